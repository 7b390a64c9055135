"""Uploads: taken where the page offers one, in its size, from the browser it was offered to; kept nowhere here.

viser would take any number of files of any size for any control, and keep the last of each as the control's value.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from typing import Any

import viser
from viser import _gui_api, _gui_handles, _messages

from .door import DOOR

PART = 512 * 1024  # bytes: what viser's page sends at once
MAX_UPLOAD = 16 * 1024 * 1024  # bytes of one file, and of all that one browser sends at a time
MAX_AT_ONCE = 2  # files on their way from one browser
KEPT_NAME = 80  # characters

_real_start = _gui_api.GuiApi._handle_file_transfer_start
_real_part = _gui_api.GuiApi._handle_file_transfer_part


def add_upload(
    gui: viser.GuiApi,
    label: str,
    mime_type: str,
    heard: Callable[[str, bytes], None],
    **options: Any,
) -> viser.GuiUploadButtonHandle:
    """A button that takes a file of at most MAX_UPLOAD bytes. `heard` gets its name and bytes, on the event loop.

    The control itself keeps neither: they live as long as what `heard` does with them.
    """
    button = gui.add_upload_button(label, mime_type=mime_type, **options)

    async def uploaded(event: Any) -> None:
        file, state = event.target.value, event.target._impl
        state.value = _gui_handles.UploadedFile("", b"")
        heard(file.name, file.content)

    button.on_upload(uploaded)
    return button


def start(api: Any, client_id: Any, message: Any) -> None:
    """viser begins any transfer; ours those of a button that is there to be pressed, within the limits."""
    door = DOOR.get()
    if door is None:
        _real_start(api, client_id, message)
        return
    control = api._gui_input_handle_from_uuid.get(message.source_component_uuid)
    if not isinstance(control, _gui_handles.GuiUploadButtonHandle) or control._impl.removed:
        return
    if control.disabled or not control.visible or not control._impl.update_cb:
        return
    size, running = message.size_bytes, api._current_file_upload_states
    own = [state for state in running.values() if state["client_id"] == client_id]
    fits = sum(state["total_bytes"] for state in own) + size <= MAX_UPLOAD
    parts = -(-size // PART)
    known = message.transfer_uuid in running
    if known or not fits or len(own) >= MAX_AT_ONCE or parts != message.part_count or size == 0:
        _end(api, client_id, message)
        door.refuse(client_id, control, size, 0)
        return
    message.filename = plain_name(message.filename)
    message.mime_type = ""  # a browser's guess from the name; what a file is, is told by its bytes
    _real_start(api, client_id, message)


def part(api: Any, client_id: Any, message: Any) -> None:
    """viser takes parts from anybody, as long as they like; ours from the sender, up to the size it said."""
    state = api._current_file_upload_states.get(message.transfer_uuid)
    if DOOR.get() is not None and state is not None:
        most = min(PART, state["total_bytes"] - PART * message.part_index)
        if state["client_id"] != client_id or len(message.content) != most:
            return
    _real_part(api, client_id, message)


def _end(api: Any, client_id: Any, message: Any) -> None:
    """Tell the page that the transfer is over, nothing of it taken: its button waits for that."""
    client = api._resolve_client(client_id)
    if client is None:
        return
    done = partial(
        _messages.FileTransferPartAck, message.source_component_uuid, message.transfer_uuid
    )
    client._websock_connection.queue_message(done(0, 0))


def plain_name(name: str) -> str:
    """The last part of a path, of letters that can stand anywhere."""
    last = re.split(r"[/\\\\]", name)[-1]
    plain = re.sub(r"[^\w .()+-]", "_", last).strip(" .")
    return plain[-KEPT_NAME:] or "file"
