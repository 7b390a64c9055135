"""Requests: where the page is served, to whom, and with which headers."""

from __future__ import annotations

import errno
import http
import ipaddress
import re
import socket
import sys
from collections.abc import Iterable, Sequence

from websockets import Headers
from websockets.http11 import Request, Response

from ..state.link import IGNORED, ignored, told_ignored
from .access import Access
from .door import Door
from .pinned import ServeError

HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
    "X-Frame-Options": "DENY",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=()",
}

LINKLESS = "This page needs its link, with the token: whoever serves it has it."
LEADERLESS = "This link does not lead the class of this server: take the one that it printed when it started."
AGAIN = "again"  # in an address: asked for once more
_LANGUAGE = re.compile(r"([A-Za-z0-9-]{1,40})(?:\s*;\s*[qQ]=([01](?:\.[0-9]{0,3})?))?")


def answer(door: Door, address: str, request: Request) -> Response | None:
    """The answer to a request that has come in at `address`; None lets a websocket through."""
    access = door.access
    hosts = [value.lower() for value in request.headers.get_all("Host")]
    origin = access.origin(hosts[0], address) if len(hosts) == 1 else None
    if origin is None:  # another name: DNS rebinding
        return reply(421, "This server does not go by that name.")
    path, _, query = request.path.partition("?")
    if request.headers.get_all("Upgrade"):
        return _joined(door, request, origin, path)
    if path not in ("/", "/index.html") or not query.isascii():
        return reply(404, "There is one page, /.")
    pieces = query.split("&") if query else []
    if access.token is not None or access.lead is not None:
        entering = _entered(access, request, pieces, origin)
        if entering is not None:
            return entering
    kept = _ours(door, pieces)
    if kept != pieces:
        return reply(303, "", Location="/?" + "&".join(kept) if kept else "/")
    zipped = "gzip" in request.headers.get("Accept-Encoding", "")
    return reply(
        200,
        door.page.zipped if zipped else door.page.text,
        **{"Content-Type": "text/html; charset=utf-8", "Vary": "Accept-Encoding"},
        **({"Content-Encoding": "gzip"} if zipped else {}),
    )


def _ours(door: Door, pieces: list[str]) -> list[str]:
    """The pieces of a query that may stand in the page's address; last the names of the others, for the page to tell.

    Names are compared as written: viser also obeys websocket= and playbackPath=, in any spelling.
    """
    kept: list[str] = []
    others: list[str] = []
    for piece in pieces:
        name, _, value = piece.partition("=")
        if name in door.keys:
            kept.append(piece)
        elif name == IGNORED:
            others += told_ignored(value)
        elif piece:
            others.append(name)
    return [*kept, f"{IGNORED}={ignored(others)}"] if others else kept


def _joined(door: Door, request: Request, origin: str, path: str) -> Response | None:
    """The answer to a websocket's request; None lets it in."""
    if len(request.headers.get_all("Upgrade")) != 1:
        return reply(400, "One protocol at a time.")
    origins = request.headers.get_all("Origin")
    if origins and origins != [origin]:  # a page of another site
        return reply(403, "Another page may not connect.")
    if not door.access.knows(request.headers.get_all("Cookie")):
        return reply(403, LINKLESS)
    if path != "/":
        return reply(404, "There is one page, /.")
    if door.full(request.headers.get_all("Cookie")):
        return reply(503, "Too many browsers: try again when one has left.")
    return None


def _entered(
    access: Access, request: Request, pieces: Sequence[str], origin: str
) -> Response | None:
    """The answer to who comes with a token, or without one; None to who has come in before."""
    taken = ("token", AGAIN) if access.lead is None else ("token", "lead", AGAIN)
    rest = [piece for piece in pieces if piece.partition("=")[0] not in taken]
    place = "/?" + "&".join(rest) if rest else "/"
    tokens = _values(pieces, "token")
    secrets = _values(pieces, "lead") if access.lead is not None else []
    cookies: list[tuple[str, str]] = []
    if secrets:
        if not access.takes_lead(secrets):
            return reply(401, LEADERLESS)
        cookies.append(access.lead_cookie)
    if access.token is not None and (cookies or access.takes(tokens)):
        cookies.append(access.cookie)
    if cookies:
        flags = "Path=/; HttpOnly; SameSite=Strict" + "; Secure" * origin.startswith("https:")
        entered = reply(303, "", Location=place)
        for name, secret in cookies:  # a name that is there already is added to, never replaced
            entered.headers["Set-Cookie"] = f"{name}={secret}; {flags}"
        return entered
    if access.knows(request.headers.get_all("Cookie")):
        return None if len(rest) == len(pieces) else reply(303, "", Location=place)
    # From a link on another site a browser sends no strict cookie, not even after a redirect: it asks once more itself.
    if not tokens and AGAIN not in pieces:
        once_more = f"0; url={place}{'&' if rest else '?'}{AGAIN}"
        return reply(401, LINKLESS, Refresh=once_more)
    return reply(401, LINKLESS)


def _values(pieces: Sequence[str], name: str) -> list[str]:
    return [piece.partition("=")[2] for piece in pieces if piece.partition("=")[0] == name]


def dress(door: Door, address: str, request: Request, response: Response) -> None:
    """Headers on every answer, those of websockets itself included."""
    if response.status_code == 101:
        return
    host = next(iter(request.headers.get_all("Host")), "").lower()
    for name, value in HEADERS.items():
        response.headers[name] = value
    origin = door.access.origin(host, address) or f"http://127.0.0.1:{door.access.port}"
    response.headers["Content-Security-Policy"] = door.page.policy(origin)


def preferred(values: Iterable[str]) -> tuple[str, ...]:
    """The tags of Accept-Language headers (de-AT,de;q=0.9,en;q=0.8), dearest first; what is none is left out."""
    weighed: list[tuple[float, str]] = []
    for piece in ",".join(values).split(","):
        found = _LANGUAGE.fullmatch(piece.strip())
        if found is not None and (weight := float(found[2] or 1)) > 0:
            weighed.append((weight, found[1]))
    return tuple(tag for _, tag in sorted(weighed, key=lambda each: -each[0]))


def listen(host: str, port: int) -> socket.socket:
    """A listening socket. Bound here: viser takes the next port in silence, or never comes back."""
    name = "127.0.0.1" if host == "localhost" else host.strip("[]")
    try:
        address = ipaddress.ip_address(name)  # no look-up of names, which may take its time
    except ValueError:
        raise ServeError(
            f"host {host!r}: not an address: 127.0.0.1 for this machine only, 0.0.0.0 for all that reach it"
        ) from None
    if not 0 <= port <= 65535:
        raise ServeError(f"port {port}: must be from 0 to 65535")
    listener = socket.socket(socket.AF_INET if address.version == 4 else socket.AF_INET6)
    if (
        sys.platform != "win32"
    ):  # there it would share the port; here it frees it at once after a restart
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((str(address), port))
        listener.listen(128)
    except OSError as error:
        listener.close()
        if error.errno == errno.EADDRINUSE:
            raise ServeError(f"port {port} is taken: choose another one") from None
        raise ServeError(f"port {port} at {host}: {error.strerror or error}") from None
    return listener


def reply(status: int, body: str | bytes, **headers: str) -> Response:
    data = body if isinstance(body, bytes) else body.encode()
    every = {"Content-Type": "text/plain; charset=utf-8", "Connection": "close", **headers}
    return Response(
        status,
        http.HTTPStatus(status).phrase,
        Headers(every | {"Content-Length": str(len(data))}),
        data,
    )
