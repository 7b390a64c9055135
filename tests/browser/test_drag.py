"""No frame without a head while a hand drags, the heat map on: the canvas is read in every frame that is shown."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from visitor import FRAMES, Visitor

pytestmark = pytest.mark.browser

# Of every picture the pixels that differ from the ground (the corner) by more than 40 of 255 in any channel: in the
# left half of the canvas and in the right one, and of these how many have a hot colour of the legend: the skin is less
# red, and a mesh without colours of its own is blue. viser's canvas keeps what was drawn, so what is read at the start
# of a frame is what a person has seen until then.
WATCH = """() => {
  const gl = __viserMutable.canvas.getContext("webgl2"), told = [];
  const w = gl.drawingBufferWidth, h = gl.drawingBufferHeight, data = new Uint8Array(4 * w * h);
  const look = () => {
    gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, data);
    let left = 0, right = 0, hot = 0, sum = 0;
    for (let i = 0; i < data.length; i += 4) {
      const [r, g, b] = [data[i], data[i + 1], data[i + 2]];
      sum = (31 * sum + r + 3 * g + 7 * b) % 4294967291;
      if (Math.max(Math.abs(r - data[0]), Math.abs(g - data[1]), Math.abs(b - data[2])) <= 40) continue;
      if ((i / 4) % w < w / 2) { left++; continue }
      right++;
      if (r - b > 100) hot++;
    }
    told.push([left, right, hot, sum]);
    if (window.faceambigWatched === told) requestAnimationFrame(look);
  };
  window.faceambigWatched = told; requestAnimationFrame(look) }"""
WATCHED = (
    "() => { const told = window.faceambigWatched; window.faceambigWatched = null; return told }"
)
STEPS = 20  # of the mouse on the slider, 60 ms apart: a message each
SHARE = 0.7  # of a head's first pixels: from 20 cm to 2 m it grows, and nothing hides it


@pytest.fixture(scope="module")
def me(visit: Callable[..., Visitor]) -> Visitor:
    """A browser with the heat map on; its canvas is so small that it is read in a millisecond."""
    return visit(query="show=difference")


def drag(me: Visitor, during: Callable[[], Any] = lambda: None) -> np.ndarray:
    """The assumed distance from its near end on, and rest: (F, 4) of every frame meanwhile, what WATCH tells.

    `during` is called in the middle of the way.
    """
    slider = me.slider("Assumed distance")
    slider.focus()
    me.tab.keyboard.press("Home")
    me.until(lambda: me.state.distance == 0.2, "Home does not arrive")
    me.rest()
    box = slider.bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    me.tab.evaluate(WATCH)
    me.tab.mouse.move(x, y)
    me.tab.mouse.down()
    for step in range(STEPS):
        if step == STEPS // 2:
            during()
        me.tab.mouse.move(x + 8 * (step + 1), y)
        me.tab.wait_for_timeout(60)
    me.tab.mouse.up()
    me.until(lambda: me.state.distance > 1.0, "the drag does not arrive")
    me.rest()
    return np.array(me.tab.evaluate(WATCHED))


def blank(seen: np.ndarray) -> list[int]:
    """The frames in which a head, or its colours, were not there."""
    assert (seen[0, :3] > 500).all(), seen[
        0
    ]  # two heads and a heat map: there is something to lose
    return np.flatnonzero((seen[:, :3] < SHARE * seen[0, :3]).any(axis=1)).tolist()


def test_no_frame_is_blank_while_a_hand_drags_with_the_heat_map_on(me):
    seen = drag(me)
    assert len(set(seen[:, 3])) > 5  # the heads have moved before our eyes
    assert blank(seen) == [], seen[blank(seen)]


def test_a_head_that_is_taken_out_and_put_back_is_seen_as_a_blank_frame(me):
    """Were a mesh replaced and not changed, this is what would be seen: the test above can fail."""

    def take_out() -> None:
        room = me.browser.room
        me.until(lambda: room._drawn == (room._changed_at, False), "the hand does not rest")
        with me.browser._client.atomic():
            me.browser.stage._heads.pop("fit").remove()
        me.browser._client.flush()
        me.tab.wait_for_function("() => !__viserMutable.nodeRefFromName['/fit/head']")
        me.tab.evaluate(FRAMES)

    seen = drag(me, take_out)
    assert blank(seen) != []
    assert len(seen) - 1 not in blank(seen)  # the next value has put it back


def test_no_frame_is_blank_while_two_heads_blink(me):
    """Both stand in the middle, so what is in the two halves is one head."""
    me.goes(show="blink")
    me.tab.evaluate(WATCH)
    me.tab.wait_for_function(
        "() => faceambigWatched.length > 8 && new Set(faceambigWatched.map(frame => frame[3])).size > 1"
    )
    seen = np.array(me.tab.evaluate(WATCHED))
    sizes = seen[:, 0] + seen[:, 1]
    assert sizes.max() > 1000
    assert sizes.min() > SHARE * sizes.max()
    me.tab.keyboard.press("Escape")
    me.until(lambda: me.state.show == "both", "Escape does not stop it")
