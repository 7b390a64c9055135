"""Glide: the assumed distance moves by itself through its whole range and comes back, one octave in two seconds.

Any change by a hand stops it; it is a task of the event loop, so a change never crosses a step of it.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Iterable, Iterator

from .state.fields import FIELDS

SECONDS_PER_OCTAVE = 2.0
STEP = 0.05  # seconds between two distances: as often as a slider of viser speaks
STILLS = (0.3, 0.6, 1.2, 2.4)  # metres, where motion is not wanted
STILL_SECONDS = 2.0


def path(start: float) -> Iterator[float]:
    """Distances from `start` to the far end, to the near end and back, metres."""
    low, high = FIELDS["distance"].low, FIELDS["distance"].high
    octaves = STEP / SECONDS_PER_OCTAVE
    at = start
    for end in (high, low, start):
        n = max(1, math.ceil(abs(math.log2(end / at)) / octaves))
        for k in range(1, n + 1):
            yield round(at * (end / at) ** (k / n), 4)
        at = end


class Glide:
    """The glide of one browser."""

    def __init__(self, go: Callable[[float], None]) -> None:
        self._go = go
        self._task: asyncio.Task[None] | None = None

    @property
    def on(self) -> bool:
        """Whether it is moving."""
        return self._task is not None and not self._task.done()

    def start(self, distance: float, *, stills: bool) -> None:
        """Move from `distance`; by few stills where a person wants no motion."""
        self.stop()
        steps = [*STILLS, distance] if stills else path(distance)
        self._task = asyncio.get_running_loop().create_task(
            self._run(steps, STILL_SECONDS if stills else STEP)
        )

    def stop(self) -> None:
        """Stay where it is."""
        if self._task is not None:
            self._task.cancel()
            self._task = None

    async def _run(self, steps: Iterable[float], seconds: float) -> None:
        for distance in steps:
            self._go(distance)
            await asyncio.sleep(seconds)
