"""A learner in Chromium goes through the lessons from start to end: by mouse, by touch on a phone, by keyboard alone.

What is done comes from the lessons' files. FACEAMBIG_LESSONS=all takes every lesson both ways, some minutes.
Pictures of every step are in FACEAMBIG_ARTEFACTS.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from faceambig_app.lessons import Lesson, Step, lessons
from faceambig_app.state import changed
from faceambig_app.text import say
from visitor import Visitor, artefacts

pytestmark = [pytest.mark.browser, pytest.mark.slow]

ALL = lessons().by_number
EVERY = os.environ.get("FACEAMBIG_LESSONS") == "all"
PHONE = {"width": 390, "height": 844, "has_touch": True, "is_mobile": True}
# What is cut off, or makes the page or the panel scroll sideways
CUT = """() => { const cut = [], root = document.documentElement;
  if (root.scrollWidth > root.clientWidth) cut.push(`page: ${root.scrollWidth} in ${root.clientWidth}`);
  for (const e of document.querySelectorAll('.fa-lesson, .fa-lesson *, .mantine-Button-label'))
    if (e.checkVisibility() && e.clientWidth > 2 && e.scrollWidth > e.clientWidth + 1)
      cut.push(`${e.textContent}: ${e.scrollWidth} in ${e.clientWidth}`);
  for (const e of document.querySelectorAll('.fa-lesson, .fa-tasks li, button')) {
    const box = e.getBoundingClientRect();
    if (e.checkVisibility() && (box.left < -0.5 || box.right > innerWidth + 0.5)) cut.push(e.textContent) }
  for (const e of document.querySelectorAll('.mantine-ScrollArea-viewport'))
    if (e.scrollWidth > e.clientWidth + 1) cut.push(`sideways: ${e.scrollWidth} in ${e.clientWidth}`);
  return cut }"""
# What is red in the lesson: letters, borders, grounds. The brown of the surface difference is not there
RED = """() => { const red = [];
  for (const e of document.querySelectorAll('.fa-lesson, .fa-lesson *, .mantine-Notification-root')) {
    const style = getComputedStyle(e), widths = style.borderLeftWidth;
    for (const colour of [style.color, style.backgroundColor, widths === '0px' ? '' : style.borderLeftColor]) {
      const [r, g, b, a] = (colour.match(/[0-9.]+/g) ?? []).map(Number);
      if (e.checkVisibility() && a !== 0 && r - Math.max(g, b) > 60 && g < 110)
        red.push(`${colour}: ${e.textContent}`) } }
  return red }"""
# Whether a pointer at the middle of an element reaches it, wholly inside the window
REACHED = """e => { const box = e.getBoundingClientRect(), x = box.x + box.width / 2, y = box.y + box.height / 2;
  const at = document.elementFromPoint(x, y);
  return box.left >= 0 && box.right <= innerWidth && box.top >= 0 && box.bottom <= innerHeight
    && (e.contains(at) || at?.contains(e)) }"""


class Hand:
    """A mouse, or a finger."""

    def __init__(self, me: Visitor, finger: bool) -> None:
        self.me, self.finger = me, finger

    def press(self, name: str) -> None:
        button = self.me.tab.get_by_role("button", name=name, exact=True).locator("visible=true")
        self.reach(button.first)
        self.hit(button.first)

    def hit(self, element: Any) -> None:
        element.tap() if self.finger else element.click()

    def reach(self, element: Any) -> None:
        """Bring it into view; nothing may lie over it."""
        element.scroll_into_view_if_needed()
        self.me.until(lambda: element.evaluate(REACHED), f"out of reach: {element}")

    def slide(self, slider: Any, share: float) -> None:
        self.reach(slider)
        if not self.finger:
            self.me.drag(slider, share)
            return
        track = slider.locator(
            "xpath=ancestor::*[contains(@class, 'mantine-Slider-trackContainer')]"
        )
        box = track.bounding_box()
        track.tap(position={"x": share * box["width"], "y": box["height"] / 2}, force=True)

    def begin(self, lesson: Lesson) -> None:
        box = self.me.tab.get_by_label(say("field.lesson"), exact=True).first
        option = self.me.tab.get_by_role("option", name=f"{lesson.number} {lesson.title}")
        self.me.rest()  # the words of a lesson that was left would move away under the finger
        self.hit(box)
        self.hit(option)

    def guess(self, step: Step) -> str:
        assert step.ask is not None
        if step.ask.number is None:
            wrong = next(
                words for words in step.ask.choices if not step.ask.answer.startswith(words)
            )
            self.press(wrong)
            return wrong
        unit = step.ask.number.unit
        self.me.tab.get_by_label(say("lesson.number", unit=unit)).fill("7")
        self.press(say("lesson.say"))
        return f"7 {unit}"

    def seen(self, elements: Any) -> Any:
        """The first that is not hidden."""
        return elements.locator("visible=true").first

    def do(self, task: str) -> None:
        """What a lesson's condition asks for, as a person would do it."""
        tab = self.me.tab
        first = re.match(r"([a-z_]+)(\d*) (\S+) (\S+)", task)
        assert first is not None, task
        name, _, sign, value = first.groups()
        high = sign in (">", ">=")
        match name:
            case "distance":
                self.slide(
                    self.seen(tab.get_by_role("slider", name=say("field.distance"))),
                    1.0 if high else 0.0,
                )
            case "actual":
                share = 0.95 if high else 0.08  # 0.2 to 5 m, logarithmic
                self.slide(self.seen(tab.get_by_role("slider", name=say("field.actual"))), share)
            case "flex":
                slider = self.seen(tab.get_by_role("slider", name=re.compile("^A: ")))
                self.slide(slider, 1.0 if high else 0.0)
            case "view":
                self.press(say(f"view.{value}"))
            case "data":
                self.press(say(f"data.{value}"))
            case "overlays":
                self.press(say(f"action.{value}"))
            case "extreme":
                self.press(say("action.extremes"))
            case "draw":
                for k in range(int(value) + 1):
                    self.press(say("action.draw"))
                    self.me.until(lambda k=k: self.me.state.draw == k, "no draw")
            case _:
                raise AssertionError(f"a learner does not know how to do {task}")


def conditions(lesson: Lesson) -> list[list[str]]:
    """Of each step the conditions as the file has them."""
    path = Path(__file__).parents[2] / "assets" / "lessons" / "en" / f"{lesson.name}.md"
    front = path.read_text(encoding="utf-8").partition("\n+++\n")[0]
    return [re.findall(r'when = "(.*?)"', part) for part in front.split("[[steps]]")[1:]]


def go_through(me: Visitor, lesson: Lesson, hand: Any, name: str, folder: Path) -> None:
    """Every step from the first to the last, looked at before and after."""
    text = me.tab.locator(".fa-lesson").first
    for number, (step, tasks) in enumerate(zip(lesson.steps, conditions(lesson), strict=True), 1):
        me.tab.get_by_text(
            say("lesson.step", number=number, count=len(lesson.steps), title=step.title)
        ).wait_for()
        if step.ask is not None:
            me.rest()
            asked(me, step)
            look(me, f"{name}_{lesson.number}_{number}_asked", folder)
            said = hand.guess(step)
            text.get_by_text(say("lesson.said", words=said)).wait_for()
            assert me.tab.evaluate(RED) == []
            assert words_of(step.answered) in words_of(text.inner_text())
            me.until(
                lambda: (
                    "numbers" not in me.state.hide
                    and ("truth" in me.state.hide or "?" not in cards(me))
                ),
                "the numbers stay hidden",
            )
        for k, task in enumerate(tasks):
            assert text.locator(".fa-done").count() == k
            hand.do(task)
            me.until(lambda k=k: text.locator(".fa-done").count() == k + 1, f"no tick: {task}")
        me.rest()
        look(me, f"{name}_{lesson.number}_{number}", folder)
        if number < len(lesson.steps):
            hand.press(say("action.lesson_next"))
    hand.press(say("action.lesson_leave"))
    me.until(lambda: me.state.lesson is None, "the lesson does not end")
    text.wait_for(state="detached")


def asked(me: Visitor, step: Step) -> None:
    """Before the answer nothing is told that comes after it; the numbers, where the step hides them, are nowhere."""
    text = words_of(me.tab.locator(".fa-lesson").first.inner_text())
    assert words_of(step.answered) not in text
    assert me.tab.locator(".fa-tasks").count() == 0
    if "numbers" in step.state.hide:
        assert cards(me).count("?") == 2
        assert me.tab.locator(".fa-plot polyline").count() == 0
        spoken = me.tab.locator(".fa-spoken")  # a moment after the page has come to rest
        me.until(
            lambda: not re.search(r"error \d|difference \d", " ".join(spoken.all_inner_texts())),
            "what is hidden is spoken",
        )


def cards(me: Visitor) -> str:
    """The two large numbers."""
    return " ".join(me.tab.locator(".fa-card span").all_inner_texts()[:2])


def words_of(text: str) -> str:
    """The words alone, without Markdown and line ends."""
    return " ".join(text.replace("*", "").split())


def look(me: Visitor, name: str, folder: Path) -> None:
    assert me.tab.evaluate(CUT) == [], name
    head = me.tab.locator(".fa-lesson h1").first
    head.scroll_into_view_if_needed()
    me.tab.screenshot(
        path=folder / f"lesson_{name}.png", style=".mantine-Notifications-root { display: none }"
    )


@pytest.fixture(scope="module")
def desk(visit: Callable[..., Visitor]) -> Hand:
    """A mouse at a desk."""
    size = {"width": 1440, "height": 900, "dpr": 0.4} if EVERY else {}
    return Hand(visit(**size), finger=False)


@pytest.fixture(scope="module")
def phone(visit: Callable[..., Visitor]) -> Hand:
    """A finger on a phone."""
    return Hand(visit(**PHONE), finger=True)


@pytest.mark.parametrize("number", sorted(ALL) if EVERY else [1])
def test_a_lesson_by_mouse(desk, tmp_path, number):
    desk.begin(ALL[number])
    go_through(desk.me, ALL[number], desk, "desktop", artefacts(tmp_path))


@pytest.mark.parametrize("number", sorted(ALL) if EVERY else [2])
def test_a_lesson_by_touch_on_a_phone(phone, tmp_path, number):
    phone.begin(ALL[number])
    go_through(phone.me, ALL[number], phone, "phone", artefacts(tmp_path))


def test_a_finger_moves_the_sheet_and_finds_the_slider_beside_the_words(phone):
    me, slider = phone.me, say("field.distance")
    phone.begin(ALL[1])
    me.until(lambda: me.state.lesson == 1, "the lesson is not chosen")
    me.do(lambda: me.browser.change(lambda state: changed(state, step=3)))
    me.tab.locator(".fa-tasks").first.wait_for()
    at = phone.seen(me.tab.get_by_role("slider", name=slider)).bounding_box()
    words = me.tab.locator(".fa-tasks").first.bounding_box()
    assert 0 < at["y"] - words["y"] < 150  # seen with the words, and above the photograph
    sheet = me.tab.locator(".fa-lesson").first
    before = sheet.bounding_box()["y"]
    send = me.tab.context.new_cdp_session(me.tab).send
    start = round(words["y"]) + 8  # on words: a slider would move
    moves = (("Move", y) for y in range(start - 10, start - 350, -20))
    for kind, y in (("Start", start), *moves, ("End", 0)):
        points = [] if kind == "End" else [{"x": 195, "y": y}]
        send("Input.dispatchTouchEvent", {"type": f"touch{kind}", "touchPoints": points})
    me.until(lambda: sheet.bounding_box()["y"] < before - 200, "the sheet does not follow")
    me.do(lambda: me.browser.act("lesson_leave"))
    me.until(lambda: me.state.lesson is None, "the lesson does not end")
    me.rest()


class Keys(Hand):
    """A keyboard and nothing else."""

    def __init__(self, me: Visitor) -> None:
        super().__init__(me, finger=False)

    def tab_to(self, element: Any) -> None:
        """Tab until it has the focus, as a person does who sees where the focus is."""
        wanted = element.element_handle()
        for _ in range(150):
            self.me.tab.keyboard.press("Tab")
            if self.me.tab.evaluate("e => document.activeElement === e", wanted):
                return
        raise AssertionError(f"no Tab leads to {element}")

    def press(self, name: str) -> None:
        self.tab_to(self.me.tab.get_by_role("button", name=name, exact=True).first)
        self.me.tab.keyboard.press("Enter")

    def slide(self, slider: Any, share: float) -> None:
        self.tab_to(slider)
        self.me.tab.keyboard.press("End" if share > 0.5 else "Home")

    def begin(self, lesson: Lesson) -> None:
        self.tab_to(self.me.tab.get_by_label(say("field.lesson"), exact=True).first)
        option = self.me.tab.get_by_role("option", name=f"{lesson.number} {lesson.title}")
        for _ in range(8):
            self.me.tab.keyboard.press("ArrowDown")
            self.me.tab.wait_for_timeout(400)  # the list opens, and moves
            if option.get_attribute("data-combobox-selected") == "true":
                break
        self.me.tab.keyboard.press("Enter")


def test_lesson_1_by_keyboard_alone(visit, tmp_path):
    me = visit()
    hand = Keys(me)
    before = me.camera()
    hand.begin(ALL[1])
    me.until(lambda: me.state.lesson == 1, "the lesson is not chosen")
    me.tab.mouse.move = lambda *_, **__: pytest.fail("a mouse")  # type: ignore[method-assign]
    go_through(me, ALL[1], hand, "keys", artefacts(tmp_path))
    assert me.state.orbit is None  # no arrow turned the viewer
    assert before["fov"] > 0
    me.tab.context.close()


def test_the_key_n_goes_on_but_first_asks_for_the_guess(visit):
    me = visit(query="lesson=1&step=2")
    assert (me.state.distance, me.state.hide) == (0.3, ("numbers",))
    me.tab.keyboard.press("n")
    me.tab.get_by_text(say("lesson.first")).wait_for()
    assert me.state.step == 2
    Hand(me, finger=False).press("None")
    me.until(lambda: me.state.hide == (), "the guess is not heard")
    me.tab.keyboard.press("n")
    me.until(lambda: me.state.step == 3, "the key does not go on")
    me.rest()
    assert "lesson=1&step=3" in me.tab.evaluate("() => location.search")
    me.tab.context.close()
