"""Write docs/commands.md from the parsers of the commands: every flag with the words of its --help.

    python tools/command_reference.py          # writes the page
    python tools/command_reference.py --check  # writes nothing; 1 if the page is old

From the parser's rows and not from its printed help, whose form changes with Python and with the terminal's width.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

from faceambig_app.cli import parser
from faceambig_app.commands import COMMANDS
from faceambig_app.commands.shared import BAD_INPUT, GOOD, NOT_CONVERGED, READER_GONE

PAGE = Path(__file__).resolve().parents[1] / "docs" / "commands.md"
HEAD = f"""# Commands

Written by `python tools/command_reference.py` from the same parsers that print `faceambig COMMAND --help`; a test
compares them.

Flags are given in full; `faceambig --version` prints the version. The exit status is {GOOD} if all is good,
{NOT_CONVERGED} if a fit did not converge or a part of the work could not be done, {BAD_INPUT} with one line on stderr
if the input is bad, 130 if interrupted, {READER_GONE} if what reads the output has gone.

| command | |
|---|---|
"""


def page() -> str:
    """All commands in the order of the help."""
    root = parser()
    subparsers = next(
        action.choices for action in root._actions if isinstance(action, argparse._SubParsersAction)
    )
    rows = [f"| [`{name}`](#{name}) | {words} |\n" for name, _, words in COMMANDS]
    sections = [section(name, words, subparsers[name]) for name, _, words in COMMANDS]
    return HEAD + "".join(rows) + "\n" + "\n".join(sections)


def section(name: str, words: str, command: argparse.ArgumentParser) -> str:
    """One command: what it is for, how it is called, a table of its flags."""
    lines = [f"## {name}", "", f"{words[0].upper()}{words[1:]}.", ""]
    lines += ["```text", *usage(name, command), "```", "", "| flag | what it says |", "|---|---|"]
    lines += [
        f"| {called(command, action)} | {cell(said(command, action))} |"
        for action in command._actions
        if action.help != argparse.SUPPRESS and not isinstance(action, argparse._HelpAction)
    ]
    return "\n".join(lines) + "\n"


def usage(name: str, command: argparse.ArgumentParser) -> Iterator[str]:
    """The command's own usage where it has one; else its words, what it must be given, and [flags]."""
    if command.usage:
        yield from (line.strip() for line in command.usage.splitlines())
        return
    needed = [a for a in command._actions if a.required and a.option_strings]
    flags = [f"{action.option_strings[-1]} {shown(command, action)}" for action in needed]
    words = [shown(command, action) for action in command._actions if not action.option_strings]
    yield " ".join(["faceambig", name, *flags, "[flags]", *words])


def shown(command: argparse.ArgumentParser, action: argparse.Action) -> str:
    """What stands for the value of a flag or for a word of its own."""
    formatter = command._get_formatter()
    if not action.option_strings:
        return formatter._format_args(action, formatter._get_default_metavar_for_positional(action))
    return formatter._format_args(action, formatter._get_default_metavar_for_optional(action))


def called(command: argparse.ArgumentParser, action: argparse.Action) -> str:
    """A flag as it is typed."""
    if not action.option_strings:
        return f"`{cell(shown(command, action))}`"
    value = () if action.nargs == 0 else (shown(command, action),)
    return ", ".join(f"`{cell(' '.join((flag, *value)))}`" for flag in action.option_strings)


def said(command: argparse.ArgumentParser, action: argparse.Action) -> str:
    """The words of the help, with what argparse fills in."""
    words = command._get_formatter()._expand_help(action) if action.help else ""
    return f"{words} (required)" if action.required and action.option_strings else words


def cell(text: str) -> str:
    """Text that may stand in a cell of a table."""
    return " ".join(text.split()).replace("|", r"\|")


def main() -> int:
    check = "--check" in sys.argv[1:]
    text = page()
    old = not PAGE.is_file() or PAGE.read_text(encoding="utf-8") != text
    if old:
        print(f"docs/{PAGE.name}: {'is old; run this without --check' if check else 'written'}")
        if not check:
            PAGE.write_text(text, encoding="utf-8")
    return int(check and old)


if __name__ == "__main__":
    sys.exit(main())
