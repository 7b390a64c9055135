"""Scene -> HTML and SVG of the page: words, number cards, legend, tables. Strings, no viser.

Photograph and plots have modules of their own and are handed on here: the page asks this one.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from html import escape

import numpy as np
from numpy.typing import NDArray

from faceambig.arrays import Array
from faceambig.scene import Legend, Numbers, Scene

from ..text import NARROW, distance_text, numeral, percent_number, say


def hidden_boxes(uuids: Iterable[str]) -> str:
    """Hide the number boxes of sliders that count steps: the box would show the step, not the distance.

    In their place is room for half a thumb, which at the far end would stand under the bar of scrolling.
    """
    sliders = [f'[id="{uuid}"]' for uuid in uuids]
    boxes = ",".join(f"{slider}+div" for slider in sliders)
    return f"<style>{boxes}{{display:none}}{','.join(sliders)}{{margin-right:8px}}</style>"


def heading(assumed: float | None, actual: float | None, points: int) -> str:
    """The first words of the page. actual None: where the photo was taken from is not told."""
    to = distance_text(assumed)
    if actual is None:
        lead = say("app.lead_hidden", assumed=to, points=points)
    else:
        lead = say("app.lead", actual=distance_text(actual), assumed=to, points=points)
    title, task = escape(say("app.heading")), escape(say("app.try"))
    return f'<div class="fa"><h1>{title}</h1><p>{escape(lead)}</p><p>{task}</p></div>'


def cards(numbers: Numbers, *, hide: Collection[str] = ()) -> str:
    """The two numbers whose disagreement is the lesson. `hide` of Scene: "numbers" both, "truth" the second."""
    warning = ""
    if not numbers.converged:
        warning = say("number.not_converged")
    elif not numbers.plausible:
        warning = say("number.implausible")
    warned = f'<p class="fa-warn">{escape(warning)}</p>' if warning else ""
    d_l, d_s = percent_number(numbers.d_l_percent), numeral(f"{abs(numbers.d_s_mm):.1f}")
    title, note = say("number.d_s"), say("number.d_s_note")
    if numbers.reference:
        title, note = say("number.d_s_to", reference=numbers.reference), say("number.d_s_to_note")
    d_l_shown, d_s_shown = "numbers" not in hide, not {"numbers", "truth"} & set(hide)
    shown = _card(
        "fa-dl", say("number.d_l"), d_l if d_l_shown else "?", "%" if d_l_shown else "",
        say("number.d_l_note") if d_l_shown else say("number.hidden"), numbers.eyes_meaning,
    ) + _card(
        "fa-ds", title, d_s if d_s_shown else "?", "mm" if d_s_shown else "",
        note if d_s_shown else say("number.hidden_truth") if d_l_shown else say("number.hidden"), "",
    )  # fmt: skip
    return f'<div class="fa"><div class="fa-cards">{shown}</div>{warned}</div>'


def _card(tone: str, title: str, value: str, unit: str, note: str, hint: str) -> str:
    hover = f' title="{escape(hint)}"' if hint else ""
    unit = f"<i>{NARROW}{unit}</i>" if unit else ""
    return (
        f'<div class="fa-card {tone}"{hover}><b>{escape(title)}</b><span>{value}{unit}</span>'
        f"<small>{escape(note)}</small></div>"
    )


def flex_words(lines: Iterable[str]) -> str:
    """What the flexibility modes move, and how far each stays a face: a line a mode."""
    said = "".join(f"<p><small>{escape(line)}</small></p>" for line in lines)
    return f'<div class="fa">{said}</div>'


def told(words: str) -> str:
    """Which face stands for the fitted one; nothing where it is the fit."""
    return f'<div class="fa"><p>{escape(words)}</p></div>' if words else ""


def pins(names: Sequence[str], words: Sequence[str], d_s_mm: Array) -> str:
    """The faces kept, P of each, and how far they are from each other; what to do where there is none."""
    if not names:
        return f'<div class="fa"><p>{escape(say("pins.none"))}</p></div>'
    rows = "".join(
        f"<li><b><bdi>{escape(name)}</bdi></b> {escape(text)}</li>"
        for name, text in zip(names, words, strict=True)
    )
    listed = f'<div class="fa"><ul class="fa-small">{rows}</ul></div>'
    return listed + (pin_matrix(names, d_s_mm) if len(names) > 1 else "")


def spoken(numbers: Numbers, *, hide: Collection[str] = ()) -> str:
    """The result as one sentence for a screen reader; changes once a rest."""
    distance = distance_text(numbers.distance)
    d_l = percent_number(numbers.d_l_percent)
    if "numbers" in hide:
        sentence = say("number.spoken_hidden", distance=distance)
    elif "truth" in hide:
        sentence = say("number.spoken_half", distance=distance, d_l=d_l)
    else:
        sentence = say(
            "number.spoken",
            distance=distance,
            d_l=d_l,
            d_s=f"{numbers.d_s_mm:.1f}",
        )
    # What is replaced is not read aloud: the page's script says it in an element of its own, that stays
    return f'<div class="fa-hidden" aria-hidden="true" data-fa-spoken="">{escape(sentence)}</div>'


def heads_words(scene: Scene) -> str:
    """The 3D view in words: a canvas has none."""
    view = scene.views[0]
    if scene.through_camera:
        place = say("stage.camera")
    elif abs(view.azimuth_deg) < 0.5 and abs(view.elevation_deg) < 0.5:
        place = say("stage.straight")
    else:
        place = say(
            "stage.turned",
            azimuth=f"{abs(view.azimuth_deg):.0f}",
            side=say("stage.left") if view.azimuth_deg > 0 else say("stage.right"),
            elevation=f"{abs(view.elevation_deg):.0f}",
            height=say("stage.below") if view.elevation_deg < 0 else say("stage.above"),
        )
    heads = say("stage.and").join(head.title for head in scene.heads if head.title)
    words = escape(say("stage.alt", heads=heads, place=place))
    return f'<div class="fa-hidden" role="img" aria-label="{words}"></div>'


def legend(scale: Legend) -> str:
    """A colour scale: the very colours of the heads, ticks, and what lies beyond its ends."""
    stops = ",".join("#{:02X}{:02X}{:02X}".format(*colour) for colour in scale.colours.tolist())
    span = scale.high - scale.low
    ticks = "".join(
        f'<span style="left:{100 * (tick - scale.low) / span:.4g}%">{_signed(tick)}</span>'
        for tick in scale.ticks
    )
    first, last = scale.colours[0], scale.colours[-1]
    below = _over(f"&lt; {_signed(scale.low)}", first) if scale.open_low else ""
    above = _over(f"&gt; {_signed(scale.high)}", last) if scale.open_high else ""
    ramp = f'<div class="fa-ramp" style="background:linear-gradient(90deg,{stops})">{ticks}</div>'
    note = f"<div>{escape(scale.note)}</div>" if scale.note else ""
    words = say("legend.alt", title=scale.title, low=_signed(scale.low), high=_signed(scale.high))
    return (
        f'<div class="fa fa-small" role="img" aria-label="{escape(words)}"><div>{escape(scale.title)}</div>'
        f'<div class="fa-legend">{below}{ramp}{above}</div>{note}</div>'
    )


def _over(words: str, colour: NDArray[np.uint8]) -> str:
    """What lies beyond an end of the scale: its last colour once more."""
    red, green, blue = colour.tolist()
    swatch = f'<i style="background:#{red:02X}{green:02X}{blue:02X}"></i>'
    return f'<div class="fa-over">{swatch}{words}</div>'


def _signed(value: float) -> str:
    return numeral(f"{value:g}").replace("-", "\u2212")


def spectrum(values_mm: Array, words: Sequence[str]) -> str:
    """How far each flexibility mode moves the surface, millimetres at 1 % landmark change: values_mm (K,), words K."""
    largest = max((float(value) for value in values_mm), default=0.0) or 1.0
    rows = "".join(
        f"<li><span>{escape(text)}</span><span>{numeral(f'{value:.1f}')}{NARROW}mm</span>"
        f'<i style="width:{100 * float(value) / largest:.1f}%"></i></li>'
        for value, text in zip(values_mm, words, strict=True)
    )
    title = escape(say("spectrum.title"))
    return f'<div class="fa"><b class="fa-small">{title}</b><ul class="fa-bars fa-small">{rows}</ul></div>'


def pin_matrix(names: Sequence[str], d_s_mm: Array) -> str:
    """d_S between pinned faces as a table: names P, d_s_mm (P, P)."""
    called = [f"<bdi>{escape(name)}</bdi>" for name in names]  # of any script, right to left too
    head = "".join(f'<th scope="col">{name}</th>' for name in called)
    rows = []
    for i, name in enumerate(called):
        cells = "".join(
            f"<td>{'' if i == j else numeral(f'{d_s_mm[i, j]:.1f}')}</td>"
            for j in range(len(names))
        )
        rows.append(f'<tr><th scope="row">{name}</th>{cells}</tr>')
    caption = escape(say("pins.matrix"))
    return (
        f'<div class="fa fa-wide"><table><caption>{caption}</caption><thead><tr><td></td>{head}</tr></thead>'
        f"<tbody>{''.join(rows)}</tbody></table></div>"
    )


def side_by_side(marks: str, numbers: str) -> str:
    """The photograph beside the two numbers, for a narrow browser."""
    return f'<div class="fa-both">{marks}{numbers}</div>'
