"""The standalone page: a track or several in one HTML file that plays from disk, with no network and no Python.

The script (assets/player.js) draws what lies in the file and computes nothing of the face: at a stop it shows the
words of the pipeline for it, while it plays it moves between stops. The policy in its head allows that script and its
style by their hashes and nothing else: no request, no eval, no style attribute.
"""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from hashlib import sha256
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceambig.arrays import Array
from faceambig.compose import (
    DIFFERENCE_MM,
    HALF_HEIGHT,
    UNMEASURED,
    VIEWS,
    Face,
    difference_legend,
    pivot,
    skin,
)
from faceambig.io.files import asset_path
from faceambig.scene import Photo, Scene

from . import pipeline, trackplots
from .packing import TOLERANCE_MM, directions, packed, rounded, step_of
from .provenance import file_name, provenance, shown, who
from .state import ViewState, changed
from .text import centimetres, distance_text, percent_number, say
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
MARKS = (
    0.2,
    0.3,
    0.6,
    1.2,
    2.4,
    3.0,
)  # metres: stops in any case; those that stand still at reduced motion
OCTAVE_SECONDS, SWING_SECONDS = 2.0, 4.0
HALF_WIDTH = 0.125  # metres to either side of a head, as far as the page shows
PHOTO_WIDTH, QUALITY = 560, 88
LANDMARK_SHARE = 30_000  # a landmark is rounded to this part of the picture's longer side
LIGHTS = (  # as on the page: direction towards the light (right, up, back), colour of 255, intensity
    ((-0.5, 0.7, 1.2), (255, 244, 232), 2.8),
    ((0.9, 0.1, 0.8), (235, 242, 255), 0.7),
    ((0.0, 0.6, -1.0), (255, 250, 245), 0.9),
)
AMBIENT, OCCLUSION_POWER = 0.75, 1.3
CROSS, CIRCLE = 3.6, 4.6  # half sizes, pixels of a picture of 500


def page(
    state: ViewState, *, whats: Sequence[str] = ("distance",), own_photo: bool = False
) -> tuple[str, bytes]:
    """(name, contents) of the HTML file: the way along the distance, or the swings of modes A, B, C, or both.

    whats: of WHATS. own_photo: a photograph of one's own goes into the file; a synthetic one always does.
    """
    if not whats or any(what not in WHATS for what in whats):
        raise ValueError(f"whats: {', '.join(whats)!r} is not one or more of {', '.join(WHATS)}")
    state = changed(state, show="both")
    tracks = tracks_of(state, whats)
    scene = pipeline.frame(state, with_curves=False).scene
    own = scene.photo.pixels is not None
    photo = scene.photo if own_photo or not own else replace(scene.photo, pixels=None)
    data, geometry = contents(state, scene, tracks)
    words = "_".join((shown(state) if "mode" in whats else who(state), *whats))
    html = filled(
        state, tracks, photo, data, geometry, said=say("player.left_out") if own and not own_photo else ""
    )  # fmt: skip
    return file_name(words, "html"), html.encode()


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
    taken = pipeline.photograph(state.target)
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
        "view": scene.views[0].name if scene.views[0].name in VIEWS else "three_quarter",
        "difference": state.surface == "difference",
        "legend": {"colours": legend.colours.tolist(), "mm": DIFFERENCE_MM, "rest": UNMEASURED},
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
        "cursor": [_short(values, 2) for values in (x, y_l, y_s)],
        "weights": [_short(row, 7) for row in weights],
        "stops": [stop_words(track, stop) for stop in range(len(track.places))],
    }


def stop_words(track: Track, stop: int) -> dict[str, Any]:
    """What is shown and said at a stop: the same numbers, written the same way, as on the page."""
    face, text = track.faces[stop], place_text(track, stop)
    d_l, d_s = percent_number(face.d_l_percent), f"{face.d_s_mm:.1f}"
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


# ---- the file ----


def filled(
    state: ViewState, tracks: Sequence[Track], photo: Photo, data: Mapping[str, Any], geometry: str, *, said: str = ""
) -> str:  # fmt: skip
    """The HTML of assets/player.html with its places filled in. `said`: one more line of the footer."""
    style, script = (_asset(f"player.{ending}") for ending in ("css", "js"))
    origin = provenance(state)
    points = len(photo.observed)
    lead = (
        say("player.lead", actual=distance_text(state.actual), points=points)
        if not tracks[0].mode
        else say(
            "player.lead_modes",
            actual=distance_text(state.actual),
            assumed=distance_text(tracks[0].faces[0].fit.distance),
            points=points,
        )
    )
    return _substituted(
        _asset("player.html"),
        {
            "policy": policy(script, style),
            "style": style,
            "script": script,
            "data": json.dumps(data, separators=(",", ":"), ensure_ascii=False).replace("<", r"\u003c"),
            "geometry": geometry,
            "metas": "\n".join(
                f'<meta name="faceambig:{name.lower()}" content="{escape(value)}">'
                for name, value in origin.items()
            ),
            "photo": photo_html(photo),
            "plots": "".join(
                f'<div data-track="{track.name}"{" hidden" if i else ""}>{trackplots.plots(track, state.actual)}</div>'
                for i, track in enumerate(tracks)
            ),
            "tables": "".join(table(track) for track in tracks),
            "tracks": _buttons("track", {t.name: _button(t) for t in tracks}, tracks[0].name)
            if len(tracks) > 1
            else "",
            "views": _buttons("view", {v: say(f"view.{v}") for v in VIEWS}, str(data["view"])),
            "origin": "".join(f"<dt>{escape(k)}</dt><dd>{escape(v)}</dd>" for k, v in origin.items()),
            "said": f"<p>{escape(said)}</p>" if said else "",
            "true_note": escape(say("head.taken", distance=centimetres(state.actual))),
            "lead": escape(lead),
            "label": escape(label(tracks[0])),
            "last": str(len(tracks[0].places) - 1),
            "start": str(data["tracks"][0]["start"]),
            "legend": legend_html(),
            **{name: escape(text) for name, text in _words(state).items()},
        },
    )  # fmt: skip


def _words(state: ViewState) -> dict[str, str]:
    origin = provenance(state)
    return {
        "heading": say("app.heading"),
        "true": say("head.true"),
        "fit": say("head.fit"),
        "d_l": say("number.d_l"),
        "d_l_note": say("number.d_l_note"),
        "d_s": say("number.d_s"),
        "d_s_note": say("number.d_s_note"),
        "play": say("player.play"),
        "difference": say("player.difference"),
        "heads": say("player.heads"),
        "keys": say("player.keys"),
        "table": say("player.table"),
        "views_name": say("player.views"),
        "no_script": say("player.no_script"),
        "no_faces": say("player.no_faces"),
        "rounded": say("player.rounded", mm=f"{TOLERANCE_MM:g}"),
        "made": say("player.made"),
        "software": origin["Software"],
        "model": origin["Model"].split(":")[0],
        "licence": origin["Licence"],
    }


def policy(script: str, style: str) -> str:
    """The content security policy: this script, this style, pictures inside the file; no connection of any kind."""
    s, c = (base64.b64encode(sha256(text.encode()).digest()).decode() for text in (script, style))
    return (
        f"default-src 'none'; script-src 'sha256-{s}'; style-src 'sha256-{c}'; img-src data:; base-uri 'none'; "
        "form-action 'none'; require-trusted-types-for 'script'; trusted-types 'none'"
    )


def photo_html(photo: Photo) -> str:
    """The photograph with red crosses and, for the script to move, blue circles; a white halo around both."""
    unit = photo.width / 500
    size = (PHOTO_WIDTH, max(1, round(photo.height * PHOTO_WIDTH / photo.width)))
    arm = CROSS * unit
    crosses = "".join(
        f"M{x - arm:.1f} {y - arm:.1f}l{2 * arm:.1f} {2 * arm:.1f}m0 {-2 * arm:.1f}l{-2 * arm:.1f} {2 * arm:.1f}"
        for x, y in photo.observed
        if np.isfinite(x + y)
    )
    alt = escape(say("player.photo", points=len(photo.observed), caption=photo.caption))
    return (
        f'<img alt="{alt}" width="{size[0]}" height="{size[1]}" '
        f'src="data:image/jpeg;base64,{base64.b64encode(_jpeg(photo)).decode()}">'
        f'<svg viewBox="0 0 {photo.width} {photo.height}" aria-hidden="true" fill="none">'
        f'<g stroke="#FFF" stroke-width="{3.4 * unit:.1f}"><path d="{crosses}"/><path data-circles/></g>'
        f'<g stroke-width="{1.7 * unit:.1f}"><path class="seen" d="{crosses}"/><path class="fitted" data-circles/></g>'
        f"</svg><figcaption><span>{escape(photo.caption)}</span>"
        f"<span>{_key('seen', 'M2 2l8 8m0 -8l-8 8')}{escape(say('app.cross'))}</span>"
        f"<span>{_key('fitted', 'M1.5 6a4.5 4.5 0 1 0 9 0a4.5 4.5 0 1 0 -9 0')}{escape(say('app.circle'))}</span>"
        "</figcaption>"
    )


def _key(tone: str, path: str) -> str:
    return f'<svg viewBox="0 0 12 12" aria-hidden="true" fill="none"><path class="{tone}" d="{path}"/></svg>'


def _jpeg(photo: Photo) -> bytes:
    import cv2

    from faceambig.render.painter import paint_photo

    rgb = paint_photo(photo, PHOTO_WIDTH) if photo.pixels is None else photo.pixels
    return cv2.imencode(".jpg", rgb[:, :, ::-1], (cv2.IMWRITE_JPEG_QUALITY, QUALITY))[1].tobytes()


def legend_html() -> str:
    """The scale of the difference as an SVG, its ticks below."""
    legend = difference_legend("", "")
    width = 200 / len(legend.colours)
    bars = "".join(
        f'<rect x="{10 + i * width:.2f}" y="2" width="{width + 0.3:.2f}" height="10" shape-rendering="crispEdges" fill="#{r:02x}{g:02x}{b:02x}"/>'
        for i, (r, g, b) in enumerate(legend.colours.tolist())
    )
    ticks = "".join(
        f'<text x="{10 + 200 * tick / legend.high:.1f}" y="26" text-anchor="middle">{tick:g}</text>'
        for tick in legend.ticks
    )
    words = f"{say('legend.difference')}; {say('legend.unmeasured')}"
    return (
        f'<svg viewBox="0 0 220 30" width="220" height="30" aria-hidden="true">{bars}{ticks}</svg>'
        f"<span>{escape(words)}</span>"
    )


def table(track: Track) -> str:
    """Every stop in numbers."""
    place = say("plot.axis") if not track.mode else say("player.axis_mode")
    rows = []
    for stop in range(len(track.places)):
        words = stop_words(track, stop)
        rows.append(
            f"<tr><td>{words['place']}</td><td>{words['d_l']}</td><td>{words['d_s']}</td></tr>"
        )
    heads = "".join(
        f'<th scope="col">{escape(name)}</th>' for name in (place, say("plot.d_l"), say("plot.d_s"))
    )
    return f"<table><caption>{escape(label(track))}</caption><thead><tr>{heads}</tr></thead><tbody>{''.join(rows)}</tbody></table>"


def _button(track: Track) -> str:
    return (
        say("player.distance")
        if not track.mode
        else say("player.mode", letter=LETTERS[track.mode - 1])
    )


def _buttons(kind: str, names: Mapping[str, str], pressed: str) -> str:
    name = say("player.tracks") if kind == "track" else say("player.views")
    buttons = "".join(
        f'<button type="button" data-{kind}-button="{key}" aria-pressed="{str(key == pressed).lower()}">{escape(text)}</button>'
        for key, text in names.items()
    )
    return f'<div class="group" role="group" aria-label="{escape(name)}">{buttons}</div>'


def _asset(name: str) -> str:
    return asset_path(name).read_text(encoding="utf-8")


def _substituted(template: str, values: Mapping[str, str]) -> str:
    """{{name}} replaced; in one pass, so what was filled in is not read."""
    return re.sub(r"\{\{(\w+)\}\}", lambda place: values[place.group(1)], template)
