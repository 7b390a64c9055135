"""Dispatcher and Room: the newest state wins, nobody waits twice, an error costs a frame and no worker.

Plain objects, no browser. Time is waited for by events; what must not happen is looked for in the log of what did.
"""

from __future__ import annotations

import random
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import pytest

from faceambig_app import room as module
from faceambig_app.room import REST, Dispatcher, Room
from faceambig_app.state import DEFAULT, ViewState, changed

SOON = 10.0  # seconds: far more than anything here takes on a busy machine


def until(holds: Callable[[], object], seconds: float = SOON) -> None:
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, "waited too long"
        time.sleep(0.001)


@pytest.fixture
def dispatchers() -> Iterator[Callable[..., Dispatcher]]:
    made: list[Dispatcher] = []

    def make(*arguments: object, **options: object) -> Dispatcher:
        made.append(Dispatcher(*arguments, **options))  # pyright: ignore[reportArgumentType]
        return made[-1]

    yield make
    for dispatcher in made:
        dispatcher.close()
        assert not any(thread.is_alive() for thread in dispatcher._threads)


@dataclass(eq=False)
class Counter:
    """A plain room: `state` counts up; remembers what was served and whether two were in at once."""

    work: float = 0.0  # seconds
    state: int = 0
    seen: list[int] = field(default_factory=list)
    inside: int = 0
    crowded: bool = False

    def serve(self) -> None:
        self.inside += 1
        self.crowded |= self.inside > 1
        state = self.state
        if self.work:
            time.sleep(self.work)
        self.seen.append(state)
        self.inside -= 1


@pytest.mark.parametrize("workers", [1, 2, 4])
@pytest.mark.parametrize("seed", range(3))
def test_the_last_state_is_served_and_no_older_one_after_a_newer(dispatchers, workers, seed):
    rng = random.Random(seed)
    dispatcher = dispatchers(Counter.serve, workers=workers)
    rooms = [Counter(work=rng.choice([0.0, 0.0002, 0.001])) for _ in range(5)]
    for _ in range(1500):
        chosen = rng.choice(rooms)
        chosen.state += 1
        dispatcher.ring(chosen, rng.choice([0.0, 0.0, 0.0, 0.002]))
        if rng.random() < 0.02:
            time.sleep(0.001)
    for each in rooms:  # the last ring may have been one for later
        until(lambda each=each: each.seen and each.seen[-1] == each.state)
        assert not each.crowded
        assert each.seen == sorted(each.seen)


def test_rooms_that_are_false_or_equal_to_none_are_served_too(dispatchers):
    served: list[object] = []
    dispatcher = dispatchers(served.append)
    for name in (0, "", (), False):
        dispatcher.ring(name)
    until(lambda: len(served) >= 3)  # 0 and False are one key
    assert set(served) == {0, "", ()}


def test_rings_while_waiting_are_one_turn_and_rings_while_served_another(dispatchers):
    go, started = threading.Event(), threading.Event()
    turns: list[str] = []

    def serve(name: str) -> None:
        turns.append(name)
        started.set()
        assert go.wait(SOON)

    dispatcher = dispatchers(serve, workers=1)
    dispatcher.ring("a")
    assert started.wait(SOON)
    for name in "abba":
        dispatcher.ring(name)
    go.set()
    until(lambda: len(turns) == 3)
    dispatcher.close()
    assert turns == ["a", "a", "b"]  # in the order of their first ring


def test_greedy_rooms_get_equal_turns(dispatchers):
    # One worker: of two, one may be kept from running for 50 ms by other programs while the other goes round
    order: list[int] = []
    stopped = threading.Event()

    def serve(name: int) -> None:
        order.append(name)
        if not stopped.is_set():
            dispatcher.ring(name)

    dispatcher = dispatchers(serve, workers=1)
    for name in range(10):
        dispatcher.ring(name)
    until(lambda: len(order) > 400)
    stopped.set()
    dispatcher.close()
    start = order.index(9) + 10  # by then all have rung
    assert sorted(order[start : start + 10]) == list(range(10))
    assert order[start : start + 10] * 10 == order[start : start + 100]


def test_a_later_turn_comes_when_it_is_due_and_not_before(dispatchers):
    served: list[tuple[str, float]] = []
    dispatcher = dispatchers(lambda name: served.append((name, time.monotonic())))
    start = time.monotonic()
    dispatcher.ring("late", 0.06)
    dispatcher.ring("early", 0.02)
    dispatcher.ring("now")
    until(lambda: len(served) == 3)
    assert [name for name, _ in served] == ["now", "early", "late"]
    assert served[1][1] - start >= 0.02
    assert served[2][1] - start >= 0.06


def test_a_later_turn_is_not_kept_back_by_a_busy_worker(dispatchers):
    # of two idle workers the one that knows of the later turn may be given other work meanwhile
    free, served = threading.Event(), threading.Event()
    serve = {"long": lambda: free.wait(SOON), "late": served.set, "idle": lambda: None}
    for _ in range(5):
        dispatcher = dispatchers(lambda name: serve[name](), workers=3)
        dispatcher.ring("idle")
        dispatcher.ring("late", 0.02)
        dispatcher.ring("long")
        assert served.wait(0.5 * SOON)
        served.clear()
        free.set()
        dispatcher.close()
        free.clear()


def test_many_later_turns_of_one_room_are_one(dispatchers):
    served: list[str] = []
    dispatcher = dispatchers(served.append)
    for _ in range(50):
        dispatcher.ring("a", 0.02)
    dispatcher.ring("end", 0.06)
    until(lambda: "end" in served)
    assert served == ["a", "end"]


class Clock:
    """Time that passes when it is told to."""

    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now


def test_a_full_frame_lets_drafts_pass_but_not_for_ever(dispatchers, monkeypatch):
    clock = Clock()
    monkeypatch.setattr(module, "time", clock)
    dispatcher = dispatchers(workers=0)
    dispatcher.ring("full", REST)
    clock.now += REST
    assert dispatcher._next() == "full"  # nobody else waits
    clock.now += 0.5 * module.YIELD
    dispatcher.ring("draft")
    assert dispatcher._next() == "draft"
    clock.now += module.YIELD
    dispatcher.ring("another")
    del dispatcher._waiting["draft"]
    assert dispatcher._next() == "full"
    dispatcher.ring("full")  # whoever rings does not lose the place
    assert dispatcher._next() == "full"


def test_late_turns_that_take_long_leave_a_worker_to_hands_that_move(dispatchers):
    go, served = threading.Event(), []

    def serve(name: str) -> None:
        served.append(name)
        if name.startswith("late"):
            assert go.wait(SOON)

    dispatcher = dispatchers(serve, workers=3)
    for k in range(4):
        dispatcher.ring(f"late {k}", 0.001)
    until(lambda: len(served) == 2)
    for k in range(20):
        dispatcher.ring(f"hand {k}")
        until(lambda k=k: f"hand {k}" in served)
    assert sum(name.startswith("late") for name in served) == 2
    go.set()
    until(lambda: len(served) == 24)


def test_close_finishes_who_is_served_and_drops_who_waits():
    started, go, done = threading.Event(), threading.Event(), []

    def serve(name: str) -> None:
        started.set()
        go.wait(SOON)
        done.append(name)

    dispatcher = Dispatcher(serve, workers=1)
    dispatcher.ring("a")
    assert started.wait(SOON)
    dispatcher.ring("b")
    closer = threading.Thread(target=dispatcher.close)
    closer.start()
    until(lambda: dispatcher._closed)
    go.set()
    closer.join(SOON)
    assert done == ["a"]


class Canvas:
    """A painter that writes down what it is asked."""

    def __init__(self) -> None:
        self.drawn: list[tuple[ViewState, bool]] = []
        self.refused: list[BaseException] = []
        self.fails: Callable[[ViewState], bool] = lambda _: False
        self.threads: set[str] = set()

    def draw(self, state: ViewState, draft: bool) -> None:
        self.threads.add(threading.current_thread().name)
        if self.fails(state):
            raise ZeroDivisionError("the model is broken")
        self.drawn.append((state, draft))

    def refuse(self, error: BaseException) -> None:
        self.refused.append(error)


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> float:
    """A rest that is worth waiting for in a test."""
    monkeypatch.setattr(module, "REST", 0.05)
    return 0.05


def at(metres: float) -> ViewState:
    return changed(DEFAULT, distance=metres)


def test_a_room_draws_in_full_when_opened_then_a_draft_and_in_full_after_a_rest(dispatchers, quick):
    canvas = Canvas()
    room = Room(DEFAULT, canvas, dispatchers().ring)
    room.open()
    until(lambda: canvas.drawn)
    assert canvas.drawn == [(DEFAULT, False)]
    start = time.monotonic()
    room.go(changed(room.state, distance=0.5))
    until(lambda: (at(0.5), False) in canvas.drawn)
    assert time.monotonic() - start >= quick
    assert canvas.drawn[1] == (at(0.5), True)
    assert canvas.drawn.count((at(0.5), False)) == 1
    assert (
        0.1 <= REST <= 0.5
    )  # seconds: not before a hand has stopped, not so late that a teacher waits


def test_while_values_keep_coming_there_are_only_drafts_and_the_last_value_is_drawn_in_full(
    dispatchers, quick
):
    canvas = Canvas()
    room = Room(DEFAULT, canvas, dispatchers(workers=3).ring)
    for step in range(40):
        room.go(changed(room.state, distance=0.3 + 0.01 * step))
        time.sleep(0.004)
    last = room.state
    until(lambda: (last, False) in canvas.drawn)
    distances = [state.distance for state, _ in canvas.drawn]
    assert distances == sorted(distances)
    # 4 ms apart, a rest of 50 ms cannot come between on a machine that sleeps as long as asked; one that
    # oversleeps tenfold may draw a few states in full
    full = [state for state, draft in canvas.drawn if not draft]
    assert len(full) < 10
    assert full[-1] == last


def test_a_value_that_is_served_late_is_a_draft_first(monkeypatch):
    # else a crowd that waits longer than REST is drawn in full, which takes longer still
    clock, canvas = Clock(), Canvas()
    monkeypatch.setattr(module, "time", clock)
    rings: list[float] = []
    room = Room(DEFAULT, canvas, lambda _, after: rings.append(after))
    for metres in (0.5, 0.6):
        room.go(at(metres))
        clock.now += 10 * REST
        room.serve()
    assert canvas.drawn == [(at(0.5), True), (at(0.6), True)]
    assert rings == [0.0, module.BREATH, 0.0, module.BREATH]
    room.serve()
    assert canvas.drawn[-1] == (at(0.6), False)
    assert len(rings) == 4


def test_a_draft_is_not_drawn_again_while_nothing_changes(dispatchers, quick):
    canvas = Canvas()
    room = Room(DEFAULT, canvas, dispatchers().ring)
    for step in range(20):
        room.go(changed(room.state, distance=0.3 + 0.01 * step))
        time.sleep(0.008)
    until(lambda: (room.state, False) in canvas.drawn)
    drafts = [state for state, draft in canvas.drawn if draft]
    assert len(drafts) == len(set(drafts))


def test_a_change_to_the_same_value_asks_for_nothing():
    rings: list[float] = []
    room = Room(DEFAULT, Canvas(), lambda _, after: rings.append(after))
    room.go(changed(room.state, distance=DEFAULT.distance))
    room.go(changed(DEFAULT))
    assert rings == []
    room.go(changed(room.state, distance=0.5))
    assert rings == [0.0]


def test_what_rests_is_not_drawn_twice():
    canvas = Canvas()
    room = Room(DEFAULT, canvas, lambda _, after: None)
    for _ in range(3):
        room.serve()
    assert canvas.drawn == [(DEFAULT, False)]


def test_an_error_is_refused_in_words_and_the_worker_goes_on(dispatchers, quick):
    canvas = Canvas()
    canvas.fails = lambda state: state.distance < 0.5
    dispatcher = dispatchers(workers=1)
    room = Room(DEFAULT, canvas, dispatcher.ring)
    for distance in (0.3, 0.4, 0.45):
        room.go(changed(room.state, distance=distance))
        count = len(canvas.refused)
        until(lambda count=count: len(canvas.refused) > count)
    room.go(changed(room.state, distance=0.6))
    until(lambda: (at(0.6), False) in canvas.drawn)
    assert {str(error) for error in canvas.refused} == {"the model is broken"}
    assert len(canvas.refused) == 3  # once each: not again when it rests
    assert canvas.threads == {"faceambig-worker-0"}


def test_a_draft_that_fails_once_is_drawn_in_full_when_the_hand_rests(dispatchers, quick):
    canvas, failures = Canvas(), iter([True])
    canvas.fails = lambda _: next(failures, False)
    room = Room(DEFAULT, canvas, dispatchers().ring)
    room.go(at(0.3))
    until(lambda: (at(0.3), False) in canvas.drawn)
    assert len(canvas.refused) == 1


def test_a_state_that_could_not_be_drawn_is_tried_when_it_is_asked_for_again(quick):
    canvas, failures, rings = Canvas(), iter([True]), []
    canvas.fails = lambda _: next(failures, False)
    room = Room(at(0.3), canvas, lambda _, after: rings.append(after))
    room.serve()
    assert len(canvas.refused) == 1
    room.serve()  # by itself it is not
    assert canvas.drawn == []
    room.go(at(0.3))
    assert rings == [0.0]
    time.sleep(quick)
    room.serve()
    room.serve()
    assert canvas.drawn == [(at(0.3), True), (at(0.3), False)]
    room.go(at(0.3))
    assert rings == [0.0, module.BREATH]  # now it is there


def test_a_hand_that_moves_on_over_failures_is_told_once_and_again_where_it_rests(quick):
    canvas = Canvas()
    canvas.fails = lambda _: True
    room = Room(DEFAULT, canvas, lambda _, after: None)
    for distance in (0.3, 0.4, 0.45):
        room.go(at(distance))
        room.serve()
    assert len(canvas.refused) == 1
    time.sleep(quick)
    room.serve()
    assert len(canvas.refused) == 2


def test_the_last_good_state_is_drawn_again_after_one_that_failed(dispatchers, quick):
    canvas = Canvas()
    canvas.fails = lambda state: state.distance < 0.5
    room = Room(DEFAULT, canvas, dispatchers().ring)
    room.open()
    until(lambda: canvas.drawn)
    room.go(changed(room.state, distance=0.3))
    until(lambda: canvas.refused)
    room.go(DEFAULT)
    until(lambda: canvas.drawn.count((DEFAULT, False)) == 2)


def test_a_painter_that_cannot_even_refuse_costs_no_worker(dispatchers, quick):
    # a browser may go between the error and the words about it
    class Gone(Canvas):
        def refuse(self, error: BaseException) -> None:
            raise ConnectionError("the browser has gone")

    gone, canvas = Gone(), Canvas()
    gone.fails = lambda _: True
    dispatcher = dispatchers(workers=1)
    lost, room = (Room(DEFAULT, painter, dispatcher.ring) for painter in (gone, canvas))
    lost.open()
    room.open()
    until(lambda: canvas.drawn)
    lost.go(changed(lost.state, distance=0.5))
    room.go(changed(room.state, distance=0.5))
    until(lambda: (at(0.5), False) in canvas.drawn)


def test_a_room_that_was_left_is_not_served(dispatchers):
    canvas = Canvas()
    room = Room(DEFAULT, canvas, lambda _, after: None)
    room.left = True
    room.serve()
    assert canvas.drawn == []


def test_an_error_of_a_room_that_is_being_left_is_nobodys():
    canvas = Canvas()
    room = Room(DEFAULT, canvas, lambda _, after: None)

    def leave(state: ViewState) -> bool:
        room.left = True
        return True

    canvas.fails = leave
    room.serve()
    assert canvas.refused == []


def test_two_rooms_keep_their_own_states(dispatchers, quick):
    canvases = [Canvas(), Canvas()]
    dispatcher = dispatchers()
    rooms = [Room(DEFAULT, canvas, dispatcher.ring) for canvas in canvases]
    rooms[0].go(changed(rooms[0].state, distance=0.4))
    rooms[1].go(changed(rooms[1].state, distance=0.8))
    for canvas, metres in zip(canvases, (0.4, 0.8), strict=True):
        until(lambda canvas=canvas, metres=metres: (at(metres), False) in canvas.drawn)
        assert {state.distance for state, _ in canvas.drawn} == {metres}
