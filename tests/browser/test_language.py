"""Languages in Chromium: by link, by what the browser asks for, by the switch; two browsers at one server."""

from __future__ import annotations

import pytest

from visitor import Visitor

pytestmark = pytest.mark.browser

FACES = "Other faces behind the same points", "Andere Gesichter hinter denselben Punkten"


def shown(me: Visitor) -> str:
    """All words that are drawn, and those of the plots."""
    return me.tab.evaluate("() => document.body.innerText")


def test_two_browsers_at_one_server_have_a_language_each(visit):
    you = visit(locale="en-GB")
    me = visit(locale="de-AT")
    you.rest()
    assert me.state.lang == you.state.lang == "auto"
    assert "Landmarken-Fehler" in shown(me)
    assert "Landmark error" not in shown(me)
    assert "Landmark error" in shown(you)
    assert "Landmarken" not in shown(you)
    assert FACES[1] in shown(me)
    assert FACES[0] in shown(you)
    assert me.tab.evaluate("() => document.documentElement.lang") == "de"

    # A change of each goes on in its own words: what the workers draw as well
    for page in (me, you):
        page.do(lambda page=page: page.browser.act("nearer"))
    for page in (me, you):
        page.until(lambda page=page: page.state.distance < 1.2, "the key did not arrive")
        page.rest()
    assert "Angenommener Abstand 1,17\u202fm." in me.tab.content()
    assert "Assumed distance 1.17\u202fm." in you.tab.content()
    you.tab.context.close()
    me.tab.context.close()


def test_a_link_and_the_switch_choose_the_language_and_what_was_done_stays(visit):
    me = visit(locale="en-GB", query="distance=0.6&lang=de")
    assert "Landmarken-Fehler" in shown(me)
    me.do(lambda: me.browser.act("nearer"))
    me.until(lambda: me.state.distance < 0.6, "the key did not arrive")
    me.rest()
    me.tab.get_by_role("tab", name="Ansicht", exact=True).click()
    me.tab.get_by_role("button", name="Seite", exact=True).click()
    me.tab.get_by_role("button", name="English", exact=True).click()
    me.until(lambda: me.browser.language == "en", "the switch did not arrive")
    me.rest()
    assert "lang=en" in me.tab.evaluate("() => location.search")
    assert "Landmark error" in shown(me)
    # What a screen reader is told comes last
    me.until(lambda: "Landmarken" not in shown(me), "German words stay")
    assert me.tab.evaluate("() => document.documentElement.lang") == "en"
    # The new controls are heard, and the history is that of before: language is no step of it
    me.tab.keyboard.press("Control+z")
    me.until(lambda: me.state.distance == 0.6, "undo did not arrive")
    assert me.state.lang == "en"
    me.rest()
    me.tab.context.close()


def test_a_lesson_is_told_in_the_language(visit):
    me = visit(query="lang=de&lesson=1")
    me.until(lambda: "Gleiches Bild, anderes Gesicht" in shown(me), "no German lesson")
    assert "Schritt 1 von 5: Ansehen" in shown(me)
    me.do(lambda: me.browser.act("lesson_next"))
    me.until(lambda: "Fast dasselbe Gesicht" in shown(me), "no German choices")
    assert me.state.lang == "de"
    me.tab.context.close()
