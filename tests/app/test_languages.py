"""The language of a browser, from the first words on: by its request, then by what the page's script tells."""

from __future__ import annotations

import json
from collections.abc import Iterator

import pytest

from faceambig_app import browser as browser_module
from faceambig_app import server
from faceambig_app.guard import requests
from faceambig_app.text import say, speaking
from guarded import Browser, until

SOON = 60.0  # seconds: other tests share the processors


@pytest.mark.parametrize(
    ("values", "tags"),
    [
        (["de-AT,de;q=0.9,en;q=0.8"], ("de-AT", "de", "en")),
        (["en;q=0.5, de"], ("de", "en")),
        (["en;q=0.5", "de;q=0.7"], ("de", "en")),  # two lines are one list
        (["de;q=0, en ; Q=1"], ("en",)),  # 0: not wanted
        (["*", "de;q=x", "de;q=0.1234", "en;q=2", "", "x" * 41, "\u00e4"], ()),
        ([], ()),
    ],
)
def test_a_request_names_languages_dearest_first(values, tags):
    assert requests.preferred(values) == tags


@pytest.fixture(scope="module")
def page() -> Iterator[server.Page]:
    served = server.Page("127.0.0.1", 0)
    yield served
    served.close()


def labels(visitor: Browser) -> list[str]:
    """Of all sliders that were made for a browser, in order."""
    visitor.read()
    return [m["props"]["label"] for m in visitor.messages if m["type"] == "GuiSliderMessage"]


@pytest.mark.parametrize(("asked", "spoken"), [("de-AT,de;q=0.9", "de"), ("fr", "en")])
def test_the_panel_is_there_before_the_script_says_a_word(monkeypatch, page, asked, spoken):
    """Its way to the script and back is not waited for; the same language then makes nothing anew."""
    monkeypatch.setattr(browser_module, "HELLO", 10 * SOON)  # so nothing else can bring the panel
    port = int(page.address.rsplit(":", 1)[1].strip("/"))
    with Browser(port, additional_headers={"Accept-Language": asked}) as visitor:
        with speaking(spoken):
            distance = say("field.distance")
        assert until(lambda: distance in labels(visitor), SOON)
        made = len(labels(visitor))
        (one,) = until(lambda: list(page._browsers.values()), SOON)
        hello = {
            "query": "distance=0.5", "reduced_motion": False, "touch": False, "dark": False,
            "theme": None, "text": None, "languages": [spoken],
        }  # fmt: skip
        visitor.set(one.script._control, json.dumps({"hello": hello}))
        assert until(lambda: one.room.state.distance == 0.5, SOON)
        assert until(lambda: one._pointer.settled is not None, SOON)
        assert len(labels(visitor)) == made
    assert until(lambda: not page._browsers, SOON)
