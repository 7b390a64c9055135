"""What colours a head: skin, clay, or values, each scale with its Legend. The legend's colours are those drawn."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, checked
from ..model import FaceModel, Subject
from ..scene import Legend

Colours = NDArray[np.uint8]

SURFACES = ("clay", "skin", "difference", "depth", "spread")
DIFFERENCE_MM, DEPTH_MM, SPREAD_MM = 15.0, 15.0, 10.0  # ends of the scales
UNMEASURED = (176, 178, 184)  # grey of what is not in d_S
CLAY = (205, 172, 150)
GHOST = (126, 152, 190)  # of the true face over the fitted one: no colour of skin, clay or a scale
# matplotlib's inferno (CC0) at 0, 0.1, ... 1; used reversed from 4 % to 78 %: light is small, dark is large
INFERNO = np.array(
    [
        (0, 0, 4), (22, 11, 57), (66, 10, 104), (106, 23, 110), (147, 38, 103), (188, 55, 84),
        (221, 81, 58), (243, 120, 25), (252, 165, 10), (246, 215, 70), (252, 255, 164),
    ],
    dtype=np.float64,
)  # fmt: skip
# Moreland's diverging map (2009, free to use) at -1, -0.75, ... 1: grey at 0, equally light on both sides of it
COOL_WARM = np.array(
    [
        (59, 76, 192), (98, 130, 234), (141, 176, 254), (184, 208, 249), (221, 221, 221),
        (245, 196, 173), (244, 154, 123), (222, 96, 77), (180, 4, 38),
    ],
    dtype=np.float64,
)  # fmt: skip


def shown_surface(surface: str, show: str = "both", hide: Collection[str] = ()) -> str:
    """The surface drawn when `surface` is asked for: show="difference" wants a difference, a hidden truth has none."""
    if show == "difference" and surface != "depth":
        surface = "difference"
    return "skin" if "truth" in hide and surface in ("difference", "depth") else surface


def skin(subject: Subject) -> Colours:
    """(N, 3) sRGB: the subject's own colours, else the model's, else clay."""
    for colours in (subject.colours, subject.model.colours):
        if colours is not None:
            return colours
    return plain(subject.model, CLAY)


def plain(model: FaceModel, colour: tuple[int, int, int]) -> Colours:
    """(N, 3) of one colour."""
    return np.tile(np.array(colour, dtype=np.uint8), (model.n_vertices, 1))


def greyed(colours: Colours) -> Colours:
    """The colours without their colour: a face that is no longer plausible."""
    grey = colours @ np.array([0.3, 0.59, 0.11])
    return np.repeat(grey.round().astype(np.uint8)[:, None], 3, axis=1)


def scale_colours(share: Array) -> Colours:
    """sRGB (n, 3) of the magnitude scale at share (n,) of its range, 0 to 1."""
    return _at(INFERNO, 10.0 * (0.96 - np.clip(share, 0.0, 1.0) * (0.96 - 0.22)))


def signed_colours(share: Array) -> Colours:
    """sRGB (n, 3) of the diverging scale at share (n,) of its range, -1 to 1."""
    return _at(COOL_WARM, 4.0 * (np.clip(share, -1.0, 1.0) + 1.0))


def _at(table: Array, place: Array) -> Colours:
    rows = np.arange(len(table))
    columns = [np.interp(place, rows, table[:, c]) for c in range(3)]
    return np.stack(columns, axis=1).round().astype(np.uint8)


def difference_colours(model: FaceModel, gaps_mm: Array) -> Colours:
    """(N, 3) sRGB: distance to the true face on the evaluation region (E,), grey elsewhere."""
    return _over_region(model, scale_colours(gaps_mm / DIFFERENCE_MM))


def depth_colours(model: FaceModel, depth_mm: Array) -> Colours:
    """(N, 3) sRGB: change of depth on the evaluation region (E,), warm nearer to the camera, grey elsewhere."""
    return _over_region(model, signed_colours(depth_mm / DEPTH_MM))


def spread_colours(model: FaceModel, sd_mm: Array) -> Colours:
    """(N, 3) sRGB: posterior sd of every vertex (N,); the grey of what is not measured where it is NaN."""
    sd = checked("spread_mm", sd_mm, (model.n_vertices,), nan=True)
    colours = scale_colours(np.nan_to_num(sd) / SPREAD_MM)
    colours[np.isnan(sd)] = UNMEASURED
    return colours


def over_region(model: FaceModel, values: Array) -> Array:
    """(N,) values of the evaluation region (E,) over all vertices; NaN elsewhere."""
    every = np.full(model.n_vertices, np.nan)
    every[slice(None) if model.evaluation is None else model.evaluation] = values
    return every


def _over_region(model: FaceModel, values: Colours) -> Colours:
    colours = plain(model, UNMEASURED)
    colours[slice(None) if model.evaluation is None else model.evaluation] = values
    return colours


def difference_legend(title: str, note: str) -> Legend:
    """The scale of difference_colours."""
    return _legend(title, note, DIFFERENCE_MM, 5.0)


def spread_legend(title: str, note: str) -> Legend:
    """The scale of spread_colours."""
    return _legend(title, note, SPREAD_MM, 2.0)


def depth_legend(title: str, note: str) -> Legend:
    """The scale of depth_colours."""
    return Legend(
        title=title,
        colours=signed_colours(np.linspace(-1.0, 1.0, 65)),
        low=-DEPTH_MM,
        high=DEPTH_MM,
        ticks=(-15.0, -10.0, -5.0, 0.0, 5.0, 10.0, 15.0),
        note=note,
        open_low=True,
        open_high=True,
    )


def _legend(title: str, note: str, high: float, step: float) -> Legend:
    return Legend(
        title=title,
        colours=scale_colours(np.linspace(0.0, 1.0, 64)),
        low=0.0,
        high=high,
        ticks=tuple(np.arange(0.0, high + step / 2, step).tolist()),
        note=note,
        open_high=True,
    )


LEGENDS = {"difference": difference_legend, "depth": depth_legend, "spread": spread_legend}
