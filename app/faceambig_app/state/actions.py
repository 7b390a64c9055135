"""Every action of the page: name, key, and the change of the state it is. One row is a command of the palette.

Rows without a change are done by the browser: they need its history, its clipboard or time.
"""

from __future__ import annotations

import math
import random
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from .fields import FIELDS, MODES, PINS, tidy
from .viewstate import DEFAULT, ViewState, changed, names_of_pins, short

ROW_DISTANCES = (0.3, 0.6, 1.2, 2.4)  # metres, of the strip of faces
NEARER = 2 ** (-1 / 24)  # one step of the distance slider: 3 %


@dataclass(frozen=True, slots=True)
class Action:
    """Something a person can do; its words are at action.`name`."""

    name: str
    key: Any = None  # single letter, avoiding viser's W A S D Q E
    modifier: Any = None  # both as viser spells them
    change: Callable[[ViewState], ViewState] | None = None


def _set(**values: object) -> Callable[[ViewState], ViewState]:
    return lambda state: changed(state, **values)


def _scaled(factor: float) -> Callable[[ViewState], ViewState]:
    def change(state: ViewState) -> ViewState:
        low, high = FIELDS["distance"].low, FIELDS["distance"].high
        return changed(
            state, distance=min(high, max(low, round(state.distance * factor, 3))), camera="perspective"
        )  # fmt: skip

    return change


def _shown(show: str) -> Callable[[ViewState], ViewState]:
    return lambda state: changed(state, show="both" if state.show == show else show)


def _overlay(name: str) -> Callable[[ViewState], ViewState]:
    def change(state: ViewState) -> ViewState:
        rest = tuple(other for other in state.overlays if other != name)
        return changed(state, overlays=rest if name in state.overlays else (*rest, name))

    return change


def pin(state: ViewState) -> ViewState:
    """The state with its face kept; the oldest goes when there is no room, a face already kept moves to the end."""
    kept = short(state)
    named = list(zip(state.pins, names_of_pins(state), strict=True))
    name = next((name for face, name in named if face == kept), "")
    return _with_pins(state, [*(one for one in named if one[0] != kept), (kept, name)][-PINS:])


def _with_pins(state: ViewState, named: list[tuple[ViewState, str]]) -> ViewState:
    return changed(state, pins=[face for face, _ in named], pin_names=[name for _, name in named])


def pin_distances(state: ViewState) -> ViewState:
    """The state with its faces at ROW_DISTANCES kept."""
    faces = (
        changed(short(state), distance=metres, camera="perspective") for metres in ROW_DISTANCES
    )
    return changed(state, pins=tuple(faces), pin_names=(), show="row")


def unpin(number: int) -> Callable[[ViewState], ViewState]:
    """The change that lets one pin go, counted from 0."""

    def change(state: ViewState) -> ViewState:
        named = list(zip(state.pins, names_of_pins(state), strict=True))
        return _with_pins(state, named[:number] + named[number + 1 :])

    return change


def rename(number: int, name: str) -> Callable[[ViewState], ViewState]:
    """The change that names one pin, counted from 0; an empty name takes it back to its number."""

    def change(state: ViewState) -> ViewState:
        names = list(names_of_pins(state))
        if number >= len(names):  # removed meanwhile
            return state
        names[number] = tidy(name)
        return changed(state, pin_names=names)

    return change


def visit(number: int) -> Callable[[ViewState], ViewState]:
    """The change that shows the face of a pin; how it is looked at stays."""

    def change(state: ViewState) -> ViewState:
        if number >= len(state.pins):  # removed meanwhile
            return state
        kept = state.pins[number]
        names = (
            name for name, field in FIELDS.items() if field.part in ("target", "fitting", "bend")
        )
        face = {name: getattr(kept, name) for name in names if name != "model"}
        return changed(state, **face, show="both" if state.show == "row" else state.show)

    return change


def surprise(mm: float) -> Callable[[ViewState], ViewState]:
    """The change that mixes the three modes with sliders, `mm` long: another mixture every time, but of one state one.

    Its seed is the bend that was there, so the mixture is all in the state and nothing else need be kept.
    """

    def change(state: ViewState) -> ViewState:
        # Whatever the process: hash() of text is salted
        rng = random.Random(zlib.crc32(repr((state.flex_from, state.flex)).encode()))  # noqa: S311 - no secret
        mixture = [rng.gauss(0.0, 1.0) for _ in range(MODES)]
        length = math.hypot(*mixture)
        flex = [
            (state.flex_from + k, round(mm * share / length, 1)) for k, share in enumerate(mixture)
        ]
        return changed(state, flex=flex, draw=None, extreme=None)

    return change


def next_modes(state: ViewState) -> ViewState:
    """The state with sliders for the next three flexibility modes; after the last come the first."""
    first = state.flex_from + MODES
    return changed(state, flex_from=first if first + MODES - 1 <= state.modes else 1)


def other_extreme(state: ViewState) -> ViewState:
    """The state with one of the two faces farthest apart, then with the other."""
    return changed(state, extreme=2 if state.extreme == 1 else 1, draw=None)


def draw_next(state: ViewState) -> ViewState:
    """The state with the next face drawn from the posterior."""
    draw = 0 if state.draw is None else (state.draw + 1) % (int(FIELDS["draw"].high) + 1)
    return changed(state, draw=draw, extreme=None)


def _new_noise(state: ViewState) -> ViewState:
    noise = state.noise if state.noise > 0 else 1.0  # a new draw of nothing would show nothing
    return changed(state, seed=(state.seed + 1) % (int(FIELDS["seed"].high) + 1), noise=noise)


_ROWS = (
    Action("nearer", "J", change=_scaled(NEARER)),
    Action("farther", "K", change=_scaled(1 / NEARER)),
    Action("glide", "G"),
    Action("front", "F", change=_set(view="front", orbit=None)),
    Action("three_quarter", "T", change=_set(view="three_quarter", orbit=None)),
    Action("side", "P", change=_set(view="side", orbit=None)),
    Action("top", "U", change=_set(view="top", orbit=None)),
    Action("camera", "C", change=_set(view="camera", orbit=None)),
    Action("both", change=_set(show="both")),
    Action("blink", "B", change=_shown("blink")),
    Action("overlay", "O", change=_shown("overlay")),
    Action("difference", "H", change=_shown("difference")),
    Action("row", change=_shown("row")),
    Action("points", "L", change=_overlay("points")),
    Action("rays", "R", change=_overlay("rays")),
    Action("pin", "M", change=pin),
    Action("pin_distances", change=pin_distances),
    Action("unpin", change=_set(pins=())),
    Action("reset_view", "X", change=_set(view=DEFAULT.view, orbit=None, zoom=DEFAULT.zoom)),
    Action("undo", "Z", "cmd/ctrl"),
    Action("redo", "Z", "cmd/ctrl+shift"),
    Action("reset"),
    Action("unbend", change=_set(flex=(), draw=None, extreme=None)),
    Action("next_modes", change=next_modes),
    Action("surprise", change=surprise(5.0)),
    Action("extremes", change=other_extreme),
    Action("draw", change=draw_next),
    Action("new_noise", change=_new_noise),
    Action("lesson_next", "N"),
    Action("lesson_back"),
    Action("lesson_leave"),
    Action("reveal", "V"),
    Action("copy_link"),
    Action("copy_command"),
    Action("far_away", change=_set(camera="orthographic")),
)  # fmt: skip
ACTIONS: Mapping[str, Action] = {action.name: action for action in _ROWS}
