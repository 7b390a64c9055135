"""The widgets of a room against a browser's messages, without a browser."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any

from faceambig_app.panel import Panel
from faceambig_app.state import DEFAULT, changed


class Widget:
    """Keeps its listener, as viser's handles do."""

    def __init__(self, label: str, *_: Any, **__: Any) -> None:
        self.label, self.value = label, None
        self._impl = SimpleNamespace(uuid=label)

    def on_update(self, listener: Any) -> None:
        self.listener = listener

    on_click = on_update

    def __enter__(self) -> None:
        pass

    def __exit__(self, *_: Any) -> None:
        pass

    def hears(self, value: Any) -> None:
        event = SimpleNamespace(client_id=1, target=SimpleNamespace(value=value))
        asyncio.run(self.listener(event))


class Gui:
    """Makes a Widget for every add_...(label)."""

    def __init__(self) -> None:
        self.widgets: dict[str, Widget] = {}

    def __getattr__(self, name: str) -> Any:
        def add(label: str, *arguments: Any, **options: Any) -> Widget:
            return self.widgets.setdefault(label, Widget(label, *arguments, **options))

        return add


def test_the_slider_of_mode_a_leaves_the_other_modes():
    gui, said = Gui(), []
    state = changed(DEFAULT, flex=[(1, 2.0), (3, -4.0)])
    panel = Panel(gui, state, ("a", "b", "c"), said.append)  # pyright: ignore[reportArgumentType]
    panel.build_rest(state)
    panel.show(state)
    slider = gui.widgets["Mode A (mm)"]
    assert slider.value == 2.0
    slider.hears(5)
    assert changed(state, **said[-1]).flex == ((1, 5.0), (3, -4.0))
    panel.show(changed(state, flex=[(2, 1.0)]))
    assert slider.value == 0.0
    slider.hears(0)
    assert changed(state, **said[-1]).flex == ((2, 1.0),)
    gui.widgets["Zero"].hears(None)
    assert changed(state, **said[-1]).flex == ()
