"""The random photographs that benchmarks share, and the competitor: SciPy's least_squares on all parameters.

Photographs: a face drawn from all modes of the model, 0.3 to 2.4 m away, yaw within 40 degrees, pitch and roll within
20, noise of 0, 0.5, 1 or 2 px in a picture whose eye centres are 100 px apart; the distance assumed is drawn like the
true one. Every second one is fitted with lambda 1 px^2, the others with 0.01.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.optimize import least_squares

import faceambig as fa
from faceambig.arrays import Array
from faceambig.camera import Camera, project
from faceambig.fitting.problem import NEAREST_KAPPA, Problem
from faceambig.observation import portrait_camera
from faceambig.rotation import cross_matrix, rotation_matrix

LAMBDAS = (1.0, 0.01)  # px^2


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """A photograph and how it is fitted."""

    observation: fa.Observation
    distance: float  # metres, assumed by the fit
    prior_weight: float  # lambda, px^2


def model_of_the_benchmarks() -> fa.FaceModel:
    """ICT-FaceKit if FACEAMBIG_ICT names its folder, else the embedded head."""
    return fa.load_model("ict" if os.environ.get("FACEAMBIG_ICT") else "embedded")


def drawn(
    model: fa.FaceModel, number: int, *, points: str | Sequence[int] = "ibug68", seed: int = 1
) -> list[Case]:
    """`number` cases; `points` are a scheme's or the numbers of vertices."""
    rng = np.random.default_rng(seed)
    cases = []
    for i in range(number):
        face = fa.Subject(
            "drawn", "", model.vertices(rng.standard_normal(model.n_modes)), None, model
        )
        actual, assumed = np.exp(rng.uniform(np.log(0.3), np.log(2.4), 2))
        yaw, pitch, roll = rng.uniform((-40, -20, -20), (40, 20, 20))
        observation = _photograph(face, float(actual), (yaw, pitch, roll), points)
        noise = float(rng.choice([0.0, 0.5, 1.0, 2.0]))
        seen = observation.points + noise * rng.standard_normal(observation.points.shape)
        cases.append(
            Case(replace(observation, points=seen), float(assumed), LAMBDAS[i % len(LAMBDAS)])
        )
    return cases


def _photograph(
    face: fa.Subject,
    distance: float,
    angles: tuple[float, float, float],
    points: str | Sequence[int],
) -> fa.Observation:
    yaw, pitch, roll = angles
    if isinstance(points, str):
        return fa.observe(
            face, distance=distance, scheme=points, yaw_deg=yaw, pitch_deg=pitch, roll_deg=roll
        )
    camera = portrait_camera(face, distance=distance, yaw_deg=yaw, pitch_deg=pitch, roll_deg=roll)
    vertices = np.asarray(points, dtype=np.intp)
    return fa.Observation(
        project(camera, face.vertices[vertices]), vertices, principal_point=(0.0, 0.0)
    )


Derivative = Literal["analytic", "2-point"]


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """Where SciPy stopped."""

    cost: float  # E, px^2
    evaluations: int


class Stacked:
    """Residual and Jacobian of all parameters, the prior as rows below, in one array that is allocated once.

    theta = (alpha, d, t_xy, log s[, kappa]); d turns the start, the others are absolute: counted from the start too,
    they would be zero there, and SciPy's first trust region, as wide as theta is long, would cost it steps.
    """

    def __init__(self, problem: Problem, camera: Camera, alpha: Array) -> None:
        L, _, S = problem.modes.shape
        self.problem, self.camera, self.S = problem, camera, S
        n = S + 6 + problem.free_distance
        self.rows = np.zeros((2 * L + S, n))
        self.root = float(np.sqrt(problem.prior_weight))
        np.fill_diagonal(self.rows[2 * L :], self.root)
        self.J = self.rows[: 2 * L].reshape(L, 2, n)
        self.Q = problem.modes.reshape(-1, S)
        pose = [0.0, 0.0, 0.0, *camera.t, np.log(camera.s)]
        self.start = np.concatenate([alpha, pose, [camera.kappa] if problem.free_distance else []])
        self.low, self.high = np.full(n, -np.inf), np.full(n, np.inf)
        self.low[:S], self.high[:S] = -problem.box, problem.box
        if problem.free_distance:
            self.low[-1], self.high[-1] = 0.0, NEAREST_KAPPA

    def residual(self, theta: Array) -> Array:
        """(2 L + S,) projected minus observed, then the prior's; keeps what the derivative needs."""
        S, problem = self.S, self.problem
        self.R = R = rotation_matrix(theta[S : S + 3]) @ self.camera.R
        self.s = s = float(np.exp(theta[S + 5]))
        self.kappa = kappa = float(theta[S + 6]) if problem.free_distance else self.camera.kappa
        self.q = q = ((self.Q @ theta[:S]).reshape(-1, 3) + problem.mean) @ R.T
        self.z = z = s / (1.0 + kappa * q[:, 2])
        self.xy = xy = z[:, None] * (q[:, :2] + theta[S + 3 : S + 5])
        e = np.empty(len(self.rows))  # not kept: SciPy compares it with the next
        np.subtract(xy, problem.points, out=e[:-S].reshape(-1, 2))
        np.multiply(theta[:S], self.root, out=e[-S:])
        return e

    def derivative(self, theta: Array) -> Array:
        """(2 L + S, n), at the theta of the last residual, as SciPy calls it."""
        S, J, R, q, z, xy = self.S, self.J, self.R, self.q, self.z, self.xy
        tilt = (-self.kappa / self.s * z)[:, None] * xy
        D_R = z[:, None, None] * R[:2] + tilt[:, :, None] * R[2]
        np.matmul(D_R, self.problem.modes, out=J[:, :, :S])
        turn = np.empty((len(q), 2, 3))  # -D [q]x
        turn[:, :, 0] = tilt * q[:, 1, None]
        turn[:, 1, 0] -= z * q[:, 2]
        turn[:, :, 1] = -tilt * q[:, 0, None]
        turn[:, 0, 1] += z * q[:, 2]
        turn[:, 0, 2] = -z * q[:, 1]
        turn[:, 1, 2] = z * q[:, 0]
        np.matmul(turn, left_jacobian(theta[S : S + 3]), out=J[:, :, S : S + 3])
        J[:, 0, S + 3] = z
        J[:, 1, S + 4] = z
        J[:, :, S + 5] = xy
        if self.problem.free_distance:
            J[:, :, S + 6] = (-(q[:, 2] * z) / self.s)[:, None] * xy
        return self.rows


def left_jacobian(d: Array) -> Array:
    """(3, 3): a small change c of d turns exp([d]x) by a further left_jacobian(d) @ c."""
    angle = float(np.sqrt(d @ d))
    W = cross_matrix(d)
    if angle < 1e-4:  # the next terms are below 1e-9
        return np.eye(3) + 0.5 * W + W @ W / 6
    b, c = (1 - np.cos(angle)) / angle**2, (angle - np.sin(angle)) / angle**3
    return np.eye(3) + b * W + c * (W @ W)


def scipy_fit(
    problem: Problem,
    camera: Camera,
    alpha: Array,
    *,
    tolerance: float = 1e-8,
    derivative: Derivative = "analytic",
    method: Literal["trf", "dogbox"] = "trf",
    most: int | None = None,
) -> Found:
    """The fit by SciPy from a start, `alpha` (S,) strictly inside the box; landmarks weigh the same."""
    work = Stacked(problem, camera, alpha)
    jac: Callable[[Array], Array] | Literal["2-point"] = (
        work.derivative if derivative == "analytic" else "2-point"
    )
    found = least_squares(
        work.residual,
        work.start,
        jac,
        bounds=(work.low, work.high),
        method=method,
        x_scale="jac",
        ftol=tolerance,
        xtol=tolerance,
        gtol=tolerance,
        max_nfev=most,
    )
    return Found(float(2 * found.cost), int(found.nfev))


def inside(problem: Problem, alpha: Array) -> Array:
    """`alpha` (S,) pulled off the box by 1e-4: SciPy wants a start strictly inside, or moves it far (MATH.md 8.5)."""
    room = max(problem.box - 1e-4, 0.0)
    return alpha.clip(-room, room)


def excess_over_best(
    problem: Problem, camera: Camera, alpha: Array, costs: Sequence[float]
) -> list[float]:
    """How far each cost lies, relatively, above the best of them and of SciPy at 1e-13 from (camera, alpha)."""
    best = min(
        *costs, scipy_fit(problem, camera, inside(problem, alpha), tolerance=1e-13, most=200).cost
    )
    return [cost / best - 1 for cost in costs]
