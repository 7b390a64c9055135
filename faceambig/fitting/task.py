"""One fit made ready for the solvers, and its answer put back into the user's terms."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from ..arrays import Array, number, read_only, shown
from ..camera import Camera, depths, project
from ..model import FaceModel, Scheme
from ..observation import FLATTEST, MIN_POINTS, Observation, eye_distance
from .als import solve_alternating
from .checks import check_model
from .problem import Problem
from .result import Fit, FitOptions
from .separable import solve_separable
from .solve import Solution, solve
from .start import at_distance, centred_pinv, pose_from_points, refuse_face_from_behind

NEAREST = 0.2  # metres: nearer fits put the nose of large faces behind the camera (MATH.md 1)
FARTHEST = 1e6  # metres; beyond, ask for camera="orthographic"
# Per metre: where a free distance starts; no second basin in kappa was met (MATH.md 3)
FIRST_KAPPA = 1.0
# Points: dense ones; rows of the model take 20 MB, and in every pose others are visible
MANY = 1000


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """An observation made ready for the solver: what every distance of a sweep shares."""

    model: FaceModel
    observation: Observation
    options: FitOptions
    problem: Problem
    pose: Camera  # closed form, orthographic: the start, once it is put at a distance
    interocular_px: float
    interocular_meaning: str


def prepare(model: FaceModel, observation: Observation, options: FitOptions) -> Task:
    """Visible points, their rows of the model, the prior's weight in px^2; ValueError if they do not match."""
    check_model(model)
    if not isinstance(observation, Observation):
        raise ValueError(f"observation: {shown(observation)} is not an Observation")
    visible = observation.visible
    vertices = observation.vertices(model)
    rows = landmark_rows if len(vertices) <= MANY else _dense_rows
    mean, pinv, Q = rows(model, tuple(vertices[visible].tolist()), options.modes_of(model))
    points = observation.points[visible] - observation.centre
    pose = pose_from_points(points, mean, pinv)
    interocular, meaning = _interocular(model, observation, pose)
    lam = options.prior_weight
    if lam is None:
        # MATH.md 3: the MAP estimate has lambda = sigma^2
        lam = (options.noise_percent / 100 * interocular) ** 2
    weights = np.ones(len(points)) if observation.weights is None else observation.weights[visible]
    box = np.inf if options.box is None else options.box
    problem = Problem(points, weights, mean, pinv, Q, lam, box)
    refuse_face_from_behind(problem, pose)
    return Task(model, observation, options, problem, pose, interocular, meaning)


@lru_cache(maxsize=64)
def landmark_rows(
    model: FaceModel, vertices: tuple[int, ...], n_modes: int
) -> tuple[Array, Array, Array]:
    """Mean (L, 3), its pseudo-inverse for the start (3, L) and modes (L, 3, S) at landmark vertices.

    Kept: a sweep, a batch or a page asks for the same ones again.
    """
    mean, modes = model.rows(np.array(vertices, dtype=np.intp))
    different = len(set(vertices))
    if 1 < different < MIN_POINTS:  # one alone is a line, below
        raise ValueError(
            f"points: on only {different} different vertices of the model; {MIN_POINTS} are needed"
        )
    spread = np.linalg.svd(mean - mean.mean(axis=0), compute_uv=False)
    if spread[1] <= FLATTEST * spread[0]:
        raise ValueError(
            "points: on the model they lie on one line, no pose can be found; add a point off the line"
        )
    modes = np.ascontiguousarray(modes[:, :, :n_modes])
    return read_only(mean), read_only(centred_pinv(mean)), read_only(modes)


_dense_rows = lru_cache(maxsize=2)(landmark_rows.__wrapped__)


def start_of(task: Task, kappa: float) -> tuple[Camera, Array]:
    """Where a fit at kappa = 1 / t_z starts when it knows no other: the closed-form pose of the mean face."""
    return at_distance(task.pose, task.problem.mean, kappa), np.zeros(task.problem.modes.shape[2])


def solve_from(task: Task, camera: Camera, alpha: Array, free_distance: bool = False) -> Fit:
    """The fit of a task from a given start, at the camera's distance or with the distance free."""
    problem = task.problem
    if free_distance:
        problem = replace(problem, free_distance=True)
    return answer(task, solve_by(problem, camera, alpha, task.options))


def solve_by(problem: Problem, camera: Camera, alpha: Array, options: FitOptions) -> Solution:
    """By the method that the options name."""
    if options.method == "snls" or options.weighting == "algebraic":
        return solve_separable(problem, camera, alpha, options)
    if options.method == "als":
        return solve_alternating(problem, camera, alpha, options)
    return solve(problem, camera, alpha, tolerance=options.tolerance, max_steps=options.max_steps)


def best_camera(
    points: Array, landmarks: Array, start: Camera, weights: Array | None = None
) -> Camera:
    """The camera at the distance of `start` that sees given landmarks (L, 3) of a face best.

    points: (L, 2) pixels from the principal point. `start` itself where a landmark is behind it.
    """
    if depths(start, landmarks).min() <= 0:
        return start
    L, still = len(landmarks), np.zeros(1)  # the solver wants a mode: one that moves nothing
    weights = np.ones(L) if weights is None else weights
    rigid = Problem(points, weights, landmarks, np.zeros((3, L)), np.zeros((L, 3, 1)), 1.0, np.inf)
    return solve(rigid, start, still, tolerance=1e-10).camera


def kappa_of(camera: str, distance: float | None) -> float:
    """1 / t_z of a camera name and a distance in metres; ValueError out of range."""
    if not isinstance(camera, str) or camera not in ("perspective", "orthographic"):
        raise ValueError(f"camera: {shown(camera)} is not perspective or orthographic")
    if camera == "orthographic":
        if distance is not None:
            raise ValueError("distance: an orthographic camera has none; leave it out")
        return 0.0
    if distance is None:
        return FIRST_KAPPA
    distance = number("distance", distance)
    if not NEAREST <= distance <= FARTHEST:  # False for NaN too
        raise ValueError(f"distance: {distance:g} m is not within {NEAREST:g} to {FARTHEST:g}")
    return 1.0 / distance


def _interocular(model: FaceModel, observation: Observation, pose: Camera) -> tuple[float, str]:
    """Distance of the eye centres in pixels and its definition.

    Measured on the observed points; where an eye corner is missing, on the mean face in the start's pose.
    """
    scheme: Scheme | None = None
    if isinstance(observation.scheme, str):
        scheme = model.scheme(observation.scheme)
        measured = eye_distance(observation.points, scheme)
        if np.isfinite(measured) and measured > 0:
            return measured, scheme.eyes_meaning
    scheme = scheme or next(iter(model.schemes.values()), None)
    if scheme is None:
        raise ValueError(
            "noise_percent: the model names no eyes to measure it by; give prior_weight instead"
        )
    estimated = eye_distance(project(pose, model.mean[scheme.vertices]), scheme)
    return (
        estimated,
        f"{scheme.eyes_meaning}, of the mean face in the fitted pose (an eye corner is missing)",
    )


def answer(task: Task, solution: Solution) -> Fit:
    """The solution as a Fit."""
    camera, problem, observation = solution.camera, task.problem, task.observation
    residual = problem.points - project(camera, problem.landmarks(solution.alpha))
    if len(residual) < len(observation.points):
        seen, residual = residual, np.full(observation.points.shape, np.nan)
        residual[observation.visible] = seen
    return Fit(
        model=task.model,
        observation=observation,
        options=task.options,
        camera=camera,
        alpha=solution.alpha,
        residual=residual,
        cost=solution.cost,
        prior_weight=float(problem.prior_weight),
        interocular_px=task.interocular_px,
        interocular_meaning=task.interocular_meaning,
        steps=solution.steps,
        status=solution.status,
    )
