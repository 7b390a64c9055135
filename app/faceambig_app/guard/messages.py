"""Messages: what a browser may say. All else is dropped."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import msgspec
from viser.infra import _infra

from ..text import AUTO, speaking
from .door import DOOR
from .log import log_line
from .sessions import SESSION

MAX_MESSAGE = 768 * 1024  # bytes; an upload arrives in parts of 512 KiB
MAX_BAD = 40  # messages that mean nothing, before the connection is closed
SIDE = 65_536  # pixels of a canvas
MAX_NAME = 1_000  # characters of a file's name: systems allow 255 bytes

real_consumer = _infra._message_consumer
real_dispatch = _infra.WebsockMessageHandler._handle_incoming_message


async def consume(websocket: Any, handle_message: Any, message_class: Any) -> None:
    """viser's reader of one connection; ours lets through what `FIELDS` knows."""
    session = SESSION.get()
    if session is None:
        await real_consumer(websocket, handle_message, message_class)
        return
    bad = 0
    while True:
        raw = await session.read(websocket)
        try:
            message = _checked(raw, message_class, shown=session.shown)
            session.shown = True  # none else is let through before the camera
        except (ValueError, TypeError, RecursionError, msgspec.MsgspecError) as error:
            bad += 1
            if bad == 1:
                log_line(f"a message is dropped: {error}")
            if bad >= MAX_BAD:
                await websocket.close(1008, "too many bad messages")
            continue
        session.at_work += 2  # the server's handlers and the client's
        handle_message(message)


def _checked(raw: object, message_class: Any, *, shown: bool) -> Any:
    """A message as it may come; `shown`: from a browser whose first camera has come."""
    if not isinstance(raw, bytes):
        raise TypeError("text instead of bytes")
    content = msgspec.msgpack.decode(raw)
    kind = content.get("type") if isinstance(content, dict) else None
    fields = FIELDS.get(kind) if isinstance(kind, str) else None
    if fields is None:
        raise ValueError("not one that the page sends")
    if content.keys() - {"type"} != fields.keys():
        raise ValueError(f"{kind}: fields missing or unknown")
    for name, holds in fields.items():
        if not holds(content[name]):
            raise ValueError(f"{kind}: {name}")
    if not shown and kind != "ViewerCameraMessage":
        raise ValueError(f"{kind}: before the first camera")
    message = message_class.deserialize(raw)
    if kind == "ViewerCameraMessage":
        # A canvas without height has no aspect
        message.image_height = max(1, message.image_height)
        message.image_width = max(1, message.image_width)
    return message


def is_number(value: object, low: float = -1e9, high: float = 1e9) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and low <= value <= high


def _vector(value: object, size: int) -> bool:
    return isinstance(value, list) and len(value) == size and all(map(is_number, value))


def _text(value: object, most: int) -> bool:
    return isinstance(value, str) and len(value) <= most


def _count(value: object) -> bool:
    return isinstance(value, int) and is_number(value, 0, 2**53)


_name = partial(_text, most=64)


_positive = partial(is_number, low=1e-9)
_side = partial(is_number, low=0, high=SIDE)
# What a browser may say. Not here, so dropped: the public tunnel, rendered pictures, local storage.
FIELDS: Mapping[str, Mapping[str, Callable[[Any], bool]]] = {
    "ViewerCameraMessage": {
        "wxyz": partial(_vector, size=4),
        "position": partial(_vector, size=3),
        "fov": partial(is_number, low=1e-9, high=math.pi),
        "near": _positive,
        "far": _positive,
        "image_height": _side,
        "image_width": _side,
        "look_at": partial(_vector, size=3),
        "up_direction": partial(_vector, size=3),
    },
    "GuiUpdateMessage": {"uuid": _name, "updates": lambda value: isinstance(value, dict)},
    "CommandTriggerMessage": {"uuid": _name},
    # Which of them are taken: uploads.py
    "FileTransferStartUpload": {
        "source_component_uuid": _name,
        "transfer_uuid": _name,
        "filename": partial(_text, most=MAX_NAME),
        "mime_type": partial(_text, most=MAX_NAME),
        "part_count": _count,
        "size_bytes": _count,
    },
    "FileTransferPart": {
        "source_component_uuid": _name,
        "transfer_uuid": _name,
        "part_index": _count,
        "content": lambda value: isinstance(value, bytes),
    },
}


async def dispatch(self: Any, client_id: Any, message: Any) -> None:
    door = DOOR.get()
    try:
        with speaking(AUTO if door is None else door.hooks.language(int(client_id))):
            await real_dispatch(self, client_id, message)  # the tasks that it makes speak it too
    except Exception as error:
        if door is None:
            raise
        door.failed(int(client_id), error)
    finally:
        session = SESSION.get()
        if session is not None:
            session.at_work -= 1
