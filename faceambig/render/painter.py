"""The synthetic photograph, painted without OpenGL, so that the page needs no graphics library.

A z-buffer in NumPy. Every triangle is cut into spans, one for each row of samples it covers; the ends of a span
follow from the three edges at once. Spans are laid out behind each other as samples, the nearest sample of each pixel
wins, and only the winners get a colour. No step loops over triangles, and nothing depends on their order or size.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, vertex_normals
from ..scene import Photo

SAMPLES = 2  # per pixel and axis
NEAREST = 1e-3  # metres: triangles that reach behind the camera are left out
# sRGB at the top and at the bottom, CBD5E0 between
BACKGROUND = (
    (0.835, 0.867, 0.902),
    (0.757, 0.800, 0.851),
)
INSIDE = 0.42  # sRGB grey of back faces: a cut surface, never a look into the empty head

# Direction towards the light in camera axes with y up (x right, z to the camera), linear colour. Key from above left.
KEY, KEY_COLOUR = (-0.50, 0.58, 0.72), (1.02, 0.97, 0.91)
FILL, FILL_COLOUR = (0.75, 0.05, 0.66), (0.20, 0.22, 0.25)
AMBIENT = (0.150, 0.152, 0.158)
WRAP = 0.22  # light reaches this far around the edge of shadow: skin is translucent
SHEEN = 0.055  # strength of the broad highlight on skin


def paint_photo(photo: Photo, width: int) -> NDArray[np.uint8]:
    """(H, W, 3) sRGB picture of a Photo without its marks, `width` pixels wide.

    Pixel coordinates of the photo times width / photo.width are those of the picture: marks drawn over it coincide.
    """
    if width < 1:
        raise ValueError(f"width: {width} is not a number of pixels above 0")
    height = max(1, round(photo.height * width / photo.width))
    return paint(photo.vertices, photo, photo.focal, (width, height))


def paint(
    vertices: Array,
    photo: Photo,
    focal: float,
    size: tuple[int, int],
    *,
    colours: NDArray[np.uint8] | None = None,
) -> NDArray[np.uint8]:
    """(H, W, 3) sRGB picture, size (W, H), of `vertices` (V, 3) in camera axes, framed as `photo` is.

    The triangles are the photo's; `colours` (V, 3) too where none are given.
    """
    width, height = SAMPLES * size[0], SAMPLES * size[1]
    ramp = np.linspace(0.0, 1.0, height)[:, None]
    rows = (1.0 - ramp) * BACKGROUND[0] + ramp * BACKGROUND[1]
    picture = np.repeat((255.0 * rows[:, None]).astype(np.float32), width, axis=1)
    paint_over(picture, vertices, photo, focal, colours=colours)
    return cv2.resize(picture, size, interpolation=cv2.INTER_AREA).round().astype(np.uint8)


def paint_over(
    picture: NDArray[np.float32],
    vertices: Array,
    photo: Photo,
    focal: float,
    *,
    colours: NDArray[np.uint8] | None = None,
) -> None:
    """As `paint`, into `picture` (H, W, 3) of 0 to 255, which shows all of the photo: what lies there stays behind."""
    height, width = picture.shape[:2]
    depth = np.maximum(vertices[:, 2], NEAREST)
    x = (focal * vertices[:, 0] / depth + photo.principal[0]) * (width / photo.width)
    y = (focal * vertices[:, 1] / depth + photo.principal[1]) * (height / photo.height)
    faces = photo.faces[(vertices[:, 2] > NEAREST)[photo.faces].all(axis=1)]
    # Camera axes are turned by half about x: y up and z to the camera, as the lights are given.
    turned = vertices * (1.0, -1.0, -1.0)
    lit = shade(turned, faces, photo.colours if colours is None else colours, photo.occlusion)
    fill(picture, np.stack([x, y, 1.0 / depth], axis=1), faces, lit)


def shade(
    points: Array,
    faces: NDArray[np.integer],
    colours: NDArray[np.uint8],
    occlusion: NDArray[np.uint8] | None,
) -> Array:
    """(V, 3) sRGB 0 to 255 of lit skin. points (V, 3) seen from the origin, x right, y up, z to the viewer."""
    normals = vertex_normals(points, faces)
    to_eye = -points / np.linalg.norm(points, axis=1, keepdims=True)
    key, fill_ = (np.asarray(d) / np.linalg.norm(d) for d in (KEY, FILL))
    wrapped = np.clip((normals @ key + WRAP) / (1.0 + WRAP), 0.0, None)[:, None] ** (1.0, 1.12, 1.2)
    light = (
        wrapped * KEY_COLOUR + np.clip(normals @ fill_, 0.0, None)[:, None] * FILL_COLOUR + AMBIENT
    )
    half = key + to_eye
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    sheen = SHEEN * np.clip(np.einsum("vk,vk->v", normals, half), 0.0, None) ** 18
    linear = (colours / 255.0) ** 2.2
    # Pupils and brows do not shine as skin does
    sheen *= np.clip(linear.mean(axis=1) / 0.06, 0.0, 1.0)
    if occlusion is not None:
        open_ = occlusion[:, None] / 255.0
        # Light that reaches a fold has met skin before: it loses blue and green first: folds are warm, not grey.
        light = light * open_ ** (0.9, 1.2, 1.25)
        sheen *= open_[:, 0] ** 2
    return 255.0 * np.clip(linear * light + sheen[:, None], 0.0, 1.0) ** (1.0 / 2.2)


class Spans(NamedTuple):
    """Rows of samples covered by triangles. P spans."""

    triangle: NDArray[np.intp]  # (P,)
    row: NDArray[np.intp]  # (P,)
    first: NDArray[np.intp]  # (P,) column of the first sample
    samples: NDArray[np.intp]  # (P,) how many, at least 1


def fill(
    picture: NDArray[np.float32], points: Array, faces: NDArray[np.integer], colours: Array
) -> None:
    """Paint triangles into `picture` (H, W, 3), the nearest one on each pixel.

    points (V, 3): x, y in pixels (pixel i spans i to i + 1) and 1 / depth. colours (V, 3). Front faces are wound
    counterclockwise as they are seen; back faces are painted in the grey of the inside.
    """
    height, width = picture.shape[:2]
    corners = points[faces]
    a, b, c, area = _edges(corners[..., 0], corners[..., 1])
    spans = _spans(a, b, c, corners[..., 1], width, height)
    # Everything interpolated is divided by depth: then it is linear on the screen (perspective).
    values = np.concatenate([np.ones((len(colours), 1)), colours], axis=1)[faces] * corners[..., 2:]
    back = area < 0
    values[back, :, 1:] = 255.0 * INSIDE * corners[back, :, 2:]
    size = np.where(area == 0, 1.0, np.abs(area))[:, None]
    along, down, base = (np.einsum("fe,fek->fk", side, values) / size for side in (a, b, c))
    x, y = spans.first + 0.5, spans.row + 0.5
    t = spans.triangle
    start = (base[t] + along[t] * x[:, None] + down[t] * y[:, None]).astype(np.float32)
    slope = along[t].astype(np.float32)
    pixel, span, column = _samples(spans, width)
    near = start[span, 0] + slope[span, 0] * column
    nearest = np.zeros(height * width, dtype=np.float32)
    np.maximum.at(nearest, pixel, near)
    won = near == nearest[pixel]
    pixel, span, column, near = pixel[won], span[won], column[won], near[won]
    colour = start[span, 1:] + slope[span, 1:] * column[:, None]
    picture.reshape(-1, 3)[pixel] = np.clip(colour / near[:, None], 0.0, 255.0)


def _edges(x: Array, y: Array) -> tuple[Array, Array, Array, Array]:
    """a, b, c (F, 3) with a x + b y + c >= 0 inside, edge e opposite corner e; their sum is the doubled area (F,).

    A shared edge has exactly opposite coefficients in its two triangles: no sample between them is lost. The sign
    of the area says front (positive) or back.
    """
    x1, x2, y1, y2 = np.roll(x, -1, 1), np.roll(x, -2, 1), np.roll(y, -1, 1), np.roll(y, -2, 1)
    a, b, c = y2 - y1, x1 - x2, x2 * y1 - x1 * y2
    area = c.sum(axis=1)
    sign = np.where(area < 0, -1.0, 1.0)[:, None]
    return a * sign, b * sign, c * sign, area


def _spans(a: Array, b: Array, c: Array, y: Array, width: int, height: int) -> Spans:
    """Spans of triangles with edges a, b, c (F, 3) and corner rows y (F, 3)."""
    top = np.clip(np.ceil(y.min(axis=1) - 0.5), 0, height).astype(np.intp)
    bottom = np.clip(np.floor(y.max(axis=1) - 0.5), -1, height - 1).astype(np.intp)
    rows = np.maximum(bottom - top + 1, 0)
    triangle = np.repeat(np.arange(len(rows)), rows)
    row = np.arange(len(triangle)) + np.repeat(top - (np.cumsum(rows) - rows), rows)
    low = np.zeros(len(triangle))
    high = np.full(len(triangle), width - 1.0)
    for e in range(3):
        slant = a[triangle, e]
        with np.errstate(divide="ignore", invalid="ignore"):
            at = -(b[triangle, e] * (row + 0.5) + c[triangle, e]) / slant - 0.5
        np.maximum(low, at, out=low, where=slant > 0)
        np.minimum(high, at, out=high, where=slant < 0)
    first = np.ceil(low).astype(np.intp)
    count = np.floor(high).astype(np.intp) - first + 1
    kept = count > 0
    return Spans(triangle[kept], row[kept], first[kept], count[kept])


def _samples(
    spans: Spans, width: int
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float32]]:
    """Of every sample: its pixel's number, its span, and how many samples it is behind the span's first."""
    before = np.cumsum(spans.samples) - spans.samples
    span = np.repeat(np.arange(len(before)), spans.samples)
    column = np.arange(len(span)) - before[span]
    pixel = (spans.row * width + spans.first)[span] + column
    return pixel, span, column.astype(np.float32)
