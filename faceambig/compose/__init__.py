"""From a fit to a Scene: the only place that decides what a picture shows. Page and snapshot draw what comes out."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import replace

import numpy as np

from ..arrays import Array, number
from ..camera import Camera
from ..model import Subject
from ..scene import Curves, Head, Lines, Marks, Photo, Scene, View
from .colours import (
    CLAY,
    GHOST,
    LEGENDS,
    SURFACES,
    UNMEASURED,
    Colours,
    depth_colours,
    depth_legend,
    difference_colours,
    difference_legend,
    greyed,
    over_region,
    plain,
    scale_colours,
    shown_surface,
    signed_colours,
    skin,
    spread_colours,
    spread_legend,
)
from .face import (
    Face,
    bent,
    curves,
    depth_change_mm,
    measure,
    numbers,
    stand_in,
    with_density,
)
from .heads import HALF_HEIGHT, SPACING, VIEWS, head, named_view, pivot
from .look import HIDEABLE, SHOWS, Look, look_of
from .overlays import BREAK, OVERLAYS, Station, marks, pyramid, rays, station
from .picture import outline, photo, photo_of_fit, with_fit
from .row import PINS, SCALE_BAR, compose_pins, compose_row

__all__ = [
    "CLAY",
    "GHOST",
    "HIDEABLE",
    "LEGENDS",
    "OVERLAYS",
    "PINS",
    "SHOWS",
    "SPACING",
    "SURFACES",
    "UNMEASURED",
    "VIEWS",
    "Face",
    "bent",
    "compose",
    "compose_pins",
    "compose_row",
    "curves",
    "depth_change_mm",
    "depth_colours",
    "depth_legend",
    "difference_colours",
    "difference_legend",
    "greyed",
    "head",
    "measure",
    "named_view",
    "numbers",
    "outline",
    "photo",
    "photo_of_fit",
    "pivot",
    "scale_colours",
    "shown_surface",
    "signed_colours",
    "skin",
    "spread_colours",
    "spread_legend",
    "stand_in",
    "with_density",
    "with_fit",
]

ERROR_SCALES = (1.0, 5.0, 10.0, 20.0)
GHOST_OPACITY = 0.45
FADED_IN = 0.75  # fade at which the true face is solid over the fitted one, which then goes
MARGIN = 0.02  # metres between a drawn camera and the edge of the picture


def compose(
    subject: Subject,
    face: Face,
    picture: Photo,
    *,
    titles: tuple[str, str],
    view: str = "three_quarter",
    orbit: tuple[float, float] = (0.0, 0.0),
    zoom: float = 1.0,
    show: str = "both",
    fade: float = 0.5,
    surface: str = "skin",
    spread_mm: Array | None = None,
    overlays: Collection[str] = ("points", "scale"),
    error_scale: float = 1.0,
    hide: Collection[str] = (),
    true_camera: Camera | None = None,
    reference: str = "",
    curve: Curves | None = None,
    legend_words: tuple[str, str] = ("", ""),
    note: str = "",
) -> Scene:
    """True head and fitted head, with the photograph, the numbers and the curves.

    Parameters
    ----------
    subject: the true face; of an own photograph a `stand_in`, with `reference` saying what it is.
    titles: above the true head and above the fitted one.
    view: a key of VIEWS; "free" at `orbit` (azimuth, elevation), degrees; or "camera": the photograph itself.
    zoom: 0.5 to 4; the bar of 50 mm keeps 50 mm.
    show: "both" side by side; "overlay", both in one place, `fade` 0 the fitted face, 1 the true one, one of them
        always solid; "blink", both in one place, in turn; "difference", side by side, the fitted head coloured by it.
    surface: "skin" or "clay"; or of the fitted head "difference" (d_S per vertex, mm), "depth" (`depth_change_mm`) or
        "spread" (`spread_mm` (N,), posterior sd). `shown_surface` says which is drawn, for `legend_words`: title, note.
    overlays: of OVERLAYS; "points" are those on the photograph, "marks" the same on the heads. The ghost is left out
        where the fitted head's colours are values; rays and pyramid are in the room of the heads, so not in the view
        "camera".
    error_scale: 1, 5, 10 or 20 times the gap from cross to circle, of the overlay "errors".
    hide: of HIDEABLE: "numbers" their text, "truth" the true head and every difference to it, "actual" the distance
        the photograph was taken from.
    true_camera: that took the photograph; for the surface "depth", and for rays and pyramid of the true head.

    Raises
    ------
    ValueError: a name that is none, a number out of range, or what an overlay or surface needs is missing.
    """
    look = look_of(view, show, surface, overlays, hide, fade, true_camera)
    colours = _colours(subject, face, look, spread_mm)
    heads = _valued(
        _heads(subject, face, look, titles, colours), _values(subject, face, look, spread_mm)
    )
    lines = () if view == "camera" else tuple(_lines(subject, face, look, picture))
    if curve is not None and "actual" in look.hide:
        curve = replace(curve, true_distance=np.nan)
    return Scene(
        heads=heads,
        views=(_view(look, orbit, zoom, subject, lines),),
        photo=_picture(picture, face, look, error_scale),
        pivot=pivot(subject.model),
        numbers=numbers(face, reference=reference),
        curves=curve,
        legend=LEGENDS[look.surface](*legend_words) if look.surface in LEGENDS else None,
        through_camera=view == "camera",
        blink=look.show == "blink" and len(heads) > 1,
        marks=_marks(subject, face, look),
        lines=lines,
        scale_bar=SCALE_BAR if "scale" in look.overlays else 0.0,
        hide=look.hide,
        note=note,
    )


def _colours(subject: Subject, face: Face, look: Look, spread_mm: Array | None) -> Colours:
    """(N, 3) sRGB of the fitted head."""
    model = subject.model
    if look.surface == "difference":
        return difference_colours(model, face.gaps_mm)
    if look.surface == "depth":
        assert look.true_camera is not None  # look_of refuses
        return depth_colours(model, depth_change_mm(subject, face, look.true_camera))
    if look.surface == "spread":
        if spread_mm is None:
            raise ValueError("surface: 'spread' needs the sd of every vertex; give spread_mm")
        return spread_colours(model, spread_mm)
    colours = plain(model, CLAY) if look.surface == "clay" else skin(subject)
    return colours if face.plausible else greyed(colours)


def _values(subject: Subject, face: Face, look: Look, spread_mm: Array | None) -> Array | None:
    """(N,) millimetres that the colours of the fitted head mean; None where they mean none."""
    if look.surface == "difference":
        return over_region(subject.model, face.gaps_mm)
    if look.surface == "depth" and look.true_camera is not None:
        return over_region(subject.model, depth_change_mm(subject, face, look.true_camera))
    return spread_mm if look.surface == "spread" else None


def _valued(heads: tuple[Head, ...], values: Array | None) -> tuple[Head, ...]:
    """The heads, the fitted one with its values (N,) if it has any."""
    if values is None:
        return heads
    return tuple(replace(one, values_mm=values) if one.name == "fit" else one for one in heads)


def _heads(
    subject: Subject, face: Face, look: Look, titles: tuple[str, str], colours: Colours
) -> tuple[Head, ...]:
    """The true head and the fitted one, side by side or in one place, and the true one's ghost over the fitted."""
    model, valued = subject.model, look.surface in LEGENDS
    own = plain(model, CLAY) if look.surface == "clay" else skin(subject)
    left, right = (0.0, 0.0) if look.show != "both" else (-SPACING / 2, SPACING / 2)
    if "truth" in look.hide:
        return (head(model, "fit", titles[1], face.vertices, colours, slot=0.0, lit=not valued),)
    true = head(model, "true", titles[0], subject.vertices, own, slot=left)
    fit = head(model, "fit", titles[1], face.vertices, colours, slot=right, lit=not valued)
    if look.show == "overlay":
        # The true face comes over the whole fitted one, which goes when that is whole: one of the two is always solid
        true = replace(true, opacity=min(1.0, look.fade / FADED_IN))
        fit = replace(fit, opacity=min(1.0, (1.0 - look.fade) / (1.0 - FADED_IN)))
        return tuple(shown for shown in (true, fit) if shown.opacity > 0)
    if look.show == "both" and "ghost" in look.overlays and not valued and look.view != "camera":
        ghost = head(
            model, "ghost", "", subject.vertices, plain(model, GHOST), slot=right,
            opacity=GHOST_OPACITY,
        )  # fmt: skip
        return true, fit, ghost
    return true, fit


def _picture(picture: Photo, face: Face, look: Look, error_scale: float) -> Photo:
    """The photograph with what is laid over it."""
    error_scale = number("error_scale", error_scale)
    if error_scale not in ERROR_SCALES:
        known = ", ".join(f"{scale:g}" for scale in ERROR_SCALES)
        raise ValueError(f"error_scale: {error_scale:g} is not one of {known}")
    return replace(
        with_fit(picture, face, whole=look.view == "camera"),
        caption="" if "actual" in look.hide else picture.caption,
        points_shown="points" in look.overlays,
        names_shown="names" in look.overlays,
        error_scale=error_scale if "errors" in look.overlays else 0.0,
        outline=outline(face) if "outline" in look.overlays else None,
    )


def _marks(subject: Subject, face: Face, look: Look) -> tuple[Marks, ...]:
    if "marks" not in look.overlays or look.view == "camera":
        return ()
    both = marks(subject, face, names="names" in look.overlays)
    return both[1:] if "truth" in look.hide else both


def _cameras(face: Face, look: Look) -> tuple[tuple[str, Station], ...]:
    """(head, camera) whose rays or pyramid are drawn."""
    if not look.overlays & {"rays", "pyramid"}:
        return ()
    fit = ("fit", station(face.camera, face.rotation, face.translation))
    if "truth" in look.hide or look.true_camera is None:
        return (fit,)
    return ("true", station(look.true_camera)), fit


def _lines(subject: Subject, face: Face, look: Look, picture: Photo) -> Iterable[Lines]:
    """Rays cut to what is shown: from a drawn camera on, else from where the picture ends; and the cameras."""
    at = face.observation.vertices(subject.model)
    for name, place in _cameras(face, look):
        vertices, tone = (subject.vertices, "seen") if name == "true" else (face.vertices, "d_l")
        if "rays" in look.overlays:
            within = (np.array(pivot(subject.model)), HALF_HEIGHT)
            if look.view == "top" and "pyramid" in look.overlays:
                within = (np.zeros(3), BREAK) if place.far else None
            yield rays(name, place, picture, vertices[at], tone, within=within)
        if "pyramid" in look.overlays:
            yield pyramid(name, place, picture)


def _view(
    look: Look,
    orbit: tuple[float, float],
    zoom: float,
    subject: Subject,
    lines: tuple[Lines, ...],
) -> View:
    """The viewer's place; from above, cameras that are drawn are in the picture too."""
    name = "front" if look.view == "camera" else look.view
    drawn = [line.segments for line in lines if line.name == "pyramid"]
    if name != "top" or not drawn:
        return named_view(name, orbit=orbit, zoom=zoom)
    # Seen from above, what lies before the face is below the pivot
    front = max(float(segments[..., 2].max()) for segments in drawn) + MARGIN
    low, high = min(pivot(subject.model)[2] - front, -HALF_HEIGHT), HALF_HEIGHT
    return named_view(name, zoom=zoom, half_height=(high - low) / 2, rise=-(high + low) / 2)
