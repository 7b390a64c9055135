"""A small guarded page, and a browser that speaks viser's protocol without drawing, for tests of the guard."""

from __future__ import annotations

import contextlib
import http.client
import itertools
import socket
import struct
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import msgspec
import viser
import zstandard
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

from faceambig_app import guard
from faceambig_app.guard import log

SOON = 5.0  # seconds: other tests share the processors
CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": (1.0, 0.0, 0.0, 0.0),
    "position": (0.0, 0.0, 3.0),
    "fov": 1.0,
    "near": 0.01,
    "far": 100.0,
    "image_height": 600,
    "image_width": 800,
    "look_at": (0.0, 0.0, 0.0),
    "up_direction": (0.0, 0.0, 1.0),
}


MARKS = itertools.count(100.0)


def until(holds: Callable[[], Any], seconds: float = SOON) -> Any:
    """The first true value of `holds`, or its last one."""
    end = time.monotonic() + seconds
    while not (value := holds()) and time.monotonic() < end:
        time.sleep(0.01)
    return value


class Browser:
    """Speaks viser's protocol as the page does, without drawing."""

    def __init__(
        self,
        port: int,
        camera: bool = True,
        host: str = "127.0.0.1",
        uri: str | None = None,
        **options: Any,
    ) -> None:
        options = {
            "compression": None,
            "origin": f"http://{host}:{port}",
            "proxy": None,
        } | options
        self.socket: ClientConnection = connect(
            uri or f"ws://{host}:{port}/",
            subprotocols=[Subprotocol("viser-v1.1.1")],
            max_size=None,
            **options,
        )
        self.messages: list[dict[str, Any]] = []  # all that were sent to it
        self.values: dict[str, Any] = {}  # of controls, as this browser would show them
        self.mark = next(MARKS)  # by which it is found among the clients
        if camera:
            self.send(CAMERA | {"far": self.mark})

    def send(self, message: object) -> None:
        self.socket.send(message if isinstance(message, bytes) else msgspec.msgpack.encode(message))

    def set(self, control: Any, value: object) -> None:
        self.values[control._impl.uuid] = value
        self.update(control, value=value)

    def update(self, control: Any, **updates: object) -> None:
        self.send({"type": "GuiUpdateMessage", "uuid": control._impl.uuid, "updates": updates})

    def read(self, seconds: float = 0.05) -> None:
        """Takes in what has come, until nothing comes for some time."""
        while True:
            try:
                frame = self.socket.recv(timeout=seconds)
            except TimeoutError:
                return
            assert isinstance(frame, bytes)
            size, packed = struct.unpack_from("<QQ", frame)
            content = zstandard.ZstdDecompressor().decompress(frame[16 : 16 + packed], size)
            for message in msgspec.msgpack.decode(content)["messages"]:
                self.messages.append(message)
                if message["type"] == "GuiUpdateMessage" and "value" in message["updates"]:
                    self.values[message["uuid"]] = message["updates"]["value"]

    def shows(self, control: Any) -> Any:
        self.read()
        return self.values.get(control._impl.uuid)

    def __enter__(self) -> Browser:
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()


@dataclass
class Tiny:
    server: viser.ViserServer
    cookie: dict[str, str] = field(default_factory=dict)  # of who has come by the link
    refused: list[tuple[int, str]] = field(default_factory=list)
    errors: list[tuple[int | None, str]] = field(default_factory=list)
    files: list[tuple[str, bytes]] = field(default_factory=list)
    clients: dict[int, dict[str, Any]] = field(default_factory=dict)

    @property
    def port(self) -> int:
        return self.server.get_port()

    @property
    def netloc(self) -> str:
        return f"{self.host}:{self.port}"

    @property
    def host(self) -> str:
        return self.server.get_host()

    @property
    def sessions(self) -> int:
        """Browsers that the server still holds."""
        return len(self.server._websock_server._live_connections)

    def forget(self) -> None:
        log.LINES.clear()
        for told in (self.refused, self.errors, self.files):
            told.clear()

    def get(self, target: str = "/", **headers: str) -> tuple[http.client.HTTPResponse, bytes]:
        connection = http.client.HTTPConnection(self.host, self.port, timeout=SOON)
        connection.putrequest("GET", target, skip_host="Host" in headers, skip_accept_encoding=True)
        for name, value in (self.cookie | headers).items():
            connection.putheader(name.replace("_", "-"), value)
        connection.endheaders()
        with contextlib.closing(connection):
            answer = connection.getresponse()
            return answer, answer.read()

    @contextlib.contextmanager
    def browser(self, **options: Any) -> Iterator[tuple[Browser, dict[str, Any]]]:
        """A browser and the controls that it has got."""
        with Browser(
            self.port, host=self.host, additional_headers=self.cookie, **options
        ) as browser:
            mine = until(
                lambda: [c for c in list(self.clients.values()) if c["mark"] == browser.mark]
            )
            yield browser, mine[0]

    def works(self) -> None:
        """A good browser is served; within a second, on a machine that is not busy."""
        with self.browser() as (browser, controls):
            browser.set(controls["steps"], 11)
            assert until(lambda: controls["steps"].value == 11)
        assert until(lambda: not self.sessions)


def made(gui: viser.GuiApi) -> dict[str, Any]:
    return {
        "slider": gui.add_slider("Distance", 20.0, 300.0, 0.5, 120.0),
        "steps": gui.add_slider("Steps", 0, 96, 1, 50),
        "number": gui.add_number("Typed", 120.0, min=20.0, max=300.0),
        "on": gui.add_checkbox("On", True),
        "text": gui.add_text("Name", "Anna"),
        "view": gui.add_dropdown("View", ("front", "side"), initial_value="front"),
        "show": gui.add_button_group("Show", ("both", "one")),
        "press": gui.add_button("Press"),
        "size": gui.add_vector3("Size", (1.0, 2.0, 3.0), min=(0.0, 0.0, 0.0), max=(9.0, 9.0, 9.0)),
        "tint": gui.add_rgb("Tint", (1, 2, 3)),
        "range": gui.add_multi_slider("Range", 0.0, 1.0, 0.1, (0.2, 0.8)),
        "upload": gui.add_upload_button("Photo"),
        "off": gui.add_slider("Disabled", 0, 9, 1, 5, disabled=True),
        "gone": gui.add_slider("Hidden", 0, 9, 1, 5, visible=False),
        "done": gui.add_progress_bar(30.0),
    }


@contextlib.contextmanager
def tiny_page(host: str = "127.0.0.1", **options: Any) -> Iterator[Tiny]:
    """A page with one control of each kind for every browser; `options` are those of `guard.start`."""
    page = Tiny(
        guard.start(
            host,
            0,
            **options,
            keys=("distance", "view"),
            hooks=guard.Hooks(
                words=lambda control, asked, put: f"{control.label}: {asked!r}, set to {put!r}",
                on_refused=lambda client, words: page.refused.append((client, words)),
                on_error=lambda client, error: page.errors.append((client, str(error))),
            ),
        )
    )

    async def enter(client: viser.ClientHandle) -> None:
        controls = made(client.gui)

        async def breaks(_event: object) -> None:
            raise ValueError("in the loop")

        def breaks_in_a_thread(_event: object) -> None:
            raise ValueError("in a thread")

        controls["take"] = guard.add_upload(
            client.gui, "Take", "image/png", lambda name, data: page.files.append((name, data))
        )
        controls["press"].on_click(breaks)
        controls["view"].on_update(breaks_in_a_thread)
        page.clients[client.client_id] = controls | {"client": client, "mark": client.camera.far}

    page.server.on_client_connect(enter)
    if (token := options.get("token")) is not None:
        answer, _ = page.get(f"/?token={token}")
        page.cookie = {"Cookie": answer.headers["Set-Cookie"].partition(";")[0]}
    yield page
    page.server.stop()


PART = 512 * 1024


def begin(
    control: Any, transfer: str, size: int, *, name: str = "me.png", parts: int | None = None
) -> dict[str, Any]:
    count = -(-size // PART) if parts is None else parts
    return {
        "type": "FileTransferStartUpload", "source_component_uuid": control._impl.uuid, "transfer_uuid": transfer,
        "filename": name, "mime_type": "image/png", "part_count": count, "size_bytes": size,
    }  # fmt: skip


def piece(control: Any, transfer: str, index: int, content: bytes) -> dict[str, Any]:
    return {
        "type": "FileTransferPart", "source_component_uuid": control._impl.uuid, "transfer_uuid": transfer,
        "part_index": index, "content": content,
    }  # fmt: skip


def on_the_way(client: Any) -> int:
    """Bytes held of files that are being sent."""
    states = client.gui._current_file_upload_states.values()
    return sum(len(part) for state in states for part in state["parts"].values())


def raw(tiny: Tiny, camera: bool = True) -> socket.socket:
    """A websocket by hand, which reads nothing unless told to."""
    connection = socket.socket()
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    connection.connect((tiny.host, tiny.port))
    lines = (
        "GET / HTTP/1.1", f"Host: {tiny.netloc}", "Connection: Upgrade", "Upgrade: websocket",
        "Sec-WebSocket-Version: 13", "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
        "Sec-WebSocket-Protocol: viser-v1.1.1",
    )  # fmt: skip
    connection.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
    connection.settimeout(SOON)
    answer = b""
    while not answer.endswith(b"\r\n\r\n"):
        answer += connection.recv(1)
    assert answer.startswith(b"HTTP/1.1 101")
    if camera:
        connection.sendall(framed(msgspec.msgpack.encode(CAMERA)))
    return connection


def framed(data: bytes, first: int = 0x82) -> bytes:
    """A frame as a client sends it, its mask all zeros."""
    size = len(data)
    length = bytes([0x80 | size]) if size < 126 else struct.pack(">BH", 0x80 | 126, size)
    return bytes([first]) + length + bytes(4) + data
