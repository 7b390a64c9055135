"""faceambig snapshot: the page's picture of a state; its flags are the fields of the state."""

from __future__ import annotations

import argparse

from ..state import DEFAULT, FIELDS, ViewState, parse
from .shared import GOOD

HELP = {
    "subject": "synthetic person, counted from 1",
    "actual": "where the photo was taken from, metres",
    "distance": "distance the fit assumes, metres",
    "camera": "camera of the fit",
    "yaw": "turn of the head in the photo, degrees",
    "pitch": "nod of the head in the photo, degrees",
    "roll": "tilt of the head in the photo, degrees",
    "scheme": "landmarks used",
    "noise": "noise added to the points, %% of the eye distance",
    "seed": "of the noise",
    "modes": "shape modes of the fit",
    "prior": "landmark noise the fit assumes, %% of the eye distance",
    "box": "largest shape coefficient, standard deviations",
    "flex": "millimetres along the first flexibility mode",
    "show": "two heads, or the row of fits at 30 60 120 240 cm",
    "surface": "colours of the fitted face",
    "view": "where the viewer stands",
}


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
        "--model", default=DEFAULT.model, help="model name or path (default embedded)"
    )
    for field in FIELDS.values():
        unit = (
            f" [{field.low:g} to {field.high:g}]"
            if not field.choices
            else f" [{', '.join(field.choices)}]"
        )
        default = getattr(DEFAULT, field.name)
        command.add_argument(
            field.flag,
            dest=field.name,
            metavar=field.name.upper(),
            help=f"{HELP[field.name]}{unit} (default {default})",
        )


def run(options: argparse.Namespace) -> int:
    """Draw a state off-screen."""
    state = state_of(options)
    for side in (options.width, options.height):
        if side is not None and not 64 <= side <= 8192:
            raise ValueError(f"width, height: {side} is not within 64 to 8192 pixels")
    from pathlib import Path

    from ..pipeline import snapshot, writable

    writable(Path(options.out))  # before the work, not after it
    snapshot(state, options.out, width=options.width, height=options.height)
    return GOOD


def state_of(options: argparse.Namespace) -> ViewState:
    """The state of the flags given."""
    given = {
        name: parse(field, getattr(options, name))
        for name, field in FIELDS.items()
        if getattr(options, name) is not None
    }
    return ViewState(model=options.model, **given)
