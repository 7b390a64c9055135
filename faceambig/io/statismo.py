"""Statismo and Scalismo `.h5`: Basel 2017 and 2019, and any other shape model of these libraries. Needs h5py.

Groups `shape`, `color`, `expression`, or a plain model at the root, each with

    model/mean (3N,), model/pcaBasis (3N, S), model/pcaVariance (S,)       variances
    representer/points (3, N), representer/cells (3, F) from 0             or reference-mesh/vertex-coordinates (N, 3),
                                                                           reference-mesh/triangle-list (F, 3)
    version/majorVersion, minorVersion; metadata/landmarks/json            [{"id": ..., "coordinates": [x, y, z]}, ...]

A mode is pcaBasis * sqrt(pcaVariance). Files of version 0.8, and those of no version with a representer of that time,
have the square root in pcaBasis already: its columns are normalised first. The neutral face of a model with
expressions is shape mean + expression mean.

HDF5 can lead out of the file (soft and external links, external storage, virtual datasets) and can claim sizes that it
does not hold: such a file is refused before a number is read.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import AssetError
from ..model import FaceModel, Scheme
from .build import Parts, build, fits_in_memory, sds_of_variances
from .checks import finite, nearest, shaped
from .files import MAX_BYTES, asset_path, damage_named, text_of
from .points import cells
from .schemes import ibug68_sides, make_scheme, schemes_in
from .zipped import count

if TYPE_CHECKING:
    import h5py

MAGIC = b"\x89HDF\r\n\x1a\n"
OLD_REPRESENTERS = ("itkMeshRepresenter", "vtkPolyDataRepresenter")
FILTERS = (1, 2, 3, 32000)  # deflate, shuffle, checksum, lzf: others would load a library
MAX_JSON = 1 << 20  # bytes of landmarks; 64 points take 10 kB
N_BFM2017 = 53_149
# The corners of the right and of the left eye, by Basel's names
CORNERS = (
    ("right.eye.corner_outer", "right.eye.corner_inner"),
    ("left.eye.corner_inner", "left.eye.corner_outer"),
)
FAR = 30.0  # in file units: a landmark this far from every vertex, 3 cm if they are mm, is of another mesh


def is_hdf5(path: Path) -> bool:
    """Whether `path` is HDF5; MATLAB 7.3 puts 512 bytes of its own before it."""
    with path.open("rb") as stream:
        start = stream.read(520)
    return MAGIC in (start[:8], start[512:])


def read_statismo(path: Path) -> FaceModel:
    """The model of a Statismo or Scalismo `.h5` at its own origin, metres.

    Raises
    ------
    AssetError: one line: a damaged file, one that leads elsewhere, another kind of HDF5.
    RuntimeError: h5py is not installed.
    """
    try:
        import h5py
    except ImportError as error:
        raise RuntimeError(
            f"{path.name}: .h5 is read by h5py: pip install 'faceambig[models]'"
        ) from error
    with path.open("rb") as stream:
        if stream.read(10) == b"MATLAB 7.3":
            raise AssetError(
                f"{path.name}: MATLAB 7.3 is not read; save the arrays with -v7 in MATLAB"
            )
    with damage_named(path), h5py.File(path, "r") as file:
        root = _group(file, "shape") or file
        if _group(root, "model") is None:
            raise AssetError("no group model or shape/model: not a shape model of Statismo")
        return build(_parts(file, root, path.name))


def _parts(file: h5py.Group, root: h5py.Group, name: str) -> Parts:
    basis = _dataset(root, "model/pcaBasis", 2)
    fits_in_memory(basis.shape[0] // 3, basis.shape[1])
    mean = shaped("model/mean", _read(root, "model/mean", 1))
    sds = sds_of_variances(_read(root, "model/pcaVariance", 1))
    columns = _values(basis)
    if _is_scaled(root):
        columns = columns / np.linalg.norm(columns.astype(np.float64), axis=0)
    expression = _group(file, "expression")
    if expression is not None and _group(expression, "model") is not None:
        neutral = shaped("expression/model/mean", _read(expression, "model/mean", 1))
        if neutral.shape != mean.shape:
            raise AssetError(f"expression mean has shape {neutral.shape}, expected {mean.shape}")
        mean = mean + neutral
    known = len(mean) == N_BFM2017
    return Parts(
        name="bfm2017" if known else "statismo",
        mean=mean,
        modes=shaped("model/pcaBasis", columns),
        sds=sds,
        faces=_triangles(root),
        unit="mm",
        unit_is_sure=False,
        schemes=_schemes(file, root, mean, known),
        colours=_colours(file),
        licence="research only, no redistribution (Basel Face Model)" if known else "",
        source=f"Statismo model, {name}",
    )


def _group(parent: h5py.Group, name: str) -> h5py.Group | None:
    found = _member(parent, name)
    if found is None:
        return None
    import h5py

    if not isinstance(found, h5py.Group):
        raise AssetError(f"{name} is not a group")
    return found


def _member(parent: h5py.Group, path: str) -> Any:
    """What lies at `path` inside the file; None if nothing does, AssetError if it leads elsewhere."""
    import h5py

    found: Any = parent
    for name in path.split("/"):
        if not isinstance(found, h5py.Group):
            raise AssetError(f"{path}: {found.name} is not a group")
        link = found.get(name, getlink=True)
        if link is None:
            return None
        if not isinstance(link, h5py.HardLink):
            raise AssetError(f"{path} is a link to elsewhere; put the data into the file")
        found = found[name]
    return found


def _dataset(parent: h5py.Group, path: str, dimensions: int) -> h5py.Dataset:
    """The numeric dataset at `path`, its numbers in the file, of a size that is accepted; nothing is read yet."""
    import h5py

    found = _member(parent, path)
    if not isinstance(found, h5py.Dataset):
        raise AssetError(f"{path} is missing")
    if found.external or found.is_virtual:
        raise AssetError(f"{path} has its numbers in another file")
    settings = found.id.get_create_plist()
    filters = [settings.get_filter(k)[0] for k in range(settings.get_nfilters())]
    if set(filters) - set(FILTERS):
        raise AssetError(f"{path} is packed by filter {filters[0]}; deflate and lzf are read")
    if found.shape is None or found.dtype.kind not in "iuf":
        raise AssetError(f"{path} holds {found.dtype} values")
    if found.ndim != dimensions and not (found.ndim == 2 and 1 in found.shape and dimensions == 1):
        raise AssetError(f"{path} has shape {found.shape}, expected {dimensions} dimensions")
    # A chunk may be larger than the array: it is unpacked whole
    chunk = count(found.chunks or (0,)) * found.dtype.itemsize
    size = max(count(found.shape) * max(8, found.dtype.itemsize), chunk)
    if size > MAX_BYTES:
        raise AssetError(
            f"{path} of shape {found.shape} takes {size >> 20} MB; {MAX_BYTES >> 20} MB are accepted"
        )
    return found


def _values(dataset: h5py.Dataset) -> NDArray[Any]:
    stored = dataset.id.get_storage_size()
    if dataset.size and not stored:  # HDF5 would make up zeros
        raise AssetError(f"{dataset.name} holds no data")
    return dataset[()]


def _read(parent: h5py.Group, path: str, dimensions: int) -> NDArray[Any]:
    values = _values(_dataset(parent, path, dimensions))
    return values.ravel() if dimensions == 1 else values


def _number(parent: h5py.Group, path: str) -> float:
    """A number by itself, or in an array of one."""
    import h5py

    found = _member(parent, path)
    if not isinstance(found, h5py.Dataset) or found.dtype.kind not in "iuf" or found.size != 1:
        raise AssetError(f"{path} is not a number")
    return float(np.ravel(found[()])[0])


def _is_scaled(root: h5py.Group) -> bool:
    """Whether pcaBasis holds the square roots of the variances."""
    version = []
    for part in ("majorVersion", "minorVersion"):
        there = _member(root, f"version/{part}") is not None
        version.append(int(_number(root, f"version/{part}")) if there else None)
    if None not in version:
        return version == [0, 8]
    return _representer(root) in OLD_REPRESENTERS


def _representer(root: h5py.Group) -> str:
    """The name of the representer; it may come as bytes, as an array, with a NUL at its end."""
    group = _group(root, "representer")
    if group is None or "name" not in group.attrs:
        return ""
    name = np.ravel(np.asarray(group.attrs["name"]))[0]
    text = name.decode("latin-1") if isinstance(name, bytes) else str(name)
    return text.rstrip("\x00").rpartition("::")[2]


def _triangles(root: h5py.Group) -> NDArray[Any]:
    """(F, 3) as stored: columns of three, or rows in older files."""
    if _member(root, "representer/cells") is not None:
        return _read(root, "representer/cells", 2).T
    if _member(root, "representer/reference-mesh/triangle-list") is not None:
        return _read(root, "representer/reference-mesh/triangle-list", 2)
    raise AssetError("representer/cells is missing: the model has no triangles")


def _colours(file: h5py.Group) -> NDArray[Any] | None:
    group = _group(file, "color")
    if group is None or _group(group, "model") is None:
        return None
    return shaped("color/model/mean", _read(group, "model/mean", 1))


def _schemes(
    file: h5py.Group, root: h5py.Group, mean: NDArray[Any], known: bool
) -> dict[str, Scheme]:
    """Of the file's own landmarks: all ("basel") and those that mean a point of iBUG; else ours for Basel 2017."""
    named = _landmarks(file) or _landmarks(root)
    if named and {name for eye in CORNERS for name in eye} <= set(named):
        at = np.array(list(named.values()))
        vertices, away = nearest(finite("mean", mean), at)
        if not (away < FAR).all():
            odd = list(named)[int(np.argmax(away))]
            raise AssetError(f"landmark {odd:.40} is {away.max():.3g} from the nearest vertex")
        vertex = dict(zip(named, vertices.tolist(), strict=True))
        return {"ibug68": _as_ibug(vertex), "basel": _as_named(vertex)}
    return schemes_in(asset_path("schemes"), "bfm2017", N_BFM2017) if known else {}


def _landmarks(group: h5py.Group) -> dict[str, list[float]]:
    """Coordinates by name, of the JSON in metadata/landmarks/json."""
    import h5py

    where = "metadata/landmarks/json"
    found = _member(group, where)
    if found is None:
        return {}
    if not isinstance(found, h5py.Dataset) or found.external or found.is_virtual or not found.size:
        raise AssetError(f"{where} is not a text in the file")
    if found.size * found.dtype.itemsize > MAX_JSON:
        raise AssetError(f"{where} takes more than {MAX_JSON >> 20} MB")
    value = found[()]
    if isinstance(value, np.ndarray):  # of letters as numbers, or of one string
        value = value.tobytes() if value.dtype.kind in "iu" else np.ravel(value)[0]
    if not isinstance(value, str | bytes):
        raise AssetError(f"{where} is not a text")
    try:
        text = value.decode() if isinstance(value, bytes) else value
        items = json.loads(text.rstrip("\x00"))
        if not isinstance(items, list):
            raise TypeError
        named = {str(item["id"]): [float(x) for x in item["coordinates"]] for item in items}
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise AssetError(f"{where} is not a list of landmarks") from error
    if len(named) < len(items) or not all(
        len(at) == 3 and np.isfinite(at).all() for at in named.values()
    ):
        raise AssetError(f"{where}: each landmark has a name of its own and three coordinates")
    return named


def _as_ibug(vertex: dict[str, int]) -> Scheme:
    """The points of iBUG among Basel's names."""
    lines = text_of(asset_path("schemes/basel_names.csv")).splitlines()
    rows = [cells(line) for line in lines if not line.startswith("#")][1:]
    points = {number: vertex[name] for number, name, _ in rows if name in vertex}
    sides = ibug68_sides()
    return make_scheme(
        "ibug68", list(points), [sides[p] for p in points], list(points.values()), "landmarks"
    )


def _as_named(vertex: dict[str, int]) -> Scheme:
    """All landmarks of the file under their names."""
    names = tuple(vertex)
    side = {"right": "right", "left": "left"}
    right, left = (tuple(names.index(name) for name in eye) for eye in CORNERS)
    return Scheme(
        name="basel",
        points=names,
        vertices=np.array(list(vertex.values())),
        sides=tuple(side.get(name.partition(".")[0], "mid") for name in names),
        eyes=(right, left),
        eyes_meaning="mean of the outer and inner corner of each eye",
    )
