"""together: what shares a place is drawn over each other by depth and opacity, points and lines where they stand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import scenes
from faceambig.render import gl, together
from faceambig.scene import Lines, Marks

pytestmark = pytest.mark.gl
SIZE, SCALE = (80, 80), 1000.0  # pixels, pixels a metre


@pytest.fixture(autouse=True)
def renderer() -> None:
    scenes.need_renderer()


def square(z: float, colour: tuple[int, int, int], opacity: float = 1.0, half: float = 0.02):
    """A square facing the viewer, in the colours of a legend: drawn as they are."""
    corners = half * np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], dtype=float)
    return replace(
        scenes.head(lit=False),
        vertices=corners + np.array([0.0, 0.0, z]),
        faces=np.array([(0, 1, 2), (0, 2, 3)], dtype=np.uint32),
        colours=np.tile(np.array(colour, dtype=np.uint8), (4, 1)),
        occlusion=None,
        opacity=opacity,
    )


def layers(*heads):
    drawn = [gl.render_layer(head, scenes.FRONT, *SIZE, SCALE) for head in heads]
    return gl.over_each_other(drawn, [head.opacity for head in heads])[40, 40].astype(int)


RED, BLUE = (200, 40, 40), (40, 40, 200)


@pytest.mark.parametrize("swapped", [False, True])
def test_the_nearer_surface_covers_whatever_the_order(swapped):
    near, far = square(0.01, RED), square(-0.01, BLUE)
    pixel = layers(*((far, near) if swapped else (near, far)))
    assert np.abs(pixel[:3] - RED).max() <= 2
    assert pixel[3] == 255


def test_the_farther_surface_shines_through_by_what_the_nearer_leaves():
    pixel = layers(square(0.01, RED, 0.25), square(-0.01, BLUE))
    # 0.25 of the one and 0.75 of the other; two of 255 for rounding on the way
    assert np.abs(pixel[:3] - (0.25 * np.array(RED) + 0.75 * np.array(BLUE))).max() <= 2
    assert pixel[3] == 255
    behind = layers(square(-0.01, RED, 0.25), square(0.01, BLUE))
    assert np.abs(behind[:3] - BLUE).max() <= 2
    alone = layers(square(0.0, RED, 0.25))
    assert abs(alone[3] - 64) <= 1
    assert np.abs(alone[:3] - RED).max() <= 3


def test_heads_of_a_slot_share_a_place_and_those_in_turn_do_not():
    scene = scenes.scene()
    one, two = (replace(scene.heads[0], name=name, slot=0.0) for name in ("true", "fit"))
    third = replace(one, name="other", slot=0.3)
    scene = replace(scene, heads=(one, third, two))
    names = [[head.name for head in heads] for heads in together.places(scene)]
    assert names == [["true", "fit"], ["other"]]
    assert len(together.places(replace(scene, blink=True))) == 3


def test_lines_and_points_are_those_of_their_head_about_the_pivot():
    scene = replace(scenes.scene(), pivot=(0.0, 0.01, 0.02))
    ends = np.array([[[0.0, 0.01, 0.02], [0.03, 0.02, 0.5]]])
    scene = replace(scene, lines=(Lines("rays", "true", ends, "seen"),), heads=scene.heads[:1])
    mine = replace(scene.heads[0], name="true")
    ((at, tone),) = together.segments(scene, [mine], scenes.FRONT)
    assert tone == "seen"
    assert np.allclose(at, [[[0.0, 0.0], [0.03, 0.01]]], rtol=0, atol=1e-12)
    assert together.segments(scene, [replace(mine, name="fit")], scenes.FRONT) == []

    head = replace(square(0.02, BLUE), name="true")
    point = np.array([[0.01, 0.01, 0.021]])
    scene = replace(scene, marks=(Marks("true", point, "seen"),), lines=())
    picture = together.picture(scene, [head], scenes.FRONT, (400, 400), 4 * SCALE)
    marked = np.abs(picture[:, :, :3].astype(int) - together.TONES["seen"]).max(axis=2) < 12
    rows, columns = np.nonzero(marked)
    assert len(rows)
    # the pivot is in the middle, so the point lies 40 pixels to the right of it; a pixel for the ball's edge
    assert abs(columns.mean() - 239.5) < 1
    assert abs(rows.mean() - 199.5) < 1
