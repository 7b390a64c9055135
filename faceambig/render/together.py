"""What stands in one place of a picture: heads laid over each other, their points, and the lines of their room."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ..scene import Head, Scene, View
from . import gl

TONES: Mapping[str, tuple[int, int, int]] = {
    "seen": (0xC8, 0x10, 0x2E), "d_l": (0x1B, 0x5F, 0xC1), "dim": (0x52, 0x60, 0x6D),
}  # fmt: skip


def places(scene: Scene) -> list[tuple[Head, ...]]:
    """The heads of each slot, in the order of their first. Those shown in turn stand beside each other."""
    if scene.blink:
        return [(head,) for head in scene.heads]
    slots: dict[float, list[Head]] = {}
    for head in scene.heads:
        slots.setdefault(head.slot, []).append(head)
    return [tuple(heads) for heads in slots.values()]


def picture(
    scene: Scene, heads: Sequence[Head], view: View, size: tuple[int, int], pixels_per_metre: float
) -> NDArray[np.uint8]:
    """(height, width, 4) RGBA of heads in one place, the scene's pivot in the middle; size (width, height).

    Where heads cover each other the nearer surface is drawn by its opacity, the farther shines through.
    """
    right, up, _ = gl.viewer_rotation(view) @ scene.pivot
    middle = (right, up - view.rise)
    layers = []
    for head in heads:
        beads = [(mark.points, TONES[mark.tone]) for mark in scene.marks if mark.head == head.name]
        layers.append(
            gl.render_layer(
                head,
                view,
                *size,
                pixels_per_metre,
                middle=middle,
                marked=scene.landmarks,
                beads=beads,
            )
        )
    return gl.over_each_other(layers, [head.opacity for head in heads])


def segments(
    scene: Scene, heads: Sequence[Head], view: View
) -> list[tuple[NDArray[np.float64], str]]:
    """Of each kind of line in the room of these heads: (n, 2, 2) metres right and up from the middle, and the tone."""
    names = {head.name for head in heads}
    turn = gl.viewer_rotation(view)[:2]
    found = []
    for line in scene.lines:
        if line.head in names:
            at = (line.segments - scene.pivot) @ turn.T
            found.append((at + np.array([0.0, view.rise]), line.tone))
    return found
