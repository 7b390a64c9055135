"""A pose from landmarks alone, in closed form: no guess by the user, the start of every fit (MATH.md 3)."""

from __future__ import annotations

import numpy as np
from scipy.linalg import lapack

from ..arrays import Array
from ..camera import Camera


def pose_from_points(points: Array, mean: Array, mean_pinv: Array, kappa: float) -> Camera:
    """Camera that maps the mean landmarks (L, 3), metres, near the points (L, 2), pixels from the principal point.

    Least squares affine map of the centred points, `mean_pinv` (3, L) being the pseudo-inverse of the centred mean
    landmarks; its 2 x 3 part made orthonormal by the polar decomposition, s the mean singular value; the third row is
    their cross product, so det R = +1 always. s is corrected for the depth of the landmarks at distance 1 / kappa.
    """
    x_mean, v_mean = points.mean(axis=0), mean.mean(axis=0)
    # LAPACK itself: np.linalg.svd spends three times as long around it
    U, sv, Vt, _ = lapack.dgesdd((mean_pinv @ (points - x_mean)).T, full_matrices=0)
    rows = U @ Vt
    R = np.vstack([rows, _cross(rows[0], rows[1])])
    q = R @ v_mean
    depth = 1.0 + kappa * q[2]
    s = float(sv.mean()) * depth
    return Camera(R, x_mean * depth / s - q[:2], s, kappa)


def centred_pinv(mean: Array) -> Array:
    """(3, L) pseudo-inverse of the centred landmarks (L, 3): of every start with the same landmarks."""
    centred = mean - mean.mean(axis=0)
    # Of the 3 x 3 normal matrix, not of the L x 3 one: landmarks in one plane are allowed
    return np.linalg.pinv(centred.T @ centred, hermitian=True) @ centred.T


def _cross(a: Array, b: Array) -> Array:
    # np.cross costs 15 us for two vectors; this is called once a fit
    return np.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )
