"""GNM: the head's modes only, the order of its landmarks, the skin, and zips that lie."""

from __future__ import annotations

import re
import zipfile
from typing import Any

import numpy as np
import pytest
from hypothesis import given

import faceambig.io as fio
from damage import cases
from faceambig.errors import AssetError
from faceambig.io.files import MAX_BYTES
from model_files import (
    HEAD_AT,
    damages,
    drawn,
    gnm_arrays,
    gnm_head,
    gnm_rows,
    read_damaged,
    write_gnm,
)

SMALL = drawn()
ROUNDING = 2e-8  # metres: float32 of 0.2 m


def test_only_modes_of_the_head_are_read_in_metres(tmp_path):
    model = fio.load_model(write_gnm(tmp_path / "gnm_head.npz", SMALL), origin="file")
    assert np.abs(model.mean - 1e-3 * SMALL.mean).max() < ROUNDING
    assert model.n_modes == 3  # the file has five: one of the eyes, one of the teeth
    assert np.abs(model.control_modes - 1e-3 * SMALL.modes).max() < ROUNDING
    assert np.array_equal(model.faces, SMALL.faces)
    assert (model.name, model.unit) == ("gnm", "m")
    assert model.licence.startswith("Apache-2.0")
    assert model.evaluation is not None
    assert model.evaluation.tolist() == list(range(21))  # the skin, not the teeth
    assert not model.schemes


@pytest.mark.parametrize("order", ["ibug", "published"])
def test_the_order_of_the_jaw_is_seen_on_the_mean(tmp_path, order):
    swapped = [0, 1, 6, 5, 4, 3, 2, *range(7, 68)]  # its own inverse
    table = gnm_rows(range(68) if order == "ibug" else swapped)
    model = fio.load_model(write_gnm(tmp_path / "gnm_head.npz", gnm_head(), table))
    assert model.scheme("ibug68").vertices.tolist() == list(range(42, 110))
    assert [mm for _, mm, _, _ in fio.eye_distances(model)] == pytest.approx([90, 36, 63], abs=1e-3)
    assert np.abs(model.file_origin + 1e-3 * HEAD_AT).max() < ROUNDING


def test_a_point_between_vertices_becomes_a_vertex_of_the_mesh(tmp_path):
    table = gnm_rows()
    table[30] = [1, 0.25, 2, 0.25, 0, 0.5]  # the nose, in the first triangle of the surface
    model = fio.load_model(write_gnm(tmp_path / "gnm_head.npz", gnm_head(), table), origin="file")
    nose = model.scheme("ibug68").vertices[30]
    assert nose == 120
    wanted = 0.25 * model.mean[1] + 0.25 * model.mean[2] + 0.5 * model.mean[0]
    assert np.abs(model.mean[nose] - wanted).max() < 1e-15
    assert model.vertices([1.0])[nose] == pytest.approx(
        np.array([0.5, 0.25, 0.25]) @ model.vertices([1.0])[:3]
    )
    table[30] = [1, 0.25, 20, 0.15, 40, 0.6]  # of no triangle: the vertex of most weight
    model = fio.load_model(write_gnm(tmp_path / "gnm_head.npz", gnm_head(), table), origin="file")
    assert model.scheme("ibug68").vertices[30] == 40


def changed(tmp_path, **changes: Any):
    path = tmp_path / "gnm_head.npz"
    arrays: dict[str, Any] = {
        k: v for k, v in (gnm_arrays(SMALL) | changes).items() if v is not None
    }
    np.savez(path, **arrays)
    return path


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"identity_names": np.array(["eyes_0"] * 5)}, "identity_names: none begins with head_"),
        (
            {"identity_names": np.array(["head_0"] * 4)},
            "4 identity_names for a basis of shape (5, 42, 3)",
        ),
        ({"identity_names": np.arange(5)}, "5 identity_names for a basis"),
        (
            {"vertex_identity_basis": np.ones((5, 41, 3))},
            "modes have shape (41, 3, 3), expected (42, 3, S)",
        ),
        (
            {"vertex_identity_basis": np.full((5, 42, 3), np.inf)},
            "modes holds a value that is not finite",
        ),
        (
            {"template_vertex_positions": np.full((42, 3), np.nan)},
            "mean holds a value that is not finite",
        ),
        ({"template_vertex_positions": np.ones((42, 2))}, "mean has shape (42, 2)"),
        ({"triangles": np.full((3, 3), 42)}, "triangles: vertex 42 is not within 0 to 41"),
        ({"triangles": np.array([{}])}, "triangles is not a plain array"),
    ],
)
def test_what_does_not_fit_is_named(tmp_path, changes, said):
    with pytest.raises(AssetError, match=rf"gnm_head\.npz: .*{re.escape(said)}"):
        fio.load_model(changed(tmp_path, **changes), origin="file")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1 1 2 0 3 0\n", "expected 68 lines of three vertices and weights"),
        ("words\n" * 68, "a line is not three vertices and weights"),
        ("1 1 2 0\n" * 68, "expected 68 lines"),
        ("0.5 1 2 0 3 0\n" * 68, "expected 68 lines"),
        ("nan 1 2 0 3 0\n" * 68, "expected 68 lines"),
        ("42 1 2 0 3 0\n" * 68, "landmarks: vertex 42 is not within 0 to 41"),
        ("1 0.5 2 0.1 3 0\n" * 68, "landmark weights: three of 0 or more with the sum 1"),
        ("1 inf 2 0.1 3 0\n" * 68, "landmark weights holds a value that is not finite"),
    ],
)
def test_bad_landmarks_are_named(tmp_path, text, said):
    path = write_gnm(tmp_path / "gnm_head.npz", SMALL)
    (tmp_path / "head_sparse_68.txt").write_text(text)
    with pytest.raises(AssetError, match=re.escape(said)):
        fio.load_model(path)


def test_a_bomb_is_refused_by_the_zip_directory(tmp_path):
    path = changed(tmp_path, vertex_identity_basis=None)
    n = MAX_BYTES // 8 + 1
    words = (
        f"{{'descr': '|i1', 'fortran_order': False, 'shape': (1, {n}, 3), }}".encode().ljust(117)
        + b"\n"
    )
    with (
        zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
        archive.open("vertex_identity_basis.npy", "w") as member,
    ):
        member.write(b"\x93NUMPY\x01\x00" + len(words).to_bytes(2, "little") + words)
        for _ in range(3):
            member.write(bytes(n))
    with pytest.raises(
        AssetError, match=r"gnm_head\.npz: unpacks to 15\d\d MB; 512 MB are accepted"
    ):
        fio.load_model(path)


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> bytes:
    return write_gnm(tmp_path_factory.mktemp("gnm") / "gnm_head.npz", SMALL).read_bytes()


@cases(150)
@given(damage=damages(10_000))
def test_damage_is_an_asset_error_or_another_number(whole, tmp_path_factory, damage):
    read_damaged(tmp_path_factory.getbasetemp() / "damaged_gnm.npz", whole, damage)
