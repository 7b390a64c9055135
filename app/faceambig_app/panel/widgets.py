"""Widgets of fields: each says a change of the state, and knows how to show a state. The field table has the ranges.

Sliders are linear in viser, so a distance is a slider over whole steps of 2.9 % with the centimetres as marks, and a
number field beside it for exact values.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Coroutine, Mapping, Sequence
from typing import Any

import viser

from ..state import ViewState, changed
from ..state.fields import FIELDS, Field
from ..text import numeral, say

Change = Callable[[ViewState], ViewState]
Tell = Callable[[Change], None]
Listener = Callable[[viser.GuiEvent[Any]], Coroutine[Any, Any, None]]

_NOTHING = object()  # equal to no value
STEPS_PER_OCTAVE = 24.0  # of a distance slider: 2.9 % a step
MARKS_CM = (20, 30, 60, 120, 240, 500)


class Widgets:
    """Makes the widgets of one browser, and writes a state into all of them."""

    def __init__(self, gui: viser.GuiApi, tell: Tell, act: Callable[[str], None]) -> None:
        self.gui = gui
        self._tell, self._act = tell, act
        self._shown: list[tuple[viser.GuiInputHandle[Any], Callable[[ViewState], Any]]] = []
        self._last: list[Any] = []  # what was shown in each, unless a person has changed it since
        self._touched: set[int] = set()  # those that somebody has changed since `touched` was asked
        self._watched: list[tuple[Callable[[ViewState], Any], Callable[[Any], None]]] = []
        self._seen: list[Any] = []  # what each watcher was told
        self._pressed: dict[str, Callable[[ViewState], str]] = {}  # label of a group -> option on
        self._steps: list[str] = []

    def touched(self) -> list[viser.GuiInputHandle[Any]]:
        """The widgets that a person or `show` has changed since this was asked: there both may have crossed."""
        touched = [self._shown[index][0] for index in sorted(self._touched)]
        self._touched.clear()
        return touched

    @property
    def step_sliders(self) -> tuple[str, ...]:
        """Identifiers of sliders whose own number box shows a step, not a value: the page hides those boxes."""
        return tuple(self._steps)

    def pressed(self, state: ViewState) -> dict[str, str]:
        """The option that is on, of each group of buttons."""
        return {label: read(state) for label, read in self._pressed.items()}

    def show(self, state: ViewState) -> None:
        """Write a state into the widgets; on the event loop only, so an older value never overwrites a newer one."""
        for index, (handle, read) in enumerate(self._shown):
            value = read(state)
            if value == self._last[index]:
                continue
            self._last[index] = value
            if handle.value != value:  # asked first: viser looks up types at every assignment
                handle.value = value
                self._touched.add(index)
        for index, (read, tell) in enumerate(self._watched):
            value = read(state)
            if value != self._seen[index]:
                self._seen[index] = value
                tell(value)

    def watch(self, read: Callable[[ViewState], Any], tell: Callable[[Any], None]) -> None:
        """Call `tell` with `read(state)` whenever that has changed: for what is more than a value of a widget."""
        self._watched.append((read, tell))
        self._seen.append(_NOTHING)

    def distance(
        self, name: str, marks_cm: Sequence[int] = MARKS_CM, *, visible: bool = True
    ) -> viser.GuiSliderHandle[int]:
        """A slider over the steps of a distance."""
        field = FIELDS[name]
        marks = [cm for cm in marks_cm if field.low <= cm / 100 <= field.high]
        handle = self.gui.add_slider(
            say(f"field.{name}"), 0, to_step(field, field.high), 1, to_step(field, field.low),
            marks=tuple((to_step(field, cm / 100), str(cm)) for cm in marks), hint=say(f"field.{name}_hint"),
            visible=visible,
        )  # fmt: skip
        self._steps.append(handle._impl.uuid)
        self.bind(handle, lambda state: to_step(field, getattr(state, name)),
                  lambda step: setting(name, from_step(field, step)))  # fmt: skip
        return handle

    def centimetres(self, name: str, label: str) -> None:
        """A number field for a distance, in centimetres, to a tenth."""
        field = FIELDS[name]
        handle = self.gui.add_number(
            say(f"field.{label}"), centimetres(field.low), min=centimetres(field.low), max=centimetres(field.high),
            step=0.1, hint=say(f"field.{label}_hint"),
        )  # fmt: skip
        self.bind(handle, lambda state: centimetres(getattr(state, name)),
                  lambda cm: setting(name, round(0.01 * cm, 5)))  # fmt: skip

    def logarithmic(self, name: str, marks: Sequence[float]) -> None:
        """A slider over the octaves of a positive number, with its values as marks."""
        field = FIELDS[name]
        handle = self.gui.add_slider(
            say(f"field.{name}"), 0, to_step(field, field.high), 1, 0,
            marks=tuple((to_step(field, mark), numeral(f"{mark:g}")) for mark in marks), hint=say(f"field.{name}_hint"),
        )  # fmt: skip
        self._steps.append(handle._impl.uuid)
        self.bind(handle, lambda state: to_step(field, getattr(state, name)),
                  lambda step: setting(name, from_step(field, step)))  # fmt: skip

    def slider(self, name: str) -> None:
        """A linear slider with its number box."""
        field = FIELDS[name]
        kind = int if field.kind == "whole" else float
        handle = self.gui.add_slider(
            say(f"field.{name}"), kind(field.low), kind(field.high), kind(field.step), kind(field.low),
            hint=say(f"field.{name}_hint"),
        )  # fmt: skip
        self.bind(
            handle, lambda state: getattr(state, name), lambda value: setting(name, kind(value))
        )

    def buttons(
        self, name: str, choices: Sequence[str | int] | None = None, *, visible: bool = True
    ) -> viser.GuiButtonGroupHandle:
        """A row of buttons, one a choice."""
        by_label = {
            say(f"{name}.{choice}"): choice
            for choice in (FIELDS[name].choices if choices is None else choices)
        }
        label = say(f"field.{name}")
        handle = self.gui.add_button_group(
            label, tuple(by_label), hint=say(f"field.{name}_hint"), visible=visible
        )
        handle.on_click(self.heard(lambda option: setting(name, by_label[option])))
        labels = {choice: option for option, choice in by_label.items()}
        self._pressed[label] = lambda state: labels.get(getattr(state, name), "")
        return handle

    def dropdown(self, name: str, choices: Mapping[Any, str]) -> None:
        """A list to choose from: value -> words."""
        values = {words: value for value, words in choices.items()}
        handle = self.gui.add_dropdown(
            say(f"field.{name}"), tuple(values), initial_value=next(iter(values)), hint=say(f"field.{name}_hint")
        )  # fmt: skip
        first = next(iter(values))
        self.bind(handle, lambda state: choices.get(getattr(state, name), first),
                  lambda words: setting(name, values[words]))  # fmt: skip

    def checkbox(
        self, label: str, read: Callable[[ViewState], bool], write: Callable[[bool], Change]
    ) -> None:
        """A tick for something that is on or off; words at field.`label`."""
        handle = self.gui.add_checkbox(
            say(f"field.{label}"), False, hint=say(f"field.{label}_hint")
        )
        self.bind(handle, read, write)

    def names(self, name: str) -> None:
        """Ticks of a field that is a set of names."""
        for choice in FIELDS[name].choices:
            self.checkbox(f"{name}_{choice}", _has(name, choice), _with(name, choice))

    def action(self, name: str) -> viser.GuiButtonHandle:
        """A button that does an action of the table."""
        handle = self.gui.add_button(say(f"action.{name}"), hint=say(f"action.{name}_hint"))
        handle.on_click(self.acted(lambda _: name))
        return handle

    def actions(
        self, label: str, names: Sequence[str], *, visible: bool = True
    ) -> viser.GuiButtonGroupHandle:
        """A row of buttons, one an action; words at field.`label`."""
        by_label = {say(f"action.{name}"): name for name in names}
        handle = self.gui.add_button_group(say(f"field.{label}"), tuple(by_label), visible=visible)
        handle.on_click(self.acted(lambda option: by_label[option]))
        return handle

    def bind(
        self, handle: viser.GuiInputHandle[Any], read: Callable[[ViewState], Any], write: Callable[[Any], Change]
    ) -> None:  # fmt: skip
        """Let a widget show `read(state)` and say the change `write(value)`."""
        index = len(self._shown)

        def changes(value: Any) -> Change:
            self._last[index] = _NOTHING
            self._touched.add(index)
            return write(value)

        handle.on_update(self.heard(changes))
        self._shown.append((handle, read))
        self._last.append(_NOTHING)

    def heard(self, write: Callable[[Any], Change]) -> Listener:
        """A listener that says what a person did; what show() writes is not heard."""

        async def listener(
            event: viser.GuiEvent[Any],
        ) -> None:  # async: on the loop, in message order
            if event.client_id is not None:  # None: written by show()
                self._tell(write(event.target.value))

        return listener

    def acted(self, name: Callable[[Any], str]) -> Listener:
        """A listener that does an action."""

        async def listener(event: viser.GuiEvent[Any]) -> None:
            if event.client_id is not None:
                self._act(name(event.target.value))

        return listener


def setting(name: str, value: Any) -> Change:
    """The change that sets one field."""
    return lambda state: changed(state, **{name: value})


def _has(name: str, choice: object) -> Callable[[ViewState], bool]:
    return lambda state: choice in getattr(state, name)


def _with(name: str, choice: object) -> Callable[[bool], Change]:
    def write(on: bool) -> Change:
        return lambda state: changed(state, **{name: toggled(getattr(state, name), choice, on)})

    return write


def toggled(names: tuple[object, ...], choice: object, on: bool) -> tuple[object, ...]:
    """The names with `choice` in or out."""
    rest = tuple(name for name in names if name != choice)
    return (*rest, choice) if on else rest


def centimetres(metres: float) -> float:
    """As a number field shows it: to a tenth."""
    return round(100.0 * metres, 1)


def to_step(field: Field, value: float) -> int:
    """Nearest step of a logarithmic slider."""
    return round(STEPS_PER_OCTAVE * math.log2(value / field.low))


def from_step(field: Field, step: float) -> float:
    """Value at a step of a logarithmic slider, to a thousandth; the last step is the end of the range."""
    return min(field.high, round(field.low * 2 ** (float(step) / STEPS_PER_OCTAVE), 3))
