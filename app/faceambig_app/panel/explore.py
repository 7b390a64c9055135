"""Explore: the assumed distance and what is looked at; the rest in folders."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import viser

from ..state.fields import FIELDS
from ..text import say
from .widgets import Widgets

NAMED_VIEWS = tuple(name for name in FIELDS["view"].choices if name != "free")


def build_first(w: Widgets) -> None:
    """What a newcomer sees: the slider that the page is about, the same in figures, and how to look."""
    w.distance("distance")
    w.centimetres("distance", "distance_cm")
    w.actions("play", ("glide",))
    w.buttons("view", NAMED_VIEWS)
    w.buttons("show", ("both", "overlay", "blink", "difference"))


def build_photo(w: Widgets, people: Mapping[Any, str]) -> None:
    """Folders of who is in the photo, and how."""
    with folder(w, "photo"):
        w.dropdown("subject", people)
        w.distance("actual")
    with folder(w, "pose"):
        for name in ("yaw", "pitch", "roll"):
            w.slider(name)


def build_data(w: Widgets) -> None:
    """Folders of what is fitted, and how."""
    with folder(w, "data"):
        w.buttons("data")
        w.buttons("scheme")
        w.slider("noise")
        w.action("new_noise")
    with folder(w, "fit"):
        w.buttons("camera")
        w.slider("modes")
        w.logarithmic("prior", (0.01, 0.1, 1, 5))
        w.slider("box")


def build_history(w: Widgets) -> None:
    """The way back, and the way to somebody else."""
    w.actions("history", ("undo", "redo", "reset", "copy_link"))


def folder(w: Widgets, name: str, *, visible: bool = True) -> viser.GuiFolderHandle:
    """A folder that a newcomer need not open."""
    return w.gui.add_folder(say(f"folder.{name}"), expand_by_default=False, visible=visible)
