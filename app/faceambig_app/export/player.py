"""The standalone page: a track or several in one HTML file that plays from disk, with no network and no Python.

The script (assets/player.js) draws what lies in the file and computes nothing of the face: at a stop it shows the
words of the pipeline for it, while it plays it moves between stops. This module says what lies in the file, and
standalone.py how it is written.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceambig.arrays import Array
from faceambig.compose import (
    HALF_HEIGHT,
    UNMEASURED,
    VIEWS,
    Face,
    difference_legend,
    pivot,
    skin,
)
from faceambig.scene import Scene

from .. import pipeline
from ..pipeline import fits
from ..state import ViewState, changed
from ..text import distance_text, numeral, percent_number, say
from . import trackplots
from .packing import directions, packed, rounded, step_of
from .provenance import file_name, shown, who
from .standalone import CIRCLE, html
from .tracks import (
    FARTHEST,
    LETTERS,
    MODES,
    NEAREST,
    SWING_MM,
    Track,
    distance_track,
    distances,
    label,
    mode_track,
    place_text,
)

WHATS = ("distance", "mode")  # what a page can move through
STOPS, SWING_STOPS = 49, 21  # of the way along the distance, and along a mode
# Metres: stops in any case, and what is shown, one picture at a time, where motion is to be reduced
MARKS = (0.2, 0.3, 0.6, 1.2, 2.4, 3.0)
OCTAVE_SECONDS, SWING_SECONDS = 2.0, 4.0
HALF_WIDTH = 0.125  # metres to either side of a head, as far as the page shows
LANDMARK_SHARE = 30_000  # a landmark is rounded to this part of the picture's longer side
LIGHTS = (  # as on the page: direction towards the light (right, up, back), colour of 255, intensity
    ((-0.5, 0.7, 1.2), (255, 244, 232), 2.8),
    ((0.9, 0.1, 0.8), (235, 242, 255), 0.7),
    ((0.0, 0.6, -1.0), (255, 250, 245), 0.9),
)
AMBIENT, OCCLUSION_POWER = 0.75, 1.3


def page(
    state: ViewState,
    *,
    whats: Sequence[str] = ("distance",),
    own_photo: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[str, bytes]:
    """(name, contents) of the HTML file: the way along the distance, or the swings of modes A, B, C, or both.

    whats: of WHATS. own_photo: a photograph of one's own goes into the file; a synthetic one always does.
    progress: called with the parts of the work that are done, of how many; what it raises ends the work.
    """
    if not whats or any(what not in WHATS for what in whats):
        raise ValueError(f"whats: {', '.join(whats)!r} is not one or more of {', '.join(WHATS)}")
    state = changed(state, show="both")
    told = progress or (lambda _done, _of: None)
    tracks = []
    for done, what in enumerate(whats):
        told(done, len(whats) + 2)
        tracks += tracks_of(state, (what,))
    told(len(whats), len(whats) + 2)
    scene = pipeline.frame(state, with_curves=False).scene
    own = scene.photo.pixels is not None
    photo = scene.photo if own_photo or not own else replace(scene.photo, pixels=None)
    data, geometry = contents(state, scene, tracks)
    told(1, 1)
    words = "_".join((shown(state) if "mode" in whats else who(state), *whats))
    said = say("player.left_out") if own and not own_photo else ""
    text = html(state, tracks, photo, data, geometry, said=said)
    return file_name(words, "html"), text.encode()


def tracks_of(state: ViewState, whats: Sequence[str]) -> list[Track]:
    """The ways of a page, in the order asked for."""
    tracks = []
    for what in whats:
        if what == "distance":
            through = (*MARKS, state.actual, state.distance)
            metres = distances(NEAREST, FARTHEST, STOPS, through)
            tracks.append(distance_track(state, metres))
        else:
            mm = np.linspace(-SWING_MM, SWING_MM, SWING_STOPS)
            tracks += [mode_track(state, mode, mm) for mode in range(1, MODES + 1)]
    return tracks


# ---- what the script is given ----


def contents(state: ViewState, scene: Scene, tracks: Sequence[Track]) -> tuple[dict[str, Any], str]:
    """Numbers, words and places as JSON can hold them; and the geometry as text."""
    taken = fits.photograph(state.target)
    subject, face_model = taken.subject, taken.subject.model
    first = tracks[0].faces[0].vertices
    step = step_of(subject.vertices, *(face.vertices for track in tracks for face in track.faces))
    base = rounded(first, step)
    open_ = (
        face_model.occlusion
        if face_model.occlusion is not None
        else np.full(face_model.n_vertices, 255, np.uint8)
    )
    measured = np.zeros((1, face_model.n_vertices), np.uint8)
    measured[0, slice(None) if face_model.evaluation is None else face_model.evaluation] = 1
    small = face_model.n_vertices <= np.iinfo(np.uint16).max
    arrays: dict[str, NDArray[np.integer]] = {
        "faces": face_model.faces.T.astype(np.uint16 if small else np.uint32),
        "truth": rounded(subject.vertices, step),
        "base": base,
        "colours": np.concatenate([skin(subject).T, open_[None]]),
        "measured": measured,
    }
    unit = max(scene.photo.width, scene.photo.height) / LANDMARK_SHARE
    described = []
    for track in tracks:
        way = directions(np.stack([face.vertices for face in track.faces]), base, step)
        arrays[f"{track.name}_parts"] = way.parts
        arrays[f"{track.name}_points"] = _landmarks(track.faces, unit)
        described.append(described_track(state, track, way.weights))
    about, text = packed(arrays)
    legend = difference_legend("", "")
    data = {
        "arrays": about,
        "step": step,
        "pixels": unit,
        "pivot": pivot(face_model),
        "half": [HALF_WIDTH, HALF_HEIGHT],
        "views": VIEWS,
        "view": state.view if state.view in VIEWS else "three_quarter",
        "difference": state.surface == "difference",
        "legend": {"colours": legend.colours.tolist(), "mm": legend.high, "rest": UNMEASURED},
        "lights": LIGHTS,
        "ambient": AMBIENT,
        "occlusion": OCCLUSION_POWER,
        "circle": CIRCLE * scene.photo.width / 500,
        "words": {"play": say("player.play"), "pause": say("player.pause")},
        "tracks": described,
    }
    return data, text


def described_track(state: ViewState, track: Track, weights: Array) -> dict[str, Any]:
    """A track for the script: places, and the words of each stop."""
    x, y_l, y_s = trackplots.cursor_places(track)
    along = trackplots.along(track)
    begin = state.distance if not track.mode else 0.0
    marks = MARKS if not track.mode else (-SWING_MM, -SWING_MM / 2, 0.0, SWING_MM / 2, SWING_MM)
    octaves = 0.0 if track.mode else float(np.log2(track.places[-1] / track.places[0]))
    return {
        "name": track.name,
        "label": label(track),
        "seconds": SWING_SECONDS if track.mode else OCTAVE_SECONDS * octaves,
        "start": int(np.abs(track.places - begin).argmin()),
        "marks": sorted({int(np.abs(track.places - mark).argmin()) for mark in marks}),
        "along": _short(along, 6),
        "cursor": [_short(values, 4) for values in (x, y_l, y_s)],
        "weights": [_short(row, 7) for row in weights],
        "stops": [stop_words(track, stop) for stop in range(len(track.places))],
    }


def stop_words(track: Track, stop: int) -> dict[str, Any]:
    """What is shown and said at a stop: the same numbers, written the same way, as on the page."""
    face, text = track.faces[stop], place_text(track, stop)
    d_l, d_s = percent_number(face.d_l_percent), numeral(f"{face.d_s_mm:.1f}")
    warning = ""
    if not face.fit.converged:
        warning = say("number.not_converged")
    elif not face.plausible:
        warning = say("number.implausible")
    if track.mode:
        letter = LETTERS[track.mode - 1]
        spoken = say("player.mode_spoken", place=text, letter=letter, d_l=d_l, d_s=d_s)
        under = f"{say('player.mode', letter=letter)}: {text}"
    else:
        metres = float(track.places[stop])
        spoken = say("number.spoken", distance=distance_text(metres), d_l=d_l, d_s=d_s)
        under = say("head.assumed", distance=text)
    return {
        "place": text,
        "d_l": d_l,
        "d_s": d_s,
        "under": under,
        "spoken": spoken,
        "warning": warning,
        "grey": not face.plausible,
    }


def _landmarks(faces: Sequence[Face], unit: float) -> NDArray[np.int32]:
    """(F, 2L) whole `unit`s of pixels: x and y of each projected landmark in turn."""
    return np.stack([np.round(face.projected / unit).astype(np.int32).ravel() for face in faces])


def _short(values: Array, digits: int) -> list[float]:
    return [float(f"{value:.{digits}g}") if value else 0.0 for value in values.tolist()]
