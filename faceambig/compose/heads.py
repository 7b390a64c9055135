"""Heads of a row and where the viewer stands."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, number
from ..model import FaceModel
from ..scene import Head, View

HALF_HEIGHT = 0.165  # metres: a large head with its neck
SPACING = 0.26  # metres between two heads of the row: they never touch while turning
ZOOM = (0.5, 4.0)
VIEWS: Mapping[str, tuple[float, float]] = {  # azimuth, elevation in degrees
    "front": (0.0, 0.0),
    "three_quarter": (-32.0, 6.0),
    "side": (-90.0, 0.0),
    "top": (0.0, 89.0),
}


@lru_cache(maxsize=8)
def pivot(model: FaceModel) -> tuple[float, float, float]:
    """The middle of the mean head's height and depth, metres: heads that turn about it stay in their place."""
    low, high = model.mean.min(axis=0), model.mean.max(axis=0)
    return 0.0, float(low[1] + high[1]) / 2, float(low[2] + high[2]) / 2


def head(
    model: FaceModel,
    name: str,
    title: str,
    vertices: Array,
    colours: NDArray[np.uint8],
    *,
    slot: float,
    caption: tuple[tuple[str, str], ...] = (),
    lit: bool = True,
    opacity: float = 1.0,
) -> Head:
    """One head of the row, with the model's triangles."""
    return Head(
        name=name,
        title=title,
        vertices=vertices,
        faces=model.faces,
        colours=colours,
        occlusion=model.occlusion,
        lit=lit,
        slot=float(slot),
        caption=caption,
        coarse_faces=model.coarse_faces,
        opacity=opacity,
    )


def named_view(
    name: str,
    *,
    orbit: tuple[float, float] = (0.0, 0.0),
    zoom: float = 1.0,
    half_height: float = HALF_HEIGHT,
    rise: float = 0.0,
) -> View:
    """The viewer's place for a key of VIEWS, or for "free" at `orbit` (azimuth, elevation), degrees.

    half_height: metres shown above and below the middle at zoom 1, rise: of the pivot above it.
    """
    if name not in VIEWS and name != "free":
        raise ValueError(f"view: {name!r} is not one of {', '.join(VIEWS)}, free or camera")
    zoom = number("zoom", zoom)
    if not ZOOM[0] <= zoom <= ZOOM[1]:
        raise ValueError(f"zoom: {zoom:g} is not within {ZOOM[0]:g} to {ZOOM[1]:g}")
    azimuth, elevation = (number("orbit", angle) for angle in VIEWS.get(name, orbit))
    if not (abs(azimuth) <= 360 and abs(elevation) <= 90):  # False for NaN too
        raise ValueError(
            f"orbit: azimuth {azimuth:g} and elevation {elevation:g} are not within "
            "-360 to 360 and -90 to 90 degrees"
        )
    return View(name, azimuth, elevation, half_height / zoom, rise)
