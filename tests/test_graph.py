"""draw_chart(): values stand where their axis says; bands, bars, names and logarithms; nothing to draw is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from faceambig.chart import Chart, Line
from faceambig.render import graph

RISING = Line("rising", (1.0, 2.0, 4.0), (0.0, 5.0, 10.0))
CHART = Chart("A title", "along", "up", (RISING,))


def inked(pixels: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    """(n, 2) row and column of the pixels of a colour."""
    return np.argwhere((pixels == colour).all(axis=2))


def plot_of(chart: Chart) -> np.ndarray:
    """The picture without the names at the right."""
    return graph.draw_chart(chart)[:, : round(graph.SIZE[0] - graph.KEY - graph.MARGIN) + 4]


def halfway(at: np.ndarray) -> float:
    """The column where a curve (n, 2) is at half its height."""
    level = (at[:, 0].min() + at[:, 0].max()) / 2
    return float(at[np.abs(at[:, 0] - level) <= 1, 1].mean())


def test_a_curve_begins_and_ends_where_its_values_are():
    at = inked(plot_of(CHART), graph.COLOURS[0])
    left, right = at[at[:, 1].argmin()], at[at[:, 1].argmax()]
    assert abs(left[1] - graph.LEFT) < 6  # the least x is the left end, 0 the bottom
    assert abs(left[0] - (graph.SIZE[1] - graph.BOTTOM)) < 6
    assert abs(right[0] - (graph.TOP + 6)) < 6
    share = (halfway(at) - left[1]) / (right[1] - left[1])
    assert share == pytest.approx(1 / 3, abs=0.03)  # 2 on an even axis from 1 to 4


def test_a_logarithmic_axis_puts_equal_ratios_apart_equally():
    at = inked(plot_of(replace(CHART, log_x=True)), graph.COLOURS[0])
    share = (halfway(at) - at[:, 1].min()) / (at[:, 1].max() - at[:, 1].min())
    assert share == pytest.approx(0.5, abs=0.03)


def test_bars_are_as_high_as_their_values_and_stand_side_by_side():
    lines = (Line("a", (0, 1), (10.0, 5.0)), Line("b", (0, 1), (2.0, 10.0)))
    pixels = plot_of(Chart("Bars", "", "", lines, bars=True, ticks=("one", "two")))
    heights = {}
    for colour in graph.COLOURS[:2]:
        columns = np.bincount(inked(pixels, colour)[:, 1])
        wide = np.flatnonzero(columns)
        first = wide[: np.flatnonzero(np.diff(wide) > 1)[0] + 1]  # the bar at 0
        heights[colour] = (columns[first].max(), first.min())
    (high, left), (low, right) = heights.values()
    assert low / high == pytest.approx(0.2, abs=0.02)
    assert left < right


def test_a_band_lies_around_its_curve_and_hides_none():
    band = Line("band", (1.0, 2.0), (5.0, 5.0), (2.0, 2.0), (8.0, 8.0))
    other = Line("other", (1.0, 2.0), (6.0, 6.0))
    pixels = plot_of(Chart("Band", "", "", (other, band)))
    assert len(inked(pixels, graph.COLOURS[0])) > 500  # drawn before, and still whole
    tinted = (pixels != 255).any(axis=2).mean()
    assert tinted > 0.3  # 6 of 10 parts of the height


def test_a_value_that_is_none_leaves_a_gap():
    gap = Line("gap", (1.0, 2.0, 3.0), (1.0, float("nan"), 3.0))
    assert len(inked(plot_of(Chart("Gap", "", "", (gap,))), graph.COLOURS[0]))


def test_names_of_places_stand_below_the_axis():
    named = replace(CHART, lines=(Line("a", (0, 1, 2), (1.0, 2.0, 3.0)),), ticks=("x", "y", "z"))
    plain = replace(named, ticks=())
    below = slice(round(graph.SIZE[1] - graph.BOTTOM) + 4, None)
    assert (graph.draw_chart(named)[below] != graph.draw_chart(plain)[below]).any()


@pytest.mark.parametrize(
    ("low", "high", "log", "ticks"),
    [
        (0.0, 7.3, False, (0, 2, 4, 6, 8)),
        (0.0, 1.0, False, (0, 0.2, 0.4, 0.6, 0.8, 1.0)),
        (0.3, 5.0, True, (0.2, 0.5, 1, 2, 5)),
        (1e-12, 1.0, True, (1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 1e-2, 1.0)),
        (3.0, 3.0, False, (3.0, 3.5, 4.0)),
    ],
)
def test_ticks_are_round_and_hold_the_ends(low, high, log, ticks):
    found = np.array(graph._ticks(low, high, log))
    assert len(found) <= 10
    assert found[0] <= low * (1 + 1e-12)
    assert found[-1] >= high * (1 - 1e-12)
    if low < high:
        np.testing.assert_allclose(found, ticks, rtol=1e-12)


def test_a_chart_without_a_value_is_refused():
    empty = Chart("Empty", "", "", (Line("a", (1.0,), (float("nan"),)),))
    with pytest.raises(ValueError, match="chart: 'Empty' has no finite value to draw"):
        graph.draw_chart(empty)


def test_a_line_refuses_values_for_other_places():
    with pytest.raises(ValueError, match="y: 2 values in 'a' for 3 of x"):
        Line("a", (1.0, 2.0, 3.0), (1.0, 2.0))
