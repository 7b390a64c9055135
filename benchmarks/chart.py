"""Curves on two logarithmic axes, drawn by the canvas of the pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from faceambig.arrays import Array
from faceambig.render.canvas import Canvas, Colour

INK, DIM, LINE, PAPER = (0x1D, 0x27, 0x33), (0x52, 0x60, 0x6D), (0xD5, 0xDC, 0xE3), (255, 255, 255)


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """A curve and the words at its right end."""

    words: str
    x: Array  # (K,) > 0
    y: Array  # (K,) > 0
    colour: Colour


@dataclass(frozen=True, slots=True)
class Frame:
    """Where a plot stands on the canvas, units, and the powers of ten its axes span."""

    left: float
    top: float
    width: float
    height: float
    x_powers: tuple[int, int]
    y_powers: tuple[int, int]

    def at(self, x: Array | float, y: Array | float) -> tuple[Array, Array]:
        across = (np.log10(x) - self.x_powers[0]) / (self.x_powers[1] - self.x_powers[0])
        up = (np.log10(y) - self.y_powers[0]) / (self.y_powers[1] - self.y_powers[0])
        return self.left + self.width * across, self.top + self.height * (1.0 - up)


def plot(
    canvas: Canvas, frame: Frame, title: str, axis: str, units: Sequence[str], lines: Sequence[Line]
) -> None:
    """A plot: title above, axis below, one word a power of ten at the left, the names right of the ends."""
    bottom, right = frame.top + frame.height, frame.left + frame.width
    canvas.text(frame.left, frame.top - 14, title, 15, INK, 650)
    for power, words in zip(range(frame.y_powers[0], frame.y_powers[1] + 1), units, strict=True):
        _, y = frame.at(1.0, 10.0**power)
        canvas.line((frame.left, float(y)), (right, float(y)), LINE)
        canvas.text(frame.left - 8, float(y) + 4.5, words, 12.5, DIM, anchor="end")
    for power in range(frame.x_powers[0], frame.x_powers[1] + 1):
        x, _ = frame.at(10.0**power, 10.0 ** frame.y_powers[0])
        canvas.line((float(x), frame.top), (float(x), bottom), LINE)
        canvas.text(float(x), bottom + 18, f"{10**power:,}", 12.5, DIM, anchor="middle")
    canvas.text(frame.left + frame.width / 2, bottom + 40, axis, 12.5, DIM, anchor="middle")
    ends = [frame.at(line.x[-1], line.y[-1]) for line in lines]
    beside = max(right, *(float(x) for x, _ in ends)) + 12
    for line, y in zip(lines, apart([float(y) for _, y in ends], 18.0), strict=True):
        xs, ys = frame.at(line.x, line.y)
        canvas.curve(xs, ys, line.colour, 2.2)
        for point in zip(xs.tolist(), ys.tolist(), strict=True):
            canvas.circle(point, 3.2, line.colour)
        canvas.text(beside, y + 4.5, line.words, 12.5, line.colour, 600)


def apart(places: Sequence[float], gap: float) -> list[float]:
    """`places` moved as little as needed, in their order, until neighbours are `gap` apart."""
    order = sorted(range(len(places)), key=places.__getitem__)
    moved = [places[i] - k * gap for k, i in enumerate(order)]
    # Isotonic least squares by pooling: without the gaps, places must only not fall
    pools: list[list[float]] = []
    for value in moved:
        pools.append([value])
        while len(pools) > 1 and np.mean(pools[-2]) > np.mean(pools[-1]):
            last = pools.pop()
            pools[-1] += last
    flat = [float(np.mean(pool)) for pool in pools for _ in pool]
    answer = [0.0] * len(places)
    for k, i in enumerate(order):
        answer[i] = flat[k] + k * gap
    return answer
