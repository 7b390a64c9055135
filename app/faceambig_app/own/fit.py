"""What the points of a person's own photograph become: fits, modes, a sweep. Remembered in the photograph alone.

There is no true face: the fit at 60 cm stands in for it, and everything that is measured is measured to that.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

import faceambig as fa
from faceambig.compose import Face, bent, curves, measure, stand_in
from faceambig.flex import FlexibilityModes, plausible_limit
from faceambig.model import Subject
from faceambig.observation import FLATTEST, MIN_POINTS
from faceambig.scene import Curves

from ..pipeline.fits import model
from ..state import DEFAULT, Fitting, ViewState
from ..state.fields import FIELDS
from ..text import say
from .photo import OwnPhoto

REFERENCE = 0.6  # metres: of the fit that stands in for the true face

_T = TypeVar("_T")


def problem(own: OwnPhoto | None, state: ViewState | None = None) -> str:
    """Why no face can be fitted, in words; "" if one can. Without a state only the points are looked at."""
    if own is None:
        return say("own.none")
    points = own.points[np.isfinite(own.points).all(axis=1)]
    places = np.unique(points, axis=0)
    if len(places) < MIN_POINTS:
        return say("own.few", points=len(places), needed=MIN_POINTS)
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if spread[1] <= FLATTEST * spread[0]:
        return say("own.line")
    if state is None:
        return ""
    return _once(own, ("failed", state.model, state.fitting), lambda: _failed(own, state))


def _failed(own: OwnPhoto, state: ViewState) -> str:
    """Why the solver refuses these points, such as those of a face from behind; "" if it does not."""
    try:
        for fitting in (state.fitting, state.fitting._replace(distance=REFERENCE)):
            fit_of(own, state, fitting)
    except ValueError as error:
        return say("own.no_fit", cause=str(error).removeprefix("points: "))
    return ""


def reference(own: OwnPhoto, state: ViewState, draft: bool) -> Subject:
    """The fit at 60 cm, which stands in for the true face, in the colours of the photograph."""
    from faceambig.texture import sample_texture

    fit = fit_of(own, state, state.fitting._replace(distance=REFERENCE))
    if not draft:
        key = ("skin", state.model, fit.options)
        colours = _once(own, key, lambda: sample_texture(fit, own.taken.rgb).colours)
        own.memo["skin"] = colours
    colours = own.memo.get("skin")
    if colours is not None and len(colours) != fit.model.n_vertices:
        colours = None  # of another model's mesh
    return stand_in(fit, say("own.reference"), colours)


def own_sweep(own: OwnPhoto, state: ViewState) -> tuple[fa.Sweep, Curves]:
    """The sweep behind the curves, and the curves."""
    fitting = state.fitting._replace(distance=None)

    def computed() -> tuple[fa.Sweep, Curves]:
        sweep = fa.sweep_distance(
            model(state.model), _observation(own), modes=_count(fitting), box=fitting.box,
            noise_percent=fitting.prior, tolerance=1e-6,
        )  # fmt: skip
        return sweep, curves(reference(own, state, draft=True), sweep, None)

    return _once(own, ("curves", state.model, fitting), computed)


def own_curves(own: OwnPhoto, state: ViewState) -> Curves:
    """d_L, and the difference to the fit at 60 cm, over all distances."""
    return own_sweep(own, state)[1]


def told_distance(own: OwnPhoto | None, state: ViewState) -> float | None:
    """Metres from the camera that the focal length in the file means, with the fitted scale; None where it tells none.

    f = s t_z: a lens of f pixels that shows the face with s pixels a metre stands t_z away (MATH.md 1). None too where
    that is no distance that can be assumed: the picture is then cropped or zoomed.
    """
    if own is None or own.taken.focal_px is None or problem(own, state):
        return None
    metres = own.taken.focal_px / fit_of(own, state, state.fitting).camera.s
    return metres if FIELDS["distance"].low <= metres <= FIELDS["distance"].high else None


def own_face(own: OwnPhoto, state: ViewState, fitting: Fitting, subject: Subject) -> Face:
    """The fitted face, bent as the state says, measured against the reference."""
    if state.draw is not None or state.extreme is not None:
        raise ValueError(say("own.no_draw"))
    fit = fit_of(own, state, fitting)
    if not state.flex:
        return measure(subject, fit)
    last = max(mode for mode, _ in state.flex)
    modes = _bending(own, state, fitting, len(fit.alpha))
    by_mode = dict(state.flex)
    amounts = [by_mode.get(mode, 0.0) for mode in range(1, last + 1)]
    return measure(
        subject, fit, bent(modes, amounts),
        limit=max(plausible_limit(len(fit.alpha)), float(np.linalg.norm(fit.alpha))),
        flex=[(modes.words[mode - 1], mm) for mode, mm in state.flex],
    )  # fmt: skip


def _bending(own: OwnPhoto, state: ViewState, fitting: Fitting, count: int) -> FlexibilityModes:
    """The modes up to the last that is bent, of a fit with `count` coefficients."""
    last = max(mode for mode, _ in state.flex)
    if last > count:
        raise ValueError(f"flex: mode {last} of a fit with {count} modes")
    return modes_of(own, state, fitting, last)


def modes_of(own: OwnPhoto, state: ViewState, fitting: Fitting, count: int) -> FlexibilityModes:
    how = "algebraic" if state.flex_at == "dlt" else "reprojection"

    def computed() -> FlexibilityModes:
        fit = fit_of(own, state, fitting)
        return fa.flexibility_modes(fit.model, fit, count=count, linearisation=how)

    return _once(own, ("modes", state.model, fitting, how, count), computed)


def fit_of(own: OwnPhoto, state: ViewState, fitting: Fitting) -> fa.Fit:
    def computed() -> fa.Fit:
        return fa.fit(
            model(state.model), _observation(own),
            camera="orthographic" if fitting.distance is None else "perspective",
            distance=fitting.distance, modes=_count(fitting), box=fitting.box,
            noise_percent=fitting.prior,
        )  # fmt: skip

    return _once(own, ("fit", state.model, fitting), computed)


def _observation(own: OwnPhoto) -> fa.Observation:
    return fa.Observation(own.points, own.scheme, image_size=own.taken.size)


def _count(fitting: Fitting) -> int | None:
    """A setting left alone is the library's default, which suits smaller models too."""
    return None if fitting.modes == DEFAULT.modes else fitting.modes


def _once(own: OwnPhoto, key: Any, make: Callable[[], _T]) -> _T:
    """What `make` gives, remembered as long as these points."""
    if key not in own.memo:
        own.memo[key] = make()
    return own.memo[key]
