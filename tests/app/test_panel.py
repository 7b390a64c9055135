"""The widgets of a room against a browser's messages, without a browser."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import numpy as np

from faceambig_app.markup import figures
from faceambig_app.panel import Change, Panel
from faceambig_app.panel.export import Shown
from faceambig_app.state import DEFAULT, ViewState, changed, names_of_pins
from faceambig_app.state.actions import ACTIONS, rename, unpin


class Widget:
    """Keeps its listener, as viser's handles do."""

    def __init__(self, label: str, *_: Any, **__: Any) -> None:
        self.label = label
        self.value: Any = None
        self.disabled, self._marks, self.visible = False, (), True
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
            if name == "add_text":
                widget.value = arguments[0]
            return self.widgets.setdefault(label, widget) if label else widget

        return add


def panel_of(state: ViewState, saving: Any = None) -> tuple[Panel, Gui, list[Change], list[str]]:
    gui, told, acts = Gui(), [], []
    made: Any = gui  # a stand-in
    made.main_panel = MagicMock()
    panel = Panel(
        made, {1: "a", 2: "b", 3: "c"}, told.append, acts.append, narrow=True,
        own=MagicMock(), use_hint=lambda: None, saving=saving or MagicMock(),
        lessons_do=MagicMock(),
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
    gui.widgets["Modes"].hears("Zero")
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


def test_the_window_of_sliders_follows_the_state():
    state = changed(DEFAULT, flex=[(1, 2.0), (5, -4.0)], flex_from=4)
    _, gui, told, acts = panel_of(state)
    b = gui.widgets["Mode B (mm)"]
    assert b.value == -4.0
    assert gui.widgets["Mode A (mm)"].value == 0.0
    b.hears(1.5)
    assert told[-1](state).flex == ((1, 2.0), (5, 1.5))
    gui.widgets["Modes"].hears("Next three")
    onward = ACTIONS[acts[-1]].change
    assert onward is not None
    assert onward(state).flex_from == 7
    assert onward(state).flex == state.flex
    assert onward(changed(DEFAULT, flex_from=67)).flex_from == 1  # of 70 modes


def test_sliders_are_told_their_words_and_marks():
    panel, gui, _, _ = panel_of(DEFAULT)
    panel.flex.tell([("A: nose forward", ((-1.5, "face"), (1.5, ""))), ("B: ears back", ())])
    a, b, c = (gui.widgets[f"Mode {letter} (mm)"] for letter in "ABC")
    assert (a.label, b.label, c.label) == ("A: nose forward", "B: ears back", "Mode C (mm)")
    assert [(mark.value, mark.label) for mark in a._marks] == [(-1.5, "face"), (1.5, "")]
    assert (a.disabled, b.disabled, c.disabled) == (False, False, True)


def test_a_surprise_is_as_strong_as_the_slider_and_the_state_decides_it():
    _, gui, told, _ = panel_of(DEFAULT)
    gui.widgets["Strength (mm)"].value = 3.0
    gui.widgets["Other faces"].hears("Surprise me")
    state = changed(DEFAULT, extreme=2, draw=5, flex_from=4)
    mixed = told[-1](state)
    assert mixed == told[-1](state)
    assert [mode for mode, _ in mixed.flex] == [4, 5, 6]
    # rounded to a tenth of a millimetre each
    assert abs(sum(mm**2 for _, mm in mixed.flex) ** 0.5 - 3.0) < 0.1
    assert (mixed.extreme, mixed.draw) == (None, None)
    assert told[-1](mixed).flex != mixed.flex


def test_other_faces_come_one_after_the_other_and_a_bend_ends_them():
    state, seen = DEFAULT, []
    for _ in range(3):
        state = changed_by("draw", state)
        seen.append(state.draw)
    assert seen == [0, 1, 2]
    assert changed_by("draw", changed(DEFAULT, draw=9999)).draw == 0
    one = changed_by("extremes", state)
    two = changed_by("extremes", one)
    assert [(s.extreme, s.draw) for s in (one, two, changed_by("extremes", two))] == [
        (1, None), (2, None), (1, None),
    ]  # fmt: skip
    _, gui, told, _ = panel_of(two)
    gui.widgets["Mode A (mm)"].hears(1.0)
    assert told[-1](two) == changed(DEFAULT, flex=[(1, 1.0)])
    assert changed_by("unbend", two) == DEFAULT


def changed_by(action: str, state: ViewState) -> ViewState:
    change = ACTIONS[action].change
    assert change is not None
    return change(state)


def test_a_pin_keeps_its_name_while_others_come_and_go():
    faces = [changed(DEFAULT, distance=metres) for metres in (0.3, 0.6, 1.2, 2.0, 2.4)]
    state = changed(DEFAULT, pins=faces, pin_names=["a", "", "c", "d", "e"])
    assert changed_by("pin", changed(state, distance=0.3)).pin_names == ("", "c", "d", "e", "a")
    other = changed_by("pin", changed(state, distance=0.5))  # the oldest goes
    assert names_of_pins(other) == ("", "c", "d", "e", "")
    assert names_of_pins(unpin(2)(state)) == ("a", "", "d", "e")
    assert unpin(9)(state) == rename(9, "x")(state) == state
    assert changed_by("pin_distances", state).pin_names == ()
    assert changed_by("unpin", state) == DEFAULT


def test_a_name_is_typed_beside_its_pin_and_follows_the_state():
    state = changed(DEFAULT, pins=[DEFAULT, changed(DEFAULT, distance=0.6)], pin_names=["", "Near"])
    panel, gui, told, _ = panel_of(state)
    first, second, third = (gui.widgets[f"Name of pin {number}"] for number in (1, 2, 3))
    assert [w.visible for w in (first, second, third)] == [True, True, False]
    assert (first.value, second.value) == ("", "Near")
    first.hears("My \u202eface \x07" + "x" * 40)
    assert told[-1](state).pin_names == ("My face " + "x" * 22, "Near")
    second.hears("")
    assert told[-1](state).pin_names == ()
    second.value = "Near "  # the next word is being typed
    panel.show(state)
    assert second.value == "Near "
    second.value = "Near" + "x" * 40  # too long: what is kept is shown
    panel.show(changed(state, pin_names=["", "Near" + "x" * 26]))
    assert second.value == "Near" + "x" * 26
    panel.show(changed(state, pins=[DEFAULT]))
    assert not second.visible
    remove = gui.widgets["Remove all pins"]
    assert remove.visible
    panel.show(DEFAULT)
    assert not remove.visible  # there is nothing to remove


def test_pins_are_listed_with_their_distances_and_an_empty_list_says_what_to_do():
    assert "Nothing pinned yet. Press M to keep this face." in figures.pins(
        (), (), np.zeros((0, 0))
    )
    d_s = np.array([[0.0, 2.34], [2.34, 0.0]])
    html = figures.pins(("Pin 1", "Pin 2"), ("Person 2, a < b", "Person 3"), d_s)
    assert html.count("2.3") == 2
    assert "a &lt; b" in html
    alone = figures.pins(("Pin 1",), ("Person 2",), np.zeros((1, 1)))
    assert "<table>" not in alone


def test_a_hidden_distance_is_not_in_the_first_words():
    assert "30\u202fcm" in figures.heading(1.2, 0.3, 68)
    assert "30\u202fcm" not in figures.heading(1.2, None, 68)


class Saving:
    """Writes down what is ordered."""

    def __init__(self) -> None:
        self.ordered: list[Any] = []

    def save(self, kind: str, **options: Any) -> None:
        self.ordered.append((kind, options))

    def stop(self) -> None:
        self.ordered.append("stop")

    def open(self, name: str, data: bytes) -> None:
        self.ordered.append((name, data))


def test_the_export_tab_orders_what_its_boxes_say():
    saving = Saving()
    panel, gui, told, _ = panel_of(DEFAULT, saving)
    at = gui.widgets
    at["Size"].value, at["Transparent"].value, at["Words and numbers"].value = "4 x", True, False
    at["Save the picture"].hears(True)
    at["Face"].value = "True face"
    at["Save as"].hears("GLB")
    at["Save numbers"].hears("CSV")
    at["Save the state"].hears(True)
    at["What moves"].value = "Mode B"
    at["Save it as"].hears("GIF")
    at["Save it as"].hears("Page")
    at["What moves"].value = "Assumed distance"
    at["Save it as"].hears("WebP")
    at["Stop"].hears(True)
    assert saving.ordered == [
        ("png", {"scale": 4, "transparent": True, "overlays": False}),
        ("glb", {"face": "true"}),
        ("csv", {}),
        ("state", {}),
        ("gif", {"what": "mode", "mode": 2}),
        ("html", {"whats": ("mode",)}),
        ("webp", {"what": "distance"}),
        "stop",
    ]
    assert told == []  # an export changes nothing
    panel.show(DEFAULT)


def test_an_own_photograph_is_in_a_file_only_when_it_is_there_and_asked_for():
    saving = Saving()
    panel, gui, _, _ = panel_of(DEFAULT, saving)
    own = gui.widgets["With my photograph"]
    at = gui.widgets
    at["Size"].value, at["Transparent"].value, at["Words and numbers"].value = "1 x", False, True
    at["What moves"].value = "Assumed distance"
    seen: list[bool] = []
    for state, ticked in ((DEFAULT, True), (changed(DEFAULT, subject="photo"), False)):
        panel.show(state)
        own.value = ticked
        at["Save the picture"].hears(True)
        at["Save it as"].hears("WebP")
        seen.append(getattr(own, "visible", True))
    assert seen == [False, True]
    assert all("own_photo" not in options for _, options in saving.ordered)
    own.value = True
    at["Save the picture"].hears(True)
    at["Save it as"].hears("Page")
    assert [options["own_photo"] for _, options in saving.ordered[-2:]] == [True, True]


def test_how_far_a_file_is_stands_in_the_tab_and_can_be_stopped_only_meanwhile():
    panel, *_ = panel_of(DEFAULT)
    tab: Any = panel.export
    tab.show(Shown("Drawing: 2 of <4>.", 0.25, busy=True))
    assert "Drawing: 2 of &lt;4&gt;." in tab.words.content
    assert tab.bar.value == 25.0
    assert tab.bar.visible
    assert tab.stop.visible
    tab.show(Shown())
    assert tab.words.content == ""
    assert not tab.bar.visible
    assert not tab.stop.visible
