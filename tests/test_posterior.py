"""posterior(): against MCMC, calibrated, inside the box; condition() is a model again; bad input."""

from __future__ import annotations

import importlib
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import emcee
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import binom, norm, truncnorm

import faceambig as fa
from faceambig.errors import NotConverged
from faceambig.fitting.problem import Problem, evaluate, normal_equations
from faceambig.fitting.solve import Solution, kkt_error
from faceambig.fitting.task import prepare
from faceambig.truncated import box_draws, box_moments, cut_moments
from reference import log_posterior
from strategies import bumpy_model, face_of, tiny_model

S = 4
MODEL = bumpy_model(n_modes=S)
STEPS = 2100  # of each of 100 walkers; a draw is forgotten after about 33
# Fifty times rarer than one flicker in the life of the project
RARE = 1e-4


def photograph(
    seed: int, distance: float, noise: float, limit: float = np.inf, model: fa.FaceModel = MODEL
) -> fa.Observation:
    rng = np.random.default_rng(seed)
    face = face_of(model, rng.standard_normal(model.n_modes).clip(-limit, limit))
    scheme = next(iter(model.schemes))
    return fa.observe(
        face, distance=distance, scheme=scheme, yaw_deg=20, noise_percent=noise, seed=seed
    )


def problem_of(post: fa.Posterior) -> Problem:
    options = post.sweep.orthographic.options
    return prepare(post.model, post.sweep.orthographic.observation, options).problem


def drawn_by_emcee(post: fa.Posterior, fit: fa.Fit, free: bool, seed: int) -> np.ndarray:
    """(n, S + 6 or 7) of the exact posterior by emcee's walkers, at the fit's distance or with log t_z free."""
    problem, n = problem_of(post), len(fit.alpha)
    nearest, last = np.log(post.distance_density.distances[[0, -1]])
    log_t = np.log(1 / fit.camera.kappa)
    point = [*fit.alpha, 1e-3, 0, 0, *fit.camera.t, np.log(fit.camera.s), *[log_t] * free]
    spread = [*[0.2] * n, *[0.01] * 3, *[2e-4] * 2, 0.005, *[0.05] * free]
    start = point + spread * np.random.default_rng(seed).standard_normal((100, len(point)))
    start[:, :n] = start[:, :n].clip(-0.999 * problem.box, 0.999 * problem.box)

    def log_p(theta: np.ndarray) -> np.ndarray:
        at = log_posterior(problem, fit.camera.R, theta, post.sigma_px, None if free else log_t)
        inside = (theta[:, -1] > nearest) & (theta[:, -1] < last)
        return np.where(inside, at, -np.inf) if free else at

    # Differential evolution: its steps follow the long valley between shape and pose. Not emcee's snooker beside it:
    # with a fifth of those the sds came out up to a fifth too small
    move = emcee.moves.DEMove()
    sampler = emcee.EnsembleSampler(len(start), len(point), log_p, moves=move, vectorize=True)
    sampler.random_state = np.random.RandomState(seed).get_state()  # emcee's own kind
    sampler.run_mcmc(start, STEPS)
    return np.asarray(sampler.get_chain(discard=STEPS // 3, thin=10, flat=True))


def agree(mean: np.ndarray, sd: np.ndarray, drawn: np.ndarray) -> None:
    """Means within 0.1 sd, sds within 15 %: 4,200 independent draws are good to 0.015 sd and 1 %."""
    assert (np.abs(mean - drawn.mean(axis=0)) < 0.1 * drawn.std(axis=0)).all()
    assert (np.abs(sd / drawn.std(axis=0) - 1) < 0.15).all()


# --- against Markov chains, which share only the equation -----------------------------------------


def test_shapes_at_one_distance_are_those_of_a_markov_chain_in_a_box_that_cuts():
    observation = photograph(2, 0.4, 2.0, limit=1.5)
    post = fa.posterior(MODEL, observation, noise_percent=2.0, box=1.5)
    fit = post.sweep.nearest(0.4)
    assert (np.abs(fit.alpha) == 1.5).any()  # the optimum is on the wall
    chain = drawn_by_emcee(post, fit, free=False, seed=2)[:, :S]
    narrow = fa.posterior(
        MODEL, observation, np.array([1.0, 1.0001]) / fit.camera.kappa,
        noise_px=post.sigma_px, box=1.5, beyond=0.0,
    )  # fmt: skip
    mean, covariance = narrow.shape_moments()
    agree(mean, np.sqrt(np.diag(covariance)), chain)
    draws = narrow.sample(4000, seed=5).alpha
    assert np.abs(draws).max() <= 1.5
    agree(draws.mean(axis=0), draws.std(axis=0), chain)


@pytest.mark.parametrize("box", [None, 1.0])
def test_distances_and_shapes_are_those_of_a_markov_chain(box):
    observation = photograph(0, 0.5, 1.0, limit=box or np.inf)
    post = fa.posterior(MODEL, observation, box=box, beyond=0.0)
    best = min(post.sweep.fits, key=lambda fit: fit.cost)
    chain = drawn_by_emcee(post, best, free=True, seed=0)
    draws = post.sample(4000, seed=1)
    agree(draws.alpha.mean(axis=0), draws.alpha.std(axis=0), chain[:, :S])
    mean, covariance = post.shape_moments()
    agree(mean, np.sqrt(np.diag(covariance)), chain[:, :S])
    log_t = np.log(draws.distances)[:, None]
    agree(log_t.mean(axis=0), log_t.std(axis=0), chain[:, -1:])
    for level in (0.5, 0.95):
        interval = post.interval(level)
        low, high = np.log(interval.low), np.log(interval.high or np.inf)
        # About 4,200 independent draws: 0.8 points; Laplace is allowed the rest
        assert np.mean((chain[:, -1] > low) & (chain[:, -1] < high)) == pytest.approx(
            level, abs=0.04
        )


@pytest.mark.parametrize("box", [None, 1.0])
def test_distances_weigh_as_much_as_the_integrals_over_shape_and_pose(box):
    # The determinant and the share inside the box move a density by less than a chain of this length can tell
    observation = photograph(3, 0.5, 1.0, limit=box or np.inf)
    post = fa.posterior(MODEL, observation, box=box)
    problem, laplace = problem_of(post), post.laplace
    rng, found, said = np.random.default_rng(0), [], []
    for distance in (0.25, 0.5, 2.0):
        fit = post.sweep.nearest(distance)
        point = evaluate(problem, fit.camera.view, fit.alpha)
        H, _ = normal_equations(problem, *point[:4])
        # Importance sampling; a proposal half as wide again leaves no tail without draws
        scale = np.linalg.cholesky(2.25 * post.sigma_px**2 * np.linalg.solve(H, np.eye(len(H))))
        centre = np.array([*fit.alpha, 0, 0, 0, *fit.camera.t, np.log(fit.camera.s)])
        z = rng.standard_normal((60_000, len(H)))
        theta = centre + z @ scale.T
        log_p = log_posterior(
            problem, fit.camera.R, theta, post.sigma_px, -np.log(fit.camera.kappa)
        )
        log_w = log_p + 0.5 * (z**2).sum(axis=1) + np.log(np.diag(scale)).sum()
        w = np.exp(log_w - log_w.max())
        assert w.sum() ** 2 / (w**2).sum() > 1000  # effective draws: the logarithm is known to 0.03
        found.append(np.log(w.mean()) + log_w.max())
        said.append(laplace.log_evidence[np.argmin(np.abs(laplace.kappas - fit.camera.kappa))])
    # Laplace's own error: 0.08 and 0.06 here; without the determinant 0.17, without the share in the box 3
    assert np.abs(np.diff(found) - np.diff(said)).max() < 0.1
    assert np.abs(np.diff(found)).max() > 1.0


# --- calibration ----------------------------------------------------------------------------------


@pytest.fixture
def calibration(monkeypatch):
    """benchmarks/calibration.py, whose full table is of 500 faces a row."""
    folder = Path(__file__).resolve().parents[1] / "benchmarks"
    monkeypatch.syspath_prepend(str(folder))
    before = set(sys.modules)
    yield importlib.import_module("calibration")
    for name in set(sys.modules) - before:
        if Path(getattr(sys.modules[name], "__file__", None) or "").parent == folder:
            del sys.modules[name]


def test_the_truth_is_inside_the_intervals_as_often_as_they_say(calibration):
    cases = calibration.drawn_faces(MODEL, 60, 1.0, scheme="egg")
    found = calibration.calibration(MODEL, cases, fits=16)
    for level, share in zip(calibration.LEVELS, found.shares, strict=True):
        low, high = (float(binom.ppf(p, 60, level)) for p in (RARE / 2, 1 - RARE / 2))
        assert low <= 60 * share <= high
    # of 60 uniform numbers
    assert found.pit == pytest.approx(0.5, abs=float(norm.isf(RARE / 2)) / np.sqrt(12 * 60))


def test_the_distances_of_the_embedded_head_hold_the_truth(embedded):
    face = face_of(embedded, np.random.default_rng(3).standard_normal(embedded.n_modes))
    widths = []
    for distance in (0.3, 1.0, 3.0):
        observation = fa.observe(face, distance=distance, noise_percent=1.0, seed=2)
        post = fa.posterior(embedded, observation)
        interval = post.interval(0.999)
        assert interval.low < distance < (interval.high or np.inf)
        low, high = post.distance_density.quantiles([0.25, 0.75])
        widths.append(np.log(high / low))
    assert widths[0] < widths[1] < widths[2]  # kappa is known equally well, log t_z is not


# --- the density ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def post() -> fa.Posterior:
    return fa.posterior(MODEL, photograph(0, 0.5, 1.0))


def test_masses_add_up_and_quantiles_invert_the_cumulative(post):
    density = post.distance_density
    assert density.masses.sum() + density.beyond == pytest.approx(1.0, abs=1e-12)
    assert density.cumulative[-1] + density.beyond == pytest.approx(1.0, abs=1e-12)
    assert (density.density >= 0).all()
    shares = np.linspace(0.01, 0.9, 20)
    at = np.interp(np.log(density.quantiles(shares)), np.log(density.distances), density.cumulative)
    assert np.abs(at - shares).max() < 1e-9
    half, most = post.interval(0.5), post.interval(0.95)
    assert most.low < half.low < half.high < (most.high or np.inf)


def test_intervals_hardly_depend_on_the_grid(post):
    # 12 fits instead of 48, and one picture 20 times sharper, whose density is narrower than both grids' steps
    for noise in (1.0, 0.05):
        observation = photograph(0, 0.5, noise)
        ends = []
        for number in (12, 48):
            grid = np.geomspace(0.2, 10, number)
            found = fa.posterior(MODEL, observation, grid, noise_percent=noise, beyond=0.0)
            ends.append(np.log(found.distance_density.quantiles([0.025, 0.5, 0.975])))
        width = ends[1][2] - ends[1][0]
        assert np.abs(ends[0] - ends[1]).max() < 0.02 * width


def test_mass_beyond_grows_with_the_prior_and_opens_the_interval():
    observation = photograph(4, 3.0, 2.0)
    none, some, much = (
        fa.posterior(MODEL, observation, noise_percent=2.0, beyond=beyond)
        for beyond in (0.0, 0.05, 0.5)
    )
    assert none.distance_density.beyond == 0
    assert none.interval().high is not None
    assert 0 < some.distance_density.beyond < much.distance_density.beyond < 1
    # Odds of beyond against within are the prior's times a number that the picture gives: 0.5/0.5 over 0.05/0.95
    odds = [p.distance_density.beyond / (1 - p.distance_density.beyond) for p in (some, much)]
    assert odds[1] / odds[0] == pytest.approx(19.0, rel=1e-9)
    assert much.interval().high is None
    assert np.isinf(much.sample(200).distances).mean() == pytest.approx(
        much.distance_density.beyond, abs=norm.isf(RARE / 2) * 0.5 / np.sqrt(200)
    )
    # 99 % of a prior beyond: even the nearer end of the half interval is
    far = fa.posterior(MODEL, observation, noise_percent=2.0, beyond=0.99).interval(0.5)
    assert (far.low, far.high) == (pytest.approx(10.0), None)


def test_a_prior_multiplies_the_density(post):
    observation = post.sweep.orthographic.observation
    tilted = fa.posterior(MODEL, observation, prior=lambda t: t, beyond=0.0).distance_density
    flat = fa.posterior(MODEL, observation, beyond=0.0).distance_density
    ratio = tilted.density / flat.density / flat.distances
    seen = flat.density > 1e-12
    assert np.ptp(ratio[seen]) < 1e-9 * ratio[seen].mean()
    only_far = fa.posterior(MODEL, observation, prior=lambda t: t > 0.6, beyond=0.0)
    assert only_far.interval(0.99).low > 0.59  # the step of its grid


def test_modes_left_out_count_as_noise():
    observation = photograph(0, 0.5, 1.0)
    few = fa.posterior(MODEL, observation, modes=2)
    ignored = fa.posterior(MODEL, observation, modes=2, missing_modes=False)
    every = fa.posterior(MODEL, observation)
    assert ignored.sigma_px == pytest.approx(every.sigma_px, rel=1e-12)
    # Its own account of the variance: pictures of random faces, the best similar pose taken out of each
    rng, fit = np.random.default_rng(0), every.sweep.nearest(1.0)
    rows = MODEL.rows(MODEL.scheme("egg").vertices)[1][:, :, 2:]
    shifts = (rows @ rng.standard_normal((2, 400))) @ np.eye(400)
    flat = np.einsum("ab,lbn->lan", fit.camera.R[:2], shifts) * fit.camera.s
    upper = np.mean(flat**2)
    added = few.sigma_px**2 - ignored.sigma_px**2
    assert 0.2 * upper < added < upper  # pose takes up a part, not most of it


# --- faces and vertices ---------------------------------------------------------------------------


def test_vertex_sds_are_those_of_the_drawn_faces(post):
    draws = post.sample(3000, seed=2)
    faces = np.stack([draws.vertices(k) for k in range(len(draws))])
    sd = 1e3 * np.sqrt(faces.var(axis=0).sum(axis=1))
    assert post.vertex_sd_mm.shape == (MODEL.n_vertices,)
    # sd of an sd of 3000 draws: 1.3 %; four of them
    assert np.abs(sd / post.vertex_sd_mm - 1).max() < 0.06


def test_the_same_seed_draws_the_same_faces(post):
    assert np.array_equal(post.sample(20, seed=4).alpha, post.sample(20, seed=4).alpha)
    assert not np.array_equal(post.sample(20, seed=4).alpha, post.sample(20, seed=5).alpha)
    same: Any = np.array(4)  # a number that NumPy wrapped
    assert np.array_equal(post.sample(20, seed=4).alpha, post.sample(20, seed=same).alpha)


def test_surfaces_of_a_subdivided_model_have_sds_too(embedded):
    post = fa.posterior(
        embedded, fa.observe(embedded.subject(3), distance=0.6), [0.5, 0.8], modes=20
    )
    sd, draws = post.vertex_sd_mm, post.sample(400, seed=0)
    assert sd.shape == (embedded.n_vertices,)
    some = np.array([draws.vertices(k)[::500] for k in range(len(draws))])
    ratio = 1e3 * np.sqrt(some.var(axis=0).sum(axis=1)) / sd[::500]
    assert np.abs(ratio - 1).max() < 0.2  # 400 draws: 3.5 % each, 29 vertices


def test_conditioning_gives_a_model_whose_faces_explain_the_points():
    observation = photograph(1, 0.5, 1.0)
    fit = fa.fit(MODEL, observation, distance=0.5, box=None)
    given = fa.condition(MODEL, fit)
    assert given.n_modes == S
    assert np.abs(given.mean - fit.vertices()).max() < 1e-7  # metres; the fit's leftover
    sizes = np.sqrt((given.control_modes**2).sum(axis=(0, 1)))
    assert (np.diff(sizes) <= 0).all()
    assert sizes[0] < np.sqrt((MODEL.control_modes**2).sum(axis=(0, 1))).max()
    # Its covariance is the posterior's at that distance: per vertex the same sd
    narrow = fa.posterior(
        MODEL, observation, [0.5, 0.50005], beyond=0.0, noise_px=float(np.sqrt(fit.prior_weight))
    )
    own = 1e3 * np.sqrt((given.control_modes**2).sum(axis=(1, 2)))
    assert np.abs(own / narrow.vertex_sd_mm - 1).max() < 1e-2
    # It is a model: it is fitted, bent and truncated like any
    again = fa.fit(given, observation, distance=0.5, box=None)
    assert again.converged
    assert fa.flexibility_modes(given, again).directions.shape == (3, S)
    # Faces drawn from it show the points about as well as the fit does: chi-square of 2 L - 6, and S more at most
    rng, sigma = np.random.default_rng(0), np.sqrt(fit.prior_weight)
    for _ in range(20):
        face = given.vertices(rng.standard_normal(S))
        refit = fa.fit(
            replace(given, control_mean=face, control_modes=1e-9 * given.control_modes),
            observation,
            distance=0.5,
        )
        assert np.nansum(refit.residual**2) < sigma**2 * (2 * 20 + S + 4 * np.sqrt(4 * 20 + 2 * S))


def test_conditioning_on_a_fit_at_the_box_stays_inside():
    fit = fa.fit(MODEL, photograph(2, 0.4, 2.0, limit=1.5), distance=0.4, box=1.0, noise_percent=2)
    assert (np.abs(fit.alpha) == 1.0).any()
    given = fa.condition(MODEL, fit)
    flat = MODEL.control_modes.reshape(-1, S)
    mean = np.linalg.lstsq(flat, (given.control_mean - MODEL.control_mean).ravel(), rcond=None)[0]
    assert (np.abs(mean) < 1.0).all()  # moments of what is inside


# --- the cut Gaussian -----------------------------------------------------------------------------


def test_moments_of_one_cut_gaussian_are_those_of_the_integral():
    means, sds = np.array([0.0, 0.7, -3.0, 9.0, -30.0]), np.array([0.4, 3.0, 0.8, 1.0, 2.0])
    log_share, mean, variance = cut_moments(means, sds**2, 2.0)
    for k, (m, sd) in enumerate(zip(means, sds, strict=True)):
        # scaled by its largest value, so that nothing is lost far outside
        top = norm.logpdf(np.clip(m, -2, 2), m, sd)
        parts = [
            quad(lambda x, p=p, m=m, sd=sd, top=top: x**p * np.exp(norm.logpdf(x, m, sd) - top), -2, 2,
                 points=[np.clip(m, -2, 2)], epsabs=1e-300, epsrel=1e-9)[0]
            for p in range(3)
        ]  # fmt: skip
        assert log_share[k] == pytest.approx(np.log(parts[0]) + top, rel=1e-9, abs=1e-9)
        assert mean[k] == pytest.approx(parts[1] / parts[0], abs=1e-8)
        assert variance[k] == pytest.approx(parts[2] / parts[0] - mean[k] ** 2, rel=1e-5)


def test_moments_and_draws_of_a_correlated_gaussian_are_those_of_rejection():
    rng = np.random.default_rng(0)
    A = rng.standard_normal((4, 4))
    covariance, centre = A @ A.T + 0.3 * np.eye(4), np.array([1.5, 0.0, -0.5, 2.0])
    precision = np.asarray(np.linalg.solve(covariance, np.eye(4))[None], dtype=np.float64)
    log_share, mean, cut = box_moments(centre[None], precision, 2.0)
    every = centre + rng.standard_normal((400_000, 4)) @ np.linalg.cholesky(covariance).T
    kept = every[(np.abs(every) <= 2).all(axis=1)]
    sd = kept.std(axis=0)
    # Expectation propagation is an approximation; of a box it is good to a percent
    assert np.exp(log_share[0]) == pytest.approx(len(kept) / len(every), rel=0.02)
    assert np.abs((mean[0] - kept.mean(axis=0)) / sd).max() < 0.02
    assert np.abs(np.sqrt(np.diag(cut[0])) / sd - 1).max() < 0.03
    n = 20_000
    which, means = np.zeros(n, dtype=np.intp), np.tile(centre, (n, 1))
    draws = box_draws(means, precision, which, 2.0, np.zeros((n, 4)), rng)
    assert np.abs(draws).max() <= 2
    assert np.abs((draws.mean(axis=0) - kept.mean(axis=0)) / sd).max() < 0.04  # 20,000 draws: 0.007
    assert np.abs(draws.std(axis=0) / sd - 1).max() < 0.03


def test_independent_gaussians_in_a_box_are_exact():
    centre, sd = np.array([0.5, -4.0, 1.9]), np.array([1.0, 0.5, 2.0])
    log_share, mean, covariance = box_moments(centre[None], np.diag(sd**-2)[None], 2.0)
    cut = truncnorm((-2 - centre) / sd, (2 - centre) / sd, centre, sd)
    assert mean[0] == pytest.approx(cut.mean(), abs=1e-6)
    assert np.diag(covariance[0]) == pytest.approx(cut.var(), rel=1e-5)
    inside = norm.logsf((-2 - centre) / sd) + np.log1p(
        -np.exp(norm.logsf((2 - centre) / sd) - norm.logsf((-2 - centre) / sd))
    )
    assert log_share[0] == pytest.approx(inside.sum(), abs=1e-6)


# --- bad input ------------------------------------------------------------------------------------

GOOD = photograph(0, 0.5, 1.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"distances": [0.5]}, "distances: 1 of them; a density needs at least two"),
        ({"distances": [0.5, 0.5]}, "distances: 1 of them"),
        ({"distances": []}, "distances: 0 of them"),
        ({"distances": [0.1, 1.0]}, r"distances: 0\.1 to 1 m is not within"),
        ({"prior": lambda t: 0 * t}, r"prior: it excludes every distance from 0\.2 to 10 m"),
        ({"prior": lambda t: t - 1}, r"prior: -0\.8 at 0\.2 m is negative"),
        ({"prior": lambda t: t[:3]}, "prior: expected shape"),
        ({"prior": lambda t: t * np.nan}, "prior: every value must be finite"),
        ({"prior": "uniform"}, "prior: 'uniform' is not a function"),
        ({"beyond": 1.0}, "beyond: 1 is not a probability"),
        ({"beyond": np.nan}, "beyond: nan is not a probability"),
        ({"noise_px": 0.0}, "noise_px: 0 is not within 1e-06 to 1e"),
        ({"noise_px": 1e300}, r"noise_px: 1e\+300 is not within"),
        ({"noise_percent": 0.0}, "noise_percent: 0 is not within"),
        ({"modes": 7}, "modes: 7 of a model with 4"),
        ({"missing_modes": 1}, "missing_modes: 1 is not True or False"),
        ({"max_steps": 1}, r"fit: .* did not converge \(step limit reached\); raise max_steps"),
    ],
)
def test_bad_arguments_are_refused_in_one_line(arguments, message):
    with pytest.raises(ValueError, match=message) as error:
        fa.posterior(MODEL, GOOD, **arguments)
    assert "\n" not in str(error.value)


def test_what_is_no_model_no_observation_and_no_fit_is_refused(post):
    nothing: object = None
    with pytest.raises(ValueError, match="model: None is not a FaceModel"):
        fa.posterior(nothing, GOOD)  # pyright: ignore[reportArgumentType]
    with pytest.raises(ValueError, match="observation: None is not an Observation"):
        fa.posterior(MODEL, nothing)  # pyright: ignore[reportArgumentType]
    with pytest.raises(ValueError, match="fit: None is not a Fit"):
        fa.condition(MODEL, nothing)  # pyright: ignore[reportArgumentType]
    fit = fa.fit(MODEL, GOOD, distance=0.5)
    with pytest.raises(ValueError, match="model: None is not a FaceModel"):
        fa.condition(nothing, fit)  # pyright: ignore[reportArgumentType]
    with pytest.raises(ValueError, match="model: 30 vertices, 5 modes; the fit is of one with"):
        fa.condition(tiny_model(), fit)
    with pytest.raises(ValueError, match=r"did not converge \(step limit reached\)"):
        fa.condition(MODEL, fa.fit(MODEL, GOOD, distance=0.5, max_steps=1))
    with pytest.raises(ValueError, match="is no optimum of E"):
        fa.condition(MODEL, fa.fit(MODEL, GOOD, distance=0.5, method="als"))
    with pytest.raises(ValueError, match="without a prior"):
        fa.condition(MODEL, fa.fit(MODEL, GOOD, distance=0.5, prior_weight=0.0))
    for level in (0.0, 1.0, np.nan):
        with pytest.raises(ValueError, match=r"level: .* is not within 0 to 1"):
            post.interval(level)
    with pytest.raises(ValueError, match="n: 0 is not at least 1"):
        post.sample(0)
    with pytest.raises(ValueError, match="seed: -1 is negative"):
        post.sample(1, seed=-1)
    with pytest.raises(ValueError, match="shares: they are not within 0 to 1"):
        post.distance_density.quantiles([1.5])


# --- far less noise assumed than the points have ----------------------------------------------------


# (person, distance, yaw, pitch, roll, noise, seed, scheme, noise assumed): each had a fit that did not converge
HARD = (
    (2, 0.481, 25.4, -2.7, -16.0, 2.37, 0, "ibug68", 0.137),  # a path that ends at a fold
    (7, 0.6690568, -21.99142, 11.48022, -28.92853, 1.98128, 3, "ibug68", 0.094238),
    (4, 0.2231638, -8.4643, 11.11222, -30.9288, 1.92829, 0, "ibug68", 0.053291),
    (9, 0.2017764, -16.0988, -26.49465, 12.60095, 0.232666, 3, "farkas", 0.064357),
    # After a leap of the path the polynomial through its fits ended anywhere
    (7, 0.2790895, 56.16681, -5.28903, -2.21344, 3.92231, 5, "farkas", 0.037233),
)
# Here no fit is best: E falls for ever while the face is drawn together, and s grows. It ended in an OverflowError
NONE_BEST = (8, 0.5604562, 23.23388, 2.31567, 34.89595, 3.66683, 8, "ibug68", 0.104277)


def posterior_of(person: int, actual: float, *rest: Any) -> fa.Posterior:
    yaw, pitch, roll, noise, seed, scheme, assumed = rest
    model = fa.load_model("embedded")
    observation = fa.observe(
        model.subject(person), distance=actual, yaw_deg=yaw, pitch_deg=pitch, roll_deg=roll,
        noise_percent=noise, seed=seed, scheme=scheme,
    )  # fmt: skip
    return fa.posterior(model, observation, noise_percent=assumed)


@pytest.mark.parametrize("settings", HARD)
def test_faces_far_from_the_mean_are_followed_to_their_ends(settings):
    post = posterior_of(*settings)
    problem = problem_of(post)
    for fit in (post.sweep.orthographic, *post.sweep.fits):
        solution = Solution(fit.alpha, fit.camera, fit.cost, fit.steps, fit.status)
        # The solver stops where a step promises 1e-8 of E: scaled by sqrt(E H_jj) the gradient is at most 1e-4
        assert kkt_error(problem, solution) < 1e-4
    assert np.isfinite(post.distance_density.density).all()


def test_where_no_fit_is_best_it_is_said_in_words():
    with pytest.raises(
        NotConverged, match=r"the orthographic fit did not converge.*assume more noise"
    ):
        posterior_of(*NONE_BEST)
