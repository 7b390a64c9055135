"""What the page and the teacher's sheet show of a lesson: Markdown -> HTML without any markup of its writer's own."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from functools import cache
from html import escape

from markdown_it import MarkdownIt

from ..state import ViewState, changed
from ..state.fields import LANGUAGES
from ..state.link import query
from ..text import NARROW, language, say
from .lesson import Lesson, Step

ADDRESS = "http://127.0.0.1:8080/"  # of `faceambig serve`, in links of the teacher's sheet


@cache
def _markdown() -> MarkdownIt:
    """No HTML, and no pictures: they would be fetched from elsewhere."""
    return MarkdownIt("commonmark", {"html": False}).enable("table").disable("image")


def html_of(markdown: str) -> str:
    """Markdown as HTML; what stands there as HTML is shown as text."""
    return _markdown().render(markdown)


def step_html(
    lesson: Lesson,
    number: int,
    *,
    said: str | None,
    ticked: Collection[int],
    held: str | None = None,
) -> str:
    """A step as the learner sees it. said: what was predicted; ticked: tasks done, counted from 0.

    held: what was predicted in a class that has not been told yet; a `said` of "" is told without a prediction.
    """
    step = lesson.steps[number - 1]
    bars = "".join(
        f'<i class="{"fa-on" if k <= number else ""}"></i>' for k in range(1, len(lesson.steps) + 1)
    )
    where = say("lesson.step", number=number, count=len(lesson.steps), title=step.title)
    parts = [
        f'<div class="fa-steps" aria-hidden="true">{bars}</div>',
        f"<h1>{lesson.number}{NARROW}·{NARROW}{escape(lesson.title)}</h1>",
        f'<p class="fa-small">{escape(where)}</p>',
        html_of(step.text),
    ]
    if step.ask is not None:
        parts.append(f"<p><b>{escape(step.ask.question)}</b></p>")
        if said is None and held is not None:
            parts.append(f'<p class="fa-said">{escape(say("class.held", words=held))}</p>')
        if said is None:
            return _wrapped(parts, f"{lesson.number}.{number}")
        if said:
            parts.append(f'<p class="fa-said">{escape(say("lesson.said", words=said))}</p>')
        parts.append(html_of(step.answered))
    if step.tasks:
        parts.append(_tasks(step, ticked))
        if len(ticked) == len(step.tasks):
            parts.append(html_of(step.done))
    return _wrapped(parts, f"{lesson.number}.{number}")


def _wrapped(parts: list[str], place: str) -> str:
    return f'<div class="fa fa-lesson" data-fa-step="{place}">{"".join(parts)}</div>'


def _tasks(step: Step, ticked: Collection[int]) -> str:
    rows = []
    for k, task in enumerate(step.tasks):
        done = k in ticked
        words, sign = (say("lesson.done"), "✓") if done else (say("lesson.open"), "")
        mark = f'<span aria-label="{escape(words)}" role="img">{sign}</span>'
        rows.append(f'<li class="{"fa-done" if done else ""}">{mark}{escape(task.words)}</li>')
    return f'<ul class="fa-tasks">{"".join(rows)}</ul>'


def teacher_html(lesson: Lesson) -> str:
    """The teacher's note on the page."""
    goal = say("lesson.goal", goal=lesson.goal, minutes=lesson.minutes)
    return f'<div class="fa fa-lesson"><p>{escape(goal)}</p>{html_of(lesson.teacher)}</div>'


def teacher_page(lesson: Lesson) -> str:
    """The teacher's sheet as Markdown: goal, time, a link for every step, answers, and the file's own words."""
    lines = [
        "# " + say("teacher.title", number=lesson.number, title=lesson.title), "",
        f"<!-- {say('teacher.written', name=lesson.name)} -->", "",
        f"**{say('teacher.goal')}** {lesson.goal}", "",
        f"**{say('teacher.time')}** {say('teacher.minutes', minutes=lesson.minutes)}", "",
        say("teacher.address", address=ADDRESS), "",
        "## " + say("teacher.steps"), "",
    ]  # fmt: skip
    for k, step in enumerate(lesson.steps, 1):
        lines.append(f"{k}. [{step.title}]({ADDRESS}?{query(_in_language(step.state))})")
        lines += [f"   - {line}" for line in _sheet(step)]
    return "\n".join([*lines, "", "## " + say("teacher.notes"), "", lesson.teacher, ""])


def _in_language(state: ViewState) -> ViewState:
    """A link of a sheet opens the page in the sheet's language, whatever the browser asks for."""
    return state if language() == LANGUAGES[0] else changed(state, lang=language())


def _sheet(step: Step) -> Iterator[str]:
    """What a teacher should know of a step, a line each."""
    if step.ask is not None:
        number = step.ask.number
        if number is None:
            choices = " / ".join(step.ask.choices)
        else:
            choices = say("teacher.number", low=number.low, high=number.high, unit=number.unit)
        yield say("teacher.asked", question=step.ask.question, choices=choices)
        yield say("teacher.answer", answer=step.ask.answer)
    for task in step.tasks:
        yield say("teacher.task", words=task.words)
    for text in (step.answered, step.done):
        if text:
            yield say("teacher.told", words=" ".join(text.split()))
