"""ViewState: one value, one table of fields; every way in refuses the same things."""

from __future__ import annotations

import math

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from faceambig_app.state import (
    DEFAULT,
    FIELDS,
    Field,
    ViewState,
    changed,
    check,
    parse,
)

NUMBERS = [field for field in FIELDS.values() if field.kind is not str]
WORDS = [field for field in FIELDS.values() if field.kind is str]


def values(field: Field) -> st.SearchStrategy:
    """Values a field may have, its ends among them."""
    if field.kind is str:
        return st.sampled_from(field.choices)
    if field.kind is int:
        return st.integers(int(field.low), int(field.high))
    return st.sampled_from([field.low, field.high]) | st.floats(field.low, field.high)


states = st.fixed_dictionaries({name: values(field) for name, field in FIELDS.items()}).map(
    lambda chosen: ViewState(**chosen)
)


def test_the_table_names_every_field_of_the_state_and_only_those():
    assert set(FIELDS) | {"v", "model"} == set(ViewState.__struct_fields__)
    for name, field in FIELDS.items():
        assert field.name == name
        assert field.flag == f"--{name}"
        check(field, getattr(DEFAULT, name))
        assert type(getattr(DEFAULT, name)) is field.kind


@given(states)
def test_json_gives_the_same_state_back(state):
    assert msgspec.json.decode(msgspec.json.encode(state), type=ViewState) == state


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b'{"v": 2}', "v: 2 is a newer format"),
        (b'{"model": ""}', "model: '' is not a name or a path"),
        (b'{"distance": 99}', "distance: 99 is not within 0.2 to 3 m"),
        (b'{"subject": 0}', "subject: 0 is not within 1 to 10"),
        (b'{"subject": 1.5}', "Expected `int`"),
        (b'{"view": "below"}', "view: 'below' is not front or"),
        (b'{"colour": "red"}', "unknown field `colour`"),
        (b'{"distance": NaN}', "malformed"),
        (b"[]", "Expected `object`"),
    ],
)
def test_json_that_is_no_state_is_refused(text, words):
    with pytest.raises(msgspec.DecodeError, match=words):
        msgspec.json.decode(text, type=ViewState)


@given(states, st.sampled_from(sorted(FIELDS)), st.data())
def test_a_change_changes_its_field_alone(state, name, data):
    value = data.draw(values(FIELDS[name]))
    after = changed(state, **{name: value})
    assert getattr(after, name) == value
    assert changed(after, **{name: getattr(state, name)}) == state


@given(states)
def test_equal_states_are_one_key(state):
    twin = changed(state)
    assert twin == state
    assert hash(twin) == hash(state)
    with pytest.raises(AttributeError):
        state.distance = 1.0


# which parts of the state a field belongs to
PARTS = {
    "target": {"subject", "actual", "yaw", "pitch", "roll", "scheme", "noise", "seed", "model"},
    "fitting": {"distance", "camera", "modes", "prior", "box"},
    "bend": {"flex"},
    "look": {"show", "surface", "view"},
}


@pytest.mark.parametrize("name", [*FIELDS, "model"])
def test_every_field_belongs_to_one_part(name):
    field = FIELDS.get(name)
    if field is None:
        value = "elsewhere.npz"
    elif field.kind is str:
        value = next(c for c in field.choices if c != getattr(DEFAULT, name))
    else:
        value = field.kind(field.high if getattr(DEFAULT, name) != field.high else field.low)
    other = changed(DEFAULT, **{name: value})
    for part, names in PARTS.items():
        assert (getattr(other, part) != getattr(DEFAULT, part)) == (name in names), part
    assert sum(name in names for names in PARTS.values()) == 1


def test_far_away_the_assumed_distance_plays_no_part():
    far = changed(DEFAULT, camera="orthographic")
    assert far.fitting.distance is None
    assert changed(far, distance=0.7).fitting == far.fitting


@pytest.mark.parametrize("field", NUMBERS, ids=lambda field: field.name)
def test_numbers_out_of_range_are_refused_with_name_value_and_range(field):
    unit = f" {field.unit}" if field.unit else ""
    for bad in (field.low - 1, field.high + 1):
        words = f"^{field.name}: {bad:g} is not within {field.low:g} to {field.high:g}{unit}$"
        with pytest.raises(ValueError, match=words):
            ViewState(**{field.name: field.kind(bad)})
        with pytest.raises(ValueError, match=words):
            changed(DEFAULT, **{field.name: field.kind(bad)})
    assert getattr(ViewState(**{field.name: field.kind(field.high)}), field.name) == field.high


@pytest.mark.parametrize("field", NUMBERS, ids=lambda field: field.name)
@pytest.mark.parametrize(
    "bad",
    [math.nan, math.inf, -math.inf, 10**400, -(10**400), "abc", None, True, [], 1j],
    ids=lambda bad: repr(bad)[:8],
)
def test_what_is_no_number_in_range_is_refused_in_one_short_line(field, bad):
    with pytest.raises(ValueError, match=f"^{field.name}: ") as refused:
        ViewState(**{field.name: bad})
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 120


def test_a_whole_number_is_not_a_fraction():
    with pytest.raises(ValueError, match=r"^subject: 1\.5 is not a whole number$"):
        changed(DEFAULT, subject=1.5)
    assert changed(DEFAULT, distance=1).distance == 1


@pytest.mark.parametrize("field", WORDS, ids=lambda field: field.name)
@pytest.mark.parametrize("bad", ["", "x", None, 1, ["front"]])
def test_words_that_are_no_choice_are_refused_with_the_choices(field, bad):
    with pytest.raises(ValueError, match=f"^{field.name}: .* is not {field.choices[0]} or "):
        ViewState(**{field.name: bad})


@given(states)
def test_text_gives_the_same_values_back(state):
    for name, field in FIELDS.items():
        assert parse(field, str(getattr(state, name))) == getattr(state, name)


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("distance", "abc", "distance: 'abc' is not a number"),
        ("distance", "", "distance: '' is not a number"),
        ("subject", "1.5", "subject: '1.5' is not a whole number"),
        ("subject", "nan", "subject: 'nan' is not a whole number"),
        ("subject", "1" * 9999, "subject: '1{59} is not a whole number"),
    ],
)
def test_text_that_is_no_number_is_refused(name, text, words):
    with pytest.raises(ValueError, match=f"^{words}$"):
        parse(FIELDS[name], text)
