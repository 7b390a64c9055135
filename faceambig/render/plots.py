"""The curves of a Scene on a canvas: d_L above d_S above the density, one distance axis, one cursor, no double axis."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
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
DENSITY, AREA = (0x4A, 0x55, 0x63), (0xC9, 0xD3, 0xDE)
AXIS_CM, TICKS_CM = (20.0, 300.0), (20, 30, 60, 120, 240)
# Units: the lower edge of each plot below the upper edge of all, and what follows the last: ticks, words of the axis
D_L_END, D_S_END, DENSITY_ROOM, AXIS_ROOM = 118.0, 296.0, 92.0, 56.0


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


def height(curves: Curves, hide: Collection[str] = ()) -> float:
    """Units from the first title to the words under the axis."""
    last = D_L_END if "truth" in hide else D_S_END
    return last + (0.0 if curves.density is None else DENSITY_ROOM) + AXIS_ROOM


def curves(
    canvas: Canvas,
    curves: Curves,
    numbers: Numbers,
    words: Mapping[str, str],
    x: float,
    y: float,
    width: float,
    *,
    hide: Collection[str] = (),
) -> None:
    """The plots with their upper left at (x, y), `height` high; the far-away camera has its own place at the right.

    With "truth" in `hide` there is no d_S. A density is a third plot below.
    """
    left, far = x + 26, x + width - 12
    right = far - 22
    d_l = max(curves.d_l_percent.max(), curves.orthographic[0], numbers.d_l_percent)
    d_s = max(curves.d_s_mm.max(), curves.orthographic[1], numbers.d_s_mm)
    upper = Axes(left, right, y + 20, y + D_L_END, 3.0 * max(2.0, np.ceil(d_l / 3.0)))
    lower = Axes(left, right, y + 164, y + D_S_END, 4.0 * max(3.0, np.ceil(d_s / 4.0)))
    shown = [Line(upper, curves.d_l_percent, curves.orthographic[0], numbers.d_l_percent, D_L)]
    canvas.text(x, y + 6, words["d_l_axis"], 13, D_L, 650)
    _band(canvas, curves, words, upper, far + 8, (x + width, y))
    _grid(canvas, upper, 3 if upper.high <= 12 else 6, far + 8)
    if "truth" not in hide:
        canvas.text(x, y + 150, words["d_s_axis"], 13, D_S, 650)
        _grid(canvas, lower, 4 if lower.high <= 16 else 8, far + 8)
        shown.append(Line(lower, curves.d_s_mm, curves.orthographic[1], numbers.d_s_mm, D_S))
    plots = [line.axes for line in shown]
    if curves.density is not None:
        bottom = plots[-1].bottom + DENSITY_ROOM
        plots.append(Axes(left, right, bottom - 58, bottom - 8, 1.0))
        _density(canvas, curves, words, plots[-1], (x, x + width))
    _ticks(canvas, words, plots[-1], far)
    _standing(canvas, curves, numbers, words, plots, (x, far + 12))
    for line in shown:
        _curve(canvas, curves, line, far)
    if numbers.distance is None or AXIS_CM[0] <= 100 * numbers.distance <= AXIS_CM[1]:
        at = far if numbers.distance is None else float(lower.x(numbers.distance))
        for axes in plots:
            canvas.line((at, axes.top - 2), (at, axes.bottom), INK, 1.5)
        for line in shown:
            _marker(canvas, line, at, line.now)


class Line(NamedTuple):
    """One curve in its plot."""

    axes: Axes
    values: Array  # (D,)
    far: float  # of the far-away camera
    now: float  # at the cursor
    colour: Colour


def _curve(canvas: Canvas, curves: Curves, line: Line, far: float) -> None:
    inside = _inside(curves)
    values = np.interp(inside, curves.distances, line.values)
    dash = (6.0, 3.0) if line.colour == D_L else None
    canvas.curve(line.axes.x(inside), line.axes.y(values), line.colour, 2.2, dash=dash)
    _marker(canvas, line, far, line.far, ring=True)


def _marker(canvas: Canvas, line: Line, x: float, value: float, *, ring: bool = False) -> None:
    """Round on d_L, square on d_S: told apart without colour too."""
    at = (x, float(line.axes.y(value)))
    size, width = (-1.0, 1.5) if ring else (0.0, 0.0)
    if line.colour == D_L:
        canvas.circle(at, 4.6 + size, D_L, width)
    else:
        canvas.square(at, 4.3 + 0.9 * size, D_S, width)


def _inside(curves: Curves) -> Array:
    low, high = 0.01 * AXIS_CM[0], 0.01 * AXIS_CM[1]
    return curves.distances[(curves.distances >= low) & (curves.distances <= high)]


def _band(
    canvas: Canvas,
    curves: Curves,
    words: Mapping[str, str],
    axes: Axes,
    end: float,
    corner: tuple[float, float],
) -> None:
    """What a person cannot tell, and its words up to the upper right `corner`."""
    text = words["band"].format(tolerance=f"{curves.tolerance_percent:g}")
    start = canvas.text(corner[0], corner[1] + 6, text, 11, DIM, anchor="end")
    canvas.fill(start - 18, corner[1] - 4, 13, 11, BAND)
    top = float(axes.y(curves.tolerance_percent))
    canvas.fill(axes.left, top, end - axes.left, axes.bottom - top, BAND)


def _density(
    canvas: Canvas,
    curves: Curves,
    words: Mapping[str, str],
    axes: Axes,
    sides: tuple[float, float],
) -> None:
    """How likely each distance is: an area, and below it bars that hold 50 and 95 %."""
    assert curves.density is not None
    canvas.text(sides[0], axes.top - 10, words["density"], 13, INK, 650)
    if curves.beyond >= 0.005:
        text = words["beyond"].format(percent=f"{100 * curves.beyond:.0f}")
        canvas.text(sides[1], axes.top - 10, text, 11, DIM, anchor="end")
    x = axes.x(_inside(curves))
    y = axes.y(np.interp(_inside(curves), curves.distances, curves.density))
    canvas.area(
        np.concatenate([[x[0]], x, [x[-1]]]),
        np.append(np.append(axes.bottom, y), axes.bottom),
        AREA,
    )
    canvas.curve(x, y, DENSITY, 1.6)
    canvas.line((axes.left, axes.bottom), (axes.right, axes.bottom), LINE)
    nearest, farthest = (0.01 * cm for cm in AXIS_CM)
    for (low, high), width in zip(curves.intervals, (4.5, 1.6), strict=False):
        at = axes.x(np.clip([low, high], nearest, farthest))
        if at[1] > at[0]:
            canvas.line((at[0], axes.bottom + 3.5), (at[1], axes.bottom + 3.5), DENSITY, width)


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
    plots: Sequence[Axes],
    ends: tuple[float, float],
) -> None:
    """The dotted line at the truth, and below the ticks what is true and what is assumed, never over each other."""
    axes = plots[-1]
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
