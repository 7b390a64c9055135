"""The array types of every signature, and the two ways an array crosses a border.

S modes, L landmarks, N vertices, B control vertices, F faces: the same letters everywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
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


def checked(
    name: str, value: ArrayLike, shape: Sequence[int | None], *, nan: bool = False
) -> Array:
    """`value` as float64 of `shape` (None: any length); ValueError names the argument and what came."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name}: expected numbers, found {value!r:.60}") from error
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
