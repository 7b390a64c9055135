"""Comparing in Chromium: names of pins, overlays, millimetres under the pointer; and links that say too much."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from faceambig_app.state import DEFAULT, changed
from faceambig_app.state.link import query
from visitor import PATIENCE, Visitor, artefacts

pytestmark = pytest.mark.browser

TAG = (
    "() => { const t = document.querySelector('.fa-under'); return t.hidden ? '' : t.textContent }"
)
# Where a vertex of a head is in the window, pixels
AT = """([name, k]) => { const c = __viserMutable.camera; let mesh;
  __viserMutable.nodeRefFromName[name].traverse(o => { if (!mesh && o.isMesh) mesh = o });
  const p = mesh.geometry.attributes.position, box = __viserMutable.canvas.getBoundingClientRect();
  const v = c.position.clone().set(p.getX(k), p.getY(k), p.getZ(k)).applyMatrix4(mesh.matrixWorld).project(c);
  return [box.left + (v.x + 1) / 2 * box.width, box.top + (1 - v.y) / 2 * box.height] }"""
HIDE = ".mantine-Notifications-root { display: none }"
OPACITIES = """() => Object.fromEntries(["true", "fit"].map(name => { let found;
  __viserMutable.nodeRefFromName[`/${name}/head`]?.traverse(o => { if (!found && o.isMesh) found = o });
  return [name, found && [found.material.transparent, +found.material.opacity.toFixed(3)]] }))"""


def vertex_of(me: Visitor, name: str) -> tuple[int, float]:
    """A vertex in the middle of the face, seen from the front, and what its colour means."""
    nodes = me.browser.stage._heads[name]
    points, values = nodes._full.vertices, nodes._values
    assert values is not None
    front = np.flatnonzero(np.isfinite(values) & (points[:, 2] > np.quantile(points[:, 2], 0.97)))
    tip = int(front[np.argmax(points[front, 2])])
    return tip, float(values[tip])


# ---------------------------------------------------------------- links


def test_a_link_says_what_was_left_out_and_the_rest_of_it_counts(browser, served):
    context = browser.new_context(viewport={"width": 1150, "height": 560})
    context.set_default_timeout(PATIENCE)
    tab = context.new_page()
    known = set(served._browsers)
    tab.goto(f"{served.address}?fixedDpr=0.25&distance=0.5&spin=3&zoom=99&subject=many&%3Cb%3E=1")
    for words in (
        "Unknown settings in this link were left out: spin, _b_.",
        "zoom: 99 is outside 0.5 to 4. Set to 4.",
        'subject: "many" was not understood',
    ):
        tab.get_by_text(words).wait_for()
    me = Visitor(tab, served, known)
    assert me.state == changed(DEFAULT, distance=0.5, zoom=4)
    assert "ignored" not in tab.evaluate("() => location.search")
    context.close()


# ---------------------------------------------------------------- pins


def test_a_pin_is_named_by_typing_and_its_name_is_in_row_table_and_link(me, visit, tmp_path):
    me.goes(pins=(DEFAULT, changed(DEFAULT, distance=0.5)), view="front")
    me.tab.get_by_role("tab", name="Compare", exact=True).click()
    field = me.tab.get_by_label("Name of pin 2", exact=True)
    field.click()
    field.press_sequentially("N\u00e4her <b> \u05e9", delay=30)
    me.until(lambda: me.state.pin_names == ("", "N\u00e4her <b> \u05e9"), "the name did not arrive")
    assert field.input_value() == "N\u00e4her <b> \u05e9"
    me.rest()
    heads = me.tab.locator("table:has(caption) thead th")
    assert heads.all_inner_texts() == ["Pin 1", "N\u00e4her <b> \u05e9"]
    me.goes(show="row")
    title = me.browser.stage._heads["pin2"]._title.lines
    assert " ".join(title) == "N\u00e4her <b> \u05e9, assumed 50\u202fcm"
    me.tab.screenshot(path=str(artefacts(tmp_path) / "pins_named.png"))
    link = query(me.state)
    you = visit(query=link)
    assert you.state.pin_names == me.state.pin_names
    you.tab.context.close()
    me.tab.get_by_role("button", name="Remove", exact=True).first.click()
    me.until(
        lambda: me.state.pin_names == ("N\u00e4her <b> \u05e9",), "the other pin's name went too"
    )


# ---------------------------------------------------------------- overlay


def test_one_head_of_an_overlay_is_solid_at_every_fade(me):
    for fade, true, fit in ((0.3, [True, 0.4], [False, 1]), (0.75, [False, 1], [False, 1]),
                            (0.9, [False, 1], [True, 0.4])):  # fmt: skip
        me.goes(show="overlay", fade=fade)
        assert me.tab.evaluate(OPACITIES) == {"true": true, "fit": fit}, fade


# ---------------------------------------------------------------- the legend


# Where all vertices are in the window, pixels, and how much they face the viewer of a front view
PLACES = """name => { const c = __viserMutable.camera; let mesh;
  __viserMutable.nodeRefFromName[name].traverse(o => { if (!mesh && o.isMesh) mesh = o });
  const { position: p, normal: n } = mesh.geometry.attributes, box = __viserMutable.canvas.getBoundingClientRect();
  return Array.from({ length: p.count }, (_, k) => {
    const v = c.position.clone().set(p.getX(k), p.getY(k), p.getZ(k)).applyMatrix4(mesh.matrixWorld).project(c);
    return [box.left + (v.x + 1) / 2 * box.width, box.top + (1 - v.y) / 2 * box.height, n.getZ(k)] }) }"""


def colours_are_the_legends(me: Visitor) -> None:
    """Of what faces the viewer: pixels as the legend has them, so that a value read by eye is right."""
    nodes = me.browser.stage._heads["fit"]
    values, colours = nodes._values, np.asarray(nodes._painted, dtype=int)
    assert values is not None
    at = np.array(me.tab.evaluate(PLACES, "/fit/head"))
    front = (at[:, 2] > 0.9) & (nodes._full.vertices[:, 2] > 0.02) & np.isfinite(values)
    png = Image.open(io.BytesIO(me.tab.screenshot(style=HIDE))).convert("RGB")
    x, y = np.round(at[front, :2]).astype(int).T
    pixels = np.asarray(png).astype(int)[y, x]
    # 6 of 255 measured: shine, the lamps' tint; 13 with lamps twice as strong
    assert np.median(np.abs(pixels - colours[front]).max(axis=1)) <= 8
    scale = values[front][np.argmin(np.abs(pixels[:, None] - colours[front]).sum(axis=2), axis=1)]
    assert np.median(np.abs(scale - values[front])) < 0.3  # mm of 15


# ---------------------------------------------------------------- millimetres under the pointer


def test_a_mouse_that_rests_on_a_head_reads_its_millimetres_until_the_next_change(me, tmp_path):
    me.goes(show="difference", view="front")
    vertex, mm = vertex_of(me, "fit")
    x, y = me.tab.evaluate(AT, ["/fit/head", vertex])
    me.tab.mouse.move(x + 1, y + 1)
    me.tab.mouse.move(x, y)
    me.tab.wait_for_function(TAG)
    said = me.tab.evaluate(TAG)
    assert said.endswith("\u202fmm to the true face")
    # the triangle under a whole pixel may be the next one: the surface is smooth
    assert float(said.split("\u202f")[0]) == pytest.approx(mm, abs=0.25)
    me.tab.screenshot(path=str(artefacts(tmp_path) / "under.png"))
    me.do(lambda: me.browser.change(lambda state: changed(state, distance=0.5)))
    me.tab.wait_for_function(f"() => ({TAG})() === ''")
    me.rest()
    true = me.tab.evaluate(AT, ["/true/head", vertex])
    me.tab.mouse.move(*true)  # a head whose colours mean nothing
    me.tab.wait_for_timeout(600)
    assert me.tab.evaluate(TAG) == ""


def test_the_skin_is_not_asked_and_a_press_that_turns_the_heads_is_no_click(me):
    me.goes(view="front")
    asked = []
    heard, me.browser.script._heard = me.browser.script._heard, lambda report: asked.append(report)
    try:
        x, y = me.tab.evaluate(AT, ["/fit/head", 0])
        me.tab.mouse.move(x, y)
        me.tab.wait_for_timeout(400)
        assert asked == []
    finally:
        me.browser.script._heard = heard


def test_a_finger_reads_by_a_tap(visit, tmp_path):
    you = visit(390, 844, query="show=difference&view=front", dpr=1, has_touch=True)
    you.close_notices()
    colours_are_the_legends(you)
    vertex, mm = vertex_of(you, "fit")
    x, y = you.tab.evaluate(AT, ["/fit/head", vertex])
    you.tab.touchscreen.tap(x, y)
    you.tab.wait_for_function(TAG)
    assert float(you.tab.evaluate(TAG).split("\u202f")[0]) == pytest.approx(mm, abs=0.4)
    you.tab.screenshot(path=str(artefacts(tmp_path) / "under_phone.png"))
    you.tab.touchscreen.tap(x, 20)  # nothing is there
    you.tab.wait_for_function(f"() => ({TAG})() === ''")
    you.tab.context.close()
