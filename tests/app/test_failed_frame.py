"""A frame that fails: the browser is told why, and its controls show what is, as at any rest."""

from __future__ import annotations

import asyncio
from typing import Any

from faceambig_app import server
from faceambig_app.display import Display
from faceambig_app.notices import cause
from faceambig_app.text import say

SLIDER = "Assumed distance"
BROKEN = ZeroDivisionError("the model is broken")


def test_controls_are_said_again_after_a_frame_that_failed(monkeypatch, benchmarks):
    opened = benchmarks("page_tab").opened
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


def test_a_panel_that_is_made_anew_under_a_moving_hand_is_not_written_into(wires, caplog):
    there: set[str] = set()
    lost: list[dict[str, Any]] = []

    class Listening(wires.Wire):
        """Knows which elements there are, as the page does."""

        def _hear(self, message: dict[str, Any]) -> None:
            kind, uuid = message["type"], message.get("uuid")
            if kind == "GuiRemoveMessage":
                there.discard(uuid)
            elif kind == "GuiUpdateMessage":
                if uuid not in there:
                    lost.append(message)
            elif kind.startswith("Gui") and uuid is not None:
                there.add(uuid)
            super()._hear(message)

    page = server.Page("127.0.0.1", 0)
    try:
        wire = Listening(int(page.address.rsplit(":", 1)[1].strip("/")))
        assert wire.rests(60)
        spoken = {
            "Deutsch": ("Language", "Assumed distance"), "English": ("Sprache", "Angenommener Abstand"),
        }  # fmt: skip
        for k, (wanted, (group, slider)) in enumerate(6 * list(spoken.items())):
            assert wire.wait(lambda g=group: labelled(wire, g), 60)
            wire.set(wire.control("Slider", slider), 10 + k)
            wire.read(0.002 * k)
            wire.set(wire.control("ButtonGroup", group), wanted)
        assert wire.wait(lambda: labelled(wire, "Language"), 60)
        wire.close()
    finally:
        page.close()
    assert not lost
    assert not caplog.records


def test_faces_that_are_shown_in_turn_go_on_in_another_language(wires, caplog):
    page = server.Page("127.0.0.1", 0)
    try:
        wire = wires.Wire(int(page.address.rsplit(":", 1)[1].strip("/")), "show=blink")
        assert wire.rests(60)
        assert wire.told["blink"]["nodes"]
        wire.set(wire.control("ButtonGroup", "Language"), "Deutsch")
        assert wire.wait(lambda: labelled(wire, "Sprache"), 60)
        for value, still in ((30, True), (12, False)):
            wire.told.pop("address")
            wire.set(wire.control("Slider", "Angenommener Abstand"), value)
            assert wire.rests(60)
            assert bool(wire.told["blink"]["nodes"]) is still
            wire.report(key="Escape")  # they stand still
        assert not wire.notices
        wire.close()
    finally:
        page.close()
    assert not caplog.records


def labelled(wire: Any, label: str) -> bool:
    """Whether there is a control of this label."""
    return any(made["props"].get("label") == label for made in wire.controls.values())
