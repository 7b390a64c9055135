"""The page: a server, and a Room with its Panel and Stage for every browser.

One way: event -> state -> compute -> draw.
"""

from __future__ import annotations

import asyncio
import gc
import signal
import threading
from types import FrameType
from typing import Any

import viser

from . import guard
from .browser import Browser
from .fields import FIELDS
from .fits import model
from .lessons import lessons
from .orders import Orders
from .panel.data import POINTS
from .panel.export import STATES
from .pipeline import frame
from .room import Dispatcher
from .stage import FAR, FIRST_FOV, FIRST_POSITION, NEAR
from .state import DEFAULT
from .text import say


class Page:
    """The server and its rooms."""

    def __init__(self, host: str, port: int) -> None:
        model(DEFAULT.model)  # before the first browser comes
        frame(DEFAULT)
        lessons()
        self._dispatcher, self._orders = Dispatcher(), Orders()
        self._browsers: dict[int, Browser] = {}
        hooks = guard.Hooks(words=refusal, on_refused=self._refused, on_error=self._failed)
        self._server = guard.start(
            host, port, keys=("v", *FIELDS), title=say("app.title"), hooks=hooks
        )
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
        browser = Browser(client, self._dispatcher, self._orders, asyncio.get_running_loop())
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

    def _refused(self, client_id: int, words: str) -> None:
        browser = self._browsers.get(client_id)
        if browser is not None:
            browser.notice(words)

    @property
    def address(self) -> str:
        """Where the page is."""
        return f"http://{self._server.get_host()}:{self._server.get_port()}/"

    def close(self) -> None:
        """Stop serving; returns within two seconds."""
        self._orders.close()
        self._dispatcher.close()
        self._server.stop()


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


def serve(host: str, port: int) -> int:
    """Serve the page until SIGINT or SIGTERM; the exit status."""
    stopped = threading.Event()
    status = 0

    def stop(number: int, _: FrameType | None) -> None:
        nonlocal status
        status = 130 if number == signal.SIGINT else 0
        stopped.set()

    for number in (signal.SIGINT, signal.SIGTERM):  # before anybody can know that the page is there
        signal.signal(number, stop)
    page = Page(host, port)
    print(f"faceambig is at {page.address} (Ctrl-C ends it)", flush=True)
    stopped.wait()
    page.close()
    return status
