"""Panel: the widgets of one room. They say what a person changed; show() writes what is. They know no scene and no fit.

Sliders are linear in viser, so a distance is a slider over whole steps of 2.9 % with the centimetres as marks, and a
number field beside it for exact values.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Coroutine
from typing import Any

import viser

from .guard import data_html
from .state import FIELDS, Field, ViewState
from .text import distance_text, say

Say = Callable[[dict[str, Any]], None]
Listener = Callable[[viser.GuiEvent[Any]], Coroutine[Any, Any, None]]

STEPS_PER_OCTAVE = 24.0  # of a distance slider: 2.9 % a step
MODE_A = 1  # the most flexible
MARKS_CM = (20, 30, 60, 120, 240)
VIEWS = ("front", "three_quarter", "side", "top", "camera")  # each a button


class Panel:
    """The widgets of one room."""

    def __init__(
        self, gui: viser.GuiApi, state: ViewState, people: tuple[str, ...], say_change: Say
    ) -> None:
        self._gui, self._say = gui, say_change
        self._people = people
        self._bends = state.flex  # of all modes; the slider moves the first
        self._build_distance(state)

    def _build_distance(self, state: ViewState) -> None:
        self._distance = self._distance_slider("distance", state.distance)
        self._distance_cm = self._gui.add_number(
            say("field.distance_cm"), centimetres(state.distance), min=centimetres(FIELDS["distance"].low),
            max=centimetres(FIELDS["distance"].high), step=0.1, hint=say("field.distance_cm_hint"),
        )  # fmt: skip
        self._distance_cm.on_update(self._heard("distance", lambda cm: round(0.01 * cm, 5)))

    def build_rest(self, state: ViewState) -> None:
        """The controls below the numbers and plots."""
        self._subject = self._gui.add_dropdown(
            say("field.subject"),
            self._people,
            initial_value=self._person(state),
            hint=say("field.subject_hint"),
        )
        self._subject.on_update(self._heard("subject", lambda name: self._people.index(name) + 1))
        self._actual = self._distance_slider("actual", state.actual)
        self._view = self._gui.add_button_group(
            say("field.view"),
            tuple(say(f"view.{name}") for name in VIEWS),
            hint=say("field.view_hint"),
        )
        by_label = {say(f"view.{name}"): name for name in VIEWS}
        self._view.on_click(self._heard("view", by_label.__getitem__))
        with self._gui.add_folder(say("folder.pose"), expand_by_default=False):
            self._pose = {
                name: self._linear_slider(name, getattr(state, name))
                for name in ("yaw", "pitch", "roll")
            }
        with self._gui.add_folder(say("folder.flex"), expand_by_default=False):
            self._flex = self._linear_slider("flex", bent(state.flex), self._bend)
            zero = self._gui.add_button(say("flex.zero"))
            zero.on_click(self._heard("flex", lambda _: ()))
            self.flex_words = self._gui.add_html("")

    @property
    def index_sliders(self) -> tuple[str, str]:
        """Identifiers of the sliders whose own number box shows a step, not a value: the page hides those boxes."""
        return self._distance._impl.uuid, self._actual._impl.uuid

    def show(self, state: ViewState) -> None:
        """Write a state into the widgets; on the event loop only, so an older value never overwrites a newer one."""
        self._distance.value = to_step(FIELDS["distance"], state.distance)
        self._distance_cm.value = centimetres(state.distance)
        self._actual.value = to_step(FIELDS["actual"], state.actual)
        self._subject.value = self._person(state)
        for name, handle in self._pose.items():
            handle.value = getattr(state, name)
        self._bends = state.flex
        self._flex.value = bent(state.flex)

    @property
    def controls(self) -> tuple[viser.GuiInputHandle[Any], ...]:
        """All that hold a value."""
        return (
            self._distance,
            self._distance_cm,
            self._subject,
            self._actual,
            *self._pose.values(),
            self._flex,
        )

    def spoken(self, state: ViewState) -> str:
        """Data for the page's script: the button that is on, and what a screen reader says for a distance slider."""
        texts = {
            say(f"field.{name}"): distance_text(getattr(state, name))
            for name in ("distance", "actual")
        }
        return data_html("pressed", {say("field.view"): say(f"view.{state.view}")}) + data_html(
            "valuetext", texts
        )

    def _person(self, state: ViewState) -> str:
        # Of a photograph nobody's name is in this list: the first stands there
        return self._people[state.subject - 1 if isinstance(state.subject, int) else 0]

    def _distance_slider(self, name: str, value: float) -> viser.GuiSliderHandle[int]:
        field = FIELDS[name]
        marks = [cm for cm in (*MARKS_CM, 500) if field.low <= cm / 100 <= field.high]
        handle = self._gui.add_slider(
            say(f"field.{name}"), 0, to_step(field, field.high), 1, to_step(field, value),
            marks=tuple((to_step(field, cm / 100), str(cm)) for cm in marks), hint=say(f"field.{name}_hint"),
        )  # fmt: skip
        handle.on_update(self._heard(name, lambda step: from_step(field, step)))
        return handle

    def _bend(self, mm: float) -> tuple[tuple[int, float], ...]:
        others = (pair for pair in self._bends if pair[0] != MODE_A)
        return (MODE_A, float(mm)), *others

    def _linear_slider(
        self, name: str, value: float, read: Callable[[Any], Any] = float
    ) -> viser.GuiSliderHandle[float]:
        field = FIELDS[name]
        handle = self._gui.add_slider(
            say(f"field.{name}"),
            float(field.low),
            float(field.high),
            float(field.step),
            float(value),
            hint=say(f"field.{name}_hint"),
        )
        handle.on_update(self._heard(name, read))
        return handle

    def _heard(self, name: str, read: Callable[[Any], Any]) -> Listener:
        async def heard(event: viser.GuiEvent[Any]) -> None:  # async: on the loop, in message order
            if event.client_id is not None:  # None: written by show()
                self._say({name: read(event.target.value)})

        return heard


def bent(flex: tuple[tuple[int, float], ...]) -> float:
    """Millimetres along mode A."""
    return dict(flex).get(MODE_A, 0.0)


def centimetres(metres: float) -> float:
    """As a number field shows it: to a tenth."""
    return round(100.0 * metres, 1)


def to_step(field: Field, metres: float) -> int:
    """Nearest step of a distance slider."""
    return round(STEPS_PER_OCTAVE * math.log2(metres / field.low))


def from_step(field: Field, step: float) -> float:
    """Metres at a step of a distance slider, to a tenth of a centimetre; the last step is the end of the range."""
    return min(field.high, round(field.low * 2 ** (float(step) / STEPS_PER_OCTAVE), 3))
