"""What the panel says of a state beside its picture: flexibility modes, the face that stands for the fit, pins."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from faceambig.arrays import Array
from faceambig.metrics import HUMAN_TOLERANCE_PERCENT, surface_difference

from ..state import Bend, Fitting, Look, Target, ViewState
from ..state.fields import FIELDS, MODES
from ..text import centimetres, movement, percent_number, say
from .faces import face
from .fits import photograph
from .likely import FlexMode, extremes, flex_modes, posterior, source
from .scenes import fit_title, pin_names, place_words

SPECTRUM = 10  # flexibility modes shown as bars
LETTERS = ("A", "B", "C")  # of the sliders
MARK_ROOM = 3.5  # mm on a slider that the words of a mark need

Slider = tuple[str, tuple[tuple[float, str], ...]]  # label; marks: mm and words
Short = tuple[Target, Fitting, Bend]


@dataclass(frozen=True, slots=True, eq=False)
class Pins:
    """The faces kept. P pins."""

    names: tuple[str, ...]
    words: tuple[str, ...]  # P sentences without names
    d_s_mm: Array  # (P, P) between them


def flex_of(state: ViewState) -> tuple[FlexMode, ...]:
    """The flexibility modes that are shown of a state: those of its sliders and all before them, at least SPECTRUM."""
    bent = [mode for mode, _ in state.flex]
    count = max(SPECTRUM, state.flex_from + 2, *bent)
    return flex_modes(state.target, state.fitting, state.flex_at, count)


def sliders_of(state: ViewState) -> list[Slider]:
    """Label and marks of the sliders of flexibility modes: what a person cannot tell, where plausible faces end."""
    window = flex_of(state)[state.flex_from - 1 : state.flex_from + MODES - 1]
    return [
        (say("flex.slider", letter=letter, words=movement(mode.words)), _marks(mode))
        for letter, mode in zip(LETTERS, window, strict=False)
    ]


def flex_lines(state: ViewState) -> list[str]:
    """What the modes with sliders move, in words; and those that are bent without a slider."""
    modes, bent = flex_of(state), dict(state.flex)
    first = state.flex_from
    lines = [
        say(
            "flex.words",
            letter=letter,
            number=mode.number,
            words=movement(mode.words),
            low=f"{mode.low:.1f}".replace("-", "\u2212"),
            high=f"{mode.high:.1f}",
            percent=percent_number(10.0 * HUMAN_TOLERANCE_PERCENT / mode.tolerance_mm),
        )
        for letter, mode in zip(LETTERS, modes[first - 1 : first + MODES - 1], strict=False)
    ]
    for number, mm in bent.items():
        if not first <= number < first + MODES:
            words = movement(modes[number - 1].words)
            lines.append(say("flex.elsewhere", number=number, words=words, mm=f"{mm:g}"))
    return lines


def _marks(mode: FlexMode) -> tuple[tuple[float, str], ...]:
    """Where a slider has marks, mm; words where there is room for them, rather at the right."""
    low, high = FIELDS["flex"].low, FIELDS["flex"].high
    face_ends, unseen = say("flex.mark_plausible"), say("flex.mark_tolerance")
    marks: list[tuple[float, str]] = []
    for mm, words in (
        (mode.high, face_ends),
        (mode.tolerance_mm, unseen),
        (-mode.tolerance_mm, unseen),
        (mode.low, face_ends),
    ):
        if low <= mm <= high:
            free = all(abs(mm - other) >= MARK_ROOM for other, said in marks if said)
            marks.append((round(mm, 2), words if free else ""))
    return tuple(sorted(marks))


def spectrum_of(state: ViewState) -> tuple[Array, list[str]]:
    """How far each of the first modes may bend, mm (K,), and what it moves.

    As far as the points move by 1 % of the eye distance; not beyond plausible faces, where flexible modes end first.
    """
    modes = flex_of(state)[:SPECTRUM]
    reach = [min(mode.tolerance_mm / HUMAN_TOLERANCE_PERCENT, mode.high) for mode in modes]
    return np.array(reach), [movement(mode.words) for mode in modes]


@lru_cache(maxsize=256)
def _between(a: Short, b: Short) -> float:
    """d_S between two faces, mm."""
    one, two = face(*a), face(*b)
    evaluation = one.fit.model.evaluation
    return surface_difference(one.own_vertices, two.own_vertices, evaluation).mean_mm


def pins_of(state: ViewState) -> Pins:
    """The faces that a state keeps, in words, and how far they are from each other."""
    keys = [(pin.target, pin.fitting, pin.bend) for pin in state.pins]
    lines = tuple(_pin_words(pin, state.look) for pin in state.pins)
    d_s = np.array([[0.0 if a == b else _between(a, b) for b in keys] for a in keys])
    return Pins(pin_names(state), lines, d_s.reshape(len(keys), len(keys)))


def _pin_words(pin: ViewState, look: Look) -> str:
    """Who a pin shows, at which distances, and how far off it is; what is hidden is left out."""
    shown = face(pin.target, pin.fitting, pin.bend)
    words = [photograph(pin.target).subject.name]
    if "actual" not in look.hide:
        words.append(say("head.taken", distance=centimetres(pin.actual)))
    if pin.bend.extreme is not None or pin.bend.draw is not None:
        words.append(fit_title(pin.bend))
    words.append(place_words(pin))
    if "numbers" not in look.hide:
        d_l, d_s = percent_number(shown.d_l_percent), f"{shown.d_s_mm:.1f}"
        words.append(say("pin.d_l", d_l=d_l))
        if "truth" not in look.hide:
            words.append(say("pin.d_s", d_s=d_s))
    return ", ".join(words)


def told(state: ViewState) -> str:
    """Which face stands for the fitted one, in words; empty where it is the fit, bent or not."""
    if state.extreme is not None:
        found = extremes(state.target, state.fitting)
        return say(
            "flex.extreme",
            number=state.extreme,
            tolerance=f"{found.tolerance_percent:g}",
            reached=f"{found.faces[state.extreme - 1].rms_mm:.1f}",
            bound=f"{found.bound_mm:.1f}",
        )
    if state.draw is None:
        return ""
    found = posterior(source(state.target, state.fitting)).interval(0.95)
    low = centimetres(round(found.low, 2))
    if found.high is None:
        return say("flex.draw_open", number=state.draw + 1, low=low)
    return say("flex.draw", number=state.draw + 1, low=low, high=centimetres(round(found.high, 2)))
