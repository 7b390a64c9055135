"""docs/ambiguity_player.html, the page for whoever has a minute, is what the exporter writes now."""

from __future__ import annotations

import base64
import json
import re
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from faceambig_app.export import player
from faceambig_app.state import ViewState

FILE = Path(__file__).resolve().parents[2] / "docs" / "ambiguity_player.html"
AGAIN = "faceambig animate --out docs/ambiguity_player.html"


@pytest.fixture(scope="module")
def written() -> str:
    return player.page(ViewState())[1].decode()


@pytest.fixture(scope="module")
def stored() -> str:
    return FILE.read_text(encoding="utf-8")


def element(text: str, name: str) -> str:
    (found,) = re.findall(rf'<script [^>]*id="{name}">(.*?)</script>', text, re.DOTALL)
    return found


def without_numbers(text: str) -> str:
    """Everything but what a machine may round differently: the two data elements, the photograph, the plots' paths."""
    for name in ("data", "geometry"):
        text = text.replace(element(text, name), "")
    return re.sub(r'( d| points|src| [xy][12]?| c[xy])="[^"]*"', r"\1", text)


def rows(text: str) -> dict[str, np.ndarray]:
    """The arrays of the page, as its script reads them."""
    data, at, found = zlib.decompress(base64.b64decode(element(text, "geometry"))), 0, {}
    for part in json.loads(element(text, "data"))["arrays"]:
        kind = np.dtype("<" + part["kind"])
        count = part["rows"] * part["columns"]
        steps = np.frombuffer(data, kind, count, at).reshape(part["rows"], part["columns"])
        found[part["name"]] = np.cumsum(steps, axis=1, dtype=kind)
        at += count * kind.itemsize
    return found


def words(text: str) -> list[dict[str, Any]]:
    return [track["stops"] for track in json.loads(element(text, "data"))["tracks"]]


def test_its_frame_script_and_words_are_todays(written: str, stored: str) -> None:
    assert without_numbers(stored) == without_numbers(written), AGAIN
    assert words(stored) == words(written), AGAIN


def test_its_faces_are_todays(written: str, stored: str) -> None:
    now, then = rows(written), rows(stored)
    assert now.keys() == then.keys()
    for name in ("faces", "measured", "colours"):
        assert np.array_equal(now[name], then[name]), name
    for name in (
        "truth",
        "base",
    ):  # whole steps of 8 micrometres: the last may be rounded the other way
        assert np.abs(now[name].astype(int) - then[name]).max() <= 1, name


def test_it_is_about_a_megabyte_and_asks_nobody(stored: str) -> None:
    assert len(stored) < 1_200_000
    assert "default-src 'none'" in stored
    assert not re.search(r'(?:src|href)="(?!data:|#)', stored)


def test_the_readme_and_the_first_page_lead_to_it() -> None:
    root = FILE.parents[1]
    assert "(docs/ambiguity_player.html)" in (root / "README.md").read_text(encoding="utf-8")
    assert 'href="ambiguity_player.html"' in (root / "docs/index.md").read_text(encoding="utf-8")
