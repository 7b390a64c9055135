"""Least value of a quadratic in a box: min 1/2 d^T H d - g^T d, low <= d <= high, H positive definite.

Block principal pivoting (Judice and Pires 1994; Kim and Park 2011): guess which variables sit on a bound, solve for the
others by Cholesky, exchange every one that violates its sign or its bound. Blocks of exchanges may cycle, so after
three rounds without progress one variable is exchanged at a time (Murty's least index rule), which cannot.

`box_qp` is the method and asks for passes; `solve_box_qp` answers for one problem, `passes` for many at once.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import lapack

from ..arrays import Array

FREE, AT_LOW, AT_HIGH = 0, -1, 1
BLOCK_TRIES = 3  # rounds without fewer violations before exchanging one at a time


class Pass(NamedTuple):
    """Asks for the minimiser with some variables held on their bounds, and which of them are wrong there."""

    H: Array  # (n, n)
    g: Array  # (n,)
    low: Array  # (n,)
    high: Array  # (n,)
    active: np.ndarray  # (n,) int8: which bounds hold
    there: bool  # d = 0 lies on every bound that holds
    slack: float  # a slope that rounding can make
    factors: dict[bytes, Array]  # of H's free parts, by name: for another g or other bounds


Passed = (
    tuple[Array, np.ndarray, int] | None
)  # d, wrong (n,), their number; None: not positive definite


def box_qp(
    H: Array,
    g: Array,
    low: Array,
    high: Array,
    active: np.ndarray,
    max_rounds: int,
    factors: dict[bytes, Array],
    there: bool,
) -> Generator[Pass, Passed, tuple[Array, np.ndarray, bool]]:
    """(d, active, solved) as `solve_box_qp`, for whoever answers its passes."""
    n, slack = len(g), 1e-12 * math.sqrt(g @ g) + 1e-300
    fewest, tries = n + 1, BLOCK_TRIES
    d = np.zeros(n)
    for _ in range(max_rounds):
        passed = yield Pass(H, g, low, high, active, there, slack, factors)
        if passed is None:
            raise np.linalg.LinAlgError("H is not positive definite")
        d, wrong, count = passed
        there = False
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


def solve_box_qp(
    H: Array, g: Array, low: Array, high: Array, active: np.ndarray, max_rounds: int
) -> tuple[Array, np.ndarray, bool]:
    """(d, active, solved): minimiser (n,), which bounds hold (-1, 0, 1), and whether it is exact.

    `active` (n,) int8 is the guess to start from, e.g. the last step's. Not solved within `max_rounds`: d is clipped to
    the box, feasible but not optimal. LinAlgError if H is not positive definite.
    """
    work = box_qp(H, g, low, high, active, max_rounds, {}, False)
    asked = next(work)
    while True:
        try:
            asked = work.send(one_pass(asked))
        except StopIteration as end:
            return end.value


def one_pass(asked: Pass) -> Passed:
    """The answer to one pass."""
    H, g, low, high, active, there, slack, factors = asked
    free = active == FREE
    d = np.zeros(len(g)) if there else _held(low, high, active, free)
    slope = _solve_free(H, g, free, d, there, factors)
    if slope is None:
        return None
    if slope is g:  # nothing held
        wrong = (d < low) | (d > high)
    else:
        wrong = _wrong(low, high, active, slack, free, d, slope)
    return d, wrong, int(np.count_nonzero(wrong))


def passes(asked: Sequence[Pass]) -> list[Passed]:
    """The answers to many, what is not linear algebra computed together."""
    H, g, *limits, there, slack, factors = zip(*asked, strict=True)
    low, high, active = map(np.stack, limits)
    free = active == FREE
    d = _held(low, high, active, free)
    slopes = list(map(_solve_free, H, g, free, d, there, factors))
    slope = np.stack([g[0] if each is None else each for each in slopes])
    wrong = _wrong(low, high, active, np.array(slack)[:, None], free, d, slope)
    rows = zip(d, wrong, np.count_nonzero(wrong, axis=1).tolist(), strict=True)
    return [None if each is None else row for each, row in zip(slopes, rows, strict=True)]


def _held(low: Array, high: Array, active: np.ndarray, free: np.ndarray) -> Array:
    """d (..., n) of the variables on bounds, zero for the free ones."""
    return np.where(free, 0.0, np.where(active > 0, high, low))


def _solve_free(
    H: Array, g: Array, free: np.ndarray, d: Array, there: bool, factors: dict[bytes, Array]
) -> Array | None:
    """Writes the free variables into d (n,); returns g - H d, > 0 where a larger d_j would lower the cost, or None."""
    chosen = free.nonzero()[0]
    everything = len(chosen) == len(g)
    if len(chosen):
        name = chosen.tobytes()
        factor = factors.get(name)
        if factor is None:
            part = H if everything else H.take(chosen, 0).take(chosen, 1)
            # .T of a C-ordered symmetric matrix is the Fortran order LAPACK wants: no transposed copy
            factor, info = lapack.dpotrf(part.T, clean=0)
            if info != 0:
                return None
            factors[name] = factor
        if everything:
            d[:] = lapack.dpotrs(factor, g)[0]
            return g
        pull = g if there else g - H @ d
        d[chosen] = lapack.dpotrs(factor, pull[chosen])[0]
    return g - H @ d


def _wrong(
    low: Array,
    high: Array,
    active: np.ndarray,
    slack: Array | float,
    free: np.ndarray,
    d: Array,
    slope: Array,
) -> np.ndarray:
    """(..., n) True: a free variable out of the box, or a bound that holds against the slope."""
    return np.where(free, np.minimum(d - low, high - d), active * slope + slack) < 0
