"""Heads of one place, with what is laid over them: the nearer covers the farther, the hidden is not drawn."""

from dataclasses import replace

import numpy as np
import pytest

import scenes
from faceambig.render import gl, heads, marked, overlay, painter
from faceambig.render.canvas import Canvas
from faceambig.render.gl import Layer
from faceambig.render.sheet import GROUND, OBSERVED, PROJECTED
from faceambig.scene import Head, Lines, Marks, Scene

draws = pytest.mark.gl
SIZE = (720, 450)  # half of the layout's own: a unit is half a pixel
CLOSE = replace(scenes.FRONT, half_height=0.12)


@pytest.fixture(autouse=True)
def _renderer(request):
    if request.node.get_closest_marker("gl"):
        scenes.need_renderer()


def layer(colour, front, alpha=255) -> Layer:
    rgba = np.empty((1, len(front), 4), dtype=np.uint8)
    rgba[...] = (*colour, alpha)
    rgba[0, np.isinf(front), 3] = 0
    return Layer(rgba, np.array([front], dtype=np.float32))


def test_in_each_pixel_the_nearer_covers_the_farther_by_its_opacity():
    red = layer((200, 0, 0), [0.1, 0.3, 0.1, -np.inf])
    blue = layer((0, 0, 200), [0.2, 0.2, -np.inf, -np.inf])
    for order in ((0, 1), (1, 0)):
        layers, opacities = [red, blue], [1.0, 0.25]
        mixed = heads.blended([layers[i] for i in order], [opacities[i] for i in order])[0]
        assert mixed[0].tolist() == [150, 0, 50, 255]  # a quarter of blue before red
        assert mixed[1].tolist() == [200, 0, 0, 255]  # red hides the ghost behind it
        assert mixed[2].tolist() == [200, 0, 0, 255]
        assert mixed[3, 3] == 0
    alone = heads.blended([blue], [0.25])[0]
    assert alone[0].tolist() == [0, 0, 200, 64]


@draws
def test_the_depth_of_a_pixel_is_that_of_the_surface():
    # a plane that rises by its own x: 1 metre a metre
    corners = np.array([[-1, -1, -1], [1, -1, 1], [1, 1, 1], [-1, 1, -1]]) * 0.05
    faces = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32)
    plane = Head("plane", "", corners, faces, np.full((4, 3), 200, dtype=np.uint8))
    view = replace(scenes.FRONT, half_height=0.1)
    for size in (40, 1800):  # sampled twice each way, and once
        drawn = gl.render_layer(plane, view, size, size, size / 0.2)
        x = (np.arange(size) + 0.5) * 0.2 / size - 0.1
        inside = np.abs(x) < 0.049
        found = drawn.front[size // 2, inside]
        # the nearest of a pixel's samples, half a pixel aside at most; the buffer has 24 bits of 4 metres
        assert np.abs(found - x[inside]).max() < 0.5 * 0.2 / size + 1e-5
        assert np.isneginf(drawn.front[2, 2])
        assert np.array_equal(np.isfinite(drawn.front), drawn.rgba[..., 3] > 0)


@pytest.fixture
def blank(monkeypatch):
    """Heads and painted photographs are left out: no OpenGL is needed, and it is quick."""

    def nothing(head, view, width, height, pixels_per_metre, **options):
        front = np.full((height, width), -np.inf, dtype=np.float32)
        return Layer(np.zeros((height, width, 4), dtype=np.uint8), front)

    def grey(vertices, photo, focal, size, **options):
        return np.full((size[1], size[0], 3), 200, dtype=np.uint8)

    monkeypatch.setattr(gl, "render_layer", nothing)
    monkeypatch.setattr(painter, "paint", grey)


def bare(**fields) -> Scene:
    """One egg of one grey, without numbers that could be red or blue."""
    egg = scenes.head("true", "")
    egg = replace(egg, colours=np.full_like(egg.colours, 190))
    return replace(scenes.scene(view=CLOSE, curves=None), heads=(egg,), note="", **fields)


def coloured(picture: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    """(n, 2) row and column of the pixels, where the heads stand, that are as red or as blue as a colour."""
    red, _, blue = np.moveaxis(picture[..., :3].astype(int), 2, 0)
    more = (red - blue) * np.sign(colour[0] - colour[2])  # the egg and the ground are nearly grey
    more[:, :190] = more[:, 530:] = more[:122] = more[323:] = 0
    return np.argwhere(more > 60)


@draws
@pytest.mark.parametrize(("tone", "colour"), [("seen", OBSERVED), ("d_l", PROJECTED)])
def test_a_mark_before_the_surface_is_drawn_and_one_behind_it_is_not(tone, colour):
    tip = scenes.face()[0][:, 2].argmax()
    nose = scenes.face()[0][tip] + (0.0, 0.0, 1.5e-3)
    behind = nose - (0.0, 0.0, 0.01)
    shown, hidden, other = (
        overlay.draw(bare(marks=(Marks(name, at[None], tone),)), *SIZE)
        for name, at in (("true", nose), ("true", behind), ("someone", nose))
    )
    assert len(coloured(shown, colour)) > 2
    assert len(coloured(hidden, colour)) == 0
    assert np.array_equal(hidden, other)
    # it stands where the tip of the nose is: parallel rays, the egg is in the middle of the picture
    row, column = coloured(shown, colour).mean(axis=0)
    assert column == pytest.approx(360, abs=1.5)
    x0, x1 = _across(hidden)
    scale = (x1 - x0) / np.ptp(scenes.face()[0][:, 0])  # pixels for a metre
    assert 225 - 3 - row == pytest.approx((nose[1] - scenes.PIVOT[1]) * scale, abs=2)


def _across(picture: np.ndarray) -> tuple[int, int]:
    """First and last column of the head at the height of its eyes."""
    row = picture[222, 190:530, :3].astype(int)
    found = np.flatnonzero(np.abs(row - GROUND).max(axis=1) > 40) + 190
    return int(found[0]), int(found[-1])


@draws
def test_a_line_is_drawn_as_far_as_nothing_hides_it():
    through = np.array([[[-0.11, -0.03, -0.06], [0.11, -0.03, -0.06]]])
    drawn = overlay.draw(bare(lines=(Lines("pyramid", "true", through, "seen"),)), *SIZE)
    x0, x1 = _across(overlay.draw(bare(), *SIZE))
    columns = coloured(drawn, OBSERVED)[:, 1]
    assert not ((columns > x0 + 4) & (columns < x1 - 4)).any()  # within the egg
    assert (columns < x0).any()
    assert (columns > x1).any()


@draws
def test_a_ghost_stands_in_the_place_of_the_fitted_head():
    scene = scenes.scene()
    true, fit = scene.heads
    ghost = replace(true, name="ghost", title="", slot=fit.slot, opacity=0.4)
    plain = overlay.draw(scene, *SIZE)
    over = overlay.draw(replace(scene, heads=(true, fit, ghost)), *SIZE)
    changed = np.argwhere((plain != over).any(axis=2))
    assert len(changed) > 500
    assert changed[:, 1].min() > 360  # the fitted head is the right one of two
    away = 0.02 * gl.viewer_rotation(scene.views[0])[2]
    behind = replace(ghost, vertices=fit.vertices - away)
    hidden = overlay.draw(replace(scene, heads=(true, fit, behind)), *SIZE)
    # smoothed pixels of the outline, where half of the fitted head is nothing
    assert (plain != hidden).any(axis=2).sum() < 0.1 * len(changed)


def test_of_blinking_heads_the_fitted_one_is_drawn_under_its_title(blank):
    scene = scenes.scene()
    true, fit = (replace(head, slot=0.0) for head in scene.heads)
    blink = overlay.draw(replace(scene, heads=(true, fit), blink=True), *SIZE)
    assert np.array_equal(blink, overlay.draw(replace(scene, heads=(fit,)), *SIZE))
    both = overlay.draw(replace(scene, heads=(true, fit)), *SIZE)  # two titles
    assert not np.array_equal(blink, both)


def test_the_bar_grows_with_the_zoom(blank):
    scene = replace(scenes.scene(view=scenes.FRONT, curves=None), note="")
    near = replace(scene, views=(replace(scenes.FRONT, half_height=0.165 / 3),))
    bars = []
    for asked in (scene, near, replace(scene, scale_bar=0.0)):
        drawn = overlay.draw(asked, transparent=True)[620:760, 380:1060, 3] > 127
        bars.append(int(drawn.sum(axis=1).max()))
    # two pixels of strokes at the ends
    assert (bars[1] - 2) / (bars[0] - 2) == pytest.approx(3.0, rel=0.02)
    assert bars[2] == 0


@draws
def test_without_overlays_there_are_heads_and_nothing_else():
    vertices = scenes.face()[0]
    marks = (Marks("true", vertices[::40], "seen", tuple("n" for _ in vertices[::40])),)
    lines = (Lines("rays", "true", np.array([[[0.0, 0, 0], [0, 0, 0.3]]]), "seen"),)
    full = scenes.scene(legend=scenes.legend(), marks=marks, lines=lines)
    empty = replace(full, marks=(), lines=(), note="", scale_bar=0.0, legend=None, curves=None)
    a, b = (overlay.draw(s, 360, 225, transparent=True, overlays=False) for s in (full, empty))
    assert np.array_equal(a, b)
    assert 0.2 < (a[..., 3] > 127).mean() < 0.8
    photo = replace(
        full.photo, observed=full.photo.observed[:0], projected=full.photo.projected[:0]
    )
    both, plain = (
        overlay.draw(
            replace(full, through_camera=True, photo=shown),
            360,
            225,
            transparent=True,
            overlays=False,
        )
        for shown in (full.photo, photo)
    )
    assert np.array_equal(both, plain)


def test_a_gap_is_drawn_as_many_times_its_length_as_is_asked_for():
    photo = scenes.photo()
    for scale in (1.0, 20.0):
        ends = marked.gap_lines(replace(photo, error_scale=scale))
        given = np.isfinite(photo.observed).all(axis=1)
        assert np.array_equal(ends[:, 0], photo.observed[given])
        gap = photo.projected[given] - photo.observed[given]
        assert np.abs(ends[:, 1] - ends[:, 0] - scale * gap).max() < 1e-12 * 500 * scale


def test_names_stand_beside_their_points_and_never_over_each_other():
    points = np.array(
        [[50.0, 50.0], [53.0, 50.0], [56.0, 50.0], [54.0, 52.0], [np.nan, 1.0], [150, 90]]
    )
    canvas = Canvas((200, 120), 1.0, GROUND)
    marked.names(canvas, points, ("one", "two", "three", "four", "gone", "far"), 3.0)
    words = [box[0] for box in canvas.boxes]
    assert "gone" not in words
    assert {"one", "far"} <= set(words)
    for i, (_, x, y, wide, tall) in enumerate(canvas.boxes):
        for _, ox, oy, owide, otall in canvas.boxes[i + 1 :]:
            assert min(x + wide, ox + owide) <= max(x, ox) or min(y + tall, oy + otall) <= max(
                y, oy
            )


def test_a_real_photograph_is_drawn_instead_of_a_painted_one(blank):
    rng = np.random.default_rng(0)
    pixels = rng.integers(0, 255, (500, 500, 3), dtype=np.uint8)
    photo = replace(scenes.photo(), pixels=pixels, points_shown=False)
    scene = replace(scenes.scene(through_camera=True), photo=photo)
    drawn = overlay.draw(scene, 1440, 900)
    side = min((1440 - 36 - 36) / 2, 900 - 84 - 122 - 40)
    left = (1440 - 2 * side - 36) / 2
    part = drawn[84 + 20 : 84 + 120, round(left) + 20 : round(left) + 120, :3]
    assert part.std() > 30  # noise, where a painted photograph has a smooth ground


@draws
def test_what_is_laid_over_heads_and_photograph_looks_like_the_stored_picture():
    vertices, narrow = scenes.face()[0], scenes.face(0.93)[0]
    rays = np.stack([vertices[::211], np.broadcast_to([0.05, 0.0, 0.2], vertices[::211].shape)], 1)
    cross = np.array(
        [[[-0.03, -0.03, 0.07], [0.03, 0.03, 0.07]], [[0.03, -0.03, 0.07], [-0.03, 0.03, 0.07]]]
    )
    scene = scenes.scene(
        marks=(
            Marks("true", 1.01 * vertices[::37] + (0, 0, 1e-3), "seen"),
            Marks("fit", 1.01 * narrow[::37] + (0, 0, 1e-3), "d_l"),
        ),
        lines=(Lines("rays", "true", rays, "seen"), Lines("pyramid", "fit", cross, "dim")),
    )
    true, fit = scene.heads
    ghost = replace(true, name="ghost", title="", slot=fit.slot, opacity=0.45)
    sweep = scenes.curves()
    density = np.exp(-0.5 * (np.log(sweep.distances / 0.45) / 0.25) ** 2)
    told = replace(sweep, density=density, intervals=((0.38, 0.53), (0.28, 0.74)), beyond=0.03)
    outline = np.array(
        [[120.0, 120], [380, 120], [400, 380], [np.nan, np.nan], [200, 450], [300, 450]]
    )
    photo = replace(scene.photo, names_shown=True, error_scale=10.0, outline=outline)
    scene = replace(scene, heads=(true, fit, ghost), curves=told, photo=photo)
    scenes.like_stored("overlaid", overlay.draw(scene, 720, 450))


@draws
def test_two_faces_in_one_place_look_like_the_stored_picture():
    scale = replace(
        scenes.legend(), low=-15.0, ticks=(-15.0, 0.0, 15.0), open_low=True, open_high=True
    )
    scene = scenes.scene(hide=frozenset({"truth"}), legend=scale)
    true, fit = (replace(head, slot=0.0) for head in scene.heads)
    shown = (replace(true, opacity=0.6), replace(fit, opacity=0.8))
    scenes.like_stored("one_place", overlay.draw(replace(scene, heads=shown), 720, 450))
