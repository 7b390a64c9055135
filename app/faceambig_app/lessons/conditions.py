"""What a learner must do, as a lesson's file has it: `distance < 0.25`, `view is side and overlays has rays`.

A name is a setting of a link, or flex1 to flex100 (mm of one flexibility mode), or a result: d_l (%), d_s (mm),
plausible (yes or no). Results are known when the page is at rest, settings always.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from faceambig.scene import Numbers

from ..state import ViewState
from ..state.fields import FIELDS, LAST_MODE, short_repr

COMPARED: Mapping[str, Callable[[float, float], bool]] = {
    "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge,
}  # fmt: skip
RESULTS = ("d_l", "d_s", "plausible")
_TERM = re.compile(r"\s*([a-z_]+?)(\d*)\s*(<=|>=|<|>|\bis\b|\bhas\b)\s*([A-Za-z0-9_.-]+)\s*")


@dataclass(frozen=True, slots=True)
class Term:
    """One comparison."""

    name: str
    mode: int  # of flex; else 0
    sign: str
    value: str


@dataclass(frozen=True, slots=True)
class Condition:
    """Comparisons that must hold together."""

    terms: tuple[Term, ...]

    def holds(self, state: ViewState, numbers: Numbers | None) -> bool:
        """Whether all hold; without numbers, none about a result does."""
        return all(_holds(term, state, numbers) for term in self.terms)


def condition(text: Any) -> Condition:
    """The condition of a text; ValueError, of one line, if it is none."""
    if not isinstance(text, str):
        raise ValueError(f"{short_repr(text)} is not a condition")
    return Condition(tuple(_term(part) for part in re.split(r"\s+and\s+", text)))


def _term(text: str) -> Term:
    found = _TERM.fullmatch(text)
    if found is None:
        raise ValueError(f'{text.strip()!r} is not like "distance < 0.25" or "view is side"')
    name, mode, sign, value = found.groups()
    if name == "flex" and not (mode and 1 <= int(mode) <= LAST_MODE):
        raise ValueError(f"{text.strip()!r}: write flex1 to flex{LAST_MODE}")
    if (name not in FIELDS and name not in RESULTS) or (mode and name != "flex"):
        raise ValueError(f"{name + mode!r} is no setting and no result")
    kind = _kind(name)
    if (sign in COMPARED) != (kind == "number") or (sign == "has") != (kind == "names"):
        fitting = {"number": "< <= > >=", "names": "has"}.get(kind, "is")
        raise ValueError(f"{text.strip()!r}: of {name} write {fitting}")
    if kind == "number":
        try:
            float(value)
        except ValueError:
            raise ValueError(f"{value!r} is not a number") from None
    choices = ("yes", "no") if name == "plausible" else _choices(name)
    if choices and value not in choices:
        raise ValueError(f"{value!r} is not {' or '.join(choices)}")
    return Term(name, int(mode or 0), sign, value)


def _choices(name: str) -> tuple[str, ...]:
    return tuple(map(str, FIELDS[name].choices)) if name in FIELDS else ()


def _kind(name: str) -> str:
    """How a name is compared: "number", "names" or "word"."""
    if name in RESULTS:
        return "word" if name == "plausible" else "number"
    kind = FIELDS[name].kind
    if kind in ("number", "whole", "index", "modes"):
        return "number"
    return "names" if kind == "names" else "word"


def _holds(term: Term, state: ViewState, numbers: Numbers | None) -> bool:
    value: Any
    if term.name in RESULTS:
        if numbers is None:
            return False
        value = {
            "d_l": numbers.d_l_percent, "d_s": numbers.d_s_mm, "plausible": "yes" if numbers.plausible else "no",
        }[term.name]  # fmt: skip
    elif term.name == "flex":
        value = dict(state.flex).get(term.mode, 0.0)
    else:
        value = getattr(state, term.name)
    match term.sign:
        case "is":
            return str(value) == term.value
        case "has":
            return term.value in value
        case sign:
            return value is not None and COMPARED[sign](float(value), float(term.value))
