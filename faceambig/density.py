"""How probable each distance is: from log evidence at a few distances to a density, its quantiles and intervals.

A Gaussian in log t_z instead is not calibrated: the data fix kappa, and beyond about 2 m infinity is within two sd.
Between the distances the logarithm of the density is a piecewise cubic.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Array, checked, read_only, shown

FINE = 32  # points of the density between two distances

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


def density_of(
    grid: Array, log_evidence: Array, log_far: float, prior: Prior | None, beyond: float
) -> DistanceDensity:
    """From the log evidence at the distances grid (D,) and at infinity."""
    log_t = np.log(grid)
    share = np.linspace(0, 1, FINE, endpoint=False)
    fine = np.append((log_t[:-1, None] + share * np.diff(log_t)[:, None]).ravel(), log_t[-1])
    distances = np.exp(fine)
    distances[::FINE] = grid
    log_prior = log_prior_of(prior, distances)
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


def log_prior_of(prior: Prior | None, distances: Array) -> Array:
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
