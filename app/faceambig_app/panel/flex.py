"""Other faces behind the same points: three flexibility modes at a time, in millimetres."""

from __future__ import annotations

from collections.abc import Callable

import viser

from ..fields import FIELDS, MODES
from ..state import ViewState, changed
from ..text import say
from .explore import folder
from .widgets import Change, Widgets

LETTERS = ("A", "B", "C")


def build(w: Widgets) -> viser.GuiHtmlHandle:
    """The folder; the element that says what the modes move."""
    field = FIELDS["flex"]
    with folder(w, "flex"):
        for mode, letter in enumerate(LETTERS, start=1):
            handle = w.gui.add_slider(
                say("field.flex", letter=letter), field.low, field.high, field.step, 0.0,
                hint=say("field.flex_hint"),
            )  # fmt: skip
            w.bind(handle, _millimetres(mode), _bent(mode))
        w.action("unbend")
        return w.gui.add_html("")


def _millimetres(mode: int) -> Callable[[ViewState], float]:
    return lambda state: dict(state.flex).get(mode, 0.0)


def _bent(mode: int) -> Callable[[float], Change]:
    def write(mm: float) -> Change:
        def change(state: ViewState) -> ViewState:
            others = [pair for pair in state.flex if pair[0] != mode]
            # Of a link: modes that have no slider here make room for the one that a hand moves
            return changed(state, flex=(*others[: MODES - 1], (mode, float(mm))))

        return change

    return write
