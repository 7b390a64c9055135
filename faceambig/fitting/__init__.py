"""fit(): the face and camera that explain the points of one photograph best."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np

from ..arrays import Array, number, read_only, shown
from ..camera import Camera, project
from ..model import FaceModel, Scheme
from ..observation import FLATTEST, MIN_POINTS, Observation, eye_distance
from ..rotation import R0, axis_angle
from .als import solve_alternating
from .result import Fit, FitOptions, Jacobian, Method, Status, Weighting
from .separable import solve_separable
from .solve import Problem, Solution, solve
from .start import centred_pinv, pose_from_points, refuse_face_from_behind

__all__ = ["Fit", "FitOptions", "Status", "fit"]

NEAREST = 0.2  # metres: nearer fits put the nose of large faces behind the camera (MATH.md 1)
FARTHEST = 1e6  # metres; beyond, ask for camera="orthographic"
FIRST_KAPPA = (
    1.0  # per metre: where a free distance starts; no second basin in kappa was met (MATH.md 3)
)


def fit(
    model: FaceModel,
    observation: Observation,
    *,
    camera: Literal["perspective", "orthographic"] = "perspective",
    distance: float | None = None,
    modes: int | None = None,
    box: float | None = 2.0,
    noise_percent: float = 1.0,
    prior_weight: float | None = None,
    tolerance: float = 1e-8,
    max_steps: int = 100,
    weighting: Weighting = "reprojection",
    method: Method = "joint",
    jacobian: Jacobian = "kaufman",
    als_rounds: int | None = 10,
) -> Fit:
    """The face and camera of least cost E (MATH.md 3) for one observation.

    Parameters
    ----------
    camera: "perspective", or "orthographic" for a far-away camera (scaled orthographic projection, paper section 4.1).
    distance: t_z, metres from the camera to the model's origin, held fixed; None lets the fit choose it (perspective).
    modes: shape modes used, the strongest first; None for the strongest 70, or all of a model with fewer.
    box: largest |alpha_j| in standard deviations; None for none.
    noise_percent: landmark noise the prior assumes, sd per coordinate in percent of the interocular distance; it sets
        lambda = sigma^2 in px^2.
    prior_weight: lambda in px^2 itself, instead of noise_percent.
    tolerance: relative cost above the optimum that still counts as converged.
    weighting: "reprojection", pixels in the picture; or "algebraic", the paper's DLT residual, Z_i (x_i - xhat_i) over
        the held t_z (over 1 m if free), always solved by SNLS, whose own value `status` is then about. *Biased*: it
        rewards moving the face nearer. A free distance, held to 0.1 to 100 m, comes out at about 0.75 of the truth from
        30 cm, 0.2 from 2.4 m, less with noise, and at 0.1 m with neither box nor prior (MATH.md 2.1). At a given
        distance E is mostly within 0.2 % of its least value. Under an orthographic camera the two weightings are one.
    method: "joint"; "snls", the paper's separable least squares, under perspective on the DLT and from there on E, with
        the same optimum; or "als", the paper's baseline, pose and shape in turn, which stops short of it.
    jacobian: of SNLS, Kaufman's or in full (Golub and Pereyra), with the same optimum.
    als_rounds: rounds of "als"; None for rounds until one gains less than `tolerance`, at most max_steps.

    Raises
    ------
    ValueError: an argument out of range, points that do not belong to the model, or that show the face from behind, as
        with left and right exchanged, in a mirrored picture or with y counted upward.

    Notes
    -----
    Joint Gauss-Newton on shape and camera with a box QP a step (fitting/solve.py), from a closed-form pose; the paper's
    own solvers are in fitting/separable.py and fitting/als.py. `cost` is E for all of them, so they can be compared.
    """
    options = FitOptions(
        modes, box, noise_percent, prior_weight, tolerance, max_steps,
        weighting, method, jacobian, als_rounds,
    )  # fmt: skip
    kappa = kappa_of(camera, distance)
    task = prepare(model, observation, options)
    free = camera == "perspective" and distance is None
    return solve_from(
        task, start_pose(task.problem, kappa), np.zeros(task.problem.modes.shape[2]), free
    )


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """An observation made ready for the solver: what every distance of a sweep shares."""

    model: FaceModel
    observation: Observation
    options: FitOptions
    problem: Problem
    interocular_px: float
    interocular_meaning: str


def prepare(model: FaceModel, observation: Observation, options: FitOptions) -> Task:
    """Visible points, their rows of the model, the prior's weight in px^2; ValueError if they do not match."""
    if not isinstance(model, FaceModel):
        raise ValueError(f"model: {shown(model)} is not a FaceModel; load one with load_model")
    if not isinstance(observation, Observation):
        raise ValueError(f"observation: {shown(observation)} is not an Observation")
    visible = observation.visible
    vertices = observation.vertices(model)
    mean, pinv, Q = landmark_rows(model, tuple(vertices[visible].tolist()), options.modes_of(model))
    points = observation.points[visible] - observation.centre
    weights = np.ones(len(points)) if observation.weights is None else observation.weights[visible]
    problem = Problem(
        points, weights, mean, pinv, Q, 0.0, np.inf if options.box is None else options.box
    )
    refuse_face_from_behind(problem, start_pose(problem, 0.0))
    interocular, meaning = _interocular(model, observation, problem)
    lam = options.prior_weight
    if lam is None:
        lam = (
            options.noise_percent / 100 * interocular
        ) ** 2  # MATH.md 3: the MAP estimate has lambda = sigma^2
    return Task(
        model, observation, options, replace(problem, prior_weight=lam), interocular, meaning
    )


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


def start_pose(problem: Problem, kappa: float) -> Camera:
    """The closed-form pose of the mean face at kappa = 1 / t_z."""
    return pose_from_points(problem.points, problem.mean, problem.mean_pinv, kappa)


def solve_from(task: Task, camera: Camera, alpha: Array, free_distance: bool = False) -> Fit:
    """The fit of a task from a given start, at the camera's distance or with the distance free."""
    problem = replace(task.problem, free_distance=free_distance)
    options = task.options
    if options.method == "snls" or options.weighting == "algebraic":
        solution = solve_separable(problem, camera, alpha, options)
    elif options.method == "als":
        solution = solve_alternating(problem, camera, alpha, options)
    else:
        solution = solve(
            problem, camera, alpha, tolerance=options.tolerance, max_steps=options.max_steps
        )
    return _answer(task, solution)


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


def _interocular(model: FaceModel, observation: Observation, problem: Problem) -> tuple[float, str]:
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
    start = start_pose(problem, 0.0)
    estimated = eye_distance(project(start, model.mean[scheme.vertices]), scheme)
    return (
        estimated,
        f"{scheme.eyes_meaning}, of the mean face in the fitted pose (an eye corner is missing)",
    )


def _answer(task: Task, solution: Solution) -> Fit:
    camera, problem, observation = solution.camera, task.problem, task.observation
    residual = np.full(observation.points.shape, np.nan)
    v = problem.mean + problem.modes @ solution.alpha
    residual[observation.visible] = problem.points - project(camera, v)
    perspective = camera.kappa > 0
    return Fit(
        model=task.model,
        observation=observation,
        options=task.options,
        camera=camera,
        alpha=solution.alpha,
        rotation=axis_angle(camera.R @ R0),
        translation=np.array([*camera.t, 1 / camera.kappa]) if perspective else camera.t,
        focal=camera.focal,
        scale=None if perspective else camera.s,
        residual=residual,
        cost=solution.cost,
        prior_weight=float(problem.prior_weight),
        interocular_px=task.interocular_px,
        interocular_meaning=task.interocular_meaning,
        steps=solution.steps,
        status=solution.status,
    )
