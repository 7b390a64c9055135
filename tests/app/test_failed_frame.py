"""A frame that fails: the browser is told why, and its controls show what is, as at any rest."""

from __future__ import annotations

import asyncio
import importlib
import sys
from pathlib import Path
from typing import Any

from faceambig_app import server
from faceambig_app.display import Display
from faceambig_app.notices import cause
from faceambig_app.text import say

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks"
SLIDER = "Assumed distance"
BROKEN = ZeroDivisionError("the model is broken")


def test_controls_are_said_again_after_a_frame_that_failed(monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))
    opened = importlib.import_module("page_tab").opened
    monkeypatch.delitem(sys.modules, "page_tab")
    page = server.Page("127.0.0.1", 0)

    def fail(*_: object) -> None:
        raise BROKEN

    async def visit() -> None:
        async with opened(page.address) as tab:
            monkeypatch.setattr(Display, "draw", fail)
            control: Any = tab.controls[SLIDER]
            await tab.set(SLIDER, 30)
            # As if an older value of the server had crossed ours: the server has 30, and no reason to say so
            control.value = None
            assert await tab.until(lambda: control.value == 30, 20.0)
            assert tab.notices == [say("error.failed", cause=cause(BROKEN))]

    try:
        asyncio.run(visit())
    finally:
        page.close()
