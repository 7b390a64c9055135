"""A pose from landmarks alone, in closed form: no guess by the user, the start of every fit (MATH.md 3)."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.linalg import lapack

from ..arrays import Array
from ..camera import Camera
from .problem import Problem
from .solve import solve

# Sines of degrees that the nose points away from the camera, negative towards it. Measured on ICT-FaceKit and the cases
# of benchmarks/start_anywhere.py, 68 points: the closed form says -6 or less to yaw 75 and pitch 40, up to 8 to yaw 90,
# the refined pose -9.1 or less and up to 5.5. With left and right exchanged the signs turn. 6 points add a few degrees.
TOWARDS, AWAY = math.sin(math.radians(-10.0)), math.sin(math.radians(20.0))
BEHIND = math.sin(math.radians(7.2))
REFINED_NOISE = 0.00065  # metres of landmark noise, sd: 1 % of the distance of the eyes


def pose_from_points(points: Array, mean: Array, mean_pinv: Array) -> Camera:
    """Orthographic camera that maps the mean landmarks (L, 3), metres, near the points (L, 2), pixels from the centre.

    Least squares affine map of the centred points, `mean_pinv` (3, L) being the pseudo-inverse of the centred mean
    landmarks; its 2 x 3 part made orthonormal by the polar decomposition, s the mean singular value; the third row is
    their cross product, so det R = +1 always.
    """
    count = len(points)
    x_mean, v_mean = points.sum(axis=0) / count, mean.sum(axis=0) / count
    # LAPACK itself: np.linalg.svd spends three times as long around it
    U, sv, Vt, _ = lapack.dgesdd((mean_pinv @ (points - x_mean)).T, full_matrices=0)
    R = np.empty((3, 3))
    R[:2] = U @ Vt
    R[2] = _cross(*R[:2].tolist())
    s = float(sv[0] + sv[1]) / 2
    return Camera(R, x_mean / s - R[:2] @ v_mean, s, 0.0)


def at_distance(pose: Camera, mean: Array, kappa: float) -> Camera:
    """An orthographic pose of the mean landmarks (L, 3) at kappa = 1 / t_z: larger, as far as they lie beyond t_z."""
    depth = 1.0 + kappa * float(pose.R[2] @ mean.sum(axis=0)) / len(mean)
    return Camera(pose.R, pose.t, pose.s * depth, kappa)


def start_pose(problem: Problem, kappa: float) -> Camera:
    """Where the fit of a problem at kappa = 1 / t_z starts."""
    pose = pose_from_points(problem.points, problem.mean, problem.mean_pinv)
    return at_distance(pose, problem.mean, kappa)


def centred_pinv(mean: Array) -> Array:
    """(3, L) pseudo-inverse of the centred landmarks (L, 3): of every start with the same landmarks."""
    centred = mean - mean.mean(axis=0)
    # Of the 3 x 3 normal matrix, not of the L x 3 one: landmarks in one plane are allowed
    return np.linalg.pinv(centred.T @ centred, hermitian=True) @ centred.T


def _cross(a: list[float], b: list[float]) -> list[float]:
    # np.cross costs 15 us for two vectors; this is called once a fit
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def refuse_face_from_behind(problem: Problem, start: Camera) -> None:
    """ValueError if the points show a face from behind; `start` is their closed-form pose.

    A mirrored picture, or left and right exchanged in the order of the points, is explained by a head turned away,
    its relief inside out: det R = +1 leaves no other pose, and from far away it fits as well as the right one. No
    detector finds the points of a face from behind, so such a pose says that the points are wrong. Only near the
    profile the closed form is not sure; there the pose is refined with the shape, under the orthographic camera,
    whose two answers are mirror images and thus as far from the profile. Costs a comparison, near the profile a fit.
    """
    R = start.R
    if R[2, 2] < TOWARDS:
        return
    if R[2, 2] < AWAY:
        # Not the caller's prior and box: with neither, any pose will do
        lam = (REFINED_NOISE * start.s) ** 2
        likely = replace(problem, prior_weight=lam, box=2.0, free_distance=False)
        R = solve(likely, start, np.zeros(problem.modes.shape[2]), tolerance=1e-4).camera.R
    if R[2, 2] <= BEHIND:
        return
    degrees = math.degrees(math.asin(min(1.0, R[2, 2])))
    if R[1, 1] > 0:  # the model's up is down in the picture
        raise ValueError(
            f"points: the face would be upside down with the nose {degrees:.0f} degrees away from the camera, so y "
            "seems to count upward; give height - y, which counts from the top of the picture"
        )
    raise ValueError(
        f"points: the nose would point {degrees:.0f} degrees away from the camera, so left and right seem exchanged; "
        "order the points as the scheme does (right is the subject's), or give width - x if the picture is mirrored"
    )
