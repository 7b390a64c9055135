"""Reports of our script: what it says through one hidden text control, as it comes and in order."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import viser

from .door import Door
from .log import log_line

MAX_REPORT = 8192  # characters: an address of 7000 among them

_LISTENER = "faceambig_listener"  # on viser's record of the control, so that it goes with it


@dataclass
class _Listener:
    heard: Callable[[str], None]
    warned: bool = False


def add_reports(gui: viser.GuiApi, heard: Callable[[str], None]) -> viser.GuiTextHandle:
    """The control of a browser by which our script reports; `data_html("report", {"uuid": ...})` tells it which.

    `heard` is called with each report on the event loop, in the order in which they were sent, none left out, and must
    not wait. Texts longer than MAX_REPORT are dropped; the first is logged. The control itself is never drawn and
    keeps no value.
    """
    control = gui.add_text("", "", visible=False)
    setattr(control._impl, _LISTENER, _Listener(heard))
    return control


def take_report(door: Door, client_id: int, control: Any, updates: dict[str, Any]) -> bool:
    """Whether the control is one for reports; then it has been heard."""
    listener = getattr(control._impl, _LISTENER, None)
    if listener is None:
        return False
    text = updates.get("value")
    if updates.keys() != {"value"} or not isinstance(text, str) or len(text) > MAX_REPORT:
        if not listener.warned:
            log_line(f"a report is dropped: not a text of at most {MAX_REPORT} characters")
        listener.warned = True
        return True
    try:
        listener.heard(text)
    except Exception as error:  # noqa: BLE001 - the page's own code
        door.failed(client_id, error)
    return True
