"""Small files of other models' formats, written as docs/models.md describes them, with made-up numbers.

The mean is an egg with the eye corners of an adult; vertex numbers of landmarks come from our scheme files, so that a
file of full size has eyes where the reader looks for them.
"""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io

import faceambig.io as fio
from faceambig.errors import AssetError
from faceambig.io.files import asset_path
from faceambig.io.schemes import load_scheme

# x, y and z of points 37 to 48 of iBUG, millimetres from the middle between the eyes: corners and lids
EYE_X = (-45.0, -37.0, -26.0, -18.0, -26.0, -37.0, 18.0, 26.0, 37.0, 45.0, 37.0, 26.0)
EYES = {str(37 + k): (x, 0.0, 0.0) for k, x in enumerate(EYE_X)}
HEAD_AT = np.array([3.0, -40.0, -90.0])  # of the middle between the eyes, mm from the file's origin


@dataclass(frozen=True)
class Drawn:
    """A made-up model, millimetres. N vertices, S modes."""

    mean: np.ndarray  # (N, 3)
    basis: np.ndarray  # (3N, S) orthonormal columns, x y z interleaved
    sds: np.ndarray  # (S,) millimetres of the whole vector
    faces: np.ndarray  # (F, 3) wound outward
    colours: np.ndarray  # (N, 3) 0 to 1

    @property
    def modes(self) -> np.ndarray:
        """(N, 3, S) millimetres per standard deviation."""
        return (self.basis * self.sds).reshape(len(self.mean), 3, -1)


def drawn(n: int = 42, s: int = 3, eyes: Mapping[str, int] | None = None) -> Drawn:
    """A closed, outward surface over the first vertices, others scattered on it; `eyes`: vertices of points of iBUG."""
    rng = np.random.default_rng(11)
    around, rings = 8, 5
    polar = np.linspace(0, np.pi, rings + 1)[1:-1]
    turn = np.linspace(0, 2 * np.pi, around, endpoint=False)
    grid = [(np.sin(p) * np.cos(t), np.sin(p) * np.sin(t), np.cos(p)) for p in polar for t in turn]
    ball = np.array([(0, 0, 1.0), *grid, (0, 0, -1.0)])
    last = len(ball) - 1
    faces = []
    for k in range(around):
        here, beside = 1 + k, 1 + (k + 1) % around
        faces.append((0, here, beside))
        for ring in range(rings - 2):
            a, b = here + ring * around, beside + ring * around
            faces += [(a, a + around, b), (b, a + around, b + around)]
        faces.append((last, beside + (rings - 2) * around, here + (rings - 2) * around))
    mean = rng.normal(size=(n, 3))
    mean /= np.linalg.norm(mean, axis=1, keepdims=True)
    mean[: len(ball)] = ball[:n]
    mean = mean * (80.0, 110.0, 90.0) + HEAD_AT
    for point, vertex in (eyes or {}).items():
        mean[vertex] = HEAD_AT + EYES.get(point, (0.0, -60.0, 5.0))
    basis, _ = np.linalg.qr(rng.normal(size=(3 * n, s)))
    sds = 20.0 * np.sqrt(n) * 0.7 ** np.arange(s)
    return Drawn(mean, basis, sds, np.array(faces), rng.uniform(0, 1, (n, 3)))


def eyes_of(scheme: str) -> dict[str, int]:
    """Vertices of the eye points in one of our scheme files."""
    read = load_scheme(asset_path(f"schemes/{scheme}.csv"), "ibug68")
    return {
        point: int(v) for point, v in zip(read.points, read.vertices, strict=True) if point in EYES
    }


# eos


def eos_matrix(values: np.ndarray) -> bytes:
    values = np.atleast_2d(values)
    return struct.pack("<ii", *values.shape) + values.astype("<f4").tobytes(order="F")


def eos_list(rows: np.ndarray, dtype: str) -> bytes:
    return struct.pack("<Q", len(rows)) + rows.astype(dtype).tobytes()


def eos_text(text: str) -> bytes:
    return struct.pack("<Q", len(text)) + text.encode()


def write_eos(
    path: Path, model: Drawn, version: int = 1, *, colours: bool = False,
    expressions: str = "none", landmarks: Mapping[str, int] | None = None,
) -> Path:  # fmt: skip
    """An eos file; expressions: none, pca or blendshapes."""
    n = len(model.mean)
    shape = [
        eos_matrix(model.mean.reshape(-1, 1)),
        eos_matrix(model.basis),
        eos_matrix(model.sds[:, None] ** 2),
    ]
    triangles = eos_list(model.faces, "<i4")
    nothing = [
        eos_matrix(np.zeros((0, 1))),
        struct.pack("<ii", 0, 0),
        eos_matrix(np.zeros((0, 1))),
        struct.pack("<Q", 0),
    ]
    parts = [struct.pack("<I", version), *shape, triangles]
    parts += (
        [eos_matrix(model.colours.reshape(-1, 1)), *shape[1:], triangles] if colours else nothing
    )
    if version >= 2:
        blend = struct.pack("<Q", 2) + b"".join(
            eos_text(t) + eos_matrix(np.zeros((3 * n, 1))) for t in ("smile", "o")
        )
        kinds = {"none": b"\x01", "pca": b"\x00" + struct.pack("<i", 0) + b"".join([*shape, triangles]),
                 "blendshapes": b"\x00" + struct.pack("<i", 1) + blend}  # fmt: skip
        parts.append(kinds[expressions])
    if version >= 3:
        rows = b"".join(
            eos_text(name) + struct.pack("<i", v) for name, v in (landmarks or {}).items()
        )
        parts.append(
            b"\x01" if landmarks is None else b"\x00" + struct.pack("<Q", len(landmarks)) + rows
        )
    parts.append(eos_list(np.zeros((n, 2)), "<f8"))
    if version >= 4:
        parts.append(triangles)
    path.write_bytes(b"".join(parts))
    return path


# Basel 2009


def write_basel(path: Path, model: Drawn, *, compressed: bool = False, **changes: Any) -> Path:
    """A `.mat` in micrometres, triangles from 1 and inward; changes: variables instead, None leaves one out."""
    arrays: dict[str, Any] = {
        "shapeMU": (1e3 * model.mean).reshape(-1, 1).astype(np.float32),
        "shapePC": model.basis.astype(np.float32),
        "shapeEV": (1e3 * model.sds)[:, None].astype(np.float32),
        "texMU": (255 * model.colours).reshape(-1, 1).astype(np.float32),
        "texPC": model.basis.astype(np.float32),
        "tl": model.faces[:, ::-1] + 1.0,
        "segbin": np.eye(4, dtype=np.uint8),
    }
    stored = {name: value for name, value in (arrays | changes).items() if value is not None}
    scipy.io.savemat(path, stored, do_compression=compressed)
    return path


def write_farkas(path: Path, model: Drawn, points: Mapping[str, int], off_mm: float = 0.0) -> Path:
    """The points of Farkas in the layout of Basel's `.fp` files, micrometres."""
    rows = [
        "{} {:.3f} {:.3f} {:.3f} 0.5 0.5 {}".format(
            v, *(1e3 * (model.mean[v] + off_mm)).tolist(), name
        )
        for name, v in points.items()
    ]
    path.parent.mkdir(parents=True, exist_ok=True)
    header = [
        "File of points",
        f"Points {len(rows)} all",
        "Format: (vertex_nr) (x y z) (x y) (name)",
    ]
    path.write_text("\n".join([*header, *rows]) + "\n")
    return path


# Statismo and Scalismo


def write_statismo(
    path: Path, model: Drawn, *, root: str = "shape", version: tuple[int, int] | None = (0, 9),
    representer: str = "gravis::MeshShapeRepresenter", legacy: bool = False, colours: bool = True,
    expression: np.ndarray | None = None, landmarks: Mapping[str, np.ndarray] | None = None, factor: float = 1.0,
    change: Callable[[Any], None] | None = None,
) -> Path:  # fmt: skip
    """An `.h5`, lengths times `factor`; legacy: points in rows, square roots of the variances in the basis."""
    import h5py

    with h5py.File(path, "w") as file:

        def part(name: str, mean: np.ndarray, basis: np.ndarray, variance: np.ndarray) -> Any:
            group = file.require_group(name) if name else file
            group["model/mean"] = mean.ravel().astype(np.float32)
            group["model/pcaBasis"] = basis.astype(np.float32)
            group["model/pcaVariance"] = variance.astype(np.float32)
            group["model/noiseVariance"] = np.zeros(1, np.float32)
            return group

        basis = model.basis * model.sds if legacy else model.basis
        shape = part(root, factor * model.mean, basis, (factor * model.sds) ** 2)
        if version is not None:
            shape["version/majorVersion"], shape["version/minorVersion"] = (
                version[0],
                np.array([version[1]]),
            )
        mesh = shape.require_group("representer")
        mesh.attrs["name"] = np.array([representer.encode() + b"\x00"])  # as older files have it
        mesh.attrs["datasetType"] = "POLYGON_MESH"
        if legacy:
            mesh["reference-mesh/vertex-coordinates"] = (factor * model.mean).astype(np.float32)
            mesh["reference-mesh/triangle-list"] = model.faces.astype(np.int32)
        else:
            mesh["points"] = (factor * model.mean).T.astype(np.float32)
            mesh["cells"] = model.faces.T.astype(np.int32)
        if colours:
            part("color", model.colours, model.basis, np.ones(model.basis.shape[1]))
        if expression is not None:
            part("expression", expression, model.basis, np.ones(model.basis.shape[1]))
        if landmarks is not None:
            items = [
                {"id": k, "coordinates": (factor * at).tolist()} for k, at in landmarks.items()
            ]
            file["metadata/landmarks/json"] = np.frombuffer(json.dumps(items).encode(), np.int8)
        if change is not None:
            change(file)
    return path


# FLAME


class Ch:
    """Stands for chumpy's array while a pickle is written: the class is written as chumpy.ch.Ch."""

    def __init__(self, x: np.ndarray) -> None:
        self.x, self._dirty_vars, self._itr = x, {"x"}, None


class Csc:
    """Stands for a matrix of SciPy: written as scipy.sparse.csc.csc_matrix."""

    def __init__(self, n: int) -> None:
        self.data, self.indices, self.indptr, self._shape = (
            np.ones(5),
            np.arange(5),
            np.arange(n + 1) % 6,
            (5, n),
        )


Ch.__module__, Csc.__module__, Csc.__qualname__ = "chumpy.ch", "scipy.sparse.csc", "csc_matrix"
Csc.__name__ = "csc_matrix"


def pickled(value: Any, protocol: int) -> bytes:
    """The pickle of a value with the two classes above, which no import would find."""
    import sys
    from pickle import Pickler  # noqa: TID251 - written here, read by our own reader
    from types import ModuleType

    stands = {"chumpy": {}, "chumpy.ch": {"Ch": Ch}, "scipy.sparse.csc": {"csc_matrix": Csc}}
    before = {name: sys.modules.get(name) for name in stands}
    try:
        for name, members in stands.items():
            sys.modules[name] = ModuleType(name)
            vars(sys.modules[name]).update(members)
        stream = io.BytesIO()
        Pickler(stream, protocol, fix_imports=True).dump(value)
        return stream.getvalue()
    finally:
        for name, module in before.items():
            if module is None:
                del sys.modules[name]
            else:
                sys.modules[name] = module


def flame_arrays(model: Drawn, expressions: int = 0) -> dict[str, Any]:
    """The arrays of FLAME, metres; `expressions` more modes behind those of identity."""
    n = len(model.mean)
    behind = np.full((n, 3, expressions), 9.0)
    return {
        "v_template": 1e-3 * model.mean,
        "shapedirs": np.concatenate([1e-3 * model.modes, behind], axis=2),
        "f": model.faces.astype(np.uint32),
    }


def write_flame(path: Path, model: Drawn, protocol: int = 2, expressions: int = 0) -> Path:
    """A `generic_model.pkl` with chumpy's arrays, a sparse matrix and plain values, or an `.npz`."""
    arrays = flame_arrays(model, expressions)
    if path.suffix == ".npz":
        np.savez(path, **arrays, weights=np.zeros((3, 5)))
        return path
    content: dict[str, Any] = {
        **arrays,
        "v_template": Ch(arrays["v_template"]),
        "shapedirs": Ch(np.asfortranarray(arrays["shapedirs"])),
        "J_regressor": Csc(len(model.mean)),
        "kintree_table": np.array([[2**32 - 1, 0], [0, 1]], dtype=np.uint32),
        "bs_style": "lbs",
        "bs_type": "lrotmin",
        "numbers": [1, -2, 2**40, 1.5, None, True, False, (), (1,), (1, 2, 3, 4)],
    }
    path.write_bytes(pickled(content, protocol))
    return path


# GNM


def gnm_arrays(model: Drawn) -> dict[str, Any]:
    """The arrays of GNM, metres: all modes of the head, and one more each of eyes and teeth."""
    n, s = len(model.mean), len(model.sds)
    other = np.ones((1, n, 3))
    names = ["eyes_0", *(f"head_{k}" for k in range(s)), "teeth_0"]
    groups = np.zeros((2, n), dtype=np.float32)
    groups[0, : n // 2], groups[1, n // 2 :] = 1, 1
    return {
        "template_vertex_positions": (1e-3 * model.mean).astype(np.float32),
        "vertex_identity_basis": np.concatenate(
            [other, 1e-3 * model.modes.transpose(2, 0, 1), other]
        ).astype(np.float32),
        "identity_names": np.array(names),
        "triangles": model.faces.astype(np.int32),
        "vertex_groups": groups,
        "vertex_group_names": np.array(["skin", "teeth"]),
        "version": np.array("3.0"),
    }


def gnm_head() -> Drawn:
    """A head with a vertex for each of the 68 points: the jaw an arc from ear to ear, the eyes an adult's."""
    model = drawn(120, 3)
    turn = np.linspace(-1.5, 1.5, 17)
    model.mean[42:59] = (
        np.column_stack([70 * np.sin(turn), -20 - 90 * np.cos(turn), -20 * turn**2]) + HEAD_AT
    )
    model.mean[78:90] = np.column_stack([EYE_X, np.zeros(12), np.zeros(12)]) + HEAD_AT
    return model


def gnm_rows(order: Iterable[int] = range(68)) -> np.ndarray:
    """Each point at one vertex, 42 and on; `order`: which point each line is."""
    table = np.zeros((68, 6))
    table[:, 0] = 42 + np.array(list(order))
    table[:, 1] = 1.0
    return table


def write_gnm(path: Path, model: Drawn, rows: np.ndarray | None = None) -> Path:
    """A `gnm_head.npz`, with `rows` (68, 6) as `head_sparse_68.txt` beside it."""
    np.savez(path, **gnm_arrays(model))
    if rows is not None:
        lines = [" ".join(f"{x:.9g}" for x in row) for row in rows]
        (path.parent / "head_sparse_68.txt").write_text("\n".join(lines) + "\n")
    return path


# Damage


def damages(size: int) -> Any:
    """A strategy: up to five bytes of a file changed, or its end cut off; always something of either."""
    from hypothesis import strategies as st

    change = st.tuples(st.integers(0, size - 1), st.integers(0, 255))
    return st.tuples(st.lists(change, min_size=1, max_size=5), st.none() | st.integers(0, size - 1))


def read_damaged(path: Path, data: bytes, damage: tuple[list[tuple[int, int]], int | None]) -> None:
    """Load the damaged `data`: an error of one line that names the file, or a model of finite numbers; nothing else."""
    changed = bytearray(data)
    for at, value in damage[0]:
        changed[at % len(data)] = value
    path.write_bytes(bytes(changed[: damage[1]]))
    said = ""
    try:
        model = fio.load_model(path, origin="file")
    except AssetError as error:
        said = str(error)
    else:
        assert np.isfinite(model.mean).all()
        assert np.isfinite(model.control_modes).all()
    assert "\n" not in said
    assert not said or path.name in said
