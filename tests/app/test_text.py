"""The words: each that the page asks for is in the file, each in the file is asked for, none stands in the code."""

from __future__ import annotations

import ast
import inspect
import re
import string
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

import pytest

from faceambig.errors import AssetError
from faceambig_app import own, panel, text
from faceambig_app.actions import ACTIONS
from faceambig_app.guard import page
from faceambig_app.panel import compare, data, explore, flex, lessons, view, widgets
from faceambig_app.state import DEFAULT
from faceambig_app.text import centimetres, distance_text, percent_number, say, words

ROOT = Path(__file__).parents[2]
APP = ROOT / "app" / "faceambig_app"
MODULES = {
    ".".join(path.relative_to(APP).with_suffix("").parts): ast.parse(
        path.read_text(encoding="utf-8")
    )
    for path in sorted(APP.rglob("*.py"))
}
FILE = tomllib.loads((ROOT / "assets" / "text" / "en.toml").read_text(encoding="utf-8"))
KEYS = {f"{section}.{name}" for section, names in FILE.items() for name in names}
SPEAKING = [name for name, tree in MODULES.items() if "say" in ast.dump(tree) and name != "text"]


def calls(tree: ast.AST) -> Iterator[ast.Call]:
    """Calls of say(...)."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "say":
            yield node


def pattern(key: ast.expr) -> str:
    """A regular expression of the keys an argument of say() may be; {name} in an f-string is any name."""
    if isinstance(key, ast.Constant) and isinstance(key.value, str):
        return re.escape(key.value)
    assert isinstance(key, ast.JoinedStr), ast.unparse(key)
    return "".join(
        re.escape(str(part.value)) if isinstance(part, ast.Constant) else "[a-z_]+"
        for part in key.values
    )


ASKED = {
    (module, pattern(call.args[0])) for module, tree in MODULES.items() for call in calls(tree)
}


def test_every_word_asked_for_is_in_the_file():
    assert SPEAKING
    assert len(ASKED) > 40
    missing = [ask for ask in ASKED if not any(re.fullmatch(ask[1], key) for key in KEYS)]
    assert missing == []


@pytest.fixture
def recorded(monkeypatch: pytest.MonkeyPatch) -> set[str]:
    """Keys that are really looked up."""
    seen: set[str] = set()

    def heard(key: str, **values: Any) -> str:
        seen.add(key)
        return say(key, **values)

    for module in (panel, compare, data, explore, flex, lessons, view, widgets):
        if hasattr(module, "say"):
            monkeypatch.setattr(module, "say", heard)
    return seen


def test_every_word_of_the_file_is_asked_for(recorded):
    # keys put together from names are those that a real panel looks up
    shown = panel.Panel(
        MagicMock(),
        {1: "a"},
        lambda _: None,
        lambda _: None,
        narrow=False,
        own=MagicMock(),
        use_hint=lambda: None,
        saving=MagicMock(),
        lessons_do=MagicMock(),
        class_do=MagicMock(),
    )
    shown.spoken(DEFAULT)
    exact = {ask.replace("\\", "") for _, ask in ASKED if "[" not in ask}
    commands = {f"action.{name}{end}" for name in ACTIONS for end in ("", "_hint")}
    # whole sections go to the page's script
    whole = set(re.findall(r'words\(\)\["(\w+)"\]', inspect.getsource(page)))
    scripted = {key for key in KEYS if key.split(".")[0] in whole}
    points = {f"point.{name}" for name in own.NAMED}
    assert KEYS - exact - recorded - commands - scripted - points == set()
    assert (exact | recorded | commands | points) - KEYS == set()


def test_every_call_fills_in_the_names_its_words_have():
    for module, tree in MODULES.items():
        for call in calls(tree):
            key = call.args[0]
            if not (isinstance(key, ast.Constant) and isinstance(key.value, str)):
                continue
            section, name = key.value.split(".")
            needed = {
                part for _, part, _, _ in string.Formatter().parse(FILE[section][name]) if part
            }
            assert needed == {keyword.arg for keyword in call.keywords}, (module, key.value)


def test_say_fills_in_and_does_not_read_what_it_filled_in():
    assert say("plot.true", distance="{distance} %s") == "true: {distance} %s"
    with pytest.raises(KeyError):
        say("plot.nothing")


def without_markup(pieces: str) -> str:
    """What a reader sees of HTML or SVG in which \0 stands for values: no tags, styles, or halves of tags."""
    seen = re.sub(r"<(style|defs)\b.*?</\1>", "", pieces, flags=re.DOTALL)
    seen = re.sub(r"<[^<>]*>", "", seen)
    seen = re.sub(r"<[a-z]+ [^<>]*$", "", seen)  # a tag that the next string ends
    return re.sub(r'(^| )[a-z-]+="[^"]*"?[^<>]*>?', "", seen)  # its end


def shown_literals(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Strings of a module that a reader may see: no comments, names, keys, errors, logs."""
    skipped: set[ast.AST] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            skipped.add(node.value)  # a docstring
        if isinstance(node, ast.Dict):
            skipped.update(key for key in node.keys if key is not None)
        if isinstance(node, ast.Raise | ast.Subscript):
            skipped.update(ast.walk(node))
        if isinstance(node, ast.Call):
            name = ast.unparse(node.func)
            # print and log go to the terminal
            if name in ("say", "print", "getattr", "re.compile") or name.startswith("log"):
                skipped.update(ast.walk(node))
        if isinstance(node, ast.JoinedStr) and node not in skipped:
            # one string: its pieces are read together
            parts = [p.value if isinstance(p, ast.Constant) else "\0" for p in node.values]
            skipped.update(p for p in node.values if isinstance(p, ast.Constant))
            yield node.lineno, "".join(str(part) for part in parts)
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node not in skipped:
            yield node.lineno, node.value


# Names of things in the program and style rules: small letters without a space
NOT_WORDS = re.compile(r"[a-z0-9_.:;()=+/?\0\[\]\"-]*")


@pytest.mark.parametrize(
    "module",
    [
        m
        for m in SPEAKING
        if m.split(".")[0] not in ("cli", "commands", "guard", "photo", "__init__")
    ],
)
def test_no_english_stands_in_the_code_that_speaks(module):
    found = []
    for line, literal in shown_literals(MODULES[module]):
        seen = without_markup(literal).strip(" \0")
        if re.search(r"[A-Za-z]{3}", seen) and not NOT_WORDS.fullmatch(seen):
            found.append(f"{module}:{line}: {seen!r}")
    assert found == []


def test_a_language_without_a_file_is_said():
    with pytest.raises(AssetError, match="language 'xx': no such file of words"):
        words("xx")


NARROW = text.NARROW


@pytest.mark.parametrize(
    ("metres", "sentence", "control"),
    [
        (0.2, "20_cm", "20_cm"),
        (0.305, "30.5_cm", "30.5_cm"),
        (0.9994, "99.9_cm", "99.9_cm"),
        (0.9996, "1_m", "100_cm"),
        (1.0, "1_m", "100_cm"),
        (1.234, "1.23_m", "123_cm"),
        (2.4, "2.4_m", "240_cm"),
        (5.0, "5_m", "500_cm"),
    ],
)
def test_distances_are_said_with_their_unit_kept_beside(metres, sentence, control):
    assert distance_text(metres) == sentence.replace("_", NARROW)
    assert centimetres(metres) == control.replace("_", NARROW)


def test_no_distance_is_far_away():
    assert distance_text(None) == centimetres(None) == say("app.far")


@pytest.mark.parametrize(
    ("value", "written"),
    [
        (0.0, "0.00"),
        (0.994, "0.99"),
        (0.996, "1.0"),
        (1.04, "1.0"),
        (12.34, "12.3"),
        (-0.0, "0.00"),
    ],
)
def test_percent_has_two_decimals_below_one(value, written):
    assert percent_number(value) == written
