"""A Scene as a finished picture: photograph, heads, numbers, curves and words on one canvas.

Three layouts: the usual one (photograph, two heads, numbers and curves), a strip (several heads, a row for each view) and
the view through the camera (photograph beside the fitted face through its own camera). Each is laid out in units on a
canvas of at least its own default size; a smaller picture shrinks all of it, a larger one gives the room to the heads.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from ..arrays import Array
from ..scene import Curves, Head, Legend, Numbers, Photo, Scene, View
from . import gl, painter

Picture = NDArray[np.uint8]
Colour = tuple[int, int, int]  # sRGB

INK, DIM, LINE = (0x1D, 0x27, 0x33), (0x52, 0x60, 0x6D), (0xD5, 0xDC, 0xE3)
GROUND, PANEL, CARD, BAND = (
    (0xF3, 0xF6, 0xF9),
    (0xFF, 0xFF, 0xFF),
    (0xF6, 0xF8, 0xFA),
    (0xE3, 0xEA, 0xF2),
)
OBSERVED, PROJECTED, HALO = (0xC8, 0x10, 0x2E), (0x1B, 0x5F, 0xC1), (0xFF, 0xFF, 0xFF)
D_L, D_S, WARN = PROJECTED, (0xA8, 0x4A, 0x00), OBSERVED
TONES: Mapping[str, Colour] = {"dim": DIM, "d_l": D_L, "d_s": D_S}

USUAL, STRIP, CAMERA = (
    (1440, 900),
    (1600, 760),
    (1440, 900),
)  # default sizes; also the least room of each layout
SMALLEST, LARGEST = 160, 16384  # pixels of a side
MARGIN, COLUMN = 24, 348  # units: around everything, and the columns beside the heads
HEAD_WIDTH = 0.238  # metres across a head seen from any side: the room of one column
AXIS_CM, TICKS_CM = (20.0, 300.0), (20, 30, 60, 120, 240)  # of the curves
THIN = "\u2009"

WORDS: Mapping[str, str] = {
    "cross": "point in the photo",
    "circle": "same point of the fitted face",
    "assumed": "assumed {cm}",
    "far": "assumed far away (orthographic)",
    "d_l": "Landmark error",
    "d_l_note": "of the eye distance. A person\nclicks within {tolerance}" + THIN + "%.",
    "d_l_note_alone": "of the eye distance",
    "d_s": "Surface difference",
    "d_s_note": "mean distance to the true\nface, rigidly aligned",
    "d_l_axis": "Landmark error (%)",
    "d_s_axis": "Surface difference (mm)",
    "axis": "assumed camera distance (cm)",
    "band": "a person cannot tell (under {tolerance}" + THIN + "%)",
    "true": "true {cm}",
    "far_tick": "far",
    "not_converged": "No good fit here; the last step is shown.",
    "implausible": "no longer a plausible face",
    "bar": "{mm}" + THIN + "mm",
    "bar_all": "{mm}" + THIN + "mm, all views",
    "photo": "The photograph",
    "own_camera": "through its own camera",
}


def draw(
    scene: Scene,
    width: int | None = None,
    height: int | None = None,
    *,
    scale: float = 1.0,
    transparent: bool = False,
    words: Mapping[str, str] = WORDS,
) -> Picture:
    """(H, W, 4) RGBA picture of a scene, H = scale * height and W = scale * width.

    width, height: units of the layout, pixels at scale 1; by default 1440 x 900, a strip 1600 x 760. transparent: nothing
    behind heads and words. words: replaces some or all of WORDS. Raises ValueError for a size out of range, NoRendererError
    where heads are to be drawn and no OpenGL is found.
    """
    layout, least = _layout(scene)
    units = (width or least[0], height or least[1])
    size = tuple(round(scale * side) for side in units)
    for name, side in zip(("width", "height"), size, strict=True):
        if not SMALLEST <= side <= LARGEST:
            raise ValueError(f"{name}: {side} pixels are not within {SMALLEST} to {LARGEST}")
    unit = min(size[0] / least[0], size[1] / least[1])
    words = {**WORDS, **words}
    pictures: dict[object, Picture] = {}  # heads are drawn once, whatever is behind them
    if not transparent:
        canvas = Canvas(size, unit, GROUND, PANEL, pictures)
        layout(canvas, scene, words)
        return np.dstack([canvas.pixels, np.full(size[::-1], 255, dtype=np.uint8)])
    both = [Canvas(size, unit, ground, ground, pictures) for ground in ((0, 0, 0), (255, 255, 255))]
    for canvas in both:
        layout(canvas, scene, words)
    return _without_ground(both[0].pixels, both[1].pixels)


def encode_png(rgba: Picture, text: Mapping[str, str]) -> bytes:
    """PNG file of an RGBA picture with `text` inside (names of 1 to 79 Latin-1 characters). Same input, same bytes."""
    from PIL import Image, PngImagePlugin  # comes with pyrender; cv2 writes no text into a PNG

    chunks = PngImagePlugin.PngInfo()
    for name, value in text.items():
        chunks.add_itxt(name, value)
    opaque = bool((rgba[..., 3] == 255).all())
    file = io.BytesIO()
    Image.fromarray(rgba[..., :3] if opaque else rgba).save(
        file, "PNG", pnginfo=chunks, compress_level=6
    )
    return file.getvalue()


def _layout(scene: Scene):
    """The function that lays the scene out, and the least room it needs."""
    if scene.through_camera:
        return _through_camera, CAMERA
    if len(scene.views) > 1 or len(scene.heads) > 2:
        return _strip, STRIP
    return _usual, USUAL


def _without_ground(on_black: Picture, on_white: Picture) -> Picture:
    """RGBA from the same drawing on black and on white: what both show is opaque, their difference is seen through."""
    black, white = on_black.astype(np.float32), on_white.astype(np.float32)
    alpha = 255.0 - (white - black).mean(axis=2, keepdims=True)
    colour = np.where(alpha > 0, 255.0 * black / np.maximum(alpha, 1.0), 0.0)
    return np.concatenate([colour, alpha], axis=2).clip(0, 255).round().astype(np.uint8)


# ---- layouts, in units ----


def _usual(canvas: Canvas, scene: Scene, words: Mapping[str, str]) -> None:
    width, height = canvas.room
    panel = COLUMN + 2 * MARGIN
    for x in (0, width - panel):
        canvas.fill(x, 0, panel, height, canvas.panel)
    canvas.line((panel, 0), (panel, height), LINE)
    canvas.line((width - panel, 0), (width - panel, height), LINE)
    _photo_panel(canvas, scene.photo, words, MARGIN, (height - COLUMN - 90) / 2)
    _heads(canvas, scene, words, panel, width - 2 * panel, height)
    _numbers_panel(canvas, scene, words, width - panel + MARGIN, height)


def _photo_panel(
    canvas: Canvas, photo: Photo, words: Mapping[str, str], x: float, y: float
) -> None:
    tall = COLUMN * photo.height / photo.width
    canvas.text(x, y - 14, words["photo"], 15, INK, 650)
    canvas.text(x + COLUMN, y - 14, photo.caption, 13, DIM, anchor="end")
    _photo(canvas, photo, x, y, COLUMN)
    _key(canvas, words, x, y + tall + 22)


def _heads(
    canvas: Canvas, scene: Scene, words: Mapping[str, str], x: float, width: float, height: float
) -> None:
    """One or two heads in the middle, titles above, bar and legend below."""
    view = scene.views[0]
    cell = (width - 2 * MARGIN) / max(2, len(scene.heads))
    ppm = min(cell / HEAD_WIDTH, (height - 240) / (2 * view.half_height))
    tall = min(height - 200, 2.1 * view.half_height * ppm)
    top = (height - tall) / 2 + 8
    left = x + (width - cell * len(scene.heads)) / 2
    for index, head in enumerate(scene.heads):
        at = left + index * cell
        canvas.head(head, view, scene, (at, top, cell, tall), ppm)
        lines = head.caption or ((_standing(scene, index, words), "dim"),)
        canvas.text(
            at + cell / 2, top - 34, head.title, 18, INK, 650, anchor="middle", most=cell - 8
        )
        for row, (line, tone) in enumerate(lines):
            canvas.text(
                at + cell / 2,
                top - 12 + 18 * row,
                line,
                14,
                TONES[tone],
                anchor="middle",
                most=cell - 8,
            )
    below = top + tall + 34
    _bar(canvas, x + MARGIN + 4, below, scene.scale_bar, ppm, words["bar"])
    if scene.legend is not None:
        _legend_across(canvas, scene.legend, x + width - MARGIN - 4, below)
    canvas.text(
        x + width / 2, height - 18, scene.note, 12.5, DIM, anchor="middle", most=width - 2 * MARGIN
    )


def _standing(scene: Scene, index: int, words: Mapping[str, str]) -> str:
    """What the line under a title says where the scene gives none: whose distance this face belongs to."""
    if index == 0 and len(scene.heads) > 1:
        return scene.photo.caption
    distance = scene.numbers.distance
    return (
        words["far"]
        if distance is None
        else words["assumed"].format(cm=_cm(distance) + THIN + "cm")
    )


def _numbers_panel(
    canvas: Canvas, scene: Scene, words: Mapping[str, str], x: float, height: float
) -> None:
    curves = scene.curves
    block = 122 + (420 if curves is not None else 0)
    y = max(MARGIN, (height - block) / 2)
    half = (COLUMN - 12) / 2
    _card(canvas, scene, words, "d_l", x, y, half)
    _card(canvas, scene, words, "d_s", x + half + 12, y, half)
    _warning(canvas, scene.numbers, words, x, y + 140)
    if curves is not None:
        _plots(canvas, curves, scene.numbers, words, x, y + 176)


def _strip(canvas: Canvas, scene: Scene, words: Mapping[str, str]) -> None:
    width, height = canvas.room
    beside = 170 if scene.legend is not None else MARGIN
    lines = max(len(head.caption) for head in scene.heads)
    top, bottom = 56, 54 + 22 * lines
    cell = (width - MARGIN - beside) / len(scene.heads)
    tall = (height - top - bottom) / len(scene.views)
    # A head fills less than the height a view asks for: rows may stand a little closer.
    ppm = min(cell / HEAD_WIDTH, tall / (1.8 * scene.views[0].half_height))
    for index, head in enumerate(scene.heads):
        x = MARGIN + index * cell
        canvas.text(x + cell / 2, 36, head.title, 19, INK, 650, anchor="middle", most=cell - 8)
        for row, view in enumerate(scene.views):
            canvas.head(head, view, scene, (x, top + row * tall, cell, tall), ppm)
        for row, (line, tone) in enumerate(head.caption):
            y = height - bottom + 22 + 22 * row
            canvas.text(x + cell / 2, y, line, 15, TONES[tone], anchor="middle", most=cell - 6)
    if scene.legend is not None:
        _legend_beside(
            canvas, scene.legend, width - beside + 44, top + 20, height - top - bottom - 40
        )
    bar = words["bar_all" if len(scene.views) > 1 else "bar"]
    taken = _bar(canvas, MARGIN, height - 24, scene.scale_bar, ppm, bar, beside=True)
    canvas.text(
        width - MARGIN,
        height - 20,
        scene.note,
        13,
        DIM,
        anchor="end",
        most=width - taken - 3 * MARGIN,
    )


def _through_camera(canvas: Canvas, scene: Scene, words: Mapping[str, str]) -> None:
    width, height = canvas.room
    photo = scene.photo
    canvas.fill(0, 0, width, height, canvas.panel)
    share = photo.height / photo.width
    side = min((width - 3 * MARGIN) / 2, (height - 260) / share)
    left = (width - 2 * side - 40) / 2
    top, tall = 88, side * share
    titles = [head.title for head in scene.heads] + ["", ""]
    own = _standing(scene, len(scene.heads), words)
    for x, title, line in ((left, titles[0], photo.caption), (left + side + 40, titles[1], own)):
        canvas.text(x, top - 38, title, 18, INK, 650, most=side)
        canvas.text(x, top - 14, line, 14, DIM, most=side)
    _photo(canvas, photo, left, top, side)
    if photo.fit_vertices is not None:
        shown = scene.heads[-1] if scene.heads else None
        _photo(canvas, photo, left + side + 40, top, side, fit=True, head=shown)
    _key(canvas, words, left, top + tall + 28)
    y = top + tall + 14
    right = left + side + 40
    _card(canvas, scene, words, "d_l", right, y, (side - 12) / 2)
    _card(canvas, scene, words, "d_s", right + (side + 12) / 2, y, (side - 12) / 2)
    _warning(canvas, scene.numbers, words, left, top + tall + 84)
    canvas.text(left, height - 22, scene.note, 12.5, DIM, most=side)


# ---- parts, in units ----


def _photo(
    canvas: Canvas,
    photo: Photo,
    x: float,
    y: float,
    width: float,
    *,
    fit: bool = False,
    head: Head | None = None,
) -> None:
    """The photograph or the fitted face through its own camera, with both kinds of points over it."""
    picture = canvas.photo(photo, width, fit, head)
    at = canvas.paste(x, y, picture, radius=8)
    radius = 3.2 + 0.0045 * width
    step = picture.shape[1] / photo.width
    marks(canvas.pixels, at, step, photo, radius * canvas.unit)


def marks(pixels: Picture, at: tuple[int, int], step: float, photo: Photo, radius: float) -> None:
    """Red crosses (observed) under blue circles (projected), one white halo around all, drawn into `pixels`.

    at: the picture's first column and row; step: pixels of the picture for one of the photo; radius in pixels.
    """
    shift, thin = 4, max(1, round(0.36 * radius))
    halo = thin + max(2, round(0.4 * radius))
    arm = 0.72 * radius

    def fixed(point: Array) -> tuple[int, int]:
        # Pixel i spans i to i + 1 in the photo; OpenCV counts from its centre.
        return tuple(int(v) for v in np.round((np.asarray(at) + step * point - 0.5) * 2**shift))

    crosses = [p for p in photo.observed if np.isfinite(p).all()]
    circles = [p for p in photo.projected if np.isfinite(p).all()]
    for red, blue, thickness in ((HALO, HALO, halo), (OBSERVED, PROJECTED, thin)):
        for point in crosses:
            for turn in ((arm, arm), (arm, -arm)):
                ends = (point - np.array(turn) / step, point + np.array(turn) / step)
                cv2.line(pixels, fixed(ends[0]), fixed(ends[1]), red, thickness, cv2.LINE_AA, shift)
        for point in circles:
            cv2.circle(
                pixels, fixed(point), round(radius * 2**shift), blue, thickness, cv2.LINE_AA, shift
            )


def _key(canvas: Canvas, words: Mapping[str, str], x: float, y: float) -> None:
    """Which mark is which, in one line."""
    canvas.line((x + 1, y - 9), (x + 9, y - 1), OBSERVED, 2)
    canvas.line((x + 1, y - 1), (x + 9, y - 9), OBSERVED, 2)
    end = canvas.text(x + 16, y, words["cross"], 13, DIM)
    canvas.circle((end + 22, y - 5), 4.6, PROJECTED, 2)
    canvas.text(end + 34, y, words["circle"], 13, DIM)


def _card(
    canvas: Canvas,
    scene: Scene,
    words: Mapping[str, str],
    which: str,
    x: float,
    y: float,
    width: float,
) -> None:
    """One of the two numbers whose disagreement is the lesson."""
    if which == "d_l":
        value, unit = _percent(scene.numbers.d_l_percent), "%"
    else:
        value, unit = f"{scene.numbers.d_s_mm + 0.0:.1f}", "mm"
    colour = TONES[which]
    canvas.fill(x, y, width, 122, colour, radius=8)
    canvas.fill(x + 4, y, width - 4, 122, CARD, radius=8)
    canvas.text(x + 16, y + 26, words[which], 14, INK, 600, most=width - 24)
    end = canvas.text(x + 16, y + 60, value, 29, colour, 700)
    canvas.text(end + 4, y + 60, unit, 16, colour, 600)
    note = words[f"{which}_note"]
    if "{tolerance}" in note:
        known = scene.curves is not None
        note = (
            note.format(tolerance=f"{scene.curves.tolerance_percent:g}")
            if known
            else words["d_l_note_alone"]
        )
    for row, line in enumerate(note.split("\n")):
        canvas.text(x + 16, y + 84 + 18 * row, line, 12.5, DIM, most=width - 22)


def _warning(
    canvas: Canvas, numbers: Numbers, words: Mapping[str, str], x: float, y: float
) -> None:
    """What keeps the numbers from being taken at their face value, and what bends the face."""
    if not numbers.converged:
        canvas.text(x, y, words["not_converged"], 13, WARN, 600, most=COLUMN)
    elif not numbers.plausible:
        canvas.text(x, y, words["implausible"], 13, WARN, 600, most=COLUMN)
    elif numbers.flex_words:
        amount = f"{numbers.flex_mm:+.1f}{THIN}mm"
        canvas.text(x, y, f"{numbers.flex_words}: {amount}", 13, DIM, most=COLUMN)


def _bar(
    canvas: Canvas,
    x: float,
    y: float,
    length: float,
    ppm: float,
    words: str,
    *,
    beside: bool = False,
) -> float:
    """The scale bar, its words below or beside it; returns where it ends."""
    end = x + length * ppm
    canvas.line((x, y), (end, y), INK, 2)
    for side in (x, end):
        canvas.line((side, y - 5), (side, y + 5), INK, 2)
    text = words.format(mm=f"{1e3 * length:g}")
    if beside:
        return canvas.text(end + 10, y + 5, text, 14, INK)
    canvas.text((x + end) / 2, y + 24, text, 14, INK, anchor="middle")
    return end


def _legend_beside(canvas: Canvas, legend: Legend, x: float, y: float, height: float) -> None:
    """The colour scale upright, low at the bottom, title above."""
    title = _wrapped(legend.title, 20)
    for row, line in enumerate(title):
        canvas.text(x + 11, y + 15 * row, line, 13, DIM, anchor="middle")
    top = y + 15 * len(title)
    height -= 15 * len(title) + 20
    canvas.ramp(x, top, 22, height, legend.colours, upright=True)
    for tick in legend.ticks:
        at = top + height * (legend.high - tick) / (legend.high - legend.low)
        canvas.line((x + 22, at), (x + 27, at), INK)
        canvas.text(x + 33, at + 5, f"{tick:g}", 14, INK)
    canvas.text(x + 11, top + height + 24, legend.note, 12.5, DIM, anchor="middle")


def _legend_across(canvas: Canvas, legend: Legend, right: float, y: float) -> None:
    """The colour scale lying, ending at `right`, title above."""
    width = 250
    x = right - width
    canvas.text(right, y - 16, legend.title, 13, DIM, anchor="end")
    canvas.ramp(x, y - 8, width, 14, legend.colours, upright=False)
    for tick in legend.ticks:
        at = x + width * (tick - legend.low) / (legend.high - legend.low)
        canvas.line((at, y + 6), (at, y + 10), INK)
        canvas.text(at, y + 24, f"{tick:g}", 13, INK, anchor="middle")
    canvas.text(right, y + 44, legend.note, 12.5, DIM, anchor="end")


# ---- the two curves ----


class Axes(NamedTuple):
    """Where a value stands in a plot. Units; `high` is the value at the top, 0 at the bottom."""

    left: float
    right: float
    top: float
    bottom: float
    high: float
    cm: tuple[float, float] = AXIS_CM

    def x(self, metres: Array | float) -> Array:
        low, high = np.log2(self.cm)
        return self.left + (np.log2(100.0 * np.asarray(metres)) - low) / (high - low) * (
            self.right - self.left
        )

    def y(self, value: Array | float) -> Array:
        share = np.clip(np.asarray(value) / self.high, 0.0, 1.0)
        return self.bottom - share * (self.bottom - self.top)


def _plots(
    canvas: Canvas, curves: Curves, numbers: Numbers, words: Mapping[str, str], x: float, y: float
) -> None:
    """d_L above d_S on one distance axis; one cursor through both, one dotted line at the true distance."""
    left, right = x + 26, x + COLUMN - 34
    far = x + COLUMN - 12  # a place of its own: the far-away camera is no point of the axis
    tallest = [max(np.max(c), v, o) for c, v, o in zip(
        (curves.d_l_percent, curves.d_s_mm), (numbers.d_l_percent, numbers.d_s_mm), curves.orthographic, strict=True
    )]  # fmt: skip
    upper = Axes(left, right, y + 20, y + 120, 3.0 * max(2, np.ceil(tallest[0] / 3.0)))
    lower = Axes(left, right, y + 166, y + 300, 4.0 * max(3, np.ceil(tallest[1] / 4.0)))
    tolerance = f"{curves.tolerance_percent:g}"
    canvas.text(x, y + 6, words["d_l_axis"], 13, D_L, 650)
    start = canvas.text(
        x + COLUMN, y + 6, words["band"].format(tolerance=tolerance), 11.5, DIM, anchor="end"
    )
    canvas.fill(start - 18, y - 4, 13, 10, BAND)
    canvas.text(x, y + 152, words["d_s_axis"], 13, D_S, 650)
    band = float(upper.y(curves.tolerance_percent))
    canvas.fill(left, band, far + 8 - left, upper.bottom - band, BAND)
    _grid(canvas, upper, 3 if upper.high <= 12 else 6, far + 8)
    _grid(canvas, lower, 4 if lower.high <= 16 else 8, far + 8)
    _distance_axis(canvas, curves, numbers, words, (upper, lower), far)
    canvas.curve(upper.x(curves.distances), upper.y(curves.d_l_percent), D_L, 2.2, dash=(7, 4))
    canvas.curve(lower.x(curves.distances), lower.y(curves.d_s_mm), D_S, 2.2)
    canvas.circle((far, float(upper.y(curves.orthographic[0]))), 3.4, D_L, 1.6)
    canvas.square((far, float(lower.y(curves.orthographic[1]))), 3.2, D_S, 1.6)
    at = far if numbers.distance is None else float(upper.x(numbers.distance))
    for axes in (upper, lower):
        canvas.line((at, axes.top - 2), (at, axes.bottom), INK, 1.6)
    canvas.circle((at, float(upper.y(numbers.d_l_percent))), 5, D_L)
    canvas.square((at, float(lower.y(numbers.d_s_mm))), 4.6, D_S)


def _grid(canvas: Canvas, axes: Axes, step: int, end: float) -> None:
    for value in np.arange(0, axes.high + 0.5 * step, step):
        y = float(axes.y(value))
        canvas.line((axes.left, y), (end, y), LINE)
        canvas.text(axes.left - 7, y + 4.5, f"{value:g}", 12.5, DIM, anchor="end")


def _distance_axis(
    canvas: Canvas,
    curves: Curves,
    numbers: Numbers,
    words: Mapping[str, str],
    plots: tuple[Axes, Axes],
    far: float,
) -> None:
    """Ticks, the dotted line at the truth, and under them what is true and what is assumed, pushed apart."""
    lower = plots[1]
    for cm in TICKS_CM:
        x = float(lower.x(cm / 100))
        canvas.line((x, lower.bottom), (x, lower.bottom + 4), DIM)
        canvas.text(x, lower.bottom + 18, str(cm), 12.5, DIM, anchor="middle")
    canvas.line((far, lower.bottom), (far, lower.bottom + 4), DIM)
    canvas.text(far, lower.bottom + 18, words["far_tick"], 12.5, DIM, anchor="middle")
    labels = []
    if AXIS_CM[0] <= 100 * curves.true_distance <= AXIS_CM[1]:
        x = float(lower.x(curves.true_distance))
        labels.append((x, words["true"].format(cm=_cm(curves.true_distance)), DIM))
        for axes in plots:
            canvas.line((x, axes.top - 2), (x, axes.bottom), DIM, 1.4, dash=(2, 4))
    if numbers.distance is not None:
        x = float(lower.x(numbers.distance))
        labels.append((x, words["assumed"].format(cm=_cm(numbers.distance)), INK))
    middles = _apart(
        [x for x, _, _ in labels],
        [canvas.wide(text, 12.5, 600) + 10 for _, text, _ in labels],
        lower.left - 26,
        far + 12,
    )
    for middle, (_, text, colour) in zip(middles, labels, strict=True):
        canvas.text(middle, lower.bottom + 37, text, 12.5, colour, 600, anchor="middle")
    canvas.text(
        (lower.left + lower.right) / 2, lower.bottom + 58, words["axis"], 12.5, DIM, anchor="middle"
    )


def _apart(
    middles: Sequence[float], widths: Sequence[float], low: float, high: float
) -> list[float]:
    """The middles of labels moved as little as needed: inside low to high, and two of them not over each other."""
    inside = [min(max(m, low + w / 2), high - w / 2) for m, w in zip(middles, widths, strict=True)]
    if len(inside) < 2:
        return inside
    first, second = (0, 1) if inside[0] <= inside[1] else (1, 0)
    need = (widths[0] + widths[1]) / 2
    centre = (inside[0] + inside[1]) / 2
    if inside[second] - inside[first] < need:
        left = min(
            max(centre - need / 2, low + widths[first] / 2), high - widths[second] / 2 - need
        )
        inside[first], inside[second] = left, left + need
    return inside


# ---- words and numbers ----


def _percent(value: float) -> str:
    """2 decimals below 1 %, 1 above."""
    return f"{value + 0.0:.2f}" if round(value, 2) < 1 else f"{value:.1f}"


def _cm(metres: float) -> str:
    """Centimetres of 3 significant digits, without an exponent."""
    digits = 2 - int(np.floor(np.log10(100.0 * metres)))
    return (
        f"{round(100.0 * metres, digits):.{max(digits, 0)}f}".rstrip("0").rstrip(".")
        if digits > 0
        else (f"{round(100.0 * metres, digits):.0f}")
    )


def _wrapped(text: str, most: int) -> list[str]:
    """Lines of at most `most` characters, broken at spaces."""
    lines = [""]
    for word in text.split():
        joined = f"{lines[-1]} {word}".strip()
        if len(joined) <= most or not lines[-1]:
            lines[-1] = joined
        else:
            lines.append(word)
    return lines


# ---- the canvas ----


class Canvas:
    """Pixels and the size of a unit on them. Positions are units from the upper left, colours sRGB."""

    def __init__(
        self,
        size: tuple[int, ...],
        unit: float,
        ground: Colour,
        panel: Colour,
        pictures: dict[object, Picture],
    ) -> None:
        self.pixels: Picture = np.full((size[1], size[0], 3), ground, dtype=np.uint8)  # RGB
        self.unit = unit  # pixels
        self.panel = panel  # colour of the columns beside the heads
        self.room = (size[0] / unit, size[1] / unit)  # units
        self.boxes: list[
            tuple[str, float, float, float, float]
        ] = []  # every text with its box, for tests
        self._pictures = pictures
        self._font = cv2.FontFace("sans")

    def text(
        self,
        x: float,
        y: float,
        text: str,
        size: float,
        colour: Colour,
        weight: int = 400,
        *,
        anchor: str = "start",
        most: float | None = None,
    ) -> float:
        """Write on the base line y; anchor start, middle or end at x. Shrunk, then cut with dots, to `most` units.

        Returns where the words end ("end": where they start).
        """
        text = text.replace("\u202f", THIN)  # the font has no narrow no-break space
        while most is not None and size > 9 and self.wide(text, size, weight) > most:
            size -= 0.5
        while most is not None and len(text) > 2 and self.wide(text, size, weight) > most:
            text = text.rstrip("…")[:-1] + "…"
        wide = self.wide(text, size, weight)
        left = x - {"start": 0.0, "middle": 0.5, "end": 1.0}[anchor] * wide
        org = (round(left * self.unit), round(y * self.unit))
        if text:
            cv2.putText(self.pixels, text, org, colour, self._font, self._size(size), weight)
            self.boxes.append((text, left, y - 0.8 * size, wide, size))
        return left if anchor == "end" else left + wide

    def wide(self, text: str, size: float, weight: int) -> float:
        """Width of words in units."""
        text = text.replace("\u202f", THIN)
        return (
            cv2.getTextSize((0, 0), text, (0, 0), self._font, self._size(size), weight)[2]
            / self.unit
        )

    def _size(self, size: float) -> int:
        return max(1, round(size * self.unit))

    def fill(
        self, x: float, y: float, width: float, height: float, colour: Colour, *, radius: float = 0
    ) -> None:
        """A rectangle, its corners rounded."""
        left, top, right, bottom = (round(v * self.unit) for v in (x, y, x + width, y + height))
        part = self.pixels[max(top, 0) : bottom, max(left, 0) : right]
        if radius:
            cover = _rounded(part.shape[0], part.shape[1], radius * self.unit)
            part[:] = (part + cover * (np.array(colour) - part.astype(np.float32))).round()
        else:
            part[:] = colour

    def line(
        self,
        a: tuple[float, float],
        b: tuple[float, float],
        colour: Colour,
        width: float = 1,
        *,
        dash: tuple[float, float] | None = None,
    ) -> None:
        self.curve(np.array([a[0], b[0]]), np.array([a[1], b[1]]), colour, width, dash=dash)

    def curve(
        self,
        x: Array,
        y: Array,
        colour: Colour,
        width: float,
        *,
        dash: tuple[float, float] | None = None,
    ) -> None:
        """A line through points, dashed by (drawn, left out) units."""
        points = np.stack([x, y], axis=1) * self.unit - 0.5
        thick = max(1, round(width * self.unit))
        if thick % 2 == 0 and len(x) == 2:
            points = np.round(points - 0.5) + 0.5  # an even line stands between two pixels: sharp
        elif len(x) == 2 and (x[0] == x[1] or y[0] == y[1]):
            points = np.round(points)
        pieces = [points] if dash is None else _dashes(points, [d * self.unit for d in dash])
        fixed = [np.round(piece * 16).astype(np.int32) for piece in pieces]
        cv2.polylines(self.pixels, fixed, False, colour, thick, cv2.LINE_AA, 4)

    def circle(
        self, at: tuple[float, float], radius: float, colour: Colour, width: float = 0
    ) -> None:
        """Filled, or a ring of `width`."""
        centre = tuple(round((v * self.unit - 0.5) * 16) for v in at)
        thick = max(1, round(width * self.unit)) if width else -1
        cv2.circle(
            self.pixels, centre, round(radius * self.unit * 16), colour, thick, cv2.LINE_AA, 4
        )

    def square(
        self, at: tuple[float, float], half: float, colour: Colour, width: float = 0
    ) -> None:
        """Filled, or an outline of `width`."""
        a, b = (tuple(round((v + s * half) * self.unit - 0.5) for v in at) for s in (-1, 1))
        thick = max(1, round(width * self.unit)) if width else -1
        cv2.rectangle(self.pixels, a, b, colour, thick)

    def ramp(
        self,
        x: float,
        y: float,
        width: float,
        height: float,
        colours: NDArray[np.uint8],
        *,
        upright: bool,
    ) -> None:
        """Colours (K, 3) evenly spaced over a rectangle, the first at the bottom or at the left."""
        left, top, right, bottom = (round(v * self.unit) for v in (x, y, x + width, y + height))
        n = bottom - top if upright else right - left
        at = np.linspace(0, len(colours) - 1, n)
        band = np.stack(
            [np.interp(at, np.arange(len(colours)), colours[:, k]) for k in range(3)], axis=1
        ).round()
        self.pixels[top:bottom, left:right] = band[::-1, None] if upright else band[None]

    def paste(self, x: float, y: float, picture: Picture, *, radius: float = 0) -> tuple[int, int]:
        """RGB or RGBA pixels with their upper left at (x, y); returns that pixel's column and row."""
        left, top = round(x * self.unit), round(y * self.unit)
        picture = picture[: self.pixels.shape[0] - top, : self.pixels.shape[1] - left]
        part = self.pixels[top : top + picture.shape[0], left : left + picture.shape[1]]
        cover = _rounded(*part.shape[:2], radius * self.unit)
        if picture.shape[2] == 4:
            cover = cover * picture[..., 3:] / 255.0
        part[:] = (part + cover * (picture[..., :3] - part.astype(np.float32))).round()
        return left, top

    def head(
        self,
        head: Head,
        view: View,
        scene: Scene,
        cell: tuple[float, float, float, float],
        ppm: float,
    ) -> None:
        """A head in the middle of a cell (x, y, width, height); ppm units for a metre."""
        key = (head.name, view)
        size = (round(cell[2] * self.unit), round(cell[3] * self.unit))
        if key not in self._pictures:
            middle = _middle(scene.heads[0], view)
            self._pictures[key] = gl.render_head(head, view, *size, ppm * self.unit, middle=middle)
        self.paste(cell[0], cell[1], self._pictures[key])

    def photo(self, photo: Photo, width: float, fit: bool, head: Head | None) -> Picture:
        """The photograph, or the fitted face through its own camera, `width` units wide."""
        if fit not in self._pictures:
            pixels = round(width * self.unit)
            size = (pixels, max(1, round(photo.height * pixels / photo.width)))
            vertices, focal = photo.vertices, photo.focal
            colours = photo.colours
            if fit and photo.fit_vertices is not None:
                vertices, focal = photo.fit_vertices, photo.fit_focal or photo.focal
                if head is not None and head.lit and head.colours.shape == colours.shape:
                    colours = head.colours
            self._pictures[fit] = painter.paint(vertices, photo, focal, size, colours=colours)
        return self._pictures[fit]


def _middle(head: Head, view: View) -> tuple[float, float]:
    """The point of the first head that stands in the middle of every cell, metres right and up."""
    seen = head.vertices @ gl.viewer_rotation(view)[:2].T
    low, high = seen.min(axis=0), seen.max(axis=0)
    middle = (low + high) / 2
    # Of a bust that is too tall the top is shown, not the middle.
    return float(middle[0]), float(max(middle[1], high[1] - 0.9 * view.half_height))


def _rounded(height: int, width: int, radius: float) -> NDArray[np.float32]:
    """(H, W, 1) cover 0 to 1 of a rectangle with rounded corners."""
    if not radius:
        return np.ones((height, width, 1), dtype=np.float32)
    x = np.abs(np.arange(width) + 0.5 - width / 2) - (width / 2 - radius)
    y = np.abs(np.arange(height) + 0.5 - height / 2) - (height / 2 - radius)
    out = np.hypot(np.maximum(x, 0)[None], np.maximum(y, 0)[:, None]) - radius
    return np.clip(0.5 - out, 0.0, 1.0).astype(np.float32)[..., None]


def _dashes(points: Array, dash: Sequence[float]) -> list[Array]:
    """The drawn pieces of a dashed line through points (n, 2); dash: lengths drawn and left out."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    pieces = []
    for start in np.arange(0.0, along[-1], dash[0] + dash[1]):
        end = min(start + dash[0], along[-1])
        inner = along[(along > start) & (along < end)]
        at = np.concatenate([[start], inner, [end]])
        pieces.append(np.stack([np.interp(at, along, points[:, k]) for k in range(2)], axis=1))
    return pieces
