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


class Passed(NamedTuple):
    """The answer."""

    d: Array  # (n,)
    wrong: np.ndarray  # (n,) bool: free and out of the box, or held against the slope
    n_wrong: int
    gd: float  # g . d
    promised: float  # g . d - d . H d / 2, how much lower the quadratic lies at d than at 0


class Step(NamedTuple):
    """Where the quadratic is least in the box."""

    d: Array  # (n,)
    active: np.ndarray  # (n,) int8: which bounds hold (-1, 0, 1)
    solved: bool  # exact; else d is clipped to the box, feasible but not optimal
    gd: float  # g . d
    promised: float  # g . d - d . H d / 2


def box_qp(
    H: Array,
    g: Array,
    low: Array,
    high: Array,
    active: np.ndarray,
    max_rounds: int,
    factors: dict[bytes, Array],
    there: bool,
) -> Generator[Pass, Passed | None, Step]:
    """As `solve_box_qp`, for whoever answers its passes, with None where H is not positive definite."""
    n, slack = len(g), 1e-12 * math.sqrt(g @ g) + 1e-300
    fewest, tries = n + 1, BLOCK_TRIES
    d = np.zeros(n)
    for _ in range(max_rounds):
        passed = yield Pass(H, g, low, high, active, there, slack, factors)
        if passed is None:
            raise np.linalg.LinAlgError("H is not positive definite")
        d, wrong, count, gd, promised = passed
        there = False
        if count == 0:
            return Step(d, active, True, gd, promised)
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
    d = np.clip(d, low, high)
    gd = float(g @ d)
    return Step(d, active, False, gd, gd - 0.5 * float(d @ (H @ d)))


def solve_box_qp(
    H: Array, g: Array, low: Array, high: Array, active: np.ndarray, max_rounds: int
) -> Step:
    """The minimiser of the quadratic in the box, searched for within `max_rounds`.

    `active` (n,) int8 is the guess to start from, e.g. the last step's. LinAlgError if H is not positive definite.
    """
    work = box_qp(H, g, low, high, active, max_rounds, {}, False)
    asked = next(work)
    while True:
        try:
            asked = work.send(one_pass(asked))
        except StopIteration as end:
            return end.value


def one_pass(asked: Pass) -> Passed | None:
    """The answer to one pass."""
    H, g, low, high, active, there, slack, factors = asked
    free = active == FREE
    d = np.zeros(len(g)) if there else _held(low, high, active, free)
    slope = _solve_free(H, g, free, d, there, factors)
    if slope is None:
        return None
    gd = float(g @ d)
    if slope is g:  # nothing held, g - H d = 0
        wrong, promised = (d < low) | (d > high), 0.5 * gd
    else:
        wrong = _wrong(low, high, active, slack, free, d, slope)
        promised = 0.5 * (gd + float(slope @ d))
    return Passed(d, wrong, int(np.count_nonzero(wrong)), gd, promised)


def passes(asked: Sequence[Pass]) -> list[Passed | None]:
    """The answers to many, what is not linear algebra computed together."""
    H, g, *limits, there, slack, factors = zip(*asked, strict=True)
    low, high, active = map(np.stack, limits)
    free = active == FREE
    d = _held(low, high, active, free)
    slopes = list(map(_solve_free, H, g, free, d, there, factors))
    slope = np.stack([d[0] if each is None else each for each in slopes])
    wrong = _wrong(low, high, active, np.array(slack)[:, None], free, d, slope)
    gd = np.vecdot(np.stack(g), d)
    promised = 0.5 * (gd + np.where(free.all(axis=1), 0.0, np.vecdot(slope, d)))
    counts = np.count_nonzero(wrong, axis=1)
    rows = map(Passed, d, wrong, counts.tolist(), gd.tolist(), promised.tolist())
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
            factor, info = lapack.dpotrf(part.T, lower=1, clean=0, overwrite_a=not everything)
            if info != 0:
                return None
            factors[name] = factor
        if everything:
            d[:] = lapack.dpotrs(factor, g, lower=1)[0]
            return g
        pull = g if there else g - H @ d
        d[chosen] = lapack.dpotrs(factor, pull[chosen], lower=1)[0]
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
