"""The timer benchmarks share: competitors alternate inside each round, so that drift of the machine hits all alike."""

from __future__ import annotations

import os
import platform
import time
import tracemalloc
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import scipy

TURN = 3  # runs in succession: the first of them finds the caches as another competitor left them


def compare(work: Mapping[str, Callable[[], object]], rounds: int) -> dict[str, float]:
    """Least CPU milliseconds of each over `rounds` turns. Run each once before: its optimum is compared then.

    Time of this thread: what other programs do on the machine does not enter.
    """
    least = dict.fromkeys(work, float("inf"))
    for _ in range(rounds):
        for name, run in work.items():
            for _ in range(TURN):
                start = time.thread_time()
                run()
                least[name] = min(least[name], 1e3 * (time.thread_time() - start))
    return least


def peak_megabytes(run: Callable[[], object]) -> float:
    """Most memory `run` holds at once beyond what is held before: Python's objects and NumPy's arrays."""
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        run()
        return (tracemalloc.get_traced_memory()[1] - before) / 1e6
    finally:
        tracemalloc.stop()


def about() -> dict[str, str | float]:
    """What the figures depend on: versions, processor, what else runs, threads of the linear algebra.

    Beside other work small NumPy calls slow down more than long LAPACK calls: ratios then come out too low.
    """
    said: dict[str, str | float] = {
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "processor": _processor(),
        "load": round(os.getloadavg()[0], 1),
        "cores": os.cpu_count() or 1,
    }
    try:
        from threadpoolctl import threadpool_info
    except ImportError:
        return said
    return said | {"threads": max((pool["num_threads"] for pool in threadpool_info()), default=1)}


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.machine()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()
