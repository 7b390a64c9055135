"""The words: each that the page asks for is in the file, each in the file is asked for, none stands in the code."""

from __future__ import annotations

import ast
import inspect
import re
import string
import tomllib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

import pytest

import faceambig as fa
from faceambig.errors import AssetError
from faceambig.render.sheet import WORDS
from faceambig.surface import DIRECTIONS, LANDMARK_GROUPS
from faceambig_app import own, panel, text
from faceambig_app.guard import page
from faceambig_app.panel import compare, data, explore, flex, lessons, view, widgets
from faceambig_app.reports.report import VERDICTS
from faceambig_app.state import DEFAULT
from faceambig_app.state.actions import ACTIONS
from faceambig_app.state.fields import FIELDS, LANGUAGES
from faceambig_app.text import (
    AUTO,
    accepted,
    centimetres,
    distance_text,
    drawn_words,
    each_language,
    language,
    movement,
    numeral,
    percent_number,
    say,
    speaking,
    words,
)  # fmt: skip

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


OTHERS = {
    path.stem: tomllib.loads(path.read_text(encoding="utf-8"))
    for path in sorted((ROOT / "assets" / "text").glob("*.toml"))
    if path.stem != "en"
}
# What a mode moves, as the library says it
MOVED = {
    *(way for ways in DIRECTIONS for way in ways), *LANDMARK_GROUPS, *fa.load_model("embedded").regions, "face",
}  # fmt: skip
# The same in every language: names, signs, and words that are spelt alike
ALIKE = {
    "de": {
        "app.title", "photo.point", "stage.bar", "view.three_quarter", "flex.slider", "flex.mark_tolerance",
        "player.pause", "error_scale.1", "error_scale.5", "error_scale.10", "error_scale.20", "own.from_file",
        "drawn.bar", "export.scale", "panel.export", "lang.en", "lang.de", "field.subject",
    }
}  # fmt: skip


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
    signs = {"app.decimal", "app.thousands"}
    reported = {
        f"report.{name}" for name in (*VERDICTS.values(), "says", "paper", "ours", "verdict")
    }
    drawn = {f"drawn.{name}" for name in set(WORDS) - {"decimal"}}
    moved = {f"moves.{name}" for name in MOVED}
    others = commands | points | signs | reported | moved | drawn
    assert KEYS - exact - recorded - scripted - others == set()
    assert (exact | recorded | others) - KEYS == set()


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


def placeholders(words: str) -> set[str]:
    """Names that are filled in."""
    return {part for _, part, _, _ in string.Formatter().parse(words) if part}


@pytest.mark.parametrize("language", OTHERS)
def test_a_language_has_the_words_of_every_other(language):
    file = OTHERS[language]
    assert {section: set(names) for section, names in file.items()} == {
        section: set(names) for section, names in FILE.items()
    }
    for section, names in file.items():
        for name, said in names.items():
            assert said.strip(), (section, name)
            assert placeholders(said) == placeholders(FILE[section][name]), (section, name)


# What no text of ours says of a face, or of a guess; in lessons alone an assumed distance may be wrong
JUDGING = {
    "en": r"distort|flatter|ugly|beautiful|your? real|real you|\bsimply\b|wrong (?!distance|one\b|camera|assumption)",
    "de": r"verzerr|entstell|schmeichel|hässlich|schöne|dein wahres|wirkliches ich"
    r"|falsche[snrm]? (?!Abstand|Kamera|Annahme|schlechter|steigt)",
}


@pytest.mark.parametrize("language", JUDGING)
def test_no_text_judges_a_face_or_a_guess(language):
    folder = ROOT / "assets"
    said = (folder / "text" / f"{language}.toml").read_text(encoding="utf-8")
    lessons_said = [
        path.read_text(encoding="utf-8") for path in (folder / "lessons" / language).glob("*.md")
    ]
    assert len(lessons_said) == 5
    for words_of in (said, *lessons_said):
        flat = " ".join(words_of.split())
        assert not re.findall(rf".{{20}}(?:{JUDGING[language]}).{{20}}", flat, re.IGNORECASE)
    assert not re.search(r"\bwrong\b|\bfalsch", said, re.IGNORECASE)
    assert "!" not in "".join(
        said for names in tomllib.loads(said).values() for said in names.values()
    )


@pytest.mark.parametrize("language", OTHERS)
def test_no_english_is_left_in_another_language(language):
    alike = {
        f"{section}.{name}"
        for section, names in OTHERS[language].items()
        for name, said in names.items()
        if said == FILE[section][name]
    }
    assert alike == ALIKE[language]


@pytest.mark.parametrize("language", OTHERS)
def test_choices_that_stand_together_are_told_apart(language):
    # a row of buttons finds out by its words which was pressed
    for field in FIELDS.values():
        shown = [OTHERS[language].get(field.name, {}).get(str(choice)) for choice in field.choices]
        shown = [label for label in shown if label is not None]
        assert len(set(shown)) == len(shown), field.name
    # and so does a row of actions
    said = [[file["action"][name] for name in ACTIONS] for file in (FILE, OTHERS[language])]
    same = [{(i, k) for i in range(len(row)) for k in range(i) if row[i] == row[k]} for row in said]
    assert same[1] <= same[0]


def test_the_languages_are_those_that_have_a_file():
    assert {"en", *OTHERS} == set(LANGUAGES)
    folders = {path.name for path in (ROOT / "assets" / "lessons").iterdir() if path.is_dir()}
    assert folders == set(LANGUAGES)


def test_a_thread_speaks_the_language_it_was_told():
    def asked(language: str) -> tuple[str, str, str]:
        with speaking(language):
            return say("number.d_l"), percent_number(0.391), distance_text(1.2)

    with ThreadPoolExecutor(2) as pool:
        heard = list(pool.map(asked, ["de", "en"] * 4))
    german = ("Landmarken-Fehler", "0,39", "1,2\u202fm")
    assert heard == [german, ("Landmark error", "0.39", "1.2\u202fm")] * 4
    assert language() == "en"


def test_what_is_kept_is_kept_for_each_language():
    calls_of: list[str] = []

    @each_language(maxsize=4)
    def title(key: str) -> str:
        calls_of.append(language())
        return say(key)

    for _ in range(2):
        assert title("head.true") == "True face"
        with speaking("de"):
            assert title("head.true") == "Wahres Gesicht"
    assert calls_of == ["en", "de"]


# Functions that keep what they return: none of them says a word, or it keeps each language's by itself
@pytest.mark.parametrize("module", SPEAKING)
def test_nothing_that_is_kept_says_a_word_of_one_language(module):
    speakers = {"say", "distance_text", "centimetres", "percent_number", "numeral", "movement"}
    for node in ast.walk(MODULES[module]):
        if isinstance(node, ast.FunctionDef) and any(
            "cache" in ast.unparse(decorator) for decorator in node.decorator_list
        ):
            names = {n.id for n in ast.walk(node) if isinstance(n, ast.Name)}
            assert not names & speakers, (module, node.name)


def test_auto_leaves_the_language_as_it_is():
    with speaking("de"), speaking(AUTO):
        assert language() == "de"


@pytest.mark.parametrize(
    ("tags", "found"),
    [
        (("de-AT", "en"), "de"),
        (("fr", "de"), "de"),
        (("en-GB", "de"), "en"),
        (("fr",), "en"),
        ((), "en"),
        (("DE",), "de"),
    ],
)
def test_a_browser_gets_the_first_of_its_languages_that_there_is(tags, found):
    assert accepted(tags) == found


def test_a_number_alone_is_filled_in_with_the_decimal_sign_of_the_language():
    with speaking("de"):
        assert say("pin.d_s", d_s="4.1") == "Oberflächen-Unterschied 4,1\u202fmm"
        assert say("pin.d_s", d_s="\u22124.1") == "Oberflächen-Unterschied \u22124,1\u202fmm"
        assert (
            say("plot.true", distance="v. 1.5 a") == "wahr: v. 1.5 a"
        )  # no number: somebody's words
        assert numeral("9,201.5") == "9.201,5"


def test_pictures_say_in_english_what_the_library_draws():
    assert drawn_words() == WORDS
    with speaking("de"):
        assert drawn_words().keys() == WORDS.keys()
        assert drawn_words()["decimal"] == ","


def test_what_a_mode_moves_is_said_in_the_language():
    with speaking("de"):
        assert movement("nose forward, ears back") == "Nase nach vorn, Ohren nach hinten"
        assert movement("left cheek wider") == "left cheek breiter"  # a model's own part
    assert movement("nose forward, ears back") == "nose forward, ears back"


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
        if isinstance(node, ast.JoinedStr) and "default-src" in ast.unparse(node):
            skipped.update((node, *node.values))  # a policy, which browsers read
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
        if m.split(".")[0] not in ("cli", "commands", "guard")
        and m != "reports.photo"
        and not m.endswith("__init__")
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
