"""Rotations: R(r) of an axis-angle vector, its inverse, its derivative, and yaw, pitch, roll.

R(r) = I + a W + b W^2 with W = [r]x, a = sin t / t, b = (1 - cos t) / t^2, t = |r| (paper, appendix A). Half angles and
`sinc` keep every digit near t = 0, where the printed form of dR/dr divides by t^2 (MATH.md 2, E7).

The rotation of a face is R(r) R0 with R0 = diag(1, -1, -1): r = 0 is a frontal face, camera axes x right, y down, z
away from the viewer (MATH.md 1).
"""

from __future__ import annotations

import math

import numpy as np

from .arrays import Array, checked

# Frontal: model y up, z out of the face -> camera y down, z forward
R0 = np.diag([1.0, -1.0, -1.0])
# [e_i]x, index i first
GENERATORS = np.array(
    [
        [[0, 0, 0], [0, 0, -1], [0, 1, 0]],
        [[0, 0, 1], [0, 0, 0], [-1, 0, 0]],
        [[0, -1, 0], [1, 0, 0], [0, 0, 0]],
    ],
    dtype=np.float64,
)


def cross_matrix(r: Array) -> Array:
    """[r]x (3, 3): cross_matrix(r) @ v is the cross product r x v."""
    x, y, z = r
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotation_matrix(r: Array) -> Array:
    """R(r) (3, 3) of the axis-angle vector r (3,), radians."""
    x, y, z = r.tolist()
    a, b, _, _ = _coefficients(x * x + y * y + z * z)
    # I + a W + b W^2 written out: three times a step of every fit, and a third of the time of the matrix form
    return np.array(
        [
            [1 - b * (y * y + z * z), b * x * y - a * z, b * x * z + a * y],
            [b * x * y + a * z, 1 - b * (x * x + z * z), b * y * z - a * x],
            [b * x * z - a * y, b * y * z + a * x, 1 - b * (x * x + y * y)],
        ]
    )


def rotation_jacobian(r: Array) -> Array:
    """dR/dr_i as (3, 3, 3), index i first; equal to the form of appendix A, regular at r = 0."""
    a, b, da, db = _coefficients(float(r @ r))
    W, E = cross_matrix(r), GENERATORS
    return a * E + b * (E @ W + W @ E) + r[:, None, None] * (da * W + db * (W @ W))


def _coefficients(theta2: float) -> tuple[float, float, float, float]:
    """R = I + a W + b W^2: a, b and their derivatives divided by theta, at theta^2."""
    theta = math.sqrt(theta2)
    a = _sin_over(theta)
    # Half-angle for 1 - cos: the difference keeps no digit below theta = 1e-8.
    b = 0.5 * _sin_over(0.5 * theta) ** 2
    if theta2 < 1e-30:  # only against 0/0: here da and db meet a factor of order theta^2
        return a, b, -1 / 3, -1 / 12
    return a, b, (math.cos(theta) - a) / theta2, (a - 2 * b) / theta2


def _sin_over(x: float) -> float:
    # exact to rounding for every x > 0; np.sinc says the same in 7 us, ten times a fit
    return math.sin(x) / x if x > 0 else 1.0


def axis_angle(R: Array) -> Array:
    """r (3,) with R(r) = R and |r| <= pi, radians, of a rotation matrix (3, 3).

    Near |r| = pi the antisymmetric part vanishes; there the axis is read from the symmetric part.
    """
    vee = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])  # sin(t) axis
    sin_t, cos_t = float(np.linalg.norm(vee)), 0.5 * (float(np.trace(R)) - 1.0)
    angle = float(np.arctan2(sin_t, cos_t))
    if cos_t > -0.9:
        return vee / np.sinc(angle / np.pi)
    B = 0.5 * (R + R.T) - cos_t * np.eye(3)  # (1 - cos t) axis axis^T
    column = B[:, int(np.argmax(np.diag(B)))]
    axis = column / np.linalg.norm(column)
    # At exactly pi both signs give the same rotation.
    return angle * (axis if axis @ vee >= 0 else -axis)


def rotation_from_angles(yaw_deg: float, pitch_deg: float, roll_deg: float) -> Array:
    """Full rotation Rz(roll) Rx(pitch) Ry(yaw) R0 (3, 3), degrees, about the camera's axes.

    yaw > 0 moves the nose to the left of the picture, pitch > 0 moves it down, roll > 0 turns the head clockwise.
    """
    yaw, pitch, roll = np.radians(checked("yaw, pitch, roll", (yaw_deg, pitch_deg, roll_deg), (3,)))
    x, y, z = np.eye(3)
    return rotation_matrix(roll * z) @ rotation_matrix(pitch * x) @ rotation_matrix(yaw * y) @ R0


def angles_from_rotation(R: Array) -> tuple[float, float, float]:
    """(yaw, pitch, roll) in degrees of a full rotation (3, 3): the inverse of rotation_from_angles."""
    M = R @ R0
    pitch = np.arctan2(M[2, 1], np.hypot(M[2, 0], M[2, 2]))
    yaw = np.arctan2(-M[2, 0], M[2, 2])
    roll = np.arctan2(-M[0, 1], M[1, 1])
    return float(np.degrees(yaw)), float(np.degrees(pitch)), float(np.degrees(roll))
