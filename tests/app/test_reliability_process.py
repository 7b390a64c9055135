"""The page as a program: killed and started again under open pages, ended under load, files on a full disk."""

from __future__ import annotations

import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

SOON = 60.0  # seconds: other tests share the processors
MAIN = "import sys; from faceambig_app.cli import main; sys.exit(main())"
# All that is computed for a browser takes a minute, and a photograph is being read for as long
SLOW = """
import asyncio, time
from faceambig_app import display, server
enter = server.Page._enter
async def reading(page, client):
    await enter(page, client)
    page.reading = asyncio.create_task(asyncio.to_thread(time.sleep, 60))
server.Page._enter = reading
def slow(real):
    def call(*a, **o):
        print("busy", flush=True)
        time.sleep(60)
        return real(*a, **o)
    return call
display.drawn = slow(display.drawn)
"""
HANDSHAKE = (
    "GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nOrigin: http://127.0.0.1:{port}\r\nUpgrade: websocket\r\n"
    "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
    "Sec-WebSocket-Protocol: viser-v1.1.1\r\n\r\n"
)


@contextmanager
def served(port: int = 0, before: str = "") -> Iterator[tuple[subprocess.Popen[str], int]]:
    """`faceambig serve` as a program, and its port; `before`: code that it runs first."""
    with subprocess.Popen(
        [sys.executable, "-c", f"{before}\n{MAIN}", "serve", "--port", str(port)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        guard = threading.Timer(2 * SOON, process.kill)  # ends what waits for its words
        guard.start()
        try:
            assert process.stdout is not None
            said = process.stdout.readline()
            found = re.search(r"http://127\.0\.0\.1:(\d+)/", said)
            assert found, (said, process.stderr and process.stderr.read())
            yield process, int(found[1])
        finally:
            guard.cancel()
            process.kill()


def drag(wire: Any, *steps: int) -> None:
    slider = wire.control("Slider", "Assumed distance")
    for step in steps:
        wire.set(slider, step)
        wire.read(0.02)


def ended(process: subprocess.Popen[str], wires: Any, drags: Callable[[], object]) -> str:
    """Load until the program has ended; what it said on stderr."""
    end = time.monotonic() + SOON
    while process.poll() is None:
        assert time.monotonic() < end, "it does not end"
        with suppress(*wires.GONE):
            drags()
        time.sleep(0.02)
    _, err = process.communicate(timeout=SOON)
    return err


def is_free(port: int) -> bool:
    """Whether another program could listen there, as ours does."""
    with socket.socket() as other:
        other.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            other.bind(("127.0.0.1", port))
            other.listen()
        except OSError:
            return False
        return True


def test_a_killed_server_is_started_again_under_open_pages_and_ends_under_load(wires):
    """The page's script tells its address again when it is back; in Chromium: tests/browser/test_page_state.py."""
    states = ["subject=3&distance=0.8", "subject=5&view=side&hide=actual"]
    with served() as (process, port):
        pages = [wires.Wire(port, text) for text in states]
        for page in pages:
            assert page.rests(SOON)
            drag(page, 30, 40)
        for page in pages:
            assert page.wait(lambda page=page: "distance" in page.query, SOON)
        left = [page.query for page in pages]
        process.send_signal(signal.SIGKILL)
        process.wait(SOON)
    for page in pages:
        with pytest.raises(wires.GONE):
            drag(page, *range(10, 90))
    with served(port) as (process, again):
        assert again == port
        pages = [wires.Wire(port, text) for text in left]
        for page, text in zip(pages, left, strict=True):
            assert page.wait(lambda page=page, text=text: page.query == text, SOON)
            assert page.notices == []
        drag(pages[0], 20, 25, 50)
        process.send_signal(signal.SIGTERM)
        err = ended(process, wires, lambda: [drag(page, 20, 60) for page in pages])
        assert process.returncode == 0
        assert err == ""
    assert is_free(port)


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 0)])
def test_it_ends_while_both_workers_compute_for_a_minute(wires, number, status):
    with (
        served(before=SLOW) as (process, port),
        socket.create_connection(("127.0.0.1", port)) as mute,
    ):
        mute.sendall(HANDSHAKE.format(port=port).encode())  # and never answers a farewell
        pages = [wires.Wire(port) for _ in range(2)]
        assert process.stdout is not None
        assert [process.stdout.readline() for _ in pages] == ["busy\n"] * 2
        start = time.monotonic()
        process.send_signal(number)
        err = ended(process, wires, lambda: [page.read(0.01) for page in pages])
        assert process.returncode == status
        assert err == ""
        # two seconds are promised; the machine may be busy, but what they compute is not waited for
        assert time.monotonic() - start < 30
    assert is_free(port)


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 0)])
def test_it_ends_while_its_first_face_is_computed(number, status):
    slow = """
from faceambig_app import server
def slow(state):
    print("busy", flush=True)
    time.sleep(60)
import time
server.frame = slow
"""
    with subprocess.Popen(
        [sys.executable, "-c", f"{slow}\n{MAIN}", "serve", "--port", "0"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        assert process.stdout.readline() == "busy\n"
        process.send_signal(number)
        _, err = process.communicate(timeout=30)
    assert (process.returncode, err) == (status, "")


# ---------------------------------------------------------------- files

FULL = """
import resource, sys
from pathlib import Path
import numpy as np
import faceambig as fa, faceambig.io as fio
from faceambig_app import files
from faceambig_app.reports import photo
from strategies import face_of, tiny_model
model = tiny_model(n_vertices=400, n_modes=6, seed=4)
fit = fa.fit(model, fa.observe(face_of(model, np.zeros(6)), distance=0.6, scheme="all"), distance=0.6)
points = fio.LandmarkFile(np.random.default_rng(1).uniform(0, 400, (68, 2)), "ibug68", (500, 500))
out, big = Path(sys.argv[1]), bytes(50_000)
resource.setrlimit(resource.RLIMIT_FSIZE, (2_000, 2_000))
calls = {
    "write": lambda: files.write(out / "a.png", big),
    "write_all": lambda: files.write_all({out / "a.txt": b"small", out / "a.png": big}),
    "folder": lambda: photo.write_folder(out / "new", iter([("a", b"small"), ("b", big)])),
    "model": lambda: fio.save_model(model, out / "a.npz"),
    "fit": lambda: fio.save_fit(fit, out / "a.json"),
    "landmarks": lambda: fio.save_landmarks(points, out / "a.points"),
}
for name, call in calls.items():
    try:
        call()
    except (ValueError, OSError) as error:
        print(name, type(error).__name__, str(error).count(chr(10)))
    else:
        print(name, "written")
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no limit on the size of files there")
def test_no_room_on_the_disk_leaves_the_old_files_and_nothing_else(tmp_path):
    names = ("a.png", "a.txt", "a.npz", "a.json", "a.points")
    for name in names:
        (tmp_path / name).write_text("old")
    tests = str(Path(__file__).resolve().parents[1])
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path.insert(0, {tests!r})\n{FULL}", str(tmp_path)],
        capture_output=True, text=True, timeout=SOON, check=False,
    )  # fmt: skip
    assert done.stderr == ""
    said = dict(line.split(" ", 1) for line in done.stdout.splitlines())
    assert said == {
        "write": "ValueError 0", "write_all": "ValueError 0", "folder": "ValueError 0",
        "model": "OSError 0", "fit": "OSError 0", "landmarks": "OSError 0",
    }  # fmt: skip
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(names)
    assert {(tmp_path / name).read_text() for name in names} == {"old"}
