"""The curves of the page as SVG: d_L, d_S and how likely each distance is, over one axis with one cursor.

Colours are CSS variables of style.STYLE. Words and a table of the same numbers are in plottable.py.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable
from html import escape
from typing import NamedTuple

import numpy as np

from faceambig.arrays import Array
from faceambig.scene import Curves, Numbers

from ..text import NARROW, centimetres, each_language, numeral, say
from .plottable import KEPT, in_words, interval_words, likely_words, ranges, table

WIDTH, LEFT, RIGHT = 340, 34, 290  # in SVG units; the distances end at RIGHT
FAR, END = 322, 332  # of the far-away camera, which stands beyond all distances; of bands and grid
NEAREST, FARTHEST = 0.2, 3.0  # metres, of the axis
OCTAVES = math.log2(FARTHEST / NEAREST)
TICKS_CM = (20, 30, 60, 120, 240)
D_L_TOP, D_L_BOTTOM, D_S_TOP, D_S_BOTTOM = 24, 94, 128, 222
LIKELY_TOP, LIKELY_BOTTOM = 256, 300
BARS_AT = (324, 310)  # of the middle halves and the 95 %, below the density
D_L_MAX = 6.0  # percent
AUTOMATIC_PERCENT = 5.0  # the gap of points that a program finds


def plots(
    curves: Curves, numbers: Numbers, *, hide: Collection[str] = (), brief: bool = False
) -> str:
    """The curves against the assumed distance, the range that cannot be told apart in words, and a table.

    `hide` of Scene: "numbers" leaves out curves, words and table, "truth" the curve of d_S, "actual" the line of the
    true distance. brief: without the table, for while a hand moves.
    """
    told = "numbers" not in hide
    true = told and "truth" not in hide
    top = d_s_axis(curves, numbers)
    words = escape(in_words(curves, numbers) if true else say("plot.alt_hidden"))
    below, above = _still(curves, numbers.reference, top, told, true, "actual" not in hide)
    x = float(FAR) if numbers.distance is None else _across(numbers.distance)
    cursor = (
        f'<path d="{_upright(x, _last(curves, told))}" stroke="var(--fa-ink)" stroke-width="1.6"/>'
    )
    marks = _marks(x, numbers, top, true) if told else ""
    said = _said(curves, true, not brief) if told else ""
    return (
        f'<div class="fa"><div class="fa-wide">'
        f'<svg class="fa-plot" viewBox="0 0 {WIDTH} {_ticks_at(curves, told) + 40}" '
        f'role="img" aria-label="{words}">{below}{cursor}{above}{marks}</svg></div>{said}</div>'
    )


def _last(curves: Curves, told: bool) -> int:
    """Where the lowest plot ends."""
    return LIKELY_BOTTOM if told and curves.density is not None else D_S_BOTTOM


def _ticks_at(curves: Curves, told: bool) -> int:
    return BARS_AT[0] + 7 if told and curves.density is not None else D_S_BOTTOM


@each_language(maxsize=KEPT)
def _still(
    curves: Curves, reference: str, top: float, told: bool, true: bool, actual: bool
) -> tuple[str, str]:
    """All of the plots that stays while a hand moves the distance: what is below the cursor, and what is above it.

    Words are above the upright lines, on a rim of the ground (style.py), so that no line crosses letters; curves are
    above the words, so that the rim hides no data.
    """
    at = _ticks_at(curves, told)
    shown = [_d_l_plot(curves, told), _d_s_plot(curves, reference, top, true, _hidden(told))]
    if told and curves.density is not None:
        shown.append(_likely_plot(curves))
    true_line, true_words = _true_line(curves, _last(curves, told)) if actual else ("", "")
    words = [
        *(plot.words for plot in shown),
        *(_tick(cm, at) for cm in TICKS_CM),
        _far_tick(at),
        f'<text x="{(LEFT + RIGHT) / 2}" y="{at + 35}" text-anchor="middle">{escape(say("plot.axis"))}</text>',
        true_words,
    ]
    lines = [*(plot.line for plot in shown), _far_marks(curves, top, true) if told else ""]
    return "".join(plot.ground for plot in shown) + true_line, "".join(words + lines)


@each_language(maxsize=KEPT)
def _said(curves: Curves, true: bool, with_table: bool) -> str:
    """The sentences below the plots, and the table."""
    below = [interval_words(curves), *([] if curves.density is None else [likely_words(curves)])]
    said = "".join(f"<p><small>{escape(text)}</small></p>" for text in below)
    return said + (table(curves, true) if with_table else "")


def d_s_axis(curves: Curves, numbers: Numbers) -> float:
    """End of the d_S axis: 12 mm, growing in steps of 4."""
    largest = max(ranges(curves)[3], curves.orthographic[1], numbers.d_s_mm)
    return 4.0 * max(3, math.ceil(largest / 4.0))


class Plot(NamedTuple):
    """SVG of one plot, from below to above."""

    ground: str = ""
    words: str = ""
    line: str = ""


def _hidden(told: bool) -> str:
    """Why a curve is not there."""
    return say("number.hidden_truth") if told else say("number.hidden")


def _d_l_plot(curves: Curves, told: bool) -> Plot:
    band, automatic = _d_l(curves.tolerance_percent), _d_l(AUTOMATIC_PERCENT)
    line = _line(_x(curves.distances), _y(curves.d_l_percent, D_L_MAX, D_L_TOP, D_L_BOTTOM))
    grid, values = _grid((0, 3, 6), D_L_MAX, D_L_TOP, D_L_BOTTOM)
    return Plot(
        f'<path d="M{LEFT} {band:.1f}H{END}V{D_L_BOTTOM}H{LEFT}z" fill="var(--fa-band)"/>{grid}'
        f'<path d="M{LEFT} {automatic:.1f}H{END}" stroke="var(--fa-dim)" stroke-dasharray="5 4"/>',
        _title(say("plot.d_l"), D_L_TOP, "dl")
        + values
        + _note(automatic + 12, say("plot.automatic"))
        + _note(band + 13, say("plot.band"), "b"),
        f'<polyline points="{line}" fill="none" stroke="var(--fa-dl)" stroke-width="2.2" stroke-dasharray="6 3"/>'
        if told
        else "",
    )


def _d_s_plot(curves: Curves, reference: str, top: float, true: bool, hidden: str) -> Plot:
    line = _line(_x(curves.distances), _y(curves.d_s_mm, top, D_S_TOP, D_S_BOTTOM))
    title = say("plot.d_s_to", reference=reference) if reference else say("plot.d_s")
    grid, values = _grid(range(0, int(top) + 1, 4), top, D_S_TOP, D_S_BOTTOM)
    words = _title(title, D_S_TOP, "ds") + values
    if not true:
        return Plot(grid, words + _note((D_S_TOP + D_S_BOTTOM) / 2 + 4, hidden))
    return Plot(
        grid,
        words,
        f'<polyline points="{line}" fill="none" stroke="var(--fa-ds)" stroke-width="2.2"/>',
    )


def _likely_plot(curves: Curves) -> Plot:
    """How likely each distance is: an area of equal share a width of the axis, and the two intervals below."""
    assert curves.density is not None
    x, y = _x(curves.distances), _y(curves.density, 1.0, LIKELY_TOP, LIKELY_BOTTOM)
    area = f"M{x[0]:.1f} {LIKELY_BOTTOM}L{_line(x, y)}L{x[-1]:.1f} {LIKELY_BOTTOM}z"
    ground = f'<path d="{area}" fill="var(--fa-band)" stroke="var(--fa-ink)" stroke-width="1.4"/>'
    words = _title(say("plot.likely"), LIKELY_TOP, "ink")
    for share, at, width, (low, high) in zip(
        (50, 95), BARS_AT, (6, 3), curves.intervals, strict=False
    ):
        a, b = (_across(min(max(end, NEAREST), FARTHEST)) for end in (low, high))
        words += f'<text x="{LEFT - 4}" y="{at + 4}" text-anchor="end">{share}{NARROW}%</text>'
        ground += f'<path d="M{a:.1f} {at}H{b:.1f}" stroke="var(--fa-ink)" stroke-width="{width}"/>'
        if high > FARTHEST:  # it goes on
            ground += f'<path d="M{b + 1:.1f} {at - 5}l7 5l-7 5z" fill="var(--fa-ink)"/>'
    return Plot(ground, words)


def _title(text: str, top: int, tone: str) -> str:
    return (
        f'<text class="t" x="2" y="{top - 10}" style="fill:var(--fa-{tone})">{escape(text)}</text>'
    )


def _note(y: float, text: str, of: str = "") -> str:
    """Words inside a plot; of "b": on its band."""
    kind = f'class="{of}" ' if of else ""
    return f'<text {kind}x="{END - 3}" y="{y:.1f}" text-anchor="end">{escape(text)}</text>'


def _x(metres: Array) -> Array:
    return LEFT + np.log2(metres / NEAREST) / OCTAVES * (RIGHT - LEFT)


def _across(metres: float) -> float:
    """As `_x`, of one distance."""
    return LEFT + math.log2(metres / NEAREST) / OCTAVES * (RIGHT - LEFT)


def _y(values: Array, top_value: float, top: int, bottom: int) -> Array:
    return bottom - np.clip(values, 0, top_value) / top_value * (bottom - top)


def _at(value: float, top_value: float, top: int, bottom: int) -> float:
    return bottom - min(max(value, 0.0), top_value) / top_value * (bottom - top)


def _d_l(value: float) -> float:
    return _at(value, D_L_MAX, D_L_TOP, D_L_BOTTOM)


def _line(x: Array, y: Array) -> str:
    return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))


def _grid(values: Iterable[float], top_value: float, top: int, bottom: int) -> tuple[str, str]:
    """Lines across, and their values."""
    lines, words = "", ""
    for value in values:
        y, shown = _at(value, top_value, top, bottom), numeral(f"{value:g}")
        lines += f'<path d="M{LEFT} {y:.1f}H{END}" stroke="var(--fa-line)"/>'
        words += f'<text x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{shown}</text>'
    return lines, words


def _tick(cm: int, at: int) -> str:
    x = _across(cm / 100)
    return (
        f'<path d="M{x:.1f} {at}v4" stroke="var(--fa-dim)"/>'
        f'<text x="{x:.1f}" y="{at + 17}" text-anchor="middle">{cm}</text>'
    )


def _far_tick(at: int) -> str:
    return (
        f'<path d="M{FAR} {at}v4" stroke="var(--fa-dim)"/>'
        f'<text x="{WIDTH - 1}" y="{at + 17}" text-anchor="end">{escape(say("plot.far"))}</text>'
    )


def _far_marks(curves: Curves, d_s_top: float, true: bool) -> str:
    """Where the curves are for the far-away camera: a ring and an open square, as the cursor's marks are filled."""
    d_l, d_s = curves.orthographic
    a, b = _d_l(d_l), _at(d_s, d_s_top, D_S_TOP, D_S_BOTTOM)
    square = f'<rect x="{FAR - 3.6:.1f}" y="{b - 3.6:.1f}" width="7.2" height="7.2" stroke="var(--fa-ds)"/>'
    return (
        f'<g class="far" fill="none" stroke-width="1.5"><circle cx="{FAR}" cy="{a:.1f}" r="3.8" '
        f'stroke="var(--fa-dl)"/>{square if true else ""}</g>'
    )


def _upright(x: float, last: int) -> str:
    """A line down all plots, with room for their titles."""
    plots_at = ((D_L_TOP, D_L_BOTTOM), (D_S_TOP, D_S_BOTTOM), (LIKELY_TOP, LIKELY_BOTTOM))
    return "".join(f"M{x:.1f} {top}V{bottom}" for top, bottom in plots_at if bottom <= last)


def _true_line(curves: Curves, last: int) -> tuple[str, str]:
    """The line of the true distance, and its words; empty where it is off the axis."""
    if not NEAREST <= curves.true_distance <= FARTHEST:
        return "", ""
    x = _across(curves.true_distance)
    anchor, shift = ("end", -4) if x > (LEFT + RIGHT) / 2 else ("start", 4)
    words = escape(say("plot.true", distance=centimetres(curves.true_distance)))
    return (
        f'<path d="{_upright(x, last)}" stroke="var(--fa-dim)" stroke-dasharray="2 3"/>',
        f'<text x="{x + shift:.1f}" y="{D_S_TOP + 10}" text-anchor="{anchor}">{words}</text>',
    )


def _marks(x: float, numbers: Numbers, d_s_top: float, true: bool) -> str:
    """Where the cursor meets the curves: round on d_L, square on d_S."""
    a, b = _d_l(numbers.d_l_percent), _at(numbers.d_s_mm, d_s_top, D_S_TOP, D_S_BOTTOM)
    square = (
        f'<rect x="{x - 4.2:.1f}" y="{b - 4.2:.1f}" width="8.4" height="8.4" fill="var(--fa-ds)"/>'
    )
    return (
        f'<circle cx="{x:.1f}" cy="{a:.1f}" r="4.5" fill="var(--fa-dl)"/>{square if true else ""}'
    )
