"""A Scene as a finished picture: photograph, heads, numbers, curves and words on one canvas.

Three layouts: the usual one (photograph, two heads, numbers and curves), a strip (several heads, a row for each view)
and the view through the camera (photograph beside the fitted face through its own camera). Each is laid out in units
on room of at least its own default size: a smaller picture shrinks all of it, a larger one gives room to the heads.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np

from ..arrays import Array
from ..scene import Head, Legend, Photo, Scene, View
from . import painter, plots, together
from .canvas import FINE, THIN, Canvas, Colour, Picture, Place
from .plots import D_L, D_S, DIM, INK, LINE

GROUND, PANEL, CARD = (0xF3, 0xF6, 0xF9), (0xFF, 0xFF, 0xFF), (0xF6, 0xF8, 0xFA)
OBSERVED, PROJECTED, HALO = (0xC8, 0x10, 0x2E), (0x1B, 0x5F, 0xC1), (0xFF, 0xFF, 0xFF)
TONES: Mapping[str, Colour] = {"dim": DIM, "d_l": D_L, "d_s": D_S}

USUAL, STRIP = (1440, 900), (1600, 760)  # default sizes, and the least room of a layout
SMALLEST, LARGEST = 160, 16384  # pixels of a side
MARGIN, COLUMN, CARD_HEIGHT = 18, 338, 122  # units; a column is what stands beside the heads
HEAD_WIDTH = 0.228  # metres across most heads, seen from any side: the room each is given
ROW_HEIGHT = 1.72  # times a view's half height: the room a head is given from top to bottom

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
    "d_l_axis": "Landmark error in %",
    "d_s_axis": "Surface difference in mm",
    "axis": "assumed camera distance in cm",
    "band": "under {tolerance}\u202f%: a person cannot tell",
    "not_converged": "No good fit here; the last step is shown.",
    "implausible": "no longer a plausible face",
    "bar": "{mm}\u202fmm",
    "bar_all": "{mm}\u202fmm, all views",
}


@dataclass(frozen=True, slots=True, eq=False)
class Sheet:
    """What every part of a picture draws with."""

    canvas: Canvas
    scene: Scene
    words: Mapping[str, str]
    panel: Colour  # behind what stands beside the heads
    pictures: dict[object, Picture]  # heads and photographs: drawn once, whatever is behind them


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

    width, height: pixels at scale 1; by default 1440 x 900, a strip 1600 x 760. transparent: nothing behind heads
    and words. words: replaces some of WORDS. ValueError for a size out of range, NoRendererError where heads are to
    be drawn and there is no OpenGL.
    """
    layout, least = _layout(scene)
    asked = (least[0] if width is None else width, least[1] if height is None else height)
    size = (round(scale * asked[0]), round(scale * asked[1]))
    for name, side in zip(("width", "height"), size, strict=True):
        if not SMALLEST <= side <= LARGEST:
            raise ValueError(f"{name}: {side} pixels, expected {SMALLEST} to {LARGEST}")
    unit = min(size[0] / least[0], size[1] / least[1])
    words = {**WORDS, **words}
    pictures: dict[object, Picture] = {}

    def drawn(ground: Colour, panel: Colour) -> Picture:
        sheet = Sheet(Canvas(size, unit, ground), scene, words, panel, pictures)
        layout(sheet)
        return sheet.canvas.pixels

    if not transparent:
        opaque = np.full((size[1], size[0], 1), 255, dtype=np.uint8)
        return np.concatenate([drawn(GROUND, PANEL), opaque], axis=2)
    black, white = (0, 0, 0), (255, 255, 255)
    return _without_ground(drawn(black, black), drawn(white, white))


def encode_png(rgba: Picture, text: Mapping[str, str]) -> bytes:
    """PNG file of an RGBA picture with `text` in it, names of 1 to 79 Latin-1 characters. Same input, same bytes."""
    from PIL import Image, PngImagePlugin  # comes with pyrender; OpenCV writes no text

    chunks = PngImagePlugin.PngInfo()
    for name, value in text.items():
        chunks.add_itxt(name, value)
    opaque = bool((rgba[..., 3] == 255).all())
    picture = Image.fromarray(np.ascontiguousarray(rgba[..., :3]) if opaque else rgba)
    file = io.BytesIO()
    picture.save(file, "PNG", pnginfo=chunks, compress_level=6)
    return file.getvalue()


def _layout(scene: Scene) -> tuple[Callable[[Sheet], None], tuple[int, int]]:
    """What lays the scene out, and the least room it needs."""
    if scene.through_camera:
        return _through_camera, USUAL
    if len(scene.views) > 1 or len(together.places(scene)) > 2:
        return _strip, STRIP
    return _usual, USUAL


def _without_ground(on_black: Picture, on_white: Picture) -> Picture:
    """RGBA of the same drawing on black and on white: where both agree it is opaque."""
    black, white = on_black.astype(np.float32), on_white.astype(np.float32)
    alpha = 255.0 - (white - black).mean(axis=2, keepdims=True)
    colour = np.where(alpha > 0, 255.0 * black / np.maximum(alpha, 1.0), 0.0)
    return np.concatenate([colour, alpha], axis=2).clip(0, 255).round().astype(np.uint8)


# ---- layouts ----


def _usual(sheet: Sheet) -> None:
    """Photograph, heads, numbers and curves side by side."""
    canvas, scene = sheet.canvas, sheet.scene
    width, height = canvas.room
    panel = COLUMN + 2 * MARGIN
    for x, edge in ((0.0, panel), (width - panel, width - panel)):
        canvas.fill(x, 0, panel, height, sheet.panel)
        canvas.line((edge, 0), (edge, height), LINE)
    tall = COLUMN * scene.photo.height / scene.photo.width
    y = (height - tall) / 2 - 6
    canvas.text(MARGIN, y - 14, sheet.words["photo"], 15, INK, 650)
    canvas.text(MARGIN + COLUMN, y - 14, scene.photo.caption, 13.5, DIM, anchor="end")
    _photo(sheet, MARGIN, y, COLUMN)
    _key(sheet, MARGIN, y + tall + 24, COLUMN)
    _heads(sheet, panel, width - 2 * panel)
    x = width - panel + MARGIN
    warning = _warning(sheet)
    warned = 26 if warning else 0
    block = CARD_HEIGHT + warned + (38 + plots.HEIGHT if scene.curves is not None else 0)
    y = (height - block) / 2
    _cards(sheet, x, y, COLUMN)
    if warning:
        canvas.text(x, y + CARD_HEIGHT + 26, *warning, most=COLUMN)
    if scene.curves is not None:
        y += CARD_HEIGHT + warned + 38
        true = "truth" not in scene.hide
        plots.curves(canvas, scene.curves, scene.numbers, sheet.words, x, y, COLUMN, true=true)


def _heads(sheet: Sheet, x: float, width: float) -> None:
    """One or two heads, titles above, scale bar and legend below."""
    canvas, scene = sheet.canvas, sheet.scene
    height = canvas.room[1]
    view = scene.views[0]
    places = together.places(scene)
    cell = (width - 2 * MARGIN) / max(2, len(places))
    ppm = min(cell / HEAD_WIDTH, (height - 230) / (ROW_HEIGHT * view.half_height))
    tall = ROW_HEIGHT * view.half_height * ppm
    top = (height - tall) / 2 - 6
    left = x + (width - cell * len(places)) / 2
    for index, heads in enumerate(places):
        middle = left + (index + 0.5) * cell
        _place(sheet, heads, view, (middle, top + tall / 2), (cell, tall), ppm)
        lines = heads[0].caption or ((_assumed(sheet, heads), "dim"),)
        start = top - 18 - 20 * len(lines)
        canvas.text(middle, start, _title(heads), 18, INK, 650, anchor="middle", most=cell - 8)
        for row, (line, tone) in enumerate(lines, start=1):
            canvas.text(
                middle, start + 2 + 20 * row, line, 14, TONES[tone], anchor="middle", most=cell - 8
            )
    below = top + tall + 44
    _bar(sheet, x + MARGIN + 4, below, ppm, "bar")
    if scene.legend is not None:
        _legend_across(canvas, scene.legend, x + width - MARGIN - 10, below)
    canvas.text(
        x + width / 2, height - 20, scene.note, 12.5, DIM, anchor="middle", most=width - 2 * MARGIN
    )


def _strip(sheet: Sheet) -> None:
    """All heads in a row, a row for each view, one scale."""
    canvas, scene = sheet.canvas, sheet.scene
    width, height = canvas.room
    beside = 176 if scene.legend is not None else MARGIN
    lines = max(len(head.caption) for head in scene.heads)
    top, bottom = 58, 56 + 22 * lines
    places = together.places(scene)
    cell = (width - MARGIN - beside) / len(places)
    tall = (height - top - bottom) / len(scene.views)
    ppm = min(cell / HEAD_WIDTH, *(tall / (ROW_HEIGHT * view.half_height) for view in scene.views))
    for index, heads in enumerate(places):
        middle = MARGIN + (index + 0.5) * cell
        canvas.text(middle, 38, _title(heads), 19, INK, 650, anchor="middle", most=cell - 8)
        for row, view in enumerate(scene.views):
            _place(sheet, heads, view, (middle, top + (row + 0.5) * tall), (cell, tall), ppm)
        for row, (line, tone) in enumerate(heads[0].caption):
            y = height - bottom + 22 + 22 * row
            canvas.text(middle, y, line, 15, TONES[tone], anchor="middle", most=cell - 6)
    if scene.legend is not None:
        area = height - top - bottom
        _legend_beside(canvas, scene.legend, width - beside + 40, top + 22, area - 44)
    key = "bar_all" if len(scene.views) > 1 else "bar"
    end = _bar(sheet, MARGIN, height - 24, ppm, key, beside=True)
    most = width - MARGIN - end - 40
    canvas.text(width - MARGIN, height - 19, scene.note, 13, DIM, anchor="end", most=most)


def _through_camera(sheet: Sheet) -> None:
    """The photograph, and the fitted face as its own camera sees it: the same points on two faces."""
    canvas, scene = sheet.canvas, sheet.scene
    width, height = canvas.room
    canvas.fill(0, 0, width, height, sheet.panel)
    share = scene.photo.height / scene.photo.width
    gap = 36
    side = min((width - 2 * MARGIN - gap) / 2, (height - 84 - CARD_HEIGHT - 40) / share)
    top, tall = 84, side * share
    left = (width - 2 * side - gap) / 2
    titles = {head.name: head.title for head in scene.heads}
    columns = (
        (left, titles.get("true", ""), scene.photo.caption),
        (left + side + gap, titles.get("fit", ""), _assumed(sheet, scene.heads[-1:])),
    )
    for x, title, line in columns:
        end = canvas.text(x, top - 16, title, 18, INK, 650, most=side)
        canvas.text(max(end + 14, x), top - 16, line, 14.5, DIM, most=side - (end - x) - 14)
    _photo(sheet, left, top, side)
    _photo(sheet, left + side + gap, top, side, fit=scene.photo.fit_vertices is not None)
    below = top + tall
    _key(sheet, left, below + 34, side)
    canvas.paragraph(left, below + 62, scene.note, 12.5, DIM, most=side, step=18)
    warning = _warning(sheet)
    if warning:
        canvas.text(left, below + 102, *warning, most=side)
    _cards(sheet, left + side + gap, below + 16, side)


# ---- heads and photographs ----


def _place(
    sheet: Sheet,
    heads: Sequence[Head],
    view: View,
    middle: tuple[float, float],
    room: tuple[float, float],
    ppm: float,
) -> None:
    """Heads with the scene's pivot at `middle`; ppm: units for a metre. They may stand out of their room a little."""
    unit = sheet.canvas.unit
    size = (round(1.16 * room[0] * unit), round(1.04 * room[1] * unit))
    key = (*(head.name for head in heads), view)
    if key not in sheet.pictures:
        sheet.pictures[key] = together.picture(sheet.scene, heads, view, size, ppm * unit)
    left, top = middle[0] - size[0] / (2 * unit), middle[1] - size[1] / (2 * unit)
    sheet.canvas.paste(left, top, sheet.pictures[key])
    for ends, tone in together.segments(sheet.scene, heads, view):
        for a, b in (middle + ppm * ends * (1.0, -1.0)).tolist():
            sheet.canvas.line((a[0], a[1]), (b[0], b[1]), together.TONES[tone], 0.8)


def _title(heads: Sequence[Head]) -> str:
    """What stands above the heads of one place."""
    return " / ".join(head.title for head in heads if head.title)


def _assumed(sheet: Sheet, heads: Sequence[Head]) -> str:
    """The line under a title where the scene gives none: the distance these faces belong to."""
    if len(heads) == 1 and heads[0].name == "true":
        return sheet.scene.photo.caption
    distance = sheet.scene.numbers.distance
    if distance is None:
        return sheet.words["far"]
    return sheet.words["assumed"].format(cm=f"{plots.centimetres(distance)}{THIN}cm")


def _photo(sheet: Sheet, x: float, y: float, width: float, *, fit: bool = False) -> None:
    """The photograph, or the fitted face through its own camera, with both kinds of points over it."""
    photo = sheet.scene.photo
    if fit not in sheet.pictures:
        pixels = round(width * sheet.canvas.unit)
        size = (pixels, max(1, round(photo.height * pixels / photo.width)))
        vertices, focal, colours = photo.vertices, photo.focal, photo.colours
        if fit and photo.fit_vertices is not None:
            vertices, focal = photo.fit_vertices, photo.fit_focal or photo.focal
            shown = sheet.scene.heads[-1] if sheet.scene.heads else None
            if shown is not None and shown.lit and shown.colours.shape == colours.shape:
                colours = shown.colours
        sheet.pictures[fit] = painter.paint(vertices, photo, focal, size, colours=colours)
    picture = sheet.pictures[fit]
    at = sheet.canvas.paste(x, y, picture, radius=8)
    step = picture.shape[1] / photo.width
    radius = (2.3 + 0.0055 * width) * sheet.canvas.unit
    _photo_lines(sheet.canvas, np.array(at), step, photo)
    if photo.points_shown:
        marks(sheet.canvas, np.array(at), step, photo, radius)
    if photo.names_shown:
        _names(sheet, np.array(at), step, radius)


def _photo_lines(canvas: Canvas, at: Array, step: float, photo: Photo) -> None:
    """The fitted face's outline, and from each cross the line to its circle, lengthened."""
    unit = canvas.unit
    if photo.outline is not None and len(photo.outline):
        xy = (at + step * photo.outline) / unit
        for a, b in pairwise(xy):
            if np.isfinite([a, b]).all():
                canvas.line((a[0], a[1]), (b[0], b[1]), PROJECTED, 1.3)
    if photo.error_scale:
        gaps = photo.error_scale * (photo.projected - photo.observed)
        for a, b in zip(photo.observed, photo.observed + gaps, strict=True):
            (x, y), (u, v) = (at + step * a) / unit, (at + step * b) / unit
            if np.isfinite([x, y, u, v]).all():
                canvas.line((x, y), (u, v), OBSERVED, 1.3)


def _names(sheet: Sheet, at: Array, step: float, radius: float) -> None:
    """The name of each point beside its cross."""
    canvas, photo = sheet.canvas, sheet.scene.photo
    for name, point in zip(photo.names, photo.observed, strict=True):
        x, y = (at + step * point + radius) / canvas.unit
        if np.isfinite([x, y]).all():
            canvas.text(x, y, name, 7.5, INK)


def marks(canvas: Canvas, at: Array, step: float, photo: Photo, radius: float) -> None:
    """Red crosses (observed) under blue circles (projected), all on one white halo.

    at (2,): pixels, the picture's upper left; step: pixels of the picture for one of the photo; radius in pixels.
    """
    points = [p[np.isfinite(p).all(axis=1)] * step + at for p in (photo.observed, photo.projected)]
    everything = np.concatenate(points)
    if not len(everything):
        return
    stroke, halo = max(1.0, 0.3 * radius), max(1.0, 0.24 * radius)
    arm = 0.68 * radius

    def crosses(width: float) -> Callable[[Picture, Place], None]:
        def paint(mask: Picture, place: Place) -> None:
            for point in points[0]:
                for turn in ((arm, arm), (arm, -arm)):
                    ends = place(np.array([point - turn, point + turn]))
                    cv2.polylines(mask, [ends], False, 255, max(1, round(FINE * width)), shift=4)

        return paint

    def circles(width: float) -> Callable[[Picture, Place], None]:
        def paint(mask: Picture, place: Place) -> None:
            for centre in place(points[1]):
                size = round(16 * FINE * radius)
                cv2.circle(mask, centre, size, 255, max(1, round(FINE * width)), shift=4)

        return paint

    pad = radius + stroke + halo
    for colour, paint in (
        (HALO, crosses(stroke + 2 * halo)),
        (HALO, circles(stroke + 2 * halo)),
        (OBSERVED, crosses(stroke)),
        (PROJECTED, circles(stroke)),
    ):
        canvas.ink(colour, everything, pad, paint)


def _key(sheet: Sheet, x: float, y: float, width: float) -> None:
    """Which mark is which, in one line."""
    canvas = sheet.canvas
    for a, b in ((-9, -1), (-1, -9)):
        canvas.line((x + 1, y + a), (x + 9, y + b), OBSERVED, 1.8)
    end = canvas.text(x + 15, y, sheet.words["cross"], 12.5, DIM, most=0.42 * width)
    canvas.circle((end + 19, y - 5), 4.6, PROJECTED, 1.7)
    canvas.text(end + 29, y, sheet.words["circle"], 12.5, DIM, most=x + width - end - 29)


# ---- numbers, scale and legend ----


def _cards(sheet: Sheet, x: float, y: float, width: float) -> None:
    """The two numbers whose disagreement is the lesson; what is hidden is asked for."""
    numbers, curves, hide = sheet.scene.numbers, sheet.scene.curves, sheet.scene.hide
    note = sheet.words["d_l_note_alone"]
    if curves is not None:
        note = sheet.words["d_l_note"].format(tolerance=f"{curves.tolerance_percent:g}")
    half = (width - 12) / 2
    d_l, d_s = percent(numbers.d_l_percent), f"{numbers.d_s_mm:.1f}"
    shown = (d_l, "%") if "numbers" not in hide else ("?", "")
    _card(sheet, "d_l", shown, note, x, y, half)
    shown = (d_s, "mm") if not hide & {"numbers", "truth"} else ("?", "")
    _card(sheet, "d_s", shown, sheet.words["d_s_note"], x + half + 12, y, half)


def _card(
    sheet: Sheet, which: str, value: tuple[str, str], note: str, x: float, y: float, width: float
) -> None:
    canvas, colour = sheet.canvas, TONES[which]
    canvas.fill(x, y, 20, CARD_HEIGHT, colour, radius=8)
    canvas.fill(x + 4, y, width - 4, CARD_HEIGHT, CARD, radius=8)
    canvas.text(x + 15, y + 25, sheet.words[which], 14, INK, 600, most=width - 22)
    end = canvas.text(x + 15, y + 58, value[0], 29, colour, 700)
    canvas.text(end + 4, y + 58, value[1], 16, colour, 600)
    canvas.paragraph(x + 15, y + 80, note, 12, DIM, most=width - 23, step=17)


def _warning(sheet: Sheet) -> tuple[str, float, Colour, int] | None:
    """Words, size, colour, weight: why not to take the numbers at face value, or what bends the face."""
    numbers = sheet.scene.numbers
    if not numbers.converged:
        return sheet.words["not_converged"], 13.0, OBSERVED, 600
    if not numbers.plausible:
        return sheet.words["implausible"], 13.0, OBSERVED, 600
    if numbers.flex_words:
        return f"{numbers.flex_words}: {numbers.flex_mm:+.1f}{THIN}mm", 13.0, DIM, 400
    return None


def percent(value: float) -> str:
    """d_L: 2 decimals below 1 %, 1 above."""
    return f"{value:.2f}" if value < 0.995 else f"{value:.1f}"


def _bar(sheet: Sheet, x: float, y: float, ppm: float, key: str, *, beside: bool = False) -> float:
    """The scale bar, its words below or beside it; returns where it ends."""
    canvas, end = sheet.canvas, x + sheet.scene.scale_bar * ppm
    if not sheet.scene.scale_bar:
        return x
    canvas.line((x, y), (end, y), INK, 1.6)
    for side in (x, end):
        canvas.line((side, y - 5), (side, y + 5), INK, 1.6)
    text = sheet.words[key].format(mm=f"{1e3 * sheet.scene.scale_bar:g}")
    if beside:
        return canvas.text(end + 10, y + 5, text, 14, INK)
    canvas.text((x + end) / 2, y + 24, text, 14, INK, anchor="middle")
    return end


def _legend_beside(canvas: Canvas, legend: Legend, x: float, y: float, height: float) -> None:
    """The colour scale upright, low at the bottom, title above and note below."""
    start = canvas.paragraph(x - 24, y, legend.title, 13, DIM, most=104, step=17) + 14
    height = y + height - start - 14
    canvas.ramp(x, start, 22, height, legend.colours, upright=True)
    for tick in legend.ticks:
        at = start + height * (legend.high - tick) / (legend.high - legend.low)
        canvas.line((x + 22, at), (x + 27, at), INK)
        canvas.text(x + 33, at + 5, f"{tick:g}", 14, INK)
    canvas.text(x - 24, start + height + 26, legend.note, 12.5, DIM, most=150)


def _legend_across(canvas: Canvas, legend: Legend, right: float, y: float) -> None:
    """The colour scale lying, ending at `right`, title above and note below."""
    width = 250
    x = right - width
    canvas.text(x, y - 16, legend.title, 13, DIM)
    canvas.ramp(x, y - 7, width, 14, legend.colours, upright=False)
    for tick in legend.ticks:
        at = x + width * (tick - legend.low) / (legend.high - legend.low)
        canvas.line((at, y + 7), (at, y + 11), INK)
        canvas.text(at, y + 25, f"{tick:g}", 13, INK, anchor="middle")
    canvas.text(x, y + 46, legend.note, 12.5, DIM)
