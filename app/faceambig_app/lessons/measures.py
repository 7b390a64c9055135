"""What a lesson may say in numbers: an expression such as `d_s distance=1.2` -> a number of the embedded head.

An expression is the name of a measure and the query of a state. `d_s.mean` is over the ten synthetic people, `.max` and
`.min` likewise; the query's own subject then plays no part.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from statistics import fmean

import numpy as np

from faceambig.arrays import Array
from faceambig.metrics import (
    AUTOMATIC_TOLERANCE_PERCENT,
    HUMAN_TOLERANCE_PERCENT,
    surface_difference,
)
from faceambig.model import FaceModel

from ..pipeline.faces import face
from ..pipeline.fits import model, n_fitted
from ..pipeline.likely import extremes, flex_modes, posterior, source
from ..state import ViewState, changed, link
from ..text import NARROW, distance_text, numeral, percent_number
from .crowd import Crowd, crowd, moved_percent, points_of, spans

OVER: Mapping[str, Callable[[list[float]], float]] = {"mean": fmean, "max": max, "min": min}
LEVEL = 0.95  # of the range of likely distances


@dataclass(frozen=True, slots=True)
class Measure:
    """A number of a state, and how it is written."""

    of: Callable[[ViewState], float]
    words: Callable[[float], str]


def value(expression: str) -> float:
    """The number of an expression; ValueError, of one line, if there is none."""
    name, over, state = _parsed(expression)
    if not over:
        return MEASURES[name].of(state)
    people = range(1, len(model(state.model).subjects) + 1)
    return OVER[over]([MEASURES[name].of(changed(state, subject=who)) for who in people])


def written(expression: str, number: float) -> str:
    """A number as the text of a lesson has it: digits and unit of its measure."""
    return MEASURES[_parsed(expression)[0]].words(number)


def normal(expression: str) -> str:
    """The one form of an expression: single spaces, the query as `link.query` writes it."""
    name, over, state = _parsed(expression)
    return f"{name}{over and '.' + over} {link.query(state)}".strip()


@lru_cache(maxsize=512)
def _parsed(expression: str) -> tuple[str, str, ViewState]:
    head, _, query = " ".join(expression.split()).partition(" ")
    name, _, over = head.partition(".")
    if name not in MEASURES:
        raise ValueError(f"{link.shown(head)!r} is no measure: {', '.join(MEASURES)}")
    if over and over not in OVER:
        raise ValueError(f"{link.shown(head)!r}: .{link.shown(over)} is not .mean, .max or .min")
    state, findings = link.read(query)
    if findings:
        about = ", ".join(findings[0].names) or findings[0].kind
        raise ValueError(f"{link.shown(query)!r}: {about} is no setting of a link, or out of range")
    return name, over, state


def _face(state: ViewState):
    return face(state.target, state.fitting, state.bend)


def _mode(state: ViewState):
    """The flexibility mode that is the first with a slider."""
    return flex_modes(state.target, state.fitting, state.flex_at, state.flex_from)[-1]


def _likely(state: ViewState) -> tuple[float, float]:
    found = posterior(source(state.target, state.fitting)).interval(LEVEL)
    return found.low, math.inf if found.high is None else found.high


def _person(state: ViewState) -> tuple[FaceModel, Array]:
    """The model, and the vertices (N, 3) metres of who was photographed."""
    if isinstance(state.subject, str):
        raise ValueError("subject: photo: there is no photograph here, only the synthetic people")
    found = model(state.model)
    return found, found.subject(state.subject).vertices


def _wider(part: str) -> Callable[[ViewState], float]:
    """How much wider the nose is, against a part of the face, in a photograph from `actual` than from `distance`."""

    def percent(state: ViewState) -> float:
        shares = []
        for metres in (state.actual, state.distance):
            nose, whole = spans(points_of(*_person(state), metres), "nose", part)
            shares.append(nose / whole)
        return 100.0 * (shares[0] / shares[1] - 1.0)

    return percent


def _moved(state: ViewState) -> float:
    """How far the points of one face move between photographs from `actual` and from `distance`, percent."""
    found, vertices = _person(state)
    near, far = (points_of(found, vertices, metres) for metres in (state.actual, state.distance))
    return moved_percent(near, far, found)


def _other(state: ViewState) -> ViewState:
    if not state.pins:
        raise ValueError("pins: the other photograph is missing; write pins=subject:5,actual:4.88")
    return state.pins[0]


def _pair_points(state: ViewState) -> float:
    """How far the points of two photographs are apart, percent: the state's laid on that of its first pin."""
    found = model(state.model)
    one, two = (points_of(*_person(each), each.actual) for each in (state, _other(state)))
    return moved_percent(one, two, found)


def _pair_face(state: ViewState) -> float:
    """d_S between the true faces of two photographs, mm."""
    (found, one), (_, two) = _person(state), _person(_other(state))
    return surface_difference(one, two, found.evaluation).mean_mm


def _of_crowd(read: Callable[[Crowd], float]) -> Callable[[ViewState], float]:
    return lambda state: read(crowd(state.model))


def _percent(number: float) -> str:
    return f"{percent_number(number)}{NARROW}%"


def _whole_percent(number: float) -> str:
    return f"{number:.0f}{NARROW}%"


def _mm(number: float) -> str:
    return numeral(f"{abs(number):.1f}{NARROW}mm")


def _metres(number: float) -> str:
    return distance_text(number if np.isfinite(number) else None)


MEASURES: Mapping[str, Measure] = {
    # of the face that fits
    "d_l": Measure(lambda state: _face(state).d_l_percent, _percent),
    "d_s": Measure(lambda state: _face(state).d_s_mm, _mm),
    "points": Measure(
        lambda state: n_fitted(state.target, state.fitting),
        lambda number: numeral(f"{number:,.0f}"),
    ),
    # of the first flexibility mode with a slider: where plausible faces end
    "bend_end": Measure(lambda state: min(-_mode(state).low, _mode(state).high), _mm),
    # of the two faces farthest apart that a person cannot tell from the points: how far from the fit
    "extreme": Measure(
        lambda state: max(far.d_s_mm for far in extremes(state.target, state.fitting).faces), _mm
    ),
    # the range of distances with a chance of 95 %
    "likely_from": Measure(lambda state: _likely(state)[0], _metres),
    "likely_to": Measure(lambda state: _likely(state)[1], _metres),
    # of photographs from `actual` and from `distance`, without any fit
    "nose_by_face": Measure(_wider("face"), _whole_percent),
    "nose_by_eyes": Measure(_wider("eyes"), _whole_percent),
    "moved": Measure(_moved, _percent),
    # of a state and the first of its pins: two photographs, and the two who are on them
    "pair_points": Measure(_pair_points, _percent),
    "pair_face": Measure(_pair_face, _mm),
    # of random people, photographed from 61 and 488 cm
    "crowd_same": Measure(_of_crowd(lambda found: found.same_percent), _percent),
    "crowd_other": Measure(_of_crowd(lambda found: found.other_percent), _percent),
    "crowd_pair": Measure(_of_crowd(lambda found: found.pair_percent), _percent),
    "crowd_pair_face": Measure(_of_crowd(lambda found: found.pair_mm), _mm),
    "crowd_found": Measure(_of_crowd(lambda found: 100.0 * found.found_share), _whole_percent),
    "person_tolerance": Measure(lambda _: HUMAN_TOLERANCE_PERCENT, lambda n: f"{n:g}{NARROW}%"),
    "program_tolerance": Measure(
        lambda _: AUTOMATIC_TOLERANCE_PERCENT, lambda n: f"{n:g}{NARROW}%"
    ),
}
