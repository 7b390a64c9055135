"""Observation and observe(): where the camera stands, what it sees, and what is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import faceambig as fa
from faceambig.observation import DISTANCES, FLATTEST, eye_distance, portrait_camera
from reference import pinhole
from strategies import face_of, tiny_model

MODEL = tiny_model(n_vertices=24)
SCHEME = MODEL.scheme("all")
SUBJECT = face_of(MODEL, np.array([1.0, -0.5, 0.3, 0.8, -1.2]))
POINTS = fa.observe(SUBJECT, distance=0.6, scheme="all").points
distances = st.floats(np.log(DISTANCES[0]), np.log(DISTANCES[1])).map(np.exp)


@given(
    distance=distances,
    pose=st.tuples(st.floats(-60, 60), st.floats(-30, 30), st.floats(-45, 45)),
    eyes_px=st.sampled_from([50.0, 100.0, 333.0]),
)
def test_points_are_where_a_pinhole_camera_sees_them(distance, pose, eyes_px):
    yaw, pitch, roll = pose
    asked = {"yaw_deg": yaw, "pitch_deg": pitch, "roll_deg": roll, "eyes_px": eyes_px}
    distance = float(np.clip(distance, *DISTANCES))  # exp(log(x)) may pass x by a digit
    observation = fa.observe(SUBJECT, distance=distance, scheme="all", **asked)
    camera = portrait_camera(SUBJECT, distance=distance, scheme="all", **asked)
    assert camera.distance == pytest.approx(distance, rel=1e-15)
    side = round(5 * eyes_px)
    assert observation.image_size == (side, side)
    assert observation.centre.tolist() == [side / 2, side / 2]
    expected = pinhole(camera, SUBJECT.vertices) + side / 2
    assert np.abs(observation.points - expected).max() < 1e-9 * side  # rounding of f X / Z


@pytest.mark.parametrize("distance", [0.2, 0.3, 1.2, 5.0, None])
def test_the_zoom_keeps_the_eyes_of_a_frontal_face_apart(embedded, distance):
    face = embedded.subject(1)
    scheme = embedded.scheme("ibug68")
    frontal = fa.observe(face, distance=distance)
    assert eye_distance(frontal.points, scheme) == pytest.approx(100.0, rel=1e-12)
    turned = portrait_camera(face, distance=distance, yaw_deg=30)
    assert turned.s == portrait_camera(face, distance=distance).s
    assert turned.t.tolist() == [0.0, 0.0]  # the origin, between the eyes, is in the middle


def test_an_orthographic_picture_is_the_limit_of_far_ones():
    far = fa.observe(SUBJECT, distance=None, scheme="all").points
    apart = [
        np.abs(fa.observe(SUBJECT, distance=d, scheme="all").points - far).max() for d in (2.5, 5.0)
    ]
    assert apart[0] / apart[1] == pytest.approx(2.0, rel=0.05)  # like 1 / t_z


def test_turning_goes_the_way_its_names_say(embedded):
    # yaw > 0 moves the nose to the left of the picture, pitch > 0 down, roll > 0 turns clockwise
    face = embedded.subject(1)
    nose, straight = 33, fa.observe(face, distance=1.0).points
    assert fa.observe(face, distance=1.0, yaw_deg=20).points[nose, 0] < straight[nose, 0] - 10
    assert fa.observe(face, distance=1.0, pitch_deg=20).points[nose, 1] > straight[nose, 1] + 5
    rolled = fa.observe(face, distance=1.0, roll_deg=20).points
    assert rolled[45, 1] > rolled[36, 1] + 10  # the eye at the right of the picture sinks
    assert straight[45, 0] > straight[36, 0]  # the subject's left eye is at the right


def test_noise_is_in_percent_of_the_eyes_in_the_picture():
    quiet = fa.observe(SUBJECT, distance=0.6, scheme="all", yaw_deg=40, eyes_px=400)
    noisy = fa.observe(
        SUBJECT, distance=0.6, scheme="all", yaw_deg=40, eyes_px=400, noise_percent=3, seed=5
    )
    sigma = 0.03 * eye_distance(quiet.points, SCHEME)  # of the turned face: closer together
    drawn = np.random.default_rng(5).normal(scale=sigma, size=(24, 2))
    assert np.abs(noisy.points - quiet.points - drawn).max() < 1e-9


def test_the_centre_is_given_or_the_pictures_or_the_points():
    points = np.vstack([POINTS, [[np.nan, np.nan]]])
    numbers = np.append(np.arange(24), 3)
    middle = (POINTS.min(axis=0) + POINTS.max(axis=0)) / 2
    cases: tuple[tuple[dict[str, Any], list[float], str], ...] = (
        ({"principal_point": (10, 20), "image_size": (640, 480)}, [10, 20], "given"),
        ({"image_size": (640, 480)}, [320, 240], "middle of the picture"),
        ({}, middle.tolist(), "middle of the points"),
    )
    for given_, centre, meaning in cases:
        observation = fa.Observation(points, numbers, **given_)
        assert observation.centre.tolist() == centre
        assert observation.centre_meaning == meaning


def test_a_point_is_visible_if_it_is_given_and_weighs_something():
    points, weights = POINTS.copy(), np.ones(24)
    points[3] = np.nan
    points[4, 1] = np.nan  # half a point is none
    weights[5] = 0
    seen = fa.Observation(points, "all", weights=weights).visible
    assert np.flatnonzero(~seen).tolist() == [3, 4, 5]
    assert np.flatnonzero(~fa.Observation(points, "all").visible).tolist() == [3, 4]


def test_vertices_are_those_of_the_scheme_or_the_numbers():
    assert fa.Observation(POINTS, "all").vertices(MODEL).tolist() == list(range(24))
    backwards: Any
    for backwards in (list(range(23, -1, -1)), np.arange(24, dtype=np.uint16)[::-1]):
        vertices = fa.Observation(POINTS, backwards).vertices(MODEL)
        assert vertices.dtype == np.intp
        assert vertices.tolist() == list(range(23, -1, -1))


@pytest.mark.parametrize(
    ("scheme", "n", "words"),
    [
        ("all", 20, "points: 20 for scheme 'all', which has 24"),
        ("ibug68", 24, "unknown scheme 'ibug68': this model has all"),
        (np.arange(24) + 1, 24, "scheme: vertex 24 is not within 0 to 23"),
        (np.arange(24) - 1, 24, "scheme: vertex -1 is not within 0 to 23"),
    ],
)
def test_points_that_do_not_belong_to_the_model_are_refused(scheme, n, words):
    with pytest.raises(ValueError, match=words):
        fa.Observation(POINTS[:n], scheme).vertices(MODEL)


def test_nothing_of_an_observation_can_be_written_to():
    points, weights = POINTS.copy(), np.ones(24)
    observation = fa.Observation(points, np.arange(24), weights=weights)
    for array in (observation.points, observation.scheme, observation.weights):
        assert isinstance(array, np.ndarray)
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    points[0] = 1.0  # the caller's own stay writable
    weights[0] = 2.0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"points": POINTS[:5], "scheme": np.arange(5)}, "points: 5 visible; 6 are needed"),
        ({"points": np.zeros((0, 2)), "scheme": "all"}, "points: 0 visible"),
        ({"points": POINTS[:, :1]}, r"points: expected shape \(n, 2\), found \(24, 1\)"),
        ({"points": "abc"}, "points: expected numbers, found 'abc'"),
        ({"points": np.where(POINTS[3, 0] == POINTS, np.inf, POINTS)}, "points: every value must"),
        ({"points": np.ones((24, 2))}, "points: 24 visible, but at only 1 different places"),
        ({"points": POINTS @ [[1, 0.5], [0, 0]]}, "points: they lie on one line"),
        ({"weights": -np.ones(24)}, "weights: -1 is negative"),
        ({"weights": np.ones(23)}, r"weights: expected shape \(24\), found \(23,\)"),
        ({"weights": np.full(24, np.nan)}, "weights: every value must be finite"),
        ({"weights": np.arange(24) < 5}, "weights: only 5 of 24 visible points weigh more"),
        ({"scheme": np.arange(23)}, "scheme: expected a name or 24 vertex numbers"),
        ({"scheme": np.arange(24.0)}, "scheme: expected a name or 24 vertex numbers"),
        ({"image_size": (0, 480)}, r"image_size: \(0, 480\) is not a width and a height"),
        ({"image_size": (640, -1)}, "image_size"),
        ({"image_size": (640,)}, "image_size"),
        ({"image_size": (640, np.nan)}, "image_size"),
        ({"image_size": (np.inf, 480)}, "image_size"),
        ({"principal_point": (1.0, np.nan)}, "principal_point: every value must be finite"),
        ({"principal_point": (1.0,)}, "principal_point: expected shape"),
    ],
)
def test_bad_observations_are_refused_by_name_and_value(change, words):
    with pytest.raises(ValueError, match=words):
        fa.Observation(**{"points": POINTS, "scheme": "all"} | change)


@given(st.floats(0, 2 * np.pi), st.floats(1.5, 100.0))
def test_a_thin_band_of_points_is_one_line_from_a_thousandth_on(angle, over):
    along = np.linspace(-100, 100, 24)
    across = np.where(np.arange(24) % 2, 1, -1) * 1.0
    across -= along * (along @ across) / (along @ along)
    ratio = np.linalg.norm(across) / np.linalg.norm(along)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    for share, flat in ((over, False), (1 / over, True)):
        band = np.stack([along, across * FLATTEST / ratio * share], axis=1) @ turn + 250
        if flat:
            with pytest.raises(ValueError, match="one line"):
                fa.Observation(band, "all")
        else:
            assert fa.Observation(band, "all").visible.all()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"distance": 0.1}, "distance: 0.1 m is not within 0.2 to 5"),
        ({"distance": 5.1}, "distance: 5.1 m is not within 0.2 to 5"),
        ({"distance": float("nan")}, "distance: nan m"),
        ({"noise_percent": -1}, "noise_percent: -1 is not within 0 to 20"),
        ({"noise_percent": float("nan")}, "noise_percent: nan"),
        ({"yaw_deg": float("inf")}, "yaw_deg: inf is not within -360 to 360"),
        ({"roll_deg": 400}, "roll_deg: 400 is not within"),
        ({"seed": -1}, "seed: -1 is negative"),
        ({"scheme": "farkas"}, "unknown scheme 'farkas'"),
        ({"eyes_px": 0.0}, "eyes_px: 0"),
        ({"eyes_px": -100.0}, "eyes_px: -100"),
        ({"eyes_px": float("nan")}, "eyes_px: nan"),
    ],
)
def test_a_photograph_that_cannot_be_taken_is_refused_by_name_and_value(change, words):
    with pytest.raises(ValueError, match=words):
        fa.observe(SUBJECT, **{"distance": 0.6, "scheme": "all"} | change)


def test_a_camera_inside_the_head_is_refused():
    nose = face_of(MODEL, np.zeros(5))
    vertices = nose.vertices.copy()
    vertices[7, 2] = 0.25  # metres in front of the eyes
    long = fa.Subject("long", "", vertices, None, MODEL)
    with pytest.raises(ValueError, match=r"distance: at 0\.2 m a point lies behind the camera"):
        fa.observe(long, distance=0.2, scheme="all")
