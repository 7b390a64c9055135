"""faceambig snapshot: the page's picture of a state; its flags are the fields of the state."""

from __future__ import annotations

import argparse

from ..state import DEFAULT, FIELDS, Field, ViewState, changed
from ..state.forms import LONGEST, from_json, text_of, value_of
from .shared import GOOD


def add(command: argparse.ArgumentParser) -> None:
    """Its flags."""
    command.add_argument(
        "--out", required=True, metavar="FILE.png", help="where to write the picture"
    )
    command.add_argument("--width", type=int, metavar="PX", help="width of the picture")
    command.add_argument("--height", type=int, metavar="PX", help="height of the picture")
    add_state(command)


def add_state(command: argparse.ArgumentParser) -> None:
    """The flags of a state: the model, and the rows of the field table."""
    command.add_argument(
        "--state", metavar="FILE.json", help="a state, as saved by the page; flags change it"
    )
    for field in FIELDS.values():
        command.add_argument(
            field.flag, dest=field.name, metavar=field.name.upper(), help=help_of(field)
        )


def help_of(field: Field, also: str = "") -> str:
    """What a flag sets, its range or choices, its default."""
    within = f"{field.low:g} to {field.high:g}" if field.high < float("inf") else ""
    told = " ".join(filter(None, (within, field.unit))) or ", ".join(map(str, field.choices))
    default = text_of(field, getattr(DEFAULT, field.name))
    ranged = f" [{told}]" if told else ""
    # argparse fills in %
    return f"{field.help}{also}{ranged} (default {default})".replace("%", "%%")


def run(options: argparse.Namespace) -> int:
    """Draw a state off-screen."""
    state = state_of(options)
    for side in (options.width, options.height):
        if side is not None and not 64 <= side <= 8192:
            raise ValueError(f"width, height: {side} is not within 64 to 8192 pixels")
    from pathlib import Path

    from ..export import snapshot
    from ..files import writable

    writable(Path(options.out))  # before the work, not after it
    snapshot(state, options.out, width=options.width, height=options.height)
    return GOOD


def state_of(options: argparse.Namespace) -> ViewState:
    """The state of the file and the flags given; a flag counts before the file."""
    given = {
        name: value_of(field, getattr(options, name))
        for name, field in FIELDS.items()
        if getattr(options, name) is not None
    }
    return changed(DEFAULT if options.state is None else _saved(options.state), **given)


def _saved(name: str) -> ViewState:
    """The state in a file of JSON."""
    from pathlib import Path

    path = Path(name)
    with path.open("rb") as file:
        content = file.read(LONGEST + 1)  # not more than tells that it is too long
    try:
        return from_json(content)
    except ValueError as error:
        raise ValueError(f"{path.name}: {error}") from error
