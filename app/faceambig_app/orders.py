"""Orders: files that browsers ask for, made one after the other by a thread of their own.

A picture or an animation takes up to a minute: nobody's page waits for it, and two at a time would only both be slower.
A browser has one order at a time. It may take it back: before its turn it leaves the line, later the work ends where it
next tells how far it is.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Protocol

FAREWELL = 0.3  # seconds for what is being made when the page is closed; then it is abandoned

Progress = Callable[[int, int], None]  # how much is done, of how much
Work = Callable[[Progress], tuple[str, bytes]]  # makes (name, contents)


class Customer(Protocol):
    """Who has ordered a file. All but `made` are called in order and under the line's lock: they must not wait."""

    def waits(self, before: int) -> None:
        """So many orders come first; 0: it is being made."""

    def goes_on(self, done: int, of: int) -> None:
        """How far the work is."""

    def made(self, name: str, data: bytes) -> None:
        """Take the file; the next one is begun when this returns."""

    def failed(self, error: Exception) -> None:
        """There is no file; the error says why."""


class _Stopped(BaseException):
    """Ends work that is not wanted any more. Not an Exception: what catches those must not go on after this."""


@dataclass(eq=False, slots=True)
class _Order:
    customer: Customer
    work: Work
    begun: bool = False
    stopped: bool = False


class Orders:
    """One thread and the line before it."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._line: list[_Order] = []  # the first is being made
        self._closed = False
        self._thread = threading.Thread(target=self._run, name="faceambig-orders", daemon=True)
        self._thread.start()

    def take(self, customer: Customer, work: Work) -> bool:
        """Put an order into the line; False if the customer has one already."""
        with self._changed:
            if self._closed or any(
                order.customer is customer and not order.stopped for order in self._line
            ):
                return False
            customer.waits(len(self._line))
            self._line.append(_Order(customer, work))
            self._changed.notify()
            return True

    def stop(self, customer: Customer) -> bool:
        """Take the customer's order back: nothing more is heard of it. False if it has none that can be."""
        with self._changed:
            mine = [o for o in self._line if o.customer is customer and not o.stopped]
            for order in mine:
                order.stopped = True
                if not order.begun:
                    self._leave(order)
            return bool(mine)

    def close(self) -> None:
        """Take all orders back; the thread ends at the latest when its work next tells how far it is."""
        with self._changed:
            self._closed = True
            for order in self._line:
                order.stopped = True
            self._changed.notify()
        self._thread.join(timeout=FAREWELL)

    def _run(self) -> None:
        while (order := self._next()) is not None:
            try:
                self._make(order)
            except _Stopped:
                pass
            except Exception as error:  # noqa: BLE001 - whatever a file fails by, the others need this thread
                with self._changed:
                    if not order.stopped:
                        order.customer.failed(error)
            with self._changed:
                self._leave(order)

    def _make(self, order: _Order) -> None:
        name, data = order.work(partial(self._told, order))
        with self._changed:
            wanted = not order.stopped
        if wanted:  # a stop from here on comes too late
            order.customer.made(name, data)

    def _next(self) -> _Order | None:
        """The first of the line, once there is one; None when there will be none."""
        with self._changed:
            while not self._line and not self._closed:
                self._changed.wait()
            if self._closed:
                return None
            self._line[0].begun = True
            return self._line[0]

    def _told(self, order: _Order, done: int, of: int) -> None:
        with self._changed:
            if order.stopped:
                raise _Stopped
            order.customer.goes_on(done, of)

    def _leave(self, order: _Order) -> None:
        """An order leaves the line; those behind it move up."""
        place = self._line.index(order)
        del self._line[place]
        for before, behind in enumerate(self._line[place:], start=place):
            if not behind.stopped:
                behind.customer.waits(before)
