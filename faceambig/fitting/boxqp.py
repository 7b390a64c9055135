"""Least value of a quadratic in a box: min 1/2 d^T H d - g^T d, low <= d <= high, H positive definite.

Block principal pivoting (Judice and Pires 1994; Kim and Park 2011): guess which variables sit on a bound, solve for the
others by Cholesky, exchange every one that violates its sign or its bound. Blocks of exchanges may cycle, so after
three rounds without progress one variable is exchanged at a time (Murty's least index rule), which cannot.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg import lapack

from ..arrays import Array

FREE, AT_LOW, AT_HIGH = 0, -1, 1
BLOCK_TRIES = 3  # rounds without fewer violations before exchanging one at a time


def solve_box_qp(
    H: Array,
    g: Array,
    low: Array,
    high: Array,
    active: np.ndarray,
    max_rounds: int,
    factors: dict[bytes, Array] | None = None,
    *,
    there: bool = False,
) -> tuple[Array, np.ndarray, bool]:
    """(d, active, solved): minimiser (n,), which bounds hold (-1, 0, 1), and whether it is exact.

    `active` (n,) int8 is the guess to start from, e.g. the last step's. Not solved within `max_rounds`: d is clipped to
    the box, feasible but not optimal. `factors` keeps what was factored of H, for another g or other bounds. `there`
    says that d = 0 lies on every bound of the guess.
    """
    factors = {} if factors is None else factors
    n, scale = len(g), 1e-12 * math.sqrt(g @ g) + 1e-300
    fewest, tries = n + 1, BLOCK_TRIES
    d = np.zeros(n)
    for _ in range(max_rounds):
        free = active == FREE
        chosen = free.nonzero()[0]
        if len(chosen) < n:
            pull = g
            if not there:
                d = np.where(free, 0.0, np.where(active > 0, high, low))
                pull = g - H @ d
            d[chosen] = _solve(H, chosen, pull[chosen], chosen.tobytes(), factors)
            slope = g - H @ d  # > 0: a larger d_j would lower the cost
            room = np.minimum(d - low, high - d)
            wrong = np.where(free, room, active * slope + scale) < 0
        else:
            d = _solve(H, None, g, b"", factors)
            wrong = (d < low) | (d > high)
        there = False
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
        # Bounds that hold against the slope are given up, variables out of the box held
        beyond = (d > high).astype(np.int8) - (d < low)
        active = np.where(wrong, np.where(active, FREE, beyond), active)
    return np.clip(d, low, high), active, False


def _solve(
    H: Array, chosen: np.ndarray | None, g: Array, name: bytes, factors: dict[bytes, Array]
) -> Array:
    """Solution for the chosen variables (None: all) by Cholesky, the factor taken from or put under `name`."""
    if not len(g):  # every variable on a bound
        return g
    if name not in factors:
        part = H if chosen is None else H.take(chosen, 0).take(chosen, 1)
        # .T of a C-ordered symmetric matrix is the Fortran order LAPACK wants: no transposed copy
        factor, info = lapack.dpotrf(part.T, clean=0)
        if info != 0:
            raise np.linalg.LinAlgError(f"leading minor {info} is not positive definite")
        factors[name] = factor
    return lapack.dpotrs(factors[name], g)[0]
