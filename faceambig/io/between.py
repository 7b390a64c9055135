"""Landmarks that lie in a triangle of the mesh, not at a vertex: FLAME's and GNM's.

A scheme names vertices, so the triangle is cut where the point lies. Not the nearest vertex instead: on a coarse mesh
it is millimetres off, and the eye distance with it.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..arrays import Array, IntArray
from ..errors import AssetError
from ..model import FaceModel
from .checks import finite, vertex_numbers
from .files import text_of
from .points import cells
from .schemes import make_scheme


class Between(NamedTuple):
    """Landmarks that lie in triangles. L points."""

    name: str  # of the scheme
    points: tuple[str, ...]  # L
    sides: tuple[str, ...]  # L
    corners: IntArray  # (L, 3) vertices
    weights: Array  # (L, 3)


def points_between(path: Path) -> Between:
    """The landmarks in triangles of a scheme file with the columns name, side, a, b, c, wa, wb, wc."""
    rows = [cells(line) for line in text_of(path).splitlines() if line and line[0] != "#"]
    name, side, *numbers = (
        rows[0].index(c) for c in ("name", "side", "a", "b", "c", "wa", "wb", "wc")
    )
    return Between(
        name=path.stem.partition("_")[2],
        points=tuple(row[name] for row in rows[1:]),
        sides=tuple(row[side] for row in rows[1:]),
        corners=np.array([[int(row[k]) for k in numbers[:3]] for row in rows[1:]]),
        weights=np.array([[float(row[k]) for k in numbers[3:]] for row in rows[1:]]),
    )


def with_points(model: FaceModel, between: Between) -> FaceModel:
    """`model` with a vertex at each landmark that lies between vertices: its triangle becomes three.

    The surface stays what it is; the vertices of the file keep their numbers, and d_S is measured on them.
    """
    n = model.n_vertices
    corners = vertex_numbers("landmarks", between.corners, n)
    weights = finite("landmark weights", between.weights)
    if (weights < -1e-6).any() or (np.abs(weights.sum(axis=1) - 1) > 1e-3).any():
        raise AssetError("landmark weights: three of 0 or more with the sum 1 are accepted")
    weights = weights.clip(0)
    weights /= weights.sum(axis=1, keepdims=True)
    surface = _Surface(model.faces)
    rows: list[Array] = []
    ids: list[IntArray] = []
    vertices = []
    for triple, weight in zip(corners, weights, strict=True):
        if weight.max() > 1 - 1e-6 or not surface.split(triple, weight, n + len(rows)):
            vertices.append(int(triple[weight.argmax()]))
            continue
        vertices.append(n + len(rows))
        ids.append(triple)
        rows.append(weight)
    scheme = make_scheme(between.name, between.points, between.sides, vertices, model.name)
    schemes = {**model.schemes, between.name: scheme}
    if not rows:
        return replace(model, schemes=schemes)
    at = np.repeat(np.arange(len(rows)), 3)
    added = sparse.csr_array(
        (np.concatenate(rows), (at, np.concatenate(ids))), shape=(len(rows), n)
    )
    operator = sparse.csr_array(sparse.vstack([sparse.eye_array(n), added], format="csr"))
    colours = None if model.colours is None else np.rint(operator @ model.colours.astype(float))
    return replace(
        model,
        schemes=schemes,
        subdivision=operator,
        faces=surface.triangles(),
        coarse_faces=model.faces,
        colours=None if colours is None else colours.astype(np.uint8),
        evaluation=np.arange(n) if model.evaluation is None else model.evaluation,
    )


class _Piece(NamedTuple):
    """A part of a triangle of the file: its vertices, and where they lie in that triangle."""

    vertices: tuple[int, ...]  # 3
    at: Array  # (3, 3) rows: weights over the vertices of the file's triangle


class _Surface:
    """Triangles, some of them cut into pieces."""

    def __init__(self, faces: NDArray[np.uint32]) -> None:
        self.faces = faces
        self.number = {frozenset(face): k for k, face in enumerate(faces.tolist())}
        self.cut: dict[int, list[_Piece]] = {}

    def split(self, triple: IntArray, weight: Array, vertex: int) -> bool:
        """Put `vertex` where `weight` (3,) over the vertices `triple` says; False if they are no triangle."""
        k = self.number.get(frozenset(triple.tolist()))
        if k is None:
            return False
        order = self.faces[k].tolist()
        spot = np.array([weight[triple.tolist().index(v)] for v in order])
        pieces = self.cut.setdefault(k, [_Piece(tuple(order), np.eye(3))])
        inside = [np.linalg.solve(piece.at.T, spot) for piece in pieces]
        at = int(np.argmax([x.min() for x in inside]))
        piece, x = pieces.pop(at), inside[at]
        for corner in range(3):
            if x[corner] > 1e-9:  # on an edge: the piece there has no area
                ids, rows = list(piece.vertices), piece.at.copy()
                ids[corner], rows[corner] = vertex, spot
                pieces.append(_Piece(tuple(ids), rows))
        return True

    def triangles(self) -> NDArray[np.uint32]:
        """(F, 3) whole triangles, then the pieces of the others."""
        whole = np.delete(self.faces, list(self.cut), axis=0)
        pieces = [piece.vertices for cut in self.cut.values() for piece in cut]
        return np.concatenate([whole, np.array(pieces, dtype=np.uint32)])
