"""One server of ours and what its parts share: what the page is told, the log, errors in words."""

from __future__ import annotations

import asyncio
import logging
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Collection
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ..text import AUTO

# First of all: what the others take from viser is there
from .pinned import VISER, ServeError

if TYPE_CHECKING:
    from .access import Access
    from .page import Page
    from .sessions import Limits, Session

__all__ = [
    "DOOR", "LINES", "LOG", "VISER", "Door", "Held", "Hooks", "ServeError", "log_line",
]  # fmt: skip

LOG = logging.getLogger(__package__)


def _no_words(_control: Any, _asked: object, _put: object) -> str:
    return "This value cannot be set."


@dataclass(frozen=True)
class Hooks:
    """What the page is told. A call that raises costs one line in the log."""

    words: Callable[[Any, object, object], str] = _no_words  # (control, asked, put) -> the notice
    on_refused: Callable[[int, str], None] = lambda _client_id, _words: None
    on_error: Callable[[int | None, BaseException], None] = lambda _client_id, _error: None
    # of the words with which a browser's messages are answered
    language: Callable[[int], str] = lambda _client_id: AUTO


@dataclass
class Held:
    """A number out of range that may be half typed."""

    asked: float
    put: float
    timer: asyncio.TimerHandle


@dataclass
class Door:
    """One server of ours: its socket, its page and the controls that wait for the end of typing."""

    listener: socket.socket
    access: Access
    limits: Limits
    keys: frozenset[str]
    page: Page
    hooks: Hooks
    held: dict[tuple[int, str], Held] = field(default_factory=dict)
    sessions: set[Session] = field(default_factory=set)

    def full(self, cookies: Collection[str]) -> bool:
        """Whether there is no room for who has these cookies; for who leads there always is."""
        return len(self.sessions) >= self.limits.sessions and not self.access.leads(cookies)

    def failed(self, client_id: int | None, error: BaseException) -> None:
        log_line(f"{type(error).__name__}: {error}")
        LOG.debug("where it happened", exc_info=error)
        try:
            self.hooks.on_error(client_id, error)
        except Exception as again:  # noqa: BLE001 - the page's own code; nothing is left to tell it
            log_line(f"on_error: {type(again).__name__}: {again}")

    def refuse(self, client_id: int, control: Any, asked: object, put: object) -> None:
        try:
            self.hooks.on_refused(client_id, self.hooks.words(control, asked, put))
        except Exception as error:  # noqa: BLE001 - the page's own code
            self.failed(client_id, error)


DOOR: ContextVar[Door | None] = ContextVar("door of the running connection", default=None)


class Lines:
    """When the last lines of the log were written: so many in so long, for whoever sends what costs a line."""

    MOST, SECONDS = 20, 10.0

    def __init__(self) -> None:
        self._written: deque[float] = deque(maxlen=self.MOST)
        self._left_out = 0
        self._one = threading.Lock()

    def room(self) -> int | None:
        """How many lines were left out before this one; None if this one is too."""
        with self._one:
            now = time.monotonic()
            if len(self._written) == self.MOST and now - self._written[0] < self.SECONDS:
                self._left_out += 1
                return None
            self._written.append(now)
            left_out, self._left_out = self._left_out, 0
            return left_out

    def clear(self) -> None:
        with self._one:
            self._written.clear()
            self._left_out = 0


LINES = Lines()


def log_line(text: str) -> None:
    """One line of the log, whatever is in the text."""
    left_out = LINES.room()
    if left_out is None:
        return
    if left_out:
        LOG.warning("page: %d lines are left out", left_out)
    LOG.warning("page: %s", text[:200].encode("unicode_escape").decode())
