"""Caltech Multi-Distance Portraits (Burgos-Artizzu, Ronchi, Perona, ECCV 2014): the landmarks, `dinfo.mat`.

    distancesVec_FT (1, D) feet (2 3 4 6 8 12 16);  distancesVec_MM the same in millimetres
    fids_Manual_OR (n, 110, D)     55 points set by hand in the original pictures: columns 1-55 x, 56-110 y
    fids_Rcpr300F_OR (n, 136, D)   68 points of a detector, in the order of Multi-PIE, which is that of iBUG

Pixels count from 1 there, as in MATLAB, and from the upper left corner of the first pixel here. The published archive
has 51 people, its paper 53; the number is the file's. The pictures themselves are not needed.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, read_only
from ..errors import AssetError
from .files import damage_named
from .matlab import is_matlab, read_matlab

FILE = "dinfo.mat"
MANUAL, DETECTED = "fids_Manual_OR", "fids_Rcpr300F_OR"
POINTS = {MANUAL: 55, DETECTED: 68}
# Rows whose means are the eyes: of 55 by the code of the data set's own detector (RCPR, points 7 8 and 9 10 from 1)
MANUAL_EYES = ((6, 7), (8, 9))
FOOT = 0.3048  # metres
FEET = (0.5, 100.0)  # what a distance may be
MOST_PEOPLE = 10_000
FARTHEST_PX = 1e6


@dataclass(frozen=True, slots=True, eq=False)
class Portraits:
    """Landmarks of people photographed from several distances. n people, D distances."""

    name: str  # of the file
    distances: Array  # (D,) metres, ascending; marks on the floor
    manual: Array  # (n, D, 55, 2) pixels, set by hand; NaN = missing
    detected: Array | None  # (n, D, 68, 2) pixels, by a detector; None: not in the file

    def __post_init__(self) -> None:
        for name in ("distances", "manual", "detected"):
            array = getattr(self, name)
            if array is not None:
                object.__setattr__(self, name, read_only(array))

    def __len__(self) -> int:
        return len(self.manual)

    def at(self, metres: float) -> int:
        """Number of the distance nearest to `metres`."""
        return int(np.abs(self.distances - metres).argmin())


def read_cmdp(path: str | os.PathLike[str]) -> Portraits:
    """The portraits' landmarks of `dinfo.mat`, or of the folder that holds it; AssetError, one line, if damaged."""
    file = Path(path)
    if file.is_dir():
        file = next(iter(sorted(file.rglob(FILE))), file / FILE)
    try:
        if not is_matlab(file):
            raise AssetError(f"{file.name}: not a MATLAB 5 file; CMDP-ANNO.zip holds {FILE}")
    except OSError as error:
        raise AssetError(f"{file}: cannot be read ({error.strerror or error})") from error
    with damage_named(file):
        arrays = read_matlab(file, ("distancesVec_FT", MANUAL, DETECTED))
        for name in ("distancesVec_FT", MANUAL):
            if name not in arrays:
                raise AssetError(f"{name} is missing; the archive's {FILE} has it")
        distances = _distances(arrays["distancesVec_FT"])
        order = np.argsort(distances)
        manual = _points(MANUAL, arrays[MANUAL], len(distances))[:, order]
        detected = None
        if DETECTED in arrays:
            detected = _points(DETECTED, arrays[DETECTED], len(distances))[:, order]
            if len(detected) != len(manual):
                raise AssetError(
                    f"{DETECTED} is of {len(detected)} people, {MANUAL} of {len(manual)}"
                )
    return Portraits(file.name, distances[order], manual, detected)


def _distances(values: NDArray[np.generic]) -> Array:
    """(D,) metres of distances in feet."""
    feet = np.asarray(values, dtype=np.float64).ravel()
    if len(feet) < 2 or not ((feet >= FEET[0]) & (feet <= FEET[1])).all():  # False for NaN too
        raise AssetError("distancesVec_FT holds no two distances in feet")
    if len(np.unique(feet)) < len(feet):
        raise AssetError("distancesVec_FT holds a distance twice")
    return FOOT * feet


def _points(name: str, values: NDArray[np.generic], distances: int) -> Array:
    """(n, D, L, 2) pixels from 0 of (n, 2L, D) from 1; what a detector left out or put outside any picture is NaN."""
    L = POINTS[name]
    if values.ndim == 2 and distances == 1:
        values = values[:, :, None]
    if values.ndim != 3 or values.shape[1:] != (2 * L, distances):
        raise AssetError(
            f"{name} has shape {values.shape}, expected (people, {2 * L}, {distances})"
        )
    if not 1 <= len(values) <= MOST_PEOPLE:
        raise AssetError(f"{name} is of {len(values)} people")
    xy = np.asarray(values, dtype=np.float64).reshape(len(values), 2, L, distances)
    points = np.ascontiguousarray(xy.transpose(0, 3, 2, 1)) - 0.5
    points[~(np.abs(points) <= FARTHEST_PX).all(axis=3)] = np.nan
    if np.isnan(points).all():
        raise AssetError(f"{name} holds no point")
    return points
