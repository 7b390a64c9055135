"""Browsers that come and go: `python benchmarks/churn.py [--cycles 500]`, the end of `make bench-page`.

Each cycle connects, has its first picture, changes the assumed distance to one of four values, and leaves: half of
them at once, half when the change is drawn; ten at a time. After every tenth of the cycles the server is asked what it
holds when all have left. Wanted: no slope of memory, descriptors, threads and asyncio tasks over the second half, when
what is kept for good, such as the faces in store, is there.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import time

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from page_load import PATIENCE, SLIDER
from page_server import Server, running
from page_tab import opened

TOGETHER = 10
HELD = ("resident", "descriptors", "threads", "tasks", "browsers", "objects")


def main() -> None:
    """Print the table."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--cycles", type=int, default=500)
    cycles = arguments.parse_args().cycles
    start = time.perf_counter()
    with running() as server:
        told = asyncio.run(churn(server, cycles))
    print("cycles" + "".join(f"{name:>14}" for name in HELD))
    for done, held in told.items():
        print(f"{done:>6}" + "".join(f"{_shown(name, held[name]):>14}" for name in HELD))
    print("slope of the second half, a hundred cycles:")
    for name, slope in slopes(told).items():
        unit = " kB" if name == "resident" else ""
        print(f"  {name:<14}{100 * slope / (1e3 if unit else 1):>10.2f}{unit}")
    print(f"{cycles} cycles in {time.perf_counter() - start:.0f} s")


async def churn(server: Server, cycles: int, first: int = 20) -> dict[int, dict[str, int]]:
    """What the server holds after so many cycles, up to ten times; at 0 after the `first`, which do not count."""
    await asyncio.gather(*(_cycle(server.address, number) for number in range(first)))
    told = {0: await _left(server)}
    done = 0
    for until in (
        np.linspace(0, cycles, 1 + min(10, cycles // TOGETHER)).round().astype(int).tolist()[1:]
    ):
        while done < until:
            count = min(TOGETHER, until - done)
            await asyncio.gather(*(_cycle(server.address, done + n) for n in range(count)))
            done += count
        told[done] = await _left(server)
    return told


async def _cycle(address: str, number: int) -> None:
    async with opened(address) as tab:
        before = len(tab.meshes)
        control = tab.controls[SLIDER]
        # Few values: each new one leaves a face in store, half a megabyte, until the store is full
        await tab.set(SLIDER, int(control.props["max"]) - 1 - 5 * (number % 4))
        if number % 2 and not await tab.until(lambda: len(tab.meshes) > before, PATIENCE):
            raise TimeoutError(f"cycle {number}: no mesh in {PATIENCE:g} s: {tab.lost}")


async def _left(server: Server) -> dict[str, int]:
    """What is held when the server has seen all leave, and its workers have come to rest."""
    end = time.perf_counter() + PATIENCE
    while (held := server.ask("state"))["browsers"] and time.perf_counter() < end:
        await asyncio.sleep(0.05)
    await asyncio.sleep(0.5)  # a worker may be drawing for one who has just left
    return server.ask("state") if held["browsers"] == 0 else held


def slopes(told: dict[int, dict[str, int]]) -> dict[str, float]:
    """Of each figure over the second half of the cycles, a cycle: least squares."""
    half = [done for done in told if done >= max(told) / 2]
    return {
        name: float(np.polyfit(half, [told[done][name] for done in half], 1)[0]) for name in HELD
    }


def _shown(name: str, value: int) -> str:
    return f"{1e-6 * value:.1f} MB" if name == "resident" else str(value)


if __name__ == "__main__":
    main()
