"""The photograph of the page: red crosses of its points under blue circles of the fitted face's, as SVG.

The picture and the crosses change with the photograph only and can be sent in elements of their own; what follows a
hand is the circles. White halos: on skin the two colours alone are too weak.
"""

from __future__ import annotations

import base64
import math
from dataclasses import replace
from html import escape

import numpy as np

from faceambig.arrays import Array, IntArray
from faceambig.scene import Photo

from ..text import NARROW, each_language, numeral, say

CROSS, CIRCLE = 3.6, 4.6  # half sizes in pixels of a picture of 500
RED, BLUE, INK = "#C8102E", "#1B5FC1", "#1D2733"  # on the photograph, in both themes


def photo_picture(jpeg: bytes) -> str:
    """The photograph as a style, so that moving the points does not send the picture again."""
    data = base64.b64encode(jpeg).decode()
    return f"<style>.fa-photo{{background-image:url(data:image/jpeg;base64,{data})}}</style>"


def photo_crosses(photo: Photo) -> str:
    """The crosses in an element of their own, for `photo_marks(..., crosses=False)` in the same page."""
    return (
        f'<svg class="fa-defs" aria-hidden="true"><defs>{_crosses_path(photo)}</defs></svg>'
        if photo.points_shown
        else '<svg class="fa-defs" aria-hidden="true"></svg>'
    )


def photo_marks(
    photo: Photo,
    *,
    crosses: bool = True,
    draggable: bool = False,
    hover: bool = True,
    landmarks: IntArray | None = None,
    place: bool = False,
    part: tuple[float, float, float, float] | None = None,
) -> str:
    """The points on the photograph, with the key below.

    crosses: False where `photo_crosses` is in the page. draggable: each point is a button that the page's script moves;
    the photograph then says its size in pixels. hover: names and gaps under the pointer, 8 kB that a hand on a slider
    does not need. landmarks: (L,) vertices of the points, whose depth turns the gaps into millimetres. place: a click
    places a point. part: x, y, width and height of what is shown, pixels; None: all.
    """
    whole, photo = photo, photo if part is None else replace(photo, width=part[2], height=part[3])
    points = draggable or photo.points_shown
    drawn = [_outline(photo), _errors(photo) if points else ""]
    if points:
        drawn += [_crosses_and_circles(photo, crosses and not draggable, draggable)]
        drawn += [_names(photo)] if photo.names_shown else []
        drawn += [_buttons(photo)] if draggable else []
        drawn += [_hover(photo, landmarks)] if hover and not draggable else []
    role = "group" if draggable else "img"  # a picture would hide its buttons from a screen reader
    size = f' data-fa-photo="{whole.width}x{whole.height}"' if draggable or place else ""
    size += ' data-fa-place="1"' if place else ""
    x, y, style = 0.0, 0.0, ""
    if part is not None:
        x, y = part[:2]
        size += f' data-fa-view="{",".join(f"{number:g}" for number in part)}"' if size else ""
        style = _cut(whole, part)
    words = escape(_alternative(photo, landmarks))
    return (
        f'<div class="fa"><div class="fa-photo" style="aspect-ratio:{photo.width:g}/{photo.height:g}{style}"{size}>'
        f'<svg viewBox="{x:g} {y:g} {photo.width:g} {photo.height:g}" role="{role}" aria-label="{words}" '
        f'fill="none">{"".join(drawn)}</svg><em>{escape(photo.caption)}</em></div>{_key() if points else ""}</div>'
    )


def _cut(photo: Photo, part: tuple[float, float, float, float]) -> str:
    """The style by which the background shows a part of the picture alone."""
    x, y, width, height = part
    sizes = 100 * photo.width / width, 100 * photo.height / height
    # A position in percent puts this share of the picture on this share of the box
    places = 100 * x / max(photo.width - width, 1e-9), 100 * y / max(photo.height - height, 1e-9)
    size, place = (" ".join(f"{share:.4f}%" for share in pair) for pair in (sizes, places))
    return f";background-size:{size};background-position:{place}"


def gaps_mm(photo: Photo, landmarks: IntArray | None = None) -> Array:
    """(L,) millimetres at the face between each point and its circle, NaN where missing.

    A pixel is depth / focal metres; without `landmarks` the depth is that of the middle of the head.
    """
    depths = photo.vertices[:, 2] if photo.fit_vertices is None else photo.fit_vertices[:, 2]
    focal = photo.focal if photo.fit_focal is None else photo.fit_focal
    if landmarks is not None and len(landmarks) == len(photo.observed):
        depth = depths[landmarks]
    else:
        depth = depths.mean() if len(depths) else np.nan
    return 1e3 * np.linalg.norm(photo.projected - photo.observed, axis=1) * depth / focal


def _unit(photo: Photo) -> float:
    return photo.width / 500


def _crosses_path(photo: Photo) -> str:
    r = CROSS * _unit(photo)
    crosses = "".join(_cross(x, y, r) for x, y in photo.observed if np.isfinite(x + y))
    return f'<path id="fx" d="{crosses}"/>'


def _crosses_and_circles(photo: Photo, crosses: bool, apart: bool) -> str:
    """Both, with their halo; `apart`: the crosses are drawn elsewhere, each for itself."""
    unit = _unit(photo)
    circles = _circles(photo.projected, CIRCLE * unit)
    thin, halo = 1.7 * unit, 3.4 * unit
    halves = "" if apart else '<use href="#fx"/>'
    red = "" if apart else f'<use href="#fx" stroke="{RED}"/>'
    return (
        f'<defs>{_crosses_path(photo) if crosses else ""}<path id="fo" d="{circles}"/></defs>'
        f'<g stroke="#FFF" stroke-width="{halo:.1f}">{halves}<use href="#fo"/></g>'
        f'<g stroke-width="{thin:.1f}">{red}<use href="#fo" stroke="{BLUE}"/></g>'
    )


def _buttons(photo: Photo) -> str:
    """A group a point: what a script moves, with its cross, and 24 pixels of the screen to hit."""
    unit, parts = _unit(photo), []
    for index, (x, y) in enumerate(photo.observed):
        if not np.isfinite(x + y):
            continue
        words = say("photo.point", name=_name(photo, index), x=f"{x:.0f}", y=f"{y:.0f}")
        cross = _cross(x, y, CROSS * unit)
        parts.append(
            f'<g data-fa-point="{index}" data-fa-at="{x:.2f},{y:.2f}" tabindex="0" role="button" '
            f'aria-label="{escape(words)}">'
            f'<path class="fa-hit" d="M{x:.1f} {y:.1f}h.01"><title>{escape(words)}</title></path>'
            f'<path d="{cross}" stroke="#FFF" stroke-width="{3.4 * unit:.1f}"/>'
            f'<path d="{cross}" stroke="{RED}" stroke-width="{1.7 * unit:.1f}"/></g>'
        )
    return "".join(parts)


def _hover(photo: Photo, landmarks: IntArray | None) -> str:
    """An unseen spot on each point whose title names it and its gap."""
    parts = []
    for index, gap in enumerate(gaps_mm(photo, landmarks).tolist()):
        x, y = photo.observed[index].tolist()
        if math.isfinite(x + y):
            before, after = _gap_words(_name(photo, index))
            mm = numeral(f"{gap:.1f}") if math.isfinite(gap) else "?"
            parts.append(
                f'<path class="fa-hit" d="M{x:.1f} {y:.1f}h.01"><title>{before}{mm}{after}</title></path>'
            )
    return "".join(parts)


@each_language(maxsize=512)
def _gap_words(name: str) -> tuple[str, str]:
    """What stands before and after the millimetres of a point, escaped; a class asks for 68 of them many times."""
    before, _, after = escape(say("photo.gap", name=name, mm="\0")).partition("\0")
    return before, after


def _name(photo: Photo, index: int) -> str:
    return photo.names[index] if index < len(photo.names) else str(index + 1)


def _names(photo: Photo) -> str:
    unit = _unit(photo)
    words = "".join(
        f'<text x="{x + 6 * unit:.1f}" y="{y + 3.5 * unit:.1f}">{escape(_name(photo, index))}</text>'
        for index, (x, y) in enumerate(photo.observed)
        if np.isfinite(x + y)
    )
    return f'<g font-size="{10 * unit:.1f}" stroke-width="{2.4 * unit:.1f}">{words}</g>'


def _errors(photo: Photo) -> str:
    """A line from each cross towards its circle, `error_scale` times as long as the gap."""
    if photo.error_scale <= 0:
        return ""
    ends = photo.observed + photo.error_scale * (photo.projected - photo.observed)
    lines = "".join(
        f"M{x:.1f} {y:.1f}L{u:.1f} {v:.1f}"
        for (x, y), (u, v) in zip(photo.observed, ends, strict=True)
        if np.isfinite(x + y + u + v)
    )
    return _haloed("fe", lines, INK, 1.5 * _unit(photo))


def _outline(photo: Photo) -> str:
    """The fitted face's outline; NaN rows lift the pen."""
    if photo.outline is None:
        return ""
    steps, pen = [], "M"
    for x, y in photo.outline:
        if np.isfinite(x + y):
            steps.append(f"{pen}{x:.1f} {y:.1f}")
            pen = "L"
        else:
            pen = "M"
    return _haloed("fl", "".join(steps), BLUE, 1.4 * _unit(photo))


def _haloed(name: str, path: str, colour: str, width: float) -> str:
    return (
        f'<defs><path id="{name}" d="{path}"/></defs>'
        f'<use href="#{name}" stroke="#FFF" stroke-width="{2.2 * width:.1f}"/>'
        f'<use href="#{name}" stroke="{colour}" stroke-width="{width:.1f}"/>'
    )


def _alternative(photo: Photo, landmarks: IntArray | None) -> str:
    """The photograph in words."""
    gaps = gaps_mm(photo, landmarks)
    gaps = gaps[np.isfinite(gaps)]
    if not photo.points_shown or not len(gaps):
        return say("photo.alt_plain", caption=photo.caption)
    return say(
        "photo.alt",
        caption=photo.caption,
        points=len(gaps),
        mm=numeral(f"{gaps.mean():.1f}{NARROW}mm"),
    )


@each_language(maxsize=4)
def _key() -> str:
    cross, circle = (
        _sign(_cross(6, 6, 4), "seen"),
        _sign(_circles(np.array([[6.0, 6.0]]), 4.5), "dl"),
    )
    return (
        f'<div class="fa-key"><span>{cross}{escape(say("app.cross"))}</span>'
        f"<span>{circle}{escape(say('app.circle'))}</span></div>"
    )


def _sign(path: str, tone: str) -> str:
    style = f"fill:none;stroke:var(--fa-{tone});stroke-width:1.8"
    return f'<svg viewBox="0 0 12 12" aria-hidden="true"><path d="{path}" style="{style}"/></svg>'


def _cross(x: float, y: float, r: float) -> str:
    return (
        f"M{x - r:.1f} {y - r:.1f}l{2 * r:.1f} {2 * r:.1f}m0 {-2 * r:.1f}l{-2 * r:.1f} {2 * r:.1f}"
    )


def _circles(points: Array, r: float) -> str:
    """One path; a hand on a slider asks for it some ten times a second."""
    starts = points - (r, 0.0)
    starts = starts[np.isfinite(starts).all(axis=1)]
    two = 2 * r
    round_ = f"a{r:.1f} {r:.1f} 0 1 0 {two:.1f} 0a{r:.1f} {r:.1f} 0 1 0 {-two:.1f} 0"
    return "".join([f"M{x:.1f} {y:.1f}{round_}" for x, y in starts.tolist()])
