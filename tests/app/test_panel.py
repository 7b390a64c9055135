"""The widgets of a room against a browser's messages, without a browser."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

from faceambig_app.actions import ACTIONS
from faceambig_app.panel import Change, Panel
from faceambig_app.state import DEFAULT, ViewState, changed


class Widget:
    """Keeps its listener, as viser's handles do."""

    def __init__(self, label: str, *_: Any, **__: Any) -> None:
        self.label, self.value = label, None
        self._impl = SimpleNamespace(uuid=label)

    def on_update(self, listener: Any) -> None:
        self.listener = listener

    on_click = on_upload = on_update

    def add_tab(self, label: str) -> Widget:
        return Widget(label)

    def __enter__(self) -> None:
        pass

    def __exit__(self, *_: Any) -> None:
        pass

    def hears(self, value: Any) -> None:
        event = SimpleNamespace(client_id=1, target=SimpleNamespace(value=value))
        asyncio.run(self.listener(event))


class Gui:
    """Makes a Widget for every add_...(label), of tabs and folders too."""

    def __init__(self) -> None:
        self.widgets: dict[str, Widget] = {}

    def __getattr__(self, name: str) -> Any:
        def add(label: str = "", *arguments: Any, **options: Any) -> Widget:
            widget = Widget(label, *arguments, **options)
            return self.widgets.setdefault(label, widget) if label else widget

        return add


def panel_of(state: ViewState, saving: Any = None) -> tuple[Panel, Gui, list[Change], list[str]]:
    gui, told, acts = Gui(), [], []
    made: Any = gui  # a stand-in
    made.main_panel = MagicMock()
    panel = Panel(
        made, {1: "a", 2: "b", 3: "c"}, told.append, acts.append, narrow=True,
        saving=saving or MagicMock(),
    )  # fmt: skip
    panel.show(state)
    return panel, gui, told, acts


def test_the_slider_of_mode_a_leaves_the_other_modes():
    state = changed(DEFAULT, flex=[(1, 2.0), (3, -4.0)])
    panel, gui, told, acts = panel_of(state)
    slider = gui.widgets["Mode A (mm)"]
    assert slider.value == 2.0
    slider.hears(5)
    assert told[-1](state).flex == ((1, 5.0), (3, -4.0))
    panel.show(changed(state, flex=[(2, 1.0)]))
    assert slider.value == 0.0
    slider.hears(0)
    assert told[-1](changed(state, flex=[(2, 1.0)])).flex == ((2, 1.0),)
    gui.widgets["Zero"].hears(None)
    zero = ACTIONS[acts[-1]].change
    assert zero is not None
    assert zero(state).flex == ()


def test_a_change_is_of_the_state_that_is_then():
    """Two ticks within one message each: neither undoes the other."""
    _, gui, told, _ = panel_of(DEFAULT)
    gui.widgets["Rays"].hears(True)
    gui.widgets["Names of points"].hears(True)
    state = told[1](told[0](DEFAULT))
    assert {"rays", "names"} <= set(state.overlays)


def test_what_show_writes_is_not_heard():
    _, gui, told, _ = panel_of(changed(DEFAULT, distance=0.6))
    event = SimpleNamespace(client_id=None, target=SimpleNamespace(value=3))
    asyncio.run(gui.widgets["Assumed distance"].listener(event))
    assert told == []
