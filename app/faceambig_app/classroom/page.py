"""What a class sees besides the page: how often each answer was given, and the note of who leads."""

from __future__ import annotations

import itertools
from html import escape

from ..lessons import Ask
from ..text import say

BINS = 5  # bars of a question that asks for a number


def note_html(note: str) -> str:
    """The strip with what who leads has written; "" where that is nothing."""
    return f'<div class="fa-note" role="status">{escape(note)}</div>' if note else ""


def bars_html(ask: Ask, answers: list[float], present: int) -> str:
    """How often each answer was given, without names. answers: as `Classroom.answers` has them."""
    counted = _counts(ask, answers)
    most = max((count for _, count in counted), default=0) or 1
    rows = "".join(
        f"<li><span>{escape(words)}</span><span>{count}</span>"
        + (f'<i style="width:{100 * count / most:.1f}%"></i></li>' if count else "</li>")
        for words, count in counted
    )
    title = escape(say("class.answers", count=len(answers), present=present))
    return f'<div class="fa"><b>{title}</b><ul class="fa-bars">{rows}</ul></div>'


def _counts(ask: Ask, answers: list[float]) -> list[tuple[str, int]]:
    """Each choice and how often it was given; numbers in BINS ranges of equal width."""
    if ask.number is None:
        return [(words, answers.count(k)) for k, words in enumerate(ask.choices)]
    low, high, unit = ask.number.low, ask.number.high, ask.number.unit
    bins = min(BINS, high - low + 1)
    edges = [low + round(k * (high - low + 1) / bins) for k in range(bins + 1)]
    return [
        (say("class.range", low=start, high=end - 1, unit=unit),
         sum(start <= min(high, max(low, round(answer))) < end for answer in answers))
        for start, end in itertools.pairwise(edges)
    ]  # fmt: skip
