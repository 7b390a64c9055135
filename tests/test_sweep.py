"""sweep_distance(): the way along the distance changes no fit; far away is a limit; speed; intervals; bad input."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import faceambig as fa
from faceambig.fitting.tangent import tangent
from faceambig.fitting.task import prepare, solve_from, start_of
from faceambig.metrics import surface_difference
from faceambig.path import follow
from faceambig.rotation import axis_angle
from faceambig.sweep import END_TOLERANCE
from strategies import face_of, tiny_model

MODEL = tiny_model(n_vertices=24, n_modes=6, seed=4)
# The solver stops at 1e-8 of the cost above the optimum (`tolerance`), so two starts may end 1e-8 apart, seldom more
SAME_COST = 1e-7


def drawn(seed: int, distance: float = 0.5, noise: float = 1.0) -> fa.Observation:
    rng = np.random.default_rng(seed)
    return fa.observe(
        face_of(MODEL, rng.standard_normal(6)), distance=distance, scheme="all",
        yaw_deg=rng.uniform(-40, 40), pitch_deg=rng.uniform(-20, 20), noise_percent=noise, seed=seed,
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


def both_ways(model: fa.FaceModel, observation: fa.Observation, grid: np.ndarray, **options):
    """(fits of the path from far away, of the path from the nearest distance), each D + 1, far away first."""
    task = prepare(model, observation, fa.FitOptions(**options))
    kappas = [0.0, *(1 / np.sort(grid)[::-1]).tolist()]
    ends = [solve_from(task, *start_of(task, kappa)) for kappa in (0.0, kappas[-1])]
    return follow(task, kappas, ends[0]), follow(task, kappas[::-1], ends[1])[::-1]


@settings(max_examples=25)  # 25 x 26 fits
@given(
    seed=st.integers(0, 10_000),
    lam=st.sampled_from([0.01, 1.0]),
    noise=st.sampled_from([0.1, 1.0, 3.0]),
)
def test_the_path_is_the_same_both_ways(seed, lam, noise):
    grid = np.geomspace(0.25, 4.0, 12)
    there, back = both_ways(MODEL, drawn(seed, noise=noise), grid, prior_weight=lam)
    for a, b in zip(there, back, strict=True):
        assert a.converged
        assert b.converged
        assert a.cost == pytest.approx(b.cost, rel=SAME_COST)
    sweep = fa.sweep_distance(MODEL, drawn(seed, noise=noise), grid, prior_weight=lam)
    assert len(sweep.disagreed) == 0


@pytest.mark.parametrize("noise_percent", [0.1, 1.0])
def test_the_path_of_a_head_is_the_same_both_ways(embedded, noise_percent):
    observation = fa.observe(embedded.subject(7), distance=0.5, yaw_deg=-30, noise_percent=2)
    there, back = both_ways(
        embedded, observation, np.geomspace(0.2, 5, 20), noise_percent=noise_percent
    )
    for a, b in zip(there, back, strict=True):
        assert a.cost == pytest.approx(b.cost, rel=SAME_COST)


def test_where_two_ways_disagree_the_lower_cost_is_kept_and_said():
    # Two steps a fit are too few: what is reached then depends on the start
    observation, grid = drawn(3, noise=5.0), np.geomspace(0.25, 4.0, 6)
    options = {"prior_weight": 0.01, "max_steps": 2}
    there, back = both_ways(MODEL, observation, grid, **options)
    sweep = fa.sweep_distance(MODEL, observation, grid, **options)
    apart = [
        abs(a.cost - b.cost) > 1e-6 * min(a.cost, b.cost) for a, b in zip(there, back, strict=True)
    ]
    assert sum(apart) >= 2
    assert apart[0]  # even far away: the second way arrives there by itself
    assert sweep.disagreed.tolist() == [
        *(d for d, differs in zip(grid, apart[:0:-1], strict=True) if differs), np.inf
    ]  # fmt: skip
    for fit, a, b in zip((sweep.orthographic, *sweep.fits[::-1]), there, back, strict=True):
        assert fit.cost == pytest.approx(min(a.cost, b.cost), rel=1e-6)


@pytest.mark.parametrize("options", [{"method": "als"}, {"weighting": "algebraic"}])
def test_answers_that_are_no_optimum_have_no_second_direction_and_no_speed(options):
    sweep = fa.sweep_distance(MODEL, drawn(1), [0.4, 1.0], **options)
    assert len(sweep.disagreed) == 0
    with pytest.raises(ValueError, match="no optimum of E, its path has no speed"):
        sweep.speed_mm_per_octave()
    snls = fa.sweep_distance(MODEL, drawn(1), [0.4, 1.0], method="snls")
    joint = fa.sweep_distance(MODEL, drawn(1), [0.4, 1.0])
    assert snls.speed_mm_per_octave() == pytest.approx(joint.speed_mm_per_octave(), rel=1e-3)


def test_a_distance_given_twice_is_fitted_once():
    observation = drawn(2)
    sweep = fa.sweep_distance(MODEL, observation, [1.0, 0.3, 1.0, 0.3, 0.3])
    assert sweep.distances.tolist() == [0.3, 1.0]
    assert [fit.distance for fit in sweep.fits] == pytest.approx([0.3, 1.0], rel=1e-12)


def motion(before: fa.Fit, after: fa.Fit) -> np.ndarray:
    """(alpha, d, t_xy, log s) from one fit to another."""
    a, b = before.camera, after.camera
    d = axis_angle(b.R @ a.R.T)
    return np.concatenate([after.alpha - before.alpha, d, b.t - a.t, [np.log(b.s / a.s)]])


@settings(max_examples=25)
@given(
    seed=st.integers(0, 10_000),
    distance=st.sampled_from([0.3, 0.8, 3.0]),
    box=st.sampled_from([0.5, None]),
    weighted=st.booleans(),
)
def test_the_tangent_is_what_neighbouring_fits_differ_by(seed, distance, box, weighted):
    observation = drawn(seed, noise=3.0)
    if weighted:
        weights = np.random.default_rng(seed).uniform(0.2, 3, 24)
        observation = replace(observation, weights=weights)
    options = {"box": box, "prior_weight": 0.5, "tolerance": 1e-14, "max_steps": 1000}
    h = 1e-3  # the difference is right to h^2 of the third derivative, and to rounding of fits / h
    near, fit, far = (
        fa.fit(MODEL, observation, distance=distance * np.exp(x), **options) for x in (-h, 0, h)
    )
    held = [np.abs(f.alpha) >= (box or np.inf) for f in (near, fit, far)]
    if (held[0] != held[1]).any() or (held[1] != held[2]).any():
        return  # a coefficient reaches the box just here: no two-sided derivative
    difference = motion(near, far) / (2 * h)
    found = tangent(prepare(MODEL, observation, fit.options).problem, fit.camera, fit.alpha)
    # Fits stop within 1e-14 of E: 1e-7 of a standard deviation, over 2 h; measured 2e-4 at most
    assert np.linalg.norm(found - difference) < 1e-3 * np.linalg.norm(difference)
    assert (found[:6][held[1]] == 0).all()


def test_far_away_nothing_moves_with_the_distance():
    observation = drawn(1)
    fit = fa.fit(MODEL, observation, camera="orthographic")
    task = prepare(MODEL, observation, fit.options)
    assert (tangent(task.problem, fit.camera, fit.alpha) == 0).all()
    # alpha goes to its limit like 1 / t_z, so the speed falls by half with each doubling
    speeds = fa.sweep_distance(MODEL, observation, [50.0, 100.0, 200.0]).speed_mm_per_octave()
    assert speeds[:-1] / speeds[1:] == pytest.approx([2.0, 2.0], rel=0.02)


@pytest.mark.parametrize("model", ["embedded", "ict"])
def test_the_speed_is_how_fast_d_s_grows_between_neighbours(request, model):
    model = request.getfixturevalue(model)
    rng = np.random.default_rng(5)
    face = face_of(model, rng.standard_normal(model.n_modes))
    observation = fa.observe(face, distance=0.5, yaw_deg=10, noise_percent=1, seed=5)
    distances = np.array([0.3, 0.6, 1.5])
    speeds = fa.sweep_distance(model, observation, distances, tolerance=1e-12).speed_mm_per_octave()
    h = 2e-3
    for distance, speed in zip(distances, speeds, strict=True):
        near, far = (
            fa.fit(model, observation, distance=distance * 2**x, tolerance=1e-13, max_steps=500)
            for x in (-h, h)
        )
        gap = surface_difference(far.vertices(), near.vertices(), model.evaluation).mean_mm
        assert speed == pytest.approx(gap / (2 * h), rel=2e-3)  # the fits' own 1e-13 of the cost


def test_the_speed_belongs_to_the_path_and_not_to_the_grid(embedded, near):
    fine = fa.sweep_distance(embedded, near, np.geomspace(0.25, 2, 13))
    coarse = fa.sweep_distance(embedded, near, [0.25, 2.0])
    assert coarse.speed_mm_per_octave() == pytest.approx(
        fine.speed_mm_per_octave()[[0, -1]], rel=1e-3
    )
    assert (fine.speed_mm_per_octave() > 0.3).all()  # mm: the face changes, while d_L hardly does


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
    assert interval.pieces == 0
    # of the path, between the distances of the sweep too: at 1 % of the distance from the best d_L is flat
    fine = fa.sweep_distance(
        swept.fits[0].model, swept.fits[0].observation, np.geomspace(0.25, 0.32, 60)
    )
    assert interval.best_d_l_percent == pytest.approx(fine.d_l_percent.min(), rel=1e-4)
    assert interval.best_d_l_percent < swept.d_l_percent.min()


@pytest.mark.parametrize("distances", [[0.2, 1.0], [0.2, 0.9, 3.0], [0.2, 0.22, 3.0]])
def test_a_dip_between_two_distances_is_found(embedded, near, swept, distances):
    # no distance of these is below 0.4 %, d_L at 0.28 m is 0.373 %
    sweep = fa.sweep_distance(embedded, near, distances)
    assert sweep.d_l_percent.min() > 0.4
    interval, fine = sweep.interval(0.4), swept.interval(0.4)
    assert not interval.empty
    for end, fine_end in ((interval.low, fine.low), (interval.high, fine.high)):
        assert end is not None
        assert fine_end is not None
        assert abs(np.log(end / fine_end)) < 2 * END_TOLERANCE
    assert sweep.interval(0.36).empty
    assert sweep.interval(0.36).best_d_l_percent == pytest.approx(0.37298, abs=2e-5)


def test_a_dip_beyond_the_last_distance_is_found(embedded):
    # d_L of a photograph from 1.5 m turns beyond 60 cm, where the sweep ends, and ends higher at infinity
    observation = fa.observe(embedded.subject(1), distance=1.5)
    sweep = fa.sweep_distance(embedded, observation, np.geomspace(0.3, 0.6, 4))
    whole = fa.sweep_distance(embedded, observation, np.geomspace(0.3, 20, 120))
    ends = (sweep.d_l_percent[-1], whole.orthographic.d_l_percent)
    best = whole.d_l_percent.min()
    assert best < 0.98 * min(ends)
    tolerance = float(0.5 * (best + min(ends)))
    interval = sweep.interval(tolerance)
    inside = whole.distances[whole.d_l_percent <= tolerance]
    assert interval.low == pytest.approx(inside[0], rel=0.05)  # the grid of `whole` is 3.6 % wide
    assert interval.high == pytest.approx(inside[-1], rel=0.05)


def test_of_several_ranges_the_one_with_the_best_is_told_and_all_are_counted(embedded):
    # measured: d_L is 2.9931 % at 43.7 cm, 2.9939 % at 47 cm and 2.9932 % at 55 cm
    observation = fa.observe(
        embedded.subject(5), distance=1.0, yaw_deg=0.906, noise_percent=3, seed=4
    )
    sweep = fa.sweep_distance(embedded, observation, np.geomspace(0.2, 20, 60), noise_percent=0.1)
    interval = sweep.interval(2.9935)
    assert interval.pieces == 2
    assert interval.low is not None
    assert interval.high is not None
    assert interval.low < 0.437 < interval.high < 0.49

    def d_l(distance: float) -> float:
        return fa.fit(embedded, observation, distance=distance, noise_percent=0.1).d_l_percent

    assert d_l(0.437) < 2.9935
    assert d_l(0.55) < 2.9935
    assert d_l(0.487) > 2.9935
    assert sweep.interval(2.995).pieces == 1


@pytest.mark.parametrize("tolerance", [0, -1.0, float("nan"), float("inf")])
def test_a_tolerance_that_is_none_is_refused(swept, tolerance):
    with pytest.raises(ValueError, match=f"tolerance_percent: {tolerance:g} is not above 0 and"):
        swept.interval(tolerance)


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
