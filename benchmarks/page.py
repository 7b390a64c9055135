"""How fluid the page is: `python benchmarks/page.py [--quick]`, or `make bench-page` with the churn of browsers.

Black box over the websocket, with a server process of its own; tabs here, no browser. For each row so many tabs drag
the assumed distance at so many values a second: time from every message to the first mesh that shows its value or a
newer one, CPU a change, bytes, the slowest tab, the last value; what must be zero. Then where the server's time goes in
a drag, through values nobody has seen (every one is fitted) and again through the same, and the race of two controls.
"wanted" is for a machine of two cores with nothing else running, the load included; beside other work compare the CPU.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import random
from collections.abc import Callable
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


ROWS = (
    Bars(1, 20, p50=12, p95=30),
    Bars(10, 10, p95=50),
    Bars(30, 10, p95=100, mbit=140),
    Bars(50, 10, p95=200, slowest=5, end=400),
)


def main() -> None:
    """Print the tables."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--quick", action="store_true", help="one short drag a row, few rounds")
    arguments.add_argument("--json", action="store_true", help="the rows as JSON")
    options = arguments.parse_args()
    drags, rounds = (1, 3) if options.quick else (4, 20)
    with running() as server:
        rows, bars = asyncio.run(_rows(server, drags)), ROWS
        wrong = asyncio.run(race(server.address, rounds))
    with running(stages=True) as server:
        stages = asyncio.run(_stages(server))
    if options.json:
        figures = [_figures(row) for row in rows]
        print(json.dumps({"about": about(), "rows": figures, "race": wrong, "stages": stages}))
        return
    print(", ".join(f"{name} {value}" for name, value in about().items()))
    _show(rows, bars)
    _show_sizes(rows)
    _show_stages(stages)
    print(f"race of two controls, {PAIRS} tabs x {rounds} rounds: {len(wrong)} wrong")
    for words in wrong:
        print(f"  {words}")


async def _rows(server: Server, drags: int) -> list[Row]:
    book = await page_load.learn(server.address)
    return [
        await page_load.row(
            server.address, book, bars.clients, bars.hertz, drags, server.cpu_seconds
        )
        for bars in ROWS
    ]


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
        "clients": row.clients,
        "hertz": row.hertz,
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


def _show(rows: list[Row], bars: tuple[Bars, ...]) -> None:
    print("tabs @ Hz      p50 ms      p95 ms   last p95 ms    Mbit/s   slowest/s   CPU ms a change "
          "(ours)   kB   lost wrong shared backward")  # fmt: skip
    for row, wanted in zip(rows, bars, strict=True):
        told = _figures(row)

        def cell(
            name: str, width: int, bar: Callable[[Bars], float | None], low: bool = False
        ) -> str:
            most = bar(wanted)  # noqa: B023 - called in the same round
            said = "" if most is None else f" ({'>=' if low else '<'}{most:g})"
            return f"{told[name]:.1f}{said}".rjust(width)  # noqa: B023

        print(
            f"{row.clients:>4} @ {row.hertz:<3g}"
            + cell("p50", 12, lambda b: b.p50) + cell("p95", 14, lambda b: b.p95)
            + cell("end", 14, lambda b: b.end) + cell("mbit", 14, lambda b: b.mbit)
            + cell("slowest", 12, lambda b: b.slowest, low=True)
            + f"{told['cpu']:>12.2f} ({told['own cpu']:.2f}){told['kB']:>10.1f}"
            + "".join(f"{told[name]:>7g}" for name in ("lost", "wrong", "shared", "backward"))
        )  # fmt: skip


def _show_sizes(rows: list[Row]) -> None:
    print("bytes a change, by kind of message:")
    row = rows[0]
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
