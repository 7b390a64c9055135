"""What the page survives: computations that fail, browsers that vanish, a clock that jumps; over a real socket.

The bad thing comes first; then a good browser, and the one it happened to, are served as if nothing had been.
"""

from __future__ import annotations

import asyncio
import gc
import itertools
import random
import socket
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import viser

from faceambig_app import browser as browser_module
from faceambig_app import drawn, pipeline, server
from faceambig_app.markup import photograph
from faceambig_app.panel import Panel
from faceambig_app.pipeline.scenes import photo_jpeg
from faceambig_app.room import Room
from faceambig_app.stage import Stage
from faceambig_app.state import DEFAULT, changed
from faceambig_app.state.link import query

SOON = 60.0  # seconds: other tests share the processors


@pytest.fixture(scope="module")
def page() -> Iterator[server.Page]:
    served = server.Page("127.0.0.1", 0)
    yield served
    served.close()


@pytest.fixture
def come(page: server.Page, wires: Any) -> Iterator[Callable[..., Any]]:
    """Opens the page in one more browser that has its first frame; all are gone afterwards."""
    opened: list[Any] = []

    def one(query_text: str = "", *, rests: bool = True) -> Any:
        opened.append(wires.Wire(port_of(page), query_text))
        if rests:
            assert opened[-1].rests(SOON)
        return opened[-1]

    yield one
    for wire in opened:
        wire.close()
    until(lambda: not page._browsers)


def port_of(page: server.Page) -> int:
    return int(page.address.rsplit(":", 1)[1].strip("/"))


def until(holds: Callable[[], object]) -> None:
    end = time.monotonic() + SOON
    while not holds():
        assert time.monotonic() < end, "waited too long"
        time.sleep(0.01)


def drag(wire: Any, *steps: int) -> None:
    """The distance along some steps of its slider."""
    slider = wire.control("Slider", "Assumed distance")
    for step in steps:
        wire.set(slider, step)
        wire.read(0.02)


def is_served(wire: Any, step: int) -> None:
    """A drag of a browser ends in a full frame of where it was let go."""
    before = wire.query
    drag(wire, step - 1, step)
    assert wire.wait(lambda: wire.query != before and "distance" in (wire.query or ""), SOON)
    shown = wire.values[wire.control("Slider", "Assumed distance")]
    assert shown == step
    assert wire.meshes > 0


class Fault:
    """Stands before a function and lets its n-th call, counted from 1, raise."""

    def __init__(self, real: Callable[..., Any], n: int, error: BaseException) -> None:
        self._real, self._n, self._error = real, n, error
        self._calls = itertools.count(1)
        self.happened = threading.Event()

    def __call__(self, *args: Any, **options: Any) -> Any:
        if next(self._calls) == self._n:
            self.happened.set()
            raise self._error
        return self._real(*args, **options)

    def __get__(self, instance: object, _owner: object = None) -> Callable[..., Any]:
        """As a method."""
        return self if instance is None else lambda *a, **o: self(instance, *a, **o)


# Each: where a frame is computed or drawn, and by whom it is called
STEPS: dict[str, tuple[Any, str]] = {
    "fit and scene, while a hand moves": (pipeline, "draft"),
    "fit and scene, at rest": (drawn, "frame"),
    "curves": (drawn, "plots_of"),
    "heads": (Stage, "show"),
    "photograph": (drawn.photograph, "photo_marks"),
    "cards": (drawn.figures, "cards"),
    "told": (drawn, "told"),
}
ERRORS = (
    ValueError("a value\nof two lines"),
    FloatingPointError("overflow"),
    MemoryError(),
    np.linalg.LinAlgError("singular"),
    RecursionError("deep"),
    AssertionError(),
    KeyError("a"),
)


@pytest.mark.parametrize(("step", "n"), list(zip(STEPS, (1, 3, 2, 1, 3, 2, 1), strict=True)))
def test_an_error_at_any_call_is_told_and_the_next_drag_works(monkeypatch, come, step, n):
    wire, other = come(), come()
    owner, name = STEPS[step]
    error = ERRORS[(list(STEPS).index(step) + n) % len(ERRORS)]
    fault = Fault(getattr(owner, name), n, error)
    monkeypatch.setattr(owner, name, fault)
    monkeypatch.setattr(drawn, "_KEPT", drawn.Kept(1))  # of what was drawn before
    for at in itertools.cycle((20, 30, 25, 35)):  # until the call has come
        drag(wire, at)
        if fault.happened.wait(0.3):
            break
    assert wire.wait(lambda: wire.notices, SOON)
    told = wire.notices[-1]
    assert told.startswith("That could not be shown: ")
    assert told.endswith(" The last face stays.")
    assert "\n" not in told
    assert "Traceback" not in told
    assert "shown:  The" not in told, "no cause is named"
    is_served(wire, 60)
    is_served(other, 61)
    assert other.notices == []
    assert wire.notices == [told]


def test_numbers_that_are_none_are_refused_before_they_are_sent(monkeypatch, come):
    wire = come()
    real, spoilt = drawn.frame, threading.Event()

    def nan_once(*args: Any, **options: Any) -> Any:
        shown = real(*args, **options)
        if spoilt.is_set():
            return shown
        spoilt.set()
        heads = [replace(head, vertices=head.vertices * np.nan) for head in shown.scene.heads]
        return replace(shown, scene=replace(shown.scene, heads=tuple(heads)))

    drag(wire, 40)  # the last good frame is of here
    assert wire.wait(lambda: "distance" in wire.query, SOON)
    seen: list[bool] = []
    stage = Stage.show

    def look(self: Stage, scene: Any, draft: bool) -> None:
        seen.append(all(np.isfinite(head.vertices).all() for head in scene.heads))
        stage(self, scene, draft)

    monkeypatch.setattr(Stage, "show", look)
    monkeypatch.setattr(drawn, "_KEPT", drawn.Kept())  # of what was drawn before
    monkeypatch.setattr(drawn, "frame", nan_once)
    drag(wire, 30)
    assert wire.wait(lambda: wire.notices, SOON)
    assert "not finite" in wire.notices[0]
    is_served(wire, 50)
    assert seen
    assert all(seen)


def test_what_a_failed_frame_did_not_send_is_sent_by_the_next(monkeypatch, come):
    """The photograph, its crosses and the plots are sent when they change: a frame that fails has not sent them."""
    wire, real, fails = come(), Stage.show, threading.Event()
    fails.set()

    def show(self: Stage, scene: Any, draft: bool) -> None:
        if fails.is_set() and not draft:
            raise MemoryError
        real(self, scene, draft)

    monkeypatch.setattr(Stage, "show", show)
    wire.set(wire.control("Dropdown", "Person"), "Person 5")
    assert wire.wait(lambda: wire.notices, SOON)
    picture = photograph.photo_picture(photo_jpeg(changed(DEFAULT, subject=5).target, False))
    assert picture not in wire.shown
    fails.clear()
    drag(wire, 40)
    assert wire.wait(lambda: "distance" in wire.query, SOON)
    assert picture in wire.shown


def test_a_browser_that_cannot_be_made_costs_the_others_nothing(monkeypatch, page, come, wires):
    good = come()
    fault = Fault(Panel.__init__, 1, RuntimeError("no panel today"))
    monkeypatch.setattr(browser_module, "Panel", lambda *a, **o: fault(object(), *a, **o))
    lost = wires.Wire(port_of(page))
    until(fault.happened.is_set)
    monkeypatch.undo()
    is_served(good, 40)
    lost.close()
    until(lambda: len(page._server.get_clients()) == 1)
    assert len(page._browsers) == 1
    is_served(come(), 41)


def test_an_error_while_a_browser_leaves_leaves_nothing(monkeypatch, page, come):
    wire = come()
    fault = Fault(browser_module.Browser.leave, 1, RuntimeError("no farewell"))
    monkeypatch.setattr(browser_module.Browser, "leave", fault)
    wire.close()
    until(fault.happened.is_set)
    until(lambda: not page._browsers and not page._server.get_clients())
    is_served(come(), 41)


def test_a_clock_of_the_day_that_jumps_moves_nothing(monkeypatch, come):
    wire, real = come(), time.time  # noqa: TID251 - what others may have asked
    jumps = itertools.cycle([-3600.0, 0.0, 86_400.0, -1e9])
    monkeypatch.setattr(time, "time", lambda: max(0.0, real() + next(jumps)))
    drag(wire, *range(20, 40))
    is_served(wire, 45)
    history = wire.control("ButtonGroup", "History")
    wire.set(history, "Undo")  # the drag is one step of it
    assert wire.wait(lambda: wire.query == "", SOON)
    assert wire.notices == []


def test_nothing_is_computed_where_messages_are_heard(monkeypatch, come):
    """A computation on the event loop would keep everybody waiting."""
    names: set[str] = set()

    def told(real: Callable[..., Any]) -> Callable[..., Any]:
        def call(*args: Any, **options: Any) -> Any:
            names.add(threading.current_thread().name)
            return real(*args, **options)

        return call

    for owner, name in STEPS.values():
        monkeypatch.setattr(owner, name, told(getattr(owner, name)))
    wire = come()
    is_served(wire, 33)
    wire.set(wire.control("ButtonGroup", "Surface"), "Difference")
    assert wire.wait(lambda: "surface" in wire.query, SOON)
    assert names
    assert {name.rsplit("-", 1)[0] for name in names} == {"faceambig-worker"}


# ---------------------------------------------------------------- browsers that vanish


def handshake(port: int) -> bytes:
    return (
        f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nOrigin: http://127.0.0.1:{port}\r\nUpgrade: websocket\r\n"
        "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
        "Sec-WebSocket-Protocol: viser-v1.1.1\r\n\r\n"
    ).encode()


def broken_off(port: int, rng: random.Random) -> None:
    """A request, a handshake or a frame of which only a part comes; then the connection is reset."""
    whole = handshake(port)
    frame = bytes([0x82, 0xFE, 0x40, 0x00, 1, 2, 3, 4]) + rng.randbytes(rng.randint(0, 200))
    sent = rng.choice([whole[: rng.randint(0, len(whole))], whole + frame, whole])
    with socket.create_connection(("127.0.0.1", port), timeout=SOON) as raw:
        raw.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\x01\0\0\0\0\0\0\0")
        raw.sendall(sent)
        time.sleep(rng.choice([0.0, 0.01]))


def held(page: server.Page) -> tuple[int, int, int, int]:
    """Descriptors, threads, tasks and what was made for single browsers, when all have left."""
    until(lambda: not page._browsers and not page._server.get_clients())
    loop = page._server.get_event_loop()
    settled = len(asyncio.all_tasks(loop))
    for _ in range(200):  # the last connections are being closed
        time.sleep(0.01)
        if (now := len(asyncio.all_tasks(loop))) == settled and now <= 1:
            break
        settled = now
    gc.collect()
    folder = Path("/proc/self/fd")  # no such folder: not counted
    descriptors = len(list(folder.iterdir())) if folder.exists() else 0
    kinds = (browser_module.Browser, Room, Panel, Stage, viser.ClientHandle)
    left = sum(type(thing) in kinds for thing in gc.get_objects())  # all objects are noise: caches
    return descriptors, threading.active_count(), settled, left


def settled(page: server.Page, before: list[tuple[int, ...]]) -> tuple[int, ...]:
    """What is held when the workers have let go of the last browser, too: as little as before, or what stays."""
    end = time.monotonic() + SOON
    while (now := held(page)) and before and now[3] > before[-1][3] and time.monotonic() < end:
        time.sleep(0.2)
    return now


def test_connections_that_break_at_any_time_leave_nothing(page, wires):
    rng, counts = random.Random(7), []
    for cycle in range(20):
        for _ in range(4):
            broken_off(port_of(page), rng)
        wire = wires.Wire(port_of(page), query(changed(DEFAULT, subject=1 + cycle % 3)))
        end = time.monotonic() + rng.choice([0.0, 0.1, 0.4, 1.0])
        while (
            time.monotonic() < end
        ):  # in the midst of the first frame, of a drag, of a frame at rest
            wire.read(0.01)
            if wire.controls and "address" in wire.told:
                drag(wire, rng.randint(5, 90))
        wire.vanish()
        if cycle >= 8 and cycle % 3 == 2:  # caches are filled by then
            counts.append(settled(page, counts))
    cycles = np.arange(len(counts)) * 3.0
    slopes = np.polyfit(cycles, np.array(counts), 1)[0]
    assert slopes.max() < 0.2, counts  # a leak is one a cycle, or five
    wire = wires.Wire(port_of(page))
    assert wire.rests(SOON)
    is_served(wire, 44)
    wire.close()
