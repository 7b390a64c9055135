"""The photograph without OpenGL: against rays shot one by one, in any order, to the pixel, and the same each time."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import scenes
from faceambig.arrays import vertex_normals
from faceambig.render import painter

SIZE = 40  # pixels of the small scenes


def cast(points, faces, colours, x, y):
    """Colour of the nearest triangle at a screen position, by solving for each; None where there is none.

    points (V, 3): screen x, y and 1 / depth. Also the least distance to an edge, as a share of the triangle.
    """
    best, colour, margin = 0.0, None, np.inf
    for face in faces:
        corners = points[face]
        system = np.vstack([corners[:, :2].T, np.ones(3)])
        if abs(np.linalg.det(system)) < 1e-9:
            continue
        share = np.linalg.solve(system, [x, y, 1.0])
        margin = min(margin, np.abs(share).min())
        near = share @ corners[:, 2]  # 1 / depth is linear on the screen
        if (share >= 0).all() and near > best:
            front = np.linalg.det(system) < 0  # y points down: counterclockwise as seen is negative
            weights = share * corners[:, 2] / near
            best = near
            colour = weights @ colours[face] if front else np.full(3, 255.0 * painter.INSIDE)
    return colour, margin


def triangles(rng, count):
    """`count` triangles that cut through each other, colours at the corners."""
    points = np.column_stack(
        [rng.uniform(-8, SIZE + 8, (3 * count, 2)), rng.uniform(0.5, 4.0, 3 * count)]
    )
    return points, np.arange(3 * count).reshape(-1, 3), rng.uniform(0, 255, (3 * count, 3))


def filled(points, faces, colours):
    picture = np.full((SIZE, SIZE, 3), -1.0, dtype=np.float32)
    painter.fill(picture, points, faces, colours)
    return picture


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_every_pixel_shows_the_nearest_triangle(seed):
    points, faces, colours = triangles(np.random.default_rng(seed), 9)
    picture = filled(points, faces, colours)
    checked = 0
    for row in range(0, SIZE, 3):
        for column in range(0, SIZE, 3):
            colour, margin = cast(points, faces, colours, column + 0.5, row + 0.5)
            if margin < 1e-6:  # on an edge either side is right
                continue
            checked += 1
            expected = np.full(3, -1.0) if colour is None else colour
            # float32 along a span of 40 samples and one division: 1e-5 of 255 and some
            np.testing.assert_allclose(picture[row, column], expected, atol=0.02, rtol=0)
    assert checked > 180


@given(st.permutations(range(9)))
def test_the_order_of_triangles_does_not_matter(order):
    points, faces, colours = triangles(np.random.default_rng(4), 9)
    assert np.array_equal(filled(points, faces[order], colours), filled(points, faces, colours))


@given(
    st.lists(st.tuples(st.floats(-0.45, 0.45), st.floats(-0.45, 0.45)), min_size=49, max_size=49)
)
def test_a_closed_surface_has_no_cracks(shifts):
    # 9 x 9 corners beyond the picture on all sides, the inner ones moved by up to half a cell
    grid = np.stack(np.meshgrid(np.linspace(-5, 45, 9), np.linspace(-5, 45, 9)), axis=-1)
    grid[1:-1, 1:-1] += 6.25 * np.array(shifts).reshape(7, 7, 2)
    number = np.arange(81).reshape(9, 9)
    a, b, c, d = (
        number[:-1, :-1].ravel(),
        number[:-1, 1:].ravel(),
        number[1:, :-1].ravel(),
        number[1:, 1:].ravel(),
    )
    faces = np.concatenate([np.stack([a, c, b], 1), np.stack([b, c, d], 1)])
    points = np.column_stack([grid.reshape(-1, 2), np.ones(81)])
    assert (filled(points, faces, np.full((81, 3), 255.0)) >= 0).all()


def test_a_triangle_behind_the_camera_is_left_out():
    photo = scenes.photo()
    away = photo.vertices.copy()
    away[:, 2] -= 2.0
    picture = painter.paint_photo(replace(photo, vertices=away), 60).astype(int)
    assert np.ptp(picture, axis=1).max() == 0  # nothing but the background's rows


@pytest.mark.parametrize("width", [420, 333, 250])
def test_pixels_of_the_photo_are_pixels_of_the_picture(width):
    photo = scenes.photo()
    depth, half = 0.5, 0.004
    errors = []
    for point in np.random.default_rng(width).uniform(150, 350, (12, 2)):  # pixels of the photo
        centre = np.append((point - photo.principal) * depth / photo.focal, depth)
        corners = centre + half * np.array([[-1, -1, 0], [-1, 1, 0], [1, 1, 0], [1, -1, 0]])
        spot = replace(
            photo, vertices=corners, faces=np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32),
            colours=np.full((4, 3), 255, dtype=np.uint8), occlusion=np.zeros(4, dtype=np.uint8),
        )  # fmt: skip
        picture = painter.paint_photo(spot, width).astype(float)
        dark = (picture[:, :1] - picture).sum(
            axis=2
        )  # no light reaches it: black on the background
        rows, columns = np.indices(dark.shape)
        seen = np.array([(dark * (columns + 0.5)).sum(), (dark * (rows + 0.5)).sum()]) / dark.sum()
        errors.append(seen - point * width / photo.width)
    # Two samples a pixel and axis: an edge, and so the middle, is right to a quarter of a pixel, without a bias:
    # the mean of 12 such errors has a standard deviation of 0.03 pixels.
    assert np.abs(errors).max() < 0.26
    assert np.abs(np.mean(errors, axis=0)).max() < 0.1


def test_a_photo_that_is_not_square_keeps_its_shape():
    photo = replace(scenes.photo(), width=500, height=300)
    assert painter.paint_photo(photo, 250).shape == (150, 250, 3)
    with pytest.raises(ValueError, match="width: 0"):
        painter.paint_photo(photo, 0)


def test_the_same_photo_gives_the_same_bytes():
    photo = scenes.photo()
    assert np.array_equal(painter.paint_photo(photo, 200), painter.paint_photo(photo, 200))


def test_occlusion_darkens_and_light_comes_from_above_left():
    photo = scenes.photo()
    white = replace(photo, colours=np.full_like(photo.colours, 190), occlusion=None)
    bright = painter.paint_photo(white, 200).astype(int)
    # the egg's middle is at 100, 100; compare forehead with chin, left cheek with right cheek
    assert bright[70, 80].mean() > 1.1 * bright[130, 120].mean()
    dark = painter.paint_photo(
        replace(white, occlusion=np.full(len(white.colours), 90, dtype=np.uint8)), 200
    )
    assert (dark[100, 100].astype(int) < 0.8 * bright[100, 100]).all()


def test_normals_of_a_sphere_point_outward():
    t, a = np.meshgrid(
        np.linspace(0.05, np.pi - 0.05, 40), 2 * np.pi * np.arange(80) / 80, indexing="ij"
    )
    sphere = np.stack([np.sin(t) * np.sin(a), np.cos(t), np.sin(t) * np.cos(a)], axis=-1).reshape(
        -1, 3
    )
    _, faces, _, _ = scenes.face(rings=40, sectors=80)
    inner = slice(80, -80)  # the two open rims see one side only
    cosine = (vertex_normals(sphere, faces) * sphere).sum(axis=1)[inner]
    assert cosine.min() > 0.999  # triangles of 4.5 degrees: half of that off is 0.9992


def test_the_photo_looks_like_the_stored_one():
    scenes.like_stored("photo", painter.paint_photo(scenes.photo(), 240))
