"""The page: a server, and a Room with its Panel and Stage for every browser.

One way: event -> state -> compute -> draw.
"""

from __future__ import annotations

import asyncio
import gc
import logging
import signal
import threading
from asyncio import AbstractEventLoop
from types import FrameType
from typing import Any

import viser

from . import figures, guard
from .panel import Panel
from .pipeline import Frame, curve_key, curve_of, frame, model, photo_jpeg
from .room import Dispatcher, Room
from .stage import FAR, FIRST_FOV, FIRST_POSITION, NEAR, Stage
from .state import DEFAULT, ViewState
from .text import say

log = logging.getLogger("faceambig")

SIDE_WIDTH = 372  # pixels of each docked panel


class Browser:
    """One connected browser: widgets, nodes and figures of its room."""

    def __init__(
        self, client: viser.ClientHandle, dispatcher: Dispatcher, loop: AbstractEventLoop
    ) -> None:
        self._client, self._loop = client, loop
        self.room = Room(DEFAULT, self, dispatcher.ring)
        self._curves_of: object = None  # what the plots show
        self._picture_of: object = None  # what the photograph shows: (target, draft)
        self.stage = Stage(client)
        self._build(client)

    def _build(self, client: viser.ClientHandle) -> None:
        state, gui = self.room.state, client.gui
        gui.configure_theme(
            show_logo=False,
            show_share_button=False,
            brand_color=(27, 95, 193),
            control_width="large",
        )
        gui.set_panel_label(say("app.title"))
        people = tuple(subject.name for subject in model(state.model).subjects)
        narrow = self.stage.narrow
        self._style = gui.add_html("")
        if narrow:  # one panel: the photograph comes first, beside the numbers
            self._add_photo(gui)
        self.panel = Panel(gui, state, people, self._heard)
        self._cards = None if narrow else gui.add_html("")
        self._plots, self._spoken, self._words = (
            gui.add_html(""),
            gui.add_html(""),
            gui.add_html(""),
        )
        self.panel.build_rest(state)
        self._style.content = figures.STYLE + figures.hidden_boxes(self.panel.index_sliders)
        self._heading: viser.GuiHtmlHandle | None = None
        gui.main_panel.dock_right()
        gui.main_panel.set_width(SIDE_WIDTH)
        if not narrow:
            side = gui.add_panel()
            with side.add_tab(say("panel.photo")):
                self._heading = gui.add_html("")
                self._add_photo(gui)
            side.dock_left()
            side.set_width(SIDE_WIDTH)

    def _add_photo(self, gui: viser.GuiApi) -> None:
        self._picture, self._marks = gui.add_html(""), gui.add_html("")

    def open(self) -> None:
        """Draw the first frame."""
        self.room.open()

    def leave(self) -> None:
        """The browser has gone: compute nothing more for it."""
        self.room.left = True

    def _heard(self, values: dict[str, Any]) -> None:
        self.room.hear(values)
        self.panel.show(self.room.state)

    def notice(self, words: str) -> None:
        """A red line in this browser."""
        self._client.add_notification(say("app.title"), words, color="red", auto_close_seconds=8.0)

    def refuse(self, error: BaseException) -> None:
        """Say why a state could not be drawn; the last good frame stays."""
        log.warning("a frame failed: %s", " ".join(str(error).split())[:200])
        self.notice(say("error.failed", cause=str(error)))

    def draw(self, state: ViewState, draft: bool) -> None:
        """Compute a state and send it. Computing is done before the lock of atomic(), never inside."""
        shown = frame(state, with_curves=not draft)
        numbers, key = shown.scene.numbers, curve_key(state)
        cards, marks = figures.cards(numbers), figures.photo_marks(shown.scene.photo)
        if self._cards is None:
            html = [(self._marks, figures.side_by_side(marks, cards))]
        else:
            html = [(self._cards, cards), (self._marks, marks)]
        if not draft or key == self._curves_of:  # a new target's curves cost a sweep: only at rest
            html.append((self._plots, figures.plots(curve_of(state), numbers)))
            self._curves_of = key
        if (state.target, draft) != self._picture_of and not (
            draft and self._picture_of == (state.target, False)
        ):
            html.append((self._picture, figures.photo_picture(photo_jpeg(state.target, draft))))
            self._picture_of = (state.target, draft)
        if not draft:
            html += self._at_rest(state, shown)
        if self.room.left:  # while this was computed
            return
        with self._client.atomic():
            self.stage.show(shown.scene, draft)
            for handle, content in html:
                handle.content = content
        self._client.flush()
        if not draft:
            self._loop.call_soon_threadsafe(self._settle)

    def _settle(self) -> None:
        """At rest, on the loop: what the controls show is what is, even where messages crossed on the way."""
        if not self.room.left:
            self.panel.show(self.room.state)
            guard.restate(self._client, self.panel.controls)

    def _at_rest(self, state: ViewState, shown: Frame) -> list[tuple[viser.GuiHtmlHandle, str]]:
        numbers = shown.scene.numbers
        low, high = shown.flex_reach
        html = [
            (self._spoken, figures.spoken(numbers)),
            (self._words, self.panel.spoken(state)),
            (self.panel.flex_words, figures.flex_words(shown.flex_words, low, high)),
        ]
        if self._heading is not None:
            points = len(shown.scene.photo.observed)
            html.append((self._heading, figures.heading(numbers.distance, state.actual, points)))
        return html


class Page:
    """The server and its rooms."""

    def __init__(self, host: str, port: int) -> None:
        model(DEFAULT.model)  # before the first browser comes
        frame(DEFAULT)
        self._dispatcher = Dispatcher()
        self._browsers: dict[int, Browser] = {}
        hooks = guard.Hooks(words=refusal, on_refused=self._refused, on_error=self._failed)
        self._server = guard.start(host, port, title=say("app.title"), hooks=hooks)
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
        browser = Browser(client, self._dispatcher, asyncio.get_running_loop())
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
        self._dispatcher.close()
        self._server.stop()


def refusal(control: Any, asked: object, put: object) -> str:
    """The notice for a value a control may not have."""
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
