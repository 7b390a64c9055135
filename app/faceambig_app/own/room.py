"""OwnRoom: the one photograph of one browser, and what a person does with it. It ends with the browser, or on Remove.

All of it happens on the event loop, but for reading a file and finding points, which take their time elsewhere.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from ..pipeline.fits import model
from ..script import Click, Gone, Point
from ..text import say
from . import placing
from .photo import OwnPhoto, closer, found, from_file, moved, read_photo, replace_part, with_points

Make = Callable[[Any], OwnPhoto]
STEPS = 100  # of point moves that can be taken back


class OwnRoom:
    """The photograph of one browser. `photo` may be read from any thread: it is replaced as a whole."""

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        changed: Callable[[], None],
        notice: Callable[[str], None],
        steps: Callable[[], int] = lambda: 0,
    ) -> None:
        self.photo: OwnPhoto | None = None
        self.model = ""  # name of the model whose points are placed
        self.status = ""  # what has just been done, in words
        self._loop, self._changed, self._notice, self._steps = loop, changed, notice, steps
        # The points of before, oldest first, and `steps` then
        self._past: list[tuple[int, OwnPhoto]] = []
        self._dragged: int | None = None  # the point that a hand holds
        self._job = 0  # counts what was asked for: what comes late is not wanted any more
        self._todo: tuple[int, Make, Callable[[OwnPhoto], None]] | None = None
        # A thread works; it holds what it was given until it ends
        self._busy: asyncio.Task[None] | None = None

    @property
    def can_undo(self) -> bool:
        """Whether there were other points before these."""
        return bool(self._past)

    @property
    def newest(self) -> int:
        """`steps` of the history of states when points changed last; -1 where none did."""
        return self._past[-1][0] if self._past else -1

    def leave(self) -> None:
        """Keep nothing: the browser has gone."""
        self._job += 1
        self.photo, self._todo = None, None
        self._past.clear()

    def remove(self) -> None:
        """Remove was pressed."""
        self.leave()
        self.status = say("own.removed")
        self._changed()

    # ------------------------------------------------------------ files and the networks

    def take(self, name: str, data: bytes) -> None:
        """A picture was uploaded."""
        self._work(say("own.reading"), lambda _: read_photo(name, data), self._took)

    def _took(self, photo: OwnPhoto) -> None:
        self._past.clear()  # of another picture
        self._show(photo, say("own.taken"))

    def find(self) -> None:
        """Find the points."""
        if self.photo is None:
            self._notice(say("own.none"))
            return
        self._work(say("own.finding"), lambda photo: found(photo, model(self.model)))

    def read_points(self, name: str, data: bytes) -> None:
        """A file of points was uploaded."""
        if self.photo is None:
            self._notice(say("own.none"))
            return
        self._work(
            say("own.reading"), lambda photo: from_file(photo, model(self.model), name, data)
        )

    def _work(
        self, words: str, make: Make, done: Callable[[OwnPhoto], None] | None = None
    ) -> None:  # fmt: skip
        """Make a photograph of this one in another thread, and show it unless something else was asked meanwhile.

        One at a time for each browser: what is asked while another runs waits, and the last that was asked counts.
        """
        self._job += 1
        self._todo = (self._job, make, done or (lambda made: self._step(made, made.words)))
        self.status = words
        self._changed()
        if self._busy is None:
            self._busy = self._loop.create_task(self._run())

    async def _run(self) -> None:
        while self._todo is not None:
            (job, make, done), self._todo = self._todo, None
            try:
                made = await asyncio.to_thread(make, self.photo)  # in the same language
            except Exception as error:  # noqa: BLE001 - a stranger's file; the browser goes on, and is told
                if job == self._job:
                    self.status = str(error)
                    self._notice(self.status)
                    self._changed()
            else:
                if job == self._job:
                    done(made)
                del made
        self._busy = None

    # ------------------------------------------------------------ points by hand

    def begin(self) -> None:
        """Place the twelve points."""
        if self.photo is not None:
            self._step(placing.begin(self.photo, model(self.model)))

    def more(self) -> None:
        """Place what is left, after the twelve."""
        if self.photo is not None:
            self._step(placing.more(self.photo))

    def skip(self) -> None:
        """The point asked for is not visible."""
        if self.photo is not None and self.photo.asked:
            self._step(placing.skip(self.photo))

    def closer(self, on: bool) -> None:
        """Show the face alone, or all of the photograph."""
        if self.photo is not None:
            self._show(closer(self.photo) if on else replace_part(self.photo, None))

    def undo(self) -> None:
        """The points of before."""
        if self._past and self.photo is not None:
            (_, before), part = self._past.pop(), self.photo.part
            self._show(replace_part(before, part))

    def hear(self, report: Point | Click | Gone) -> None:
        """What the page's script tells of points."""
        photo = self.photo
        if photo is None:
            return
        match report:
            case Click():
                if photo.asked:
                    self._step(placing.place(photo, report.x, report.y))
            case Gone():
                self._step(moved(photo, report.index, float("nan"), float("nan")))
            case Point():
                placed = moved(photo, report.index, report.x, report.y)
                if self._dragged == report.index:  # one drag is one step
                    self._show(placed)
                else:
                    self._step(placed)
                self._dragged = None if report.done else report.index

    def _step(self, photo: OwnPhoto, words: str = "") -> None:
        """Another set of points; those of before can be had again."""
        if self.photo is not None and photo is not self.photo:
            before = with_points(self.photo, self.photo.points)  # without what was computed
            self._past = [*self._past, (self._steps(), before)][-STEPS:]
        self._show(photo, words)

    def _show(self, photo: OwnPhoto, words: str = "") -> None:
        self.photo, self.status = photo, words
        self._changed()
