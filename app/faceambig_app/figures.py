"""Scene -> HTML and SVG of the page: number cards, the two plots, the photograph's points. Strings, no viser.

Colours are CSS variables of STYLE, so one string serves light and dark.
"""

from __future__ import annotations

import base64
from collections.abc import Iterable
from html import escape

import numpy as np

from faceambig.arrays import Array
from faceambig.scene import Curves, Numbers, Photo

from .text import NARROW, centimetres, distance_text, percent_number, say

STYLE = """<style>
:root{--fa-ink:#1D2733;--fa-dim:#52606D;--fa-line:#D5DCE3;--fa-card:#F6F8FA;--fa-band:#E3EAF2;
--fa-dl:#1B5FC1;--fa-ds:#A84A00;--fa-seen:#C8102E}
[data-mantine-color-scheme=dark]{--fa-ink:#E9EEF3;--fa-dim:#A9B4BF;--fa-line:#3C4650;--fa-card:#252A30;
--fa-band:#2B3540;--fa-dl:#7AB7FF;--fa-ds:#FFAB66;--fa-seen:#FF7A85}
.fa{color:var(--fa-ink);font-size:14px;line-height:1.45;padding:0 .75em .35em}
.fa h1{font-size:17px;font-weight:650;margin:.5em 0 .3em}
.fa p{margin:.35em 0}.fa small{font-size:12.5px;color:var(--fa-dim)}
.fa-cards{display:grid;grid-template-columns:1fr 1fr;gap:8px}
.fa-card{background:var(--fa-card);border-radius:8px;border-left:4px solid;padding:8px 10px}
.fa-card b{font-size:13px;display:block}.fa-card span{font-size:26px;font-weight:700;
font-variant-numeric:tabular-nums;line-height:1.15;display:block}.fa-card i{font-style:normal;font-size:14px}
.fa-dl{border-color:var(--fa-dl)}.fa-dl span{color:var(--fa-dl)}
.fa-ds{border-color:var(--fa-ds)}.fa-ds span{color:var(--fa-ds)}
.fa-photo{position:relative;border-radius:8px;overflow:hidden;background-color:#CBD5E0;background-size:100% 100%;
aspect-ratio:1}.fa-photo svg{position:absolute;inset:0;width:100%;height:100%}
.fa-photo em{position:absolute;top:8px;left:8px;background:#FFFD;color:#1D2733;font-style:normal;
font-size:12.5px;padding:1px 7px;border-radius:4px}
.fa-key{display:flex;flex-wrap:wrap;gap:0 16px;font-size:12.5px;color:var(--fa-dim);padding-top:4px}
.fa-key svg{width:13px;height:13px;vertical-align:-2px;margin-right:4px}
.fa-plot{display:block;width:100%;height:auto;font-size:11.5px}.fa-plot text{fill:var(--fa-dim)}
.fa-plot .t{font-weight:650;font-size:12.5px}
.fa-hidden{position:absolute;width:1px;height:1px;overflow:hidden;clip-path:inset(50%)}
.fa-both{display:grid;grid-template-columns:46% 1fr;align-items:start}
.fa-both .fa{padding-right:0}.fa-both .fa+.fa{padding-right:.75em}.fa-both .fa-cards{grid-template-columns:1fr}
canvas[data-engine]{background:#F3F6F9}[data-mantine-color-scheme=dark] canvas[data-engine]{background:#181C21}
.mantine-Slider-root:has(.mantine-Slider-markLabel){padding-bottom:20px!important}
.mantine-Slider-markLabel{margin-top:7px;font-size:11px!important;color:var(--fa-dim)!important}
label[for]{color:var(--fa-dim)!important;letter-spacing:0!important;font-size:13px!important}
[data-mantine-color-scheme=dark] [style*="color: var(--mantine-primary-color-filled)"]{color:#7AB7FF!important}
@media(max-width:576px){.mantine-Paper-root[style*="20em"]{width:100%!important;left:0!important;right:0!important}
.mantine-ScrollArea-content>div[style*="20em"]{width:100%!important}}
.fa-warn{border-left:4px solid #C8102E;padding-left:8px}
</style>"""

WIDTH, LEFT, RIGHT = 340, 34, 330  # of the plots, in SVG units
TICKS_CM = (20, 30, 60, 120, 240)
D_L_TOP, D_L_BOTTOM, D_S_TOP, D_S_BOTTOM = 24, 94, 128, 222
D_L_MAX = 6.0  # percent
CROSS, CIRCLE = 3.6, 4.6  # half sizes in pixels of a picture of 500
RED, BLUE = "#C8102E", "#1B5FC1"  # on the photograph, in both themes, with a white halo


def hidden_boxes(uuids: Iterable[str]) -> str:
    """Hide the number boxes of sliders that count steps: the box would show the step, not the distance."""
    selectors = ",".join(f'[id="{uuid}"]+div' for uuid in uuids)
    return f"<style>{selectors}{{display:none}}</style>"


def heading(assumed: float | None, actual: float, points: int) -> str:
    """The first words of the page."""
    lead = say(
        "app.lead", actual=distance_text(actual), assumed=distance_text(assumed), points=points
    )
    title, task = escape(say("app.heading")), escape(say("app.try"))
    return f'<div class="fa"><h1>{title}</h1><p>{escape(lead)}</p><p>{task}</p></div>'


def cards(numbers: Numbers) -> str:
    """The two numbers whose disagreement is the lesson."""
    warning = ""
    if not numbers.converged:
        warning = say("number.not_converged")
    elif not numbers.plausible:
        warning = say("number.implausible")
    warned = f'<p class="fa-warn">{escape(warning)}</p>' if warning else ""
    return (
        '<div class="fa"><div class="fa-cards">'
        + _card(
            "fa-dl",
            say("number.d_l"),
            percent_number(numbers.d_l_percent),
            "%",
            say("number.d_l_note"),
            numbers.eyes_meaning,
        )
        + _card(
            "fa-ds", say("number.d_s"), f"{numbers.d_s_mm:.1f}", "mm", say("number.d_s_note"), ""
        )
        + f"</div>{warned}</div>"
    )


def flex_words(words: str, low: float, high: float) -> str:
    """What mode A moves, and how far it stays a face."""
    text = say("flex.words", words=words, low=f"{low:.1f}", high=f"{high:.1f}")
    return f'<div class="fa"><small>{escape(text)}</small></div>'


def _card(tone: str, title: str, value: str, unit: str, note: str, hint: str) -> str:
    hover = f' title="{escape(hint)}"' if hint else ""
    return (
        f'<div class="fa-card {tone}"{hover}><b>{escape(title)}</b><span>{value}<i>{NARROW}{unit}</i></span>'
        f"<small>{escape(note)}</small></div>"
    )


def spoken(numbers: Numbers) -> str:
    """The result as one sentence for a screen reader; changes once a rest."""
    sentence = say(
        "number.spoken",
        distance=distance_text(numbers.distance),
        d_l=percent_number(numbers.d_l_percent),
        d_s=f"{numbers.d_s_mm:.1f}",
    )
    return f'<div class="fa-hidden" aria-live="polite">{escape(sentence)}</div>'


def photo_picture(jpeg: bytes) -> str:
    """The photograph as a style, so that moving the points does not send the picture again."""
    data = base64.b64encode(jpeg).decode()
    return f"<style>.fa-photo{{background-image:url(data:image/jpeg;base64,{data})}}</style>"


def photo_marks(photo: Photo) -> str:
    """Red crosses of the photograph's points under blue circles of the fitted face's, a white halo around both."""
    unit = photo.width / 500
    crosses = "".join(_cross(x, y, CROSS * unit) for x, y in photo.observed if np.isfinite(x + y))
    circles = "".join(_circle(x, y, CIRCLE * unit) for x, y in photo.projected)
    thin, halo = 1.7 * unit, 3.4 * unit
    return (
        '<div class="fa"><div class="fa-photo">'
        f'<svg viewBox="0 0 {photo.width} {photo.height}" role="img" aria-label="{escape(photo.caption)}" fill="none">'
        f'<defs><path id="fx" d="{crosses}"/><path id="fo" d="{circles}"/></defs>'
        f'<g stroke="#FFF" stroke-width="{halo:.1f}"><use href="#fx"/><use href="#fo"/></g>'
        f'<g stroke-width="{thin:.1f}"><use href="#fx" stroke="{RED}"/><use href="#fo" stroke="{BLUE}"/></g></svg>'
        f"<em>{escape(photo.caption)}</em></div>"
        f'<div class="fa-key"><span>{_key(_cross(6, 6, 4), "seen")}{escape(say("app.cross"))}</span>'
        f"<span>{_key(_circle(6, 6, 4.5), 'dl')}{escape(say('app.circle'))}</span></div></div>"
    )


def side_by_side(marks: str, numbers: str) -> str:
    """The photograph beside the two numbers, for a narrow browser."""
    return f'<div class="fa-both">{marks}{numbers}</div>'


def _cross(x: float, y: float, r: float) -> str:
    return (
        f"M{x - r:.1f} {y - r:.1f}l{2 * r:.1f} {2 * r:.1f}m0 {-2 * r:.1f}l{-2 * r:.1f} {2 * r:.1f}"
    )


def _circle(x: float, y: float, r: float) -> str:
    return f"M{x - r:.1f} {y:.1f}a{r:.1f} {r:.1f} 0 1 0 {2 * r:.1f} 0a{r:.1f} {r:.1f} 0 1 0 {-2 * r:.1f} 0"


def _key(path: str, tone: str) -> str:
    style = f"fill:none;stroke:var(--fa-{tone});stroke-width:1.8"
    return f'<svg viewBox="0 0 12 12"><path d="{path}" style="{style}"/></svg>'


def plots(curves: Curves, numbers: Numbers) -> str:
    """d_L over d_S against the assumed distance, one axis and one cursor."""
    top = d_s_axis(curves, numbers)
    x = _x(curves.distances)
    d_l = _line(x, _y(curves.d_l_percent, D_L_MAX, D_L_TOP, D_L_BOTTOM))
    d_s = _line(x, _y(curves.d_s_mm, top, D_S_TOP, D_S_BOTTOM))
    parts = [
        (
            f'<svg class="fa-plot" viewBox="0 0 {WIDTH} 262" role="img" aria-label="{escape(say("plot.d_l"))}, '
            f'{escape(say("plot.d_s"))}">'
        ),
        f'<text class="t" x="2" y="14" style="fill:var(--fa-dl)">{escape(say("plot.d_l"))}</text>',
        (
            f'<rect x="{LEFT}" y="{_at(curves.tolerance_percent, D_L_MAX, D_L_TOP, D_L_BOTTOM):.1f}" '
            f'width="{RIGHT - LEFT}" height="{(D_L_BOTTOM - D_L_TOP) * curves.tolerance_percent / D_L_MAX:.1f}" '
            'fill="var(--fa-band)"/>'
        ),
        *(_grid(value, D_L_MAX, D_L_TOP, D_L_BOTTOM) for value in (0, 3, 6)),
        (
            f'<text x="{RIGHT - 3}" y="{_at(3, D_L_MAX, D_L_TOP, D_L_BOTTOM) + 13:.1f}" text-anchor="end">'
            f"{escape(say('plot.band'))}</text>"
        ),
        f'<text class="t" x="2" y="{D_S_TOP - 10}" style="fill:var(--fa-ds)">{escape(say("plot.d_s"))}</text>',
        *(_grid(value, top, D_S_TOP, D_S_BOTTOM) for value in range(0, int(top) + 1, 4)),
        *(_tick(cm) for cm in TICKS_CM),
        f'<text x="{(LEFT + RIGHT) / 2}" y="257" text-anchor="middle">{escape(say("plot.axis"))}</text>',
        _true_line(curves),
        f'<polyline points="{d_l}" fill="none" stroke="var(--fa-dl)" stroke-width="2.2" stroke-dasharray="6 3"/>',
        f'<polyline points="{d_s}" fill="none" stroke="var(--fa-ds)" stroke-width="2.2"/>',
        _cursor(numbers, top),
        "</svg>",
    ]
    return f'<div class="fa">{"".join(parts)}</div>'


def d_s_axis(curves: Curves, numbers: Numbers) -> float:
    """End of the d_S axis: 12 mm, growing in steps of 4."""
    largest = max(float(curves.d_s_mm.max()), numbers.d_s_mm)
    return 4.0 * max(3, int(np.ceil(largest / 4.0)))


def _x(metres: Array | float) -> Array:
    low, high = np.log2(0.2), np.log2(3.0)
    return LEFT + (np.log2(metres) - low) / (high - low) * (RIGHT - LEFT)


def _y(values: Array, top_value: float, top: int, bottom: int) -> Array:
    return bottom - np.clip(values, 0, top_value) / top_value * (bottom - top)


def _at(value: float, top_value: float, top: int, bottom: int) -> float:
    return float(_y(np.array(value), top_value, top, bottom))


def _line(x: Array, y: Array) -> str:
    return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))


def _grid(value: float, top_value: float, top: int, bottom: int) -> str:
    y = _at(value, top_value, top, bottom)
    return (
        f'<path d="M{LEFT} {y:.1f}H{RIGHT}" stroke="var(--fa-line)"/>'
        f'<text x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{value:g}</text>'
    )


def _tick(cm: int) -> str:
    x = float(_x(cm / 100))
    return (
        f'<path d="M{x:.1f} {D_S_BOTTOM}v4" stroke="var(--fa-dim)"/>'
        f'<text x="{x:.1f}" y="{D_S_BOTTOM + 17}" text-anchor="middle">{cm}</text>'
    )


def _true_line(curves: Curves) -> str:
    if not 0.2 <= curves.true_distance <= 3.0:
        return ""
    x = float(_x(curves.true_distance))
    anchor, shift = ("end", -4) if x > (LEFT + RIGHT) / 2 else ("start", 4)
    return (
        f'<path d="M{x:.1f} {D_L_TOP}V{D_S_BOTTOM}" stroke="var(--fa-dim)" stroke-dasharray="2 3"/>'
        f'<text x="{x + shift:.1f}" y="{D_S_TOP + 10}" text-anchor="{anchor}">'
        f"{escape(say('plot.true', distance=centimetres(curves.true_distance)))}</text>"
    )


def _cursor(numbers: Numbers, d_s_top: float) -> str:
    if numbers.distance is None:
        return ""
    x = float(_x(numbers.distance))
    a = _at(numbers.d_l_percent, D_L_MAX, D_L_TOP, D_L_BOTTOM)
    b = _at(numbers.d_s_mm, d_s_top, D_S_TOP, D_S_BOTTOM)
    return (
        f'<path d="M{x:.1f} {D_L_TOP}V{D_S_BOTTOM}" stroke="var(--fa-ink)" stroke-width="1.6"/>'
        f'<circle cx="{x:.1f}" cy="{a:.1f}" r="4.5" fill="var(--fa-dl)"/>'
        f'<rect x="{x - 4.2:.1f}" y="{b - 4.2:.1f}" width="8.4" height="8.4" fill="var(--fa-ds)"/>'
    )
