"""ViewState: one value, one table of fields; every way in refuses the same things."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from faceambig_app.state import (
    DEFAULT,
    FIELDS,
    Bend,
    Field,
    Look,
    Target,
    ViewState,
    changed,
    names_of_pins,
    short,
)
from faceambig_app.state.fields import canonical, tidy
from states import alone, states, values

NUMBERS = [field for field in FIELDS.values() if field.kind in ("number", "whole")]
CHOICES = [field for field in FIELDS.values() if field.kind == "choice"]
NAMES = [field for field in FIELDS.values() if field.kind == "names"]


def test_the_table_names_every_field_of_the_state_and_only_those():
    assert ("v", *FIELDS) == ViewState.__struct_fields__
    for name, field in FIELDS.items():
        assert field.name == name
        assert field.flag == "--" + name.replace("_", "-")
        assert canonical(field, getattr(DEFAULT, name)) == getattr(DEFAULT, name)
        assert field.help


@settings(max_examples=50)
@given(states())
def test_json_gives_the_same_state_back(state):
    assert msgspec.json.decode(msgspec.json.encode(state), type=ViewState) == state


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b'{"v": 2}', "v: 2 is not the format that this program reads"),
        (b'{"model": ""}', "model: '' is not a name or a path"),
        (b'{"distance": 99}', "distance: 99 is not within 0.2 to 3 m"),
        (b'{"subject": 0}', "subject: 0 is not within 1 to 10"),
        (b'{"subject": 1.5}', "Expected `int | str`"),
        (b'{"view": "below"}', "view: 'below' is not front or"),
        (b'{"colour": "red"}', "unknown field `colour`"),
        (b'{"distance": NaN}', "malformed"),
        (b"[]", "Expected `object`"),
    ],
)
def test_json_that_is_no_state_is_refused(text, words):
    with pytest.raises(msgspec.DecodeError, match=words):
        msgspec.json.decode(text, type=ViewState)


@settings(max_examples=50)
@given(
    states(),
    st.sampled_from(sorted({*FIELDS} - {"view", "orbit", "pins", "pin_names", "model"})),
    st.data(),
)
def test_a_change_changes_its_field_alone(state, name, data):
    value = data.draw(values(FIELDS[name]))
    after = changed(state, **{name: value})
    assert getattr(after, name) == canonical(FIELDS[name], value)
    assert changed(after, **{name: getattr(state, name)}) == state


@settings(max_examples=50)
@given(states())
def test_equal_states_are_one_key(state):
    twin = changed(state)
    assert twin == state
    assert hash(twin) == hash(state)
    with pytest.raises(AttributeError):
        state.distance = 1.0


# Which part of the state a field belongs to; the others are the page's alone
PARTS = {
    "target": {"subject", "actual", "yaw", "pitch", "roll", "scheme", "noise", "seed", "model", "data"},
    "fitting": {"distance", "camera", "modes", "prior", "box"},
    "bend": {"flex", "flex_at", "draw", "extreme"},
    "look": {"show", "surface", "view", "orbit", "zoom", "overlays", "error_scale", "fade", "hide"},
    "page": {"pins", "pin_names", "lesson", "step", "theme", "text", "lang", "flex_from"},
}  # fmt: skip
OTHER = {
    "model": "elsewhere.npz", "subject": "photo", "flex": ((2, 1.0),), "draw": 0, "extreme": 1, "lesson": 1,
    "orbit": (1.0, 2.0), "overlays": ("rays",), "hide": ("truth",), "pins": (DEFAULT,), "pin_names": (),
}  # fmt: skip


@pytest.mark.parametrize("name", FIELDS)
def test_every_field_belongs_to_one_part(name):
    field, default = FIELDS[name], getattr(DEFAULT, name)
    if name in OTHER:
        value = OTHER[name]
    elif field.choices:
        value = next(c for c in field.choices if c != default)
    else:
        value = int(field.high if default != field.high else field.low)
    other = changed(DEFAULT, **{name: value})
    for part in ("target", "fitting", "bend", "look"):
        assert (getattr(other, part) != getattr(DEFAULT, part)) == (name in PARTS[part]), part
    assert [part for part, names in PARTS.items() if name in names] == [field.part]


def test_the_parts_hold_the_fields_of_their_names():
    for part in (Target, Bend, Look):
        of_part = {name for name, field in FIELDS.items() if field.part == part.__name__.lower()}
        assert set(part._fields) == of_part


def test_far_away_the_assumed_distance_plays_no_part():
    far = changed(DEFAULT, camera="orthographic")
    assert far.fitting.distance is None
    assert changed(far, distance=0.7).fitting == far.fitting


def new(**values: Any) -> ViewState:
    """ViewState(...) of values that may not stand there."""
    return ViewState(**values)


def like(field: Field, value: float) -> float:
    return int(value) if field.kind == "whole" else value


@pytest.mark.parametrize("field", NUMBERS, ids=lambda field: field.name)
def test_numbers_out_of_range_are_refused_with_name_value_and_range(field):
    unit = f" {field.unit}" if field.unit else ""
    for bad in (field.low - 1, field.high + 1):
        words = f"^{field.name}: {bad:g} is not within {field.low:g} to {field.high:g}{unit}$"
        with pytest.raises(ValueError, match=words):
            new(**{field.name: like(field, bad)})
        with pytest.raises(ValueError, match=words):
            changed(DEFAULT, **{field.name: like(field, bad)})
    assert getattr(new(**{field.name: like(field, field.high)}), field.name) == field.high


@pytest.mark.parametrize("field", NUMBERS, ids=lambda field: field.name)
@pytest.mark.parametrize(
    "bad",
    [math.nan, math.inf, -math.inf, 10**400, -(10**400), "abc", None, True, [], 1j],
    ids=lambda bad: repr(bad)[:8],
)
def test_what_is_no_number_in_range_is_refused_in_one_short_line(field, bad):
    with pytest.raises(ValueError, match=f"^{field.name}: ") as refused:
        new(**{field.name: bad})
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 120


def test_a_whole_number_is_not_a_fraction():
    with pytest.raises(ValueError, match=r"^subject: 1\.5 is not a whole number or \"photo\"$"):
        changed(DEFAULT, subject=1.5)
    assert changed(DEFAULT, distance=1).distance == 1


@pytest.mark.parametrize("field", CHOICES, ids=lambda field: field.name)
@pytest.mark.parametrize("bad", ["", "x" * 999, None, True, 1.0, ["front"]])
def test_words_that_are_no_choice_are_refused_with_the_choices(field, bad):
    with pytest.raises(ValueError, match=f"^{field.name}: .* is not {field.choices[0]} or "):
        new(**{field.name: bad})


@pytest.mark.parametrize("field", NAMES, ids=lambda field: field.name)
def test_names_are_a_set(field):
    given = [*reversed(field.choices), field.choices[0]]
    for several in (given, tuple(given), set(given)):
        assert getattr(new(**{field.name: several}), field.name) == field.choices
    for bad in (["x"], [1], [["names"]]):
        with pytest.raises(ValueError, match=f"^{field.name}: .* is not {field.choices[0]} or "):
            new(**{field.name: bad})
    with pytest.raises(ValueError, match=f"^{field.name}: 'numbers' is not a tuple, a list or a"):
        new(**{field.name: "numbers"})


@pytest.mark.parametrize(
    ("name", "given", "kept"),
    [
        ("yaw", -0.0, 0.0),
        ("distance", 1, 1.0),
        ("flex", [[2, 3], (1, -1)], ((1, -1.0), (2, 3.0))),
        ("flex", [(5, 0.0), (1, -0.0), (2, 1), (3, 2), (4, 3)], ((2, 1.0), (3, 2.0), (4, 3.0))),
        ("orbit", (190, -0.0), (-170.0, 0.0)),
        ("orbit", [-180, 90], (180.0, 90.0)),
        ("orbit", (720.5, -90), (0.5, -90.0)),
        ("orbit", (-1e-320, 0), (-1e-320, 0.0)),
    ],
)
def test_what_means_the_same_is_one_value(name, given, kept):
    value = getattr(new(**{name: given}), name)
    assert repr(value) == repr(kept)  # tells 0.0 from -0.0 and from 0
    assert new(**{name: value}) == new(**{name: given})


@pytest.mark.parametrize(
    ("name", "bad", "words"),
    [
        ("model", "", "model: '' is not a name or a path"),
        ("model", "x" * 1001, "model: 'x{56}\\.\\.\\. is not a name or a path"),
        ("model", None, "model: None is not a name or a path"),
        ("model", "a\nb", r"model: 'a\\nb' has characters no name has"),
        ("model", "\ud800", r"model: '\\ud800' has characters no name has"),
        ("subject", "foto", "subject: 'foto' is not a whole number or \"photo\""),
        ("subject", 11, "subject: 11 is not within 1 to 10"),
        ("draw", 10000, "draw: 10000 is not within 0 to 9999"),
        ("draw", 0.5, "draw: 0.5 is not a whole number"),
        ("flex", 3.5, "flex: 3.5 is not a tuple, a list or a set"),
        ("flex", [3.5], r"flex: 3.5 is not \(mode, mm\)"),
        ("flex", [(1, 2, 3)], r"flex: \(1, 2, 3\) is not \(mode, mm\)"),
        ("flex", [(0, 1.0)], "flex: mode 0 is not a whole number within 1 to 100"),
        ("flex", [(101, 1.0)], "flex: mode 101 is not a whole number within 1 to 100"),
        ("flex", [(True, 1.0)], "flex: mode True is not a whole number within 1 to 100"),
        ("flex", [(1, 1.0), (1, 2.0)], "flex: mode 1 stands there twice"),
        ("flex", [(1, 10.1)], "flex: 10.1 is not within -10 to 10 mm"),
        ("flex", [(1, math.nan)], "flex: nan is not within -10 to 10 mm"),
        ("flex", [(k, 1) for k in (1, 2, 3, 4)], "flex: 4 modes at once; give at most 3"),
        ("orbit", 30, r"orbit: 30 is not \(azimuth, elevation\)"),
        ("orbit", (1, 91), "orbit: 91 is not within -90 to 90 deg"),
        ("orbit", (math.inf, 0), "orbit: azimuth inf is not an angle in degrees"),
        ("orbit", (math.nan, 0), "orbit: azimuth nan is not an angle in degrees"),
        ("orbit", ("a", 0), "orbit: azimuth 'a' is not an angle in degrees"),
        ("orbit", (True, 0), "orbit: azimuth True is not an angle in degrees"),
        ("orbit", (10**400, 0), "orbit: azimuth 10+\\.\\.\\. is not an angle in degrees"),
        ("view", "free", "view: free needs an orbit, the viewer's azimuth and elevation"),
        ("pins", ["x"], "pins: 'x' is not a ViewState"),
        ("pins", [DEFAULT] * 6, "pins: 6 of them; give at most 5"),
        ("pins", DEFAULT, "pins: ViewState.* is not a tuple, a list or a set"),
        ("pin_names", ["x"] * 6, "pin_names: 6 of them; give at most 5"),
        ("pin_names", "x", "pin_names: 'x' is not a tuple, a list or a set"),
        ("pin_names", {"x"}, "pin_names: {'x'} is not a tuple or a list"),
        ("pin_names", [1], "pin_names: 1 is not a text"),
        ("pin_names", ["x" * 31], "pin_names: 'x+' is longer than 30 characters"),
        ("pin_names", ["\u202eevil"], r"pin_names: '\\u202eevil' has characters no name has"),
        ("pin_names", ["\ud800"], r"pin_names: '\\ud800' has characters no name has"),
        ("pin_names", ["\x07"], r"pin_names: '\\x07' has characters no name has"),
        ("v", 2, r"v: 2 is not the format that this program reads \(1\)"),
        ("v", True, r"v: True is not the format that this program reads \(1\)"),
    ],
)  # fmt: skip
def test_what_may_not_stand_there_is_refused_in_one_line(name, bad, words):
    with pytest.raises(ValueError, match=f"^(?:{words})$"):
        new(**{name: bad})


@settings(max_examples=50)
@given(alone())
def test_a_pin_is_the_face_alone(state):
    pin = short(state)
    assert (pin.target, pin.fitting, pin.bend) == (state.target, state.fitting, state.bend)
    assert pin.look == DEFAULT.look
    assert short(pin) == pin
    assert changed(state, pins=[state]).pins == (pin,)


def test_names_of_pins_have_one_space_between_words_and_end_with_the_pins():
    state = changed(DEFAULT, pins=[DEFAULT] * 2, pin_names=[" Near \n by ", "", "Gone"])
    assert state.pin_names == ("Near by",)
    assert names_of_pins(state) == ("Near by", "")
    assert changed(state, pins=()) == DEFAULT
    assert changed(DEFAULT, pin_names=["Near"]) == DEFAULT


@given(st.text(max_size=60))
def test_what_is_typed_is_tidied_into_a_name(text):
    name = tidy(text)
    assert changed(DEFAULT, pins=[DEFAULT], pin_names=[name]).pin_names == ((name,) if name else ())
    assert tidy(name) == name


def test_pins_are_of_the_model_of_their_state():
    pinned = changed(DEFAULT, pins=[changed(DEFAULT, subject=4), DEFAULT])
    other = changed(pinned, model="other.npz")
    assert [pin.model for pin in other.pins] == ["other.npz"] * 2
    assert [pin.subject for pin in other.pins] == [4, 2]
    assert changed(other, model="embedded") == pinned


def test_an_orbit_stays_in_another_view():
    turned = ViewState(view="free", orbit=(30.0, 10.0))
    assert changed(turned, view="side").orbit == (30.0, 10.0)
    assert changed(turned, view="side") != ViewState(view="side")
