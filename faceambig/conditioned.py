"""The model after a photograph: faces that explain it, as mean and modes again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .fitting import Fit
from .fitting.checks import check_fit_of
from .fitting.task import prepare
from .flex import gram
from .laplace import laplace_at, refuse_unconverged
from .model import FaceModel
from .truncated import box_moments


def condition(model: FaceModel, fit: Fit) -> FaceModel:
    """The model after a photograph: faces that explain it at the fit's distance, as mean and modes again.

    Laplace's Gaussian of alpha at the fit, pose eliminated and the distance held, sigma^2 = fit.prior_weight; in an
    active box, the moments of the cut one. Its modes are the principal ones of the surface that d_S is measured on,
    the strongest first; there are as many as the fit used.

    Raises
    ------
    ValueError: no fit, one of another model, one that did not converge or is no optimum of E, one without a prior.
    """
    check_fit_of(model, fit)
    S = len(fit.alpha)
    if not fit.options.least_squares:
        raise ValueError(
            f"fit: by method {fit.options.method!r}, weighting {fit.options.weighting!r}, is no optimum of E; "
            "fit with method='joint'"
        )
    refuse_unconverged(fit)
    if not fit.prior_weight > 0:
        raise ValueError(
            "fit: without a prior (prior_weight 0) there is no posterior; give noise_percent"
        )
    options = replace(fit.options, modes=S, prior_weight=fit.prior_weight)
    laplace = laplace_at(prepare(model, fit.observation, options).problem, [fit])
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
