"""Sheet: what every part of a picture draws with, and the colours and words they share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from ..scene import Scene, View
from .canvas import Canvas, Colour, Picture
from .gl import Layer
from .plots import D_L, D_S, DIM

GROUND, PANEL, CARD = (0xF3, 0xF6, 0xF9), (0xFF, 0xFF, 0xFF), (0xF6, 0xF8, 0xFA)
OBSERVED, PROJECTED, HALO = (0xC8, 0x10, 0x2E), (0x1B, 0x5F, 0xC1), (0xFF, 0xFF, 0xFF)
TONES: Mapping[str, Colour] = {"dim": DIM, "d_l": D_L, "d_s": D_S, "seen": OBSERVED}

WORDS: Mapping[str, str] = {
    "photo": "The photograph",
    "cross": "point in the photo",
    "circle": "same point of the fitted face",
    "assumed": "assumed {cm}",
    "true": "true {cm}",
    "far": "assumed far away (orthographic)",
    "far_tick": "far",
    "d_l": "Landmark error",
    "d_l_note": "of the eye distance; people click within {tolerance}\u202f%.",
    "d_l_note_alone": "of the eye distance",
    "d_s": "Surface difference",
    "d_s_note": "mean distance to the true face",
    "d_s_note_reference": "mean distance to {reference}",
    "d_l_axis": "Landmark error in %",
    "d_s_axis": "Surface difference in mm",
    "axis": "assumed camera distance in cm",
    "band": "under {tolerance}\u202f%: a person cannot tell",
    "density": "How likely is each distance",
    "beyond": "{percent}\u202f% farther",
    "not_converged": "No good fit here; the last step is shown.",
    "implausible": "no longer a plausible face",
    "bar": "{mm}\u202fmm",
    "bar_all": "{mm}\u202fmm, all views",
    "decimal": ".",  # of numbers
}


@dataclass(frozen=True, slots=True, eq=False)
class Pictures:
    """What is drawn once, whatever is behind it."""

    heads: dict[tuple[str, View], Layer] = field(default_factory=dict)
    photographs: dict[bool, Picture] = field(default_factory=dict)  # True: through the fit's camera
    step: Callable[[], None] = lambda: None  # called before each of them


@dataclass(frozen=True, slots=True, eq=False)
class Sheet:
    """What every part of a picture draws with."""

    canvas: Canvas
    scene: Scene
    words: Mapping[str, str]
    panel: Colour  # behind what stands beside the heads
    pictures: Pictures
    bare: bool = False  # heads and photographs alone
