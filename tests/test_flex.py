"""Flexibility modes: the eigenproblem against brute force, their scale, their reach, their words."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import eig
from scipy.stats import chi

import faceambig as fa
from faceambig.camera import project
from faceambig.flex import DIRECTIONS, FlexibilityModes, gram, plausible_limit
from strategies import face_of, tiny_model

S = 8
MODEL = tiny_model(n_vertices=24, n_modes=S, seed=7)
AXES = {
    word: (axis, sign)
    for axis, pair in enumerate(DIRECTIONS)
    for word, sign in zip(pair, (1, -1), strict=True)
}
CAMERAS = [("perspective", 0.3), ("perspective", 1.2), ("orthographic", None)]


def fitted(
    seed: int = 0,
    camera: Literal["perspective", "orthographic"] = "perspective",
    distance: float | None = 0.5,
) -> fa.Fit:
    face = face_of(MODEL, np.random.default_rng(seed).standard_normal(S))
    observation = fa.observe(
        face, distance=0.5, scheme="all", yaw_deg=20, noise_percent=1, seed=seed
    )
    return fa.fit(MODEL, observation, camera=camera, distance=distance)


def picture(fit: fa.Fit, alpha: np.ndarray) -> np.ndarray:
    """(L, 2) visible landmarks of a face at the fit's own camera, pixels."""
    points = fit.model.vertices(alpha)[fit.observation.vertices(fit.model)]
    return project(fit.camera, points)[fit.observation.visible]


def by_differences(fit: fa.Fit, step: float = 1e-4) -> np.ndarray:
    """Pi (L, 2, S) by central differences of the picture."""
    a = fit.alpha
    sides = [(picture(fit, a + step * e), picture(fit, a - step * e)) for e in np.eye(len(a))]
    return np.stack([(plus - minus) / (2 * step) for plus, minus in sides], axis=-1)


def surface_change(model: fa.FaceModel, f: np.ndarray) -> np.ndarray:
    """(N, 3) metres: how each vertex moves along f."""
    return model.vertices(f) - model.vertices(0 * f)


@pytest.mark.parametrize(("camera", "distance"), CAMERAS)
def test_directions_are_the_eigenvectors_found_by_plain_differences(camera, distance):
    fit = fitted(1, camera, distance)
    Pi = by_differences(fit).reshape(-1, S)
    Q = MODEL.control_modes.reshape(-1, S)
    values, vectors = eig(Pi.T @ Pi, Q.T @ Q)  # neither symmetric nor ordered: another routine
    order = np.argsort(values.real)
    found = fa.flexibility_modes(MODEL, fit, count=S).directions
    for f, true in zip(found, vectors.real.T[order], strict=True):
        cosine = abs(f @ true) / np.linalg.norm(f) / np.linalg.norm(true)
        assert cosine > 1 - 1e-9  # Pi to 1e-8 by differences; the cosine is off by its square
    F = found @ gram(MODEL) @ found.T
    scale = np.sqrt(np.outer(np.diag(F), np.diag(F)))
    assert np.abs(F / scale - np.eye(S)).max() < 1e-10  # no mode repeats another's change


@settings(max_examples=20)
@given(seed=st.integers(0, 10_000))
def test_no_direction_moves_the_surface_more_for_its_landmarks(seed):
    fit = fitted(seed)
    modes = fa.flexibility_modes(MODEL, fit, count=3)
    Pi, Q = by_differences(fit).reshape(-1, S), MODEL.control_modes.reshape(-1, S)

    def flexibility(f: np.ndarray) -> np.ndarray:
        return np.linalg.norm(Q @ f, axis=0) / np.linalg.norm(Pi @ f, axis=0)

    rng = np.random.default_rng(seed)
    tried = rng.standard_normal((S, 3000))
    near = modes.directions[0] + 0.05 * np.linalg.norm(modes.directions[0]) * tried.T
    own = flexibility(modes.directions.T)
    assert (np.diff(own) < 0).all()  # the most flexible first
    # differences of step 1e-4 are right to 1e-8
    assert max(flexibility(tried).max(), flexibility(near.T).max()) <= own[0] * (1 + 1e-6)
    # the second among those that share nothing with the first (Courant)
    first = gram(MODEL) @ modes.directions[0]
    rest = tried - np.outer(modes.directions[0], first @ tried) / (modes.directions[0] @ first)
    assert flexibility(rest).max() <= own[1] * (1 + 1e-6)


@pytest.mark.parametrize("distance", [0.3, 1.2])
def test_a_direction_moves_the_measured_surface_by_one_millimetre_on_average(embedded, distance):
    fit = fa.fit(embedded, fa.observe(embedded.subject(2), distance=0.3), distance=distance)
    for f in fa.flexibility_modes(embedded, fit, count=6).directions:
        moved = np.linalg.norm(surface_change(embedded, f)[embedded.evaluation], axis=1)
        # exact but for the difference of two faces of 0.1 m: 1e-17 m in 1e-3
        assert 1e3 * moved.mean() == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize(("camera", "distance"), CAMERAS)
def test_landmark_percent_is_the_first_order_movement_of_the_points(embedded, camera, distance):
    observation = fa.observe(embedded.subject(4), distance=0.3)
    fit = fa.fit(embedded, observation, camera=camera, distance=distance)
    modes = fa.flexibility_modes(embedded, fit, count=4)
    step = 1e-3  # mm: central differences are right to its square
    for f, percent in zip(modes.directions, modes.landmark_percent, strict=True):
        plus, minus = picture(fit, fit.alpha + step * f), picture(fit, fit.alpha - step * f)
        per_mm = np.linalg.norm(plus - minus, axis=1).mean() / (2 * step)
        assert percent == pytest.approx(100 * per_mm / fit.interocular_px, rel=1e-6)


@pytest.mark.parametrize(("camera", "distance"), CAMERAS)
def test_what_first_order_leaves_out_falls_with_the_square_of_the_step(embedded, camera, distance):
    observation = fa.observe(embedded.subject(2), distance=0.3, yaw_deg=15)
    fit = fa.fit(embedded, observation, camera=camera, distance=distance)
    Pi, still = by_differences(fit), picture(fit, fit.alpha)
    for f in fa.flexibility_modes(embedded, fit, count=3).directions:
        errors = np.array(
            [
                np.abs(picture(fit, fit.alpha + w * f) - still - w * Pi @ f).max()
                for w in (8, 4, 2, 1)
            ]
        )  # millimetres; pixels
        if camera == "orthographic":  # exactly linear: what is left is that of the differences
            assert errors.max() < 1e-7
        else:
            ratios = errors[:-1] / errors[1:]
            assert (ratios > 3.5).all()
            assert (ratios < 4.5).all()


def test_hidden_points_hold_nothing(embedded):
    whole = fa.observe(embedded.subject(2), distance=0.6)
    points = whole.points.copy()
    points[:17] = np.nan  # the line of the jaw
    fit = fa.fit(embedded, fa.Observation(points, "ibug68", (500, 500)), distance=0.6)
    weightless = fa.Observation(
        whole.points, "ibug68", (500, 500), weights=np.isfinite(points[:, 0]).astype(float)
    )
    again = fa.flexibility_modes(embedded, fa.fit(embedded, weightless, distance=0.6), count=2)
    free, held = (
        fa.flexibility_modes(embedded, each, count=2)
        for each in (fit, replace(fit, observation=whole))
    )
    assert np.array_equal(free.directions, again.directions)
    assert free.landmark_percent[0] < 0.8 * held.landmark_percent[0]  # measured 0.3


def test_plausible_limit_is_three_deviations_above_the_mean_of_chi():
    for n in (1, 5, 70, 199):
        assert plausible_limit(n) == pytest.approx(chi.mean(n) + 3 * chi.std(n), rel=1e-9)
    assert plausible_limit(70) == pytest.approx(10.45, abs=0.01)  # MATH.md 4


def test_reach_ends_where_the_face_is_as_far_out_as_a_plausible_one(embedded):
    observation = fa.observe(embedded.subject(2), distance=0.3)
    fit = fa.fit(embedded, observation, distance=1.2)
    modes = fa.flexibility_modes(embedded, fit, count=4)
    limit = plausible_limit(70)
    assert np.linalg.norm(fit.alpha) < limit
    for mode, f in enumerate(modes.directions):
        low, high = modes.reach(mode)
        assert low < 0 < high
        for end in (low, high):
            assert np.linalg.norm(fit.alpha + end * f) == pytest.approx(limit, rel=1e-12)


def test_a_face_that_is_beyond_the_limit_by_itself_has_no_reach():
    fit = fitted()
    far = replace(fit, alpha=np.full(S, 2.0))
    modes = FlexibilityModes(far, np.eye(S), np.ones(S), ("",) * S)
    assert np.linalg.norm(far.alpha) > plausible_limit(S)
    assert modes.reach(0) == (0.0, 0.0)
    at_zero = FlexibilityModes(
        replace(fit, alpha=np.zeros(S)), 0.5 * np.eye(S), np.ones(S), ("",) * S
    )
    assert at_zero.reach(2) == pytest.approx((-2 * plausible_limit(S), 2 * plausible_limit(S)))


def region_movements(model: fa.FaceModel, f: np.ndarray) -> dict[str, np.ndarray]:
    """(3,) outward, up, forward of every vertex of each named region that d_S measures, and of the ears."""
    moved = surface_change(model, f)
    assert model.evaluation is not None
    named = {}
    for name, vertices in model.regions.items():
        if name == "ears" or np.isin(vertices, model.evaluation).mean() > 0.5:
            side = np.sign(model.mean[vertices, 0])
            x, y, z = moved[vertices].T
            named[name] = np.array([(side * x).mean(), y.mean(), z.mean()])
    return named


@pytest.mark.parametrize("subject", [1, 2, 5])
@pytest.mark.parametrize("distance", [0.3, 1.2])
def test_the_named_part_moves_most_and_that_way(embedded, subject, distance):
    fit = fa.fit(embedded, fa.observe(embedded.subject(subject), distance=0.3), distance=distance)
    modes = fa.flexibility_modes(embedded, fit, count=5)
    for f, words in zip(modes.directions, modes.words, strict=True):
        movements = region_movements(embedded, f)
        said = [phrase.rsplit(" ", 1) for phrase in words.split(", ")]
        assert 1 <= len(said) <= 2
        for part, way in said:
            axis, sign = AXES[way]
            assert sign * movements[part][axis] > 0
        most = max(np.abs(change).max() for change in movements.values())
        part, way = said[0]
        assert abs(movements[part][AXES[way][0]]) > most * (1 - 1e-9)
        if len(said) == 2:
            assert said[0][0] != said[1][0]
            assert said[0][1] != said[1][1]


@pytest.mark.parametrize("subject", [1, 2, 5])
def test_the_sign_brings_the_part_that_moves_most_in_depth_forward(embedded, subject):
    fit = fa.fit(embedded, fa.observe(embedded.subject(subject), distance=0.3), distance=1.2)
    for f in fa.flexibility_modes(embedded, fit, count=5).directions:
        assert max((change[2] for change in region_movements(embedded, f).values()), key=abs) > 0


def test_a_model_without_regions_speaks_of_the_face():
    modes = fa.flexibility_modes(MODEL, fitted(), count=S)
    assert all(words.split()[0] == "face" for words in modes.words)


def test_modes_are_measured_where_the_model_is():
    part = np.arange(10)
    measured = replace(MODEL, evaluation=part)
    fit = replace(fitted(), model=measured)
    for f in fa.flexibility_modes(measured, fit, count=3).directions:
        moved = np.linalg.norm(surface_change(measured, f)[part], axis=1)
        assert 1e3 * moved.mean() == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("count", [0, -1, S + 1])
def test_a_count_that_no_model_has_is_refused(count):
    with pytest.raises(ValueError, match=f"count: {count} is not within 1 to {S}"):
        fa.flexibility_modes(MODEL, fitted(), count=count)


def test_directions_cannot_be_written_to():
    modes = fa.flexibility_modes(MODEL, fitted(), count=2)
    for array in (modes.directions, modes.landmark_percent):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
