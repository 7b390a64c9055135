"""States for the property tests: every value a field may have, the ends of its range among them."""

from __future__ import annotations

import random
import unicodedata
from collections.abc import Iterator
from functools import cache
from typing import Any

from hypothesis import strategies as st

from faceambig_app.state import FIELDS, Field, ViewState, changed

SAFE = st.text("abcdefghijklmnopqrstuvwxyz0123456789_", min_size=1, max_size=12)
# Of any script, with every sign that means something in an address, a file or a shell
TURNING = ("LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI")
NAMES = st.sampled_from(
    [
        "",
        "none",
        "a, b",
        "50%2C",
        "..",
        "default",
        "<b>&\"'",
        "-x",
        "N\u00e4he \u05d0",
        "\U0001f600",
    ]
) | st.text(
    st.characters(exclude_categories=("Cc", "Cs")).filter(
        lambda c: unicodedata.bidirectional(c) not in TURNING
    ),
    max_size=30,
)


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
        case "words":
            return st.lists(NAMES, max_size=5)


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
    return changed(draw(alone()), pins=pins, pin_names=draw(values(FIELDS["pin_names"])))


def random_states(number: int, seed: int) -> Iterator[ViewState]:
    """Many states, most fields set: they do not shrink, but cost a twentieth of drawn ones."""
    rng = random.Random(seed)
    for _ in range(number):
        pins = [_random(rng, rng.random()) for _ in range(rng.choice((0, 0, 1, 2, 5)))]
        names = [
            rng.choice(("", "none", "Near", "a, b", "50%2C", "\U0001f600 \u05d0")) for _ in pins
        ]
        yield changed(_random(rng, rng.random()), pins=pins, pin_names=names)


def _random(rng: random.Random, share: float) -> ViewState:
    chosen = {"view": "three_quarter", "orbit": None}
    names = (name for name in FIELDS if rng.random() < share)
    return made(chosen | {name: _random_value(rng, FIELDS[name]) for name in names})


def _random_value(rng: random.Random, field: Field) -> Any:
    low, high = field.low, field.high
    match field.kind:
        case "number":
            return rng.choice([low, high, rng.uniform(low, high), round(rng.uniform(low, high), 2)])
        case "whole" | "subject" | "index":
            return rng.randint(int(low), int(high))
        case "choice":
            return rng.choice(field.choices)
        case "names":
            return rng.sample(field.choices, rng.randint(0, len(field.choices)))
        case "name":
            return rng.choice(["embedded", "ict", "a b/\u00fc.npz", "-x", "50%&=#+?"])
        case "modes":
            return [
                (mode, rng.uniform(-10, 10))
                for mode in rng.sample(range(1, 101), rng.randint(0, 3))
            ]
        case "orbit":
            return rng.uniform(-400, 400), rng.uniform(low, high)
        case "pins" | "words":
            return ()
