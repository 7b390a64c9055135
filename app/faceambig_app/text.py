"""The words of the page and of pictures, one file a language: assets/text/<language>.toml."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import lru_cache, wraps
from typing import Any, ParamSpec, TypeVar

from faceambig.errors import AssetError
from faceambig.io import asset_path

from .state.fields import LANGUAGES

NARROW = "\u202f"  # thin space that does not break, before units


AUTO = "auto"  # the language that is spoken already
_DECIMAL = re.compile(r"[-+\u2212]?\d+\.\d+", re.ASCII)

_P = ParamSpec("_P")
_T = TypeVar("_T")

# Of the thread or task that speaks: at one server each browser has its own
_spoken: ContextVar[str] = ContextVar("language of the words", default=LANGUAGES[0])


def language() -> str:
    """The language that is spoken here."""
    return _spoken.get()


@contextmanager
def speaking(language: str) -> Iterator[None]:
    """All words within are of this language; AUTO changes nothing.

    What is called later from within, by the loop or as a task, speaks it too; another thread does not.
    """
    if language == AUTO:
        yield
        return
    before = _spoken.set(language)
    try:
        yield
    finally:
        _spoken.reset(before)


def accepted(tags: Iterable[str]) -> str:
    """The first of a browser's languages (de-AT, en) that there is; English if there is none."""
    wanted = (tag.partition("-")[0].lower() for tag in tags)
    return next((tag for tag in wanted if tag in LANGUAGES), LANGUAGES[0])


def each_language(maxsize: int) -> Callable[[Callable[_P, _T]], Callable[_P, _T]]:
    """lru_cache for a function that returns words: kept for each language by itself."""

    def cached(function: Callable[_P, _T]) -> Callable[_P, _T]:
        @lru_cache(maxsize=maxsize)
        def kept(_language: str, *given: _P.args, **named: _P.kwargs) -> _T:
            return function(*given, **named)

        @wraps(function)
        def asked(*given: _P.args, **named: _P.kwargs) -> _T:
            return kept(language(), *given, **named)

        return asked

    return cached


def words(of: str | None = None) -> dict[str, dict[str, str]]:
    """Sections of words of a language, by default of the one that is spoken; AssetError if there is no such file."""
    return _read(language() if of is None else of)


@lru_cache(maxsize=8)
def _read(language: str) -> dict[str, dict[str, str]]:
    path = asset_path(f"text/{language}.toml")
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise AssetError(f"language {language!r}: no such file of words") from error


def say(key: str, **values: Any) -> str:
    """The words at "section.name", filled in; a value that is a number alone with the language's decimal sign."""
    section, name = key.split(".")
    text = words()[section][name]
    if not values:
        return text
    return text.format(**{name: _numeral(value) for name, value in values.items()})


def _numeral(value: Any) -> Any:
    return (
        numeral(value)
        if isinstance(value, str) and _DECIMAL.fullmatch(value) is not None
        else value
    )


def numeral(digits: str) -> str:
    """Digits as Python writes them, 9,201.5, with the signs of the language."""
    signs = words()["app"]
    return digits.translate({ord("."): signs["decimal"], ord(","): signs["thousands"]})


def drawn_words() -> dict[str, str]:
    """What the library writes into a picture, for its `draw`."""
    return words()["drawn"] | {"decimal": words()["app"]["decimal"]}


def movement(english: str) -> str:
    """What a flexibility mode moves, as the library says it ("nose forward, ears back"), in the language.

    A part that a model names itself keeps its name.
    """
    known, said = words()["moves"], []
    for each in english.split(", "):
        part, _, way = each.rpartition(" ")
        said.append(f"{known.get(part, part)} {known.get(way, way)}".strip())
    return ", ".join(said)


def distance_text(metres: float | None) -> str:
    """30 cm, 1.2 m: as in sentences; None is the far-away camera."""
    if metres is None:
        return say("app.far")
    if metres < 0.9995:
        return f"{_digits(100 * metres)}{NARROW}cm"
    return f"{_digits(metres)}{NARROW}m"


def centimetres(metres: float | None) -> str:
    """30 cm, 120 cm: as on controls and plots."""
    return say("app.far") if metres is None else f"{_digits(100 * metres)}{NARROW}cm"


def percent_number(value: float) -> str:
    """d_L: two decimals below 1, one above; never minus zero."""
    value = abs(value)
    return numeral(f"{value:.2f}" if value < 0.995 else f"{value:.1f}")


def _digits(value: float) -> str:
    """Three significant digits without trailing zeros."""
    return numeral(f"{float(f'{value:.3g}'):g}")
