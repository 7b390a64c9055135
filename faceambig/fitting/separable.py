"""The paper's own solver: what enters linearly is eliminated, four unknowns are left (section 4.3 and appendix A).

Shape alpha and translation t enter both of the paper's residuals linearly, so for a rotation and a size, the scale s or
the focal length f, the best ones solve a linear least squares problem. Per landmark it has the two rows

    K_i (R (Q_i alpha + mean_i) + t) - x'_i,      stacked  d = A c - y,  c = (alpha, t),

    orthographic           K_i = s P = [[s, 0, 0], [0, s, 0]],    x'_i = x_i,  t = t_2d in metres (MATH.md 2, E9)
    perspective (DLT)      K_i = [[f, 0, -x_i], [0, f, -y_i]],    x'_i = 0,    t = (t_x, t_y, t_z)
    perspective, t_z = k   K_i the same divided by k,             x'_i = x_i,  t = (t_x, t_y)

so A = [K_i R Q_i, K_i] and y = x' - K_i R mean_i: A(r, s) and y(r, s) of the paper in the first line, B(r, f) and
z(r, f) in the second; for the third problem the paper gives no formula. The sign of y is corrected (E1); the third row
of the DLT, which depends on the other two, is left out (E3).

A DLT row is a reprojection error times the landmark's depth Z_i. Divided by a fixed depth it is in pixels again and
lambda means what it means elsewhere: by k where t_z is held, by the start's t_z, 1 m in `fit`, where it is free.
sqrt(w_i) weighs both rows of a landmark; sqrt(lambda) I on alpha is stacked below, its derivatives vanish. With the
thin QR A = Q U of the columns that no bound of the box holds, and P = I - Q Q^T,

    |d|^2 = |P y|^2,   d' = P (A' c - y') - Q U^-T A'^T d                     (appendix A; Golub and Pereyra 1973)

and Kaufman (1975) drops the last term: it lies in the range of A, where d has no part, so the gradient stays the same.
Neither A^+ nor P is ever formed. With a box the elimination is a box QP, and its value is once continuously
differentiable in rotation and size: all that a descent on the true value needs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular

from ..arrays import Array
from ..camera import Camera
from ..rotation import rotation_jacobian, rotation_matrix
from .boxqp import FREE, solve_box_qp
from .problem import NEAREST_KAPPA, Problem, cost
from .result import FitOptions, Jacobian, Status
from .solve import Solution, solve

FARTHEST_FREE = 100.0  # metres, for t_z of a free DLT: perspective moves no landmark by 0.02 % there (MATH.md 6)
# tan of half the field of view. A smaller f is no lens but the hole of E4: at f -> 0 the DLT residual vanishes.
WIDEST_VIEW = float(np.tan(np.radians(75)))
LEAST_PRIOR = 1e-10  # px^2: without any, modes that no point sees have no curvature (MATH.md 8.9)
QP_ROUNDS = 200
FIRST_DAMPING, MORE_DAMPING, MOST_DAMPING = 1e-4, 10.0, 1e10
# Shares of the promised decrease: below the first a step is refused, below the second the damping grows, above the
# third it falls
LEAST_GAIN, POOR, GOOD = 1e-4, 0.25, 0.75


class Rows(NamedTuple):
    """The residual of a camera of some size (s or f): sqrt(w_i) times K_i (R v_i + t) - constant_i."""

    K: Array  # (L, 2, 3)
    dK: Array  # (L, 2, 3) dK / dsize
    constant: Array  # (L, 2)
    n_t: int  # 2 or 3, unknown components of t


def orthographic_rows(problem: Problem, s: float) -> Rows:
    """s P (R v + t_2d) - x in pixels: reprojection itself."""
    P = np.tile(np.eye(2, 3), (len(problem.points), 1, 1))
    return _weighted(problem, s * P, P, problem.points, 2)


def perspective_rows(problem: Problem, f: float, unit: float) -> Rows:
    """f X - x Z and f Y - y Z, two rows of the DLT, over a depth `unit` in metres: t_z itself unless that is free."""
    dK = np.tile(np.eye(2, 3), (len(problem.points), 1, 1))
    K = f * dK
    K[:, :, 2] = -problem.points
    if problem.free_distance:
        return _weighted(problem, K / unit, dK / unit, np.zeros_like(problem.points), 3)
    # K (0, 0, k)^T / k = -x whatever f is: it moves to the right-hand side
    return _weighted(problem, K / unit, dK / unit, problem.points, 2)


def _weighted(problem: Problem, K: Array, dK: Array, constant: Array, n_t: int) -> Rows:
    root = np.sqrt(problem.weights)[:, None]
    return Rows(root[:, :, None] * K, root[:, :, None] * dK, root * constant, n_t)


def linear_system(problem: Problem, rows: Rows, R: Array) -> tuple[Array, Array]:
    """A(r, s), y(r, s) or B(r, f), z(r, f): (2 L, S + n_t) and (2 L,) of the residual A (alpha, t) - y."""
    KR = rows.K @ R
    A = np.concatenate([KR @ problem.modes, rows.K[:, :, : rows.n_t]], axis=2)
    y = rows.constant - (KR @ problem.mean[:, :, None])[:, :, 0]
    return A.reshape(y.size, -1), y.ravel()


def linear_system_derivatives(
    problem: Problem, rows: Rows, R: Array, dR: Array
) -> tuple[Array, Array]:
    """dA (4, 2 L, S + n_t) and dy (4, 2 L) by (r_1, r_2, r_3, size) with dR/dr_i (3, 3, 3): appendix A."""
    m, S = 2 * len(problem.points), problem.modes.shape[2]
    dA, dy = np.zeros((4, m, S + rows.n_t)), np.empty((4, m))
    for i in range(3):  # K dR/dr_i: the columns of t do not turn
        KdR = rows.K @ dR[i]
        dA[i, :, :S] = (KdR @ problem.modes).reshape(m, S)
        dy[i] = -(KdR @ problem.mean[:, :, None]).ravel()
    # dK/dsize, the rest as above: A / s in the orthographic problem
    dA[3], dy[3] = linear_system(problem, Rows(rows.dK, rows.dK, 0 * rows.constant, rows.n_t), R)
    return dA, dy


@dataclass(frozen=True, slots=True, eq=False)
class Eliminated:
    """The best linear unknowns of a system and what they leave. F of the n = S + n_t columns are free."""

    c: Array  # (n,) alpha and t
    active: np.ndarray  # (n,) which bounds hold: -1, 0, 1
    solved: bool  # the active set is the best one, not where the search for it was cut off
    d: Array  # (2 L + S,) A c - y, the prior's rows below
    Q: Array  # (2 L + S, F) orthonormal columns, range of the free part of A
    U: Array  # (F, F) upper triangular, A_free = Q U

    @property
    def value(self) -> float:
        """|d|^2 of data and prior."""
        return float(self.d @ self.d)


def eliminate(problem: Problem, A: Array, y: Array, active: np.ndarray) -> Eliminated:
    """Least |A c - y|^2 + lambda |alpha|^2 in the box, from a guess of the bounds that hold (n,).

    The bounds that hold come from the normal equations; values and projector from the QR of the free columns, whose
    condition number is the root of theirs.
    """
    n, S = A.shape[1], problem.modes.shape[2]
    prior = max(problem.prior_weight, LEAST_PRIOR)
    A = np.concatenate([A, np.sqrt(prior) * np.eye(S, n)])
    y = np.concatenate([y, np.zeros(S)])
    low, high = np.full(n, -np.inf), np.full(n, np.inf)
    low[:S], high[:S] = -problem.box, problem.box
    if problem.free_distance:
        low[-1], high[-1] = 1 / NEAREST_KAPPA, FARTHEST_FREE
    c, active, solved, *_ = solve_box_qp(A.T @ A, A.T @ y, low, high, active, QP_ROUNDS)
    free = active == FREE
    Q, U = np.linalg.qr(A[:, free])
    if solved:
        c[free] = solve_triangular(U, Q.T @ (y - A[:, ~free] @ c[~free]), check_finite=False)
    return Eliminated(c, active, solved, A @ c - y, Q, U)


def projected_jacobian(found: Eliminated, dA: Array, dy: Array, kind: Jacobian) -> Array:
    """d' (2 L + S, 4) by (r_1, r_2, r_3, size), the linear unknowns following: appendix A, or Kaufman's part of it."""
    m = dy.shape[1]
    J = np.zeros((len(found.d), 4))
    J[:m] = (dA @ found.c - dy).T
    J -= found.Q @ (found.Q.T @ J)
    if kind == "full":
        pulled = (found.d[:m] @ dA)[:, found.active == FREE].T  # A'^T d, (F, 4)
        J -= found.Q @ solve_triangular(found.U, pulled, trans="T", check_finite=False)
    return J


class Point(NamedTuple):
    """A rotation and a size, and the best face for them."""

    R: Array  # (3, 3)
    size: float  # s or f
    rows: Rows
    found: Eliminated


@dataclass(frozen=True, slots=True, eq=False)
class Separated:
    """One of the three problems with the linear unknowns eliminated."""

    problem: Problem
    unit: float  # metres, by which DLT rows are divided; inf for the orthographic problem

    def at(self, R: Array, size: float, active: np.ndarray) -> Point | None:
        """The best face for a rotation and a size; None if it reaches behind the camera."""
        if np.isinf(self.unit):
            rows = orthographic_rows(self.problem, size)
        else:
            rows = perspective_rows(self.problem, size, self.unit)
        try:
            found = eliminate(self.problem, *linear_system(self.problem, rows, R), active)
        except np.linalg.LinAlgError:  # so far off that rounding eats the curvature
            return None
        point = Point(R, size, rows, found)
        return point if np.isfinite(self.solution(point, 0, Status.STALLED).cost) else None

    def jacobian(self, point: Point, kind: Jacobian) -> Array:
        """d' (2 L + S, 4) by a turn (3,) that follows R and by log size."""
        dR = rotation_jacobian(np.zeros(3)) @ point.R
        dA, dy = linear_system_derivatives(self.problem, point.rows, point.R, dR)
        dA[3], dy[3] = point.size * dA[3], point.size * dy[3]  # d / dlog s = s d / ds
        return projected_jacobian(point.found, dA, dy, kind)

    def solution(self, point: Point, steps: int, status: Status) -> Solution:
        """The point as a face and a camera, with E as its cost."""
        S, c = self.problem.modes.shape[2], point.found.c
        alpha = c[:S].clip(-self.problem.box, self.problem.box)  # rounding may pass a bound
        kappa = 1 / float(c[S + 2]) if self.problem.free_distance else 1 / self.unit
        s = point.size if kappa == 0 else point.size * kappa
        camera = Camera(point.R, c[S : S + 2], s, kappa)
        return Solution(alpha, camera, cost(self.problem, camera, alpha), steps, status)


def separate(
    problem: Problem,
    camera: Camera,
    *,
    jacobian: Jacobian = "kaufman",
    tolerance: float = 1e-8,
    max_steps: int = 100,
) -> Solution | None:
    """SNLS: least |d|^2 from the rotation and size of `camera`; None if its best face reaches behind the camera.

    camera.kappa = 0 asks for the orthographic problem, else for the DLT with t_z held, or free, within 0.1 to 100 m,
    where the problem says so; f keeps the field of view below 150 degrees. The unknowns are a turn d, R <- exp([d]x) R,
    so that dR/dr is taken at r = 0 only, and log s or log f. Levenberg-Marquardt; converged means, as in the joint
    solver, that the undamped step promises nothing. `cost` is E of the reprojection, whichever residual was minimised.
    """
    kappa = max(camera.kappa, 1 / FARTHEST_FREE) if problem.free_distance else camera.kappa
    task = Separated(problem, 1 / kappa if kappa > 0 else np.inf)
    size, least = camera.s, 0.0
    if kappa > 0:
        least = float(np.abs(problem.points).max()) / WIDEST_VIEW
        size = max(camera.s / kappa, least)
    n_t = 3 if problem.free_distance else 2
    point = task.at(camera.R, size, np.zeros(problem.modes.shape[2] + n_t, dtype=np.int8))
    if point is None:
        return None
    # A noise-free picture can be explained exactly: then |d|^2 is rounding, and no relative test ever holds
    largest = float(np.abs(problem.points).max())
    rounding = len(point.found.d) * (10 * np.finfo(float).eps * largest) ** 2
    mu = 0.0
    for step in range(1, max_steps + 1):
        J = task.jacobian(point, jacobian)
        H, g = J.T @ J, -(J.T @ point.found.d)
        H.flat[::5] += 1e-12 * H.max() + 1e-300  # few points explained exactly leave no J at all
        low = np.log(least / point.size) if least > 0 else -np.inf
        _, promised = _step(H, g, low, 0.0)
        if point.found.solved and promised <= 0.1 * tolerance * point.found.value + rounding:
            return task.solution(point, step, Status.CONVERGED)
        new, mu = _descend(task, point, H, g, low, mu)
        if new is None:
            return task.solution(point, step, Status.STALLED)
        point = new
    return task.solution(point, max_steps, Status.MAX_STEPS)


def _descend(
    task: Separated, point: Point, H: Array, g: Array, low: float, mu: float
) -> tuple[Point | None, float]:
    """A point of less |d|^2, damped as much as it takes, and the damping of the next step; None if there is none."""
    while mu <= MOST_DAMPING:
        delta, promised = _step(H, g, low, mu)
        R, size = rotation_matrix(delta[:3]) @ point.R, point.size * float(np.exp(delta[3]))
        new = task.at(R, size, point.found.active)
        gain = -np.inf if new is None else point.found.value - new.found.value
        if gain < POOR * promised:
            mu = max(FIRST_DAMPING, MORE_DAMPING * mu)
        elif gain > GOOD * promised:
            mu = mu / MORE_DAMPING if mu > FIRST_DAMPING else 0.0
        if gain > LEAST_GAIN * promised:
            return new, mu
    return None, mu


def _step(H: Array, g: Array, low: float, mu: float) -> tuple[Array, float]:
    """The step (4,) of damping mu that keeps log size above `low`, and the decrease of |d|^2 it promises."""
    bounds = np.array([-np.inf, -np.inf, -np.inf, low]), np.full(4, np.inf)
    damped = H + mu * np.diag(np.diag(H))
    delta = solve_box_qp(damped, g, *bounds, np.zeros(4, dtype=np.int8), QP_ROUNDS).d
    return delta, float(2 * (g @ delta) - delta @ (H @ delta))


def solve_separable(
    problem: Problem, camera: Camera, alpha: Array, options: FitOptions
) -> Solution:
    """SNLS from the rotation and size of `camera`, then, unless it already is the least E, all parameters together.

    `weighting="algebraic"` and the orthographic camera end with SNLS. `alpha` (S,) starts the rest where the DLT's best
    face reaches behind the camera.
    """
    first = separate(
        problem, camera,
        jacobian=options.jacobian, tolerance=options.tolerance, max_steps=options.max_steps,
    )  # fmt: skip
    orthographic = camera.kappa == 0 and not problem.free_distance
    if first is not None and (orthographic or options.weighting == "algebraic"):
        return first
    if first is not None:
        camera, alpha = first.camera, first.alpha
    elif options.weighting == "algebraic":
        raise ValueError(
            "weighting: the algebraic residual's best face reaches behind the camera at the start; "
            "give a larger distance, a smaller box or more prior"
        )
    done = solve(problem, camera, alpha, tolerance=options.tolerance, max_steps=options.max_steps)
    return replace(done, steps=done.steps + (first.steps if first is not None else 0))
