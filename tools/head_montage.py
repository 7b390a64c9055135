"""The pictures docs/head*.png, drawn from the written asset alone."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from head_pictures import Picture, draw, montage, save

Array = NDArray[np.float64]

N_RANDOM, RANDOM_SEED, BOX = 20, 0, 2.0  # random faces, each weight within two sds
RED = (200, 30, 30)


@dataclass(frozen=True, slots=True, eq=False)
class Asset:
    """What the pictures need from head.npz; N fine vertices, metres."""

    operator: sparse.csr_array
    mean: Array  # (B, 3)
    modes: Array  # (S, B, 3)
    subjects: Array  # (10, B, 3)
    faces: NDArray[np.int64]
    colours: NDArray[np.uint8]  # (N, 3)
    subject_colours: NDArray[np.uint8]
    occlusion: NDArray[np.uint8]  # (N,)

    def picture(self, shape: Array, colours: NDArray[np.uint8], **view: object) -> Picture:
        return draw(self.operator @ shape, self.faces, colours, self.occlusion, **view)[0]


def read_asset(path: Path) -> Asset:
    with np.load(path) as file:
        mean = file["mean"] * 1e-6
        pointer = file["subdivision_indptr"]
        return Asset(
            operator=sparse.csr_array(
                (
                    file["subdivision_data"],
                    file["subdivision_indices"].astype(np.int32),
                    pointer,
                ),
                shape=(len(pointer) - 1, len(mean)),
            ),
            mean=mean,
            modes=file["modes"] * file["mode_step"][:, None, None],
            subjects=mean + file["subjects"] * file["subject_step"],
            faces=file["faces"].astype(np.int64),
            colours=file["colours"],
            subject_colours=file["subject_colours"],
            occlusion=file["occlusion"],
        )


def people(asset: Asset, size: int) -> Picture:
    """Mean from all sides, the ten subjects, twenty random faces."""
    wide = 2 * size
    views: list[dict] = [
        {}, {"yaw": 40.0}, {"yaw": 90.0}, {"yaw": 180.0}, {"pitch": -50.0},
    ]  # fmt: skip
    rows = [[asset.picture(asset.mean, asset.colours, size=wide, **view) for view in views]]
    pairs = list(zip(asset.subjects, asset.subject_colours, strict=True))
    draws = np.random.default_rng(RANDOM_SEED).standard_normal((N_RANDOM, len(asset.modes)))
    random = [
        (asset.mean + np.tensordot(alpha, asset.modes, axes=1), asset.colours)
        for alpha in np.clip(draws, -BOX, BOX)
    ]
    rows += [
        [asset.picture(s, c, size=size, yaw=yaw, half_height=0.15) for s, c in ten]
        for yaw, ten in (
            (0.0, pairs), (55.0, pairs), (0.0, random[:10]), (0.0, random[10:]),
            (70.0, random[:10]), (70.0, random[10:]),
        )
    ]  # fmt: skip
    return montage(rows)


def with_points(
    asset: Asset, rows: list[dict[str, str]], sides: set[str], **view: object
) -> Picture:
    """The mean in grey with the points of some sides and their names."""
    grey = np.full_like(asset.colours, 205)
    picture, pixels = draw(asset.operator @ asset.mean, asset.faces, grey, asset.occlusion, **view)
    picture = np.ascontiguousarray(picture)
    for row in rows:
        if row["side"] in sides:
            x, y = np.rint(pixels[int(row["vertex"])]).astype(int).tolist()
            cv2.circle(picture, (x, y), 2, RED, -1, cv2.LINE_AA)
            cv2.putText(
                picture, row["name"], (x + 3, y - 2), cv2.FONT_HERSHEY_SIMPLEX, 0.36, (0, 0, 90),
                1, cv2.LINE_AA,
            )  # fmt: skip
    return picture


def draw_all(asset_path: Path, schemes: Path, out: Path) -> None:
    """Write docs/head.png, head_ibug68.png and head_farkas.png."""
    asset = read_asset(asset_path)
    out.mkdir(parents=True, exist_ok=True)
    save(out / "head.png", people(asset, 108))
    everyone, right = {"left", "right", "mid"}, {"right", "mid"}
    for name in ("ibug68", "farkas"):
        text = (schemes / f"embedded_{name}.csv").read_text(encoding="utf-8").splitlines()
        rows = list(csv.DictReader(line for line in text if not line.startswith("#")))
        whole = name == "farkas"
        half = 0.15 if whole else 0.085
        centre = (0.0, 0.0, -0.05) if whole else (0.0, -0.035, -0.03)
        view = {"size": 570, "half_height": half}
        parts = [
            with_points(asset, rows, everyone, centre=centre, **view),
            with_points(asset, rows, right, centre=(0.0, *centre[1:]), yaw=90.0, **view),
        ]
        if whole:
            close = {"size": 570, "half_height": 0.07, "centre": (0.0, -0.03, 0.0)}
            parts += [
                with_points(asset, rows, everyone, **close),
                with_points(asset, rows, right, yaw=90.0, size=570, half_height=0.085,
                            centre=(0.0, -0.025, -0.04)),
            ]  # fmt: skip
            save(out / f"head_{name}.png", montage([parts[:2], parts[2:]]))
        else:
            save(out / f"head_{name}.png", montage([parts]))
