"""Does shading tell the distance? `python benchmarks/shading.py [--actual 0.3] [--json] [--picture docs/shading.png]`.

Faces of known shape photographed from 0.3 m, frontal, under seven known lights; their landmarks fitted at 0.3, 0.6, 1.2
and 2.4 m and orthographic; then the light that explains the photograph's shading best on each fitted face. Faces are
the embedded head's subjects, whom its modes do not reach, faces drawn from all its modes and, if FACEAMBIG_ICT names
its folder, from all modes of ICT-FaceKit. Perfect knowledge otherwise: skin of one colour, no noise, no cast shadows.

The fit at the distance that is true is the ground to compare with: 68 points do not fix the surface there either.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from numpy.typing import NDArray

import faceambig as fa
from faceambig.arrays import Array, vertex_normals
from faceambig.camera import Camera, camera_points, project
from faceambig.metrics import surface_difference
from faceambig.observation import portrait_camera

if TYPE_CHECKING:
    from faceambig.render.canvas import Canvas, Picture

DISTANCES: tuple[float | None, ...] = (0.3, 0.6, 1.2, 2.4, None)  # None: orthographic
DRAWN, RANDOM = 20, 4
SKY = fa.Light.sky(0.1)  # irradiance 0.3 beside a lamp's 1


def lights() -> dict[str, fa.Light]:
    """Towards the lamp in camera axes: 60 degrees from the view to the side, to the top; or three anywhere in front."""
    rng = np.random.default_rng(7)
    across, along = np.sqrt(0.75), -0.5
    named = {
        "frontal": fa.Light.lamp((0, 0, -1)) + SKY,
        "side": fa.Light.lamp((across, 0, along)) + SKY,
        "top": fa.Light.lamp((0, -across, along)) + SKY,
    }
    for k in range(RANDOM):
        mixed = SKY
        for direction in rng.standard_normal((3, 3)):
            mixed = mixed + fa.Light.lamp(
                direction * (1, 1, -np.sign(direction[2])), rng.uniform(0.2, 1)
            )
        named[f"random {k + 1}"] = mixed
    return named


LIGHTS = lights()


@dataclass(frozen=True, slots=True)
class Row:
    """One face, one fit, one light."""

    faces: str
    face: int
    fitted: float | None
    light: str
    d_l_percent: float
    d_s_mm: float
    # Mean angle between the two faces' normals, camera axes, over what is compared
    normals_deg: float
    fraction: float
    kept_fraction: float
    residual: float  # in sd of the target
    residual_percent: float  # of the target's mean
    rank: int


def main() -> None:
    """Print the tables, draw the picture if a file is named."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--json", action="store_true")
    arguments.add_argument("--actual", type=float, default=0.3, help="metres")
    arguments.add_argument("--subjects", action="store_true", help="the embedded head's only")
    arguments.add_argument("--picture", type=Path)
    options = arguments.parse_args()
    embedded = fa.load_model("embedded")
    if options.picture:
        draw(embedded.subject(3), (options.actual, 1.2), ("frontal", "side"), options.picture)
        return
    works = {"embedded head, its subjects": embedded.subjects}
    if not options.subjects:
        works["embedded head, drawn"] = drawn(embedded)
        if os.environ.get("FACEAMBIG_ICT"):
            works["ICT-FaceKit, drawn"] = drawn(fa.load_model("ict"))
    rows = [row for words, faces in works.items() for row in measured(words, faces, options.actual)]
    if options.json:
        print(json.dumps([asdict(row) for row in rows]))
        return
    for words in works:
        print_tables([row for row in rows if row.faces == words], options.actual)
    spread = [colour_percent(face, options.actual) for face in embedded.subjects]
    print(
        f"\nbrightness of the subjects' colours, sd over the picture: {min(spread):.0f} to {max(spread):.0f} % of its "
        f"mean, median {np.median(spread):.0f} %"
    )


def drawn(model: fa.FaceModel) -> tuple[fa.Subject, ...]:
    """Faces of all modes."""
    alphas = np.random.default_rng(2019).standard_normal((DRAWN, model.n_modes))
    return tuple(fa.Subject("drawn", "", model.vertices(alpha), None, model) for alpha in alphas)


def fitted(face: fa.Subject, actual: float, distance: float | None) -> fa.Fit:
    """To the landmarks of the photograph."""
    observation = fa.observe(face, distance=actual)
    camera = "orthographic" if distance is None else "perspective"
    return fa.fit(face.model, observation, camera=camera, distance=distance)


def measured(words: str, faces: Sequence[fa.Subject], actual: float) -> list[Row]:
    """All lights on all fits of these faces."""
    rows = []
    for number, face in enumerate(faces, start=1):
        camera = portrait_camera(face, distance=actual)
        true = vertex_normals(face.vertices, face.model.faces) @ camera.R.T
        for distance in DISTANCES:
            fit = fitted(face, actual, distance)
            found = fit.vertices()
            d_s = surface_difference(found, face.vertices, face.model.evaluation).mean_mm
            normals = vertex_normals(found, face.model.faces) @ fit.camera.R.T
            turned = np.degrees(np.arccos(np.clip((normals * true).sum(axis=1), -1, 1)))
            for name, light in LIGHTS.items():
                shading = fa.explain_shading(fit, face.vertices, camera, light)
                rows.append(
                    Row(
                        words, number, distance, name, fit.d_l_percent, d_s,
                        float(np.average(turned, weights=shading.weights)),
                        shading.fraction, shading.kept_fraction, shading.residual,
                        shading.residual_percent, shading.rank,
                    )
                )  # fmt: skip
    return rows


def colour_percent(face: fa.Subject, actual: float) -> float:
    """Sd of the colours' luminance over what is compared, percent of its mean: brows, lips, a beard's shadow."""
    assert face.colours is not None
    fit, camera = fitted(face, actual, actual), portrait_camera(face, distance=actual)
    weights = fa.explain_shading(fit, face.vertices, camera, LIGHTS["frontal"]).weights
    brightness = (face.colours / 255.0) ** GAMMA @ [0.2126, 0.7152, 0.0722]
    mean = np.average(brightness, weights=weights)
    return 100.0 * float(np.sqrt(np.average((brightness - mean) ** 2, weights=weights)) / mean)


def print_tables(rows: Sequence[Row], actual: float) -> None:
    """Medians over faces, by distance and by light; which distance the shading would choose."""
    number = len({row.face for row in rows})
    print(
        f"\n{rows[0].faces}: {number} faces x {len(LIGHTS)} lights; medians, photographed from {said(actual)}"
    )
    print(
        f"{'fitted':<9}{'d_L':>7}{'d_S':>9}{'normals':>9}   {'explained (10th to 90th face)':<34}"
        f"{'kept light':<12}{'residual':<16}"
    )
    for distance in DISTANCES:
        some = [row for row in rows if row.fitted == distance]
        explained = np.array([row.fraction for row in some])
        low, high = np.percentile(explained, (10, 90))
        print(
            f"{said(distance):<9}{median(some, 'd_l_percent'):>5.2f} %{median(some, 'd_s_mm'):>6.1f} mm"
            f"{median(some, 'normals_deg'):>7.1f}°   "
            f"{f'{100 * np.median(explained):.1f} % ({100 * low:.1f} to {100 * high:.1f})':<34}"
            f"{100 * median(some, 'kept_fraction'):>5.1f} %     "
            f"{median(some, 'residual'):.3f} sd, {median(some, 'residual_percent'):.1f} % of the mean"
        )
    for words, column, unit in (
        ("explained by light", "fraction", 100.0),
        ("left, % of the mean", "residual_percent", 1.0),
    ):
        print(f"{words:<21}" + "".join(f"{said(d):>9}" for d in DISTANCES))
        for name in LIGHTS:
            cells = [
                median([r for r in rows if r.light == name and r.fitted == d], column)
                for d in DISTANCES
            ]
            print(f"  {name:<19}" + "".join(f"{unit * cell:>7.1f} %" for cell in cells))
    for words, column in (("best light", "fraction"), ("kept light", "kept_fraction")):
        chosen = chosen_distances(rows, column)
        shares = ", ".join(f"{said(d)} {100 * share:.0f} %" for d, share in chosen.items())
        print(f"most explained with the {words} at: {shares}")
    least = {row.face: row for row in sorted(rows, key=lambda row: -row.d_l_percent)}
    right = sum(row.fitted == actual for row in least.values())
    print(f"landmark error least at the true distance, without noise: {right} of {number} faces")


def chosen_distances(rows: Sequence[Row], column: str) -> Mapping[float | None, float]:
    """Share of faces and lights whose shading is explained best at each distance."""
    best: dict[tuple[int, str], Row] = {}
    for row in rows:
        key = (row.face, row.light)
        if key not in best or getattr(row, column) > getattr(best[key], column):
            best[key] = row
    return {d: float(np.mean([row.fitted == d for row in best.values()])) for d in DISTANCES}


def median(rows: Sequence[Row], column: str) -> float:
    return float(np.median([getattr(row, column) for row in rows]))


def said(distance: float | None) -> str:
    return "ortho" if distance is None else f"{distance:g} m"


# ---- the picture ----

TILE, GAP, TOP, FOOT, UNDER = (310, 370), 16, 104, 50, 34  # pixels
EYES, FINE = 97.0, 2  # pixels between the eyes in a tile; samples per pixel and axis
MOST = 20.0  # percent of the mean: the ends of the scale
BELOW, EVEN, ABOVE = (0x2B, 0x5C, 0xA8), (0xF4, 0xF2, 0xEE), (0xB4, 0x3A, 0x1E)
APART = (0xB9, 0xC0, 0xC8)  # not compared
GAMMA = 2.2


def draw(
    face: fa.Subject, distances: tuple[float, float], names: Sequence[str], file: Path
) -> None:
    """A row a light: the photograph's shading, what explains it on the other face, and what is left of it."""
    from faceambig.render.canvas import Canvas
    from faceambig.render.overlay import encode_png
    from faceambig.render.plots import DIM, INK

    actual, distance = distances
    fit, camera = fitted(face, actual, distance), portrait_camera(face, distance=actual)
    size = (4 * TILE[0] + 5 * GAP, TOP + len(names) * (TILE[1] + UNDER + GAP) + FOOT)
    canvas = Canvas(size, 1.0, (255, 255, 255))
    canvas.text(GAP, 32, "Does shading tell which face it was?", 22, INK, 650)
    off = surface_difference(fit.vertices(), face.vertices, face.model.evaluation).mean_mm
    canvas.text(
        GAP, 57,
        f"A synthetic subject photographed from {100 * actual:.0f} cm under a known light, and the face fitted to the "
        f"photograph's 68 points at {100 * distance:.0f} cm: landmarks {fit.d_l_percent:.1f} % of the eye distance "
        f"off, surface {off:.1f} mm.",
        14, DIM, most=size[0] - 2 * GAP,
    )  # fmt: skip
    titles = (
        "shading of the true face",
        "the fitted face, light chosen anew",
        "left unexplained",
        "left, had the light been known",
    )
    for column, title in enumerate(titles):
        canvas.text(GAP + column * (TILE[0] + GAP), TOP - 14, title, 15.5, INK, 650, most=TILE[0])
    for row, name in enumerate(names):
        light = LIGHTS[name]
        found = fa.explain_shading(fit, face.vertices, camera, light)
        used = found.weights > 0
        mean = float(np.average(found.target, weights=found.weights))
        white = float(np.percentile(found.target[used], 99.5))
        gaps = [
            coloured(100 * (found.target - other) / mean, used)
            for other in (found.explained, found.kept)
        ]
        tiles = [
            painted(camera, face.vertices, face.model, grey(found.target, white)),
            painted(fit.camera, fit.vertices(), face.model, grey(found.explained, white)),
            *(painted(camera, face.vertices, face.model, gap) for gap in gaps),
        ]
        words = (
            f"{name} lamp; the ball shows the light",
            f"explains {100 * found.fraction:.0f} % of the variance",
            f"rms {found.residual_percent:.1f} % of the mean, {found.residual:.2f} sd",
            f"{100 * found.kept_fraction:.0f} % of the variance explained",
        )
        y = TOP + row * (TILE[1] + UNDER + GAP)
        for column, (tile, said_) in enumerate(zip(tiles, words, strict=True)):
            x = GAP + column * (TILE[0] + GAP)
            canvas.paste(x, y, tile, radius=8)
            canvas.text(x, y + TILE[1] + 22, said_, 14, INK, most=TILE[0])
            if column < 2:
                canvas.paste(x + 12, y + TILE[1] - 84, ball((light, found.light)[column], white))
    key(canvas, size[1] - FOOT + 6)
    opaque = np.full((*canvas.pixels.shape[:2], 1), 255, dtype=np.uint8)
    picture = np.concatenate([canvas.pixels, opaque], axis=2)
    file.write_bytes(encode_png(picture, {"Software": "faceambig"}))
    print(f"{file}: {size[0]} x {size[1]}")


def painted(camera: Camera, vertices: Array, model: fa.FaceModel, colours: Array) -> Picture:
    """A tile of a face as its camera sees it, in `colours` (N, 3) sRGB as they are."""
    import cv2

    from faceambig.render.painter import fill

    large = np.full((FINE * TILE[1], FINE * TILE[0], 3), 226, dtype=np.float32)
    middle = np.array([0.5, 0.51]) * TILE
    # a synthetic photograph has its eye centres 100 px apart
    xy = FINE * (EYES / 100 * project(camera, vertices) + middle)
    depth = camera_points(camera, vertices)[:, 2:]
    fill(large, np.hstack([xy, 1 / depth]), model.faces, colours)
    small = cv2.resize(large, TILE, interpolation=cv2.INTER_AREA)
    return small.round().clip(0, 255).astype(np.uint8)


def grey(irradiance: Array, white: float) -> Array:
    """(N, 3) sRGB of white skin under this irradiance."""
    value = 250.0 * np.clip(irradiance / white, 0.0, 1.0) ** (1 / GAMMA)
    return np.repeat(value[:, None], 3, axis=1)


def coloured(percent: Array, used: NDArray[np.bool_]) -> Array:
    """(N, 3) sRGB of a signed difference, one flat colour where nothing was compared."""
    at = np.clip(percent / MOST, -1, 1)
    scale = np.array([BELOW, EVEN, ABOVE], dtype=float)
    rgb = np.stack([np.interp(at, (-1, 0, 1), scale[:, k]) for k in range(3)], axis=1)
    return np.where(used[:, None], rgb, APART)


def ball(light: fa.Light, white: float) -> Picture:
    """RGBA of a white ball under the light."""
    x, y = np.meshgrid(*2 * [(np.arange(72) + 0.5) / 36 - 1])
    r2 = x * x + y * y
    normals = np.stack([x, y, -np.sqrt(np.maximum(1 - r2, 0))], axis=-1).reshape(-1, 3)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    rgb = grey(light.irradiance(normals), white).reshape(72, 72, 3)
    cover = np.clip(36 * (1 - np.sqrt(r2)) + 0.5, 0, 1)[..., None] * 255
    return np.concatenate([rgb, cover], axis=2).round().astype(np.uint8)


def key(canvas: Canvas, y: float) -> None:
    """The scale of what is left."""
    from faceambig.render.plots import DIM

    x, width = GAP + 2 * (TILE[0] + GAP), TILE[0]
    ramp = coloured(np.linspace(-MOST, MOST, 101), np.ones(101, dtype=bool))
    canvas.ramp(x, y, width, 12, ramp.round().astype(np.uint8), upright=False)
    for at, words, anchor in (
        (0.0, f"−{MOST:.0f} %: darker", "start"),
        (0.5, "of the mean", "middle"),
        (1.0, f"brighter: +{MOST:.0f} %", "end"),
    ):
        canvas.text(x + at * width, y + 30, words, 12.5, DIM, anchor=anchor)
    x += width + GAP
    canvas.fill(x, y, 12, 12, APART)
    canvas.text(x + 20, y + 11, "not compared: hidden, or not of the face", 12.5, DIM)
    canvas.text(
        GAP,
        y + 11,
        "Light: nine numbers, spherical harmonics up to order 2. One skin colour, no cast shadows.",
        12.5,
        DIM,
    )


if __name__ == "__main__":
    main()
