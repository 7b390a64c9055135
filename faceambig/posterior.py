"""Which faces, and which distances, a photograph leaves open: the posterior (MATH.md 7).

    x | theta ~ N(xhat, sigma^2 I),   alpha ~ N(0, I),   pose flat (rotation, t_xy and log s),   log t_z by a prior

On the grid of a sweep, kappa = 1 / t_z given, Laplace's approximation at each fit with H = J^T W J / sigma^2 + I_alpha:

    log p(log t_z) = log prior - E / (2 sigma^2) - 1/2 log det H + const,

alpha ~ N(alpha_fit, H^-1) with the pose eliminated (laplace.py); the density between the fits is density.py's, and
where it is narrow, fits are added.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Array, checked, number, read_only, shown, whole
from .camera import jacobian
from .density import FINE, DistanceDensity, DistanceInterval, Prior, density_of, log_prior_of
from .fitting import Fit, FitOptions
from .fitting.task import FARTHEST, NEAREST, Task, landmark_rows, prepare, start_of
from .laplace import Laplace, between_nodes, laplace_at, nearest_node, refuse_unconverged
from .model import FaceModel
from .observation import LARGEST_PX, Observation
from .path import cold, follow
from .sweep import Sweep, sweep_from
from .truncated import box_draws, box_moments

GRID = (0.2, 10.0, 48)  # metres from, to, fits
BEYOND = 0.05  # prior mass of the distances beyond the last
# So many fits less than this below the highest log density: the cubics have its shape
WITHIN, ENOUGH = 8.0, 9
# 300 were needed at most, where faces are far from the mean, and 100 do for all others
MAX_STEPS = 1000
FINEST = 1e-4  # relative, between two distances: nearer ones are not told apart
FINEST_PX = 1e-6  # sigma: less is rounding of the pixels' own digits


@dataclass(frozen=True, slots=True, eq=False)
class FaceSamples:
    """Faces drawn from a posterior, each with the distance it was drawn at. n draws."""

    model: FaceModel
    alpha: Array  # (n, S) standard deviations
    # (n,) metres; inf: beyond the last distance, drawn under the orthographic camera
    distances: Array

    def __post_init__(self) -> None:
        for name in ("alpha", "distances"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    def __len__(self) -> int:
        return len(self.alpha)

    def vertices(self, index: int) -> Array:
        """The surface (N, 3) of one draw, metres."""
        return self.model.vertices(self.alpha[index])


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
        which = nearest_node(L.kappas, kappas)
        used, row = np.unique(which, return_inverse=True)
        _, centres, covariances = box_moments(L.means[used], L.precisions[used], L.box)
        means = between_nodes(L.kappas, L.means, kappas)
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
        shares = np.bincount(nearest_node(L.kappas, kappas), masses, len(L.kappas))
        used = shares > 0
        _, centres, covariances = box_moments(L.means[used], L.precisions[used], L.box)
        covariance = np.tensordot(shares[used], covariances, axes=1)
        at = between_nodes(L.kappas[used], centres, kappas)
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
    noise_percent: landmark sd *per coordinate*, sigma, in percent of the interocular distance. A mean error of d
        percent is sigma = d / 1.2533. The default is a careful hand's. For points found automatically it is too
        little: theirs is about 3.4, and told 1 the interval of 95 % held the truth for 58 % of photographs
        (benchmarks/calibration.py).
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
    grid = _grid(distances)
    beyond = number("beyond", beyond)
    if not 0 <= beyond < 1:
        raise ValueError(f"beyond: {beyond:g} is not a probability from 0 to below 1")
    if not isinstance(missing_modes, bool):
        raise ValueError(f"missing_modes: {shown(missing_modes)} is not True or False")
    if modes is None and isinstance(model, FaceModel):
        modes = model.n_modes
    options = FitOptions(modes, box, noise_percent, _px2(noise_px), tolerance, max_steps)
    task = prepare(model, observation, options)
    variance = float(task.problem.prior_weight)
    if missing_modes:
        variance += _missing_px2(task)
    options = replace(options, prior_weight=variance)
    task = prepare(model, observation, options)
    # refused before the work
    log_prior_of(prior, np.geomspace(grid[0], grid[-1], FINE * len(grid)))
    if grid[0] < NEAREST or grid[-1] > FARTHEST:
        raise ValueError(
            f"distances: {grid[0]:g} to {grid[-1]:g} m is not within {NEAREST:g} to {FARTHEST:g}"
        )
    first = cold(task, 0.0)
    refuse_unconverged(first)  # the others would take as long
    sweep = sweep_from(task, first, grid, progress)
    fits = [sweep.orthographic, *sweep.fits[::-1]]
    fits, laplace = _refined(task, fits)
    grid = 1.0 / laplace.kappas[:0:-1]
    sweep = Sweep(grid, tuple(fits[:0:-1]), fits[0], sweep.disagreed)
    density = density_of(grid, laplace.log_evidence[:0:-1], laplace.log_evidence[0], prior, beyond)
    return Posterior(sweep, float(np.sqrt(variance)), density, laplace)


def _grid(distances: ArrayLike | None) -> Array:
    """(n,) metres, ascending; ValueError for fewer than two."""
    if distances is None:
        return np.geomspace(*GRID)
    grid = np.unique(checked("distances", distances, (None,)))
    if len(grid) < 2:
        raise ValueError(f"distances: {len(grid)} of them; a density needs at least two")
    return grid


def _px2(noise_px: float | None) -> float | None:
    """sigma^2 of noise given in pixels."""
    if noise_px is None:
        return None
    sigma = number("noise_px", noise_px)
    if not FINEST_PX <= sigma <= LARGEST_PX:
        raise ValueError(f"noise_px: {sigma:g} is not within {FINEST_PX:g} to {LARGEST_PX:g}")
    return sigma**2


def _refined(task: Task, fits: list[Fit]) -> tuple[list[Fit], Laplace]:
    """`fits` from the orthographic to the nearest, and their Gaussians; fits added while the density is too narrow."""
    for fit in fits:
        refuse_unconverged(fit)
    laplace = laplace_at(task.problem, fits)
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
            refuse_unconverged(fit)
            added.append(fit)
        more = laplace_at(task.problem, added)
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
