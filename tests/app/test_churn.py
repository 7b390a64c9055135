"""Browsers that come and go leave nothing behind: thirty here, five hundred by `make bench-page`."""

from __future__ import annotations

import asyncio
import importlib
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks"


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="what is held is read in /proc")
def test_thirty_browsers_come_and_go_and_leave_nothing(monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))
    churn = importlib.import_module("churn")
    with importlib.import_module("page_server").running() as served:
        told = list(asyncio.run(churn.churn(served, 30, 8)).values())
    for name in [n for n in sys.modules if n == "churn" or n.startswith("page_")]:
        monkeypatch.delitem(sys.modules, name)
    first, last = told[0], told[-1]
    for name in ("descriptors", "threads", "tasks"):
        assert last[name] == first[name], (name, told)
    assert last["browsers"] == 0
    assert last["objects"] < first["objects"] + 300, told  # a browser that stays has thousands
