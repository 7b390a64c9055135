"""faceambig serve: the page, on this machine."""

from __future__ import annotations

import argparse


def add(command: argparse.ArgumentParser) -> None:
    """Its flags."""
    command.add_argument(
        "--host",
        default="127.0.0.1",
        help="address to listen on; only this machine's own (default 127.0.0.1)",
    )
    command.add_argument("--port", type=int, default=8080, help="port (default 8080)")


def run(options: argparse.Namespace) -> int:
    """Serve the page until interrupted."""
    from ..server import serve

    return serve(options.host, options.port)
