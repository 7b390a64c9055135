"""Track: a face on its way, along the distance that its fit assumes or along a flexibility mode.

What an animation and the standalone page move through. Every stop is a fit of its own, measured as the page measures
it, so what is shown at a stop is what the page shows there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from string import ascii_uppercase

import numpy as np

from faceambig.arrays import Array
from faceambig.compose import Face
from faceambig.scene import Scene

from .. import pipeline
from ..pipeline import likely
from ..pipeline.faces import face
from ..state import FIELDS, ViewState, changed
from ..text import NARROW, centimetres, movement, numeral, say

MODES = 3  # flexibility modes on offer: A, B, C
# Of mean surface change to either side, if nothing is asked, and the most
SWING_MM, MOST_MM = (
    5.0,
    10.0,
)
LETTERS = ascii_uppercase[:MODES]
NEAREST, FARTHEST = FIELDS["distance"].low, FIELDS["distance"].high  # metres


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """Stops on a way, in order. F stops."""

    mode: int  # flexibility mode, 1 to MODES; 0: the distance
    places: Array  # (F,) metres assumed, or millimetres along the mode; ascending
    faces: tuple[Face, ...]  # F
    words: str = ""  # what the mode moves

    @property
    def name(self) -> str:
        """distance, mode1, ..."""
        return f"mode{self.mode}" if self.mode else "distance"


def distances(low: float, high: float, count: int, through: Sequence[float] = ()) -> Array:
    """(F,) metres from low to high, evenly in ratio, three digits each; with those of `through` between them."""
    even = [float(f"{d:.3g}") for d in np.geomspace(low, high, count)]
    kept = [float(d) for d in through if low <= d <= high]
    # A stop of ours beside one asked for would be a step of nothing
    near = 0.4 * np.log(high / low) / max(1, count - 1)
    even[1:-1] = [d for d in even[1:-1] if all(abs(np.log(d / k)) > near for k in kept)]
    return np.array(sorted({low, high, *even[1:-1], *kept}))


def distance_track(state: ViewState, metres: Array) -> Track:
    """The fits that assume `metres` (F,), ascending; of the far-away camera's state too."""
    target, fitting = state.target, state.fitting
    faces = [face(target, fitting._replace(distance=float(d)), state.bend) for d in metres]
    return Track(0, metres, tuple(faces))


def mode_track(state: ViewState, mode: int, millimetres: Array) -> Track:
    """The state's fit bent by `millimetres` (F,), ascending, along flexibility mode `mode`, from 1."""
    if not 1 <= mode <= MODES:
        raise ValueError(f"mode: {mode} is not within 1 to {MODES}")
    states = [bent(state, mode, float(mm)) for mm in millimetres]
    faces = [face(one.target, one.fitting, one.bend) for one in states]
    modes = likely.bending(state.target, state.fitting, state.flex_at, MODES)
    return Track(mode, millimetres, tuple(faces), modes.words[mode - 1])


def bent(state: ViewState, mode: int, mm: float) -> ViewState:
    """The state with its fit bent by `mm` along mode `mode`, from 1; what other modes bend stays."""
    return changed(state, flex=tuple((dict(state.flex) | {mode: mm}).items()))


def state_at(state: ViewState, track: Track, stop: int) -> ViewState:
    """The state of the page that shows a stop."""
    place = float(track.places[stop])
    if track.mode:
        return bent(state, track.mode, place)
    return changed(state, camera="perspective", distance=place)


def scene_of(state: ViewState, track: Track, stop: int) -> Scene:
    """The page's picture of a stop; of a mode, its words and millimetres go before the note."""
    scene = pipeline.frame(state_at(state, track, stop)).scene
    if not track.mode:
        return scene
    return replace(scene, note=f"{label(track)}: {place_text(track, stop)}; {scene.note}")


def label(track: Track) -> str:
    """What moves, in words."""
    if not track.mode:
        return say("player.distance")
    return say("player.mode_label", letter=LETTERS[track.mode - 1], words=movement(track.words))


def place_text(track: Track, stop: int) -> str:
    """Where a stop lies: 120 cm; −3 mm."""
    place = float(track.places[stop])
    if not track.mode:
        return centimetres(place)
    return numeral(f"{float(f'{place:.2f}'):+g}{NARROW}mm").replace("-", "−").replace("+0", "0")
