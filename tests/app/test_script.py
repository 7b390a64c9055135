"""Reports of the page's script are read strictly; what it is told is checked before it is sent."""

from __future__ import annotations

import json
import logging
from typing import Any, cast
from unittest.mock import MagicMock

import pytest
import viser

from faceambig_app import script
from faceambig_app.script import (
    LONGEST,
    Click,
    Copied,
    Dark,
    Gone,
    Hand,
    Hello,
    Key,
    Point,
    Probe,
    is_dark,
    read_report,
)

HELLO = {
    "query": "distance=1.2",
    "reduced_motion": False,
    "touch": True,
    "dark": False,
    "theme": None,
    "text": 1.5,
}


@pytest.mark.parametrize(
    ("sent", "read"),
    [
        ({"hello": HELLO}, Hello("distance=1.2", False, True, False, None, 1.5)),
        (
            {"point": {"index": 3, "x": 1, "y": 2.5, "done": True}},
            Point(3, 1.0, 2.5, True),
        ),
        ({"click": {"x": 0, "y": 9.25}}, Click(0.0, 9.25)),
        ({"gone": 0}, Gone(0)),
        ({"key": "Escape"}, Key("Escape")),
        ({"hand": True}, Hand(True)),
        ({"dark": True}, Dark(True)),
        ({"copied": {"n": 2, "ok": False}}, Copied(2, False)),
        ({"probe": {"n": 3, "head": "fit", "vertex": 77}}, Probe(3, "fit", 77)),
    ],
)
def test_reports_are_read(sent: object, read: script.Report) -> None:
    assert read_report(json.dumps(sent)) == read


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        "null",
        "{}",
        "7",
        '{"gone": -1}',
        '{"gone": 1e9}',
        '{"gone": true}',
        '{"gone": 1, "dark": true}',
        '{"other": 1}',
        '{"key": "Enter"}',
        '{"probe": {"n": 0, "head": "fit", "vertex": 1}}',
        '{"probe": {"n": 1, "head": "fit", "vertex": -1}}',
        '{"probe": {"n": 1, "head": "' + "x" * 65 + '", "vertex": 1}}',
        '{"probe": {"n": 1, "head": 1, "vertex": 1}}',
        '{"dark": 1}',
        '{"click": {"x": 1}}',
        '{"click": {"x": NaN, "y": 1}}',
        '{"click": {"x": 1e999, "y": 1}}',
        '{"click": {"x": -1, "y": 1}}',
        '{"click": {"x": "1", "y": 1}}',
        '{"point": {"index": 1.5, "x": 1, "y": 1, "done": true}}',
        json.dumps({"hello": HELLO | {"query": "x" * (LONGEST + 1)}}),
        json.dumps({"hello": HELLO | {"theme": "blue"}}),
        json.dumps({"hello": HELLO | {"text": 3}}),
        "[" * 4000,
        '{"gone": 1}\ud800',
    ],
)
def test_what_is_no_report_is_refused_in_a_line(text: str) -> None:
    with pytest.raises(ValueError, match=r"^report: ") as caught:
        read_report(text)
    assert "\n" not in str(caught.value)


def made(heard: list[Any]) -> tuple[script.Script, MagicMock]:
    gui = MagicMock()
    gui.add_text.return_value._impl.uuid = "u"
    return script.Script(cast("viser.GuiApi", gui), heard.append), gui.add_html.return_value


def test_data_stand_together_so_that_none_is_merged_away() -> None:
    page, html = made([])
    page.address("distance=0.6")
    assert page.copy("a") == 1
    assert page.copy("b") == 2
    page.blink(["/a", "/b"])
    for kind in ("report", "address", "copy", "blink"):
        assert html.content.count(f'data-faceambig="{kind}"') == 1
    assert "/a" in html.content
    page._take('{"key": "Escape"}')  # the page has ended it by itself
    assert "/a" not in html.content


def test_one_line_for_nonsense_and_the_rest_is_heard(caplog: pytest.LogCaptureFixture) -> None:
    heard: list[Any] = []
    page, _ = made(heard)
    with caplog.at_level(logging.WARNING):
        for text in ("{", "[]", '{"gone": 4}', "{"):
            page._take(text)
    assert heard == [Gone(4)]
    assert len(caplog.records) == 1


@pytest.mark.parametrize(
    ("call", "value", "words"),
    [
        ("address", "a b", "query 'a b'"),
        ("address", "a#b", "query 'a#b'"),
        ("address", "a" * (LONGEST + 1), f"at most {LONGEST}"),
        ("theme", "blue", "theme 'blue': auto, light or dark"),
    ],
)
def test_what_cannot_be_sent_is_refused(call: str, value: str, words: str) -> None:
    page, _ = made([])
    with pytest.raises(ValueError, match=words):
        getattr(page, call)(value)


def test_blink_never_flashes_and_text_has_a_size() -> None:
    page, _ = made([])
    with pytest.raises(ValueError, match=r"seconds 0\.1: from 0\.4"):
        page.blink(["/a"], 0.1)
    with pytest.raises(ValueError, match="text 3: from 1 to 2"):
        page.theme("auto", 3)


def test_dark() -> None:
    assert [is_dark(t, s) for t in ("auto", "light", "dark") for s in (False, True)] == [
        *(False, True),
        *(False, False),
        *(True, True),
    ]
