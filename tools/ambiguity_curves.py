"""The plots of docs/ambiguity.md."""

from __future__ import annotations

import numpy as np

import ambiguity_numbers as numbers
import ambiguity_plots as plots
import faceambig as fa
from ambiguity_plots import DASH, Plot, thin
from faceambig.arrays import Array
from faceambig.metrics import HUMAN_TOLERANCE_PERCENT
from faceambig.posterior import BEYOND
from faceambig.render.canvas import THIN, Canvas, Picture
from faceambig.render.plots import D_L, D_S, DIM, INK

TICKS, WIDE_TICKS = (20, 30, 60, 120, 240), (20, 30, 60, 120, 240, 480, 960)  # cm
UNIT, PAPER = 1.25, (255, 255, 255)
AXIS, UNKNOWN = "assumed camera distance in cm", "camera distance in cm"
CANNOT_TELL = f"under {HUMAN_TOLERANCE_PERCENT:g}{THIN}%: a person cannot tell"
DENSITY = "Probability per doubling"
# One colour a photograph, the nearest first: of d_L, of d_S, of the densities
BLUES = ((0x08, 0x1E, 0x45), D_L, (0x45, 0x88, 0xDD), (0x7E, 0xAE, 0xE8))
BROWNS = ((0x4A, 0x20, 0x00), D_S, (0xD6, 0x76, 0x22), (0xE6, 0xA1, 0x63))
INKS = (INK, D_L, D_S)


def curves() -> Picture:
    """d_L and d_S over the assumed distance for four photographs, means of the subjects; three densities."""
    canvas = Canvas((1560, 470), UNIT, PAPER)
    paths = numbers.paths()
    left = Plot(46, 50, 240, 260, (19, 300), 3.0)
    middle = Plot(450, 50, 240, 260, (19, 300), 8.0)
    right = Plot(858, 50, 360, 260, (19, 1000), 3.5)
    plots.band(canvas, left, HUMAN_TOLERANCE_PERCENT, CANNOT_TELL)
    plots.frame(canvas, left, "Landmark error in %", D_L, (0, 1, 2, 3), TICKS, AXIS)
    plots.frame(canvas, middle, "Surface difference in mm", D_S, (0, 2, 4, 6, 8), TICKS, AXIS)
    for plot, colours, square in ((left, BLUES, False), (middle, BROWNS, True)):
        labels = []
        for path, colour in zip(paths, colours, strict=True):
            value = (path.d_s_mm if square else path.d_l_percent).mean(axis=0)
            dash = None if square else DASH
            plots.line(
                canvas, plot, numbers.FITTED, value, colour,
                dash=dash, at=(path.actual,), square=square,
            )  # fmt: skip
            labels.append(
                (float(plot.y(value[-1])), f"from {thin(numbers.said(path.actual))}", colour)
            )
        plots.names(canvas, plot.far + 22, labels, square=square)
    plots.frame(
        canvas, right, DENSITY, INK, (0, 1, 2, 3), WIDE_TICKS, UNKNOWN, far=False
    )  # fmt: skip
    for actual, colour in zip(numbers.PHOTOGRAPHS, INKS, strict=True):
        metres, value = per_doubling(numbers.posterior(actual, exact=True))
        canvas.curve(right.x(metres), right.y(value), colour, 2.2)
        x = float(right.x(actual))
        canvas.line((x, right.bottom), (x, right.top), colour, 1.2, dash=plots.DOTS)
        canvas.text(x + 5, right.top + 10, f"from {thin(numbers.said(actual))}", 12.5, colour, 600)
    return canvas.pixels


def errors() -> Picture:
    """The paper's error plot: d_L and d_S over the assumed distance, mean of the subjects and each of them."""
    canvas = Canvas((910, 725), UNIT, PAPER)
    path = numbers.paths()[0]
    upper = Plot(46, 46, 560, 190, (19, 300), 3.0)
    lower = Plot(46, 290, 560, 230, (19, 300), 8.0)
    plots.band(canvas, upper, HUMAN_TOLERANCE_PERCENT, CANNOT_TELL)
    plots.frame(canvas, upper, "Landmark error in %", D_L, (0, 1, 2, 3), TICKS, "")
    plots.frame(canvas, lower, "Surface difference in mm", D_S, (0, 2, 4, 6, 8), TICKS, AXIS)
    for plot, every, colour, square in (
        (upper, path.d_l_percent, D_L, False),
        (lower, path.d_s_mm, D_S, True),
    ):
        for one in every:
            plots.line(canvas, plot, numbers.FITTED, one, plots.pale(colour), width=0.9)
        plots.truth(canvas, plot, path.actual, f"true: {100 * path.actual:.0f}")
        plots.line(
            canvas, plot, numbers.FITTED, every.mean(axis=0), colour,
            dash=None if square else DASH, at=numbers.ROW, square=square,
        )  # fmt: skip
        middle = float(plot.y(every.mean(axis=0)[-1]))
        canvas.text(plot.far + 14, middle + 4.5, "mean of 10", 12.5, colour, 600)
    return canvas.pixels


def distances() -> Picture:
    """Posterior of the distance of one face photographed from three distances."""
    canvas = Canvas((1130, 845), UNIT, PAPER)
    for index, actual in enumerate(numbers.PHOTOGRAPHS):
        found = numbers.posterior(actual)
        plot = Plot(46, 48 + 208 * index, 620, 150, (19, 1000), 4.0)
        last = index == len(numbers.PHOTOGRAPHS) - 1
        metres, value = per_doubling(found)
        for level, white in ((0.95, 0.82), (0.5, 0.55)):
            interval = found.interval(level)
            high = metres[-1] if interval.high is None else interval.high
            inside = np.unique(
                np.concatenate([metres, [interval.low, high]]).clip(interval.low, high)
            )
            plots.area(
                canvas, plot, inside, np.interp(inside, metres, value), plots.pale(D_L, white)
            )
        title = f"{DENSITY}, photograph from {thin(numbers.said(actual))}"
        axis = UNKNOWN if last else ""
        plots.frame(canvas, plot, title, INK, (0, 1, 2, 3, 4), WIDE_TICKS, axis, far=False)
        before = np.full(2, np.log(2.0) * (1.0 - BEYOND) / np.log(metres[-1] / metres[0]))
        canvas.curve(plot.x(metres[[0, -1]]), plot.y(before), DIM, 1.2, dash=DASH)
        canvas.curve(plot.x(metres), plot.y(value), D_L, 2.2)
        plots.truth(canvas, plot, actual, f"true: {100 * actual:.0f}")
        x, y = plot.left + plot.width + 16, plot.top + 22
        for words, colour in (
            (f"50{THIN}%: {thin(numbers.between(found.interval(0.5)))}", INK),
            (f"95{THIN}%: {thin(numbers.between(found.interval(0.95)))}", INK),
            (f"beyond 10{THIN}m: {mass(found.distance_density.beyond)}", DIM),
        ):
            canvas.text(x, y, words, 13.5, colour, 600 if colour == INK else 400)
            y += 24
        canvas.line((x, y + 19), (x + 24, y + 19), DIM, 1.2, dash=DASH)
        canvas.text(x + 32, y + 24, "before the picture", 13.5, DIM)
    return canvas.pixels


def per_doubling(found: fa.Posterior) -> tuple[Array, Array]:
    """Distances (K,) metres and the density (K,) per doubling of the distance."""
    density = found.distance_density
    return density.distances, np.log(2.0) * density.density


def mass(share: float) -> str:
    """Percent of one decimal."""
    return f"under 0.1{THIN}%" if share < 0.001 else f"{100 * share:.1f}{THIN}%"
