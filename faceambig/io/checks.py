"""Arrays of a file, looked at before they are used: kinds of number, finite, within the model."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..arrays import Array, IntArray
from ..errors import AssetError


def finite(name: str, values: NDArray[Any]) -> Array:
    """`values` as float64; AssetError if they are no real numbers, or one is not finite."""
    if values.dtype.kind not in "iuf":
        raise AssetError(f"{name} holds {values.dtype} numbers")
    array = np.ascontiguousarray(values, dtype=np.float64)
    if not np.isfinite(array).all():
        raise AssetError(f"{name} holds a value that is not finite")
    return array


def whole_numbers(name: str, values: NDArray[Any]) -> NDArray[Any]:
    """`values` as integers, of floats too if they are whole."""
    if values.dtype.kind != "f":
        return values
    if not (finite(name, values) == np.rint(values)).all():
        raise AssetError(f"{name} holds numbers that are not whole")
    return values.clip(-(1 << 40), 1 << 40).astype(np.int64)


def vertex_numbers(name: str, values: NDArray[Any], end: int) -> NDArray[Any]:
    """`values`, if they are whole numbers from 0 below `end`."""
    if values.dtype.kind not in "iu":
        raise AssetError(f"{name} hold {values.dtype} numbers, not vertex numbers")
    low, high = int(values.min()), int(values.max())
    if low < 0 or high >= end:
        raise AssetError(f"{name}: vertex {low if low < 0 else high} is not within 0 to {end - 1}")
    return values


def shaped(name: str, flat: NDArray[Any]) -> NDArray[Any]:
    """(N, 3) or (N, 3, S) of x y z interleaved (3N,) or (3N, S)."""
    if not flat.shape or len(flat) % 3:
        raise AssetError(f"{name} has shape {flat.shape}, expected x y z of each vertex in turn")
    return flat.reshape(len(flat) // 3, 3, *flat.shape[1:])


def nearest(mean: Array, points: Array) -> tuple[IntArray, Array]:
    """The vertex of `mean` (N, 3) nearest to each of `points` (L, 3), and how far it is."""
    away, vertices = cKDTree(mean).query(points)
    return np.asarray(vertices, dtype=np.intp), np.asarray(away)
