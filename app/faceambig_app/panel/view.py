"""View: what is drawn besides the heads, in which colours and how large."""

from __future__ import annotations

from .explore import folder
from .widgets import Widgets


def build(w: Widgets) -> None:
    """The widgets of the tab."""
    w.buttons("surface")
    w.slider("fade")
    w.slider("zoom")
    with folder(w, "overlays"):
        w.names("overlays")
        w.buttons("error_scale")
    with folder(w, "hide"):
        w.names("hide")
    with folder(w, "page"):
        w.buttons("theme")
        w.slider("text")
        w.buttons("lang")
