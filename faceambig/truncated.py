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

ROUNDS, DAMPING = 200, 0.7  # parallel updates at full length may swing
SAME = 1e-7  # sd by which means still move when they have settled
SWEEPS = 25  # sds have settled; 200 sweeps change them by less than 1 %
LEAST = 1e-300  # ndtri of less is minus infinity


def box_moments(mean: Array, precision: Array, box: float) -> tuple[Array, Array, Array]:
    """Log of the share inside (D,), mean (D, S) and covariance (D, S, S) of D Gaussians cut to the box, k > 0 or inf.

    mean (D, S) and precision (D, S, S) are those before the cut.
    """
    eye = np.eye(mean.shape[1])
    if box == np.inf:
        return np.zeros(len(mean)), mean, np.linalg.solve(precision, eye)
    pull = (precision @ mean[..., None])[..., 0]
    tau, nu = np.zeros_like(mean), np.zeros_like(mean)  # walls as exp(-tau x^2 / 2 + nu x)
    for _ in range(ROUNDS):
        C = np.linalg.solve(precision + tau[..., None] * eye, eye)
        m, v = (C @ (pull + nu)[..., None])[..., 0], np.diagonal(C, axis1=1, axis2=2)
        v_cavity = 1.0 / (1.0 / v - tau)
        m_cavity = v_cavity * (m / v - nu)
        log_share, m_cut, v_cut = cut_moments(m_cavity, v_cavity, box)
        if (np.abs(m_cut - m) <= SAME * np.sqrt(v)).all():
            break
        tau += DAMPING * (np.maximum(1.0 / v_cut - 1.0 / v_cavity, 0.0) - tau)
        nu += DAMPING * (m_cut / v_cut - m_cavity / v_cavity - nu)
    # Each wall's Gaussian is scaled to have the wall's share; then the integral of their product with ours
    site = 0.5 * (np.log(v / v_cavity) + m**2 / v - m_cavity**2 / v_cavity)
    product = 0.5 * (np.linalg.slogdet(precision)[1] + np.linalg.slogdet(C)[1])
    product += 0.5 * (np.vecdot(m, pull + nu) - np.vecdot(mean, pull))
    return (log_share - site).sum(axis=1) + product, m, C


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
