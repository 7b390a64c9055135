"""Progress of long work: one line on stderr, renewed in place; only a terminal sees it, never a file or a program."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Iterator
from types import TracebackType
from typing import TypeVar

T = TypeVar("T")
PATIENCE = 0.3  # seconds: work that is done sooner says nothing
EVERY = 0.1  # seconds between two states of the line


class Progress:
    """Call it with what is done since the last call, of `of`. The line goes away at the end."""

    def __init__(self, words: str, of: int) -> None:
        self._words, self._of, self._done = words, of, 0
        self._next = time.perf_counter() + PATIENCE
        self._shown = 0  # characters on the line

    def __call__(self, more: int = 1) -> None:
        self._done = min(self._done + more, self._of)
        if not sys.stderr.isatty() or time.perf_counter() < self._next:
            return
        self._next = time.perf_counter() + EVERY
        line = f"{self._words}: {self._done} of {self._of}"
        sys.stderr.write(f"\r{line:<{self._shown}}")
        sys.stderr.flush()
        self._shown = len(line)

    def over(self, items: Iterable[T]) -> Iterator[T]:
        """`items`, counted as they go by."""
        for item in items:
            yield item
            self(1)

    def __enter__(self) -> Progress:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._shown:
            sys.stderr.write(f"\r{'':<{self._shown}}\r")
            sys.stderr.flush()
            self._shown = 0
