"""A Gaussian in a box |x_j| <= k: its share inside, its moments, draws from it (MATH.md 7).

Share and moments by expectation propagation: each wall pair is replaced by the one-dimensional Gaussian that, in the
company of all others, has the moments of the cut one. The share of a correlated Gaussian in a box of many dimensions
has no formula; of independent ones this is exact. Draws by Gibbs: one coordinate at a time from its own conditional,
cut, in all chains at once. Throwing away what lies outside would keep 4 % of draws of the prior at k = 2, S = 70.
"""

from __future__ import annotations

import numpy as np
from scipy.special import log_ndtr, ndtr, ndtri

from .arrays import Array, IntArray

ROUNDS, DAMPING = 1000, 0.7  # parallel updates at full length may swing
SAME = 1e-7  # of an sd: walls that pull the mean by no more have settled
SWEEPS = 25  # sds have settled; 200 sweeps change them by less than 1 %
LEAST = 1e-300  # ndtri of less is minus infinity


def box_moments(mean: Array, precision: Array, box: float) -> tuple[Array, Array, Array]:
    """Log of the share inside (D,), mean (D, S) and covariance (D, S, S) of D Gaussians cut to the box, k > 0 or inf.

    mean (D, S) and precision (D, S, S) are those before the cut.
    """
    if box == np.inf:
        return np.zeros(len(mean)), mean, _inverse(precision)
    pull = (precision @ mean[..., None])[..., 0]
    walls = np.zeros_like(mean), np.zeros_like(mean)
    for _ in range(ROUNDS):
        log_share, m, C, better = _round(mean, precision, pull, walls, box)
        step = DAMPING * (better[0] - walls[0]), DAMPING * (better[1] - walls[1])
        if (np.abs(step[1] - step[0] * m) <= SAME / np.sqrt(_diagonal(C))).all():
            return log_share, m, C
        walls = walls[0] + step[0], walls[1] + step[1]
    raise ValueError(
        f"box: moments inside {box:g} sd did not settle in {ROUNDS} rounds; leave it out"
    )


def _round(
    mean: Array, precision: Array, pull: Array, walls: tuple[Array, Array], box: float
) -> tuple[Array, Array, Array, tuple[Array, Array]]:
    """Log of the share, mean, covariance with `walls`, exp(-tau x^2 / 2 + nu x); and the walls that these call for."""
    tau, nu = walls
    stiff = precision + tau[..., None] * np.eye(mean.shape[1])
    C = _inverse(stiff)
    m, v = (C @ (pull + nu)[..., None])[..., 0], _diagonal(C)
    v_cavity = 1.0 / (1.0 / v - tau)
    m_cavity = v_cavity * (m / v - nu)
    log_share, m_cut, v_cut = cut_moments(m_cavity, v_cavity, box)
    # Each wall is scaled to have the share that it leaves of its cavity; then the integral of their product with ours
    site = 0.5 * (np.log(v / v_cavity) + m**2 / v - m_cavity**2 / v_cavity)
    product = np.linalg.slogdet(precision)[1] - np.linalg.slogdet(stiff)[1]
    product += np.vecdot(m, pull + nu) - np.vecdot(mean, pull)
    log_share = (log_share - site).sum(axis=1) + 0.5 * product
    better = np.maximum(1.0 / v_cut - 1.0 / v_cavity, 0.0), m_cut / v_cut - m_cavity / v_cavity
    return log_share, m, C, better


def _inverse(precision: Array) -> Array:
    """(D, S, S): here the covariance itself is asked for."""
    return np.linalg.solve(precision, np.eye(precision.shape[1])).astype(np.float64, copy=False)


def _diagonal(C: Array) -> Array:
    return np.diagonal(C, axis1=1, axis2=2)


def cut_moments(mean: Array, variance: Array, box: float) -> tuple[Array, Array, Array]:
    """Log of the share inside, mean and variance of one-dimensional Gaussians cut to -box..box, elementwise."""
    sd = np.sqrt(variance)
    flip = np.where(mean > 0, -1.0, 1.0)  # into the lower half, where shares keep their digits
    low, high = (-box + np.abs(mean)) / sd, (box + np.abs(mean)) / sd  # of -|mean|
    low, high = -high, -low  # mirrored: the nearer wall is `high`
    log_high = log_ndtr(high)
    log_share = log_high + np.log1p(-np.exp(log_ndtr(low) - log_high))
    at_low, at_high = (np.exp(-0.5 * z**2 - log_share) / np.sqrt(2 * np.pi) for z in (low, high))
    shift = at_low - at_high  # of the mirrored mean |mean|, in sd
    m = np.abs(mean) + sd * shift
    v = variance * np.maximum(1.0 + low * at_low - high * at_high - shift**2, 1e-12)
    return log_share, -flip * m, v


def box_draws(
    mean: Array,
    precision: Array,
    which: IntArray,
    box: float,
    start: Array,
    rng: np.random.Generator,
) -> Array:
    """One draw (n, S) for each mean (n, S), with precision[which] of precision (D, S, S), from `start` (n, S)."""
    x = start.clip(-box, box)
    rows = np.ascontiguousarray(precision.swapaxes(0, 1))  # (S, D, S)
    for _ in range(SWEEPS):
        for j, row in enumerate(rows):
            stiff = row[which]
            peak = x[:, j] - np.vecdot(stiff, x - mean) / stiff[:, j]
            x[:, j] = cut_draws(peak, 1.0 / np.sqrt(stiff[:, j]), box, rng.random(len(x)))
    return x


def cut_draws(mean: Array, sd: Array, box: float, u: Array) -> Array:
    """Quantiles u of one-dimensional Gaussians cut to -box..box, elementwise; mirrored where the mean is above 0."""
    size = np.abs(mean)
    low, high = (-box - size) / sd, (box - size) / sd
    a, b = ndtr(low), ndtr(high)
    z = ndtri(np.maximum(a + u * (b - a), LEAST)).clip(low, high)
    return (np.where(mean > 0, 1.0, -1.0) * (size + sd * z)).clip(-box, box)
