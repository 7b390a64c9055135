"""The state of the page in Chromium: links, the address bar, undo, keys, a lost server, what moves and what is said."""

from __future__ import annotations

import contextlib
import io
import shlex

import numpy as np
import pytest
from PIL import Image

from faceambig_app import cli, room, server
from faceambig_app.glide import STILLS
from faceambig_app.state import DEFAULT, changed, forms, history
from faceambig_app.state.actions import ACTIONS
from faceambig_app.state.link import query, to_digits
from visitor import PATIENCE, SEEN, Visitor, artefacts

pytestmark = pytest.mark.browser

LOST = "Connection lost. Your state is kept; reconnecting..."
BACK = "Back. Nothing was lost."


def seen(me: Visitor) -> np.ndarray:
    """(H, W, 3) the window: heads, photograph and numbers, without notices and focus."""
    me.tab.evaluate("() => document.activeElement?.blur()")
    me.tab.mouse.move(2, 2)
    png = me.tab.screenshot(style=".mantine-Notifications-root { display: none }")
    picture = np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(int)
    return picture[:, :-16]  # there a bar of scrolling fades when nothing moves


def search(me: Visitor) -> str:
    return me.tab.evaluate("() => location.search")


# ---------------------------------------------------------------- links and the address bar


def test_a_link_opened_in_a_fresh_browser_shows_the_same_pixels(visit, tmp_path):
    size = (640, 700)
    me = visit(*size, dpr=1)
    me.type_distance("45")
    me.until(lambda: me.state.distance == 0.45, "45 did not arrive")
    me.tab.evaluate("() => document.activeElement.blur()")
    for key in "pm":  # profile; a pin
        me.tab.keyboard.press(key)
    me.until(lambda: me.state.pins and me.state.view == "side", "the keys did not arrive")
    me.rest()
    link = search(me).removeprefix("?fixedDpr=1&")
    you = visit(*size, dpr=1, query=link)
    assert you.state == me.state
    assert you.numbers() == me.numbers()
    assert you.camera()["matrix"] == pytest.approx(me.camera()["matrix"], abs=1e-6)
    assert you.camera()["fov"] == pytest.approx(me.camera()["fov"], rel=1e-6)
    mine, yours = seen(me), seen(you)
    folder = artefacts(tmp_path)
    Image.fromarray(mine.astype(np.uint8)).save(folder / "link_made.png")
    Image.fromarray(yours.astype(np.uint8)).save(folder / "link_opened.png")
    differ = np.abs(mine - yours).max(axis=2) > 8  # of 255
    assert differ.mean() < 1e-3, np.argwhere(differ)[[0, -1]]
    for page in (me, you):
        page.tab.context.close()


def test_a_drag_is_one_step_and_the_address_follows_without_history(me, monkeypatch):
    monkeypatch.setattr(
        history, "STEP_CLOSES", 60.0
    )  # where others compute, a hand stops for longer
    entries = me.tab.evaluate("() => history.length")
    slider, crosses = me.slider("Assumed distance"), me.tab.locator("#fx").get_attribute("d")
    circles = me.tab.locator("#fo").get_attribute("d")
    true, fit, camera = me.mesh("/true/head"), me.mesh("/fit/head"), me.camera()
    me.drag(slider, 0.0)
    me.until(lambda: me.state.distance == 0.2, "the drag to the near end did not arrive")
    me.rest()
    near = me.mesh("/fit/head")
    me.drag(slider, 1.0)
    me.until(lambda: me.state.distance == 3.0, "the drag to the far end did not arrive")
    me.rest()
    assert len(me.browser._history.past) == 1
    assert search(me) == "?fixedDpr=0.25&distance=3"
    assert me.tab.evaluate("() => history.length") == entries
    # The crosses stay, and so do the true head and the viewer; circles and the other head follow
    assert me.tab.locator("#fx").get_attribute("d") == crosses
    assert me.tab.locator("#fo").get_attribute("d") != circles
    assert np.abs(me.mesh("/true/head") - true).max() == 0
    assert np.abs(me.mesh("/fit/head") - near).max() > 1e-3
    assert np.abs(me.mesh("/fit/head") - fit).max() > 1e-4
    slider.focus()
    for key in ("ArrowLeft", "w", "ArrowUp", "ArrowDown", "ArrowRight"):
        me.tab.keyboard.press(key, delay=40)
    me.until(
        lambda: me.state.distance == 3.0 and me.centimetres() == 300, "arrows do not come back"
    )
    assert me.camera() == camera

    me.start_again()
    me.drag(slider, 0.0)
    me.until(lambda: me.state.distance == 0.2, "the drag did not arrive")
    me.rest()
    for key, distance in (("Control+z", 1.2), ("Control+Shift+Z", 0.2)):
        me.tab.evaluate("() => document.activeElement.blur()")
        me.tab.keyboard.press(key)
        me.until(lambda d=distance: me.state.distance == d, key)
        me.rest()
    assert len(me.browser._history.past) == 1
    for name, distance in (("Undo", 1.2), ("Redo", 0.2), ("Reset", 1.2)):
        me.tab.get_by_role("button", name=name, exact=True).click()
        me.until(lambda d=distance: me.state.distance == d, name)
        me.rest()
        assert me.centimetres() == 100 * distance
    assert me.state == DEFAULT
    assert search(me) == "?fixedDpr=0.25"
    assert np.abs(me.mesh("/fit/head") - fit).max() < 1e-6


# ---------------------------------------------------------------- keys


def test_keys_do_what_the_table_of_actions_says(me):
    expected = {
        "J": "nearer", "K": "farther", "F": "front", "T": "three_quarter", "P": "side", "U": "top", "C": "camera",
        "B": "blink", "O": "overlay", "H": "difference", "L": "points", "R": "rays", "M": "pin", "X": "reset_view",
    }  # fmt: skip
    assert {a.key: name for name, a in ACTIONS.items() if a.change and a.key} == expected
    for key, name in expected.items():
        change = ACTIONS[name].change
        assert change is not None
        if change(me.state) == me.state:  # three quarters, where it stands at first
            me.tab.keyboard.press("f")
            me.until(lambda: me.state.view == "front", "f")
        wanted = change(me.state)
        me.tab.keyboard.press(key.lower())
        me.until(lambda w=wanted: me.state == w, f"{key}: {name}")
    me.rest()  # all that was asked for can be drawn, and is
    me.tab.keyboard.press("h")  # off again, so that the view from the side comes back
    me.until(lambda: me.state.show == "both", "h")
    before = me.state
    box = me.tab.get_by_label("Distance (cm)")
    box.focus()
    for key in [*expected, "g", "Control+z", "Control+Shift+Z"]:
        me.tab.keyboard.press(key.lower() if len(key) == 1 else key)
    me.press_on(me.slider("Assumed distance"), "ArrowLeft")  # what is sent after them has come
    me.until(lambda: me.state.distance < before.distance, "the slider")
    assert changed(me.state, distance=before.distance) == before


def test_escape_ends_glide_and_blink(me):
    me.tab.keyboard.press("g")
    me.until(lambda: me.state.distance > 1.3, "g does not glide")
    me.tab.keyboard.press("Escape")
    me.until(lambda: not me.browser._glide.on, "Escape does not stop it")
    me.rest()
    stood = me.state.distance
    assert me.centimetres() == pytest.approx(100 * stood, abs=0.06)
    play = me.tab.get_by_role("button", name="Play", exact=True)
    play.click()
    me.until(lambda: me.state.distance != stood, "Play does not glide")
    play.click()  # the same button stops it
    me.until(lambda: not me.browser._glide.on, "Play does not stop it")
    me.tab.evaluate("() => document.activeElement.blur()")
    me.tab.keyboard.press("b")
    for shown, hidden in (("/true", "/fit"), ("/fit", "/true")):
        me.until(
            lambda s=shown, h=hidden: me.tab.evaluate(SEEN, s) and not me.tab.evaluate(SEEN, h),
            f"{shown} does not come",
        )
    me.tab.keyboard.press("Escape")
    me.until(lambda: me.state.show == "both", "Escape does not end it")
    me.rest()
    assert me.tab.evaluate(SEEN, "/true")
    assert me.tab.evaluate(SEEN, "/fit")


# ---------------------------------------------------------------- clipboard


def copied(me: Visitor, press) -> str:
    me.tab.evaluate("() => navigator.clipboard.writeText('')")
    press()
    me.until(lambda: me.tab.evaluate("() => navigator.clipboard.readText()"), "nothing is copied")
    return me.tab.evaluate("() => navigator.clipboard.readText()")


@pytest.mark.gl
def test_link_and_command_are_copied_and_draw_what_is_seen(me, tmp_path):
    me.type_distance("45")
    me.until(lambda: me.state.distance == 0.45, "45 did not arrive")
    me.tab.evaluate("() => document.activeElement.blur()")
    me.tab.keyboard.press("h")
    me.until(lambda: me.state.show == "difference", "h")
    link = copied(me, lambda: me.tab.get_by_role("button", name="Copy link").click())
    assert link == f"{me.served.address}?{query(me.state)}"
    me.tab.get_by_text("Copied.").first.wait_for(timeout=PATIENCE)

    def by_palette() -> None:
        me.tab.keyboard.press("Control+k")
        me.tab.locator(".mantine-Spotlight-search input").fill("copy command")
        me.tab.locator(".mantine-Spotlight-action").first.click()

    command = shlex.split(copied(me, by_palette))
    assert command[:2] == ["faceambig", "snapshot"]
    assert forms.command(me.state) == shlex.join(command)
    out = tmp_path / "face.png"
    command[command.index("--out") + 1] = str(out)
    with contextlib.redirect_stdout(io.StringIO()):
        assert cli.main([*command[1:], "--width", "320"]) == 0
    with Image.open(out) as drawn:
        assert to_digits(forms.from_json(str(drawn.info["ViewState"]))) == to_digits(me.state)


# ---------------------------------------------------------------- the connection


def test_the_state_comes_back_with_the_connection_and_with_the_server(browser, me):
    """One page through a connection cut by the server, a wish for no motion, and a server that is started anew."""
    home = server.Page("127.0.0.1", 0)
    port = int(home.address.rsplit(":", 1)[1].strip("/"))
    context = browser.new_context(viewport={"width": 500, "height": 500})
    context.set_default_timeout(PATIENCE)
    tab = context.new_page()
    try:
        tab.goto(f"{home.address}?fixedDpr=0.25&distance=0.6&view=side&hide=actual")
        you = Visitor(tab, home)
        wanted, numbers = you.state, tab.inner_text(".fa-cards")
        assert (wanted.distance, wanted.view, wanted.hide) == (0.6, "side", ("actual",))
        fit = you.mesh("/fit/head")

        tab.emulate_media(reduced_motion="reduce")
        known = set(home._browsers)
        home._server._websock_server.disconnect_all_clients()
        tab.get_by_text(BACK).wait_for(timeout=PATIENCE)
        you.find(known)
        you.until(lambda: you.state == wanted, "the state is lost")
        you.rest()
        assert tab.inner_text(".fa-cards") == numbers
        glide_and_blink_stand_still(you)

        you.do(lambda: you.browser.change(lambda _: wanted))
        you.until(lambda: you.state == wanted, "back")
        you.rest()
        home.close()
        tab.get_by_text(LOST).wait_for(timeout=PATIENCE)
        assert you.numbers is not None
        home = server.Page("127.0.0.1", port)
        tab.get_by_text(BACK).wait_for(timeout=PATIENCE)
        you.served = home
        you.find(())
        you.until(lambda: you.state == wanted, "the state is lost")
        you.rest()
        assert tab.inner_text(".fa-cards") == numbers
        assert np.abs(you.mesh("/fit/head") - fit).max() < 1e-6
        tab.wait_for_function("() => document.querySelector('.fa-status').textContent === ''")
    finally:
        context.close()
        home.close()
    me.rest()  # another page on another server saw nothing of it
    assert me.state == DEFAULT


def glide_and_blink_stand_still(me: Visitor) -> None:
    """Where a person wants no motion: few stills, and one face in the place of two."""
    visited = {me.state.distance}
    me.tab.keyboard.press("g")

    def second() -> bool:
        visited.add(me.state.distance)
        return me.state.distance == STILLS[2]

    me.until(second, "no stills")
    assert visited <= {0.6, *STILLS}
    me.tab.keyboard.press("Escape")
    me.until(lambda: not me.browser._glide.on, "Escape does not stop it")
    me.tab.keyboard.press("b")
    me.until(lambda: me.state.show == "blink", "b")
    me.rest()
    me.until(
        lambda: me.tab.evaluate(SEEN, "/true") != me.tab.evaluate(SEEN, "/fit"), "both are seen"
    )
    first = me.tab.evaluate(SEEN, "/true")
    changes = me.tab.evaluate(
        """name => new Promise(done => { const node = __viserMutable.nodeRefFromName[name], seen = new Set();
        let n = 8; const look = () => { __viserMutable.requestRender(); seen.add(node.visible);
          if (n--) setTimeout(look, 200); else done([...seen]) }; look() })""",
        "/true",
    )
    assert changes == [first]  # for longer than a turn of half a second
    me.tab.keyboard.press("Escape")
    me.until(lambda: me.state.show == "both", "Escape does not end it")


# ---------------------------------------------------------------- what is said


def test_what_a_screen_reader_says_changes_once_a_rest(me, monkeypatch):
    monkeypatch.setattr(room, "REST", 4.0)  # where others compute, a hand stops for longer
    me.tab.evaluate(
        """() => { window.said = []; const words = () => [...document.querySelectorAll('.fa-spoken[aria-live=polite]')]
          .map(e => e.textContent).join('');
        let last = words();
        window.listening = new MutationObserver(() => { const now = words();
          if (now !== last) { last = now; said.push(now) } });
        listening.observe(document, { childList: true, subtree: true, characterData: true }) }"""
    )
    me.drag(me.slider("Assumed distance"), 0.2)
    me.until(lambda: me.state.distance < 0.5, "the drag did not arrive")
    me.rest()
    me.until(lambda: me.tab.evaluate("() => said.filter(Boolean).length"), "nothing is said")
    said = me.tab.evaluate("() => { listening.disconnect(); return said.filter(Boolean) }")
    d_l, d_s = me.numbers()
    assert len(said) == 1, said
    assert f"Landmark error {d_l:.2f} percent" in said[0]
    assert f"Surface difference {d_s:.1f} millimetres" in said[0]
