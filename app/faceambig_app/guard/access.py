"""Access: by which names the server goes, from which pages a browser may connect, and who is let in.

On 127.0.0.1 whoever sits at this machine is let in. At any other address, and behind a proxy, only who has come by the
link with the token; the browser is then known by a cookie. The cookie is made of the token alone: a server that starts
again with the same token still knows its browsers. Who leads a class comes by a link with another secret, and has a
second cookie.
"""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
import re
import secrets
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

from .pinned import ServeError

OWN = ("127.0.0.1", "::1")  # reached from this machine only; 127.0.0.2 may be forwarded
SHORTEST = 16  # characters of a token: guessing takes for ever

_NAME = re.compile(r"(?:[a-z0-9](?:[a-z0-9-]*[a-z0-9])?)(?:\.[a-z0-9](?:[a-z0-9-]*[a-z0-9])?)*")


@dataclass(frozen=True)
class Access:
    """Who may come in."""

    port: int
    origins: Mapping[str, str]  # value of Host -> the only page that may connect
    anywhere: bool  # listens at all addresses of this machine, and goes by the one where it is met
    token: str | None = None
    lead: str | None = None  # of the link of who leads a class

    def origin(self, host: str, address: str) -> str | None:
        """The origin of our own page for a value of Host; None if that is not us. `address`: where it was met."""
        if host in self.origins:
            return self.origins[host]
        if self.anywhere and host in netlocs([plain_address(address)], self.port):
            return f"http://{host}"
        return None

    @property
    def cookie(self) -> tuple[str, str]:
        """Name and value: browsers do not part cookies by port, so the name does."""
        return f"faceambig-{self.port}", _cookie(self.token, b"faceambig cookie")

    @property
    def lead_cookie(self) -> tuple[str, str]:
        """As `cookie`, of who leads."""
        return f"faceambig-lead-{self.port}", _cookie(self.lead, b"faceambig leader's cookie")

    def knows(self, cookies: Iterable[str]) -> bool:
        """Whether one of the Cookie headers lets in."""
        if self.token is None:
            return True
        return _has(cookies, *self.cookie)

    def leads(self, cookies: Iterable[str]) -> bool:
        """Whether one of the Cookie headers is of who leads."""
        return self.lead is not None and _has(cookies, *self.lead_cookie)

    def takes(self, tokens: Collection[str]) -> bool:
        """Whether the tokens of a link are one and ours."""
        return _is_one(tokens, self.token)

    def takes_lead(self, secrets_: Collection[str]) -> bool:
        """Whether the secrets of a leader's link are one and ours."""
        return _is_one(secrets_, self.lead)


def make_access(
    address: str,
    port: int,
    token: str | None,
    allowed: Collection[str] = (),
    lead: str | None = None,
) -> Access:
    """Who may come in at `address`; a server that others can reach needs a token.

    `allowed` are further names: NAME or NAME:PORT of a proxy with TLS, or NAME with our own port for this machine.
    """
    anywhere = ipaddress.ip_address(address).is_unspecified
    # Not 0.0.0.0: no link of ours has it, and pages of other sites use it to reach this machine
    own = netlocs(["localhost", *([] if anywhere else [plain_address(address)])], port)
    names = {host: f"http://{host}" for host in own} | host_names(allowed, port)
    if token is None and needs_token(address, allowed):
        raise ServeError(f"host {address}: others can reach it, so it needs a token")
    if lead is not None and lead == token:
        raise ServeError("lead: the token of all is no secret of who leads: leave it out")
    return Access(
        port,
        names,
        anywhere,
        None if token is None else _checked_token(token),
        None if lead is None else _checked_token(lead),
    )


def needs_token(address: str, allowed: Collection[str] = ()) -> bool:
    """Whether anybody but who sits at this machine can reach the server."""
    return address not in (*OWN, "localhost", "[::1]") or len(allowed) > 0


def make_token() -> str:
    """A token nobody guesses: 128 bits."""
    return secrets.token_urlsafe(16)


def host_names(allowed: Collection[str], port: int) -> dict[str, str]:
    """Value of Host -> origin, for names besides the address."""
    hosts = [_checked_name(name) for name in allowed]
    direct = {host for host in hosts if host in netlocs([host.partition(":")[0]], port)}
    return {host: f"http{'s' * (host not in direct)}://{host}" for host in hosts}


def netlocs(names: Iterable[str], port: int) -> set[str]:
    """How a browser writes names with our port."""
    return {f"{name}:{port}" for name in names} | (set(names) if port == 80 else set())


def plain_address(address: str) -> str:
    """An address as it stands in a link: no zone, IPv4 within IPv6 as IPv4, IPv6 in brackets."""
    plain = ipaddress.ip_address(address.partition("%")[0])
    if plain.version == 6:
        return f"[{plain}]" if plain.ipv4_mapped is None else str(plain.ipv4_mapped)
    return str(plain)


def _cookie(secret: str | None, use: bytes) -> str:
    return hmac.digest((secret or "").encode(), use, "sha256").hex()


def _has(cookies: Iterable[str], name: str, secret: str) -> bool:
    found = False
    for piece in ";".join(cookies).split(";"):
        key, _, value = piece.strip().partition("=")
        found |= key == name and _same(value, secret)
    return found


def _is_one(given: Collection[str], ours: str | None) -> bool:
    return ours is not None and len(given) == 1 and all(_same(one, ours) for one in given)


def _same(given: str, ours: str) -> bool:
    """Compared in a time that tells nothing of where they differ."""
    return hmac.compare_digest(
        hashlib.sha256(given.encode(errors="replace")).digest(),
        hashlib.sha256(ours.encode()).digest(),
    )


def _checked_token(token: str) -> str:
    if re.fullmatch(rf"[A-Za-z0-9_-]{{{SHORTEST},128}}", token) is None:
        raise ServeError(
            f"token: must be {SHORTEST} to 128 letters, digits, - or _: leave it out and one is made"
        )
    return token


def _checked_name(name: str) -> str:
    host, colon, port = name.lower().partition(":")
    if _NAME.fullmatch(host) is None or (colon and not (port.isdecimal() and int(port) <= 65535)):
        raise ServeError(
            f"allowed host {name[:80]!r}: must be a name such as class.example or class.example:8443"
        )
    return name.lower()
