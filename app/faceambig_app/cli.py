"""faceambig on the command line: parse -> state or library call -> print. Text for people, --json for programs.

The commands are in commands/, one module each.

Exit status 0: good; 1: the fit did not converge; 2: bad input, one line on stderr, never a traceback;
130: interrupted; 141: what reads the output has gone.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

from .commands import COMMANDS
from .commands.shared import BAD_INPUT, READER_GONE, version


class Parser(argparse.ArgumentParser):
    """argparse with errors of one line, and flags in full: an abbreviation of today may mean two things tomorrow."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options, allow_abbrev=False)

    def error(self, message: str) -> NoReturn:
        """One line on stderr, exit status 2."""
        # argparse repeats all of a value
        short = message if len(message) <= 300 else f"{message[:297]}..."
        self.exit(BAD_INPUT, f"{self.prog}: {short}\n")


class Version(argparse.Action):
    """Prints it and ends; asked for only then, since a look into the installed packages takes its time."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        print(f"faceambig {version()}")
        parser.exit()


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit status."""
    options = parser().parse_args(arguments)
    try:
        status = options.run(options)
        sys.stdout.flush()  # here, not when Python ends: the reader may have gone
        return status
    except (
        BrokenPipeError
    ):  # the reader has enough, as `| head` has: no error, and nothing more is written
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return READER_GONE
    except (
        ValueError,
        OSError,
        RuntimeError,
    ) as error:  # AssetError and ServeError are among these
        print(f"faceambig {options.command}: {one_line(error)}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        return 130


def one_line(error: BaseException) -> str:
    """The error's words on one line."""
    if isinstance(error, OSError) and error.strerror and error.filename:
        return f"{error.filename}: {error.strerror}"
    return " ".join(str(error).split()) or type(error).__name__


def parser() -> Parser:
    """All commands and their flags."""
    root = Parser(prog="faceambig", description="A photograph of a face does not fix the face.")
    root.add_argument("--version", action=Version, nargs=0, help="print the version and end")
    commands = root.add_subparsers(
        dest="command", required=True, parser_class=Parser, metavar="COMMAND"
    )
    for name, module, words in COMMANDS:
        command = commands.add_parser(name, help=words)
        module.add(command)
        command.set_defaults(run=module.run)
    return root
