"""What a fit must be for what is asked of it afterwards: one line that says what is wrong."""

from __future__ import annotations

from ..arrays import shown
from ..model import FaceModel
from .result import Fit


def check_model(model: object) -> None:
    """ValueError unless `model` is one."""
    if not isinstance(model, FaceModel):
        raise ValueError(f"model: {shown(model)} is not a FaceModel; load one with load_model")


def check_fit_of(model: FaceModel, fit: Fit) -> None:
    """ValueError unless `fit` is a fit of a model with this mesh and these modes."""
    check_model(model)
    if not isinstance(fit, Fit):
        raise ValueError(f"fit: {shown(fit)} is not a Fit; make one with faceambig.fit")
    if model.n_vertices != fit.model.n_vertices or model.n_modes < len(fit.alpha):
        raise ValueError(
            f"model: {model.n_vertices} vertices, {model.n_modes} modes; "
            f"the fit is of one with {fit.model.n_vertices} and {fit.model.n_modes}"
        )


def check_fit(model: FaceModel, fit: Fit) -> None:
    """As `check_fit_of`, and that it converged."""
    check_fit_of(model, fit)
    if not fit.converged:
        raise ValueError(
            f"fit: it did not converge ({fit.status.value}), so its neighbourhood means nothing; "
            "fit again with more max_steps, or with method='joint'"
        )
