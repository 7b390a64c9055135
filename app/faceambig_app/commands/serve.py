"""faceambig serve: the page, for this machine or, by a link with a token, for others."""

from __future__ import annotations

import argparse
import logging
import os
import sys


def add(command: argparse.ArgumentParser) -> None:
    """Its flags."""
    command.add_argument(
        "--host",
        default="127.0.0.1",
        help="address to listen on: 127.0.0.1 for this machine only (default), 0.0.0.0 for all that reach it",
    )
    command.add_argument("--port", type=int, default=8080, help="port (default 8080)")
    command.add_argument(
        "--token",
        nargs="?",
        const="",
        help="let in only who comes by the link with this token; without a value one is made, as it is for other "
        "addresses than 127.0.0.1",
    )
    command.add_argument(
        "--present",
        action="store_true",
        help="for a class: who opens the leader's link leads, all others follow; give --host 0.0.0.0 too",
    )
    command.add_argument(
        "--allow-host",
        action="append",
        default=[],
        metavar="NAME",
        help="a name besides the address: class.example of a proxy with TLS, or with this page's own port "
        "teacher.local:8080; may be repeated",
    )
    command.add_argument(
        "--max-sessions", type=int, default=64, metavar="N", help="browsers at a time (default 64)"
    )
    command.add_argument(
        "--idle-minutes",
        type=float,
        default=60.0,
        metavar="M",
        help="a browser is sent away after so long without a word (default 60)",
    )


def run(options: argparse.Namespace) -> int:
    """Serve the page until interrupted, and end the program."""
    from .. import guard
    from ..server import serve

    token = guard.make_token() if options.token == "" else options.token
    limits = guard.Limits(sessions=options.max_sessions, idle=60 * options.idle_minutes)
    status = serve(
        options.host, options.port, token=token, allowed=options.allow_host, limits=limits,
        present=options.present,
    )  # fmt: skip
    logging.shutdown()
    sys.stdout.flush()
    sys.stderr.flush()
    # Python itself would wait for a photograph that is being read, and take a second to put all of a model away
    os._exit(status)
