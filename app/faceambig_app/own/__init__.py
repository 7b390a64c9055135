"""A person's own photograph: read, its points placed, a face fitted to them, shown, and saved if asked."""

from .fit import own_curves, problem, told_distance
from .frame import OwnFrame, own_frame
from .photo import (
    LARGEST,
    MAX_PIXELS,
    NAMED,
    TWELVE,
    OwnPhoto,
    found,
    from_file,
    moved,
    on_scheme,
    read_photo,
    with_points,
)

__all__ = [
    "LARGEST", "MAX_PIXELS", "NAMED", "TWELVE", "OwnFrame", "OwnPhoto", "found", "from_file", "moved", "on_scheme",
    "own_curves", "own_frame", "problem", "read_photo", "told_distance", "with_points",
]  # fmt: skip
