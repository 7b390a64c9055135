"""The lesson of one browser: where it is, what was predicted, what has been done. All on the event loop."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from html import escape
from typing import Protocol

from faceambig.scene import Numbers

from ..panel import Change
from ..panel.lessons import Shown
from ..state import DEFAULT, ViewState, changed, for_eyes_of
from ..text import say
from .lesson import Ask, Step
from .page import step_html, teacher_html
from .shelf import Lessons

Place = tuple[int, int]  # lesson and step


class Class(Protocol):
    """The class that a browser may be part of."""

    @property
    def leads(self) -> bool:
        """Whether this browser leads it: it asks and answers nothing."""
        ...

    def holds(self, place: Place, answer: float) -> bool:
        """Take an answer, a number or a choice counted from 0; whether what it hides is told later, to all."""
        ...


class LessonRoom:
    """What one browser has of the lessons."""

    def __init__(
        self,
        lessons: Lessons,
        now: Callable[[], ViewState],
        tell: Callable[[Change], None],
        notice: Callable[[str], None],
        show: Callable[[Shown], None],
        of: Class | None = None,
    ) -> None:
        self._lessons, self._now, self._tell = lessons, now, tell
        self._notice, self._show = notice, show
        self._class = of
        self._said: dict[Place, str] = {}  # "": told without an answer
        self._held: dict[Place, str] = {}  # answers to what a class has not been told yet
        self._ticked: dict[Place, set[int]] = {}

    def read(self, lessons: Lessons) -> None:
        """The same lessons in another language; what was predicted and done stays."""
        self._lessons = lessons

    @property
    def titles(self) -> Mapping[int, str]:
        """Number -> title of every lesson."""
        return {number: lesson.title for number, lesson in self._lessons.by_number.items()}

    def chosen(self, number: int | None) -> Change:
        """The change that begins a lesson; None ends the one that runs."""
        if number is None:
            return _left
        return lambda state: self._at(number, 1, state)

    def onward(self, state: ViewState) -> ViewState:
        """The next step; after the last the next lesson, after the last lesson none. First a prediction is made."""
        step, place = self._place(state)
        if step is None or place is None:
            return state
        if step.ask is not None and place not in self._said and not self._leads:
            self._notice(say("lesson.first"))
            return state
        number, k = place
        if k < len(self._lessons.by_number[number].steps):
            return self._at(number, k + 1, state)
        later = [other for other in sorted(self._lessons.by_number) if other > number]
        return self._at(later[0], 1, state) if later else _left(state)

    def back(self, state: ViewState) -> ViewState:
        """The step before; at the first the same from its beginning."""
        _, place = self._place(state)
        return state if place is None else self._at(place[0], max(1, place[1] - 1), state)

    def leave(self, state: ViewState) -> ViewState:
        """No lesson; what is seen stays, and nothing is hidden any more."""
        return _left(state)

    def start(self, state: ViewState) -> ViewState:
        """Where a reset leads: the beginning of the step, or the page's first state."""
        _, place = self._place(state)
        return DEFAULT if place is None else self._at(*place, state)

    def arrived(self, state: ViewState) -> ViewState:
        """The state of a link. One that names a lesson and no more is at the beginning of its step."""
        if state.lesson is None:
            return state
        if state.lesson not in self._lessons.by_number:
            self._notice(say("lesson.missing", number=state.lesson))
            return _left(state)
        _, place = self._place(state)
        bare = changed(for_eyes_of(state, DEFAULT), lesson=None, step=DEFAULT.step)
        return self._at(*place, state) if bare == DEFAULT and place is not None else state

    def predict(self, words: str) -> None:
        """The learner has answered: the numbers may be seen, and what follows the question is told."""
        step, place = self._place(self._now())
        if step is None or place is None or step.ask is None:
            return
        if self._class is not None and self._class.holds(place, _answer(step.ask, words)):
            self._held[place] = words
        else:
            self._said[place] = words
            self._tell(_numbers_told)
        self.watch(self._now())

    def reveal(self, place: Place) -> None:
        """A class is told what a question hides: with the learner's own answer, if there is one."""
        self._said.setdefault(place, self._held.pop(place, ""))

    @property
    def _leads(self) -> bool:
        return self._class is not None and self._class.leads

    def watch(self, state: ViewState, numbers: Numbers | None = None) -> None:
        """A state is now what is; at rest with its numbers. Tick what the learner has done, and show it."""
        step, place = self._place(state)
        if step is None or place is None:
            self._show(Shown(problems=self._problems()))
            return
        said, ticked = self._said.get(place), self._ticked.setdefault(place, set())
        if step.ask is None or said is not None:
            ticked |= {k for k, task in enumerate(step.tasks) if task.when.holds(state, numbers)}
        lesson, asks = self._lessons.by_number[place[0]], step.ask is not None and said is None
        ask = step.ask if asks and not self._leads else None
        number = None if ask is None else ask.number
        self._show(
            Shown(
                html=step_html(
                    lesson, place[1], said=said, ticked=ticked, held=self._held.get(place)
                ),
                choices=() if ask is None else ask.choices,
                number=None if number is None else (number.low, number.high, number.unit),
                tools=() if asks else step.tools,
                teacher=teacher_html(lesson),
                problems=self._problems(),
            )
        )

    def _place(self, state: ViewState) -> tuple[Step | None, Place | None]:
        lesson = self._lessons.by_number.get(state.lesson or 0)
        if lesson is None:
            return None, None
        k = min(state.step, len(lesson.steps))
        return lesson.steps[k - 1], (lesson.number, k)

    def _at(self, number: int, k: int, now: ViewState) -> ViewState:
        """The beginning of a step, for eyes as they are; a prediction that was made hides nothing again."""
        step = self._lessons.by_number[number].steps[k - 1]
        state = for_eyes_of(step.state, now)
        return _numbers_told(state) if (number, k) in self._said else state

    def _problems(self) -> str:
        lines = "".join(f"<p>{escape(line)}</p>" for line in self._lessons.problems)
        return f'<div class="fa fa-small">{lines}</div>' if lines else ""


def _answer(ask: Ask, words: str) -> float:
    """An answer as a class counts it, in whatever language it was given."""
    return float(words.split()[0]) if ask.number is not None else float(ask.choices.index(words))


def _left(state: ViewState) -> ViewState:
    return changed(state, lesson=None, step=DEFAULT.step, hide=DEFAULT.hide)


def _numbers_told(state: ViewState) -> ViewState:
    return changed(state, hide=tuple(name for name in state.hide if name != "numbers"))
