"""The paper's baseline: pose and shape in turn, each the best for the other held (alternating least squares).

A round takes Gauss-Newton steps on the pose, (d, t_xy, log s[, kappa]) of (U), then on the shape in its box. Under an
orthographic camera one shape step is exact, a ridge regression in a box; under perspective it is repeated. Both lower
E, so E never rises. But along the valley where pose and shape change together rounds gain little: without a prior E
is still 2.3 times its least value after 10 rounds and 1.4 times after 50 (MATH.md 3).
"""

from __future__ import annotations

import numpy as np

from ..arrays import Array
from ..camera import Camera
from .boxqp import AT_HIGH, AT_LOW, solve_box_qp
from .problem import Point, Problem, evaluate, limits, moved_view, normal_equations, theta_of
from .result import FitOptions, Status
from .solve import Solution, solution_at

STEPS = 5  # Gauss-Newton steps a half round; from the last round's pose 2 or 3 settle it
SETTLED = 1e-12  # promised decrease, of E, that is not worth another step
QP_ROUNDS = 200
SHORTEST = 1e-6  # of a step, before a half round ends


def solve_alternating(
    problem: Problem, camera: Camera, alpha: Array, options: FitOptions
) -> Solution:
    """Pose and shape in turn from a start, for `options.als_rounds` rounds, or until a round gains nothing.

    However the rounds end, the status is CONVERGED only if no joint step of pose and shape promises a decrease either:
    that rounds gain nothing does not make an optimum. `steps` counts rounds.
    """
    point = evaluate(problem, camera.view, alpha)
    if point.cost == np.inf:
        raise ValueError(
            "distance: a landmark lies behind the camera at the start; fit at a larger distance"
        )
    S = len(alpha)
    n = problem.unknowns
    done, most = 0, options.als_rounds or options.max_steps
    status = Status.MAX_STEPS if options.als_rounds is None else Status.ROUNDS
    while done < most:
        before, done = point.cost, done + 1
        point = _descend(problem, point, slice(S, n))
        point = _descend(problem, point, slice(0, S))
        if options.als_rounds is None and before - point.cost <= options.tolerance * point.cost:
            status = Status.STALLED
            break
    _, _, promised = _step(problem, point, slice(0, n))
    if promised <= 0.1 * options.tolerance * point.cost:
        status = Status.CONVERGED
    return solution_at(problem, point, done, status)


def _descend(problem: Problem, point: Point, block: slice) -> Point:
    """The point after a few Gauss-Newton steps in some of the parameters, never above the cost it starts from."""
    for _ in range(STEPS):
        delta, slope, promised = _step(problem, point, block)
        if promised <= SETTLED * point.cost:
            break
        length, new = 1.0, _at(problem, point, delta)
        while new.cost > point.cost - 1e-4 * length * slope:
            length *= 0.5
            if length < SHORTEST:
                return point
            new = _at(problem, point, length * delta)
        point = new
    return point


def _step(problem: Problem, point: Point, block: slice) -> tuple[Array, float, float]:
    """Gauss-Newton step (n,) of theta = (alpha, d, t_xy, log s[, kappa]), zero outside `block`; -dE along it; decrease
    of E it promises.
    """
    H, g = normal_equations(problem, *point[:4])
    low, high = (end - theta_of(problem, point) for end in limits(problem))
    delta = np.zeros(len(g))
    H, g, low, high = H[block, block], g[block], low[block], high[block]
    guess = AT_LOW * ((low >= 0) & (g < 0)) + AT_HIGH * ((high <= 0) & (g > 0))
    found = solve_box_qp(H, g, low, high, guess.astype(np.int8), QP_ROUNDS)
    delta[block] = found.d
    return delta, 2 * found.gd, 2 * found.promised


def _at(problem: Problem, point: Point, delta: Array) -> Point:
    S = len(point.alpha)
    alpha = (point.alpha + delta[:S]).clip(-problem.box, problem.box)
    return evaluate(problem, moved_view(point.view, delta[S:]), alpha)
