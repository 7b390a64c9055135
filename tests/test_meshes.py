"""Meshes as files, read back by trimesh: positions, triangles, colours and notes survive."""

from __future__ import annotations

import io
import json
import struct
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import trimesh

from faceambig.arrays import vertex_normals
from faceambig.io.meshes import UNITS, Mesh, encode_glb, encode_obj, encode_ply, linear

ENCODERS = {"obj": encode_obj, "ply": encode_ply, "glb": encode_glb}
NOTES = ("face of photo.jpg", "colours: 5 sampled, 3 mirrored")


@pytest.fixture(scope="module")
def mesh(embedded):
    vertices = embedded.vertices(np.ones(3))
    # every one of the 256 values in every channel
    colours = (np.arange(3 * len(vertices)).reshape(-1, 3) * 7 % 256).astype(np.uint8)
    return Mesh(vertices, embedded.faces, colours, vertex_normals(vertices, embedded.faces), NOTES)


def read(mesh: Mesh, kind: str) -> Any:
    data = io.BytesIO(ENCODERS[kind](mesh))
    return trimesh.load_mesh(data, file_type=kind, process=False, maintain_order=True)


@pytest.mark.parametrize("kind", ENCODERS)
def test_positions_and_triangles_come_back(mesh, kind):
    back = read(mesh, kind)
    # single precision at 0.2 m, and seven digits after the point in OBJ
    assert np.abs(back.vertices - mesh.vertices).max() <= (6e-8 if kind == "obj" else 1.5e-8)
    assert np.array_equal(back.faces, mesh.faces)


@pytest.mark.parametrize("kind", ["obj", "ply"])
def test_colours_come_back_exactly(mesh, kind):
    assert np.array_equal(read(mesh, kind).visual.vertex_colors[:, :3], mesh.colours)


def test_colours_of_glb_are_linear_light(mesh):
    tree, data = parts(encode_glb(mesh))
    view = tree["bufferViews"][tree["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"]]
    stored = np.frombuffer(data, "<f4", view["byteLength"] // 4, view["byteOffset"]).reshape(-1, 3)
    # back by the inverse of IEC 61966-2-1
    back = np.where(stored <= 0.0031308, 12.92 * stored, 1.055 * stored ** (1 / 2.4) - 0.055)
    assert np.array_equal(np.round(255 * back).astype(np.uint8), mesh.colours)
    # beside a material trimesh keeps them as an attribute; without one a viewer takes the skin for metal
    scene = trimesh.load_scene(io.BytesIO(encode_glb(mesh)), file_type="glb", process=False)
    (face,) = scene.geometry.values()
    assert np.array_equal(face.visual.vertex_attributes["color"], stored)
    assert np.abs(stored - linear(mesh.colours)).max() < 1e-7


def parts(glb: bytes) -> tuple[dict, bytes]:
    """JSON and data of a GLB, its lengths checked."""
    assert struct.unpack_from("<4sII", glb) == (b"glTF", 2, len(glb))
    length, kind = struct.unpack_from("<I4s", glb, 12)
    assert kind == b"JSON"
    assert length % 4 == 0
    tree = json.loads(glb[20 : 20 + length])
    size, kind = struct.unpack_from("<I4s", glb, 20 + length)
    assert kind == b"BIN\x00"
    assert size % 4 == 0
    assert 28 + length + size == len(glb)
    assert 0 <= size - tree["buffers"][0]["byteLength"] < 4
    return tree, glb[28 + length :]


def test_a_glb_keeps_the_rules_of_gltf(mesh):
    tree, data = parts(encode_glb(mesh))
    primitive = tree["meshes"][0]["primitives"][0]
    for number, accessor in enumerate(tree["accessors"]):
        view = tree["bufferViews"][accessor["bufferView"]]
        assert view["byteOffset"] % 4 == 0
        width = {"SCALAR": 4, "VEC3": 12}[accessor["type"]]
        assert view["byteLength"] == accessor["count"] * width, number
    position = tree["accessors"][primitive["attributes"]["POSITION"]]
    assert np.allclose(position["min"], mesh.vertices.min(axis=0), rtol=0, atol=1e-7)
    assert np.allclose(position["max"], mesh.vertices.max(axis=0), rtol=0, atol=1e-7)
    view = tree["bufferViews"][primitive["attributes"]["NORMAL"]]
    normals = np.frombuffer(data, "<f4", view["byteLength"] // 4, view["byteOffset"])
    lengths = np.linalg.norm(normals.reshape(-1, 3), axis=1)
    assert np.abs(lengths - 1).max() < 1e-6  # glTF asks for unit length
    assert tree["materials"][0]["pbrMetallicRoughness"]["metallicFactor"] == 0


def test_notes_stand_where_each_format_has_them(mesh):
    wanted = [*NOTES, UNITS]
    lines = encode_obj(mesh).decode().splitlines()
    assert [line[2:] for line in lines if line.startswith("# ")] == wanted
    header = encode_ply(mesh).partition(b"end_header\n")[0].decode().splitlines()
    assert [line[8:] for line in header if line.startswith("comment ")] == wanted
    tree, _ = parts(encode_glb(mesh))
    assert tree["asset"]["extras"]["notes"] == wanted
    assert read(mesh, "glb").metadata["notes"] == wanted  # of the mesh: what programs keep


@pytest.mark.parametrize("kind", ENCODERS)
@pytest.mark.parametrize(
    "note", ["a\nv 0 0 0\nend_header\n", "Müller.jpg \udcff", "tab\tand\x00\x1b[31m", "end\\", ""]
)
def test_no_note_can_break_a_file(mesh, kind, note):
    odd = replace(mesh, notes=(note,))
    assert np.array_equal(read(odd, kind).faces, mesh.faces)
    if kind == "glb":
        notes = parts(encode_glb(odd))[0]["asset"]["extras"]["notes"]
    else:
        lines = ENCODERS[kind](odd)[:600].split(b"\n")
        notes = [line.decode() for line in lines if line.startswith((b"# ", b"comment "))]
    assert len(notes) == 2
    assert all(note.isprintable() and note.isascii() for note in notes)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"vertices": np.full((4, 3), np.nan)}, "vertices: every value must be finite"),
        ({"vertices": np.zeros((4, 2))}, "vertices: expected shape"),
        ({"colours": np.zeros((3, 3), np.uint8)}, "colours: expected"),
        ({"colours": np.zeros((4, 3))}, "colours: expected"),
        ({"faces": np.array([[0, 1, 4]])}, "faces: vertex 4 is not within 0 to 3"),
        ({"faces": np.array([[0, 1, -1]])}, "faces: vertex"),
        ({"faces": np.array([0, 1, 2])}, "faces: expected triangles"),
        ({"normals": np.zeros((3, 3))}, "normals: expected shape"),
    ],
)
def test_what_is_no_mesh_is_refused(change, words):
    good = {
        "vertices": np.eye(4, 3),
        "faces": np.array([[0, 1, 2]]),
        "colours": np.zeros((4, 3), np.uint8),
        "normals": np.eye(4, 3),
    }
    Mesh(**good)
    with pytest.raises(ValueError, match=words):
        Mesh(**(good | change))
