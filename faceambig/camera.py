"""One camera formula for scaled orthographic and perspective projection (MATH.md 1, equation U).

With kappa = 1 / t_z, s = f / t_z (pixels per metre at the depth of the model's origin) and q = R v:

    xhat = c + s (q_xy + t_xy) / (1 + kappa q_z)                                            (U)

kappa = 0 is exactly the paper's scaled orthographic camera SOP (t_xy is its t_2d, in metres); kappa > 0 is exactly the
pinhole with t = (t_x, t_y, 1 / kappa) and f = s / kappa. Distance infinity is a point of the family, not a limit.
Principal points c are subtracted at the border: below, pixels count from c.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import Array, read_only


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """Pose and projection of (U). Camera axes: x right, y down, z forward."""

    R: Array  # (3, 3) full rotation, model axes to camera axes
    t: Array  # (2,) t_xy, metres
    s: float  # pixels per metre at the depth of the model's origin
    kappa: float  # 1 / t_z, per metre; 0 is orthographic

    def __post_init__(self) -> None:
        object.__setattr__(self, "R", read_only(self.R))
        object.__setattr__(self, "t", read_only(self.t))

    @property
    def focal(self) -> float | None:
        """f in pixels, None when orthographic."""
        return self.s / self.kappa if self.kappa > 0 else None

    @property
    def distance(self) -> float | None:
        """t_z in metres, None when orthographic."""
        return 1.0 / self.kappa if self.kappa > 0 else None


def depths(camera: Camera, points: Array) -> Array:
    """1 + kappa q_z (N,) of model points (N, 3): depth relative to the origin's; <= 0 is behind the camera."""
    return 1.0 + camera.kappa * (points @ camera.R[2])


def project(camera: Camera, points: Array) -> Array:
    """Pixels (N, 2), from the principal point, of model points (N, 3) in metres. Equation U."""
    q = points @ camera.R.T
    return camera.s * (q[:, :2] + camera.t) / (1.0 + camera.kappa * q[:, 2:])


def camera_points(camera: Camera, points: Array, distance: float | None = None) -> Array:
    """Positions (N, 3), metres, in camera axes; `distance` stands in for t_z of an orthographic camera."""
    t_z = camera.distance if camera.distance is not None else distance
    if t_z is None:
        raise ValueError(
            "distance: an orthographic camera has no position; give a distance to draw from"
        )
    return points @ camera.R.T + np.array([*camera.t, t_z])


def jacobian(camera: Camera, points: Array, modes: Array) -> Array:
    """d xhat / d (alpha, d, t_xy, log s, kappa) as (L, 2, S + 7) at points v (L, 3) with modes Q (L, 3, S).

    d is a further rotation from the left, R <- exp([d]x) R, so that no formula is evaluated away from d = 0. With
    z = s / (1 + kappa q_z) and D = z [[1, 0, -(kappa / s) x], [0, 1, -(kappa / s) y]] (MATH.md 1):
    alpha D R Q; d -D [q]x; t_xy z I; log s xhat; kappa -(q_z z / s) xhat.
    """
    q = points @ camera.R.T
    z = camera.s / (1.0 + camera.kappa * q[:, 2])  # (L,)
    xy = z[:, None] * (q[:, :2] + camera.t)
    tilt = (-camera.kappa / camera.s * z)[:, None] * xy  # (L, 2) third column of D
    L, S = len(points), modes.shape[2]
    J = np.zeros((L, 2, S + 7))
    DR = z[:, None, None] * camera.R[:2] + tilt[:, :, None] * camera.R[2]
    np.matmul(DR, modes, out=J[:, :, :S])
    qx, qy, qz = q.T
    pose = J[:, :, S:]
    # -D [q]x: column i is D (e_i x q), with
    # e_x x q = (0, -q_z, q_y), e_y x q = (q_z, 0, -q_x), e_z x q = (-q_y, q_x, 0)
    pose[:, :, 0] = tilt * qy[:, None]
    pose[:, 1, 0] -= z * qz
    pose[:, :, 1] = -tilt * qx[:, None]
    pose[:, 0, 1] += z * qz
    pose[:, 0, 2] = -z * qy
    pose[:, 1, 2] = z * qx
    pose[:, 0, 3] = z
    pose[:, 1, 4] = z
    pose[:, :, 5] = xy
    pose[:, :, 6] = (-(qz * z) / camera.s)[:, None] * xy
    return J
