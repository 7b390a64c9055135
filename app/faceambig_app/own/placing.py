"""Placing points by hand: which are asked, one after another, their names, and where they are on a small drawn face."""

from __future__ import annotations

from html import escape

from faceambig.model import FaceModel

from ..text import say
from .photo import NAMED, TWELVE, OwnPhoto, moved, on_scheme, with_points

SCHEME = "farkas"
# x, y in the drawing of 100 x 120. The subject's right is on the left: r and l are the subject's sides
SPOTS = {
    "ex_r": (25, 51), "en_r": (40, 52), "en_l": (60, 52), "ex_l": (75, 51), "prn": (50, 71), "al_r": (42, 75),
    "al_l": (58, 75), "ch_r": (37, 90), "ch_l": (63, 90), "gn": (50, 113), "t_r": (11, 60), "t_l": (89, 60),
    "p_r": (32.5, 51), "p_l": (67.5, 51), "se": (50, 49), "sn": (50, 78), "ls": (50, 87), "li": (50, 95),
    "sba_r": (11, 72), "sba_l": (89, 72),
}  # fmt: skip
_LINES = (
    "M50 6C24 6 14 28 14 52C14 82 30 114 50 114C70 114 86 82 86 52C86 28 76 6 50 6Z"  # head
    "M14 48C7 44 6 56 9 66C10 72 13 74 16 70M86 48C93 44 94 56 91 66C90 72 87 74 84 70"  # ears
    "M25 51Q32 45 40 52Q32 56 25 51M60 52Q68 45 75 51Q68 56 60 52"  # eyes
    "M24 42Q33 37 42 41M58 41Q67 37 76 42"  # brows
    "M47 52L43 71Q41 77 46 76L50 78L54 76Q59 77 57 71L53 52"  # nose
    "M37 90Q45 85 50 87Q55 85 63 90Q50 100 37 90M37 90Q50 91 63 90"  # mouth
)


def begin(own: OwnPhoto, faces: FaceModel) -> OwnPhoto:
    """The photograph without points, the twelve to be asked."""
    return on_scheme(own, faces, SCHEME, asked=TWELVE, words="")


def more(own: OwnPhoto) -> OwnPhoto:
    """The photograph with the optional points to be asked."""
    return with_points(own, own.points, asked=tuple(left(own)))


def left(own: OwnPhoto) -> list[str]:
    """Of twelve and more, what could still be placed."""
    if own.scheme != SCHEME or own.asked:
        return []
    row = {name: k for k, name in enumerate(own.names)}
    wanted = [name for name in NAMED if name in row]
    return [name for name in wanted if own.points[row[name]][0] != own.points[row[name]][0]]  # NaN


def place(own: OwnPhoto, x: float, y: float) -> OwnPhoto:
    """The photograph with the point that was asked for; the next one is asked."""
    if not own.asked:
        return own
    name, *others = own.asked
    placed = moved(own, own.names.index(name), x, y)
    return with_points(placed, placed.points, asked=tuple(others))


def skip(own: OwnPhoto) -> OwnPhoto:
    """The photograph with the next point asked, this one left out: it is not visible."""
    return with_points(own, own.points, asked=own.asked[1:])


def asked_words(own: OwnPhoto) -> str:
    """What is to be placed now, as HTML: its name, and a drawn face that marks it."""
    if not own.asked:
        return ""
    name = own.asked[0]
    words = say("own.place", name=say(f"point.{name}"), left=len(own.asked))
    return f'<div class="fa fa-ask" data-fa-ask="1">{_drawing(own)}<p aria-live="polite">{escape(words)}</p></div>'


def _drawing(own: OwnPhoto) -> str:
    """A face with the points placed small, and the one asked for large."""
    row = {name: k for k, name in enumerate(own.names)}
    spots = []
    for name, (x, y) in SPOTS.items():
        if name == own.asked[0]:
            spots.append(
                f'<circle cx="{x}" cy="{y}" r="8" fill="none" stroke="var(--fa-seen)" stroke-width="2.5"/>'
                f'<circle cx="{x}" cy="{y}" r="2.5" fill="var(--fa-seen)"/>'
            )
        elif name in row and own.points[row[name]][0] == own.points[row[name]][0]:
            spots.append(f'<circle cx="{x}" cy="{y}" r="2" fill="var(--fa-dim)"/>')
    return (
        f'<svg viewBox="0 0 100 120" aria-hidden="true"><path d="{_LINES}" fill="none" stroke="var(--fa-dim)"/>'
        f"{''.join(spots)}</svg>"
    )
