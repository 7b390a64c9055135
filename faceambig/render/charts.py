"""Charts of any range of distances: landmark error above surface difference, and the density of the distance.

Unlike the plots beside the heads (plots.py), which keep the range of the page's slider, the axis is that of the data.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import cv2
import numpy as np

from ..arrays import Array
from ..scene import Curves
from .canvas import Canvas, Colour, Picture, Place
from .plots import BAND, D_L, D_S, DIM, INK, LINE

NICE_CM = (5, 10, 15, 20, 30, 60, 120, 240, 500, 1000, 2000, 5000, 10000, 100000)
APART = 34.0  # units: labels of ticks nearer than that are left out
WITHIN = ((0xDC, 0xE8, 0xF8), (0xB4, 0xCE, 0xF0))  # under the density: 95 %, 50 %
FAR = 60.0  # units from the last distance to the place of the far-away camera


class Frame(NamedTuple):
    """Where a value stands. Units; metres from `low` to `high`, values from 0 to `most`."""

    left: float
    right: float
    top: float
    bottom: float
    low: float
    high: float
    most: float

    def x(self, metres: Array | float) -> Array:
        share = np.log(np.asarray(metres) / self.low) / np.log(self.high / self.low)
        return self.left + share * (self.right - self.left)

    def y(self, value: Array | float) -> Array:
        share = np.clip(np.asarray(value) / self.most, 0.0, 1.0)
        return self.bottom - share * (self.bottom - self.top)


def two_curves(
    canvas: Canvas,
    curves: Curves,
    words: Mapping[str, str],
    x: float,
    y: float,
    width: float,
    height: float,
) -> None:
    """d_L above d_S against the distance, upper left at (x, y); the far-away camera has its own place at the right.

    words: d_l, d_s, axis, far, band, true. A true distance that is NaN is not known, and not drawn.
    """
    d_l = max(float(curves.d_l_percent.max()), curves.orthographic[0], curves.tolerance_percent)
    d_s = max(float(curves.d_s_mm.max()), curves.orthographic[1])
    left, far = x + 40, x + width - 16
    low, high = _range(curves.distances)
    middle = y + 0.42 * height
    upper = Frame(left, far - FAR, y + 24, middle - 16, low, high, _rounded_up(d_l))
    lower = Frame(left, far - FAR, middle + 30, y + height - 52, low, high, _rounded_up(d_s))
    canvas.text(x, y + 8, words["d_l"], 15, D_L, 650)
    canvas.text(x, middle + 14, words["d_s"], 15, D_S, 650, most=width)
    start = canvas.text(x + width, y + 8, words["band"], 13, DIM, anchor="end")
    canvas.fill(start - 22, y - 4, 15, 13, BAND)
    at = float(upper.y(curves.tolerance_percent))
    canvas.fill(left, at, far + 10 - left, upper.bottom - at, BAND)
    for frame, values, end, colour, dash in (
        (upper, curves.d_l_percent, curves.orthographic[0], D_L, (6.0, 3.0)),
        (lower, curves.d_s_mm, curves.orthographic[1], D_S, None),
    ):
        _grid(canvas, frame, far + 10)
        _upright(canvas, frame, curves.true_distance)
        xs, ys = frame.x(curves.distances), frame.y(values)
        if len(xs) > 1:
            canvas.curve(xs, ys, colour, 2.4, dash=dash)
        else:
            canvas.circle((float(xs[0]), float(ys[0])), 4.0, colour)
        canvas.circle((far, float(frame.y(end))), 4.0, colour, 1.6)
    _ticks(canvas, lower, words["axis"])
    canvas.text(far, lower.bottom + 19, words["far"], 13, DIM, anchor="middle")
    _label(canvas, lower, curves.true_distance, words["true"])


def density(
    canvas: Canvas,
    distances: Array,
    values: Array,
    intervals: Sequence[tuple[float, float]],
    beyond: float,
    words: Mapping[str, str],
    x: float,
    y: float,
    width: float,
    height: float,
    *,
    true_distance: float = np.nan,
) -> None:
    """How probable each distance is, upper left at (x, y), with its intervals below the curve.

    values (D,): probability per doubling of the distances (D,), metres. intervals: of 95 and of 50 %, the wider first,
    metres, inf for no end. beyond: probability of what is farther. words: density, axis, far, true.
    """
    left, far = x + 48, x + width - 20
    low, high = float(distances[0]), float(distances[-1])
    most = _rounded_up(max(float(values.max()), beyond))
    frame = Frame(left, far - FAR, y + 26, y + height - 52, low, high, most)
    canvas.text(x, y + 8, words["density"], 15, D_L, 650, most=width)
    _grid(canvas, frame, far + 12)
    xs, ys = frame.x(distances), frame.y(values)
    for (near, end), colour in zip(intervals, WITHIN, strict=True):
        inside = (distances >= near) & (distances <= end)
        ends = [near] if near < high else []
        ends += [end] if end < high else []
        at = np.sort(np.append(distances[inside], ends))
        if len(at) > 1:
            _area(canvas, frame, at, np.interp(np.log(at), np.log(distances), values), colour)
    canvas.curve(xs, ys, D_L, 2.4)
    _upright(canvas, frame, true_distance)
    top = float(frame.y(beyond))
    if frame.bottom - top >= 0.5:
        canvas.fill(far - 9, top, 18, frame.bottom - top, D_L)
    share = f"{100 * beyond:.2g}" if beyond >= 1e-4 or beyond == 0 else "<0.01"
    canvas.text(far, top - 7, f"{share}\u202f%", 13, D_L, 600, anchor="middle")
    _ticks(canvas, frame, words["axis"])
    canvas.text(far, frame.bottom + 19, words["far"], 13, DIM, anchor="middle")
    _label(canvas, frame, true_distance, words["true"])


def _area(canvas: Canvas, frame: Frame, distances: Array, values: Array, colour: Colour) -> None:
    """What lies between the axis and a curve."""
    xs, ys = frame.x(distances), frame.y(values)
    x, y = np.concatenate([xs, xs[::-1]]), np.append(ys, np.full(len(ys), frame.bottom))
    outline = np.stack([x, y], axis=1) * canvas.unit

    def filled(mask: Picture, place: Place) -> None:
        cv2.fillPoly(mask, [place(outline)], 255, shift=4)

    canvas.ink(colour, outline, 1.0, filled)


def _range(distances: Array) -> tuple[float, float]:
    """Ends of the axis; one distance alone stands in the middle."""
    low, high = float(distances[0]), float(distances[-1])
    return (low, high) if high > low else (low / 2, 2 * high)


def _rounded_up(value: float) -> float:
    """The next 1, 2, 3, 4, 6 or 8 times a power of ten: what _grid divides evenly."""
    power = 10.0 ** np.floor(np.log10(max(value, 1e-6)))
    return float(
        power * next(step for step in (1, 2, 3, 4, 6, 8, 10) if step * power >= value * (1 - 1e-9))
    )


def _grid(canvas: Canvas, frame: Frame, end: float) -> None:
    first = round(frame.most / 10.0 ** np.floor(np.log10(frame.most)))
    parts = 3 if first in (3, 6) else 4
    for value in np.linspace(0, frame.most, parts + 1):
        at = float(frame.y(value))
        canvas.line((frame.left, at), (end, at), LINE)
        canvas.text(frame.left - 8, at + 5, f"{value:.3g}", 13, DIM, anchor="end")


def _ticks(canvas: Canvas, frame: Frame, title: str) -> None:
    last = -np.inf
    for cm in NICE_CM:
        at = float(frame.x(cm / 100))
        if frame.left - 0.5 <= at <= frame.right + 0.5 and at - last >= APART:
            canvas.line((at, frame.bottom), (at, frame.bottom + 5), DIM)
            canvas.text(at, frame.bottom + 19, str(cm), 13, DIM, anchor="middle")
            last = at
    middle = (frame.left + frame.right) / 2
    canvas.text(middle, frame.bottom + 48, title, 13, DIM, anchor="middle")


def _upright(canvas: Canvas, frame: Frame, metres: float) -> None:
    """The dotted line at the true distance, if it is known and on the axis."""
    if frame.low <= metres <= frame.high:
        at = float(frame.x(metres))
        canvas.line((at, frame.bottom), (at, frame.top - 2), INK, 1.2, dash=(2.0, 3.0))


def _label(canvas: Canvas, frame: Frame, metres: float, words: str) -> None:
    if frame.low <= metres <= frame.high:
        half = canvas.wide(words, 13, 600) / 2
        at = float(np.clip(frame.x(metres), frame.left + half, frame.right - half))
        canvas.text(at, frame.bottom + 34, words, 13, INK, 600, anchor="middle")
