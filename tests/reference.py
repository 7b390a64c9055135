"""Slow and plain versions to compare with: readable first, no tricks shared with the code under test."""

from __future__ import annotations

import itertools

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from faceambig.camera import Camera
from faceambig.fitting.problem import Problem, moved_camera
from faceambig.fitting.solve import Solution


def rotation_series(r: np.ndarray) -> np.ndarray:
    """exp([r]x) by its power series in longdouble: no trigonometry at all."""
    x, y, z = r.astype(np.longdouble)
    W = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]], dtype=np.longdouble)
    total, term = np.eye(3, dtype=np.longdouble), np.eye(3, dtype=np.longdouble)
    for n in range(1, 60):
        term = term @ W / n
        total = total + term
    return total


def rotation_series_derivative(r: np.ndarray) -> np.ndarray:
    """d exp([r]x) / dr_i (3, 3, 3) by the product rule on the power series, longdouble."""
    x, y, z = r.astype(np.longdouble)
    W = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]], dtype=np.longdouble)
    result = np.zeros((3, 3, 3), dtype=np.longdouble)
    for i in range(3):
        ex, ey, ez = np.eye(3, dtype=np.longdouble)[i]
        E = np.array([[0, -ez, ey], [ez, 0, -ex], [-ey, ex, 0]], dtype=np.longdouble)
        power, dpower = np.eye(3, dtype=np.longdouble), np.zeros((3, 3), dtype=np.longdouble)
        for n in range(1, 60):
            dpower = (dpower @ W + power @ E) / n
            power = power @ W / n
            result[i] = result[i] + dpower
    return result


def pinhole(camera: Camera, points: np.ndarray) -> np.ndarray:
    """Pixels (N, 2) by the textbook formula f X / Z of the perspective camera, from the principal point."""
    t = np.array([camera.t[0], camera.t[1], 1.0 / camera.kappa])
    f = camera.s / camera.kappa
    return np.array([f * (camera.R @ p + t)[:2] / (camera.R @ p + t)[2] for p in points])


def box_qp_by_enumeration(
    H: np.ndarray, g: np.ndarray, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """The minimiser among all 3^n guesses of what sits on which bound."""
    n, best, best_value = len(g), np.zeros(len(g)), np.inf
    for guess in itertools.product((-1, 0, 1), repeat=n):
        a = np.array(guess)
        d = np.where(a < 0, low, np.where(a > 0, high, 0.0))
        free = a == 0
        if free.any():
            d[free] = np.linalg.solve(
                H[np.ix_(free, free)], g[free] - H[np.ix_(free, ~free)] @ d[~free]
            )
        if (d >= low - 1e-12).all() and (d <= high + 1e-12).all():
            value = 0.5 * d @ H @ d - g @ d
            if value < best_value:
                best, best_value = d, value
    return best


def trf(problem: Problem, start: Solution, tolerance: float = 1e-15) -> float:
    """The cost SciPy's trust-region reflective method reaches from `start`; a residual of its own."""
    S = len(start.alpha)
    root = np.sqrt(problem.weights)

    def residual(theta: np.ndarray) -> np.ndarray:
        camera = moved_camera(start.camera, theta[S:])
        q = (problem.mean + problem.modes @ theta[:S]) @ camera.R.T
        x = camera.s * (q[:, :2] + camera.t) / (1 + camera.kappa * q[:, 2:])
        return np.concatenate(
            [
                ((x - problem.points) * root[:, None]).ravel(),
                np.sqrt(problem.prior_weight) * theta[:S],
            ]
        )

    n = S + 6 + problem.free_distance
    low, high = np.full(n, -np.inf), np.full(n, np.inf)
    low[:S], high[:S] = -problem.box, problem.box
    if problem.free_distance:
        low[-1], high[-1] = -start.camera.kappa, 10.0 - start.camera.kappa
    theta = np.concatenate(
        [np.clip(start.alpha, 0.9999 * low[:S], 0.9999 * high[:S]), np.zeros(n - S)]
    )
    found = least_squares(
        residual,
        theta,
        bounds=(low, high),
        x_scale="jac",
        ftol=tolerance,
        xtol=tolerance,
        gtol=tolerance,
        max_nfev=400,
    )
    return float(2 * found.cost)


def traced(
    faces: np.ndarray, vertices: np.ndarray, camera: Camera, asked: np.ndarray
) -> np.ndarray:
    """(n,) metres of depth by which the surface lies before each asked vertex; 0 where nothing does.

    A ray in space from the vertex to the camera, through every triangle (Moeller and Trumbore). Those that hold the
    vertex are left out: their lead is 0, or rounding.
    """
    q = vertices @ camera.R.T
    a, b, c = (q[faces[:, k]] for k in range(3))
    one, two = b - a, c - a
    lead = np.zeros(len(asked))
    for i, vertex in enumerate(asked):
        origin = q[vertex]
        way = np.array([0.0, 0.0, -1.0])
        if camera.kappa > 0:
            way = np.array([-camera.t[0], -camera.t[1], -1 / camera.kappa]) - origin
        p = np.cross(way, two)
        det = np.einsum("ij,ij->i", one, p)
        usable = (np.abs(det) > 0) & (faces != vertex).all(axis=1)
        inverse = 1 / np.where(usable, det, 1.0)
        u = np.einsum("ij,ij->i", origin - a, p) * inverse
        r = np.cross(origin - a, one)
        v = r @ way * inverse
        along = np.einsum("ij,ij->i", two, r) * inverse
        hit = usable & (u >= 0) & (v >= 0) & (u + v <= 1) & (along > 0)
        if camera.kappa > 0:
            hit &= along < 1
        lead[i] = (-way[2] * along[hit]).max(initial=0.0)
    return lead


def log_posterior(
    problem: Problem, R: np.ndarray, theta: np.ndarray, sigma: float, log_t: float | None = None
) -> np.ndarray:
    """log p (C,) of C faces theta (C, S + 6 or S + 7) = alpha, r, t_xy, log s[, log t_z], from the pinhole's formula.

    The rotation is exp([r]x) R with Haar's density in r; t_xy, log s and log t_z flat; `log_t` if it is held.
    """
    S = problem.modes.shape[2]
    alpha, r, t, log_s = theta[:, :S], theta[:, S : S + 3], theta[:, S + 3 : S + 5], theta[:, S + 5]
    t_z = np.exp(theta[:, S + 6] if log_t is None else np.full(len(theta), log_t))
    v = problem.mean + (alpha @ problem.modes.reshape(-1, S).T).reshape(len(theta), -1, 3)
    q = v @ (Rotation.from_rotvec(r).as_matrix() @ R).swapaxes(1, 2)
    Z = q[:, :, 2] + t_z[:, None]
    f = np.exp(log_s) * t_z
    x = f[:, None, None] * (q[:, :, :2] + t[:, None]) / Z[:, :, None]
    e = ((x - problem.points) ** 2).sum(axis=2) @ problem.weights
    haar = 2 * np.log(np.abs(np.sinc(np.linalg.norm(r, axis=1) / (2 * np.pi))))
    log_p = -0.5 * e / sigma**2 - 0.5 * (alpha**2).sum(axis=1) + haar
    inside = (np.abs(alpha) <= problem.box).all(axis=1) & (Z > 0).all(axis=1)
    return np.where(inside, log_p, -np.inf)
