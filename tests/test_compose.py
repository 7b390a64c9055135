"""compose: what a picture shows is what was measured; the colours are the legend's; the camera is the fit's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import faceambig as fa
from faceambig import compose as fc
from faceambig.flex import plausible_limit
from faceambig.metrics import landmark_error_percent, surface_difference
from faceambig.model import Subject
from faceambig.observation import portrait_camera
from faceambig.scene import Photo
from strategies import face_of, tiny_model

MODEL = tiny_model()
SUBJECT = face_of(MODEL, np.array([1.0, -0.5, 0.3, 0.8, -1.2]))
TITLES = ("True", "Fits")


@pytest.fixture(scope="module")
def subject(embedded: fa.FaceModel) -> Subject:
    return embedded.subject(2)


@pytest.fixture(scope="module")
def observation(subject: Subject) -> fa.Observation:
    return fa.observe(subject, distance=0.3, yaw_deg=20, noise_percent=0.5)


@pytest.fixture(scope="module")
def fit(embedded: fa.FaceModel, observation: fa.Observation) -> fa.Fit:
    return fa.fit(embedded, observation, distance=1.2)


@pytest.fixture(scope="module")
def face(subject: Subject, fit: fa.Fit) -> fc.Face:
    return fc.measure(subject, fit)


@pytest.fixture(scope="module")
def picture(subject: Subject, observation: fa.Observation) -> Photo:
    camera = portrait_camera(subject, distance=0.3, yaw_deg=20)
    return fc.photo(subject, observation, camera, caption="taken from 30 cm")


def seen(vertices: np.ndarray, focal: float, principal: tuple[float, float]) -> np.ndarray:
    """Pixels of points in camera axes by the textbook: f X / Z + c."""
    return focal * vertices[:, :2] / vertices[:, 2:] + np.array(principal)


def test_the_measures_are_those_of_metrics(embedded, subject, observation, fit, face):
    scheme = embedded.scheme("ibug68")
    d_l = landmark_error_percent(observation.points, fit.projected(), scheme)
    apart = surface_difference(fit.vertices(), subject.vertices, embedded.evaluation)
    # the same formulas by another route: rounding
    assert face.d_l_percent == pytest.approx(d_l, rel=1e-10)
    assert face.d_l_percent == pytest.approx(fit.d_l_percent, rel=1e-10)
    assert np.abs(face.projected - fit.projected()).max() < 1e-9
    assert face.d_s_mm == pytest.approx(apart.mean_mm, rel=1e-12)
    assert np.array_equal(face.gaps_mm, 1e3 * apart.distances)
    assert face.plausible
    assert (face.flex_words, face.flex_mm) == ("", 0.0)


def test_points_that_are_not_visible_do_not_count(embedded, subject, observation):
    points = observation.points.copy()
    points[:17] = np.nan
    fit = fa.fit(embedded, fa.Observation(points, "ibug68", (500, 500)), distance=0.6)
    assert fc.measure(subject, fit).d_l_percent == pytest.approx(fit.d_l_percent, rel=1e-10)


def test_the_fitted_head_is_laid_on_the_true_one_without_changing_its_size(subject, face):
    model, rng = subject.model, np.random.default_rng(0)
    a, b = rng.integers(0, model.n_vertices, (2, 500))
    lengths = [np.linalg.norm(v[a] - v[b], axis=1) for v in (face.vertices, face.own_vertices)]
    assert np.abs(lengths[0] - lengths[1]).max() < 1e-14  # metres; a head is 0.2 m large
    # it is the same head, not its mirror image, and no other place lies closer
    again = surface_difference(face.vertices, subject.vertices, model.evaluation)
    assert np.abs(again.rotation - np.eye(3)).max() < 1e-9
    assert np.abs(again.translation).max() < 1e-9
    apart = np.linalg.norm(face.vertices - subject.vertices, axis=1)[model.evaluation]
    assert np.abs(1e3 * apart - face.gaps_mm).max() < 1e-9


def test_a_bent_face_is_the_face_of_the_changed_coefficients(embedded, subject, fit):
    f = fa.flexibility_modes(embedded, fit, count=1).directions[0]
    limit = plausible_limit(len(f))
    bent = fc.measure(subject, fit, 2.0 * f, limit=limit, flex_words="nose up", flex_mm=2.0)
    assert np.abs(bent.own_vertices - embedded.vertices(fit.alpha + 2.0 * f)).max() < 1e-15
    assert (bent.flex_words, bent.flex_mm) == ("nose up", 2.0)
    _, high = fa.flexibility_modes(embedded, fit, count=1).reach(0)
    for share, plausible in ((0.999, True), (1.001, False)):
        assert fc.measure(subject, fit, share * high * f, limit=limit).plausible is plausible


@pytest.mark.parametrize("yaw", [0, 20])
def test_the_photograph_shows_its_points_where_the_true_face_is(subject, yaw):
    observation = fa.observe(subject, distance=0.3, yaw_deg=yaw)
    camera = portrait_camera(subject, distance=0.3, yaw_deg=yaw)
    photo = fc.photo(subject, observation, camera, caption="c")
    at = observation.vertices(subject.model)
    points = seen(photo.vertices[at], photo.focal, photo.principal)
    assert np.abs(points - photo.observed).max() < 1e-9  # pixels
    assert np.array_equal(photo.observed, observation.points)
    assert np.array_equal(photo.projected, photo.observed)  # no fit yet
    assert (photo.width, photo.height, photo.caption) == (500, 500, "c")
    assert photo.names == subject.model.scheme("ibug68").points
    assert photo.fit_vertices is None


@pytest.mark.parametrize("distance", [0.3, 1.2])
def test_through_the_camera_the_fitted_face_carries_its_circles(
    embedded, subject, observation, picture, distance
):
    fit = fa.fit(embedded, observation, distance=distance)
    face = fc.measure(subject, fit)
    shown = fc.compose(subject, face, picture, titles=TITLES, view="camera")
    assert shown.through_camera
    photo = shown.photo
    assert photo.fit_vertices is not None
    assert photo.fit_focal is not None
    at = observation.vertices(embedded)
    points = seen(photo.fit_vertices[at], photo.fit_focal, photo.principal)
    assert np.abs(points - photo.projected).max() < 1e-9  # pixels
    assert np.array_equal(photo.projected, face.projected)
    assert photo.fit_vertices[:, 2].mean() == pytest.approx(distance, abs=0.15)  # a head's depth


def test_an_orthographic_fit_is_drawn_from_a_distance_that_stands_for_far_away(
    embedded, subject, observation, picture
):
    fit = fa.fit(embedded, observation, camera="orthographic")
    face = fc.measure(subject, fit)
    at = observation.vertices(embedded)
    apart = []
    for distance in (3.0, 6.0):
        photo = fc.with_fit(picture, face, whole=True, draw_from=distance)
        assert photo.fit_vertices is not None
        assert photo.fit_focal is not None
        points = seen(photo.fit_vertices[at], photo.fit_focal, photo.principal)
        apart.append(np.abs(points - photo.projected).max())
    # 3 m moves points q_z / 3 m of their way from the middle: at most 0.1 / 3 of 150 px; half of that from 6 m
    assert apart[0] < 5
    assert apart[1] == pytest.approx(apart[0] / 2, rel=0.05)


def test_other_views_keep_the_fitted_face_out_of_the_photograph(subject, face, picture):
    scene = fc.compose(subject, face, picture, titles=TITLES, view="side")
    assert scene.photo.fit_vertices is None
    assert np.array_equal(scene.photo.projected, face.projected)
    assert scene.photo.vertices is picture.vertices
    assert [view.name for view in scene.views] == ["side"]
    assert not scene.through_camera


def test_two_heads_stand_side_by_side_true_to_scale(subject, face, picture):
    scene = fc.compose(subject, face, picture, titles=TITLES, note="n")
    true, fitted = scene.heads
    assert (true.name, fitted.name) == ("true", "fit")
    assert (true.title, fitted.title) == TITLES
    assert np.array_equal(true.vertices, subject.vertices)
    assert np.array_equal(fitted.vertices, face.vertices)
    assert true.slot < fitted.slot
    for head in scene.heads:
        # turned any way about the pivot, a head stays within its half of the room between the two
        across = np.hypot(*(head.vertices - scene.pivot)[:, [0, 2]].T).max()
        assert across < (fitted.slot - true.slot) / 2
        assert np.array_equal(head.faces, subject.model.faces)
        assert head.lit
    assert scene.legend is None
    assert scene.note == "n"
    assert scene.pivot[0] == 0.0


def test_numbers_are_those_of_the_face(subject, face, picture, fit):
    numbers = fc.compose(subject, face, picture, titles=TITLES).numbers
    assert numbers.distance == pytest.approx(1.2)
    assert (numbers.d_l_percent, numbers.d_s_mm) == (face.d_l_percent, face.d_s_mm)
    assert numbers.converged is True
    assert numbers.eyes_meaning == fit.interocular_meaning
    stopped = replace(face, fit=replace(fit, status=fa.Status.MAX_STEPS), plausible=False)
    assert fc.numbers(stopped).converged is False
    assert fc.numbers(stopped).plausible is False


def test_difference_colours_are_the_legends_colours(embedded):
    legend = fc.difference_legend("mm", "grey")
    values = np.linspace(legend.low, legend.high, len(legend.colours))
    gaps = np.resize(values, len(embedded.evaluation))
    colours = fc.difference_colours(embedded, gaps)
    expected = np.resize(legend.colours, (len(gaps), 3))
    assert np.array_equal(colours[embedded.evaluation], expected)
    beyond = fc.difference_colours(embedded, np.full(len(gaps), 99.0))
    assert (beyond[embedded.evaluation] == legend.colours[-1]).all()
    assert legend.ticks[0] == legend.low
    assert legend.ticks[-1] == legend.high
    # a scale of magnitudes: lightness falls all the way (weights of sRGB luma)
    luma = legend.colours @ np.array([0.3, 0.59, 0.11])
    assert (np.diff(luma) < 0).all()


def test_what_is_not_measured_is_grey(embedded, subject, face, picture):
    scene = fc.compose(
        subject, face, picture, titles=TITLES, surface="difference", legend_words=("mm", "grey")
    )
    true, fitted = scene.heads
    outside = np.setdiff1d(np.arange(embedded.n_vertices), embedded.evaluation)
    assert len(outside) > 1000
    assert (fitted.colours[outside] == fc.UNMEASURED).all()
    measured = fitted.colours[embedded.evaluation].astype(int)
    assert (measured.max(axis=1) - measured.min(axis=1) > 20).all()  # none of them is a grey
    assert np.array_equal(fitted.colours, fc.difference_colours(embedded, face.gaps_mm))
    assert not fitted.lit  # its colours are values
    assert true.lit
    assert np.array_equal(true.colours, subject.colours)
    assert scene.legend is not None
    assert (scene.legend.title, scene.legend.note) == ("mm", "grey")


def test_a_model_without_a_region_is_coloured_all_over():
    colours = fc.difference_colours(MODEL, np.zeros(30))
    assert (colours == fc.scale_colours(np.zeros(1))).all()


def test_a_face_that_is_none_loses_its_colour(subject, face, picture):
    none = replace(face, plausible=False)
    fitted = fc.compose(subject, none, picture, titles=TITLES).heads[1]
    assert (fitted.colours == fitted.colours[:, :1]).all()
    values = fc.compose(subject, none, picture, titles=TITLES, surface="difference").heads[1]
    assert np.array_equal(values.colours, fc.difference_colours(subject.model, face.gaps_mm))


def test_colours_are_the_subjects_else_the_models_else_clay():
    own = np.full((30, 3), 7, dtype=np.uint8)
    coloured = replace(MODEL, colours=own + np.uint8(1))
    assert (fc.skin(replace(SUBJECT, colours=own)) == 7).all()
    assert (fc.skin(replace(SUBJECT, model=coloured)) == 8).all()
    assert (fc.skin(SUBJECT) == fc.CLAY).all()


def test_a_row_of_faces_stands_evenly_and_is_coloured_by_the_legend(embedded, subject, observation):
    fits = [fa.fit(embedded, observation, distance=d) for d in (0.3, 0.6, 1.2)]
    faces = [fc.measure(subject, fit) for fit in fits]
    camera = portrait_camera(subject, distance=0.3, yaw_deg=20)
    scene = fc.compose_row(
        subject, faces, fc.photo(subject, observation, camera, caption=""),
        titles=("t", "a", "b", "c"), captions=[(("x", "dim"),)] * 4, legend_words=("mm", ""),
    )  # fmt: skip
    assert [head.name for head in scene.heads] == ["true", "fit1", "fit2", "fit3"]
    assert [head.title for head in scene.heads] == ["t", "a", "b", "c"]
    slots = np.array([head.slot for head in scene.heads])
    assert np.abs(np.diff(slots) - fc.SPACING).max() < 1e-12
    assert abs(slots.mean()) < 1e-12
    for head, face in zip(scene.heads[1:], faces, strict=True):
        assert np.array_equal(head.colours, fc.difference_colours(embedded, face.gaps_mm))
        assert np.array_equal(head.vertices, face.vertices)
    assert [view.name for view in scene.views] == ["front", "side"]
    assert scene.legend is not None
    assert scene.numbers.d_s_mm == faces[-1].d_s_mm


def test_curves_are_the_measures_of_every_fit(subject, embedded, observation):
    sweep = fa.sweep_distance(embedded, observation, [0.3, 1.2])
    curves = fc.curves(subject, sweep, 0.3)
    faces = [fc.measure(subject, fit) for fit in (*sweep.fits, sweep.orthographic)]
    assert np.array_equal(curves.distances, sweep.distances)
    assert curves.d_l_percent.tolist() == [face.d_l_percent for face in faces[:-1]]
    assert curves.d_s_mm.tolist() == [face.d_s_mm for face in faces[:-1]]
    assert curves.orthographic == (faces[-1].d_l_percent, faces[-1].d_s_mm)
    assert (curves.true_distance, curves.tolerance_percent) == (0.3, 3.0)


def test_a_photograph_of_vertex_numbers_names_its_points_by_them():
    observation = fa.observe(SUBJECT, distance=0.5, scheme="all")
    numbered = fa.Observation(observation.points, np.arange(30), (500, 500))
    camera = portrait_camera(SUBJECT, distance=0.5, scheme="all")
    photo = fc.photo(SUBJECT, numbered, camera, caption="")
    assert photo.names == tuple(str(n) for n in range(30))
    fit = fa.fit(MODEL, numbered, distance=0.5)
    assert fc.measure(SUBJECT, fit).d_l_percent == pytest.approx(fit.d_l_percent, rel=1e-9)


def test_a_photograph_of_unknown_size_cannot_be_drawn():
    observation = fa.observe(SUBJECT, distance=0.5, scheme="all")
    sizeless = fa.Observation(observation.points, "all")
    camera = portrait_camera(SUBJECT, distance=0.5, scheme="all")
    with pytest.raises(ValueError, match="image_size: the photograph's width and height"):
        fc.photo(SUBJECT, sizeless, camera, caption="")


def test_an_unknown_view_is_refused_with_those_there_are(subject, face, picture):
    with pytest.raises(
        ValueError, match=r"view: 'below' is not one of front, three_quarter, .*top, free or camera"
    ):
        fc.compose(subject, face, picture, titles=TITLES, view="below")
