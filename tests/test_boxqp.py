"""The box QP of one step against trying every active set."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from faceambig.fitting.boxqp import solve_box_qp
from reference import box_qp_by_enumeration


def problem(
    seed: int, n: int, spread: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n + 2, n))
    low, high = -rng.uniform(0.1, 2, n), rng.uniform(0.1, 2, n)
    return A.T @ A + 1e-3 * np.eye(n), spread * rng.normal(size=n), low, high


@given(st.integers(0, 2**31), st.integers(1, 6), st.sampled_from([0.1, 1.0, 30.0]))
def test_it_finds_the_minimum_that_enumeration_finds(seed, n, spread):
    H, g, low, high = problem(seed, n, spread)
    d, _, solved, *_ = solve_box_qp(H, g, low, high, np.zeros(n, dtype=np.int8), 200)
    assert solved
    # two Cholesky solutions of the same small system: rounding times its condition (at most 1e5 here)
    assert np.abs(d - box_qp_by_enumeration(H, g, low, high)).max() < 1e-9


@given(st.integers(0, 2**31), st.integers(2, 40))
def test_any_first_guess_leads_to_the_same_minimum(seed, n):
    H, g, low, high = problem(seed, n, 10.0)
    guess = np.random.default_rng(seed + 1).integers(-1, 2, n).astype(np.int8)
    a, _, solved_a, *_ = solve_box_qp(H, g, low, high, guess, 1000)
    b, _, solved_b, *_ = solve_box_qp(H, g, low, high, np.zeros(n, dtype=np.int8), 1000)
    assert solved_a
    assert solved_b
    assert np.abs(a - b).max() < 1e-8


def test_it_ends_where_exchanging_whole_blocks_would_cycle():
    # 300 problems whose columns are nearly parallel: without the single exchange some cycle for ever
    for seed in range(300):
        rng = np.random.default_rng(seed)
        A = rng.normal(size=(8, 12)) + 3 * rng.normal(size=(8, 1))
        H = A.T @ A + 1e-6 * np.eye(12)
        g = 10 * rng.normal(size=12)
        _, _, solved, *_ = solve_box_qp(
            H, g, -np.ones(12), np.ones(12), np.zeros(12, dtype=np.int8), 5000
        )
        assert solved, seed


def test_a_capped_search_stays_inside_the_box():
    H, g, low, high = problem(3, 30, 100.0)
    d, _, solved, *_ = solve_box_qp(H, g, low, high, np.zeros(30, dtype=np.int8), 1)
    assert not solved
    assert (d >= low).all()
    assert (d <= high).all()


def test_a_matrix_that_is_not_positive_definite_is_said():
    with pytest.raises(np.linalg.LinAlgError):
        solve_box_qp(-np.eye(2), np.ones(2), -np.ones(2), np.ones(2), np.zeros(2, dtype=np.int8), 5)
