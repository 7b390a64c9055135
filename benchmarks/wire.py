"""A browser without pictures: speaks with the page over its websocket as the page's script does, and keeps count."""

from __future__ import annotations

import html
import json
import re
import socket
import struct
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import msgspec
import zstandard
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": (1.0, 0.0, 0.0, 0.0), "position": (0.0, 0.0, 3.0), "fov": 1.0, "near": 0.01,
    "far": 100.0, "image_height": 600, "image_width": 800, "look_at": (0.0, 0.0, 0.0), "up_direction": (0.0, 1.0, 0.0),
}  # fmt: skip
DATA = re.compile(r'<div hidden data-faceambig="(\w+)" data-json="([^"]*)"></div>')


class Wire:
    """One connection to the page at 127.0.0.1. Nothing is read but in `read` and in what waits."""

    def __init__(self, port: int, query: str = "", cookie: str = "") -> None:
        self._query = query
        self.controls: dict[str, dict[str, Any]] = {}  # by uuid: the message that made it
        self.values: dict[str, Any] = {}  # by uuid, as this browser would show them
        self.told: dict[str, Any] = {}  # what our script was told last, by kind
        self.notices: list[str] = []
        self.commands: list[str] = []  # uuids
        self.meshes = 0  # messages that carried vertices
        self.bytes = 0  # received
        self._html: dict[str, str] = {}
        self._greeted = False
        self._socket: ClientConnection = connect(
            f"ws://127.0.0.1:{port}/",
            subprotocols=[Subprotocol("viser-v1.1.1")],
            origin=f"http://127.0.0.1:{port}",  # pyright: ignore[reportArgumentType] - a plain str to websockets
            compression=None,
            additional_headers={"Cookie": cookie} if cookie else None,
            proxy=None,
            max_size=None,
            ping_interval=None,  # a browser sends none
        )
        self.send(CAMERA)

    # ---------------------------------------------------------------- what a person does

    def send(self, message: dict[str, Any] | bytes) -> None:
        """A message, or bytes as they are."""
        self._socket.send(
            message if isinstance(message, bytes) else msgspec.msgpack.encode(message)
        )

    def set(self, uuid: str, value: Any) -> None:
        """Move a control."""
        self.values[uuid] = value
        self.send({"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": value}})

    def report(self, **what: Any) -> None:
        """A report of our script."""
        self.set(self.told["report"]["uuid"], json.dumps(what))

    def trigger(self, uuid: str) -> None:
        """A command of the palette."""
        self.send({"type": "CommandTriggerMessage", "uuid": uuid})

    def control(self, kind: str, label: str) -> str:
        """As `find`; LookupError where there is none."""
        found = self.find(kind, label)
        if found is None:
            raise LookupError(f"no {kind} {label!r}")
        return found

    def find(self, kind: str, label: str) -> str | None:
        """The uuid of a control by its kind, as "Slider", and the start of its label; one that can be seen, if any."""
        named = [
            made
            for made in self.controls.values()
            if made["type"] == f"Gui{kind}Message" and made["props"]["label"].startswith(label)
        ]
        seen = (made["uuid"] for made in named if made["props"]["visible"])
        return next(seen, named[0]["uuid"] if named else None)

    # ---------------------------------------------------------------- what comes

    def read(self, seconds: float = 0.02) -> None:
        """Take in what comes, until nothing has come for so long."""
        while self._take(seconds):
            pass

    def wait(self, holds: Callable[[], Any], seconds: float) -> bool:
        """Take in what comes until something holds; whether it does in time."""
        end = time.monotonic() + seconds
        while not holds():
            left = end - time.monotonic()
            if left <= 0:
                return False
            self._take(min(left, 0.2))
        return True

    def rests(self, seconds: float) -> bool:
        """Wait for the first full frame: then the page's address is told."""
        return self.wait(lambda: "address" in self.told, seconds)

    @property
    def shown(self) -> str:
        """All that the elements of the page show now, as HTML."""
        return "".join(self._html.values())

    @property
    def query(self) -> str | None:
        """What the address bar shows; None before the first frame."""
        return self.told["address"]["query"] if "address" in self.told else None

    def close(self) -> None:
        """Leave as a browser does."""
        self._socket.close()

    def vanish(self) -> None:
        """Leave as a laptop without a network does: the connection is reset."""
        raw = self._socket.socket
        raw.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        # shutdown() wakes the thread that reads; with a lingering time of 0 the rest is a reset
        with suppress(OSError):  # it has gone already
            raw.shutdown(socket.SHUT_RD)
        raw.close()

    def _take(self, seconds: float) -> bool:
        try:
            frame = self._socket.recv(timeout=seconds)
        except TimeoutError:
            return False
        assert isinstance(frame, bytes)
        self.bytes += len(frame)
        size, packed = struct.unpack_from("<QQ", frame)
        content = zstandard.ZstdDecompressor().decompress(frame[16 : 16 + packed], size)
        for message in msgspec.msgpack.decode(content)["messages"]:
            self._hear(message)
        return True

    def _hear(self, message: dict[str, Any]) -> None:
        kind = message["type"]
        if kind == "GuiHtmlMessage":
            self._show(message["uuid"], message["props"]["content"])
        elif kind == "GuiUpdateMessage":
            updates = message["updates"]
            if "content" in updates:
                self._show(message["uuid"], updates["content"])
            if "value" in updates:
                self.values[message["uuid"]] = updates["value"]
            if message["uuid"] in self.controls:
                props = self.controls[message["uuid"]]["props"]
                props.update({name: new for name, new in updates.items() if name in props})
        elif kind.startswith("Gui") and "props" in message and "value" in message:
            self.controls[message["uuid"]] = message
            self.values[message["uuid"]] = message["value"]
        elif kind == "GuiButtonMessage":
            self.controls[message["uuid"]] = message
        elif kind == "GuiRemoveMessage":
            self.controls.pop(message["uuid"], None)
        elif kind == "RegisterCommandMessage":
            self.commands.append(message["uuid"])
        elif kind == "NotificationShowMessage":
            self.notices.append(message["props"]["body"])
        elif kind == "MeshMessage" or (
            kind == "SceneNodeUpdateMessage" and "vertices" in message["updates"]
        ):
            self.meshes += 1

    def _show(self, uuid: str, content: str) -> None:
        self._html[uuid] = content
        for name, data in DATA.findall(content):
            self.told[name] = json.loads(html.unescape(data))
        if "report" in self.told and not self._greeted:
            self._greeted = True
            self.report(
                hello={
                    "query": self._query, "reduced_motion": False, "touch": False, "dark": False,
                    "theme": None, "text": None,
                }
            )  # fmt: skip


GONE = (ConnectionClosed, OSError, EOFError)
