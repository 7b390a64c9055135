"""fit(): the face and camera that explain the points of one photograph best."""

from __future__ import annotations

from typing import Literal

import numpy as np

from ..arrays import Array
from ..camera import Camera, project
from ..model import FaceModel, Scheme
from ..observation import Observation, eye_distance
from ..rotation import R0, axis_angle
from .result import Fit, FitOptions, Status
from .solve import Problem, Solution, solve
from .start import pose_from_points

__all__ = ["Fit", "FitOptions", "Status", "fit"]

NEAREST = 0.2  # metres: nearer fits put the nose of large faces behind the camera (MATH.md 1)
FARTHEST = 1e6  # metres; beyond, ask for camera="orthographic"
FIRST_KAPPA = 1.0  # per metre: where a free distance starts; no second basin in kappa was met (MATH.md 3)
SPREAD = 1e-3  # smallest ratio of the second to the first singular value of the model's points


def fit(
    model: FaceModel,
    observation: Observation,
    *,
    camera: Literal["perspective", "orthographic"] = "perspective",
    distance: float | None = None,
    modes: int = 70,
    box: float | None = 2.0,
    noise_percent: float = 1.0,
    prior_weight: float | None = None,
    tolerance: float = 1e-8,
    max_steps: int = 100,
) -> Fit:
    """The face and camera of least cost E (MATH.md 3) for one observation.

    Parameters
    ----------
    camera: "perspective", or "orthographic" for a far-away camera (scaled orthographic projection, paper section 4.1).
    distance: t_z, metres from the camera to the model's origin, held fixed; None lets the fit choose it (perspective).
    modes: shape modes used, the strongest first; a model with fewer uses all it has.
    box: largest |alpha_j| in standard deviations; None for none.
    noise_percent: landmark noise the prior assumes, sd per coordinate in percent of the interocular distance; it sets
        lambda = sigma^2 in px^2.
    prior_weight: lambda in px^2 itself, instead of noise_percent.
    tolerance: relative cost above the optimum that still counts as converged.

    Raises
    ------
    ValueError: an argument out of range, or points that do not belong to the model.

    Notes
    -----
    Joint Gauss-Newton on shape and camera with a box QP a step (fitting/solve.py), from a closed-form pose.
    """
    options = FitOptions(modes, box, noise_percent, prior_weight, tolerance, max_steps)
    kappa = _kappa(camera, distance)
    visible = observation.visible
    vertices = observation.vertices(model)
    mean, Q = model.rows(vertices[visible] if not visible.all() else vertices)
    _refuse_flat(mean)
    Q = np.ascontiguousarray(Q[:, :, : min(modes, model.n_modes)])
    points = observation.points[visible] - observation.centre
    start = pose_from_points(points, mean, np.linalg.pinv(mean - mean.mean(axis=0)).copy(), kappa)
    interocular, meaning = _interocular(model, observation, start)
    lam = prior_weight if prior_weight is not None else (noise_percent / 100 * interocular) ** 2
    weights = np.ones(len(points)) if observation.weights is None else observation.weights[visible]
    problem = Problem(
        points, weights, mean, Q, lam, np.inf if box is None else box, camera == "perspective" and distance is None
    )
    solution = solve(problem, start, np.zeros(Q.shape[2]), tolerance=tolerance, max_steps=max_steps)
    return _answer(model, observation, options, solution, problem, interocular, meaning)


def _kappa(camera: str, distance: float | None) -> float:
    if camera not in ("perspective", "orthographic"):
        raise ValueError(f"camera: {camera!r} is not perspective or orthographic")
    if camera == "orthographic":
        if distance is not None:
            raise ValueError("distance: an orthographic camera has none; leave it out")
        return 0.0
    if distance is None:
        return FIRST_KAPPA
    if not NEAREST <= distance <= FARTHEST:  # False for NaN too
        raise ValueError(f"distance: {distance:g} m is not within {NEAREST:g} to {FARTHEST:g}")
    return 1.0 / distance


def _refuse_flat(mean: Array) -> None:
    spread = np.linalg.svd(mean - mean.mean(axis=0), compute_uv=False)
    if spread[1] <= SPREAD * spread[0]:
        raise ValueError("points: on the model they lie on one line, no pose can be found; add a point off the line")


def _interocular(model: FaceModel, observation: Observation, start: Camera) -> tuple[float, str]:
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
        raise ValueError("noise_percent: the model names no eyes to measure it by; give prior_weight instead")
    estimated = eye_distance(project(start, model.mean[scheme.vertices]), scheme)
    return estimated, f"{scheme.eyes_meaning}, of the mean face in the fitted pose (an eye corner is missing)"


def _answer(
    model: FaceModel,
    observation: Observation,
    options: FitOptions,
    solution: Solution,
    problem: Problem,
    interocular: float,
    meaning: str,
) -> Fit:
    camera = solution.camera
    residual = np.full(observation.points.shape, np.nan)
    v = problem.mean + problem.modes @ solution.alpha
    residual[observation.visible] = problem.points - project(camera, v)
    perspective = camera.kappa > 0
    return Fit(
        model=model,
        observation=observation,
        options=options,
        camera=camera,
        alpha=solution.alpha,
        rotation=axis_angle(camera.R @ R0),
        translation=np.array([*camera.t, 1 / camera.kappa]) if perspective else camera.t,
        focal=camera.focal,
        scale=None if perspective else camera.s,
        residual=residual,
        cost=solution.cost,
        prior_weight=problem.prior_weight,
        interocular_px=interocular,
        interocular_meaning=meaning,
        steps=solution.steps,
        status=solution.status,
    )
