"""The timer benchmarks share: competitors alternate inside each round, so that drift of the machine hits all alike."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping


def compare(work: Mapping[str, Callable[[], object]], rounds: int) -> dict[str, float]:
    """Least CPU milliseconds of each competitor over `rounds`, after one round that does not count.

    Time of this thread: what other programs do on the machine does not enter.
    """
    least = dict.fromkeys(work, float("inf"))
    for number in range(rounds + 1):
        for name, run in work.items():
            start = time.thread_time()
            run()
            spent = 1e3 * (time.thread_time() - start)
            if number:
                least[name] = min(least[name], spent)
    return least
