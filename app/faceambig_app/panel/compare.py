"""Compare: faces that were kept, side by side, and how far they are from each other."""

from __future__ import annotations

from collections.abc import Callable

import viser

from ..state import ViewState, names_of_pins
from ..state.actions import rename, unpin, visit
from ..state.fields import PIN_NAME_LENGTH, PINS
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
    remove = w.action("unpin")
    w.watch(lambda state: bool(state.pins), lambda some: setattr(remove, "visible", some))
    return table


def _build_pin(w: Widgets, number: int) -> None:
    """What can be done with one pin; seen while there is one."""
    does: dict[str, Callable[[int], Change]] = {say("pin.visit"): visit, say("pin.remove"): unpin}
    group = w.gui.add_button_group(say("pin.name", number=number + 1), tuple(does), visible=False)
    group.on_click(w.heard(lambda option: does[option](number)))
    hint = say("pin.rename_hint", most=PIN_NAME_LENGTH)
    name = w.gui.add_text(say("pin.rename", number=number + 1), "", visible=False, hint=hint)
    name.on_update(w.heard(lambda text: rename(number, text)))

    def now(state: ViewState) -> tuple[bool, str, str]:
        here = number < len(state.pins)
        # A space just typed is left for the next word
        return here, names_of_pins(state)[number] if here else "", " ".join(name.value.split())

    def seen(found: tuple[bool, str, str]) -> None:
        here, kept, typed = found
        group.visible = name.visible = here
        if typed != kept:
            name.value = kept

    w.watch(now, seen)
