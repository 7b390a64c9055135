"""Readers: a file becomes a FaceModel, landmarks or a fit, chosen by what it holds, not by its name alone."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from ..arrays import Array
from ..errors import AssetError
from ..model import FaceModel
from .basel import read_basel
from .eos import is_eos, read_eos
from .files import asset_path
from .fits import load_fit, save_fit
from .flame import is_flame, read_flame
from .gnm import is_gnm, read_gnm
from .ict import is_ict, read_ict
from .install import installed
from .landmarks import LandmarkFile, load_landmarks, save_landmarks
from .matlab import is_matlab
from .npz import is_npz_model, read_npz, save_model
from .schemes import MEDIAPIPE, mediapipe_scheme
from .statismo import is_hdf5, read_statismo

__all__ = [
    "LandmarkFile",
    "asset_path",
    "eye_distances",
    "load_fit",
    "load_landmarks",
    "load_model",
    "save_fit",
    "save_landmarks",
    "save_model",
]

# Millimetres on the mean of an adult model: ibug68 points of each end, lowest, highest. Six public
# models lie within 87-93, 33-39 and 62-66; the ranges leave room for another population.
ADULT = (
    ("outer eye corners", ("37",), ("46",), 80.0, 100.0),
    ("inner eye corners", ("40",), ("43",), 28.0, 44.0),
    (
        "eye centres",
        ("37", "38", "39", "40", "41", "42"),
        ("43", "44", "45", "46", "47", "48"),
        56.0,
        72.0,
    ),
)

# Whether a file is of a kind, and what reads it; by content, the surest signs first
READERS: tuple[tuple[Callable[[Path], bool], Callable[[Path], FaceModel]], ...] = (
    (is_npz_model, read_npz),
    (is_gnm, read_gnm),
    (is_hdf5, read_statismo),
    (is_matlab, read_basel),
    (is_flame, read_flame),
    (is_eos, read_eos),
)


def load_model(
    path: str | os.PathLike[str] = "embedded",
    *,
    part: Literal["face", "head"] = "face",
    origin: Literal["eyes", "file"] = "eyes",
) -> FaceModel:
    """The model at `path`, in metres, +x the subject's left, +y up, +z out of the face.

    Parameters
    ----------
    path: "embedded", the head that comes with faceambig; "ict", the folder named by FACEAMBIG_ICT; "ict" and "gnm" as
        `faceambig models install` has put them; else a path: an ICT-FaceKit folder (or its FaceXModel), an .npz of
        faceambig, of GNM or of FLAME, a .pkl of FLAME, a .bin of eos, the .mat of Basel 2009, or an .h5 of Basel 2017
        and 2019, Statismo and Scalismo. What the file holds counts, not its name.
    part: "face", or "head" with the back of the head, where the file has both.
    origin: "eyes", the middle between the eyes of the mean (mean of their four corners), so that a distance means the
        same in every model; "file" keeps the file's own. `model.file_origin` says where the file's own lies.

    Raises
    ------
    AssetError: nothing readable there, a damaged file, or a face of impossible size (a wrong unit).
    ValueError: another `part` or `origin`.
    RuntimeError: an .h5, and h5py is not installed.
    """
    if part not in ("face", "head"):
        raise ValueError(f"part: {part!r} is not face or head")
    if origin not in ("eyes", "file"):
        raise ValueError(f"origin: {origin!r} is not eyes or file")
    model = _with_mediapipe(_read(_located(path), part))
    _check_size(model)
    shift = model.file_origin if origin == "file" else _between_the_eyes(model)
    return _moved(model, shift)


def _located(path: str | os.PathLike[str]) -> Path:
    if path == "embedded":
        return asset_path("head.npz")
    if path == "ict" and os.environ.get("FACEAMBIG_ICT"):
        return Path(os.environ["FACEAMBIG_ICT"])
    if path in ("ict", "gnm"):
        file = installed(str(path))
        if file is None:
            named = (
                ": set FACEAMBIG_ICT to the folder that holds FaceXModel/, or"
                if path == "ict"
                else ":"
            )
            raise AssetError(f"{path}{named} run faceambig models install {path}")
        return file
    return Path(path)


def _read(path: Path, part: str) -> FaceModel:
    if not path.exists():
        raise AssetError(
            f"{path}: no such file or folder; a path, embedded, ict or gnm is accepted"
        )
    if is_ict(path):
        return read_ict(path, part=part)
    if path.is_file():
        try:
            reader = next((read for known, read in READERS if known(path)), None)
        except OSError as error:
            raise AssetError(f"{path}: cannot be read ({error.strerror or error})") from error
        if reader is not None:
            return reader(path)
    if path.name.endswith(".h5.json"):
        raise AssetError(f"{path.name}: Scalismo's JSON is not read; save the model as .h5")
    raise AssetError(
        f"{path}: not a model; an ICT-FaceKit folder (with FaceXModel/), or a file of faceambig, Basel, Statismo, eos, "
        "FLAME or GNM is accepted"
    )


def _with_mediapipe(model: FaceModel) -> FaceModel:
    """`model` with the scheme of MediaPipe's mesh, if it has the points of iBUG and not yet that scheme."""
    if "ibug68" not in model.schemes or MEDIAPIPE in model.schemes:
        return model
    scheme = mediapipe_scheme(model.schemes["ibug68"])
    return model if scheme is None else replace(model, schemes={**model.schemes, MEDIAPIPE: scheme})


def eye_distances(model: FaceModel) -> list[tuple[str, float, float, float]]:
    """What is measured on the mean, in mm, and the least and most an adult has; none without points of iBUG.

    A range whose points the model lacks is left out.

    Raises
    ------
    AssetError: the corners of the eyes are not all among the points.
    """
    if "ibug68" not in model.schemes:
        return []
    points = set(model.schemes["ibug68"].points)
    found = []
    for what, right, left, low, high in ADULT:
        if len(right) > 1 and not {*right, *left} <= points:  # the lids are not in every list
            continue
        gap = _centre(model, left) - _centre(model, right)
        found.append((what, 1000.0 * float(np.linalg.norm(gap)), low, high))
    return found


def _check_size(model: FaceModel) -> None:
    """Refuse a mean face in the wrong unit. Never rescaled silently: absolute size is information."""
    for what, mm, low, high in eye_distances(model):
        if not low <= mm <= high:
            fits = next((k for k in range(-6, 7) if low <= mm * 10.0**k <= high), None)
            hint = "" if fits is None else f"; times {10.0**fits:g} it would fit: a wrong unit?"
            raise AssetError(
                f"{model.name}: {what} of the mean are {mm:.4g} mm apart, an adult's {low:g} to {high:g}{hint}"
            )


def _centre(model: FaceModel, names: tuple[str, ...]) -> Array:
    scheme = model.schemes["ibug68"]
    if missing := set(names) - set(scheme.points):
        raise AssetError(f"{model.name}: scheme ibug68 has no point {min(missing)}")
    rows = [scheme.points.index(name) for name in names]
    return model.mean[scheme.vertices[rows]].mean(axis=0)


def _between_the_eyes(model: FaceModel) -> Array:
    scheme = model.schemes.get("ibug68") or next(iter(model.schemes.values()), None)
    if scheme is None:
        raise AssetError(
            f"{model.name}: names no eyes to put the origin between; use origin='file'"
        )
    right, left = (model.mean[scheme.vertices[list(rows)]].mean(axis=0) for rows in scheme.eyes)
    return 0.5 * (right + left)


def _moved(model: FaceModel, origin: Array) -> FaceModel:
    """`model` with its coordinates counted from `origin` (3,), metres."""
    if not origin.any():
        return model
    return replace(
        model,
        control_mean=model.control_mean - origin,
        subjects=tuple(replace(s, vertices=s.vertices - origin) for s in model.subjects),
        file_origin=model.file_origin - origin,
    )
