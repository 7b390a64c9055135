"""The benchmarks compare like with like: SciPy gets the exact derivative and reaches our optimum."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import faceambig as fa
from faceambig.fitting.problem import Problem
from faceambig.fitting.solve import solve
from faceambig.fitting.start import start_pose
from faceambig.fitting.task import prepare
from strategies import tiny_model

MODEL = tiny_model(n_vertices=24, n_modes=6, seed=4)


def problems_of(benchmarks, work: str) -> list[tuple[Problem, float]]:
    """Problems of the benchmarks' random photographs of a small model, and kappa of their starts."""
    answer = []
    for case in benchmarks("problems").drawn(MODEL, 8, points="all"):
        options = fa.FitOptions(prior_weight=case.prior_weight)
        problem = prepare(MODEL, case.observation, options).problem
        kappa = {"fixed": 1 / case.distance, "free": 1.0, "orthographic": 0.0}[work]
        answer.append((replace(problem, free_distance=work == "free"), kappa))
    return answer


@pytest.mark.parametrize("work", ["fixed", "free", "orthographic"])
def test_the_competitor_reaches_our_optimum(benchmarks, work):
    problems = benchmarks("problems")
    for problem, kappa in problems_of(benchmarks, work):
        start, zero = start_pose(problem, kappa), np.zeros(6)
        ours = solve(problem, start, zero)
        for derivative in ("analytic", "2-point"):
            found = problems.scipy_fit(problem, start, zero, derivative=derivative)
            assert abs(found.cost / ours.cost - 1) < 1e-6  # what the benchmarks ask of each case
        warm = problems.scipy_fit(problem, ours.camera, problems.inside(problem, ours.alpha))
        assert abs(warm.cost / ours.cost - 1) < 1e-6


@pytest.mark.parametrize("work", ["fixed", "free", "orthographic"])
def test_the_competitors_derivative_is_exact(benchmarks, work):
    rng = np.random.default_rng(3)
    for problem, kappa in problems_of(benchmarks, work)[:3]:
        stacked = benchmarks("problems").Stacked(problem, start_pose(problem, kappa), np.zeros(6))
        n = len(stacked.start)
        theta = stacked.start + rng.uniform(-1, 1, n) * np.r_[np.ones(6), np.full(n - 6, 0.05)]
        stacked.residual(theta)
        J = stacked.derivative(theta).copy()
        h = 6e-6  # the cube root of the rounding: central differences
        central = [
            (stacked.residual(theta + h * unit) - stacked.residual(theta - h * unit)) / (2 * h)
            for unit in np.eye(n)
        ]
        assert np.abs(J - np.transpose(central)).max() < 1e-6 * np.abs(J).max()


def test_a_plain_gauss_newton_reaches_it_with_both_derivatives(benchmarks):
    module = benchmarks("derivative")
    stacked_of = benchmarks("problems").Stacked
    for problem, kappa in problems_of(benchmarks, "fixed"):
        start = start_pose(problem, kappa)
        ours = solve(problem, start, np.zeros(6)).cost
        work = stacked_of(problem, start, np.zeros(6))
        exact = module.gauss_newton(work, lambda theta, _, w=work: w.derivative(theta))
        other = module.gauss_newton(work, lambda t, e, w=work: module.differences(w, t, e))
        assert abs(exact / ours - 1) < 1e-6
        assert abs(other / ours - 1) < 1e-6


def test_labels_are_moved_apart_and_keep_their_order(benchmarks):
    chart = benchmarks("chart")
    places = [10.0, 12.0, 11.0, 60.0]
    moved = chart.apart(places, 18.0)
    assert moved[3] == 60.0  # far from the others: it stays
    assert sorted(range(4), key=moved.__getitem__) == sorted(range(4), key=places.__getitem__)
    assert np.diff(sorted(moved)).min() >= 18.0 - 1e-9
    assert np.mean(moved[:3]) == pytest.approx(np.mean(places[:3]))  # as little as needed


def test_a_slope_is_that_of_the_power(benchmarks):
    x = np.geomspace(1, 1000, 7)
    low, high = benchmarks("growth").halves(x, np.where(x < 31, 31.0**0.5, x**0.5))
    assert high == pytest.approx(0.5, abs=0.01)  # the middle, 31.6, belongs to both halves
    assert low == pytest.approx(0.0, abs=0.01)
