"""sweep_distance(): the way along the distance changes no fit; far away is a limit; interval ends; bad input."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import faceambig as fa
from faceambig.sweep import END_TOLERANCE
from strategies import face_of, tiny_model

MODEL = tiny_model(n_vertices=24, n_modes=6, seed=4)
# The solver stops at 1e-8 of the cost above the optimum (`tolerance`), so two starts may end 1e-8 apart, seldom more
SAME_COST = 1e-7


def drawn(seed: int, distance: float = 0.5) -> fa.Observation:
    rng = np.random.default_rng(seed)
    return fa.observe(
        face_of(MODEL, rng.standard_normal(6)), distance=distance, scheme="all",
        yaw_deg=rng.uniform(-40, 40), pitch_deg=rng.uniform(-20, 20), noise_percent=1.0, seed=seed,
    )  # fmt: skip


@pytest.fixture(scope="module")
def near(embedded: fa.FaceModel) -> fa.Observation:
    """A photograph from 30 cm: d_L is least there and grows with the distance."""
    return fa.observe(embedded.subject(1), distance=0.3)


@pytest.fixture(scope="module")
def swept(embedded: fa.FaceModel, near: fa.Observation) -> fa.Sweep:
    return fa.sweep_distance(embedded, near)


@pytest.mark.parametrize("pose", [{}, {"yaw_deg": 35, "pitch_deg": -10, "noise_percent": 2}])
def test_every_fit_costs_what_a_cold_fit_at_its_distance_costs(embedded, pose):
    observation = fa.observe(embedded.subject(2), distance=0.6, **pose)
    sweep = fa.sweep_distance(embedded, observation)
    assert np.allclose(sweep.distances[[0, -1]], (0.2, 3.0), rtol=1e-12, atol=0)
    for distance, fit in zip(sweep.distances, sweep.fits, strict=True):
        cold = fa.fit(embedded, observation, distance=float(distance))
        assert fit.converged
        assert fit.distance == pytest.approx(distance, rel=1e-12)
        assert fit.cost == pytest.approx(cold.cost, rel=SAME_COST)
    far = fa.fit(embedded, observation, camera="orthographic")
    assert sweep.orthographic.cost == pytest.approx(far.cost, rel=SAME_COST)
    assert sweep.orthographic.distance is None


@settings(max_examples=25)  # 25 x 14 fits
@given(seed=st.integers(0, 10_000), steps=st.integers(1, 7), reach=st.sampled_from([1.1, 20.0]))
def test_neither_the_density_nor_the_order_of_the_distances_matters(seed, steps, reach):
    observation = drawn(seed)
    distances = np.geomspace(0.25, 0.25 * reach, steps)
    shuffled = np.random.default_rng(seed).permutation(distances)
    sweep = fa.sweep_distance(MODEL, observation, shuffled)
    assert (np.diff(sweep.distances) > 0).all()
    for distance, fit in zip(sweep.distances, sweep.fits, strict=True):
        cold = fa.fit(MODEL, observation, distance=float(distance))
        assert fit.cost == pytest.approx(cold.cost, rel=SAME_COST)


def test_options_are_those_of_fit(embedded, near):
    options = {"modes": 20, "box": 3.0, "noise_percent": 0.5, "tolerance": 1e-6, "max_steps": 50}
    (fit,) = fa.sweep_distance(embedded, near, [1.2], **options).fits
    assert fit.options == fa.FitOptions(**options)
    assert fit.alpha.shape == (20,)


def test_far_away_the_cost_comes_near_to_the_orthographic_one_like_one_over_the_distance(
    embedded, near
):
    # E(t_z) - E_ortho = c / t_z + O(1 / t_z^2) (MATH.md 6)
    def gap(distance: float) -> float:
        return fa.fit(embedded, near, distance=distance, tolerance=1e-13).cost - far.cost

    far = fa.fit(embedded, near, camera="orthographic", tolerance=1e-13)
    c = 1e4 * gap(1e4)  # its own 1 / t_z^2 term is 4e-5 of it
    # measured for this face 0.39, 0.41, 0.40 m: c belongs to the limit, the next term to the head's size
    excess = [t * (1 - t * gap(t) / c) for t in (5.0, 20.0, 100.0)]
    assert np.allclose(excess, 0.4, rtol=0, atol=0.05)
    sweep = fa.sweep_distance(embedded, near, [5, 20, 100])
    assert np.allclose(
        [
            t * (f.cost - sweep.orthographic.cost)
            for t, f in zip((5, 20, 100), sweep.fits, strict=True)
        ],
        [t * gap(t) for t in (5.0, 20.0, 100.0)],
        rtol=1e-3,
        atol=0,  # at 100 m the gap is 0.4 % of a cost that is known to 1e-8
    )


@pytest.mark.parametrize("tolerance", [0.38, 0.42, 0.5, 0.8])
def test_the_ends_of_an_interval_are_where_d_l_reaches_the_tolerance(
    embedded, near, swept, tolerance
):
    interval = swept.interval(tolerance)
    assert not interval.empty
    assert interval.tolerance_percent == tolerance
    assert interval.best_d_l_percent == swept.d_l_percent.min()
    for end, outward in (
        (interval.low, 1 / (1 + END_TOLERANCE)),
        (interval.high, 1 + END_TOLERANCE),
    ):
        if end is None:  # open: the whole sweep on that side is inside
            assert outward < 1
            assert swept.fits[0].d_l_percent <= tolerance
            continue
        assert fa.fit(embedded, near, distance=end).d_l_percent <= tolerance * (1 + 1e-6)
        if end * outward >= 0.2:  # nearer there is no fit
            assert fa.fit(embedded, near, distance=end * outward).d_l_percent > tolerance


def test_an_end_between_two_far_neighbours_is_found_as_exactly(embedded, near, swept):
    coarse = fa.sweep_distance(embedded, near, [0.3, 3.0]).interval(0.5)
    assert coarse.low is None  # d_L at 0.3 m, the nearest that was asked for, is inside
    fine = swept.interval(0.5)
    assert coarse.high is not None
    assert fine.high is not None
    assert abs(np.log(coarse.high / fine.high)) < 2 * END_TOLERANCE  # each lies 1 % inside


def test_an_interval_is_open_at_infinity_where_the_far_away_camera_is_inside(swept):
    interval = swept.interval()
    assert interval.tolerance_percent == 3.0
    assert (interval.low, interval.high, interval.empty) == (None, None, False)


def test_an_end_beyond_the_sweep_is_not_called_infinity(embedded, near, swept):
    # d_L is 0.92 % at 3 m, where the sweep ends, and 1.07 % for the far-away camera
    tolerance = 1.0
    assert swept.d_l_percent[-1] < tolerance < swept.orthographic.d_l_percent
    high = swept.interval(tolerance).high
    assert high is not None
    assert high > 3.0
    assert fa.fit(embedded, near, distance=high).d_l_percent <= tolerance * (1 + 1e-6)
    beyond = fa.fit(embedded, near, distance=high * (1 + END_TOLERANCE))
    assert beyond.d_l_percent > tolerance


def test_an_interval_that_begins_beyond_the_sweep_is_found(embedded):
    # A photograph from far away, swept near: no distance tried is inside, all far ones are
    observation = fa.observe(embedded.subject(1), distance=5.0)
    sweep = fa.sweep_distance(embedded, observation, np.geomspace(0.2, 0.6, 9))
    tolerance = 0.5 * (sweep.d_l_percent[-1] + sweep.orthographic.d_l_percent)
    assert sweep.d_l_percent.min() > tolerance > sweep.orthographic.d_l_percent
    interval = sweep.interval(tolerance)
    assert not interval.empty
    assert interval.high is None
    assert interval.low is not None
    assert interval.low > 0.6
    assert fa.fit(embedded, observation, distance=interval.low).d_l_percent <= tolerance * (
        1 + 1e-6
    )
    nearer = fa.fit(embedded, observation, distance=interval.low / (1 + END_TOLERANCE))
    assert nearer.d_l_percent > tolerance


def test_an_empty_interval_says_the_best_there_is(swept):
    interval = swept.interval(0.1)
    assert interval.empty
    assert interval.low is interval.high is None
    assert interval.best_d_l_percent == swept.d_l_percent.min()


def test_the_nearest_fit_is_nearest_in_ratio(swept):
    for distance in (0.01, 0.2, 0.449, 1.2, 50.0):
        found = swept.nearest(distance).distance
        assert found == min(swept.distances, key=lambda d: abs(np.log(d / distance)))


def test_a_sweep_cannot_be_written_to(swept):
    with pytest.raises(ValueError, match="read-only"):
        swept.distances[0] = 1.0
    assert not replace(swept).distances.flags.writeable


@pytest.mark.parametrize(
    ("distances", "words"),
    [
        ([], "distances: at least one"),
        ([0.1, 1.0], "distances: 0.1 to 1 m is not within 0.2"),
        ([1.0, 1e7], r"distances: 1 to 1e\+07 m is not within"),
        ([-1.0], "distances: -1"),
        ([0.5, np.nan], "distances: every value must be finite"),
        ([[0.5, 1.0]], r"distances: expected shape \(n\), found \(1, 2\)"),
        ("abc", "distances: expected numbers"),
    ],
)
def test_bad_distances_are_refused_by_name_and_value(distances, words):
    with pytest.raises(ValueError, match=words):
        fa.sweep_distance(MODEL, drawn(1), distances)
