"""What a file of another face model holds, checked, in metres and at one standard deviation: a FaceModel.

Every format stores mean, modes and triangles somewhere, in its own unit, order and winding. A reader takes them out
(`Parts`); here they are checked against each other, scaled, turned outward and given their landmarks.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, IntArray
from ..errors import AssetError
from ..model import FaceModel, Scheme
from .between import Between, with_points
from .checks import finite, vertex_numbers
from .files import MAX_BYTES

UNITS = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 1e-3, "micrometre": 1e-6}
# Millimetres on the mean of an adult: the largest side of a face or a head, with or without shoulders
EXTENT = (100.0, 900.0)
OUTER = (80.0, 100.0)  # between the outer eye corners, 37 and 46 of iBUG
FARTHEST = 1e3  # metres: beyond it the numbers are damage, and their squares would overflow
RISING = 1e-3  # relative: sds are sorted within the rounding of float32 files


@dataclass(frozen=True, slots=True, eq=False)
class Parts:
    """What a reader found. N vertices, S modes, F triangles; lengths in the unit of the file."""

    name: str
    mean: NDArray[Any]  # (N, 3)
    modes: NDArray[Any]  # (N, 3, S), to be multiplied by `sds`
    faces: NDArray[Any]  # (F, 3) from 0, wound either way
    unit: str  # one of UNITS
    # (S,) standard deviations, largest first; None: already in the modes
    sds: NDArray[Any] | None = None
    unit_is_sure: bool = True  # False: the format names none, and `unit` is what is common
    schemes: Mapping[str, Scheme] = field(default_factory=dict)
    between: Between | None = None
    colours: NDArray[Any] | None = None  # (N, 3) sRGB, 0 to 1 or 0 to 255
    evaluation: IntArray | None = None
    licence: str = ""
    source: str = ""


def fits_in_memory(n_vertices: int, n_modes: int) -> None:
    """AssetError if mean and modes of that size would take more than is accepted."""
    size = 24 * n_vertices * (n_modes + 1)
    if size > MAX_BYTES:
        raise AssetError(
            f"{n_vertices} vertices and {n_modes} modes take {size >> 20} MB; {MAX_BYTES >> 20} MB are accepted"
        )


def build(parts: Parts) -> FaceModel:
    """The model of `parts` at the file's own origin, metres; AssetError if they do not fit together.

    Runs inside `damage_named`: what overflows makes no noise and is refused by name.
    """
    n, _, s = _sizes(parts)
    mean = finite("mean", parts.mean)
    unit, words = _unit(parts, mean, _outer(parts, mean, parts.schemes.get("ibug68")))
    mean = _bounded("mean", mean * unit)
    scale = np.full(s, unit) if parts.sds is None else unit * _sds(parts.sds)
    modes = np.multiply(parts.modes, scale, dtype=np.float64, order="C")
    faces = _outward(vertex_numbers("triangles", parts.faces, n), mean)
    model = FaceModel(
        name=parts.name,
        control_mean=mean,
        control_modes=_bounded("modes", modes),
        faces=faces,
        schemes=parts.schemes,
        colours=_colours(parts.colours),
        evaluation=parts.evaluation,
        licence=parts.licence,
        source=parts.source,
        unit=words,
    )
    return model if parts.between is None else with_points(model, parts.between)


def _sizes(parts: Parts) -> tuple[int, ...]:
    mean, modes, faces = parts.mean, parts.modes, parts.faces
    if mean.ndim != 2 or mean.shape[1] != 3 or len(mean) < 4:
        raise AssetError(f"mean has shape {mean.shape}, expected (N, 3) with 4 vertices or more")
    if modes.ndim != 3 or modes.shape[:2] != mean.shape or not modes.shape[2]:
        raise AssetError(f"modes have shape {modes.shape}, expected ({len(mean)}, 3, S)")
    if faces.ndim != 2 or faces.shape[1] != 3 or not len(faces):
        raise AssetError(f"triangles have shape {faces.shape}, expected (F, 3)")
    if parts.sds is not None and parts.sds.shape != modes.shape[2:]:
        raise AssetError(f"{parts.sds.size} standard deviations for {modes.shape[2]} modes")
    if parts.colours is not None and parts.colours.shape != mean.shape:
        raise AssetError(f"colours have shape {parts.colours.shape}, expected {mean.shape}")
    fits_in_memory(len(mean), modes.shape[2])
    return modes.shape


def _bounded(name: str, metres: Array) -> Array:
    low, high = float(metres.min()), float(metres.max())
    if not -FARTHEST < low <= high < FARTHEST:  # also NaN
        finite = np.isfinite(low) and np.isfinite(high)
        raise AssetError(
            f"{name}: a value of {max(-low, high):.3g} m is no face's"
            if finite
            else f"{name} holds a value that is not finite"
        )
    return metres


def _sds(values: NDArray[Any]) -> Array:
    sds = finite("standard deviations", values)
    if (sds <= 0).any():
        raise AssetError(f"standard deviations: {sds.min():.3g} is not positive")
    if (sds[1:] > sds[:-1] * (1 + RISING)).any():
        k = int(np.argmax(sds[1:] > sds[:-1] * (1 + RISING)))
        raise AssetError(f"standard deviations: mode {k + 2} is stronger than mode {k + 1}")
    return sds


def sds_of_variances(variances: NDArray[Any]) -> Array:
    """(S,) square roots; AssetError if one is not positive."""
    values = finite("variances", np.ravel(variances))
    if (values <= 0).any():
        raise AssetError(f"variances: {values.min():.3g} is not positive")
    return np.sqrt(values)


def _outer(parts: Parts, mean: Array, scheme: Scheme | None) -> float | None:
    """The distance of the outer eye corners of the mean, in the file's unit, if the model names them."""
    if parts.between is not None and {"37", "46"} <= set(parts.between.points):
        rows = [parts.between.points.index(name) for name in ("37", "46")]
        corners = vertex_numbers("landmarks", parts.between.corners[rows], len(mean))
        weights = parts.between.weights[rows, :, None]
        right, left = (mean[corners] * weights).sum(axis=1)
    elif scheme is not None and {"37", "46"} <= set(scheme.points):
        rows = [scheme.points.index(name) for name in ("37", "46")]
        right, left = mean[vertex_numbers("landmarks", scheme.vertices[rows], len(mean))]
    else:
        return None
    return float(np.linalg.norm(right - left))


def _unit(parts: Parts, mean: Array, outer: float | None) -> tuple[float, str]:
    """Metres of the file's unit, and the unit in words.

    Only where a format names no unit another is tried than the common one: `load_model` refuses a wrong size.
    """
    if parts.unit_is_sure:
        return UNITS[parts.unit], parts.unit
    length = outer if outer is not None else float(np.ptp(mean, axis=0).max())
    low, high = OUTER if outer is not None else EXTENT
    for name in (parts.unit, *UNITS):
        mm = 1000.0 * length * UNITS[name]
        if low <= mm <= high:
            how = "outer eye corners" if outer is not None else "largest side"
            return UNITS[name], f"{name}, found by its size: {how} {mm:.1f} mm"
    what = "outer eye corners are apart" if outer is not None else "its largest side is"
    raise AssetError(
        f"of unknown unit: {what} {length:.4g}, an adult's {low:g} to {high:g} mm in none of {', '.join(UNITS)}"
    )


def _outward(faces: NDArray[Any], mean: Array) -> NDArray[np.uint32]:
    """(F, 3) turned, all together, if more than half of the area looks at the centroid."""
    corners = mean[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    away = np.einsum("fk,fk->f", normals, corners.mean(axis=1) - mean.mean(axis=0))
    area = np.linalg.norm(normals, axis=1)
    if area[away < 0].sum() > area[away > 0].sum():
        faces = faces[:, ::-1]
    return np.ascontiguousarray(faces, dtype=np.uint32)


def _colours(values: NDArray[Any] | None) -> NDArray[np.uint8] | None:
    """(N, 3) bytes of colours 0 to 1 or 0 to 255: which of the two is told by the largest."""
    if values is None:
        return None
    colours = finite("colours", values)
    full = 255.0 if colours.max() <= 1.5 else 1.0
    return np.rint((colours.clip(-1e3, 1e3) * full).clip(0, 255)).astype(np.uint8)
