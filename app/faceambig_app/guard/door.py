"""One server of ours and what its parts share: what the page is told, the log, errors in words."""

from __future__ import annotations

import asyncio
import logging
import socket
from collections.abc import Callable
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .page import Page

VISER = "1.1.1"

LOG = logging.getLogger(__package__)


class ServeError(RuntimeError):
    """The page cannot be served: one line, what is wrong and what helps."""


def _no_words(_control: Any, _asked: object, _put: object) -> str:
    return "This value cannot be set."


@dataclass(frozen=True)
class Hooks:
    """What the page is told. A call that raises costs one line in the log."""

    words: Callable[[Any, object, object], str] = _no_words  # (control, asked, put) -> the notice
    on_refused: Callable[[int, str], None] = lambda _client_id, _words: None
    on_error: Callable[[int | None, BaseException], None] = lambda _client_id, _error: None


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
    port: int
    names: frozenset[str]  # values of Host that mean us
    keys: frozenset[str]
    page: Page
    hooks: Hooks
    held: dict[tuple[int, str], Held] = field(default_factory=dict)

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


def log_line(text: str) -> None:
    """One line of the log, whatever is in the text."""
    LOG.warning("page: %s", text[:200].encode("unicode_escape").decode())
