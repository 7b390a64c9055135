"""Posterior modes and the spread of a surface: against the joint covariance of shape and camera, inverted outright."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import faceambig as fa
from faceambig.camera import Camera, project
from faceambig.flex import evaluation_modes
from faceambig.rotation import rotation_matrix
from strategies import face_of, tiny_model

S = 8
MODEL = tiny_model(n_vertices=24, n_modes=S, seed=7)
CAMERAS = [("perspective", 0.3), ("perspective", 1.2), ("orthographic", None)]
POSES: list[dict[str, Any]] = [{"pose": "fixed"}, {}, {"free_distance": True}]


def fitted(camera: Any = "perspective", distance: float | None = 0.5, **change: Any) -> fa.Fit:
    face = face_of(MODEL, np.random.default_rng(2).standard_normal(S))
    observation = fa.observe(face, distance=0.5, scheme="all", yaw_deg=20, noise_percent=1)
    return fa.fit(MODEL, replace(observation, **change), camera=camera, distance=distance)


def covariance(fit: fa.Fit, sigma: float, columns: int) -> np.ndarray:
    """(S, S) of alpha: the inverse of the joint precision of shape and the first `columns` of the camera, cut out."""
    vertices, step = fit.observation.vertices(fit.model), 1e-4
    weights = fit.observation.weights
    root = np.ones(len(vertices)) if weights is None else np.sqrt(weights)

    def picture(theta: np.ndarray) -> np.ndarray:
        c, p = fit.camera, theta[S:]
        R = rotation_matrix(p[:3]) @ c.R
        camera = Camera(R, c.t + p[3:5], c.s * np.exp(p[5]), c.kappa + p[6])
        x = project(camera, fit.model.vertices(fit.alpha + theta[:S])[vertices])
        return (root[:, None] * x)[fit.observation.visible].ravel()

    J = np.stack([(picture(e) - picture(-e)) / (2 * step) for e in step * np.eye(S + 7)], axis=1)[
        :, : S + columns
    ]
    P = J.T @ J / sigma**2
    P[:S, :S] += np.eye(S)
    scale = np.sqrt(np.diag(P))
    return np.linalg.solve(P / np.outer(scale, scale), np.eye(S + columns))[:S, :S] / np.outer(
        scale[:S], scale[:S]
    )


def relative(found: np.ndarray, expected: np.ndarray) -> float:
    return float(np.abs(found - expected).max() / np.abs(expected).max())


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("how", POSES)
@pytest.mark.parametrize(("camera", "distance"), CAMERAS)
def test_all_modes_together_are_the_covariance_of_the_shape(camera, distance, how, weighted):
    weights = np.linspace(0, 3, 24) if weighted else None  # the first point counts for nothing
    fit = fitted(camera, distance, weights=weights)
    columns = (0, 6, 7)[POSES.index(how)]
    for sigma in (0.3, 3.0):
        modes = fa.posterior_modes(MODEL, fit, None, noise_px=sigma, **how)
        F = modes.directions.T
        C = covariance(fit, sigma, columns)
        assert relative(F @ F.T, C) < 1e-6  # differences of step 1e-4 are right to 1e-8
        Q = evaluation_modes(MODEL).reshape(-1, S)
        moved = Q @ F
        shares = moved.T @ moved
        assert relative(shares, np.diag(np.diag(shares))) < 1e-10  # no mode repeats another's
        assert (np.diff(np.diag(shares)) < 0).all()
        rms = 1e3 * np.sqrt(np.trace(Q @ C @ Q.T) / (len(Q) / 3))
        assert modes.total_mm == pytest.approx(rms, rel=1e-6)
        few = fa.posterior_modes(MODEL, fit, 2, noise_px=sigma, **how)
        assert np.array_equal(few.directions, modes.directions[:2])
        assert few.total_mm == modes.total_mm
        lengths = np.linalg.norm(moved.reshape(-1, 3, S), axis=1).mean(axis=0)
        assert modes.amplitude_mm == pytest.approx(1e3 * lengths, rel=1e-12)


@pytest.mark.parametrize(("camera", "distance"), CAMERAS)
def test_the_spread_adds_up_in_variances_in_its_order(camera, distance):
    fit = fitted(camera, distance)
    spread = fa.surface_spread(MODEL, fit, noise_px=1.0)
    fixed, free, open_ = (
        fa.posterior_modes(MODEL, fit, noise_px=1.0, **how).total_mm for how in POSES
    )
    assert 0 < fixed < free < open_ < spread.prior_mm
    assert spread.shape_mm == pytest.approx(fixed, rel=1e-9)
    assert spread.pose_mm**2 == pytest.approx(free**2 - fixed**2, rel=1e-6)
    assert spread.distance_mm**2 == pytest.approx(open_**2 - free**2, rel=1e-6)
    assert (spread.pose_free_mm, spread.total_mm) == pytest.approx((free, open_), rel=1e-9)


def test_without_information_the_prior_is_left_and_without_noise_nothing():
    fit = fitted()
    blind = fa.surface_spread(MODEL, fit, noise_px=1e9)
    assert blind.shape_mm == pytest.approx(blind.prior_mm, rel=1e-9)
    assert (blind.pose_mm, blind.distance_mm) == pytest.approx((0, 0), abs=1e-3)
    Q = evaluation_modes(MODEL)
    assert blind.prior_mm == pytest.approx(1e3 * np.sqrt((Q**2).sum() / len(Q)), rel=1e-12)
    sharp = fa.surface_spread(MODEL, fit, noise_px=1e-4)
    # 48 numbers fix 8 coefficients and a camera: the rest falls with the noise
    assert sharp.total_mm < 1e-3
    assert fa.surface_spread(MODEL, fit, noise_px=2e-4).total_mm == pytest.approx(
        2 * sharp.total_mm, rel=1e-6
    )


def test_many_noisy_pictures_scatter_as_the_modes_say():
    """MAP estimates of faces drawn from the prior miss them by the posterior's covariance."""
    rng = np.random.default_rng(11)
    missed, said = [], []
    for _ in range(200):
        face = face_of(MODEL, rng.standard_normal(S))
        observation = fa.observe(
            face, distance=0.6, scheme="all", noise_percent=1, seed=int(rng.integers(10**6))
        )
        fit = fa.fit(MODEL, observation, distance=0.6, box=None)
        gap = MODEL.vertices(fit.alpha) - face.vertices
        missed.append(1e6 * (gap**2).sum(axis=1).mean())
        said.append(fa.surface_spread(MODEL, fit).pose_free_mm ** 2)
    # a mean of 200 sums of some 8 squares: sd 3.5 % or, were one mode everything, 10 %
    assert np.mean(missed) == pytest.approx(np.mean(said), rel=0.25)


@pytest.mark.parametrize("how", POSES)
def test_the_noise_is_what_the_fit_assumed(embedded, how):
    fit = fa.fit(embedded, fa.observe(embedded.subject(2), distance=0.3), distance=0.6)
    sigma = 0.01 * fit.interocular_px  # noise_percent = 1
    own = fa.posterior_modes(embedded, fit, **how)
    assert own.noise_px == pytest.approx(sigma, rel=1e-12)
    given = fa.posterior_modes(embedded, fit, noise_px=own.noise_px, **how)
    assert np.array_equal(own.directions, given.directions)
    assert len(own.words) == 3
    assert all(own.words)
    assert (own.landmark_percent > 0).all()


def test_the_reference_figures_are_met(ict):
    # MATH.md 4 and 7: mean face, frontal, orthographic, px100, sigma 1
    points = ict.mean[ict.scheme("ibug68").vertices]
    apart = np.linalg.norm(points[36:42].mean(axis=0) - points[42:48].mean(axis=0))
    pixels = 100 / apart * points[:, :2] * [1, -1]
    observation = fa.Observation(pixels, "ibug68", principal_point=(0, 0))
    fit = fa.fit(ict, observation, camera="orthographic", prior_weight=1.0)
    fixed, free = (fa.posterior_modes(ict, fit, **how) for how in POSES[:2])
    assert (fixed.amplitude_mm[0], free.amplitude_mm[0]) == pytest.approx((0.72, 1.95), abs=0.005)
    assert (fixed.total_mm, free.total_mm) == pytest.approx((2.4, 3.3), abs=0.05)
    assert fa.surface_spread(ict, fit).prior_mm == pytest.approx(6.1, abs=0.05)


@pytest.mark.parametrize("how", POSES)
def test_posterior_modes_keep_place_and_sign_of_those_they_continue(how):
    own = fa.posterior_modes(MODEL, fitted(), 5, **how)
    order, turned = [3, 0, 2], np.array([-1.0, 1.0, -1.0])
    before = replace(own, directions=2 * turned[:, None] * own.directions[order])
    after = fa.posterior_modes(MODEL, fitted(), 5, previous=before, **how)
    expected = np.concatenate([turned[:, None] * own.directions[order], own.directions[[1, 4]]])
    assert np.abs(after.directions - expected).max() < 1e-12
    assert after.amplitude_mm == pytest.approx(own.amplitude_mm[[*order, 1, 4]], rel=1e-9)
    assert after.words[1] == own.words[0]


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"noise_px": 0}, "noise_px: 0 is not above 0 and finite"),
        ({"noise_px": -1.5}, "noise_px: -1.5 is not above 0"),
        ({"noise_px": np.nan}, "noise_px: nan is not above 0"),
        ({"noise_px": "1"}, "noise_px: '1' is not a number"),
        ({"count": 9}, "count: 9 is not within 1 to 8"),
        ({"pose": "compensated"}, "pose: 'compensated' is not fixed or free"),
        ({"pose": "fixed", "free_distance": True}, "free_distance: a fixed .*give pose='free'"),
        ({"previous": 1}, "previous: 1 is not a PosteriorModes"),
        ({"model": None}, "model: None is not a FaceModel"),
        ({"fit": None}, "fit: None is not a Fit"),
    ],
)
def test_what_cannot_be_asked_is_refused(asked, said):
    with pytest.raises(ValueError, match=said):
        fa.posterior_modes(**{"model": MODEL, "fit": fitted(), **asked})
    if not set(asked) - {"noise_px", "model", "fit"}:
        with pytest.raises(ValueError, match=said):
            fa.surface_spread(**{"model": MODEL, "fit": fitted(), **asked})


def test_a_fit_without_prior_or_that_did_not_converge_is_refused():
    given = fitted()
    free = fa.fit(MODEL, given.observation, distance=0.5, prior_weight=0)
    unfinished = fa.fit(MODEL, given.observation, distance=0.5, max_steps=1)
    for call in (fa.posterior_modes, fa.surface_spread):
        with pytest.raises(ValueError, match=r"noise_px: the fit had no prior.*give the landmarks"):
            call(MODEL, free)
        call(MODEL, free, noise_px=1.0)
        with pytest.raises(ValueError, match="fit: it did not converge"):
            call(MODEL, unfinished)


def test_posterior_modes_cannot_be_written_to():
    modes = fa.posterior_modes(MODEL, fitted())
    for array in (modes.directions, modes.amplitude_mm, modes.landmark_percent):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
