"""The standalone page in Chromium, opened from disk without a network: it shows what the pipeline computes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from playwright.sync_api import Browser, Page

from faceambig.arrays import vertex_normals
from faceambig.compose import difference_colours, pivot
from faceambig_app.export import player
from faceambig_app.pipeline import faces, fits
from faceambig_app.state import ViewState, changed
from faceambig_app.text import percent_number

pytestmark = pytest.mark.browser
STATE = ViewState(subject=3)
DRAWN = "() => document.getElementById('heads').dataset.drawn"
# Of either plot, pixels: where the curve is at the stop, and the middle of the cursor's mark
MARKS = """() => ["dl", "ds"].map(kind => {
  const plot = document.querySelector("[data-track=distance] .plot"), line = plot.querySelector(`.line.${kind}`);
  const at = line.points[document.getElementById("slider").value].matrixTransform(line.getScreenCTM());
  const box = plot.querySelector(`.cursor .${kind}`).getBoundingClientRect();
  return [[at.x, at.y], [box.x + box.width / 2, box.y + box.height / 2]] })"""
Open = Callable[..., Page]


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("player") / "page.html"
    path.write_bytes(player.page(STATE, whats=("distance", "mode"))[1])
    return path


@pytest.fixture
def opened(browser: Browser, file: Path) -> Iterator[Open]:
    """Opens the page offline; its console must stay clean and its only request be the file itself."""
    pages, problems, asked = [], [], []

    def go(width: int = 800, height: int = 600, **context: Any) -> Page:
        page = browser.new_context(
            viewport={"width": width, "height": height}, offline=True, **context
        ).new_page()
        page.on("console", lambda message: problems.append(message.text))
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.on("request", lambda request: asked.append(request.url))
        page.goto(file.as_uri())
        page.wait_for_function(DRAWN)
        pages.append(page)
        return page

    yield go
    for page in pages:
        page.context.close()
    assert problems == []
    assert {url for url in asked if not url.startswith("data:")} == {file.as_uri()}


def numbers(page: Page) -> tuple[str, str, str]:
    return page.inner_text("#place"), page.inner_text("#d_l"), page.inner_text("#d_s")


def expected(state: ViewState, place: str) -> tuple[str, str, str]:
    face = faces.face(state.target, state.fitting, state.bend)
    return f"{place}", percent_number(face.d_l_percent), f"{face.d_s_mm:.1f}"


def half(page: Page, right: bool) -> np.ndarray:
    """(H, W, 3) of what is seen of one head."""
    box = page.locator("#heads").bounding_box()
    assert box is not None
    width = box["width"] / 2
    left = box["x"] + right * width
    seen = page.screenshot(clip={"x": left, "y": box["y"], "width": width, "height": box["height"]})
    picture = cv2.imdecode(np.frombuffer(seen, np.uint8), cv2.IMREAD_COLOR)
    assert picture is not None
    return picture[..., ::-1].astype(int)


def at_rest(page: Page, stop: int, track: str = "distance") -> None:
    page.wait_for_function(f"{DRAWN} === '{track} {stop}'")


def test_every_stop_shows_the_numbers_of_the_pipeline(opened: Open):
    page = opened()
    assert numbers(page) == expected(STATE, "120\u202fcm")
    (track,) = player.tracks_of(STATE, ("distance",))
    page.keyboard.press("Home")
    for metres in track.places.tolist():
        state = changed(STATE, distance=metres)
        assert numbers(page) == expected(state, f"{100 * metres:g}\u202fcm")
        for curve, mark in page.evaluate(MARKS):
            # pixels: a curve is written to tenths of a unit, a cursor to four digits; both plots are 340 units wide
            assert mark == pytest.approx(curve, abs=0.2)
        page.keyboard.press("ArrowRight")
    assert page.get_attribute("#slider", "aria-valuetext") == "300\u202fcm"
    page.wait_for_function(
        "() => document.getElementById('spoken').textContent.includes('3\\u202fm.')"
    )


def test_modes_bend_the_right_face_and_grey_it_when_it_is_none(opened: Open):
    page = opened()
    before = half(page, right=True)
    page.click("[data-track-button=mode2]")
    assert page.inner_text("#label").startswith("Mode B: ")
    for key, mm in (("End", 5.0), ("Home", -5.0)):
        page.keyboard.press(key)
        shown = f"{mm:+g}\u202fmm".replace("-", "−")
        assert numbers(page) == expected(changed(STATE, flex=((2, mm),)), shown)
    at_rest(page, 0, "mode2")
    after = half(page, right=True)
    assert page.inner_text("#warning") == "no longer a plausible face"
    height, width = before.shape[:2]
    middle = np.s_[2 * height // 5 : 3 * height // 5, 2 * width // 5 : 3 * width // 5]
    assert np.ptp(before[middle], axis=2).mean() > 40  # skin
    assert np.ptp(after[middle], axis=2).mean() < 12  # grey but for the lamps' colours


def test_the_right_head_changes_and_the_left_one_stays(opened: Open):
    page = opened()
    left, right = (half(page, right=side) for side in (False, True))
    page.focus("#slider")
    page.keyboard.press("Home")
    at_rest(page, 0)
    np.testing.assert_array_equal(half(page, right=False), left)
    assert (np.abs(half(page, right=True) - right).max(axis=2) > 30).mean() > 0.02


def test_difference_is_drawn_in_the_colours_of_its_scale(opened: Open):
    """Where the surface faces the viewer its colour is the scale's: no light, no second gamma."""
    page = opened()
    page.click("[data-view-button=front]")
    page.click("#difference")
    page.wait_for_timeout(300)
    picture = half(page, right=True)
    face = faces.face(STATE.target, STATE.fitting, STATE.bend)
    model = fits.model("embedded")
    bar = page.locator(".bars i").first.bounding_box()
    assert bar is not None
    scale = bar["width"] / 0.05  # pixels a metre
    facing = vertex_normals(face.vertices, model.faces)[:, 2] > 0.985
    # A centimetre before the eyes: nothing hides forehead, nose and chin, and no pupil shares a pixel with its white
    in_front = face.vertices[:, 2] > 0.01
    chosen = np.flatnonzero(facing & in_front)
    offset = (face.vertices[chosen] - pivot(model))[:, :2] * scale
    x = np.round(picture.shape[1] / 2 + offset[:, 0]).astype(int)
    y = np.round(picture.shape[0] / 2 - offset[:, 1]).astype(int)
    colours = difference_colours(model, face.gaps_mm)[chosen].astype(int)
    assert np.ptp(colours, axis=0).max() > 60  # more than one colour is looked at
    apart = np.abs(picture[y, x] - colours).max(axis=1)
    assert np.median(apart) < 8
    assert np.quantile(apart, 0.9) < 12
    assert page.is_visible("#legend")


def test_play_glides_and_space_stops_at_a_stop(opened: Open):
    page = opened()
    page.keyboard.press("Space")
    assert page.inner_text("#play") == "Pause"
    page.wait_for_function(f"() => /\\.\\d/.test(({DRAWN})())")  # between two stops
    page.keyboard.press("Space")
    assert page.inner_text("#play") == "Play"
    page.wait_for_function(f"() => /^distance \\d+$/.test(({DRAWN})())")
    place = page.inner_text("#place").split("\u202f")[0]
    shown = changed(STATE, distance=float(place) / 100)
    assert numbers(page) == expected(shown, f"{place}\u202fcm")


def test_reduced_motion_shows_one_picture_after_another(opened: Open):
    page = opened(reduced_motion="reduce")
    page.click("#play")
    for place in ("240\u202fcm", "300\u202fcm"):
        page.wait_for_function(f"() => document.getElementById('place').textContent === '{place}'")
        page.wait_for_function(f"() => /^distance \\d+$/.test(({DRAWN})())")
    page.click("#play")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_it_follows_the_system_and_fits_a_phone(opened: Open, scheme):
    page = opened(390, 844, color_scheme=scheme)
    ground = page.evaluate("() => getComputedStyle(document.body).backgroundColor")
    assert ground == {"light": "rgb(255, 255, 255)", "dark": "rgb(27, 32, 38)"}[scheme]
    assert page.evaluate("() => document.documentElement.scrollWidth") == 390
    for name in ("#d_l", "#d_s", "#heads", "#slider", "#play"):
        box = page.locator(name).bounding_box()
        assert box is not None
        assert box["y"] + box["height"] <= 844, name  # on the first screen
    for button in page.locator("button").all():
        box = button.bounding_box()
        assert box is not None
        assert min(box["width"], box["height"]) >= 24


def test_without_a_script_the_numbers_stand_in_a_table(browser: Browser, file: Path):
    context = browser.new_context(java_script_enabled=False, offline=True)
    page = context.new_page()
    page.goto(file.as_uri())
    assert page.is_visible("noscript p")
    page.locator("#table summary").click()
    d_l, d_s = expected(STATE, "")[1:]
    row = page.locator("#table tr", has_text="120\u202fcm").first
    assert row.locator("td").all_inner_texts() == ["120\u202fcm", d_l, d_s]
    context.close()
