"""The array types of every signature, and the ways arrays and numbers cross a border.

S modes, L landmarks, N vertices, B control vertices, F faces: the same letters everywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Integral, Real
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
IntArray = NDArray[np.intp]
T = TypeVar("T", bound=np.generic)


def read_only(array: NDArray[T]) -> NDArray[T]:
    """A view that cannot be written through; the caller's own array stays writable."""
    view = array.view()
    view.flags.writeable = False
    return view


def vertex_normals(vertices: Array, faces: NDArray[np.integer]) -> Array:
    """(V, 3) unit normals, each triangle weighted by its area; faces (F, 3) wound outward."""
    corners = vertices[faces]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normals = np.empty((len(faces), 3))
    normals[:, 0] = a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1]
    normals[:, 1] = a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2]
    normals[:, 2] = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    at = faces.ravel()
    sums = np.stack(
        [np.bincount(at, np.repeat(normals[:, k], 3), len(vertices)) for k in range(3)], axis=1
    )
    return sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-300)


def checked(
    name: str, value: ArrayLike, shape: Sequence[int | None], *, nan: bool = False
) -> Array:
    """`value` as float64 of `shape` (None: any length); ValueError names the argument and what came."""
    try:
        if isinstance(value, np.ma.MaskedArray):  # what is masked is missing, not what lies below
            value = np.ma.filled(value.astype(np.float64), np.nan)
        array = np.asarray(value)
        if (
            array.dtype.kind not in "biufO"
        ):  # text and complex numbers would be converted in silence
            raise ValueError(f"of type {array.dtype}")
        array = array.astype(np.float64, copy=False)
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"{name}: expected numbers, found {shown(value)}") from error
    fits = array.ndim == len(shape) and all(
        want is None or want == have for want, have in zip(shape, array.shape, strict=False)
    )
    if not fits:
        wanted = ", ".join("n" if n is None else str(n) for n in shape)
        raise ValueError(f"{name}: expected shape ({wanted}), found {array.shape}")
    finite = np.isfinite(array) | np.isnan(array) if nan else np.isfinite(array)
    if not finite.all():
        raise ValueError(f"{name}: every value must be finite{' or NaN (missing)' if nan else ''}")
    return array


def number(name: str, value: object) -> float:
    """`value` as a float, NaN and infinity included; ValueError for what is no real number (text, bool, None)."""
    value = _scalar(value)
    if isinstance(value, bool | np.bool_) or not isinstance(value, Real):
        raise ValueError(f"{name}: {shown(value)} is not a number")
    try:
        return float(value)
    except OverflowError as error:  # a whole number beyond every float
        raise ValueError(f"{name}: {shown(value)} is too large") from error


def whole(name: str, value: object) -> int:
    """`value` as an int; ValueError for what is no whole number (text, bool, None, 70.0)."""
    value = _scalar(value)
    if isinstance(value, bool | np.bool_) or not isinstance(value, Integral):
        raise ValueError(f"{name}: {shown(value)} is not a whole number")
    return int(value)


def positive(name: str, value: object) -> float:
    """`value` as a float above 0 and finite."""
    given = number(name, value)
    if not 0 < given < np.inf:
        raise ValueError(f"{name}: {given:g} is not above 0 and finite")
    return given


def one_of(name: str, value: object, known: Sequence[str]) -> None:
    """ValueError unless `value` is one of the known words."""
    if not isinstance(value, str) or value not in known:
        raise ValueError(f"{name}: {shown(value)} is not {' or '.join(known)}")


def shown(value: object) -> str:
    """`value` in at most 60 characters of one line, for an error message."""
    try:
        text = " ".join(repr(value).split())
    except ValueError:  # Python refuses to write more than 4300 digits
        return "a number of that many digits"
    return text if len(text) <= 60 else f"{text[:57]}..."


def _scalar(value: object) -> object:
    return value.item() if isinstance(value, np.ndarray) and value.ndim == 0 else value
