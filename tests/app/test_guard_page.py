"""The page itself behind the guard: what a person types or sends stays text, and goes with them."""

from __future__ import annotations

import gc
import json
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from faceambig_app import server
from guarded import Browser, begin, piece, until

MARKUP = (
    "<img src=x onerror=owned()>", "<script>owned()</script>", '"><svg onload=owned()>', "[a](javascript:owned())",
    '<iframe srcdoc="<script>owned()</script>">',
)  # fmt: skip
# What viser puts into the page as HTML, or renders as markdown
RENDERED = ("_markdown", "content", "_icon_html", "_plotly_json_str")


@pytest.fixture(scope="module")
def page() -> Iterator[server.Page]:
    page = server.Page("127.0.0.1", 0)
    yield page
    page.close()


@pytest.fixture
def browser(page: server.Page) -> Iterator[Browser]:
    with Browser(int(page.address.rstrip("/").rpartition(":")[2])) as browser:
        assert until(lambda: browser.read() or controls(browser, "GuiSliderMessage"))
        yield browser
    assert until(lambda: not page._browsers)


def controls(browser: Browser, kind: str) -> list[Any]:
    """Controls of one kind, as the messages of the tests name them."""
    return [
        SimpleNamespace(_impl=SimpleNamespace(uuid=message["uuid"]))
        for message in browser.messages
        if message["type"] == kind
    ]


def rendered(message: dict[str, Any]) -> list[str]:
    """The texts of a message that become elements of the page."""
    found = {**message.get("props", {}), **message.get("updates", {})}
    return [text for name in RENDERED if isinstance(text := found.get(name), str)]


def test_what_is_typed_or_named_comes_back_as_text(browser: Browser) -> None:
    texts = controls(browser, "GuiTextMessage")
    uploads = controls(browser, "GuiUploadButtonMessage")
    assert texts
    assert uploads
    for k, words in enumerate(MARKUP):
        before = len(browser.messages)
        for text in texts:
            browser.set(text, words)
            browser.set(text, json.dumps({"hello": words, "query": f"distance={words}&{words}=1"}))
        for n, button in enumerate(uploads):
            browser.send(begin(button, f"{k}-{n}", 5, name=f"{words}.png"))
            browser.send(piece(button, f"{k}-{n}", 0, b"\x00" * 5))

        def notices(first: int = before) -> list[Any]:
            browser.read()
            return [m for m in browser.messages[first:] if m["type"] == "NotificationShowMessage"]

        assert until(notices)  # a file of zeros is none, and that is said
    shown = [text for message in browser.messages for text in rendered(message)]
    assert shown
    for words in MARKUP:
        assert not [text for text in shown if words in text]


def test_a_file_goes_with_the_browser_that_sent_it(page: server.Page, browser: Browser) -> None:
    marker = b"%marker-of-a-face%"
    for k, button in enumerate(controls(browser, "GuiUploadButtonMessage")):
        data = marker + bytes([k]) * 100
        browser.send(begin(button, str(k), len(data)))
        browser.send(piece(button, str(k), 0, data))
    browser.read(0.5)
    browser.socket.close()
    assert until(lambda: not page._browsers)

    def left() -> int:
        gc.collect()
        kept = (o for o in gc.get_objects() if isinstance(o, dict | list | tuple))
        values = (v for o in kept for v in list(o.values() if isinstance(o, dict) else o))
        return sum(type(v) is bytes and len(v) > len(marker) and marker in v for v in values)

    assert until(lambda: left() == 0), left()
