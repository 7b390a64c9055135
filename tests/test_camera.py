"""The unified camera (U): both paper cameras, and every column of its Jacobian."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given

from faceambig.camera import Camera, camera_points, depths, jacobian, project
from faceambig.fitting.problem import moved_camera
from reference import pinhole
from strategies import cameras, tiny_model

MODEL = tiny_model()


@given(cameras())
def test_it_is_the_pinhole_camera_at_every_distance(camera):
    points = MODEL.mean
    if camera.kappa > 0:
        assert (
            np.abs(project(camera, points) - pinhole(camera, points)).max() < 1e-9
        )  # pixels of O(1e3)


@given(cameras())
def test_it_is_scaled_orthographic_projection_at_kappa_zero(camera):
    flat = Camera(camera.R, camera.t, camera.s, 0.0)
    expected = camera.s * (MODEL.mean @ camera.R.T)[:, :2] + camera.s * camera.t  # the paper's SOP
    assert np.abs(project(flat, MODEL.mean) - expected).max() < 1e-10
    assert flat.focal is None
    assert flat.distance is None


@given(cameras())
def test_infinity_is_a_point_of_the_family(camera):
    flat = Camera(camera.R, camera.t, camera.s, 0.0)
    far = Camera(camera.R, camera.t, camera.s, 1e-9)
    # first order in kappa: at most s * |q|^2 * kappa = 3000 * 0.04 * 1e-9 px
    assert np.abs(project(far, MODEL.mean) - project(flat, MODEL.mean)).max() < 1e-6


@given(cameras())
def test_the_jacobian_equals_central_differences(camera):
    S = MODEL.n_modes
    alpha = np.linspace(-1, 1, S)
    J = jacobian(camera, MODEL.vertices(alpha), MODEL.control_modes)
    numeric = np.empty_like(J)
    for column in range(S + 7):
        h = 6e-6  # eps^(1/3) for parameters of O(1): a wrong step hides a wrong term
        ends = []
        for sign in (1, -1):
            step = np.zeros(S + 7)
            step[column] = sign * h
            # kappa may step below 0 here: (U) itself has no bound
            moved = moved_camera(camera, step[S:])
            moved = Camera(moved.R, moved.t, moved.s, camera.kappa + step[-1])
            ends.append(project(moved, MODEL.vertices(alpha + step[:S])))
        numeric[:, :, column] = (ends[0] - ends[1]) / (2 * h)
    for column in range(S + 7):
        scale = np.abs(numeric[:, :, column]).max()
        assert (
            np.abs(J - numeric)[:, :, column].max() < 1e-6 * scale + 1e-6
        )  # issue: 1e-6 of the largest entry


@given(cameras())
def test_turning_the_model_and_the_camera_back_changes_nothing(camera):
    turn = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
    turned = Camera(camera.R @ turn.T, camera.t, camera.s, camera.kappa)
    assert np.abs(project(turned, MODEL.mean @ turn.T) - project(camera, MODEL.mean)).max() < 1e-9


def test_depths_tell_what_is_behind_the_camera():
    camera = Camera(np.diag([1.0, -1, -1]), np.zeros(2), 1000.0, 10.0)
    assert depths(camera, np.array([[0, 0, 0.05], [0, 0, 0.15]])).tolist() == [0.5, -0.5]


def test_camera_points_of_an_orthographic_camera_need_a_distance():
    camera = Camera(np.eye(3), np.zeros(2), 1.0, 0.0)
    with pytest.raises(ValueError, match="distance"):
        camera_points(camera, np.zeros((1, 3)))
    assert camera_points(camera, np.zeros((1, 3)), 2.0).tolist() == [[0, 0, 2]]
