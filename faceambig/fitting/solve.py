"""Joint Gauss-Newton over shape and camera, in a box: the fast exact path (MATH.md 3).

What is minimised is in problem.py. One step: H = J^T J + lambda I_alpha,
g = J^T e - lambda alpha, the box QP of the linearised problem, then backtracking along the step (the box is convex, so
every point of it is feasible). Eliminating the linear unknowns from this step *is* Kaufman's step of the paper's SNLS.

Damping mu stays 0 unless steps shorter than 0.3 are needed. Converged means that the undamped step, its QP solved,
promises nothing: a small promise under damping was once taken for convergence 3e-4 above the optimum (MATH.md 3 b).
Near the optimum H hardly changes: the last steps keep it and renew g alone, which needs no J (a fifth of the time of a
fit).

`descent` is the method and asks for what it needs: the cost at a trial, H and g at a point. `solve` answers for one
face, `batch.solve_together` for many at once, so both give the same fits.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..arrays import Array
from ..camera import Camera, View
from .boxqp import Pass, box_qp, one_pass
from .problem import (
    Point,
    Problem,
    camera_of,
    evaluate,
    gradient,
    limits,
    moved_view,
    normal_equations,
    theta_of,
)
from .result import Status

SHORT_STEP = 0.3  # below this the quadratic model is bad: damp the next step
FIRST_DAMPING, MORE_DAMPING = 1e-5, 3.0
POOR = 0.5  # share of the predicted decrease below which a shorter step is tried too
LARGEST_TURN = 1.0  # radians a step; beyond, the linearised rotation says nothing
# Of log s a step, seven times as large; no overflow where the shape is hardly held
LARGEST_GROWTH = 2.0
QP_ROUNDS_EARLY, QP_ROUNDS = (2, 3, 4), 200  # far from the optimum the active set need not be exact
EPS = float(np.finfo(float).eps)
KEEP_H = 1e-2  # predicted decrease, of E, below which the next step keeps H ...
SLOW = 0.1  # ... as long as each such step predicts less than this share of the last one's decrease


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Where the solver stopped."""

    alpha: Array  # (S,)
    camera: Camera
    cost: float
    steps: int
    status: Status


class First(NamedTuple):
    """Asks for the Point of the start."""

    alpha: Array
    view: View


class Trial(NamedTuple):
    """Asks for the Point a fraction of a step away."""

    point: Point
    delta: Array  # (n,)
    length: float


class Linearised(NamedTuple):
    """Asks for (H, g) at a point."""

    point: Point


class Gradient(NamedTuple):
    """Asks for g alone."""

    point: Point


Request = First | Trial | Linearised | Gradient | Pass
Descent = Generator[Request, Any, Solution]


def descent(
    problem: Problem, camera: Camera, alpha: Array, tolerance: float, max_steps: int
) -> Descent:
    """The method, from a start; yields what it wants to know and is sent the answer."""
    point = yield First(alpha, camera.view)
    if point.cost == np.inf:
        raise ValueError(
            "distance: a landmark lies behind the camera at the start; fit at a larger distance"
        )
    lowest, highest = limits(problem)
    S, n = len(alpha), problem.unknowns
    H, factors, last = np.empty((0, 0)), {}, np.inf
    keep, whole = False, True  # whole: the last step ended on the bounds that are active
    # -1, 0, 1; a start on the box stays there unless its gradient says otherwise
    active, mu = np.zeros(n, dtype=np.int8), 0.0
    active[:S] = (alpha >= problem.box).astype(np.int8) - (alpha <= -problem.box)
    # A noise-free picture can be explained exactly: then E itself is rounding, and no relative test ever holds
    rounding = (10 * EPS) ** 2 * float(np.vdot(problem.points, problem.points))
    if problem.weighted:
        rounding *= float(problem.weights.max())
    for step in range(1, max_steps + 1):
        if keep:
            g = yield Gradient(point)
        else:
            H, g = yield Linearised(point)
            factors = {}
        here = theta_of(problem, point)
        damped = H + np.diag(mu * np.diag(H)) if mu > 0 else H
        rounds = QP_ROUNDS_EARLY[step - 1] if step <= len(QP_ROUNDS_EARLY) else QP_ROUNDS
        try:
            delta, active, solved, gd, promised = yield from box_qp(
                damped, g, lowest - here, highest - here, active, rounds, factors, whole
            )
        except np.linalg.LinAlgError:  # a bad point of the curved valley: damp and try again
            mu, active = max(FIRST_DAMPING, MORE_DAMPING * mu), np.zeros(n, dtype=np.int8)
            keep = whole = False
            continue
        slope, predicted = 2 * gd, 2 * promised
        if mu > 0:
            predicted += mu * float(np.diag(H) @ delta**2)  # of the quadratic without damping
        enough = tolerance * point.cost + rounding
        if mu == 0 and solved and predicted <= enough:
            if predicted > 0.1 * tolerance * point.cost + rounding:  # the step is known: take it
                new = yield Trial(point, delta, 1.0)
                point = new if new.cost < point.cost else point
            return solution_at(problem, point, step, Status.CONVERGED)
        if (
            mu > 0 and predicted <= enough
        ):  # a damped step always promises less than an undamped one
            undamped = yield from _undamped(H, g, lowest - here, highest - here)
            if undamped <= enough:
                return solution_at(problem, point, step, Status.CONVERGED)
        moved = yield from _line_search(point, delta, slope)
        if moved is None:
            whole = False
            if keep:
                keep = False
                continue
            if mu > 1e3 or (mu == 0 and solved and predicted <= 1e-12 * point.cost):
                return solution_at(problem, point, step, Status.STALLED)
            mu = max(FIRST_DAMPING, 10 * MORE_DAMPING * mu)
            continue
        point, length, whole = moved
        whole = whole and mu == 0 and solved
        keep = whole and predicted <= KEEP_H * point.cost and not (keep and predicted > SLOW * last)
        last = predicted
        if length < SHORT_STEP:
            mu = max(FIRST_DAMPING, MORE_DAMPING * mu)
        else:
            mu = mu / 10 if mu > FIRST_DAMPING else 0.0
    return solution_at(problem, point, max_steps, Status.MAX_STEPS)


def _undamped(H: Array, g: Array, low: Array, high: Array) -> Generator[Pass, Any, float]:
    """The decrease of E that the step without damping promises; inf where there is none."""
    try:
        nothing_held = np.zeros(len(g), dtype=np.int8)
        step = yield from box_qp(H, g, low, high, nothing_held, QP_ROUNDS, {}, False)
    except np.linalg.LinAlgError:
        return np.inf
    return 2 * step.promised if step.solved else np.inf


def solution_at(problem: Problem, point: Point, steps: int, status: Status) -> Solution:
    # A step to the bound may pass it by a rounding
    alpha = point.alpha.clip(-problem.box, problem.box)
    return Solution(alpha, camera_of(point.view), point.cost, steps, status)


def _line_search(
    point: Point, delta: Array, slope: float
) -> Generator[Trial, Point, tuple[Point, float, bool] | None]:
    """The point a fraction of `delta` away that lowers E, the fraction that did, and whether all was gone; or None.

    `slope` is -dE/dlength at 0. Lengths follow the parabola through E(0), E'(0), E(length), kept within 0.15 to 0.7
    of the last.
    """
    S, E = len(point.alpha), point.cost
    turn, growth = math.hypot(*delta[S : S + 3].tolist()), abs(float(delta[S + 5]))
    length = 1.0 / max(1.0, turn / LARGEST_TURN, growth / LARGEST_GROWTH)
    for _ in range(30):
        new = yield Trial(point, delta, length)
        if new.cost <= E - 1e-4 * length * slope:
            if E - new.cost < POOR * 0.5 * length * slope:
                # Residuals too large for Gauss-Newton: whole steps would zig-zag across the valley for ever
                other = yield Trial(point, delta, _parabola(E, slope, new.cost, length))
                if other.cost < new.cost:
                    return other, length, False
            return new, length, length == 1.0
        seen = new.cost < np.inf
        length = _parabola(E, slope, new.cost, length) if seen else 0.15 * length
    return None


def _parabola(E: float, slope: float, E_new: float, length: float) -> float:
    """Where the parabola through E(0), -E'(0) = slope and E(length) is least, within 0.15 to 0.7 of `length`."""
    curve = E_new - E + slope * length
    factor = 0.5 * slope * length / curve if curve > 0 else 0.7
    return length * min(0.7, max(0.15, factor))


def solve(
    problem: Problem, camera: Camera, alpha: Array, *, tolerance: float = 1e-8, max_steps: int = 100
) -> Solution:
    """The best face and camera from a start; `alpha` (S,) inside the box, `camera` in front of the face."""
    work = descent(problem, camera, alpha, tolerance, max_steps)
    request = next(work)
    while True:
        try:
            request = work.send(_answer(problem, request))
        except StopIteration as end:
            return end.value


def _answer(problem: Problem, request: Request) -> Any:
    if isinstance(request, Pass):
        return one_pass(request)
    if isinstance(request, First):
        return evaluate(problem, request.view, request.alpha)
    if isinstance(request, Trial):
        point, delta, length = request
        S, step = len(point.alpha), length * delta
        return evaluate(problem, moved_view(point.view, step[S:]), point.alpha + step[:S])
    work = gradient if isinstance(request, Gradient) else normal_equations
    return work(problem, *request.point[:4])


def kkt_error(problem: Problem, solution: Solution) -> float:
    """Largest violation of the optimality conditions, each scaled by sqrt(E H_jj): 0 at a constrained optimum."""
    point = evaluate(problem, solution.camera.view, solution.alpha)
    H, g = normal_equations(problem, *point[:4])
    (low, high), theta = limits(problem), theta_of(problem, point)
    violated = np.where(
        theta <= low, np.maximum(g, 0), np.where(theta >= high, np.maximum(-g, 0), np.abs(g))
    )
    return float((violated / np.sqrt(np.maximum(solution.cost * np.diag(H), 1e-300))).max())
