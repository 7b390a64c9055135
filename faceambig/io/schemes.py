"""Landmark schemes: which vertex of a model each named point is, and which point of a face mesh that of iBUG.

A scheme file has lines `name,side,vertex,...` under a header; `assets/schemes/<model>_<scheme>.csv` are ours.
MediaPipe's dense mesh has no public list of vertices on other models, and its points between the features mark nothing
that could be found again. What it shares with a model are the points of iBUG: both ways go through them.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..arrays import Array
from ..errors import AssetError
from ..model import Scheme
from .files import asset_path, text_of
from .points import cells

MEDIAPIPE = "mediapipe"
JAW = 17  # the first points of iBUG run along the jaw

# The corners of the right and of the left eye, by point name, and what the distance between their centres is called.
EYES = (
    (("37", "40"), ("43", "46"), "mean of the two corners of each eye (37+40, 43+46)"),
    (("ex_r", "en_r"), ("en_l", "ex_l"), "mean of the outer and inner corner of each eye (ex, en)"),
)
MESH_EYES = (
    ("33", "133"), ("362", "263"), "mean of the two corners of each eye (MediaPipe's 33+133, 362+263)",
)  # fmt: skip


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
    header = cells(rows[0][1]) if rows else []
    if not {"name", "side", "vertex"} <= set(header):
        raise AssetError(
            f"{path.name}: expected the columns name, side, vertex, found {','.join(header):.60}"
        )
    columns = [header.index(column) for column in ("name", "side", "vertex")]
    points, sides, vertices = [], [], []
    for number, line in rows[1:]:
        row = cells(line)
        if len(row) != len(header):
            raise AssetError(
                f"line {number} of {path.name}: {len(row)} cells, the header has {len(header)}"
            )
        point, side, vertex = (row[column].strip() for column in columns)
        if side not in ("right", "left", "mid") or not re.fullmatch(r"\d{1,9}", vertex):
            raise AssetError(
                f"line {number} of {path.name}: expected a side (right, left, mid) and a vertex number, "
                f"found {side!r:.20}, {vertex!r:.20}"
            )
        points.append(point)
        sides.append(side)
        vertices.append(int(vertex))
    return make_scheme(name, points, sides, vertices, path.name)


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


def ibug68_sides() -> dict[str, str]:
    """The side (right, left, mid) of each point of iBUG, by its number."""
    scheme = load_scheme(asset_path("schemes/embedded_ibug68.csv"), "ibug68")
    return dict(zip(scheme.points, scheme.sides, strict=True))


def check_scheme(scheme: Scheme, n_vertices: int, file: str) -> Scheme:
    """`scheme`, if its vertices exist in a model of `n_vertices`."""
    highest = int(scheme.vertices.max())
    if highest >= n_vertices:
        raise AssetError(f"{file}: vertex {highest} is not within 0 to {n_vertices - 1}")
    return scheme


def schemes_in(folder: Path, model: str, n_vertices: int) -> dict[str, Scheme]:
    """The schemes `<model>_<scheme>.csv` in `folder` of a model of `n_vertices`, ibug68 first."""
    files = sorted(folder.glob(f"{model}_*.csv"))
    names = [file.stem.removeprefix(f"{model}_") for file in files]
    # ibug68 first: the scheme a caller gets who names none
    order = sorted(zip(names, files, strict=True), key=lambda pair: (pair[0] != "ibug68", pair[0]))
    return {
        name: check_scheme(load_scheme(file, name), n_vertices, file.name) for name, file in order
    }


def mesh_of_ibug68() -> tuple[tuple[int, ...], ...]:
    """One or two points of MediaPipe's face mesh, counted from 0, for each of the 68 of iBUG."""
    lines = text_of(asset_path("schemes/mediapipe_ibug68.csv")).splitlines()
    rows = [cells(line) for line in lines if not line.startswith("#")][1:]
    return tuple(tuple(int(k) for k in row[1:3] if k) for row in rows)


def ibug68_of_mesh(mesh: Array) -> Array:
    """The 68 points of iBUG (68, 2) on MediaPipe's face mesh (468 or 478, 2), in its unit; NaN where it is missing.

    A point between two of the mesh is their mean. The first 17 lie on the mesh's outline, 10 to 19 mm nearer the ear
    than the jaw points of other models.
    """
    return np.array([mesh[list(pair)].mean(axis=0) for pair in mesh_of_ibug68()])


def mediapipe_scheme(ibug68: Scheme) -> Scheme | None:
    """Scheme "mediapipe" of a model that has `ibug68`: points named by their number in the mesh, without the outline.

    Those of iBUG that are one point of the mesh: the mean of two has no number. None if it lacks an eye corner.
    """
    row_of = {point: row for row, point in enumerate(ibug68.points)}
    pairs = list(enumerate(mesh_of_ibug68(), start=1))[JAW:]
    single = [(str(k), str(pair[0])) for k, pair in pairs if len(pair) == 1 and str(k) in row_of]
    rows, points = [row_of[k] for k, _ in single], tuple(point for _, point in single)
    right, left, meaning = MESH_EYES
    if not {*right, *left} <= set(points):
        return None
    return Scheme(
        name=MEDIAPIPE,
        points=points,
        vertices=ibug68.vertices[rows],
        sides=tuple(ibug68.sides[row] for row in rows),
        eyes=(tuple(map(points.index, right)), tuple(map(points.index, left))),
        eyes_meaning=meaning,
    )
