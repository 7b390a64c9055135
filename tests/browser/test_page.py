"""The page in Chromium, as a person uses it: what is read comes from the page."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from faceambig_app import ViewState, drawn
from faceambig_app.pipeline import faces, fits
from visitor import PATIENCE, SEEN

pytestmark = pytest.mark.browser


def test_the_first_frame_teaches(me):
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


def test_arrow_keys_move_the_slider_and_the_face_but_not_the_camera(me):
    true, fit, camera = me.mesh("/true/head"), me.mesh("/fit/head"), me.camera()
    slider, before = me.slider("Assumed distance"), me.centimetres()
    me.press_on(slider, *4 * ("ArrowLeft",))
    me.until(lambda: me.centimetres() < before, "the number did not follow the slider")
    me.rest()
    assert me.centimetres() == pytest.approx(before * 2 ** (-4 / 24), rel=0.01)
    assert np.abs(me.mesh("/fit/head") - fit).max() > 1e-4
    assert np.abs(me.mesh("/true/head") - true).max() == 0
    assert me.camera() == camera
    assert slider.get_attribute("aria-valuetext").startswith("1.0")


def test_the_cards_tell_the_numbers_of_the_person_that_was_chosen(me):
    for number in (2, 10):
        name = fits.model("embedded").subjects[number - 1].name
        me.open("Person in the photo")
        me.tab.get_by_label("Person", exact=True).click()
        me.tab.get_by_role("option", name=name, exact=True).click()
        me.until(lambda number=number: me.state.subject == number, f"{name} was not chosen")
        me.type_distance("240")
        me.until(lambda: me.state.distance == 2.4, "240 did not arrive")
        me.rest()
        state = ViewState(subject=number, distance=2.4)
        face = faces.face(state.target, state.fitting, state.bend)
        want = np.array([face.d_l_percent, face.d_s_mm])
        assert np.abs(me.numbers() - want).max() < 0.06  # as many digits as the cards have


def test_two_browsers_do_not_influence_each_other(me, visit):
    you = visit(500, 400)
    mine, yours = me.mesh("/fit/head"), you.mesh("/fit/head")
    me.type_distance("45")
    me.until(lambda: me.state.distance == 0.45, "45 did not arrive")
    me.rest()
    you.rest()
    assert np.abs(me.mesh("/fit/head") - mine).max() > 1e-4
    assert np.abs(you.mesh("/fit/head") - yours).max() == 0
    assert you.centimetres() == 120
    assert you.state.distance == 1.2
    you.tab.context.close()


def test_two_controls_changed_at_once_both_count(me):
    me.open("Person in the photo")
    second = me.slider("Photo taken from")
    for key in ("ArrowLeft", "ArrowRight", "ArrowLeft"):
        before, at = me.centimetres(), second.get_attribute("aria-valuenow")
        for slider in (me.slider("Assumed distance"), second):  # nothing waits between the two
            slider.focus()
            me.tab.keyboard.press(key)
        me.until(lambda b=before: me.centimetres() != b, "the first control was lost")
        me.until(lambda a=at: second.get_attribute("aria-valuenow") != a, "the key was lost")
        step = int(second.get_attribute("aria-valuenow"))
        shown = f"{100 * 0.2 * 2 ** (step / 24):.3g}"
        me.until(
            lambda shown=shown: shown in me.tab.inner_text(".fa-photo em"),
            f"{key}: the slider shows {shown} cm, the server does not have it",
        )
        me.rest()


def test_what_is_typed_is_clamped_in_words_and_what_is_no_number_changes_nothing(me):
    for typed, stands, shown in (
        ("5", 20, "5"),
        ("1000000000", 300, r"1e\+09"),
        ("9999", 300, "9999"),
    ):
        me.type_distance("100")
        me.until(lambda: me.state.distance == 1.0, "100 did not arrive")
        me.rest()  # two values within 50 ms, which no hand types, are one to viser: the later
        me.type_distance(typed)
        words = re.compile(rf"{shown} is outside 20 to 300\. Set to {stands}\.")
        me.tab.get_by_text(words).first.wait_for(timeout=PATIENCE)
        me.until(lambda s=stands: me.centimetres() == s, "the nearest value was not set")
        me.rest()
        assert me.state.distance == stands / 100
        assert me.numbers()[0] < 3
    fit = me.mesh("/fit/head")
    box = me.tab.get_by_label("Distance (cm)")
    box.press_sequentially("abc")
    box.fill("")
    box.press("Tab")
    me.rest()
    assert np.abs(me.mesh("/fit/head") - fit).max() < 1e-6
    assert me.state.distance == 3.0
    # viser writes changes only: what it left empty shows the next value
    me.press_on(me.slider("Assumed distance"), "ArrowLeft")
    me.until(
        lambda: me.centimetres() == round(100 * me.state.distance, 1), "the field stayed empty"
    )


def test_an_error_is_a_red_line_and_the_last_face_stays(me, monkeypatch):
    fit = me.mesh("/fit/head")
    real = drawn.frame

    def fails(state, **options):
        if abs(state.distance - 0.66) < 1e-9:
            raise RuntimeError("a planted error")
        return real(state, **options)

    monkeypatch.setattr(drawn, "frame", fails)
    me.type_distance("66")
    me.tab.get_by_text("a planted error").first.wait_for(timeout=PATIENCE)
    assert np.abs(me.mesh("/fit/head") - fit).max() == 0
    me.type_distance("67")
    me.until(lambda: np.abs(me.mesh("/fit/head") - fit).max() > 1e-4, "the page did not go on")


def bar(me, name: str) -> float:
    """Length of a head's bar, metres of the scene."""
    ends = me.tab.evaluate(
        """name => { const xs = []; __viserMutable.nodeRefFromName[name].traverse(o => {
        const p = o.geometry?.attributes.instanceStart ?? o.geometry?.attributes.position;
        if (p && o.visible) for (let i = 0; i < p.count; i++) xs.push(p.getX(i)) });
        return [Math.min(...xs), Math.max(...xs)] }""",
        name,
    )
    return ends[1] - ends[0]


def test_heads_stay_side_by_side_while_the_viewer_goes_round_and_the_wheel_changes_no_perspective(
    me,
):
    canvas = me.canvas()
    x, y = canvas["x"] + canvas["width"] / 2, canvas["y"] + canvas["height"] / 2
    bars = [bar(me, f"/{name}/board/bar") for name in ("true", "fit")]
    assert bars == pytest.approx([0.05, 0.05], rel=1e-5)
    me.close_notices()
    for turn in range(3):
        me.tab.mouse.move(x, y)
        under = me.tab.evaluate("([x, y]) => document.elementFromPoint(x, y).tagName", [x, y])
        assert under == "CANVAS", "something is in the way of the pointer"
        me.tab.mouse.down()
        me.tab.mouse.move(x + 90 + 40 * turn, y + 10, steps=6)
        me.tab.mouse.up()

        def beside() -> bool:  # along the viewer's right, to 2.5 degrees
            gap = me.place("/fit") - me.place("/true")
            return gap @ np.array(me.camera()["matrix"][:3]) / np.linalg.norm(gap) > 0.999

        me.until(beside, f"turn {turn}: the heads are not side by side")
    me.until(lambda: me.state.view == "free", "the turn was not told")
    me.tab.mouse.move(x, y)
    fov = me.camera()["fov"]
    for _ in range(5):
        me.tab.mouse.wheel(0, -300)
    me.tab.keyboard.press("ArrowRight", delay=60)  # handled after them
    me.rest()
    assert np.linalg.norm(me.camera()["position"]) == pytest.approx(20, rel=0.01)  # a long lens
    assert me.camera()["fov"] == pytest.approx(fov, rel=1e-6)
    assert not me.browser._history.past  # the viewer's moves are no steps


def test_view_buttons_say_which_is_on_and_turn_the_heads(me):
    for name, forward in (("Front", 0.0), ("Side", 90.0), ("3/4", 32.0)):
        button = me.tab.get_by_role("group", name="View").get_by_role(
            "button", name=name, exact=True
        )
        button.click()
        me.until(
            lambda b=button: b.get_attribute("aria-pressed") == "true", f"{name} is not shown as on"
        )

        # a face looks along -z of the page's world; three-quarter is also 6 degrees from above
        def turned() -> float:
            back = np.array(me.camera()["matrix"][8:11])
            return math.degrees(math.acos(np.clip(-back[2], -1, 1)))

        me.until(lambda to=forward: abs(turned() - to) < 1.5, f"{name} turns nothing")
        back = np.array(me.camera()["matrix"][8:11])

        def across(back=back) -> bool:
            gap = me.place("/true") - me.place("/fit")
            return abs(back @ gap) < 1e-2 * np.linalg.norm(gap)

        me.until(across, f"{name}: the heads are not beside each other")


# Of every picture how far apart the drawn eyes are, in heights of the canvas; of the mesh that is seen, fine or coarse
EYES = """rows => { const told = window.eyes = []; const look = () => {
  const c = __viserMutable.camera; c.updateMatrixWorld(); let mesh;
  for (const name of ["/fit/head", "/fit/draft"])
    if (__viserMutable.nodeRefFromName[name]?.visible) __viserMutable.nodeRefFromName[name].traverse(o => {
      if (o.isMesh) mesh ??= o });
  const p = mesh.geometry.attributes.position; mesh.updateWorldMatrix(true, false);
  const [a, b, d, e] = rows.map(k => { const v = c.position.clone().set(p.getX(k), p.getY(k), p.getZ(k));
    v.applyMatrix4(mesh.matrixWorld).project(c); return [v.x * c.aspect, v.y] });
  told.push([Math.hypot(d[0] + e[0] - a[0] - b[0], d[1] + e[1] - a[1] - b[1]) / 4, c.fov]);
  if (window.eyes === told) requestAnimationFrame(look) }; requestAnimationFrame(look) }"""


def test_through_the_camera_the_eyes_keep_their_distance_in_every_picture_of_a_glide(me):
    me.goes(view="camera", distance=0.25)
    corners = fits.model("embedded").scheme("ibug68").vertices[[36, 39, 42, 45]].tolist()
    me.tab.evaluate(EYES, corners)
    me.tab.keyboard.press("g")
    me.until(lambda: me.state.distance > 1.0, "g does not glide")
    me.tab.keyboard.press("Escape")
    me.rest()
    eyes, fov = np.array(
        me.tab.evaluate("() => { const told = window.eyes; window.eyes = null; return told }")
    ).T
    assert fov.max() > 3 * fov.min()  # it came from near to far before our eyes
    assert eyes.max() / eyes.min() < 1.001  # a pixel of a thousand; unmended 1.02
    canvas = me.canvas()
    high = max(
        1, canvas["height"] / canvas["width"]
    )  # in photographs, each five eye distances high
    assert eyes[0] * high == pytest.approx(0.2, rel=1e-3)


def test_the_first_mode_bends_the_face_and_says_what_moves(me):
    fit, before = me.mesh("/fit/head"), me.numbers()
    me.open("Other faces behind the same points")
    slider = me.tab.get_by_role("slider", name=re.compile("^A: "))
    slider.wait_for(timeout=PATIENCE)
    unbent = {
        part: me.mesh("/fit/head", vertices[::20].tolist())
        for part, vertices in fits.model("embedded").regions.items()
    }
    me.press_on(slider, "ArrowRight", "ArrowRight")
    me.until(lambda: me.state.flex == ((1, 1.0),), "the mode did not arrive")
    me.rest()
    assert abs(me.numbers()[0] - before[0]) < 0.1  # 1 mm of surface; the points hardly move
    regions = fits.model("embedded").regions
    for words in slider.get_attribute("aria-label").removeprefix("A: ").split(", "):
        part, way = words.split()
        rows = regions[part][::20].tolist()
        moved = (me.mesh("/fit/head", rows) - unbent[part]).mean(axis=0)
        axis, sign = {"up": (1, 1), "down": (1, -1), "forward": (2, 1), "back": (2, -1)}[way]
        assert sign * moved[axis] > 2e-4, words  # metres: 0.49 mm, the brows, is the least
    assert "A is mode 1:" in me.tab.inner_text("body")
    me.tab.get_by_role("button", name="Zero").click()
    me.until(
        lambda: np.abs(me.mesh("/fit/head") - fit).max() < 1e-6, "Zero did not bring the face back"
    )


def test_turning_the_head_changes_the_photograph(me):
    shown = "() => getComputedStyle(document.querySelector('.fa-photo')).backgroundImage"
    picture = me.tab.evaluate(shown)
    me.open("Pose of the head in the photo")
    slider = me.slider("Turn (\u00b0)")
    slider.wait_for(timeout=PATIENCE)
    me.press_on(slider, *4 * ("ArrowRight",))
    me.until(lambda: me.tab.evaluate(shown) != picture, "the photograph stayed")
    me.rest()
    assert me.numbers()[0] < 1.5


def test_of_two_heads_in_one_place_one_is_drawn_at_a_time(me):
    for key, pressed in (("b", "Blink"), ("o", "Overlay"), ("o", "Both")):
        me.tab.keyboard.press(key)
        group = me.tab.get_by_role("group", name="Show", exact=True)
        me.until(
            lambda g=group, p=pressed: (
                g.get_by_role("button", pressed=True).all_inner_texts() == [p]
            ),
            f"{pressed} is not on",
        )
        me.rest()
        gap = np.linalg.norm(me.place("/fit") - me.place("/true"))
        assert (gap < 1e-6) == (pressed != "Both")
        if pressed == "Blink":
            for shown in ("/true", "/fit", "/true"):
                me.until(lambda s=shown: me.tab.evaluate(SEEN, s), f"{shown} does not come")
        else:
            me.until(
                lambda: me.tab.evaluate(SEEN, "/true") and me.tab.evaluate(SEEN, "/fit"),
                "one is gone",
            )
