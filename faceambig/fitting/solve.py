"""Joint Gauss-Newton over shape and camera, in a box: the fast exact path (MATH.md 3).

    E = sum_i w_i |x_i - xhat_i|^2 + lambda |alpha|^2,   |alpha_j| <= k                       (px^2)

over theta = (alpha, d, t_xy, log s[, kappa]) in the unified camera (U). One step: H = J^T J + lambda I_alpha,
g = J^T e - lambda alpha, the box QP of the linearised problem, then backtracking along the step (the box is convex, so
every point of it is feasible). Eliminating the linear unknowns from this step *is* Kaufman's step of the paper's SNLS.

Damping mu stays 0 unless steps shorter than 0.3 are needed. Convergence is tested only with mu = 0 and the QP solved:
a small predicted decrease under damping was once taken for convergence 3e-4 above the optimum (MATH.md 3 b).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..arrays import Array
from ..camera import Camera, depths, jacobian, project
from ..rotation import rotation_matrix
from .boxqp import solve_box_qp
from .result import Status

POSE = 6  # d (3), t_xy (2), log s
NEAREST_KAPPA = (
    10.0  # per metre: free distances stop at 10 cm, where no face is in front of its camera
)
SHORT_STEP = 0.3  # below this the quadratic model is bad: damp the next step
FIRST_DAMPING, MORE_DAMPING = 1e-5, 3.0
POOR = 0.5  # share of the predicted decrease below which a shorter step is tried too
LARGEST_TURN = 1.0  # radians a step; beyond, the linearised rotation says nothing
QP_ROUNDS_EARLY, QP_ROUNDS = (2, 3, 4), 200  # far from the optimum the active set need not be exact


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """One fit in the solver's own terms. L visible landmarks, S modes."""

    points: Array  # (L, 2) pixels from the principal point
    weights: Array  # (L,) > 0
    mean: Array  # (L, 3) metres
    modes: Array  # (L, 3, S), C-contiguous
    prior_weight: float  # lambda, px^2
    box: float  # k, may be inf
    free_distance: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Where the solver stopped."""

    alpha: Array  # (S,)
    camera: Camera
    cost: float
    steps: int
    status: Status


class Point(NamedTuple):
    """A face and a camera, and what they cost."""

    alpha: Array  # (S,)
    camera: Camera
    v: Array  # (L, 3) landmarks, metres
    e: Array  # (L, 2) observed minus projected, pixels
    cost: float  # E of MATH.md 3, px^2; inf if a landmark is behind the camera


def evaluate(problem: Problem, camera: Camera, alpha: Array) -> Point:
    """The landmarks, residuals and cost of a face and a camera."""
    S = len(alpha)
    v = problem.mean + (problem.modes.reshape(-1, S) @ alpha).reshape(-1, 3)
    if camera.kappa > 0 and depths(camera, v).min() <= 0:
        return Point(alpha, camera, v, np.full_like(problem.points, np.nan), np.inf)
    e = problem.points - project(camera, v)
    E = problem.weights @ np.einsum("ij,ij->i", e, e) + problem.prior_weight * (alpha @ alpha)
    return Point(alpha, camera, v, e, float(E))


def cost(problem: Problem, camera: Camera, alpha: Array) -> float:
    """E of MATH.md 3 in px^2; inf if a landmark is behind the camera."""
    return evaluate(problem, camera, alpha).cost


def solve(
    problem: Problem, camera: Camera, alpha: Array, *, tolerance: float = 1e-8, max_steps: int = 100
) -> Solution:
    """The best face and camera from a start; `alpha` (S,) inside the box, `camera` in front of the face."""
    point = evaluate(problem, camera, alpha)
    if not np.isfinite(point.cost):
        raise ValueError(
            "distance: a landmark lies behind the camera at the start; fit at a larger distance"
        )
    n = len(alpha) + POSE + problem.free_distance
    active, mu = np.zeros(n, dtype=np.int8), 0.0
    # A noise-free picture can be explained exactly: then E itself is rounding, and no relative test ever holds
    largest = float(np.abs(problem.points).max())
    rounding = float(problem.weights.sum()) * (10 * np.finfo(float).eps * largest) ** 2
    for step in range(1, max_steps + 1):
        H, g = _normal_equations(problem, point, n)
        low, high = _bounds(problem, point, n)
        damped = H + np.diag(mu * np.diag(H)) if mu > 0 else H
        rounds = QP_ROUNDS_EARLY[step - 1] if step <= len(QP_ROUNDS_EARLY) else QP_ROUNDS
        try:
            delta, active, solved = solve_box_qp(damped, g, low, high, active, rounds)
        except np.linalg.LinAlgError:  # a bad point of the curved valley: damp and try again
            mu, active = max(FIRST_DAMPING, MORE_DAMPING * mu), np.zeros(n, dtype=np.int8)
            continue
        slope = float(2 * (g @ delta))
        predicted = slope - float(delta @ (H @ delta))
        if mu == 0 and solved and predicted <= 0.1 * tolerance * point.cost + rounding:
            return Solution(point.alpha, point.camera, point.cost, step, Status.CONVERGED)
        moved = _line_search(problem, point, delta, slope)
        if moved is None:
            if mu > 1e3 or (mu == 0 and solved and predicted <= 1e-12 * point.cost):
                return Solution(point.alpha, point.camera, point.cost, step, Status.STALLED)
            mu = max(FIRST_DAMPING, 10 * MORE_DAMPING * mu)
            continue
        point, length = moved
        if length < SHORT_STEP:
            mu = max(FIRST_DAMPING, MORE_DAMPING * mu)
        else:
            mu = mu / 10 if mu > FIRST_DAMPING else 0.0
    return Solution(point.alpha, point.camera, point.cost, max_steps, Status.MAX_STEPS)


def _normal_equations(problem: Problem, point: Point, n: int) -> tuple[Array, Array]:
    """H = J^T W J + lambda I_alpha (n, n) and g = J^T W e - lambda alpha (n,), in px^2."""
    S, lam = len(point.alpha), problem.prior_weight
    J, e = jacobian(point.camera, point.v, problem.modes)[:, :, :n], point.e
    if (problem.weights != 1).any():
        root = np.sqrt(problem.weights)
        J, e = J * root[:, None, None], e * root[:, None]
    flat = np.ascontiguousarray(J).reshape(
        -1, n
    )  # one array on both sides of the product: half the work
    H, g = flat.T @ flat, flat.T @ e.ravel()
    # Without a prior the unseen modes have no curvature at all (MATH.md 8.9)
    H.flat[: S * (n + 1) : n + 1] += max(lam, 1e-10)
    g[:S] -= lam * point.alpha
    return H, g


def _bounds(problem: Problem, point: Point, n: int) -> tuple[Array, Array]:
    """Lowest and highest step (n,) that stays inside the box and between infinity and the nearest distance."""
    S = len(point.alpha)
    low, high = np.full(n, -np.inf), np.full(n, np.inf)
    low[:S], high[:S] = -problem.box - point.alpha, problem.box - point.alpha
    if problem.free_distance:
        low[-1], high[-1] = -point.camera.kappa, NEAREST_KAPPA - point.camera.kappa
    return low, high


def _line_search(
    problem: Problem, point: Point, delta: Array, slope: float
) -> tuple[Point, float] | None:
    """The point a fraction of `delta` away that lowers E, and the fraction, or None.

    `slope` is -dE/dlength at 0. Lengths follow the parabola through E(0), E'(0), E(length), kept within 0.15 to 0.7
    of the last.
    """
    S, E = len(point.alpha), point.cost
    turn = float(np.linalg.norm(delta[S : S + 3]))
    length = min(1.0, LARGEST_TURN / turn) if turn > 0 else 1.0
    for _ in range(30):
        new = _at(problem, point, delta, length)
        if new.cost <= E - 1e-4 * length * slope:
            if E - new.cost < POOR * 0.5 * length * slope:
                # Residuals too large for Gauss-Newton: whole steps would zig-zag across the valley for ever
                other = _at(problem, point, delta, _parabola(E, slope, new.cost, length))
                if other.cost < new.cost:
                    return other, length
            return new, length
        finite = np.isfinite(new.cost)
        length = _parabola(E, slope, new.cost, length) if finite else 0.15 * length
    return None


def _at(problem: Problem, point: Point, delta: Array, length: float) -> Point:
    """The point a fraction of `delta` away, inside the box."""
    S = len(point.alpha)
    alpha = (point.alpha + length * delta[:S]).clip(-problem.box, problem.box)
    return evaluate(problem, moved_camera(point.camera, length * delta[S:]), alpha)


def _parabola(E: float, slope: float, E_new: float, length: float) -> float:
    """Where the parabola through E(0), -E'(0) = slope and E(length) is least, within 0.15 to 0.7 of `length`."""
    curve = E_new - E + slope * length
    factor = 0.5 * slope * length / curve if curve > 0 else 0.7
    return length * min(0.7, max(0.15, factor))


def moved_camera(camera: Camera, step: Array) -> Camera:
    """`camera` after a step (d, t_xy, log s[, kappa]), (6,) or (7,)."""
    kappa = camera.kappa + step[6] if len(step) > 6 else camera.kappa
    return Camera(
        rotation_matrix(step[:3]) @ camera.R,
        camera.t + step[3:5],
        camera.s * float(np.exp(step[5])),
        max(0.0, kappa),
    )


def kkt_error(problem: Problem, solution: Solution) -> float:
    """Largest violation of the optimality conditions, each scaled by sqrt(E H_jj): 0 at a constrained optimum."""
    S = len(solution.alpha)
    n = S + POSE + problem.free_distance
    point = evaluate(problem, solution.camera, solution.alpha)
    H, g = _normal_equations(problem, point, n)
    at_low, at_high = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    at_low[:S], at_high[:S] = solution.alpha <= -problem.box, solution.alpha >= problem.box
    if problem.free_distance:
        at_low[-1] = solution.camera.kappa <= 0
        at_high[-1] = solution.camera.kappa >= NEAREST_KAPPA
    violated = np.where(at_low, np.maximum(g, 0), np.where(at_high, np.maximum(-g, 0), np.abs(g)))
    return float((violated / np.sqrt(np.maximum(solution.cost * np.diag(H), 1e-300))).max())
