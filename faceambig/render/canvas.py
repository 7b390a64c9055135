"""Canvas: words, lines, marks and pictures on pixels, placed in units.

Words and strokes are drawn four times as large and averaged: they keep their size and their width, also a fraction of
a pixel, and the letters of small words keep their distance.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from ..arrays import Array

Picture = NDArray[np.uint8]
Colour = tuple[int, int, int]  # sRGB
# Positions in pixels -> what OpenCV wants, 4 bits of fraction
Place = Callable[[Array], NDArray[np.int32]]
THIN = "\u2009"  # thin space: the font has no narrow no-break space
FINE = 4  # times larger than a pixel: where strokes are drawn


class Canvas:
    """Pixels and the size of a unit on them. Positions are units from the upper left, colours sRGB."""

    def __init__(self, size: tuple[int, int], unit: float, ground: Colour) -> None:
        self.pixels: Picture = np.full((size[1], size[0], 3), ground, dtype=np.uint8)  # RGB
        self.unit = unit  # pixels
        self.room = (size[0] / unit, size[1] / unit)  # units
        self.boxes: list[tuple[str, float, float, float, float]] = []  # words, x, y, width, height
        self._font = cv2.FontFace("sans")

    # ---- words ----

    def text(
        self,
        x: float,
        y: float,
        text: str,
        size: float,
        colour: Colour,
        weight: int = 400,
        *,
        anchor: str = "start",
        most: float | None = None,
        halo: Colour | None = None,
    ) -> float:
        """Write on the base line y, `anchor` (start, middle, end) at x; returns the end that is not at x.

        Wider than `most` units the words are made smaller, then cut with dots. weight: 400 regular, 700 bold. halo:
        of a colour around the letters, for words on a picture.
        """
        text = text.replace("\u202f", THIN)
        if most is not None:
            while size > 9 and self.wide(text, size, weight) > most:
                size -= 0.5
            while len(text) > 2 and self.wide(text, size, weight) > most:
                text = text.rstrip("…")[:-1] + "…"
        wide = self.wide(text, size, weight)
        left = x - {"start": 0.0, "middle": 0.5, "end": 1.0}[anchor] * wide
        if text:
            start = np.array([[left, y]]) * self.unit
            box = start + np.array([[0.0, -size], [wide, 0.4 * size]]) * self.unit

            def letters(mask: Picture, place: Place) -> None:
                org = (place(start)[0] + 8) // 16
                cv2.putText(mask, text, org.tolist(), 255, self._font, self._size(size), weight)

            def around(mask: Picture, place: Place) -> None:
                letters(mask, place)
                wide = 2 * round(FINE * self.unit) + 1
                disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (wide, wide))
                cv2.dilate(mask, disc, mask)

            if halo is not None:
                self.ink(halo, box, 2 * self.unit, around)
            self.ink(colour, box, self.unit, letters)
            self.boxes.append((text, left, y - 0.8 * size, wide, size))
        return left if anchor == "end" else left + wide

    def paragraph(
        self,
        x: float,
        y: float,
        text: str,
        size: float,
        colour: Colour,
        *,
        most: float,
        step: float,
    ) -> float:
        """Words in lines of at most `most` units, `step` apart; returns the base line of the last."""
        words = text.replace("\u202f", THIN).split(" ")
        line = words[0]
        for word in words[1:]:
            if self.wide(f"{line} {word}", size, 400) > most:
                self.text(x, y, line, size, colour, most=most)
                line, y = word, y + step
            else:
                line = f"{line} {word}"
        self.text(x, y, line, size, colour, most=most)
        return y

    def wide(self, text: str, size: float, weight: int = 400) -> float:
        """Width of words in units."""
        text = text.replace("\u202f", THIN)
        box = cv2.getTextSize((0, 0), text, (0, 0), self._font, self._size(size), weight)
        return box[2] / (FINE * self.unit)

    def _size(self, size: float) -> int:
        return max(1, round(FINE * size * self.unit))

    # ---- areas ----

    def fill(
        self,
        x: float,
        y: float,
        width: float,
        height: float,
        colour: Colour,
        *,
        radius: float = 0.0,
    ) -> None:
        """A rectangle, its corners rounded."""
        part = self._part(x, y, width, height)
        if radius:
            _blend(part, colour, _rounded(part.shape[0], part.shape[1], radius * self.unit))
        else:
            part[:] = colour

    def ramp(
        self, x: float, y: float, width: float, height: float, colours: Picture, *, upright: bool
    ) -> None:
        """Colours (K, 3) evenly spaced over a rectangle, the first at the bottom or at the left."""
        part = self._part(x, y, width, height)
        at = np.linspace(0, len(colours) - 1, part.shape[0 if upright else 1])
        columns = [np.interp(at, np.arange(len(colours)), colours[:, k]) for k in range(3)]
        band = np.stack(columns, axis=1).round().astype(np.uint8)
        part[:] = band[::-1, None] if upright else band[None]

    def paste(
        self, x: float, y: float, picture: Picture, *, radius: float = 0.0
    ) -> tuple[int, int]:
        """RGB or RGBA pixels with their upper left at (x, y); returns that pixel's column and row."""
        left, top = round(x * self.unit), round(y * self.unit)
        height, width = self.pixels.shape[:2]
        # What falls outside is cut off on all four sides.
        picture = picture[max(-top, 0) : max(height - top, 0), max(-left, 0) : max(width - left, 0)]
        part = self.pixels[max(top, 0) :, max(left, 0) :][: picture.shape[0], : picture.shape[1]]
        cover = _rounded(part.shape[0], part.shape[1], radius * self.unit)
        if picture.shape[2] == 4:
            cover = cover * picture[..., 3:] / np.float32(255.0)
        _blend(part, picture[..., :3], cover)
        return left, top

    def _part(self, x: float, y: float, width: float, height: float) -> Picture:
        sides = (x, y, x + width, y + height)
        left, top, right, bottom = (max(round(v * self.unit), 0) for v in sides)
        return self.pixels[top:bottom, left:right]

    # ---- strokes ----

    def line(
        self,
        a: tuple[float, float],
        b: tuple[float, float],
        colour: Colour,
        width: float = 1.0,
        *,
        dash: tuple[float, float] | None = None,
    ) -> None:
        """From a to b; upright and level lines are sharp: they fill whole pixels."""
        if a[0] != b[0] and a[1] != b[1]:
            self.curve(np.array([a[0], b[0]]), np.array([a[1], b[1]]), colour, width, dash=dash)
            return
        ends = np.array([a, b]) * self.unit
        thick = max(1, round(width * self.unit))
        pieces = [ends] if dash is None else _dashes(ends, [d * self.unit for d in dash])
        for piece in pieces:
            low, high = piece.min(axis=0), piece.max(axis=0)
            level = int(low[0] == high[0])  # the axis along the line
            first = np.round(low).astype(int)
            last = np.round(high).astype(int)
            first[1 - level] = round(low[1 - level] - thick / 2)
            last[1 - level] = first[1 - level] + thick
            first, last = np.maximum(first, 0), np.maximum(last, 0)
            self.pixels[first[1] : last[1], first[0] : last[0]] = colour

    def curve(
        self,
        x: Array,
        y: Array,
        colour: Colour,
        width: float,
        *,
        dash: tuple[float, float] | None = None,
    ) -> None:
        """A line through points, dashed by (drawn, left out) units."""
        points = np.stack([x, y], axis=1) * self.unit
        pieces = [points] if dash is None else _dashes(points, [d * self.unit for d in dash])
        thick = max(1, round(FINE * width * self.unit))

        def strokes(mask: Picture, place: Place) -> None:
            cv2.polylines(mask, [place(piece) for piece in pieces], False, 255, thick, shift=4)

        self.ink(colour, points, width * self.unit, strokes)

    def area(self, x: Array, y: Array, colour: Colour) -> None:
        """What a closed line through points surrounds."""
        points = np.stack([x, y], axis=1) * self.unit

        def inside(mask: Picture, place: Place) -> None:
            cv2.fillPoly(mask, [place(points)], 255, shift=4)

        self.ink(colour, points, 0.0, inside)

    def circle(
        self, at: tuple[float, float], radius: float, colour: Colour, width: float = 0.0
    ) -> None:
        """Filled, or a ring of `width`."""
        centre = np.array([at]) * self.unit
        thick = max(1, round(FINE * width * self.unit)) if width else -1

        def disc(mask: Picture, place: Place) -> None:
            cv2.circle(
                mask, place(centre)[0], round(16 * FINE * radius * self.unit), 255, thick, shift=4
            )

        self.ink(colour, centre, (radius + width) * self.unit, disc)

    def square(
        self, at: tuple[float, float], half: float, colour: Colour, width: float = 0.0
    ) -> None:
        """Filled, or an outline of `width`."""
        corners = np.array(at) + np.array([[-half, -half], [half, half]])
        thick = max(1, round(FINE * width * self.unit)) if width else -1

        def box(mask: Picture, place: Place) -> None:
            a, b = place(corners * self.unit).tolist()
            cv2.rectangle(mask, a, b, 255, thick, shift=4)

        self.ink(colour, corners * self.unit, width * self.unit, box)

    def ink(
        self, colour: Colour, points: Array, pad: float, draw: Callable[[Picture, Place], None]
    ) -> None:
        """Paint in one colour what `draw(mask, place)` puts into a mask FINE times as large.

        points (n, 2) pixels and `pad` around them: the part of the canvas that may change.
        """
        size = np.array(self.pixels.shape[1::-1])
        low = np.clip(np.floor(points.min(axis=0) - pad - 1), 0, size).astype(int)
        high = np.clip(np.ceil(points.max(axis=0) + pad + 1), 0, size).astype(int)
        width, height = (high - low).tolist()
        if width <= 0 or height <= 0:
            return
        mask = np.zeros((FINE * height, FINE * width), dtype=np.uint8)

        def place(at: Array) -> NDArray[np.int32]:
            # Pixel i spans i to i + 1; OpenCV counts from its middle.
            return np.round((FINE * (at - low) - 0.5) * 16).astype(np.int32)

        draw(mask, place)
        cover = cv2.resize(mask.astype(np.float32), (width, height), interpolation=cv2.INTER_AREA)
        part = self.pixels[low[1] : high[1], low[0] : high[0]]
        _blend(part, colour, cover[..., None] / np.float32(255.0))


def _blend(part: Picture, over: Colour | Picture, cover: NDArray[np.float32]) -> None:
    """Lay `over` on `part` in place, `cover` (H, W, 1) of 0 to 1."""
    below = part.astype(np.float32)
    part[:] = (below + cover * (np.asarray(over, dtype=np.float32) - below)).round()


def _rounded(height: int, width: int, radius: float) -> NDArray[np.float32]:
    """(H, W, 1) cover 0 to 1 of a rectangle with rounded corners."""
    if not radius:
        return np.ones((height, width, 1), dtype=np.float32)
    x = np.abs(np.arange(width) + 0.5 - width / 2) - (width / 2 - radius)
    y = np.abs(np.arange(height) + 0.5 - height / 2) - (height / 2 - radius)
    outside = np.hypot(np.maximum(x, 0)[None], np.maximum(y, 0)[:, None]) - radius
    return np.clip(0.5 - outside, 0.0, 1.0).astype(np.float32)[..., None]


def _dashes(points: Array, dash: Sequence[float]) -> list[Array]:
    """The drawn pieces of a dashed line through points (n, 2); dash: lengths drawn and left out."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    pieces = []
    for start in np.arange(0.0, along[-1], dash[0] + dash[1]):
        end = min(start + dash[0], along[-1])
        at = np.concatenate([[start], along[(along > start) & (along < end)], [end]])
        pieces.append(np.stack([np.interp(at, along, points[:, k]) for k in range(2)], axis=1))
    return pieces
