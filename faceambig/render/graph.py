"""A Chart on a canvas: curves with bands, or bars side by side, over axes that choose their own ticks."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from ..arrays import Array
from ..chart import Chart, Line
from .canvas import Canvas, Colour, Picture, Place
from .plots import DIM, INK, LINE

GROUND = (0xFF, 0xFF, 0xFF)
SIZE = (900, 520)  # pixels
# Told apart by people who do not see red or green, and by their dashes in grey
COLOURS: tuple[Colour, ...] = (
    (0x1B, 0x5F, 0xC1), (0xD5, 0x5E, 0x00), (0x00, 0x8F, 0x6B), (0xB0, 0x3A, 0x8C),
    (0x5B, 0x4B, 0xC4), (0x7A, 0x6A, 0x00), (0x2A, 0x9D, 0xC9), (0x55, 0x5F, 0x6B),
)  # fmt: skip
DASHES = (None, (9.0, 4.0), (3.0, 3.0), (12.0, 3.0), None, (6.0, 3.0))
BAND = 0.16  # cover of a curve's band
MARGIN, LEFT, TOP, BOTTOM = 24.0, 76.0, 62.0, 58.0  # units
KEY = 236.0  # units for the names of the curves, at the right
BARS = 0.78  # of the room of a tick


class Axis(NamedTuple):
    """Where a value stands, in units: `low` at `start`, `high` at `end`."""

    low: float
    high: float
    start: float
    end: float
    log: bool
    ticks: tuple[float, ...]

    def at(self, values: Array | float) -> Array:
        v = np.asarray(values, dtype=float)
        if self.log:
            v = np.log(np.maximum(v, 1e-300) / self.low) / np.log(self.high / self.low)
        else:
            v = (v - self.low) / (self.high - self.low)
        return self.start + np.clip(v, 0.0, 1.0) * (self.end - self.start)


def draw_chart(chart: Chart, size: tuple[int, int] = SIZE) -> Picture:
    """(H, W, 3) sRGB picture, size (W, H). ValueError for a chart without a finite value."""
    canvas = Canvas(size, 1.0, GROUND)
    width, height = size
    x, y = _axes(chart, width - MARGIN - KEY, height)
    canvas.text(MARGIN, 30, chart.title, 17, INK, 650, most=width - 2 * MARGIN)
    canvas.text(MARGIN, 52, chart.y_label, 13, DIM, most=width - 2 * MARGIN)
    for tick in y.ticks:
        at = float(y.at(tick))
        canvas.line((x.start, at), (x.end, at), LINE)
        canvas.text(x.start - 8, at + 5, _number(tick), 13, DIM, anchor="end")
    _x_ticks(canvas, chart, x, y)
    for k, line in enumerate(chart.lines):
        _band(canvas, line, x, y, COLOURS[k % len(COLOURS)])
    for k, line in enumerate(chart.lines):
        colour = COLOURS[k % len(COLOURS)]
        if chart.bars:
            _bars(canvas, line, k, len(chart.lines), x, y, colour)
        else:
            _curve(canvas, line, k, x, y, colour)
    _names(canvas, chart, width - KEY - MARGIN + 18)
    middle = (x.start + x.end) / 2
    canvas.text(middle, height - 12, chart.x_label, 13, DIM, anchor="middle")
    return canvas.pixels


def _axes(chart: Chart, right: float, height: int) -> tuple[Axis, Axis]:
    ys = np.concatenate(
        [np.array(part, dtype=float) for line in chart.lines for part in (line.y, line.low, line.high) if part]
    )  # fmt: skip
    xs = np.concatenate([np.array(line.x, dtype=float) for line in chart.lines])
    ys, xs = ys[np.isfinite(ys)], xs[np.isfinite(xs)]
    if not len(ys) or not len(xs):
        raise ValueError(f"chart: {chart.title!r} has no finite value to draw")
    low, high = float(ys.min()), float(ys.max())
    if not chart.log_y:
        low = min(low, 0.0)  # lengths are compared with 0 in sight
    y_ticks = _ticks(low, high, chart.log_y)
    y = Axis(
        min(low, y_ticks[0]), max(high, y_ticks[-1]), height - BOTTOM, TOP + 6, chart.log_y, y_ticks
    )
    low, high = float(xs.min()), float(xs.max())
    if chart.bars or chart.ticks:
        low, high = low - 0.5, high + 0.5
    if low == high:
        low, high = (low / 2, 2 * high) if chart.log_x else (low - 1, high + 1)
    inside = tuple(tick for tick in _ticks(low, high, chart.log_x) if low <= tick <= high)
    return Axis(low, high, LEFT, right, chart.log_x, inside), y


def _ticks(low: float, high: float, log: bool) -> tuple[float, ...]:
    """Round numbers that hold both ends: at most ten."""
    if log:
        low = max(low, 1e-300)
        first, last = int(np.floor(np.log10(low))), int(np.ceil(np.log10(high) - 1e-9))
        decades = range(first, last + 1, max(1, (last - first) // 8 + (last - first > 8)))
        if last - first > 3:
            return tuple(10.0**k for k in decades)
        marks = [m * 10.0**k for k in range(first, last + 1) for m in (1, 2, 5)]
        below = [m for m in marks if m <= low * (1 + 1e-9)][-1:] or marks[:1]
        above = [m for m in marks if m >= high * (1 - 1e-9)][:1] or marks[-1:]
        return tuple(m for m in marks if below[0] <= m <= above[0])
    span = high - low if high > low else max(abs(high), 1.0)
    power = 10.0 ** np.floor(np.log10(span / 5))
    step = float(power * next(m for m in (1, 2, 5, 10) if span / (m * power) <= 7))
    first, last = np.floor(low / step + 1e-9), np.ceil(high / step - 1e-9)
    return tuple(float(k * step) for k in np.arange(first, max(last, first + 1) + 1))


def _x_ticks(canvas: Canvas, chart: Chart, x: Axis, y: Axis) -> None:
    """The axis below: names where the chart has them, else numbers, left out where they would touch."""
    if chart.ticks:
        places = chart.lines[0].x
        named = list(zip(places, chart.ticks, strict=False))
    else:
        named = [(tick, _number(tick)) for tick in x.ticks]
    canvas.line((x.start, y.start), (x.end, y.start), DIM)
    room = (x.end - x.start) / max(len(named), 1) - 6
    last = -np.inf
    for value, words in named:
        at = float(x.at(value))
        half = min(canvas.wide(words, 13), room if chart.ticks else np.inf) / 2
        if at - half < last + 6:
            continue
        canvas.line((at, y.start), (at, y.start + 5), DIM)
        canvas.text(at, y.start + 21, words, 13, DIM, anchor="middle", most=max(room, 30.0))
        last = at + half


def _curve(canvas: Canvas, line: Line, k: int, x: Axis, y: Axis, colour: Colour) -> None:
    xs, ys = x.at(np.array(line.x)), np.array(line.y, dtype=float)
    good = np.isfinite(ys)
    if good.sum() > 1:
        canvas.curve(xs[good], y.at(ys[good]), colour, 2.2, dash=_dash(k))
    if good.sum() <= 14:
        for at, value in zip(xs[good], y.at(ys[good]), strict=True):
            canvas.circle((float(at), float(value)), 3.6, colour)


def _band(canvas: Canvas, line: Line, x: Axis, y: Axis, colour: Colour) -> None:
    """Between `low` and `high` of a curve, so thin that what lies below is seen."""
    if line.low is None or line.high is None:
        return
    low, high = np.array(line.low, dtype=float), np.array(line.high, dtype=float)
    good = np.isfinite(low) & np.isfinite(high)
    if good.sum() < 2:
        return
    xs = x.at(np.array(line.x))[good]
    heights = np.concatenate([y.at(high[good]), y.at(low[good])[::-1]])
    outline = np.stack([np.concatenate([xs, xs[::-1]]), heights], axis=1) * canvas.unit

    def filled(mask: Picture, place: Place) -> None:
        cv2.fillPoly(mask, [place(outline)], round(255 * BAND), shift=4)

    canvas.ink(colour, outline, 1.0, filled)


def _bars(canvas: Canvas, line: Line, k: int, of: int, x: Axis, y: Axis, colour: Colour) -> None:
    room = float(x.at(x.low + 1) - x.at(x.low)) * BARS
    zero = float(y.at(max(0.0, y.low)))
    for value, height in zip(line.x, line.y, strict=True):
        if not np.isfinite(height):
            continue
        left = float(x.at(value)) - room / 2 + k * room / of
        top = float(y.at(height))
        canvas.fill(left, min(top, zero), room / of - 1, abs(zero - top), colour)


def _names(canvas: Canvas, chart: Chart, x: float) -> None:
    """Colour, dash and name of each curve, below each other."""
    for k, line in enumerate(chart.lines):
        at, colour = TOP + 14 + 24 * k, COLOURS[k % len(COLOURS)]
        if chart.bars:
            canvas.fill(x, at - 11, 16, 14, colour)
        else:
            ends = np.array([x, x + 26.0])
            canvas.curve(ends, np.array([at - 4.5, at - 4.5]), colour, 2.2, dash=_dash(k))
        canvas.text(x + 34, at, line.label, 13, INK, most=KEY - 52)


def _dash(k: int) -> tuple[float, float] | None:
    dash = DASHES[k % len(DASHES)]
    return None if dash is None else (dash[0], dash[1])


def _number(value: float) -> str:
    """A tick's number, without needless digits."""
    if value != 0 and not 1e-4 <= abs(value) < 1e6:
        return f"{value:.0e}"
    return f"{value:.0f}" if abs(value) >= 1e4 else f"{value:.4g}"
