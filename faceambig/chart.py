"""A chart as values: curves or bars over one axis. What draws one is render/graph.py."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Line:
    """One curve of a chart; of a bar chart one colour."""

    label: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    low: tuple[float, ...] | None = None  # a band about the curve
    high: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        for values in (self.y, self.low, self.high):
            if values is not None and len(values) != len(self.x):
                raise ValueError(
                    f"y: {len(values)} values in {self.label!r} for {len(self.x)} of x"
                )


@dataclass(frozen=True, slots=True)
class Chart:
    """Curves, or bars side by side, over one axis."""

    title: str
    x_label: str
    y_label: str
    lines: tuple[Line, ...]
    log_x: bool = False
    log_y: bool = False
    bars: bool = False
    ticks: tuple[str, ...] = ()  # names of the places on the x axis, of bars: one for each x
