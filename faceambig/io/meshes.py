"""Meshes written as OBJ, PLY and GLB: metres, vertex colours, and notes that say where they come from.

Own writers, for what general ones leave out: notes in the place each format has for remarks, and in glTF colours as
linear light, which is what its viewers expect. Positions are rounded to single precision, 8 nm on a head.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, checked

UNITS = "metres; +x the subject's left, +y up, +z out of the face"
ARRAY_BUFFER, ELEMENT_BUFFER = 34962, 34963  # glTF: what a part of the data is for
FLOAT, UINT32 = 5126, 5125
GLTF, JSON_CHUNK, DATA_CHUNK = 0x46546C67, 0x4E4F534A, 0x004E4942


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """A coloured surface to be written. N vertices, F triangles."""

    vertices: Array  # (N, 3) metres
    faces: NDArray[np.integer]  # (F, 3) from 0, wound outward
    colours: NDArray[np.uint8]  # (N, 3) sRGB
    normals: Array  # (N, 3) unit length; GLB only: without them it would be drawn in facets
    notes: tuple[str, ...] = ()  # a line each: model, origin of the colours, what is assumed

    def __post_init__(self) -> None:
        vertices = checked("vertices", self.vertices, (None, 3))
        checked("normals", self.normals, vertices.shape)
        if self.colours.shape != vertices.shape or self.colours.dtype != np.uint8:
            raise ValueError(
                f"colours: expected {vertices.shape} of 8 bits, found {self.colours.shape}"
            )
        faces = np.asarray(self.faces)
        if faces.ndim != 2 or faces.shape[1] != 3 or faces.dtype.kind not in "iu":
            raise ValueError(
                f"faces: expected triangles (F, 3) of vertex numbers, found {faces.shape}"
            )
        if faces.size and not 0 <= faces.min() <= faces.max() < len(vertices):
            raise ValueError(f"faces: vertex {faces.max()} is not within 0 to {len(vertices) - 1}")


def encode_obj(mesh: Mesh) -> bytes:
    """Wavefront OBJ: notes as `#` lines, colours as three numbers 0 to 1 behind each position."""
    lines = [f"# {note}" for note in _plain((*mesh.notes, UNITS))]
    # 0.1 micrometre, and 8-bit colours that come back exactly
    rows = np.concatenate([mesh.vertices, mesh.colours / 255.0], axis=1).tolist()
    lines += [f"v {x:.7f} {y:.7f} {z:.7f} {r:.5f} {g:.5f} {b:.5f}" for x, y, z, r, g, b in rows]
    lines += [f"f {a} {b} {c}" for a, b, c in (mesh.faces.astype(np.int64) + 1).tolist()]
    return "\n".join([*lines, ""]).encode("ascii")


def encode_ply(mesh: Mesh) -> bytes:
    """Binary PLY: notes as comments, colours as 8-bit sRGB."""
    kind = [("xyz", "<f4", 3), ("rgb", "u1", 3)]
    vertices = np.empty(len(mesh.vertices), dtype=kind)
    vertices["xyz"], vertices["rgb"] = mesh.vertices, mesh.colours
    faces = np.empty(len(mesh.faces), dtype=[("n", "u1"), ("corners", "<i4", 3)])
    faces["n"], faces["corners"] = 3, mesh.faces
    # Some readers end the header wherever they find its last word
    notes = [note.replace("end_header", "end header") for note in _plain((*mesh.notes, UNITS))]
    header = [
        "ply",
        "format binary_little_endian 1.0",
        *(f"comment {note}" for note in notes),
        f"element vertex {len(vertices)}",
        *(f"property float {axis}" for axis in "xyz"),
        *(f"property uchar {channel}" for channel in ("red", "green", "blue")),
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "end_header",
        "",
    ]
    return "\n".join(header).encode("ascii") + vertices.tobytes() + faces.tobytes()


def encode_glb(mesh: Mesh) -> bytes:
    """Binary glTF 2.0: notes in the extras of the asset and of the mesh, colours as linear light, matte material."""
    extras = {"notes": _plain((*mesh.notes, UNITS))}
    parts = {
        "POSITION": mesh.vertices.astype("<f4"),
        "NORMAL": mesh.normals.astype("<f4"),
        "COLOR_0": linear(mesh.colours).astype("<f4"),
        "indices": mesh.faces.astype("<u4").reshape(-1),
    }
    views, accessors, at = [], [], 0
    for name, values in parts.items():
        corner = name == "indices"
        views.append(
            {"buffer": 0, "byteOffset": at, "byteLength": values.nbytes}
            | {"target": ELEMENT_BUFFER if corner else ARRAY_BUFFER}
        )
        accessor: dict[str, Any] = {"bufferView": len(accessors), "count": len(values)}
        accessor |= {
            "componentType": UINT32 if corner else FLOAT,
            "type": "SCALAR" if corner else "VEC3",
        }
        if name == "POSITION":  # required; of the numbers as written
            accessor |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        accessors.append(accessor)
        at += values.nbytes
    numbers = {name: number for number, name in enumerate(parts)}
    primitive = {"indices": numbers.pop("indices"), "attributes": numbers, "material": 0, "mode": 4}
    matte = {"metallicFactor": 0.0, "roughnessFactor": 1.0}
    tree = {
        "asset": {"version": "2.0", "generator": "faceambig", "extras": extras},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "face"}],
        "meshes": [{"name": "face", "primitives": [primitive], "extras": extras}],
        "materials": [{"name": "skin", "pbrMetallicRoughness": matte}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": at}],
    }
    data = b"".join(values.tobytes() for values in parts.values())
    return _glb(tree, data)


def _glb(tree: Mapping[str, Any], data: bytes) -> bytes:
    """The container: header, JSON filled up with spaces, data filled up with zeros, both to 4 bytes."""
    text = json.dumps(tree, separators=(",", ":")).encode("ascii")
    text += b" " * (-len(text) % 4)
    data += b"\x00" * (-len(data) % 4)
    length = 12 + 8 + len(text) + 8 + len(data)
    return b"".join(
        [
            struct.pack("<III", GLTF, 2, length),
            struct.pack("<II", len(text), JSON_CHUNK),
            text,
            struct.pack("<II", len(data), DATA_CHUNK),
            data,
        ]
    )


def linear(srgb: NDArray[np.uint8]) -> Array:
    """Linear light 0 to 1 of 8-bit sRGB (IEC 61966-2-1)."""
    value = srgb / 255.0
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def _plain(notes: Sequence[str]) -> list[str]:
    """The notes as single lines of ASCII: a file name with a line break must not end a header."""
    lines = (" ".join(note.split()).encode("ascii", "replace").decode("ascii") for note in notes)
    return ["".join(c if c.isprintable() else "?" for c in line) for line in lines]
