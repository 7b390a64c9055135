"""Small pictures of the experiments: landmarks of two faces, heads without a graphics card, blends, strips."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from ..arrays import Array
from ..camera import Camera
from ..compose import photo
from ..model import FaceModel, Subject
from ..observation import Observation
from ..render.canvas import Canvas
from ..render.painter import SAMPLES, fill, paint_photo
from ..rotation import rotation_from_angles

Pixels = NDArray[np.uint8]

INK, OBSERVED, PROJECTED = (0x33, 0x3F, 0x4D), (0xC8, 0x10, 0x2E), (0x1B, 0x5F, 0xC1)
SIDE = 360  # pixels of a square picture
FAR = 12.0  # metres: heads are looked at through a long lens
GROUND = 0xE6
TALL = 0.33  # metres from the upper to the lower edge of a picture of a head
LABEL, GAP, WHITE = 26, 8, (0xFF, 0xFF, 0xFF)
READ_AT = 1000  # pixels a picture is shown wide, if larger: its words are 14 pixels high there
SUB = 4  # fractional bits of OpenCV's drawing


def portrait(
    subject: Subject, observation: Observation, camera: Camera, width: int = SIDE
) -> Pixels:
    """The photograph (width, width, 3) that `camera` takes of a face, without its points."""
    return paint_photo(photo(subject, observation, camera, caption=""), width)


def head(
    model: FaceModel, vertices: Array, colours: NDArray[np.uint8], *, yaw_deg: float = 0.0, width: int = SIDE
) -> Pixels:  # fmt: skip
    """A head (N, 3) through a long lens, as large as it is, in colours (N, 3) that hold their light already."""
    low, high = model.mean.min(axis=0), model.mean.max(axis=0)
    middle = np.array([0.0, 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2])])
    R = rotation_from_angles(yaw_deg, 0.0, 0.0)
    q = (vertices - middle) @ R.T
    depth = FAR + q[:, 2]
    scale = SAMPLES * width / TALL * FAR / depth
    points = np.column_stack([scale * q[:, 0], scale * q[:, 1], 1.0 / depth])
    points[:, :2] += 0.5 * SAMPLES * width
    picture = np.full((SAMPLES * width, SAMPLES * width, 3), GROUND, dtype=np.float32)
    fill(picture, points, model.faces, colours.astype(np.float64))
    return (
        cv2.resize(picture, (width, width), interpolation=cv2.INTER_AREA).round().astype(np.uint8)
    )


def blended(one: Pixels, other: Pixels) -> Pixels:
    """Half of each: where two pictures agree, the blend is as sharp as they are."""
    return np.asarray(cv2.addWeighted(one, 0.5, other, 0.5, 0.0), dtype=np.uint8)


def with_pairs(
    picture: Pixels, scale: float, edges: Array, matched: Array, points: Array
) -> Pixels:
    """A photograph paled, with edge pixels, lines to the contour points (P, 2) matched with `points` (P, 2).

    scale: pixels of the picture for one of the coordinates.
    """
    white = np.full_like(picture, 255)
    drawn = np.asarray(cv2.addWeighted(picture, 0.35, white, 0.65, 0.0), dtype=np.uint8)
    for x in edges * scale:
        _dot(drawn, x, 0.6, INK)
    for a, b in zip(matched * scale, points * scale, strict=True):
        cv2.line(drawn, _at(a), _at(b), OBSERVED, 1, cv2.LINE_AA, SUB)
        _dot(drawn, a, 1.6, PROJECTED)
    return drawn


def two_pictures(one: NDArray[np.complex128], other: NDArray[np.complex128]) -> Pixels:
    """Circles at one face's points, crosses at another's; both (L,) in one unit, x right, y down."""
    both = np.concatenate([one, other])
    low = np.array([both.real.min(), both.imag.min()])
    size = np.array([np.ptp(both.real), np.ptp(both.imag)])
    scale = 0.86 * SIDE / float(size.max())
    corner = 0.5 * (SIDE - scale * size)
    picture = np.full((SIDE, SIDE, 3), 255, dtype=np.uint8)
    for z in one:
        at = (np.array([z.real, z.imag]) - low) * scale + corner
        cv2.circle(picture, _at(at), 4 << SUB, PROJECTED, 1, cv2.LINE_AA, SUB)
    for z in other:
        x, y = (np.array([z.real, z.imag]) - low) * scale + corner
        for dx, dy in ((3, 3), (3, -3)):
            ends = _at(np.array([x - dx, y - dy])), _at(np.array([x + dx, y + dy]))
            cv2.line(picture, *ends, OBSERVED, 1, cv2.LINE_AA, SUB)
    return picture


def labelled(rows: Sequence[Sequence[tuple[str, Pixels]]]) -> Pixels:
    """(H, W, 3): pictures of one size in rows, with words above each."""
    tall, wide = rows[0][0][1].shape[:2]
    columns = max(len(row) for row in rows)
    larger = max(1.0, columns * wide / READ_AT)
    label = round(LABEL * larger)
    size = (columns * (wide + GAP) + GAP, len(rows) * (tall + label + GAP) + GAP)
    canvas = Canvas(size, 1.0, WHITE)
    for i, row in enumerate(rows):
        for j, (words, picture) in enumerate(row):
            x, y = GAP + j * (wide + GAP), GAP + i * (tall + label + GAP)
            at = (x + wide / 2, y + 0.7 * label)
            canvas.text(*at, words, 14 * larger, INK, anchor="middle", most=wide)
            canvas.paste(x, y + label, picture)
    return canvas.pixels


def matrix(values: Array, low: float, high: float, cell: int = 4) -> Pixels:
    """Values (n, m) as grey squares, black at `low` and white at `high`."""
    share = np.clip((values - low) / max(high - low, 1e-12), 0.0, 1.0)
    grey = (255 * share).round().astype(np.uint8)
    return np.repeat(grey.repeat(cell, axis=0).repeat(cell, axis=1)[:, :, None], 3, axis=2)


def _at(point: Array) -> tuple[int, int]:
    x, y = (point - 0.5) * (1 << SUB)
    return round(float(x)), round(float(y))


def _dot(picture: Pixels, at: Array, radius: float, colour: tuple[int, int, int]) -> None:
    cv2.circle(picture, _at(at), round(radius * (1 << SUB)), colour, -1, cv2.LINE_AA, SUB)
