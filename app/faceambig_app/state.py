"""ViewState: everything a person can set, as one frozen value, and the table of its fields.

One row of FIELDS drives the slider, the number box, the command line flag, the key of the address, the key of the JSON,
the range and the hint of a setting. Metres and degrees inside; centimetres only on labels.

The state falls into four parts, each the key of one cached step of the pipeline: Target -> Fitting -> Bend -> Look.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import msgspec


@dataclass(frozen=True, slots=True)
class Field:
    """One setting: where it may lie and what it is called."""

    name: str  # ViewState field, URL and JSON key, Python keyword
    kind: type  # float, int or str
    low: float = -math.inf
    high: float = math.inf
    step: float = 1.0  # of the widget, in the widget's unit
    unit: str = ""  # "m", "deg", "mm", "%"
    choices: tuple[str, ...] = ()

    @property
    def flag(self) -> str:
        """Command line flag."""
        return "--" + self.name.replace("_", "-")


FIELDS: Mapping[str, Field] = {
    field.name: field
    for field in (
        Field("subject", int, 1, 10),
        Field("actual", float, 0.2, 5.0, unit="m"),
        Field("distance", float, 0.2, 3.0, unit="m"),
        Field("camera", str, choices=("perspective", "orthographic")),
        Field("yaw", float, -60, 60, unit="deg"),
        Field("pitch", float, -30, 30, unit="deg"),
        Field("roll", float, -45, 45, unit="deg"),
        Field("scheme", str, choices=("ibug68", "farkas")),
        Field("noise", float, 0, 5, step=0.5, unit="%"),
        Field("seed", int, 0, 9999),
        Field("modes", int, 10, 100),
        Field("prior", float, 0.01, 5, unit="%"),
        Field("box", float, 1, 4, step=0.5),
        Field("flex", float, -10, 10, step=0.5, unit="mm"),
        Field("show", str, choices=("both", "row")),
        Field("surface", str, choices=("skin", "difference")),
        Field("view", str, choices=("front", "three_quarter", "side", "top", "camera")),
    )
}


class Target(NamedTuple):
    """What was photographed, and how: the key of an observation."""

    model: str
    subject: int
    actual: float
    yaw: float
    pitch: float
    roll: float
    scheme: str
    noise: float
    seed: int


class Fitting(NamedTuple):
    """What the fit assumes: with a Target, the key of a fit. distance None is the far-away camera."""

    distance: float | None
    modes: int
    prior: float
    box: float


class Bend(NamedTuple):
    """How the fitted face is bent along its flexibility modes: mm of the first."""

    flex: float


class Look(NamedTuple):
    """What is drawn of it."""

    show: str
    surface: str
    view: str


class ViewState(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True
):
    """Everything a person can set. `prior` is the noise the fit assumes, `noise` what observe adds."""

    v: int = 1
    model: str = "embedded"
    subject: int = (
        2  # of the ten, the face that shows the effect best: d_S 1.0 mm at 30 cm, 4.1 mm at 120 cm
    )
    actual: float = 0.3  # metres, where the photo was taken from
    distance: float = 1.2  # metres, assumed by the fit
    camera: str = "perspective"
    yaw: float = 0.0  # degrees, pose of the head in the photo
    pitch: float = 0.0
    roll: float = 0.0
    scheme: str = "ibug68"
    noise: float = 0.0  # % of the eye distance, added to the points
    seed: int = 0
    modes: int = 70
    prior: float = 1.0  # % of the eye distance, noise the fit assumes
    box: float = 2.0  # standard deviations
    flex: float = 0.0  # mm along the first flexibility mode
    show: str = "both"
    surface: str = "skin"
    view: str = "three_quarter"

    def __post_init__(self) -> None:
        if self.v != 1:
            raise ValueError(f"v: {self.v!r} is a newer format than this program reads (1)")
        if not self.model:
            raise ValueError("model: '' is not a name or a path")
        for field in FIELDS.values():
            check(field, getattr(self, field.name))

    @property
    def target(self) -> Target:
        """The part that decides the observation."""
        return Target(
            self.model,
            self.subject,
            self.actual,
            self.yaw,
            self.pitch,
            self.roll,
            self.scheme,
            self.noise,
            self.seed,
        )

    @property
    def fitting(self) -> Fitting:
        """The part that decides the fit of an observation."""
        return Fitting(
            None if self.camera == "orthographic" else self.distance,
            self.modes,
            self.prior,
            self.box,
        )

    @property
    def bend(self) -> Bend:
        """The part that bends a fitted face."""
        return Bend(self.flex)

    @property
    def look(self) -> Look:
        """The part that only decides what is drawn."""
        return Look(self.show, self.surface, self.view)


def check(field: Field, value: Any) -> None:
    """ValueError, naming field, value and range, unless `value` may stand in `field`."""
    if field.kind is str:
        if value not in field.choices:
            raise ValueError(f"{field.name}: {value!r} is not {' or '.join(field.choices)}")
        return
    if not isinstance(value, field.kind | int) or isinstance(
        value, bool
    ):  # every int is a float, not the other way
        raise ValueError(
            f"{field.name}: {value!r} is not a {'whole number' if field.kind is int else 'number'}"
        )
    if not field.low <= value <= field.high:  # False for NaN too
        unit = f" {field.unit}" if field.unit else ""
        try:
            shown = f"{value:g}"
        except OverflowError:  # a whole number beyond every float
            shown = "a number of that many digits"
        raise ValueError(
            f"{field.name}: {shown} is not within {field.low:g} to {field.high:g}{unit}"
        )


def changed(state: ViewState, **values: Any) -> ViewState:
    """`state` with some fields changed; ValueError if a value is out of range."""
    return msgspec.structs.replace(state, **values)


def parse(kind_of: Field, text: str) -> Any:
    """The value of a field written as text (address, flag); ValueError if it is none."""
    if kind_of.kind is str:
        return text.replace("-", "_")  # three-quarter, as people write it
    try:
        return kind_of.kind(text)
    except ValueError as error:
        raise ValueError(
            f"{kind_of.name}: {text!r:.60} is not a {'whole ' if kind_of.kind is int else ''}number"
        ) from error


DEFAULT = ViewState()
