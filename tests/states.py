"""States for the property tests: every value a field may have, the ends of its range among them."""

from __future__ import annotations

from functools import cache
from typing import Any

from hypothesis import strategies as st

from faceambig_app.state import FIELDS, Field, ViewState, changed

SAFE = st.text("abcdefghijklmnopqrstuvwxyz0123456789_", min_size=1, max_size=12)


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    return st.sampled_from([low, high, 0.5 * (low + high)]) | st.floats(low, high)


@cache
def values(field: Field) -> st.SearchStrategy[Any]:
    """Values a field may have; pins none, as they need a state of their own."""
    whole = st.integers(int(field.low), int(field.high)) if field.high < 1e9 else st.nothing()
    match field.kind:
        case "number":
            return numbers(field.low, field.high)
        case "whole":
            return whole
        case "choice":
            return st.sampled_from(field.choices)
        case "names":
            return st.sets(st.sampled_from(field.choices)).map(tuple)
        case "name":
            return st.just("embedded") | SAFE | st.sampled_from(["a b/ü.npz", "-x", "50%&=#+?"])
        case "subject":
            return whole | st.just("photo")
        case "index":
            return st.none() | whole
        case "modes":
            modes = st.lists(st.integers(1, 100), max_size=3, unique=True)
            return modes.flatmap(
                lambda chosen: st.tuples(*(st.tuples(st.just(m), numbers(-10, 10)) for m in chosen))
            )
        case "orbit":
            return st.none() | st.tuples(st.floats(-400, 400), numbers(-90, 90))
        case "pins":
            return st.just(())


def made(chosen: dict[str, Any]) -> ViewState:
    """A state of the values; "free" gets the orbit it needs."""
    if chosen["view"] == "free" and chosen["orbit"] is None:
        chosen = chosen | {"orbit": (30.0, -10.0)}
    return ViewState(**chosen)


ALL = sorted(FIELDS)


@st.composite
def alone(draw: st.DrawFn, most: int = 8) -> ViewState:
    """States without pins. Some fields are set, as in links: all of them would cost a hundred draws."""
    names = draw(st.lists(st.sampled_from(ALL), max_size=most))
    chosen = {"view": "three_quarter", "orbit": None}
    return made(chosen | {name: draw(values(FIELDS[name])) for name in names})


@st.composite
def states(draw: st.DrawFn) -> ViewState:
    """States, some with pins."""
    pins = draw(st.lists(alone(4), max_size=draw(st.sampled_from([0, 0, 1, 5]))))
    return changed(draw(alone()), pins=pins)
