"""Landmark files: points of a picture (.pts), and the schemes that say which vertex of a model each point is."""

from __future__ import annotations

import csv
import math
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..arrays import Array, read_only
from ..errors import AssetError
from ..model import Scheme
from .pictures import picture_beside, picture_size

MAX_BYTES = 1 << 20  # of a landmark file: 68 points take 2 kB, a dense scheme 200 kB
MAX_POINTS = 10_000
SCHEME_OF_COUNT = {68: "ibug68"}  # picture points whose number tells what they are

# The corners of the right and of the left eye, by point name, and what the distance between their centres is called.
EYES = (
    (("37", "40"), ("43", "46"), "mean of the two corners of each eye (37+40, 43+46)"),
    (("ex_r", "en_r"), ("en_l", "ex_l"), "mean of the outer and inner corner of each eye (ex, en)"),
)


@dataclass(frozen=True, slots=True, eq=False)
class LandmarkFile:
    """The points of one picture, as the file has them. L landmarks."""

    points: Array  # (L, 2) pixels, x right, y down, the file's own counting; NaN = missing
    scheme: str  # "ibug68"
    image_size: tuple[int, int] | None  # width, height, pixels
    image_size_from: str  # how the size was found, in words

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", read_only(self.points))


def load_landmarks(
    path: str | os.PathLike[str], *, image_size: tuple[int, int] | None = None
) -> LandmarkFile:
    """The landmarks of one picture, and the size of the picture if it is known.

    Parameters
    ----------
    path: a `.pts` file (300-W): `version: 1`, `n_points: 68`, then a row `x y` per point between braces. The numbers
        stay as they are; 300-W counts pixels from 1. `nan nan` is a missing point.
    image_size: width and height in pixels, used if no picture of the same name lies beside the file.

    Raises
    ------
    AssetError: names the line: `line 14 of faces.pts: expected two numbers, found 'x 1'`.
    ValueError: an `image_size` that is no width and height.
    """
    file = Path(path)
    lines = text_of(file).splitlines()
    if not any(re.match(r"\s*(version|n_points)\s*:", line) for line in lines[:10]):
        raise AssetError(f"{file.name}: not a landmark file; .pts (300-W) is accepted")
    points = _parse_pts(lines, file.name)
    scheme = SCHEME_OF_COUNT.get(len(points))
    if scheme is None:
        raise AssetError(f"{file.name}: {len(points)} points; 68 (iBUG) are accepted")
    if image_size is not None and (len(image_size) != 2 or min(image_size) < 1):
        raise ValueError(f"image_size: {image_size!r} is not a width and a height in pixels")
    picture = picture_beside(file)
    if picture is not None:
        return LandmarkFile(points, scheme, picture_size(picture), f"size of {picture.name}")
    if image_size is not None:
        return LandmarkFile(points, scheme, (int(image_size[0]), int(image_size[1])), "given")
    words = f"no picture beside {file.name}: the middle of the points stands for the middle of the picture"
    return LandmarkFile(points, scheme, None, words)


def load_scheme(path: Path, name: str) -> Scheme:
    """The landmark scheme `name` of a model: lines `name,side,vertex,...` under a header, `#` lines are remarks.

    A point that both sides have is called `ex_r` and `ex_l`. Vertex numbers count from 0; whoever knows the model
    checks that they exist (`check_scheme`).
    """
    rows = [
        (number, line)
        for number, line in enumerate(text_of(path).splitlines(), start=1)
        if line.strip() and not line.startswith("#")
    ]
    header = _cells(rows[0][1]) if rows else []
    if not {"name", "side", "vertex"} <= set(header):
        raise AssetError(
            f"{path.name}: expected the columns name, side, vertex, found {','.join(header):.60}"
        )
    columns = [header.index(column) for column in ("name", "side", "vertex")]
    points, sides, vertices = [], [], []
    for number, line in rows[1:]:
        cells = _cells(line)
        if len(cells) != len(header):
            raise AssetError(
                f"line {number} of {path.name}: {len(cells)} cells, the header has {len(header)}"
            )
        point, side, vertex = (cells[column].strip() for column in columns)
        if side not in ("right", "left", "mid") or not re.fullmatch(r"\d{1,9}", vertex):
            raise AssetError(
                f"line {number} of {path.name}: expected a side (right, left, mid) and a vertex number, "
                f"found {side!r:.20}, {vertex!r:.20}"
            )
        points.append(point)
        sides.append(side)
        vertices.append(int(vertex))
    return make_scheme(name, points, sides, vertices, path.name)


def _cells(line: str) -> list[str]:
    try:
        return next(csv.reader([line]))
    except csv.Error:  # a cell of more than 131,072 characters
        return []


def make_scheme(
    name: str, points: Sequence[str], sides: Sequence[str], vertices: Sequence[int], file: str
) -> Scheme:
    """A Scheme with its eyes found by the names of the points; AssetError if they are not among them."""
    full = [
        point if point.isdigit() or side == "mid" else f"{point}_{side[0]}"
        for point, side in zip(points, sides, strict=True)
    ]
    row_of = {point: row for row, point in enumerate(full)}
    if len(row_of) != len(full):
        twice = next(point for point in full if full.count(point) > 1)
        raise AssetError(f"{file}: point {twice!r:.30} is named twice")
    for right, left, meaning in EYES:
        if all(corner in row_of for corner in (*right, *left)):
            eyes = tuple(row_of[p] for p in right), tuple(row_of[p] for p in left)
            numbers = np.array(vertices, dtype=np.intp)
            return Scheme(name, tuple(full), numbers, tuple(sides), eyes, meaning)
    raise AssetError(
        f"{file}: no eye corners among the points (37, 40, 43, 46, or ex and en of both sides)"
    )


def check_scheme(scheme: Scheme, n_vertices: int, file: str) -> Scheme:
    """`scheme`, if its vertices exist in a model of `n_vertices`."""
    highest = int(scheme.vertices.max())
    if highest >= n_vertices:
        raise AssetError(f"{file}: vertex {highest} is not within 0 to {n_vertices - 1}")
    return scheme


def text_of(path: Path) -> str:
    """A small text file; AssetError if it is none."""
    try:
        if path.stat().st_size > MAX_BYTES:
            raise AssetError(
                f"{path.name}: {path.stat().st_size} bytes, a landmark file has at most {MAX_BYTES}"
            )
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise AssetError(f"{path.name}: not a text file") from error
    except OSError as error:
        raise AssetError(f"{path}: cannot be read ({error.strerror or error})") from error


def _parse_pts(lines: Sequence[str], file: str) -> Array:
    """(L, 2) of a 300-W file. Blank lines are allowed anywhere, and space around colons and braces."""
    count, rows, inside, closed = None, [], False, False
    for number, line in enumerate(lines, start=1):
        words = line.split()
        if not words:
            continue
        if closed:
            raise AssetError(
                f"line {number} of {file}: nothing may follow }}, found {line.strip()!r:.40}"
            )
        if inside:
            if words == ["}"]:
                closed = True
            else:
                rows.append(_two_numbers(words, f"line {number} of {file}"))
                if len(rows) > MAX_POINTS:
                    raise AssetError(f"{file}: more than {MAX_POINTS} points")
        elif words == ["{"]:
            inside = True
        elif match := re.fullmatch(r"n_points\s*:\s*(\d{1,6})", line.strip()):
            count = int(match[1])
        elif not re.fullmatch(r"version\s*:\s*\S+", line.strip()):
            raise AssetError(
                f"line {number} of {file}: expected 'n_points: 68' or {{, found {line.strip()!r:.40}"
            )
    if not closed:
        raise AssetError(f"{file}: ends before }}, after {len(rows)} points")
    if count is not None and count != len(rows):
        raise AssetError(f"{file}: n_points says {count}, there are {len(rows)}")
    return np.array(rows, dtype=np.float64).reshape(-1, 2)


def _two_numbers(words: Sequence[str], where: str) -> tuple[float, float]:
    """x and y of a row; both NaN is a missing point, one alone is damage."""
    try:
        x, y = map(float, words)
    except ValueError:
        x = y = math.inf
    if math.isinf(x) or math.isinf(y) or math.isnan(x) != math.isnan(y):
        raise AssetError(f"{where}: expected two numbers, found {' '.join(words)!r:.40}")
    return x, y
