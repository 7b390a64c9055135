"""The curves in words and as a table: what a person reads who does not see the plots."""

from __future__ import annotations

from functools import lru_cache
from html import escape

import numpy as np

from faceambig.arrays import Array
from faceambig.scene import Curves, Numbers

from ..text import NARROW, centimetres, numeral, percent_number, say

KEPT = 64  # curves whose unmoving part is kept: a class drags over one photograph each
MOST_ROWS = 25  # distances; the far-away camera has a row of its own


def table(curves: Curves, true: bool = True) -> str:
    """The curves as numbers, folded away; at most MOST_ROWS of them, first and last among them."""
    n = len(curves.distances)
    rows = np.unique(np.linspace(0, n - 1, min(n, MOST_ROWS)).round().astype(int))
    heads = [say("plot.axis"), say("plot.d_l"), *([say("plot.d_s")] if true else [])]
    likely = curves.density
    if likely is not None:
        heads.append(say("plot.likely_share"))
    body = []
    for row in rows:
        cells = [percent_number(float(curves.d_l_percent[row]))]
        if true:
            cells.append(numeral(f"{curves.d_s_mm[row]:.1f}"))
        if likely is not None:
            cells.append(f"{100 * likely[row]:.0f}")
        numbers = "".join(f"<td>{cell}</td>" for cell in cells)
        body.append(f'<tr><th scope="row">{100 * curves.distances[row]:.0f}</th>{numbers}</tr>')
    body.append(_far_row(curves, true))
    head = "".join(f'<th scope="col">{escape(text)}</th>' for text in heads)
    return (
        f'<details><summary>{escape(say("plot.table"))}</summary><div class="fa-wide"><table><thead><tr>{head}</tr>'
        f"</thead><tbody>{''.join(body)}</tbody></table></div></details>"
    )


def _far_row(curves: Curves, true: bool) -> str:
    """The last row: the far-away camera, which is no distance that could be likely."""
    d_l, d_s = curves.orthographic
    cells = [percent_number(d_l), *([numeral(f"{d_s:.1f}")] if true else [])]
    cells += [""] if curves.density is not None else []
    numbers = "".join(f"<td>{cell}</td>" for cell in cells)
    return f'<tr><th scope="row">{escape(say("plot.far"))}</th>{numbers}</tr>'


@lru_cache(maxsize=KEPT)
def ranges(curves: Curves) -> tuple[float, float, float, float]:
    """Least and largest d_L in percent and d_S in millimetres."""
    d_l, d_s = curves.d_l_percent, curves.d_s_mm
    return float(d_l.min()), float(d_l.max()), float(d_s.min()), float(d_s.max())


def told_apart(curves: Curves) -> tuple[float, float] | None:
    """The range of distances around the best whose d_L a person accepts, metres; None if there is none.

    Between two distances of the sweep the curve is taken as straight over the logarithm.
    """
    over = curves.d_l_percent - curves.tolerance_percent
    best = int(np.argmin(over))
    if over[best] > 0:
        return None
    return _crossing(curves.distances, over, best, -1), _crossing(curves.distances, over, best, 1)


def _crossing(distances: Array, over: Array, start: int, step: int) -> float:
    """Where `over` first rises above 0 on the way from `start`; the end of the sweep if it does not."""
    at = start
    while 0 <= at + step < len(over):
        if over[at + step] > 0:
            share = -over[at] / (over[at + step] - over[at])
            return float(distances[at] * (distances[at + step] / distances[at]) ** share)
        at += step
    return float(distances[at])


def interval_words(curves: Curves) -> str:
    """Which distances cannot be told apart, as a sentence."""
    found = told_apart(curves)
    percent = f"{curves.tolerance_percent:g}{NARROW}%"
    if found is None:
        return say("plot.none", tolerance=percent)
    return say(
        "plot.interval",
        low=f"{100 * found[0]:.0f}",
        high=centimetres(_rounded(found[1])),
        tolerance=percent,
    )


def nothing_likely() -> str:
    """Why there is no plot of how likely each distance is."""
    return f'<div class="fa"><p><small>{escape(say("plot.likely_none"))}</small></p></div>'


def likely_words(curves: Curves) -> str:
    """The intervals of the posterior and what lies beyond the axis, as sentences."""
    words = [say("plot.likely_lead")]
    for share, (low, high) in zip((50, 95), curves.intervals, strict=False):
        near = centimetres(_rounded(low))
        if np.isinf(high):
            words.append(say("plot.likely_open", share=share, low=near))
        else:
            far = centimetres(_rounded(high))
            words.append(say("plot.likely_range", share=share, low=near, high=far))
    if curves.beyond >= 0.005:
        end = centimetres(float(curves.distances[-1]))
        words.append(say("plot.beyond", share=f"{100 * curves.beyond:.0f}{NARROW}%", end=end))
    return " ".join(words)


def _rounded(metres: float) -> float:
    """To whole centimetres, as the words say "about"."""
    return round(100 * metres) / 100


def in_words(curves: Curves, numbers: Numbers) -> str:
    """What the plots show, as one sentence in their place."""
    least_l, most_l, least_s, most_s = ranges(curves)
    return say(
        "plot.alt",
        d_l=f"{percent_number(least_l)} - {percent_number(most_l)}{NARROW}%",
        d_s=numeral(f"{least_s:.1f} - {most_s:.1f}{NARROW}mm"),
        now=centimetres(numbers.distance),
    )
