"""The line of exports: one at a time, in order; taken back, left and failed orders let the next one go on."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from faceambig_app.orders import Orders, Progress

SOON = 10.0  # seconds: far more than anything here takes on a busy machine


def until(holds: Callable[[], object]) -> None:
    end = time.monotonic() + SOON
    while not holds():
        assert time.monotonic() < end, "waited too long"
        time.sleep(0.001)


@pytest.fixture
def orders() -> Iterator[Orders]:
    made = Orders()
    yield made
    made.close()
    assert not made._thread.is_alive()


class Customer:
    """Writes down what it is told."""

    def __init__(self) -> None:
        self.heard: list[tuple[Any, ...]] = []

    def waits(self, before: int) -> None:
        self.heard.append(("waits", before))

    def goes_on(self, done: int, of: int) -> None:
        self.heard.append(("goes on", done, of))

    def made(self, name: str, data: bytes) -> None:
        self.heard.append(("made", name, data))

    def failed(self, error: Exception) -> None:
        self.heard.append(("failed", str(error)))


class Slow:
    """Work of two steps that begins and goes on when it is let."""

    def __init__(self, name: str) -> None:
        self.name, self.begun, self.ended = name, threading.Event(), threading.Event()
        self.go_on = threading.Event()

    def __call__(self, progress: Progress) -> tuple[str, bytes]:
        try:
            self.begun.set()
            progress(0, 2)
            assert self.go_on.wait(SOON)
            progress(1, 2)
            return self.name, b"data"
        finally:
            self.ended.set()


def quick(name: str) -> Callable[[Progress], tuple[str, bytes]]:
    return lambda _: (name, b"")


def test_orders_are_made_one_at_a_time_in_their_order_and_hear_how_many_come_first(orders):
    customers = [Customer() for _ in range(3)]
    works = [Slow(name) for name in "abc"]
    for customer, work in zip(customers, works, strict=True):
        assert orders.take(customer, work)
    for work, rest in zip(works, ((1, 2), (2,), ()), strict=True):
        assert work.begun.wait(SOON)
        assert not any(works[other].begun.is_set() for other in rest)
        work.go_on.set()
    until(lambda: ("made", "c", b"data") in customers[2].heard)
    for number, customer in enumerate(customers):
        assert customer.heard == [
            *(("waits", before) for before in range(number, -1, -1)),
            ("goes on", 0, 2), ("goes on", 1, 2), ("made", "abc"[number], b"data"),
        ]  # fmt: skip


def test_a_customer_has_one_order_at_a_time_and_may_come_again(orders):
    me, work = Customer(), Slow("a")
    assert orders.take(me, work)
    assert not orders.take(me, quick("b"))
    work.go_on.set()
    until(lambda: me.heard[-1][0] == "made")
    until(lambda: orders.take(me, quick("c")))
    until(lambda: me.heard[-1] == ("made", "c", b""))


def test_an_order_that_is_taken_back_in_the_line_is_never_begun_and_others_move_up(orders):
    first, second, third = (Customer() for _ in range(3))
    running, gone = Slow("a"), Slow("b")
    orders.take(first, running)
    assert running.begun.wait(SOON)
    orders.take(second, gone)
    orders.take(third, quick("c"))
    assert orders.stop(second)
    assert not orders.stop(second)
    assert third.heard == [("waits", 2), ("waits", 1)]
    running.go_on.set()
    until(lambda: third.heard[-1][0] == "made")
    assert not gone.begun.is_set()
    assert second.heard == [("waits", 1)]


def test_work_that_is_stopped_ends_at_its_next_step_and_says_nothing_more(orders):
    me, you, work = Customer(), Customer(), Slow("a")
    orders.take(me, work)
    until(lambda: ("goes on", 0, 2) in me.heard)
    orders.take(you, quick("b"))
    assert orders.stop(me)
    assert orders.take(me, quick("again"))  # at once, though the thread is still at the old one
    work.go_on.set()
    until(lambda: me.heard[-1] == ("made", "again", b""))
    assert work.ended.is_set()
    assert you.heard[-1] == ("made", "b", b"")
    kinds = [heard[0] for heard in me.heard]
    assert kinds.count("made") == 1
    assert ("goes on", 1, 2) not in me.heard
    assert "failed" not in kinds


def test_a_file_that_is_finished_after_all_is_not_handed_over(orders):
    me, work = Customer(), Slow("a")
    heedless = threading.Event()

    def no_steps(progress: Progress) -> tuple[str, bytes]:
        heedless.set()
        assert work.go_on.wait(SOON)
        return "a", b""

    orders.take(me, no_steps)
    assert heedless.wait(SOON)
    orders.stop(me)
    work.go_on.set()
    you = Customer()
    orders.take(you, quick("b"))
    until(lambda: you.heard[-1][0] == "made")
    assert "made" not in [heard[0] for heard in me.heard]


def test_an_error_is_told_and_the_next_file_is_made(orders):
    me, you = Customer(), Customer()

    def fails(_: Progress) -> tuple[str, bytes]:
        raise ValueError("no such face")

    orders.take(me, fails)
    orders.take(you, quick("b"))
    until(lambda: you.heard and you.heard[-1][0] == "made")
    assert me.heard[-1] == ("failed", "no such face")


def test_an_error_of_who_takes_the_file_costs_no_thread(orders):
    class Torn(Customer):
        def made(self, name: str, data: bytes) -> None:
            raise OSError("the line is dead")

    me, you = Torn(), Customer()
    orders.take(me, quick("a"))
    orders.take(you, quick("b"))
    until(lambda: you.heard and you.heard[-1][0] == "made")
    assert me.heard[-1] == ("failed", "the line is dead")


def test_closing_ends_the_work_and_the_line():
    orders, me, you, work = Orders(), Customer(), Customer(), Slow("a")
    orders.take(me, work)
    assert work.begun.wait(SOON)
    orders.take(you, quick("b"))
    threading.Timer(0.05, work.go_on.set).start()
    orders.close()
    assert not orders._thread.is_alive()
    assert "made" not in [heard[0] for heard in me.heard + you.heard]
    assert not orders.take(me, quick("c"))
