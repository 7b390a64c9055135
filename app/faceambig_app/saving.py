"""Saving: what one browser saves as files, made in the line that all browsers share, and the states it opens."""

from __future__ import annotations

import logging
import weakref
from asyncio import AbstractEventLoop
from collections.abc import Callable
from functools import partial
from typing import Any

import viser

from .export import files
from .guard import send_file
from .notices import cause, from_file
from .orders import Orders, Progress, Work
from .own import OwnPhoto
from .own import export as own_export
from .panel.export import Shown
from .state import ViewState
from .text import NARROW, language, numeral, say, speaking

log = logging.getLogger("faceambig")


class Saving:
    """One browser's orders, and what its tab shows of them: `show` is called on the event loop only."""

    def __init__(
        self,
        client: viser.ClientHandle,
        loop: AbstractEventLoop,
        orders: Orders,
        *,
        now: Callable[[], ViewState],
        go: Callable[[ViewState], None],
        show: Callable[[Shown], None],
        notice: Callable[[str], None],
        own: Callable[[], OwnPhoto | None] = lambda: None,
        language: Callable[[], str] = language,
    ) -> None:
        self._own, self._language = own, language
        self._client, self._loop, self._orders = client, loop, orders
        self._now, self._go, self._show, self._notice = now, go, show, notice
        self._left = False
        self._number = 0  # of what was stopped: what is heard of an older order comes too late
        self._note: viser.NotificationHandle | None = None  # seen from any tab while there is work

    # ---------------------------------------------------------------- what a person does, on the loop

    def save(self, kind: str, **options: Any) -> None:
        """Order the state, as it is now, as a file."""
        state = self._now()
        work = _spoken(self._language(), self._work(state, kind, options))
        if not self._orders.take(self, work):
            self._notice(say("export.busy"))

    def _work(self, state: ViewState, kind: str, options: dict[str, Any]) -> Work:
        """What makes the file. While it waits it holds nothing of an own photograph: Remove frees that."""
        if state.subject != "photo":
            return lambda progress: files(state, kind, progress=progress, **options)
        photo = self._own()
        shown = (lambda: None) if photo is None else weakref.ref(photo)
        there = photo is not None
        del photo

        def work(progress: Progress) -> tuple[str, bytes]:
            photo = shown()
            if there and photo is None:
                raise ValueError(say("own.gone"))
            return own_export.files(photo, state, kind, progress=progress, **options)

        return work

    def stop(self) -> None:
        """Take the order back."""
        if self._orders.stop(self):
            self._number += 1
            self._put(Shown(say("export.stopped")))

    def open(self, name: str, data: bytes) -> None:
        """Go to the state of a file; a red line if it is none."""
        try:
            state, notices = from_file(data)
        except ValueError as error:
            self._notice(say("export.no_state", name=name, cause=str(error)))
            return
        for words in notices:
            self._notice(words)
        self._go(state)

    def leave(self) -> None:
        """The browser has gone: make nothing more for it."""
        self._left = True
        self._orders.stop(self)

    # ---------------------------------------------------------------- what becomes of it, from any thread

    def waits(self, before: int) -> None:
        """Another's file is made first, or this one is begun."""
        with speaking(self._language()):
            words = say("export.waits", count=before) if before else say("export.begins")
            self._tell(Shown(words, busy=True))

    def goes_on(self, done: int, of: int) -> None:
        """So many parts of it are done."""
        with speaking(self._language()):
            if done < of:
                words = say("export.goes_on", done=done + 1, of=of)
            else:
                words = say("export.writing")
            self._tell(Shown(words, done / of, busy=True))

    def made(self, name: str, data: bytes) -> None:
        """Send it."""
        if send_file(self._client, name, data, lambda: self._left):
            with speaking(self._language()):
                self._tell(Shown(say("export.saved", name=name, size=size_text(len(data)))))

    def failed(self, error: Exception) -> None:
        """Say why there is no file."""
        log.warning("an export failed: %s", cause(error))
        with speaking(self._language()):
            words = say("export.failed", cause=cause(error))
            self._tell(Shown(), partial(self._notice, words))

    def _tell(self, shown: Shown, also: Callable[[], None] | None = None) -> None:
        number = self._number

        def told() -> None:
            if not self._left and number == self._number:
                self._put(shown)
                if also is not None:
                    also()

        self._loop.call_soon_threadsafe(told)

    def _put(self, shown: Shown) -> None:
        """In the tab, and where it is seen from every other one."""
        self._show(shown)
        if shown.busy and self._note is not None:
            self._note.body = shown.words
            return
        if self._note is not None:
            self._note.remove()
            self._note = None
        if shown.words:
            self._note = self._client.add_notification(
                say("app.title"), shown.words, loading=shown.busy, with_close_button=not shown.busy,
                auto_close_seconds=None if shown.busy else 4.0,
            )  # fmt: skip
        if not shown.busy:
            self._note = None  # closes itself


def _spoken(language: str, work: Work) -> Work:
    """The same work in a thread that speaks another language."""

    def speaks(progress: Progress) -> tuple[str, bytes]:
        with speaking(language):
            return work(progress)

    return speaks


def size_text(n_bytes: int) -> str:
    """12 kB, 1.4 MB."""
    if n_bytes < 1e6:
        return f"{max(1, round(n_bytes / 1e3))}{NARROW}kB"
    return numeral(f"{n_bytes / 1e6:.1f}{NARROW}MB")
