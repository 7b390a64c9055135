"""A track as a moving picture that comes back to where it began: animated WebP and GIF, drawn as snapshots are.

Every frame is a fit of its own, none is interpolated. Along the distance the frames lie evenly in ratio; along a mode
they swing, slow at the ends.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from faceambig.arrays import Array

from ..state import ViewState, changed
from ..text import drawn_words
from .pictures import Progress, without_own_photo
from .provenance import file_name, notes, provenance, shown, who
from .tracks import (
    FARTHEST,
    MOST_MM,
    NEAREST,
    SWING_MM,
    Track,
    distance_track,
    mode_track,
    scene_of,
)

if TYPE_CHECKING:
    from PIL import Image

Picture = NDArray[np.uint8]  # (H, W, 3) sRGB

SECONDS, FPS, WIDTH = 6.0, 12.0, 960  # there and back
LIMITS = {"seconds": (0.5, 60.0), "fps": (1.0, 30.0), "width": (320, 1920)}
SHAPE = 0.625  # height over width, as of the snapshot
MOST_PIXELS = 200_000_000  # of all frames together: 600 MB
QUALITY, METHOD = 85, 4  # of WebP
COLOURS, EXACT = 256, 8  # of GIF
SOFTWARE, DESCRIPTION = 0x0131, 0x010E  # EXIF


def animation(
    state: ViewState,
    kind: str,
    *,
    what: str = "distance",
    mode: int = 1,
    low: float | None = None,
    high: float | None = None,
    seconds: float = SECONDS,
    fps: float = FPS,
    width: int = WIDTH,
    own_photo: bool = False,
    progress: Progress | None = None,
) -> tuple[str, bytes]:
    """(name, contents) of a "webp" or "gif" that goes from low to high and back, without end.

    Parameters
    ----------
    what: "distance": low and high in metres, 0.2 to 3 left out. "mode": in millimetres along mode `mode` (1 to 3) of
        the state's fit, -5 to 5 left out.
    seconds: there and back. fps: frames a second; GIF counts hundredths of a second. width: pixels, height 5/8 of it.
    own_photo: a photograph of one's own is shown; else the face that was fitted, in its place.

    Raises
    ------
    ValueError: no such kind or an argument out of range. NoRendererError: no OpenGL.
    """
    if kind not in ("webp", "gif"):
        raise ValueError(f"kind: {kind!r} is not webp or gif")
    for name, value in (("seconds", seconds), ("fps", fps), ("width", width)):
        least, most = LIMITS[name]
        if not least <= value <= most:
            raise ValueError(f"{name}: {value:g} is not within {least:g} to {most:g}")
    low, high = ends(what, low, high)
    count = max(2, round(seconds * fps / 2) + 1)
    size = (int(width), round(SHAPE * width))
    if count * size[0] * size[1] > MOST_PIXELS:
        raise ValueError(
            f"width: {count} frames of {size[0]} x {size[1]} are more than {MOST_PIXELS // 10**6} million pixels; "
            "give fewer seconds, fps or width"
        )
    state = changed(state, show="both")
    track = track_of(state, what, mode, places(what, low, high, count))
    forth = drawn(state, track, size, own_photo=own_photo, progress=progress)
    frames = [*forth, *forth[-2:0:-1]]
    words = f"{who(state)}_distance" if what == "distance" else f"{shown(state)}_{track.name}"
    encode = encode_webp if kind == "webp" else encode_gif
    return file_name(words, kind), encode(frames, fps, state)


def ends(what: str, low: float | None, high: float | None) -> tuple[float, float]:
    """Both ends of the way, those left out filled in; ValueError unless they may be."""
    if what not in ("distance", "mode"):
        raise ValueError(f"what: {what!r} is not distance or mode")
    if what == "distance":
        least, most, usual, unit = NEAREST, FARTHEST, (NEAREST, FARTHEST), "m"
    else:
        least, most, usual, unit = -MOST_MM, MOST_MM, (-SWING_MM, SWING_MM), "mm"
    low, high = usual[0] if low is None else low, usual[1] if high is None else high
    if not least <= low < high <= most:
        raise ValueError(
            f"from, to: {low:g} to {high:g} {unit} is not a way within {least:g} to {most:g} {unit}"
        )
    return float(low), float(high)


def places(what: str, low: float, high: float, count: int) -> Array:
    """(count,) ascending from low to high: distances evenly in ratio, millimetres as a pendulum swings."""
    if what == "distance":
        steps = np.geomspace(low, high, count)
        steps[[0, -1]] = low, high  # to the last digit: these two are snapshots anyone can ask for
        return steps
    return low + (high - low) * (1.0 - np.cos(np.linspace(0.0, np.pi, count))) / 2.0


def track_of(state: ViewState, what: str, mode: int, stops: Array) -> Track:
    """The track of an animation."""
    return distance_track(state, stops) if what == "distance" else mode_track(state, mode, stops)


def drawn(
    state: ViewState,
    track: Track,
    size: tuple[int, int],
    *,
    own_photo: bool = False,
    progress: Progress | None = None,
) -> list[Picture]:
    """The snapshot of every stop of a track, size (W, H)."""
    from faceambig.render.overlay import draw

    frames = []
    for stop in range(len(track.places)):
        scene = scene_of(state, track, stop)
        scene = scene if own_photo else without_own_photo(scene)
        frames.append(np.ascontiguousarray(draw(scene, *size, words=drawn_words())[..., :3]))
        if progress is not None:
            progress(stop + 1, len(track.places))
    return frames


def encode_webp(frames: Sequence[Picture], fps: float, state: ViewState) -> bytes:
    """Animated WebP, lossy, without end; where it comes from is in its EXIF."""
    from PIL import Image

    exif = Image.Exif()
    exif[SOFTWARE] = provenance(state)["Software"]
    exif[DESCRIPTION] = "\n".join(notes(state))
    first, *others = map(Image.fromarray, frames)
    file = io.BytesIO()
    first.save(
        file, "WEBP", save_all=True, append_images=others, duration=round(1000 / fps), loop=0,
        quality=QUALITY, method=METHOD, exif=exif,
    )  # fmt: skip
    return file.getvalue()


def encode_gif(frames: Sequence[Picture], fps: float, state: ViewState) -> bytes:
    """Animated GIF, without end, of one palette, not dithered: skin would crawl. Where it comes from is its comment."""
    palette = _palette(np.concatenate(frames[:: max(1, len(frames) // 6)]))  # of the whole way
    first, *others = (_indexed(frame, palette) for frame in frames)
    file = io.BytesIO()
    first.save(
        file, "GIF", save_all=True, append_images=others, duration=10 * round(100 / fps), loop=0,
        comment="\n".join(notes(state)).encode(),
    )  # fmt: skip
    return file.getvalue()


def _palette(sample: Picture) -> NDArray[np.uint8]:
    """(COLOURS, 3): the EXACT most frequent of a sample as they are, or grounds would be tinted; others chosen."""
    from PIL import Image

    colours, _, counts = _colours(sample)
    exact = colours[np.argsort(-counts, kind="stable")[:EXACT]]
    chosen = Image.fromarray(sample).quantize(
        COLOURS - len(exact), Image.Quantize.MAXCOVERAGE, kmeans=1
    )
    others = np.array(chosen.getpalette() or [], np.uint8).reshape(-1, 3)
    return np.concatenate([exact, others])[:COLOURS]


def _indexed(frame: Picture, palette: NDArray[np.uint8]) -> Image.Image:
    """The frame in the nearest colours of a palette; Pillow's own search is coarser and misses white."""
    from PIL import Image
    from scipy.spatial import cKDTree

    colours, place, _ = _colours(frame)
    nearest = np.asarray(cKDTree(palette).query(colours)[1], dtype=np.uint8)
    picture = Image.fromarray(nearest[place].reshape(frame.shape[:2]))
    picture.putpalette(palette.ravel().tolist())
    return picture


def _colours(picture: Picture) -> tuple[NDArray[np.uint8], NDArray[np.intp], NDArray[np.intp]]:
    """The colours (n, 3) of a picture, which of them each pixel has, and on how many pixels each is."""
    codes = picture.reshape(-1, 3).astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], np.uint32)
    found, place, counts = np.unique(codes, return_inverse=True, return_counts=True)
    rgb = np.stack([found >> 16, found >> 8 & 255, found & 255], axis=1)
    return rgb.astype(np.uint8), place, counts
