"""Tab: what a browser says to the page and hears from it, without a browser. viser's protocol over a websocket.

To the server one msgpack map a frame. From it two lengths (plain, packed), a zstd-packed msgpack map of messages, and
the arrays they name by number, each at a multiple of eight bytes.
"""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import msgspec
import numpy as np
import zstandard
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed
from websockets.typing import Origin, Subprotocol

VISER = "viser-v1.1.1"
ROWS = 64  # vertices of a mesh by which it is known again
CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": [1.0, 0.0, 0.0, 0.0], "position": [0.0, 0.0, 1.0], "fov": 0.8, "near": 0.01,
    "far": 1000.0, "image_height": 800, "image_width": 1280, "look_at": [0.0, 0.0, 0.0],
    "up_direction": [0.0, 1.0, 0.0],
}  # fmt: skip


class Mesh(NamedTuple):
    """The arrival of a mesh."""

    at: float  # seconds, perf_counter
    node: str
    n_vertices: int
    rows: np.ndarray  # (64 * 3,) metres: vertices spread over the mesh


@dataclass
class Control:
    """A control as this tab shows it."""

    uuid: str
    value: Any
    props: dict[str, Any]


@dataclass(eq=False)
class Tab:
    """One connection; `async with opened(address)` makes it."""

    socket: ClientConnection
    controls: dict[str, Control] = field(default_factory=dict)  # by label
    meshes: list[Mesh] = field(default_factory=list)
    geometry: dict[str, np.ndarray] = field(default_factory=dict)  # node -> (V * 3,) as it is now
    sizes: Counter[str] = field(default_factory=Counter)  # bytes by kind of message
    notices: list[str] = field(default_factory=list)
    lost: str = ""  # why the connection ended before it was closed
    reading: bool = True
    _labels: dict[str, str] = field(default_factory=dict)  # uuid -> label
    _news: asyncio.Event = field(default_factory=asyncio.Event)

    async def set(self, label: str, value: float) -> float:
        """Change a control as a browser does; the time just before it is sent."""
        control = self.controls[label]
        control.value = value
        at = time.perf_counter()
        await self.say("GuiUpdateMessage", uuid=control.uuid, updates={"value": value})
        return at

    async def say(self, kind: str, **fields: Any) -> None:
        """Send one message."""
        await self.socket.send(msgspec.msgpack.encode({"type": kind, **fields}))

    async def until(self, holds: Callable[[], Any], seconds: float) -> bool:
        """Wait until something holds that a message may change; False if it does not in time."""
        end = time.perf_counter() + seconds
        while not holds():
            left = end - time.perf_counter()
            if left <= 0 or self.lost:
                return False
            self._news.clear()
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._news.wait(), min(left, 0.1))
        return True

    async def quiet(self, seconds: float, patience: float) -> None:
        """Wait until no mesh has come for some time, at most `patience` seconds."""
        start = time.perf_counter()
        await self.until(
            lambda: (
                time.perf_counter() - max(start, self.meshes[-1].at if self.meshes else 0.0)
                >= seconds
            ),
            patience,
        )

    async def listen(self) -> None:
        """Take in what comes, until the connection ends."""
        try:
            while True:
                raw = await self.socket.recv(decode=False)
                self._take(raw, time.perf_counter())
                self._news.set()
        except ConnectionClosed as error:
            self.lost = f"the connection was closed: {error}"
            self._news.set()

    def _take(self, raw: bytes, now: float) -> None:
        packed = int.from_bytes(raw[8:16], "little")
        plain = zstandard.decompress(raw[16 : 16 + packed])
        body = msgspec.msgpack.decode(plain)
        arrays = list(_arrays(raw, 16 + packed, body.get("binaryBufferLengths", ())))
        sizes = [_size(message) for message in body["messages"]]
        share = (packed + 16) / max(1, sum(sizes))  # of the packed part, each by its own length
        for message, size in zip(body["messages"], sizes, strict=True):
            props = message.get("updates") or message.get("props") or {}
            own = sum(len(arrays[value["__binary_index"]]) for value in _named(props))
            self.sizes[_kind(message, props)] += round(share * size) + own
            self._hear(message, props, arrays, now)

    def _hear(
        self, message: dict[str, Any], props: Any, arrays: list[memoryview], now: float
    ) -> None:
        kind, name = message["type"], message.get("name")
        if name is not None and isinstance(props.get("vertices"), dict):
            told = props["vertices"]
            array = np.frombuffer(arrays[told["__binary_index"]], dtype=told["dtype"])
            self.geometry[name] = array
            self.meshes.append(Mesh(now, name, len(array) // 3, rows_of(array)))
        elif kind == "GuiUpdateMessage":
            control = self.controls.get(self._labels.get(message["uuid"], ""))
            if control is not None:
                control.value = props.get("value", control.value)
                control.props.update(props)
        elif kind == "RemoveSceneNodeMessage":
            self.geometry.pop(message["name"], None)
        elif kind == "NotificationShowMessage":
            self.notices.append(str(props.get("body")))
        elif kind.startswith("Gui") and "value" in message and props.get("label"):
            label = props["label"]
            self.controls[label] = Control(message["uuid"], message["value"], dict(props))
            self._labels[message["uuid"]] = label


def _arrays(raw: bytes, at: int, lengths: list[int]) -> Iterator[memoryview]:
    view = memoryview(raw)
    for length in lengths:
        at += -at % 8
        yield view[at : at + length]
        at += length


def rows_of(array: np.ndarray) -> np.ndarray:
    """Some vertices of a mesh (V * 3,), spread over it: (192,)."""
    vertices = array.reshape(-1, 3)
    return vertices[np.linspace(0, len(vertices) - 1, ROWS).astype(int)].astype(float).ravel()


def _named(props: dict[str, Any]) -> Iterator[dict[str, Any]]:
    return (v for v in props.values() if isinstance(v, dict) and "__binary_index" in v)


def _size(message: dict[str, Any]) -> int:
    return len(msgspec.msgpack.encode(message))


def _kind(message: dict[str, Any], props: dict[str, Any]) -> str:
    kind = message["type"].removesuffix("Message")
    if kind in ("SceneNodeUpdate", "GuiUpdate"):
        return f"{kind} {'+'.join(sorted(props))}"
    return kind


@contextlib.asynccontextmanager
async def opened(address: str, first: str = "/fit", patience: float = 60.0, cookie: str = ""):
    """A tab that has its controls and the first meshes below the node `first`."""
    async with connect(
        address.replace("http", "ws", 1), subprotocols=[Subprotocol(VISER)], origin=Origin(address.rstrip("/")),
        compression=None, max_size=None, ping_interval=None, proxy=None, open_timeout=patience,
        additional_headers={"Cookie": cookie} if cookie else None,
    ) as socket:  # fmt: skip
        tab = Tab(socket)
        listener = asyncio.create_task(tab.listen())
        try:
            await socket.send(msgspec.msgpack.encode(CAMERA))
            there = await tab.until(
                lambda: any(name.startswith(f"{first}/") for name in tab.geometry), patience
            )
            if not there:
                raise TimeoutError(f"{address}: no mesh below {first} in {patience:g} s {tab.lost}")
            yield tab
        finally:
            listener.cancel()
