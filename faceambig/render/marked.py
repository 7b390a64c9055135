"""The photograph of a Scene with what is laid over it: points, gaps, outline, names."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import cv2
import numpy as np

from ..arrays import Array
from ..scene import Photo
from . import painter
from .canvas import FINE, Canvas, Colour, Picture, Place
from .plots import DIM, INK
from .sheet import HALO, OBSERVED, PROJECTED, Sheet

NAME = 8.5  # units: size of the names of points


def photograph(sheet: Sheet, x: float, y: float, width: float, *, fit: bool = False) -> None:
    """The photograph, or the fitted face through its own camera, with what the scene lays over it."""
    photo = sheet.scene.photo
    if fit not in sheet.pictures.photographs:
        sheet.pictures.step()
        sheet.pictures.photographs[fit] = _pixels(sheet, round(width * sheet.canvas.unit), fit)
    picture = sheet.pictures.photographs[fit]
    at = np.array(sheet.canvas.paste(x, y, picture, radius=8))
    if sheet.bare:
        return
    step = picture.shape[1] / photo.width
    radius = (2.3 + 0.0055 * width) * sheet.canvas.unit
    if photo.outline is not None and not fit:
        pieces = _pieces(photo.outline * step + at)
        for colour, wide in ((HALO, 3.0), (PROJECTED, 1.3)):
            polylines(sheet.canvas, pieces, colour, wide)
    if photo.error_scale > 0 and not fit:
        gaps = list(gap_lines(photo) * step + at)
        for colour, wide in ((HALO, 3.0), (DIM, 1.4)):
            polylines(sheet.canvas, gaps, colour, wide)
    if photo.points_shown:
        marks(sheet.canvas, at, step, photo, radius)
    if photo.names_shown and not fit:
        points = (photo.observed * step + at) / sheet.canvas.unit
        names(sheet.canvas, points, photo.names, radius / sheet.canvas.unit)


def _pixels(sheet: Sheet, width: int, fit: bool) -> Picture:
    """(H, W, 3) what a camera sees, `width` pixels wide."""
    photo, scene = sheet.scene.photo, sheet.scene
    size = (width, max(1, round(photo.height * width / photo.width)))
    if not fit or photo.fit_vertices is None:
        if photo.pixels is None:
            return painter.paint(photo.vertices, photo, photo.focal, size, colours=photo.colours)
        way = cv2.INTER_AREA if width < photo.width else cv2.INTER_LINEAR
        return np.asarray(cv2.resize(photo.pixels, size, interpolation=way), dtype=np.uint8)
    colours = photo.colours
    shown = next((head for head in scene.heads if head.name == "fit"), None)
    if shown is not None and shown.lit and shown.colours.shape == colours.shape:
        colours = shown.colours
    focal = photo.fit_focal or photo.focal
    return painter.paint(photo.fit_vertices, photo, focal, size, colours=colours)


def gap_lines(photo: Photo) -> Array:
    """(n, 2, 2) pixels: from each cross towards its circle, `error_scale` times the gap between them."""
    given = np.isfinite((photo.observed + photo.projected).sum(axis=1))
    start, gap = photo.observed[given], (photo.projected - photo.observed)[given]
    return np.stack([start, start + photo.error_scale * gap], axis=1)


def marks(canvas: Canvas, at: Array, step: float, photo: Photo, radius: float) -> None:
    """Red crosses (observed) under blue circles (projected), all on one white halo.

    at (2,): pixels, the picture's upper left; step: pixels of the picture for one of the photo; radius in pixels.
    """
    crosses, circles = (
        p[np.isfinite(p).all(axis=1)] * step + at for p in (photo.observed, photo.projected)
    )
    crosses_and_circles(canvas, crosses, circles, radius)


def crosses_and_circles(canvas: Canvas, crosses: Array, circles: Array, radius: float) -> None:
    """Marks at positions (n, 2) and (m, 2), of `radius`, all in pixels."""
    everything = np.concatenate([crosses, circles])
    if not len(everything):
        return
    stroke, halo = max(1.0, 0.3 * radius), max(1.0, 0.24 * radius)
    arm = 0.68 * radius

    def paint_crosses(width: float) -> Callable[[Picture, Place], None]:
        def paint(mask: Picture, place: Place) -> None:
            for point in crosses:
                for turn in ((arm, arm), (arm, -arm)):
                    ends = place(np.array([point - turn, point + turn]))
                    cv2.polylines(mask, [ends], False, 255, max(1, round(FINE * width)), shift=4)

        return paint

    def paint_circles(width: float) -> Callable[[Picture, Place], None]:
        def paint(mask: Picture, place: Place) -> None:
            for centre in place(circles):
                size = round(16 * FINE * radius)
                cv2.circle(mask, centre, size, 255, max(1, round(FINE * width)), shift=4)

        return paint

    pad = radius + stroke + halo
    for colour, paint in (
        (HALO, paint_crosses(stroke + 2 * halo)),
        (HALO, paint_circles(stroke + 2 * halo)),
        (OBSERVED, paint_crosses(stroke)),
        (PROJECTED, paint_circles(stroke)),
    ):
        canvas.ink(colour, everything, pad, paint)


def polylines(canvas: Canvas, pieces: Sequence[Array], colour: Colour, width: float) -> None:
    """Lines through points (n, 2) pixels, `width` units."""
    pieces = [piece for piece in pieces if len(piece) > 1]
    if not pieces:
        return
    thick = max(1, round(FINE * width * canvas.unit))

    def strokes(mask: Picture, place: Place) -> None:
        cv2.polylines(mask, [place(piece) for piece in pieces], False, 255, thick, shift=4)

    canvas.ink(colour, np.concatenate(pieces), width * canvas.unit, strokes)


def _pieces(line: Array) -> list[Array]:
    """The parts of a line (n, 2) between its NaN rows."""
    gaps = np.flatnonzero(np.isnan(line[:, 0]))
    return [part[np.isfinite(part[:, 0])] for part in np.split(line, gaps)]


def names(canvas: Canvas, points: Array, words: Sequence[str], radius: float) -> None:
    """Words beside points (n, 2), units, on the side that is free; where none is, the name is left out."""
    taken: list[tuple[float, float, float, float]] = [
        (x - radius, y - radius, x + radius, y + radius)
        for x, y in points[np.isfinite(points.sum(axis=1))].tolist()
    ]
    for (x, y), word in zip(points.tolist(), words, strict=True):
        if not np.isfinite(x + y):
            continue
        wide = canvas.wide(word, NAME)
        for left, top in (
            (x + radius + 1, y - NAME / 2),
            (x - radius - 1 - wide, y - NAME / 2),
            (x - wide / 2, y - radius - 1 - NAME),
            (x - wide / 2, y + radius + 1),
        ):
            box = (left, top, left + wide, top + NAME)
            if not any(_meet(box, other) for other in taken):
                taken.append(box)
                canvas.text(left, top + 0.85 * NAME, word, NAME, INK, halo=HALO)
                break


def _meet(a: tuple[float, float, float, float], b: tuple[float, float, float, float]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
