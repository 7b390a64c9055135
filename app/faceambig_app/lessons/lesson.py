"""A lesson as a value: its steps, what is asked in them, and what is to be done."""

from __future__ import annotations

from dataclasses import dataclass

from ..state import ViewState
from .conditions import Condition


@dataclass(frozen=True, slots=True)
class Number:
    """What is asked for is a whole number of a unit."""

    low: int
    high: int
    unit: str


@dataclass(frozen=True, slots=True)
class Ask:
    """A prediction: a question, and either choices or a number."""

    question: str
    choices: tuple[str, ...]
    number: Number | None
    answer: str  # for the teacher


@dataclass(frozen=True, slots=True)
class Task:
    """Something the learner does: it is ticked when its condition has held once."""

    words: str
    when: Condition


@dataclass(frozen=True, slots=True)
class Step:
    """One step of a lesson. Texts are Markdown, numbers filled in."""

    title: str
    state: ViewState
    ask: Ask | None
    tasks: tuple[Task, ...]
    tools: tuple[str, ...]  # controls that stand beside the text
    text: str
    answered: str  # told when the question is answered
    done: str  # told when all tasks are ticked


@dataclass(frozen=True, slots=True)
class Lesson:
    """A lesson and what its teacher should know (Markdown)."""

    number: int
    name: str  # of its file, without ending
    title: str
    goal: str
    minutes: int
    steps: tuple[Step, ...]
    teacher: str
