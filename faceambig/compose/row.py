"""Faces in a row on one scale, front over side: one subject at several distances, or faces that were pinned."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from ..arrays import Array
from ..model import Subject
from ..scene import Head, Photo, Scene
from .colours import LEGENDS, Colours, difference_colours, greyed, over_region, skin
from .face import Face, numbers
from .heads import SPACING, head, named_view, pivot

PINS = 5
SCALE_BAR = 0.05  # metres
Caption = tuple[tuple[str, str], ...]  # lines under a head: (text, tone of scene.Head)


def compose_row(
    subject: Subject,
    faces: Sequence[Face],
    picture: Photo,
    *,
    titles: Sequence[str],
    captions: Sequence[Caption],
    legend_words: tuple[str, str],
    hide: Collection[str] = (),
    scale: bool = True,
    note: str = "",
) -> Scene:
    """The true head and several fits in a row, coloured by their difference, from the front and from the side.

    titles and captions: one for the true head, then one a face. With "truth" in `hide` the true head and the
    differences are left out, and the faces are as they look.
    """
    heads = [_fitted(f"fit{k}", subject, face, hide) for k, face in enumerate(faces, start=1)]
    words = list(zip(titles, captions, strict=True))
    if "truth" in hide:
        words = words[1:]
    else:
        heads.insert(0, ("true", subject, subject.vertices, skin(subject), True, None))
    return _scene(heads, words, faces[-1], picture, legend_words, hide, scale, note)


def compose_pins(
    pins: Sequence[tuple[Subject, Face]],
    picture: Photo,
    *,
    titles: Sequence[str],
    captions: Sequence[Caption],
    legend_words: tuple[str, str],
    hide: Collection[str] = (),
    scale: bool = True,
    note: str = "",
) -> Scene:
    """Up to five faces in a row, each coloured by its difference to its own true face, front over side.

    pins: (true face, fitted face) each; the models may differ. titles and captions: one a pin; the true face's name
    belongs into one of them. picture: the photograph of the last.
    """
    if not 1 <= len(pins) <= PINS:
        raise ValueError(f"pins: {len(pins)} faces; 1 to {PINS} stand in a row")
    heads = [
        _fitted(f"pin{k}", subject, face, hide) for k, (subject, face) in enumerate(pins, start=1)
    ]
    words = list(zip(titles, captions, strict=True))
    return _scene(heads, words, pins[-1][1], picture, legend_words, hide, scale, note)


# name, whose, vertices, colours, lit, millimetres that the colours mean
Standing = tuple[str, Subject, Array, Colours, bool, Array | None]


def _fitted(name: str, subject: Subject, face: Face, hide: Collection[str]) -> Standing:
    if "truth" not in hide:
        colours = difference_colours(subject.model, face.gaps_mm)
        values = over_region(subject.model, face.gaps_mm)
        return name, subject, face.vertices, colours, False, values
    colours = skin(subject)
    return name, subject, face.vertices, colours if face.plausible else greyed(colours), True, None


def _scene(
    standing: Sequence[Standing],
    words: Sequence[tuple[str, Caption]],
    last: Face,
    picture: Photo,
    legend_words: tuple[str, str],
    hide: Collection[str],
    scale: bool,
    note: str,
) -> Scene:
    middle = pivot(standing[0][1].model)
    slots = SPACING * (np.arange(len(standing)) - (len(standing) - 1) / 2)
    heads: list[Head] = []
    for (name, subject, vertices, colours, lit, values), (title, caption), slot in zip(
        standing, words, slots, strict=True
    ):
        # All turn about one pivot: a head of another model is moved so that its own stands there
        own = pivot(subject.model)
        placed = vertices if own == middle else vertices + np.subtract(middle, own)
        lines = tuple(
            line for line in caption if not ("numbers" in hide and line[1] in ("d_l", "d_s"))
        )
        one = head(subject.model, name, title, placed, colours, slot=slot, caption=lines, lit=lit)
        heads.append(replace(one, values_mm=values))
    return Scene(
        heads=tuple(heads),
        views=(named_view("front"), named_view("side")),
        photo=picture,
        pivot=middle,
        numbers=numbers(last),
        legend=None if "truth" in hide else LEGENDS["difference"](*legend_words),
        scale_bar=SCALE_BAR if scale else 0.0,
        hide=frozenset(hide),
        note=note,
    )
