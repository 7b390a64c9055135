"""What our script in the page is given: hidden elements and, for colours, a hidden cloud of points."""

from __future__ import annotations

import html
import json

import numpy as np
import viser


def data_html(kind: str, value: object) -> str:
    """A hidden element for `gui.add_html` that our script reads when its message comes, shown or not.

    The kinds stand at the top of assets/page/channel.js. "title": text of the browser's tab. "pressed": label of a
    button group -> the option that is on. "valuetext": label of a slider -> what a screen reader says for its number.
    "icons": icon -> name of its button, viser's gear is "adjustments". For those that a `Script` sends see script.py.
    """
    return f"<div hidden {_attributes(kind, value)}></div>"


def data_meta(kind: str, value: object) -> str:
    """The same for the head of the page: what our script knows before the server has said a word."""
    return f'<meta name="faceambig" {_attributes(kind, value)}>'


def _attributes(kind: str, value: object) -> str:
    return f'data-faceambig="{kind}" data-json="{html.escape(json.dumps(value))}"'


def add_colours(scene: viser.SceneApi, parent: str, colours: np.ndarray) -> viser.PointCloudHandle:
    """Colours (V, 3) uint8 sRGB for the vertices of the meshes that stand directly below `parent`.

    Assign new ones to `.colors`; `.remove()` takes them off. A mesh of fewer vertices takes the first ones. They travel
    as a cloud of points that is never shown, in the same batch of messages as the vertices.
    """
    _check(colours)
    return scene.add_point_cloud(
        f"{parent}/colours", np.zeros(colours.shape), colours, point_size=0.001, visible=False
    )


def _check(colours: np.ndarray) -> None:
    if colours.dtype != np.uint8 or colours.ndim != 2 or colours.shape[1] != 3:
        raise ValueError(f"colours must be (V, 3) uint8, not {colours.shape} {colours.dtype}")
