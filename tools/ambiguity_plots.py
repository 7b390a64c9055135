"""Plots over the camera distance for docs/ambiguity.md: a logarithmic axis in centimetres, one quantity a plot."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from faceambig.arrays import Array
from faceambig.render.canvas import THIN, Canvas, Colour
from faceambig.render.plots import BAND, DIM, LINE

DASH, DOTS = (6.0, 3.0), (2.0, 3.0)
FAR = 26.0  # units from the end of the axis to the orthographic camera
PALE = 0.72  # of white in what stands behind a line


@dataclass(frozen=True, slots=True)
class Plot:
    """Where a plot stands, units, and what its axes span."""

    left: float
    top: float
    width: float  # of the distance axis; the place of "far" is right of it
    height: float
    cm: tuple[float, float]
    high: float  # value at the top, 0 at the bottom

    @property
    def bottom(self) -> float:
        return self.top + self.height

    @property
    def far(self) -> float:
        return self.left + self.width + FAR

    def x(self, metres: Array | float) -> Array:
        low, high = np.log2(self.cm)
        share = (np.log2(100.0 * np.asarray(metres)) - low) / (high - low)
        return self.left + self.width * share

    def y(self, value: Array | float) -> Array:
        return self.bottom - self.height * np.asarray(value) / self.high


def frame(
    canvas: Canvas,
    plot: Plot,
    title: str,
    colour: Colour,
    values: Sequence[float],
    ticks: Sequence[int],
    axis: str,
    *,
    far: bool = True,
) -> None:
    """Title, grid and axes; `values` get a line and a number, `ticks` are centimetres; `axis` may be empty."""
    right = plot.far + 8 if far else plot.left + plot.width
    canvas.text(plot.left - 26, plot.top - 14, title, 14, colour, 650)
    for value in values:
        y = float(plot.y(value))
        canvas.line((plot.left, y), (right, y), LINE)
        canvas.text(plot.left - 7, y + 4.5, f"{value:g}", 12.5, DIM, anchor="end")
    marks = [(float(plot.x(cm / 100)), str(cm)) for cm in ticks]
    for x, words in marks + ([(plot.far, "far")] if far else []):
        canvas.line((x, plot.bottom), (x, plot.bottom + 4), DIM)
        if axis:
            canvas.text(x, plot.bottom + 19, words, 12.5, DIM, anchor="middle")
    middle = plot.left + plot.width / 2
    canvas.text(middle, plot.bottom + 41, axis, 12.5, DIM, anchor="middle")


def band(canvas: Canvas, plot: Plot, value: float, words: str) -> None:
    """The values below the tolerance; drawn before everything else."""
    y, right = float(plot.y(value)), plot.far + 8
    canvas.fill(plot.left, y, right - plot.left, plot.bottom - y, BAND)
    canvas.text(right - 8, y + 18, words, 12, DIM, anchor="end")


def line(
    canvas: Canvas,
    plot: Plot,
    metres: Array,
    values: Array,
    colour: Colour,
    *,
    dash: tuple[float, float] | None = None,
    width: float = 2.2,
    at: Sequence[float | None] = (),
    square: bool = False,
) -> None:
    """A curve (D,), its last of D + 1 values at "far", with marks at the distances `at` (metres, None: far)."""
    canvas.curve(plot.x(metres), plot.y(values[:-1]), colour, width, dash=dash)
    # Across the gap lies all that is beyond the axis
    ends = np.array([float(plot.x(metres[-1])), plot.far])
    canvas.curve(ends, plot.y(values[-2:]), colour, 0.6 * width, dash=DOTS)
    for distance in at:
        index = -1 if distance is None else int(np.argmin(np.abs(metres - distance)))
        x = plot.far if distance is None else float(plot.x(metres[index]))
        place = (x, float(plot.y(values[index])))
        if square:
            canvas.square(place, 4.0, colour)
        else:
            canvas.circle(place, 4.3, colour)


def names(
    canvas: Canvas, x: float, labels: Sequence[tuple[float, str, Colour]], *, square: bool
) -> None:
    """Mark and words right of the curves' ends, (y, words, colour), upwards where they would be over each other."""
    last = np.inf
    for y, words, colour in sorted(labels, reverse=True):
        last = min(y, last - 17.0)
        if square:
            canvas.square((x, last), 4.0, colour)
        else:
            canvas.circle((x, last), 4.3, colour)
        canvas.text(x + 10, last + 4.5, words, 12.5, DIM, 600)


def truth(canvas: Canvas, plot: Plot, metres: float, words: str) -> None:
    """The dotted line at the true distance, its words at its head."""
    x = float(plot.x(metres))
    canvas.line((x, plot.bottom), (x, plot.top), DIM, 1.2, dash=DOTS)
    canvas.text(x + 6, plot.top + 18, words, 12.5, DIM, 600)


def area(canvas: Canvas, plot: Plot, metres: Array, values: Array, colour: Colour) -> None:
    """What lies below a curve."""
    x, y = plot.x(metres), plot.y(values)
    outline = np.column_stack(
        [np.concatenate([x[:1], x, x[-1:]]), np.concatenate([[plot.bottom], y, [plot.bottom]])]
    )
    points = outline * canvas.unit

    def filled(mask: np.ndarray, place: Callable[[Array], np.ndarray]) -> None:
        cv2.fillPoly(mask, [place(points)], 255, shift=4)

    canvas.ink(colour, points, 1.0, filled)


def pale(colour: Colour, white: float = PALE) -> Colour:
    """The colour mixed with white."""
    r, g, b = (round(part + white * (255 - part)) for part in colour)
    return r, g, b


def thin(words: str) -> str:
    """Words with a thin space before the unit of a distance."""
    return re.sub(r"(?<=\d) (?=c?m\b)", THIN, words)
