"""Stage: the nodes of a browser are those of the scene, stand where it says, and the orbit is told and never drawn."""

from __future__ import annotations

import asyncio
import contextlib
import json
import re
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from html import unescape
from typing import Any

import numpy as np
import pytest

from faceambig.scene import Head, Lines, Marks, Scene, View
from faceambig_app import guard
from faceambig_app.stage import Stage, heads, viewer
from faceambig_app.stage.heads import APART, LETTER, fitted, shaded
from faceambig_app.stage.marks import CROSS, DISC
from faceambig_app.stage.viewer import LENS, ZOOM_1
from scenes import FRONT, PIVOT, SIDE, head, scene, strip


class Camera:
    """What the stage uses of viser's camera; a browser's answers are put in by hand."""

    def __init__(self, width: int, height: int) -> None:
        self.image_width, self.image_height = width, height
        self.position, self.look_at = np.array([0.0, 0.0, LENS]), np.zeros(3)
        self.wxyz, self.fov = np.array([0.0, 1.0, 0.0, 0.0]), 0.02
        self.heard: Any = None
        self.looks = 0

    def __setattr__(self, name: str, value: Any) -> None:
        if name == "min_orbit_distance":  # once a look
            self.looks += 1
        super().__setattr__(name, value)

    def on_update(self, callback: Any) -> None:
        self.heard = callback

    def turn(self, azimuth: float, elevation: float) -> None:
        """As a hand on the page does: the place, and viser's axes: right, down, forward."""
        a, e = np.radians((azimuth, elevation))
        back = np.array([np.sin(a) * np.cos(e), np.sin(e), np.cos(a) * np.cos(e)])
        right = np.array([np.cos(a), 0.0, -np.sin(a)])
        axes = np.column_stack([right, np.cross(right, back), -back])
        self.position, self.wxyz = LENS * back, viewer.quaternion(axes)


@dataclass
class Client:
    """A browser without a browser: viser's own nodes, our camera."""

    scene: Any
    gui: Any
    camera: Camera
    told: list[tuple[float, float, float]] = field(default_factory=list)

    def atomic(self) -> Any:
        return contextlib.nullcontext()

    def node(self, name: str) -> Any:
        return self.scene._handle_from_node_name[name]

    def names(self) -> set[str]:
        return set(self.scene._handle_from_node_name)


@pytest.fixture(scope="module")
def served() -> Iterator[Any]:
    server = guard.start("127.0.0.1", 0)
    yield server
    server.stop()


@pytest.fixture
def enter(served: Any) -> Iterator[Callable[..., tuple[Client, Stage]]]:
    """A browser with a stage."""

    def make(width: int = 700, height: int = 800) -> tuple[Client, Stage]:
        client = Client(served.scene, served.gui, Camera(width, height))
        tell = lambda *place: client.told.append(place)  # noqa: E731 - of the fixture's client
        return client, Stage(client, tell)  # pyright: ignore[reportArgumentType]

    yield make
    served.scene.reset()
    served.gui.reset()


POINTS = np.array([[0.0, 0.01, 0.0123456], [0.03, 0.0, -0.02]])
MARKS = (Marks("true", POINTS, "seen", ("nose", "eye")), Marks("fit", POINTS, "d_l"))
ERRORS = Lines("errors", "fit", np.stack([POINTS, POINTS + 0.002], axis=1), "seen")


def overlaid(**fields: Any) -> Scene:
    """The true face as a ghost over the fitted one."""
    heads = (head("fit", "Face that fits", 0.93), head(opacity=0.4))
    return replace(scene(), heads=heads, **fields)


def test_heads_come_and_go_and_leave_nothing_behind(enter):
    client, shown = enter()
    before = client.names()
    shown.show(strip(), False)
    five = client.names() - before
    assert {name for name in five if name.count("/") == 1} == {
        "/true", "/fit1", "/fit2", "/fit3", "/fit4",
    }  # fmt: skip
    shown.show(replace(scene(), marks=MARKS, lines=(ERRORS,)), False)
    two = client.names() - before
    assert {name.split("/")[1] for name in two} == {"true", "fit"}
    assert {"/true/seen/crosses", "/true/seen/name1", "/fit/d_l/discs", "/fit/errors"} <= two
    shown.show(scene(), False)
    assert not [name for name in client.names() - before if re.search("seen|d_l|errors", name)]
    shown.show(strip(), False)
    assert client.names() - before == five


def test_other_triangles_are_other_meshes(enter):
    client, shown = enter()
    shown.show(replace(scene(), marks=MARKS), False)
    old = client.node("/fit/head")
    first, second = scene().heads
    fewer = replace(second, faces=second.faces[::2].copy())
    shown.show(replace(scene(), heads=(first, fewer), marks=MARKS), False)
    assert np.array_equal(client.node("/fit/head").faces, fewer.faces)
    assert client.node("/fit/head") is not old
    assert client.node("/fit/d_l/discs") is not None  # on the new head
    kept = client.node("/true/head")
    shown.show(scene(), False)
    assert client.node("/true/head") is kept


def in_picture(client: Client, point: np.ndarray) -> np.ndarray:
    """(2,) where a point of the world is on the canvas: -1 to 1 from edge to edge, right and up."""
    camera = client.camera
    back = camera.position - camera.look_at
    back = back / np.linalg.norm(back)
    right = np.cross((0.0, 1.0, 0.0), back)
    right = right / np.linalg.norm(right)
    up = np.cross(back, right)
    way = point - camera.position
    half = np.tan(camera.fov / 2) * -(way @ back)
    return np.array([way @ right * camera.image_height / camera.image_width, way @ up]) / half


@pytest.mark.parametrize("size", [(1440, 900), (700, 800), (300, 900), (390, 844)])
@pytest.mark.parametrize("view", [FRONT, SIDE, View("free", 40.0, 25.0, 0.165)])
@pytest.mark.parametrize("shown", [scene(), strip()], ids=["two", "five"])
def test_every_head_is_whole_and_stands_apart(enter, size, view, shown):
    client, on = enter(*size)
    on.show(replace(shown, views=(view,)), False)
    names = [head.name for head in shown.heads]
    at = np.array([in_picture(client, client.node(f"/{name}").position) for name in names])
    assert np.abs(np.diff(at[:, 1])).max() < 1e-9  # a row
    assert at[:, 0].mean() == pytest.approx(0, abs=1e-9)
    pixels = (at[:, 0] + 1) * size[0] / 2
    pixel = 2 * LENS * np.tan(client.camera.fov / 2) / size[1]
    assert np.diff(pixels) * pixel == pytest.approx(
        np.diff([h.slot for h in shown.heads]), rel=0.01
    )
    for x, y in at:
        half_head = 0.11 / pixel
        assert (x + 1) * size[0] / 2 > half_head
        assert (1 - x) * size[0] / 2 > half_head
        if size[0] <= 576:  # above the sheet
            assert y > 0.3


def test_heads_of_one_slot_are_drawn_over_each_other_under_one_title(enter):
    client, shown = enter()
    shown.show(overlaid(), False)
    assert client.node("/true/head").opacity == 0.4
    assert client.node("/fit/head").opacity is None
    assert client.node("/fit/board").visible
    assert not client.node("/true/board").visible
    assert client.node("/fit/board/title0").text == "Face that fits / True face"
    assert np.abs(client.node("/fit").position).max() == 0
    gone = replace(overlaid().heads[1], opacity=0.0)
    shown.show(replace(overlaid(), heads=(overlaid().heads[0], gone)), False)
    assert not client.node("/true/head").visible
    shown.show(scene(), False)
    assert client.node("/true/head").opacity is None
    assert client.node("/true/board/title0").text == "True face"


def blinking(shown: Stage) -> dict[str, Any]:
    assert shown._blink is not None
    found = re.search('data-json="([^"]*)"', shown._blink.content)
    assert found is not None
    return json.loads(unescape(found[1]))


def test_the_page_is_told_which_heads_take_turns(enter):
    client, shown = enter()
    shown.show(scene(), False)
    assert shown._blink is None
    pair = (head("true", "True face"), head("fit", "Face that fits", 0.93))
    shown.show(replace(scene(), heads=pair, blink=True), False)
    assert blinking(shown) == {"nodes": ["/true", "/fit"], "seconds": 0.5}
    assert client.node("/true").visible  # both: without the script they are seen at once
    assert client.node("/fit").visible
    shown.show(scene(), False)
    assert blinking(shown)["nodes"] == []


def test_marks_lie_on_their_points_and_face_the_viewer_at_the_size_of_the_screen(enter):
    client, shown = enter()
    shown.show(replace(scene(view=SIDE), marks=MARKS), False)
    pixel = 2 * LENS * np.tan(client.camera.fov / 2) / client.camera.image_height
    back = np.array([-1.0, 0.0, 0.0])  # of the side view, -90 degrees
    discs, crosses = client.node("/fit/d_l/discs"), client.node("/true/seen/crosses")
    assert discs.points.dtype == np.float32
    assert np.abs(discs.points - (POINTS - PIVOT)).max() < 1e-8
    assert discs.point_size == pytest.approx(0.5 * DISC * pixel, rel=1e-3)
    arms = crosses.points.reshape(2, 2, 2, 3)  # points, strokes, ends
    assert np.abs(arms.mean(axis=(1, 2)) - (POINTS - PIVOT)).max() < 1e-8
    strokes = arms[:, :, 1] - arms[:, :, 0]
    assert np.abs(strokes @ back).max() < 1e-8
    assert np.abs(strokes[:, 0] @ strokes[0, 1]).max() < 1e-9  # a right angle
    assert np.linalg.norm(strokes, axis=2) == pytest.approx(2 * CROSS * pixel * 2**0.5, rel=1e-3)
    for name, away in (("/fit/d_l", 0.002), ("/true/seen", 0.003)):
        assert client.node(name).position == pytest.approx(away * back, abs=1e-9)
    assert [client.node(f"/true/seen/name{i}").text for i in (0, 1)] == ["nose", "eye"]


def test_lines_stand_in_the_room_of_their_head(enter):
    client, shown = enter()
    shown.show(replace(scene(), lines=(ERRORS,)), False)
    lines = client.node("/fit/errors")
    assert np.abs(lines.points - (ERRORS.segments - PIVOT)).max() < 1e-8
    assert lines.thickness_units == "screen"
    more = replace(ERRORS, segments=np.concatenate([ERRORS.segments] * 3))
    shown.show(replace(scene(), lines=(more,)), True)
    assert lines.points.shape == (6, 2, 3)
    none = replace(ERRORS, segments=np.zeros((0, 2, 3)))
    shown.show(replace(scene(), lines=(none,)), True)
    assert not lines.visible


@pytest.mark.parametrize("size", [(1440, 900), (390, 844)])
@pytest.mark.parametrize("zoom", [0.5, 1.0, 4.0])
def test_the_bar_is_true_and_in_the_picture_at_any_zoom(enter, zoom, size):
    client, shown = enter(*size)
    shown.show(
        replace(scene(view=replace(FRONT, half_height=ZOOM_1 / zoom)), scale_bar=0.02), False
    )
    bar = client.node("/true/board/bar")
    assert np.ptp(bar.points[:, :, 0]) == pytest.approx(0.02, rel=1e-6)
    assert client.node("/true/board/foot0").text == "20\u202fmm"
    middle = client.node("/true").position * (
        0,
        1,
        1,
    )  # zoomed in, the heads are partly beside the picture
    for name in ("bar", "title0", "foot0"):
        at = middle + client.node(f"/true/board/{name}").position
        assert np.abs(in_picture(client, at)).max() < 1, name
    shown.show(replace(scene(), scale_bar=0.0), False)
    assert not bar.visible
    assert not client.node("/true/board/foot0").visible


def test_zoom_and_rise_are_the_views(enter):
    client, shown = enter(900, 900)
    shown.show(scene(view=FRONT), False)
    half = np.tan(client.camera.fov / 2)
    shown.show(scene(view=replace(FRONT, half_height=0.25 * FRONT.half_height)), False)
    assert np.tan(client.camera.fov / 2) == pytest.approx(half / 4)
    shown.show(scene(view=replace(FRONT, rise=0.05)), False)
    pixel = 2 * LENS * np.tan(client.camera.fov / 2) / 900
    assert in_picture(client, np.zeros(3))[1] == pytest.approx(0.05 / (450 * pixel), rel=1e-3)


def orbit(
    client: Client, shown: Stage, places: list[tuple[float, float]], *, by_hand: bool = True
) -> None:
    """A hand turns the viewer, or viser does, then it rests."""

    async def run() -> None:
        for place in places:
            if by_hand:
                shown.by_hand()
            client.camera.turn(*place)
            await client.camera.heard(client.camera)
        await asyncio.sleep(0.05)

    asyncio.run(run())


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(viewer, "ORBIT_REST", 0.02)
    monkeypatch.setattr(viewer, "ARRIVAL", -1.0)  # a browser that is there at once


def test_a_turned_viewer_is_told_once_at_rest(enter, quick):
    client, shown = enter()
    shown.show(scene(view=FRONT), False)
    orbit(client, shown, [(5.0, 2.0), (11.0, 3.0), (20.04, 7.0)])
    assert client.told == [(20.0, 7.0, 1.0)]
    right = np.array([np.cos(np.radians(20.04)), 0.0, -np.sin(np.radians(20.04))])
    assert client.node("/fit").position == pytest.approx(0.135 * right, abs=1e-6)
    # Back as a state, rounded: the hand's place stays; another view is gone to
    looks = client.camera.looks
    shown.show(scene(view=View("free", 20.0, 7.0, 0.165)), False)
    assert client.camera.looks == looks
    shown.show(scene(view=SIDE), False)
    assert client.camera.looks == looks + 1
    shown.show(scene(view=View("free", 20.0, 7.0, 0.165)), False)  # undo
    assert client.camera.looks == looks + 2


def test_an_older_place_that_comes_back_late_does_not_pull_the_viewer(enter, quick):
    client, shown = enter()
    shown.show(scene(view=FRONT), False)
    orbit(client, shown, [(20.0, 7.0)])
    orbit(client, shown, [(40.0, 7.0)])
    assert client.told == [(20.0, 7.0, 1.0), (40.0, 7.0, 1.0)]
    looks = client.camera.looks
    for azimuth in (20.0, 40.0):
        shown.show(scene(view=View("free", azimuth, 7.0, 0.165)), False)
    assert client.camera.looks == looks


def test_where_the_viewer_was_put_is_no_news(enter, quick):
    client, shown = enter()
    shown.show(scene(view=View("free", 30.0, 10.0, 0.08)), False)
    orbit(client, shown, [(30.0, 10.0)])
    assert client.told == []


def test_what_no_hand_has_done_is_no_news(enter, quick):
    client, shown = enter()
    shown.show(scene(view=FRONT), False)
    orbit(client, shown, [(20.0, 7.0)], by_hand=False)
    assert client.told == []
    orbit(client, shown, [(21.0, 7.0)])
    assert client.told == [(21.0, 7.0, 1.0)]


def test_until_the_browser_has_arrived_older_places_are_not_told(enter, monkeypatch):
    monkeypatch.setattr(viewer, "ORBIT_REST", 0.0)
    client, shown = enter()
    shown.show(scene(view=SIDE), False)
    orbit(client, shown, [(3.0, 0.0)])  # on its way
    assert client.told == []
    orbit(client, shown, [(-90.0, 0.0)])  # there
    orbit(client, shown, [(-80.0, 0.0)])  # a hand
    assert client.told == [(-80.0, 0.0, 1.0)]


def test_through_the_camera_both_faces_keep_their_pixels(enter):
    client, shown = enter(800, 800)
    through = overlaid(through_camera=True)
    photo = through.photo
    assert photo.fit_vertices is not None
    assert photo.fit_focal is not None
    shown.show(through, False)
    half = np.tan(client.camera.fov / 2)
    for name, points, focal in (
        ("fit", photo.fit_vertices, photo.fit_focal),
        ("true", photo.vertices, photo.focal),
    ):
        drawn = client.node(f"/{name}/head").vertices.astype(float)
        seen = drawn[:, :2] / -drawn[:, 2:] / half
        wanted = focal * points[:, :2] / points[:, 2:] * (1, -1) / (photo.height / 2)
        assert np.abs(seen - wanted).max() < 1e-5, name
        assert client.node(f"/{name}").visible
    assert client.node("/true/head").opacity == 0.4
    shown.show(scene(through_camera=True), False)  # side by side: the fitted face alone
    assert not client.node("/true").visible
    assert client.node("/fit").visible
    assert np.tan(client.camera.fov / 2) == pytest.approx(half, rel=1e-9)
    # Its title is where the face is; no bar is true of all depths
    away = client.node("/fit/board").position[2]
    assert away == pytest.approx(-photo.fit_vertices[:, 2].mean(), rel=1e-6)
    assert client.node("/fit/board/title0").text == "Face that fits"
    assert not client.node("/fit/board/bar").visible
    # Alone, it is zoomed to the photograph's eyes; over the true face it is not
    wide = replace(photo, fit_eyes=1.02)
    shown.show(replace(scene(through_camera=True), photo=wide), False)
    assert np.tan(client.camera.fov / 2) == pytest.approx(1.02 * half, rel=1e-9)
    shown.show(replace(overlaid(through_camera=True), photo=wide), False)
    assert np.tan(client.camera.fov / 2) == pytest.approx(half, rel=1e-9)
    shown.show(scene(), False)
    assert client.node("/fit/board").position == pytest.approx((0, 0, 0))
    assert client.node("/fit/board/bar").visible


def test_colours_of_a_legend_are_sent_as_they_are_and_read_in_even_light(enter):
    client, shown = enter()
    shown.show(scene(), False)
    key = client.node("/light/key").intensity
    shown.show(strip(), False)
    coloured = strip().heads[1]
    assert np.array_equal(client.node("/fit1/colours").colors, coloured.colours)
    assert client.node("/light/key").intensity < 0.5 * key
    assert client.node("/ambient").intensity > 2  # pi would be all of a surface's own colour
    shown.show(scene(), False)
    assert client.node("/light/key").intensity == key


def test_lit_colours_are_darkened_by_occlusion_only(enter):
    open_ = Head(
        "a", "", np.zeros((2, 3)), np.zeros((0, 3), dtype=np.uint32),
        np.array([[200, 120, 60]] * 2, dtype=np.uint8), np.array([255, 100], dtype=np.uint8),
    )  # fmt: skip
    bright, dark = shaded(open_)
    assert bright.tolist() == [200, 120, 60]
    assert (dark < bright).all()
    assert shaded(replace(open_, lit=False)).tolist() == open_.colours.tolist()


def test_a_draft_moves_the_coarse_mesh_and_rest_brings_both(enter):
    client, shown = enter()
    coarse = np.array([[0, 1, 2]], dtype=np.uint32)
    heads = tuple(replace(each, coarse_faces=coarse) for each in scene().heads)
    still = replace(scene(), heads=heads)
    shown.show(still, False)
    moved = replace(heads[1], vertices=heads[1].vertices + 0.01)
    shown.show(replace(still, heads=(heads[0], moved)), True)
    draft, full = client.node("/fit/draft"), client.node("/fit/head")
    assert draft.visible
    assert not full.visible
    wanted = moved.vertices - PIVOT
    assert np.abs(draft.vertices - wanted[:3]).max() < 1e-7
    assert np.abs(full.vertices - wanted).max() > 1e-3
    shown.show(replace(still, heads=(heads[0], moved)), False)
    assert full.visible
    assert not draft.visible
    assert np.abs(full.vertices - wanted).max() < 1e-7


def test_words_below_a_narrow_row_give_way(enter):
    for width, lines in ((1400, 3), (760, 4), (390, 1)):  # of 760 one is parted
        client, shown = enter(width, 800)
        shown.show(strip(), False)
        words = shown._heads["fit2"]._foot.lines
        assert len(words) == lines
        nodes = [client.node(f"/fit2/board/foot{k}") for k in range(lines)]
        assert [node.text for node in nodes] == words
        heights = [node.position[1] for node in nodes]
        assert heights == sorted(heights, reverse=True)
        assert all(abs(node.position[0]) < 1e-9 for node in nodes)  # each in the middle
        client.scene.reset()


def test_words_give_way_when_panels_come_after_the_heads(enter):
    client, shown = enter(1400, 800)
    shown.show(strip(), False)
    assert len(shown._heads["fit2"]._foot.lines) == 3
    client.camera.image_width = 760
    asyncio.run(client.camera.heard(client.camera))
    assert len(shown._heads["fit2"]._foot.lines) == 4


def test_who_turns_while_words_are_written_writes_none_twice(enter, monkeypatch):
    # a worker draws, and the page's place comes on the loop: two labels of one name remove each other
    client, shown = enter()
    made: list[str] = []
    real = client.scene.add_label

    def slow(name: str, *given: Any, **options: Any) -> Any:
        made.append(name)
        time.sleep(0.05)
        return real(name, *given, **options)

    monkeypatch.setattr(client.scene, "add_label", slow)
    errors: list[BaseException] = []

    def turn() -> None:
        try:
            while not made:
                time.sleep(0.001)
            sight = shown._viewer.sight
            shown._place(replace(sight, pixel=1.1 * sight.pixel))
        except BaseException as error:  # noqa: BLE001 - whatever it is
            errors.append(error)

    thread = threading.Thread(target=turn)
    thread.start()
    shown.show(strip(), False)
    thread.join(10)
    assert not errors
    assert len(made) == len(set(made)) > 1


def test_who_turns_while_a_worker_draws_writes_no_node_and_is_followed(enter, monkeypatch):
    # else it would move a head that is just being taken out
    _, shown = enter()
    shown.show(strip(), False)
    few, turned, wrote = replace(strip(), heads=strip().heads[:2]), [], set()
    remove, place = heads.HeadNodes.remove, heads.HeadNodes.place

    def turn() -> None:
        turned.append(replace(shown._viewer.sight, pixel=1.1 * shown._viewer.sight.pixel))
        shown._place(turned[0])

    def turning(nodes: heads.HeadNodes) -> None:
        remove(nodes)
        if not turned:
            thread = threading.Thread(target=turn, name="loop")
            thread.start()
            thread.join(10)

    def placed(nodes: heads.HeadNodes, *sight: Any) -> None:
        wrote.add(threading.current_thread().name)
        place(nodes, *sight)

    monkeypatch.setattr(heads.HeadNodes, "remove", turning)
    monkeypatch.setattr(heads.HeadNodes, "place", placed)
    shown._viewer._half_width = max(head.slot for head in few.heads) / 2 + viewer.BESIDE
    shown.show(few, False)
    assert turned
    assert wrote == {threading.current_thread().name}
    assert shown._sight is shown._asked


def test_words_of_neighbours_do_not_touch():
    texts = ["Pin 1, assumed 30\u202fcm", "surface difference 2.8\u202fmm"]
    for room in (60.0, 80.0, 140.0, 400.0, np.inf):
        lines, scale = fitted(texts, room, 0.7)
        assert " ".join(lines) == " ".join(texts)
        assert 0.7 <= scale <= 1
        assert not any(line.endswith("30") for line in lines)  # a number keeps its unit
        if room > 80:  # the longest word and its unit have room
            assert max(map(len, lines)) * scale * LETTER <= room - APART
    assert fitted(texts, 400.0, 0.7) == (texts, 1.0)
    assert len(fitted(texts[:1], 80.0, 0.7)[0]) == 2
    assert fitted([""], 80.0, 0.7)[0] == []
