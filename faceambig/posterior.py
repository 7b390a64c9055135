"""Which faces, and which distances, a photograph leaves open: the posterior (MATH.md 7).

    x | theta ~ N(xhat, sigma^2 I),   alpha ~ N(0, I),   pose flat (rotation, t_xy and log s),   log t_z by a prior

On the grid of a sweep, kappa = 1 / t_z given, Laplace's approximation at each fit with H = J^T W J / sigma^2 + I_alpha:

    log p(log t_z) = log prior - E / (2 sigma^2) - 1/2 log det H + const,

alpha ~ N(alpha_fit, H^-1) with the pose eliminated. A Gaussian in log t_z instead of the grid is not calibrated: the
data fix kappa, and beyond about 2 m infinity is within two sd. Between the fits the logarithm of the density is a
piecewise cubic; where it is narrow, fits are added. In a box the Gaussian is that of the cost's quadratic at the fit,
cut (truncated.py).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Array, IntArray, checked, number, read_only, shown, whole
from .camera import jacobian
from .errors import NotConverged
from .fitting import Fit, FitOptions
from .fitting.solve import Problem, evaluate, normal_equations
from .fitting.task import FARTHEST, NEAREST, Task, landmark_rows, prepare, start_of
from .flex import gram
from .model import FaceModel
from .observation import LARGEST_PX, Observation
from .sweep import Sweep, cold, follow, sweep_from
from .truncated import box_draws, box_moments

GRID = (0.2, 10.0, 48)  # metres from, to, fits
BEYOND = 0.05  # prior mass of the distances beyond the last
FINE = 32  # points of the density between two fits
WITHIN, ENOUGH = (
    8.0,
    9,
)  # so many fits less than this below the highest log density: the cubics have its shape
MAX_STEPS = (
    1000  # 300 were needed at most, where faces are far from the mean, and 100 do for all others
)
FINEST = 1e-4  # relative, between two distances: nearer ones are not told apart
FINEST_PX = 1e-6  # sigma: less is rounding of the pixels' own digits

Prior = Callable[[Array], ArrayLike]


@dataclass(frozen=True, slots=True)
class DistanceInterval:
    """Distances that hold the truth with a probability: the same probability lies nearer as farther."""

    low: float  # metres
    high: float | None  # None: open, more than that probability lies beyond the last distance
    level: float


@dataclass(frozen=True, slots=True, eq=False)
class DistanceDensity:
    """Posterior of the distance. K points; density is per unit of log t_z (of draws: per e-fold of distance)."""

    distances: Array  # (K,) metres, ascending
    density: Array  # (K,); by trapezoids in log t_z it integrates to 1 - beyond
    beyond: float  # probability of the distances beyond the last

    def __post_init__(self) -> None:
        for name in ("distances", "density"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def masses(self) -> Array:
        """(K,) the probability each point stands for, by trapezoids; their sum is 1 - beyond."""
        half = 0.5 * np.diff(np.log(self.distances))
        return self.density * (np.append(half, 0.0) + np.append(0.0, half))

    @property
    def cumulative(self) -> Array:
        """(K,) probability of being nearer than each distance."""
        parts = 0.5 * (self.density[1:] + self.density[:-1]) * np.diff(np.log(self.distances))
        return np.append(0.0, parts.cumsum())

    def quantiles(self, shares: ArrayLike) -> Array:
        """(n,) metres, the distances that leave each of `shares` (n,) nearer; inf where that is beyond the last."""
        at = checked("shares", shares, (None,))
        if ((at < 0) | (at > 1)).any():
            raise ValueError("shares: they are not within 0 to 1")
        inside = np.exp(np.interp(at, self.cumulative, np.log(self.distances)))
        return np.where(at > self.cumulative[-1], np.inf, inside)


@dataclass(frozen=True, slots=True, eq=False)
class FaceSamples:
    """Faces drawn from a posterior, each with the distance it was drawn at. n draws."""

    model: FaceModel
    alpha: Array  # (n, S) standard deviations
    distances: (
        Array  # (n,) metres; inf: beyond the last distance, drawn under the orthographic camera
    )

    def __post_init__(self) -> None:
        for name in ("alpha", "distances"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    def __len__(self) -> int:
        return len(self.alpha)

    def vertices(self, index: int) -> Array:
        """The surface (N, 3) of one draw, metres."""
        return self.model.vertices(self.alpha[index])


@dataclass(frozen=True, slots=True, eq=False)
class Laplace:
    """Gaussians of alpha, pose eliminated, at D fits; where there is a box, before the cut."""

    kappas: Array  # (D,) per metre, ascending
    means: Array  # (D, S)
    precisions: Array  # (D, S, S)
    log_evidence: (
        Array  # (D,) log of the integral over alpha and pose, the same constant left out of all
    )
    box: float  # k, may be inf


@dataclass(frozen=True, slots=True, eq=False)
class Posterior:
    """What one photograph leaves open. S modes, N vertices."""

    sweep: Sweep  # the fits it rests on
    sigma_px: float  # landmark sd per coordinate, that of the modes left out in it
    distance_density: DistanceDensity
    laplace: Laplace  # the orthographic camera first, then the sweep from its farthest distance

    @property
    def model(self) -> FaceModel:
        return self.sweep.orthographic.model

    def interval(self, level: float = 0.95) -> DistanceInterval:
        """The distances between the quantiles (1 - level) / 2 and (1 + level) / 2; ValueError out of 0 to 1.

        Where even the lower one is beyond the last distance, `low` is that last distance.
        """
        level = number("level", level)
        if not 0 < level < 1:
            raise ValueError(f"level: {level:g} is not within 0 to 1")
        low, high = self.distance_density.quantiles([0.5 - 0.5 * level, 0.5 + 0.5 * level]).tolist()
        last = float(self.distance_density.distances[-1])
        return DistanceInterval(min(low, last), high if high < np.inf else None, level)

    def sample(self, n: int, seed: int = 0) -> FaceSamples:
        """`n` faces: a distance from the density, then the shape from Laplace's Gaussian there, inside the box.

        Under a box by Gibbs, 25 sweeps from a start that has about the right moments already.
        """
        n = whole("n", n)
        if n < 1:
            raise ValueError(f"n: {shown(n)} is not at least 1")
        seed = whole("seed", seed)
        if seed < 0:
            raise ValueError(f"seed: {shown(seed)} is negative")
        rng, L = np.random.default_rng(seed), self.laplace
        distances = self.distance_density.quantiles(rng.random(n))
        kappas = 1.0 / distances
        which = _nearest(L.kappas, kappas)
        used, row = np.unique(which, return_inverse=True)
        _, centres, covariances = box_moments(L.means[used], L.precisions[used], L.box)
        means = _between(L.kappas, L.means, kappas)
        noise = rng.standard_normal(means.shape)
        for k, factor in enumerate(np.linalg.cholesky(covariances)):
            noise[row == k] = noise[row == k] @ factor.T
        if L.box == np.inf:
            return FaceSamples(self.model, means + noise, distances)
        start = centres[row] + noise
        alpha = box_draws(means, L.precisions[used], row, L.box, start, rng)
        return FaceSamples(self.model, alpha, distances)

    def shape_moments(self) -> tuple[Array, Array]:
        """Mean (S,) and covariance (S, S) of alpha, the distance left open too."""
        L, density = self.laplace, self.distance_density
        masses = np.append(density.beyond, density.masses[::-1])
        kappas = np.append(0.0, 1.0 / density.distances[::-1])
        shares = np.bincount(_nearest(L.kappas, kappas), masses, len(L.kappas))
        used = shares > 0
        _, centres, covariances = box_moments(L.means[used], L.precisions[used], L.box)
        covariance = np.tensordot(shares[used], covariances, axes=1)
        at = _between(L.kappas[used], centres, kappas)
        mean = masses @ at
        return mean, covariance + (at - mean).T @ (masses[:, None] * (at - mean))

    @property
    def vertex_sd_mm(self) -> Array:
        """(N,) sd of each vertex, millimetres, in the model's own axes: root of the sum of its three variances.

        Shape and distance are open, the pose is eliminated: the rows of Q L with the covariance of alpha L L^T.
        """
        _, covariance = self.shape_moments()
        Q = self.model.control_modes[:, :, : len(covariance)]
        wide = (Q @ np.linalg.cholesky(covariance)).reshape(len(Q), -1)
        surface = self.model.refine(wide)
        return 1e3 * np.sqrt(np.vecdot(surface, surface))


def posterior(
    model: FaceModel,
    observation: Observation,
    distances: ArrayLike | None = None,
    *,
    prior: Prior | None = None,
    beyond: float = BEYOND,
    modes: int | None = None,
    missing_modes: bool = True,
    box: float | None = None,
    noise_percent: float = 1.0,
    noise_px: float | None = None,
    tolerance: float = 1e-8,
    max_steps: int = MAX_STEPS,
    progress: Callable[[int], object] | None = None,
) -> Posterior:
    """The faces and distances that one observation leaves open, with their probabilities.

    Parameters
    ----------
    distances: (n,) metres, at least two, the fits to begin with; None: 48 from 0.2 to 10 m, evenly in ratio. The prior
        spans them.
    prior: relative density of log t_z at distances (D,), metres; None: uniform in log t_z. Only its shape counts.
    beyond: prior mass, 0 to 1, of all distances beyond the last, where the camera is taken for orthographic. The
        picture hardly says anything against it from 2 m on: with 0, intervals end where the prior does.
    modes: shape modes, the strongest first; None for all that the model has. With fewer, the rest moves the landmarks
        by more than their noise: intervals come out too narrow.
    missing_modes: add the mean variance that the modes left out cause in the picture to sigma^2.
    box: largest |alpha_j| in standard deviations; None: the prior alone, N(0, I). Unlike in `fit` there is none unless
        asked for: cut at 2, a prior sd of 1 is 0.88, and one true coefficient in 22 is outside.
    noise_percent: landmark sd *per coordinate*, sigma, in percent of the interocular distance. A mean distance of d
        percent between two markings is sigma = d / 1.2533.
    noise_px: sigma in pixels itself, instead of noise_percent.
    tolerance, max_steps: as `fit`; more steps, for without a box some fits follow a long valley.
    progress: as in `sweep_distance`.

    Raises
    ------
    ValueError: an argument out of range; fewer than two distances; a prior that is 0 at all of them; points that do not
        belong to the model.
    NotConverged, a ValueError: a fit did not converge. With far less noise assumed than the points have, faces of
        tens of standard deviations explain them ever better the smaller and nearer together they are: no fit is best.

    Notes
    -----
    The optimum of E is the most probable face only for lambda = sigma^2, so there is no prior_weight here.
    """
    grid = (
        np.geomspace(*GRID)
        if distances is None
        else np.unique(checked("distances", distances, (None,)))
    )
    if len(grid) < 2:
        raise ValueError(f"distances: {len(grid)} of them; a density needs at least two")
    beyond = number("beyond", beyond)
    if not 0 <= beyond < 1:
        raise ValueError(f"beyond: {beyond:g} is not a probability from 0 to below 1")
    if not isinstance(missing_modes, bool):
        raise ValueError(f"missing_modes: {shown(missing_modes)} is not True or False")
    if modes is None and isinstance(model, FaceModel):
        modes = model.n_modes
    sigma2 = None
    if noise_px is not None:
        sigma = number("noise_px", noise_px)
        if not FINEST_PX <= sigma <= LARGEST_PX:
            raise ValueError(f"noise_px: {sigma:g} is not within {FINEST_PX:g} to {LARGEST_PX:g}")
        sigma2 = sigma**2
    options = FitOptions(modes, box, noise_percent, sigma2, tolerance, max_steps)
    task = prepare(model, observation, options)
    variance = float(task.problem.prior_weight)
    if missing_modes:
        variance += _missing_px2(task)
    options = replace(options, prior_weight=variance)
    task = prepare(model, observation, options)
    _log_prior(prior, np.geomspace(grid[0], grid[-1], FINE * len(grid)))  # refused before the work
    if grid[0] < NEAREST or grid[-1] > FARTHEST:
        raise ValueError(
            f"distances: {grid[0]:g} to {grid[-1]:g} m is not within {NEAREST:g} to {FARTHEST:g}"
        )
    first = cold(task, 0.0)
    _refuse_unconverged(first)  # the others would take as long
    sweep = sweep_from(task, first, grid, progress)
    fits = [sweep.orthographic, *sweep.fits[::-1]]
    fits, laplace = _refined(task, fits)
    grid = 1.0 / laplace.kappas[:0:-1]
    sweep = Sweep(grid, tuple(fits[:0:-1]), fits[0], sweep.disagreed)
    density = _density(grid, laplace.log_evidence[:0:-1], laplace.log_evidence[0], prior, beyond)
    return Posterior(sweep, float(np.sqrt(variance)), density, laplace)


def condition(model: FaceModel, fit: Fit) -> FaceModel:
    """The model after a photograph: faces that explain it at the fit's distance, as mean and modes again.

    Laplace's Gaussian of alpha at the fit, pose eliminated and the distance held, sigma^2 = fit.prior_weight; in an
    active box, the moments of the cut one. Its modes are the principal ones of the surface that d_S is measured on,
    the strongest first; there are as many as the fit used.

    Raises
    ------
    ValueError: no fit, one of another model, one that did not converge or is no optimum of E, one without a prior.
    """
    if not isinstance(model, FaceModel):
        raise ValueError(f"model: {shown(model)} is not a FaceModel; load one with load_model")
    if not isinstance(fit, Fit):
        raise ValueError(f"fit: {shown(fit)} is not a Fit")
    S = len(fit.alpha)
    if model.n_vertices != fit.model.n_vertices or model.n_modes < S:
        raise ValueError(
            f"model: {model.n_vertices} vertices, {model.n_modes} modes; "
            f"the fit is of one with {fit.model.n_vertices} and {S}"
        )
    if not fit.options.least_squares:
        raise ValueError(
            f"fit: by method {fit.options.method!r}, weighting {fit.options.weighting!r}, is no optimum of E; "
            "fit with method='joint'"
        )
    _refuse_unconverged(fit)
    if not fit.prior_weight > 0:
        raise ValueError(
            "fit: without a prior (prior_weight 0) there is no posterior; give noise_percent"
        )
    options = replace(fit.options, modes=S, prior_weight=fit.prior_weight)
    laplace = _laplace(prepare(model, fit.observation, options).problem, [fit])
    _, mean, covariance = box_moments(laplace.means, laplace.precisions, laplace.box)
    L = np.linalg.cholesky(covariance[0])
    _, turn = np.linalg.eigh(L.T @ gram(model)[:S, :S] @ L)
    factor = L @ turn[:, ::-1]
    Q = model.control_modes[:, :, :S]
    return replace(
        model,
        name=f"{model.name}, given {int(fit.observation.visible.sum())} points",
        control_mean=model.control_vertices(mean[0]),
        control_modes=(Q.reshape(-1, S) @ factor).reshape(Q.shape),
    )


def _laplace(problem: Problem, fits: list[Fit]) -> Laplace:
    """At each fit the Gaussian that E's quadratic means; its integral, inside the box."""
    S, sigma2 = problem.modes.shape[2], float(problem.prior_weight)
    means, precisions, logs = [], [], []
    for fit in fits:
        point = evaluate(problem, fit.camera.view, fit.alpha)
        H, g = normal_equations(problem, *point[:4])
        H, g = H / sigma2, g / sigma2
        # 0 at a fit, but for coefficients on the box: there the quadratic's own minimum is outside
        step = np.linalg.solve(H, g)
        means.append(fit.alpha + step[:S])
        precisions.append(H[:S, :S] - H[:S, S:] @ np.linalg.solve(H[S:, S:], H[S:, :S]))
        logs.append(-0.5 * fit.cost / sigma2 + 0.5 * g @ step - 0.5 * np.linalg.slogdet(H)[1])
    kappas = np.array([fit.camera.kappa for fit in fits])
    laplace = Laplace(kappas, np.array(means), np.array(precisions), np.array(logs), problem.box)
    if problem.box == np.inf:
        return laplace
    log_share, _, _ = box_moments(laplace.means, laplace.precisions, problem.box)
    return replace(laplace, log_evidence=laplace.log_evidence + log_share)


def _refined(task: Task, fits: list[Fit]) -> tuple[list[Fit], Laplace]:
    """`fits` from the orthographic to the nearest, and their Gaussians; fits added while the density is too narrow."""
    for fit in fits:
        _refuse_unconverged(fit)
    laplace = _laplace(task.problem, fits)
    while True:
        high = laplace.log_evidence[1:] > laplace.log_evidence[1:].max() - WITHIN
        if high.sum() >= ENOUGH:
            return fits, laplace
        first, last = 1 + np.flatnonzero(high)[[0, -1]]
        gaps = [
            k
            for k in range(max(first - 1, 1), min(last + 1, len(fits) - 1))
            if fits[k + 1].camera.kappa / fits[k].camera.kappa > 1 + FINEST
        ]
        if not gaps:
            return fits, laplace
        added = []
        for k in gaps:
            near, far = fits[k + 1], fits[k]
            kappa = float(np.sqrt(near.camera.kappa * far.camera.kappa))
            fit = follow(task, [far.camera.kappa, kappa], far)[1]
            _refuse_unconverged(fit)
            added.append(fit)
        more = _laplace(task.problem, added)
        at = np.array(gaps) + 1
        for k, fit in zip(at[::-1], added[::-1], strict=True):
            fits.insert(k, fit)
        laplace = Laplace(
            np.insert(laplace.kappas, at, more.kappas),
            np.insert(laplace.means, at, more.means, axis=0),
            np.insert(laplace.precisions, at, more.precisions, axis=0),
            np.insert(laplace.log_evidence, at, more.log_evidence),
            laplace.box,
        )


def _density(
    grid: Array, log_evidence: Array, log_far: float, prior: Prior | None, beyond: float
) -> DistanceDensity:
    """From the log evidence at the distances grid (D,) and at infinity."""
    log_t = np.log(grid)
    share = np.linspace(0, 1, FINE, endpoint=False)
    fine = np.append((log_t[:-1, None] + share * np.diff(log_t)[:, None]).ravel(), log_t[-1])
    distances = np.exp(fine)
    distances[::FINE] = grid
    log_prior = _log_prior(prior, distances)
    half = 0.5 * np.diff(fine)
    weights = np.append(half, 0.0) + np.append(0.0, half)
    log_prior -= np.log(weights @ np.exp(log_prior))
    log_p = log_prior + _smooth(log_t, log_evidence, share)
    with np.errstate(divide="ignore"):
        log_p, log_far = log_p + np.log1p(-beyond), log_far + np.log(beyond)
    top = max(log_p.max(), log_far)
    p, far = np.exp(log_p - top), np.exp(log_far - top)
    total = weights @ p + far
    return DistanceDensity(distances, p / total, float(far / total))


def _smooth(x: Array, y: Array, share: Array) -> Array:
    """Piecewise cubic through y (D,) at x (D,), at `share` of each interval and the last x; exact for parabolas.

    Slopes are those of the parabola through three neighbours. Local: a cliff far from the top leaves no ripple there.
    """
    step = np.diff(x)[:, None]
    slope = np.gradient(y, x, edge_order=2 if len(x) > 2 else 1)[:, None]
    u, left, right = share[None], y[:-1, None], y[1:, None]
    bent = (slope[:-1] * step - (right - left)) * (1 - u) - (slope[1:] * step - (right - left)) * u
    return np.append((left + u * (right - left) + u * (1 - u) * bent).ravel(), y[-1])


def _log_prior(prior: Prior | None, distances: Array) -> Array:
    """(D,) log of the prior density of log t_z, not normalised; ValueError for what is none."""
    if prior is None:
        return np.zeros(len(distances))
    if not callable(prior):
        raise ValueError(f"prior: {shown(prior)} is not a function of distances")
    density = checked("prior", prior(distances), (len(distances),))
    if density.min() < 0:
        raise ValueError(
            f"prior: {density.min():g} at {distances[density.argmin()]:g} m is negative"
        )
    if density.max() == 0:
        raise ValueError(
            f"prior: it excludes every distance from {distances[0]:g} to {distances[-1]:g} m"
        )
    with np.errstate(divide="ignore"):
        return np.log(density / density.max())


def _missing_px2(task: Task) -> float:
    """Mean variance per coordinate, px^2, that the modes left out cause; what the pose takes up is not in it."""
    model, S = task.model, task.problem.modes.shape[2]
    if model.n_modes == S:
        return 0.0
    observation = task.observation
    vertices = observation.vertices(model)[observation.visible]
    mean, _, modes = landmark_rows(model, tuple(vertices.tolist()), model.n_modes)
    camera, _ = start_of(task, 1.0)
    J = jacobian(camera, mean, modes).reshape(2 * len(mean), -1)
    pose, _ = np.linalg.qr(J[:, model.n_modes :])
    left_out = J[:, S : model.n_modes]
    left_out = left_out - pose @ (pose.T @ left_out)
    return float((left_out**2).sum() / len(J))


def _refuse_unconverged(fit: Fit) -> None:
    if not fit.converged:
        where = "the orthographic fit" if fit.distance is None else f"the fit at {fit.distance:g} m"
        raise NotConverged(
            f"fit: {where} did not converge ({fit.status}); raise max_steps, or assume more noise"
        )


def _nearest(nodes: Array, kappas: Array) -> IntArray:
    """(n,) which of nodes (D,), ascending, is nearest to each kappa (n,)."""
    middles = 0.5 * (nodes[1:] + nodes[:-1])
    return np.searchsorted(middles, kappas)


def _between(nodes: Array, values: Array, kappas: Array) -> Array:
    """(n, S) values (D, S) at nodes (D,), ascending, carried linearly to kappas (n,)."""
    if len(nodes) == 1:
        return np.repeat(values, len(kappas), axis=0)
    right = np.searchsorted(nodes[1:-1], kappas) + 1
    share = ((kappas - nodes[right - 1]) / (nodes[right] - nodes[right - 1])).clip(0, 1)[:, None]
    return (1 - share) * values[right - 1] + share * values[right]
