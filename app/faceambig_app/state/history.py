"""Undo and redo of one room: a value that functions change. It has no clock: the time of a change is an argument.

A step is what a hand does in one go: changes less than STEP_CLOSES apart are one, a drag, or the clicks of one idea.
Moves of the viewer (view, orbit, zoom, theme, size of letters) are no steps: they neither make one nor cut the redo,
and neither undo nor redo turns the head away under the reader's eyes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from .fields import FIELDS
from .viewstate import DEFAULT, ViewState, changed, for_eyes_of

STEPS = 100
STEP_CLOSES = 0.4  # seconds after the last change
VIEW = tuple(name for name, field in FIELDS.items() if field.view)
NOT_VIEW = tuple(name for name, field in FIELDS.items() if not field.view)


@dataclass(frozen=True, slots=True)
class History:
    """The state of a room, those before it and those undone. Oldest first; at most STEPS of each."""

    now: ViewState = DEFAULT
    past: tuple[ViewState, ...] = ()
    future: tuple[ViewState, ...] = ()  # the last was undone last
    changed_at: float | None = None  # seconds; None: the step is closed, the next change begins one


def change(history: History, state: ViewState, at: float) -> History:
    """`state` is now what is, since `at` seconds of any clock that does not run backwards."""
    if _same(state, history.now):
        return replace(history, now=state)
    is_open = history.changed_at is not None and at - history.changed_at < STEP_CLOSES
    past = history.past if is_open else (*history.past, history.now)[-STEPS:]
    if is_open and _same(state, past[-1]):
        # Dragged back to where it began: no step, and what follows begins there
        return History(state, past[:-1])
    return History(state, past, changed_at=at)


def undo(history: History) -> History:
    """One step back; the same history if there is none. The step before is closed."""
    if not history.past:
        return history
    *past, before = history.past
    return History(_seen_as(before, history.now), tuple(past), (*history.future, history.now))


def redo(history: History) -> History:
    """The step undone last; the same history if there is none."""
    if not history.future:
        return history
    *future, after = history.future
    return History(_seen_as(after, history.now), (*history.past, history.now), tuple(future))


def reset(history: History, start: ViewState = DEFAULT) -> History:
    """Back to `start`, as a step of its own; colours of the page, size of letters and language stay."""
    state = for_eyes_of(start, history.now)
    if _same(state, history.now):
        return replace(history, now=state, changed_at=None)
    return History(state, (*history.past, history.now)[-STEPS:])


def _seen_as(state: ViewState, now: ViewState) -> ViewState:
    """A state of before, looked at from where the viewer is now."""
    return changed(state, **{name: getattr(now, name) for name in VIEW})


def _same(a: ViewState, b: ViewState) -> bool:
    """Whether two states differ by nothing but where the viewer is."""
    return all(getattr(a, name) == getattr(b, name) for name in NOT_VIEW)
