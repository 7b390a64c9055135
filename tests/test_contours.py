"""Contours: the boundary against plain definitions, pairs against all distances, the fit by what it must not break."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

import faceambig as fa
from faceambig.boundary import contour_points, inner_edges, occluding_boundary
from faceambig.camera import Camera, project
from faceambig.contours import SETTLED_MM, match
from faceambig.fitting.task import landmark_rows
from faceambig.io.edges import canny_edges
from faceambig.metrics import surface_difference
from faceambig.model import FaceModel, Subject
from faceambig.observation import portrait_camera
from faceambig.rotation import rotation_from_angles
from strategies import bumpy_model, face_of, poses

EGG = bumpy_model()


def border_and_edges(model: FaceModel) -> tuple[set[int], dict[tuple[int, int], list[int]]]:
    """Vertices of edges with one triangle, and the triangles of every edge, by a plain walk."""
    triangles: dict[tuple[int, int], list[int]] = {}
    for f, face in enumerate(model.faces.tolist()):
        for a, b in pairwise([*face, face[0]]):
            triangles.setdefault((min(a, b), max(a, b)), []).append(f)
    border = {v for edge, those in triangles.items() if len(those) != 2 for v in edge}
    return border, triangles


def camera_of(pose: tuple[float, float, float], kappa: float) -> Camera:
    return Camera(rotation_from_angles(*pose), np.array([0.01, -0.02]), 1500.0, kappa)


def photograph(face: Subject, distance: float | None, yaw: float, scheme: str = "ibug68"):
    """Observation and perfect edges of a face: the middles of the pixels its visible contours pass."""
    observation = fa.observe(face, distance=distance, yaw_deg=yaw, scheme=scheme)
    camera = portrait_camera(face, distance=distance, yaw_deg=yaw, scheme=scheme)
    points = contour_points(face.model, face.vertices, camera) + observation.centre
    return observation, np.unique(np.floor(points), axis=0) + 0.5


def egg_photograph(seed: int = 0, distance: float | None = 0.6, yaw: float = 20.0):
    alpha = np.random.default_rng(seed).standard_normal(EGG.n_modes)
    return photograph(face_of(EGG, alpha), distance, yaw, "egg")


# ---- the boundary ----


@pytest.mark.parametrize("kappa", [0.0, 2.0])
def test_an_edge_is_on_the_boundary_if_its_triangles_look_opposite_ways(kappa):
    border, triangles = border_and_edges(EGG)
    for pose in poses(20):
        camera = camera_of(pose, kappa)
        q = EGG.mean @ camera.R.T
        corners = q[EGG.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        middle = corners.mean(axis=1)  # MATH.md 5: the ray to the middle of the face
        ray = np.column_stack([kappa * (middle[:, :2] + camera.t), 1 + kappa * middle[:, 2]])
        away = (normals * ray).sum(axis=1) > 0
        expected = {
            edge
            for edge, those in triangles.items()
            if not border & set(edge) and away[those[0]] != away[those[1]]
        }
        boundary = occluding_boundary(EGG, EGG.mean, camera)
        assert {tuple(edge) for edge in boundary.edges.tolist()} == expected
        assert set(boundary.vertices.tolist()) == {v for edge in expected for v in edge}
        assert not border & set(boundary.vertices.tolist())


def test_the_border_of_a_real_mesh_is_no_contour(ict):
    border, triangles = border_and_edges(ict)
    assert len(triangles) == 27_872
    assert sum(len(those) == 1 for those in triangles.values()) == 361
    assert len(border) == 361
    edges, two = inner_edges(ict)
    assert not border & set(edges.ravel().tolist())
    assert len(edges) == sum(not border & set(edge) for edge in triangles)
    for edge, those in zip(edges[::97].tolist(), two[::97].tolist(), strict=True):
        assert sorted(triangles[edge[0], edge[1]]) == sorted(those)


def test_the_boundary_of_a_ball_is_the_circle_of_geometry():
    # A ball of radius r whose centre is z away shows its contour where the normal is r / z towards the camera
    centre = EGG.mean - np.array([0.0, 0.0, -0.085])
    ball = 0.09 * centre / np.linalg.norm(centre, axis=1)[:, None]
    for kappa, towards in ((0.0, 0.0), (4.0, 0.09 * 4)):
        camera = replace(camera_of((10, 5, 0), kappa), t=np.zeros(2))
        boundary = occluding_boundary(EGG, ball, camera)
        seen = boundary.vertices[boundary.visible]
        assert len(seen) > 25
        # one facet of the mesh spans 0.1 to 0.17 rad
        assert np.abs(-(ball[seen] @ camera.R[2]) / 0.09 - towards).max() < 0.17


def test_nose_before_cheek_is_found_and_the_outline_too(embedded):
    camera = portrait_camera(embedded.subject(1), distance=0.6, yaw_deg=25)
    surface = embedded.subject(1).vertices
    boundary = occluding_boundary(embedded, surface, camera)
    seen = boundary.vertices[boundary.visible]
    xy = project(camera, surface)
    turn = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    around = xy[seen][:, None] + 6 * np.stack([np.cos(turn), np.sin(turn)], axis=1)  # pixels
    gaps, _ = cKDTree(xy).query(around)
    inside = (np.asarray(gaps) < 4).all(
        axis=1
    )  # surface on all sides: vertices are 1 to 4 px apart
    assert np.isin(seen[inside], embedded.regions["nose"]).sum() > 5
    hull = [xy[:, 0].argmin(), xy[:, 0].argmax(), xy[:, 1].argmin()]  # temples or ears, and the top
    assert np.isin(hull, seen[~inside]).all()


def test_contour_points_lie_close_together_on_the_boundary():
    camera = camera_of((20, 5, 0), 2.0)
    boundary = occluding_boundary(EGG, EGG.mean, camera)
    points, xy = contour_points(EGG, EGG.mean, camera), project(camera, EGG.mean)
    both = boundary.visible[np.searchsorted(boundary.vertices, boundary.edges)].all(axis=1)
    for a, b in boundary.edges[both]:
        along = points - xy[a]
        way = xy[b] - xy[a]
        length = np.linalg.norm(way)
        place = along @ way / length**2
        on = np.abs(along[:, 0] * way[1] - along[:, 1] * way[0]) < 1e-9 * length
        inside = np.sort(place[on & (place >= -1e-9) & (place <= 1 + 1e-9)])
        assert inside[0] == pytest.approx(0, abs=1e-9)
        assert inside[-1] == pytest.approx(1, abs=1e-9)
        assert np.diff(inside).max() * length <= 0.25 + 1e-9


# ---- pairs ----


def test_pairs_are_mutual_nearest_neighbours_without_the_worst():
    observation, edges = egg_photograph()
    start = fa.fit(EGG, observation, distance=0.6)
    surface, centred, reach = start.vertices(), edges - observation.centre, 6.0
    vertices, rows = match(EGG, surface, start.camera, cKDTree(centred), reach)
    boundary = occluding_boundary(EGG, surface, start.camera)
    contour = boundary.vertices[boundary.visible]
    gaps = np.linalg.norm(project(start.camera, surface)[contour][:, None] - centred[None], axis=2)
    mutual = [
        (gaps[i, e], contour[i], e)
        for i, e in enumerate(gaps.argmin(axis=1))
        if gaps[:, e].argmin() == i and gaps[i, e] < reach
    ]
    assert len(mutual) > 25
    kept = sorted(mutual)[: len(mutual) - len(mutual) // 20]
    assert len(kept) < len(mutual)
    assert {(v, e) for _, v, e in kept} == set(zip(vertices, rows, strict=True))


def test_no_edge_within_reach_gives_no_pair():
    observation, edges = egg_photograph()
    start = fa.fit(EGG, observation, distance=0.6)
    for points in (edges + 5000.0, np.zeros((0, 2))):
        vertices, rows = match(EGG, start.vertices(), start.camera, cKDTree(points), 15.0)
        assert len(vertices) == len(rows) == 0


# ---- the fit ----


def test_a_settled_fit_is_the_optimum_of_landmarks_and_pairs_together():
    observation, edges = egg_photograph()
    found = fa.contour_fit(EGG, observation, edges, distance=0.6, pair_weight=0.5)
    assert found.status == "settled"
    assert found.movement_mm[-1] < SETTLED_MM <= found.movement_mm[:-1].min()
    assert found.iterations == len(found.movement_mm) < 30
    fit = found.fit
    assert fit.observation is observation
    assert fit.converged
    # the same points as one observation, from the closed-form pose
    again = fa.fit(EGG, found.observation, distance=0.6, prior_weight=fit.prior_weight)
    assert again.cost == pytest.approx(found.cost, rel=1e-7)  # both stop within 1e-8 of the optimum
    np.testing.assert_allclose(again.alpha, fit.alpha, atol=1e-4)
    # E of the landmarks, and that of the pairs beside it
    prior = fit.prior_weight * fit.alpha @ fit.alpha
    assert fit.cost == pytest.approx((fit.residual**2).sum() + prior, rel=1e-12)
    placed = project(fit.camera, fit.vertices()[found.pairs.vertices]) + observation.centre
    apart = ((placed - found.pairs.points) ** 2).sum()
    assert found.cost == pytest.approx(fit.cost + 0.5 * apart, rel=1e-12)
    known = {tuple(point) for point in edges.tolist()}
    assert all(tuple(point) in known for point in found.pairs.points.tolist())


@pytest.mark.parametrize("kind", ["orthographic", "free"])
def test_other_cameras_fit_contours_too(kind):
    observation, edges = egg_photograph(2, None if kind == "orthographic" else 0.5)
    options: dict[str, Any] = {"camera": "orthographic"} if kind == "orthographic" else {}
    found = fa.contour_fit(EGG, observation, edges, noise_percent=0.3, **options)
    assert found.status in ("settled", "cycle")
    assert len(found.pairs) > 25
    assert (found.fit.scale is None) == (kind == "free")
    placed = project(found.fit.camera, found.fit.vertices()[found.pairs.vertices])
    gaps = np.linalg.norm(placed + observation.centre - found.pairs.points, axis=1)
    assert gaps.mean() < 2.0  # pixels; facets of the egg are 10 wide


def test_contours_of_a_face_of_the_model_bring_it_nearer_to_the_truth():
    before, after = [], []
    for seed in range(6):
        observation, edges = egg_photograph(seed, yaw=10.0 * seed)
        alpha = np.random.default_rng(seed).standard_normal(EGG.n_modes)
        options: dict[str, Any] = {
            "distance": 0.6,
            "prior_weight": 30.0,
        }  # 20 landmarks leave much open
        for found, into in (
            (fa.fit(EGG, observation, **options), before),
            (fa.contour_fit(EGG, observation, edges, **options).fit, after),
        ):
            into.append(surface_difference(found.vertices(), EGG.vertices(alpha)).mean_mm)
    assert np.mean(after) < 0.8 * np.mean(before)  # measured 0.6


def test_a_cycle_is_seen_and_its_member_of_least_cost_kept():
    cycles = 0
    for seed in (
        17,
        2,
        25,
        38,
        24,
        54,
    ):  # more than are needed: another BLAS may end some otherwise
        observation, edges = egg_photograph(seed, yaw=15.0)
        # a reach of few pixels at a wrong distance lets pairs come and go
        options: dict[str, Any] = {"distance": 1.5, "max_distance_px": 4.0, "prior_weight": 0.01}
        found = fa.contour_fit(EGG, observation, edges, **options)
        if found.status != "cycle":
            continue
        cycles += 1
        # Stopped after each iteration; the pairs that return are those of the next one
        each = [
            fa.contour_fit(EGG, observation, edges, **options, max_iterations=k)
            for k in range(1, found.iterations + 1)
        ]
        assert all(one.status == "iteration limit reached" for one in each)
        last, tree = each[-1].fit, cKDTree(edges - observation.centre)
        vertices, rows = match(EGG, last.vertices(), last.camera, tree, 4.0)
        same = [
            k
            for k, one in enumerate(each)
            if np.array_equal(one.pairs.vertices, vertices)
            and np.array_equal(one.pairs.points, edges[rows])
        ]
        assert len(same) == 1
        assert same[0] < len(each) - 1
        assert found.cost == min(one.cost for one in each[same[0] :])
        if cycles == 3:
            return
    assert cycles > 0


@pytest.mark.parametrize("edges", [np.zeros((0, 2)), np.full((10, 2), -4000.0)])
def test_without_a_contour_the_landmarks_fit_is_given_and_said_to_be_that(edges):
    observation, _ = egg_photograph()
    found = fa.contour_fit(EGG, observation, edges, distance=0.6)
    plain = fa.fit(EGG, observation, distance=0.6)
    assert found.status == "no contour found"
    assert (len(found.pairs), found.iterations) == (0, 0)
    np.testing.assert_array_equal(found.fit.alpha, plain.alpha)
    assert found.fit.cost == found.cost == plain.cost
    assert len(found.observation.points) == len(observation.points)


def test_missing_and_weighted_landmarks_are_kept_as_given():
    observation, edges = egg_photograph()
    points, weights = observation.points.copy(), np.linspace(0.5, 2.0, 20)
    points[7] = np.nan
    given = replace(observation, points=points, weights=weights)
    found = fa.contour_fit(EGG, given, edges, distance=0.6)
    assert np.isnan(found.fit.residual[7]).all()
    again = fa.fit(EGG, found.observation, distance=0.6, prior_weight=found.fit.prior_weight)
    assert again.cost == pytest.approx(found.cost, rel=1e-7)


def test_same_edges_in_another_order_or_twice_give_the_same_fit():
    observation, edges = egg_photograph()
    found = fa.contour_fit(EGG, observation, edges, distance=0.6)
    mixed = np.random.default_rng(0).permutation(np.concatenate([edges, edges[::2]]))
    again = fa.contour_fit(EGG, observation, mixed, distance=0.6)
    np.testing.assert_array_equal(again.fit.alpha, found.fit.alpha)


def test_the_rows_of_pairs_are_not_kept_for_later_fits():
    observation, edges = egg_photograph(5)
    fa.fit(EGG, observation, distance=0.6)
    before = landmark_rows.cache_info()
    assert fa.contour_fit(EGG, observation, edges, distance=0.6).iterations > 2
    assert landmark_rows.cache_info().misses == before.misses


@pytest.mark.parametrize(
    ("argument", "value", "words"),
    [
        ("edges", np.zeros((3, 3)), r"edges: expected shape \(n, 2\)"),
        ("edges", [[1.0, np.nan]], "edges: every value must be finite"),
        ("edges", [[1e12, 0.0]], r"edges: 1e\+12 is not within"),
        ("pair_weight", 0.0, "pair_weight: 0 is not within"),
        ("pair_weight", float("nan"), "pair_weight: nan is not within"),
        ("max_distance_px", 0, "max_distance_px: 0 is not above 0"),
        ("max_distance_px", "far", "max_distance_px: 'far' is not a number"),
        ("max_iterations", 0, "max_iterations: 0 is not at least 1"),
        ("max_iterations", 2.5, "max_iterations: 2.5 is not a whole number"),
        ("distance", 0.01, "distance: 0.01 m is not within"),
        ("modes", 9, "modes: 9 of a model with 8"),
    ],
)
def test_wrong_arguments_are_refused_in_one_line(argument, value, words):
    observation, edges = egg_photograph()
    arguments: dict[str, Any] = {"edges": edges, "distance": 0.6} | {argument: value}
    with pytest.raises(ValueError, match=words) as refusal:
        fa.contour_fit(EGG, observation, **arguments)
    assert "\n" not in str(refusal.value)


def test_a_boundary_of_another_mesh_is_refused():
    with pytest.raises(ValueError, match=r"vertices: expected shape"):
        occluding_boundary(EGG, EGG.mean[:-1], camera_of((0, 0, 0), 0.0))


# ---- the table of MATH.md 5 ----


def d_s_of_the_table(model: FaceModel, actual: float, fitted: float, faces: int) -> np.ndarray:
    """(3 faces, 2) mm of fits to landmarks and to contours: faces of 100 modes, yaw 0, 20, 35, fitted with 70."""
    rows = []
    for alpha in np.random.default_rng(2019).standard_normal((6, 100))[:faces]:
        face = face_of(model, alpha)
        for yaw in (0.0, 20.0, 35.0):
            observation, edges = photograph(face, actual, yaw)
            options: dict[str, Any] = {"distance": fitted, "prior_weight": 1.0}
            landmarks = fa.fit(model, observation, **options)
            found = fa.contour_fit(model, observation, edges, **options)
            assert found.status != "no contour found"
            assert len(found.pairs) > 150
            rows.append(
                [
                    surface_difference(each.vertices(), face.vertices).mean_mm
                    for each in (landmarks, found.fit)
                ]
            )
    return np.array(rows)


@pytest.mark.slow
def test_at_the_right_distance_contours_bring_the_face_nearer(ict):
    table = d_s_of_the_table(ict, 0.6, 0.6, 6)
    # measured 1.98 -> 1.71 mm, 15 of 18; single faces and angles differ by 0.3 mm with the rounding of the edges
    assert table[:, 1].mean() < table[:, 0].mean() - 0.15
    assert (table[:, 1] < table[:, 0]).sum() >= 10


@pytest.mark.slow
def test_at_a_wrong_distance_contours_do_not_rescue_the_face(ict):
    table = d_s_of_the_table(ict, 0.3, 1.2, 3)
    assert table[:, 1].mean() > table[:, 0].mean() + 0.15  # measured 4.1 -> 4.9 mm
    assert (table[:, 1] > table[:, 0]).sum() >= 6


# ---- dense ----


@pytest.mark.parametrize("name", ["ict", "embedded"])
@pytest.mark.parametrize("scheme", ["all", "visible"])
def test_a_dense_fit_recovers_the_shape(name, scheme, request):
    model = request.getfixturevalue(name)
    alpha = np.random.default_rng(0).standard_normal(model.n_modes)
    face = face_of(model, alpha)
    observation = fa.observe(face, distance=0.6, yaw_deg=25, scheme=scheme)
    share = len(observation.points) / model.n_vertices
    assert share == 1 if scheme == "all" else 0.5 < share < 0.8
    options: dict[str, Any] = {"modes": model.n_modes, "box": None, "prior_weight": 1e-6}
    fit = fa.fit(model, observation, distance=0.6, **options)
    assert fit.converged
    assert surface_difference(fit.vertices(), face.vertices).mean_mm < 1e-4
    np.testing.assert_allclose(fit.alpha, alpha, atol=1e-3)


def test_dense_points_are_those_of_the_camera_and_of_no_hidden_vertex():
    face = face_of(EGG, np.full(EGG.n_modes, 0.5))
    every = fa.observe(face, distance=0.5, yaw_deg=30, scheme="all")
    some = fa.observe(face, distance=0.5, yaw_deg=30, scheme="visible")
    np.testing.assert_array_equal(every.scheme, np.arange(EGG.n_vertices))
    np.testing.assert_array_equal(some.points, every.points[some.vertices(EGG)])
    landmarks = fa.observe(face, distance=0.5, yaw_deg=30, scheme="egg")
    rows = EGG.scheme("egg").vertices
    np.testing.assert_allclose(every.points[rows], landmarks.points, atol=1e-9)
    boundary = occluding_boundary(
        EGG, face.vertices, portrait_camera(face, distance=0.5, yaw_deg=30, scheme="egg")
    )
    assert set(boundary.vertices[boundary.visible]) <= set(some.scheme)
    assert not set(boundary.vertices[~boundary.visible]) & set(some.scheme)
    noisy = fa.observe(face, distance=0.5, scheme="all", noise_percent=1.0, eyes_px=200.0)
    still = fa.observe(face, distance=0.5, scheme="all", eyes_px=200.0)
    # 1,700 numbers of sd 2 px: within 5 sd of it
    assert np.std(noisy.points - still.points) == pytest.approx(2.0, rel=0.09)


def test_rows_of_dense_points_are_not_kept_for_every_pose(embedded):
    from faceambig.fitting.task import _dense_rows

    before = landmark_rows.cache_info().currsize
    for yaw in (0.0, 10.0, 20.0):
        dense = fa.observe(embedded.subject(1), distance=0.6, yaw_deg=yaw, scheme="visible")
        fa.fit(embedded, dense, distance=0.6, modes=5)
    assert landmark_rows.cache_info().currsize == before
    assert _dense_rows.cache_info().currsize <= 2


# ---- edges of a picture ----


def disc(side: int = 200, radius: float = 60.0) -> np.ndarray:
    """(side, side) grey: a bright disc about the middle, its rim a pixel wide."""
    at = np.arange(side) + 0.5 - side / 2
    return (40 + 160 * np.clip(radius + 0.5 - np.hypot(at[:, None], at), 0, 1)).astype(np.uint8)


def test_edges_of_a_disc_lie_on_its_rim():
    for picture in (disc(), np.repeat(disc()[..., None], 3, axis=2)):
        edges = canny_edges(picture)
        assert len(edges) > 300
        distance = np.hypot(*(edges - 100.0).T)
        assert np.abs(distance - 60.0).max() < 1.1  # a pixel, and its middle
        assert (
            abs(edges.mean(axis=0) - 100.0).max() < 0.15
        )  # pixels count from the corner: no half lost


def test_weak_edges_beside_strong_ones_are_left_out_by_the_threshold():
    picture = disc()
    picture[:, :20] += 12  # a step of 12 grey levels beside one of 160
    assert canny_edges(picture)[:, 0].min() > 35
    assert canny_edges(picture, threshold=0.03)[:, 0].min() < 22


def test_a_picture_of_one_grey_has_no_edge():
    assert canny_edges(np.full((20, 30), 7, dtype=np.uint8)).shape == (0, 2)
    assert canny_edges(np.full((1, 1, 3), 7, dtype=np.uint8)).shape == (0, 2)


@pytest.mark.parametrize(
    ("pixels", "options", "words"),
    [
        (np.zeros((5, 5)), {}, r"pixels: expected uint8 .*found float64 \(5, 5\)"),
        (np.zeros((5, 5, 4), dtype=np.uint8), {}, r"found uint8 \(5, 5, 4\)"),
        (np.zeros((0, 5), dtype=np.uint8), {}, r"found uint8 \(0, 5\)"),
        ("photo.jpg", {}, "found 'photo.jpg'"),
        (disc(), {"threshold": 1.0}, "threshold: 1 is not within 0 to 1"),
        (disc(), {"blur_px": 0.0}, "blur_px: 0 is not within"),
    ],
)
def test_what_is_no_picture_has_no_edges(pixels, options, words):
    with pytest.raises(ValueError, match=words):
        canny_edges(pixels, **options)
