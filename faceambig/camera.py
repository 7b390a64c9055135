"""One camera formula for scaled orthographic and perspective projection (MATH.md 1, equation U).

With kappa = 1 / t_z, s = f / t_z (pixels per metre at the depth of the model's origin) and q = R v:

    xhat = c + s (q_xy + t_xy) / (1 + kappa q_z)                                            (U)

kappa = 0 is exactly the paper's scaled orthographic camera SOP (t_xy is its t_2d, in metres); kappa > 0 is exactly the
pinhole with t = (t_x, t_y, 1 / kappa) and f = s / kappa. Distance infinity is a point of the family, not a limit.
Principal points c are subtracted at the border: below, pixels count from c.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .arrays import Array, read_only


class View(NamedTuple):
    """The numbers of one camera, or of F of them stacked for one computation."""

    R: Array  # (3, 3) or (F, 3, 3)
    t: Array  # (2,) or (F, 1, 2)
    s: Array | float  # or (F, 1)
    kappa: Array | float  # or (F, 1)


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
    def view(self) -> View:
        return View(self.R, self.t, self.s, self.kappa)

    @property
    def focal(self) -> float | None:
        """f in pixels, None when orthographic."""
        return self.s / self.kappa if self.kappa > 0 else None

    @property
    def distance(self) -> float | None:
        """t_z in metres, None when orthographic."""
        return 1.0 / self.kappa if self.kappa > 0 else None


class Seen(NamedTuple):
    """Points as one camera sees them, or, with a leading axis F, many."""

    q: Array  # (N, 3) R v, metres, camera axes, from the model's origin
    z: Array  # (N,) s / (1 + kappa q_z), pixels per metre at the point
    xy: Array  # (N, 2) pixels from the principal point
    # () or (F,) True: a point is behind the camera and z, xy mean nothing; None: nowhere
    behind: Array | None


def see(view: View, points: Array) -> Seen:
    """Equation U for points (N, 3) in one view, or (F, N, 3) in F."""
    R, t, s, kappa = view
    q = points @ R.swapaxes(-1, -2)
    depth = 1.0 + kappa * q[..., 2]
    behind = None
    if depth.min() <= 0:
        behind = depth.min(-1) <= 0
        depth = np.where(depth > 0, depth, 1.0)
    z = s / depth
    return Seen(q, z, z[..., None] * (q[..., :2] + t), behind)


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

    d is a further rotation from the left, R <- exp([d]x) R, so that no formula is evaluated away from d = 0.
    """
    J = np.zeros((len(points), 2, modes.shape[2] + 7))
    view = camera.view
    fill_jacobian(J, view, see(view, points), modes)
    return J


def fill_jacobian(J: Array, view: View, seen: Seen, modes: Array) -> None:
    """Write the derivative of (U) into the first S + 7 columns of J ([F,] L, 2, at least S + 7), zeros before.

    With D = z [[1, 0, -(kappa / s) x], [0, 1, -(kappa / s) y]] (MATH.md 1): alpha D R Q; d -D [q]x; t_xy z I;
    log s xhat; kappa -(q_z z / s) xhat.
    """
    R, _, s, kappa = view
    S = modes.shape[-1]
    q, z, xy, _ = seen
    tilt = (z * (-kappa / s))[..., None] * xy  # third column of D
    DR = z[..., None, None] * R[..., None, :2, :] + tilt[..., None] * R[..., None, 2:, :]
    np.matmul(DR, modes, out=J[..., :S])
    pose = J[..., S:]
    z_q = z[..., None] * q
    # -D [q]x: column i is D (e_i x q), with
    # e_x x q = (0, -q_z, q_y), e_y x q = (q_z, 0, -q_x), e_z x q = (-q_y, q_x, 0)
    np.multiply(tilt, q[..., 1:2], out=pose[..., 0])
    pose[..., 1, 0] -= z_q[..., 2]
    np.multiply(tilt, -q[..., 0:1], out=pose[..., 1])
    pose[..., 0, 1] += z_q[..., 2]
    pose[..., 0, 2] = -z_q[..., 1]
    pose[..., 1, 2] = z_q[..., 0]
    pose[..., 0, 3] = z
    pose[..., 1, 4] = z
    pose[..., 5] = xy
    np.multiply((z_q[..., 2] / -s)[..., None], xy, out=pose[..., 6])
