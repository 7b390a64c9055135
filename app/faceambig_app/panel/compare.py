"""Compare: faces that were kept, side by side, and how far they are from each other."""

from __future__ import annotations

from collections.abc import Callable

import viser

from ..actions import unpin, visit
from ..fields import PINS
from ..text import say
from .widgets import Change, Widgets


def build(w: Widgets) -> viser.GuiHtmlHandle:
    """The tab; the element of the list of pins and of their distances."""
    w.action("pin")
    w.action("pin_distances")
    w.action("row")
    table = w.gui.add_html("")
    for number in range(PINS):
        _build_pin(w, number)
    w.action("unpin")
    return table


def _build_pin(w: Widgets, number: int) -> None:
    """What can be done with one pin; seen while there is one."""
    does: dict[str, Callable[[int], Change]] = {say("pin.visit"): visit, say("pin.remove"): unpin}
    group = w.gui.add_button_group(say("pin.name", number=number + 1), tuple(does), visible=False)
    group.on_click(w.heard(lambda option: does[option](number)))

    def seen(here: bool) -> None:
        group.visible = here

    w.watch(lambda state: number < len(state.pins), seen)
