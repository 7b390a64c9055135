"""FLAME: `generic_model.pkl` (a Python 2 pickle, read as data) or an `.npz` of the same names.

    v_template (N, 3) metres, f (F, 3), shapedirs (N, 3, 300 + 100): identity, then expression, per standard deviation

Pose, joints and weights are not read: the fit is of a neutral face. The 68 points of iBUG are those of the static
embedding, whose contour does not slide along the jaw.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import AssetError
from ..model import FaceModel
from .between import points_between
from .build import Parts, build
from .checks import whole_numbers
from .files import asset_path, damage_named
from .pickled import array_of, is_pickle, read_pickle
from .zipped import names_in, plain_arrays

NAMES = ("v_template", "shapedirs", "f")
N_VERTICES = 5_023
IDENTITY = 300  # of the modes; those behind are expressions


def is_flame(path: Path) -> bool:
    """Whether `path` is a pickle, or a zip with FLAME's arrays."""
    return is_pickle(path) or set(NAMES) <= names_in(path)


def read_flame(path: Path) -> FaceModel:
    """FLAME's identity model at its own origin; AssetError, one line, for damage or a pickle of anything else."""
    with damage_named(path):
        arrays = _unpickled(path) if is_pickle(path) else plain_arrays(path, NAMES, NAMES)
        modes = arrays["shapedirs"]
        if modes.ndim != 3:
            raise AssetError(f"shapedirs has shape {modes.shape}, expected (N, 3, S)")
        known = len(arrays["v_template"]) == N_VERTICES
        return build(
            Parts(
                name="flame" if known else "flame-like",
                mean=arrays["v_template"],
                modes=modes[:, :, :IDENTITY],
                faces=whole_numbers("f", arrays["f"]),
                unit="m",
                between=points_between(asset_path("schemes/flame_ibug68.csv")) if known else None,
                licence="FLAME's model licence (flame.is.tue.mpg.de); CC BY 4.0 for the versions that say so",
                source=f"FLAME, {path.name}",
            )
        )


def _unpickled(path: Path) -> Mapping[str, Any]:
    found = read_pickle(path)
    if not isinstance(found, dict):
        raise AssetError("a pickle of something else; FLAME's is a dictionary")
    missing = [name for name in NAMES if name not in found]
    if missing:
        raise AssetError(f"{missing[0]} is missing; FLAME has {', '.join(NAMES)}")
    return {name: array_of(name, found[name]) for name in NAMES}
