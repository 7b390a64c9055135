"""What one browser does to the others: floods, silence, junk and stalled readers, each followed by a good browser."""

from __future__ import annotations

import concurrent.futures
import contextlib
import gc
import math
import os
import random
import socket
import threading
import time
from collections.abc import Iterator
from typing import Any

import msgspec
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus

from faceambig_app import guard
from faceambig_app.guard import sessions
from guarded import CAMERA, SOON, Browser, Tiny, begin, framed, piece, raw, tiny_page, until

LIMITS = guard.Limits(
    sessions=6,
    first=0.6,
    idle=1.5,
    rate=400.0,
    burst=100.0,
    hurry=1.0,
    waiting=200,
    waiting_bytes=2**20,
)


@pytest.fixture(scope="module")
def tiny() -> Iterator[Tiny]:
    """A page of small limits, so that a test meets them soon."""
    with tiny_page(limits=LIMITS) as page:
        yield page


@pytest.fixture(autouse=True)
def a_good_browser_is_served_afterwards(tiny: Tiny) -> Iterator[None]:
    tiny.forget()
    yield
    assert until(lambda: tiny.sessions < LIMITS.sessions)
    tiny.works()


def close_code(connection: socket.socket) -> int:
    """The code by which the server ends a connection; what comes before is skipped."""
    with connection:
        while True:
            first, size = _exactly(connection, 2)
            if size == 126:
                size = int.from_bytes(_exactly(connection, 2), "big")
            elif size == 127:
                size = int.from_bytes(_exactly(connection, 8), "big")
            content = _exactly(connection, size)
            if first == 0x88:
                return int.from_bytes(content[:2], "big")


def _exactly(connection: socket.socket, size: int) -> bytes:
    content = b""
    while len(content) < size:
        more = connection.recv(size - len(content))
        assert more, "the connection ended without a word"
        content += more
    return content


# ---------------------------------------------------------------- messages


def mutations(count: int) -> list[bytes]:
    """Good messages with bytes changed, cut off and doubled: the same ones each time."""
    chosen = random.Random(7)
    good = [
        msgspec.msgpack.encode(message)
        for message in (
            CAMERA,
            {"type": "GuiUpdateMessage", "uuid": "x", "updates": {"value": 1.5}},
            begin_of("x"),
            {"type": "CommandTriggerMessage", "uuid": "x"},
        )
    ]
    found = []
    for _ in range(count):
        data = bytearray(chosen.choice(good))
        for _ in range(chosen.randint(1, 4)):
            where = chosen.randrange(len(data))
            what = chosen.random()
            if what < 0.6:
                data[where] = chosen.randrange(256)
            elif what < 0.8:
                del data[where : where + chosen.randint(1, 8)]
            else:
                data[where:where] = data[: chosen.randint(1, 8)]
            data = data or bytearray(b"\xc0")
        found.append(bytes(data))
    return found


def begin_of(transfer: str) -> dict[str, Any]:
    return {
        "type": "FileTransferStartUpload", "source_component_uuid": "x", "transfer_uuid": transfer, "filename": "a",
        "mime_type": "b", "part_count": 1, "size_bytes": 5,
    }  # fmt: skip


def test_a_thousand_broken_messages_end_no_connection_by_an_error(
    tiny: Tiny, caplog: pytest.LogCaptureFixture
) -> None:
    broken = mutations(1000)
    for first in range(0, 1000, guard.MAX_BAD - 1):  # one more bad one ends a connection
        with tiny.browser() as (browser, controls):
            for message in broken[first : first + guard.MAX_BAD - 1]:
                browser.send(message)
            browser.set(controls["steps"], 9)
            assert until(lambda c=controls: c["steps"].value == 9)
    assert not tiny.errors
    assert "Traceback" not in caplog.text
    assert len(caplog.text) < 10_000


@pytest.mark.parametrize("size", [guard.MAX_MESSAGE + 1, 8_000_000, 2**40])
def test_a_message_too_large_is_refused_by_its_length_alone(tiny: Tiny, size: int) -> None:
    connection = raw(tiny)
    connection.sendall(bytes([0x82, 0x80 | 127]) + size.to_bytes(8, "big") + bytes(4))
    assert close_code(connection) == 1009  # not a byte of it was sent, so none is held


def test_a_message_too_large_in_pieces_is_refused(tiny: Tiny) -> None:
    connection = raw(tiny)
    piece = bytes(60_000)
    connection.sendall(framed(piece, 0x02))
    with contextlib.suppress(OSError):  # ended while they are being sent
        for _ in range(guard.MAX_MESSAGE // len(piece) + 1):
            connection.sendall(framed(piece, 0x00))
    assert close_code(connection) == 1009


def test_a_compressed_frame_is_an_error_of_protocol(tiny: Tiny) -> None:
    connection = raw(tiny)
    connection.sendall(framed(b"\x00" * 50, 0xC2))  # RSV1: compressed, which nobody agreed to
    assert close_code(connection) == 1002


def test_a_text_frame_and_a_nest_are_dropped(tiny: Tiny) -> None:
    with tiny.browser() as (browser, controls):
        browser.socket.send("text")
        browser.send(b"\x91" * 60_000 + b"\xc0")
        browser.send(b"\xdd\xff\xff\xff\xff")
        browser.set(controls["steps"], 4)
        assert until(lambda: controls["steps"].value == 4)


def test_nothing_is_taken_before_the_first_camera(tiny: Tiny) -> None:
    shared = tiny.server.gui.add_upload_button("All")
    heard: list[object] = []
    shared.on_upload(heard.append)
    try:
        with Browser(tiny.port, camera=False) as browser:
            browser.send(begin(shared, "a", 5))
            browser.send(piece(shared, "a", 0, b"12345"))
            browser.send(CAMERA)
            browser.read(0.2)
            assert not tiny.server.gui._current_file_upload_states
            assert not heard
            browser.send(begin(shared, "a", 5))
            browser.send(piece(shared, "a", 0, b"12345"))
            assert until(lambda: heard)
    finally:
        shared.remove()


def test_junk_is_not_kept_for_those_who_come_later(tiny: Tiny) -> None:
    buffer = tiny.server._websock_server._broadcast_buffer
    before = set(buffer.message_from_id)
    for kind in ("GuiFormDirtyMessage", "GuiFormSubmitMessage", "GuiUpdateMessage"):
        message = {"type": kind} | ({"updates": {"value": 1}} if "Update" in kind else {})
        with Browser(tiny.port) as browser, contextlib.suppress(ConnectionClosed):
            for k in range(150):
                browser.send(message | {"uuid": f"junk-{k}-" + "z" * 50})
            browser.read(0.1)
    assert set(buffer.message_from_id) == before


def test_the_log_stays_small_whatever_is_sent(tiny: Tiny, caplog: pytest.LogCaptureFixture) -> None:
    for k in range(25):
        with Browser(tiny.port) as browser, contextlib.suppress(ConnectionClosed):
            browser.send(CAMERA | {"wxyz": ["\x1b[31mFAKE\r\n" + str(k) + "w" * 200_000]})
            browser.send({"type": "\x1b[2J\r\nFAKE" + "t" * 200_000})
            browser.socket.close()
        assert until(lambda: not tiny.sessions)
    assert len(caplog.records) == 20  # of 25
    assert len(caplog.text) < 5000
    assert "\x1b" not in caplog.text
    assert not any(line.startswith("FAKE") for line in caplog.text.splitlines())


# ---------------------------------------------------------------- speed


def test_a_flooder_is_slowed_then_cut_off_and_others_are_served(tiny: Tiny) -> None:
    heard: list[float] = []

    async def count(_: object) -> None:
        heard.append(time.monotonic())

    with tiny.browser() as (browser, controls), tiny.browser() as (other, others):
        controls["slider"].on_update(count)
        served, start = 0, time.monotonic()

        def flood() -> None:
            for k in range(10**6):
                browser.update(controls["slider"], value=20.5 + k % 500 / 2)

        with concurrent.futures.ThreadPoolExecutor() as pool:
            flooding = pool.submit(flood)
            while not flooding.done():
                other.set(others["steps"], served % 90 + 1)
                assert until(lambda n=served: others["steps"].value == n % 90 + 1)
                served += 1
                assert time.monotonic() < start + 4 * SOON, "it is never cut off"
            end = flooding.exception()
        most = LIMITS.burst + LIMITS.rate * (time.monotonic() - start)
        assert isinstance(end, ConnectionClosed)
        # Who never stops sending may be cut off before the reason is read
        assert end.rcvd is None or (end.rcvd.code, end.rcvd.reason) == (1008, "too fast")
        assert LIMITS.burst < len(heard) <= most
        assert served > 10
    assert not tiny.errors


def test_handlers_at_work_are_counted_and_the_next_message_waits(tiny: Tiny) -> None:
    """A handler that waits takes no more than a few messages at a time."""
    begun: list[int] = []
    with tiny.browser() as (browser, controls):
        release = threading.Event()

        async def slow(event: Any) -> None:
            begun.append(event.target.value)
            while not release.is_set():
                await sessions.asyncio.sleep(0.01)

        controls["steps"].on_update(slow)
        for value in range(1, 61):
            browser.set(controls["steps"], value)
        assert until(lambda: len(begun) >= sessions.AT_WORK // 2)
        time.sleep(0.2)
        assert len(begun) <= sessions.AT_WORK + 2
        release.set()
        assert until(lambda: controls["steps"].value == 60)


def flat(tiny: Tiny, connection: socket.socket) -> Any:
    """The client of a connection by hand; it says so by its camera."""
    connection.sendall(framed(msgspec.msgpack.encode(CAMERA | {"far": 4321.0})))
    return until(lambda: [c["client"] for c in list(tiny.clients.values()) if c["mark"] == 4321.0])[
        -1
    ]


def test_who_does_not_read_is_cut_off_and_what_waits_is_bounded(tiny: Tiny) -> None:
    tiny.clients.clear()
    with raw(tiny, camera=False) as connection, tiny.browser() as (other, others):
        client = flat(tiny, connection)
        sent = 0
        while (
            tiny.sessions == 2 and sent < 1000
        ):  # a notice has a name of its own: none replaces another
            with client._websock_connection.get_message_buffer().sanctioned_dead_writes():
                client.add_notification("x" * 50_000, "")
            other.set(others["steps"], sent % 90 + 1)
            sent += 1
            time.sleep(0.005)
        assert until(lambda: tiny.sessions == 1)
        assert sent < 1000
        other.set(others["steps"], 5)
        assert until(lambda: others["steps"].value == 5)


def test_files_for_who_does_not_read_wait_in_parts(tiny: Tiny) -> None:
    """Three exports of 8 MB: what waits are parts of them, and all end with the browser."""
    tiny.clients.clear()
    ends: list[bool] = []
    with tiny_page() as roomy:  # of the usual limits
        with raw(roomy, camera=False) as connection:
            client = flat(roomy, connection)
            buffer = client._websock_connection.get_message_buffer()
            left = lambda: buffer.done  # noqa: E731
            senders = [
                threading.Thread(
                    target=lambda: ends.append(
                        guard.send_file(client, "a.bin", os.urandom(2**23), left)
                    )
                )
                for _ in range(3)
            ]
            for sender in senders:
                sender.start()
            most = 0
            for _ in range(20):
                time.sleep(0.02)
                with buffer.buffer_lock:
                    most = max(most, sum(map(sessions._weight, buffer.message_from_id.values())))
            assert 0 < most <= 3 * 2 * 2**20 + 10_000  # two parts of each
        for sender in senders:
            sender.join(SOON)
        assert ends == [False] * 3
        roomy.works()


# ---------------------------------------------------------------- how many, how long


def test_browsers_are_limited_and_there_is_room_again(tiny: Tiny) -> None:
    inside: list[Browser] = []
    refused: list[int] = []
    for _ in range(LIMITS.sessions + 15):
        try:
            inside.append(Browser(tiny.port))
        except InvalidStatus as error:
            refused.append(error.response.status_code)
    assert (len(inside), refused) == (LIMITS.sessions, [503] * 15)
    assert tiny.get()[0].status == 200  # the page tells that it is not connected, and tries again
    inside[0].socket.close()
    assert until(lambda: tiny.sessions == LIMITS.sessions - 1)
    tiny_again = Browser(tiny.port)
    for browser in (*inside, tiny_again):
        browser.socket.close()


def test_silent_ones_are_sent_away(tiny: Tiny) -> None:
    with Browser(tiny.port, camera=False) as silent, pytest.raises(ConnectionClosed, match="1008"):
        silent.read(SOON)


def test_idle_ones_are_sent_away_and_busy_ones_stay(tiny: Tiny) -> None:
    with tiny.browser() as (idle, _), tiny.browser() as (busy, controls):
        end = time.monotonic() + 1.5 * LIMITS.idle
        step = 0
        while time.monotonic() < end:
            step += 1
            busy.set(controls["steps"], step % 90)
            time.sleep(0.05)
        with pytest.raises(ConnectionClosed, match="1008"):
            idle.read(SOON)
        busy.set(controls["steps"], 91)
        assert until(lambda: controls["steps"].value == 91)


# ---------------------------------------------------------------- what is left


def test_nothing_of_a_browser_is_left_in_the_process(tiny: Tiny) -> None:
    marker = b"marker-of-" + str(random.Random(3).getrandbits(64)).encode()
    with tiny.browser() as (browser, controls):
        browser.set(controls["text"], marker.decode())
        browser.send(begin(controls["take"], "whole", len(marker)))
        browser.send(piece(controls["take"], "whole", 0, marker))
        browser.send(begin(controls["take"], "half", 512 * 1024 + 5))
        browser.send(piece(controls["take"], "half", 0, marker.ljust(512 * 1024, b".")))
        assert until(lambda: tiny.files and controls["text"].value == marker.decode())
        assert until(lambda: controls["client"].gui._current_file_upload_states)
    assert until(lambda: not tiny.sessions and not tiny.server.get_clients())
    tiny.forget()
    tiny.clients.clear()
    controls.clear()
    browser.values.clear()

    def left() -> list[type]:
        gc.collect()
        return [type(kept) for kept in holders() if holds(kept, marker)]

    assert until(lambda: not left()), left()


def holders() -> list[object]:
    return [o for o in gc.get_objects() if isinstance(o, dict | list | tuple)]


def holds(kept: Any, marker: bytes) -> bool:
    """Whether a container has a text or bytes with the marker in it, longer than the marker of this test."""
    values = kept.values() if isinstance(kept, dict) else kept
    return any(
        (type(v) is bytes and v is not marker and marker in v)
        or (type(v) is str and marker.decode() in v)
        for v in list(values)
    )


def test_numbers_that_are_none_reach_nobody(tiny: Tiny) -> None:
    shared = tiny.server.gui.add_slider("Shared", 0.0, 10.0, 0.1, 5.0)
    try:
        with tiny.browser() as (browser, _), tiny.browser() as (witness, _):
            for value in (math.nan, math.inf, -math.inf, "5", [5], {"a": 1}, True, None):
                browser.set(shared, value)
            browser.set(shared, 6.5)
            assert until(lambda: shared.value == 6.5)
            assert until(lambda: witness.shows(shared) == 6.5)
    finally:
        shared.remove()
