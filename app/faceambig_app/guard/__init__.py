"""Every hook into viser's internals: one page from memory, checked requests and values, errors in words.

viser is pinned: the hooks name private parts, and `start` refuses any other version. They act on servers made by
`start` alone; which server a piece of code serves is found in the context that each connection runs in. In the page
our script, assets/page/, stands before viser's; its data come through hidden elements (`data_html`) and, for colours,
a hidden cloud of points (`add_colours`), and it answers through one hidden text control (`add_reports`).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import viser

from .access import make_access, make_token, needs_token
from .data import add_colours, data_html
from .door import Door, Hooks
from .downloads import send_file
from .hooks import install, opened
from .invitation import links, qr_code, qr_svg
from .log import log_line
from .messages import MAX_BAD, MAX_MESSAGE
from .page import PATCHES, make_page, our_script
from .panels import clear
from .pinned import ServeError
from .reports import MAX_REPORT, add_reports
from .requests import listen
from .sessions import Limits, languages, leads
from .uploads import MAX_UPLOAD, add_upload
from .values import TYPING, restate

__all__ = [
    "MAX_BAD", "MAX_MESSAGE", "MAX_REPORT", "MAX_UPLOAD", "PATCHES", "TYPING", "Hooks", "Limits", "ServeError",
    "add_colours", "add_reports", "add_upload", "clear", "data_html", "languages", "leads", "links", "log_line",
    "make_token", "needs_token", "qr_code", "qr_svg", "restate", "send_file", "start",
]  # fmt: skip


def start(
    host: str = "127.0.0.1",
    port: int = 8080,
    *,
    token: str | None = None,
    lead: str | None = None,
    allowed: Collection[str] = (),
    limits: Limits | None = None,
    keys: Collection[str] = (),
    title: str = "faceambig",
    hooks: Hooks | None = None,
    script: str | None = None,
    patches: Sequence[tuple[str, str]] | None = None,
) -> viser.ViserServer:
    """A viser server on an address of this machine; port 0 takes a free one (`get_port`). Prints nothing.

    Where others can reach it (`needs_token`) it needs a `token`, which a link brings as `?token=`. `allowed` are names
    it goes by besides its address: NAME or NAME:PORT of a proxy with TLS, or NAME with its own port. Who comes with the
    secret `lead` as `?lead=` leads a class: `leads` tells it of the running connection.
    `keys` are the names that may stand in the page's address beside those of viser that do no harm. `script` and
    `patches` replace our script and our mends of viser's bundle; tests show with them what happens without.
    """
    install()
    listener = listen(host, port)
    try:
        address, port = listener.getsockname()[:2]
        access = make_access(address, port, token, allowed, lead)
        page = make_page(
            our_script() if script is None else script,
            title,
            PATCHES if patches is None else patches,
        )
    except ServeError:
        listener.close()
        raise
    door = Door(
        listener,
        access,
        limits or Limits(),
        frozenset(keys) | {"darkMode", "fixedDpr"},
        page,
        hooks or Hooks(),
    )
    return opened(door, address, title)
