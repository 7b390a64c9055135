"""The lesson: its text, the prediction, the controls that a step needs, back and next; and the list to choose from.

The texts come in as HTML. What a person does goes out as it is: which answer, which lesson.
"""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import viser

from ..state import ViewState
from ..text import say
from . import flex
from .explore import NAMED_VIEWS, folder
from .widgets import MARKS_CM, Change, Widgets

CHOICES = 5  # buttons for an answer


@dataclass(frozen=True, slots=True)
class Shown:
    """What is shown of a step. The default is: no lesson."""

    html: str = ""
    choices: tuple[str, ...] = ()  # that can be predicted now
    number: tuple[int, int, str] | None = None  # or a number: low, high, unit
    tools: tuple[str, ...] = ()
    teacher: str = ""  # HTML
    problems: str = ""  # HTML


class Does(Protocol):
    """What the room of the lessons does."""

    @property
    def titles(self) -> Mapping[int, str]:
        """Number -> title."""
        ...

    def chosen(self, number: int | None) -> Change:
        """The change that begins a lesson; None ends it."""
        ...

    def predict(self, words: str) -> None:
        """An answer is given."""
        ...


class Lessons:
    """The widgets of the lessons; `build_list` makes the last of them, below the photograph."""

    def __init__(self, w: Widgets, does: Does, *, narrow: bool) -> None:
        """narrow: there is one panel, and the tab Explore far below the lesson."""
        self._w, self._does = w, does
        self._shown = Shown()
        self._on: dict[str, bool] = {}  # names of what can be seen
        self._text = w.gui.add_html("")
        self._buttons = [_button(w.gui, f"{k}") for k in range(CHOICES)]
        for button in self._buttons:
            button.on_click(_heard(lambda button=button: does.predict(button.label)))
        self._number = w.gui.add_number(say("lesson.number", unit=""), 0, visible=False)
        self._unit = ""
        self._say = _button(w.gui, say("lesson.say"))
        self._say.on_click(_heard(self._guess))
        self.flex = flex.sliders(w, visible=False)
        self._tools: dict[str, Sequence[Any]] = {
            # Without the last mark: its words stand out of the panel, which would scroll sideways
            "actual": (w.distance("actual", MARKS_CM[:-1], visible=False),),
            "data": (w.buttons("data", visible=False),),
            "camera": (w.buttons("camera", visible=False),),
            "view": (w.buttons("view", NAMED_VIEWS, visible=False),),
            "show": (w.buttons("show", ("both", "overlay", "blink", "difference"), visible=False),),
            "flex": self.flex,
            **{
                name: (w.actions("lesson_tool", (name,), visible=False),)
                for name in ("glide", "draw", "extremes", "rays")
            },
        }
        if narrow:
            self._tools["distance"] = (w.distance("distance", visible=False),)
        self._steps = w.actions(
            "lesson_step", ("lesson_back", "lesson_next", "lesson_leave"), visible=False
        )

    def build_list(self) -> None:
        """The lessons to choose from, what is wrong with files of lessons, and the teacher's note."""
        w, titles = self._w, dict(self._does.titles)
        numbered = {None: say("lesson.none")} | {n: f"{n} {title}" for n, title in titles.items()}
        numbers = {words: number for number, words in numbered.items()}
        entry = w.gui.add_dropdown(
            say("field.lesson"), tuple(numbers), initial_value=numbered[None], hint=say("field.lesson_hint")
        )  # fmt: skip
        w.bind(entry, _title(numbered), lambda words: self._does.chosen(numbers[words]))
        self._problems = w.gui.add_html("")
        self._folder = folder(w, "teacher", visible=False)
        with self._folder:
            self._teacher = w.gui.add_html("")

    def show(self, shown: Shown) -> None:
        """Write what is shown; on the event loop only."""
        if shown == self._shown:
            return
        self._shown = shown
        self._text.content, self._teacher.content = shown.html, shown.teacher
        self._problems.content = shown.problems
        for k, button in enumerate(self._buttons):
            if k < len(shown.choices) and button.label != shown.choices[k]:
                button.label = shown.choices[k]
            self._see(f"choice {k}", (button,), k < len(shown.choices))
        if shown.number is not None:
            low, high, self._unit = shown.number
            self._number.min, self._number.max = low, high
            self._number.label = say("lesson.number", unit=self._unit)
        self._see("number", (self._number, self._say), shown.number is not None)
        for name, handles in self._tools.items():
            self._see(name, handles, name in shown.tools)
        self._see("steps", (self._steps, self._folder), bool(shown.html))

    def _guess(self) -> None:
        self._does.predict(f"{self._number.value:g} {self._unit}")

    def _see(self, name: str, handles: Sequence[Any], on: bool) -> None:
        if self._on.get(name, False) != on:
            self._on[name] = on
            for handle in handles:
                handle.visible = on


def _title(numbered: Mapping[int | None, str]) -> Callable[[ViewState], str]:
    return lambda state: numbered.get(state.lesson, numbered[None])


def _button(gui: viser.GuiApi, label: str) -> viser.GuiButtonHandle:
    return gui.add_button(label, visible=False)


def _heard(do: Callable[[], None]) -> Callable[[viser.GuiEvent[Any]], Coroutine[Any, Any, None]]:
    async def listener(event: viser.GuiEvent[Any]) -> None:  # on the loop, in message order
        if event.client_id is not None:
            do()

    return listener
