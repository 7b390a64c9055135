"""Requests: where the page is served, to whom, and with which headers."""

from __future__ import annotations

import errno
import http
import ipaddress
import socket
import sys

from websockets import Headers
from websockets.http11 import Request, Response

from ..link import IGNORED, ignored, told_ignored
from .door import Door, ServeError

HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
    "X-Frame-Options": "DENY",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=()",
}


def answer(door: Door, request: Request) -> Response | None:
    """The answer to a request; None lets a websocket through."""
    hosts = [value.lower() for value in request.headers.get_all("Host")]
    if len(hosts) != 1 or hosts[0] not in door.names:  # another name: DNS rebinding
        return reply(421, "This server does not go by that name.")
    path, _, query = request.path.partition("?")
    if request.headers.get_all("Upgrade"):
        origins = request.headers.get_all("Origin")
        if origins and origins != [f"http://{hosts[0]}"]:  # a page of another site
            return reply(403, "Another page may not connect.")
        return None if path == "/" else reply(404, "There is one page, /.")
    if path not in ("/", "/index.html"):
        return reply(404, "There is one page, /.")
    pieces = query.split("&") if query else []
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


def dress(door: Door, request: Request, response: Response) -> None:
    """Headers on every answer, those of websockets itself included."""
    if response.status_code == 101:
        return
    host = next(iter(request.headers.get_all("Host")), "").lower()
    for name, value in HEADERS.items():
        response.headers[name] = value
    response.headers["Content-Security-Policy"] = door.page.policy(
        host if host in door.names else f"127.0.0.1:{door.port}"
    )


def listen(host: str, port: int) -> socket.socket:
    """A listening socket. Bound here: viser takes the next port in silence, or never comes back."""
    name = "127.0.0.1" if host == "localhost" else host.strip("[]")
    try:
        address = ipaddress.ip_address(name)  # no look-up of names, which may take its time
    except ValueError:
        raise ServeError(
            f"host {host!r}: not an address of this machine, 127.0.0.1 or ::1"
        ) from None
    if not address.is_loopback:  # nothing here asks who comes in
        raise ServeError(f"host {host}: the page is served to this machine only, 127.0.0.1 or ::1")
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
