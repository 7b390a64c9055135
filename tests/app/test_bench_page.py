"""What `make bench-page` measures holds, in small: browsers that come and go leave nothing, the newest state wins."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not Path("/proc/self/statm").exists(), reason="what is held is read in /proc"
    ),
]


def test_thirty_browsers_come_and_go_and_leave_nothing(benchmarks):
    with benchmarks("page_server").running() as served:
        told = list(asyncio.run(benchmarks("churn").churn(served, 30, 8)).values())
    first, last = told[0], told[-1]
    for name in ("descriptors", "threads", "tasks"):
        assert last[name] == first[name], (name, told)
    assert last["browsers"] == 0
    assert last["objects"] < first["objects"] + 300, told  # a browser that stays has thousands


def test_two_controls_in_one_instant_both_count(benchmarks):
    with benchmarks("page_server").running() as served:
        assert asyncio.run(benchmarks("page_race").race(served.address, 1)) == []


def test_the_stages_of_a_drag_are_found_and_timed(benchmarks):
    tabs, load = benchmarks("page_tab"), benchmarks("page_load")

    async def drag(address: str) -> None:
        async with tabs.opened(address) as tab:
            for value in (31, 57):
                await tab.set(load.SLIDER, value)
                await tab.quiet(load.QUIET, load.PATIENCE)  # drawn in full

    server = benchmarks("page_server")
    with server.running(stages=True) as served:
        asyncio.run(drag(served.address))
        told = served.ask("stages")["stages"]
    assert set(told) >= {*server.STAGES, "pack", "send"}
    for name, (_, wall, calls) in told.items():
        assert wall > 0, name
        assert calls > 0, name
