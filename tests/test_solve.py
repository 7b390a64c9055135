"""The solver's parts: H and g against their definitions, one face and many alike, batches that survive a bad face."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import faceambig as fa
from faceambig.camera import jacobian, project
from faceambig.fitting.problem import Problem, evaluate, gradient, normal_equations
from faceambig.fitting.solve import Solution, kkt_error, solve
from faceambig.fitting.start import start_pose
from faceambig.fitting.task import prepare
from strategies import cameras, face_of, tiny_model

MODEL = tiny_model(n_vertices=24, n_modes=6, seed=4)


def problem_of(seed: int, lam: float, *, weighted: bool, free: bool) -> Problem:
    rng = np.random.default_rng(seed)
    observation = fa.observe(
        face_of(MODEL, rng.standard_normal(6)), distance=0.6, scheme="all", noise_percent=1.0
    )
    if weighted:
        observation = replace(observation, weights=rng.uniform(0.1, 3.0, 24))
    problem = prepare(MODEL, observation, fa.FitOptions(prior_weight=lam)).problem
    return replace(problem, free_distance=free)


@given(
    seed=st.integers(0, 10_000),
    camera=cameras(),
    lam=st.sampled_from([0.0, 0.01, 1.0]),
    weighted=st.booleans(),
    free=st.booleans(),
)
def test_the_normal_equations_are_those_of_the_weighted_jacobian(seed, camera, lam, weighted, free):
    problem = problem_of(seed, lam, weighted=weighted, free=free)
    alpha = np.random.default_rng(seed).uniform(-2, 2, 6)
    point = evaluate(problem, camera.view, alpha)
    H, g = normal_equations(problem, *point[:4])
    J = jacobian(camera, MODEL.vertices(alpha), problem.modes)[:, :, : problem.unknowns]
    prior = np.zeros(problem.unknowns)
    prior[:6] = max(lam, 1e-10)
    by_hand = np.einsum("lij,l,lik->jk", J, problem.weights, J) + np.diag(prior)
    assert np.abs(H - by_hand).max() < 1e-12 * np.abs(by_hand).max()
    down = np.einsum("lij,l,li->j", J, problem.weights, point.e)
    down[:6] -= lam * alpha
    scale = np.sqrt(np.diag(by_hand)) * np.sqrt(point.cost)  # of a gradient: |J_j| |e|
    assert (np.abs(g - down) < 1e-12 * scale).all()
    # without J, each residual carried back to the model: the same numbers in another order
    assert (np.abs(gradient(problem, *point[:4]) - down) < 1e-12 * scale).all()


def test_a_start_behind_the_camera_is_refused():
    problem = problem_of(1, 1.0, weighted=False, free=False)
    start = start_pose(problem, 1.0)
    with pytest.raises(ValueError, match="behind the camera at the start"):
        solve(problem, replace(start, kappa=100.0), np.zeros(6))


def test_a_start_on_the_box_that_is_right_costs_no_search():
    problem = replace(problem_of(3, 0.01, weighted=False, free=False), box=0.5)
    found = solve(problem, start_pose(problem, 1 / 0.6), np.zeros(6), tolerance=1e-12)
    assert (np.abs(found.alpha) == 0.5).any()  # else this says nothing
    again = solve(problem, found.camera, found.alpha, tolerance=1e-8)
    assert again.steps == 1
    assert again.status == "converged"


@pytest.mark.parametrize("camera", ["perspective", "orthographic"])
@pytest.mark.parametrize(("points", "modes"), [(6, 1), (6, 100), (68, 1), (68, 100), (14159, 100)])
def test_six_points_or_all_vertices_one_mode_or_all(embedded, camera, points, modes):
    rng = np.random.default_rng(points + modes)
    alpha = np.zeros(100)
    alpha[:modes] = rng.uniform(-1.5, 1.5, modes)
    face = face_of(embedded, alpha)
    where = {6: embedded.scheme("ibug68").vertices[[8, 30, 36, 45, 48, 54]]}.get(
        points, embedded.scheme("ibug68").vertices if points == 68 else np.arange(points)
    )
    seen = fa.observe(face, distance=0.6 if camera == "perspective" else None, yaw_deg=20)
    view = fa.fit(embedded, seen, distance=0.6 if camera == "perspective" else None, camera=camera)
    x = project(view.camera, face.vertices[where]) + rng.normal(scale=0.2, size=(len(where), 2))
    observation = fa.Observation(x, where, principal_point=(0.0, 0.0))
    fit = fa.fit(
        embedded, observation, camera=camera, distance=0.6 if camera == "perspective" else None,
        modes=modes, box=3.0, prior_weight=0.04,
    )  # fmt: skip
    assert fit.converged
    task = prepare(embedded, observation, fit.options)
    found = Solution(fit.alpha, fit.camera, fit.cost, fit.steps, fit.status)
    assert kkt_error(task.problem, found) < 1e-4  # scaled gradient; cost is its square
    if points == 14159:
        assert np.abs(fit.alpha - alpha).max() < 0.3  # noise of 0.2 px over 28,318 coordinates
