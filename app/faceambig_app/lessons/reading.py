"""Reading a lesson: a Markdown file with front matter that a teacher can write. assets/lessons/README.md tells how."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

from faceambig.io.files import text_of

from ..state import DEFAULT, ViewState, changed, link
from ..state.fields import LAST_LESSON, LAST_STEP
from . import measures
from .conditions import condition
from .lesson import Ask, Lesson, Number, Step, Task

FENCE, TOLD_AFTER = "+++", "---"
PLACEHOLDER = re.compile(r"\{\{(.*?)\}\}")
MOST_BYTES = 200_000  # of a lesson
MOST_CHOICES = 5
TOOLS = (
    "distance", "actual", "view", "show", "data", "camera", "flex", "glide", "draw", "extremes", "rays",
)  # fmt: skip

_LESSON: Mapping[str, type] = {"title": str, "goal": str, "minutes": int, "steps": list}
_STEP: Mapping[str, type] = {
    "title": str, "link": str, "ask": str, "choices": list, "number": dict, "answer": str, "do": list, "tools": list,
}  # fmt: skip
_NUMBER: Mapping[str, type] = {"low": int, "high": int, "unit": str}


def read_lesson(path: Path, numbers: Mapping[str, float]) -> Lesson:
    """One lesson; ValueError of one line, with file and line, if it is none."""
    return _Reader(path.name, text_of(path, MOST_BYTES, "a lesson"), numbers).lesson()


def expressions(path: Path) -> list[str]:
    """What a file asks to be computed, each in its one form; ValueError as of `read_lesson`."""
    asked: dict[str, None] = {}

    def note(expression: str) -> str:
        asked[measures.normal(expression)] = None
        return ""

    reader = _Reader(path.name, text_of(path, MOST_BYTES, "a lesson"), {})
    reader.fill(note)
    return list(asked)


class _Reader:
    """The lines of one file while it is read."""

    def __init__(self, name: str, text: str, numbers: Mapping[str, float]) -> None:
        self._name, self._numbers = name, numbers
        self._lines = text.splitlines()
        self._starts: list[int] = []  # lines of [[steps]]

    def lesson(self) -> Lesson:
        self.fill(self._number)
        end, front = self._front()
        self._keys(front, _LESSON, ("title", "goal", "minutes", "steps"), 1)
        sections = self._sections(end + 1)
        steps, number = front["steps"], int(self._name[:2])
        if not 1 <= number <= LAST_LESSON:
            self._fail(1, f"lesson {number} is not within 1 to {LAST_LESSON}")
        if not 1 <= len(steps) <= LAST_STEP:
            self._fail(1, f"{len(steps)} steps; a lesson has 1 to {LAST_STEP}")
        *bodies, (line, title, teacher) = sections
        if title is not None:
            self._fail(line, 'the last part is not "# For the teacher"')
        read = [
            self._step(k, step, bodies[k] if k < len(bodies) else None)
            for k, step in enumerate(steps)
        ]
        if len(bodies) > len(steps):
            self._fail(bodies[len(steps)][0], f'"## {bodies[len(steps)][1]}" has no [[steps]]')
        placed = (changed(step.state, lesson=number, step=k) for k, step in enumerate(read, 1))
        steps = tuple(replace(step, state=state) for step, state in zip(read, placed, strict=True))
        name = self._name.removesuffix(".md")
        return Lesson(
            number, name, front["title"], front["goal"], front["minutes"], steps, "\n".join(teacher).strip()
        )  # fmt: skip

    def fill(self, number: Callable[[str], str]) -> None:
        """Put `number(expression)` in the place of every {{ expression }}."""
        for k, line in enumerate(self._lines):
            try:
                self._lines[k] = PLACEHOLDER.sub(lambda found: number(found[1]), line)
            except ValueError as error:
                self._fail(k + 1, str(error))

    def _number(self, expression: str) -> str:
        known = self._numbers.get(measures.normal(expression))
        return measures.written(expression, measures.value(expression) if known is None else known)

    def _front(self) -> tuple[int, dict[str, Any]]:
        """Number of the line that ends the front matter, and what it holds."""
        if not self._lines or self._lines[0].strip() != FENCE:
            self._fail(1, f"does not begin with {FENCE}")
        fences = (k for k, line in enumerate(self._lines[1:], 2) if line.strip() == FENCE)
        end = next(fences, 0) or self._fail(1, f"the front matter has no end: a line {FENCE}")
        lines = self._lines[1 : end - 1]
        self._starts = [k for k, line in enumerate(lines, 2) if line.strip() == "[[steps]]"]
        try:
            return end, tomllib.loads("\n".join(lines))
        except tomllib.TOMLDecodeError as error:
            at = re.search(r" \(at line (\d+), column (\d+)\)| \(at end of document\)", str(error))
            line = int(at[1]) + 1 if at and at[1] else end
            return self._fail(line, str(error)[: at.start()] if at else str(error))

    def _sections(self, first: int) -> list[tuple[int, str | None, list[str]]]:
        """Line, title and text of each "## Title", at the end of "# For the teacher": None."""
        sections: list[tuple[int, str | None, list[str]]] = []
        for k, line in enumerate(self._lines[first - 1 :], first):
            if line.startswith("# "):
                sections.append((k, None, []))
            elif line.startswith("## ") and not (sections and sections[-1][1] is None):
                sections.append((k, line[3:].strip(), []))
            elif sections:
                sections[-1][2].append(line)
            elif line.strip():
                self._fail(k, 'text before the first "## Title" of a step')
        if not sections or sections[-1][1] is not None:
            self._fail(len(self._lines), 'there is no part "# For the teacher" at the end')
        return sections

    def _step(self, k: int, front: Any, body: tuple[int, str | None, list[str]] | None) -> Step:
        start = self._starts[k] if k < len(self._starts) else 1
        if not isinstance(front, dict):
            self._fail(start, "a step is written under a line [[steps]]")
        self._keys(front, _STEP, ("title", "link"), start)
        if body is None:
            self._fail(start, f'there is no "## {front["title"]}" below the front matter')
        line, title, text = body
        if title != front["title"]:
            self._fail(line, f'"## {title}" stands where "## {front["title"]}" should')
        state, ask = self._state(start, front["link"]), self._ask(start, front)
        tasks = tuple(self._task(start, task, state) for task in front.get("do", ()))
        parts = "\n".join(text).split(f"\n{TOLD_AFTER}\n")
        most = 1 + (ask is not None) + bool(tasks)
        if len(parts) > most:
            rulers = [n for n, written in enumerate(text, line + 1) if written == TOLD_AFTER]
            self._fail(rulers[most - 1], f'nothing to wait for before this "{TOLD_AFTER}"')
        told = [part.strip() for part in (*parts, "", "")]
        answered = told[1] if ask is not None else ""
        done = told[2 if ask is not None else 1] if tasks else ""
        tools = tuple(front.get("tools", ()))
        for tool in tools:
            if tool not in TOOLS:
                self._fail(self._line(start, "tools"), f"tools: {tool!r} is not {', '.join(TOOLS)}")
        return Step(front["title"], state, ask, tasks, tools, told[0], answered, done)

    def _state(self, start: int, query: str) -> ViewState:
        state, findings = link.read(query)
        if findings:
            about = ", ".join(findings[0].names) or findings[0].kind
            self._fail(self._line(start, "link"), f"link: {about} is unknown or out of range")
        if (state.lesson, state.step) != (DEFAULT.lesson, DEFAULT.step):
            self._fail(self._line(start, "link"), "link: lesson and step are added by themselves")
        return state

    def _ask(self, start: int, front: dict[str, Any]) -> Ask | None:
        if "ask" not in front:
            for name in ("choices", "number", "answer"):
                if name in front:
                    self._fail(self._line(start, name), f"{name}: there is no ask")
            return None
        at = self._line(start, "ask")
        if ("choices" in front) == ("number" in front):
            self._fail(at, "ask: give either choices or a number")
        choices, number = tuple(front.get("choices", ())), None
        if "number" in front:
            at = self._line(start, "number")
            self._keys(front["number"], _NUMBER, tuple(_NUMBER), at)
            number = Number(**front["number"])
            if not number.low < number.high:
                self._fail(at, "number: low is not below high")
        elif not (
            2 <= len(choices) <= MOST_CHOICES and len(set(choices)) == len(choices)
        ) or not all(isinstance(choice, str) and choice.strip() for choice in choices):
            self._fail(
                self._line(start, "choices"), f"choices: 2 to {MOST_CHOICES} different texts"
            )
        return Ask(front["ask"], choices, number, front.get("answer", ""))

    def _task(self, start: int, task: Any, state: ViewState) -> Task:
        at = self._line(start, "do")
        if not isinstance(task, dict) or set(task) != {"words", "when"}:
            self._fail(at, 'do: write { words = "...", when = "distance < 0.25" }')
        line = next(
            (n for n in range(at, len(self._lines) + 1) if str(task["when"]) in self._lines[n - 1]),
            at,
        )
        try:
            when = condition(task["when"])
        except ValueError as error:
            self._fail(line, f"do: {error}")
        if when.holds(state, None):
            self._fail(line, f"do: {task['when']!r} holds before the learner has done anything")
        return Task(str(task["words"]), when)

    def _keys(
        self,
        given: Mapping[str, Any],
        known: Mapping[str, type],
        needed: tuple[str, ...],
        start: int,
    ) -> None:
        for name, value in given.items():
            if name not in known:
                self._fail(self._line(start, name), f"{name}: not one of {', '.join(known)}")
            if type(value) is not known[name]:
                kind = {str: "a text", int: "a whole number", list: "a list", dict: "a table"}
                self._fail(self._line(start, name), f"{name}: expected {kind[known[name]]}")
        for name in needed:
            if name not in given:
                self._fail(start, f"{name} is missing")

    def _line(self, start: int, name: str) -> int:
        """The line of a key, looked for from the line `start` on; `start` if it is written in another way."""
        key = re.compile(rf"\s*{re.escape(name)}\s*=")
        for k, line in enumerate(self._lines[start - 1 :], start):
            if key.match(line):
                return k
            if line.strip() == FENCE and k > 1:
                break
        return start

    def _fail(self, line: int, words: str) -> NoReturn:
        raise ValueError(f"{self._name}, line {line}: {words}")
