"""The heads of one place in the row as one picture, with their marks and lines hidden where a surface hides them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..arrays import Array
from ..scene import Head, View
from . import gl
from .canvas import Picture
from .gl import Layer
from .marked import crosses_and_circles, names, polylines
from .sheet import TONES, Sheet

TOLERANCE = 1e-3  # metres: what lies less behind a surface is seen; marks stand above it
MARK, RAY = 3.3, 0.7  # units: radius of a mark, width of a line
SOLID = 0.5  # opacity from which a head hides what lies behind it


class Ground(NamedTuple):
    """The picture of heads that marks and lines are laid on."""

    R: Array  # (3, 3) from model axes to the viewer's
    aim: tuple[float, float]  # metres along the viewer's right and up: its middle
    scale: float  # pixels for a metre
    front: Array  # (H, W) metres towards the viewer that hide what lies behind
    corner: Array  # (2,) pixels of the canvas at its upper left

    def placed(self, points: Array) -> tuple[Array, Array]:
        """Points (n, 3), metres, in viewer axes, and their pixels (n, 2) of the picture."""
        xyz = points @ self.R.T
        size = np.array(self.front.shape[::-1])
        return xyz, (xyz[:, :2] - self.aim) * (self.scale, -self.scale) + 0.5 * size

    def seen(self, xyz: Array, pixels: Array) -> np.ndarray:
        """(n,) True where a point that was `placed` lies in the picture and before the surface."""
        front = self.front
        column, row = np.floor(pixels).astype(np.intp).T
        inside = (column >= 0) & (row >= 0) & (column < front.shape[1]) & (row < front.shape[0])
        nearest = front[np.where(inside, row, 0), np.where(inside, column, 0)]
        return inside & (nearest <= xyz[:, 2] + TOLERANCE)


def places(sheet: Sheet) -> list[list[Head]]:
    """Heads by the place they stand in, from left to right; of blinking ones the last, which is the fitted one."""
    slots = sorted({head.slot for head in sheet.scene.heads})
    rows = [[head for head in sheet.scene.heads if head.slot == slot] for slot in slots]
    return [row[-1:] for row in rows] if sheet.scene.blink else rows


def standing(
    sheet: Sheet,
    heads: Sequence[Head],
    view: View,
    middle: tuple[float, float],
    room: tuple[float, float],
    ppm: float,
) -> None:
    """Heads of one place, the view's middle at `middle`; ppm: units for a metre. They may stand out of it a little."""
    unit, R = sheet.canvas.unit, gl.viewer_rotation(view)
    pivot = R @ sheet.scene.pivot
    aim = (float(pivot[0]), float(pivot[1]) - view.rise)
    size = _size(heads, R, aim, room, ppm, unit)
    layers = []
    for head in heads:
        key = (head.name, view)
        if key not in sheet.pictures.heads:
            sheet.pictures.step()
            sheet.pictures.heads[key] = gl.render_layer(
                head, view, *size, ppm * unit, middle=aim, marked=sheet.scene.landmarks
            )
        layers.append(sheet.pictures.heads[key])
    left, top = middle[0] - size[0] / (2 * unit), middle[1] - size[1] / (2 * unit)
    corner = sheet.canvas.paste(left, top, blended(layers, [head.opacity for head in heads]))
    if sheet.bare:
        return
    solid = [
        layer.front for head, layer in zip(heads, layers, strict=True) if head.opacity >= SOLID
    ]
    front = np.max(solid, axis=0) if solid else np.full(size[::-1], -np.inf)
    # A surface may stand out of its room a little, what is laid over it may not
    edge = np.maximum((np.array(size) - np.array(room) * unit) / 2, 0).astype(np.intp)
    front[:, : edge[0]] = front[:, size[0] - edge[0] :] = np.inf
    ground = Ground(R, aim, ppm * unit, front, np.array(corner))
    _lines(sheet, heads, ground)
    _marks(sheet, heads, ground)


def _size(
    heads: Sequence[Head],
    R: Array,
    aim: tuple[float, float],
    room: tuple[float, float],
    ppm: float,
    unit: float,
) -> tuple[int, int]:
    """Pixels of the picture: a little more than its room, unless the heads are too large for that anyway."""
    reach = max(float(np.abs(head.vertices @ R[0] - aim[0]).max()) for head in heads)
    wide = 1.16 if 2 * reach * ppm < 1.16 * room[0] else 1.0
    return round(wide * room[0] * unit), round(1.04 * room[1] * unit)


def blended(layers: Sequence[Layer], opacities: Sequence[float]) -> Picture:
    """RGBA of several heads: in each pixel the nearer covers the farther by its opacity."""
    if len(layers) == 1 and opacities[0] == 1:
        return layers[0].rgba
    colour = np.stack([layer.rgba for layer in layers]).astype(np.float32)
    cover = colour[..., 3:] / 255.0 * np.array(opacities, dtype=np.float32)[:, None, None, None]
    # Farthest first; of equal depth in the order they come
    order = np.argsort(np.stack([layer.front for layer in layers]), axis=0, kind="stable")[
        ..., None
    ]
    premultiplied = np.take_along_axis(colour[..., :3] * cover, order, axis=0)
    cover = np.take_along_axis(cover, order, axis=0)
    shown, alpha = np.zeros_like(premultiplied[0]), np.zeros_like(cover[0])
    for over, share in zip(premultiplied, cover, strict=True):
        shown, alpha = over + (1 - share) * shown, share + (1 - share) * alpha
    rgba = np.concatenate([shown / np.maximum(alpha, 1e-6), 255.0 * alpha], axis=2)
    return rgba.clip(0, 255).round().astype(np.uint8)


def _marks(sheet: Sheet, heads: Sequence[Head], ground: Ground) -> None:
    """Those landmarks that no surface hides, as large at every zoom."""
    shown, unit = {head.name for head in heads}, sheet.canvas.unit
    nothing = np.zeros((0, 2))
    for mark in sheet.scene.marks:
        if mark.head not in shown or not len(mark.points):
            continue
        xyz, pixels = ground.placed(mark.points)
        seen = ground.seen(xyz, pixels)
        at = pixels[seen] + ground.corner
        crosses, circles = (at, nothing) if mark.tone == "seen" else (nothing, at)
        crosses_and_circles(sheet.canvas, crosses, circles, MARK * unit)
        if mark.names:
            words = [name for name, kept in zip(mark.names, seen.tolist(), strict=True) if kept]
            names(sheet.canvas, at / unit, words, MARK)


def _lines(sheet: Sheet, heads: Sequence[Head], ground: Ground) -> None:
    """Lines cut into short pieces; of each, the runs that nothing hides."""
    shown = {head.name for head in heads}
    for lines in sheet.scene.lines:
        if lines.head not in shown or not len(lines.segments):
            continue
        ends = ground.placed(lines.segments.reshape(-1, 3))[1].reshape(-1, 2, 2)
        longest = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).max())
        share = np.linspace(0.0, 1.0, 2 + int(min(longest, 4096.0) / 3))[None, :, None]
        a, b = lines.segments[:, :1], lines.segments[:, 1:]
        points = a + share * (b - a)
        xyz, pixels = ground.placed(points.reshape(-1, 3))
        seen = ground.seen(xyz, pixels).reshape(points.shape[:2])
        runs = []
        for row, visible in zip(pixels.reshape(*seen.shape, 2) + ground.corner, seen, strict=True):
            turns = np.flatnonzero(np.diff(np.concatenate([[0], visible.view(np.int8), [0]])))
            runs += [row[[i, j - 1]] for i, j in turns.reshape(-1, 2).tolist() if j - i > 1]
        width = RAY if lines.name == "rays" else 2 * RAY
        polylines(sheet.canvas, runs, TONES[lines.tone], width)
