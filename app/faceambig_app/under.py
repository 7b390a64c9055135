"""What is under the pointer: the millimetres that a head's colours mean at one vertex, in words."""

from __future__ import annotations

import math
from collections.abc import Callable

from faceambig.compose import LEGENDS, shown_surface

from .script import Probe, Script
from .state import ViewState
from .text import NARROW, numeral, say


class Pointer:
    """What one browser's pointer may read, and has read. `value` finds the number of a head's vertex as it is drawn."""

    def __init__(self, script: Script, value: Callable[[str, int], float | None]) -> None:
        self.settled: ViewState | None = None  # the state drawn in full last
        self._script, self._value = script, value
        self._on = False  # whether the page may ask
        self._told = ""

    def asks(self, probe: Probe, state: ViewState) -> None:
        """Say what is under the pointer; nothing while what is drawn is not yet what the state says."""
        mm = self._value(probe.head, probe.vertex) if state == self.settled else None
        self._told = words(state, mm)
        self._script.probed(probe.n, self._told)

    def moved(self, before: ViewState, now: ViewState) -> None:
        """Let the pointer read numbers where colours are some; what it has read of another state holds no more."""
        if self._told and now != before:
            self._told = ""
            self._script.probed(0, "")
        if has_values(now) != self._on:
            self._on = not self._on
            self._script.probe(self._on)


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
