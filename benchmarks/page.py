"""How fluid the page is: `python benchmarks/page.py [--quick]`, or `make bench-page` with the churn of browsers.

Black box over the websocket, with a server process of its own; tabs here, no browser. For each row so many tabs drag
the assumed distance at so many values a second: time from every message to the first mesh that shows its value or a
newer one, CPU of the server a change ("ours": of this process), bytes, meshes of the slowest tab, the last value; what
must be zero. Then the race of two controls, and where the server's time goes in a drag: through values nobody has seen
(every one is fitted), and again through the same.
What stands in brackets is wanted of a machine of two cores with nothing else running, this
load included; beside other work compare the CPU.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import random
from typing import Any, NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import page_load
from page_load import QUIET, SLIDER, Row
from page_race import PAIRS, race
from page_server import Server, running
from page_tab import opened
from timing import about


class Bars(NamedTuple):
    """What is wanted of a row; None: nothing."""

    clients: int
    hertz: float
    p50: float | None = None  # ms
    p95: float | None = None
    mbit: float | None = None
    slowest: float | None = None  # meshes a second
    end: float | None = None  # ms, 95 %


COLUMNS = (  # heading, name in Bars and of a figure, width
    ("p50 ms", "p50", 13), ("p95 ms", "p95", 13), ("last p95 ms", "end", 14), ("Mbit/s", "mbit", 13),
    ("slowest/s", "slowest", 12), ("CPU ms a change", "cpu", 17), ("ours", "own cpu", 7), ("kB", "kB", 7),
    ("lost", "lost", 6), ("wrong", "wrong", 6), ("shared", "shared", 7), ("backward", "backward", 9),
)  # fmt: skip
ROWS = (
    Bars(1, 20, p50=12, p95=30),
    Bars(10, 10, p95=50),
    Bars(30, 10, p95=100, mbit=140),
    Bars(50, 10, p95=200, slowest=5, end=400),
)


def main() -> None:
    """Print the tables, each line when it is known."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--quick", action="store_true", help="one short drag a row, few rounds")
    drags, rounds = (1, 3) if arguments.parse_args().quick else (4, 20)
    print(", ".join(f"{name} {value}" for name, value in about().items()))
    with running() as server:
        asyncio.run(_rows(server, drags))
        wrong = asyncio.run(race(server.address, rounds))
    print(f"race of two controls, {PAIRS} tabs x {rounds} rounds: {len(wrong)} wrong", flush=True)
    for words in wrong:
        print(f"  {words}")
    with running(stages=True) as server:
        _show_stages(asyncio.run(_stages(server)))


async def _rows(server: Server, drags: int) -> None:
    book = await page_load.learn(server.address)
    print(" tabs @ Hz" + "".join(f"{words:>{width}}" for words, _, width in COLUMNS), flush=True)
    first = None
    for bars in ROWS:
        row = await page_load.row(
            server.address, book, bars.clients, bars.hertz, drags, server.cpu_seconds
        )
        told, wanted = _figures(row), bars._asdict()
        line = f"{row.clients:>5} @ {row.hertz:<2g}"
        for _, name, width in COLUMNS:
            bar = wanted.get(name)
            sign = ">=" if name == "slowest" else "<"
            line += f"{told[name]:.4g}{'' if bar is None else f' ({sign}{bar:g})'}".rjust(width)
        print(line, flush=True)
        first = first or row
    if first is not None:
        _show_sizes(first)


async def _stages(server: Server) -> dict[str, dict[str, Any]]:
    """What the server does in a drag by one tab at 20 Hz through 60 values, twice."""
    answer = {}
    async with opened(server.address) as tab:
        props = tab.controls[SLIDER].props
        values = [round(x) for x in np.linspace(props["min"] + 1, props["max"] - 1, 60)]
        random.Random(0).shuffle(values)  # noqa: S311 - an order, not a secret
        for name in ("first time", "again"):
            await tab.quiet(QUIET, page_load.PATIENCE)
            server.ask("stages")
            before = len(tab.meshes)
            for value in values:
                await tab.set(SLIDER, value)
                await asyncio.sleep(0.05)
            told = server.ask("stages")  # before the rest, which draws in full
            meshes = [m for m in tab.meshes[before:] if m.node.startswith(page_load.HEAD)]
            answer[name] = told | {"changes": len(values), "meshes": len(meshes)}
    return answer


def _figures(row: Row) -> dict[str, float]:
    """Milliseconds unless the name says otherwise."""
    lags, ends = 1e3 * np.array(row.told.lags), 1e3 * np.array(row.told.ends)
    return {
        "p50": float(np.percentile(lags, 50)),
        "p95": float(np.percentile(lags, 95)),
        "end": float(np.percentile(ends, 95)),
        "cpu": 1e3 * row.server_cpu / row.sent,
        "own cpu": 1e3 * row.own_cpu / row.sent,
        "kB": 1e-3 * sum(row.sizes.values()) / row.sent,
        "mbit": row.mbit,
        "slowest": row.slowest,
        "lost": row.told.lost,
        "wrong": row.told.wrong,
        "shared": row.shared,
        "backward": row.told.backward,
    }


def _show_sizes(row: Row) -> None:
    print(f"bytes a change, by kind of message, {row.clients} @ {row.hertz:g}:")
    for kind, size in row.sizes.most_common():
        print(f"  {kind:<44}{size / row.sent:>10.0f}")
    print(f"  {'all':<44}{sum(row.sizes.values()) / row.sent:>10.0f}   {row.meshes} meshes, "
          f"{row.sent} changes, rests included")  # fmt: skip


def _show_stages(stages: dict[str, dict[str, Any]]) -> None:
    print("the server in a drag, ms a change, CPU (wall):" + "".join(f"{n:>22}" for n in stages))
    names = {name for told in stages.values() for name in told["stages"]}
    order = ["hear", "fit", "compose", "sweep, posterior", "figures", "stage", "pack", "send"]
    for name in [n for n in order if n in names]:
        line = f"  {name:<44}"
        for told in stages.values():
            cpu, wall, _ = told["stages"].get(name, (0.0, 0.0, 0))
            share = 1e3 / told["changes"]
            line += f"{share * cpu:>14.2f} ({share * wall:.2f})"
        print(line)
    line, rest = f"  {'all':<44}", f"  {'of it not in a stage: event loop, websocket':<44}"
    for told in stages.values():
        share = 1e3 / told["changes"]
        known = sum(cpu for cpu, _, _ in told["stages"].values())
        line += f"{share * told['cpu']:>14.2f}        "
        rest += f"{share * (told['cpu'] - known):>14.2f}        "
    print(line, rest, sep="\n")


if __name__ == "__main__":
    main()
