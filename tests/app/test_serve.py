"""`faceambig serve` as a program: where it listens, how it ends, how it fails."""

from __future__ import annotations

import http.client
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

from faceambig_app.cli import main

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
        (["--host", "192.0.2.99"], "port 8080 at 192.0.2.99"),
        (["--token", "short"], "token: must be 16 to 128"),
        (["--allow-host", "https://class.example"], "must be a name such as class.example"),
        (["--max-sessions", "0"], "sessions 0: must be from 1 to 1000"),
        (["--idle-minutes", "nan"], "idle minutes nan: must be above 0"),
        (["--port", "x"], "invalid int value"),
    ],
)
def test_a_place_that_cannot_be_served_is_one_line(flags, words, capsys, monkeypatch):
    monkeypatch.setattr(signal, "signal", lambda *_: None)  # those of the tests stay
    try:
        status = main(["serve", *flags])
    except SystemExit as end:  # of the parser
        status = end.code
    out, err = capsys.readouterr()
    assert (status, out) == (2, "")
    assert len(err.splitlines()) == 1
    assert words in err


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have one loopback address")
def test_elsewhere_a_link_with_a_token_is_made_and_nobody_comes_in_without_it():
    command = [*SERVE, "--host", "127.0.0.2", "--port", "0", "--max-sessions", "5"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout is not None
            said = process.stdout.readline()
            found = re.search(r"http://127\.0\.0\.2:(\d+)/\?token=([A-Za-z0-9_-]{22})(?= )", said)
            assert found, said
            port, token = int(found[1]), found[2]

            def ask(target, **headers):
                connection = http.client.HTTPConnection("127.0.0.2", port, timeout=5)
                connection.request("GET", target, headers=headers)
                answer = connection.getresponse()
                answer.read()
                connection.close()
                return answer

            assert ask("/").status == 401
            assert ask("/?token=" + "A" * 22).status == 401
            assert ask("/", Host=f"127.0.0.1:{port}").status == 421
            answer = ask(f"/?token={token}")
            assert (answer.status, answer.headers["Location"]) == (303, "/")
            cookie = answer.headers["Set-Cookie"].partition(";")[0]
            assert ask("/", Cookie=cookie).status == 200
        finally:
            process.send_signal(signal.SIGTERM)
            rest, err = process.communicate(timeout=10)
    assert process.returncode == 0
    assert token not in rest + err  # said once, in the link
    assert "\x1b" not in rest  # the code is for a terminal


def test_another_viser_is_refused_in_a_line(monkeypatch, capsys):
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    monkeypatch.setattr("viser.__version__", "1.2.0")
    assert main(["serve", "--port", "0"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err == "faceambig serve: viser 1.2.0: the page needs 1.1.1: pip install viser==1.1.1\n"


def test_a_viser_whose_parts_have_moved_is_refused_at_import():
    """In a process of its own: the parts are looked for when the guard is imported."""
    part = "WebsockMessageHandler._handle_incoming_message"
    words = (
        f"import viser.infra._infra as i; del i.{part}\n"
        "import sys; from faceambig_app.cli import main; sys.exit(main(['serve', '--port', '0']))"
    )
    done = subprocess.run(
        [sys.executable, "-c", words], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 2
    assert re.fullmatch(
        rf"faceambig serve: viser 1\.1\.1: {part} is not where it was: .*\n", done.stderr
    )


def test_a_class_gets_a_link_to_lead_and_one_to_follow():
    command = [*SERVE, "--port", "0", "--present"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        said = [process.stdout.readline() for _ in range(3)]
        process.kill()
    room = re.search(r"http://\S+/", said[0])
    lead = re.search(r"(http://\S+/)\?lead=[A-Za-z0-9_-]{22} ", said[1])
    assert room
    assert lead
    assert lead[1] == room[0]
    assert "--host 0.0.0.0" in said[2]  # nobody else could come
