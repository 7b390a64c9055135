"""The pictures of the paper's figure 2: input, fit to landmarks, edges and contour, fit with contours, coloured result.

    python tools/gallery.py                 # of a rendering of the embedded head, to docs/gallery.png
    python tools/gallery.py photo.jpg points.pts --model ict --out gallery.png  # outside the repository

A photograph's own gallery shows the person: it does not belong into the repository. Needs no OpenGL.
"""

from __future__ import annotations

import argparse
import os
from dataclasses import replace
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import cv2
import numpy as np

import faceambig as fa
from faceambig import compose
from faceambig.boundary import occluding_boundary
from faceambig.camera import project
from faceambig.io.edges import canny_edges
from faceambig.io.pictures import read_picture
from faceambig.observation import portrait_camera
from faceambig.render import painter
from faceambig.render.canvas import Canvas
from faceambig.render.marked import marks
from faceambig.render.overlay import encode_png
from faceambig.render.plots import DIM, INK
from faceambig.render.sheet import PROJECTED
from faceambig.texture import sample_texture

DOCS = Path(__file__).resolve().parent.parent / "docs"
VIEW = {"distance": 0.6, "yaw_deg": 35.0}
SUBJECT, SIDE = 7, 900  # pixels of the rendering
TILE, GAP, WORDS = 380, 14, 58  # pixels
EDGE, PAIR = (0x52, 0x60, 0x6D), (0xA8, 0x4A, 0x00)


def main() -> None:
    """Make one gallery."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("photo", nargs="?", type=Path, help="photograph (default: a rendering)")
    parser.add_argument("points", nargs="?", type=Path, help="its landmarks")
    parser.add_argument("--model", default="embedded")
    parser.add_argument("--distance", type=float, default=VIEW["distance"])
    parser.add_argument("--out", type=Path, default=DOCS / "gallery.png")
    options = parser.parse_args()
    model = fa.load_model(options.model)
    if options.photo is None:
        rgb, observation, truth = rendering(model)
    else:
        if options.points is None or options.out.resolve().is_relative_to(DOCS.parent):
            parser.error("a photograph needs its points, and --out outside the repository")
        rgb = read_picture(options.photo).rgb
        size = (rgb.shape[1], rgb.shape[0])
        read = fa.load_landmarks(options.points, image_size=size, model=model)
        observation, truth = fa.Observation(read.points, read.scheme, image_size=size), None
    picture = gallery(model, rgb, observation, truth, options.distance)
    options.out.write_bytes(encode_png(picture, {"Software": "faceambig"}))
    print(f"{options.out}: {picture.shape[1]} x {picture.shape[0]}")


def rendering(model: fa.FaceModel) -> tuple[np.ndarray, fa.Observation, fa.Subject]:
    """A photograph of a subject who is not in the model, and its points."""
    subject = model.subject(SUBJECT)
    observation = fa.observe(subject, eyes_px=SIDE / 5, **VIEW)
    camera = portrait_camera(subject, eyes_px=SIDE / 5, **VIEW)
    taken = compose.photo(subject, observation, camera, caption="")
    return painter.paint_photo(taken, SIDE), observation, subject


def gallery(model, rgb, observation, truth, distance) -> np.ndarray:
    """(h, w, 4) RGBA of five tiles."""
    edges = canny_edges(rgb)
    before = fa.fit(model, observation, distance=distance)
    contour = fa.contour_fit(model, observation, edges, distance=distance)
    after = contour.fit
    size = (rgb.shape[1], rgb.shape[0])
    low, high = frame(observation, before, size)
    step = TILE / (high - low).max()
    part = rgb[low[1] : high[1], low[0] : high[0]]
    tile = tuple(np.round(step * (high - low)).astype(int).tolist())
    ground = cv2.resize(part, tile, interpolation=cv2.INTER_AREA)
    titles = ["Input", "Fit to landmarks", "Edges and contour", "Fit with contours", "Result"]
    notes = [
        f"{int(observation.visible.sum())} landmarks",
        said(before, truth),
        f"{len(contour.pairs)} pairs, {contour.iterations} iterations",
        said(after, truth),
        "colours of the input; mirrored and filled where it shows none",
    ]
    tiles = []
    for index in range(5):
        canvas = Canvas(tile, 1.0, (255, 255, 255))
        canvas.pixels[:] = ground
        if index in (1, 3, 4):
            fit = before if index == 1 else after
            shown = moved(compose.photo_of_fit(fit, size), low, step, tile)
            colours = sample_texture(fit, rgb).colours if index == 4 else shown.colours
            canvas.pixels[:] = painted(
                ground if index != 4 else None, shown, colours, lit=index != 4
            )
        if index == 0:
            shown = moved(compose.photo_of_fit(before, size), low, step, tile)
            marks(canvas, np.zeros(2), 1.0, replace(shown, projected=np.zeros((0, 2))), 3.0)
        if index == 2:
            canvas.pixels[:] = 255
            for x, y in (edges - low) * step:
                if 0 <= x < tile[0] and 0 <= y < tile[1]:
                    canvas.pixels[int(y), int(x)] = EDGE
            boundary = occluding_boundary(model, after.vertices(), after.camera)
            seen = boundary.vertices[boundary.visible]
            xy = project(after.camera, after.vertices()[seen]) + observation.centre
            for at in (xy - low) * step:
                canvas.circle((float(at[0]), float(at[1])), 1.6, PROJECTED)
            for at in (contour.pairs.points - low) * step:
                canvas.circle((float(at[0]), float(at[1])), 1.3, PAIR)
        tiles.append(canvas.pixels)
    sheet = Canvas((5 * tile[0] + 6 * GAP, tile[1] + WORDS + GAP), 1.0, (255, 255, 255))
    for index, (picture, title, note) in enumerate(zip(tiles, titles, notes, strict=True)):
        x = GAP + index * (tile[0] + GAP)
        sheet.paste(x, WORDS, picture)
        sheet.text(x, 24, title, 17, INK, 650, most=tile[0])
        sheet.text(x, 46, note, 13, DIM, most=tile[0])
    opaque = np.full((*sheet.pixels.shape[:2], 1), 255, dtype=np.uint8)
    return np.concatenate([sheet.pixels, opaque], axis=2)


def said(fit: fa.Fit, truth: fa.Subject | None) -> str:
    """The numbers under a fit; the surface is only known of a rendering."""
    words = f"landmark error {fit.d_l_percent:.1f}\u202f%"
    if truth is None:
        return words
    return f"{words}, surface {compose.measure(truth, fit).d_s_mm:.1f}\u202fmm off"


def frame(observation, fit, size) -> tuple[np.ndarray, np.ndarray]:
    """Corners of a square about the face, inside the picture."""
    xy = project(fit.camera, fit.vertices()) + observation.centre
    middle = 0.5 * (xy.min(axis=0) + xy.max(axis=0))
    half = min(0.56 * np.ptp(xy, axis=0).max(), 0.5 * min(size))
    middle = np.clip(middle, half, np.array(size) - half)
    return np.round(middle - half).astype(int), np.round(middle + half).astype(int)


def moved(shown, low, step, tile):
    """The photo in the pixels of a tile."""
    return replace(
        shown,
        width=tile[0],
        height=tile[1],
        observed=(shown.observed - low) * step,
        projected=(shown.projected - low) * step,
        focal=shown.focal * step,
        principal=tuple(((np.array(shown.principal) - low) * step).tolist()),
    )


def painted(ground, shown, colours, *, lit: bool) -> np.ndarray:
    """The fitted face over a tile, or on white; unlit: the colours carry the photograph's light already."""
    scale = painter.SAMPLES
    size = (scale * shown.height, scale * shown.width, 3)
    large = np.full(size, 255, dtype=np.float32)
    if ground is not None:
        large[:] = ground.repeat(scale, axis=0).repeat(scale, axis=1)
    if lit:
        painter.paint_over(large, shown.vertices, shown, shown.focal)
    else:
        z = shown.vertices[:, 2:]
        xy = scale * (shown.focal * shown.vertices[:, :2] / z + shown.principal)
        painter.fill(large, np.hstack([xy, 1 / z]), shown.faces, colours.astype(float))
    small = cv2.resize(large, (shown.width, shown.height), interpolation=cv2.INTER_AREA)
    return small.round().clip(0, 255).astype(np.uint8)


if __name__ == "__main__":
    main()
