"""How true and how fast the automatic landmarks are: `python benchmarks/detect.py [--json] [--check]`.

Renderings: 15 heads of the embedded model (its ten people, five drawn from its modes) and, if FACEAMBIG_ICT names its
folder, 15 drawn from ICT-FaceKit's; yaw from -30 to 30 degrees, pitch within 10. Each is drawn twice: as the page's
photographs are (0.4 to 2 m away, roll within 10) and by OpenGL from far away, in another light. True points are the
model's own. ICT-FaceKit has no colours: its heads are bare clay, without brows and lips. FACEAMBIG_PTS names the
hand-placed points of a photograph that lies beside them.

Errors are means over points, in percent of the distance of the outer eye corners. Milliseconds of CPU of one thread,
least of some rounds. --check fails when the photograph's points without the jaw are off by more than is promised, a
face is not found, or one is found where there is none.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import cv2
import numpy as np
from numpy.typing import NDArray
from timing import about, compare

import faceambig as fa
from faceambig.arrays import Array
from faceambig.compose import head, photo, skin
from faceambig.io.detect import detect_landmarks
from faceambig.io.nets import DETECTOR_PX, MESH_PX, Frame, candidates, face_mesh
from faceambig.io.pictures import picture_beside
from faceambig.observation import portrait_camera
from faceambig.render import gl
from faceambig.render.painter import paint_photo
from faceambig.scene import View

Picture = NDArray[np.uint8]
HEADS = 15  # of each model
PROMISED = 3.2  # percent, of the photograph's points without the jaw
GROUPS = {
    "no jaw": slice(17, 68),
    "jaw": slice(0, 17),
    "brows": slice(17, 27),
    "nose": slice(27, 36),
    "eyes": slice(36, 48),
    "mouth": slice(48, 68),
}
CORNERS = (36, 45)  # the outer ones of the eyes, in the order of iBUG
WIDTH, EYES_PX = 640, 100.0  # pixels: of a photograph, and between the eyes in one of 500
FAR_WIDTH, FAR_SCALE = 600, 1700.0  # pixels of a picture from far away, and in a metre


def main() -> int:
    """Print the tables."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--json", action="store_true")
    arguments.add_argument("--check", action="store_true")
    options = arguments.parse_args()
    cv2.setNumThreads(1)
    known = about() | {"opencv": cv2.__version__}
    sets, missed = {}, 0
    if file := os.environ.get("FACEAMBIG_PTS"):
        picture, points = by_hand(Path(file))
        sets["the photograph"] = [(picture, points)]
    for model in models():
        sets[f"{model.name}, page"] = list(renderings(model))
        sets[f"{model.name}, far away"] = list(far_renderings(model))
    errors = {}
    for name, pictures in sets.items():
        errors[name] = np.array([error_percent(*each) for each in pictures])
        missed += int(np.isnan(errors[name]).any(axis=1).sum())
    table = {name: summary(each) for name, each in errors.items()}
    wrong = [name for name, picture in faceless().items() if found(picture) is not None]
    speed = milliseconds(next(iter(sets.values()))[0][0])
    if options.json:
        print(json.dumps(known | {"errors": table, "wrong": wrong, "milliseconds": speed}))
    else:
        print(
            "% of the outer eye corners' distance".ljust(38),
            *(f"{g:>7}" for g in GROUPS),
            " worst picture, found",
        )
        for name, row in table.items():
            line = " ".join(f"{row[group]:7.2f}" for group in GROUPS)
            print(f"{name:<38} {line} {row['worst']:7.2f}   {row['found']:.0f} of {row['of']:.0f}")
        print(
            f"faces found where there is none: {', '.join(wrong) or 'none'} (of {len(faceless())} pictures)"
        )
        print("ms: " + ", ".join(f"{name} {ms:.1f}" for name, ms in speed.items()))
    promised = table.get("the photograph", {"no jaw": 0.0})["no jaw"] <= PROMISED
    return int(options.check and (missed > 0 or bool(wrong) or not promised))


def models() -> list[fa.FaceModel]:
    """The embedded head, and ICT-FaceKit where it is."""
    return [
        fa.load_model(name)
        for name in ("embedded", *(["ict"] if os.environ.get("FACEAMBIG_ICT") else []))
    ]


def by_hand(file: Path) -> tuple[Picture, Array]:
    """A photograph and its hand-placed points (68, 2). 300-W calls the middle of the first pixel 1, we 0.5."""
    beside = picture_beside(file)
    pixels = cv2.imread(str(beside), cv2.IMREAD_COLOR_RGB)
    if pixels is None:
        sys.exit(f"{file}: no picture beside it")
    return np.asarray(pixels, np.uint8), fa.load_landmarks(file).points - 0.5


def heads(model: fa.FaceModel) -> Iterator[tuple[fa.Subject, float, Array]]:
    """Subject, yaw and three numbers from -1 to 1 of each rendering."""
    rng = np.random.default_rng(1)
    for i, yaw in enumerate(np.linspace(-30.0, 30.0, HEADS)):
        alpha, free = rng.standard_normal(model.n_modes), rng.uniform(-1.0, 1.0, 3)
        known = i < len(model.subjects)
        face = (
            model.subject(i + 1)
            if known
            else fa.Subject("drawn", "", model.vertices(alpha), None, model)
        )
        yield face, float(yaw), free


def renderings(model: fa.FaceModel) -> Iterator[tuple[Picture, Array]]:
    """Photographs as on the page, and the true points (68, 2)."""
    for face, yaw, (pitch, roll, way) in heads(model):
        distance = float(np.sqrt(0.4 * 2.0) * np.sqrt(2.0 / 0.4) ** way)
        pose = {"yaw_deg": yaw, "pitch_deg": 10 * pitch, "roll_deg": 10 * roll, "eyes_px": EYES_PX}
        seen = fa.observe(face, distance=distance, **pose)
        drawn = photo(face, seen, portrait_camera(face, distance=distance, **pose), caption="")
        yield paint_photo(drawn, WIDTH), seen.points * WIDTH / drawn.width


def far_renderings(model: fa.FaceModel) -> Iterator[tuple[Picture, Array]]:
    """Heads before grey by OpenGL, parallel rays, and the true points (68, 2)."""
    for face, yaw, (pitch, _, _) in heads(model):
        view = View("free", yaw, 10 * float(pitch), 0.2)
        shown = head(model, "true", "", face.vertices, skin(face), slot=0.0)
        rgba = gl.render_head(shown, view, FAR_WIDTH, FAR_WIDTH, FAR_SCALE).astype(np.float64)
        alpha = rgba[..., 3:] / 255.0
        points = face.vertices[model.scheme("ibug68").vertices] @ gl.viewer_rotation(view).T
        middle = 0.5 * FAR_WIDTH
        yield (
            (alpha * rgba[..., :3] + (1.0 - alpha) * 200.0).round().astype(np.uint8),
            middle + FAR_SCALE * points[:, :2] * (1.0, -1.0),
        )


def found(picture: Picture) -> Array | None:
    """(68, 2) the points; None where there is no face."""
    try:
        return detect_landmarks(picture, jaw=True).points
    except ValueError:
        return None


def error_percent(picture: Picture, truth: Array) -> Array:
    """(68,) distances to the true points; NaN where no face is found."""
    points = found(picture)
    if points is None:
        return np.full(len(truth), np.nan)
    across = np.linalg.norm(truth[CORNERS[0]] - truth[CORNERS[1]])
    return 100.0 * np.linalg.norm(points - truth, axis=1) / across


def summary(errors: Array) -> dict[str, float]:
    """Means over the pictures with a face found (n, 68), and the picture that is worst without its jaw."""
    seen = errors[np.isfinite(errors).all(axis=1)]
    row = {name: float(seen[:, group].mean()) for name, group in GROUPS.items()}
    return row | {
        "worst": float(seen[:, GROUPS["no jaw"]].mean(axis=1).max()),
        "found": len(seen),
        "of": len(errors),
    }


def faceless() -> dict[str, Picture]:
    """Pictures without a face: nothing, noise of several sizes, a drawn smile, heads from behind."""
    rng = np.random.default_rng(0)
    pictures = {
        "black": np.zeros((400, 500, 3), np.uint8),
        "white": np.full((400, 500, 3), 255, np.uint8),
    }
    pictures["noise"] = rng.integers(0, 256, (600, 800, 3)).astype(np.uint8)
    for blur in (3, 10, 20, 40, 80):
        cloud = cv2.GaussianBlur(rng.normal(size=(600, 800, 3)), (0, 0), blur)
        low, high = cloud.min(), cloud.max()
        pictures[f"clouds of {blur} px"] = (255.0 * (cloud - low) / (high - low)).astype(np.uint8)
    smile = np.full((400, 400, 3), 255, np.uint8)
    cv2.circle(smile, (200, 200), 150, (255, 220, 0), cv2.FILLED)
    for x in (150, 250):
        cv2.circle(smile, (x, 160), 18, (0, 0, 0), cv2.FILLED)
    cv2.ellipse(smile, (200, 220), (80, 60), 0, 20, 160, (0, 0, 0), 8)
    pictures["a drawn smile"] = smile
    model = fa.load_model("embedded")
    for number in (1, 5, 10):
        face = model.subject(number)
        seen = fa.observe(face, distance=1.0)
        drawn = photo(face, seen, portrait_camera(face, distance=1.0, yaw_deg=180.0), caption="")
        pictures[f"subject {number} from behind"] = paint_photo(drawn, WIDTH)
    return pictures


def milliseconds(picture: Picture) -> dict[str, float]:
    """CPU of each network and of all together, on one picture with its face in sight."""
    height, width = picture.shape[:2]
    whole = Frame(np.array([0.5 * width, 0.5 * height]), float(max(width, height)), 0.0)
    face = candidates(picture, whole, 0.5)[0]
    around = Frame(face.box[0], 1.5 * float(face.box[1].max()), 0.0)
    blank = np.full((600, 800, 3), 128, np.uint8)
    work = {
        f"detector ({DETECTOR_PX} px)": lambda: candidates(picture, whole, 0.5),
        f"face mesh ({MESH_PX} px)": lambda: face_mesh(picture, around),
        f"a picture of {width} x {height}": lambda: detect_landmarks(picture),
        "one of 800 x 600 without a face": lambda: found(blank),
    }
    return compare(work, 10)


if __name__ == "__main__":
    sys.exit(main())
