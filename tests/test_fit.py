"""fit(): the optimum, on small models here and on real heads in test_fit_heads.py; bad input in words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import faceambig as fa
from faceambig.camera import Camera, project
from faceambig.fitting.result import FitOptions
from faceambig.fitting.solve import Solution, kkt_error, solve
from faceambig.fitting.start import start_pose
from faceambig.fitting.task import prepare
from faceambig.rotation import angles_from_rotation, rotation_matrix
from reference import trf
from strategies import face_of, tiny_model

MODEL = tiny_model(n_vertices=24, n_modes=6, seed=4)


def drawn(seed: int, noise_percent: float = 1.0, distance: float | None = 0.6) -> fa.Observation:
    rng = np.random.default_rng(seed)
    face = face_of(MODEL, rng.standard_normal(6))
    yaw, pitch, roll = rng.uniform((-40, -20, -20), (40, 20, 20))
    return fa.observe(
        face, distance=distance, scheme="all", yaw_deg=yaw, pitch_deg=pitch, roll_deg=roll,
        noise_percent=noise_percent, seed=seed,
    )  # fmt: skip


CAMERAS = [("perspective", 0.5), ("perspective", None), ("orthographic", None)]


@pytest.mark.parametrize(("camera", "distance"), CAMERAS)
@given(
    seed=st.integers(0, 10_000),
    lam=st.sampled_from([0.01, 1.0, 30.0]),
    box=st.sampled_from([0.5, 2.0, None]),
)
def test_no_optimiser_started_there_finds_a_lower_cost(camera, distance, seed, lam, box):
    options = FitOptions(box=box, prior_weight=lam, tolerance=1e-10)
    task = prepare(MODEL, drawn(seed), options)
    problem = task.problem
    if distance is None and camera == "perspective":
        problem = replace(problem, free_distance=True)
    kappa = {"orthographic": 0.0}.get(camera, 1.0 / (distance or 1.0))
    start = start_pose(task.problem, kappa)
    found = solve(problem, start, np.zeros(6), tolerance=1e-10)
    assert found.status == "converged"
    assert (np.abs(found.alpha) <= (box or np.inf)).all()
    assert kkt_error(problem, found) < 1e-4  # scaled gradient; cost is its square
    reference = trf(problem, Solution(np.zeros(6), start, 0.0, 0, fa.Status.STALLED))
    assert found.cost <= reference * (1 + 1e-6)  # the bound


def test_the_truth_is_found_again_without_noise_and_prior():
    alpha = np.array([0.5, -1.0, 0.3, 1.2, -0.4, 0.8])
    face = face_of(MODEL, alpha)
    obs = fa.observe(face, distance=0.6, scheme="all", yaw_deg=25, pitch_deg=-10, roll_deg=5)
    fit = fa.fit(MODEL, obs, distance=0.6, prior_weight=0.0, box=None, tolerance=1e-14)
    assert fit.converged
    assert (
        np.abs(fit.alpha - alpha).max() < 1e-6
    )  # zero-residual problem: quadratic convergence to rounding
    assert fit.d_l_percent < 1e-7
    assert np.abs(np.array(angles_from_rotation(fit.camera.R)) - (25, -10, 5)).max() < 1e-5
    assert fit.translation[2] == pytest.approx(0.6, rel=1e-12)
    assert np.abs(fit.projected() - obs.points).max() < 1e-6
    free = fa.fit(MODEL, obs, prior_weight=0.0, box=None, tolerance=1e-14)
    assert free.distance == pytest.approx(0.6, rel=1e-5)


@given(st.integers(0, 10_000))
def test_a_point_given_twice_equals_weight_two(seed):
    obs = drawn(seed)
    numbers = np.arange(24)
    weights = np.ones(24)
    weights[5] = 2.0
    weighted = fa.Observation(obs.points, numbers, obs.image_size, weights=weights)
    twice = fa.Observation(
        np.vstack([obs.points, obs.points[5:6]]), np.append(numbers, 5), obs.image_size
    )
    a, b = (
        fa.fit(MODEL, o, distance=0.6, prior_weight=1.0, tolerance=1e-12) for o in (weighted, twice)
    )
    assert a.cost == pytest.approx(b.cost, rel=1e-9)
    assert (
        np.abs(a.alpha - b.alpha).max() < 1e-4
    )  # lambda = 1 px^2 bounds the curvature from below: root of 1e-9 cost


@given(st.integers(0, 10_000))
def test_the_order_of_the_points_does_not_matter(seed):
    obs = drawn(seed)
    order = np.random.default_rng(seed).permutation(24)
    shuffled = fa.Observation(obs.points[order], order, obs.image_size)
    plain = fa.Observation(obs.points, np.arange(24), obs.image_size)
    a, b = (
        fa.fit(MODEL, o, distance=0.6, prior_weight=1.0, tolerance=1e-12) for o in (shuffled, plain)
    )
    assert a.cost == pytest.approx(b.cost, rel=1e-9)


@given(st.integers(0, 10_000), st.floats(0.2, 5.0))
def test_scaling_the_picture_scales_the_focal_length_alone(seed, factor):
    obs = drawn(seed)
    scaled = fa.Observation(obs.points * factor, "all", principal_point=tuple(obs.centre * factor))
    a = fa.fit(MODEL, obs, distance=0.6, tolerance=1e-12)
    b = fa.fit(MODEL, scaled, distance=0.6, tolerance=1e-12)
    assert b.focal == pytest.approx(a.focal * factor, rel=1e-4)
    assert b.cost == pytest.approx(a.cost * factor**2, rel=1e-8)
    assert b.d_l_percent == pytest.approx(a.d_l_percent, rel=1e-4)


def test_missing_points_are_left_out_and_still_projected():
    obs = drawn(1)
    points = obs.points.copy()
    points[[7, 9]] = np.nan
    fit = fa.fit(MODEL, fa.Observation(points, "all", obs.image_size), distance=0.6)
    assert fit.converged
    assert np.isnan(fit.residual[[7, 9]]).all()
    assert np.isfinite(fit.projected()).all()
    assert (
        np.abs(fit.projected()[7] - obs.points[7]).max() < 30
    )  # px of 100 between the eyes: near where it was


def test_a_missing_eye_corner_is_replaced_by_the_model_and_said():
    obs = drawn(1)
    points = obs.points.copy()
    points[0] = np.nan
    fit = fa.fit(MODEL, fa.Observation(points, "all", obs.image_size), distance=0.6)
    assert "eye corner is missing" in fit.interocular_meaning
    assert fit.interocular_px == pytest.approx(
        fa.fit(MODEL, obs, distance=0.6).interocular_px, rel=0.3
    )


def test_a_fit_that_ran_out_of_steps_does_not_say_converged():
    fit = fa.fit(MODEL, drawn(2), distance=0.6, max_steps=1)
    assert fit.status is fa.Status.MAX_STEPS
    assert not fit.converged


def test_damping_is_no_convergence():
    # a start far off in the curved valley of a weak prior: full steps are refused first (MATH.md 3 a, b)
    task = prepare(
        MODEL, drawn(3, noise_percent=0), FitOptions(prior_weight=1e-4, box=None, modes=6)
    )
    start = start_pose(task.problem, 1 / 0.2)
    turned = Camera(
        rotation_matrix(np.array([0.0, 2.2, 0.0])) @ start.R, start.t, 0.3 * start.s, start.kappa
    )
    found = solve(task.problem, turned, np.full(6, 3.0), tolerance=1e-9)
    assert found.status == "converged"
    assert kkt_error(task.problem, found) < 1e-4
    near = solve(task.problem, start, np.zeros(6), tolerance=1e-12)
    assert found.cost == pytest.approx(
        near.cost, rel=1e-9
    )  # measured 8e-11; a false stop was 3e-4 above


def test_the_cost_is_what_the_definition_says():
    obs = drawn(5)
    fit = fa.fit(MODEL, obs, distance=0.6, prior_weight=2.0)
    x = project(fit.camera, fit.vertices()) + obs.centre
    by_hand = np.sum((obs.points - x) ** 2) + 2.0 * np.sum(fit.alpha**2)
    assert fit.cost == pytest.approx(by_hand, rel=1e-12)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"distance": 0.1}, "distance: 0.1 m is not within 0.2"),
        ({"distance": float("nan")}, "distance: nan"),
        ({"distance": -1.0}, "distance: -1"),
        ({"camera": "fisheye"}, "camera: 'fisheye'"),
        ({"camera": "orthographic", "distance": 1.0}, "orthographic camera has none"),
        ({"modes": 0}, "modes: 0"),
        ({"box": -1.0}, "box: -1"),
        ({"noise_percent": float("nan")}, "noise_percent: nan"),
        ({"prior_weight": -1.0}, "prior_weight: -1"),
    ],
)
def test_bad_options_are_refused_by_name_and_value(change, words):
    with pytest.raises(ValueError, match=words):
        fa.fit(MODEL, drawn(1), **{"distance": 0.6} | change)


def test_bad_points_are_refused_by_name():
    line = np.stack([np.linspace(0, 100, 24), np.linspace(0, 50, 24)], axis=1)
    with pytest.raises(ValueError, match="one line"):
        fa.Observation(line, "all")
    few = np.full((24, 2), np.nan)
    few[:5] = np.random.default_rng(0).normal(size=(5, 2))
    with pytest.raises(ValueError, match="points: 5 visible"):
        fa.Observation(few, "all")
    with pytest.raises(ValueError, match=r"points: expected shape \(n, 2\)"):
        fa.Observation(np.zeros((24, 3)), "all")
    with pytest.raises(ValueError, match="finite"):
        fa.Observation(np.full((24, 2), np.inf), "all")
    with pytest.raises(ValueError, match="unknown scheme 'farkas'"):
        fa.fit(MODEL, fa.Observation(drawn(1).points, "farkas"), distance=1.0)
    with pytest.raises(ValueError, match="vertex 99"):
        fa.fit(MODEL, fa.Observation(drawn(1).points, np.full(24, 99)), distance=1.0)


def test_points_of_the_model_on_one_line_are_refused():
    straight = replace(MODEL, control_mean=np.outer(np.linspace(-0.1, 0.1, 24), [1.0, 0.2, 0.1]))
    with pytest.raises(ValueError, match="on the model they lie on one line"):
        fa.fit(straight, drawn(1), distance=0.6)


def test_noise_is_that_of_its_seed_and_size():
    face = face_of(MODEL, np.zeros(6))
    quiet = fa.observe(face, distance=1.0, scheme="all")
    a, b, c = (
        fa.observe(face, distance=1.0, scheme="all", noise_percent=2.0, seed=s) for s in (1, 1, 2)
    )
    assert np.array_equal(a.points, b.points)
    assert not np.array_equal(a.points, c.points)
    # 48 normal numbers of sd 2 px: the sample sd lies within 40 % with probability 1 - 1e-4
    assert np.std(a.points - quiet.points) == pytest.approx(2.0, rel=0.4)
