"""What `make bench-page` measures holds, in small: browsers that come and go leave nothing, the newest state wins."""

from __future__ import annotations

import asyncio
import importlib
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not Path("/proc/self/statm").exists(), reason="what is held is read in /proc"
    ),
]


@pytest.fixture
def benchmarks(monkeypatch):
    """Imports a script of the benchmarks, as it is found by the others: its folder on the path."""
    monkeypatch.syspath_prepend(str(FOLDER))
    before = set(sys.modules)
    yield importlib.import_module
    for name in set(sys.modules) - before:
        if Path(getattr(sys.modules[name], "__file__", None) or "").parent == FOLDER:
            del sys.modules[name]


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


def test_the_stages_of_a_drag_are_found_and_timed(benchmarks, monkeypatch):
    page = benchmarks("page")
    monkeypatch.setattr(page, "WAYPOINTS", 3)
    with benchmarks("page_server").running(stages=True) as served:
        told = asyncio.run(page._stages(served))
    for name in ("hear", "fit", "compose", "figures", "stage", "pack", "send"):
        _, wall, calls = told["first time"]["stages"][name]
        assert wall > 0, name
        assert calls > 0, name
    assert told["again"]["stages"].get("fit", (0, 0, 0))[2] < told["first time"]["stages"]["fit"][2]
