"""A Scene as a finished picture: photograph, heads, numbers, curves and words on one canvas.

Three layouts: the usual one (photograph, two heads, numbers and curves), a strip (several heads, a row for each view)
and the view through the camera (photograph beside the fitted face through its own camera). Each is laid out in units
on room of at least its own default size: a smaller picture shrinks all of it, a larger one gives room to the heads.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping

import numpy as np

from ..scene import Scene
from . import gauges, plots
from .canvas import Canvas, Colour, Picture
from .gauges import CARD_HEIGHT
from .heads import places, standing
from .marked import photograph
from .plots import DIM, INK, LINE
from .sheet import GROUND, PANEL, TONES, WORDS, Pictures, Sheet

USUAL, STRIP = (1440, 900), (1600, 760)  # default sizes, and the least room of a layout
SMALLEST, LARGEST = 160, 16384  # pixels of a side
MARGIN, COLUMN = 18, 338  # units; a column is what stands beside the heads
HEAD_WIDTH = 0.228 / 0.165  # times a view's half height: the room a head is given across, and
ROW_HEIGHT = 1.72  # from top to bottom


def draw(
    scene: Scene,
    width: int | None = None,
    height: int | None = None,
    *,
    scale: float = 1.0,
    transparent: bool = False,
    overlays: bool = True,
    words: Mapping[str, str] = WORDS,
    step: Callable[[], None] | None = None,
) -> Picture:
    """(H, W, 4) RGBA picture of a scene, H = scale * height and W = scale * width.

    width, height: pixels at scale 1; by default 1440 x 900, a strip 1600 x 760. transparent: nothing behind heads
    and words. overlays: False leaves out all words, marks, lines, numbers and scales: the heads alone, or, through
    the camera, both photographs. words: replaces some of WORDS. step: called before each head and photograph, which is
    what takes long; what it raises ends the drawing. ValueError for a size out of range, NoRendererError where heads
    are to be drawn and there is no OpenGL.
    """
    layout, least = _layout(scene) if overlays else (_bare, _layout(scene)[1])
    asked = (least[0] if width is None else width, least[1] if height is None else height)
    size = (round(scale * asked[0]), round(scale * asked[1]))
    for name, side in zip(("width", "height"), size, strict=True):
        if not SMALLEST <= side <= LARGEST:
            raise ValueError(f"{name}: {side} pixels, expected {SMALLEST} to {LARGEST}")
    unit = min(size[0] / least[0], size[1] / least[1])
    words = {**WORDS, **words}
    pictures = Pictures() if step is None else Pictures(step=step)

    def drawn(ground: Colour, panel: Colour) -> Picture:
        canvas = Canvas(size, unit, ground)
        sheet = Sheet(canvas, scene, words, panel, pictures, bare=not overlays)
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
    if len(scene.views) > 1 or len({head.slot for head in scene.heads}) > 2:
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
    photograph(sheet, MARGIN, y, COLUMN)
    gauges.key(sheet, MARGIN, y + tall + 24, COLUMN)
    _heads(sheet, panel, width - 2 * panel)
    _numbers(sheet, width - panel + MARGIN)


def _numbers(sheet: Sheet, x: float) -> None:
    """The column of numbers, warnings and curves, in the middle of the picture's height."""
    scene = sheet.scene
    tall = 0.0 if "numbers" in scene.hide else CARD_HEIGHT
    plotted = 0.0 if scene.curves is None else 38 + plots.height(scene.curves, scene.hide)
    y = (sheet.canvas.room[1] - tall - gauges.warned(sheet) - plotted) / 2
    gauges.cards(sheet, x, y, COLUMN)
    y += tall + gauges.warn(sheet, x, y + tall, COLUMN)
    if scene.curves is not None:
        plots.curves(
            sheet.canvas, scene.curves, scene.numbers, sheet.words, x, y + 38, COLUMN,
            hide=scene.hide,
        )  # fmt: skip


def _heads(sheet: Sheet, x: float, width: float) -> None:
    """One or two places of heads, titles above, scale bar and legend below."""
    canvas, scene = sheet.canvas, sheet.scene
    height = canvas.room[1]
    view, rows = scene.views[0], places(sheet)
    cell = (width - 2 * MARGIN) / max(2, len(rows))
    most = height - 230
    ppm = min(cell / HEAD_WIDTH, most / ROW_HEIGHT) / view.half_height
    tall = ROW_HEIGHT * view.half_height * ppm
    top = (height - tall) / 2 - 6
    left = x + (width - cell * len(rows)) / 2
    for index, heads in enumerate(rows):
        middle = left + (index + 0.5) * cell
        standing(sheet, heads, view, (middle, top + tall / 2), (cell, tall), ppm)
        lines = gauges.under(sheet, heads)
        start = top - 18 - 20 * len(lines)
        title = gauges.title(heads)
        room = cell - 8 if len(rows) > 1 else width - 2 * MARGIN
        canvas.text(middle, start, title, 18, INK, 650, anchor="middle", most=room)
        for row, (line, tone) in enumerate(lines, start=1):
            canvas.text(
                middle, start + 2 + 20 * row, line, 14, TONES[tone], anchor="middle", most=cell - 8
            )
    below = top + tall + 44
    gauges.bar(sheet, x + MARGIN + 4, below, ppm, "bar")
    if scene.legend is not None:
        gauges.legend_across(canvas, scene.legend, x + width - MARGIN - 10, below)
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
    rows = places(sheet)
    cell = (width - MARGIN - beside) / len(rows)
    tall = (height - top - bottom) / len(scene.views)
    ppm = _scale(scene, cell, tall)
    for index, heads in enumerate(rows):
        middle = MARGIN + (index + 0.5) * cell
        canvas.text(middle, 38, gauges.title(heads), 19, INK, 650, anchor="middle", most=cell - 8)
        for row, view in enumerate(scene.views):
            standing(sheet, heads, view, (middle, top + (row + 0.5) * tall), (cell, tall), ppm)
        for row, (line, tone) in enumerate(line for head in heads for line in head.caption):
            y = height - bottom + 22 + 22 * row
            canvas.text(middle, y, line, 15, TONES[tone], anchor="middle", most=cell - 6)
    if scene.legend is not None:
        area = height - top - bottom
        gauges.legend_beside(canvas, scene.legend, width - beside + 40, top + 22, area - 44)
    key = "bar_all" if len(scene.views) > 1 else "bar"
    end = gauges.bar(sheet, MARGIN, height - 24, ppm, key, beside=True)
    most = width - MARGIN - end - 40
    canvas.text(width - MARGIN, height - 19, scene.note, 13, DIM, anchor="end", most=most)


def _scale(scene: Scene, cell: float, tall: float) -> float:
    """Units for a metre: every view of a head has room in a cell of this size, and all have one scale."""
    largest = max(view.half_height for view in scene.views)
    return min(cell / HEAD_WIDTH, tall / ROW_HEIGHT) / largest


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
        (left, titles.get("true", sheet.words["photo"]), scene.photo.caption),
        (left + side + gap, titles.get("fit", ""), gauges.assumed(sheet)),
    )
    for x, title, line in columns:
        end = canvas.text(x, top - 16, title, 18, INK, 650, most=side)
        canvas.text(max(end + 14, x), top - 16, line, 14.5, DIM, most=side - (end - x) - 14)
    photograph(sheet, left, top, side)
    photograph(sheet, left + side + gap, top, side, fit=scene.photo.fit_vertices is not None)
    below = top + tall
    gauges.key(sheet, left, below + 34, side)
    y = canvas.paragraph(left, below + 62, scene.note, 12.5, DIM, most=side, step=18)
    gauges.warn(sheet, left, max(y, below + 80) - 4, side)
    gauges.cards(sheet, left + side + gap, below + 16, side)


def _bare(sheet: Sheet) -> None:
    """Heads alone, or both photographs, as large as the picture allows."""
    scene = sheet.scene
    width, height = sheet.canvas.room
    if scene.through_camera:
        share = scene.photo.height / scene.photo.width
        side = min((width - MARGIN) / 2, height / share)
        y, left = (height - side * share) / 2, (width - 2 * side - MARGIN) / 2
        photograph(sheet, left, y, side)
        photograph(sheet, left + side + MARGIN, y, side, fit=scene.photo.fit_vertices is not None)
        return
    rows = places(sheet)
    cell, tall = width / len(rows), height / len(scene.views)
    ppm = _scale(scene, cell, tall)
    for index, heads in enumerate(rows):
        for row, view in enumerate(scene.views):
            middle = ((index + 0.5) * cell, (row + 0.5) * tall)
            standing(sheet, heads, view, middle, (cell, tall), ppm)
