"""The log: one short line for each thing, and only so many of them, whoever causes them."""

from __future__ import annotations

import logging
import threading
import time
from collections import deque

LOG = logging.getLogger(__package__)


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
