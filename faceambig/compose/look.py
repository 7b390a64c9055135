"""What was asked to be drawn, checked: what is hidden or means nothing in a view is taken out."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

from ..arrays import number
from ..camera import Camera
from .colours import SURFACES, shown_surface
from .overlays import OVERLAYS

SHOWS = ("both", "overlay", "blink", "difference")
HIDEABLE = ("numbers", "truth", "actual")


class Look(NamedTuple):
    """What was asked to be drawn, checked."""

    view: str
    show: str
    surface: str  # that is drawn
    overlays: frozenset[str]
    hide: frozenset[str]
    fade: float
    true_camera: Camera | None


def look_of(
    view: str,
    show: str,
    surface: str,
    overlays: Collection[str],
    hide: Collection[str],
    fade: float,
    true_camera: Camera | None,
) -> Look:
    """The arguments of compose, checked; what is hidden or means nothing in this view is taken out."""
    for name, values, known in (
        ("show", (show,), SHOWS),
        ("surface", (surface,), SURFACES),
        ("overlays", overlays, OVERLAYS),
        ("hide", hide, HIDEABLE),
    ):
        for value in values:
            if value not in known:
                raise ValueError(f"{name}: {value!r} is not one of {', '.join(known)}")
    fade = number("fade", fade)
    if not 0 <= fade <= 1:
        raise ValueError(f"fade: {fade:g} is not within 0 to 1")
    drawn = shown_surface(surface, show, hide)
    shown = frozenset(overlays)
    needy = [name for name in ("rays", "pyramid") if name in shown and view != "camera"]
    if "truth" in hide:
        needy = []
    if true_camera is None and (drawn == "depth" or needy):
        what = "surface: 'depth'" if drawn == "depth" else f"overlays: {needy[0]!r}"
        raise ValueError(f"{what} needs the camera that took the photograph; give true_camera")
    one_place = show in ("overlay", "blink") and view != "camera" and "truth" not in hide
    return Look(
        view, show if one_place else "both", drawn, shown, frozenset(hide), fade, true_camera
    )
