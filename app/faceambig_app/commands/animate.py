"""faceambig animate: a sweep along the distance or a swing of a mode, as WebP, GIF or a page that plays from disk."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from .shared import GOOD
from .snapshot import add_state, state_of

ENDINGS = (".webp", ".gif", ".html")
# Of a moving picture: the page plays as fast and as large as its reader wants, and goes all the way
PICTURE_ONLY = ("mode", "low", "high", "seconds", "fps", "width")
FLAGS = {"low": "--from", "high": "--to"}


def add(command: argparse.ArgumentParser) -> None:
    """Its flags."""
    command.add_argument(
        "--out", required=True, metavar="FILE", help="where to write it: .webp, .gif or .html"
    )
    command.add_argument(
        "--what",
        default="distance",
        choices=("distance", "mode"),
        help="what moves: the distance the fit assumes, or its shape along a flexibility mode (default distance)",
    )
    command.add_argument(
        "--mode", type=int, metavar="N", help="flexibility mode, 1 to 3 (default 1); a page has all"
    )
    command.add_argument(
        "--from", dest="low", type=float, metavar="X", help="metres, or mm (default 0.2, or -5)"
    )
    command.add_argument(
        "--to", dest="high", type=float, metavar="X", help="metres, or mm (default 3, or 5)"
    )
    command.add_argument("--seconds", type=float, help="there and back (default 6)")
    command.add_argument("--fps", type=float, help="frames a second (default 12)")
    command.add_argument("--width", type=int, metavar="PX", help="of the picture (default 960)")
    add_state(command)


def run(options: argparse.Namespace) -> int:
    """Make the file, all of it or none."""
    from pathlib import Path

    out = Path(options.out)
    ending = out.suffix.lower()
    if ending not in ENDINGS:
        raise ValueError(f"--out: {options.out!r} does not end in {', '.join(ENDINGS)}")
    given = {name: value for name in PICTURE_ONLY if (value := getattr(options, name)) is not None}
    if ending == ".html" and given:
        name = next(iter(given))
        raise ValueError(f"{FLAGS.get(name, f'--{name}')}: a page has none; leave it out")
    if options.what == "distance" and "mode" in given:
        raise ValueError("--mode: is of --what mode, not of the distance")
    state = state_of(options)

    from ..files import writable, write
    from ..text import speaking

    writable(out)  # before the work, not after it
    with speaking(state.lang):
        if ending == ".html":
            from ..export.player import page

            _, data = page(state, whats=(options.what,))
        else:
            data = _animation(state, ending[1:], {"what": options.what} | given)
    write(out, data)
    return GOOD


def _animation(state: Any, kind: str, asked: dict[str, Any]) -> bytes:
    from ..export.animate import animation

    terminal = sys.stderr.isatty()
    try:
        _, data = animation(state, kind, progress=_told if terminal else None, **asked)
    finally:
        if terminal:
            _wiped()
    return data


def _told(drawn: int, frames: int) -> None:
    words = "writing" if drawn == frames else f"frame {drawn} of {frames}"
    print(f"\r\x1b[K{words}", end="", file=sys.stderr, flush=True)


def _wiped() -> None:
    """An empty line where progress stood: an error has the line to itself."""
    print("\r\x1b[K", end="", file=sys.stderr, flush=True)
