"""Saved fits: what a fit was made of and what it found, as JSON, so that it can be gone on from without fitting again.

    {"format": "faceambig fit", "format_version": 1, ..., "saved": {model, observation, options, camera, alpha, ...}}

What stands beside `saved` is for people and other programs and is not read. Numbers are written with all their digits:
a fit that is read is the fit that was saved, to the last bit. The model is named, not stored; whether it is the same
one is told by its size and by the cost, which is computed anew.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, NoReturn, TypeVar

import numpy as np

from ..arrays import Array, checked, number, shown, whole
from ..camera import Camera, depths
from ..errors import AssetError, listed
from ..fitting.result import Fit, FitOptions, Status
from ..fitting.solve import Solution
from ..fitting.task import Task, answer, prepare
from ..model import FaceModel
from ..observation import Observation
from .files import replacing, text_of

FORMAT, VERSION = "faceambig fit", 1
PARTS = ("model", "observation", "options", "camera", "alpha", "cost", "steps", "status")
MAX_BYTES = 1 << 24  # 14,000 dense points take 1 MB
BY_NAME = ("embedded", "ict")  # models that are found by their name
# Relative: another machine's rounding is far below, another model's cost far above
SAME_COST = 1e-6
LARGEST_KAPPA = 50.0  # per metre: two centimetres before the eyes, where no free distance ends
T = TypeVar("T", int, float)
SAME_PX = 1e-6  # pixels: of a cost of rounding alone no digit agrees


def save_fit(
    fit: Fit, path: str | os.PathLike[str], notes: Mapping[str, Any] | None = None
) -> None:
    """Write a fit as JSON that `load_fit` reads, replacing `path` in one step. `notes` stand in it for people."""
    with replacing(path) as whole_file:
        whole_file.write_bytes(encode_fit(fit, notes))


def encode_fit(fit: Fit, notes: Mapping[str, Any] | None = None) -> bytes:
    """The file of a saved fit."""
    head = {"format": FORMAT, "format_version": VERSION}
    rest = {**(notes or {}), "saved": _saved(fit)}
    return (json.dumps({**head, **rest}, indent=1, allow_nan=False) + "\n").encode()


def _saved(fit: Fit) -> dict[str, Any]:
    model, seen, camera = fit.model, fit.observation, fit.camera
    points = [None if np.isnan(point).any() else point.tolist() for point in seen.points]
    size, centre = seen.image_size, seen.principal_point
    return {
        "model": {
            "name": model.name,
            "source": model.source,
            "vertices": model.n_vertices,
            "modes": model.n_modes,
        },
        "observation": {
            "points": points,
            "scheme": seen.scheme if isinstance(seen.scheme, str) else seen.scheme.tolist(),
            "image_size": None if size is None else [int(side) for side in size],
            "principal_point": None if centre is None else [float(x) for x in centre],
            "weights": None if seen.weights is None else seen.weights.tolist(),
        },
        "options": asdict(fit.options),
        "camera": {
            "R": camera.R.tolist(),
            "t": camera.t.tolist(),
            "s": float(camera.s),
            "kappa": float(camera.kappa),
        },
        "alpha": fit.alpha.tolist(),
        "cost": float(fit.cost),
        "steps": int(fit.steps),
        "status": fit.status.value,
    }


def is_fit(path: str | os.PathLike[str]) -> bool:
    """Whether a file says at its beginning that it is a saved fit; it may be damaged all the same."""
    try:
        with Path(path).open("rb") as file:
            start = file.read(200)
    except OSError:
        return False
    return b'"format"' in start and f'"{FORMAT}"'.encode() in start


def load_fit(path: str | os.PathLike[str], model: FaceModel | None = None) -> Fit:
    """The fit that `save_fit` or `faceambig fit --out` wrote, as it was: nothing is fitted again.

    Parameters
    ----------
    model: the model it was made with; None: the one of that name, if it is embedded or ict.

    Raises
    ------
    AssetError: no saved fit, one of a newer format, a damaged one (wrong shapes, numbers that are not finite, a face
        outside its box, a cost that is not that of the face), or one of another model.
    """
    file = Path(path)
    saved = _read(file)

    try:
        made_with = _part(saved, "model", ("name", "source", "vertices", "modes"))
        if model is None:
            model = _named(made_with["name"])
        _check_model(model, made_with)
        task = prepare(model, _observation(saved), _options(saved))
        return answer(task, _solution(task, saved))
    except (ValueError, TypeError) as error:
        raise AssetError(f"{file.name}: {error}") from error


def _read(file: Path) -> Mapping[str, Any]:
    """What is below `saved`, of this format."""
    if not file.is_file():
        raise AssetError(f"{file}: no such file; a fit that `faceambig fit --out` saved is needed")
    text = text_of(file, MAX_BYTES, "a saved fit")

    def refuse(word: str) -> NoReturn:
        raise ValueError(f"{word} is not a number of JSON")

    try:
        record = json.loads(text, parse_constant=refuse)
    except (ValueError, RecursionError) as error:
        words = " ".join(str(error).split())
        raise AssetError(f"{file.name}: a damaged file, no JSON: {words:.120}") from error
    if not isinstance(record, dict) or record.get("format") != FORMAT:
        raise AssetError(f"{file.name}: not a saved fit; save one with faceambig fit --out FOLDER")
    if record.get("format_version") != VERSION:
        raise AssetError(
            f"{file.name}: a saved fit of format {shown(record.get('format_version'))}, this program reads {VERSION}"
        )
    try:
        return _part(record, "saved", PARTS)
    except ValueError as error:
        raise AssetError(f"{file.name}: a damaged saved fit: {error}") from error


def _part(saved: Mapping[str, Any], name: str, keys: tuple[str, ...]) -> Mapping[str, Any]:
    part = saved.get(name)
    if not isinstance(part, dict) or set(part) != set(keys):
        raise ValueError(f"{name}: expected {listed(keys).replace(' or ', ' and ')}")
    return part


def _named(name: object) -> FaceModel:
    from . import load_model

    if name not in BY_NAME:
        raise ValueError(f"made with model {shown(name)}; give that model")
    return load_model(str(name))


def _check_model(model: FaceModel, made_with: Mapping[str, Any]) -> None:
    has = (model.name, model.n_vertices, model.n_modes)
    wants = (made_with["name"], made_with["vertices"], made_with["modes"])
    if has != wants:
        raise ValueError(
            f"made with model {shown(wants[0])} of {shown(wants[1])} vertices and {shown(wants[2])} modes; "
            f"this one is {has[0]!r} of {has[1]} and {has[2]}"
        )


def _observation(saved: Mapping[str, Any]) -> Observation:
    keys = ("points", "scheme", "image_size", "principal_point", "weights")
    part = _part(saved, "observation", keys)
    points = part["points"]
    if not isinstance(points, list):
        raise ValueError(f"points: {shown(points)} is not a list")
    given = [[np.nan, np.nan] if point is None else point for point in points]
    return Observation(
        checked("points", given, (None, 2), nan=True),
        part["scheme"],
        _pair("image_size", part["image_size"], whole),
        _pair("principal_point", part["principal_point"], number),
        part["weights"],
    )


def _pair(name: str, value: Any, kind: Callable[[str, object], T]) -> tuple[T, T] | None:
    if value is None:
        return None
    if not isinstance(value, list) or len(value) != 2:
        raise ValueError(f"{name}: {shown(value)} is not two numbers")
    return kind(name, value[0]), kind(name, value[1])


def _options(saved: Mapping[str, Any]) -> FitOptions:
    return FitOptions(**_part(saved, "options", tuple(field.name for field in fields(FitOptions))))


def _solution(task: Task, saved: Mapping[str, Any]) -> Solution:
    """The face and camera of the file, checked against its own points."""
    camera = _camera(saved)
    S = task.problem.modes.shape[2]
    alpha = checked("alpha", saved["alpha"], (S,))
    box = task.problem.box
    if np.abs(alpha).max() > box:
        raise ValueError(f"alpha: {np.abs(alpha).max():g} is outside the box of {box:g}")
    landmarks = task.problem.landmarks(alpha)
    if depths(camera, landmarks).min() <= 0:
        raise ValueError("camera: a point of the face lies behind it")
    cost, steps = number("cost", saved["cost"]), whole("steps", saved["steps"])
    if steps < 0:
        raise ValueError(f"steps: {shown(steps)} is negative")
    try:
        status = Status(saved["status"])
    except ValueError as error:
        raise ValueError(f"status: {shown(saved.get('status'))} is none of a fit") from error
    solution = Solution(alpha, camera, cost, steps, status)
    real = _cost(task, solution)
    slack = SAME_COST * real + float(task.problem.weights.sum()) * SAME_PX**2
    if not abs(cost - real) <= slack:
        raise ValueError(
            f"cost: {cost:g} in the file, {real:g} with this model: another model, or numbers that were changed"
        )
    return solution


def _cost(task: Task, solution: Solution) -> float:
    """E of MATH.md 3."""
    residual = answer(task, solution).residual[task.observation.visible]
    squares = task.problem.weights @ (residual**2).sum(axis=1)
    return float(squares + task.problem.prior_weight * (solution.alpha @ solution.alpha))


def _camera(saved: Mapping[str, Any]) -> Camera:
    part = _part(saved, "camera", ("R", "t", "s", "kappa"))
    R: Array = checked("R", part["R"], (3, 3))
    t, s, kappa = (
        checked("t", part["t"], (2,)),
        number("s", part["s"]),
        number("kappa", part["kappa"]),
    )
    if np.abs(R @ R.T - np.eye(3)).max() > 1e-9 or np.linalg.det(R) < 0:
        raise ValueError("R: not a rotation")
    if not 0 < s < np.inf:
        raise ValueError(f"s: {s:g} pixels per metre is not above 0 and finite")
    if not 0 <= kappa < LARGEST_KAPPA:
        raise ValueError(f"kappa: {kappa:g} per metre is not within 0 to {LARGEST_KAPPA:g}")
    return Camera(R, t, s, kappa)
