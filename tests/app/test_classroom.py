"""A class over real sockets: who leads, who follows, what is counted, and what happens when somebody goes."""

from __future__ import annotations

import http.client
import re
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from faceambig_app import drawn, guard, server
from faceambig_app.classroom import Classroom, Seat
from faceambig_app.classroom.page import bars_html
from faceambig_app.lessons import Ask, Number, lessons
from faceambig_app.panel.classroom import NOTE_LENGTH, Shown
from faceambig_app.state import DEFAULT, ViewState, changed
from faceambig_app.text import say, speaking

SOON = 60.0  # seconds: other tests share the processors
LEAD = "a-secret-of-the-teacher-1"
TOKEN = "a-token-of-the-class-12"
PLACE, STEP = next(
    ((lesson.number, k), step)
    for lesson in lessons().by_number.values()
    for k, step in enumerate(lesson.steps, 1)
    if step.ask is not None and step.ask.choices and "numbers" in step.state.hide
)
ASK = STEP.ask or Ask("", (), None, "")
ASKS = f"lesson={PLACE[0]}&step={PLACE[1]}"


@pytest.fixture
def page() -> Iterator[server.Page]:
    """The page of a class, with room for seven."""
    shown = server.Page("127.0.0.1", 0, lead=LEAD, limits=guard.Limits(sessions=7))
    yield shown
    shown.close()


@pytest.fixture
def come(wires, page) -> Iterator[Callable[..., Any]]:
    """A browser that has come to the class and is at rest: come(query, cookie)."""
    here: list[Any] = []

    def enter(query: str = "", cookie: str = "") -> Any:
        wire = wires.Wire(port_of(page), query, cookie)
        here.append(wire)
        assert wire.rests(SOON)
        return wire

    yield enter
    for wire in here:
        wire.close()


@pytest.fixture
def lead(page, come) -> Callable[..., Any]:
    """Whoever comes by the leader's link."""
    return lambda query="": come(query, leader_cookie(page))


def port_of(page: server.Page) -> int:
    return page._server.get_port()


def asked(page: server.Page, target: str, cookie: str = "") -> http.client.HTTPResponse:
    connection = http.client.HTTPConnection("127.0.0.1", port_of(page), timeout=SOON)
    connection.request("GET", target, headers={"Cookie": cookie} if cookie else {})
    answer = connection.getresponse()
    answer.read()
    connection.close()
    return answer


def leader_cookie(page: server.Page) -> str:
    """As a browser gets it from the link that the server prints."""
    assert page.leader_link is not None
    answer = asked(page, page.leader_link.removeprefix(page.address.rstrip("/")))
    assert answer.status == 303
    assert answer.headers["Location"] == "/"  # the secret does not stay in the address
    return "; ".join(one.partition(";")[0] for one in answer.headers.get_all("Set-Cookie") or ())


def words(wire: Any) -> str:
    return re.sub(r"<[^>]+>", " ", wire.shown)


def says(wire: Any, text: str) -> bool:
    return wire.wait(lambda: text in words(wire), SOON)


def move(wire: Any, step: int) -> None:
    wire.set(wire.control("Slider", say("field.distance")), step)


def at(wire: Any, key: str, value: str) -> bool:
    """Whether the page comes to rest with `key=value` in its address."""
    return wire.wait(lambda: re.search(rf"\b{key}={value}(&|$)", wire.query or ""), SOON)


def rest_at(wire: Any, query: str) -> bool:
    return wire.wait(lambda: wire.query == query, SOON)


def choose(wire: Any, words_: str) -> None:
    wire.set(wire.control("Button", words_), True)


FOLLOWS, ALONE, GONE = say("class.follows"), say("class.alone"), say("class.gone")


def test_five_follow_one_goes_alone_and_comes_back(lead, come):
    leader = lead()
    five = [come() for _ in range(5)]
    assert says(leader, say("class.leads", present=5, following=5))
    move(leader, 70)
    assert leader.wait(lambda: "distance" in leader.query, SOON)
    assert all(rest_at(wire, leader.query.replace("&text=1.5", "")) for wire in five)
    assert all(says(wire, FOLLOWS) for wire in five)

    alone, others = five[0], five[1:]
    move(alone, 20)
    assert says(alone, ALONE)
    assert says(leader, say("class.leads", present=5, following=4))
    own = alone.query
    assert alone.wait(lambda: alone.query != own, SOON)
    own = alone.query
    move(leader, 90)
    before = leader.query
    assert leader.wait(lambda: leader.query != before, SOON)
    there = leader.query.replace("&text=1.5", "")
    assert all(rest_at(wire, there) for wire in others)
    alone.read(0.3)
    assert alone.query == own  # the class goes on without it

    choose(alone, say("class.again"))
    assert rest_at(alone, there)
    assert says(leader, say("class.leads", present=5, following=5))
    move(alone, 30)
    choose(alone, say("class.again"))
    assert rest_at(alone, there)
    late = come("distance=0.4")
    assert rest_at(late, there)  # who comes later is where the class is


@pytest.mark.parametrize("language", ["en", "de"])
def test_a_tick_goes_alone_and_comes_back_and_a_note_is_read_by_all(lead, come, language):
    leader, wire = lead("lang=" + language), come("lang=" + language)
    with speaking(language):
        tick, note = say("class.explore"), say("class.note")
        alone, follows = say("class.alone"), say("class.follows")
        leads, distance = say("class.leads", present=1, following=0), say("field.distance")
    wire.set(wire.control("Checkbox", tick), True)
    assert says(wire, alone)
    assert says(leader, leads)
    leader.set(leader.control("Slider", distance), 70)
    assert at(leader, "distance", r"[0-9.]+")
    assert "distance" not in wire.query
    wire.set(wire.control("Checkbox", tick), False)
    assert at(wire, "distance", r"[0-9.]+")
    assert says(wire, follows)
    leader.set(leader.control("Text", note), "  <b>2 & 3</b>  ")
    for each in (leader, wire):
        assert each.wait(lambda e=each: "&lt;b&gt;2 &amp; 3&lt;/b&gt;" in e.shown, SOON)
    wire.set(wire.control("Text", note), "of a follower")  # it is not shown there, and is not heard
    wire.read(0.3)
    assert "of a follower" not in leader.shown + wire.shown


def test_eyes_are_each_ones_own(lead, come):
    leader, wire = lead(), come("text=2")
    assert at(leader, "text", "1.5")
    move(leader, 70)
    assert at(wire, "distance", r"[0-9.]+")
    assert at(wire, "text", "2")
    wire.set(wire.control("Slider", say("field.text")), 1.75)
    assert at(wire, "text", "1.75")
    assert FOLLOWS in words(wire)


def test_the_leader_goes_and_comes_back(page, lead, come):
    wire = come()
    assert says(wire, say("class.waits"))
    leader = lead()
    move(leader, 70)
    assert at(wire, "distance", r"[0-9.]+")
    last = wire.query
    leader.vanish()
    assert says(wire, GONE)
    assert wire.query == last
    again = lead()  # by the bare link: it goes on where the class is
    assert again.query.replace("&text=1.5", "") == last
    assert says(wire, FOLLOWS)
    move(again, 30)
    assert wire.wait(lambda: wire.query != last, SOON)
    third = lead("view=side")  # another window takes the room over, at the place of its address
    assert at(wire, "view", "side")
    assert says(again, FOLLOWS)
    choose(again, say("class.take"))
    assert says(third, FOLLOWS)
    assert says(again, say("class.leads", present=2, following=2))


def test_answers_are_counted_and_told_when_the_leader_reveals(page, lead, come):
    choices = ASK.choices
    leader = lead(ASKS)
    five = [come() for _ in range(5)]
    for k, wire in enumerate(five[:4]):
        assert at(wire, "lesson", str(PLACE[0]))
        choose(wire, choices[0 if k == 0 else 1])
        assert says(wire, say("class.held", words=choices[0 if k == 0 else 1]))
        assert "numbers" in wire.query  # nothing is told before
    assert says(leader, say("class.answers", count=4, present=5))
    choose(five[0], choices[1])  # another answer takes the place of the first
    bars = bars_html(ASK, [1.0] * 4, 5)
    assert leader.wait(lambda: bars in leader.shown, SOON)
    assert "<i" in bars
    five[3].close()  # and goes with who gave it
    assert says(leader, say("class.answers", count=3, present=4))

    group = leader.control("ButtonGroup", say("field.class"))
    leader.set(group, say("action.reveal"))
    for wire in (leader, *five[:3], five[4]):
        assert wire.wait(lambda w=wire: "numbers" not in (w.query or "numbers"), SOON)
    assert all(says(wire, say("lesson.said", words=choices[1])) for wire in five[:3])
    assert say("lesson.said", words="") not in words(five[4])  # it had said nothing
    assert all(FOLLOWS in words(wire) for wire in (*five[:3], five[4]))


def test_a_browser_without_the_pages_script_follows_too(wires, page, lead):
    leader = lead()
    wire = wires.Wire(port_of(page))
    wire._greeted = True  # as if the script had been blocked: no word of it comes
    assert says(wire, FOLLOWS)
    move(leader, 70)
    assert at(wire, "distance", r"[0-9.]+")
    wire.close()


class Chair:
    """A seat without a browser."""

    def __init__(self, room: Classroom, *, may_lead: bool = False) -> None:
        self.state, self.told, self.shown = DEFAULT, [], Shown()
        self.seat = Seat(
            room, may_lead=may_lead, go=self.go, reveal=self.told.append, show=self.show, now=lambda: self.state
        )  # fmt: skip
        self.state = self.seat.arrive(self.state)

    def go(self, state: ViewState) -> None:
        self.state = state

    def show(self, shown: Shown) -> None:
        self.shown = shown

    def move(self, **values: Any) -> None:
        before, self.state = self.state, changed(self.state, **values)
        self.seat.moved(before, self.state)


def test_a_photograph_of_the_leaders_own_goes_nowhere():
    room = Classroom(lessons)
    leader, other = Chair(room, may_lead=True), Chair(room)
    leader.move(subject=3)
    leader.move(subject="photo", distance=0.5)
    assert (other.state.subject, other.state.distance) == (3, DEFAULT.distance)
    assert say("class.private") in other.shown.html
    assert Chair(room).state.subject == 3
    leader.move(subject=3)
    assert other.state == leader.state
    assert say("class.follows") in other.shown.html


def test_each_is_spoken_to_in_its_own_way():
    spoken: list[str] = []

    @contextmanager
    def speaking() -> Iterator[None]:
        spoken.append("begins")
        yield
        spoken.append("ends")

    room = Classroom(lessons)
    seat = Seat(
        room, may_lead=False, go=lambda _: None, reveal=lambda _: None, now=lambda: DEFAULT,
        show=lambda _: spoken.append("says"), speaking=speaking,
    )  # fmt: skip
    seat.arrive(DEFAULT)
    spoken.clear()
    Chair(room, may_lead=True)  # somebody else comes, and the first is told
    assert spoken[:3] == ["begins", "says", "ends"]


def test_one_that_fails_holds_up_nobody(monkeypatch, caplog):
    room = Classroom(lessons)
    leader, broken, other = Chair(room, may_lead=True), Chair(room), Chair(room)
    monkeypatch.setattr(broken.seat, "follow", lambda _: 1 // 0)
    leader.move(distance=0.5)
    assert other.state.distance == 0.5
    assert "could not be told" in caplog.text


def test_who_does_not_lead_reveals_nothing():
    room = Classroom(lessons)
    leader, other = Chair(room, may_lead=True), Chair(room)
    leader.state = STEP.state
    leader.seat.moved(DEFAULT, STEP.state)
    assert leader.shown.hidden
    assert other.seat.unhide(other.state) == STEP.state
    assert not room.revealed
    assert other.seat.holds(PLACE, 0.0)
    assert "numbers" not in leader.seat.unhide(leader.state).hide
    assert room.revealed == {PLACE}
    assert other.told == [PLACE]
    late = Chair(room)
    assert late.told == [PLACE]
    other.seat.take()  # it has not come by the leader's link
    assert leader.seat.leads


def test_who_explores_alone_is_left_alone_until_back():
    room = Classroom(lessons)
    leader, other = Chair(room, may_lead=True), Chair(room)
    other.seat.explore(True)
    assert other.shown.alone
    leader.move(distance=0.5)
    assert other.state == DEFAULT
    other.seat.explore(True)  # again says nothing new
    assert other.shown.alone
    other.seat.explore(False)
    assert other.state == leader.state
    assert not other.shown.alone
    leader.seat.explore(True)
    assert (leader.seat.leads, leader.shown.leads, leader.shown.alone) == (True, True, False)


def test_a_note_is_a_line_of_who_leads():
    room = Classroom(lessons)
    leader, other = Chair(room, may_lead=True), Chair(room)
    leader.seat.note("a\n\u202eb " + NOTE_LENGTH * "c")
    assert leader.shown.note == other.shown.note == "a b " + (NOTE_LENGTH - 4) * "c"
    other.seat.note("no")
    assert room.note.startswith("a b c")
    leader.seat.leave()  # it stays with all else
    assert "a b c" in other.shown.strip
    again = Chair(room, may_lead=True)
    assert again.shown.note == room.note
    again.seat.note(" ")
    assert (other.shown.strip, again.shown.note) == ("", "")


def test_numbers_are_counted_in_ranges():
    ask = Ask("How far?", (), Number(0, 20, "mm"), "5")
    html = bars_html(ask, [0.0, 3.0, 4.0, 20.0, 1e9], 7)
    assert re.findall(r"<span>([^<]*)</span><span>(\d)</span>", html) == [
        ("0 to 3 mm", "2"), ("4 to 7 mm", "1"), ("8 to 12 mm", "0"), ("13 to 16 mm", "0"), ("17 to 20 mm", "2"),
    ]  # fmt: skip


# ---------------------------------------------------------------- who may lead


@pytest.mark.parametrize(
    "query", ["lead=", f"lead={LEAD}x", f"lead={LEAD[:-1]}", f"lead={LEAD}&lead={LEAD}", f"lead={LEAD.upper()}"]
)  # fmt: skip
def test_no_other_secret_leads(page, query):
    answer = asked(page, f"/?{query}")
    assert answer.status == 401
    assert answer.headers["Set-Cookie"] is None


def test_whoever_has_no_leaders_cookie_follows(page, come):
    name, secret = "faceambig-lead-" + str(port_of(page)), leader_cookie(page).partition("=")[2]
    forged = come("", f"{name}={secret[:-1]}{'0' if secret[-1] != '0' else '1'}")
    other_name = come("", f"faceambig-{port_of(page)}={secret}")
    for wire in (forged, other_name):
        assert says(wire, say("class.waits"))
        assert say("class.room") not in words(wire)  # nor is the invitation its own


def test_the_token_of_the_class_does_not_lead_and_the_secret_lets_in(wires):
    page = server.Page("127.0.0.1", 0, token=TOKEN, lead=LEAD)
    try:
        assert asked(page, "/").status == 401
        assert asked(page, f"/?lead={TOKEN}").status == 401
        assert asked(page, f"/?token={LEAD}").status == 401
        told = asked(page, f"/?token={TOKEN}").headers.get_all("Set-Cookie") or []
        assert len(told) == 1
        assert "lead" not in told[0]
        cookie = leader_cookie(page)
        assert cookie.count("=") == 2
        wire = wires.Wire(port_of(page), "", cookie)
        assert wire.rests(SOON)
        assert TOKEN in wire.shown  # the room's link, for the class
        assert LEAD not in wire.shown
        wire.close()
    finally:
        page.close()


def test_a_secret_that_all_have_is_refused():
    with pytest.raises(guard.ServeError, match="secret of who leads"):
        server.Page("127.0.0.1", 0, token=TOKEN, lead=TOKEN)


def test_there_is_always_room_for_who_leads(page, lead, come):
    for _ in range(7):
        come()
    with pytest.raises(Exception, match="503"):
        come()
    assert says(lead(), say("class.leads", present=7, following=7))


# ---------------------------------------------------------------- once for all


def test_what_two_workers_ask_for_is_made_once():
    kept, made = drawn.Kept(2), []

    def make() -> object:
        time.sleep(0.1)
        made.append(object())
        return made[-1]

    got: list[object] = []
    threads = [threading.Thread(target=lambda: got.append(kept.get("a", make))) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(made) == 1
    assert all(one is made[0] for one in got)
    for key in "bc":
        kept.get(key, make)
    assert kept.get("a", make) is not got[0]  # two are kept


def test_what_fails_is_tried_again():
    kept = drawn.Kept()
    with pytest.raises(ZeroDivisionError):
        kept.get("a", lambda: 1 // 0)
    assert kept.get("a", lambda: 2) == 2


def test_who_makes_plots_for_long_keeps_nobody_elses_waiting(monkeypatch):
    # functools.cached_property of Python 3.11 has one lock for all
    made, go = threading.Event(), threading.Event()

    def slow(state):
        if state.distance == 0.5:
            made.set()
            assert go.wait(60)
        raise ZeroDivisionError(str(state.distance))

    monkeypatch.setattr(drawn, "plots_of", slow)
    first, second = (
        drawn.drawn(changed(DEFAULT, distance=metres), True, None) for metres in (0.5, 0.6)
    )
    errors = []

    def ask():
        try:
            _ = first.curves
        except ZeroDivisionError as error:
            errors.append(str(error))

    thread = threading.Thread(target=ask)
    thread.start()
    assert made.wait(60)
    with pytest.raises(ZeroDivisionError, match=r"0\.6"):
        _ = second.curves
    assert not errors
    go.set()
    thread.join(60)
    assert errors == ["0.5"]
    assert first.cards is first.cards
