"""The room of a class: who leads, who follows, and what was answered. All on the event loop; nothing here computes.

One browser leads: its state is everybody's who follows. A change of one's own lets one explore alone until one follows
again. Answers are counted, never named, and go with the browser that gave them: nobody votes twice by coming twice.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from html import escape

from ..lessons import Ask, Lessons
from ..lessons.room import Place
from ..panel.classroom import NOTE_LENGTH, Shown
from ..state import DEFAULT, ViewState, changed, for_eyes_of
from ..state.fields import tidy
from ..text import say
from .page import bars_html, note_html

log = logging.getLogger("faceambig")


class Classroom:
    """What all browsers of a class share."""

    def __init__(self, lessons: Callable[[], Lessons]) -> None:
        """lessons: asked for at every use, as their words are of whoever is spoken to."""
        self.state: ViewState | None = None  # of who leads, or led last; None: nobody has
        self.revealed: set[Place] = set()
        self.note = ""  # that all may read
        # Whether who leads shows a photograph of their own, which stays theirs
        self.private = False
        self.leader: Seat | None = None
        self._lessons = lessons
        self._seats: dict[Seat, None] = {}  # used as a set that keeps order
        self._answers: dict[Place, dict[Seat, float]] = {}

    def join(self, seat: Seat) -> None:
        """A browser has come."""
        self._seats[seat] = None
        self.show()

    def leave(self, seat: Seat) -> None:
        """A browser has gone, and its answers with it; what who led has shown last stays."""
        self._seats.pop(seat, None)
        for given in self._answers.values():
            given.pop(seat, None)
        if self.leader is seat:
            self.leader = None
        self.show(everybody=self.leader is None)

    def take(self, seat: Seat) -> None:
        """`seat` leads from here; who has led follows."""
        before, self.leader = self.leader, seat
        if before is not None and before is not seat:
            before.following = True
        self.show(everybody=True)

    def lead(self, state: ViewState) -> None:
        """Who leads is at a state: take there all who follow. A photograph of their own goes nowhere."""
        private, self.private = self.private, state.subject == "photo"
        if not self.private:
            self.state = state
            for seat in list(self._seats):
                if seat.following:
                    _safely(seat.follow, state)
        self.show(everybody=private != self.private)

    def reveal(self, place: Place) -> None:
        """What a question hides is told to all."""
        self.revealed.add(place)
        for seat in list(self._seats):
            _safely(seat.reveal, place)

    def write(self, note: str) -> None:
        """A note for all, as far as a line of words goes; "" takes it away."""
        note = tidy(note, NOTE_LENGTH)
        if note != self.note:
            self.note = note
            self.show(everybody=True)

    def answer(self, seat: Seat, place: Place, answer: float) -> None:
        """One answer a browser: the last."""
        given = self._answers.setdefault(place, {})
        if given.get(seat) != answer:
            given[seat] = answer
            self.show()

    def answers(self, place: Place) -> list[float]:
        """What was answered, in no order that says by whom: numbers, or choices counted from 0."""
        return sorted(self._answers.get(place, {}).values())

    def question(self, state: ViewState) -> tuple[Place, Ask] | None:
        """What a state asks, and where; None if nothing."""
        lesson = self._lessons().by_number.get(state.lesson or 0)
        if lesson is None:
            return None
        step = min(state.step, len(lesson.steps))
        ask = lesson.steps[step - 1].ask
        return None if ask is None else ((lesson.number, step), ask)

    def show(self, *, everybody: bool = False) -> None:
        """Tell who leads how the class is; everybody, whether somebody leads."""
        for seat in list(self._seats):
            if everybody or seat.leads:
                _safely(seat.show)

    @property
    def counts(self) -> tuple[int, int]:
        """Browsers besides the one that leads, and how many of them follow."""
        others = [seat for seat in self._seats if not seat.leads]
        return len(others), sum(seat.following for seat in others)


class Seat:
    """What one browser is in a class."""

    def __init__(
        self,
        room: Classroom,
        *,
        may_lead: bool,
        go: Callable[[ViewState], None],
        reveal: Callable[[Place], None],
        show: Callable[[Shown], None],
        now: Callable[[], ViewState],
        speaking: Callable[[], AbstractContextManager[object]] = nullcontext,
    ) -> None:
        """speaking: within it words are this browser's, whoever it was that changed something."""
        self.may_lead = may_lead
        self.following = not may_lead
        self._room, self._go, self._show, self._now = room, go, show, now
        self._speaking = speaking
        self.reveal = reveal

    @property
    def leads(self) -> bool:
        """Whether this is the browser that leads."""
        return self._room.leader is self

    def arrive(self, state: ViewState) -> ViewState:
        """Come in with the state of one's address; the state to begin at.

        Who leads goes on where the class is, unless the address says another place; who follows is where the class is.
        """
        room = self._room
        room.join(self)
        for place in room.revealed:
            self.reveal(place)
        if self.may_lead:
            room.take(self)
        bare = for_eyes_of(state, DEFAULT) == DEFAULT
        if room.state is not None and (self.following or bare):
            state = for_eyes_of(room.state, state)
        self.show()
        return state

    def leave(self) -> None:
        """The browser has gone."""
        self._room.leave(self)

    def moved(self, before: ViewState, now: ViewState) -> None:
        """A person has changed something here: the class comes along, or it is the end of following."""
        if self.leads:
            self._room.lead(now)
            self.show()
        elif self.following and for_eyes_of(before, now) != now:
            self.following = False
            self.show()
            self._room.show()

    def follow(self, state: ViewState) -> None:
        """Be where the class is."""
        self._go(for_eyes_of(state, self._now()))

    def explore(self, alone: bool) -> None:
        """Go on alone, or be with the class again."""
        if not alone:
            self.follow_again()
        elif self.following and not self.leads:
            self.following = False
            self.show()
            self._room.show()

    def follow_again(self) -> None:
        """Back to the class."""
        if self.leads or self.following:
            return
        self.following = True
        if self._room.state is not None:
            self.follow(self._room.state)
        self.show()
        self._room.show()

    def take(self) -> None:
        """Lead from here, if this browser came by the leader's link."""
        if self.may_lead and not self.leads:
            self.following = False
            self._room.take(self)
            self._room.lead(self._now())

    def note(self, words: str) -> None:
        """A note for the class; of who leads only."""
        if self.leads:
            self._room.write(words)

    def holds(self, place: Place, answer: float) -> bool:
        """Take an answer; whether the class waits for what it hides. Alone, or without a leader, nobody waits."""
        room = self._room
        if not self.following or room.leader is None or place in room.revealed:
            return False
        room.answer(self, place, answer)
        return True

    def unhide(self, state: ViewState) -> ViewState:
        """The change that tells all what is hidden; of who leads only."""
        if not self.leads:
            return state
        asked = self._room.question(state)
        if asked is None:
            return changed(state, hide=())
        self._room.reveal(asked[0])
        return changed(state, hide=tuple(name for name in state.hide if name != "numbers"))

    def show(self) -> None:
        """Show what this browser is in the class."""
        with self._speaking():
            self._tell()

    def _tell(self) -> None:
        room, bars, hidden = self._room, "", False
        if self.leads:
            present, following = room.counts
            words = say("class.leads", present=present, following=following)
            state = self._now()
            asked = room.question(state)
            hidden = bool(state.hide) if asked is None else asked[0] not in room.revealed
            if asked is not None:
                bars = bars_html(asked[1], room.answers(asked[0]), present)
        else:
            words = self._words()
        self._show(
            Shown(
                html=f'<div class="fa" role="status"><p class="fa-small">{escape(words)}</p></div>' + bars,
                alone=not self.leads and not self.following,
                hidden=hidden,
                may_take=self.may_lead and not self.leads,
                leads=self.leads,
                note=room.note,
                strip=note_html(room.note),
            )
        )  # fmt: skip

    def _words(self) -> str:
        """What this browser is, if it does not lead."""
        room = self._room
        if room.leader is None:
            return say("class.waits") if room.state is None else say("class.gone")
        if not self.following:
            return say("class.alone")
        return say("class.private") if room.private else say("class.follows")


def _safely(call: Callable[..., None], *given: object) -> None:
    """One browser that fails holds up nobody else."""
    try:
        call(*given)
    except Exception:  # its browser has perhaps just gone
        log.exception("a browser of the class could not be told")
