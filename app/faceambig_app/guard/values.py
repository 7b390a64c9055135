"""Values of controls: right ones are set, others are put back and said."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Iterable
from functools import partial
from typing import Any

import viser
from viser import _gui_api, _gui_handles, _messages

from .door import DOOR, Door, Held
from .messages import is_number
from .reports import take_report

MAX_TEXT = 10_000  # characters typed into one field
TYPING = 0.8  # seconds: on the way to "120" the field sends 1 and 12, which are not meant

_real_update = _gui_api.GuiApi._handle_gui_updates


async def update(api: Any, client_id: Any, message: Any) -> None:
    """viser sets any attribute to anything; ours sets values that the control may have."""
    door = DOOR.get()
    if door is None:
        await _real_update(api, client_id, message)
        return
    control = api._gui_input_handle_from_uuid.get(message.uuid)
    if control is None or control._impl.removed:
        return
    if take_report(door, client_id, control, message.updates):
        return
    before = door.held.pop((client_id, message.uuid), None)
    _typed.discard(message.uuid)
    if before is not None:
        before.timer.cancel()
    if (
        message.updates.keys() != {"value"}
        or getattr(control, "disabled", True)
        or not control.visible
    ):
        _put_back(api, client_id, control)
        return
    asked = message.updates["value"]
    put, why = _nearest(control, asked)
    if why == "":
        message.updates["value"] = put
        await _real_update(api, client_id, message)
        # Leaving the field, the browser puts the nearest value itself; a longer or shorter one is still typing.
        if before is not None and put == before.put and not _typing(before.asked, put):
            door.refuse(client_id, control, before.asked, put)
    elif why == "range":
        settle = partial(_settle, door, api, client_id, control, message)
        timer = api._event_loop.call_later(TYPING, lambda: _task(settle()))
        door.held[client_id, message.uuid] = Held(asked, put, timer)
        _typed.add(message.uuid)
    else:
        _put_back(api, client_id, control)
        door.refuse(client_id, control, asked, put)


async def _settle(door: Door, api: Any, client_id: Any, control: Any, message: Any) -> None:
    """Nobody types any more: the nearest value is set, and said."""
    held = door.held.pop((client_id, message.uuid), None)
    _typed.discard(message.uuid)
    if held is None or control._impl.removed:
        return
    message.updates["value"] = held.put
    try:
        await _real_update(api, client_id, message)
    except Exception as error:  # noqa: BLE001 - the page's handler
        door.failed(client_id, error)
    _put_back(api, client_id, control)
    door.refuse(client_id, control, held.asked, held.put)


_typed: set[str] = set()  # fields in which half a number stands
_tasks: set[asyncio.Task[None]] = set()  # asyncio forgets tasks that nobody holds


def _task(work: Any) -> None:
    task = asyncio.get_running_loop().create_task(work)
    _tasks.add(task)
    task.add_done_callback(_tasks.discard)


def _put_back(api: Any, client_id: Any, control: Any) -> None:
    """The value that counts, to the browser that has another one."""
    client = api._resolve_client(client_id)
    if client is not None and not control._impl.is_button:
        message = _messages.GuiUpdateMessage(control._impl.uuid, {"value": control.value})
        client._websock_connection.queue_message(message)
        client.flush()


def restate(client: viser.ClientHandle, controls: Iterable[Any]) -> None:
    """Send the values of controls once more.

    A value of ours that crosses an older one of the browser's on the way is shown there and is wrong here; saying it
    once more when nobody moves ends the disagreement. A field that is being typed into keeps what stands there.
    """
    for control in controls:
        if control._impl.uuid in _typed:
            continue
        message = _messages.GuiUpdateMessage(control._impl.uuid, {"value": control.value})
        client._websock_connection.queue_message(message)


def _typing(first: object, second: object) -> bool:
    a, b = f"{first:g}", f"{second:g}"
    return a.startswith(b) or b.startswith(a)


def _nearest(control: Any, asked: Any) -> tuple[Any, str]:
    """The value to set instead, and why: "" (asked is right), "range" (a number beyond its bounds) or "kind"."""
    value, props = control.value, control._impl.props
    if isinstance(control, _gui_handles.GuiButtonHandle | _gui_handles.GuiCheckboxHandle):
        return (asked, "") if isinstance(asked, bool) else (value, "kind")
    if isinstance(control, _gui_handles.GuiDropdownHandle | _gui_handles.GuiButtonGroupHandle):
        return (asked, "") if asked in tuple(props.options) else (value, "kind")
    if isinstance(control, _gui_handles.GuiTextHandle):
        return (asked, "") if _readable(asked) else (value, "kind")
    if isinstance(control, _gui_handles.GuiSliderHandle | _gui_handles.GuiNumberHandle):
        if not is_number(asked, -math.inf, math.inf) or math.isinf(asked):
            return value, "kind"
        put = _clamped(asked, props.min, props.max, whole=isinstance(value, int))
        # The browser counts steps in doubles: a hair beyond the end is the end
        return put, "" if math.isclose(put, asked, rel_tol=1e-9, abs_tol=1e-9) else "range"
    if isinstance(value, tuple) and not isinstance(control, _gui_handles.GuiUploadButtonHandle):
        return (tuple(asked), "") if _tuple_allowed(control, asked) else (value, "kind")
    return value, "kind"


def _clamped(asked: float, low: float | None, high: float | None, *, whole: bool) -> float:
    put = round(asked) if whole else asked
    if low is not None:
        put = max(put, low)
    return put if high is None else min(put, high)


def _readable(asked: object) -> bool:
    return (
        isinstance(asked, str)
        and len(asked) <= MAX_TEXT
        and not any(ord(c) < 32 and c not in "\n\t" for c in asked)
    )


def _tuple_allowed(control: Any, asked: Any) -> bool:
    """Vectors, colours and several thumbs on a slider: as many numbers as now, each in its bounds."""
    value, props = control.value, control._impl.props
    if not (isinstance(asked, list | tuple) and len(asked) == len(value)):
        return False
    if not all(is_number(x) for x in asked):
        return False
    low, high = getattr(props, "min", None), getattr(props, "max", None)
    if isinstance(control, _gui_handles.GuiRgbHandle | _gui_handles.GuiRgbaHandle):
        low, high = 0, 255
    lows, highs = (b if isinstance(b, list | tuple) else [b] * len(value) for b in (low, high))
    if isinstance(control, _gui_handles.GuiMultiSliderHandle) and list(asked) != sorted(asked):
        return False
    return all(
        x == _clamped(x, a, b, whole=isinstance(v, int))
        for x, a, b, v in zip(asked, lows, highs, value, strict=True)
    )
