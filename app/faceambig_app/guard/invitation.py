"""The invitation: by which links the page is reached, and a picture of one for telephones."""

from __future__ import annotations

import contextlib
import ipaddress
import socket
from collections.abc import Collection

from .access import host_names, netlocs, plain_address

# Ours alone decide the colours: a code of light on dark, as a dark terminal would show it, is not read by all
_BLACK_ON_WHITE, _PLAIN = "\x1b[30;107m", "\x1b[0m"
_HALVES = {(0, 0): " ", (1, 0): "▀", (0, 1): "▄", (1, 1): "█"}  # (upper, lower), 1 is dark
MARGIN = 2  # modules of white around the code; its standard says 4, all readers take 2


def links(address: str, port: int, allowed: Collection[str] = ()) -> list[str]:
    """Where the page is: by its other names first, as these are meant for people, then by its address."""
    here = ipaddress.ip_address(address)
    shown = min(
        netlocs([plain_address(_met(here) if here.is_unspecified else address)], port), key=len
    )
    return [f"{origin}/" for origin in (*host_names(allowed, port).values(), f"http://{shown}")]


def _met(anywhere: ipaddress.IPv4Address | ipaddress.IPv6Address) -> str:
    """The address at which others find this machine: where packets to far away would leave it. None is sent."""
    four = anywhere.version == 4
    far = "192.0.2.1" if four else "2001:db8::1"  # kept for examples: nobody is there
    probe = socket.socket(socket.AF_INET if four else socket.AF_INET6, socket.SOCK_DGRAM)
    with probe, contextlib.suppress(OSError):  # no net
        probe.connect((far, 9))
        return probe.getsockname()[0]
    return "127.0.0.1" if four else "::1"


def qr_svg(link: str) -> str:
    """The link as an <svg> element that takes the room it gets: black on white, whatever the page's colours are."""
    import segno

    return segno.make(link, error="m").svg_inline(
        border=MARGIN, dark="#000", light="#fff", omitsize=True
    )


def qr_code(link: str) -> str:
    """The link as a picture of characters, two modules above each other in one."""
    import segno  # only where a link is shown

    rows = [list(row) for row in segno.make(link, error="m").matrix_iter(border=MARGIN)]
    if len(rows) % 2:
        rows.append([0] * len(rows[0]))
    lines = (
        "".join(_HALVES[int(upper), int(lower)] for upper, lower in zip(above, below, strict=True))
        for above, below in zip(rows[::2], rows[1::2], strict=True)
    )
    return "\n".join(f"{_BLACK_ON_WHITE}{line}{_PLAIN}" for line in lines)
