"""Chromium for the tests of the page."""

from __future__ import annotations

import ctypes
import os
import shutil
import sys
from collections.abc import Callable, Iterator
from typing import NoReturn

import pytest
from playwright.sync_api import Browser, Error, Page, sync_playwright

FLAGS = [
    "--use-angle=swiftshader",  # the same pixels with and without a graphics card
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
]


def give_up(words: str) -> NoReturn:
    """A skip with its reason; where CI=true, a failure."""
    if os.environ.get("CI") == "true":
        pytest.fail(words, pytrace=False)
    pytest.skip(words)


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """Chromium: FACEAMBIG_CHROMIUM, one on the path, or playwright's own."""
    if sys.platform == "linux":
        try:  # playwright's Node needs it, and without it dies with no more than "Connection closed"
            ctypes.CDLL("libatomic.so.1")
        except OSError:
            give_up("playwright cannot start: apt-get install libatomic1")
    named = os.environ.get("FACEAMBIG_CHROMIUM")
    found = named or next(
        filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
    )
    with sync_playwright() as playwright:
        try:
            chromium = playwright.chromium.launch(executable_path=found, args=FLAGS)
        except Error as error:
            words = f"no browser at {found or 'any place'}: apt-get install chromium, or playwright install chromium"
            give_up(f"{words}: {error.message.splitlines()[0]}")
        yield chromium
        chromium.close()


@pytest.fixture(scope="module")
def page_url(browser: Browser) -> Iterator[Callable[..., Page]]:
    """Opens an address in a context of its own. After the module its console must have been clean.

    Give `wait_for_function` a function, "() => ...": the page's policy refuses expressions.
    """
    opened = []

    def go(url: str, width: int = 800, height: int = 450) -> Page:
        page = browser.new_page(viewport={"width": width, "height": height})
        problems: list[str] = []
        page.on(
            "console",
            lambda message: problems.append(message.text) if message.type == "error" else None,
        )
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.goto(url)
        opened.append((page, problems))
        return page

    yield go
    for page, problems in opened:
        page.close()
        # viser's sorter of splats, which we do not draw, asks for eval once: the policy refuses it
        left = [text for text in problems if "'unsafe-eval' is not an allowed source" not in text]
        assert not left
