"""R(r), its derivative and its inverse."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from faceambig.rotation import (
    R0,
    angles_from_rotation,
    axis_angle,
    rotation_from_angles,
    rotation_jacobian,
    rotation_matrix,
)
from reference import rotation_series, rotation_series_derivative
from strategies import CORNER_ANGLES, directions, rotation_vectors


@given(rotation_vectors())
def test_it_is_a_rotation_that_keeps_its_axis(r):
    R = rotation_matrix(r)
    assert np.abs(R @ R.T - np.eye(3)).max() < 4e-15  # rounding of nine products of O(1)
    assert np.linalg.det(R) > 0
    assert np.abs(R @ r - r).max() <= 1e-15 * max(1.0, np.pi)


@given(rotation_vectors())
def test_it_equals_the_power_series(r):
    # 60 terms in longdouble are exact to 1e-18 up to |r| = pi; near pi b W^2 is 1 - cos = 2: some roundings of 2
    assert np.abs(rotation_matrix(r) - rotation_series(r).astype(float)).max() < 3e-15


@given(rotation_vectors())
def test_the_derivative_equals_that_of_the_power_series(r):
    # measured 4e-16; the printed form of the paper loses 3e-9 at |r| = 1e-8 and would fail
    assert np.abs(rotation_jacobian(r) - rotation_series_derivative(r).astype(float)).max() < 1e-14


@given(directions(), st.sampled_from([a for a in CORNER_ANGLES if 1e-15 < a < 1e-3]))
def test_the_small_part_of_the_derivative_keeps_its_digits(axis, angle):
    # dR/dr - dR/dr(0) is of order |r|: compare relative to it, not to 1
    small = rotation_jacobian(angle * axis) - rotation_jacobian(np.zeros(3))
    exact = (
        rotation_series_derivative(angle * axis) - rotation_series_derivative(np.zeros(3))
    ).astype(float)
    assert (
        np.abs(small - exact).max() <= 1e-6 * angle + 2e-16
    )  # 2e-16: adding to generators of size 1


@given(rotation_vectors())
def test_the_axis_angle_comes_back(r):
    back = axis_angle(rotation_matrix(r))
    error = np.abs(back - r).max()
    if np.pi - np.linalg.norm(r) < 1e-7:  # here r and -r are the same rotation to rounding
        error = min(error, np.abs(back + r).max())
    assert error < 1e-14  # some roundings of |r| <= pi


@given(st.floats(-89, 89), st.floats(-89, 89), st.floats(-179, 179))
def test_yaw_pitch_and_roll_come_back(yaw, pitch, roll):
    back = angles_from_rotation(rotation_from_angles(yaw, pitch, roll))
    assert (
        np.abs(np.array(back) - (yaw, pitch, roll)).max() < 1e-9
    )  # degrees; pitch 89 costs two digits


def test_the_frontal_face_looks_at_the_camera_upright():
    assert np.array_equal(rotation_from_angles(0, 0, 0), R0)
    nose, crown = np.array([0, 0, 0.1]), np.array([0, 0.1, 0])
    assert (R0 @ nose)[2] < 0  # towards the camera
    assert (R0 @ crown)[1] < 0  # up in a picture whose y points down


def test_positive_yaw_turns_the_nose_to_the_left_of_the_picture_and_pitch_down():
    nose, crown = np.array([0, 0, 0.1]), np.array([0, 0.1, 0])
    assert (rotation_from_angles(20, 0, 0) @ nose)[0] < 0
    assert (rotation_from_angles(0, 20, 0) @ nose)[1] > 0
    assert (rotation_from_angles(0, 0, 20) @ crown)[0] > 0


def test_angles_that_are_no_numbers_are_refused():
    with pytest.raises(ValueError, match="yaw, pitch, roll"):
        rotation_from_angles(float("nan"), 0, 0)
