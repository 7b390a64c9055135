"""A class in Chromium: who leads at a desk with the room's code on screen, and a follower on a phone."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from faceambig_app import server
from faceambig_app.text import say
from visitor import PATIENCE, Visitor, artefacts

pytestmark = [pytest.mark.browser, pytest.mark.slow]
# Pixels of the picture's own; percents are of the diagonal of its frame, by the square root of two
WIDTH = """e => { const width = getComputedStyle(e).strokeWidth, frame = e.ownerSVGElement.viewBox.baseVal;
  return parseFloat(width) * (width.endsWith("%") ? Math.hypot(frame.width, frame.height) / Math.SQRT2 / 100 : 1) }"""


@pytest.fixture(scope="module")
def served() -> Iterator[server.Page]:
    """The page of a class."""
    page = server.Page("127.0.0.1", 0, lead="a-secret-of-the-teacher-1")
    yield page
    page.close()


def follows(me: Visitor) -> Any:
    return me.tab.get_by_text(say("class.follows"), exact=True)


def test_a_phone_follows_goes_alone_and_comes_back(visit, served, tmp_path: Path):
    folder = artefacts(tmp_path)
    secret = served.leader_link.partition("?")[2]
    leader = visit(1280, 800, secret, dpr=1)
    assert "lead" not in leader.tab.url
    phone = visit(390, 844, has_touch=True, is_mobile=True, dpr=1)
    follows(phone).wait_for(timeout=PATIENCE)

    # The code: small in the panel, large on a press, and still open when somebody comes
    leader.tab.get_by_role("button", name=say("class.larger")).click()
    large = leader.tab.locator("#fa-room")
    large.wait_for(timeout=PATIENCE)
    assert large.locator("svg").bounding_box()["width"] > 500
    leader.tab.screenshot(path=folder / "class-code.png")
    assert served.links[0] in large.inner_text()
    leader.tab.keyboard.press("Escape")
    large.wait_for(state="hidden", timeout=PATIENCE)

    leader.press_on(leader.slider("Assumed distance"), "Home")
    phone.until(lambda: phone.state.distance == leader.state.distance, "the phone does not follow")
    phone.rest()

    leader.do(lambda: leader.browser.change(leader.browser._lessons.chosen(1)))
    leader.do(lambda: leader.browser.act("lesson_next"))  # a question
    answers = say("class.answers", count=0, present=1)
    leader.tab.get_by_text(answers, exact=True).wait_for(timeout=PATIENCE)
    phone.until(lambda: phone.state.step == 2, "the phone is not in the lesson")
    lesson = phone.browser._lessons._lessons.by_number[1]
    choice = phone.tab.get_by_role("button", name=lesson.steps[1].ask.choices[0], exact=True)
    choice.tap()
    leader.tab.get_by_text(say("class.answers", count=1, present=1), exact=True).wait_for(
        timeout=PATIENCE
    )
    leader.rest()
    phone.rest()
    leader.tab.screenshot(path=folder / "class-leader.png")
    phone.tab.screenshot(path=folder / "class-phone.png")
    assert "numbers" in phone.state.hide

    leader.tab.keyboard.press("v")
    phone.until(lambda: "numbers" not in phone.state.hide, "the key reveals nothing")
    leader.tab.screenshot(path=folder / "class-revealed.png")
    follows(phone).wait_for(timeout=PATIENCE)
    tick = phone.tab.get_by_role("checkbox", name=say("class.explore"), exact=True)
    again = phone.tab.get_by_role("button", name=say("class.again"), exact=True)
    assert not again.is_visible()
    tick.tap()
    again.wait_for(timeout=PATIENCE)
    leader.do(lambda: leader.browser.act("side"))
    leader.rest()
    assert phone.state.view != leader.state.view
    phone.rest()
    phone.tab.screenshot(path=folder / "class-alone.png")
    again.tap()
    phone.until(lambda: phone.state.view == leader.state.view, "it does not come back")
    phone.until(lambda: not tick.is_checked(), "the tick stays")
    phone.do(
        lambda: phone.browser.act("front")
    )  # whoever changes something is alone, and the tick says so
    phone.until(tick.is_checked, "no tick")
    tick.tap()
    phone.until(lambda: phone.state.view == leader.state.view, "the tick does not lead back")
    a_note_stands_on_all_screens(leader, phone, folder)
    leader.tab.goto("about:blank")
    phone.tab.get_by_text(say("class.gone"), exact=True).wait_for(timeout=PATIENCE)
    leader.tab.goto(served.leader_link)
    follows(phone).wait_for(timeout=PATIENCE)


def a_note_stands_on_all_screens(leader: Visitor, phone: Visitor, folder: Path) -> None:
    """What who leads types, across the scene there and in the sheet of a phone; lines are thicker where it is led."""
    words = "In pairs: what would have to be true for your guess to be right?"
    leader.tab.get_by_label(say("class.note"), exact=True).fill(words)
    strips: list[Any] = [each.tab.locator(".fa-note") for each in (leader, phone)]
    for strip in strips:
        strip.get_by_text(words).wait_for(timeout=PATIENCE)
    scene, across = leader.canvas(), strips[0].bounding_box()
    assert across["x"] >= scene["x"]
    assert across["x"] + across["width"] <= scene["x"] + scene["width"]
    assert across["y"] + across["height"] <= 800
    in_sheet = strips[1].bounding_box()
    assert in_sheet["x"] >= 0
    assert in_sheet["x"] + in_sheet["width"] <= 390
    for each in (leader, phone):
        each.rest()  # plots are written anew at rest: what was found before is no part of the page any more
    for part in (".fa-plot polyline", ".fa-photo use"):
        thick, thin = (each.tab.locator(part).first.evaluate(WIDTH) for each in (leader, phone))
        assert thick > 1.4 * thin, part
    bars = [each.browser.stage._heads["fit"]._bar.thickness for each in (leader, phone)]
    assert bars[0] == 1.5 * bars[1]
    leader.tab.screenshot(path=folder / "class-note.png")
    phone.tab.screenshot(path=folder / "class-note-phone.png")
    leader.tab.get_by_label(say("class.note"), exact=True).fill("")
    for strip in strips:
        strip.wait_for(state="detached", timeout=PATIENCE)
