"""What a fit minimises: the cost of a face and a camera, and its derivatives (MATH.md 3).

    E = sum_i w_i |x_i - xhat_i|^2 + lambda |alpha|^2,   |alpha_j| <= k                       (px^2)

over theta = (alpha, d, t_xy, log s[, kappa]) in the unified camera (U). Nothing here chooses a step: see solve.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ..arrays import Array
from ..camera import Camera, Seen, View, fill_jacobian, see
from ..rotation import rotation_matrix

POSE = 6  # d (3), t_xy (2), log s
# Per metre: free distances stop at 10 cm, where no face is in front of its camera
NEAREST_KAPPA = 10.0
LEAST_PRIOR = 1e-10  # px^2


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """One fit in the solver's own terms. L visible landmarks, S modes.

    Many fits at once have a leading axis F: points (F, L, 2), weights (F, L), prior_weight (F, 1).
    """

    points: Array  # (L, 2) pixels from the principal point
    weights: Array  # (L,) > 0
    mean: Array  # (L, 3) metres
    mean_pinv: Array  # (3, L), of the centred mean: for the start (start.py)
    modes: Array  # (L, 3, S), C-contiguous
    prior_weight: float | Array  # lambda, px^2
    box: float  # k, may be inf
    free_distance: bool = False
    weighted: bool = field(init=False)  # not all weights are 1

    def __post_init__(self) -> None:
        object.__setattr__(self, "weighted", bool((self.weights != 1).any()))

    def landmarks(self, alpha: Array) -> Array:
        """(..., L, 3) of faces alpha (..., S), metres, model axes."""
        S = alpha.shape[-1]
        flat = self.mean.ravel() + alpha @ self.modes.reshape(-1, S).T
        return flat.reshape(*alpha.shape[:-1], -1, 3)

    @property
    def unknowns(self) -> int:
        """n, the length of theta."""
        return self.modes.shape[2] + POSE + self.free_distance


class Point(NamedTuple):
    """A face and a camera, and what they cost."""

    alpha: Array  # (S,)
    view: View
    seen: Seen
    e: Array  # (L, 2) observed minus projected, pixels
    cost: float  # E of MATH.md 3, px^2; inf if a landmark is behind the camera


def limits(problem: Problem) -> tuple[Array, Array]:
    """Lowest and highest theta (n,): the box, and the distances between infinity and the nearest."""
    S, n = problem.modes.shape[2], problem.unknowns
    low, high = np.full(n, -np.inf), np.full(n, np.inf)
    low[:S], high[:S] = -problem.box, problem.box
    if problem.free_distance:
        low[-1], high[-1] = 0.0, NEAREST_KAPPA
    return low, high


def theta_of(problem: Problem, point: Point) -> Array:
    """(n,) what has limits, alpha and a free kappa; the rest counts from the point: zeros."""
    theta = np.zeros(problem.unknowns)
    theta[: len(point.alpha)] = point.alpha
    if problem.free_distance:
        theta[-1] = point.view.kappa
    return theta


def moved_view(view: View, step: Array) -> View:
    """`view` after a step (d, t_xy, log s[, kappa]), (6,) or (7,)."""
    R, t, s, kappa = view
    if len(step) > POSE:
        kappa = max(0.0, kappa + float(step[POSE]))
    return View(rotation_matrix(step[:3]) @ R, t + step[3:5], s * math.exp(step[5]), kappa)


def camera_of(view: View) -> Camera:
    return Camera(view.R, view.t, float(view.s), float(view.kappa))


def moved_camera(camera: Camera, step: Array) -> Camera:
    """`camera` after a step (d, t_xy, log s[, kappa]), (6,) or (7,)."""
    return camera_of(moved_view(camera.view, step))


def evaluate(problem: Problem, view: View, alpha: Array) -> Point:
    """The landmarks, residuals and cost of a face and a camera."""
    seen, e, E = residuals(problem, alpha, view)
    return Point(alpha, view, seen, e, float(E))


def cost(problem: Problem, camera: Camera, alpha: Array) -> float:
    """E of MATH.md 3 in px^2; inf if a landmark is behind the camera."""
    return evaluate(problem, camera.view, alpha).cost


def residuals(problem: Problem, alpha: Array, view: View) -> tuple[Seen, Array, Array]:
    """(seen, e (..., L, 2), E (...)) of faces alpha (..., S) in views: the landmarks seen, residuals and costs."""
    seen = see(view, problem.landmarks(alpha))
    e = problem.points - seen.xy
    flat = e.reshape(*alpha.shape[:-1], -1)
    weighted = (
        flat if not problem.weighted else (problem.weights[..., None] * e).reshape(flat.shape)
    )
    E = np.vecdot(weighted, flat) + np.vecdot(problem.prior_weight * alpha, alpha)
    return seen, e, E if seen.behind is None else np.where(seen.behind, np.inf, E)


def normal_equations(
    problem: Problem, alpha: Array, view: View, seen: Seen, e: Array
) -> tuple[Array, Array]:
    """H = J^T W J + lambda I_alpha (..., n, n) and g = J^T W e - lambda alpha (..., n), in px^2."""
    S, n = alpha.shape[-1], problem.unknowns
    # e as the column after J gives g with H; whole cache lines, 8 columns, a tenth faster
    columns = -(-(S + POSE + 2) // 8) * 8
    J = np.zeros((*e.shape, columns))
    fill_jacobian(J, view, seen, problem.modes)
    J[..., n] = e
    if problem.weighted:
        J *= np.sqrt(problem.weights)[..., None, None]
    rows = J.reshape(*alpha.shape[:-1], -1, columns)
    product = rows.swapaxes(-1, -2) @ rows  # one array on both sides: half the work
    diagonal = product.reshape(*alpha.shape[:-1], -1)[..., : S * (columns + 1) : columns + 1]
    # Without a prior the unseen modes have no curvature at all (MATH.md 8.9)
    diagonal += np.maximum(problem.prior_weight, LEAST_PRIOR)
    g = product[..., n, :n]
    g[..., :S] -= problem.prior_weight * alpha
    return product[..., :n, :n], g


def gradient(problem: Problem, alpha: Array, view: View, seen: Seen, e: Array) -> Array:
    """g = J^T W e - lambda alpha (..., n) without J: each residual is carried back to the model (MATH.md 1)."""
    S, n = alpha.shape[-1], problem.unknowns
    q, z, xy, _ = seen
    if problem.weighted:
        e = problem.weights[..., None] * e
    along = np.vecdot(xy, e)
    De = np.empty_like(q)  # D^T e
    np.multiply(z[..., None], e, out=De[..., :2])
    np.multiply(z * (-view.kappa / view.s), along, out=De[..., 2])
    g = np.empty((*alpha.shape[:-1], n))
    g[..., :S] = (De @ view.R).reshape(*alpha.shape[:-1], -1) @ problem.modes.reshape(-1, S)
    g[..., :S] -= problem.prior_weight * alpha
    M = q.swapaxes(-1, -2) @ De  # torque, the sum of q x D^T e, is its antisymmetric part
    g[..., S] = M[..., 1, 2] - M[..., 2, 1]
    g[..., S + 1] = M[..., 2, 0] - M[..., 0, 2]
    g[..., S + 2] = M[..., 0, 1] - M[..., 1, 0]
    g[..., S + 3 : S + 5] = De[..., :2].sum(-2)
    g[..., S + 5] = along.sum(-1)
    if problem.free_distance:
        g[..., S + 6] = -np.vecdot(q[..., 2] * z / view.s, along)
    return g
