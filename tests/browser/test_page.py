"""The page in Chromium, as a person uses it: what is read comes from the page, pictures are kept to be looked at."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser
from playwright.sync_api import Page as Tab

from faceambig_app import ViewState, faces, fits, server

pytestmark = pytest.mark.browser

ARTEFACTS = Path(__file__).resolve().parents[2] / "artefacts"
PATIENCE = 20_000  # milliseconds until something is seen: other tests share the processors
# Every 37th vertex: enough to see a change, and little to send
MESH = """([name, rows]) => { let found; window.__viserMutable?.nodeRefFromName[name]?.traverse(o => {
  if (!found && o.isMesh) found = o }); if (!found) return null;
  const p = found.geometry.attributes.position, n = p.count;
  rows ??= Array.from({ length: Math.ceil(n / 37) }, (_, i) => i * 37);
  return [n, rows.map(i => [p.getX(i), p.getY(i), p.getZ(i)])] }"""
CAMERA = """() => { const c = __viserMutable.camera; c.updateMatrixWorld();
  return { position: c.position.toArray(), matrix: c.matrixWorld.elements.slice(), fov: c.fov, aspect: c.aspect } }"""
PLACE = """name => { const n = __viserMutable.nodeRefFromName[name]; n.updateWorldMatrix(true, false);
  return [n.matrixWorld.elements[12], n.matrixWorld.elements[13], n.matrixWorld.elements[14]] }"""


@pytest.fixture(scope="module")
def served() -> Iterator[server.Page]:
    page = server.Page("127.0.0.1", 0)
    yield page
    page.close()


class Visitor:
    """A person with a browser."""

    def __init__(self, tab: Tab) -> None:
        self.tab = tab
        tab.wait_for_selector(".fa-cards", timeout=PATIENCE)
        tab.wait_for_selector(".fa-plot", state="attached", timeout=PATIENCE)
        tab.wait_for_function(f"() => ({MESH})(['/fit/head']) !== null", timeout=PATIENCE)
        self.rest()

    def mesh(self, name: str, rows: list[int] | None = None) -> np.ndarray:
        """(n, 3) positions on the page's graphics card: every 37th vertex, or `rows`."""
        return np.array(self.tab.evaluate(MESH, [name, rows])[1])

    def n_vertices(self, name: str) -> int:
        return self.tab.evaluate(MESH, [name, []])[0]

    def numbers(self) -> tuple[float, float]:
        """d_L in percent and d_S in millimetres, as read on the cards."""
        texts = self.tab.locator(".fa-card span").all_inner_texts()
        d_l, d_s = (float(re.sub(r"[^0-9.]", "", text)) for text in texts[:2])
        return d_l, d_s

    def slider(self, name: str) -> Any:
        return self.tab.get_by_role("slider", name=name, exact=True)

    def centimetres(self) -> float:
        return float(self.tab.get_by_label("Distance (cm)").input_value())

    def type_distance(self, text: str) -> None:
        box = self.tab.get_by_label("Distance (cm)")
        box.fill(text)
        box.press("Tab")

    def until(self, what: Callable[[], bool], words: str) -> None:
        end = time.monotonic() + PATIENCE / 1000
        while not what():
            assert time.monotonic() < end, words
            self.tab.wait_for_timeout(50)

    def rest(self) -> None:
        """Until the full face has not changed for half a second."""
        last, since = None, time.monotonic()
        end = since + PATIENCE / 1000
        while time.monotonic() - since < 0.5:
            assert time.monotonic() < end, "the face does not come to rest"
            now = (self.tab.inner_text(".fa-cards"), float(self.mesh("/fit/head").sum()))
            if now != last:
                last, since = now, time.monotonic()
            self.tab.wait_for_timeout(80)


@pytest.fixture
def visit(browser: Browser, served: server.Page) -> Iterator[Callable[..., Visitor]]:
    """Opens the page; closes it after the test, when its console must have been clean."""
    opened: list[tuple[Tab, list[str]]] = []

    def go(
        width: int = 1150, height: int = 560, scheme: Any = "light", dpr: float = 0.25
    ) -> Visitor:
        tab = browser.new_page(viewport={"width": width, "height": height}, color_scheme=scheme)
        problems: list[str] = []
        tab.on("console", lambda m: problems.append(m.text) if m.type == "error" else None)
        tab.on("pageerror", lambda error: problems.append(str(error)))
        opened.append((tab, problems))
        tab.goto(f"{served.address}?fixedDpr={dpr}")
        return Visitor(tab)

    yield go
    for tab, problems in opened:
        tab.close()
        # viser's sorter of splats, which we do not draw, asks for eval once: the policy refuses it
        assert not [text for text in problems if "'unsafe-eval' is not an allowed" not in text]


def test_the_first_frame_teaches(visit):
    me = visit()
    assert me.n_vertices("/true/head") == fits.model("embedded").n_vertices
    assert me.n_vertices("/fit/head") == fits.model("embedded").n_vertices
    assert np.abs(me.mesh("/true/head") - me.mesh("/fit/head")).max() > 1e-3  # another face
    d_l, d_s = me.numbers()
    assert d_l < 1.5
    assert d_s > 2
    assert me.tab.title() == "faceambig"
    text = me.tab.inner_text("body")
    for words in ("Same picture, different face", "30", "1.2", "taken from"):
        assert words in text
    # as many crosses as circles as landmarks: two strokes, or one round, a point
    assert me.tab.locator("#fx").get_attribute("d").count("M") == 68
    assert me.tab.locator("#fo").get_attribute("d").count("M") == 68


def test_arrow_keys_move_the_slider_and_the_face_but_not_the_camera(visit):
    me = visit()
    true, fit, camera = me.mesh("/true/head"), me.mesh("/fit/head"), me.tab.evaluate(CAMERA)
    slider, before = me.slider("Assumed distance"), me.centimetres()
    slider.focus()
    for _ in range(4):
        me.tab.keyboard.press("ArrowLeft")
        me.tab.wait_for_timeout(70)
    me.until(lambda: me.centimetres() < before, "the number did not follow the slider")
    me.rest()
    assert me.centimetres() == pytest.approx(before * 2 ** (-4 / 24), rel=0.01)
    assert np.abs(me.mesh("/fit/head") - fit).max() > 1e-4
    assert np.abs(me.mesh("/true/head") - true).max() == 0
    assert me.tab.evaluate(CAMERA) == camera
    assert slider.get_attribute("aria-valuetext").startswith("1.0")


def test_the_mouse_drags_the_slider_and_the_circles_stay_on_the_crosses(visit):
    me = visit()
    fit = me.mesh("/fit/head")
    box = me.slider("Assumed distance").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    me.tab.mouse.move(x, y)
    me.tab.mouse.down()
    for step in range(12):
        me.tab.mouse.move(x - 6 * step, y)
        me.tab.wait_for_timeout(30)
    me.tab.mouse.up()
    me.until(lambda: me.centimetres() < 110, "the drag did not arrive")
    me.rest()
    assert np.abs(me.mesh("/fit/head") - fit).max() > 1e-4
    assert me.numbers()[0] < 1.5


def test_the_points_stay_while_the_face_changes_for_the_mean_of_ten_people(visit):
    me = visit()
    near, far = [], []
    for number, person in enumerate(fits.model("embedded").subjects, start=1):
        me.tab.get_by_label("Person").click()
        me.tab.get_by_role("option", name=person.name, exact=True).click()
        for metres, into in ((0.3, near), (2.4, far)):
            me.type_distance(f"{100 * metres:.0f}")
            state = ViewState(subject=number, distance=metres)
            face = faces.face(state.target, state.fitting, state.bend)
            want = np.array([face.d_l_percent, face.d_s_mm])
            me.until(
                lambda want=want: (
                    np.abs(me.numbers() - want).max() < 0.06
                ),  # as many digits as the cards have
                f"{person.name} at {metres} m does not show {want}",
            )
            into.append(me.numbers())
    d_l, d_s = np.mean(far, axis=0)
    assert d_l < 1.5  # HEAD.md 7 of the design; measured 1.08
    assert d_s >= 1.5 * np.mean(near, axis=0)[1]  # measured 1.9 times


def test_two_browsers_do_not_influence_each_other(visit):
    me, you = visit(), visit(500, 400)
    mine, yours = me.mesh("/fit/head"), you.mesh("/fit/head")
    me.type_distance("45")
    me.until(lambda: np.abs(me.mesh("/fit/head") - mine).max() > 1e-4, "my face did not change")
    me.rest()
    assert np.abs(you.mesh("/fit/head") - yours).max() == 0
    assert you.centimetres() == 120


def test_two_controls_changed_at_once_both_count(visit):
    me = visit()
    for attempt in range(6):
        before = me.centimetres()
        for name in ("Assumed distance", "Photo taken from"):  # nothing waits between the two
            me.slider(name).focus()
            me.tab.keyboard.press("ArrowRight" if attempt % 2 else "ArrowLeft")
        me.until(lambda b=before: me.centimetres() != b, "the first control was lost")
        step = int(me.slider("Photo taken from").get_attribute("aria-valuenow"))
        shown = f"{100 * 0.2 * 2 ** (step / 24):.3g}"
        me.until(
            lambda shown=shown: shown in me.tab.inner_text(".fa-photo em"),
            f"{attempt}: the slider shows {shown} cm, the server does not have it",
        )
        me.rest()


@pytest.mark.parametrize(("typed", "stands"), [("5", "20"), ("9999", "300")])
def test_a_number_out_of_range_is_said_and_set_to_the_nearest(visit, typed, stands):
    me = visit()
    me.type_distance(typed)
    notice = me.tab.get_by_text(re.compile(rf"is outside 20 to 300\. Set to {stands}\."))
    notice.first.wait_for(timeout=PATIENCE)
    me.until(lambda: me.centimetres() == float(stands), "the nearest value was not set")
    me.rest()
    assert me.numbers()[0] < 3


def test_letters_and_emptiness_leave_the_last_face(visit):
    me = visit()
    fit = me.mesh("/fit/head")
    box = me.tab.get_by_label("Distance (cm)")
    box.press_sequentially("abc")
    box.fill("")
    box.press("Tab")
    me.tab.wait_for_timeout(1500)
    assert np.abs(me.mesh("/fit/head") - fit).max() == 0


def test_an_error_is_a_red_line_and_the_last_face_stays(visit, monkeypatch):
    me = visit()
    fit = me.mesh("/fit/head")
    real = server.frame

    def fails(state, **options):
        if abs(state.distance - 0.66) < 1e-9:
            raise RuntimeError("a planted error")
        return real(state, **options)

    monkeypatch.setattr(server, "frame", fails)
    me.type_distance("66")
    me.tab.get_by_text("a planted error").first.wait_for(timeout=PATIENCE)
    assert np.abs(me.mesh("/fit/head") - fit).max() == 0
    me.type_distance("67")
    me.until(lambda: np.abs(me.mesh("/fit/head") - fit).max() > 1e-4, "the page did not go on")


def test_both_heads_stay_side_by_side_while_the_viewer_goes_round(visit):
    me = visit()
    canvas = me.tab.locator("canvas[data-engine]").bounding_box()
    x, y = canvas["x"] + canvas["width"] / 2, canvas["y"] + canvas["height"] / 2
    for turn in range(3):
        me.tab.mouse.move(x, y)
        me.tab.mouse.down()
        me.tab.mouse.move(x + 90 + 40 * turn, y + 10, steps=6)
        me.tab.mouse.up()
        me.tab.wait_for_timeout(600)
        camera = me.tab.evaluate(CAMERA)
        right = np.array(camera["matrix"][:3])
        gap = np.array(me.tab.evaluate(PLACE, "/fit")) - np.array(me.tab.evaluate(PLACE, "/true"))
        assert gap @ right / np.linalg.norm(gap) > 0.999, (
            turn
        )  # along the viewer's right, to 2.5 degrees


def test_the_wheel_does_not_change_perspective(visit):
    me = visit()
    canvas = me.tab.locator("canvas[data-engine]").bounding_box()
    me.tab.mouse.move(canvas["x"] + canvas["width"] / 2, canvas["y"] + canvas["height"] / 2)
    for _ in range(5):
        me.tab.mouse.wheel(0, -300)
        me.tab.wait_for_timeout(100)
    me.tab.wait_for_timeout(500)
    distance = np.linalg.norm(me.tab.evaluate(CAMERA)["position"])
    assert distance == pytest.approx(20, rel=0.01)  # metres: a long lens


def test_a_browser_that_goes_back_to_its_first_camera_is_put_right(visit):
    me = visit(390, 844)  # on a phone the heads stand above the sheet, not in the canvas's middle
    seen: list[float] = []

    def above_the_sheet() -> bool:
        camera = me.tab.evaluate(CAMERA)
        up, to_heads = np.array(camera["matrix"][4:7]), -np.array(camera["position"])
        seen.append(float(up @ to_heads))
        return seen[-1] > 0.2  # metres; 0.34 on this screen

    me.until(above_the_sheet, "the heads stood behind the sheet from the start")
    me.tab.evaluate("() => __viserMutable.resetCameraPose()")
    me.tab.wait_for_timeout(300)
    me.until(above_the_sheet, "the heads stayed behind the sheet")


def test_view_buttons_say_which_is_on_and_turn_the_heads(visit):
    me = visit()
    for name, forward in (("Front", 0.0), ("Side", 90.0), ("3/4", 32.0)):
        button = me.tab.get_by_role("button", name=name, exact=True)
        button.click()
        me.until(
            lambda b=button: b.get_attribute("aria-pressed") == "true", f"{name} is not shown as on"
        )
        me.tab.wait_for_timeout(600)
        back = np.array(me.tab.evaluate(CAMERA)["matrix"][8:11])
        head = np.array(me.tab.evaluate(PLACE, "/true")) - np.array(me.tab.evaluate(PLACE, "/fit"))
        assert abs(back @ head) < 1e-2 * np.linalg.norm(head)
        # a face looks along -z of the page's world; three-quarter is also 6 degrees from above
        turned = math.degrees(math.acos(np.clip(-back[2], -1, 1)))
        assert turned == pytest.approx(forward, abs=1.5)


def test_through_the_camera_the_eyes_keep_their_distance(visit):
    me = visit()
    me.tab.get_by_role("button", name="Through camera").click()
    corners = fits.model("embedded").scheme("ibug68").vertices[[36, 39, 42, 45]].tolist()
    gaps = []
    for centimetres in ("30", "60", "120", "240"):
        me.type_distance(centimetres)
        me.rest()
        me.tab.wait_for_timeout(400)
        points = me.mesh("/fit/head", corners)  # world axes, camera at the origin looking along -z
        pixels = (
            points[:, :2]
            / -points[:, 2:]
            / math.tan(math.radians(me.tab.evaluate(CAMERA)["fov"]) / 2)
        )
        eyes = pixels[:2].mean(axis=0), pixels[2:].mean(axis=0)
        gaps.append(np.linalg.norm(eyes[1] - eyes[0]))
    # The photograph's eyes keep theirs exactly; the fitted face's are off by its landmark error, up to 1.1 % each
    assert max(gaps) / min(gaps) < 1.03


def test_the_first_mode_bends_the_face_and_says_what_moves(visit):
    me = visit()
    fit, before = me.mesh("/fit/head"), me.numbers()
    me.tab.get_by_text("Other faces behind the same points").click()
    slider = me.slider("Mode A (mm)")
    slider.wait_for(timeout=PATIENCE)
    slider.focus()
    for _ in range(2):
        me.tab.keyboard.press("ArrowRight")
        me.tab.wait_for_timeout(80)
    me.until(
        lambda: np.abs(me.mesh("/fit/head") - fit).max() > 1e-4, "the mode did not bend the face"
    )
    me.rest()
    assert abs(me.numbers()[0] - before[0]) < 0.1  # 1 mm of surface; the points hardly move
    assert "Mode A:" in me.tab.inner_text("body")
    me.tab.get_by_role("button", name="Zero").click()
    me.until(
        lambda: np.abs(me.mesh("/fit/head") - fit).max() < 1e-6, "Zero did not bring the face back"
    )


def test_turning_the_head_changes_the_photograph(visit):
    me = visit()
    shown = "() => getComputedStyle(document.querySelector('.fa-photo')).backgroundImage"
    picture = me.tab.evaluate(shown)
    me.tab.get_by_text("Pose of the head in the photo").click()
    slider = me.slider("Turn")
    slider.wait_for(timeout=PATIENCE)
    slider.focus()
    for _ in range(10):
        me.tab.keyboard.press("ArrowRight")
        me.tab.wait_for_timeout(60)
    me.until(lambda: me.tab.evaluate(shown) != picture, "the photograph stayed")
    me.rest()
    assert me.numbers()[0] < 1.5


def test_a_phone_of_many_pixels_is_a_phone(browser: Browser, served):
    context = browser.new_context(viewport={"width": 390, "height": 844}, device_scale_factor=3)
    tab = context.new_page()
    tab.goto(f"{served.address}?fixedDpr=0.5")
    Visitor(tab)
    assert tab.locator(".fa-both").count() == 1  # photograph beside numbers, in the one sheet
    context.close()


@pytest.mark.parametrize(
    ("name", "width", "height", "scheme"),
    [
        ("desktop", 1440, 900, "light"),
        ("desktop_dark", 1440, 900, "dark"),
        ("phone", 390, 844, "light"),
        ("phone_small", 360, 740, "dark"),
        ("tablet", 820, 1180, "light"),
    ],
)
def test_pictures_of_the_page_are_kept(visit, name, width, height, scheme):
    me = visit(width, height, scheme, 1)
    tab = me.tab
    tab.add_style_tag(content=".mantine-Notifications-root { display: none }")
    tab.wait_for_timeout(800)
    ARTEFACTS.mkdir(exist_ok=True)
    file = ARTEFACTS / f"page_{name}.png"
    tab.screenshot(path=file)
    assert tab.evaluate(
        "() => document.documentElement.scrollWidth <= innerWidth"
    )  # nothing sideways
    dark = tab.evaluate("() => document.documentElement.dataset.mantineColorScheme")
    assert dark == scheme
    assert me.numbers()[0] < 1.5
    import cv2

    picture = cv2.imread(str(file))
    assert picture is not None
    assert picture.shape[:2] == (height, width)
    # two heads in the scene: pixels of skin, redder than blue by far, on both halves of the canvas
    canvas = tab.locator("canvas[data-engine]").bounding_box()
    x0, x1 = int(canvas["x"]), int(canvas["x"] + canvas["width"])
    scene = picture[: int(0.38 * height) if width < 577 else height, x0:x1].astype(int)
    skin = scene[:, :, 2] > scene[:, :, 0] + 25
    left, right = skin[:, : skin.shape[1] // 2].mean(), skin[:, skin.shape[1] // 2 :].mean()
    assert left > 0.05
    assert right > 0.05
