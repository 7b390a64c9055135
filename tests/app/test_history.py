"""Undo against a plain list of states; and each rule of it by itself."""

from __future__ import annotations

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from faceambig_app.state import DEFAULT, ViewState, changed
from faceambig_app.state.history import STEPS, VIEW, History, change, redo, reset, undo


def at(metres: float) -> ViewState:
    return changed(DEFAULT, distance=metres)


def steps(*metres: float, apart: float = 1.0) -> History:
    """A history of distances, `apart` seconds between them."""
    history = History()
    for index, distance in enumerate(metres):
        history = change(history, changed(history.now, distance=distance), apart * index)
    return history


def test_undo_and_redo_walk_through_the_steps():
    history = steps(0.3, 0.6, 0.9)
    back = undo(undo(history))
    assert (back.now, undo(back).now, undo(undo(back)).now) == (at(0.3), DEFAULT, DEFAULT)
    assert redo(back).now == at(0.6)
    assert redo(redo(redo(back))).now == at(0.9)
    assert redo(redo(redo(back))).past == history.past


def test_one_drag_is_one_step():
    drag = steps(*(0.3 + 0.01 * k for k in range(50)), apart=0.39)
    assert drag.past == (DEFAULT,)
    assert undo(drag).now == DEFAULT
    assert redo(undo(drag)).now == drag.now


def test_a_step_closes_400_ms_after_its_last_change():
    first = change(History(), at(0.3), 0.0)
    assert len(change(first, at(0.4), 0.399).past) == 1
    assert len(change(first, at(0.4), 0.4).past) == 2
    long = change(change(first, at(0.4), 0.375), at(0.5), 0.75)  # 0.75 s, but no pause in it
    assert long.past == (DEFAULT,)
    same = change(first, first.now, 0.3)  # nothing changed: the step is not kept open by it
    assert len(change(same, at(0.4), 0.4).past) == 2


def test_undo_closes_a_step():
    history = undo(change(change(History(), at(0.3), 0.0), at(0.4), 1.0))
    assert undo(change(history, at(0.5), 1.1)).now == at(0.3)


def test_a_drag_back_to_its_start_is_no_step():
    history = steps(0.3)
    dragged = change(change(change(history, at(0.5), 5.0), at(0.4), 5.1), at(0.3), 5.2)
    assert (dragged.now, dragged.past) == (at(0.3), (DEFAULT,))
    further = change(dragged, at(0.7), 5.3)
    assert undo(further).now == at(0.3)
    assert undo(undo(further)).now == DEFAULT


def test_a_new_change_cuts_redo_and_a_look_around_does_not():
    history = undo(steps(0.3, 0.6))
    looked = change(history, changed(history.now, view="side", zoom=2.0), 9.0)
    assert redo(looked).now == changed(at(0.6), view="side", zoom=2.0)
    new = change(history, at(0.9), 9.0)
    assert new.future == ()
    assert redo(new) == new


def test_moves_of_the_viewer_are_no_steps_and_are_not_undone():
    assert VIEW == ("flex_from", "view", "orbit", "zoom", "theme", "text", "lang")
    history = steps(0.3)
    moves = [
        {"view": "free", "orbit": (30.0, 5.0)}, {"orbit": (60.0, 5.0)}, {"zoom": 2.0}, {"theme": "dark"},
        {"text": 1.5}, {"flex_from": 7}, {"lang": "de"},
    ]  # fmt: skip
    for index, move in enumerate(moves):
        history = change(history, changed(history.now, **move), 5.0 + index)
    assert history.past == (DEFAULT,)
    before = undo(history).now
    assert before.distance == DEFAULT.distance
    assert [getattr(before, name) for name in VIEW] == [
        7,
        "free",
        (60.0, 5.0),
        2.0,
        "dark",
        1.5,
        "de",
    ]


def test_a_look_around_in_a_drag_is_not_a_pause_nor_a_step():
    history = change(History(), at(0.3), 0.0)
    history = change(history, changed(at(0.3), view="side"), 0.3)
    assert len(change(history, changed(at(0.4), view="side"), 0.35).past) == 1
    assert len(change(history, changed(at(0.4), view="side"), 0.45).past) == 2


def test_a_hundred_steps_are_kept():
    history = steps(*(0.3 + 0.01 * k for k in range(150)))
    assert len(history.past) == STEPS == 100
    for _ in range(120):
        history = undo(history)
    assert history.now.distance == 0.3 + 0.01 * 49
    assert len(history.future) == 100
    for _ in range(120):
        history = redo(history)
    assert history.now.distance == 0.3 + 0.01 * 149


def test_reset_is_a_step_that_leaves_the_size_of_letters():
    seen = changed(at(0.3), theme="dark", text=2.0, view="side", flex=[(1, 2.0)])
    history = change(History(), seen, 0.0)
    fresh = reset(history)
    assert fresh.now == changed(DEFAULT, theme="dark", text=2.0)
    assert undo(fresh).now == changed(seen, view="three_quarter")
    assert len(change(fresh, changed(fresh.now, distance=0.4), 0.1).past) == 3
    assert reset(fresh) == fresh
    start = changed(DEFAULT, subject=5)
    assert reset(history, start).now.subject == 5


class AgainstAList(RuleBasedStateMachine):
    """The history against a list of all steps and a place in it. Times in eighths of a second: no rounding."""

    def __init__(self) -> None:
        super().__init__()
        self.history = History()
        self.states, self.place = [DEFAULT.distance], 0
        self.view = DEFAULT.view
        self.time, self.changed_at = 0, -1000
        self.open = False

    @rule(metres=st.sampled_from([0.3, 0.6, 0.9, 1.2]), pause=st.integers(0, 6))
    def distance(self, metres: float, pause: int) -> None:
        self.time += pause
        state = changed(self.history.now, distance=metres)
        self.history = change(self.history, state, self.time / 8)
        if metres == self.states[self.place]:
            return
        if self.open and (self.time - self.changed_at) / 8 < 0.4:
            self.states[self.place :] = [metres]
            if self.states[self.place - 1] == metres:
                self.states.pop()
                self.place, self.open = self.place - 1, False
        else:
            self.states[self.place + 1 :] = [metres]
            self.place, self.open = self.place + 1, True
            if self.place > STEPS:
                self.states.pop(0)
                self.place -= 1
        self.changed_at = self.time

    @rule(view=st.sampled_from(["front", "side", "top"]), pause=st.integers(0, 6))
    def look(self, view: str, pause: int) -> None:
        self.time += pause
        self.view = view
        self.history = change(self.history, changed(self.history.now, view=view), self.time / 8)

    @rule(times=st.sampled_from([1, 2, 150]))
    def back(self, times: int) -> None:
        for _ in range(times):
            self.history = undo(self.history)
            if self.place:
                self.place, self.open = self.place - 1, False

    @rule(times=st.sampled_from([1, 2, 150]))
    def forth(self, times: int) -> None:
        for _ in range(times):
            self.history = redo(self.history)
            if self.place < len(self.states) - 1:
                self.place, self.open = self.place + 1, False

    @precondition(lambda self: len(self.states) < 60)
    @rule()
    def many(self) -> None:
        for step in range(50):
            self.distance([0.3, 0.6][step % 2], 4)

    @rule()
    def again(self) -> None:
        self.history = reset(self.history)
        self.view, self.open = DEFAULT.view, False
        if self.states[self.place] != DEFAULT.distance:
            self.states[self.place + 1 :] = [DEFAULT.distance]
            self.place += 1
            if self.place > STEPS:
                self.states.pop(0)
                self.place -= 1

    @invariant()
    def agree(self) -> None:
        assert self.history.now == changed(at(self.states[self.place]), view=self.view)
        assert [state.distance for state in self.history.past] == self.states[: self.place]
        future = [state.distance for state in reversed(self.history.future)]
        assert future == self.states[self.place + 1 :]
        assert len(self.states) <= STEPS + 1


TestAgainstAList = AgainstAList.TestCase
TestAgainstAList.settings = settings(max_examples=40, stateful_step_count=30, deadline=None)
