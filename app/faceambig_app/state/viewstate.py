"""ViewState: everything a person can set, as one frozen value. The table of its fields is in fields.py.

The state falls into four parts, each the key of one cached step of the pipeline: Target -> Fitting -> Bend -> Look.
States that mean the same are equal: every value is brought into its canonical form when a state is made.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from operator import attrgetter
from typing import Any, NamedTuple, TypeVar

import msgspec

from .fields import FIELDS, PINS, canonical

__all__ = [
    "DEFAULT", "VERSION", "Bend", "Fitting", "Look", "Target", "ViewState",
    "changed", "for_eyes_of", "names_of_pins", "short",
]  # fmt: skip

VERSION = 1  # of the format of links and files


class Target(NamedTuple):
    """What was photographed, and how: the key of an observation."""

    model: str
    subject: int | str  # counted from 1, or "photo"
    actual: float
    yaw: float
    pitch: float
    roll: float
    scheme: str
    noise: float
    seed: int
    data: str


class Fitting(NamedTuple):
    """What the fit assumes: with a Target, the key of a fit. distance None is the far-away camera."""

    distance: float | None
    modes: int
    prior: float
    box: float


class Bend(NamedTuple):
    """How the fitted face is bent: (mode, mm) along flexibility modes; or which posterior face stands for it."""

    flex: tuple[tuple[int, float], ...]
    flex_at: str
    draw: int | None
    extreme: int | None  # goes before a draw, and both before flex: each stands for the whole face


class Look(NamedTuple):
    """What is drawn of it."""

    show: str
    surface: str
    view: str
    orbit: tuple[float, float] | None
    zoom: float
    overlays: tuple[str, ...]
    error_scale: int
    fade: float
    hide: tuple[str, ...]


_P = TypeVar("_P", Target, Bend, Look)


class ViewState(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True
):
    """Everything a person can set. `prior` is the noise the fit assumes, `noise` what observe adds."""

    v: int = VERSION
    model: str = "embedded"
    # Of the ten, the face that shows the effect best: d_S 1.0 mm at 30 cm, 4.1 mm at 120 cm
    subject: int | str = 2
    actual: float = 0.3  # metres, where the photo was taken from
    distance: float = 1.2  # metres, assumed by the fit
    camera: str = "perspective"
    yaw: float = 0.0  # degrees, pose of the head in the photo
    pitch: float = 0.0
    roll: float = 0.0
    scheme: str = "ibug68"
    data: str = "points"
    noise: float = 0.0  # % of the eye distance, added to the points
    seed: int = 0
    modes: int = 70
    prior: float = 1.0  # % of the eye distance, noise the fit assumes
    box: float = 2.0  # standard deviations
    flex: tuple[tuple[int, float], ...] = ()  # (mode from 1, mm of mean surface change)
    flex_at: str = "reprojection"
    draw: int | None = None
    extreme: int | None = None
    flex_from: int = 1  # the first of the modes that have sliders
    show: str = "both"
    surface: str = "skin"
    view: str = "three_quarter"
    orbit: tuple[float, float] | None = None  # degrees: azimuth, elevation
    zoom: float = 1.0
    # Neither ghost nor marks at first: the one patches the fitted face, the others hide its eyes and mouth
    overlays: tuple[str, ...] = ("points", "scale")
    error_scale: int = 1
    fade: float = 0.5
    hide: tuple[str, ...] = ()
    pins: tuple[ViewState, ...] = ()  # each as short() makes it, of this state's model
    pin_names: tuple[str, ...] = ()  # of the pins in their order; "" or missing: by its number
    lesson: int | None = None
    step: int = 1
    theme: str = "auto"
    text: float = 1.0
    lang: str = "auto"  # as the browser asks; English where there is none

    def __post_init__(self) -> None:
        if isinstance(self.v, bool) or self.v != VERSION:
            raise ValueError(
                f"v: {self.v!r:.60} is not the format that this program reads ({VERSION})"
            )
        for name, field in FIELDS.items():
            value = canonical(field, getattr(self, name))
            if field.kind == "pins" and value:
                value = _pinned(value, self.model)
            if name == "pin_names":  # after the pins; a name without a pin means nothing
                value = canonical(field, value[: len(self.pins)])
            # A state is written to here and in changed() only: it is being made
            msgspec.structs.force_setattr(self, name, value)
        self.check()

    def check(self) -> None:
        """ValueError where two fields contradict each other."""
        if self.view == "free" and self.orbit is None:
            raise ValueError("view: free needs an orbit, the viewer's azimuth and elevation")

    @property
    def target(self) -> Target:
        """The part that decides the observation."""
        return self._part(Target)

    @property
    def fitting(self) -> Fitting:
        """The part that decides the fit of an observation."""
        distance = None if self.camera == "orthographic" else self.distance
        return Fitting(distance, self.modes, self.prior, self.box)

    @property
    def bend(self) -> Bend:
        """The part that bends a fitted face."""
        return self._part(Bend)

    @property
    def look(self) -> Look:
        """The part that only decides what is drawn."""
        return self._part(Look)

    def _part(self, part: type[_P]) -> _P:
        return part(*_FIELDS_OF[part](self))


_FIELDS_OF: dict[type[Any], Callable[[ViewState], tuple[Any, ...]]] = {
    part: attrgetter(*part._fields) for part in (Target, Bend, Look)
}
_OF_A_FACE = tuple(n for n, f in FIELDS.items() if f.part in ("target", "fitting", "bend"))
_NOT_OF_A_FACE = tuple(name for name in FIELDS if name not in _OF_A_FACE)
_OF_THE_READER = ("theme", "text", "lang")
_ALONE = FIELDS.keys() - {"model", "pins", "pin_names"}  # what no other field's value depends on


def short(state: ViewState) -> ViewState:
    """The state of a face alone, as it is pinned: target, fitting and bend; the look and the pins as by default."""
    return ViewState(**{name: getattr(state, name) for name in _OF_A_FACE})


def names_of_pins(state: ViewState) -> tuple[str, ...]:
    """The name of every pin; "" of one that has none."""
    return state.pin_names + ("",) * (len(state.pins) - len(state.pin_names))


def _pinned(pins: tuple[Any, ...], model: str) -> tuple[ViewState, ...]:
    """Pins in their short form; all are of one model, as faces of different meshes cannot be compared."""
    if len(pins) > PINS:
        raise ValueError(f"pins: {len(pins)} of them; give at most {PINS}")
    for pin in pins:
        if not isinstance(pin, ViewState):
            raise ValueError(f"pins: {pin!r:.60} is not a ViewState")
    return tuple(pin if _is_short(pin, model) else changed(short(pin), model=model) for pin in pins)


def _is_short(pin: ViewState, model: str) -> bool:
    return pin.model == model and all(
        getattr(pin, name) == getattr(DEFAULT, name) for name in _NOT_OF_A_FACE
    )


def changed(state: ViewState, **values: Any) -> ViewState:
    """`state` with some fields changed; ValueError if a value is out of range."""
    if not values.keys() <= _ALONE:
        return msgspec.structs.replace(state, **values)
    # The rest is as it may stand already: a hand on a slider asks for this some ten times a second
    made = copy.copy(state)
    for name, value in values.items():
        msgspec.structs.force_setattr(made, name, canonical(FIELDS[name], value))
    made.check()
    return made


def for_eyes_of(state: ViewState, reader: ViewState) -> ViewState:
    """A state as a reader wants to see it: colours of the page, size of letters and language are the reader's."""
    return changed(state, **{name: getattr(reader, name) for name in _OF_THE_READER})


DEFAULT = ViewState()
