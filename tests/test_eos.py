"""eos files: every version and every optional part, the public one, and files that claim more than they hold."""

from __future__ import annotations

import re
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given

import faceambig.io as fio
from damage import cases
from faceambig.errors import AssetError
from model_files import (
    EYES,
    HEAD_AT,
    damages,
    drawn,
    eos_list,
    eyes_of,
    read_damaged,
    write_eos,
)

SFM = Path(__file__).parents[2] / "shared" / "data" / "sfm" / "sfm_shape_3448.bin"
SMALL = drawn(42, 3, {point: k for k, point in enumerate(EYES)})
ROUNDING = 2e-8  # metres: float32 of 200 mm


@pytest.mark.parametrize("version", [1, 2, 3, 4])
@pytest.mark.parametrize("expressions", ["none", "pca", "blendshapes"])
def test_every_version_is_the_same_model(tmp_path, version, expressions):
    path = write_eos(
        tmp_path / "m.bin", SMALL, version, expressions=expressions, landmarks={"nose": 3}
    )
    model = fio.load_model(path, origin="file")
    assert np.abs(model.mean - 1e-3 * SMALL.mean).max() < ROUNDING
    assert np.abs(model.control_modes - 1e-3 * SMALL.modes).max() < ROUNDING
    assert np.array_equal(model.faces, SMALL.faces)
    assert model.colours is None


def test_a_mode_is_one_standard_deviation(tmp_path):
    model = fio.load_model(write_eos(tmp_path / "m.bin", SMALL), origin="file")
    lengths = 1000 * np.sqrt((model.control_modes**2).sum(axis=(0, 1)))
    assert lengths == pytest.approx(SMALL.sds, rel=1e-6)  # of float32 files


def test_points_of_ibug_in_the_file_become_the_scheme_and_move_the_origin(tmp_path):
    named = {point: k for k, point in enumerate(EYES)}
    path = write_eos(tmp_path / "m.bin", SMALL, 3, landmarks={**named, "wart": 40})
    model = fio.load_model(path)
    assert set(model.schemes) == {"ibug68", "mediapipe"}
    assert {name: v for name, _, v in model.scheme("ibug68").rows()} == named
    assert model.scheme("ibug68").sides[:2] == ("right", "right")
    assert np.abs(model.mean[[0, 3, 6, 9]].mean(axis=0)).max() < ROUNDING
    assert np.abs(model.file_origin + 1e-3 * HEAD_AT).max() < ROUNDING
    assert model.unit == "mm, found by its size: outer eye corners 90.0 mm"
    path = write_eos(tmp_path / "m.bin", SMALL, 3, landmarks={**named, "37": 42})
    with pytest.raises(AssetError, match=r"m\.bin: landmarks: vertex 42 is not within 0 to 41"):
        fio.load_model(path)


def test_triangles_are_turned_outward(tmp_path):
    turned = drawn()
    object.__setattr__(turned, "faces", turned.faces[:, ::-1])
    model = fio.load_model(write_eos(tmp_path / "m.bin", turned), origin="file")
    assert np.array_equal(model.faces, drawn().faces)


def test_colours_are_bytes(tmp_path):
    colours = fio.load_model(
        write_eos(tmp_path / "m.bin", SMALL, colours=True), origin="file"
    ).colours
    assert colours is not None
    assert np.abs(colours - 255 * SMALL.colours).max() <= 0.5 + 1e-4


@pytest.mark.parametrize(
    ("factor", "unit"), [(1e-3, "m"), (0.1, "cm"), (0.01, "dm"), (1000.0, "micrometre")]
)
def test_another_unit_is_found_by_the_eyes_and_said(tmp_path, factor, unit):
    other = drawn(42, 3, {point: k for k, point in enumerate(EYES)})
    for name in ("mean", "sds"):
        object.__setattr__(other, name, factor * getattr(other, name))
    named = {point: k for k, point in enumerate(EYES)}
    model = fio.load_model(write_eos(tmp_path / "m.bin", other, 3, landmarks=named), origin="file")
    assert model.unit.startswith(f"{unit}, found by its size")
    assert np.abs(model.mean - 1e-3 * SMALL.mean).max() < ROUNDING
    assert np.abs(model.control_modes - 1e-3 * SMALL.modes).max() < ROUNDING


def test_no_unit_that_fits_is_refused(tmp_path):
    other = drawn(42, 3, {point: k for k, point in enumerate(EYES)})
    object.__setattr__(other, "mean", 2.5 * other.mean)
    named = {point: k for k, point in enumerate(EYES)}
    with pytest.raises(
        AssetError,
        match=r"of unknown unit: outer eye corners are apart 225, an adult's 80 to 100 mm",
    ):
        fio.load_model(write_eos(tmp_path / "m.bin", other, 3, landmarks=named))


def test_the_surrey_models_size_has_its_fifty_points(tmp_path):
    eyes = eyes_of("sfm_ibug68")
    assert len(eyes) == 12
    model = fio.load_model(write_eos(tmp_path / "m.bin", drawn(3448, 2, eyes)))
    assert (model.name, len(model.scheme("ibug68"))) == ("sfm", 50)
    assert "non-commercial" in model.licence
    found = {what: mm for what, mm, _, _ in fio.eye_distances(model)}
    assert found["outer eye corners"] == pytest.approx(90, abs=1e-4)
    assert found["inner eye corners"] == pytest.approx(36, abs=1e-4)


@pytest.mark.skipif(not SFM.is_file(), reason="no SFM in ../shared/data/sfm")
def test_the_public_surrey_model_is_read_as_eos_reads_it():
    model = fio.load_model(SFM)
    found = [mm for _, mm, _, _ in fio.eye_distances(model)]
    assert found == pytest.approx([92.36, 38.18, 64.15], abs=0.01)  # measured with eos's own reader
    rms = 1000 * np.sqrt((model.control_modes**2).sum(axis=(0, 1)) / model.n_vertices)
    assert rms[:3] == pytest.approx([4.05, 2.94, 1.67], abs=0.005)
    assert (model.n_vertices, model.n_modes, len(model.faces)) == (3448, 63, 6736)
    assert model.file_origin[2] == pytest.approx(0.033, abs=5e-4)  # the eyes lie 33 mm behind it
    own = fio.load_model(SFM, origin="file")
    assert own.mean[114, 2] == pytest.approx(3.3e-3, abs=1e-4)


# What is refused

GOOD = 4 + 8 + 4 * 126 + 8 + 4 * 378 + 8 + 12  # bytes before the triangles of the small model


@pytest.mark.parametrize(
    ("at", "value", "said"),
    [
        (8, struct.pack("<i", 1), None),  # one column: as it is
        (12 + 4 * 126, struct.pack("<ii", 2**31 - 1, 2**31 - 1), "take"),
        (12 + 4 * 126, struct.pack("<ii", 126, 10**6), "take"),
        (12 + 4 * 126, struct.pack("<ii", -1, 3), "basis has -1 rows and 3 columns"),
        (12 + 4 * 126, struct.pack("<ii", 126, 2000), "basis claims 1008000 bytes"),
        (12, struct.pack("<f", np.nan), "mean holds a value that is not finite"),
        (12 + 4 * 126 + 8, struct.pack("<f", np.inf), "modes holds a value that is not finite"),
        (GOOD - 4, struct.pack("<f", -1), "variances: -1 is not positive"),
        (GOOD - 4, struct.pack("<f", np.nan), "variances holds a value that is not finite"),
        (GOOD - 4, struct.pack("<f", 1e9), "standard deviations: mode 3 is stronger than mode 2"),
        (GOOD, struct.pack("<Q", 2**63), "triangles claims"),
        (GOOD, struct.pack("<Q", 10**6), "triangles claims 12000000 bytes"),
        (GOOD + 8, struct.pack("<i", 42), "triangles: vertex 42 is not within 0 to 41"),
        (GOOD + 8, struct.pack("<i", -1), "triangles: vertex -1 is not within 0 to 41"),
    ],
)
def test_numbers_that_do_not_fit_are_named(tmp_path, at, value, said):
    path = write_eos(tmp_path / "m.bin", SMALL)
    data = bytearray(path.read_bytes())
    data[at : at + len(value)] = value
    path.write_bytes(bytes(data))
    if said is None:
        assert fio.load_model(path, origin="file").n_modes == 3
        return
    with pytest.raises(AssetError, match=rf"m\.bin: .*{re.escape(said)}") as caught:
        fio.load_model(path, origin="file")
    assert "\n" not in str(caught.value)


def test_the_file_ends_where_the_model_does(tmp_path):
    path = write_eos(tmp_path / "m.bin", SMALL)
    path.write_bytes(path.read_bytes() + b"\x00")
    with pytest.raises(AssetError, match=r"m\.bin: 1 bytes follow the end of the model"):
        fio.load_model(path)


def test_a_file_of_blendshapes_alone_is_no_model(tmp_path):
    path = tmp_path / "m.bin"
    path.write_bytes(eos_list(np.zeros((6, 2)), "<f8"))
    with pytest.raises(AssetError, match="not a model"):
        fio.load_model(path)


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> bytes:
    path = tmp_path_factory.mktemp("eos") / "m.bin"
    named = {point: k for k, point in enumerate(EYES)}
    return write_eos(
        path, SMALL, 4, colours=True, expressions="blendshapes", landmarks=named
    ).read_bytes()


@cases(200)
@given(damage=damages(8_000))
def test_damage_is_an_asset_error_or_another_number(whole, tmp_path_factory, damage):
    assert len(whole) > 8_000  # all the heads; behind them are coordinates of the texture
    read_damaged(tmp_path_factory.getbasetemp() / "damaged.bin", whole, damage)
