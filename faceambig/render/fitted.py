"""A fitted face laid over its photograph: the points with the face's outline, and beside it the face itself, shaded.

Both panels show the same part of the photograph, the face with some room around it, so that marks stay readable
whatever the size of the photograph.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ..arrays import Array
from ..scene import Photo
from . import painter
from .canvas import FINE, Canvas, Picture, Place
from .marked import marks
from .plots import DIM, INK
from .sheet import HALO, OBSERVED, PROJECTED

ROOM = 0.22  # around the face, as a share of its longer side
PANEL = 760  # pixels of a panel's longer side
MARGIN, LINE = 16, 21  # pixels
GROUND = (0xFF, 0xFF, 0xFF)

WORDS: Mapping[str, str] = {
    "cross": "point given",
    "circle": "same point of the fitted face",
    "outline": "outline of the fitted face",
}


def draw_fitted(
    rgb: NDArray[np.uint8],
    photo: Photo,
    lines: Sequence[str] = (),
    *,
    words: Mapping[str, str] = WORDS,
) -> Picture:
    """(h, w, 4) RGBA: `rgb` (H, W, 3) with the points and the face of `photo` over it, `lines` of words below.

    `photo` is framed as `rgb`: its width and height are those of the picture. Pixels count from the corner.
    """
    if rgb.shape != (photo.height, photo.width, 3):
        raise ValueError(f"rgb: expected {(photo.height, photo.width, 3)}, found {rgb.shape}")
    part, photo = _framed(rgb, photo)
    shaded = part.repeat(painter.SAMPLES, axis=0).repeat(painter.SAMPLES, axis=1).astype(np.float32)
    painter.paint_over(shaded, photo.vertices, photo, photo.focal)
    shaded = cv2.resize(shaded, part.shape[1::-1], interpolation=cv2.INTER_AREA)
    height, width = part.shape[:2]
    # A canvas of its own: a mark beyond the edge of a panel does not reach the other one
    marked = Canvas((width, height), 1.0, GROUND)
    marked.pixels[:] = part
    _outline(marked, photo)
    marks(marked, np.zeros(2), 1.0, photo, 3.4)
    size = (2 * width + 3 * MARGIN, height + 2 * MARGIN + LINE * (len(lines) + 2))
    canvas = Canvas(size, 1.0, GROUND)
    canvas.paste(MARGIN, MARGIN, marked.pixels)
    canvas.paste(width + 2 * MARGIN, MARGIN, shaded.round().clip(0, 255).astype(np.uint8))
    _key(canvas, height + MARGIN + LINE, words)
    for row, line in enumerate(lines, start=2):
        y = height + MARGIN + LINE * row
        canvas.text(MARGIN, y, line, 13.5, INK if row == 2 else DIM, most=size[0] - 2 * MARGIN)
    opaque = np.full((*canvas.pixels.shape[:2], 1), 255, dtype=np.uint8)
    return np.concatenate([canvas.pixels, opaque], axis=2)


def _framed(rgb: NDArray[np.uint8], photo: Photo) -> tuple[Picture, Photo]:
    """The part of the picture about the face at panel size, and the photo in its pixels."""
    z = np.maximum(photo.vertices[:, 2:], painter.NEAREST)
    xy = photo.focal * photo.vertices[:, :2] / z + photo.principal
    inside = ((xy > 0) & (xy < (photo.width, photo.height))).all(axis=1)
    given = photo.observed[np.isfinite(photo.observed).all(axis=1)]
    shown = np.concatenate([xy[inside], given])
    room = ROOM * np.ptp(shown, axis=0).max()
    limit = np.array([photo.width, photo.height])
    low = np.clip(np.floor(shown.min(axis=0) - room), 0, limit - 1).astype(int)
    high = np.clip(np.ceil(shown.max(axis=0) + room), low + 1, limit).astype(int)
    part = rgb[low[1] : high[1], low[0] : high[0]]
    step = PANEL / float((high - low).max())
    size = np.maximum(np.round(step * (high - low)), 1).astype(int)
    way = cv2.INTER_AREA if step < 1 else cv2.INTER_LINEAR
    part = cv2.resize(np.ascontiguousarray(part), size.tolist(), interpolation=way)
    scale = size / (high - low)  # of both axes: rounded to whole pixels apart

    def moved(points: Array) -> Array:
        return (points - low) * scale

    return (
        np.asarray(part, dtype=np.uint8),
        replace(
            photo,
            width=int(size[0]),
            height=int(size[1]),
            observed=moved(photo.observed),
            projected=moved(photo.projected),
            focal=photo.focal * step,
            principal=tuple(moved(np.array(photo.principal)).tolist()),
        ),
    )


def _outline(canvas: Canvas, photo: Photo) -> None:
    """The outline of the fitted face, white and blue: seen on skin and on dark ground alike."""
    scale = painter.SAMPLES
    mask = np.zeros((scale * photo.height, scale * photo.width, 3), dtype=np.float32)
    white = np.full(photo.colours.shape, 255, dtype=np.uint8)
    painter.paint_over(mask, photo.vertices, photo, photo.focal, colours=white)
    filled = (mask.max(axis=2) > 0).astype(np.uint8)
    curves, _ = cv2.findContours(filled, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    lines = [(curve[:, 0] + 0.5) / scale for curve in curves if len(curve) > 2]
    for colour, width in ((HALO, 3.0), (PROJECTED, 1.4)):
        for line in lines:

            def stroke(
                mask: Picture, place: Place, line: Array = line, width: float = width
            ) -> None:
                cv2.polylines(mask, [place(line)], True, 255, round(FINE * width), shift=4)

            canvas.ink(colour, line, width, stroke)


def _key(canvas: Canvas, y: float, words: Mapping[str, str]) -> None:
    """Which mark is which, in one line."""
    x = float(MARGIN)
    for a, b in ((-10, -2), (-2, -10)):
        canvas.line((x + 1, y + a), (x + 9, y + b), OBSERVED, 1.8)
    x = canvas.text(x + 16, y, words["cross"], 13, DIM) + 24
    canvas.circle((x + 5, y - 5), 4.6, PROJECTED, 1.7)
    x = canvas.text(x + 16, y, words["circle"], 13, DIM) + 24
    canvas.line((x, y - 5), (x + 20, y - 5), PROJECTED, 2.0)
    canvas.text(x + 27, y, words["outline"], 13, DIM)
