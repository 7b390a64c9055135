"""Visible vertices against rays traced one by one in space, through every triangle."""

from __future__ import annotations

import numpy as np
import pytest

from faceambig.camera import Camera
from faceambig.rotation import rotation_from_angles
from faceambig.visibility import MARGIN, visible_vertices
from reference import traced
from strategies import bumpy_model, poses


def camera_of(pose: tuple[float, float, float], kappa: float) -> Camera:
    return Camera(rotation_from_angles(*pose), np.array([0.01, -0.02]), 1500.0, kappa)


# Half orthographic; 0.5 m and nearer, where the sides of a head turn out of sight
KAPPAS = (0.0, 2.0, 0.0, 4.0)


@pytest.mark.parametrize("case", range(20))
def test_every_vertex_of_a_bumpy_shell_is_as_traced(case):
    # open at the back: both sides of a triangle hide, and rays pass through the hole
    model = bumpy_model(rings=14, around=22)
    camera = camera_of(poses(20)[case], KAPPAS[case % 4])
    lead = traced(model.faces, model.mean, camera, np.arange(model.n_vertices))
    clear = (
        np.abs(lead - MARGIN) > 1e-4
    )  # depth is taken as linear: facets of 2 cm are off by 0.05 mm
    assert clear.mean() > 0.97
    found = visible_vertices(model.faces, model.mean, camera)
    np.testing.assert_array_equal(found[clear], lead[clear] <= MARGIN)
    assert 0.2 < found.mean() < 0.8


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ict", "embedded"])
def test_contour_vertices_of_a_head_are_as_traced(name, request):
    from faceambig.boundary import occluding_boundary

    model, rng = request.getfixturevalue(name), np.random.default_rng(5)
    asked = hidden = 0
    for case, pose in enumerate(poses(20)):
        camera = camera_of(pose, KAPPAS[case % 4])
        surface = model.vertices(rng.standard_normal(model.n_modes))
        boundary = occluding_boundary(model, surface, camera)
        some = rng.choice(len(boundary.vertices), 20, replace=False)
        lead = traced(model.faces, surface, camera, boundary.vertices[some])
        clear = np.abs(lead - MARGIN) > 1e-5
        np.testing.assert_array_equal(boundary.visible[some][clear], lead[clear] <= MARGIN)
        asked, hidden = asked + int(clear.sum()), hidden + int((lead[clear] > MARGIN).sum())
    assert asked > 390
    assert 0.2 < hidden / asked < 0.8  # both answers were tried


def test_asked_vertices_are_answered_in_their_order():
    model = bumpy_model()
    camera = camera_of((30, 10, 5), 2.0)
    every = visible_vertices(model.faces, model.mean, camera)
    asked = np.random.default_rng(0).permutation(model.n_vertices)[:50]
    found = visible_vertices(model.faces, model.mean, camera, asked)
    np.testing.assert_array_equal(found, every[asked])
    assert visible_vertices(model.faces, model.mean, camera, np.zeros(0, dtype=int)).shape == (0,)


def test_two_millimetres_behind_a_triangle_are_forgiven_and_no_more():
    sheet = np.array(
        [[-0.1, -0.1, 0], [0.1, -0.1, 0], [0, 0.1, 0], [0, 0, -0.0019], [0, 0, -0.0021]]
    )
    faces = np.array([[0, 1, 2]], dtype=np.uint32)
    for kappa in (0.0, 2.0):
        camera = Camera(rotation_from_angles(0, 0, 0), np.zeros(2), 1000.0, kappa)
        assert visible_vertices(faces, sheet, camera).tolist() == [True, True, True, True, False]
        behind = Camera(rotation_from_angles(180, 0, 0), np.zeros(2), 1000.0, kappa)
        assert visible_vertices(faces, sheet, behind).all()  # now the points are in front


def test_what_is_behind_the_camera_is_neither_seen_nor_hides():
    # camera 0.2 m before the origin: the large triangle reaches behind it, the last vertex lies there
    points = np.array([[-1, -1, 0.1], [1, -1, 0.1], [0, 1, 0.5], [0, 0, 0.0], [0, 0, 0.4]])
    faces = np.array([[0, 1, 2]], dtype=np.uint32)
    camera = Camera(rotation_from_angles(0, 0, 0), np.zeros(2), 1000.0, 5.0)
    assert visible_vertices(faces, points, camera).tolist() == [True, True, False, True, False]


def test_no_triangle_hides_nothing():
    camera = Camera(rotation_from_angles(0, 0, 0), np.zeros(2), 1000.0, 0.0)
    none = np.zeros((0, 3), dtype=np.uint32)
    assert visible_vertices(none, np.zeros((3, 3)), camera).all()
