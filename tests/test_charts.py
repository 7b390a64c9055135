"""Charts: values and distances where they belong, ticks and labels that do not stand over each other."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from faceambig.render import charts
from faceambig.render.canvas import Canvas
from faceambig.scene import Curves

SIZE, GROUND = (900, 640), (255, 255, 255)
WORDS = dict.fromkeys(("d_l", "d_s", "density", "axis", "far", "band"), "") | {
    "true": "true: 60 cm"
}


def curves(distances: np.ndarray, true: float = np.nan) -> Curves:
    n = len(distances)
    return Curves(distances, np.full(n, 2.0), np.linspace(1.0, 5.0, n), (2.0, 5.0), true, 3.0)


def drawn(shape: Curves) -> Canvas:
    canvas = Canvas(SIZE, 1.0, GROUND)
    charts.two_curves(canvas, shape, WORDS, 20, 20, 860, 600)
    return canvas


def at(canvas: Canvas, colour: tuple[int, int, int]) -> np.ndarray:
    """(n, 2) x, y of the pixels of exactly that colour."""
    return np.argwhere((canvas.pixels == colour).all(axis=2))[:, ::-1]


def test_curves_stand_at_their_values():
    canvas = drawn(curves(np.geomspace(0.2, 3.0, 30)))
    frame = charts.Frame(60, 864 - charts.FAR, 44, 256, 0.2, 3.0, 3.0)
    blue = at(canvas, charts.D_L)
    assert len(blue) > 300
    # 2 of 3 % all along; the stroke is 2.4 wide
    assert np.abs(blue[blue[:, 0] < 830, 1] + 0.5 - frame.y(2.0)).max() < 2
    brown = at(canvas, charts.D_S)
    brown = brown[(brown[:, 1] > 310) & (brown[:, 0] < 830)]
    first, last = brown[brown[:, 0].argmin()], brown[brown[:, 0].argmax()]
    lower = charts.Frame(60, 864 - charts.FAR, 302, 568, 0.2, 3.0, 6.0)
    assert first == pytest.approx([60, lower.y(1.0)], abs=3)
    assert last == pytest.approx([864 - charts.FAR, lower.y(5.0)], abs=3)


@pytest.mark.parametrize(
    ("low", "high"), [(0.2, 3.0), (0.2, 10.0), (0.5, 0.6), (2.0, 900.0), (1.0, 1.0)]
)
def test_words_of_an_axis_do_not_touch(low, high):
    canvas = drawn(curves(np.geomspace(low, high, 1 if low == high else 5)))
    ticks = [box for box in canvas.boxes if box[0].isdigit() and box[2] > 560 and box[1] > 55]
    ticks.sort(key=lambda box: box[1])
    for (_, x, _, width, _), (_, after, *_) in itertools.pairwise(ticks):
        assert x + width < after
    assert {int(box[0]) for box in ticks} <= set(charts.NICE_CM)


def test_the_true_distance_is_marked_only_where_it_is_known_and_shown():
    for true, shown in ((0.6, True), (np.nan, False), (5.0, False)):
        canvas = drawn(curves(np.geomspace(0.2, 3.0, 30), true))
        assert any(box[0] == "true: 60 cm" for box in canvas.boxes) == shown


def test_a_density_is_filled_where_its_intervals_are():
    canvas = Canvas(SIZE, 1.0, GROUND)
    distances = np.geomspace(0.2, 3.2, 200)
    values = np.full(200, 0.25 * 0.9)
    spans = [(0.4, np.inf), (0.8, 1.6)]
    charts.density(canvas, distances, values, spans, 0.1, WORDS, 20, 20, 860, 600)
    frame = charts.Frame(68, 860 - charts.FAR, 46, 568, 0.2, 3.2, 0.3)
    wide, narrow = (at(canvas, colour) for colour in charts.WITHIN)
    assert narrow[:, 0].min() == pytest.approx(float(frame.x(0.8)), abs=1.5)
    assert narrow[:, 0].max() == pytest.approx(float(frame.x(1.6)), abs=1.5)
    assert wide[:, 0].min() == pytest.approx(float(frame.x(0.4)), abs=1.5)
    assert wide[:, 0].max() == pytest.approx(float(frame.x(3.2)), abs=2.5)  # open: to the last
    assert narrow[:, 1].min() == pytest.approx(float(frame.y(0.225)), abs=3)
    bar = at(canvas, charts.D_L)
    bar = bar[bar[:, 0] > frame.right + 30]
    bar = bar[bar[:, 1] > frame.y(0.1) - 2]
    assert bar[:, 1].min() == pytest.approx(float(frame.y(0.1)), abs=1.5)
    assert any(box[0].startswith("10") and box[0].endswith("%") for box in canvas.boxes)


@pytest.mark.parametrize(
    ("value", "end"), [(0.37, 0.4), (1.0, 1.0), (2.9, 3.0), (4.4, 6.0), (9.1, 10.0), (0.0, 1e-6)]
)
def test_the_end_of_an_axis_is_round(value, end):
    assert charts._rounded_up(value) == pytest.approx(end, rel=1e-12)
