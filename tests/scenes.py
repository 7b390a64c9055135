"""A small head of no one's asset, the scenes around it, and the comparison of pictures with stored ones."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from faceambig.render import gl
from faceambig.scene import Curves, Head, Legend, Numbers, Photo, Scene, View

GOLDEN = Path(__file__).parent / "golden"
FRONT, SIDE = View("front", 0.0, 0.0, 0.165), View("side", -90.0, 0.0, 0.165)
THREE_QUARTER = View("three_quarter", -32.0, 6.0, 0.165)
PIVOT = (0.0, -0.01, -0.06)


def need_renderer() -> None:
    """Skip with a reason where nothing can draw; fail under CI=true, where something must."""
    try:
        gl.renderer_name()
    except gl.NoRendererError as error:
        if os.environ.get("CI") == "true":
            raise
        pytest.skip(str(error))


def face(wide: float = 1.0, rings: int = 48, sectors: int = 64):
    """Vertices (V, 3), faces, colours and occlusion of an egg with nose, eyes, lips and an open neck."""
    polar = np.linspace(0.02, 0.86 * np.pi, rings)
    around = 2 * np.pi * np.arange(sectors) / sectors
    t, a = np.meshgrid(polar, around, indexing="ij")
    x = 0.074 * wide * np.sin(t) * np.sin(a)
    y = 0.118 * np.cos(t) - 0.012
    z = 0.098 * np.sin(t) * np.cos(a) - 0.06
    front = z > -0.06
    nose = np.exp(-((x / 0.011) ** 2) - ((y + 0.030) / 0.020) ** 2) * front
    vertices = np.stack([x, y, z + 0.026 * nose], axis=-1).reshape(-1, 3)
    first = np.arange((rings - 1) * sectors)
    right = first - first % sectors + (first + 1) % sectors
    upper, lower = (
        np.stack([first, first + sectors, right], 1),
        np.stack([right, first + sectors, right + sectors], 1),
    )
    colours = np.tile([206.0, 160.0, 134.0], (rings * sectors, 1))
    px, py, pf = x.ravel(), y.ravel(), front.ravel()
    for side in (-1, 1):
        r = np.hypot(px - side * 0.031 * wide, 1.5 * py)
        colours[(r < 0.014) & pf] = (236, 232, 228)
        colours[(r < 0.007) & pf] = (52, 38, 30)
    colours[(np.hypot(px / 0.026, (py + 0.068) / 0.008) < 1) & pf] = (176, 96, 88)
    occlusion = np.clip(255 - 120 * np.exp(-((py + 0.115) ** 2) / 0.0004), 0, 255)
    return (
        vertices,
        np.concatenate([upper, lower]).astype(np.uint32),
        colours.astype(np.uint8),
        occlusion.astype(np.uint8),
    )


def head(name: str = "true", title: str = "True face", wide: float = 1.0, **fields) -> Head:
    vertices, faces, colours, occlusion = face(wide)
    return Head(name, title, vertices, faces, colours, occlusion, **fields)


def photo(distance: float = 0.3, size: int = 500) -> Photo:
    """A photograph of the egg; its points are 24 vertices of the front, the fitted ones 2 pixels off."""
    vertices, faces, colours, occlusion = face()
    focal = 1500.0 * distance
    seen = vertices * (1, -1, -1) + (0, 0, distance)
    fitted = face(0.93)[0] * (1, -1, -1) + (0, 0, 4 * distance)
    at = np.flatnonzero(vertices[:, 2] > -0.02)[::24]
    observed = focal * seen[at, :2] / seen[at, 2:] + size / 2
    projected = observed + np.array([2.0, 0.0])
    observed[1] = np.nan
    names = tuple(str(n) for n in at)
    middle = (size / 2, size / 2)
    return Photo(
        size, size, observed, projected, names, "taken from 30 cm", seen, faces, colours, occlusion,
        focal, middle, fitted, 4 * focal,
    )  # fmt: skip


def curves(true_distance: float = 0.3) -> Curves:
    distances = np.geomspace(0.2, 3.0, 24)
    away = np.abs(np.log2(distances / true_distance))
    return Curves(distances, 0.15 + 0.1 * away, 0.8 + 1.7 * away, (0.5, 7.2), true_distance, 3.0)


def scene(distance: float | None = 1.2, view: View = THREE_QUARTER, **fields) -> Scene:
    """True head and fitted head, curves and numbers."""
    heads = (head(slot=-0.135), head("fit", "Face that fits", 0.93, slot=0.135))
    numbers = Numbers(distance, 0.253, 5.31, True, True, "eye centres")
    values = {"curves": curves(), "pivot": PIVOT, "note": "24 points, an egg; synthetic"} | fields
    return Scene(heads, (view,), photo(), numbers, **values)


def legend() -> Legend:
    colours = np.linspace((250, 239, 126), (74, 13, 105), 64).astype(np.uint8)
    return Legend(
        "distance to true face (mm)",
        colours,
        0.0,
        15.0,
        (0.0, 5.0, 10.0, 15.0),
        "grey: not measured",
    )


def strip() -> Scene:
    """Five heads from the front and from the side."""
    heads = [head(slot=0.0, caption=(("photo taken from 30 cm", "dim"),))]
    scale = legend()
    for k, cm in enumerate((30, 60, 120, 240), start=1):
        vertices, faces, _, occlusion = face(1 - 0.03 * k)
        share = np.clip(0.2 * k * np.abs(vertices[:, 0]) / 0.08, 0, 1)
        shown = scale.colours[(63 * share).astype(int)]
        words = (("landmark error 0.25\u202f%", "d_l"), ("surface difference 5.3\u202fmm", "d_s"))
        heads.append(
            Head(
                f"fit{k}",
                f"assumed {cm}\u202fcm",
                vertices,
                faces,
                shown,
                occlusion,
                False,
                0.27 * k,
                words,
            )
        )
    numbers = Numbers(2.4, 0.29, 6.1, True, True, "eye centres")
    return Scene(
        tuple(heads),
        (FRONT, SIDE),
        photo(),
        numbers,
        legend=scale,
        pivot=PIVOT,
        note="24 points, an egg; synthetic",
    )


def like_stored(name: str, picture: np.ndarray) -> None:
    """The picture (H, W, 3 or 4) against tests/golden/<name>.png. GOLDEN=write in the environment stores it anew."""
    path = GOLDEN / f"{name}.png"
    if os.environ.get("GOLDEN") == "write":
        path.parent.mkdir(exist_ok=True)
        bgr = np.ascontiguousarray(picture[..., 2::-1])
        cv2.imwrite(str(path), bgr, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    like_file(path, picture)


def like_file(path: Path, picture: np.ndarray) -> None:
    """The picture (H, W, 3 or 4) against one that is stored.

    Tolerances: OSMesa and EGL give the same bytes here; what may differ is another CPU's rounding at outlines and
    another build of OpenCV's text. A head that moves by a pixel, or a changed light, is far outside.
    """
    rgb = picture[..., :3]
    stored = cv2.imread(str(path))
    assert stored is not None, f"no stored picture {path.name}"
    stored = stored[..., ::-1]
    assert stored.shape == rgb.shape
    apart = np.abs(stored.astype(int) - rgb).max(axis=2)
    assert apart.mean() < 0.5, f"{path.name}: {apart.mean():.2f} levels apart on average"
    assert (apart > 24).mean() < 0.002, (
        f"{path.name}: {100 * (apart > 24).mean():.2f} % of the pixels clearly differ"
    )
