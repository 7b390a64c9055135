"""Points of a picture as files write them: .pts of 300-W, CSV with a header, JSON. Syntax only.

What the numbers mean (which scheme, pixels or fractions of the picture, which of them can be used) is for
`landmarks.py`. Errors name the line, in JSON the line of a mistake in spelling and the point of one in content.
"""

from __future__ import annotations

import csv
import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Array, shown
from ..errors import AssetError

MAX_POINTS = 10_000
FORMAT, VERSION = "faceambig-landmarks", 1  # of our own JSON
NAMES = ("name", "point", "landmark", "id", "index")  # columns and keys that name a point
DELIMITERS = (",", ";", "\t")
# Lists without a name for each point: flat ones are told apart by their length (x, y or x, y, z each)
FLAT = {per * count: per for count in (51, 68, 468, 478) for per in (2, 3)}
# Keys under which programs keep the points of a face, or of several faces
HOLDERS = (
    "points", "landmarks", "landmark", "keypoints", "scaledMesh",
    "face_landmarks", "faceLandmarks", "multi_face_landmarks", "multiFaceLandmarks",
)  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """What one file says. n points in its order."""

    xy: Array  # (n, 2), NaN = missing
    names: tuple[str, ...] | None = None  # n, all different
    scheme: str | None = None
    image_size: tuple[int, int] | None = None


def parse_points(text: str, file: str) -> Points:
    """The points of the text of `file`, by what it looks like; AssetError, one line, if it is none of the three."""
    lines = text.splitlines()
    if not text.strip():
        raise AssetError(f"{file}: empty")
    if any(re.match(r"\s*(version|n_points)\s*:", line) for line in lines[:10]):
        return Points(_parse_pts(lines, file))
    if text.lstrip()[0] in "[{":
        return _parse_json(text, file)
    return _parse_csv(lines, file)


def cells(line: str, delimiter: str = ",") -> list[str]:
    """The cells of one line of CSV; none if there is a monstrous one."""
    try:
        return next(csv.reader([line], delimiter=delimiter))
    except csv.Error:  # a cell of more than 131,072 characters
        return []


def _parse_pts(lines: Sequence[str], file: str) -> Array:
    """(n, 2) of a 300-W file. Blank lines are allowed anywhere, and space around colons and braces."""
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
    return _array(rows)


def _parse_csv(lines: Sequence[str], file: str) -> Points:
    """A row a point under a header with x and y, or OpenFace's row a face under x_0, ..., y_0, ..."""
    rows = [
        (number, line)
        for number, line in enumerate(lines, start=1)
        if line.strip() and not line.startswith("#")
    ]
    for delimiter in DELIMITERS:
        header = [cell.strip() for cell in cells(rows[0][1], delimiter)] if rows else []
        lower = [cell.lower() for cell in header]
        if {"x", "y"} <= set(lower):
            break
        if {"x_0", "y_0"} <= set(header):  # in capitals they are millimetres in space
            return _wide(header, rows[1:], delimiter, file)
    else:
        raise AssetError(
            f"{file}: not a landmark file; .pts (300-W), CSV with a header (x,y or name,x,y) or JSON is accepted"
        )
    name, side = next((n for n in NAMES if n in lower), None), "side" in lower
    found: dict[str, tuple[float, float]] = {}
    for number, line in rows[1:]:
        where = f"line {number} of {file}"
        row = [cell.strip() for cell in cells(line, delimiter)]
        if len(row) != len(header):
            raise AssetError(f"{where}: {len(row)} cells, the header has {len(header)}")
        cell = dict(zip(lower, row, strict=True))
        # Without names a place in the file is one, so that both kinds are counted and bounded alike
        point = str(len(found)) if name is None else cell[name]
        if name is not None and side and cell["side"] in ("right", "left"):
            point = point if point.isdecimal() else f"{point}_{cell['side'][0]}"
        if not point:
            raise AssetError(f"{where}: the point has no name")
        if point in found:
            raise AssetError(f"{where}: point {point!r:.30} is named twice")
        x, y = cell["x"], cell["y"]
        found[point] = (math.nan, math.nan) if x == y == "" else _two_numbers([x, y], where)
        if len(found) > MAX_POINTS:
            raise AssetError(f"{file}: more than {MAX_POINTS} points")
    return Points(_array(list(found.values())), None if name is None else tuple(found))


def _wide(
    header: Sequence[str], rows: Sequence[tuple[int, str]], delimiter: str, file: str
) -> Points:
    if len(rows) != 1:
        raise AssetError(f"{file}: {len(rows)} rows of a face each; keep one")
    number, line = rows[0]
    row = [cell.strip() for cell in cells(line, delimiter)]
    if len(row) != len(header):
        raise AssetError(f"line {number} of {file}: {len(row)} cells, the header has {len(header)}")
    cell = dict(zip(header, row, strict=True))
    count = next(k for k in range(len(header) + 1) if not {f"x_{k}", f"y_{k}"} <= set(header))
    return Points(
        _array(
            [
                _two_numbers(
                    [cell[f"x_{k}"], cell[f"y_{k}"]], f"line {number} of {file}, point {k}"
                )
                for k in range(count)
            ]
        )
    )


def _parse_json(text: str, file: str) -> Points:
    """Our own file, or the points of one face as a list, below any of the keys of HOLDERS."""
    try:
        value = json.loads(text, object_pairs_hook=lambda pairs: _once(pairs, file))
    except json.JSONDecodeError as error:
        raise AssetError(
            f"line {error.lineno} of {file}: not JSON ({error.msg}, column {error.colno})"
        ) from error
    except AssetError:
        raise
    except (ValueError, RecursionError) as error:  # 4300 digits; a thousand brackets
        raise AssetError(f"{file}: not JSON that can be read ({type(error).__name__})") from error
    scheme, image_size = None, None
    if isinstance(value, dict):
        if value.get("format") == FORMAT and value.get("version") != VERSION:
            raise AssetError(
                f"{file}: version {shown(value.get('version'))} of {FORMAT}; {VERSION} is read"
            )
        scheme, image_size = value.get("scheme"), _size(value.get("image_size"), file)
        if not isinstance(scheme, str | None):
            raise AssetError(f"{file}: scheme {shown(scheme)} is not a name")
    xy, names = _face(value, file)
    return Points(xy, names, scheme, image_size)


def _once(pairs: Sequence[tuple[str, Any]], file: str) -> dict[str, Any]:
    """An object of JSON, refused if a key comes twice: Python would keep the last in silence."""
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        raise AssetError(
            f"{file}: {next(k for k in keys if keys.count(k) > 1)!r:.30} is given twice"
        )
    return found


def _size(value: Any, file: str) -> tuple[int, int] | None:
    if value is None:
        return None
    if (
        not isinstance(value, list)
        or len(value) != 2
        or not all(
            isinstance(n, int) and not isinstance(n, bool) and 1 <= n <= 10**9 for n in value
        )
    ):
        raise AssetError(f"{file}: image_size {shown(value)} is not [width, height] in pixels")
    return value[0], value[1]


def _face(value: Any, file: str) -> tuple[Array, tuple[str, ...] | None]:
    """Points and names of the one face in `value`, whatever it is wrapped in."""
    for depth in range(6):  # deeper than any program wraps a face
        if isinstance(value, dict):
            key = next((key for key in HOLDERS if key in value), None)
            if key is not None:
                value = value[key]
            elif depth and any(_is_point(item) for item in value.values()):
                return _items(list(value.values()), file), tuple(value)
            else:
                break
        elif not isinstance(value, list):
            raise AssetError(f"{file}: expected a list of points, found {shown(value)}")
        elif value and all(map(_is_number, value)):
            return _flat(value, file), None
        elif not value or any(_is_point(item) for item in value):
            return _items(value, file), _names_of(value, file)
        elif len(value) > 1 and all(isinstance(item, list | dict) for item in value):
            raise AssetError(f"{file}: {len(value)} faces; keep one")
        else:
            value = value[0]
    raise AssetError(f"{file}: no points; a list of [x, y] below 'points' is accepted")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_point(value: Any) -> bool:
    """null, {"x": .., "y": ..} or [x, y] with at most z, visibility and presence behind."""
    if isinstance(value, dict):
        return "x" in value and "y" in value
    return value is None or (
        isinstance(value, list)
        and 2 <= len(value) <= 5
        and not any(isinstance(part, list | dict) for part in value)
    )


def _items(items: Sequence[Any], file: str) -> Array:
    if len(items) > MAX_POINTS:
        raise AssetError(f"{file}: more than {MAX_POINTS} points")
    rows = []
    for number, item in enumerate(items, start=1):
        pair = [item["x"], item["y"]] if isinstance(item, dict) and _is_point(item) else item
        if pair is None or (isinstance(pair, list) and pair[:2] == [None, None]):
            rows.append((math.nan, math.nan))
            continue
        where = f"point {number} of {file}"
        if not _is_point(pair) or not all(map(_is_number, pair[:2])):
            raise AssetError(f"{where}: expected two numbers, found {shown(item)}")
        rows.append(_two_numbers(pair[:2], where))
    return _array(rows)


def _names_of(items: Sequence[Any], file: str) -> tuple[str, ...] | None:
    """The names of the points if each has one; programs that name a few of them mean regions."""
    for key in NAMES:
        named = [item.get(key) if isinstance(item, dict) else None for item in items]
        if named and all(isinstance(n, str | int) and not isinstance(n, bool) for n in named):
            names = [str(name) for name in named]
            for number, name in enumerate(names, start=1):
                if name in names[: number - 1]:
                    raise AssetError(f"point {number} of {file}: {name!r:.30} is named twice")
            return tuple(names)
    return None


def _flat(numbers: Sequence[float], file: str) -> Array:
    per = FLAT.get(len(numbers))
    if per is None:
        raise AssetError(
            f"{file}: a list of {len(numbers)} numbers; x, y of 68, 51, 468 or 478 points are accepted"
        )
    return _items([list(numbers[k : k + 2]) for k in range(0, len(numbers), per)], file)


def _array(rows: Sequence[tuple[float, float]]) -> Array:
    return np.array(rows, dtype=np.float64).reshape(-1, 2)


def _two_numbers(words: Sequence[Any], where: str) -> tuple[float, float]:
    """x and y of a row; both NaN is a missing point, one alone is damage."""
    try:
        x, y = map(float, words)
    except (ValueError, OverflowError):  # a word; an integer beyond every float
        x = y = math.inf
    if math.isinf(x) or math.isinf(y) or math.isnan(x) != math.isnan(y):
        found = shown(" ".join(str(word)[:100] for word in words))
        raise AssetError(f"{where}: expected two numbers, found {found}")
    return x, y
