"""What the page says beside a person's own photograph: its HTML, by the element that shows it."""

from __future__ import annotations

from html import escape

import numpy as np

from faceambig.scene import Scene

from ..markup import figures, photograph, plots
from ..panel.data import Shown
from ..state import ViewState
from ..text import distance_text, say
from . import placing
from .fit import own_curves, problem
from .photo import OwnPhoto


def heading(own: OwnPhoto | None, state: ViewState) -> str:
    """The first words."""
    if own is None:
        lines = [say("own.none")]
    elif own.asked or problem(own, state):
        # The same while points are placed: the photograph below must not move under the hand
        lines = [say("own.start")]
    else:
        assumed = None if state.camera == "orthographic" else state.distance
        lines = [
            say("own.lead", assumed=distance_text(assumed), points=own.placed),
            say("own.try"),
        ]
    body = "".join(f"<p>{escape(line)}</p>" for line in lines)
    return f'<div class="fa"><h1>{escape(say("own.heading"))}</h1>{body}</div>'


def marks(own: OwnPhoto | None, scene: Scene) -> str:
    """The photograph and the points that a hand can move on it; above it, the point that is asked for."""
    if own is None:
        return ""
    return placing.asked_words(own) + photograph.photo_marks(
        scene.photo, draggable=True, place=bool(own.asked), part=own.part, hover=False
    )


def cards(own: OwnPhoto | None, state: ViewState, scene: Scene) -> str:
    """The two numbers, or what is missing for them."""
    if words := problem(own, state):
        return f'<div class="fa"><p class="fa-warn">{escape(words)}</p></div>'
    return figures.cards(scene.numbers, hide=state.hide)


def curves(own: OwnPhoto | None, state: ViewState, scene: Scene) -> str:
    """Both plots; nothing without a fit."""
    if own is None or problem(own, state):
        return ""
    return plots.plots(own_curves(own, state), scene.numbers, hide=state.hide)


def spoken(own: OwnPhoto | None, state: ViewState, scene: Scene) -> str:
    """What a screen reader says at rest."""
    if words := problem(own, state):
        return f'<div class="fa-hidden" aria-live="polite">{escape(words)}</div>'
    return figures.spoken(scene.numbers, hide=state.hide)


def shown(own: OwnPhoto | None, status: str, *, can_undo: bool, hint: float | None) -> Shown:
    """The tab Data."""
    if own is None:
        return Shown(photo=False, status=status)
    if not status and own.placed and not own.asked:
        status = problem(own) or say("own.done", points=own.placed)
    elif not status and own.placed:
        status = problem(own)
    return Shown(
        photo=True,
        asked=bool(own.asked),
        status=status,
        more=bool(placing.left(own)),
        undo=can_undo,
        hint=None if hint is None or not np.isfinite(hint) else hint,
    )
