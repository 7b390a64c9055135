"""A person with a browser, for tests of the page: what is read comes from the page, and every wait has a condition."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pytest
from playwright.sync_api import Page as Tab

from faceambig_app import server
from faceambig_app.state import DEFAULT, ViewState, changed
from faceambig_app.state.history import History
from faceambig_app.state.link import query

PATIENCE = 90_000  # milliseconds until something is seen: other tests share the processors
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
SEEN = "name => { const n = __viserMutable.nodeRefFromName[name]; return n !== undefined && n.visible }"
FRAMES = "() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"


class Visitor:
    """A browser at a page that is served by this process; `tab` has been sent there."""

    def __init__(self, tab: Tab, served: server.Page, known: Iterable[int] = ()) -> None:
        self.tab, self.served = tab, served
        self.find(known)
        tab.wait_for_selector(".fa-plot", state="attached", timeout=PATIENCE)
        self.rest()

    def find(self, known: Iterable[int]) -> None:
        """The server's side of this browser: the one that was not there before."""
        before = set(known)
        self.until(lambda: set(self.served._browsers) - before, "no browser came")
        self.number = max(set(self.served._browsers) - before)
        self.browser = self.served._browsers[self.number]

    @property
    def state(self) -> ViewState:
        """As the server has it."""
        return self.browser.room.state

    def until(self, what: Callable[[], Any], words: str) -> None:
        end = time.monotonic() + PATIENCE / 1000
        while not what():
            assert time.monotonic() < end, words
            self.tab.wait_for_timeout(40)

    def rest(self) -> None:
        """Until the page has all of the newest state: the address comes last, the faces in the next pictures."""
        self.until(self._rests, "the page does not come to rest")

    def _rests(self) -> bool:
        room, state = self.browser.room, self.state
        if room._drawn != (room._changed_at, False):
            return False
        search = self.tab.evaluate("() => location.search")
        if re.sub(r"^\??(fixedDpr=[0-9.]*&?)?", "", search) != query(state):
            return False
        for name, nodes in self.browser.stage._heads.items():
            shown = self.tab.evaluate(MESH, [f"/{name}/head", None])
            wanted = nodes._full.vertices
            if shown is None or shown[0] != len(wanted):
                return False
            if not np.allclose(shown[1], wanted[::37], atol=1e-6):
                return False
        self.tab.evaluate(FRAMES)
        return self.state == state

    def do(self, change: Callable[[], Any]) -> None:
        """Something on the server's loop, as a message of the browser would."""
        self.browser._loop.call_soon_threadsafe(change)

    def goes(self, **values: object) -> None:
        """To the state with other values, drawn in full."""
        self.do(lambda: self.browser.change(lambda state: changed(state, **values)))
        self.until(lambda: self.state == changed(self.state, **values), str(values))
        self.rest()

    def start_again(self) -> None:
        """The first state with an empty past, nothing focused or in the way, the first tab."""
        self.tab.evaluate("() => document.activeElement?.blur()")
        self.close_notices()
        self.tab.mouse.move(2, 2)
        self.do(lambda: self.browser._travel(History(DEFAULT)))
        self.until(lambda: self.state == DEFAULT and not self.browser._history.past, "no start")
        self.rest()
        explore = self.tab.get_by_role("tab", name="Explore", exact=True)
        if explore.get_attribute("aria-selected") != "true":
            explore.click()

    def close_notices(self) -> None:
        """Notices stand over the scene, and a pointer that goes down on one turns nothing."""
        close = """() => { const all = document.querySelectorAll(".mantine-Notification-closeButton");
            all.forEach(button => button.click()); return all.length }"""
        self.until(lambda: self.tab.evaluate(close) == 0, "a notice does not close")

    def mesh(self, name: str, rows: list[int] | None = None) -> np.ndarray:
        """(n, 3) positions on the page's graphics card: every 37th vertex, or `rows`."""
        return np.array(self.tab.evaluate(MESH, [name, rows])[1])

    def n_vertices(self, name: str) -> int:
        return self.tab.evaluate(MESH, [name, []])[0]

    def camera(self) -> dict[str, Any]:
        return self.tab.evaluate(CAMERA)

    def place(self, name: str) -> np.ndarray:
        return np.array(self.tab.evaluate(PLACE, name))

    def numbers(self) -> tuple[float, float]:
        """d_L in percent and d_S in millimetres, as read on the cards."""
        texts = self.tab.locator(".fa-card span").all_inner_texts()
        d_l, d_s = (float(re.sub(r"[^0-9.]", "", text)) for text in texts[:2])
        return d_l, d_s

    def slider(self, name: str) -> Any:
        return self.tab.get_by_role("slider", name=name, exact=True)

    def press_on(self, slider: Any, *keys: str) -> None:
        """Keys on a slider, each when the one before has been seen: a browser that draws slowly loses none."""
        for key in keys:
            slider.focus()
            before = slider.get_attribute("aria-valuenow")
            self.tab.keyboard.press(key)
            self.until(
                lambda b=before: slider.get_attribute("aria-valuenow") != b, f"{key} is lost"
            )

    def open(self, folder: str) -> None:
        head = self.tab.get_by_role("button", name=folder, exact=True)
        if head.get_attribute("aria-expanded") != "true":
            head.click()

    def centimetres(self) -> float:
        return float(self.tab.get_by_label("Distance (cm)").input_value() or "nan")

    def type_distance(self, text: str) -> None:
        box = self.tab.get_by_label("Distance (cm)")
        box.fill(text)
        box.press("Tab")

    def drag(self, slider: Any, to: float) -> None:
        """A slider's thumb by the mouse to a share of its track."""
        slider.scroll_into_view_if_needed()
        track = slider.evaluate(
            "e => { const b = e.closest('.mantine-Slider-trackContainer, .mantine-Slider-root')"
            ".querySelector('.mantine-Slider-track').getBoundingClientRect(); return [b.x, b.width] }"
        )
        box = slider.bounding_box()
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        end = track[0] + to * track[1]
        self.tab.mouse.move(x, y)
        self.tab.mouse.down()
        self.tab.mouse.move(end, y, steps=10)
        self.tab.mouse.up()

    def canvas(self) -> Any:
        return self.tab.locator("canvas[data-engine]").bounding_box()


def give_up(words: str) -> NoReturn:
    """A skip with its reason; where CI=true, a failure."""
    if os.environ.get("CI") == "true":
        pytest.fail(words, pytrace=False)
    pytest.skip(words)


def artefacts(tmp: Path) -> Path:
    """Where pictures to be looked at go: the folder FACEAMBIG_ARTEFACTS, or one of the test's own."""
    folder = Path(os.environ.get("FACEAMBIG_ARTEFACTS") or tmp)
    folder.mkdir(parents=True, exist_ok=True)
    return folder
