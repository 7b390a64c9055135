"""How shape and pose move the landmarks of a fit, to first order: Pi and J_p of MATH.md 4.

Pi is the Jacobian of the landmarks by alpha at the fit, in pixels: of the reprojection, or of the paper's DLT rows
f X - x Z, f Y - y Z over t_z (its Pi_persp, where x is what was observed; MATH.md 2, E10). Under an orthographic camera
held at its distance they are one. With the pose compensated Pi becomes (I - J_p J_p^+) Pi, J_p the Jacobian by the
pose.
"""

from __future__ import annotations

from typing import NamedTuple, cast

import numpy as np
from scipy.linalg import qr, solve_triangular

from .arrays import Array, IntArray, one_of, shown
from .camera import jacobian
from .fitting import Fit
from .fitting.task import MANY, landmark_rows
from .model import FaceModel

SAME_MOTION = 1e-9  # of a pose column: what is left of it beside the others is rounding


def pose_columns(pose: object, known: tuple[str, ...], free_distance: object) -> int:
    """How many parameters of the camera follow: 0 for known[0], "fixed"; else 6, or 7 with the distance."""
    one_of("pose", pose, known)
    if not isinstance(free_distance, bool | np.bool_):
        raise ValueError(f"free_distance: {shown(free_distance)} is not True or False")
    if pose == "fixed" and free_distance:
        raise ValueError(
            f"free_distance: a fixed pose has a fixed distance; give pose={known[1]!r} with it"
        )
    return 0 if pose == "fixed" else 7 if free_distance else 6


class Linear(NamedTuple):
    """Jacobian of the L visible landmarks, pixels."""

    shape: Array  # (2 L, S) by alpha
    pose: Array  # (2 L, 7) by turn, t_xy, log s, kappa


def linearised(model: FaceModel, fit: Fit) -> Linear:
    """The reprojection's, MATH.md 1."""
    points, modes = _landmarks(model, fit)
    S = modes.shape[2]
    J = jacobian(fit.camera, points, modes).reshape(-1, S + 7)
    return Linear(J[:, :S], J[:, S:])


def algebraic(model: FaceModel, fit: Fit) -> Linear:
    """The DLT's: K_i (R v_i + t) over t_z with K_i / t_z = [[s, 0, -kappa x], [0, s, -kappa y]], x observed."""
    points, modes = _landmarks(model, fit)
    observation, camera = fit.observation, fit.camera
    x = observation.points[observation.visible] - observation.centre
    K = np.zeros((len(x), 2, 3))
    K[:, 0, 0] = K[:, 1, 1] = camera.s
    K[:, :, 2] = -camera.kappa * x
    q = points @ camera.R.T
    pose = np.zeros((len(x), 2, 7))
    pose[:, :, :3] = K @ -_cross(q)
    pose[:, :, 3:5] = K[:, :, :2]
    pose[:, :, 5] = camera.s * (q[:, :2] + camera.t)
    pose[:, :, 6] = -q[:, 2:] * x
    return Linear(((K @ camera.R) @ modes).reshape(2 * len(x), -1), pose.reshape(-1, 7))


def _landmarks(model: FaceModel, fit: Fit) -> tuple[Array, Array]:
    """Visible landmarks of the fitted face (L, 3) and their modes (L, 3, S), metres."""
    S = len(fit.alpha)
    vertices = fit.observation.vertices(model)[fit.observation.visible]
    if len(vertices) > MANY:  # not worth keeping, see MANY
        mean, modes = model.rows(vertices)
        modes = np.ascontiguousarray(modes[:, :, :S])
    else:
        mean, _, modes = landmark_rows(model, tuple(vertices.tolist()), S)
    return mean + modes @ fit.alpha, modes


def _cross(q: Array) -> Array:
    """(L, 3, 3) of q (L, 3): [q]x."""
    x, y, z = q.T
    o = np.zeros_like(x)
    return np.stack([o, -z, y, z, o, -x, -y, x, o], axis=1).reshape(-1, 3, 3)


class PoseFree(NamedTuple):
    """What shape does to the landmarks when the pose follows."""

    shape: Array  # (2 L, S) (I - J_p J_p^+) Pi
    steps: Array  # (7, S) -J_p^+ Pi, how the pose follows


def without_pose(rows: Linear, columns: int) -> PoseFree:
    """The first `columns` of the pose taken out: 0, the pose is held; 6, its distance is held; 7.

    Thin QR, pivoted on columns of unit length: where two motions of the camera look the same, as a turn and a shift of
    landmarks that lie in one plane, one of them is left at rest.
    """
    Pi, J_p = rows.shape, rows.pose[:, :columns]
    steps = np.zeros((7, Pi.shape[1]))
    if columns == 0:
        return PoseFree(Pi, steps)
    unit = np.linalg.norm(J_p, axis=0)
    unit[unit == 0] = 1.0
    decomposed = qr(J_p / unit, mode="economic", pivoting=True, check_finite=False)
    Q, U, pivots = cast("tuple[Array, Array, IntArray]", decomposed)
    rank = int((np.abs(np.diag(U)) > SAME_MOTION * abs(U[0, 0])).sum())
    Q, U, pivots = Q[:, :rank], U[:rank, :rank], pivots[:rank]
    along = Q.T @ Pi
    steps[pivots] = -solve_triangular(U, along, check_finite=False) / unit[pivots, None]
    return PoseFree(Pi - Q @ along, steps)
