"""The guard in Chromium: what another site can do with the page, and what its links may."""

from __future__ import annotations

import http.server
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest
from playwright.sync_api import Browser, Page

from guarded import Tiny, tiny_page, until
from visitor import PATIENCE

pytestmark = pytest.mark.browser

TOKEN = "a-token-of-the-class-1"


@dataclass
class Elsewhere:
    """A site of a stranger, by a name that is not ours: another site for the browser."""

    port: int
    asked: list[str] = field(default_factory=list)
    body: str = ""

    @property
    def url(self) -> str:
        return f"http://localhost:{self.port}/"


@pytest.fixture
def elsewhere() -> Iterator[Elsewhere]:
    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            site.asked.append(self.path)
            data = f"<!doctype html><title>elsewhere</title><body>{site.body}".encode()
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.send_header("Access-Control-Allow-Origin", "*")
            self.send_header("Content-Length", str(len(data)))
            self.end_headers()
            self.wfile.write(data)

        def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - its name there
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        site = Elsewhere(server.server_address[1])
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield site
        server.shutdown()
        thread.join()


@pytest.fixture(scope="module")
def tiny() -> Iterator[Tiny]:
    with tiny_page(token=TOKEN) as page:
        yield page


@pytest.fixture
def tab(browser: Browser) -> Iterator[Page]:
    with browser.new_context(viewport={"width": 320, "height": 240}) as context:
        context.set_default_timeout(PATIENCE)
        yield context.new_page()


def follow(tab: Page, elsewhere: Elsewhere, target: str) -> None:
    """A click on a link of the other site, as in a chat in the browser."""
    elsewhere.body = f'<a href="{target}">come in</a>'
    tab.goto(elsewhere.url)
    tab.get_by_text("come in").click()


def test_the_link_works_from_a_chat_and_its_cookie_too(
    tiny: Tiny, elsewhere: Elsewhere, tab: Page
) -> None:
    ours = f"http://{tiny.netloc}/"
    follow(tab, elsewhere, f"{ours}?view=side")
    tab.wait_for_url(f"{ours}?view=side&again")
    assert "needs its link" in tab.inner_text("body")
    assert not tiny.sessions

    follow(tab, elsewhere, f"{ours}?view=side&token={TOKEN}")
    tab.wait_for_url(f"{ours}?view=side")
    assert until(lambda: tiny.sessions == 1, PATIENCE / 1000)
    cookie = next(c for c in tab.context.cookies() if c.get("name", "").startswith("faceambig"))
    assert (cookie.get("httpOnly"), cookie.get("sameSite")) == (True, "Strict")
    assert TOKEN not in str(cookie)
    assert tab.evaluate("() => document.cookie") == ""

    # A link to a state, from the same chat: the strict cookie is not sent with it, but with what the answer asks for
    follow(tab, elsewhere, f"{ours}?distance=0.6")
    tab.wait_for_url(f"{ours}?distance=0.6")
    assert until(lambda: tiny.sessions == 1, PATIENCE / 1000)

    # Another site with this very cookie: a websocket is refused, a frame stays empty
    elsewhere.body = f"""<iframe src="{ours}"></iframe><script>window.told = new Promise(done => {{
      const s = new WebSocket("ws://{tiny.netloc}/", ["viser-v1.1.1"]);
      s.onopen = () => done("open"); s.onerror = () => done("refused") }})</script>"""
    tab.goto(elsewhere.url)
    assert tab.evaluate("() => window.told") == "refused"
    tab.wait_for_load_state("networkidle")
    assert tab.frames[1].url.startswith(
        "chrome-error://"
    )  # Chromium's own words instead of the page
    assert until(lambda: not tiny.sessions)


def test_no_link_makes_the_page_obey_another_server(browser: Browser, elsewhere: Elsewhere) -> None:
    """Links of another site to a page without a token."""
    steering = (
        f"websocket=ws://localhost:{elsewhere.port}/", f"playbackPath={elsewhere.url}a.viser",
        f"web%73ocket=ws://localhost:{elsewhere.port}/",
    )  # fmt: skip
    with (
        tiny_page() as page,
        browser.new_context(viewport={"width": 320, "height": 240}) as context,
    ):
        tab = context.new_page()
        tab.set_default_timeout(PATIENCE)
        follow(tab, elsewhere, f"http://{page.netloc}/?{'&'.join(steering)}&view=side")
        # Of what steers, the names alone are left, for the page to say so
        tab.wait_for_url(f"http://{page.netloc}/?view=side&ignored=websocket,playbackPath")
        assert until(lambda: page.sessions == 1, PATIENCE / 1000)
        # Nor by a script that had got in all the same: the policy lets it speak to us alone
        told = tab.evaluate(
            """url => fetch(url).then(() => "fetched", () => "refused")""", f"{elsewhere.url}stolen"
        )
        assert told == "refused"
        assert not [path for path in elsewhere.asked if "viser" in path or "stolen" in path]
