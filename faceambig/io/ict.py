"""ICT-FaceKit ("light"): OBJ files in centimetres, mean and identities with one topology.

`identityNNN.obj` is the mean plus one standard deviation of mode NNN, so the mode is the difference.
The first 9,409 vertices are the face with ears, forehead and the front of the neck, those up to 11,247 add the back of
the head; eyes, teeth and lashes follow and are left out. Parsing takes seconds, so the result is kept in a cache.
"""

from __future__ import annotations

import hashlib
import io
import os
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import platformdirs
from numpy.typing import NDArray

from ..arrays import Array
from ..errors import AssetError
from ..model import FaceModel
from .files import asset_path
from .npz import read_npz, save_model
from .schemes import schemes_in

CENTIMETRE = 0.01
CACHE_VERSION = 1  # raise it when what is kept changes


class Part(NamedTuple):
    """The first vertices and polygons of the file."""

    vertices: int
    polygons: int


ALL = Part(26_719, 26_384)
PARTS = {"face": Part(9_409, 9_230), "head": Part(11_248, 11_144)}
MAX_OBJ_BYTES = 16 << 20  # of one OBJ; the real ones have 2.6 MB
MAX_IDENTITIES = 500

MEAN = "generic_neutral_mesh.obj"


def is_ict(path: Path) -> bool:
    """Whether `path` is a folder with FaceXModel/, or that folder."""
    return (path / "FaceXModel").is_dir() or (path / MEAN).is_file()


def read_ict(path: Path, *, part: str = "face") -> FaceModel:
    """The ICT-FaceKit model at the file's own origin, metres; `part` is "face" or "head".

    Kept in the user's cache folder, or that of FACEAMBIG_CACHE, under a key of the files' names, sizes and times.

    Raises
    ------
    AssetError: a file is missing, damaged or of another topology.
    """
    folder = path / "FaceXModel" if (path / "FaceXModel").is_dir() else path
    files = [folder / MEAN, *sorted(folder.glob("identity[0-9][0-9][0-9].obj"))]
    if not 2 <= len(files) <= MAX_IDENTITIES + 1:
        raise AssetError(
            f"{folder}: {len(files) - 1} files identityNNN.obj; 1 to {MAX_IDENTITIES} are accepted"
        )
    cached = cache_folder() / f"ict-{_key(files)}.npz"
    head = _cached(cached)
    if head is None:
        head = _parse(files)
        _keep(head, cached)
    return _cut(head, part)


def cache_folder() -> Path:
    """FACEAMBIG_CACHE, else the user's cache folder for faceambig."""
    named = os.environ.get("FACEAMBIG_CACHE")
    return Path(named) if named else platformdirs.user_cache_path("faceambig")


def _key(files: list[Path]) -> str:
    """A name for these very files; AssetError if one is missing."""
    digest = hashlib.sha256(f"{CACHE_VERSION} {files[0].parent.resolve()}".encode())
    for file in files:
        try:
            stat = file.stat()
        except OSError as error:
            raise AssetError(f"{file}: cannot be read ({error.strerror or error})") from error
        digest.update(f"\n{file.name} {stat.st_size} {stat.st_mtime_ns}".encode())
    return digest.hexdigest()[:16]


def _cached(file: Path) -> FaceModel | None:
    try:
        return read_npz(file)
    except AssetError:  # not there yet, or damaged: the files themselves are the truth
        return None


def _keep(model: FaceModel, file: Path) -> None:
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        save_model(model, file)
    except OSError:  # a full or read-only disk: the next load parses again
        pass


def _parse(files: list[Path]) -> FaceModel:
    """The head part of the mean and its modes, metres, without schemes."""
    part = PARTS["head"]
    text = _text(files[0])
    mean = _positions(text, files[0].name)[: part.vertices]
    modes = np.empty((part.vertices, 3, len(files) - 1))
    for column, file in enumerate(files[1:]):
        identity = _positions(_text(file), file.name)[: part.vertices]
        np.subtract(identity, mean, out=modes[:, :, column])
    modes *= CENTIMETRE
    return FaceModel(
        name="ict",
        control_mean=mean * CENTIMETRE,
        control_modes=modes,
        faces=_triangles(text, files[0].name, part),
        schemes={},
        licence="MIT, (c) 2020 USC Institute for Creative Technologies",
        source=f"ICT-FaceKit, {len(files) - 1} identity modes",
    )


def _cut(head: FaceModel, part: str) -> FaceModel:
    """The face or the head, with its landmarks; d_S is measured on the face part of both."""
    n = PARTS[part].vertices
    return replace(
        head,
        control_mean=head.control_mean[:n],
        control_modes=head.control_modes[:n],
        faces=head.faces[(head.faces < n).all(axis=1)],
        schemes=schemes_in(asset_path("schemes"), "ict", n),
        evaluation=None if part == "face" else np.arange(PARTS["face"].vertices),
    )


def _text(file: Path) -> bytes:
    try:
        size = file.stat().st_size
        if size > MAX_OBJ_BYTES:
            raise AssetError(f"{file.name}: {size} bytes; {MAX_OBJ_BYTES} are accepted")
        return b"\n" + file.read_bytes().replace(b"\r\n", b"\n")
    except OSError as error:
        raise AssetError(f"{file}: cannot be read ({error.strerror or error})") from error


def _positions(text: bytes, file: str) -> Array:
    """(26719, 3) of the block of `v x y z` lines, centimetres."""
    start, last = text.find(b"\nv "), text.rfind(b"\nv ")
    end = text.find(b"\n", last + 1)
    block = text[start + 1 : end if end > 0 else len(text)]
    n = block.count(b"\nv ") + 1 if start >= 0 else 0
    if n != ALL.vertices:
        raise AssetError(f"{file}: {n} vertices; ICT-FaceKit's light mesh has {ALL.vertices}")
    try:
        # 15 ms a file: NumPy's own reader of text, in C
        rows = np.loadtxt(io.BytesIO(block), usecols=(1, 2, 3), comments=None, ndmin=2)
    except ValueError as error:
        raise AssetError(
            f"{file}: a vertex line is damaged ({str(error).splitlines()[0]})"
        ) from error
    if rows.shape != (n, 3) or not np.isfinite(rows).all():  # a line of another kind between them
        raise AssetError(f"{file}: a vertex line is damaged (not three finite numbers)")
    return rows


def _triangles(text: bytes, file: str, part: Part) -> NDArray[np.uint32]:
    """(F, 3) of the polygons of `part`, from 0; a quad a b c d becomes a b c and a c d."""
    lines = text[max(text.find(b"\nf "), 0) :].split(b"\n")
    polygons = [line.split()[1:] for line in lines if line.startswith(b"f ")]
    if len(polygons) != ALL.polygons:
        raise AssetError(
            f"{file}: {len(polygons)} polygons; ICT-FaceKit's light mesh has {ALL.polygons}"
        )
    triangles: list[tuple[int, int, int]] = []
    for polygon in polygons[: part.polygons]:
        try:
            corners = [int(corner.partition(b"/")[0]) for corner in polygon]
        except ValueError:
            corners = []
        if len(corners) < 3 or min(corners) < 1 or max(corners) > part.vertices:
            raise AssetError(
                f"{file}: polygon {b' '.join(polygon).decode(errors='replace')!r:.60} is not three or more "
                f"vertices within 1 to {part.vertices}"
            )
        triangles += ((corners[0], b, c) for b, c in pairwise(corners[1:]))
    return np.array(triangles, dtype=np.uint32) - np.uint32(1)
