"""Target, Fitting and Bend -> the face that is shown, measured against the true one; and the curves over all distances.

Each step is memoised and bounded, shared by every browser: thirty pupils in one lesson cost one fit.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

import faceambig as fa
from faceambig.compose import Face, curves, measure, with_density
from faceambig.errors import BeyondTolerance, NotConverged
from faceambig.metrics import HUMAN_TOLERANCE_PERCENT
from faceambig.scene import Curves

from ..state import Bend, Fitting, Target
from ..text import say
from .fits import fitted, options, photograph
from .likely import Source, bending, drawn, extremes, limit, posterior, source

# Metres from, to, fits of the curves where one fit takes a tenth of a second; the lines between are as smooth
FEW = (0.2, 3.0, 13)


def face(target: Target, fitting: Fitting, bend: Bend) -> Face:
    """The face of a state, measured against the true one; ValueError in words where there is none.

    An extreme face goes before a draw, and a draw before bends: each stands for the whole face.
    """
    try:
        return _face(target, fitting, bend)
    except BeyondTolerance as error:
        tolerance = f"{HUMAN_TOLERANCE_PERCENT:g}"
        raise ValueError(say("flex.no_extremes", tolerance=tolerance)) from error


@lru_cache(maxsize=64)
def _face(target: Target, fitting: Fitting, bend: Bend) -> Face:
    fit = fitted(target, fitting)
    taken = photograph(target)
    shown = taken.observation if target.data == "dense" else None
    if bend.extreme is not None:
        far = extremes(target, fitting).faces[bend.extreme - 1]
        return measure(
            taken.subject, fit, alpha=far.alpha, camera=far.camera, limit=limit(fit), shown=shown
        )
    if bend.draw is not None:
        draw = drawn(source(target, fitting), bend.draw)
        # Of all modes and no box: the limit is that of so many, and a posterior's own faces are never greyed
        return measure(taken.subject, fit, alpha=draw.alpha, camera=draw.camera, shown=shown)
    if not bend.flex:
        return measure(taken.subject, fit, shown=shown)
    last = max(mode for mode, _ in bend.flex)
    if last > len(fit.alpha):
        raise ValueError(f"flex: mode {last} of a fit with {len(fit.alpha)} modes")
    modes = bending(target, fitting, bend.flex_at, last)
    most, most_mm = max(bend.flex, key=lambda pair: abs(pair[1]))
    return measure(
        taken.subject,
        fit,
        np.sum([mm * modes.directions[mode - 1] for mode, mm in bend.flex], axis=0),
        limit=limit(fit),
        flex_words=modes.words[most - 1],
        flex_mm=most_mm,
        flex=[(modes.words[mode - 1], mm) for mode, mm in bend.flex],
        shown=shown,
    )


def curve_key(target: Target, fitting: Fitting) -> tuple[Target, Fitting]:
    """What the curves of a state depend on: not its assumed distance."""
    return target, fitting._replace(distance=None)


def curve(target: Target, fitting: Fitting) -> Curves:
    """d_L and d_S of a target over all distances."""
    return _curve(*curve_key(target, fitting))


def likely_curve(target: Target, fitting: Fitting) -> Curves:
    """The curves with how likely each distance is; without, where the points contradict the noise assumed."""
    return _likely_curve(*curve_key(target, fitting), source(target, fitting))


@lru_cache(maxsize=64)
def _curve(target: Target, fitting: Fitting) -> Curves:
    sweep = _sweep(target, fitting)
    return curves(photograph(target).subject, sweep, target.actual)


def _sweep(target: Target, fitting: Fitting) -> fa.Sweep:
    if target.data == "points":
        taken = photograph(target)
        return fa.sweep_distance(
            taken.subject.model,
            taken.observation,
            tolerance=1e-6,  # d_L to 3e-6 points, d_S to 3e-4 mm: far below a pixel of the plot
            **options(fitting),
        )
    distances = np.geomspace(*FEW)
    fits = [fitted(target, fitting._replace(distance=float(metres))) for metres in distances]
    return fa.Sweep(distances, tuple(fits), fitted(target, fitting))


@lru_cache(maxsize=64)
def _likely_curve(target: Target, fitting: Fitting, of: Source) -> Curves:
    plain = _curve(target, fitting)
    try:
        return with_density(plain, posterior(of).distance_density)
    except NotConverged:  # the other curves are there all the same, and it would fail again
        return plain
