"""Our own format: a zip of plain arrays (.npz, no pickle). The embedded head, saved models and the cache are in it.

Letters: S modes, B control vertices, N surface vertices, F triangles, P subjects; N = B without a subdivision.

==========================  ============================  ==================================================
format, version, name,      text, int                     "faceambig-model", 1
licence, source, unit
mean                        (B, 3)                        integers: micrometres; floats: metres
modes, mode_step            (S, B, 3), (S,)               metres per standard deviation = modes * mode_step;
                                                          mode_step may be missing if modes are floats
faces, coarse_faces         (F, 3) over N, (Fc, 3) over B triangles, wound outward
subdivision_indptr,         (N + 1,), (nnz,), (nnz,)      rows of the operator (N, B), each of sum 1
_indices, _data
colours, occlusion          (B or N, 3), (N,)             sRGB, ambient occlusion with 255 open; bytes
evaluation                  (N,)                          not 0: d_S is measured there
regions, region_names       (N,), (G,)                    255: in no region
subjects, subject_step      (P, B or N, 3), ()            displacement from the mean: steps, floats are metres
subject_names, _notes,      (P,), (P,), (P, B or N, 3)
_colours
file_origin                 (3,)                          metres, as FaceModel.file_origin
scheme<k>_name, _points,    (), (L,), (L,), (L,)          landmark schemes, k = 0, 1, ...
_sides, _vertices,
_right_eye, _left_eye,      (E,), (E,), ()                rows of the scheme; words
_eyes_meaning
==========================  ============================  ==================================================

A file may also have schemes beside it: `schemes/<name of the model>_<scheme>.csv`. Other keys are not read.

Nothing is inflated before the zip directory and each array's header agree on a size (zipped.py), and all shapes with
each other.
"""

from __future__ import annotations

import os
import re
import zipfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..arrays import Array, IntArray
from ..errors import AssetError
from ..model import FaceModel, Scheme, Subject
from .files import MAX_BYTES, damage_named, replacing
from .schemes import schemes_in
from .zipped import Member, array, count, headers, names_in

FORMAT, VERSION = "faceambig-model", 1
MAX_SCHEMES = 50
NO_REGION = 255
MICROMETRE = 1e-6

# Kinds of number allowed (i, u integers, f floats, b bool, U text) and the shape, by the letters above.
MEMBERS: dict[str, tuple[str, tuple[str | int, ...]]] = {
    "format": ("U", ()),
    "version": ("iu", ()),
    "name": ("U", ()),
    "licence": ("U", ()),
    "source": ("U", ()),
    "unit": ("U", ()),
    "mean": ("if", ("B", 3)),
    "modes": ("if", ("S", "B", 3)),
    "mode_step": ("f", ("S",)),
    "faces": ("iu", ("F", 3)),
    "coarse_faces": ("iu", ("Fc", 3)),
    "subdivision_indptr": ("iu", ("N+1",)),
    "subdivision_indices": ("iu", ("nnz",)),
    "subdivision_data": ("f", ("nnz",)),
    "colours": ("u", ("B or N", 3)),
    "occlusion": ("u", ("N",)),
    "evaluation": ("iub", ("N",)),
    "regions": ("u", ("N",)),
    "region_names": ("U", ("G",)),
    "subjects": ("if", ("P", "B or N", 3)),
    "subject_step": ("f", ()),
    "subject_names": ("U", ("P",)),
    "subject_notes": ("U", ("P",)),
    "subject_colours": ("u", ("P", "B or N", 3)),
    "file_origin": ("f", (3,)),
}
SCHEME_MEMBERS: dict[str, tuple[str, tuple[str | int, ...]]] = {
    "name": ("U", ()),
    "points": ("U", ("L",)),
    "sides": ("U", ("L",)),
    "vertices": ("iu", ("L",)),
    "right_eye": ("iu", ("Er",)),
    "left_eye": ("iu", ("El",)),
    "eyes_meaning": ("U", ()),
}
REQUIRED = ("format", "version", "name", "mean", "modes", "faces")
KNOWN = {*MEMBERS, *(f"scheme{k}_{name}" for k in range(MAX_SCHEMES) for name in SCHEME_MEMBERS)}


def is_npz_model(path: Path) -> bool:
    """Whether `path` is a zip with the arrays of a model; damage inside is for `read_npz` to name."""
    return {"format", "mean", "modes"} <= names_in(path)


def read_npz(path: Path) -> FaceModel:
    """The model of an .npz file at the origin it was stored with; AssetError, one line, if it is damaged."""
    with damage_named(path), zipfile.ZipFile(path) as archive:
        members = headers(archive, KNOWN, REQUIRED)
        sizes = _agreed_sizes(members)
        arrays = {name: array(archive, member) for name, member in members.items()}
        return _built(arrays, sizes, path)


def save_model(model: FaceModel, path: str | os.PathLike[str]) -> None:
    """Write `model` as an .npz that `load_model` reads: float64, not compressed, replacing `path` in one step.

    Mean, modes and operator come back bit by bit; subjects to rounding, because they are stored relative to the mean.

    Raises
    ------
    ValueError: a vertex is in two regions, which the format cannot hold.
    """
    arrays = _stored(model)
    with replacing(path) as whole, whole.open("wb") as stream:
        np.savez(stream, **arrays)


def _agreed_sizes(members: Mapping[str, Member]) -> dict[str, int]:
    """The size behind each letter; AssetError where two arrays differ, or a kind of number is wrong."""
    sizes: dict[str, int] = {}
    for name, (kinds, letters) in MEMBERS.items():
        if name in members:
            _agree(members[name], kinds, letters, sizes)
        if name == "mean":
            indptr = members.get("subdivision_indptr")
            sizes["N"] = sizes["B"] if indptr is None else count(indptr.shape) - 1
            sizes["N+1"] = sizes["N"] + 1
    for k in range(MAX_SCHEMES):
        of_scheme: dict[str, int] = {}
        for name, (kinds, letters) in SCHEME_MEMBERS.items():
            if f"scheme{k}_name" in members:
                if f"scheme{k}_{name}" not in members:
                    raise AssetError(f"scheme{k}_{name} is missing")
                _agree(members[f"scheme{k}_{name}"], kinds, letters, of_scheme)
    parts = [f"subdivision_{part}" in members for part in ("indptr", "indices", "data")]
    if any(parts) and not all(parts):
        raise AssetError("subdivision_indptr, _indices and _data belong together")
    surfaces = sizes["N"] * (1 + sizes.get("P", 0)) * 24
    if surfaces > MAX_BYTES:
        raise AssetError(
            f"surfaces of {sizes['N']} vertices take {surfaces >> 20} MB; {MAX_BYTES >> 20} MB are accepted"
        )
    return sizes


def _agree(
    member: Member, kinds: str, letters: tuple[str | int, ...], sizes: dict[str, int]
) -> None:
    wanted = ", ".join(str(sizes.get(str(x), x)) for x in letters)
    wrong = AssetError(f"{member.name} has shape {member.shape}, expected ({wanted})")
    if member.dtype.kind not in kinds:
        raise AssetError(f"{member.name} holds {member.dtype} numbers")
    if len(member.shape) != len(letters) or 0 in member.shape:
        raise wrong
    for n, letter in zip(member.shape, letters, strict=True):
        if letter == "B or N":
            agrees = n in (sizes["B"], sizes["N"])
        elif isinstance(letter, int):
            agrees = n == letter
        else:
            agrees = sizes.setdefault(letter, n) == n
        if not agrees:
            raise wrong


def _built(arrays: Mapping[str, NDArray[Any]], sizes: Mapping[str, int], path: Path) -> FaceModel:
    if str(arrays["format"]) != FORMAT or int(arrays["version"]) != VERSION:
        raise AssetError(
            f"format {arrays['format']!s:.30} {arrays['version']}; {FORMAT} {VERSION} is read"
        )
    n, b = sizes["N"], sizes["B"]
    operator = _operator(arrays, n, b)
    coarse = arrays.get("coarse_faces")
    model = FaceModel(
        name=str(arrays["name"]),
        control_mean=_metres(arrays, "mean"),
        control_modes=_modes(arrays),
        faces=_faces("faces", arrays["faces"], n),
        schemes=_stored_schemes(arrays, n) | _schemes_beside(path, str(arrays["name"]), n),
        subdivision=operator,
        coarse_faces=None if coarse is None else _faces("coarse_faces", coarse, b),
        colours=_surface_colours(arrays.get("colours"), n, operator),
        occlusion=_bytes(arrays.get("occlusion")),
        evaluation=_evaluation(arrays.get("evaluation")),
        regions=_regions(arrays),
        licence=str(arrays.get("licence", "")),
        source=str(arrays.get("source", "")),
        unit=str(arrays.get("unit", "")),
        file_origin=_finite("file_origin", arrays.get("file_origin", np.zeros(3))),
    )
    return replace(model, subjects=_subjects(arrays, model)) if "subjects" in arrays else model


def _finite(name: str, array: NDArray[Any]) -> Array:
    values = np.ascontiguousarray(array, dtype=np.float64)
    if not np.isfinite(values).all():
        raise AssetError(f"{name} holds a value that is not finite")
    return values


def _metres(arrays: Mapping[str, NDArray[Any]], name: str) -> Array:
    array = arrays[name]
    return _finite(name, array * MICROMETRE if array.dtype.kind == "i" else array)


def _modes(arrays: Mapping[str, NDArray[Any]]) -> Array:
    """(B, 3, S), one standard deviation each, contiguous: `rows` takes vertices, a face is one product."""
    stored = arrays["modes"].transpose(1, 2, 0)
    if "mode_step" in arrays:
        return _finite(
            "modes", np.multiply(stored, arrays["mode_step"], order="C", dtype=np.float64)
        )
    if stored.dtype.kind == "i":
        raise AssetError("modes are integers, but mode_step is missing")
    return _finite("modes", stored)


def _indices(name: str, array: NDArray[Any], end: int) -> NDArray[Any]:
    low, high = int(array.min()), int(array.max())
    if low < 0 or high >= end:
        raise AssetError(f"{name}: {low if low < 0 else high} is not within 0 to {end - 1}")
    return array


def _faces(name: str, array: NDArray[Any], n_vertices: int) -> NDArray[np.uint32]:
    return np.ascontiguousarray(_indices(name, array, n_vertices), dtype=np.uint32)


def _operator(arrays: Mapping[str, NDArray[Any]], n: int, b: int) -> sparse.csr_array | None:
    if "subdivision_indptr" not in arrays:
        return None
    indptr = arrays["subdivision_indptr"].astype(np.int64)
    indices = _indices("subdivision_indices", arrays["subdivision_indices"], b)
    data = _finite("subdivision_data", arrays["subdivision_data"])
    if indptr[0] != 0 or indptr[-1] != len(data) or (np.diff(indptr) < 1).any():
        raise AssetError("subdivision_indptr does not grow from 0 to the number of weights")
    off = float(np.abs(np.add.reduceat(data, indptr[:-1]) - 1).max())
    if off > 1e-6:  # else a shift of the head would bend it; float32 weights are 1e-7 off
        raise AssetError(f"subdivision: a row of weights sums to 1 only within {off:.2g}")
    return sparse.csr_array((data, indices.astype(np.int32), indptr.astype(np.int32)), shape=(n, b))


def _bytes(array: NDArray[Any] | None) -> NDArray[np.uint8] | None:
    return None if array is None else np.ascontiguousarray(array, dtype=np.uint8)


def _surface_colours(
    array: NDArray[Any] | None, n: int, operator: sparse.csr_array | None
) -> NDArray[np.uint8] | None:
    if array is None or len(array) == n or operator is None:
        return _bytes(array)
    return np.rint((operator @ array.astype(np.float64)).clip(0, 255)).astype(np.uint8)


def _evaluation(array: NDArray[Any] | None) -> IntArray | None:
    if array is None:
        return None
    vertices = np.flatnonzero(array)
    if len(vertices) < 3:
        raise AssetError(f"evaluation: {len(vertices)} vertices; a surface difference needs 3")
    return vertices


def _regions(arrays: Mapping[str, NDArray[Any]]) -> dict[str, IntArray]:
    if "regions" not in arrays:
        return {}
    labels, names = arrays["regions"], arrays.get("region_names", np.array([], dtype="U1"))
    named = labels[labels != NO_REGION]
    if named.size:
        _indices("regions", named, len(names))
    return {str(name): np.flatnonzero(labels == k) for k, name in enumerate(names)}


def _subjects(arrays: Mapping[str, NDArray[Any]], model: FaceModel) -> tuple[Subject, ...]:
    stored = arrays["subjects"]
    if stored.dtype.kind == "i" and "subject_step" not in arrays:
        raise AssetError("subjects are integers, but subject_step is missing")
    step = float(arrays["subject_step"]) if stored.dtype.kind == "i" else 1.0
    away = _finite("subjects", stored * step)
    names = arrays.get("subject_names", [f"Person {k}" for k in range(1, len(stored) + 1)])
    notes = arrays.get("subject_notes", [""] * len(stored))
    colours = arrays.get("subject_colours", [None] * len(stored))
    refined = (d if len(d) == model.n_vertices else model.refine(d) for d in away)
    return tuple(
        Subject(
            name=str(name),
            about=str(about),
            vertices=model.mean + displacement,
            colours=_surface_colours(colour, model.n_vertices, model.subdivision),
            model=model,
        )
        for name, about, displacement, colour in zip(names, notes, refined, colours, strict=True)
    )


def _schemes_beside(path: Path, model: str, n_vertices: int) -> dict[str, Scheme]:
    # The name comes from the file: it must not lead out of the folder
    if not re.fullmatch(r"[\w-]{1,40}", model):
        return {}
    return schemes_in(path.parent / "schemes", model, n_vertices)


def _stored_schemes(arrays: Mapping[str, NDArray[Any]], n_vertices: int) -> dict[str, Scheme]:
    schemes: dict[str, Scheme] = {}
    for k in range(MAX_SCHEMES):
        if f"scheme{k}_name" not in arrays:
            break
        part = {name: arrays[f"scheme{k}_{name}"] for name in SCHEME_MEMBERS}
        points = tuple(str(point) for point in part["points"])
        right, left = (
            _indices(f"scheme{k}_{eye}", part[eye], len(points))
            for eye in ("right_eye", "left_eye")
        )
        name = str(part["name"])
        schemes[name] = Scheme(
            name=name,
            points=points,
            vertices=_indices(f"scheme{k}_vertices", part["vertices"], n_vertices).astype(np.intp),
            sides=tuple(str(side) for side in part["sides"]),
            eyes=(tuple(right.tolist()), tuple(left.tolist())),
            eyes_meaning=str(part["eyes_meaning"]),
        )
    return schemes


def _stored(model: FaceModel) -> dict[str, Any]:
    arrays: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "name": model.name,
        "licence": model.licence,
        "source": model.source,
        "unit": model.unit,
        "mean": model.control_mean,
        "modes": np.ascontiguousarray(model.control_modes.transpose(2, 0, 1)),
        "faces": model.faces,
        "coarse_faces": model.coarse_faces,
        "colours": model.colours,
        "occlusion": model.occlusion,
        "file_origin": model.file_origin,
    }
    if model.subdivision is not None:
        for part in ("indptr", "indices", "data"):
            arrays[f"subdivision_{part}"] = getattr(model.subdivision, part)
    if model.evaluation is not None:
        arrays["evaluation"] = np.isin(np.arange(model.n_vertices), model.evaluation)
    if model.regions:
        arrays["regions"] = _labels(model)
        arrays["region_names"] = list(model.regions)
    if model.subjects:
        arrays["subjects"] = np.stack([s.vertices - model.mean for s in model.subjects])
        arrays["subject_names"] = [s.name for s in model.subjects]
        arrays["subject_notes"] = [s.about for s in model.subjects]
        colours = [s.colours for s in model.subjects if s.colours is not None]
        arrays["subject_colours"] = (
            np.stack(colours) if len(colours) == len(model.subjects) else None
        )
    for k, scheme in enumerate(model.schemes.values()):
        arrays |= {
            f"scheme{k}_name": scheme.name,
            f"scheme{k}_points": list(scheme.points),
            f"scheme{k}_sides": list(scheme.sides),
            f"scheme{k}_vertices": scheme.vertices,
            f"scheme{k}_right_eye": scheme.eyes[0],
            f"scheme{k}_left_eye": scheme.eyes[1],
            f"scheme{k}_eyes_meaning": scheme.eyes_meaning,
        }
    return {name: np.asarray(value) for name, value in arrays.items() if value is not None}


def _labels(model: FaceModel) -> NDArray[np.uint8]:
    labels = np.full(model.n_vertices, NO_REGION, dtype=np.uint8)
    for k, (name, vertices) in enumerate(model.regions.items()):
        if (labels[vertices] != NO_REGION).any():
            raise ValueError(
                f"regions: {name!r} shares a vertex with another; the format holds one a vertex"
            )
        labels[vertices] = k
    return labels
