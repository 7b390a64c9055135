"""The frame of a person's own photograph: the fits at 60 cm and at the assumed distance, and their difference."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from faceambig.compose import (
    CLAY,
    Face,
    compose,
    compose_row,
    head,
    named_view,
    photo_of_fit,
    pivot,
    shown_surface,
)
from faceambig.flex import FlexibilityModes
from faceambig.model import Subject
from faceambig.scene import Curves, Numbers, Photo, Scene

from ..pipeline.fits import model
from ..pipeline.told import LETTERS
from ..state import ViewState
from ..state.actions import ROW_DISTANCES
from ..state.fields import FIELDS, MODES
from ..text import centimetres, movement, numeral, percent_number, say
from .fit import REFERENCE, fit_of, modes_of, own_curves, own_face, problem, reference
from .photo import NAMED, OwnPhoto


@dataclass(frozen=True, slots=True, eq=False)
class OwnFrame:
    """What one browser shows of its own photograph."""

    scene: Scene
    # Label, marks: of the modes
    sliders: tuple[tuple[str, tuple[tuple[float, str], ...]], ...] = ()


def own_frame(own: OwnPhoto | None, state: ViewState, draft: bool) -> OwnFrame:
    """What a browser shows of its own photograph; the average face as long as none can be fitted.

    A draft has neither curves nor new colours.
    """
    if state.data != "points":
        raise ValueError(say("own.only_points"))
    if own is None or problem(own, state):
        return OwnFrame(_average(own, state))
    fitting = state.fitting
    subject = reference(own, state, draft)
    if state.show == "row":
        return OwnFrame(_row(own, state, subject))
    face = own_face(own, state, fitting, subject)
    scene = _scene(own, state, subject, face, None if draft else own_curves(own, state))
    if draft:
        return OwnFrame(scene)
    return OwnFrame(
        scene, _sliders(modes_of(own, state, fitting, state.flex_from + MODES - 1), state.flex_from)
    )


def _sliders(
    modes: FlexibilityModes, first: int
) -> tuple[tuple[str, tuple[tuple[float, str], ...]], ...]:
    """What the sliders of the modes from `first` on say; where plausible faces end."""
    sliders = []
    for letter, k in zip(LETTERS, range(first - 1, len(modes.words)), strict=False):
        low, high = FIELDS["flex"].low, FIELDS["flex"].high
        ends = tuple((round(mm, 2), "") for mm in modes.reach(k) if low <= mm <= high)
        sliders.append((say("flex.slider", letter=letter, words=movement(modes.words[k])), ends))
    return tuple(sliders)


def _scene(
    own: OwnPhoto, state: ViewState, subject: Subject, face: Face, plot: Curves | None
) -> Scene:
    hide = [name for name in state.hide if name != "actual"]  # nobody knows it
    surface = shown_surface(state.surface, state.show, hide)
    if surface == "spread":
        raise ValueError(say("own.no_spread"))
    fit = fit_of(own, state, state.fitting._replace(distance=REFERENCE))
    scene = compose(
        subject,
        face,
        photo_of_fit(face.fit, own.taken.size, caption=say("own.caption")),
        titles=(say("own.head"), say("head.fit")),
        view=state.view,
        orbit=state.orbit or (0.0, 0.0),
        zoom=state.zoom,
        show=state.show,
        fade=state.fade,
        surface=state.surface,
        overlays=[name for name in state.overlays if name != "ghost"],  # of a true face
        error_scale=float(state.error_scale),
        hide=hide,
        true_camera=fit.camera,
        reference=say("own.reference"),
        curve=plot,
        legend_words=(say("own.legend"), say("legend.unmeasured")),
        note=say("own.note"),
    )
    return replace(scene, photo=_told(own, scene.photo))


def _told(own: OwnPhoto, picture: Photo) -> Photo:
    """The photograph with circles only where there are crosses, and its points by the names that were asked for."""
    return replace(
        picture,
        projected=np.where(np.isfinite(own.points), picture.projected, np.nan),
        names=tuple(say(f"point.{name}") if name in NAMED else name for name in own.names),
    )


def _row(own: OwnPhoto, state: ViewState, subject: Subject) -> Scene:
    """The reference and the fits at four distances, coloured by their difference to it."""
    faces = [
        own_face(own, state, state.fitting._replace(distance=d), subject) for d in ROW_DISTANCES
    ]
    titles = [say("head.assumed", distance=centimetres(d)) for d in ROW_DISTANCES]
    captions = [
        (
            (f"{say('number.in_line_d_l')} {percent_number(face.d_l_percent)}\u202f%", "d_l"),
            (f"{say('own.difference')} {numeral(f'{face.d_s_mm:.1f}')}\u202fmm", "d_s"),
        )
        for face in faces
    ]
    scene = compose_row(
        subject, faces, photo_of_fit(faces[-1].fit, own.taken.size, caption=say("own.caption")),
        titles=[say("own.head"), *titles], captions=[(), *captions],
        legend_words=(say("own.legend"), say("legend.unmeasured")), note=say("own.note"),
    )  # fmt: skip
    numbers = replace(scene.numbers, reference=say("own.reference"))
    return replace(scene, numbers=numbers, photo=_told(own, scene.photo))


def _average(own: OwnPhoto | None, state: ViewState) -> Scene:
    """The average face beside the photograph and the points that there are."""
    faces = model(state.model)
    clay = np.tile(np.array(CLAY, dtype=np.uint8), (faces.n_vertices, 1))
    nothing = Numbers(None, np.nan, np.nan, converged=True, plausible=True, eyes_meaning="")
    size, points = (500, 500), np.zeros((0, 2))
    names: tuple[str, ...] = ()
    if own is not None:
        size, points, names = own.taken.size, own.points, own.names
    view = state.view if state.view != "camera" else "front"
    return Scene(
        heads=(head(faces, "fit", say("own.average"), faces.mean, clay, slot=0.0),),
        views=(named_view(view, orbit=state.orbit or (0.0, 0.0), zoom=state.zoom),),
        photo=Photo(
            *size, observed=points, projected=np.full(points.shape, np.nan),
            names=tuple(say(f"point.{name}") if name in NAMED else name for name in names),
            caption="" if own is None else say("own.caption"), vertices=faces.mean, faces=faces.faces, colours=clay,
            occlusion=None, focal=1.0, principal=(0.5 * size[0], 0.5 * size[1]),
        ),
        numbers=nothing,
        pivot=pivot(faces),
    )  # fmt: skip
