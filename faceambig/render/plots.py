"""The two curves of a Scene on a canvas: d_L above d_S, one distance axis, one cursor, no double axis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..arrays import Array
from ..scene import Curves, Numbers
from .canvas import Canvas, Colour

INK, DIM, LINE, BAND = (
    (0x1D, 0x27, 0x33),
    (0x52, 0x60, 0x6D),
    (0xD5, 0xDC, 0xE3),
    (0xE3, 0xEA, 0xF2),
)
D_L, D_S = (0x1B, 0x5F, 0xC1), (0xA8, 0x4A, 0x00)
AXIS_CM, TICKS_CM = (20.0, 300.0), (20, 30, 60, 120, 240)
HEIGHT = 352.0  # units, from the first title to the words under the axis


class Axes(NamedTuple):
    """Where a value stands in a plot. Units; `high` is the value at the top, 0 at the bottom."""

    left: float
    right: float
    top: float
    bottom: float
    high: float

    def x(self, metres: Array | float) -> Array:
        low, high = np.log2(AXIS_CM)
        share = (np.log2(100.0 * np.asarray(metres)) - low) / (high - low)
        return self.left + share * (self.right - self.left)

    def y(self, value: Array | float) -> Array:
        share = np.clip(np.asarray(value) / self.high, 0.0, 1.0)
        return self.bottom - share * (self.bottom - self.top)


def curves(
    canvas: Canvas,
    curves: Curves,
    numbers: Numbers,
    words: Mapping[str, str],
    x: float,
    y: float,
    width: float,
    *,
    true: bool = True,
) -> None:
    """Both plots with their upper left at (x, y), HEIGHT high; the far-away camera has its own place at the right.

    true: whether d_S is told: without it its plot is empty, for those who are to say first what they expect.
    """
    left, far = x + 26, x + width - 12
    right = far - 22
    d_l = max(curves.d_l_percent.max(), curves.orthographic[0], numbers.d_l_percent)
    d_s = max(curves.d_s_mm.max(), curves.orthographic[1], numbers.d_s_mm)
    upper = Axes(left, right, y + 20, y + 118, 3.0 * max(2.0, np.ceil(d_l / 3.0)))
    lower = Axes(left, right, y + 164, y + 296, 4.0 * max(3.0, np.ceil(d_s / 4.0)))
    canvas.text(x, y + 6, words["d_l_axis"], 13, D_L, 650)
    band_words = words["band"].format(tolerance=f"{curves.tolerance_percent:g}")
    start = canvas.text(x + width, y + 6, band_words, 11, DIM, anchor="end")
    canvas.fill(start - 18, y - 4, 13, 11, BAND)
    canvas.text(x, y + 150, words["d_s_axis"], 13, D_S, 650)
    band = float(upper.y(curves.tolerance_percent))
    canvas.fill(left, band, far + 8 - left, upper.bottom - band, BAND)
    _grid(canvas, upper, 3 if upper.high <= 12 else 6, far + 8)
    _grid(canvas, lower, 4 if lower.high <= 16 else 8, far + 8)
    _ticks(canvas, words, lower, far)
    _standing(canvas, curves, numbers, words, (upper, lower), (x, far + 12))
    inside = curves.distances[
        (curves.distances >= 0.01 * AXIS_CM[0]) & (curves.distances <= 0.01 * AXIS_CM[1])
    ]
    for axes, value, colour, dash in (
        (upper, curves.d_l_percent, D_L, (6.0, 3.0)),
        (lower, curves.d_s_mm, D_S, None),
    ):
        if colour is D_S and not true:
            continue
        shown = np.interp(inside, curves.distances, value)
        canvas.curve(axes.x(inside), axes.y(shown), colour, 2.2, dash=dash)
    canvas.circle((far, float(upper.y(curves.orthographic[0]))), 3.6, D_L, 1.5)
    if true:
        canvas.square((far, float(lower.y(curves.orthographic[1]))), 3.4, D_S, 1.5)
    if numbers.distance is None or 0.2 <= numbers.distance <= 3.0:
        at = far if numbers.distance is None else float(lower.x(numbers.distance))
        for axes in (upper, lower):
            canvas.line((at, axes.top - 2), (at, axes.bottom), INK, 1.5)
        canvas.circle((at, float(upper.y(numbers.d_l_percent))), 4.6, D_L)
        if true:
            canvas.square((at, float(lower.y(numbers.d_s_mm))), 4.3, D_S)


def _grid(canvas: Canvas, axes: Axes, step: int, end: float) -> None:
    for value in np.arange(0, axes.high + 0.5 * step, step):
        y = float(axes.y(value))
        canvas.line((axes.left, y), (end, y), LINE)
        canvas.text(axes.left - 7, y + 4.5, f"{value:g}", 12.5, DIM, anchor="end")


def _ticks(canvas: Canvas, words: Mapping[str, str], axes: Axes, far: float) -> None:
    marks = [(float(axes.x(cm / 100)), str(cm)) for cm in TICKS_CM] + [(far, words["far_tick"])]
    for x, text in marks:
        canvas.line((x, axes.bottom), (x, axes.bottom + 4), DIM)
        canvas.text(x, axes.bottom + 18, text, 12.5, DIM, anchor="middle")
    middle = (axes.left + axes.right) / 2
    canvas.text(middle, axes.bottom + 56, words["axis"], 12.5, DIM, anchor="middle")


def _standing(
    canvas: Canvas,
    curves: Curves,
    numbers: Numbers,
    words: Mapping[str, str],
    plots: tuple[Axes, Axes],
    ends: tuple[float, float],
) -> None:
    """The dotted line at the truth, and below the ticks what is true and what is assumed, never over each other."""
    axes = plots[1]
    labels: list[tuple[float, str, Colour]] = []
    for distance, key, colour in (
        (curves.true_distance, "true", DIM),
        (numbers.distance, "assumed", INK),
    ):
        if distance is not None and AXIS_CM[0] <= 100 * distance <= AXIS_CM[1]:
            text = words[key].format(cm=centimetres(distance))
            labels.append((float(axes.x(distance)), text, colour))
            if key == "true":
                for plot in plots:
                    x = labels[-1][0]
                    canvas.line((x, plot.bottom), (x, plot.top - 2), DIM, 1.2, dash=(2.0, 3.0))
    middles = apart(
        [x for x, _, _ in labels], [canvas.wide(t, 12.5, 600) + 12 for _, t, _ in labels], *ends
    )
    for middle, (_, text, colour) in zip(middles, labels, strict=True):
        canvas.text(middle, axes.bottom + 37, text, 12.5, colour, 600, anchor="middle")


def apart(
    middles: Sequence[float], widths: Sequence[float], low: float, high: float
) -> list[float]:
    """Middles of one or two labels moved as little as needed: between low and high, not over each other."""
    inside = [min(max(m, low + w / 2), high - w / 2) for m, w in zip(middles, widths, strict=True)]
    if len(inside) < 2:
        return inside
    first, second = (0, 1) if middles[0] <= middles[1] else (1, 0)
    need = (widths[0] + widths[1]) / 2
    if inside[second] - inside[first] < need:
        centre = (inside[0] + inside[1]) / 2
        left = max(centre - need / 2, low + widths[first] / 2)
        left = min(left, high - widths[second] / 2 - need)
        inside[first], inside[second] = left, left + need
    return inside


def centimetres(metres: float) -> str:
    """Centimetres of 3 significant digits, without an exponent."""
    digits = max(0, 2 - int(np.floor(np.log10(100.0 * metres))))
    text = f"{100.0 * metres:.{digits}f}"
    return text.rstrip("0").rstrip(".") if digits else text
