"""Room: one browser and its newest state. Dispatcher: which room is computed next. All threads and timers live here.

A widget's handler changes the room's state and rings; a worker takes the room that waits longest, reads its state once,
computes and draws. A room waits at most once and is served by one worker at a time, so nothing queues, no old frame
lands after a new one, and the newest state wins.

While values keep coming the room draws drafts (coarse mesh, no curves); after REST seconds of silence it draws in full.
However late a value is served, its draft comes first, and a full frame lets drafts of others pass: a crowd that would
be drawn in full because it is slow, and so be slower still, gets out of it.
"""

from __future__ import annotations

import heapq
import itertools
import logging
import threading
import time
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

from .state import ViewState

log = logging.getLogger("faceambig")

REST = 0.2  # seconds without a change before the full mesh is drawn
BREATH = 0.05  # seconds after a draft that came late: newer values may wait to be heard
YIELD = 0.3  # seconds for which a full frame lets drafts pass, and no longer
FAREWELL = 0.5  # seconds for what is being computed when the page is closed; then it is abandoned
WORKERS = 3  # Python runs one at a time, and NumPy two; one is kept for hands that move


class Painter(Protocol):
    """What a room draws on."""

    def draw(self, state: ViewState, draft: bool) -> None:
        """Compute and draw a state; called by one worker at a time."""

    def refuse(self, error: BaseException) -> None:
        """Say why a state could not be drawn; the last good frame stays."""


class Room:
    """One browser: the newest ViewState, and nothing derived from it."""

    def __init__(
        self, state: ViewState, painter: Painter, ring: Callable[[Room, float], None]
    ) -> None:
        self.state = state
        self.left = False
        self._painter, self._ring = painter, ring
        self._changed_at = 0.0  # monotonic seconds
        self._drawn: tuple[float, bool] | None = None  # the change drawn last; whether as a draft
        self._refused_at: float | None = None  # the change that was refused since a frame was drawn

    def go(self, state: ViewState) -> None:
        """Make `state` the newest and ask to be served. On the event loop only: one writer, in message order.

        The same state once more asks for nothing, but where it could not be drawn: what it failed by may have passed.
        """
        if state == self.state and self._refused_at != self._changed_at:
            return
        self.state = state
        self._changed_at = time.monotonic()
        self._ring(self, 0.0)

    def again(self) -> None:
        """What is drawn has changed, though the state has not: ask to be served. On the event loop only."""
        self._changed_at = time.monotonic()
        self._ring(self, 0.0)

    def open(self) -> None:
        """Ask for the first frame, in full."""
        self._ring(self, 0.0)

    def serve(self) -> None:
        """Draw the newest state; a draft if it is young, with a full turn booked for when it has rested."""
        if self.left:
            return
        at, state = self._changed_at, self.state  # in this order: go() sets the state first
        wait = at + REST - time.monotonic()
        new = at > 0 and (self._drawn is None or self._drawn[0] != at)
        draft = new or wait > 0
        if self._drawn not in ((at, draft), (at, False)):
            try:
                self._painter.draw(state, draft)
                self._refused_at = None
            except Exception as error:  # noqa: BLE001 - a fit may fail in any way; worker and last frame must survive
                self._refuse(at, draft, error)
            self._drawn = (at, draft)  # a draft that failed may be drawn in full all the same
        if self._drawn == (at, True):
            self._ring(self, max(wait, BREATH))

    def _refuse(self, at: float, draft: bool, error: BaseException) -> None:
        """Say why, once of a change, and of a hand that goes on moving once until it rests."""
        told = self._refused_at is not None if draft else self._refused_at == at
        if not told:
            self._refused_at = at
            if not self.left:
                self._painter.refuse(error)


class Turn(NamedTuple):
    """Whose turn comes first."""

    place: float  # in the line: monotonic seconds
    late: bool  # after a rest: such a turn may take long


class Dispatcher:
    """Serves rooms by a few worker threads, the longest waiting first. One is never given a late turn."""

    def __init__(self, serve: Callable[[Any], None] = Room.serve, workers: int = WORKERS) -> None:
        self._serve = serve
        self._changed = threading.Condition()
        self._waiting: dict[Any, Turn] = {}
        self._served: dict[Any, Turn] = {}
        self._late_at_once = max(1, workers - 1)
        self._booked: dict[Any, float] = {}  # monotonic seconds of a later turn, at most one a room
        # A heap of those, and of some replaced since
        self._later: list[tuple[float, int, Any]] = []
        self._number = itertools.count()
        self._closed = False
        self._threads = [
            threading.Thread(target=self._work, name=f"faceambig-worker-{n}", daemon=True)
            for n in range(workers)
        ]
        for thread in self._threads:
            thread.start()

    def ring(self, room: Any, after: float = 0.0) -> None:
        """Ask that `room` be served, now or at most `after` seconds from now."""
        now = time.monotonic()
        with self._changed:
            if after > 0:
                self._book(room, now + after)
            else:
                before = self._waiting.get(room)
                self._waiting[room] = Turn(min(now, before.place) if before else now, late=False)
                self._changed.notify()

    def close(self) -> None:
        """Stop the workers; a room being served is finished first, if that takes no longer than FAREWELL."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        end = time.monotonic() + FAREWELL
        for thread in self._threads:
            thread.join(timeout=max(0.0, end - time.monotonic()))

    def _book(self, room: Any, due: float) -> None:
        if due >= self._booked.get(room, due + 1.0):  # it has a turn before, and may ask again then
            return
        self._booked[room] = due
        heapq.heappush(self._later, (due, next(self._number), room))
        if self._later[0][0] == due:  # sooner than all: whoever sleeps would sleep too long
            self._changed.notify_all()

    def _work(self) -> None:
        while True:
            with self._changed:
                while (room := self._next()) is None:  # the first who waits and is not being served
                    if self._closed:
                        return
                    self._changed.wait(self._until_later())
                if self._closed:
                    return
                # before the state is read: a ring from here on is a new turn
                self._served[room] = self._waiting.pop(room)
            try:
                self._serve(room)
            except Exception:  # perhaps its browser has just gone; the others need this worker
                log.exception("a room could not be served")
            finally:
                with self._changed:
                    del self._served[room]  # who rang meanwhile is found by this worker

    def _next(self) -> Any | None:
        now = time.monotonic()
        while self._later and self._later[0][0] <= now:
            due, _, room = heapq.heappop(self._later)
            if self._booked.get(room) == due:
                del self._booked[room]
                self._waiting.setdefault(room, Turn(due + YIELD, late=True))
        late = sum(turn.late for turn in self._served.values()) < self._late_at_once
        waiting = (
            room
            for room, turn in self._waiting.items()
            if room not in self._served and late >= turn.late
        )
        return min(waiting, key=self._waiting.__getitem__, default=None)

    def _until_later(self) -> float | None:
        return max(0.0, self._later[0][0] - time.monotonic()) if self._later else None
