"""ViewState -> Frame: observation, fit, bend and Scene, each a pure function of the part of the state it needs.

The steps are cached in fits.py, likely.py, faces.py and scenes.py; here is which of them a picture asks for. Moving the
view never refits, and a draft, while a hand moves, computes nothing that takes longer than a fit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from faceambig.arrays import Array
from faceambig.compose import shown_surface
from faceambig.scene import Curves, Scene

from ..state import Bend, Look, ViewState
from .faces import curve, likely_curve
from .fits import n_fitted
from .likely import source, spread
from .scenes import scene_of


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """What one browser shows now."""

    state: ViewState
    scene: Scene
    points: int  # that the face was fitted to


def frame(state: ViewState, *, with_curves: bool = True) -> Frame:
    """Everything a picture shows of a state. with_curves=False leaves the plots out: they cost a sweep a target."""
    look, sd = state.look, None
    if _surface(look) == "spread":
        sd = spread(source(state.target, state.fitting))
    scene = scene_of(state, look, state.bend, sd)
    if with_curves and look.show != "row":
        shown = curve(state.target, state.fitting)
        if "actual" in look.hide:
            shown = replace(shown, true_distance=np.nan)
        scene = replace(scene, curves=shown)
    return Frame(state, scene, n_fitted(state.target, state.fitting))


def draft(state: ViewState, rested: ViewState | None = None) -> Frame:
    """A frame while a hand moves: no curves, and of the posterior only what `rested`, shown before, left in store.

    A spread is that of the rested state; a drawn or an extreme face stays while it is of the same points, else the
    plain fit is shown until the hand rests.
    """
    look, bend = state.look, state.bend
    if not _in_store(state, rested):
        bend = Bend((), bend.flex_at, None, None)
    look, sd = _draft_look(state, look, rested)
    return Frame(state, scene_of(state, look, bend, sd), n_fitted(state.target, state.fitting))


def _draft_look(
    state: ViewState, look: Look, rested: ViewState | None
) -> tuple[Look, Array | None]:
    """The look of a draft, and the spread it needs."""
    if _surface(look) != "spread":
        return look, None
    if rested is None or rested.model != state.model or _surface(rested.look) != "spread":
        return look._replace(surface="skin"), None
    return look, spread(source(rested.target, rested.fitting))


def _surface(look: Look) -> str:
    """The surface that is drawn; a row has its own."""
    if look.show == "row":
        return "difference"
    return shown_surface(look.surface, look.show, look.hide)


def _in_store(state: ViewState, rested: ViewState | None) -> bool:
    """Whether the face that stands for the fitted one has been computed for `rested`; of a plain fit always."""
    bend = state.bend
    if bend.extreme is None and bend.draw is None:
        return True
    if rested is None:
        return False
    if bend.extreme is not None:
        same = (rested.target, rested.fitting) == (state.target, state.fitting)
        return same and rested.extreme is not None
    same = source(rested.target, rested.fitting) == source(state.target, state.fitting)
    return same and rested.extreme is None and rested.draw is not None


def plots_of(state: ViewState) -> Curves:
    """The curves of a state with how likely each distance is: a sweep and a posterior a target, only at rest."""
    return likely_curve(state.target, state.fitting)
