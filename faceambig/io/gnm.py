"""GNM, Google's head model: `gnm_head.npz`, plain arrays in metres.

    template_vertex_positions (N, 3), triangles (F, 3), vertex_identity_basis (S, N, 3) per standard deviation,
    identity_names (S,) head_..., eyes_..., teeth_...; vertex_groups (G, N) and vertex_group_names (G,)

Eyeballs and teeth have modes of their own, which no landmark sees: only those of the head are used. The points of
iBUG are in `head_sparse_68.txt`, a line `vertex weight` three times each: beside the file, in `landmarks/` beside it,
or where GNM's repository has it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, IntArray
from ..errors import AssetError
from ..model import FaceModel
from .between import Between
from .build import Parts, build, fits_in_memory
from .checks import finite, vertex_numbers
from .files import damage_named, text_of
from .schemes import ibug68_sides
from .zipped import names_in, plain_arrays

NAMES = ("template_vertex_positions", "vertex_identity_basis", "identity_names", "triangles")
GROUPS = ("vertex_groups", "vertex_group_names")
POINTS = "head_sparse_68.txt"
BESIDE = (POINTS, f"landmarks/{POINTS}", f"../../landmarks/{POINTS}")
# Points 3 to 7, on the right of the jaw, come from the chin upward in the file as published
SWAPPED = (0, 1, 6, 5, 4, 3, 2, *range(7, 68))


def is_gnm(path: Path) -> bool:
    """Whether `path` is a zip with GNM's arrays."""
    return set(NAMES) <= names_in(path)


def read_gnm(path: Path) -> FaceModel:
    """GNM's head, its 170 head modes, at its own origin; AssetError, one line, for a damaged file."""
    with damage_named(path):
        arrays = plain_arrays(path, (*NAMES, *GROUPS), NAMES)
        mean, basis = arrays["template_vertex_positions"], arrays["vertex_identity_basis"]
        names = arrays["identity_names"]
        if basis.ndim != 3 or names.shape != basis.shape[:1] or names.dtype.kind != "U":
            raise AssetError(f"{names.size} identity_names for a basis of shape {basis.shape}")
        head = np.flatnonzero(np.char.startswith(names, "head_"))
        if not len(head):
            raise AssetError("identity_names: none begins with head_")
        fits_in_memory(basis.shape[1], len(head))
        n = len(mean)
        return build(
            Parts(
                name="gnm",
                mean=mean,
                modes=basis[head].transpose(1, 2, 0),
                faces=arrays["triangles"],
                unit="m",
                between=_landmarks(path, mean),
                evaluation=_skin(arrays.get("vertex_groups"), arrays.get("vertex_group_names"), n),
                licence="Apache-2.0, Google",
                source=f"GNM (google/GNM), {path.name}, {len(head)} head modes",
            )
        )


def _skin(
    groups: NDArray[np.generic] | None, names: NDArray[np.generic] | None, n: int
) -> IntArray | None:
    """The vertices of the skin: d_S is measured there, not on teeth and eyeballs."""
    if groups is None or names is None or groups.shape != (len(names), n):
        return None
    skin = np.flatnonzero(names == "skin")
    if not len(skin) or groups.dtype.kind not in "biuf":
        return None
    vertices = np.flatnonzero(groups[skin[0]].astype(np.float64) > 0.5)
    return vertices if len(vertices) >= 3 else None


def _landmarks(path: Path, mean: NDArray[np.generic]) -> Between | None:
    file = next((path.parent / name for name in BESIDE if (path.parent / name).is_file()), None)
    if file is None:
        return None
    rows = [line.split() for line in text_of(file).splitlines() if line.strip()]
    try:
        table = np.array([[float(word) for word in row] for row in rows])
    except ValueError as error:
        raise AssetError(f"{file.name}: a line is not three vertices and weights") from error
    if table.shape != (68, 6) or not (table[:, ::2] == np.rint(table[:, ::2])).all():
        raise AssetError(f"{file.name}: expected 68 lines of three vertices and weights")
    corners = table[:, ::2].clip(-1, 1 << 40).astype(np.intp)
    weights = table[:, 1::2]
    order = _order(finite("template_vertex_positions", mean), corners, weights)
    sides = ibug68_sides()
    points = tuple(str(k) for k in range(1, 69))
    return Between(
        "ibug68", points, tuple(sides[p] for p in points), corners[order], weights[order]
    )


def _order(mean: Array, corners: IntArray, weights: Array) -> IntArray:
    """The rows in iBUG's order: that of the file, or its right jaw turned round, whichever jaw is the shorter way."""
    at = (mean[vertex_numbers("landmarks", corners, len(mean))] * weights[:, :, None]).sum(axis=1)
    orders = [np.arange(68), np.array(SWAPPED)]
    ways = [np.linalg.norm(np.diff(at[order[:17]], axis=0), axis=1).sum() for order in orders]
    return orders[int(np.argmin(ways))]
