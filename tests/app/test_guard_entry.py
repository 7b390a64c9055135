"""Coming in: by a link with a token and then a cookie, by the names that are ours, through a proxy with TLS."""

from __future__ import annotations

import contextlib
import http.client
import os
import re
import shutil
import socket
import ssl
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import InvalidStatus

from faceambig_app import guard
from faceambig_app.guard import access
from guarded import PART, SOON, Browser, Tiny, begin, piece, tiny_page, until

TOKEN = "a-token-of-the-class-1"
DOCS = Path(__file__).resolve().parents[2] / "docs" / "security.md"
UNPACKED = (
    Path(__file__).resolve().parents[2] / "build" / "nginx" / "usr" / "sbin"
)  # tools/system_packages.sh
NGINX = shutil.which(
    "nginx", path=f"{os.environ.get('PATH', '')}:/usr/sbin:/usr/local/sbin:{UNPACKED}"
)


@pytest.fixture(scope="module")
def tiny() -> Iterator[Tiny]:
    """A page with a token, as it is at any address but 127.0.0.1."""
    with tiny_page(token=TOKEN, limits=guard.Limits(sessions=3)) as page:
        yield page


@pytest.fixture(autouse=True)
def who_has_the_cookie_is_served(tiny: Tiny) -> Iterator[None]:
    tiny.forget()
    yield
    assert until(lambda: not tiny.sessions)  # those of the test have been seen to leave
    tiny.works()


# ---------------------------------------------------------------- token and cookie


def stranger(tiny: Tiny, target: str, cookie: str = "") -> http.client.HTTPResponse:
    return tiny.get(target, **({"Cookie": cookie} if cookie else {"Cookie": "x=y"}))[0]


@pytest.mark.parametrize(
    "query",
    [
        "", "?token=", f"?token={TOKEN[:-1]}", f"?token={TOKEN}x", f"?token=x&token={TOKEN}",
        f"?token={TOKEN}&token={TOKEN}", f"?token={TOKEN.upper()}", f"?TOKEN={TOKEN}", f"?tok%65n={TOKEN}",
        f"?token={'A' * len(TOKEN)}", "?token=%00", "?again", "?distance=1",
    ],
)  # fmt: skip
def test_without_the_token_nobody_comes_in(tiny: Tiny, query: str) -> None:
    answer = stranger(tiny, f"/{query}")
    assert answer.status == 401
    assert "Set-Cookie" not in answer.headers
    assert answer.headers["X-Content-Type-Options"] == "nosniff"
    assert "frame-ancestors 'none'" in answer.headers["Content-Security-Policy"]


def cookies(tiny: Tiny) -> list[str]:
    name, value = tiny.cookie["Cookie"].split("=")
    return [
        "", f"{name}=", f"{name}={TOKEN}", f"{name}={value[:-1]}", f"{name}={value}0", f"{name}={value.upper()}",
        f"faceambig-1={value}", f"{name}x={value}", value, f"{name}={'0' * 64}", f"{name}=\xff",
    ]  # fmt: skip


def test_without_the_cookie_nobody_connects(tiny: Tiny) -> None:
    for cookie in cookies(tiny):
        with pytest.raises(InvalidStatus, match="403"):
            Browser(tiny.port, additional_headers={"Cookie": cookie})
        assert stranger(tiny, "/", cookie).status == 401
    with pytest.raises(InvalidStatus, match="403"):
        Browser(tiny.port, origin=None)  # not a browser at all


def test_the_link_is_exchanged_for_a_cookie_and_leaves_the_address(tiny: Tiny) -> None:
    answer = stranger(tiny, f"/?distance=1.2&token={TOKEN}&view=side")
    assert (answer.status, answer.headers["Location"]) == (303, "/?distance=1.2&view=side")
    cookie, *flags = answer.headers["Set-Cookie"].split("; ")
    assert set(flags) == {"Path=/", "HttpOnly", "SameSite=Strict"}
    assert cookie.startswith(f"faceambig-{tiny.port}=")
    assert TOKEN not in cookie
    assert stranger(tiny, "/", f"a=b; {cookie}; c=d").status == 200
    for old in (
        "token=wrong",
        "again",
        f"token={TOKEN}",
    ):  # is in already: only the address is cleaned
        answer = stranger(tiny, f"/?{old}&view=side", cookie)
        assert (answer.status, answer.headers["Location"]) == (303, "/?view=side")


def test_from_another_site_the_browser_asks_once_more(tiny: Tiny) -> None:
    """A strict cookie is not sent with a link from elsewhere; it is with what the answer itself asks for."""
    answer = stranger(tiny, "/?view=side")
    assert answer.headers["Refresh"] == "0; url=/?view=side&again"
    assert "Refresh" not in stranger(tiny, "/?view=side&again").headers
    assert "Refresh" not in stranger(tiny, "/?token=wrong").headers


@pytest.mark.parametrize("place", ["//evil.example/", "/\\evil.example", "/%2f%2fevil.example"])
def test_the_link_leads_nowhere_else(tiny: Tiny, place: str) -> None:
    answer = stranger(tiny, f"{place}?token={TOKEN}&next=//evil.example")
    assert answer.status == 404
    assert "Location" not in answer.headers
    answer = stranger(tiny, f"/?token={TOKEN}&next=//evil.example")
    assert answer.headers["Location"].startswith("/?next=")


def test_secrets_are_compared_in_constant_time_and_are_in_no_log(
    tiny: Tiny, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    compared: list[tuple[bytes, bytes]] = []
    real = access.hmac.compare_digest
    monkeypatch.setattr(
        access.hmac, "compare_digest", lambda a, b: compared.append((a, b)) or real(a, b)
    )
    caplog.set_level("DEBUG", logger="faceambig_app")
    secret = tiny.cookie["Cookie"].partition("=")[2]
    assert stranger(tiny, f"/?token={TOKEN[:-1]}").status == 401
    assert stranger(tiny, "/", f"faceambig-{tiny.port}={secret[:-1]}").status == 401
    assert len(compared) == 2
    assert all(len(a) == len(b) == 32 for a, b in compared)  # digests: the length tells nothing
    with tiny.browser() as (browser, controls):
        browser.update(controls["press"], value=True)  # raises
        browser.send(b"\xc1")
        assert until(lambda: len(caplog.records) >= 2)
    assert TOKEN not in caplog.text
    assert secret not in caplog.text


def test_the_cookie_outlives_a_restart_with_the_same_token_only() -> None:
    one, same, other = (
        access.make_access("127.0.0.1", 8080, token, ()) for token in (TOKEN, TOKEN, TOKEN + "2")
    )
    cookie = "=".join(one.cookie)
    assert same.knows([cookie])
    assert not other.knows([cookie])


@pytest.mark.parametrize(
    "token", ["", "short", "a" * 129, "with space in the token", "a&b=c" * 4, "ä" * 20]
)
def test_a_token_that_is_no_token_is_refused(token: str) -> None:
    with pytest.raises(guard.ServeError, match="token: must be 16 to 128"):
        guard.start(port=0, token=token)


def test_a_full_page_tells_so_to_who_may_come_in_only(tiny: Tiny) -> None:
    with contextlib.ExitStack() as inside:
        for _ in range(3):
            inside.enter_context(tiny.browser())
        upgrade = {"Upgrade": "websocket", "Connection": "Upgrade"}
        answer, _ = tiny.get(**upgrade)
        assert (answer.status, answer.headers["X-Frame-Options"]) == (503, "DENY")
        assert tiny.get(**upgrade, Cookie="x=y")[0].status == 403


# ---------------------------------------------------------------- names


@pytest.mark.parametrize(
    ("address", "met", "served", "foreign"),
    [
        ("127.0.0.1", "127.0.0.1", ["localhost:81", "127.0.0.1:81"], ["10.0.0.7:81", "0.0.0.0:81"]),
        ("10.0.0.7", "10.0.0.7", ["10.0.0.7:81"], ["127.0.0.1:81", "10.0.0.8:81", "10.0.0.7"]),
        (
            "0.0.0.0",
            "10.0.0.7",
            ["10.0.0.7:81", "localhost:81"],
            ["10.0.0.8:81", "10.0.0.7:82", "0.0.0.0:81"],
        ),
        ("::", "::ffff:10.0.0.7", ["10.0.0.7:81"], ["[::ffff:10.0.0.7]:81", "[::]:81"]),
        ("::", "fe80::1%eth0", ["[fe80::1]:81"], ["[fe80::1%eth0]:81", "[fe80::2]:81"]),
    ],
)
def test_a_page_goes_by_the_address_where_it_is_met(
    address: str, met: str, served: list[str], foreign: list[str]
) -> None:
    entry = access.make_access(address, 81, TOKEN, ())
    for host in served:
        assert entry.origin(host, met) == f"http://{host}"
    for host in foreign:
        assert entry.origin(host, met) is None


def test_further_names_have_one_origin_each() -> None:
    names = ("Class.Example", "class.example:8443", "teacher.local:81")
    entry = access.make_access("127.0.0.1", 81, TOKEN, names)
    hosts = (
        "class.example", "class.example:8443", "teacher.local:81", "class.example:81", "teacher.local",
    )  # fmt: skip
    origin = {host: entry.origin(host, "127.0.0.1") for host in hosts}
    assert origin == {
        "class.example": "https://class.example",
        "class.example:8443": "https://class.example:8443",
        "teacher.local:81": "http://teacher.local:81",
        "class.example:81": None,
        "teacher.local": None,
    }
    assert guard.links("127.0.0.1", 81, names)[0] == "https://class.example/"
    assert guard.links("127.0.0.1", 80) == ["http://127.0.0.1/"]


@pytest.mark.parametrize(
    "name",
    [
        "",
        "*",
        "*.example",
        "https://class.example",
        "class.example/",
        "a b",
        "x:y",
        "x:99999",
        "evil@x",
        "-a",
    ],
)
def test_a_name_that_is_none_is_refused(name: str) -> None:
    with pytest.raises(guard.ServeError, match="must be a name such as"):
        guard.start(port=0, token=TOKEN, allowed=[name])


def test_further_names_need_a_token() -> None:
    with pytest.raises(guard.ServeError, match="needs a token"):
        guard.start(port=0, allowed=["class.example"])


@pytest.mark.parametrize(
    ("limits", "words"),
    [({"sessions": 0}, "sessions 0"), ({"sessions": 10**6}, "sessions 1000000"),
     ({"idle": 0.0}, "idle minutes 0"), ({"idle": float("nan")}, "idle minutes nan")],
)  # fmt: skip
def test_limits_that_are_none_are_refused(limits: dict[str, Any], words: str) -> None:
    with pytest.raises(guard.ServeError, match=words):
        guard.Limits(**limits)


def test_the_code_on_the_terminal_reads_as_the_link() -> None:
    pytest.importorskip("segno")
    cv2 = pytest.importorskip("cv2")
    import numpy as np

    # As long as a token that is made; of random ones OpenCV's reader fails at a few codes in a hundred
    link = "http://192.168.1.23:8080/?token=U4thMINMPE5zWrZnD8tUtQ"
    assert len(link.partition("=")[2]) == len(guard.make_token())
    lines = re.sub(r"\x1b\[[0-9;]*m", "", guard.qr_code(link)).splitlines()
    halves = {" ": (0, 0), "▀": (1, 0), "▄": (0, 1), "█": (1, 1)}
    rows = [[halves[c][k] for c in line] for line in lines for k in (0, 1)]
    picture = np.kron(255 - 255 * np.array(rows, np.uint8), np.ones((8, 8), np.uint8))
    picture = cv2.copyMakeBorder(picture, 16, 16, 16, 16, cv2.BORDER_CONSTANT, value=255)
    assert cv2.QRCodeDetector().detectAndDecode(picture)[0] == link


# ---------------------------------------------------------------- a proxy


@pytest.fixture
def proxied(tmp_path: Path) -> Iterator[tuple[Tiny, int, ssl.SSLContext]]:
    """A page behind nginx, by the configuration of docs/security.md."""
    openssl = shutil.which("openssl")
    if NGINX is None or openssl is None:
        pytest.skip("no nginx, or no openssl for its certificate")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    certificate, key = tmp_path / "class.pem", tmp_path / "class.key"
    subprocess.run(
        [openssl, "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "2",
         "-subj", "/CN=class.example", "-addext", "subjectAltName=DNS:class.example", "-keyout", key, "-out",
         certificate],
        check=True, capture_output=True,
    )  # fmt: skip
    found = re.search(r"```nginx\n(.*?)```", DOCS.read_text(encoding="utf-8"), re.DOTALL)
    assert found is not None
    with tiny_page(token=TOKEN, allowed=[f"class.example:{port}"]) as page:
        text = found[1]
        for documented, here in (
            ("listen 443", f"listen 127.0.0.1:{port}"), ("/etc/ssl/class.example.pem", str(certificate)),
            ("/etc/ssl/class.example.key", str(key)), ("/var/log/nginx/class.log", str(tmp_path / "access.log")),
            ("127.0.0.1:8080", page.netloc),
        ):  # fmt: skip
            assert text.count(documented) == 1
            text = text.replace(documented, here)
        kinds = ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
        folders = "".join(f"{kind}_temp_path {tmp_path / kind};\n" for kind in kinds)
        configuration = tmp_path / "nginx.conf"
        configuration.write_text(
            f"pid {tmp_path / 'pid'};\nerror_log {tmp_path / 'error.log'};\nevents {{}}\nhttp {{\n{folders}{text}}}\n"
        )
        command = [NGINX, "-p", str(tmp_path), "-c", str(configuration), "-e", str(tmp_path / "error.log"),
                   "-g", "daemon off; master_process off;"]  # fmt: skip
        with subprocess.Popen(command, stderr=subprocess.PIPE) as process:
            try:
                assert until(lambda: listening(port) or process.poll() is not None)
                assert process.poll() is None, process.stderr or b""
                yield page, port, ssl.create_default_context(cafile=str(certificate))
            finally:
                process.terminate()
        assert TOKEN not in (tmp_path / "access.log").read_text()


def listening(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def through(
    port: int, context: ssl.SSLContext, target: str, **headers: str
) -> tuple[http.client.HTTPResponse, bytes]:
    plain = socket.create_connection(("127.0.0.1", port), timeout=SOON)
    connection = http.client.HTTPConnection("class.example", port)
    connection.sock = context.wrap_socket(plain, server_hostname="class.example")
    with contextlib.closing(connection):
        connection.request("GET", target, headers=headers)
        answer = connection.getresponse()
        return answer, answer.read()


def test_behind_nginx_page_websocket_and_files_work(
    proxied: tuple[Tiny, int, ssl.SSLContext],
) -> None:
    page, port, context = proxied
    place = f"class.example:{port}"
    assert through(port, context, "/")[0].status == 401
    assert through(port, context, "/", Host="evil.example")[0].status == 421
    answer, _ = through(port, context, f"/?token={TOKEN}&view=side")
    assert (answer.status, answer.headers["Location"]) == (303, "/?view=side")
    cookie, *flags = answer.headers["Set-Cookie"].split("; ")
    assert "Secure" in flags
    answer, text = through(port, context, "/", Cookie=cookie)
    assert answer.status == 200
    assert b"data-faceambig" in text
    assert f"connect-src 'self' wss://{place} " in answer.headers["Content-Security-Policy"]

    def browser(origin: str, cookie: str) -> Browser:
        return Browser(
            port,
            uri=f"wss://{place}/",
            sock=socket.create_connection(("127.0.0.1", port), timeout=SOON),
            ssl=context,
            server_hostname="class.example",
            origin=origin,
            additional_headers={"Cookie": cookie},
        )

    for origin, given in (
        (f"http://{place}", cookie), ("https://class.example", cookie), (f"https://{page.netloc}", cookie),
        (f"https://{place}", "x=y"),
    ):  # fmt: skip
        with pytest.raises(InvalidStatus, match="403"):
            browser(origin, given)
    with browser(f"https://{place}", cookie) as good:
        mine = until(lambda: [c for c in list(page.clients.values()) if c["mark"] == good.mark])[0]
        good.set(mine["steps"], 7)
        assert until(lambda: mine["steps"].value == 7)
        data = os.urandom(3 * PART + 5)
        good.send(begin(mine["take"], "a", len(data)))
        for index in range(4):
            good.send(piece(mine["take"], "a", index, data[index * PART : (index + 1) * PART]))
        assert until(lambda: page.files)
        assert page.files == [("me.png", data)]


def test_the_figures_of_the_documentation_are_those_of_the_code() -> None:
    text = DOCS.read_text(encoding="utf-8")
    limits = guard.Limits()
    for figure in (
        f"{limits.rate:g} messages a second", f"{limits.burst:g} at once, {limits.hurry:g} s", f"{limits.sessions};",
        f"{limits.first:g} s to the first camera", f"{limits.waiting:,} messages",
        f"{limits.waiting_bytes >> 20} MB or", f"closed at the {guard.MAX_BAD}th", f"{guard.MAX_MESSAGE >> 10} KiB",
        f"{guard.MAX_UPLOAD >> 20} MB, two",
    ):  # fmt: skip
        assert figure in text
