"""A face and a Look -> Scene: which heads, titles, legends and notes a picture has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from faceambig.arrays import Array
from faceambig.compose import (
    Face,
    compose,
    compose_pins,
    compose_row,
    named_view,
    numbers,
    photo,
    shown_surface,
    with_fit,
)
from faceambig.scene import Photo, Scene, View

from ..state import DEFAULT, Bend, Look, Target, ViewState, names_of_pins
from ..state.actions import ROW_DISTANCES
from ..text import centimetres, distance_text, each_language, numeral, percent_number, say
from .faces import face
from .fits import n_fitted, photograph

PHOTO_FULL, PHOTO_DRAFT = 560, 200  # pixels wide, of the page's photograph


def scene_of(state: ViewState, look: Look, bend: Bend, spread_mm: Array | None = None) -> Scene:
    """The scene of a state, looked at and bent in a way; without curves.

    spread_mm: (N,) posterior sd of every vertex, for the surface of that name.
    """
    if look.show == "row":
        return _row(state, look, bend)
    taken = photograph(state.target)
    return compose(
        taken.subject,
        face(state.target, state.fitting, bend),
        picture(state.target),
        titles=(say("head.true"), fit_title(bend)),
        view=look.view,
        orbit=look.orbit or (0.0, 0.0),
        zoom=look.zoom,
        show=look.show,
        fade=look.fade,
        surface=look.surface,
        spread_mm=spread_mm,
        overlays=look.overlays,
        error_scale=look.error_scale,
        hide=look.hide,
        true_camera=taken.camera,
        legend_words=_legend(shown_surface(look.surface, look.show, look.hide)),
        note=_note(state),
    )


def fit_title(bend: Bend) -> str:
    """What stands above the fitted head."""
    if bend.extreme is not None:
        return say("head.extreme", number=bend.extreme)
    return say("head.fit") if bend.draw is None else say("head.draw", number=bend.draw + 1)


def _legend(surface: str) -> tuple[str, str]:
    """Title and note of the scale that a surface has."""
    match surface:
        case "difference":
            return say("legend.difference"), say("legend.unmeasured")
        case "depth":
            return say("legend.depth"), say("legend.depth_note")
        case "spread":
            return say("legend.spread"), say("legend.spread_note")
        case _:
            return "", ""


def _row(state: ViewState, look: Look, bend: Bend) -> Scene:
    """The pinned faces, or the true head and the fits at ROW_DISTANCES, coloured by their difference.

    The photograph and the numbers beside them stay those of the state.
    """
    row = _pins(state, look) if state.pins else _distances(state, look, bend)
    now = face(state.target, state.fitting, bend)
    return replace(
        row,
        views=tuple(_row_views(look)),
        photo=_shown(replace(with_fit(picture(state.target), now, whole=False)), look),
        numbers=numbers(now),
    )


def _shown(taken: Photo, look: Look) -> Photo:
    """The photograph beside a row: its points and its caption as the look says."""
    return replace(
        taken,
        caption="" if "actual" in look.hide else taken.caption,
        points_shown="points" in look.overlays,
        names_shown="names" in look.overlays,
        error_scale=float(look.error_scale) if "errors" in look.overlays else 0.0,
    )


def _row_views(look: Look) -> Sequence[View]:
    """Front over side, unless a view of one's own was chosen; there is none through one camera of several."""
    if look.view in (DEFAULT.view, "camera"):
        return [named_view(name, zoom=look.zoom) for name in ("front", "side")]
    return [named_view(look.view, orbit=look.orbit or (0.0, 0.0), zoom=look.zoom)]


def _distances(state: ViewState, look: Look, bend: Bend) -> Scene:
    """The true head and the fits from near to far; bent, but no other face stands for them."""
    bend = bend._replace(draw=None, extreme=None)
    faces = [face(state.target, state.fitting._replace(distance=d), bend) for d in ROW_DISTANCES]
    actual = "actual" not in look.hide
    titles = [
        say("head.true"),
        *(say("head.assumed", distance=centimetres(d)) for d in ROW_DISTANCES),
    ]
    taken = ((say("head.taken", distance=centimetres(state.actual)), "dim"),) if actual else ()
    return compose_row(
        photograph(state.target).subject,
        faces,
        picture(state.target),
        titles=titles,
        captions=[taken, *map(_caption, faces)],
        legend_words=_legend("difference"),
        hide=look.hide,
        scale="scale" in look.overlays,
        note=_note(state),
    )


def _pins(state: ViewState, look: Look) -> Scene:
    kept = [(photograph(pin.target), pin_face(pin)) for pin in state.pins]
    return compose_pins(
        [(taken.subject, shown) for taken, shown in kept],
        picture(state.pins[-1].target),
        titles=pin_titles(state),
        captions=[((taken.subject.name, "dim"), *_caption(shown)) for taken, shown in kept],
        legend_words=_legend("difference"),
        hide=look.hide,
        scale="scale" in look.overlays,
        note=say("note.pins", model=kept[0][0].subject.model.name, count=len(kept)),
    )


def pin_face(pin: ViewState) -> Face:
    """The face that a pin keeps."""
    return face(pin.target, pin.fitting, pin.bend)


def pin_names(state: ViewState) -> tuple[str, ...]:
    """What each pin is called: its name, or its number."""
    named = enumerate(names_of_pins(state), start=1)
    return tuple(name or say("pin.name", number=number) for number, name in named)


def pin_titles(state: ViewState) -> list[str]:
    """What each pin is called, and where its face was seen from: `Pin 1, assumed 60 cm`."""
    named = zip(pin_names(state), state.pins, strict=True)
    return [f"{name}, {place_words(pin)}" for name, pin in named]


def place_words(pin: ViewState) -> str:
    """The distance of a pin's face: the one assumed, or that of a face drawn with its own."""
    distance = centimetres(pin_face(pin).camera.distance)
    drawn = pin.bend.extreme is None and pin.bend.draw is not None
    if drawn:
        return say("pin.drawn", distance=distance)
    return say("head.assumed", distance=distance)


def _caption(shown: Face) -> tuple[tuple[str, str], ...]:
    return (
        (f"{say('number.in_line_d_l')} {percent_number(shown.d_l_percent)}\u202f%", "d_l"),
        (f"{say('number.in_line_d_s')} {numeral(f'{shown.d_s_mm:.1f}')}\u202fmm", "d_s"),
    )


@each_language(maxsize=64)
def picture(target: Target) -> Photo:
    """The photograph of a target, without a fit's points."""
    taken = photograph(target)
    caption = say("app.taken", distance=distance_text(target.actual))
    return photo(taken.subject, taken.observation, taken.camera, caption=caption)


@lru_cache(maxsize=64)
def photo_jpeg(target: Target, draft: bool) -> bytes:
    """The photograph as a JPEG for the page; a draft is small and coarse, for while a hand turns the head."""
    import cv2  # 75 ms to import: only where a picture is made

    from faceambig.render.painter import paint_photo

    taken, width = picture(target), PHOTO_FULL
    coarse = photograph(target).subject.model.coarse_faces
    if draft and coarse is not None:
        taken, width = replace(taken, faces=coarse), PHOTO_DRAFT
    rgb = paint_photo(taken, width)
    return cv2.imencode(".jpg", rgb[:, :, ::-1], (cv2.IMWRITE_JPEG_QUALITY, 88))[1].tobytes()


def _note(state: ViewState) -> str:
    taken, noise = photograph(state.target), say("note.noise_free")
    if state.noise:
        noise = say("note.noise", percent=f"{state.noise:g}")
    return say(
        "note.snapshot",
        points=n_fitted(state.target, state.fitting),
        model=taken.subject.model.name,
        subject=taken.subject.name,
        noise=noise,
    )


def whole(scene: Scene) -> Scene:
    """`scene`, if all its heads, points and lines are finite; ValueError: a browser would show nothing at all."""
    parts = [head.vertices for head in scene.heads]
    parts += [mark.points for mark in scene.marks] + [line.segments for line in scene.lines]
    if not all(np.isfinite(part).all() for part in parts):
        raise ValueError(say("error.not_finite"))
    return scene
