"""Browser: one connected browser, its room, its history and what it shows.

What a person does arrives on the event loop as a change of the state; what is computed is drawn by a worker.
"""

from __future__ import annotations

import logging
import threading
import time
from asyncio import AbstractEventLoop, TimerHandle
from dataclasses import replace
from typing import cast

import viser

from . import guard
from .classroom import Classroom, Seat
from .display import Display, Rest
from .glide import Glide
from .lessons import lessons
from .lessons.room import LessonRoom
from .markup import figures
from .markup.style import STYLE, bold
from .notices import cause, from_query
from .orders import Orders
from .own import page as own_page
from .own.room import OwnRoom
from .panel import SIDE_WIDTH, Change, Panel, palette
from .panel.classroom import Shown
from .panel.widgets import setting
from .pipeline.fits import model
from .room import REST, Dispatcher, Room
from .saving import Saving
from .script import (
    Click,
    Copied,
    Dark,
    Gone,
    Hand,
    Hello,
    Key,
    Point,
    Probe,
    Report,
    Script,
    Theme,
    is_dark,
)
from .stage import Stage
from .state import DEFAULT, ViewState, changed, history
from .state.actions import ACTIONS
from .state.fields import FIELDS
from .state.forms import command
from .state.link import query
from .text import AUTO, accepted, language, say, speaking, words
from .under import Pointer

log = logging.getLogger("faceambig")

FOR_ALL = 1.5  # size of letters of a page that a class looks at; lines grow as well
HELLO = 0.5  # seconds to wait for the page's script to say which state the address asks for


class Browser:
    """One connected browser: widgets, nodes and figures of its room."""

    def __init__(
        self,
        client: viser.ClientHandle,
        dispatcher: Dispatcher,
        orders: Orders,
        loop: AbstractEventLoop,
        classroom: Classroom | None = None,
        *,
        leads: bool = False,
        invitation: str = "",
    ) -> None:
        self._client, self._loop = client, loop
        self.room = Room(DEFAULT, self, dispatcher.ring)
        self._history = history.History()
        self._glide = Glide(self._glided)
        self._still = False  # whether this person wants no motion
        self._dark = False  # whether this person's system is dark
        self._greeted = False  # whether the page's script has told its address
        self._owned = False  # whether there is a photograph of this person
        # Spoken; what the browser asks for: by its request, until the page's script tells
        self.language = self._asked = accepted(guard.languages())
        self.stage = Stage(client, self._orbited, bold=FOR_ALL if leads else 1.0)
        self._dress()
        self.script = Script(client.gui, self.report)
        self._pointer = Pointer(self.script, self.stage.value)
        self._own = OwnRoom(
            loop, self._own_changed, self.notice, steps=lambda: len(self._history.past)
        )
        self._own.model = DEFAULT.model
        # Metres: of the camera, as the own photograph's file tells it
        self._hint: float | None = None
        self._saving = Saving(
            client, loop, orders, now=lambda: self.room.state, go=self._opened,
            show=lambda shown: self.panel.export.show(shown), notice=self.notice,
            own=lambda: self._own.photo, language=lambda: self.language,
        )  # fmt: skip
        self._seat = None if classroom is None else Seat(
            classroom, may_lead=leads, go=self._followed, now=lambda: self.room.state,
            reveal=lambda place: self._lessons.reveal(place), show=self._show_class,
            speaking=lambda: speaking(self.language),
        )  # fmt: skip
        self._lessons = LessonRoom(
            lessons(self.language), now=lambda: self.room.state, tell=self.change, notice=self._remark,
            show=lambda shown: self.panel.lesson.show(shown), of=self._seat,
        )  # fmt: skip
        self._invitation = invitation
        self._first: TimerHandle | None = None  # opens the page where no script says a word
        self._built = False  # whether there is a panel
        self._one = threading.Lock()  # who writes into the panel, or makes another

    def _build(self) -> None:
        """The panel and the commands, in the language that is spoken."""
        people: dict[int | str, str] = {
            index: subject.name for index, subject in enumerate(model(DEFAULT.model).subjects, 1)
        }
        people["photo"] = say("own.mine")
        leads = self._seat is not None and self._seat.may_lead
        width = round(SIDE_WIDTH * (FOR_ALL if leads and self.stage.wide else 1.0))
        self.panel = panel = Panel(
            self._client.gui, people, self.change, self.act, narrow=self.stage.narrow,
            own=self._own, use_hint=self._use_hint, saving=self._saving,
            lessons_do=self._lessons, class_do=self._seat, invitation=self._invitation, width=width,
        )  # fmt: skip
        # A worker may still be drawing for a panel that has been made anew
        self._display = Display(
            self._client, self.stage, panel,
            gone=lambda: self.room.left or self.panel is not panel, one=self._one,
        )  # fmt: skip
        boxes = figures.hidden_boxes(panel.widgets.step_sliders)
        panel.places.style.content = STYLE + boxes + (bold(width) if leads else "")
        panel.show(self.room.state)
        palette.register(self._client.gui, self.act, () if leads else ("reveal",))
        self._built = True
        if self._seat is not None:
            self._seat.show()

    # ---------------------------------------------------------------- what a person does, on the loop

    def open(self) -> None:
        """Make the panel. The first frame is of the state in the address, or of the default where no script tells."""
        with speaking(self._language_of(self.room.state)):
            self._translate()
            self._first = self._loop.call_later(HELLO, self._unheard)

    def _unheard(self) -> None:
        """Begin, with or without a word of the page's script."""
        if self.room.left:
            return
        if self._seat is not None and not self._greeted:
            self._begin(self.room.state)
        self.room.open()

    def leave(self) -> None:
        """The browser has gone: compute nothing more for it."""
        self.room.left = True
        if self._seat is not None:
            self._seat.leave()
        if self._first is not None:
            self._first.cancel()  # it would hold all of this until its time
        self._own.leave()
        self._saving.leave()
        self._glide.stop()

    def change(self, change: Change) -> None:
        """Do what a widget or a key says."""
        self._glide.stop()
        try:
            state = change(self.room.state)
        except ValueError as error:
            self.notice(str(error))
            state = self.room.state
        self._go(state)

    def act(self, name: str) -> None:
        """Do an action of the table."""
        if (change := ACTIONS[name].change) is not None:
            self.change(change)
            return
        on = self._glide.on
        self._glide.stop()
        match name:
            case "glide":
                if not on:
                    self._glide.start(self.room.state.distance, stills=self._still)
            case "undo" if self._own.newest >= len(self._history.past):
                self._own.undo()  # points of the photograph came after the last step of the state
            case "undo":
                self._travel(history.undo(self._history))
            case "redo":
                self._travel(history.redo(self._history))
            case "reset":
                start = self._lessons.start(self.room.state)
                self._travel(history.reset(self._history, start))
            case "lesson_next":
                self.change(self._lessons.onward)
            case "lesson_back":
                self.change(self._lessons.back)
            case "lesson_leave":
                self.change(self._lessons.leave)
            case "reveal" if self._seat is not None:
                self.change(self._seat.unhide)
            case "copy_link":
                self.script.copy_link(query(self.room.state))
            case "copy_command":
                self.script.copy(command(self.room.state))

    def _go(self, state: ViewState) -> None:
        before = self.room.state
        if state.draw is not None and state.fitting != before.fitting and state.draw == before.draw:
            # A drawn face has a distance of its own: the fit moves
            state = changed(state, draw=None)
        self._travel(history.change(self._history, state, time.monotonic()))

    def _travel(self, to: history.History, *, own: bool = True) -> None:
        """Be where a history says, and show it: widgets at once, heads and numbers when a worker is free.

        own: whether this person has gone there, and not the class.
        """
        with speaking(self._language_of(to.now)):
            self._arrive(to, own)

    def _arrive(self, to: history.History, own: bool) -> None:
        before, self._history = self.room.state, to
        if not self._built or self.language != language():
            self._translate()
        self.room.go(to.now)
        self._pointer.moved(before, to.now)
        if (before.theme, before.text) != (to.now.theme, to.now.text):
            self._dress()
            self.script.theme(cast(Theme, to.now.theme), to.now.text)
        self.panel.show(to.now)
        self._lessons.watch(to.now)
        if own and self._seat is not None:
            self._seat.moved(before, to.now)

    def _followed(self, state: ViewState) -> None:
        """The class is at a state, and so is this browser: no step of its history, what was undone is gone."""
        self._glide.stop()
        self._travel(
            replace(self._history, now=state, future=(), changed_at=None),
            own=False,
        )

    def _show_class(self, shown: Shown) -> None:
        if self._built and self.panel.classroom is not None:
            self.panel.classroom.show(shown)

    def _language_of(self, state: ViewState) -> str:
        return self._asked if state.lang == AUTO else state.lang

    def _translate(self) -> None:
        """Make all that has words, or make it anew: most controls cannot change theirs. What is shown stays."""
        self.language, again = language(), self._built
        self._lessons.read(lessons(self.language))
        with self._one, self._client.atomic():  # else each control wakes the loop, which is here
            self._built = False
            if again:
                guard.clear(self._client.gui, keep=(*self.script.elements, *self.stage.elements))
            self._build()
        self._client.flush()
        self.script.words(words()["page"])
        self.script.language(self.language, words()["icon"])
        if again:
            self._show_own()
            self.room.again()

    def _opened(self, state: ViewState) -> None:
        """A state came in a file."""
        self.change(lambda _: state)

    def _orbited(self, azimuth: float, elevation: float, zoom: float) -> None:
        """A hand has turned the viewer, who stands there already: the state learns it, nothing is drawn."""
        low, high = FIELDS["zoom"].low, FIELDS["zoom"].high
        self._go(
            changed(
                self.room.state,
                view="free",
                orbit=(azimuth, elevation),
                zoom=min(high, max(low, zoom)),
            )
        )

    def _glided(self, distance: float) -> None:
        self._go(changed(self.room.state, distance=distance, camera="perspective"))

    def report(self, report: Report) -> None:
        """What the page's script tells: the address it was opened with, keys that stop things."""
        match report:
            case Hello():
                self._hello(report)
            case Key():
                self._glide.stop()
                if self.room.state.show == "blink":
                    self._go(changed(self.room.state, show="both"))
            case Hand():
                self.stage.by_hand()
            case Dark():
                self._dark = report.on
                self._dress()
            case Copied():
                words = say("copy.done") if report.ok else say("copy.by_hand")
                self._remark(words)
            case Point() | Click() | Gone():
                self._own.hear(report)
            case Probe():
                self._pointer.asks(report, self.room.state)

    def _own_changed(self) -> None:
        """Another photograph, other points, or none any more: show them."""
        own, state = self._own.photo, self.room.state
        if (own is not None) != self._owned:
            self._owned = own is not None
            subject = "photo" if self._owned else DEFAULT.subject
            if self._owned or state.subject == "photo":
                self._go(changed(state, subject=subject))
        self._show_own()
        self.room.again()

    def _show_own(self) -> None:
        own = self._own
        self.panel.own.show(
            own_page.shown(own.photo, own.status, can_undo=own.can_undo, hint=self._hint)
        )

    def _use_hint(self) -> None:
        if self._hint is not None:
            self.change(setting("distance", round(self._hint, 3)))

    def _hello(self, hello: Hello) -> None:
        """A browser has come, or come back: go where its address says."""
        self._still, self._dark = hello.reduced_motion, hello.dark
        self._asked = accepted(hello.languages)
        with speaking(self._language_of(from_query(hello.query)[0])):
            self._come(hello)

    def _come(self, hello: Hello) -> None:
        state, notices = from_query(hello.query)
        if hello.theme is not None and state.theme == DEFAULT.theme:
            state = changed(state, theme=hello.theme)
        if hello.text is not None and state.text == DEFAULT.text:
            state = changed(state, text=hello.text)
        for sentence in notices:
            self.notice(sentence)
        if (
            self._seat is not None
            and self._seat.may_lead
            and hello.text is None
            and state.text == DEFAULT.text
        ):
            state = changed(state, text=FOR_ALL)
        self._greeted = True
        self._begin(self._lessons.arrived(state))
        self.room.open()

    def _begin(self, state: ViewState) -> None:
        """Be at a state without a past; in a class where the class is."""
        seat = self._seat
        arrived = state if seat is None else seat.arrive(state)
        self._travel(history.History(arrived), own=seat is not None and seat.leads)

    def _dress(self) -> None:
        """Light or dark, as the state or the system says."""
        self._client.gui.configure_theme(
            dark_mode=is_dark(cast(Theme, self.room.state.theme), self._dark),
            show_logo=False,
            show_share_button=False,
            brand_color=(27, 95, 193),
            control_width="large",
        )

    # ---------------------------------------------------------------- what it shows, by a worker

    def notice(self, words: str) -> None:
        """A red line in this browser."""
        self._client.add_notification(say("app.title"), words, color="red", auto_close_seconds=8.0)

    def _remark(self, words: str) -> None:
        """A line that is no error."""
        self._client.add_notification(say("app.title"), words, auto_close_seconds=3.0)

    def refuse(self, error: BaseException) -> None:
        """Say why a state could not be drawn; the last good frame stays."""
        log.warning("a frame failed: %s", cause(error))
        with speaking(self.language):
            self.notice(say("error.failed", cause=cause(error)))
            self._loop.call_soon_threadsafe(
                self._loop.call_later, REST, self._say_again, self.room.state
            )

    def draw(self, state: ViewState, draft: bool) -> None:
        """Compute a state and send it; called by one worker at a time."""
        display = self._display  # read before the language: made anew after it
        with speaking(spoken := self.language):
            try:
                rest = display.draw(state, draft, self._own.photo)
            except Exception:
                if self._built and display is self._display and spoken == self.language:
                    raise
                return  # it drew for a panel that is no more; for the new one it is asked again
            if rest is not None:
                self._loop.call_soon_threadsafe(self._settle, state, rest, display)

    def _settle(self, drawn: ViewState, rest: Rest, display: Display) -> None:
        """At rest, on the loop: what the controls show is what is, even where messages crossed on the way."""
        if display is self._display and not self.room.left and self.room.state == drawn:
            self._pointer.settled = drawn
            self._hint = rest.hint
            self._show_own()
            self.script.address(query(drawn))
            self.panel.flex.tell(rest.sliders)
            self._say_again(drawn)
            self._lessons.watch(drawn, rest.numbers)

    def _say_again(self, state: ViewState) -> None:
        """The controls of a state at rest, or of one that cannot be drawn: once more those that somebody has moved."""
        if not self.room.left and self.room.state == state:
            self.panel.show(state)
            guard.restate(self._client, self.panel.widgets.touched())
