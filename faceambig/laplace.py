"""Laplace's approximation at fits along the distance: Gaussians of the shape, pose eliminated (MATH.md 7).

H = J^T W J / sigma^2 + I_alpha; log evidence -E / (2 sigma^2) - 1/2 log det H. In a box the Gaussian is that of the
cost's quadratic at the fit, cut (truncated.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .arrays import Array, IntArray
from .errors import NotConverged
from .fitting import Fit
from .fitting.problem import Problem, evaluate, normal_equations
from .truncated import box_moments


@dataclass(frozen=True, slots=True, eq=False)
class Laplace:
    """Gaussians of alpha, pose eliminated, at D fits; where there is a box, before the cut."""

    kappas: Array  # (D,) per metre, ascending
    means: Array  # (D, S)
    precisions: Array  # (D, S, S)
    # (D,) log of the integral over alpha and pose, the same constant left out of all
    log_evidence: Array
    box: float  # k, may be inf


def laplace_at(problem: Problem, fits: Sequence[Fit]) -> Laplace:
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


def refuse_unconverged(fit: Fit) -> None:
    """NotConverged, of one line, where a fit has not: its curvature is of no minimum."""
    if not fit.converged:
        where = "the orthographic fit" if fit.distance is None else f"the fit at {fit.distance:g} m"
        raise NotConverged(
            f"fit: {where} did not converge ({fit.status}); raise max_steps, or assume more noise"
        )


def nearest_node(nodes: Array, kappas: Array) -> IntArray:
    """(n,) which of nodes (D,), ascending, is nearest to each kappa (n,)."""
    middles = 0.5 * (nodes[1:] + nodes[:-1])
    return np.searchsorted(middles, kappas)


def between_nodes(nodes: Array, values: Array, kappas: Array) -> Array:
    """(n, S) values (D, S) at nodes (D,), ascending, carried linearly to kappas (n,)."""
    if len(nodes) == 1:
        return np.repeat(values, len(kappas), axis=0)
    right = np.searchsorted(nodes[1:-1], kappas) + 1
    share = ((kappas - nodes[right - 1]) / (nodes[right] - nodes[right - 1])).clip(0, 1)[:, None]
    return (1 - share) * values[right - 1] + share * values[right]
