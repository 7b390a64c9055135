"""One server of ours and what its parts share: its limits, its page, and what the page is told."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable, Collection
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import Any

from ..text import AUTO
from .access import Access
from .log import LOG, log_line
from .page import Page
from .sessions import Limits, Session


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
