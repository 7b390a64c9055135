"""Least value of a quadratic in a box: min 1/2 d^T H d - g^T d, low <= d <= high, H positive definite.

Block principal pivoting (Judice and Pires 1994; Kim and Park 2011): guess which variables sit on a bound, solve for the
others by Cholesky, exchange every one that violates its sign or its bound. Blocks of exchanges may cycle, so after
three rounds without progress one variable is exchanged at a time (Murty's least index rule), which cannot.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import lapack

from ..arrays import Array

FREE, AT_LOW, AT_HIGH = 0, -1, 1
BLOCK_TRIES = 3  # rounds without fewer violations before exchanging one at a time


def solve_box_qp(
    H: Array, g: Array, low: Array, high: Array, active: np.ndarray, max_rounds: int
) -> tuple[Array, np.ndarray, bool]:
    """(d, active, solved): minimiser (n,), which bounds hold (-1, 0, 1), and whether it is exact.

    `active` (n,) is the guess to start from, e.g. the last step's. Not solved within `max_rounds`: d is clipped to the
    box, feasible but not optimal.
    """
    n, scale = len(g), 1e-12 * float(np.abs(g).max(initial=1e-300))
    fewest, tries = n + 1, BLOCK_TRIES
    d = np.zeros(n)
    for _ in range(max_rounds):
        free = active == FREE
        if free.all():
            d = _solve(H, g)
            below, above, leave = d < low, d > high, ~free
        else:
            d = np.where(active == AT_LOW, low, np.where(active == AT_HIGH, high, 0.0))
            rows = H[free]
            d[free] = _solve(rows[:, free], g[free] - rows @ d)
            slope = g - H @ d  # > 0: a larger d_j would lower the cost
            below, above = free & (d < low), free & (d > high)
            leave = ((active == AT_LOW) & (slope > scale)) | (
                (active == AT_HIGH) & (slope < -scale)
            )
        wrong = below | above | leave
        count = int(np.count_nonzero(wrong))
        if count == 0:
            return d, active, True
        if count < fewest:
            fewest, tries = count, BLOCK_TRIES
        elif tries > 0:
            tries -= 1
        else:
            last = int(np.flatnonzero(wrong)[-1])
            wrong = np.zeros(n, dtype=bool)
            wrong[last] = True
        active = active.copy()
        active[wrong & below] = AT_LOW
        active[wrong & above] = AT_HIGH
        active[wrong & leave] = FREE
    return np.clip(d, low, high), active, False


def _solve(H: Array, g: Array) -> Array:
    if not len(g):  # every variable on a bound
        return g
    # H.T of a C-ordered symmetric matrix is the Fortran order LAPACK wants: no transposed copy
    _, d, info = lapack.dposv(H.T, g)
    if info != 0:
        raise np.linalg.LinAlgError(f"leading minor {info} is not positive definite")
    return d
