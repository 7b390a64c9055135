"""A state as a picture: the page's scene, drawn off-screen."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from faceambig.scene import Scene

from .. import pipeline
from ..files import write
from ..state import ViewState
from ..text import drawn_words, speaking
from .provenance import file_name, provenance, shown

SCALES = (1, 2, 4)  # of a picture
Progress = Callable[[int, int], None]  # how much is done, of how much; what it raises ends the work


def snapshot(
    state: ViewState,
    path: str | Path | None = None,
    *,
    width: int | None = None,
    height: int | None = None,
) -> np.ndarray:
    """The page's picture of a state, drawn off-screen: (H, W, 4) uint8 RGBA, and a PNG file if `path` is given."""
    # pyrender and OpenCV only when a picture is asked for
    from faceambig.render.overlay import draw, encode_png

    with speaking(state.lang):
        drawn = draw(pipeline.frame(state).scene, width, height, words=drawn_words())
    if path is not None:
        write(Path(path), encode_png(drawn, provenance(state)))
    return drawn


def picture(
    state: ViewState,
    *,
    scale: int = 1,
    transparent: bool = False,
    overlays: bool = True,
    own_photo: bool = False,
    progress: Progress | None = None,
) -> tuple[str, bytes]:
    """The snapshot as a PNG of `scale` times 1440 x 900, a strip 1600 x 760.

    transparent: nothing behind the heads. overlays: False leaves the heads alone, without words, marks and numbers.
    """
    if scale not in SCALES:
        raise ValueError(f"scale: {scale!r} is not one of {', '.join(map(str, SCALES))}")
    scene = pipeline.frame(state).scene
    scene = scene if own_photo else without_own_photo(scene)
    return picture_of(scene, state, scale, transparent, overlays, progress)


def picture_of(
    scene: Scene,
    state: ViewState,
    scale: int,
    transparent: bool,
    overlays: bool,
    progress: Progress | None,
) -> tuple[str, bytes]:
    """A scene of a state as a PNG; the options are those of `picture`."""
    from faceambig.render.overlay import draw, encode_png

    step = None if progress is None else _counted(scene, progress)
    rgba = draw(
        scene,
        scale=scale,
        transparent=transparent,
        overlays=overlays,
        words=drawn_words(),
        step=step,
    )
    if progress is not None:
        progress(1, 1)
    return file_name(shown(state), "png"), encode_png(rgba, provenance(state))


def _counted(scene: Scene, progress: Progress) -> Callable[[], None]:
    """What tells the progress of a picture of a scene: before each head and photograph, how many are done."""
    drawn = itertools.count()
    pictures = 2 if scene.through_camera else 1 + len(scene.heads) * len(scene.views)
    return lambda: progress(min(next(drawn), pictures), pictures + 1)  # then the file is written


def without_own_photo(scene: Scene) -> Scene:
    """The scene with the fitted face where a photograph of one's own was; a synthetic one stays."""
    if scene.photo.pixels is None:
        return scene
    return replace(scene, photo=replace(scene.photo, pixels=None))
