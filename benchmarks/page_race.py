"""Race: two controls changed in one instant, again and again: both count, and the newest of each is shown.

Every racing tab has a calm one, which is told the same values one control at a time, each from rest. Their heads must
become equal to the last digit, and all controls must show what was set.
"""

from __future__ import annotations

import asyncio
import contextlib
import random
import time

import numpy as np
from page_load import PATIENCE, QUIET
from page_tab import Tab, opened

CONTROLS = ("Assumed distance", "Photo taken from", "Turn (°)")  # of the fit, and of the photograph
PAIRS = 4  # tabs that race at the same time


async def race(address: str, rounds: int, seed: int = 0) -> list[str]:
    """What was wrong, one line each; none if all is well."""
    async with contextlib.AsyncExitStack() as stack:
        tabs = [await stack.enter_async_context(opened(address)) for _ in range(2 * PAIRS)]
        pairs = zip(tabs[:PAIRS], tabs[PAIRS:], strict=True)
        found = await asyncio.gather(
            *(_pair(fast, calm, rounds, f"{seed}/{n}") for n, (fast, calm) in enumerate(pairs))
        )
    return [words for each in found for words in each]


async def _pair(fast: Tab, calm: Tab, rounds: int, seed: str) -> list[str]:
    rng, wrong = random.Random(seed), []  # noqa: S311 - a choice of values, not a secret
    for number in range(rounds):
        first, second = rng.sample(CONTROLS, 2)
        wanted: dict[str, float] = {}
        for _ in range(rng.randrange(1, 4)):  # the last of some quick values
            wanted = {name: _value(fast, name, rng) for name in (first, second)}
            for name, value in wanted.items():
                await fast.set(name, value)
            await asyncio.sleep(rng.choice((0.0, 0.005, 0.05)))
        for name, value in wanted.items():
            await calm.set(name, value)
            await calm.quiet(QUIET, PATIENCE)
        if words := await _unlike(fast, calm, wanted):
            wrong.append(f"{seed}, round {number}: {words} at {wanted}")
    return wrong


def _value(tab: Tab, name: str, rng: random.Random) -> int:
    """A value that differs from the one now."""
    control = tab.controls[name]
    low, high = int(control.props["min"]), int(control.props["max"])
    return rng.choice([v for v in range(low, high + 1) if v != control.value])


async def _unlike(fast: Tab, calm: Tab, wanted: dict[str, float]) -> str:
    """What differs when both rest; "" if nothing does."""
    end, words = time.perf_counter() + PATIENCE, "not compared"
    while words and time.perf_counter() < end and not fast.lost + calm.lost:
        await asyncio.gather(*(tab.quiet(QUIET, PATIENCE) for tab in (fast, calm)))
        words = _difference(fast, calm, wanted)
    return words or fast.lost or calm.lost


def _difference(fast: Tab, calm: Tab, wanted: dict[str, float]) -> str:
    for name, value in wanted.items():
        if fast.controls[name].value != value:
            return f"{name} shows {fast.controls[name].value}"
    for node, vertices in calm.geometry.items():
        if node not in fast.geometry or not np.array_equal(fast.geometry[node], vertices):
            return f"another {node}"
    return ""
