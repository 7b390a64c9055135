"""The largest change that linear landmarks allow: convex-concave steps from several starts.

A step maximises a tangent c . d within the box and the landmarks' ellipsoid: the box QP's answer for one multiplier.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import eigh, lapack

from ..arrays import Array
from ..fitting.boxqp import solve_box_qp
from .marks import Marks

CLIMB, CLIMBS = 1e-4, 60  # least relative gain of a convex-concave step, and most steps
EXACT = 1e-6  # of the squared tolerance: how far below it the multiplier may leave the landmarks
QP_ROUNDS = 60
GROWTH = 8.0  # most a pace grows at once: bounds are followed, not guessed
# Of the mean curvature, step by step: with less, modes that the landmarks hardly see send the first box QP's search of
# active bounds far astray; a step's answer is the next one's guess. The last changes no face by 0.01 mm
RIDGES = (1e-2, 1e-3, 1e-4, 1e-5)


def farthest(
    marks: Marks, H: Array, c: Array, low: Array, high: Array, pace: float, active: np.ndarray
) -> tuple[Array, float, np.ndarray]:
    """d of the largest c . d within the box and the tolerance; and its pace and active bounds, for a neighbouring c.

    With p, the pace, 1 / the multiplier of the landmarks, d(p) is the box QP's answer to H, p c - Pi^T r. As long as no
    bound changes it is linear in p, so the landmarks' square is a parabola, and it only grows. The parabola's root is
    the next p, kept within a bracket.
    """
    c = c / np.linalg.norm(c)
    d = np.where(c > 0, high, low)
    if marks.excess(d) <= 1:  # the landmarks hold nothing back
        return d, pace, np.sign(c).astype(np.int8)
    lowest, highest, best = 0.0, np.inf, np.zeros(len(c))
    for _ in range(60):
        d, bounds, solved, *_ = solve_box_qp(H, pace * c - marks.pull, low, high, active, QP_ROUNDS)
        gap = marks.r + marks.Pi @ d
        square = float(gap @ gap)
        if not solved:  # says nothing about larger paces: come nearer to where the bounds are known
            pace = 0.5 * (lowest + pace)
            continue
        active = bounds
        if square <= 1:
            lowest, best = pace, d
            if square >= 1 - EXACT:
                break
        else:
            highest = pace
        if highest - lowest < 1e-13 * highest:
            break
        pace = _next_pace(marks, H, c, active == 0, gap, pace, lowest, highest)
    return best, lowest or pace, active


def _next_pace(
    marks: Marks,
    H: Array,
    c: Array,
    free: np.ndarray,
    gap: Array,
    pace: float,
    lowest: float,
    highest: float,
) -> float:
    chosen = free.nonzero()[0]
    new = np.nan
    if len(chosen):
        *_, way, info = lapack.dposv(H[np.ix_(chosen, chosen)], c[chosen], lower=1)
        if info == 0:
            along = marks.Pi[:, chosen] @ way
            a, b = float(along @ along), float(gap @ along)
            rest = float(gap @ gap) - (1 - 0.5 * EXACT)
            root = b * b - a * rest
            if root >= 0 and a > 0:
                new = pace + (-b + np.sqrt(root)) / a
    if highest < np.inf:
        return new if lowest < new < highest else 0.5 * (lowest + highest)
    return float(min(new, GROWTH * pace)) if new > pace else GROWTH * pace


def climb(marks: Marks, G: Array, low: Array, high: Array, c: Array) -> Array:
    """A local maximum of d^T G d by convex-concave steps: the first of them along c, the others along G d."""
    d, value = np.zeros(len(c)), 0.0
    if not c.any():
        return d
    unit = c / np.linalg.norm(c)
    ridges = np.array(RIDGES)[:, None, None] * (np.trace(marks.H) / len(c) * np.eye(len(c)))
    # without a box and r
    pace = 1 / float(np.sqrt(unit @ np.linalg.solve(marks.H + ridges[0], unit)))
    active = (high <= 0).astype(np.int8) - (low >= 0)
    for step in range(CLIMBS):
        H = marks.H + ridges[min(step, len(ridges) - 1)]
        new, pace, active = farthest(marks, H, c, low, high, pace, active)
        reached = float(new @ G @ new)
        if reached > value:
            d = new
        if not d.any() or (reached <= value * (1 + CLIMB) and step >= len(RIDGES) - 1):
            break
        value, c = max(value, reached), G @ d
    return d


def two_ways(
    marks: Marks,
    G: Array,
    low: Array,
    high: Array,
    starts: int,
    progress: Callable[[int], object] | None = None,
) -> tuple[Array, Array]:
    """The largest change found, and the largest of those that point away from it."""
    S = len(G)
    # Towards what moves the surface most for what it moves of the landmarks and takes of the box
    room = np.diag((2 / (high - low)) ** 2) / S
    _, F = eigh(G, marks.H + room)  # room > 0, so never singular
    found = []
    for f in F.T[::-1][: -(-starts // 2)]:
        found += [climb(marks, G, low, high, sign * (G @ f)) for sign in (1.0, -1.0)]
        if progress is not None:
            progress(2)
    first = max(found, key=lambda d: float(d @ G @ d))
    found.append(climb(marks, G, low, high, -(G @ first)))
    away = [d for d in found if d @ G @ first < 0]
    return first, max(away, key=lambda d: float(d @ G @ d), default=np.zeros(S))
