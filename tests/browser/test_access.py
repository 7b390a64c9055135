"""The page for everybody: what axe-core finds on every tab, keys alone, large letters, what is unfolded or emptied."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import pytest

from audit import CUT, SMALL, found_by_axe
from visitor import Visitor

pytestmark = pytest.mark.browser

TABS = ("Explore", "View", "Compare", "Data", "Export")
FOLDED = ".mantine-Paper-root[role=button][aria-expanded=false]"
# Whether what is in the open folders is there, and does not grow any more
UNFOLDED = """() => [...document.querySelectorAll('.mantine-Paper-root[role=button][aria-expanded=true]')]
  .filter(e => e.checkVisibility()).map(e => e.nextElementSibling).every(e => e.offsetHeight && !e.style.overflow)"""
# What has the focus: its element, its name, its size and whether it is seen to have it
FOCUSED = """() => { const e = document.activeElement; if (e === document.body || walked.has(e)) return null;
  walked.add(e);
  const box = e.getBoundingClientRect(), x = box.x + box.width / 2, y = box.y + box.height / 2;
  const above = document.elementFromPoint(x, y);
  return [e.ariaLabel || e.labels?.[0]?.textContent || e.textContent.trim(), box.width, box.height,
    getComputedStyle(e).outlineStyle === 'solid' && above !== null && (e.contains(above) || above.contains(e))] }"""
# What a person can do on a tab, but for the tabs themselves
CONTROLS = """() => [...document.querySelectorAll('[role=slider], input:not([type=hidden], [type=file]), summary, ' +
    'button:not([aria-hidden=true], [role=tab]), [role=button]')]
  .filter(e => e.checkVisibility() && e.getBoundingClientRect().width && !e.closest('.mantine-Notification-root'))
  .map(e => e.ariaLabel || e.labels?.[0]?.textContent || e.textContent.trim())"""
SIDEWAYS = """() => [...document.querySelectorAll('.mantine-ScrollArea-viewport')]
  .map(e => e.scrollWidth - e.clientWidth)"""


@pytest.fixture(scope="module")
def desk(visit: Callable[..., Visitor]) -> Visitor:
    return quiet(visit(1440, 900, dpr=0.2, color_scheme="light"))


@pytest.fixture(scope="module")
def phone(visit: Callable[..., Visitor]) -> Visitor:
    return quiet(visit(390, 844, dpr=0.2, color_scheme="dark"))


def quiet(me: Visitor) -> Visitor:
    """Without notices, which come and go."""
    me.tab.add_style_tag(content=".mantine-Notifications-root { display: none !important }")
    return me


def unfold(me: Visitor) -> None:
    """Every folder of the tab, by Enter."""
    me.tab.wait_for_timeout(300)  # a tab that opens fades in
    for _ in range(12):
        folded = me.tab.locator(FOLDED).locator("visible=true")
        if (left := folded.count()) == 0:
            me.until(lambda: me.tab.evaluate(UNFOLDED), "a folder does not come to rest")
            return
        folded.first.focus()
        me.tab.keyboard.press("Enter")
        me.until(lambda n=left, f=folded: f.count() < n, "Enter opens no folder")
    raise AssertionError("more folders than a tab has")


def choose(me: Visitor, tab: str) -> None:
    handle = me.tab.get_by_role("tab", name=tab, exact=True)
    handle.focus()
    me.tab.keyboard.press("Enter")
    me.until(lambda: handle.get_attribute("aria-selected") == "true", f"Enter opens no {tab}")


def test_on_every_tab_axe_finds_nothing_and_keys_reach_everything(desk, axe):
    desk.start_again()
    desk.goes(surface="difference")
    desk.tab.evaluate(axe)
    for tab in TABS:
        choose(desk, tab)
        unfold(desk)
        wanted = desk.tab.evaluate(CONTROLS)
        assert len(wanted) > 2, tab  # of them two in the bar above
        assert all(wanted), f"{tab}: something has no name"
        assert not found_by_axe(desk), tab
        assert not found_in_the_other_scheme(desk), tab
        assert sorted(walked(desk)) == sorted(wanted), tab


def test_on_a_phone_in_the_dark_axe_finds_nothing(phone, axe):
    phone.start_again()
    phone.goes(surface="difference")
    phone.tab.evaluate(axe)
    assert phone.tab.evaluate("() => document.documentElement.dataset.mantineColorScheme") == "dark"
    for tab in TABS:
        choose(phone, tab)
        unfold(phone)
        assert len(phone.tab.evaluate(CONTROLS)) > 2, tab
        assert not found_by_axe(phone), tab
        assert not found_in_the_other_scheme(phone), tab


def found_in_the_other_scheme(me: Visitor) -> list[str]:
    """What axe finds of contrast, all that changes, in the dark for the light and the other way round."""
    scheme = "() => document.documentElement.dataset.mantineColorScheme"
    dark = me.tab.evaluate(scheme) == "dark"

    def turn(now: Literal["light", "dark"]) -> None:
        me.tab.emulate_media(color_scheme=now)
        me.until(lambda: me.tab.evaluate(scheme) == now, f"the page does not turn {now}")

    turn("light" if dark else "dark")
    me.tab.wait_for_timeout(200)  # colours of buttons fade
    found = found_by_axe(me, "color-contrast")
    turn("dark" if dark else "light")
    return found


def walked(me: Visitor) -> list[str]:
    """Names of all that Tab goes through from the top of the page to its end, but tabs; each seen and large enough."""
    me.tab.evaluate(
        "() => { const first = document.createElement('span'); first.tabIndex = -1; document.body.prepend(first);"
        " first.focus(); first.remove(); window.walked = new Set() }"
    )
    names = []
    for _ in range(120):
        me.tab.keyboard.press("Tab")
        if (focused := me.tab.evaluate(FOCUSED)) is None:
            return names
        words, width, height, seen = focused
        assert seen, f"{words} is covered, or its focus is not seen"
        assert min(width, height) >= 24, f"{words}: {width} by {height}"
        if me.tab.evaluate("() => document.activeElement.role !== 'tab'"):
            names.append(words)
    raise AssertionError(f"Tab never comes to an end: {names[-3:]}")


@pytest.mark.parametrize("window", ["desk", "phone"])
def test_letters_of_twice_the_size_are_not_cut_off(window, request):
    me: Visitor = request.getfixturevalue(window)
    me.start_again()
    me.goes(text=2.0)
    for tab in TABS:
        choose(me, tab)
        unfold(me)
        assert not me.tab.evaluate(CUT), tab
        assert not me.tab.evaluate(SMALL), tab
        assert max(me.tab.evaluate(SIDEWAYS)) <= 0, f"{tab} scrolls sideways"


def test_what_is_unfolded_stays_so_with_its_focus_when_the_server_draws_it_anew(desk):
    me = desk
    me.start_again()
    summary = me.tab.locator("summary", has_text="The curves as numbers")
    is_open = "() => document.querySelector('details')?.open"
    for unfolded in (True, False):
        summary.focus()
        me.tab.keyboard.press("Enter")
        me.until(lambda u=unfolded: me.tab.evaluate(is_open) == u, "Enter does not fold the table")
        me.tab.evaluate("() => { document.querySelector('details').old = true }")
        me.tab.keyboard.press("j")
        drawn = "() => document.querySelector('details') && !document.querySelector('details').old"
        me.until(lambda d=drawn: me.tab.evaluate(d), "the table was not sent again")
        me.rest()
        assert me.tab.evaluate(is_open) == unfolded
        assert me.tab.evaluate("() => document.activeElement.tagName") == "SUMMARY"


def test_a_number_counts_when_the_hand_rests_and_an_emptied_field_gets_its_value_back(desk):
    me = desk
    me.start_again()
    box = me.tab.get_by_label("Distance (cm)")
    box.focus()
    me.tab.keyboard.press("End")
    for _ in range(3):
        me.tab.keyboard.press("Backspace", delay=30)
    assert box.input_value() == ""
    me.tab.keyboard.press("Tab")
    me.until(lambda: box.input_value() == "120", "the field stays empty")
    me.rest()
    assert me.state.distance == 1.2
    assert not me.browser._history.past  # neither 12 nor 1 was told
    box.focus()
    me.tab.keyboard.press("End")
    for key in ("Backspace", "Backspace", "Backspace", "6", "3"):  # 12 and 1 and 6 on the way
        me.tab.keyboard.press(key)
    me.until(lambda: me.state.distance == 0.63, "63 does not arrive by itself")
    assert [state.distance for state in me.browser._history.past] == [1.2]
    me.tab.keyboard.press("x")
    me.tab.get_by_text("Type a number, for example 60.").first.wait_for()
    assert box.input_value() == "63"
