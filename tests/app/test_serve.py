"""`faceambig serve` as a program: where it listens, how it ends, how it fails."""

from __future__ import annotations

import re
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

SERVE = [
    sys.executable,
    "-c",
    "import sys; from faceambig_app.cli import main; sys.exit(main())",
    "serve",
]


@pytest.fixture
def page() -> Iterator[tuple[subprocess.Popen[str], str]]:
    with subprocess.Popen(
        [*SERVE, "--port", "0"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        said = process.stdout.readline()
        found = re.search(r"http://127\.0\.0\.1:\d+/", said)
        assert found, said
        yield process, found[0]
        process.kill()


def test_the_printed_address_is_the_page_and_this_machine_only(page):
    process, address = page
    with urllib.request.urlopen(address, timeout=5) as answer:
        assert answer.status == 200
        assert "text/html" in answer.headers["Content-Type"]
    port = int(address.rsplit(":", 1)[1].strip("/"))
    table = Path("/proc/net/tcp")
    if table.exists():
        rows = [line.split() for line in table.read_text().splitlines()[1:]]
        listening = {row[1] for row in rows if row[3] == "0A" and row[1].endswith(f":{port:04X}")}
        assert listening == {f"0100007F:{port:04X}"}  # 127.0.0.1, and no other address
    assert process.poll() is None


@pytest.mark.parametrize(("number", "status"), [(signal.SIGTERM, 0), (signal.SIGINT, 130)])
def test_it_ends_soon_and_quietly(page, number, status):
    process, _ = page
    start = time.monotonic()
    process.send_signal(number)
    _, err = process.communicate(timeout=10)
    assert process.returncode == status
    assert "Traceback" not in err
    assert time.monotonic() - start < 5  # two seconds are promised; the machine may be busy


def test_a_taken_port_is_one_line():
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        done = subprocess.run(
            [*SERVE, "--port", str(port)], capture_output=True, text=True, timeout=60, check=False
        )
    assert done.returncode == 2
    assert done.stderr.splitlines() == [
        f"faceambig serve: port {port} is taken: choose another one"
    ]
    assert done.stdout == ""


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (["--port", "70000"], "port 70000"),
        (["--host", "nowhere.invalid"], "host 'nowhere.invalid'"),
        (["--host", "0.0.0.0"], "this machine only"),
        (["--port", "x"], "invalid int value"),
    ],
)
def test_a_place_that_cannot_be_served_is_one_line(flags, words):
    done = subprocess.run([*SERVE, *flags], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert words in done.stderr
