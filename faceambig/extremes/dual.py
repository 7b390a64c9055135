"""A bound that no change passes while the landmarks are linear: the least value of the Lagrange dual (extremes)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import lapack

from ..arrays import Array
from .marks import Marks

GAP = 1e-4  # relative, of the barrier: how near the bound is to the dual's least value
STEPS = 300  # Newton's
SHORTER = 40  # halvings of one step
TIGHTER = 10.0  # factor of the barrier's weight once a step gains little


class Point(NamedTuple):
    """The dual where M is positive definite."""

    value: float
    logdet: float  # of M
    inverse: Array  # (S, S) of M
    u: Array  # (S,) M^-1 b


class Dual(NamedTuple):
    """The dual function of nu and l (S,), together x (S + 1,): a bound wherever M is positive definite."""

    marks: Marks
    G: Array  # (S, S)
    alpha: Array  # (S,) the fit's
    box: float

    def at(self, x: Array) -> Point | None:
        """Its value; None where M is not positive definite."""
        marks, nu, l = self.marks, x[0], x[1:]
        M = nu * marks.H - self.G
        M[np.diag_indices(len(l))] += l
        factor, info = lapack.dpotrf(M, lower=1)
        if info:
            return None
        inverse, info = lapack.dpotri(factor, lower=1)
        if info:
            return None
        inverse = np.tril(inverse) + np.tril(inverse, -1).T
        b = -(nu * marks.pull + l * self.alpha)
        u = inverse @ b
        room = self.box**2 - self.alpha**2
        value = float(b @ u) + nu * (1 - float(marks.r @ marks.r)) + float(l @ room)
        return Point(value, 2 * float(np.log(np.diag(factor)).sum()), inverse, u)

    def newton(self, x: Array, now: Point, t: float) -> tuple[Array, Array]:
        """Slope (S + 1,) and curvature (S + 1, S + 1) of t value - log det M - sum log x."""
        marks, inverse = self.marks, now.inverse
        w, p = self.alpha + now.u, marks.pull + marks.H @ now.u
        gap = marks.r + marks.Pi @ now.u
        A = np.column_stack([p, np.diag(w)])
        IP = inverse @ marks.H
        slope = np.concatenate([[1 - gap @ gap], self.box**2 - w**2])
        slope_log = np.concatenate([[np.trace(IP)], np.diag(inverse)])
        H = 2 * A.T @ inverse @ A
        curve = np.empty_like(H)
        curve[0, 0] = (IP * IP.T).sum()
        curve[0, 1:] = curve[1:, 0] = (IP * inverse).sum(axis=1)
        curve[1:, 1:] = inverse**2
        H = t * H + curve
        H[np.diag_indices(len(x))] += 1 / x**2
        return t * slope - slope_log - 1 / x, H

    def stepped(
        self, x: Array, now: Point, t: float, step: Array, decrement: float
    ) -> tuple[Array, Point] | None:
        """As far along `step` as the barrier falls, within x > 0; None if it does not."""
        merit = t * now.value - now.logdet - float(np.log(x).sum())
        shrinking = step < 0
        length = min(1.0, 0.99 * float((-x[shrinking] / step[shrinking]).min(initial=np.inf)))
        for _ in range(SHORTER):
            y = x + length * step
            new = self.at(y)
            if new is not None:
                changed = t * new.value - new.logdet - float(np.log(y).sum())
                if changed <= merit - 0.1 * length * decrement + 1e-9 * abs(merit):
                    return y, new
            length *= 0.5
        return None


def upper_bound(marks: Marks, G: Array, alpha: Array, box: float) -> float:
    """The least value of the Lagrange dual that Newton's method with a logarithmic barrier finds."""
    dual = Dual(marks, G, alpha, box)
    x = np.full(len(alpha) + 1, 1.1 * float(np.linalg.eigvalsh(G)[-1]))
    now = dual.at(x)
    assert now is not None
    least, t = now.value, 1.0 / now.value
    n_barrier = 2 * len(alpha) + 1
    for _ in range(STEPS):
        slope, curve = dual.newton(x, now, t)
        *_, step, info = lapack.dposv(curve, -slope, lower=1)
        if info:
            break
        decrement = float(-slope @ step)
        stepped = dual.stepped(x, now, t, step, decrement)
        if stepped is None:
            break
        x, now = stepped
        least = min(least, now.value)
        if decrement < 0.5:
            if n_barrier / t < GAP * least:
                break
            t *= TIGHTER
    return least
