"""Posterior modes: flexibility modes that know the prior and the noise, in standard deviations (MATH.md 4 and 7).

With landmark noise of sd sigma px per coordinate and alpha ~ N(0, I) the face's precision at a fit is, to first order,

    P = Pi^T Pi / sigma^2 + I,

Pi as in linear.py and with the pose's part taken out where the pose is free: under a flat prior that is the Schur
complement of the joint precision, the pose integrated away. G f = nu P f with f^T P f = 1 gives independent directions,
P^-1 = F F^T: f is one standard deviation, nu = |Q f|^2 its share of the surface's variance. Surfaces are compared in
the model's own axes, not aligned: with the pose free, size and slant belong to what is unknown.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from scipy.linalg import cho_factor, cho_solve, eigh

from .arrays import Array, positive, read_only, shown
from .fitting import Fit
from .fitting.checks import check_fit
from .flex import continued, count_of
from .linear import Linear, linearised, pose_columns, without_pose
from .model import FaceModel
from .surface import bending, evaluation_modes, gram, sign, words

FreePose = Literal["fixed", "free"]


@dataclass(frozen=True, slots=True)
class SurfaceSpread:
    """How uncertain the surface is, rms over the evaluation region, millimetres: one standard deviation.

    total^2 = shape^2 + pose^2 + distance^2, by nested fits in this order: what is open with the pose known, what not
    knowing the pose adds, what not knowing the distance adds to both. Another order would give other shares.
    """

    prior_mm: float  # of the model before any picture
    shape_mm: float  # pose and distance known
    pose_mm: float  # added by turn, shift and scale
    distance_mm: float  # added by the distance
    noise_px: float

    @property
    def pose_free_mm(self) -> float:
        """With the pose open and the distance known."""
        return float(np.hypot(self.shape_mm, self.pose_mm))

    @property
    def total_mm(self) -> float:
        """With pose and distance open."""
        return float(np.hypot(self.pose_free_mm, self.distance_mm))


@dataclass(frozen=True, slots=True, eq=False)
class PosteriorModes:
    """Independent directions of what a fit leaves open, the most uncertain first. K modes, S shape coefficients."""

    fit: Fit
    directions: Array  # (K, S) change of alpha, one standard deviation
    amplitude_mm: Array  # (K,) mean surface change by one standard deviation
    landmark_percent: Array  # (K,) mean landmark movement by one, % of the interocular distance, the pose following
    words: tuple[str, ...]  # K descriptions of what the positive direction moves
    total_mm: float  # sd of the surface by all S modes together, rms over the evaluation region
    noise_px: float
    pose: FreePose

    def __post_init__(self) -> None:
        for name in ("directions", "amplitude_mm", "landmark_percent"):
            object.__setattr__(self, name, read_only(getattr(self, name)))


def posterior_modes(
    model: FaceModel,
    fit: Fit,
    count: int | None = 3,
    *,
    noise_px: float | None = None,
    pose: FreePose = "free",
    free_distance: bool = False,
    previous: PosteriorModes | None = None,
) -> PosteriorModes:
    """The `count` directions in which the face is most uncertain at a fit, each one standard deviation long.

    A Gaussian approximation at the fit (MATH.md 7). It does not know the box: where coefficients lie on its bounds
    the face is surer than this says.

    Parameters
    ----------
    count: modes asked for; None: all S.
    noise_px: sigma, sd of the landmarks' noise per coordinate, for points of weight 1; None: what the fit assumed, the
        root of its prior_weight.
    pose: "free" for a camera known by its distance only, "fixed" where turn, shift and scale are known too.
    free_distance: the distance is unknown as well.
    previous: as in `flexibility_modes`.

    Raises
    ------
    ValueError: no fit or one that did not converge, a model of another mesh, an argument out of range, or no noise:
        the fit had no prior and noise_px is not given.
    """
    check_fit(model, fit)
    count = count_of(fit, count)
    columns = pose_columns(pose, get_args(FreePose), free_distance)
    sigma = _noise(fit, noise_px)
    surface = bending(model, fit.alpha, aligned=False)
    picture = linearised(model, fit)
    nu, F = eigh(surface.G, _precision(fit, picture, columns, sigma))
    nu, F = nu[::-1], F[:, ::-1]
    signs = np.zeros(0)
    if previous is not None:
        if not isinstance(previous, PosteriorModes):
            raise ValueError(f"previous: {shown(previous)} is not a PosteriorModes")
        order, signs = continued(previous.directions, F, surface.G, count)
        F = F[:, order]
    F = F[:, :count]
    mean, moves = surface.mean_change(F), surface.parts(F)
    turned = np.array([sign(f, mean[k], moves, k) for k, f in enumerate(F.T)])
    turned[: len(signs)] = signs
    F = F * turned
    movement = (without_pose(picture, columns).shape @ F).reshape(-1, 2, count)
    return PosteriorModes(
        fit=fit,
        directions=np.ascontiguousarray(F.T),
        amplitude_mm=1e3 * mean,
        landmark_percent=100 * np.linalg.norm(movement, axis=1).mean(axis=0) / fit.interocular_px,
        words=tuple(words(moves, k, s) for k, s in enumerate(turned)),
        total_mm=_rms_mm(model, float(nu.sum())),
        noise_px=sigma,
        pose=pose,
    )


def surface_spread(model: FaceModel, fit: Fit, *, noise_px: float | None = None) -> SurfaceSpread:
    """How uncertain the surface of a fit is, and what shape, pose and distance contribute (MATH.md 7).

    noise_px and errors as in `posterior_modes`; the distance counts as open whether the fit chose it or was given it.
    """
    check_fit(model, fit)
    sigma = _noise(fit, noise_px)
    S = len(fit.alpha)
    G, picture = gram(model)[:S, :S], linearised(model, fit)
    shape, free, total = (
        float(np.trace(cho_solve(cho_factor(_precision(fit, picture, columns, sigma)), G)))
        for columns in (0, 6, 7)
    )
    parts = (float(np.trace(G)), shape, max(free - shape, 0.0), max(total - free, 0.0))
    return SurfaceSpread(*(_rms_mm(model, variance) for variance in parts), noise_px=sigma)


def _precision(fit: Fit, picture: Linear, columns: int, sigma: float) -> Array:
    """P (S, S), the first `columns` of the pose integrated away."""
    weights = fit.observation.weights
    if weights is not None:
        root = np.sqrt(np.repeat(weights[fit.observation.visible], 2))[:, None]
        picture = Linear(root * picture.shape, root * picture.pose)
    Pi = without_pose(picture, columns).shape / sigma
    return Pi.T @ Pi + np.eye(Pi.shape[1])


def _noise(fit: Fit, noise_px: float | None) -> float:
    if noise_px is not None:
        return positive("noise_px", noise_px)
    if not fit.prior_weight > 0:
        raise ValueError(
            "noise_px: the fit had no prior to take it from; give the landmarks' sd in pixels"
        )
    return float(np.sqrt(fit.prior_weight))


def _rms_mm(model: FaceModel, variance: float) -> float:
    """Millimetres rms per measured vertex of a sum of squares, m^2."""
    return 1e3 * float(np.sqrt(variance / len(evaluation_modes(model))))
