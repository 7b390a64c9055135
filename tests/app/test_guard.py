"""The guard over a real socket: bad things first, then a good browser is still served."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import gzip
import logging
import math
import socket
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import cast

import msgspec
import numpy as np
import pytest
import viser
from viser import _viser
from websockets.exceptions import ConnectionClosed, InvalidStatus

from faceambig_app import guard
from guarded import (
    CAMERA,
    PART,
    SOON,
    Browser,
    Tiny,
    begin,
    framed,
    on_the_way,
    piece,
    raw,
    tiny_page,
    until,
)


@pytest.fixture(scope="module")
def tiny() -> Iterator[Tiny]:
    with tiny_page() as page:
        yield page


@pytest.fixture(autouse=True)
def forget(tiny: Tiny) -> None:
    tiny.forget()


# ---------------------------------------------------------------- starting


@pytest.mark.parametrize(
    ("host", "port", "words"),
    [
        ("nosuch.invalid", 0, "host 'nosuch.invalid'"),
        ("0.0.0.0", 0, "needs a token"),
        ("192.0.2.1", 0, "port 0 at 192.0.2.1"),
        ("::", 0, "needs a token"),
        ("127.0.0.1", 70000, "port 70000"),
        ("127.0.0.1", -1, "port -1"),
    ],
)
def test_a_place_that_cannot_be_is_refused_in_a_line(host: str, port: int, words: str) -> None:
    with pytest.raises(guard.ServeError, match=words) as caught:
        guard.start(host, port)
    assert "\n" not in str(caught.value)


def test_a_taken_port_is_refused(tiny: Tiny) -> None:
    with pytest.raises(guard.ServeError, match=f"port {tiny.port} is taken"):
        guard.start(port=tiny.port)


def test_another_viser_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(viser, "__version__", "1.1.2")
    with pytest.raises(guard.ServeError, match=r"viser 1\.1\.2: the page needs 1\.1\.1"):
        guard.start(port=0)


def test_a_bundle_that_is_not_as_expected_is_refused() -> None:
    with pytest.raises(guard.ServeError, match="its script is not as expected"):
        guard.start(port=0, patches=[("function RL(", "")] * 2)


def test_nothing_is_printed_by_viser(capfd: pytest.CaptureFixture[str]) -> None:
    guard.start(port=0).stop()
    assert capfd.readouterr() == ("", "")


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have one loopback address")
def test_this_machine_only(tiny: Tiny) -> None:
    with socket.socket() as other:  # an address that is ours only if nobody listens on all of them
        other.bind(("127.0.0.2", tiny.port))


# ---------------------------------------------------------------- requests


def test_the_page(tiny: Tiny) -> None:
    for target in ("/", "/index.html", "/?distance=1.2&darkMode=1"):
        answer, plain = tiny.get(target)
        assert answer.status == 200
    _, packed = tiny.get(Accept_Encoding="gzip, br")
    assert gzip.decompress(packed) == plain
    assert plain.index(b"data-faceambig") < plain.index(b"data-p=")  # our script is before viser's
    assert b"<title>faceambig</title>" in plain


def asked(tiny: Tiny, *lines: str, target: str = "/") -> int:
    """The status of a request with these lines alone."""
    with socket.create_connection((tiny.host, tiny.port), timeout=SOON) as connection:
        connection.sendall(
            ("\r\n".join([f"GET {target} HTTP/1.1", *lines]) + "\r\n\r\n").encode("latin-1")
        )
        return int(connection.recv(4096).split()[1])


HOSTILE_PATHS = (
    "/../../../../etc/passwd", "/..%2f..%2f..%2f..%2fetc/passwd", "/%2e%2e/%2e%2e/%2e%2e/etc/passwd", "/..",
    "/..%252f..%252fetc/passwd", "/%252e%252e/etc/passwd", "/....//....//etc/passwd", "/..;/etc/passwd", "/%2e%2e/x",
    "/..\\..\\..\\etc\\passwd", "/..%5c..%5cetc%5cpasswd", "/%c0%ae%c0%ae/etc/passwd", "//etc/passwd",
    "/%2fetc%2fpasswd", "///etc/passwd", "/etc/passwd%00.html", "/index.html%00", "/./../viser/__init__.py",
    "/../__init__.py", "/../index.html", "/~root/.bashrc", "/proc/self/environ", "/C:/Windows/win.ini",
    "/c:%5cWindows%5cwin.ini", "/C:Windows/win.ini", "/C%3a/Windows/win.ini", "/x%00.js",
    "/%5c%5clocalhost%5cC$%5cWindows%5cwin.ini", "//localhost/C$/Windows/win.ini", "/%3f%3f/C:/Windows/win.ini",
    "/file:///etc/passwd", "/index.html::$DATA", "/index.html.", "/CON", "/NUL", "/AUX.txt", "/.git/config", "/.env",
    "/" + "a" * 5000, "/%", "/%zz", "http://127.0.0.1:22/", "http://evil.example/", "//evil.example/", "/\xff",
    # the page by other spellings, which a server of files would know
    "//", "/./index.html", "//index.html", "/%69ndex.html", "/.//index.html", "/index.html/", "/\\index.html",
    "/x/%2e/index.html", "/index.html?a=\xff",
)  # fmt: skip


@pytest.mark.parametrize("path", HOSTILE_PATHS, ids=lambda path: path[:24])
def test_there_is_no_other_file(tiny: Tiny, path: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def touched(*_: object, **__: object) -> None:
        raise AssertionError("a request has reached the file system")  # answered by 500

    # On Windows drives and devices are paths too: here nothing is asked of the file system at all
    for name in ("open", "stat", "is_file", "exists", "read_bytes"):
        monkeypatch.setattr(Path, name, touched)
    assert asked(tiny, f"Host: {tiny.netloc}", target=path) == 404


@pytest.mark.parametrize(
    "host",
    [
        "", "evil.example", "evil.example:{}", "127.0.0.1.evil.example:{}", "localhost.evil.example:{}",
        "evil.example#127.0.0.1:{}", "127.0.0.1@evil.example:{}", "0.0.0.0:{}", "[::]:{}", "127.0.0.1", "127.0.0.1:1",
        "2130706433:{}", "127.1:{}", "127.0.0.2:{}", "127.0.0.1:{}, evil.example", "127.0.0.1:{}.",
    ],
)  # fmt: skip
def test_a_foreign_host_is_refused(tiny: Tiny, host: str) -> None:
    host = host.format(tiny.port)
    assert tiny.get(Host=host)[0].status == 421
    with pytest.raises(InvalidStatus, match="421"):
        Browser(tiny.port, additional_headers={"Host": host}, origin=None)


WEBSOCKET = (
    "Connection: Upgrade", "Upgrade: websocket", "Sec-WebSocket-Version: 13",
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==", "Sec-WebSocket-Protocol: viser-v1.1.1",
)  # fmt: skip


def test_said_twice_is_refused(tiny: Tiny) -> None:
    host, origin = f"Host: {tiny.netloc}", f"Origin: http://{tiny.netloc}"
    assert asked(tiny, host) == 200
    assert asked(tiny, host, "Host: evil.example") == 421
    assert asked(tiny, host, host) == 421
    assert asked(tiny, host, origin, *WEBSOCKET) == 101
    assert asked(tiny, host, origin, "Origin: http://evil.example", *WEBSOCKET) == 403
    assert asked(tiny, host, origin, "Upgrade: h2c", *WEBSOCKET) == 400
    assert until(lambda: not tiny.sessions)


def test_own_hosts_are_served(tiny: Tiny) -> None:
    for host in (tiny.netloc, f"localhost:{tiny.port}", f"LOCALHOST:{tiny.port}"):
        assert tiny.get(Host=host)[0].status == 200


@pytest.mark.parametrize(
    "origin",
    [
        "http://evil.example", "http://evil.example:{port}", "http://127.0.0.1.evil.example:{port}",
        "http://localhost.evil.example:{port}", "http://evil127.0.0.1:{port}", "http://{}.evil.example",
        "http://{}@evil.example", "null", "file://", "http://127.0.0.1:1", "http://127.0.0.1", "ftp://{}",
        "http://[::1]:{port}", "", "HTTP://EVIL.EXAMPLE", "http://{}/x", "https://{}", "http://localhost:{port}",
    ],
)  # fmt: skip
def test_a_foreign_origin_is_refused(tiny: Tiny, origin: str) -> None:
    with pytest.raises(InvalidStatus, match="403"):
        Browser(tiny.port, origin=origin.format(tiny.netloc, port=tiny.port))


@pytest.mark.parametrize(
    ("query", "left"),
    [
        ("websocket=ws://evil.example:1/", "?ignored=websocket"),
        (
            "playbackPath=//evil.example/a.viser&distance=1.2",
            "?distance=1.2&ignored=playbackPath",
        ),
        ("web%73ocket=x&view=top&view=%66", "?view=top&view=%66&ignored=websocket"),
        ("WEBSOCKET=x", "?ignored=WEBSOCKET"),
        ("x=1&websocket=ws%3A%2F%2Fevil.example", "?ignored=x,websocket"),
        ("token=x", "?ignored=token"),
        ("distance&&view=1", "?distance&view=1"),
        ("&", ""),
        ("=x", "?ignored=_"),
        ("a%0d%0aSet-Cookie:x=1&<b>=2&%ff%e2%80%ae=3", "?ignored=a__Set-Cookie_x,_b_,__"),
        ("spin=1&ignored=lens&spin=2", "?ignored=spin,lens"),
        ("ignored=lens&distance=2", "?distance=2&ignored=lens"),
        ("ignored=<b>", ""),
        ("ignored=a,,b&distance=2", "?distance=2"),
        ("&".join(f"k{n}{'x' * 90}=1" for n in range(20)), "?ignored=" + ",".join(f"k{n}{'x' * 22}" for n in range(8))),
    ],
)  # fmt: skip
def test_the_address_keeps_our_words_only_and_names_the_others(
    tiny: Tiny, query: str, left: str
) -> None:
    answer, _ = tiny.get(f"/?{query}")
    assert (answer.status, answer.headers["Location"]) == (303, f"/{left}")
    again, _ = tiny.get(f"/{left}")
    assert again.status == 200  # sent there, a browser stays


def test_every_answer_is_dressed(tiny: Tiny) -> None:
    answers = [tiny.get()[0], tiny.get("/x")[0], tiny.get("/?x=1")[0], tiny.get(Host="x")[0]]
    answers.append(tiny.get(Upgrade="websocket", Origin="http://evil.example")[0])
    answers.append(tiny.get(Upgrade="websocket")[0])  # this one is answered by websockets itself
    assert [answer.status for answer in answers] == [200, 404, 303, 421, 403, 426]
    for answer in answers:
        policy = answer.headers["Content-Security-Policy"]
        assert "'unsafe-eval'" not in policy
        assert f"connect-src 'self' ws://{tiny.netloc} " in policy
        assert policy.count("'sha256-") == 3
        assert answer.headers["X-Content-Type-Options"] == "nosniff"
        assert answer.headers["X-Frame-Options"] == "DENY"
        assert answer.headers["Referrer-Policy"] == "no-referrer"
        assert answer.headers["Cache-Control"] == "no-store"
        assert "Server" not in answer.headers


def test_compression_is_never_agreed(tiny: Tiny) -> None:
    with Browser(tiny.port, compression="deflate") as browser:
        assert browser.socket.protocol.extensions == []


# ---------------------------------------------------------------- messages

GARBAGE = (
    b"", b"\xc1", b"\x80", b"\xff" * 99, b"\x91" * 5000, msgspec.msgpack.encode([1]), {"type": 3},
    {"type": "Message"}, {"type": "NoSuch"}, {"type": "ShareUrlRequest"}, {"type": "ShareUrlDisconnect"},
    {"type": "RunJavascriptMessage", "source": "1"}, {"type": "GuiUpdateMessage", "uuid": 1, "updates": {}},
    {"type": "GuiUpdateMessage", "uuid": "x", "updates": []},
    {"type": "GuiUpdateMessage", "uuid": "x", "updates": {}, "y": 1},
    CAMERA | {"fov": math.nan}, CAMERA | {"position": (0.0, math.inf, 0.0)}, CAMERA | {"wxyz": (1.0,)},
    CAMERA | {"image_height": 10**12}, CAMERA | {"up_direction": "up"}, {"type": "ViewerCameraMessage"},
)  # fmt: skip


def test_garbage_is_dropped_and_hurts_nobody(
    tiny: Tiny, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    with tiny.browser() as (browser, controls):
        for message in GARBAGE:
            browser.send(message)
        browser.send(CAMERA | {"image_height": 0})  # a canvas that is folded away
        browser.set(controls["steps"], 7)
        assert until(lambda: controls["steps"].value == 7)
        assert controls["client"].camera.aspect > 0
        assert len(caplog.records) == 1
        assert "\n" not in caplog.text.strip()
        with contextlib.suppress(ConnectionClosed):  # it may be closed before all are sent
            for _ in range(guard.MAX_BAD):
                browser.send(b"\xc1")
        with pytest.raises(ConnectionClosed, match="1008"):
            browser.read(SOON)
    assert not tiny.errors


def test_a_message_too_large_ends_its_own_connection(tiny: Tiny) -> None:
    with tiny.browser() as (browser, _):
        browser.send(bytes(guard.MAX_MESSAGE + 1))
        with pytest.raises(ConnectionClosed, match="1009"):
            browser.read(SOON)


def test_there_is_no_tunnel(tiny: Tiny, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(guard.ServeError, match="not published"):
        vars(_viser)["ViserTunnel"]("share.example", 80)
    asked: list[object] = []
    monkeypatch.setattr(_viser, "ViserTunnel", lambda *place: asked.append(place))
    with tiny.browser() as (browser, controls):
        for _ in range(3):
            browser.send({"type": "ShareUrlRequest"})
            browser.send({"type": "ShareUrlDisconnect"})
        browser.set(controls["steps"], 7)
        assert until(lambda: controls["steps"].value == 7)
    assert not asked
    assert tiny.server._share_tunnel is None


# ---------------------------------------------------------------- uploads


def test_a_file_is_taken_whole_and_the_control_keeps_nothing(tiny: Tiny) -> None:
    with tiny.browser() as (browser, controls):
        take, data = controls["take"], bytes(range(256)) * 2500  # two parts
        browser.send(begin(take, "a", len(data), name="C:\\own\\..\\me\x1b<b>.png"))
        for index in (1, 0, 0):  # in any order, and once too often
            browser.send(piece(take, "a", index, data[index * PART : (index + 1) * PART]))
        assert until(lambda: tiny.files)
        assert tiny.files == [("me__b_.png", data)]
        assert take.value.content == b""
        assert on_the_way(controls["client"]) == 0
    assert not tiny.refused
    assert not tiny.errors


def test_files_that_are_not_offered_or_too_large_are_not_begun(tiny: Tiny) -> None:
    with tiny.browser() as (browser, controls):
        take = controls["take"]
        most = guard.MAX_UPLOAD
        bad = [
            begin(take, "large", most + 1), begin(take, "none", 0), begin(take, "lie", 5, parts=2),
            begin(controls["upload"], "unheard", 5), begin(controls["slider"], "slider", 5),
        ]  # fmt: skip
        for message in bad:
            browser.send(message)
            browser.send(piece(take, message["transfer_uuid"], 0, b"12345"))
        browser.send(begin(take, "half", most // 2 + 1))
        browser.send(begin(take, "other", most // 2))  # together more than one may send
        browser.send(begin(take, "small", 5))
        browser.send(begin(take, "third", 5))
        browser.send(piece(take, "small", 0, b"123456"))  # longer than it said
        browser.send(piece(take, "small", 7, b"12345"))
        browser.send(piece(take, "half", 0, bytes(PART - 1)))  # shorter than a part is
        browser.set(controls["steps"], 7)
        assert until(lambda: controls["steps"].value == 7)
        states = controls["client"].gui._current_file_upload_states
        assert set(states) == {"half", "small"}
        assert on_the_way(controls["client"]) == 0
        assert len(tiny.refused) == 5  # too large, empty, a lie, together too much, a third
        browser.send(piece(take, "small", 0, b"12345"))
        assert until(lambda: tiny.files) == [("me.png", b"12345")]


def test_nobody_sends_for_another_and_what_is_half_sent_goes_with_the_browser(tiny: Tiny) -> None:
    with tiny.browser() as (browser, controls), tiny.browser() as (other, others):
        take, gui = controls["take"], controls["client"].gui
        browser.send(begin(take, "mine", PART + 5))
        browser.send(piece(take, "mine", 0, bytes(PART)))
        assert until(lambda: on_the_way(controls["client"]) == PART)
        other.send(piece(take, "mine", 1, b"54321"))
        other.set(others["steps"], 3)
        assert until(lambda: others["steps"].value == 3)
        assert on_the_way(controls["client"]) == PART
        browser.socket.close()
        assert until(lambda: not gui._current_file_upload_states)
    assert not tiny.files


# ---------------------------------------------------------------- values

ALLOWED = (
    ("slider", 20.5), ("slider", 300), ("steps", 96), ("steps", 12.0), ("number", 33.3), ("on", False),
    ("text", "Ünal\n2"), ("text", ""), ("view", "side"), ("show", "one"), ("size", [0, 9, 4.5]),
    ("tint", [0, 255, 7]), ("range", [0.3, 0.4]),
)  # fmt: skip
OF_NO_KIND = (
    ("slider", math.nan), ("slider", math.inf), ("slider", "30"), ("slider", None), ("slider", True), ("slider", [30]),
    ("slider", {}), ("steps", -math.inf), ("number", math.nan), ("on", "false"), ("on", 0), ("on", None), ("text", 5),
    ("text", "a" * 10_001), ("text", "a\x00"), ("text", "\x1b[2J"), ("view", "top"), ("view", 0), ("view", ["front"]),
    ("show", "none"), ("size", [1, 2]), ("size", [1, 2, math.nan]), ("size", [1, 2, 99]), ("size", "abc"), ("size", 3),
    ("tint", [0, 0, 256]), ("tint", [0.5, 0, 0]), ("tint", [-1, 0, 0]), ("range", [0.8, 0.2]), ("range", [0.5]),
    ("range", [0.1, 1.2]), ("upload", "x"), ("upload", {"name": "x", "content": b""}), ("off", 7), ("gone", 7),
    ("done", 50.0), ("done", math.nan),
)  # fmt: skip


def test_right_values_are_taken(tiny: Tiny) -> None:
    with tiny.browser() as (browser, controls):
        for name, value in ALLOWED:
            browser.set(controls[name], value)
            put = tuple(value) if isinstance(value, list) else value
            assert until(lambda name=name, put=put: controls[name].value == put), (name, value)
            assert type(controls["steps"].value) is int
        browser.set(controls["slider"], math.nextafter(300.0, math.inf))  # steps counted in doubles
        assert until(lambda: controls["slider"].value == 300.0, 0.5)
    assert not tiny.refused


def test_values_of_no_kind_are_put_back(tiny: Tiny) -> None:
    with tiny.browser() as (browser, controls):
        before = {name: controls[name].value for name, _ in OF_NO_KIND}
        for name, value in OF_NO_KIND:
            browser.set(controls[name], value)
            browser.read(0.02)
        browser.set(controls["steps"], 9)
        assert until(lambda: controls["steps"].value == 9)
        for name in before.keys() - {"steps"}:
            value = before[name]
            assert controls[name].value == value
            if name not in ("upload", "show"):  # these show no value
                right = list(value) if isinstance(value, tuple) else value
                assert browser.shows(controls[name]) == right, name
        said = (
            len(OF_NO_KIND) - 4
        )  # of a disabled or hidden one, and of one that only shows, nothing is said
        assert len(tiny.refused) == said
    assert not tiny.errors


def test_only_the_value_can_be_set(tiny: Tiny) -> None:
    with tiny.browser() as (browser, controls):
        slider = controls["slider"]
        for name in (
            "removed",
            "update_cb",
            "sync_cb",
            "gui_api",
            "is_button",
            "props",
            "__dict__",
            "uuid",
        ):
            browser.update(slider, **{name: True})
            browser.update(slider, **{name: True, "value": 40.0})
        browser.set(slider, 50.0)
        assert until(lambda: slider.value == 50.0)


def test_a_number_out_of_range_waits_for_the_end_of_typing(tiny: Tiny) -> None:
    with tiny.browser() as (browser, controls):
        typed = controls["number"]
        for value in (1, 12, 125):
            browser.set(typed, value)
            time.sleep(0.05)
            assert typed.value in (120, 125)
        assert until(lambda: typed.value == 125)
        time.sleep(guard.TYPING + 0.1)
        assert not tiny.refused
        browser.set(typed, 5)
        assert until(lambda: tiny.refused)
        assert tiny.refused[0] == (controls["client"].client_id, "Typed: 5, set to 20.0")
        assert typed.value == browser.shows(typed) == 20.0
        browser.set(typed, 999)
        browser.set(typed, 300)  # the browser puts the nearest value itself when the field is left
        assert until(lambda: len(tiny.refused) == 2, 0.5)
        assert typed.value == 300.0


def test_a_shared_control_is_checked_too(tiny: Tiny) -> None:
    shared = tiny.server.gui.add_slider("Shared", 0, 10, 1, 5)
    try:
        with tiny.browser() as (browser, _), tiny.browser() as (witness, _):
            browser.set(shared, math.nan)
            browser.set(shared, 70)
            assert until(lambda: shared.value == 10)
            assert until(lambda: witness.shows(shared) == 10)
            assert browser.shows(shared) == 10
            with tiny.browser() as (late, _):
                assert until(lambda: late.shows(shared) == 10)
    finally:
        shared.remove()


# ---------------------------------------------------------------- errors


def test_errors_of_handlers_are_told_and_logged_in_a_line(
    tiny: Tiny, caplog: pytest.LogCaptureFixture
) -> None:
    with tiny.browser() as (browser, controls):
        me = controls["client"].client_id
        browser.update(controls["press"], value=True)
        assert until(lambda: tiny.errors == [(me, "in the loop")])
        browser.update(controls["view"], value="side")
        assert until(lambda: (me, "in a thread") in tiny.errors)
        assert [r.getMessage() for r in caplog.records] == [
            "page: ValueError: in the loop",
            "page: ValueError: in a thread",
        ]
        browser.set(controls["steps"], 3)
        assert until(lambda: controls["steps"].value == 3)


def test_the_log_is_one_line_whatever_is_in_it(caplog: pytest.LogCaptureFixture) -> None:
    guard.log_line("a\nb\x1b[31m" + "c" * 999)
    assert caplog.messages[0].startswith("page: a\\nb\\x1b[31mccc")
    assert len(caplog.messages[0]) < 260


# ---------------------------------------------------------------- data for the script


def test_reports_are_heard_each_in_order(tiny: Tiny, caplog: pytest.LogCaptureFixture) -> None:
    with tiny.browser() as (browser, made):
        heard: list[str] = []
        api = made["slider"]._impl.gui_api
        control = guard.add_reports(api, heard.append)
        for text in ("a", "a", "b", "x" * (guard.MAX_REPORT + 1), 7, "c"):
            browser.update(control, value=text)
        browser.update(control, disabled=True)
        browser.update(control, value="d")
        assert until(lambda: len(heard) == 5)
        assert heard == ["a", "a", "b", "c", "d"]
        assert control.value == ""
        assert len([r for r in caplog.records if "report" in r.getMessage()]) == 1

        def failing(_: str) -> None:
            raise RuntimeError("no ear")

        tiny.errors.clear()
        browser.update(guard.add_reports(api, failing), value="e")
        assert until(lambda: tiny.errors)
        assert tiny.errors[0][1] == "no ear"


def test_data_are_escaped() -> None:
    text = guard.data_html("title", '"><script>x</script>')
    assert "<script>" not in text
    assert text.count('"') == 4


@pytest.mark.parametrize(
    "colours", [np.zeros((2, 3)), np.zeros((2, 4), np.uint8), np.zeros(3, np.uint8)]
)
def test_colours_are_checked(colours: np.ndarray) -> None:
    with pytest.raises(ValueError, match="colours must be"):
        guard.add_colours(cast("viser.SceneApi", None), "/a", colours)


# ---------------------------------------------------------------- coming and going


DESCRIPTORS = Path("/proc/self/fd")


@pytest.mark.slow
def test_nothing_is_left_of_five_hundred_browsers(tiny: Tiny) -> None:
    loop = tiny.server._websock_server._background_event_loop
    assert loop is not None
    others = {id(o) for o in gc.get_objects() if isinstance(o, viser.ClientHandle)}

    def visit(k: int) -> None:
        with raw(tiny) as connection:
            if k % 2:  # some say that they go
                connection.sendall(framed(b"\x03\xe8", 0x88))

    def kept() -> tuple[int, ...]:
        internal = tiny.server._websock_server
        assert until(lambda: not internal._live_connections and not tiny.server.get_clients())
        tiny.clients.clear()
        gc.collect()
        return (
            sum(
                isinstance(o, viser.ClientHandle) and id(o) not in others for o in gc.get_objects()
            ),
            len(internal._client_state_from_id),
            len(asyncio.all_tasks(loop)),
            len(list(DESCRIPTORS.iterdir())) if DESCRIPTORS.exists() else 0,
            threading.active_count(),
            len(gc.get_objects()),
        )

    for k in range(100):
        visit(k)
    first = kept()
    for k in range(400):
        visit(k)
    last = kept()
    assert last[:2] == first[:2] == (0, 0)
    assert last[2] <= first[2]  # tasks of the loop
    assert last[3] - first[3] < 10  # descriptors
    assert last[4] - first[4] < 10  # threads: viser's pool may still grow to its 32
    assert last[5] - first[5] < 400  # less than one object a browser


logging.getLogger("websockets.client").setLevel(logging.ERROR)
