"""What stands beside and below heads: which mark is which, titles, numbers, warnings, the bar, the colour scale."""

from __future__ import annotations

from collections.abc import Sequence

from ..scene import Head, Legend
from . import plots
from .canvas import THIN, Canvas, Colour
from .plots import DIM, INK
from .sheet import CARD, OBSERVED, PROJECTED, TONES, Sheet

CARD_HEIGHT = 122  # units
# Units: the first line of warnings below the cards, and each further one
WARNING, WARNING_STEP = (
    26.0,
    19.0,
)


def under(sheet: Sheet, heads: Sequence[Head]) -> tuple[tuple[str, str], ...]:
    """The lines under a title: the heads' own, else the distance this face belongs to."""
    lines = tuple(line for head in heads for line in head.caption)
    if lines:
        return lines
    if all(head.name == "true" for head in heads):
        return ((sheet.scene.photo.caption, "dim"),)
    return ((assumed(sheet), "dim"),)


def assumed(sheet: Sheet) -> str:
    """The distance the fitted face belongs to."""
    distance = sheet.scene.numbers.distance
    if distance is None:
        return sheet.words["far"]
    return sheet.words["assumed"].format(cm=f"{plots.centimetres(distance)}{THIN}cm")


def title(heads: Sequence[Head]) -> str:
    """Of heads in one place the titles of all."""
    return " · ".join(head.title for head in heads if head.title)


def key(sheet: Sheet, x: float, y: float, width: float) -> None:
    """Which mark is which, in one line."""
    canvas, photo = sheet.canvas, sheet.scene.photo
    if not photo.points_shown:
        return
    for a, b in ((-9, -1), (-1, -9)):
        canvas.line((x + 1, y + a), (x + 9, y + b), OBSERVED, 1.8)
    end = canvas.text(x + 15, y, sheet.words["cross"], 12.5, DIM, most=0.42 * width)
    canvas.circle((end + 19, y - 5), 4.6, PROJECTED, 1.7)
    canvas.text(end + 29, y, sheet.words["circle"], 12.5, DIM, most=x + width - end - 29)


def cards(sheet: Sheet, x: float, y: float, width: float) -> None:
    """The two numbers whose disagreement is the lesson; what is hidden is left out."""
    numbers, curves, hide = sheet.scene.numbers, sheet.scene.curves, sheet.scene.hide
    if "numbers" in hide:
        return
    note = sheet.words["d_l_note_alone"]
    if curves is not None:
        note = sheet.words["d_l_note"].format(tolerance=f"{curves.tolerance_percent:g}")
    half = (width - 12) / 2
    _card(sheet, "d_l", (percent(numbers.d_l_percent), "%"), note, x, y, half)
    if "truth" in hide:
        return
    note = sheet.words["d_s_note"]
    if numbers.reference:
        note = sheet.words["d_s_note_reference"].format(reference=numbers.reference)
    _card(sheet, "d_s", (f"{numbers.d_s_mm:.1f}", "mm"), note, x + half + 12, y, half)


def _card(
    sheet: Sheet, which: str, value: tuple[str, str], note: str, x: float, y: float, width: float
) -> None:
    canvas, colour = sheet.canvas, TONES[which]
    canvas.fill(x, y, 20, CARD_HEIGHT, colour, radius=8)
    canvas.fill(x + 4, y, width - 4, CARD_HEIGHT, CARD, radius=8)
    canvas.text(x + 15, y + 25, sheet.words[which], 14, INK, 600, most=width - 22)
    digits = value[0].replace(".", sheet.words["decimal"])
    end = canvas.text(x + 15, y + 58, digits, 29, colour, 700)
    canvas.text(end + 4, y + 58, value[1], 16, colour, 600)
    canvas.paragraph(x + 15, y + 80, note, 12, DIM, most=width - 23, step=17)


def warnings(sheet: Sheet) -> list[tuple[str, float, Colour, int]]:
    """Words, size, colour, weight of each line: why not to take the numbers at face value, or what bends the face."""
    numbers = sheet.scene.numbers
    if not numbers.converged:
        return [(sheet.words["not_converged"], 13.0, OBSERVED, 600)]
    if not numbers.plausible:
        return [(sheet.words["implausible"], 13.0, OBSERVED, 600)]
    bends = numbers.flex or ((numbers.flex_words, numbers.flex_mm),) * bool(numbers.flex_words)
    return [(f"{words}: {mm:+.1f}{THIN}mm", 13.0, DIM, 400) for words, mm in bends]


def warn(sheet: Sheet, x: float, y: float, width: float) -> float:
    """The warnings from the base line y + WARNING on; returns the height they take, nothing without any."""
    lines = warnings(sheet)
    for row, line in enumerate(lines):
        sheet.canvas.text(x, y + WARNING + WARNING_STEP * row, *line, most=width)
    return warned(sheet)


def warned(sheet: Sheet) -> float:
    """Height of the warnings."""
    count = len(warnings(sheet))
    return WARNING + WARNING_STEP * (count - 1) if count else 0.0


def percent(value: float) -> str:
    """d_L: 2 decimals below 1 %, 1 above."""
    return f"{value:.2f}" if value < 0.995 else f"{value:.1f}"


def bar(sheet: Sheet, x: float, y: float, ppm: float, key: str, *, beside: bool = False) -> float:
    """The scale bar, its words below or beside it; returns where it ends."""
    canvas, end = sheet.canvas, x + sheet.scene.scale_bar * ppm
    if end == x:
        return x
    canvas.line((x, y), (end, y), INK, 1.6)
    for side in (x, end):
        canvas.line((side, y - 5), (side, y + 5), INK, 1.6)
    text = sheet.words[key].format(mm=f"{1e3 * sheet.scene.scale_bar:g}")
    if beside:
        return canvas.text(end + 10, y + 5, text, 14, INK)
    canvas.text((x + end) / 2, y + 24, text, 14, INK, anchor="middle")
    return end


def legend_beside(canvas: Canvas, legend: Legend, x: float, y: float, height: float) -> None:
    """The colour scale upright, low at the bottom, title above and note below."""
    start = canvas.paragraph(x - 24, y, legend.title, 13, DIM, most=104, step=17) + 14
    height = y + height - start - 14
    canvas.ramp(x, start, 22, height, legend.colours, upright=True)
    for tick in legend.ticks:
        at = start + height * (legend.high - tick) / (legend.high - legend.low)
        canvas.line((x + 22, at), (x + 27, at), INK)
        canvas.text(x + 33, at + 5, _tick(legend, tick), 14, INK)
    canvas.text(x - 24, start + height + 26, legend.note, 12.5, DIM, most=150)


def legend_across(canvas: Canvas, legend: Legend, right: float, y: float) -> None:
    """The colour scale lying, ending at `right`, title above and note below."""
    width = 250
    x = right - width
    canvas.text(x, y - 16, legend.title, 13, DIM)
    canvas.ramp(x, y - 7, width, 14, legend.colours, upright=False)
    for tick in legend.ticks:
        at = x + width * (tick - legend.low) / (legend.high - legend.low)
        canvas.line((at, y + 7), (at, y + 11), INK)
        canvas.text(at, y + 25, _tick(legend, tick), 13, INK, anchor="middle")
    canvas.text(x, y + 46, legend.note, 12.5, DIM)


def _tick(legend: Legend, value: float) -> str:
    """A tick's number; at an end that holds what lies beyond, "> 15"."""
    number = f"{value:g}".replace("-", "\u2212")
    if legend.open_high and value == legend.high:
        return f">{THIN}{number}"
    return f"<{THIN}{number}" if legend.open_low and value == legend.low else number
