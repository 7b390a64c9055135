"""The page: a server, and a Room with its Panel and Stage for every browser.

One way: event -> state -> compute -> draw.
"""

from __future__ import annotations

import asyncio
import gc
import math
import re
import signal
import sys
import threading
import time
import warnings
from collections.abc import Collection
from types import FrameType
from typing import Any

import viser

from . import guard
from .browser import Browser
from .classroom import Classroom
from .lessons import lessons
from .orders import Orders
from .panel.classroom import invitation
from .panel.data import POINTS
from .panel.export import STATES
from .pipeline import frame
from .pipeline.fits import model
from .room import Dispatcher
from .stage import FAR, FIRST_FOV, FIRST_POSITION, NEAR
from .state import DEFAULT
from .state.fields import FIELDS
from .text import AUTO, say

STOPPING = 0.5  # seconds for the farewells to the browsers
CLOSED = re.compile("Queued a .* on a closed connection")  # a warning of viser


class Page:
    """The server and its rooms."""

    def __init__(
        self,
        host: str,
        port: int,
        *,
        token: str | None = None,
        lead: str | None = None,
        allowed: Collection[str] = (),
        limits: guard.Limits | None = None,
    ) -> None:
        """lead: the secret of who leads a class; without it there is none, and everybody is alone."""
        model(DEFAULT.model)  # before the first browser comes
        frame(DEFAULT)
        lessons()
        self._dispatcher, self._orders = Dispatcher(), Orders()
        self._browsers: dict[int, Browser] = {}
        hooks = guard.Hooks(
            words=refusal, on_refused=self._refused, on_error=self._failed, language=self._language
        )
        self._server = guard.start(
            host,
            port,
            token=token,
            lead=lead,
            allowed=allowed,
            limits=limits,
            keys=("v", *FIELDS),
            title=say("app.title"),
            hooks=hooks,
        )
        self._token, self._lead, self._allowed = token, lead, allowed
        self._class = None if lead is None else Classroom(lessons)
        self._invitation = ""
        if self._class is not None:
            room = self.links[0]
            self._invitation = invitation(room, guard.qr_svg(room))
        # For everybody and before the first browser: a client that learns "up" later keeps its camera's old one
        self._server.scene.set_up_direction("+y")
        self._server.initial_camera.up = (0.0, 1.0, 0.0)
        self._server.initial_camera.position = FIRST_POSITION
        self._server.initial_camera.fov = FIRST_FOV
        self._server.initial_camera.near, self._server.initial_camera.far = NEAR, FAR
        self._server.on_client_connect(self._enter)
        self._server.on_client_disconnect(self._leave)

    async def _enter(
        self, client: viser.ClientHandle
    ) -> None:  # async: on the loop, before any message of this client
        browser = Browser(
            client, self._dispatcher, self._orders, asyncio.get_running_loop(), self._class,
            leads=guard.leads(), invitation=self._invitation,
        )  # fmt: skip
        self._browsers[client.client_id] = browser
        browser.open()

    async def _leave(self, client: viser.ClientHandle) -> None:
        browser = self._browsers.pop(client.client_id, None)
        if browser is not None:
            browser.leave()
            gc.collect(0)

    def _failed(self, client_id: int | None, error: BaseException) -> None:
        browser = self._browsers.get(-1 if client_id is None else client_id)
        if browser is not None:
            browser.refuse(error)

    def _language(self, client_id: int) -> str:
        browser = self._browsers.get(client_id)
        return AUTO if browser is None else browser.language

    def _refused(self, client_id: int, words: str) -> None:
        browser = self._browsers.get(client_id)
        if browser is not None:
            browser.notice(words)

    @property
    def address(self) -> str:
        """Where the page is, by its address."""
        return guard.links(self._server.get_host(), self._server.get_port())[0]

    @property
    def links(self) -> list[str]:
        """What to give to whoever may come in: by each name of the page, with the token."""
        brings = "" if self._token is None else f"?token={self._token}"
        places = guard.links(self._server.get_host(), self._server.get_port(), self._allowed)
        return [place + brings for place in places]

    @property
    def leader_link(self) -> str | None:
        """What to keep: who opens it leads the class. None where there is no class."""
        if self._lead is None:
            return None
        places = guard.links(self._server.get_host(), self._server.get_port(), self._allowed)
        return f"{places[0]}?lead={self._lead}"

    def close(self) -> None:
        """Stop serving: within 1.5 s, whatever is being computed and whoever does not answer a farewell."""
        self._orders.close()
        self._dispatcher.close()
        stopping = threading.Thread(target=self._server.stop, name="faceambig-stop", daemon=True)
        stopping.start()  # viser would wait for six seconds
        stopping.join(timeout=STOPPING)


def refusal(control: Any, asked: object, put: object) -> str:
    """The notice for a value a control may not have."""
    if isinstance(control, viser.GuiUploadButtonHandle):
        if control.mime_type == STATES:
            return say("export.not_taken")
        if control.mime_type == POINTS:
            return say("own.points_large")
        return say("own.unreadable")
    low, high = getattr(control, "min", None), getattr(control, "max", None)
    if (
        isinstance(asked, (int, float))
        and not isinstance(asked, bool)
        and math.isfinite(asked)
        and isinstance(put, (int, float))
        and low is not None
        and high is not None
    ):
        return say(
            "error.range",
            label=control.label,
            value=f"{asked:g}",
            low=f"{low:g}",
            high=f"{high:g}",
            near=f"{put:g}",
        )
    return say("error.number")


def serve(
    host: str,
    port: int,
    *,
    token: str | None = None,
    allowed: Collection[str] = (),
    limits: guard.Limits | None = None,
    present: bool = False,
) -> int:
    """Serve the page until SIGINT or SIGTERM; the exit status. present: for a class, which one browser leads.

    What is still being computed then goes on in threads that Python waits for when it ends: leave by `os._exit`.
    """
    status: int | None = None
    page: Page | None = None

    def stop(number: int, _: FrameType | None) -> None:
        nonlocal status
        status = 130 if number == signal.SIGINT else 0
        if page is None:  # a model is being read: that would take longer than anybody waits
            raise SystemExit(status)

    # viser says it of every browser that leaves while something is drawn for it, with lines of its own source
    warnings.filterwarnings("ignore", CLOSED.pattern, UserWarning)
    for number in (signal.SIGINT, signal.SIGTERM):  # before anybody can know that the page is there
        signal.signal(number, stop)
    if token is None and guard.needs_token(host, allowed):
        token = guard.make_token()
    lead = guard.make_token() if present else None
    page = Page(host, port, token=token, lead=lead, allowed=allowed, limits=limits)
    first, *others = page.links
    print(f"faceambig is at {first} (Ctrl-C ends it)")
    for link in others:
        print(f"and at {link}")
    if page.leader_link is not None:
        print(
            f"Whoever opens {page.leader_link} leads the class: keep it. The others follow by the link above."
        )
        if not guard.needs_token(host, allowed):
            print("This machine alone can open them: for a class give --host 0.0.0.0 too.")
    if token is not None:
        print("Whoever has the link is let in, and is then known by a cookie.")
        if sys.stdout.isatty():
            print(guard.qr_code(first))
    sys.stdout.flush()
    while (
        status is None
    ):  # a wait without an end would sleep through a signal that comes just before it
        time.sleep(0.1)
    page.close()
    return status
