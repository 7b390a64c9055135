"""Scene: everything one picture of the page or a snapshot shows, as plain arrays. No behaviour.

The page (viser) and the snapshot (pyrender) both draw a Scene and can compute nothing themselves, so they cannot
disagree. Heads stand in a row: each has a `slot`, metres along the viewer's right, and turns in place about the pivot.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .arrays import Array, IntArray


@dataclass(frozen=True, slots=True, eq=False)
class Head:
    """One head of the row. V vertices, F triangles; model axes, origin between the eyes."""

    name: str  # node name, "true" or "fit" or "fit60"
    title: str  # words above the head
    vertices: Array  # (V, 3) metres
    faces: NDArray[np.uint32]  # (F, 3)
    colours: NDArray[np.uint8]  # (V, 3) sRGB
    # (V,) ambient occlusion, 255 open; darkens `colours`
    occlusion: NDArray[np.uint8] | None = None
    # False: colours are values of a legend and are shown as they are, shading reduced
    lit: bool = True
    slot: float = 0.0  # metres along the viewer's right
    # Lines under the head: (text, tone), tone "dim", "d_l" or "d_s"
    caption: tuple[tuple[str, str], ...] = ()
    # Over the first vertices: the mesh while a hand moves
    coarse_faces: NDArray[np.uint32] | None = None
    values_mm: Array | None = None  # (V,) what colours of a legend mean; NaN: not measured
    opacity: float = 1.0  # below 1: a ghost; of heads in one slot the nearer surface covers the farther by this share


@dataclass(frozen=True, slots=True, eq=False)
class Marks:
    """Points marked on one head: screen-sized, so they never hide the surface."""

    head: str  # name of the Head they lie on
    points: Array  # (L, 3) metres, the head's own axes
    tone: str  # "seen" (red cross) or "d_l" (blue circle), as in the photograph
    names: tuple[str, ...] = ()  # L names to write beside them; empty: none


@dataclass(frozen=True, slots=True, eq=False)
class Lines:
    """Straight lines in the room of one head: rays to the camera, its pyramid, the gap to the true face."""

    name: str  # "rays", "pyramid", "errors"
    head: str  # name of the Head in whose axes and slot they stand
    segments: Array  # (n, 2, 3) metres, the head's own axes
    tone: str  # "dim", "seen" or "d_l"


@dataclass(frozen=True, slots=True)
class View:
    """Where the viewer stands: a long lens far away, not the subject's camera."""

    name: str  # front, three_quarter, side, top, free
    azimuth_deg: float  # 0 front; positive: the viewer sees more of the subject's left side
    elevation_deg: float  # positive: from above
    half_height: float  # metres shown above and below the middle of the picture, zoom included
    rise: float = 0.0  # metres: how far above that middle the pivot stands


@dataclass(frozen=True, slots=True, eq=False)
class Photo:
    """The synthetic photograph and the points on it. Pixels: x right, y down."""

    width: int
    height: int
    observed: Array  # (L, 2) pixels, NaN where missing
    projected: Array  # (L, 2) pixels, the same points of the fitted face
    names: tuple[str, ...]  # L names of the points
    caption: str  # "taken from 30 cm"
    vertices: Array  # (V, 3) metres in camera axes (x right, y down, z forward)
    faces: NDArray[np.uint32]  # (F, 3)
    colours: NDArray[np.uint8]  # (V, 3) sRGB
    occlusion: NDArray[np.uint8] | None
    focal: float  # pixels
    principal: tuple[float, float]  # pixels
    # (V, 3) the fitted face in camera axes, for the view "camera"
    fit_vertices: Array | None = None
    fit_focal: float | None = None  # pixels, per metre of depth as `focal`
    # Distance of the fitted face's eyes in the picture, for that of the observed ones
    fit_eyes: float = 1.0
    pixels: NDArray[np.uint8] | None = None  # (height, width, 3) a real photograph, drawn instead
    points_shown: bool = True
    names_shown: bool = False
    # A line from each cross towards its circle, this many times its length
    error_scale: float = 0.0
    # (n, 2) pixels, the fitted face's outline; NaN rows part its pieces
    outline: Array | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Curves:
    """d_L and d_S against the assumed distance: the sweep behind the two plots."""

    distances: Array  # (D,) metres, ascending
    d_l_percent: Array  # (D,)
    d_s_mm: Array  # (D,)
    orthographic: tuple[float, float]  # d_L percent and d_S mm of the far-away camera
    true_distance: float  # metres; NaN: not known, or not to be told
    tolerance_percent: float  # a person cannot tell below this
    density: Array | None = None  # (D,) posterior of the distance, per octave, of largest value 1
    intervals: tuple[tuple[float, float], ...] = ()  # metres: of 50 and 95 % posterior; inf: no end
    beyond: float = 0.0  # share of the posterior beyond the last distance


@dataclass(frozen=True, slots=True)
class Numbers:
    """The numbers beside the heads."""

    distance: float | None  # metres; None: orthographic
    d_l_percent: float
    d_s_mm: float
    converged: bool
    plausible: bool  # every coefficient inside the box
    eyes_meaning: str  # the definition of d_L's unit
    flex_words: str = ""  # what the flexibility mode moves
    flex_mm: float = 0.0
    flex: tuple[tuple[str, float], ...] = ()  # of several modes: words and mm of each
    reference: str = ""  # what d_S is measured to; empty: the true face


@dataclass(frozen=True, slots=True, eq=False)
class Legend:
    """A colour scale: value of the first and the last colour, evenly spaced between."""

    title: str
    colours: NDArray[np.uint8]  # (K, 3) sRGB, first is `low`
    low: float
    high: float
    ticks: tuple[float, ...]
    note: str = ""  # "grey: not measured"
    open_low: bool = False  # lower values are drawn in the first colour: "< -15" at the bar's end
    open_high: bool = False  # higher values are drawn in the last colour: "> 15"


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """What is drawn. Views beyond the first are further rows of the same heads (snapshot strips)."""

    heads: tuple[Head, ...]
    views: tuple[View, ...]
    photo: Photo
    numbers: Numbers
    curves: Curves | None = None
    legend: Legend | None = None
    through_camera: bool = False  # the picture is the photo itself, fitted face beside true face
    blink: bool = False  # heads of one slot are shown in turn, one at a time, a second each
    marks: tuple[Marks, ...] = ()
    lines: tuple[Lines, ...] = ()
    # Metres, model axes: where heads are centred and turn about
    pivot: tuple[float, float, float] = (
        0.0,
        0.0,
        0.0,
    )
    scale_bar: float = 0.05  # metres; 0: none
    note: str = ""  # one line: model, subject, what is grey
    # What is not told: "numbers" (their text), "truth" (d_S and its curve), "actual"
    hide: frozenset[str] = frozenset()
    # (L,) vertices marked on heads
    landmarks: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
