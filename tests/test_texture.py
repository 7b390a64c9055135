"""Colours from a photograph: seen ones against the colours it was painted with, the others against their origin."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import faceambig as fa
from faceambig import texture
from faceambig.arrays import vertex_normals
from faceambig.camera import Camera, project
from faceambig.render import painter
from faceambig.rotation import rotation_from_angles
from faceambig.texture import Source, bilinear, mirrored_vertices, sample_texture

SIDE = 600


def fit_of(model: fa.FaceModel, **view) -> fa.Fit:
    """A fit that is exact: of points of the mean face itself."""
    face = fa.Subject("mean", "", model.mean, None, model)
    observation = fa.observe(face, eyes_px=SIDE / 5, **view)
    return fa.fit(model, observation, distance=view["distance"], prior_weight=1e4)


def painted(fit: fa.Fit, colours: np.ndarray, ground: float = 0.0) -> np.ndarray:
    """The fitted face in its own camera, every vertex in its colour, without light."""
    vertices = fit.vertices()
    q = vertices @ fit.camera.R.T
    xy = project(fit.camera, vertices) + fit.observation.centre
    picture = np.full((SIDE, SIDE, 3), ground, dtype=np.float32)
    points = np.column_stack([xy, 1.0 / (1.0 / fit.camera.kappa + q[:, 2])])
    painter.fill(picture, points, fit.model.faces, colours.astype(np.float64))
    return picture.round().astype(np.uint8)


@pytest.fixture(scope="module")
def turned(embedded):
    return fit_of(embedded, distance=0.6, yaw_deg=30)


def smooth(model: fa.FaceModel) -> np.ndarray:
    """(N, 3) colours that vary smoothly over the face and differ from side to side."""
    x = model.mean
    return np.clip(128 + 1200 * np.column_stack([x[:, 0], x[:, 1], x[:, 0] - x[:, 1]]), 5, 250)


def test_seen_vertices_have_the_colours_of_the_photograph(embedded, turned):
    colours = smooth(embedded)
    found = sample_texture(turned, painted(turned, colours))
    seen = found.source == Source.SEEN
    gap = np.abs(found.colours[seen] - colours[seen]).max(axis=1)
    # 256 levels; a pixel is 0.5 mm of the face, over which the colours change by less than a level
    assert np.percentile(gap, 99) <= 2.5
    assert seen.mean() > 0.35
    assert sum(found.count(source) for source in Source) == embedded.n_vertices


def test_hidden_vertices_take_no_colour_of_what_hides_them(embedded, turned):
    # yaw 30 shows more of one side: the far ear and the back of the head are not in the picture
    found = sample_texture(turned, painted(turned, smooth(embedded)))
    q = turned.vertices() @ turned.camera.R.T
    back = q[:, 2] > np.percentile(q[:, 2], 90)
    assert not (found.source[back] == Source.SEEN).any()
    scheme = embedded.scheme("ibug68")
    row = {point: scheme.vertices[i] for i, point in enumerate(scheme.points)}
    # tip of the nose and the eye towards the camera; the other eye is turned away by more than 60 degrees
    assert [found.source[row[point]] for point in ("31", "43", "46", "37", "40")] == [2, 2, 2, 1, 1]


def test_mirrored_vertices_have_the_colour_of_the_other_side(embedded, turned):
    # the same colours on both sides: then there is no seam, and mirrored is as good as seen
    x = embedded.mean
    colours = np.clip(128 + 1200 * np.column_stack([np.abs(x[:, 0]), x[:, 1], x[:, 2]]), 5, 250)
    found = sample_texture(turned, painted(turned, colours))
    mirrored = found.source == Source.MIRRORED
    assert mirrored.mean() > 0.1
    gap = np.abs(found.colours[mirrored] - colours[mirrored]).max(axis=1)
    # a partner lies up to PAIRED away, where these colours differ by 5 levels
    assert np.percentile(gap, 95) <= 6


def test_the_seam_is_brought_to_the_light_of_the_seen_side(embedded, turned):
    # one side 60 levels darker: along the seam the mirrored side must not show the step
    colours = np.where(embedded.mean[:, :1] > 0, 200.0, 140.0) * np.ones(3)
    found = sample_texture(turned, painted(turned, colours))
    edges = np.concatenate([embedded.faces[:, [0, 1]], embedded.faces[:, [1, 2]]])
    kinds = found.source[edges]
    across = (kinds.min(axis=1) == Source.MIRRORED) & (kinds.max(axis=1) == Source.SEEN)
    values = found.colours[edges[across], 0].astype(float)
    apart = np.abs(embedded.mean[edges[across], 0]).min(axis=1) > 0.02  # not on the middle line
    assert apart.sum() > 30
    steps = np.abs(values[apart, 0] - values[apart, 1])
    assert np.median(steps) <= 15  # of 60


def test_filled_vertices_lie_between_the_coloured_ones(embedded, turned):
    found = sample_texture(turned, painted(turned, np.full((embedded.n_vertices, 3), 77.0), 77.0))
    assert found.count(Source.FILLED) > 0
    assert (found.colours == 77).all()
    assert str(found.count(Source.FILLED)) in found.words
    assert "mirrored from the other side" in found.words


def test_a_frontal_face_has_little_to_mirror(embedded):
    fit = fit_of(embedded, distance=1.0, yaw_deg=0)
    found = sample_texture(fit, painted(fit, smooth(embedded)))
    assert found.count(Source.MIRRORED) < 0.02 * embedded.n_vertices


def test_a_face_beyond_the_edge_is_sampled_only_inside(embedded, turned):
    colours = smooth(embedded)
    whole = painted(turned, colours)
    cut = whole[:, : SIDE // 2]
    found = sample_texture(turned, np.ascontiguousarray(cut))
    seen = found.source == Source.SEEN
    xy = project(turned.camera, turned.vertices()) + turned.observation.centre
    assert seen.any()
    assert (xy[seen, 0] <= SIDE // 2).all()


def test_a_picture_without_the_face_is_refused(turned):
    with pytest.raises(ValueError, match="rgb: the fitted face lies outside the picture"):
        sample_texture(turned, np.zeros((3, 3, 3), np.uint8))
    wrongs: tuple[Any, ...] = (np.zeros((9, 9), np.uint8), np.zeros((9, 9, 3)))
    for wrong in wrongs:
        with pytest.raises(ValueError, match=r"rgb: expected \(H, W, 3\) of 8 bits"):
            sample_texture(turned, wrong)


@pytest.mark.parametrize("name", ["embedded", "ict"])
def test_landmarks_of_both_sides_are_mirrored_onto_each_other(request, name):
    model = request.getfixturevalue(name)
    partner = mirrored_vertices(model.mean)
    assert (partner >= 0).mean() > 0.95
    scheme = model.scheme("ibug68")
    row = {point: i for i, point in enumerate(scheme.points)}
    for right, left in (("37", "46"), ("40", "43"), ("49", "55"), ("32", "36"), ("18", "27")):
        a, b = scheme.vertices[row[right]], scheme.vertices[row[left]]
        # both placed by hand: 4 mm
        assert np.linalg.norm(model.mean[partner[a]] - model.mean[b]) < 0.004, (right, left)
    tip = scheme.vertices[row["31"]]
    assert np.linalg.norm(model.mean[partner[tip]] - model.mean[tip]) < 0.004


def test_what_has_no_other_side_has_no_partner(embedded):
    right = embedded.mean[embedded.mean[:, 0] < -0.02]
    shifted = np.concatenate([right, [[0.3, 0.0, 0.0]]])
    assert mirrored_vertices(shifted)[-1] == -1 or mirrored_vertices(right)[0] == -1


def test_bilinear_is_exact_on_ramps():
    y, x = np.mgrid[0:20, 0:30]
    rgb = np.stack([4 * x, 5 * y, 2 * x + 3 * y], axis=-1).astype(np.uint8)
    at = np.random.default_rng(0).uniform((0.5, 0.5), (29.5, 19.5), (200, 2))
    u, v = (at - 0.5).T  # pixel i has its middle at i + 0.5
    assert np.abs(bilinear(rgb, at) - np.column_stack([4 * u, 5 * v, 2 * u + 3 * v])).max() < 1e-12
    corners = bilinear(rgb, np.array([[0.0, 0.0], [30.0, 20.0]]))
    assert corners.tolist() == [[0, 0, 0], [116, 95, 115]]  # clipped to the outer pixels


@pytest.mark.parametrize("distance", [0.4, None])
def test_a_vertex_faces_the_camera_within_60_degrees_of_its_ray(embedded, distance):
    kappa = 0.0 if distance is None else 1.0 / distance
    camera = Camera(rotation_from_angles(20, 5, 3), np.array([0.01, -0.02]), 1000.0, kappa)
    place = None if distance is None else -camera.R.T @ [*camera.t, distance]
    rays = (
        embedded.mean - place
        if place is not None
        else np.tile(camera.R[2], (len(embedded.mean), 1))
    )
    normals = vertex_normals(embedded.mean, embedded.faces)
    cosine = -(normals * rays).sum(axis=1) / np.linalg.norm(rays, axis=1)
    facing = texture.facing(camera, embedded.mean, embedded.faces)
    sure = np.abs(cosine - 0.5) > 1e-9
    assert np.array_equal(facing[sure], cosine[sure] > 0.5)
    assert 0.2 < facing.mean() < 0.6
