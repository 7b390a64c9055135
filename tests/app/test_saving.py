"""One browser's saving against a line that is driven by hand: what it shows, in which order, and when it is silent."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from unittest.mock import MagicMock

import pytest

from faceambig_app import saving
from faceambig_app.orders import Work
from faceambig_app.panel.export import Shown
from faceambig_app.saving import Saving, size_text
from faceambig_app.state import DEFAULT, ViewState
from faceambig_app.state.forms import to_json


class Loop:
    """Keeps what is to be done until run() does it."""

    def __init__(self) -> None:
        self.later: list[Callable[[], None]] = []

    def call_soon_threadsafe(self, call: Callable[[], None]) -> None:
        self.later.append(call)

    def run(self) -> None:
        calls, self.later = self.later, []
        for call in calls:
            call()


class Line:
    """Takes one order."""

    work: Work | None = None

    def take(self, customer: Saving, work: Work) -> bool:
        if self.work is not None:
            return False
        self.work = work
        customer.waits(2)
        return True

    def stop(self, _customer: Saving) -> bool:
        had, self.work = self.work is not None, None
        return had


class Desk:
    def __init__(self) -> None:
        self.loop, self.line, self.client = Loop(), Line(), MagicMock()
        self.shown: list[Shown] = []
        self.notices: list[str] = []
        self.went: list[ViewState] = []
        parts: Any = (self.client, self.loop, self.line)  # stand-ins
        self.saving = Saving(
            *parts, now=lambda: DEFAULT, go=self.went.append, show=self.shown.append,
            notice=self.notices.append,
        )  # fmt: skip


@pytest.fixture
def desk() -> Desk:
    return Desk()


def test_a_file_waits_is_drawn_written_and_sent(desk, monkeypatch):
    sent: list[Any] = []
    monkeypatch.setattr(
        saving, "send_file", lambda client, name, data, left: sent.append((name, data)) or True
    )
    desk.saving.save("state")
    assert desk.line.work is not None
    name, data = desk.line.work(desk.saving.goes_on)
    assert data.decode() == to_json(DEFAULT) + "\n"
    desk.saving.waits(0)
    desk.saving.goes_on(1, 4)
    desk.saving.goes_on(4, 4)
    desk.saving.made(name, data)
    assert desk.shown == []  # widgets are written on the loop only
    desk.loop.run()
    assert sent == [(name, data)]
    assert [(shown.words, shown.done, shown.busy) for shown in desk.shown] == [
        ("Waiting for another export (2 before yours).", 0, True),
        ("Making the file.", 0, True),
        ("Drawing: 2 of 4.", 0.25, True),
        ("Writing the file.", 1, True),
        (f"Saved: {name} (1\u202fkB).", 0, False),
    ]
    made = desk.client.add_notification.call_args_list
    assert [call.kwargs["loading"] for call in made] == [True, False]  # one while there is work


def test_a_second_order_is_refused_in_words(desk):
    desk.saving.save("csv")
    desk.saving.save("csv")
    assert desk.notices == ["One file at a time: wait for the one being made, or stop it."]


def test_what_was_said_before_a_stop_does_not_show_after_it(desk):
    desk.saving.save("png")
    desk.loop.run()
    desk.saving.goes_on(1, 4)  # on its way to the loop when the button is pressed
    desk.saving.stop()
    desk.loop.run()
    assert desk.shown[-1] == Shown("Stopped; no file was made.")
    desk.saving.stop()  # nothing to stop any more
    assert len(desk.shown) == 2


def test_an_error_is_a_red_line_and_the_tab_is_free_again(desk):
    desk.saving.save("glb", face="true")
    desk.saving.failed(ValueError("face: 'true' is hidden in this state"))
    desk.loop.run()
    assert desk.shown[-1] == Shown()
    assert desk.notices == ["No file was made: face: 'true' is hidden in this state."]


def test_a_browser_that_left_is_shown_nothing_and_its_order_is_taken_back(desk):
    desk.saving.save("png")
    desk.saving.leave()
    desk.loop.run()
    desk.saving.failed(ValueError("too late"))
    desk.loop.run()
    assert desk.line.work is None
    assert desk.shown == []
    assert desk.notices == []


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "not JSON"),
        (b"\xff\xfe", "not JSON"),
        (b"[1]", "Expected `object`"),
        (b'{"spin":1}', "unknown field `spin`"),
        (b'{"v":2}', "v: 2 is not the format"),
        (b'{"distance":9}', "distance: 9"),
        (b" " * 65_537, "longer than 65536"),
        (b"[" * 60_000, "state: "),
    ],
)
def test_a_file_that_is_no_state_is_said_and_changes_nothing(desk, data, words):
    desk.saving.open("odd.json", data)
    (notice,) = desk.notices
    assert notice.startswith("odd.json holds no state of this page: ")
    assert words in notice
    assert "\n" not in notice
    assert desk.went == []


def test_a_state_opens_but_not_the_model_of_its_own_choice(desk):
    desk.saving.open("mine.json", b'{"subject":4,"distance":0.45}')
    desk.saving.open("theirs.json", b'{"model":"/etc/passwd","subject":4}')
    desk.saving.open("photo.json", b'{"subject":"photo"}')
    assert desk.went[0] == ViewState(subject=4, distance=0.45)
    assert desk.went[1] == ViewState(subject=4)
    assert desk.notices == [
        'The model "/etc/passwd" is not on this page; embedded is shown.',
        "This state needs your photo.",
    ]


def test_sizes_are_said_in_thousands():
    assert [size_text(n) for n in (3, 12_400, 1_440_000)] == [
        "1\u202fkB", "12\u202fkB", "1.4\u202fMB",
    ]  # fmt: skip
