"""Finished pictures: words fit, marks stand where the points are, curves and numbers say what the scene says."""

import io
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import scenes
from faceambig.render import gauges, gl, marked, overlay, painter, plots
from faceambig.render.canvas import Canvas
from faceambig.render.sheet import GROUND, OBSERVED, PROJECTED, WORDS

draws = pytest.mark.gl
LAYOUTS = ("usual", "strip", "camera", "legend")


@pytest.fixture(autouse=True)
def _renderer(request):
    if request.node.get_closest_marker("gl"):
        scenes.need_renderer()


@pytest.fixture
def canvases(monkeypatch):
    """Every canvas that is drawn on; heads and photographs are left blank: no OpenGL is needed, and it is quick."""
    made = []

    class Kept(Canvas):
        def __init__(self, *arguments):
            super().__init__(*arguments)
            made.append(self)

    def nothing(head, view, width, height, pixels_per_metre, **options):
        front = np.full((height, width), -np.inf, dtype=np.float32)
        return gl.Layer(np.zeros((height, width, 4), dtype=np.uint8), front)

    def blank(vertices, photo, focal, size, **options):
        return np.full((size[1], size[0], 3), 200, dtype=np.uint8)

    monkeypatch.setattr(overlay, "Canvas", Kept)
    monkeypatch.setattr(painter, "paint", blank)
    monkeypatch.setattr(gl, "render_layer", nothing)
    return made


def layout(name, distance=1.2):
    if name == "strip":
        return scenes.strip()
    if name == "legend":
        return scenes.scene(distance, legend=scenes.legend())
    return scenes.scene(distance, through_camera=name == "camera")


def words_of(canvas):
    return [text for text, *_ in canvas.boxes]


def overlapping(canvas):
    """Pairs of words whose boxes share more than a hair."""
    pairs = []
    for i, (a, ax, ay, aw, ah) in enumerate(canvas.boxes):
        for b, bx, by, bw, bh in canvas.boxes[i + 1 :]:
            across = min(ax + aw, bx + bw) - max(ax, bx)
            down = min(ay + ah, by + bh) - max(ay, by)
            if across > 0.5 and down > 0.5:
                pairs.append((a, b))
    return pairs


@pytest.mark.parametrize(
    ("name", "size"), [("usual", (1440, 900)), ("strip", (1600, 760)), ("camera", (1440, 900))]
)
def test_a_picture_has_the_default_size_of_its_layout(canvases, name, size):
    assert overlay.draw(layout(name)).shape == (size[1], size[0], 4)


@pytest.mark.parametrize("name", LAYOUTS)
@pytest.mark.parametrize("size", [(None, None), (2400, 900), (900, 1600), (640, 400)])
@pytest.mark.parametrize("distance", [0.2, 0.29, 0.3, 0.315, 1.2, 3.0, None])
def test_words_stay_inside_and_apart(canvases, name, size, distance):
    overlay.draw(layout(name, distance), *size)
    canvas = canvases[0]
    for text, x, y, wide, tall in canvas.boxes:
        assert x > -0.5, text
        assert y > -0.5, text
        assert x + wide < canvas.room[0] + 0.5, text
        assert y + tall < canvas.room[1] + 0.5, text
    assert overlapping(canvas) == []


def test_long_words_are_made_smaller_then_cut(canvases):
    heads = tuple(replace(head, title=40 * "long ") for head in scenes.scene().heads)
    overlay.draw(replace(scenes.scene(), heads=heads, note=100 * "wordy "))
    assert overlapping(canvases[0]) == []
    assert sum(text.endswith("…") for text in words_of(canvases[0])) == 3


def test_numbers_are_written_as_the_page_writes_them(canvases):
    overlay.draw(scenes.scene(1.2))
    words = words_of(canvases[0])
    assert {
        "0.25",
        "5.3",
        "true 30",
        "assumed 120",
        "assumed 120\u2009cm",
        "taken from 30 cm",
    } <= set(words)
    assert "50\u2009mm" in words
    assert [gauges.percent(v) for v in (0.0, 0.0049, 0.994, 0.996, 1.04, 12.34)] == [
        "0.00", "0.00", "0.99", "1.0", "1.0", "12.3",
    ]  # fmt: skip
    assert [plots.centimetres(v) for v in (0.2, 0.3149, 1.2, 1.216, 3.0, 12.0)] == [
        "20", "31.5", "120", "122", "300", "1200",
    ]  # fmt: skip


def test_what_is_not_good_is_said(canvases):
    scene = scenes.scene()
    for numbers, expected in (
        (replace(scene.numbers, converged=False), WORDS["not_converged"]),
        (replace(scene.numbers, plausible=False), WORDS["implausible"]),
        (
            replace(scene.numbers, flex_words="nose forward", flex_mm=4.0),
            "nose forward: +4.0\u2009mm",
        ),
    ):
        for through in (False, True):
            overlay.draw(replace(scene, numbers=numbers, through_camera=through))
            assert expected in words_of(canvases[-1])
            assert overlapping(canvases[-1]) == []


def test_several_modes_are_said_below_each_other(canvases):
    scene = scenes.scene()
    flex = (("nose forward, ears back", 4.0), ("jaw wider", -2.5), ("brows up, mouth down", 1.0))
    numbers = replace(scene.numbers, flex=flex, flex_words=flex[0][0], flex_mm=4.0)
    for through in (False, True):
        overlay.draw(replace(scene, numbers=numbers, through_camera=through, note=30 * "words "))
        words = words_of(canvases[-1])
        assert [f"{part}: {mm:+.1f}\u2009mm" in words for part, mm in flex] == [True] * 3
        assert overlapping(canvases[-1]) == []


def test_what_is_hidden_is_not_written(canvases):
    scene = scenes.scene()
    overlay.draw(replace(scene, hide=frozenset({"truth"})))
    words = set(words_of(canvases[-1]))
    assert "0.25" in words
    assert not words & {"5.3", WORDS["d_s"], WORDS["d_s_axis"]}
    overlay.draw(replace(scene, hide=frozenset({"numbers"})))
    assert not set(words_of(canvases[-1])) & {"5.3", "0.25"}
    unknown = replace(scenes.curves(), true_distance=np.nan)
    overlay.draw(replace(scene, curves=unknown))
    assert "true 30" not in words_of(canvases[-1])
    assert "assumed 120" in words_of(canvases[-1])


def test_a_reference_in_place_of_the_true_face_is_named(canvases):
    scene = scenes.scene()
    numbers = replace(scene.numbers, reference="the 60 cm fit")
    overlay.draw(replace(scene, numbers=numbers))
    written = " ".join(words_of(canvases[-1]))
    assert "mean distance to the 60 cm fit" in written
    assert WORDS["d_s_note"] not in written


@pytest.mark.parametrize("strip", [False, True])
def test_open_ends_of_a_scale_are_written_at_its_bar(canvases, strip):
    scale = replace(scenes.legend(), low=-15.0, ticks=(-15.0, -5.0, 5.0, 15.0), open_low=True)
    scene = replace(scenes.strip() if strip else scenes.scene(), legend=scale)
    overlay.draw(scene)
    assert {"<\u2009\u221215", "\u22125", "5", "15"} <= set(words_of(canvases[-1]))
    overlay.draw(replace(scene, legend=replace(scale, open_high=True)))
    assert ">\u200915" in words_of(canvases[-1])
    assert overlapping(canvases[-1]) == []


@pytest.mark.parametrize("distance", [0.2, 0.3, 3.0, None])
@pytest.mark.parametrize("hide", [(), ("truth",)])
def test_a_density_is_a_plot_of_its_own_below_the_others(canvases, distance, hide):
    sweep = scenes.curves()
    told = replace(
        sweep, density=1.0 / sweep.distances / 5.0, intervals=((0.2, np.inf),), beyond=0.4
    )
    numbers = replace(scenes.scene().numbers, converged=False)
    scene = replace(scenes.scene(distance, curves=told, hide=frozenset(hide)), numbers=numbers)
    overlay.draw(scene)
    assert {WORDS["density"], "40\u2009% farther"} <= set(words_of(canvases[-1]))
    assert overlapping(canvases[-1]) == []
    high = plots.height(told, hide) - plots.height(sweep, hide)
    assert high == plots.DENSITY_ROOM
    bottom = max(y + tall for _, _, y, _, tall in canvases[-1].boxes)
    assert bottom <= canvases[-1].room[1]


def test_words_can_be_replaced(canvases):
    overlay.draw(scenes.scene(), words={"d_l": "Abstand der Punkte"})
    assert "Abstand der Punkte" in words_of(canvases[0])
    assert WORDS["d_s"] in words_of(canvases[0])


@pytest.mark.parametrize("size", [(100, 900), (1440, 20000), (0, 900)])
def test_a_size_out_of_range_is_refused_by_name(size):
    with pytest.raises(ValueError, match=r"^(width|height): \d+ pixels, expected 160 to 16384$"):
        overlay.draw(scenes.scene(), *size)


def test_marks_stand_where_the_points_are():
    at, step = np.array([31, 17]), 0.7
    points = np.array([[40.3, 55.9], [120.0, 90.5]])
    photo = replace(scenes.photo(), observed=points[:1], projected=points[1:])
    canvas = Canvas((160, 120), 1.0, GROUND)
    marked.marks(canvas, at, step, photo, 5.0)
    pixels = canvas.pixels.astype(float)
    rows, columns = np.indices(pixels.shape[:2])
    for point, channels in ((points[0], (0, 2)), (points[1], (2, 0))):
        strength = np.clip(pixels[..., channels[0]] - pixels[..., channels[1]] - 8, 0, None)
        seen = (
            np.array([(strength * (columns + 0.5)).sum(), (strength * (rows + 0.5)).sum()])
            / strength.sum()
        )
        # drawn four times as large with 4 bits of fraction
        np.testing.assert_allclose(seen, at + step * point, atol=0.06, rtol=0)


def test_a_circle_lies_over_its_cross_and_both_on_white():
    point = np.array([[50.0, 50.0]])
    photo = replace(scenes.photo(), observed=point, projected=point)
    canvas = Canvas((100, 100), 1.0, (10, 10, 10))
    marked.marks(canvas, np.zeros(2), 1.0, photo, 10.0)
    ring, middle, halo = canvas.pixels[50, 60], canvas.pixels[50, 50], canvas.pixels[50, 62]
    assert np.abs(ring.astype(int) - PROJECTED).max() < 40
    assert np.abs(middle.astype(int) - OBSERVED).max() < 40
    assert halo.min() > 200


def test_missing_points_are_left_out():
    photo = scenes.photo()
    nothing = replace(
        photo, observed=np.full_like(photo.observed, np.nan), projected=np.zeros((0, 2))
    )
    canvas = Canvas((100, 100), 1.0, GROUND)
    marked.marks(canvas, np.zeros(2), 0.2, nothing, 4.0)
    assert (canvas.pixels == GROUND).all()


@given(
    st.lists(st.tuples(st.floats(0, 300), st.floats(20, 110)), min_size=1, max_size=2),
)
def test_labels_are_pushed_apart_and_stay_inside(labels):
    middles, widths = [m for m, _ in labels], [w for _, w in labels]
    moved = plots.apart(middles, widths, 0.0, 300.0)
    for middle, width in zip(moved, widths, strict=True):
        assert middle - width / 2 >= -1e-9
        assert middle + width / 2 <= 300 + 1e-9
    if len(moved) == 2:
        assert abs(moved[1] - moved[0]) >= sum(widths) / 2 - 1e-9
        assert (moved[0] <= moved[1]) == (middles[0] <= middles[1]) or middles[0] == middles[1]


def test_the_axis_is_even_in_octaves():
    axes = plots.Axes(10.0, 310.0, 0.0, 100.0, 6.0)
    octaves = np.diff(axes.x(np.array([0.3, 0.6, 1.2, 2.4])))
    np.testing.assert_allclose(octaves, octaves[0], rtol=1e-12)
    np.testing.assert_allclose(axes.x(np.array([0.2, 3.0])), [10.0, 310.0], rtol=1e-12)
    np.testing.assert_allclose(
        axes.y(np.array([0.0, 3.0, 6.0, 9.0])), [100.0, 50.0, 0.0, 0.0], atol=1e-12, rtol=0
    )


def test_a_transparent_picture_over_the_ground_is_the_opaque_one(canvases):
    scene = scenes.strip()  # has no panel of another colour
    over = overlay.draw(scene, 800, 380, transparent=True).astype(float)
    opaque = overlay.draw(scene, 800, 380)
    assert (over[0, 0] == 0).all()
    alpha = over[..., 3:] / 255
    shown = over[..., :3] * alpha + np.array(GROUND) * (1 - alpha)
    assert np.abs(shown - opaque[..., :3]).max() <= 3  # two roundings, divided by alpha


def test_a_png_keeps_pixels_and_text_and_its_bytes(canvases):
    from PIL import Image

    picture = overlay.draw(scenes.strip(), 400, 190, transparent=True)
    text = {"Software": "faceambig", "ViewState": '{"subject":3,"note":"α ≤ 3"}'}
    data = overlay.encode_png(picture, text)
    assert data == overlay.encode_png(picture, text)
    with Image.open(io.BytesIO(data)) as opened:
        opened.load()
        assert {name: str(value) for name, value in opened.info.items()} == text
    read = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    assert read is not None
    assert np.array_equal(read[..., [2, 1, 0, 3]], picture)


@draws
def test_a_picture_has_the_same_bytes_twice():
    first, second = (overlay.draw(scenes.scene(), 720, 450) for _ in range(2))
    assert np.array_equal(first, second)


@draws
def test_heads_have_the_scale_of_the_bar():
    scene = scenes.scene(view=scenes.FRONT, curves=None)
    picture = overlay.draw(scene, transparent=True)
    opaque = picture[..., 3] > 127
    head = np.flatnonzero(opaque[300:600, 380:720].any(axis=0))  # the left one, right of the panel
    level = int(np.argmax(opaque[620:, 380:720].sum(axis=1)))
    bar = np.flatnonzero(opaque[620 + level, 380:720])
    wide = np.ptp(scene.heads[0].vertices[:, 0])
    # half a pixel at each of four ends of 70 and 210 pixels
    assert np.ptp(head) / np.ptp(bar) == pytest.approx(wide / scene.scale_bar, rel=0.02)


@draws
def test_scale_multiplies_the_pixels_and_nothing_else():
    plain = overlay.draw(scenes.scene(), 720, 450)
    large = overlay.draw(scenes.scene(), 720, 450, scale=2)
    assert large.shape == (900, 1440, 4)
    small = cv2.resize(large, (720, 450), interpolation=cv2.INTER_AREA)
    assert (
        np.abs(small.astype(int) - plain).mean() < 2.5
    )  # lines of whole pixels, text of whole sizes


@draws
@pytest.mark.parametrize(
    ("name", "size"),
    [("usual", (960, 600)), ("strip", (960, 456)), ("camera", (720, 450)), ("legend", (720, 450))],
)
def test_pictures_look_like_the_stored_ones(name, size):
    scenes.like_stored(name, overlay.draw(layout(name), *size))
