"""Sessions: how many browsers there may be, how fast each may speak, and when one is sent away.

A message costs two counters; all else is looked at once a second, or when a browser hurries.
"""

from __future__ import annotations

import asyncio
from contextvars import ContextVar
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

import numpy as np
from viser.infra import _infra
from viser.infra._async_message_buffer import AsyncMessageBuffer

from .log import log_line
from .pinned import ServeError

AT_WORK = 16  # handlers of one browser that may be at work before its next message is read
IN_TRANSPORT = 32 * 1024 * 1024  # bytes written and not taken: more than the largest frame of ours
LOOK = 1.0  # seconds between two looks at a browser

real_producer = _infra._message_producer


@dataclass(frozen=True)
class Limits:
    """What one browser, and all together, may take."""

    sessions: int = 64  # browsers at a time
    # Seconds until a browser shows its camera. A phone that compiles shaders for longer comes back when it is done
    first: float = 10.0
    # Seconds without a word; the page comes back by itself when it is looked at
    idle: float = 3600.0
    rate: float = 120.0  # messages a second that are read; more wait in the sender's own machine
    burst: float = 240.0  # messages that may come at once
    hurry: float = 10.0  # seconds at full speed, which no hand keeps up: what it sends would be read long after it left
    waiting: int = 4000  # messages for a browser that does not take them
    waiting_bytes: int = 16 * 1024 * 1024

    def __post_init__(self) -> None:
        if not 1 <= self.sessions <= 1000:
            raise ServeError(f"sessions {self.sessions}: must be from 1 to 1000")
        if not 0 < self.idle <= 7 * 86400:  # refuses NaN too
            raise ServeError(f"idle minutes {self.idle / 60:g}: must be above 0 and at most 10080")


class Session:
    """One connection, from its handshake to its end."""

    def __init__(
        self,
        limits: Limits,
        connection: Any,
        *,
        leads: bool = False,
        languages: tuple[str, ...] = (),
    ) -> None:
        self._loop = asyncio.get_running_loop()
        self._limits = limits
        self._connection: Any = connection
        self.leads = leads  # whether it came by the link of who leads a class
        self.languages = languages  # that it asks for, dearest first
        self.shown = False  # whether its first camera has come
        self.at_work = 0
        self.buffer: AsyncMessageBuffer | None = None
        self._opened = self._heard = self._paced = self._filled = self._loop.time()
        self._count = self._heard_count = 0  # messages read; when it was last looked
        self._free = limits.burst  # messages that may be read without a look at the clock
        self._closing: asyncio.Task[None] | None = None
        self._timer = self._loop.call_later(self._pause, self._look)

    @property
    def _pause(self) -> float:
        return min(LOOK, self._limits.first / 4, self._limits.idle / 4)

    def end(self) -> None:
        """It is over: nothing of the browser is held from here."""
        self._timer.cancel()
        self._connection = self.buffer = None

    async def read(self, websocket: Any) -> Any:
        """The next message, when it is this browser's turn: TCP then slows the sender."""
        raw = await websocket.recv()
        self._count += 1
        if self._count > self._free:
            await self._wait(websocket)
        while self.at_work > AT_WORK:
            await asyncio.sleep(0.01)
        return raw

    async def _wait(self, websocket: Any) -> None:
        """What it has earned since the last time is free again; with nothing earned it waits."""
        now, limits = self._loop.time(), self._limits
        earned = (now - self._filled) * limits.rate
        self._free, self._filled = min(self._free + earned, self._count + limits.burst), now
        if self._free > self._count + limits.burst / 2:
            self._paced = now
        elif self._count > self._free:
            if now - self._paced > limits.hurry:
                await websocket.close(1008, "too fast")
            await asyncio.sleep((self._count - self._free) / limits.rate)

    def _look(self) -> None:
        if self._connection is None:
            return
        now = self._loop.time()
        if self._count != self._heard_count:
            self._heard, self._heard_count = now, self._count
        if not self.shown and now - self._opened > self._limits.first:
            self._close("no camera")
        elif now - self._heard > self._limits.idle:
            self._close("idle")
        elif self._stuck():
            log_line("a browser that does not read is cut off")
            self._connection.transport.abort()
        else:
            self._timer = self._loop.call_later(self._pause, self._look)

    def _close(self, why: str) -> None:
        self._closing = self._loop.create_task(self._connection.close(1008, why))

    def _stuck(self) -> bool:
        if self._connection.transport.get_write_buffer_size() > IN_TRANSPORT:
            return True
        if self.buffer is None or not self.buffer.message_from_id:
            return False
        with self.buffer.buffer_lock:
            waiting = list(self.buffer.message_from_id.values())
        return (
            len(waiting) > self._limits.waiting
            or sum(map(_weight, waiting)) > self._limits.waiting_bytes
        )


SESSION: ContextVar[Session | None] = ContextVar("session of the running connection", default=None)


def leads() -> bool:
    """Whether the running connection is of who leads a class; False outside of any."""
    session = SESSION.get()
    return session is not None and session.leads


def languages() -> tuple[str, ...]:
    """Tags of the languages that the running connection's browser asks for, dearest first; none outside of any."""
    session = SESSION.get()
    return () if session is None else session.languages


async def produce(websocket: Any, buffer: Any, client_id: Any, *rest: Any, **options: Any) -> None:
    """viser's writer of one connection; ours notes where what is meant for this browser alone waits."""
    session = SESSION.get()
    if session is not None and not buffer.persistent_messages:
        session.buffer = buffer
    await real_producer(websocket, buffer, client_id, *rest, **options)


def _weight(value: object) -> int:
    """About the bytes that a message holds."""
    if isinstance(value, np.ndarray):
        return value.nbytes
    if isinstance(value, bytes | str):
        return len(value)
    if isinstance(value, dict):
        return sum(map(_weight, value.values()))
    if is_dataclass(value) and not isinstance(value, type):
        return sum(_weight(getattr(value, one.name)) for one in fields(value))
    return 8
