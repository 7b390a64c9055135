"""The stage in Chromium: heads that come and go, marks of two shapes and colours, points with room for a finger."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Page

from faceambig.scene import Lines, Marks, Scene
from faceambig_app import guard
from faceambig_app.markup import photograph, style
from faceambig_app.script import Script
from faceambig_app.stage import FAR, FIRST_FOV, FIRST_POSITION, NEAR, Stage
from scenes import FRONT, head, photo, scene, strip
from visitor import PATIENCE

pytestmark = pytest.mark.browser

ROOTS = """() => Object.entries(__viserSceneTree.getState()).filter(([name, node]) =>
  node && name.endsWith("/head")).map(([name]) => name).sort()"""
MATERIAL = """name => { let found; __viserMutable.nodeRefFromName[name]?.traverse(o => {
  if (!found && o.isMesh && o.material.isMeshStandardMaterial) found = o });
  return found && [found.material.transparent, found.material.opacity, found.material.vertexColors] }"""
RED, BLUE = (200, 16, 46), (27, 95, 193)


class Show:
    """A page with nothing but a stage."""

    def __init__(self, tab: Page, client: Any) -> None:
        self.tab, self.client, self.told = tab, client, []
        self.stage = Stage(client, lambda *place: self.told.append(place))
        self.script = Script(client.gui, lambda _: self.stage.by_hand())

    def draw(self, shown: Scene) -> None:
        with self.client.atomic():
            self.stage.show(shown, False)
        self.client.flush()
        names = sorted(f"/{each.name}/head" for each in shown.heads)
        self.tab.wait_for_function(
            f"wanted => JSON.stringify(({ROOTS})()) === JSON.stringify(wanted)", arg=names, timeout=PATIENCE
        )  # fmt: skip

    def pixels(self, colour: tuple[int, int, int], near: int = 60) -> int:
        """How many pixels of the canvas have about a colour."""
        picture = Image.open(io.BytesIO(self.tab.screenshot())).convert("RGB")
        apart = np.abs(np.asarray(picture).astype(int) - colour).max(axis=2)
        return int((apart < near).sum())

    def until(self, what: Callable[[], bool], words: str) -> None:
        for _ in range(PATIENCE // 200):
            if what():
                return
            self.tab.wait_for_timeout(200)
        pytest.fail(words)


@pytest.fixture(scope="module")
def show(page_url: Callable[..., Page]) -> Iterator[Show]:
    server = guard.start("127.0.0.1", 0)
    server.scene.set_up_direction("+y")
    server.initial_camera.up, server.initial_camera.position = (0.0, 1.0, 0.0), FIRST_POSITION
    server.initial_camera.fov = FIRST_FOV
    server.initial_camera.near, server.initial_camera.far = NEAR, FAR
    came: list[Any] = []
    server.on_client_connect(came.append)
    tab = page_url(f"http://127.0.0.1:{server.get_port()}/?fixedDpr=1", 640, 400)
    for _ in range(PATIENCE // 50):
        if came:
            break
        tab.wait_for_timeout(50)
    came[0].gui.add_html(style.STYLE)
    came[0].gui.main_panel.minimize()
    yield Show(tab, came[0])
    server.stop()


def test_heads_come_and_go_in_the_browser(show):
    show.draw(scene(view=FRONT))
    show.draw(strip())
    show.draw(scene(view=FRONT))


def test_crosses_are_red_and_discs_blue_and_go_again(show):
    shown = scene(view=FRONT)
    points = shown.heads[0].vertices[shown.heads[0].vertices[:, 2] > 0.0][::12]
    show.draw(shown)
    show.until(lambda: show.pixels(RED, 30) == 0 and show.pixels(BLUE, 30) == 0, "marks at first")
    marks = (Marks("true", points, "seen"), Marks("fit", points, "d_l"))
    errors = Lines("errors", "fit", np.stack([points, 1.1 * points], axis=1), "dim")
    show.draw(replace(shown, marks=marks, lines=(errors,)))
    show.until(lambda: show.pixels(RED) > 40, "no red crosses")
    show.until(lambda: show.pixels(BLUE) > 80, "no blue discs")
    # A point of either kind is of the same pixels at any zoom: four times nearer, no more of them
    blue = show.pixels(BLUE)
    show.draw(replace(shown, views=(replace(FRONT, half_height=0.12),), marks=marks))
    show.until(lambda: 0 < show.pixels(BLUE) < 1.6 * blue, "discs grow with the zoom")
    show.draw(shown)
    show.until(lambda: show.pixels(RED, 30) == 0 and show.pixels(BLUE, 30) == 0, "marks stay")


def test_a_ghost_is_seen_through_and_keeps_its_colours(show):
    heads = (head("fit", "Face that fits", 0.93), head(opacity=0.4))
    show.draw(replace(scene(view=FRONT), heads=heads))
    show.until(lambda: show.tab.evaluate(MATERIAL, "/true/head") == [True, 0.4, True], "no ghost")
    assert show.tab.evaluate(MATERIAL, "/fit/head") == [False, 1, True]


def test_a_hand_that_turns_the_viewer_is_told(show):
    show.draw(scene(view=FRONT))
    show.tab.wait_for_timeout(300)
    show.told.clear()
    show.tab.mouse.move(200, 300)
    show.tab.mouse.down()
    for step in range(6):
        show.tab.mouse.move(200 + 12 * step, 300)
        show.tab.wait_for_timeout(60)
    show.tab.mouse.up()
    show.until(lambda: bool(show.told), "nobody was told")
    azimuth, elevation, zoom = show.told[-1]
    assert azimuth < -3  # dragged to the right: the viewer goes to the left
    assert abs(elevation) < 1
    assert zoom == pytest.approx(1, abs=0.02)


def test_a_point_that_can_be_moved_has_24_pixels_to_hit(show):
    html = style.STYLE + photograph.photo_marks(photo(), draggable=True)
    show.tab.evaluate(
        """html => { document.getElementById("own")?.remove(); const e = document.createElement("div");
        e.id = "own"; e.style = "position:fixed;z-index:99999;left:0;top:0;width:180px"; e.innerHTML = html;
        document.body.append(e) }""",
        html,
    )
    hit = show.tab.evaluate(
        """() => { const shown = [...document.querySelectorAll("[data-fa-point]")];
        const box = e => e.querySelector(".fa-hit").getBoundingClientRect();
        const at = (e, dx, dy) => document.elementFromPoint(box(e).x + dx, box(e).y + dy)?.closest("[data-fa-point]");
        const last = shown.at(-1);  // nothing is drawn over it
        return [[0, 0], [11, 0], [0, -11], [13, 0], [0, 13]].map(([x, y]) => at(last, x, y) === last) }"""
    )
    assert hit == [True, True, True, False, False]
    show.tab.evaluate("() => document.getElementById('own').remove()")
