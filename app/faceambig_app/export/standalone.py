"""The standalone page as text: assets/player.html with its style, script, words, photograph, plots and tables.

The policy in its head allows that script and that style by their digests and nothing else: no request, no eval, no
style attribute, no markup made by the script.
"""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Mapping, Sequence
from hashlib import sha256
from html import escape
from typing import Any

import numpy as np

from faceambig.compose import VIEWS, difference_legend
from faceambig.io.files import asset_path
from faceambig.scene import Photo

from ..state import ViewState
from ..text import centimetres, distance_text, language, numeral, percent_number, say
from . import trackplots
from .packing import TOLERANCE_MM
from .provenance import provenance
from .tracks import LETTERS, Track, label, place_text

PHOTO_WIDTH, QUALITY = 560, 88
CROSS, CIRCLE = 3.6, 4.6  # half sizes, pixels of a picture of 500


def html(
    state: ViewState, tracks: Sequence[Track], photo: Photo, data: Mapping[str, Any], geometry: str, *, said: str = ""
) -> str:  # fmt: skip
    """The page. data, geometry: what its script reads. said: one more line of the footer."""
    style, script = (_asset(f"player.{ending}") for ending in ("css", "js"))
    names = {track.name: _button(track) for track in tracks}
    texts = _words(state) | {
        "lead": _lead(state, tracks[0], len(photo.observed)),
        "label": label(tracks[0]),
        "true_note": say("head.taken", distance=centimetres(state.actual)),
    }
    markup = {
        "script_digest": digest(script),
        "style_digest": digest(style),
        "style": style,
        "script": script,
        "data": _json(data),
        "geometry": geometry,
        "metas": _metas(state),
        "photo": photo_html(photo),
        "plots": _plots(state, tracks),
        "tables": "".join(table(track) for track in tracks),
        "tracks": _buttons("track", say("player.tracks"), names, tracks[0].name) if len(tracks) > 1 else "",
        "views": _buttons("view", say("player.views"), {v: say(f"view.{v}") for v in VIEWS}, str(data["view"])),
        "origin": "".join(
            f"<dt>{escape(k)}</dt><dd>{escape(v)}</dd>" for k, v in provenance(state).items()
        ),
        "said": f"<p>{escape(said)}</p>" if said else "",
        "last": str(len(tracks[0].places) - 1),
        "start": str(data["tracks"][0]["start"]),
        "legend": legend_html(),
    }  # fmt: skip
    return _substituted(
        _asset("player.html"), {name: escape(text) for name, text in texts.items()} | markup
    )


def _lead(state: ViewState, track: Track, points: int) -> str:
    actual = distance_text(state.actual)
    if not track.mode:
        return say("player.lead", actual=actual, points=points)
    assumed = distance_text(track.faces[0].fit.distance)
    return say("player.lead_modes", actual=actual, assumed=assumed, points=points)


def _json(data: Mapping[str, Any]) -> str:
    """JSON that may stand inside a script element."""
    return json.dumps(data, separators=(",", ":"), ensure_ascii=False).replace("<", r"\u003c")


def _metas(state: ViewState) -> str:
    return "\n".join(
        f'<meta name="faceambig:{name.lower()}" content="{escape(value)}">'
        for name, value in provenance(state).items()
    )


def _plots(state: ViewState, tracks: Sequence[Track]) -> str:
    return "".join(
        f'<div data-track="{track.name}"{"" if track is tracks[0] else " hidden"}>'
        f"{trackplots.plots(track, state.actual)}</div>"
        for track in tracks
    )


def _words(state: ViewState) -> dict[str, str]:
    origin = provenance(state)
    return {
        "lang": language(),
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
        "no_script": say("player.no_script"),
        "no_faces": say("player.no_faces"),
        "rounded": say("player.rounded", mm=f"{TOLERANCE_MM:g}"),
        "made": say("player.made"),
        "software": origin["Software"],
        "model": origin["Model"].split(":")[0],
        "licence": origin["Licence"],
    }


def digest(text: str) -> str:
    """By which the policy knows the script or the style: base 64 of SHA-256."""
    return base64.b64encode(sha256(text.encode()).digest()).decode()


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
        f'<rect x="{10 + i * width:.2f}" y="2" width="{width + 0.3:.2f}" height="10" '
        f'shape-rendering="crispEdges" fill="#{r:02x}{g:02x}{b:02x}"/>'
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
    axis = say("player.axis_mode") if track.mode else say("plot.axis")
    heads = "".join(
        f'<th scope="col">{escape(name)}</th>' for name in (axis, say("plot.d_l"), say("plot.d_s"))
    )
    rows = "".join(
        f"<tr><td>{place_text(track, stop)}</td><td>{percent_number(face.d_l_percent)}</td>"
        f"<td>{numeral(f'{face.d_s_mm:.1f}')}</td></tr>"
        for stop, face in enumerate(track.faces)
    )
    name = escape(label(track))
    return f"<table><caption>{name}</caption><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table>"


def _button(track: Track) -> str:
    if not track.mode:
        return say("player.distance")
    return say("player.mode", letter=LETTERS[track.mode - 1])


def _buttons(kind: str, name: str, texts: Mapping[str, str], pressed: str) -> str:
    buttons = "".join(
        f'<button type="button" data-{kind}-button="{key}" aria-pressed="{str(key == pressed).lower()}">'
        f"{escape(text)}</button>"
        for key, text in texts.items()
    )
    return f'<div class="group" role="group" aria-label="{escape(name)}">{buttons}</div>'


def _asset(name: str) -> str:
    return asset_path(name).read_text(encoding="utf-8")


def _substituted(template: str, values: Mapping[str, str]) -> str:
    """{{name}} replaced; in one pass, so what was filled in is not read."""
    return re.sub(r"\{\{(\w+)\}\}", lambda place: values[place.group(1)], template)
