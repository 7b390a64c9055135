"""Faces on their way in few bytes: rounded, few directions, deflated, as text for a page that reads them itself.

The faces of a way differ from one of them along few directions: the F x 3N displacements are a product of F x K weights
and K directions, K the least that keeps every vertex of every stop within TOLERANCE_MM (singular values, largest
first). Directions and first face are whole numbers of a step of some micrometres.
"""

from __future__ import annotations

import base64
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceambig.arrays import Array

TOLERANCE_MM = 0.02  # of every vertex at every stop, rounding and left out directions together
STEP = 8e-6  # metres: rounding to it moves a vertex by at most 0.007 mm
FINE = 3.0  # parts of a step that a direction is rounded to: their errors add up
LARGEST = 32_000  # of 16 bits, with a little air


@dataclass(frozen=True, slots=True, eq=False)
class Directions:
    """Displacements of a way from its first face. K directions, F stops, N vertices."""

    parts: NDArray[np.int16]  # (3K, N): x, y, z of each direction
    weights: Array  # (F, K): steps by one unit of a direction


def step_of(*faces: Array) -> float:
    """Metres: STEP, or as much more as 16 bits need for the extent of faces (..., 3)."""
    return max(STEP, max(float(np.abs(face).max()) for face in faces) / LARGEST)


def rounded(face: Array, step: float) -> NDArray[np.int16]:
    """(3, N) whole steps of a face (N, 3), metres."""
    return np.round(face.T / step).astype(np.int16)


def directions(faces: Array, base: NDArray[np.int16], step: float) -> Directions:
    """The way of faces (F, N, 3), metres, from `base` (3, N) in steps."""
    n_stops, n_vertices = faces.shape[:2]
    moved = (faces.transpose(0, 2, 1) / step - base).reshape(n_stops, -1)
    U, S, V = np.linalg.svd(moved, full_matrices=False)
    allowed = (0.3 * TOLERANCE_MM * 1e-3 / step) ** 2
    left, kept = moved.copy(), 0
    while kept < len(S) and (left.reshape(n_stops, 3, -1) ** 2).sum(axis=1).max() > allowed:
        left -= np.outer(U[:, kept] * S[kept], V[kept])
        kept += 1
    U, S, V = U[:, :kept], S[:kept], V[:kept]
    reach = np.abs(U).max(axis=0, initial=0.0)  # a direction is written as long as it is ever used
    parts = np.round(FINE * (S * reach)[:, None] * V)
    coarser = np.maximum(np.abs(parts).max(axis=1, initial=0.0) / LARGEST, 1.0)
    parts = np.round(parts / coarser[:, None]).astype(np.int16)
    return Directions(parts.reshape(3 * kept, n_vertices), U / reach * (coarser / FINE))


def restored(way: Directions, base: NDArray[np.int16], step: float) -> Array:
    """(F, N, 3) metres: what the page makes of it."""
    n_vertices = base.shape[1]
    flat = way.weights @ way.parts.reshape(way.weights.shape[1], 3 * n_vertices).astype(float)
    return step * (flat.reshape(len(flat), 3, n_vertices) + base).transpose(0, 2, 1)


def packed(arrays: Mapping[str, NDArray[np.integer]]) -> tuple[list[dict[str, Any]], str]:
    """What arrays (rows, columns) are called and how they lie in the text, and the text: base 64 of zlib.

    Each row is written as differences of neighbours, which wrap around: near vertices have near numbers.
    """
    about, data = [], b""
    for name, array in arrays.items():
        kind = array.dtype.newbyteorder("<")
        about.append(
            {"name": name, "kind": kind.str[1:], "rows": len(array), "columns": array.shape[1]}
        )
        data += np.diff(array, axis=1, prepend=array.dtype.type(0)).astype(kind).tobytes()
    return about, base64.b64encode(zlib.compress(data, 9)).decode()
