"""What is under the pointer: the millimetres that a head's colours mean at one vertex, in words."""

from __future__ import annotations

import math

from faceambig.compose import LEGENDS, shown_surface

from .state import ViewState
from .text import NARROW, numeral, say


def surface(state: ViewState) -> str:
    """The surface that is drawn of a state; a row has its own."""
    if state.show == "row":
        return "difference"
    return shown_surface(state.surface, state.show, state.hide)


def has_values(state: ViewState) -> bool:
    """Whether the colours of a state's heads are numbers that may be told."""
    return surface(state) in LEGENDS and "numbers" not in state.hide


def words(state: ViewState, mm: float | None) -> str:
    """The value at a vertex as a state means it; NaN: not measured. Empty for None, a head without values."""
    if mm is None or not has_values(state):
        return ""
    if math.isnan(mm):
        return say("under.unmeasured")
    size = numeral(f"{abs(mm):.1f}{NARROW}mm")
    match surface(state):
        case "depth":
            if size == f"0.0{NARROW}mm":
                return say("under.level", mm=size)
            return say("under.nearer", mm=size) if mm > 0 else say("under.farther", mm=size)
        case "spread":
            return say("under.spread", mm=size)
        case _ if state.subject == "photo":
            return say("under.to_reference", mm=size, reference=say("own.reference"))
        case _:
            return say("under.difference", mm=size)
