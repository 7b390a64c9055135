"""A state in a link, a file and a command: there and back, and what is wrong in a link is said and nothing worse."""

from __future__ import annotations

import json
import math
import re
import shlex
import string
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from damage import cases
from faceambig_app import cli, script
from faceambig_app.commands import snapshot
from faceambig_app.notices import from_query
from faceambig_app.state import DEFAULT, FIELDS, ViewState, changed, link
from faceambig_app.state.forms import command, flags, from_json, rounded, text_of, to_json, value_of
from faceambig_app.state.link import Finding, query, to_digits
from states import random_states, states

PARSER = cli.parser()
PHOTO = "This link needs your photo."


@cases(200)
@given(states())
def test_a_state_comes_back_from_link_file_flags_and_pins(state):
    comes_back(state)


def test_a_thousand_states_come_back():
    for state in random_states(1000, seed=5):
        comes_back(state)


def comes_back(state: ViewState) -> None:
    written = to_json(state)
    assert from_json(written) == from_json(written.encode()) == state
    options = PARSER.parse_args(["snapshot", "--out", "a.png", *flags(state)])
    assert snapshot.state_of(options) == state
    assert value_of(FIELDS["pins"], text_of(FIELDS["pins"], state.pins)) == tuple(
        changed(pin, model=DEFAULT.model) for pin in state.pins
    )
    short = to_digits(state)
    text = query(state)
    assert text == query(short)
    assert link.read(text, {state.model}) == (
        short,
        (Finding("photo", ("subject",)),) if state.subject == "photo" else (),
    )
    assert to_digits(short) == short


@settings(max_examples=50)
@given(states())
def test_a_link_is_of_few_signs_and_near_what_it_was_made_of(state):
    of_any_signs = query(changed(state, model=DEFAULT.model))
    assert script._QUERY.fullmatch(of_any_signs)
    assert len(of_any_signs) < script.LONGEST
    text = query(changed(state, model=DEFAULT.model, pin_names=()))
    assert set(text) <= set(string.ascii_letters + string.digits + "._,:-=&")
    for name, field in FIELDS.items():
        if field.kind == "number":
            value = getattr(state, name)
            assert math.isclose(getattr(to_digits(state), name), value, rel_tol=0.005, abs_tol=0)


@given(st.floats(-1e300, 1e300))
def test_three_digits_are_three_digits(value):
    assert rounded(rounded(value)) == rounded(value)
    digits = repr(rounded(value)).split("e")[0].strip("-").replace(".", "").strip("0")
    assert len(digits) <= 3


TWO = (DEFAULT, ViewState(distance=0.6))
LINKS: dict[str, ViewState] = {
    "pins=default..distance:0.6&pin_names=N%C3%A4her%20by,a%252C%20b%2525": ViewState(
        pins=TWO, pin_names=("N\u00e4her by", "a, b%")
    ),
    "pins=default&pin_names=%256Eone": ViewState(pins=TWO[:1], pin_names=("none",)),
    "": DEFAULT,
    "subject=3&distance=0.6&view=side": ViewState(subject=3, distance=0.6, view="side"),
    "distance=0.305&flex=3.5": ViewState(distance=0.305, flex=((1, 3.5),)),
    "flex=1:3.5,2:-4": ViewState(flex=((1, 3.5), (2, -4.0))),
    "flex=2:-4": ViewState(flex=((2, -4.0),)),
    "draw=17": ViewState(draw=17),
    "view=free&orbit=30,-10": ViewState(view="free", orbit=(30.0, -10.0)),
    "overlays=rays,outline&error_scale=20": ViewState(overlays=("rays", "outline"), error_scale=20),
    "overlays=none": ViewState(overlays=()),
    "hide=truth,actual&theme=dark&text=1.25": ViewState(
        hide=("truth", "actual"), theme="dark", text=1.25
    ),
    "pins=default..distance:0.6,flex:1:1.5,flex:2:-4..subject:3,flex_at:dlt": ViewState(
        pins=(
            DEFAULT,
            ViewState(distance=0.6, flex=((1, 1.5), (2, -4.0))),
            ViewState(subject=3, flex_at="dlt"),
        )
    ),
}


@pytest.mark.parametrize("text", LINKS)
def test_links_are_readable_and_stay_as_they_are(text):
    assert query(LINKS[text]) == text
    assert from_query(text) == from_query(f"?{text}") == (LINKS[text], ())


def test_what_means_the_same_is_one_text():
    same = (
        {"yaw": -0.0, "flex": [(1, 0.0)], "overlays": {"scale", "points"}},
        {"distance": 1.2000001, "zoom": 1},
        {"orbit": None, "pins": []},
    )
    for values in same:
        assert query(ViewState(**values)) == ""
    assert to_json(ViewState(**same[0])) == "{}"
    a = changed(DEFAULT, overlays=("rays", "points"), flex=[(3, 1), (2, 1.0)], orbit=(-190, 0))
    b = changed(DEFAULT, overlays=["points", "rays"], flex=((2, 1), (3, 1)), orbit=(170.0, -0.0))
    assert (to_json(a), query(a), command(a)) == (to_json(b), query(b), command(b))


# Each: a link, what it gives, what is said
WRONG: dict[str, tuple[str, dict[str, Any], list[str]]] = {
    "left out by the server": (
        "subject=4&ignored=spin,lens",
        {"subject": 4},
        ["Unknown settings in this link were left out: spin, lens."],
    ),
    "left out of a newer one": (
        "v=2&ignored=spin",
        {},
        ["This link was made by a newer version. Unknown settings were left out: spin."],
    ),
    "no word of a server's": ("ignored=<b>&subject=4", {"subject": 4}, []),
    "unknown": ("spin=3&subject=4", {"subject": 4}, ["Unknown settings in this link were left out: spin."]),
    "unknown, many": (
        "&".join(f"k{i}=1" for i in range(8)), {},
        ["Unknown settings in this link were left out: k0, k1, k2, k3, k4 and 3 more."],
    ),
    "unknown, long, odd": (
        f"{'x' * 99}=1&%0a%3Cb%3E=2&=3", {},
        [f"Unknown settings in this link were left out: {'x' * 24}..., ?<b>, ?."],
    ),
    "newer": (
        "v=2&spin=1&distance=0.5", {"distance": 0.5},
        ["This link was made by a newer version. Unknown settings were left out: spin."],
    ),
    "newer, all known": ("v=3&distance=0.5", {"distance": 0.5}, ["This link was made by a newer version."]),
    "this version": ("v=1&distance=0.5", {"distance": 0.5}, []),
    "no version": ("v=%C2%B2", {}, ['v: "²" was not understood and left out.']),
    "version nought": ("v=0", {}, ['v: "0" was not understood and left out.']),
    "near": ("distance=0.05", {"distance": 0.2}, ["distance: 0.05 is outside 0.2 to 3 m. Set to 0.2 m."]),
    "far": ("actual=1e999", {"actual": 5.0}, ["actual: inf is outside 0.2 to 5 m. Set to 5 m."]),
    "whole": ("seed=-1", {}, ["seed: -1 is outside 0 to 9999. Set to 0."]),
    "400 digits": (f"modes={'9' * 400}", {"modes": 100}, ["modes: inf is outside 10 to 100. Set to 100."]),
    "5000 digits": (f"modes={'9' * 5000}", {}, [f'modes: "{"9" * 24}..." was not understood and left out.']),
    "subject": ("subject=11", {"subject": 10}, ["subject: 11 is outside 1 to 10. Set to 10."]),
    "draw": ("draw=-5", {"draw": 0}, ["draw: -5 is outside 0 to 9999. Set to 0."]),
    "bent far": ("flex=2:-40", {"flex": ((2, -10.0),)}, ["flex: -40 is outside -10 to 10 mm. Set to -10 mm."]),
    "above": (
        "view=free&orbit=5,99", {"view": "free", "orbit": (5.0, 90.0)},
        ["orbit: 99 is outside -90 to 90 deg. Set to 90 deg."],
    ),
    "no number": ("distance=near", {}, ['distance: "near" was not understood and left out.']),
    "nothing": ("distance=", {}, ['distance: "" was not understood and left out.']),
    "no value": ("distance", {}, ['distance: "" was not understood and left out.']),
    "NaN": ("distance=nan", {}, ['distance: "nan" was not understood and left out.']),
    "half a subject": ("subject=1.5", {}, ['subject: "1.5" was not understood and left out.']),
    "no choice": ("view=below", {}, ['view: "below" was not understood and left out.']),
    "no such scale": ("error_scale=7", {}, ['error_scale: "7" was not understood and left out.']),
    "no such overlay": ("overlays=rays,fog", {}, ['overlays: "rays,fog" was not understood and left out.']),
    "no mode": ("flex=0:1", {}, ['flex: "0:1" was not understood and left out.']),
    "a mode twice": ("flex=1:1,1:2", {}, ['flex: "1:1,1:2" was not understood and left out.']),
    "four modes": ("flex=1:1,2:1,3:1,4:1", {}, ['flex: "1:1,2:1,3:1,4:1" was not understood and left out.']),
    "half an orbit": ("orbit=30", {}, ['orbit: "30" was not understood and left out.']),
    "an endless orbit": ("orbit=inf,0", {}, ['orbit: "inf,0" was not understood and left out.']),
    "free of an orbit": ("view=free", {}, ['view: "free" says no orbit and was left out.']),
    "six pins": (
        "pins=" + "..".join(["default"] * 6), {},
        ['pins: "default..default..defaul..." was not understood and left out.'],
    ),
    "a pin of a look": ("pins=view:side", {}, ['pins: "view:side" was not understood and left out.']),
    "a pin of pins": ("pins=pins:default", {}, ['pins: "pins:default" was not understood and left out.']),
    "a pin of a model": ("pins=model:x", {}, ['pins: "model:x" was not understood and left out.']),
    "a pin out of range": ("pins=distance:9", {}, ['pins: "distance:9" was not understood and left out.']),
    "a pin said twice": ("pins=seed:1,seed:2", {}, ['pins: "seed:1,seed:2" was not understood and left out.']),
    "a model of mine": ("model=/etc/passwd", {}, ['The model "/etc/passwd" is not on this page; embedded is shown.']),
    "no model": ("model=", {}, ['model: "" was not understood and left out.']),
    "half a letter": ("model=%ED%A0%80", {}, ['The model "???" is not on this page; embedded is shown.']),
    "photo": ("subject=photo", {"subject": "photo"}, [PHOTO]),
    "twice": (
        "subject=3&seed=1&subject=4&subject=5", {"subject": 5, "seed": 1},
        ["Given more than once in this link, the last one counts: subject."],
    ),
    "escaped": (
        "%73ubject=%34&view=three%2Dquarter&fl%65x=1%3A2%2C3%3A-4",
        {"subject": 4, "flex": ((1, 2.0), (3, -4.0))}, [],
    ),
    "broken escapes": ("subject=%4&%zz=%", {}, [
        "Unknown settings in this link were left out: %zz.", 'subject: "%4" was not understood and left out.',
    ]),
    "plus is a space": ("view=side+", {}, ['view: "side " was not understood and left out.']),
    "empty pieces": ("&&subject=3&&", {"subject": 3}, []),
    "viser's own": ("darkMode&fixedDpr=1&subject=3", {"subject": 3}, []),
    "very long": ("subject=3&x=" + "y" * 65536, {}, ["This link is longer than 65536 characters and was left out."]),
    "braces": ("view={name}{0}", {}, ['view: "{name}{0}" was not understood and left out.']),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_in_a_link_is_said_and_the_rest_is_right(name):
    text, values, said = WRONG[name]
    # what a broken escape stands for is U+FFFD, which can be printed
    said = [words.replace("???", "\ufffd\ufffd\ufffd") for words in said]
    assert from_query(text) == (ViewState(**values), tuple(said))


def test_a_link_may_name_the_models_of_the_page():
    assert from_query("model=ict", models=("embedded", "ict")) == (ViewState(model="ict"), ())
    assert query(ViewState(model="a b/ü=1&2.npz")) == "model=a%20b%2F%C3%BC%3D1%262.npz"


@cases(300)
@given(st.text() | st.lists(st.sampled_from([
    *FIELDS, "v", "spin", "=", "&", "?", "..", ",", ":", "-", "1", "2.5", "1e9", "nan", "none", "default",
    "%", "%41", "%ff", "+", "photo", "free", "rays", "\0", "é",
]), max_size=40).map("".join))  # fmt: skip
def test_any_text_is_a_link_and_its_notices_are_lines(text):
    state, notices = from_query(text)
    assert from_query(query(state)) == (state, (PHOTO,) if state.subject == "photo" else ())
    for words in notices:
        assert len(words) < 400
        assert words.isprintable()


@pytest.mark.parametrize(
    "text",
    [
        "&" * 65536,
        "a&" * 32768,
        "&".join(f"{i}" for i in range(11000)),
        "%41" * 21845,
        "pins=" + "." * 65000,
        "pins=" + "distance:1," * 5900,
        "flex=" + "1:1," * 16000,
        "overlays=" + "rays," * 13000,
        "subject=" + "9" * 65000,
        "subject=3&" * 6500,
    ],
    ids=lambda text: text[:12],
)
def test_a_link_as_long_as_can_be_gives_few_words(text):
    _, notices = from_query(text)
    assert sum(map(len, notices)) < 600


# Each: a JSON text, and what is said of it
BAD_JSON = [
    ("", r"state: not JSON \(Input data was truncated\)"),
    ("{", r"state: not JSON \(Input data was truncated\)"),
    ("{]", r"state: not JSON \(JSON is malformed.*\)"),
    (b"\xff\xfe", r"state: not JSON \(.*\)"),
    ('{"distance": NaN}', r"state: not JSON \(.*\)"),
    ("[]", "Expected `object`, got `array`"),
    ("3", "Expected `object`, got `int`"),
    ("null", "Expected `object`, got `null`"),
    ('{"v": 2, "spin": 1}', r"v: 2 is not the format that this program reads \(1\)"),
    ('{"v": {}}', r"v: \{\} is not the format that this program reads \(1\)"),
    ('{"v": true}', r"v: True is not .*|Expected `int`, got `bool`.*"),
    ('{"spin": 1}', "Object contains unknown field `spin`"),
    ('{"distance": "1"}', r"Expected `float`, got `str` - at `\$.distance`"),
    ('{"distance": 9}', r"distance: 9 is not within 0.2 to 3 m"),
    ('{"flex": [[1, 2, 3]]}', "Expected `array` of length 2.*"),
    ('{"flex": [[1, 99]]}', r"flex: 99 is not within -10 to 10 mm"),
    ('{"orbit": [1]}', "Expected `array` of length 2.*"),
    ('{"view": "free"}', "view: free needs an orbit, the viewer's azimuth and elevation"),
    ('{"pins": [{"distance": 9}]}', r"distance: 9 is not within 0.2 to 3 m - at `\$.pins\[0\]`"),
    ('{"pins": [[]]}', r"Expected `object`, got `array` - at `\$.pins\[0\]`"),
    ('{"pins":[' * 3000 + "]}" * 3000, "state: nested too deeply"),
    ("[" * 30000 + "]" * 30000, "state: nested too deeply"),
    (" " * 65537, "state: longer than 65536 characters"),
    ('{"a\\nb": 1}', "Object contains unknown field `a b`"),
    ('{"' + "x" * 60000 + '": 1}', r"Object contains unknown field `x+\.\.\."),
    ('{"distance": 1e400}', "Number out of range.*"),
    ('{"subject": ' + "9" * 5000 + "}", ".*"),
]


@pytest.mark.parametrize(("text", "words"), BAD_JSON, ids=lambda value: str(value)[:20])
def test_json_that_is_no_state_is_refused_in_one_line(text, words):
    with pytest.raises(ValueError, match=r".") as refused:
        from_json(text)
    assert re.fullmatch(words, str(refused.value)), str(refused.value)
    assert len(str(refused.value)) < 300


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)  # fmt: skip


@cases(300)
@given(st.text() | st.binary() | st.dictionaries(
    st.sampled_from([*FIELDS, "v", "spin"]), json_values, max_size=3).map(json.dumps))  # fmt: skip
def test_any_text_is_a_state_or_a_short_line(text):
    refusal = ""
    try:
        state = from_json(text)
    except ValueError as error:
        refusal = str(error)
    else:
        assert from_json(to_json(state)) == state
    assert refusal.isprintable()
    assert len(refusal) < 300


def test_json_is_readable_and_its_pins_are_states():
    state = changed(
        DEFAULT, model="ict", subject=3, flex=[(2, -1)], pins=[ViewState(), ViewState(distance=0.6)]
    )
    assert to_json(state) == (
        '{"model":"ict","subject":3,"flex":[[2,-1.0]],"pins":[{},{"distance":0.6}]}'
    )
    assert from_json(to_json(state)) == state


def test_the_command_says_what_is_not_the_default():
    assert command(DEFAULT) == "faceambig snapshot --out face.png"
    state = ViewState(subject=3, yaw=-12.5, orbit=(-30, 10), model="my faces/a.npz", distance=1 / 3)
    assert command(state, "a b.png") == (
        "faceambig snapshot --model 'my faces/a.npz' --subject 3 --distance 0.3333333333333333"
        " --yaw=-12.5 --orbit=-30,10 --out 'a b.png'"
    )
    assert shlex.split(command(state))[0] == "faceambig"
