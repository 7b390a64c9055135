"""The two plots of a track as SVG: landmark error over surface difference, one axis, one cursor for the script to move.

No style attributes: the page they stand in forbids them. Colours are classes of assets/player.css.
"""

from __future__ import annotations

from html import escape

import numpy as np

from faceambig.arrays import Array
from faceambig.metrics import HUMAN_TOLERANCE_PERCENT

from ..text import centimetres, say
from .tracks import Track

WIDTH, HEIGHT, LEFT, RIGHT = 340, 262, 34, 330
D_L_TOP, D_L_BOTTOM, D_S_TOP, D_S_BOTTOM = 24, 94, 128, 222
D_L_MAX = 6.0  # percent
TICKS_CM = (20, 30, 60, 120, 240)
TICKS_MM = (-5, -2.5, 0, 2.5, 5)


def along(track: Track) -> Array:
    """(F,) 0 to 1: where the stops lie on the way, distances evenly in ratio."""
    return _share(track, track.places)


def cursor_places(track: Track) -> tuple[Array, Array, Array]:
    """x, y of the landmark error and y of the surface difference, (F,) each, in the plot's units."""
    d_l = np.array([face.d_l_percent for face in track.faces])
    d_s = np.array([face.d_s_mm for face in track.faces])
    return (
        LEFT + along(track) * (RIGHT - LEFT),
        _height(d_l, D_L_MAX, D_L_TOP, D_L_BOTTOM),
        _height(d_s, _d_s_axis(track), D_S_TOP, D_S_BOTTOM),
    )


def plots(track: Track, true_distance: float) -> str:
    """The SVG; its cursor is the path, the circle and the square of class "cursor", empty of places."""
    x, y_l, y_s = cursor_places(track)
    top = _d_s_axis(track)
    band = float(_height(np.array(HUMAN_TOLERANCE_PERCENT), D_L_MAX, D_L_TOP, D_L_BOTTOM))
    title_l, title_s = escape(say("plot.d_l")), escape(say("plot.d_s"))
    axis = say("player.axis_mode") if track.mode else say("plot.axis")
    true_line, true_words = ("", "") if track.mode else _true_line(track, true_distance)
    # Words above the upright lines, on a rim of the ground (player.css): no line crosses letters
    return "".join(
        (
            f'<svg class="plot" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{title_l}, {title_s}">',
            f'<rect class="band" x="{LEFT}" y="{band:.1f}" width="{RIGHT - LEFT}" height="{D_L_BOTTOM - band:.1f}"/>',
            *(_grid(v, D_L_MAX, D_L_TOP, D_L_BOTTOM) for v in (0, 3, 6)),
            *(_grid(v, top, D_S_TOP, D_S_BOTTOM) for v in np.arange(0, top + 1, top / 3)),
            true_line,
            f'<g class="cursor"><path d="M0 {D_L_TOP}V{D_S_BOTTOM}"/></g>',
            f'<text class="name dl" x="2" y="14">{title_l}</text>',
            f'<text class="name ds" x="2" y="{D_S_TOP - 10}">{title_s}</text>',
            f'<text class="on" x="{RIGHT - 3}" y="{band + 13:.1f}" text-anchor="end">{escape(say("plot.band"))}</text>',
            *_ticks(track),
            f'<text x="{(LEFT + RIGHT) / 2}" y="257" text-anchor="middle">{escape(axis)}</text>',
            true_words,
            f'<polyline class="line dl" points="{_line(x, y_l)}"/>',
            f'<polyline class="line ds" points="{_line(x, y_s)}"/>',
            '<g class="cursor"><circle class="dl" r="4.5"/><rect class="ds" width="8.4" height="8.4"/></g></svg>',
        )
    )


def _share(track: Track, places: Array) -> Array:
    low, high = track.places[0], track.places[-1]
    if track.mode:
        return (places - low) / (high - low)
    return np.log(places / low) / np.log(high / low)


def _d_s_axis(track: Track) -> float:
    """End of the axis of the surface difference: 12 mm, growing in steps that three lines part in whole numbers."""
    return 12.0 * max(1.0, np.ceil(max(face.d_s_mm for face in track.faces) / 12.0))


def _height(values: Array, most: float, top: int, bottom: int) -> Array:
    return bottom - np.clip(values, 0.0, most) / most * (bottom - top)


def _line(x: Array, y: Array) -> str:
    return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))


def _grid(value: float, most: float, top: int, bottom: int) -> str:
    y = float(_height(np.array(value), most, top, bottom))
    return (
        f'<path class="grid" d="M{LEFT} {y:.1f}H{RIGHT}"/>'
        f'<text x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{value:g}</text>'
    )


def _ticks(track: Track) -> list[str]:
    ticks = TICKS_MM if track.mode else TICKS_CM
    places = np.array(ticks) / (1.0 if track.mode else 100.0)
    within = (places >= track.places[0] - 1e-9) & (places <= track.places[-1] + 1e-9)
    return [
        f'<path class="tick" d="M{x:.1f} {D_S_BOTTOM}v4"/>'
        f'<text x="{x:.1f}" y="{D_S_BOTTOM + 17}" text-anchor="middle">{f"{tick:g}".replace("-", "−")}</text>'
        for tick, x, inside in zip(
            ticks, LEFT + _share(track, places) * (RIGHT - LEFT), within, strict=True
        )
        if inside
    ]


def _true_line(track: Track, metres: float) -> tuple[str, str]:
    """The line of the true distance, and its words."""
    if not track.places[0] <= metres <= track.places[-1]:
        return "", ""
    x = LEFT + float(_share(track, np.array(metres))) * (RIGHT - LEFT)
    anchor, shift = ("end", -4) if x > (LEFT + RIGHT) / 2 else ("start", 4)
    words = escape(say("plot.true", distance=centimetres(metres)))
    return (
        f'<path class="true" d="M{x:.1f} {D_L_TOP}V{D_S_BOTTOM}"/>',
        f'<text x="{x + shift:.1f}" y="{D_S_TOP + 10}" text-anchor="{anchor}">{words}</text>',
    )
