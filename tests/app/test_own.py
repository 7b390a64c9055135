"""A person's own photograph: what is read, refused and fitted, in which words, and that nothing keeps it."""

from __future__ import annotations

import asyncio
import gc
import io
import struct
import weakref
import zlib
from typing import Any

import numpy as np
import pytest
from PIL import Image

import faceambig as fa
from faceambig import compose
from faceambig.observation import portrait_camera
from faceambig.render import painter
from faceambig_app import notices, own
from faceambig_app.markup.photograph import photo_marks
from faceambig_app.own import page as own_page
from faceambig_app.own import placing
from faceambig_app.own.room import OwnRoom
from faceambig_app.state import DEFAULT, ViewState, changed, link

VIEW: dict[str, Any] = {"distance": 0.5, "yaw_deg": 10.0}
SIDE = 600  # pixels of the photograph; a synthetic one counts its points in 500
STATE = ViewState(subject="photo")
UNREADABLE = (
    "This file is not a picture we can read (PNG, JPEG, WebP, up to 16 MB and 40 megapixels)."
)


def encoded(rgb: np.ndarray, kind: str = "JPEG", **options: Any) -> bytes:
    file = io.BytesIO()
    Image.fromarray(rgb).save(file, kind, **options)
    return file.getvalue()


@pytest.fixture(scope="module")
def painted(embedded) -> np.ndarray:
    """(600, 600, 3) a synthetic person from 50 cm."""
    subject = embedded.subject(2)
    observation = fa.observe(subject, **VIEW)
    camera = portrait_camera(subject, **VIEW)
    return painter.paint_photo(compose.photo(subject, observation, camera, caption=""), SIDE)


@pytest.fixture(scope="module")
def portrait(embedded, painted) -> bytes:
    """The photograph as a telephone writes it, with the focal length it was taken with."""
    camera = portrait_camera(embedded.subject(2), **VIEW)
    assert camera.focal is not None
    # 43.27 mm: the diagonal of 35 mm film, which equivalent focal lengths compare
    tags = Image.Exif()
    tags.get_ifd(0x8769)[0xA405] = round(camera.focal / (500 * 2**0.5) * 43.27)
    return encoded(painted, quality=95, exif=tags)


@pytest.fixture(scope="module")
def photo(portrait) -> own.OwnPhoto:
    return own.read_photo("me.jpg", portrait)


def true_points(embedded: fa.FaceModel, scheme: str) -> np.ndarray:
    return fa.observe(embedded.subject(2), scheme=scheme, **VIEW).points * SIDE / 500


def twelve(photo: own.OwnPhoto, embedded: fa.FaceModel, count: int = 12) -> own.OwnPhoto:
    """The first points placed where they are."""
    placed, at = placing.begin(photo, embedded), true_points(embedded, placing.SCHEME)
    for name in placed.asked[:count]:
        placed = placing.place(placed, *at[placed.names.index(name)].tolist())
    return placed


# ---------------------------------------------------------------- files


def bomb() -> bytes:
    """A PNG of 20,000 x 20,000 grey pixels in half a megabyte: decoded, 400 million."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))  # fmt: skip

    header = struct.pack(">IIBBBBB", 20_000, 20_000, 8, 0, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header)
        + chunk(b"IDAT", zlib.compress(bytes(20_001 * 20_000), 1)[:50_000]) + chunk(b"IEND", b"")
    )  # fmt: skip


def test_what_is_no_picture_is_refused_in_words(painted):
    good = encoded(painted)
    bad = [b"", b"hello", good[: len(good) // 2], encoded(painted, "BMP"), encoded(painted, "GIF")]
    for data in bad:
        with pytest.raises(ValueError, match="not a picture") as caught:
            own.read_photo("me.jpg", data)
        assert str(caught.value) == UNREADABLE


def test_a_picture_of_400_megapixels_is_refused_before_a_pixel_is_decoded():
    header_only = bomb()[:50]  # with the pixels cut off too: nobody looked at them
    for data in (bomb(), header_only):
        with pytest.raises(ValueError, match="not a picture") as caught:
            own.read_photo("me.png", data)
        assert str(caught.value) == UNREADABLE
        assert "400 million pixels" in str(caught.value.__cause__)


@pytest.mark.parametrize("kind", ["JPEG", "PNG", "WEBP"])
def test_a_picture_is_turned_upright_and_kept_small(kind):
    wide = np.zeros((1500, 2000, 3), dtype=np.uint8)
    wide[:750, :1000] = 255  # bright above on the left
    tags = Image.Exif()
    tags[0x0112] = 6  # held turned: a quarter to the right brings it upright
    taken = own.read_photo("me", encoded(wide, kind, exif=tags)).taken
    assert taken.file_size == (1500, 2000)
    assert taken.size == (1200, 1600)
    assert taken.scale == pytest.approx(0.8)
    bright = taken.rgb.mean(axis=2) > 128
    assert bright[100, 1100]
    assert not bright[100, 100]
    assert not bright[1500, 1100]
    shown = np.asarray(Image.open(io.BytesIO(taken.jpeg)))
    assert shown.shape == taken.rgb.shape


def test_points_of_a_file_count_its_own_pixels(embedded, painted):
    large = np.asarray(Image.fromarray(painted).resize((2000, 2000)))
    photo = own.read_photo("me.jpg", encoded(large))
    points = true_points(embedded, "ibug68") * 2000 / SIDE
    points[:7] = 2500.0, 300.0  # outside
    rows = "\n".join(f"{x:.3f} {y:.3f}" for x, y in points)
    text = f"version: 1\nn_points: 68\n{{\n{rows}\n}}\n"
    read = own.from_file(photo, embedded, "me.pts", text.encode())
    assert np.allclose(read.points[7:], 0.8 * points[7:], rtol=0, atol=1e-3)  # the file's digits
    assert "61 of 68 points used; 7 outside the picture (1 to 7)" in read.words
    odd = text.replace(f"{points[9, 0]:.3f}", "x", 1)
    with pytest.raises(ValueError, match=r"line 13 of me.pts: expected two numbers"):
        own.from_file(photo, embedded, "me.pts", odd.encode())
    with pytest.raises(ValueError, match="not a text file"):
        own.from_file(photo, embedded, "me.pts", b"\xff\xfe\x00")
    with pytest.raises(ValueError, match="a landmark file has at most"):
        own.from_file(photo, embedded, "me.pts", b" " * (1 << 21))


# ---------------------------------------------------------------- points


def test_points_are_found_where_they_are(photo, embedded):
    found = own.found(photo, embedded)
    assert (found.scheme, found.placed) == ("ibug68", 51)  # without the jaw
    gaps = np.linalg.norm(found.points[17:] - true_points(embedded, "ibug68")[17:], axis=1)
    assert np.nanmean(gaps) < 0.06 * 0.2 * SIDE  # 6 % of the eye distance, a fifth of the picture
    assert found.part is not None  # and the face fills what is shown
    x, y, width, height = found.part
    inside = (found.points[17:] > (x, y)) & (found.points[17:] < (x + width, y + height))
    assert inside.all()
    assert own.problem(found) == ""


def test_where_there_is_no_face_words_say_what_to_do(embedded):
    grey = own.read_photo("wall.png", encoded(np.full((300, 300, 3), 120, np.uint8), "PNG"))
    with pytest.raises(ValueError, match="No face") as caught:
        own.found(grey, embedded)
    assert str(caught.value) == "No face found. Place the points by hand: it takes a minute."


def test_twelve_points_are_asked_by_name_one_after_another(photo, embedded):
    placed = placing.begin(photo, embedded)
    seen = []
    while placed.asked:
        words = placing.asked_words(placed)
        assert f"{len(placed.asked)} to go" in words
        seen.append(words)
        placed = placing.place(placed, 10.0 * len(seen), 20.0)
    assert len(set(seen)) == placed.placed == 12
    assert placing.asked_words(placed) == ""
    assert placing.place(placed, 1.0, 2.0) is placed  # nothing is asked: a click places nothing
    headings = {own_page.heading(twelve(photo, embedded, count), STATE) for count in range(12)}
    assert len(headings) == 1  # the photograph below stays where it is
    rest = placing.more(placed)
    assert len(rest.asked) == 8
    assert placing.skip(rest).asked == rest.asked[1:]
    assert placing.skip(rest).placed == 12


def test_a_point_moves_goes_and_stays_in_the_picture(photo, embedded):
    placed = twelve(photo, embedded)
    row = placed.names.index("prn")
    assert own.moved(placed, row, 5.5, 7.25).points[row].tolist() == [5.5, 7.25]
    assert own.moved(placed, row, 9e3, -4.0).points[row].tolist() == [SIDE, 0.0]
    assert own.moved(placed, row, np.nan, np.nan).placed == 11
    assert own.moved(placed, 999, 1.0, 1.0) is placed
    assert placed.placed == 12  # a value: the one before is as it was


def test_too_few_points_and_points_on_a_line_are_said(photo, embedded):
    four = twelve(photo, embedded, 4)
    assert own.problem(four) == "4 points placed. 6 are needed, 12 are better."
    assert own.problem(twelve(photo, embedded, 6)) == ""
    line = placing.begin(photo, embedded)
    for k in range(8):
        line = placing.place(line, 50.0 + 20 * k, 80.0 + 30 * k)
    assert own.problem(line).startswith("These points lie on one line; no pose can be found.")
    assert own.problem(None) == "No photo yet. Your own, or a synthetic person."
    for waiting in (four, line, None, photo):
        scene = own.own_frame(waiting, STATE, False).scene
        assert [head.title for head in scene.heads] == ["Average face"]
        assert own.problem(waiting) in own_page.cards(waiting, STATE, scene)
        assert own_page.curves(waiting, STATE, scene) == ""
    same = placing.begin(photo, embedded)
    for _ in range(8):
        same = placing.place(same, 50.0, 80.0)
    assert own.problem(same).startswith("1 points")  # at one place


# ---------------------------------------------------------------- what is fitted


def test_twelve_points_give_a_face_measured_to_the_fit_at_60_cm(photo, embedded):
    placed = twelve(photo, embedded)
    frame = own.own_frame(placed, STATE, False)
    numbers, curves = frame.scene.numbers, frame.scene.curves
    assert numbers.converged
    assert numbers.d_l_percent < 1.0  # exact points: what the default prior leaves
    assert numbers.d_s_mm > 0.5
    assert numbers.reference == "the 60\u202fcm fit"
    assert [head.title for head in frame.scene.heads] == ["Fit for 60\u202fcm", "Face that fits"]
    assert curves is not None
    assert np.isnan(curves.true_distance)
    at_60 = int(np.abs(curves.distances - 0.6).argmin())
    assert curves.d_s_mm[at_60] == curves.d_s_mm.min() < 0.2  # the nearest of the sweep
    here = own.own_frame(placed, changed(STATE, distance=0.6), False).scene
    assert here.numbers.d_s_mm < 1e-6
    cards = own_page.cards(placed, STATE, frame.scene)
    assert "Difference to the 60\u202fcm fit" in cards
    assert "true face is not known" in cards
    plots = own_page.curves(placed, STATE, frame.scene)
    assert "true:" not in plots
    assert "cannot be told apart" in plots
    assert f"fits your {placed.placed} points" in own_page.heading(placed, STATE)


def test_heads_have_the_colours_of_the_photograph(painted, embedded):
    blue = own.read_photo("blue.png", encoded(np.ascontiguousarray(painted[:, :, ::-1]), "PNG"))
    placed = twelve(blue, embedded)

    def redness(photo: own.OwnPhoto, draft: bool) -> float:
        """Red minus blue over the face; of skin it is above 0."""
        heads = own.own_frame(photo, STATE, draft).scene.heads
        means = [head.colours[embedded.evaluation].mean(axis=0) for head in heads]
        assert np.allclose(means[0], means[1], rtol=0, atol=1.0)  # both heads alike
        return float(means[0][0] - means[0][2])

    assert redness(placed, True) > 20  # the model's own: nobody waits for the photograph's
    assert redness(placed, False) < -20
    moved = own.moved(placed, placed.names.index("prn"), 300.0, 320.0)
    assert redness(moved, True) < -20  # those there were: a hand does not wait for new ones


def test_points_that_no_face_has_are_said_and_the_crosses_stay(photo, embedded):
    placed = twelve(photo, embedded)
    mirrored = own.with_points(placed, placed.points * (-1, 1) + (SIDE, 0))
    frame = own.own_frame(mirrored, STATE, True)
    assert "left and right seem exchanged" in own_page.cards(mirrored, STATE, frame.scene)
    assert np.isfinite(frame.scene.photo.observed[:, 0]).sum() == 12
    assert own.told_distance(mirrored, STATE) is None


def test_a_draft_costs_no_sweep_and_a_moved_point_moves_the_circles(photo, embedded):
    placed = twelve(photo, embedded)
    row = placed.names.index("en_r")
    before = own.own_frame(placed, STATE, True)
    assert before.scene.curves is None
    x, y = placed.points[row].tolist()
    after = own.own_frame(own.moved(placed, row, x, y + 20.0), STATE, True)
    moved = after.scene.photo.projected - before.scene.photo.projected
    shown = np.isfinite(before.scene.photo.projected[:, 0])
    assert shown.sum() == 12  # circles where there are crosses, not for all of Farkas' points
    assert np.linalg.norm(moved[shown], axis=1).max() > 1.0
    assert after.scene.numbers.d_l_percent > 1.5 * before.scene.numbers.d_l_percent


@pytest.mark.parametrize("values", [
    {"show": "overlay"}, {"show": "blink"}, {"show": "difference"}, {"show": "row"},
    {"surface": "depth"}, {"view": "camera"}, {"overlays": ("rays", "pyramid", "outline", "errors")},
    {"flex": ((1, 3.0), (2, -2.0))}, {"camera": "orthographic"}, {"hide": ("truth", "numbers")},
])  # fmt: skip
def test_every_look_is_drawn_of_an_own_photograph(photo, embedded, values):
    scene = own.own_frame(twelve(photo, embedded), changed(STATE, **values), True).scene
    assert all(np.isfinite(head.vertices).all() for head in scene.heads)
    assert not any("True" in head.title for head in scene.heads)
    assert scene.legend is None or "true" not in scene.legend.title


def test_what_is_not_done_with_an_own_photograph_is_said(photo, embedded):
    placed = twelve(photo, embedded)
    for values, words in (
        ({"data": "outline"}, "only points are fitted"),
        ({"draw": 1}, "not drawn"),
        ({"surface": "spread"}, "spread"),
    ):
        with pytest.raises(ValueError, match=words):
            own.own_frame(placed, changed(STATE, **values), True)


def test_the_distance_in_the_file_is_offered_and_not_used(photo, embedded):
    placed = twelve(photo, embedded)
    hint = own.told_distance(placed, changed(STATE, distance=0.5))
    # EXIF rounds to whole millimetres, of 38 here, and a prior shrinks the face by a percent or two
    assert hint == pytest.approx(0.5, rel=0.04)
    assert own.own_frame(placed, STATE, True).scene.numbers.distance == STATE.distance
    assert own.told_distance(photo, STATE) is None  # without points no scale
    assert own.told_distance(None, STATE) is None
    shown = own_page.shown(placed, "", can_undo=False, hint=hint)
    assert shown.hint == hint


def test_the_marks_are_what_the_script_moves(photo, embedded):
    placed = placing.more(twelve(photo, embedded))
    part = (100.0, 50.0, 200.0, 300.0)
    scene = own.own_frame(placed, STATE, True).scene
    html = photo_marks(scene.photo, draggable=True, place=True, part=part)
    assert html.count("data-fa-point=") == html.count("data-fa-at=") == 12
    assert f'data-fa-photo="{SIDE}x{SIDE}"' in html
    assert 'data-fa-view="100,50,200,300"' in html
    assert 'data-fa-place="1"' in html
    assert 'viewBox="100 50 200 300"' in html
    # three times the width of the box, a quarter of the way from left to right: CSS counts positions so
    assert "background-size:300.0000% 200.0000%" in html
    assert "background-position:25.0000% 16.6667%" in html
    assert "data-fa-place" not in photo_marks(scene.photo, draggable=True)


# ---------------------------------------------------------------- nothing keeps it


def test_a_photograph_is_never_in_a_link():
    query = link.query(changed(DEFAULT, subject="photo"))
    assert query == "subject=photo"
    state, said = notices.from_query(query)
    assert state.subject == "photo"
    assert said == ("This link needs your photo.",)


class Told:
    """A room of one photograph, and what it told."""

    def __init__(self) -> None:
        self.changes, self.notices = 0, list[str]()
        self.room = OwnRoom(asyncio.get_running_loop(), self.changed, self.notices.append)
        self.room.model = "embedded"

    def changed(self) -> None:
        self.changes += 1

    async def until(self, holds: Any) -> None:
        for _ in range(1000):
            if holds():
                return
            await asyncio.sleep(0.01)
        raise AssertionError("it did not come")


@pytest.mark.parametrize("how", ["remove", "leave"])
def test_nothing_keeps_a_photograph_that_is_gone(portrait, embedded, how):
    async def visit() -> list[weakref.ref[Any]]:
        told = Told()
        room = told.room
        room.take("me.jpg", portrait)
        await told.until(lambda: room.photo is not None)
        room.find()
        await told.until(lambda: room.photo is not None and room.photo.placed == 51)
        kept: list[weakref.ref[Any]] = []
        frame = None
        for _ in range(2):
            assert room.photo is not None
            frame = own.own_frame(room.photo, STATE, True)
            for show in ("row", "difference", "both"):
                frame = own.own_frame(room.photo, changed(STATE, show=show), False)
            own.told_distance(room.photo, STATE)
            kept += [weakref.ref(room.photo), weakref.ref(room.photo.taken)]
            kept += [weakref.ref(room.photo.taken.rgb.base), weakref.ref(frame.scene.heads[1].vertices)]  # fmt: skip
            room.begin()
            from faceambig_app.script import Click

            at = dict(
                zip(room.photo.names, true_points(embedded, placing.SCHEME).tolist(), strict=True)
            )
            for name in placing.TWELVE:
                room.hear(Click(*at[name]))
        assert all(ref() is not None for ref in kept[1:3])
        getattr(room, how)()
        assert room.photo is None
        if how == "remove":
            assert room.status == "Removed."
        frame = None
        return kept

    kept = asyncio.run(visit())
    gc.collect()
    assert [ref() for ref in kept] == [None] * len(kept)


def test_what_comes_late_is_not_wanted_any_more(portrait):
    async def visit() -> None:
        told = Told()
        told.room.take("me.jpg", portrait)
        told.room.remove()  # while it is read
        await asyncio.sleep(0.3)
        assert told.room.photo is None
        assert told.room.status == "Removed."

    asyncio.run(visit())


def test_a_drag_is_one_step_that_can_be_taken_back(portrait):
    from faceambig_app.script import Click, Gone, Point

    async def visit() -> None:
        told = Told()
        room = told.room
        room.take("me.jpg", b"nothing")
        await told.until(lambda: told.notices)
        assert told.notices == [UNREADABLE]
        room.take("me.jpg", portrait)
        await told.until(lambda: room.photo is not None)
        room.begin()
        for x, y in ((100, 100), (140, 100), (180, 105)):
            room.hear(Click(x=x, y=y))
        assert room.photo is not None
        row = room.photo.names.index("ex_r")
        for x in (101, 105, 110):
            room.hear(Point(index=row, x=x, y=99, done=x == 110))
        assert room.photo.points[row].tolist() == [110, 99]
        room.undo()
        assert room.photo.points[row].tolist() == [100, 100]
        room.hear(Gone(index=row))
        assert room.photo.placed == 2
        room.undo()
        assert room.photo.placed == 3
        for _ in range(4):  # three points and the question itself
            room.undo()
        assert room.photo.placed == 0
        assert not room.can_undo

    asyncio.run(visit())
