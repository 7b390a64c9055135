"""Landmark files: points of a picture, and the schemes that say which vertex of a model each point is.

Picture points come from `.pts`, CSV or JSON (`points.py`) and are laid out by name or by their number in a scheme.
Nothing is dropped in silence: `LandmarkFile.words` says "61 of 68 points used; 7 outside the picture (1 to 7)".
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ..arrays import Array, IntArray, read_only
from ..errors import AssetError
from ..model import FaceModel
from ..observation import MIN_POINTS
from .files import MAX_TEXT_BYTES, replacing, text_of
from .pictures import picture_beside, picture_size
from .points import FORMAT, VERSION, Points, parse_points
from .schemes import JAW, MEDIAPIPE, ibug68_of_mesh

IBUG = tuple(str(k) for k in range(1, 69))
NUMBERED = ("ibug68", "jawline")  # schemes whose points are the 68 numbers of iBUG
MESHES = (468, 478)  # MediaPipe's face mesh without and with the irises
# Fractions of the picture lie near 0 to 1, even where a mesh leaves the picture; a face of 3 pixels is none
FRACTIONS = (-1.0, 2.0)
EDGE = 1.0  # pixels: files count them from 0 or from 1

# Why points are left out
MISSING = "not in the file"
OUTSIDE = "outside the picture"
OUTLINE = "of the jaw, where MediaPipe's outline runs nearer the ear"


@dataclass(frozen=True, slots=True, eq=False)
class LandmarkFile:
    """The points of one picture that can be used, and what became of the others. L landmarks."""

    # (L, 2) pixels, x right, y down, the file's own counting; NaN = missing or left out
    points: Array
    scheme: str  # "ibug68"
    image_size: tuple[int, int] | None = None  # width, height, pixels
    image_size_from: str = ""  # how the size was found, in words
    names: tuple[str, ...] = IBUG  # L
    # Names of the points that are not used, by the reason in words
    left_out: dict[str, tuple[str, ...]] = field(default_factory=dict)
    unit: str = "pixels"  # of the numbers in the file, in words

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", read_only(np.asarray(self.points, dtype=np.float64)))

    @property
    def used(self) -> int:
        """How many points are given."""
        return int(np.isfinite(self.points).all(axis=1).sum())

    @property
    def words(self) -> str:
        """What was used and what was left out, and why: "61 of 68 points used; 7 outside the picture (1 to 7)"."""
        total = self.used + sum(map(len, self.left_out.values()))
        reasons = (f"; {len(n)} {reason} ({_short(n)})" for reason, n in self.left_out.items())
        return f"{self.used} of {total} points used{''.join(reasons)}"


def load_landmarks(
    path: str | os.PathLike[str],
    *,
    image_size: tuple[int, int] | None = None,
    model: FaceModel | None = None,
) -> LandmarkFile:
    """The landmarks of one picture, and the size of the picture if it is known.

    Parameters
    ----------
    path: a text file, its kind told by what it holds:

        - `.pts` of 300-W: `version: 1`, `n_points: 68`, then a row `x y` per point between braces;
        - CSV: a header with `x` and `y`, maybe `name` and `side`, a row per point; or one row of OpenFace;
        - JSON: the file of `save_landmarks`, a face of MediaPipe's mesh as its interfaces give it, or a list of points.

        Points without names are 68 of iBUG, the last 51 of them, or 468 or 478 of MediaPipe; other numbers of points
        need names: 1 to 68, or Farkas' `n`, `ex_r`, `ex_l`. Pixels stay as they are (300-W counts them from 1);
        fractions of the picture are multiplied by its size. `nan nan`, empty cells or null are a missing point.
    image_size: width and height in pixels; else that of the picture of the same name beside the file, else the file's.
    model: lay the points out in the order of this model's scheme, and leave out those it has no vertex for. Needed for
        names other than 1 to 68.

    Returns
    -------
    The points for `Observation(file.points, file.scheme, image_size=file.image_size)`. MediaPipe's mesh comes as the
    iBUG points it has, without the jaw: its outline runs 10 to 19 mm nearer the ear. Points outside the picture are
    left out.

    Raises
    ------
    AssetError: names the line: `line 14 of faces.pts: expected two numbers, found 'x 1'`; another number of points;
        fractions of a picture of unknown size; a picture smaller than the face in it.
    ValueError: an `image_size` that is no width and height; a scheme that the model lacks.
    """
    if image_size is not None and (len(image_size) != 2 or min(image_size) < 1):
        raise ValueError(f"image_size: {image_size!r} is not a width and a height in pixels")
    file = Path(path)
    found = parse_points(text_of(file), file.name)
    return _read(found, file.name, *_size(file, image_size, found), model)


def parse_landmarks(
    data: bytes, *, name: str, image_size: tuple[int, int], model: FaceModel | None = None
) -> LandmarkFile:
    """As `load_landmarks`, of the bytes of a file called `name` and a picture of known size: nothing is on disk."""
    if len(data) > MAX_TEXT_BYTES:
        raise AssetError(f"{name}: {len(data)} bytes, a landmark file has at most {MAX_TEXT_BYTES}")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise AssetError(f"{name}: not a text file") from error
    found = parse_points(text, name)
    _refuse_other_size(found, name, image_size, "given")
    return _read(found, name, image_size, "given", model)


def _read(
    found: Points,
    name: str,
    size: tuple[int, int] | None,
    origin: str,
    model: FaceModel | None,
) -> LandmarkFile:
    """What of the points can be used, in a picture of `size`, known from `origin`."""
    read = replace(_laid_out(found, name), image_size=size, image_size_from=origin)
    read = _inside(_in_pixels(read, name), name)
    if model is not None:
        read = _on_model(read, model)
    # Too few from the start are for Observation to refuse, as for points that come from no file
    if read.used < MIN_POINTS and len(read.left_out) > (MISSING in read.left_out):
        raise AssetError(f"{name}: {read.words}; {MIN_POINTS} are needed")
    return read


def save_landmarks(file: LandmarkFile, path: str | os.PathLike[str]) -> None:
    """Write the points of `file` as JSON that `load_landmarks` reads, pixels by name, replacing `path` in one step."""
    rows = {
        name: None if np.isnan(point).any() else [float(x) for x in point]
        for name, point in zip(file.names, file.points, strict=True)
    }
    head = {"format": FORMAT, "version": VERSION, "scheme": file.scheme}
    if file.image_size is not None:
        head["image_size"] = [int(n) for n in file.image_size]
    body = ",\n".join(f"  {json.dumps(name)}: {json.dumps(point)}" for name, point in rows.items())
    text = f'{json.dumps(head)[:-1]}, "points": {{\n{body}\n}}}}\n'  # a line a point, for people
    with replacing(path) as whole:
        whole.write_text(text, encoding="utf-8")


def _size(
    file: Path, given: tuple[int, int] | None, found: Points
) -> tuple[tuple[int, int] | None, str]:
    """The picture's size and where it is from; AssetError where the file says that it is another picture's."""
    beside = picture_beside(file)
    if given is not None:
        size, origin = (int(given[0]), int(given[1])), "given"
    elif beside is not None:
        size, origin = picture_size(beside), f"size of {beside.name}"
    elif found.image_size is not None:
        return found.image_size, f"said by {file.name}"
    else:
        words = f"no picture beside {file.name}: the middle of the points stands for the middle of the picture"
        return None, words
    _refuse_other_size(found, file.name, size, origin)
    return size, origin


def _refuse_other_size(found: Points, file: str, size: tuple[int, int], origin: str) -> None:
    if found.image_size not in (None, size):
        was = " x ".join(map(str, found.image_size or ()))
        raise AssetError(
            f"{file}: made for a picture of {was} pixels, this one has {size[0]} x {size[1]} ({origin})"
        )


def _laid_out(found: Points, file: str) -> LandmarkFile:
    """The points in the order of their scheme, or named ones of another scheme in that of the file."""
    scheme, names, xy = found.scheme, found.names, found.xy
    if names is None:
        if scheme in (*NUMBERED, None) and len(xy) in (68, 51):
            return _ibug(xy, np.arange(68 - len(xy), 68), scheme)
        if scheme in (MEDIAPIPE, None) and len(xy) in MESHES:
            return _of_mesh(xy)
        few = (
            f"{len(xy)} points" if scheme is None else f"{len(xy)} points of scheme {scheme!r:.30}"
        )
        raise AssetError(
            f"{file}: {few} without names; 68 or 51 (iBUG), 468 or 478 (MediaPipe) are accepted, others with names"
        )
    if not names:
        raise AssetError(f"{file}: 0 points; 68 or 51 (iBUG), 468 or 478 (MediaPipe) are accepted")
    if scheme not in (*NUMBERED, MEDIAPIPE, None) or not all(map(_is_count, names)):
        if scheme in (*NUMBERED, MEDIAPIPE):
            odd = next(name for name in names if not _is_count(name))
            raise AssetError(f"{file}: point {odd!r:.30} is not a number, those of {scheme} are")
        return _with_missing(LandmarkFile(xy, scheme or "farkas", names=names))
    numbers = np.array([int(name) for name in names])
    if len(set(names)) > len(np.unique(numbers)):  # "1" and "01"
        raise AssetError(
            f"{file}: a point is named twice, with and without zeros before its number"
        )
    if scheme == MEDIAPIPE or (scheme is None and len(numbers) > len(IBUG)):
        mesh = np.full((max(MESHES), 2), np.nan)
        mesh[_numbers_within(numbers, 0, len(mesh) - 1, file)] = xy
        return _of_mesh(mesh)
    if set(numbers.tolist()) == set(range(len(IBUG))):  # all of them, counted from 0
        return _ibug(xy, numbers, scheme)
    return _ibug(xy, _numbers_within(numbers, 1, len(IBUG), file) - 1, scheme)


def _is_count(name: str) -> bool:
    return re.fullmatch(r"[0-9]{1,4}", name) is not None


def _numbers_within(numbers: IntArray, low: int, high: int, file: str) -> IntArray:
    odd = numbers[(numbers < low) | (numbers > high)]
    if len(odd):
        raise AssetError(f"{file}: point {odd[0]} is not within {low} to {high}")
    return numbers


def _ibug(xy: Array, rows: IntArray, scheme: str | None) -> LandmarkFile:
    points = np.full((len(IBUG), 2), np.nan)
    points[rows] = xy
    return _with_missing(LandmarkFile(points, scheme or "ibug68"))


def _of_mesh(mesh: Array) -> LandmarkFile:
    """The iBUG points of a face mesh, without its outline."""
    points = ibug68_of_mesh(mesh)
    points[:JAW] = np.nan
    return _with_missing(LandmarkFile(points, "ibug68", left_out={OUTLINE: IBUG[:JAW]}))


def _with_missing(read: LandmarkFile) -> LandmarkFile:
    known = {name for names in read.left_out.values() for name in names}
    return _without(read, np.isnan(read.points[:, 0]), MISSING, known)


def _without(
    read: LandmarkFile, gone: np.ndarray, reason: str, known: Collection[str] = ()
) -> LandmarkFile:
    """`read` without the points `gone` (L,), for a reason that is said; those in `known` have one."""
    names = tuple(n for n, out in zip(read.names, gone, strict=True) if out and n not in known)
    points = np.where(gone[:, None], np.nan, read.points)
    left_out = {**read.left_out, reason: names} if names else read.left_out
    return replace(read, points=points, left_out=left_out)


def _in_pixels(read: LandmarkFile, file: str) -> LandmarkFile:
    """Fractions of the picture times its size; pixels as they are."""
    given = read.points[np.isfinite(read.points).all(axis=1)]
    low, high = FRACTIONS
    if len(np.unique(given, axis=0)) < MIN_POINTS or not ((given >= low) & (given <= high)).all():
        return read
    if ((given >= 0) & (given <= 1)).all(axis=1).mean() < 0.5:  # as of coordinates from -1 to 1
        raise AssetError(
            f"{file}: coordinates from {given.min():.3g} to {given.max():.3g} are neither pixels nor fractions "
            "(0 to 1) of the picture"
        )
    if read.image_size is None:
        raise AssetError(
            f"{file}: coordinates from {given.min():.3g} to {given.max():.3g} are fractions of the picture; give its "
            "size (--image-size 640x480), or put it beside the file under the same name"
        )
    width, height = read.image_size
    unit = f"fractions of the picture of {width} x {height} pixels"
    return replace(read, points=read.points * np.array([width, height]), unit=unit)


def _inside(read: LandmarkFile, file: str) -> LandmarkFile:
    """`read` without the points outside the picture; AssetError if the face would not fit into it."""
    given = read.points[np.isfinite(read.points).all(axis=1)]
    if read.image_size is None or not len(given):
        return read
    size = np.array(read.image_size, dtype=np.float64)
    box = np.ptp(given, axis=0)
    if (box > size + EDGE).any():
        raise AssetError(
            f"{file}: the points span {box[0]:.6g} x {box[1]:.6g} pixels, the picture has "
            f"{size[0]:.0f} x {size[1]:.0f} ({read.image_size_from}); is it the picture of these points?"
        )
    outside = (read.points < -EDGE) | (read.points > size + EDGE)  # False for NaN
    return _without(read, outside[:, 0] | outside[:, 1], OUTSIDE)


def _on_model(read: LandmarkFile, model: FaceModel) -> LandmarkFile:
    """`read` in the order of the model's scheme, without the points that have no vertex there."""
    scheme = model.scheme(read.scheme)
    if read.names == scheme.points:
        return read
    row_of = {name: row for row, name in enumerate(scheme.points)}
    read = _without(
        read,
        np.array([name not in row_of for name in read.names]) & np.isfinite(read.points[:, 0]),
        f"without a vertex in scheme {scheme.name} of {model.name}",
    )
    points = np.full((len(scheme), 2), np.nan)
    for name, point in zip(read.names, read.points, strict=True):
        if name in row_of:
            points[row_of[name]] = point
    return replace(read, points=points, names=scheme.points)


def _short(names: Sequence[str]) -> str:
    """As in "1 to 17", in "3, 5, 8" or in "n, sn, prn and 4 more"."""
    numbers = [int(name) for name in names if _is_count(name)]
    if len(numbers) == len(names) > 2 and numbers == list(range(numbers[0], numbers[-1] + 1)):
        return f"{names[0]} to {names[-1]}"
    shown = ", ".join(f"{name:.30}" for name in names[:8])
    return shown if len(names) <= 8 else f"{shown} and {len(names) - 8} more"
