"""eos `.bin`: the Surrey Face Model and what eos converts, in cereal's binary archive.

Little endian, without magic number or padding, matrices column by column. By version::

    uint32 version 1 to 4, shape PCA, colour PCA
    2, 3, 4: optional<expressions>      3, 4: optional<landmarks>
    texture_coordinates: vector<float64[2]>      4: texture_triangles: vector<int32[3]>

    PCA      = mean (3N, 1), orthonormal basis (3N, S), variances (S, 1): matrices; vector<int32[3]> triangles
    matrix   = int32 rows, int32 columns, float32[rows * columns]
    vector   = uint64 count, elements;  string = vector of bytes;  optional = byte "is empty", then the value if 0

Every length is compared with what is left of the file before an array is made; the file ends where the last one does.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from ..errors import AssetError
from ..model import FaceModel, Scheme
from .build import Parts, build, fits_in_memory, sds_of_variances
from .checks import shaped
from .files import asset_path, damage_named
from .schemes import ibug68_sides, make_scheme, schemes_in

VERSIONS = (1, 2, 3, 4)
MAX_NAMES = 10_000  # of landmarks and blendshapes
# Meshes of a known size, and the schemes that we have for them
KNOWN = {
    3_448: ("sfm", "free for non-commercial use only (eos README)", "Surrey Face Model"),
    53_490: ("bfm2009", "research only, no redistribution (Basel Face Model)", "Basel Face Model 2009"),
    53_149: ("bfm2017", "research only, no redistribution (Basel Face Model)", "Basel Face Model 2017"),
}  # fmt: skip


def is_eos(path: Path) -> bool:
    """Whether `path` begins with a version and a column of 3N numbers that it has room for."""
    with path.open("rb") as stream:
        start = stream.read(12)
    if len(start) < 12:
        return False
    version, rows, columns = struct.unpack("<Iii", start)
    return version in VERSIONS and columns == 1 and rows > 0 and rows % 3 == 0


def read_eos(path: Path) -> FaceModel:
    """The model of an eos `.bin` at the file's own origin; AssetError, one line, if it is damaged."""
    with damage_named(path), path.open("rb") as stream:
        return build(_parts(_Archive(stream, path.stat().st_size)))


class _Archive:
    """The rest of the file, read in order."""

    def __init__(self, stream: BinaryIO, size: int) -> None:
        self.stream, self.left = stream, size

    def take(self, what: str, n: int, dtype: str) -> NDArray[Any]:
        """The next `n` numbers."""
        size = n * np.dtype(dtype).itemsize
        self._room(what, size)
        return np.frombuffer(self.stream.read(size), dtype)

    def skip(self, what: str, n: int, size: int) -> None:
        """Leave out `n` elements of `size` bytes."""
        self._room(what, n * size)
        self.stream.seek(n * size, 1)

    def _room(self, what: str, size: int) -> None:
        if not 0 <= size <= self.left:
            raise AssetError(f"{what} claims {size} bytes, {self.left} are left")
        self.left -= size

    def number(self, what: str, dtype: str = "<u8") -> int:
        return int(self.take(what, 1, dtype)[0])

    def shape(self, what: str) -> tuple[int, int]:
        rows, columns = self.take(what, 2, "<i4").tolist()
        if rows < 0 or columns < 0:
            raise AssetError(f"{what} has {rows} rows and {columns} columns")
        return rows, columns

    def matrix(self, what: str) -> NDArray[Any]:
        rows, columns = self.shape(what)
        if rows * columns > 3:
            fits_in_memory(rows // 3 + 1, columns)
        return self.take(what, rows * columns, "<f4").reshape((rows, columns), order="F")

    def skip_matrix(self, what: str) -> None:
        rows, columns = self.shape(what)
        self.skip(what, rows * columns, 4)

    def has(self, what: str) -> bool:
        flag = self.number(what, "u1")
        if flag > 1:
            raise AssetError(f"{what}: {flag} is neither there (0) nor empty (1)")
        return flag == 0

    def name(self, what: str) -> str:
        n = self.number(what)
        if n > 1000:
            raise AssetError(f"{what} claims a name of {n} letters")
        return self.take(what, n, "u1").tobytes().decode("utf-8", "replace")


def _parts(archive: _Archive) -> Parts:
    version = archive.number("version", "<u4")
    mean, basis, variances = (archive.matrix(what) for what in ("mean", "basis", "eigenvalues"))
    faces = archive.take("triangles", 3 * archive.number("triangles"), "<i4").reshape(-1, 3)
    colours = archive.matrix("colour mean")
    for what in ("colour basis", "colour eigenvalues"):
        archive.skip_matrix(what)
    archive.skip("colour triangles", archive.number("colour triangles"), 12)
    if version >= 2 and archive.has("expressions"):
        _skip_expressions(archive)
    landmarks = _landmarks(archive) if version >= 3 and archive.has("landmarks") else {}
    archive.skip("texture coordinates", archive.number("texture coordinates"), 16)
    if version >= 4:
        archive.skip("texture triangles", archive.number("texture triangles"), 12)
    if archive.left:
        raise AssetError(f"{archive.left} bytes follow the end of the model")
    vertices = shaped("mean", mean[:, 0])
    name, licence, source = KNOWN.get(len(vertices), ("eos", "", "a model of eos"))
    return Parts(
        name=name,
        mean=vertices,
        modes=shaped("basis", basis),
        sds=sds_of_variances(variances),
        faces=faces,
        unit="mm",
        unit_is_sure=False,
        schemes=_schemes(landmarks, name, len(vertices)),
        colours=shaped("colour mean", colours.ravel()) if colours.size else None,
        licence=licence,
        source=f"{source}, eos file of version {version}",
    )


def _skip_expressions(archive: _Archive) -> None:
    kind = archive.number("expressions", "<i4")
    if kind == 0:
        for what in ("mean", "basis", "eigenvalues"):
            archive.skip_matrix(f"expression {what}")
        archive.skip("expression triangles", archive.number("expression triangles"), 12)
    elif kind == 1:
        for _ in range(_count(archive, "blendshapes")):
            archive.name("blendshape")
            archive.skip_matrix("blendshape")
    else:
        raise AssetError(f"expressions of kind {kind}; 0 and 1 are read")


def _count(archive: _Archive, what: str) -> int:
    n = archive.number(what)
    if n > MAX_NAMES:
        raise AssetError(f"{n} {what}; {MAX_NAMES} are accepted")
    return n


def _landmarks(archive: _Archive) -> dict[str, int]:
    """Vertices by name, in the order of the file."""
    found: dict[str, int] = {}
    for _ in range(_count(archive, "landmarks")):
        name = archive.name("landmark")
        if name in found:
            raise AssetError(f"landmark {name!r:.30} is there twice")
        found[name] = archive.number("landmark", "<i4")
    return found


def _schemes(landmarks: dict[str, int], model: str, n_vertices: int) -> dict[str, Scheme]:
    """Ours for a known mesh; else the file's own points of iBUG, if the corners of the eyes are among them."""
    ours = {} if model == "eos" else schemes_in(asset_path("schemes"), model, n_vertices)
    sides = ibug68_sides()
    points = {name: vertex for name, vertex in landmarks.items() if name in sides}
    if ours or not {"37", "40", "43", "46"} <= set(points):
        return ours
    odd = next((v for v in points.values() if not 0 <= v < n_vertices), None)
    if odd is not None:
        raise AssetError(f"landmarks: vertex {odd} is not within 0 to {n_vertices - 1}")
    names = sorted(points, key=int)
    vertices = [points[name] for name in names]
    return {
        "ibug68": make_scheme("ibug68", names, [sides[n] for n in names], vertices, "landmarks")
    }
