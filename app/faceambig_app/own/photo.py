"""A person's own photograph: the picture and its points. In memory alone, never written anywhere.

What is computed of a photograph is remembered in its own `memo` and goes with it; no cache of the page holds any of it.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceambig.arrays import Array, read_only
from faceambig.io.landmarks import parse_landmarks
from faceambig.io.pictures import WEB_FORMATS, decode_picture
from faceambig.model import FaceModel

from ..text import say

LARGEST = 1600  # pixels of the longer side that are kept: 7.7 MB; a face is found and coloured in them as well
MAX_PIXELS = 40_000_000
QUALITY = 85  # of the JPEG on the page
# Points of Farkas that are asked for, by the name of their words: twelve, and what may follow
TWELVE = (
    "ex_r", "en_r", "en_l", "ex_l", "prn", "al_r", "al_l", "ch_r", "ch_l", "gn", "t_r", "t_l",
)  # fmt: skip
MORE = ("p_r", "p_l", "se", "sn", "ls", "li", "sba_r", "sba_l")
NAMED = (*TWELVE, *MORE)
ROOM = 0.45  # of the extent of the points, left on each side of the face in its part of the photo

_decoding = threading.Lock()  # 40 megapixels take up to 0.5 GB on the way: one at a time


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class Taken:
    """A picture as it is kept: upright, at most LARGEST pixels long."""

    rgb: NDArray[np.uint8]  # (H, W, 3) sRGB
    jpeg: bytes  # the same, for the page
    name: str
    scale: float  # pixels here for one of the file
    file_size: tuple[int, int]  # width, height of the file, upright
    focal_px: float | None  # pixels here, as EXIF has it; None: not told

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, pixels."""
        return self.rgb.shape[1], self.rgb.shape[0]


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class OwnPhoto:
    """A photograph and its points. L landmarks. Another point is another OwnPhoto of the same picture."""

    taken: Taken
    scheme: str
    names: tuple[str, ...]  # L names of the points in the scheme
    points: Array  # (L, 2) pixels of the kept picture; NaN: not placed, or not visible
    asked: tuple[str, ...] = ()  # names of points that are still to be placed, the next one first
    part: tuple[float, float, float, float] | None = None  # x, y, width, height shown; None: all
    words: str = ""  # where the points are from
    memo: dict[Any, Any] = field(init=False, repr=False, default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", read_only(self.points))

    @property
    def placed(self) -> int:
        """How many points there are."""
        return int(np.isfinite(self.points).all(axis=1).sum())


def read_photo(name: str, data: bytes) -> OwnPhoto:
    """The photograph of a file, no point on it yet; ValueError in the page's words if it is none that is read."""
    import cv2  # 75 ms to import: only where a picture is read

    try:
        with _decoding:
            picture = decode_picture(data, name=name, formats=WEB_FORMATS, max_pixels=MAX_PIXELS)
            width, height = picture.size
            scale = min(1.0, LARGEST / max(width, height))
            rgb = picture.rgb
            if scale < 1:
                small = max(1, round(scale * width)), max(1, round(scale * height))
                rgb = np.asarray(cv2.resize(rgb, small, interpolation=cv2.INTER_AREA))
    except ValueError as error:
        raise ValueError(say("own.unreadable")) from error
    jpeg = cv2.imencode(".jpg", rgb[:, :, ::-1], (cv2.IMWRITE_JPEG_QUALITY, QUALITY))[1].tobytes()
    focal = None if picture.focal_px is None else scale * picture.focal_px
    taken = Taken(read_only(rgb.astype(np.uint8)), jpeg, name, scale, (width, height), focal)
    return OwnPhoto(taken, "", (), np.zeros((0, 2)))


def on_scheme(
    own: OwnPhoto, faces: FaceModel, scheme: str, points: Array | None = None, **changes: Any
) -> OwnPhoto:
    """The photograph with the points of a scheme; None: none of them placed yet."""
    names = faces.scheme(scheme).points
    xy = np.full((len(names), 2), np.nan) if points is None else points
    return with_points(own, xy, scheme=scheme, names=names, **changes)


def with_points(own: OwnPhoto, points: Array, **changes: Any) -> OwnPhoto:
    """The photograph with other points. Nothing computed of the old ones is kept but the colours, as a first draft."""
    moved = replace(own, points=points, **changes)
    if "skin" in own.memo:
        moved.memo["skin"] = own.memo["skin"]
    return moved


def found(own: OwnPhoto, faces: FaceModel) -> OwnPhoto:
    """The photograph with the points that the networks find; ValueError in words if they see no face."""
    from faceambig.io.detect import detect_landmarks

    try:
        seen = detect_landmarks(own.taken.rgb, name=own.taken.name)
    except ValueError as error:
        raise ValueError(say("own.no_face")) from error
    words = say("own.found", points=int(np.isfinite(seen.points[:, 0]).sum()))
    if seen.n_faces > 1:
        words = f"{words} {say('own.faces', count=seen.n_faces)}"
    return closer(on_scheme(own, faces, seen.scheme, seen.points, asked=(), words=words))


def from_file(own: OwnPhoto, faces: FaceModel, name: str, data: bytes) -> OwnPhoto:
    """The photograph with the points of a landmark file, whose pixels are those of the picture's file."""
    read = parse_landmarks(data, name=name, image_size=own.taken.file_size, model=faces)
    words = say("own.from_file", words=read.words)
    return closer(
        on_scheme(own, faces, read.scheme, own.taken.scale * read.points, asked=(), words=words)
    )


def moved(own: OwnPhoto, index: int, x: float, y: float) -> OwnPhoto:
    """The photograph with one point elsewhere, NaN: nowhere; unchanged if there is no such point."""
    if not 0 <= index < len(own.points):
        return own
    points = own.points.copy()
    width, height = own.taken.size
    points[index] = np.clip(x, 0, width), np.clip(y, 0, height)  # NaN stays NaN
    return with_points(own, points)


def closer(own: OwnPhoto) -> OwnPhoto:
    """The photograph cut to the face, as far as the points tell where it is."""
    points = own.points[np.isfinite(own.points).all(axis=1)]
    if len(points) < 2:
        return replace_part(own, None)
    size = np.array(own.taken.size, dtype=np.float64)
    low, high = points.min(axis=0), points.max(axis=0)
    side = max(*(high - low), 0.1 * size.min()) * (1 + 2 * ROOM)
    extent = np.minimum(side, size)
    corner = np.clip(0.5 * (low + high) - 0.5 * extent, 0, size - extent)
    x, y, width, height = np.round([*corner, *extent]).tolist()
    return replace_part(own, (x, y, width, height))


def replace_part(own: OwnPhoto, part: tuple[float, float, float, float] | None) -> OwnPhoto:
    """The photograph with another part of it shown."""
    other = replace(own, part=part)
    other.memo.update(own.memo)
    return other
