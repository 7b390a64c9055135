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

import numpy as np

from ..arrays import Array
from ..camera import Camera, depths, jacobian, project
from ..rotation import rotation_matrix
from .boxqp import FREE, solve_box_qp
from .result import Status

POSE = 6  # d (3), t_xy (2), log s
NEAREST_KAPPA = (
    10.0  # per metre: free distances stop at 10 cm, where no face is in front of its camera
)
SHORT_STEP = 0.3  # below this the quadratic model is bad: damp the next step
FIRST_DAMPING, MORE_DAMPING = 1e-5, 3.0
POOR = 0.5  # share of the predicted decrease below which a shorter step is tried too
LARGEST_TURN = 1.0  # radians a step; beyond, the linearised rotation says nothing
QP_ROUNDS_EARLY = (2, 3, 4)  # far from the optimum the active set need not be exact


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


def cost(problem: Problem, camera: Camera, alpha: Array) -> float:
    """E of MATH.md 3 in px^2; inf if a landmark is behind the camera."""
    v = problem.mean + problem.modes @ alpha
    if camera.kappa > 0 and (depths(camera, v) <= 0).any():
        return np.inf
    e = problem.points - project(camera, v)
    return float(
        problem.weights @ np.einsum("ij,ij->i", e, e) + problem.prior_weight * (alpha @ alpha)
    )


def solve(
    problem: Problem, camera: Camera, alpha: Array, *, tolerance: float = 1e-8, max_steps: int = 100
) -> Solution:
    """The best face and camera from a start; `alpha` (S,) inside the box, `camera` in front of the face."""
    lam, S = problem.prior_weight, len(alpha)
    n = S + POSE + problem.free_distance
    low, high = np.full(n, -np.inf), np.full(n, np.inf)
    active = np.zeros(n, dtype=np.int8)
    diagonal = np.arange(S)
    mu, E = 0.0, cost(problem, camera, alpha)
    if not np.isfinite(E):
        raise ValueError(
            "distance: a landmark lies behind the camera at the start; fit at a larger distance"
        )
    # A noise-free picture can be explained exactly: then E itself is rounding, and no relative test ever holds
    rounding = (
        float(problem.weights.sum())
        * (10 * np.finfo(float).eps * float(np.abs(problem.points).max())) ** 2
    )
    flat_weights = None if (problem.weights == 1).all() else np.sqrt(problem.weights)
    for step in range(1, max_steps + 1):
        v = problem.mean + problem.modes @ alpha
        J = jacobian(camera, v, problem.modes)[:, :, :n]
        e = problem.points - project(camera, v)
        if flat_weights is not None:
            J, e = J * flat_weights[:, None, None], e * flat_weights[:, None]
        J = np.ascontiguousarray(J).reshape(-1, n)
        H, g = J.T @ J, J.T @ e.ravel()
        # Without a prior the unseen modes have no curvature at all (MATH.md 8.9)
        H[diagonal, diagonal] += max(lam, 1e-10)
        g[:S] -= lam * alpha
        H_damped = H + np.diag(mu * np.diag(H)) if mu > 0 else H
        low[:S], high[:S] = -problem.box - alpha, problem.box - alpha
        if problem.free_distance:
            low[-1], high[-1] = -camera.kappa, NEAREST_KAPPA - camera.kappa
        rounds = QP_ROUNDS_EARLY[step - 1] if step <= len(QP_ROUNDS_EARLY) else 200
        try:
            delta, active, solved = solve_box_qp(H_damped, g, low, high, active, rounds)
        except np.linalg.LinAlgError:  # a bad point of the curved valley: damp and try again
            mu, active = max(FIRST_DAMPING, MORE_DAMPING * mu), np.zeros(n, dtype=np.int8)
            continue
        predicted = 2 * (g @ delta) - delta @ H @ delta
        if mu == 0 and solved and predicted <= 0.1 * tolerance * E + rounding:
            return Solution(alpha, camera, E, step, Status.CONVERGED)
        moved = _line_search(problem, camera, alpha, delta, E, float(2 * (g @ delta)))
        if moved is None:
            if mu > 1e3 or (mu == 0 and solved and predicted <= 1e-12 * E):
                return Solution(alpha, camera, E, step, Status.STALLED)
            mu = max(FIRST_DAMPING, 10 * MORE_DAMPING * mu)
            continue
        alpha, camera, E, length = moved
        if length < SHORT_STEP:
            mu = max(FIRST_DAMPING, MORE_DAMPING * mu)
        else:
            mu = mu / 10 if mu > FIRST_DAMPING else 0.0
    return Solution(alpha, camera, E, max_steps, Status.MAX_STEPS)


def _line_search(
    problem: Problem, camera: Camera, alpha: Array, delta: Array, E: float, slope: float
) -> tuple[Array, Camera, float, float] | None:
    """The point (alpha, camera, E, length) a fraction of `delta` away that lowers E, or None.

    `slope` is -dE/dlength at 0. Lengths follow the parabola through E(0), E'(0), E(length), kept within 0.15 to 0.7
    of the last.
    """
    turn = float(np.linalg.norm(delta[len(alpha) : len(alpha) + 3]))
    length = min(1.0, LARGEST_TURN / turn) if turn > 0 else 1.0
    for _ in range(30):
        alpha_new, camera_new, E_new = _at(problem, camera, alpha, delta, length)
        if E_new <= E - 1e-4 * length * slope:
            if E - E_new < POOR * 0.5 * length * slope:
                # Residuals too large for Gauss-Newton: whole steps would zig-zag across the valley for ever
                shorter = _parabola(E, slope, E_new, length)
                other = _at(problem, camera, alpha, delta, shorter)
                if other[2] < E_new:
                    return *other, length
            return alpha_new, camera_new, E_new, length
        length = _parabola(E, slope, E_new, length) if np.isfinite(E_new) else 0.15 * length
    return None


def _at(
    problem: Problem, camera: Camera, alpha: Array, delta: Array, length: float
) -> tuple[Array, Camera, float]:
    """The point a fraction of `delta` away, inside the box, and its cost."""
    there = np.clip(alpha + length * delta[: len(alpha)], -problem.box, problem.box)
    seen = moved_camera(camera, length * delta[len(alpha) :])
    return there, seen, cost(problem, seen, there)


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
    v = problem.mean + problem.modes @ solution.alpha
    root = np.sqrt(problem.weights)
    J = (jacobian(solution.camera, v, problem.modes)[:, :, :n] * root[:, None, None]).reshape(-1, n)
    e = ((problem.points - project(solution.camera, v)) * root[:, None]).ravel()
    g = J.T @ e
    g[:S] -= problem.prior_weight * solution.alpha
    H_jj = np.einsum("ij,ij->j", J, J)
    H_jj[:S] += problem.prior_weight
    at_low, at_high = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    at_low[:S], at_high[:S] = solution.alpha <= -problem.box, solution.alpha >= problem.box
    if problem.free_distance:
        at_low[-1] = solution.camera.kappa <= 0
        at_high[-1] = solution.camera.kappa >= NEAREST_KAPPA
    violated = np.where(at_low, np.maximum(g, 0), np.where(at_high, np.maximum(-g, 0), np.abs(g)))
    return float((violated / np.sqrt(np.maximum(solution.cost * H_jj, 1e-300))).max())


__all__ = ["FREE", "Problem", "Solution", "cost", "kkt_error", "moved_camera", "solve"]
