"""ICT-FaceKit: the real files where they are, and a made-up model of the same topology everywhere."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path

import numpy as np
import pytest

import faceambig.io as fio
from faceambig.errors import AssetError
from faceambig.io import ict as reader
from faceambig.metrics import interocular

N, POLYGONS = 26_719, 26_384  # of the light mesh; the reader accepts no other


@pytest.fixture(scope="module")
def made_up() -> tuple[bytes, list[bytes]]:
    """Texts of a mean and two identities: random points, eye corners of an adult, quads and triangles."""
    rng = np.random.default_rng(5)
    mean = rng.normal(size=(N, 3)) * (5.0, 7.0, 4.0)  # centimetres
    scheme = fio.schemes.load_scheme(fio.asset_path("schemes/ict_ibug68.csv"), "ibug68")
    # points 37 to 48: right eye from the outer corner over the lid, left eye from the inner
    x = np.array([-4.5, -3.7, -2.6, -1.8, -2.6, -3.7, 1.8, 2.6, 3.7, 4.5, 3.7, 2.6])
    mean[scheme.vertices[36:48]] = np.column_stack([x, np.full(12, 3.0), np.full(12, 9.0)])
    # first vertex, end of the vertices, end of the polygons
    groups = ((0, 9_409, 9_230), (9_409, 11_248, 11_144), (11_248, N, POLYGONS))
    lines, done = [], 0
    for low, high, polygons in groups:
        for k in range(polygons - done):
            corners = 1 + low + (k + np.arange(3 + k % 2)) % (high - low)
            lines.append("f " + " ".join(f"{c}/{c}" for c in corners))
        done = polygons
    tail = "\nvt 0.5 0.5\n" + "\n".join(lines) + "\n"

    def text(points: np.ndarray) -> bytes:
        rows = "\n".join(f"v {x:.6g} {y:.6g} {z:.6g}" for x, y, z in points)
        return f"# a comment\n{rows}{tail}".encode()

    modes = rng.normal(scale=0.2, size=(2, N, 3))
    return text(mean), [text(mean + mode) for mode in modes]


@pytest.fixture
def folder(made_up, tmp_path, monkeypatch) -> Path:
    """A made-up ICT folder, with a cache of its own."""
    monkeypatch.setenv("FACEAMBIG_CACHE", str(tmp_path / "cache"))
    inside = tmp_path / "ict" / "FaceXModel"
    inside.mkdir(parents=True)
    (inside / "generic_neutral_mesh.obj").write_bytes(made_up[0])
    for k, text in enumerate(made_up[1]):
        (inside / f"identity{k:03d}.obj").write_bytes(text)
    return inside.parent


def numbers(text: bytes) -> np.ndarray:
    """(26719, 3) of the v lines, by regular expression."""
    return np.array(
        [m.split()[1:] for m in re.findall(rb"^v .*$", text, re.MULTILINE)], dtype=float
    )


def test_a_mode_is_identity_minus_mean_in_metres(folder, made_up):
    model = fio.load_model(folder, origin="file")
    mean, first = numbers(made_up[0])[:9_409], numbers(made_up[1][0])[:9_409]
    # one rounding of a product with 0.01
    assert np.abs(model.mean - 0.01 * mean).max() < 1e-16
    assert np.abs(model.vertices([1.0]) - 0.01 * first).max() < 1e-16
    assert model.n_modes == 2
    assert not model.file_origin.any()


def test_the_parts_are_the_first_polygons_cut_into_triangles(folder):
    face, head = (fio.load_model(folder, part=part) for part in ("face", "head"))
    assert face.n_vertices == 9_409
    assert head.n_vertices == 11_248
    # every second made-up polygon is a quad, which becomes two triangles
    assert len(face.faces) == 9_230 * 3 // 2
    assert len(head.faces) == 11_144 * 3 // 2
    assert face.faces[:4].tolist() == [[0, 1, 2], [1, 2, 3], [1, 3, 4], [2, 3, 4]]
    assert np.array_equal(head.control_modes[:9_409], face.control_modes)
    assert face.evaluation is None
    assert head.evaluation is not None
    assert head.evaluation.tolist() == list(range(9_409))  # d_S means the same for both


def test_the_folder_above_and_the_environment_name_the_same_model(folder, monkeypatch):
    inside = fio.load_model(folder / "FaceXModel")
    monkeypatch.setenv("FACEAMBIG_ICT", str(folder))
    assert np.array_equal(inside.mean, fio.load_model("ict").mean)
    monkeypatch.delenv("FACEAMBIG_ICT")
    monkeypatch.setenv("FACEAMBIG_MODELS", str(folder / "none"))
    with pytest.raises(AssetError, match="ict: set FACEAMBIG_ICT"):
        fio.load_model("ict")


def parses(monkeypatch) -> list[int]:
    """Grows by one entry each time the OBJ files are parsed."""
    seen: list[int] = []
    parse = reader._parse
    monkeypatch.setattr(reader, "_parse", lambda files: (seen.append(len(files)), parse(files))[1])
    return seen


def test_the_second_load_is_the_same_bit_by_bit_and_parses_nothing(folder, monkeypatch):
    parsed = parses(monkeypatch)
    first, second = fio.load_model(folder), fio.load_model(folder)
    assert len(parsed) == 1
    assert np.array_equal(first.mean, second.mean)
    assert np.array_equal(first.control_modes, second.control_modes)
    assert np.array_equal(first.faces, second.faces)
    assert first.licence == second.licence
    assert "MIT" in first.licence
    assert second.control_modes.flags.c_contiguous


@pytest.mark.parametrize("damage", ["cut", "junk", "empty", "bit"])
def test_a_damaged_cache_is_built_again(folder, monkeypatch, damage):
    parsed = parses(monkeypatch)
    first = fio.load_model(folder)
    (cache,) = (folder.parent / "cache").iterdir()
    data = bytearray(cache.read_bytes())
    data[len(data) // 2] ^= 1
    cache.write_bytes(
        {"cut": bytes(data[:9000]), "junk": b"PK" * 999, "empty": b"", "bit": bytes(data)}[damage]
    )
    again = fio.load_model(folder)
    assert np.array_equal(first.control_modes, again.control_modes)
    assert len(parsed) == 2
    fio.load_model(folder)
    assert len(parsed) == 2


def test_changed_files_are_read_again(folder, monkeypatch):
    parsed = parses(monkeypatch)
    fio.load_model(folder)
    identity = folder / "FaceXModel" / "identity001.obj"
    identity.write_bytes(identity.read_bytes().replace(b"v ", b"v  ", 1))
    fio.load_model(folder)
    stat = identity.stat()
    os.utime(identity, ns=(stat.st_atime_ns, stat.st_mtime_ns + 10**9))
    fio.load_model(folder)
    assert len(parsed) == 3


def test_a_cache_that_cannot_be_written_does_not_stop_a_load(folder, monkeypatch):
    (folder.parent / "cache").write_text("a file where the folder should be")
    assert fio.load_model(folder).n_modes == 2


@pytest.mark.parametrize(
    ("file", "old", "new", "said"),
    [
        (
            "identity001",
            b"\nv ",
            b"\nV ",
            "identity001.obj: 26718 vertices; ICT-FaceKit's light mesh has 26719",
        ),
        ("identity001", b"\nv ", b"\nv nan ", "identity001.obj: a vertex line is damaged"),
        ("identity000", b"\nv ", b"\nv 1e999 ", "identity000.obj: a vertex line is damaged"),
        ("identity000", b"\nv ", b"\nv x", "identity000.obj: a vertex line is damaged"),
        ("identity000", b"\nv ", b"\nvn 0 0 1\nv ", None),  # before the block: harmless
        ("generic_neutral_mesh", b"\nf ", b"\ng ", "generic_neutral_mesh.obj: 26383 polygons"),
        (
            "generic_neutral_mesh",
            b"\nf 1/1",
            b"\nf 0/1",
            "polygon '0/1 2/2 3/3' is not three or more",
        ),
        ("generic_neutral_mesh", b"\nf 1/1", b"\nf -1/1", "vertices within 1 to 11248"),
        ("generic_neutral_mesh", b"\nf 1/1", b"\nf 11249/1", "polygon '11249/1 2/2 3/3' is not"),
        ("generic_neutral_mesh", b"\nf 1/1", b"\nf a/1", "polygon 'a/1 2/2 3/3' is not"),
        ("generic_neutral_mesh", b"\nf 1/1", b"\nf \xff/1", "is not three or more vertices"),
        ("generic_neutral_mesh", b"\nf 1/1 ", b"\nf ", "polygon '2/2 3/3' is not three or more"),
        ("generic_neutral_mesh", b"\nf 1/1", b"\nf " + b"9" * 30 + b"/1", "polygon '999999"),
    ],
)
def test_damage_is_named_with_its_file(folder, file, old, new, said):
    path = folder / "FaceXModel" / f"{file}.obj"
    path.write_bytes(path.read_bytes().replace(old, new, 1))
    if said is None:
        fio.load_model(folder)
        return
    with pytest.raises(AssetError, match=re.escape(said)) as caught:
        fio.load_model(folder)
    assert "\n" not in str(caught.value)


def test_a_short_or_missing_file_is_refused(folder):
    identity = folder / "FaceXModel" / "identity001.obj"
    text = identity.read_bytes()
    for short in (b"", text[: len(text) // 3], b"\x00\xff" * 500):
        identity.write_bytes(short)
        with pytest.raises(AssetError, match=r"identity001\.obj: \d+ vertices"):
            fio.load_model(folder)
    (folder / "FaceXModel" / "generic_neutral_mesh.obj").unlink()
    with pytest.raises(AssetError, match=r"generic_neutral_mesh\.obj: cannot be read"):
        fio.load_model(folder)
    for file in (folder / "FaceXModel").glob("identity*"):
        file.unlink()
    with pytest.raises(AssetError, match=r"0 files identityNNN\.obj"):
        fio.load_model(folder)


def test_a_wrong_unit_is_refused_with_the_value(folder):
    for file in (folder / "FaceXModel").iterdir():
        rows = numbers(text := file.read_bytes())
        start, end = text.index(b"\nv "), text.index(b"\nvt ")
        millimetres = "".join(f"\nv {x:.6g} {y:.6g} {z:.6g}" for x, y, z in 10 * rows)
        file.write_bytes(text[:start] + millimetres.encode() + text[end:])
    with pytest.raises(
        AssetError,
        match="ict: outer eye corners of the mean are 900 mm apart, an adult's 80 to 100",
    ):
        fio.load_model(folder)


# The real files


def test_it_is_the_published_model(ict):
    assert (ict.n_vertices, ict.n_modes, ict.faces.shape[1]) == (9_409, 100, 3)
    # rms per vertex over the whole head; the face part alone has more of the first modes
    assert 1e-3 < np.sqrt((ict.control_modes[:, :, 0] ** 2).sum(1).mean()) < 5e-3
    assert ict.control_modes.flags.c_contiguous


def test_the_ten_subjects_have_the_published_eye_distances(ict):
    # PEERS.md 1: subject = mean + sum over all 100 modes; printed to 0.01 mm
    A = np.random.default_rng(2019).standard_normal((10, 100))
    scheme = ict.scheme("ibug68")
    eyes = [1000 * interocular(ict.vertices(alpha)[scheme.vertices], scheme) for alpha in A]
    expected = [62.81, 60.22, 67.37, 69.79, 64.06, 68.14, 60.08, 63.88, 70.08, 62.86]
    assert np.abs(np.subtract(eyes, expected)).max() <= 0.005 + 1e-9


def test_the_origin_lies_between_the_eyes_and_the_files_own_is_kept(ict, ict_path):
    # PEERS.md 1 prints 1e-7 m
    assert np.abs(-ict.file_origin - [0.0000008, 0.0334213, 0.0889928]).max() < 0.5e-7 + 1e-12
    corners = ict.mean[ict.scheme("ibug68").vertices[[36, 39, 42, 45]]]
    assert np.abs(corners.mean(axis=0)).max() < 1e-16  # rounding of a mean of four
    own = fio.load_model(ict_path, origin="file")
    assert not own.file_origin.any()
    assert np.abs(ict.mean - ict.file_origin - own.mean).max() < 1e-16


def test_the_landmarks_are_those_of_the_files(ict, ict_path):
    theirs = json.loads((ict_path / "FaceXModel" / "vertex_indices.json").read_text())
    scheme = ict.scheme("ibug68")
    assert scheme.vertices.tolist() == theirs["idx_to_landmark_verts"]
    assert scheme.points == tuple(str(k) for k in range(1, 69))
    x = ict.mean[scheme.vertices, 0]
    side = np.array(scheme.sides)
    assert (x[side == "right"] < 0).all()
    assert (x[side == "left"] > 0).all()
    assert np.abs(x[side == "mid"]).max() < 1e-4  # the mesh is symmetric to 0.006 mm


def test_the_head_is_wound_outward(ict_path):
    head = fio.load_model(ict_path, part="head")
    a, b, c = head.mean[head.faces].transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    outward = (normal * ((a + b + c) / 3 - head.mean.mean(axis=0))).sum(axis=1) > 0
    assert (
        np.linalg.norm(normal[outward], axis=1).sum() > 0.8 * np.linalg.norm(normal, axis=1).sum()
    )
