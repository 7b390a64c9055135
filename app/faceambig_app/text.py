"""The words of the page and of pictures, one file a language: assets/text/<language>.toml."""

from __future__ import annotations

import tomllib
from functools import lru_cache
from typing import Any

from faceambig.errors import AssetError
from faceambig.io import asset_path

NARROW = "\u202f"  # thin space that does not break, before units


@lru_cache(maxsize=8)
def words(language: str = "en") -> dict[str, dict[str, str]]:
    """Sections of words of a language; AssetError if there is no such file."""
    path = asset_path(f"text/{language}.toml")
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise AssetError(f"language {language!r}: no such file of words") from error


def say(key: str, **values: Any) -> str:
    """The words at "section.name", filled in."""
    section, name = key.split(".")
    text = words()[section][name]
    return text.format(**values) if values else text


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
    return f"{value:.2f}" if value < 0.995 else f"{value:.1f}"


def _digits(value: float) -> str:
    """Three significant digits without trailing zeros."""
    return f"{float(f'{value:.3g}'):g}"
