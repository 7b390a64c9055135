"""What assets/page/*.js reports and does when it is told, in Chromium, on a server of two boxes and a photograph."""

from __future__ import annotations

import base64
import io
import itertools
import json
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
import viser
from PIL import Image
from playwright.sync_api import Browser, Page

from faceambig_app import guard, script
from visitor import PATIENCE

pytestmark = pytest.mark.browser

WIDTH, HEIGHT = 400, 300  # of the photograph
BOXES = """(() => ['/one', '/two'].map(n => __viserMutable.nodeRefFromName[n]?.visible))()"""


def picture() -> str:
    """A photograph whose every pixel says where it is: red runs to the right, green down."""
    x, y = np.meshgrid(np.linspace(0, 255, WIDTH), np.linspace(0, 255, HEIGHT))
    rgb = np.stack([x, y, 0 * x + 80], axis=2).astype(np.uint8)
    file = io.BytesIO()
    Image.fromarray(rgb).save(file, "png")
    return base64.b64encode(file.getvalue()).decode()


def photo(points: dict[int, tuple[float, float]], place: bool = False) -> str:
    marks = "".join(
        f'<g data-fa-point="{i}" data-fa-at="{x},{y}" aria-label="Point {i}">'
        f'<circle cx="{x}" cy="{y}" r="8" fill="#c8102e"/></g>'
        for i, (x, y) in points.items()
    )
    return (
        "<style>.photo{width:200px;height:150px;margin:20px;position:relative;background-size:100% 100%;"
        f"background-image:url(data:image/png;base64,{picture()})}}</style>"
        f'<div class="photo" data-fa-photo="{WIDTH}x{HEIGHT}"{" data-fa-place=1" * place}>'
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" width="200" height="150">{marks}</svg></div>'
    )


@dataclass
class Tiny:
    server: viser.ViserServer
    heard: list[script.Report] = field(default_factory=list)
    commands: list[str] = field(default_factory=list)
    here: dict[int, tuple[Any, dict[str, Any]]] = field(
        default_factory=dict
    )  # browsers, the newest last

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server.get_port()}/?fixedDpr=0.25"

    @property
    def script(self) -> Any:
        return list(self.here.values())[-1][0]

    @property
    def made(self) -> dict[str, Any]:
        return list(self.here.values())[-1][1]

    def of(self, kind: type) -> list[Any]:
        return [report for report in self.heard if isinstance(report, kind)]

    def show(self, points: dict[int, tuple[float, float]], place: bool = False) -> None:
        self.made["photo"].content = photo(points, place)


def tiny(port: int = 0) -> Tiny:
    page = Tiny(guard.start(port=port, keys=("distance", "theme", "text")))

    async def enter(client: viser.ClientHandle) -> None:
        made = {
            "slider": client.gui.add_slider("Slider", 0, 100, 1, 50),
            "name": client.gui.add_text("Name", ""),
            "photo": client.gui.add_html(photo({3: (100, 60)})),
            "copy": client.gui.add_html('<span data-fa-copy="faceambig fit">Copy command</span>'),
        }
        page.here[client.client_id] = script.Script(client.gui, page.heard.append), made
        page.script.theme("auto")
        # viser's own lights cost a shadow pass: seconds a picture where no graphics card helps
        client.scene.configure_default_lights(enabled=False)
        client.scene.configure_environment_map(None)
        client.scene.add_light_ambient("/light")
        for name, x in (("/one", -0.3), ("/two", 0.3)):
            client.scene.add_box(name, dimensions=(0.4, 0.4, 0.4), position=(x, 0, 0))
        command = client.gui.add_command("Jump", hotkey="J")

        async def jumped(_: object) -> None:
            page.commands.append("Jump")

        command.on_trigger(jumped)

    async def leave(client: viser.ClientHandle) -> None:
        page.here.pop(client.client_id, None)

    page.server.on_client_connect(enter)
    page.server.on_client_disconnect(leave)
    return page


@pytest.fixture(scope="module")
def server() -> Iterator[Tiny]:
    page = tiny()
    yield page
    page.server.stop()


@pytest.fixture(scope="module")
def page(server: Tiny, page_url: Callable[..., Page]) -> Page:
    return opened(server, page_url(server.url, 640, 400))


@pytest.fixture(autouse=True)
def _fresh(server: Tiny) -> None:
    server.heard.clear()
    server.commands.clear()


def opened(server: Tiny, page: Page) -> Page:
    assert until(lambda: server.of(script.Hello))
    page.locator("[data-fa-point]").wait_for(timeout=PATIENCE)
    page.wait_for_function(f"() => {BOXES}.every(v => v !== undefined)", timeout=PATIENCE)
    return page


def until(holds: Callable[[], Any], seconds: float = PATIENCE / 1000) -> Any:
    """The first true value of `holds`, or its last one."""
    end = time.monotonic() + seconds
    while not (value := holds()) and time.monotonic() < end:
        time.sleep(0.02)
    return value


@pytest.fixture
def visit(browser: Browser, server: Tiny) -> Iterator[Callable[..., Page]]:
    """Opens the page in a browser of its own kind: visit("&more=query", option of the context...)."""
    contexts = []

    def go(query: str = "", script: str = "", **options: Any) -> Page:
        settings: dict[str, Any] = {"viewport": {"width": 640, "height": 400}} | options
        contexts.append(browser.new_context(**settings))
        contexts[-1].set_default_timeout(PATIENCE)
        page = contexts[-1].new_page()
        if script:
            page.add_init_script(script)
        page.goto(server.url + query)
        return opened(server, page)

    others = len(server.here)
    yield go
    for context in contexts:
        context.close()
    assert until(lambda: len(server.here) == others)


# ---------------------------------------------------------------- the first word, the address, the look


# Keeps the theme of the first picture
FIRST = """new MutationObserver(() => { const s = document.documentElement.dataset.mantineColorScheme;
  if (s) window.first ??= s }).observe(document, { attributes: true, subtree: true, childList: true })"""


def test_hello_tells_what_the_server_must_know_and_theme_and_text_are_kept(
    server: Tiny, visit: Callable[..., Page]
) -> None:
    page = visit(
        "&distance=1.2",
        FIRST,
        reduced_motion="reduce",
        color_scheme="dark",
        has_touch=True,
        is_mobile=True,
    )
    hello = server.of(script.Hello)
    languages = tuple(page.evaluate("() => navigator.languages"))
    assert languages
    query = "fixedDpr=0.25&distance=1.2"
    assert hello == [script.Hello(query, True, True, True, None, None, languages)]
    assert page.evaluate("() => window.first") == "dark"  # nobody has chosen: as the system
    theme_and_text_live_and_kept(server, page)


def test_the_address_follows_without_history(server: Tiny, page: Page) -> None:
    entries = page.evaluate("history.length")
    server.script.address("distance=0.6&view=side")
    page.wait_for_function(
        "() => location.search === '?fixedDpr=0.25&distance=0.6&view=side'", timeout=PATIENCE
    )
    server.script.address("")
    page.wait_for_function("() => location.search === '?fixedDpr=0.25'", timeout=PATIENCE)
    assert page.evaluate("[history.length, location.hash]") == [entries, ""]


def theme_and_text_live_and_kept(server: Tiny, page: Page) -> None:
    scheme = "() => document.documentElement.dataset.mantineColorScheme"
    gui = server.made["slider"]._impl.gui_api
    steps: list[tuple[script.Theme, str]] = [
        ("auto", "dark"),
        ("light", "light"),
        ("dark", "dark"),
    ]
    for theme, seen in steps:  # as a server follows
        server.script.theme(theme)
        gui.configure_theme(dark_mode=script.is_dark(theme, server.of(script.Hello)[0].dark))
        page.wait_for_function(f"() => ({scheme})() === '{seen}'", timeout=PATIENCE)
    page.emulate_media(color_scheme="light")
    assert until(lambda: server.of(script.Dark)) == [script.Dark(False)]
    font = "() => parseFloat(getComputedStyle(document.querySelector('label')).fontSize)"
    small = page.evaluate(font)
    server.script.theme("dark", 1.5)
    page.wait_for_function(f"() => ({font})() >= {1.5 * small - 0.01}", timeout=PATIENCE)
    server.heard.clear()
    page.goto(server.url)
    opened(server, page)
    assert (server.of(script.Hello)[0].theme, server.of(script.Hello)[0].text) == ("dark", 1.5)


# ---------------------------------------------------------------- clipboard


def test_a_text_is_copied_and_that_is_told(server: Tiny, visit: Callable[..., Page]) -> None:
    page = visit(
        "&theme=light",
        FIRST,
        color_scheme="dark",
        permissions=["clipboard-read", "clipboard-write"],
    )
    assert page.evaluate("() => window.first") == "light"  # the address has chosen
    n = server.script.copy_link("distance=0.9")
    assert until(lambda: server.of(script.Copied)) == [script.Copied(n, True)]
    assert page.evaluate("navigator.clipboard.readText()") == (
        f"http://127.0.0.1:{server.server.get_port()}/?distance=0.9"
    )
    server.heard.clear()
    n = server.script.copy("a link & more")
    assert until(lambda: server.of(script.Copied)) == [script.Copied(n, True)]
    assert page.evaluate("navigator.clipboard.readText()") == "a link & more"
    server.script.keys(True)  # other data: the text is not copied once more
    button = page.get_by_role("button", name="Copy command")
    for key in ("Enter", None):
        server.heard.clear()
        page.evaluate("navigator.clipboard.writeText('')")
        button.press(key) if key else button.click()
        assert until(lambda: server.of(script.Copied)) == [script.Copied(0, True)]
        assert page.evaluate("navigator.clipboard.readText()") == "faceambig fit"


def test_without_a_clipboard_the_text_is_offered(server: Tiny, page: Page) -> None:
    page.evaluate(
        "() => { Object.defineProperty(navigator, 'clipboard', { value: undefined, configurable: true });"
        " document.execCommand = () => false }"
    )
    n = server.script.copy("by hand")
    assert until(lambda: server.of(script.Copied)) == [script.Copied(n, False)]
    field = page.get_by_label("Copy this text:")
    assert field.input_value() == "by hand"
    assert page.evaluate("document.activeElement.selectionEnd") == len("by hand")
    page.keyboard.press("Escape")
    field.wait_for(state="detached", timeout=PATIENCE)
    assert not server.of(script.Key)  # that Escape was the box's
    page.evaluate("() => { delete navigator.clipboard; delete document.execCommand }")


# ---------------------------------------------------------------- blink

WATCH = f"""() => {{ window.drawn = []; const scene = __viserMutable.scene, stock = scene.onAfterRender;
  scene.onAfterRender = function (...args) {{ stock.apply(this, args);
    if (window.drawn) window.drawn.push([performance.now(), ...{BOXES}]) }} }}"""


def test_blink_shows_one_at_a_time_in_every_picture(server: Tiny, page: Page) -> None:
    page.evaluate(WATCH)
    server.script.blink(["/one", "/two"])
    page.wait_for_function("() => window.drawn.some(d => !d[1] && d[2])", timeout=PATIENCE)
    page.evaluate("() => { drawn.length = 0 }")
    page.wait_for_timeout(2200)
    drawn = page.evaluate("() => { const d = drawn; window.drawn = null; return d }")
    assert all(one != two for _, one, two in drawn)
    cuts = [t for (_, a, _), (t, b, _) in itertools.pairwise(drawn) if a != b]
    assert 3 <= len(cuts) <= 5  # every half second
    server.script.address("distance=0.5")  # other data leave it alone
    page.keyboard.press("Escape")
    assert until(lambda: server.of(script.Key)) == [script.Key("Escape")]
    page.wait_for_function(f"() => {BOXES}.every(v => v)", timeout=PATIENCE)
    server.script.address("")
    page.wait_for_timeout(700)
    assert page.evaluate(BOXES) == [True, True]
    server.script.blink(["/one", "/two"])
    page.wait_for_function(f"() => !{BOXES}.every(v => v)", timeout=PATIENCE)
    server.script.blink([])
    page.wait_for_function(f"() => {BOXES}.every(v => v)", timeout=PATIENCE)


def test_with_reduced_motion_nothing_blinks(server: Tiny, page: Page) -> None:
    page.emulate_media(reduced_motion="reduce")
    server.script.blink(["/one", "/two"])
    page.wait_for_function(f"() => {BOXES}[1] === false", timeout=PATIENCE)
    page.wait_for_timeout(700)
    assert page.evaluate(BOXES) == [True, False]
    server.script.blink([])
    page.emulate_media(reduced_motion="no-preference")


# ---------------------------------------------------------------- points on the photograph


def middle(page: Page, index: int = 3) -> tuple[float, float]:
    left, top, width, height = page.evaluate(
        """i => { const b = document.querySelector(`[data-fa-point="${i}"] circle`).getBoundingClientRect();
        return [b.left, b.top, b.width, b.height] }""",
        index,
    )
    return left + width / 2, top + height / 2


def put(server: Tiny, page: Page, place: bool = False) -> None:
    """The photograph with point 3 at (100, 60), drawn anew."""
    server.show({9: (1, 1)})
    page.locator('[data-fa-point="9"]').wait_for(timeout=PATIENCE)
    server.show({3: (100, 60)}, place)
    page.locator('[data-fa-point="3"]').wait_for(timeout=PATIENCE)
    page.evaluate("document.activeElement.blur()")
    before = None
    while before != (before := middle(page)):  # viser lays its panels out over some frames
        page.evaluate(
            "() => new Promise(done => { let n = 5; const f = () => n-- ? requestAnimationFrame(f) : done(); f() })"
        )


def test_a_point_is_dragged_while_the_server_draws(server: Tiny, page: Page) -> None:
    put(server, page)
    x, y = middle(page)
    page.mouse.move(x + 1, y + 1)  # not its middle: it must not jump there
    page.mouse.down()
    for k in range(1, 21):
        page.mouse.move(x + 1 + 2 * k, y + 1 + k)
        if k == 10:
            assert middle(page) == pytest.approx((x + 20, y + 10), abs=0.6)
            late = server.of(script.Point)[-1:] or [script.Point(3, 100, 60, False)]
            server.show({3: (late[0].x, late[0].y)})  # an older place: it stays under the hand
            page.wait_for_timeout(100)
            assert middle(page) == pytest.approx((x + 20, y + 10), abs=0.6)
    page.mouse.up()
    last = script.Point(3, 180, 100, True)  # two pixels of the photograph for one of the page
    assert until(lambda: server.of(script.Point)[-1:] == [last])
    moves = server.of(script.Point)
    assert 2 <= len(moves) <= 20
    assert not any(p.done for p in moves[:-1])
    server.show({3: (180, 100)})
    assert until(lambda: np.allclose(middle(page), (x + 40, y + 20), atol=0.6))


def test_reports_of_a_drag_are_fifty_milliseconds_apart(server: Tiny, page: Page) -> None:
    put(server, page)
    x, y = middle(page)
    page.evaluate(
        "() => { window.times = []; const real = Worker.prototype.postMessage; Worker.prototype.postMessage = "
        "function (m) { if (m.message?.type === 'GuiUpdateMessage') times.push(performance.now());"
        " return real.apply(this, arguments) } }"
    )
    page.mouse.move(x, y)
    page.mouse.down()
    for k in range(60):
        page.mouse.move(x + k, y)
    page.mouse.up()
    assert until(lambda: server.of(script.Point) and server.of(script.Point)[-1].done)
    times = page.evaluate("times")
    # The last one does not wait; timers may come a hair early
    assert all(b - a > 45 for a, b in itertools.pairwise(times[:-1]))
    page.mouse.move(0, 0)


def test_a_point_by_keys(server: Tiny, page: Page) -> None:
    put(server, page)
    point = page.get_by_role("button", name="Point 3")
    point.focus()
    position = "__viserMutable.camera.position.toArray()"
    camera = page.evaluate(position)
    for key, (x, y) in {
        "ArrowRight": (101, 60),
        "Shift+ArrowDown": (101, 70),
        "Shift+ArrowLeft": (91, 70),
        "ArrowUp": (91, 69),
    }.items():
        page.keyboard.press(key)
        assert until(
            lambda x=x, y=y: server.of(script.Point)[-1:] == [script.Point(3, x, y, True)]
        ), key
    server.show({3: (91, 69)})
    page.wait_for_timeout(100)
    assert page.evaluate("document.activeElement.dataset.faPoint") == "3"  # of the new element
    page.keyboard.press("Delete")
    assert until(lambda: server.of(script.Gone)) == [script.Gone(3)]
    assert page.evaluate(position) == camera


def test_a_click_places_or_moves_the_chosen_point(server: Tiny, page: Page) -> None:
    put(server, page, place=True)
    box = page.locator("[data-fa-photo]").bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + 150, box["y"] + 30)
    assert until(lambda: server.of(script.Click)) == [script.Click(300, 60)]
    put(server, page)
    page.mouse.click(box["x"] + 150, box["y"] + 30)  # nothing is chosen
    page.mouse.click(*middle(page))
    assert page.evaluate("document.activeElement.dataset.faPoint") == "3"
    assert not server.of(script.Point)
    page.mouse.click(box["x"] + 20, box["y"] + 120)
    assert until(lambda: server.of(script.Point)) == [script.Point(3, 40, 240, True)]
    assert len(server.of(script.Click)) == 1


def test_a_magnifier_under_a_finger(server: Tiny, visit: Callable[..., Page]) -> None:
    page = visit(has_touch=True, viewport={"width": 800, "height": 600})
    put(server, page)
    touch = page.context.new_cdp_session(page)

    def finger(kind: str, *at: float) -> None:
        points = [{"x": at[0], "y": at[1]}] if at else []
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    loupe = page.locator(".fa-loupe")
    x, y = middle(page)
    finger("touchStart", x, y)
    loupe.wait_for(timeout=PATIENCE)
    finger("touchMove", x + 20, y + 30)
    assert until(lambda: server.of(script.Point))
    assert not server.of(script.Point)[-1].done  # the browser has not taken the finger to scroll
    box = loupe.bounding_box()
    assert box is not None
    assert not (
        box["x"] <= x + 20 <= box["x"] + box["width"]
        and box["y"] <= y + 30 <= box["y"] + box["height"]
    )
    shot = np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB")).astype(int)
    cx, cy = round(box["x"] + box["width"] / 2), round(box["y"] + box["height"] / 2)
    a, b = shot[cy + 30, cx - 30], shot[cy + 30, cx + 30]  # beside the cross
    # 60 pixels of the page are 20 of the small picture, 40 of the photograph; red runs over 255 in 400
    assert b[0] - a[0] == pytest.approx(40 * 255 / WIDTH, abs=3)
    assert (a[0] + b[0]) / 2 == pytest.approx(140 * 255 / WIDTH, abs=3)
    finger("touchEnd")
    assert until(lambda: [p for p in server.of(script.Point) if p.done]) == [
        script.Point(3, 140, 120, True)
    ]
    assert until(lambda: loupe.count() == 0)


# ---------------------------------------------------------------- keys


def test_single_keys_do_not_fire_in_a_field_and_can_be_switched_off(
    server: Tiny, page: Page
) -> None:
    page.evaluate("document.activeElement.blur()")
    page.keyboard.press("j")
    assert until(lambda: server.commands == ["Jump"])
    page.get_by_label("Name").fill("")
    page.get_by_label("Name").press_sequentially("jj")
    assert until(lambda: server.made["name"].value == "jj")
    server.script.keys(False)
    page.wait_for_timeout(200)
    page.get_by_label("Name").press("j")
    assert until(lambda: server.made["name"].value == "jjj")  # a field is typed into all the same
    page.evaluate("document.activeElement.blur()")
    page.keyboard.press("j")
    page.get_by_role("slider").focus()
    page.keyboard.press("j")
    page.keyboard.press("ArrowRight")
    assert until(lambda: server.made["slider"].value == 51)
    assert server.commands == ["Jump"]
    server.script.keys(True)
    page.wait_for_timeout(200)
    page.keyboard.press("j")
    assert until(lambda: server.commands == ["Jump", "Jump"])


def test_data_come_while_the_panel_is_folded(server: Tiny, page: Page) -> None:
    panel = server.made["slider"]._impl.gui_api.main_panel
    panel.minimize()
    page.get_by_role("slider").wait_for(state="detached", timeout=PATIENCE)
    server.script.address("distance=0.7")
    page.wait_for_function("() => location.search.endsWith('distance=0.7')", timeout=PATIENCE)
    page.keyboard.press("Escape")
    assert until(lambda: server.of(script.Key))
    server.script.address("")
    panel.expand()
    page.get_by_role("slider").wait_for(timeout=PATIENCE)


# ---------------------------------------------------------------- reports that are none


def test_nonsense_is_dropped_with_one_line(
    server: Tiny, page: Page, caplog: pytest.LogCaptureFixture
) -> None:
    uuid = server.script._data["report"]["uuid"]
    for text in (
        "{",
        "[]",
        '{"gone": -1}',
        '{"point": {"index": 1}}',
        "x" * (guard.MAX_REPORT + 1),
        json.dumps({}),
    ):
        page.evaluate(
            "([uuid, value]) => __viserMutable.sendMessage({ type: 'GuiUpdateMessage', uuid, updates: { value } })",
            [uuid, text],
        )
    page.keyboard.press("Escape")
    assert until(lambda: server.heard) == [script.Key("Escape")]
    lines = [record.getMessage() for record in caplog.records]
    assert len(lines) == 2  # of the script, and of the guard for what was too long
    assert all(line.startswith("page: ") and len(line) < 260 for line in lines)


# ---------------------------------------------------------------- the connection


def test_a_lost_connection_is_said_and_the_state_comes_back(browser: Browser) -> None:
    first = tiny()
    port = first.server.get_port()
    context = browser.new_context(viewport={"width": 640, "height": 400})
    context.set_default_timeout(PATIENCE)
    page = context.new_page()
    page.goto(first.url + "&distance=0.3")
    opened(first, page)
    assert page.get_by_role("status").inner_text() == ""
    first.script.address("distance=0.9")
    page.wait_for_function("() => location.search.endsWith('=0.9')", timeout=PATIENCE)
    first.server.stop()
    page.get_by_text("Connection lost. Your state is kept; reconnecting...").wait_for(
        timeout=PATIENCE
    )
    second = tiny(port)
    try:
        page.get_by_text("Back. Nothing was lost.").wait_for(timeout=PATIENCE)
        assert until(lambda: second.of(script.Hello))
        assert second.of(script.Hello)[0].query == "fixedDpr=0.25&distance=0.9"
        page.wait_for_function(
            "() => document.querySelector('.fa-status').textContent === ''", timeout=PATIENCE
        )
    finally:
        context.close()
        second.server.stop()
