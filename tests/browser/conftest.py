"""Chromium for the tests of the page."""

from __future__ import annotations

import ctypes
import importlib.resources
import os
import shutil
import sys
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, Error, Page, sync_playwright

from faceambig_app import server
from visitor import PATIENCE, Visitor, give_up

FLAGS = [
    "--use-angle=swiftshader",  # the same pixels with and without a graphics card
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
]


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
        page.set_default_timeout(PATIENCE)
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
        assert not ours(problems)


def ours(problems: list[str]) -> list[str]:
    """All but what viser says of itself.

    Its sorter of splats, which we do not draw, asks for eval once: the policy refuses it. What comes within one picture
    it does in another order, removals before updates: of a panel that is made anew in the language of the address it
    misses elements that were there (that ours are sent in order is tested in test_failed_frame).
    """
    own = ("'unsafe-eval' is not an allowed source", "Tried to update non-existent component")
    return [text for text in problems if not any(words in text for words in own)]


@pytest.fixture(scope="module")
def served() -> Iterator[server.Page]:
    """The page on a free port."""
    page = server.Page("127.0.0.1", 0)
    yield page
    page.close()


@pytest.fixture(scope="module")
def visit(browser: Browser, served: server.Page) -> Iterator[Callable[..., Visitor]]:
    """Opens the page in a context of its own: visit(width, height, query, option of the context...).

    Small and coarse, for behaviour. After the module every console must have been clean.
    """
    opened: list[tuple[Any, list[str]]] = []

    def go(
        width: int = 1150, height: int = 560, query: str = "", dpr: float = 0.25, **options: Any
    ) -> Visitor:
        context = browser.new_context(viewport={"width": width, "height": height}, **options)
        context.set_default_timeout(PATIENCE)
        tab = context.new_page()
        problems: list[str] = []
        tab.on("console", lambda m: problems.append(m.text) if m.type == "error" else None)
        tab.on("pageerror", lambda error: problems.append(str(error)))
        opened.append((context, problems))
        known = set(served._browsers)
        tab.goto(f"{served.address}?fixedDpr={dpr:g}{query and '&' + query}")
        return Visitor(tab, served, known)

    yield go
    for context, problems in opened:
        context.close()
        assert not ours(problems)


@pytest.fixture(scope="module")
def first_visitor(visit: Callable[..., Visitor]) -> Visitor:
    """A browser at a desk."""
    return visit(permissions=["clipboard-read", "clipboard-write"])


@pytest.fixture
def me(first_visitor: Visitor) -> Visitor:
    """The browser at a desk, at the first state."""
    first_visitor.start_again()
    return first_visitor


@pytest.fixture(scope="module")
def axe() -> str:
    """The source of axe-core, of the wheel of axe-playwright-python."""
    try:
        file = importlib.resources.files("axe_playwright_python") / "axe.min.js"
    except ModuleNotFoundError:
        give_up("axe-core is not installed: pip install axe-playwright-python")
    return file.read_text(encoding="utf-8")
