"""Basel 2009: MATLAB's arrays, the points of Farkas beside them, and `.mat` files that were made to hurt."""

from __future__ import annotations

import re
import struct
import tracemalloc
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
from hypothesis import given

import faceambig.io as fio
from damage import cases
from faceambig.errors import AssetError
from faceambig.io.matlab import read_matlab
from model_files import EYES, damages, drawn, eyes_of, read_damaged, write_basel, write_farkas

SMALL = drawn()
ROUNDING = 2e-8  # metres: float32 of 200,000 micrometres


@pytest.mark.parametrize("compressed", [False, True])
def test_micrometres_and_standard_deviations_become_metres(tmp_path, compressed):
    model = fio.load_model(
        write_basel(tmp_path / "m.mat", SMALL, compressed=compressed), origin="file"
    )
    assert np.abs(model.mean - 1e-3 * SMALL.mean).max() < ROUNDING
    # shapeEV is a standard deviation, not its square
    assert np.abs(model.control_modes - 1e-3 * SMALL.modes).max() < ROUNDING
    assert model.unit == "micrometre"
    assert "no redistribution" in model.licence


def test_triangles_count_from_0_and_look_outward(tmp_path):
    model = fio.load_model(write_basel(tmp_path / "m.mat", SMALL), origin="file")
    assert np.array_equal(model.faces, SMALL.faces)


def test_colours_are_those_of_the_texture(tmp_path):
    colours = fio.load_model(write_basel(tmp_path / "m.mat", SMALL), origin="file").colours
    assert colours is not None
    assert np.abs(colours - 255 * SMALL.colours).max() <= 0.5 + 1e-4
    plain = fio.load_model(write_basel(tmp_path / "m.mat", SMALL, texMU=None), origin="file")
    assert plain.colours is None


@pytest.fixture(scope="module")
def full(tmp_path_factory) -> Path:
    """A file of the size of the real model, so that its landmarks are known; two modes."""
    folder = tmp_path_factory.mktemp("PublicMM1")
    return write_basel(
        folder / "01_MorphableModel.mat", drawn(53_490, 2, eyes_of("bfm2009_ibug68"))
    )


def test_the_size_of_the_real_model_has_its_points(full):
    model = fio.load_model(full)
    assert (model.name, len(model.scheme("ibug68")), len(model.scheme("eos"))) == (
        "bfm2009",
        68,
        18,
    )
    found = {what: mm for what, mm, _, _ in fio.eye_distances(model)}
    assert found["outer eye corners"] == pytest.approx(90, abs=1e-4)
    corners = [model.scheme("ibug68").vertices[k] for k in (36, 39, 42, 45)]
    assert np.abs(model.mean[corners].mean(axis=0)).max() < ROUNDING


def test_the_points_of_farkas_are_those_of_the_users_file(full, tmp_path):
    model, eyes = drawn(53_490, 2, eyes_of("bfm2009_ibug68")), eyes_of("bfm2009_ibug68")
    named = {
        "exr": eyes["37"],
        "enr": eyes["40"],
        "enl": eyes["43"],
        "exl": eyes["46"],
        "v": 0,
        "t": 7,
    }
    (tmp_path / "m.mat").write_bytes(full.read_bytes())
    file = write_farkas(tmp_path / "11_feature_points" / "Farkas_face05.fp", model, named)
    scheme = fio.load_model(tmp_path / "m.mat").scheme("farkas")
    assert [(name, v) for name, _, v in scheme.rows()] == list(named.items())
    assert scheme.eyes == ((0, 1), (2, 3))
    assert scheme.sides[:4] == ("right", "right", "left", "left")
    write_farkas(file, model, named, off_mm=1.5)
    with pytest.raises(
        AssetError,
        match=r"line 4 of Farkas_face05\.fp: exr is 2\.6 mm from vertex \d+: points of an",
    ):
        fio.load_model(tmp_path / "m.mat")
    file.write_text("a\nb\nc\n1 2 x 4 5 6 name\n")
    with pytest.raises(
        AssetError, match=r"line 4 of Farkas_face05\.fp: expected vertex x y z X Y name"
    ):
        fio.load_model(tmp_path / "m.mat")
    file.write_text("")
    with pytest.raises(AssetError, match=r"Farkas_face05\.fp: no points"):
        fio.load_model(tmp_path / "m.mat")


def test_a_point_that_both_sides_have_gets_its_side(full, tmp_path):
    model, eyes = drawn(53_490, 2, eyes_of("bfm2009_ibug68")), eyes_of("bfm2009_ibug68")
    (tmp_path / "m.mat").write_bytes(full.read_bytes())
    file = tmp_path / "Farkas_face05.fp"
    write_farkas(file, model, {k: eyes[k] for k in ("37", "40", "43", "46")})
    text = file.read_text()
    for number, name in (("37", "ex"), ("46", "ex"), ("40", "en"), ("43", "en")):
        text = text.replace(f" {number}\n", f" {name}\n")
    file.write_text(text)
    scheme = fio.load_model(tmp_path / "m.mat").scheme("farkas")
    assert scheme.points == ("ex_r", "en_r", "en_l", "ex_l")
    assert scheme.eyes == ((0, 1), (2, 3))


@pytest.mark.parametrize("compressed", [False, True])
def test_every_kind_of_number_is_read_as_scipy_reads_it(tmp_path, compressed):
    rng = np.random.default_rng(2)
    kinds = ("f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8")
    arrays = {f"a_{kind}": rng.uniform(0, 120, (3, 4)).astype(kind) for kind in kinds}
    arrays |= {"b": rng.normal(size=(2, 3, 4)), "one": np.array([[7.5]]), "none": np.zeros((0, 3))}
    scipy.io.savemat(tmp_path / "m.mat", arrays, do_compression=compressed)
    theirs = scipy.io.loadmat(tmp_path / "m.mat")
    ours = read_matlab(tmp_path / "m.mat", tuple(arrays))
    for name in arrays:
        assert np.array_equal(ours[name], theirs[name]), name
        assert ours[name].dtype == theirs[name].dtype, name


# What is refused


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"shapeEV": None}, "shapeEV is missing; Basel 2009 has shapeMU, shapePC, shapeEV, tl"),
        ({"shapeEV": np.ones((2, 1))}, "2 standard deviations for 3 modes"),
        ({"shapeEV": np.array([[1.0], [2.0], [3.0]])}, "mode 2 is stronger than mode 1"),
        ({"shapeEV": np.array([[1.0], [0.5], [0.0]])}, "standard deviations: 0 is not positive"),
        (
            {"shapeEV": np.array([[np.nan], [0.5], [0.1]])},
            "standard deviations holds a value that is not finite",
        ),
        ({"shapeMU": np.ones((125, 1))}, "shapeMU has shape (125,), expected x y z"),
        ({"shapeMU": np.full((126, 1), np.inf)}, "mean holds a value that is not finite"),
        ({"shapeMU": np.full((126, 1), 1e300)}, "mean: a value of 1e+294 m is no face's"),
        ({"shapePC": np.ones((123, 3))}, "modes have shape (41, 3, 3), expected (42, 3, S)"),
        ({"shapePC": np.full((126, 3), np.nan)}, "modes holds a value that is not finite"),
        ({"shapePC": np.ones((126, 3)) * 1j}, "shapePC is not an array of real numbers"),
        ({"shapePC": {"a": 1}}, "shapePC is not an array of real numbers"),
        ({"shapePC": "words"}, "shapePC is not an array of real numbers"),
        ({"tl": np.array([[0, 1, 2]])}, "triangles: vertex -1 is not within 0 to 41"),
        ({"tl": np.array([[1, 2, 43]])}, "triangles: vertex 42 is not within 0 to 41"),
        ({"tl": np.array([[1, 2, 2.5]])}, "tl holds numbers that are not whole"),
        ({"tl": np.array([[1.0, 2, np.nan]])}, "tl holds"),
        ({"tl": np.ones((5, 4))}, "triangles have shape (5, 4), expected (F, 3)"),
        ({"tl": np.zeros((0, 3))}, "triangles have shape (0, 3)"),
        ({"texMU": np.ones((123, 1))}, "colours have shape (41, 3), expected (42, 3)"),
    ],
)
def test_what_does_not_fit_is_named(tmp_path, changes, said):
    with pytest.raises(AssetError, match=rf"m\.mat: .*{re.escape(said)}") as caught:
        fio.load_model(write_basel(tmp_path / "m.mat", SMALL, **changes), origin="file")
    assert "\n" not in str(caught.value)


def bomb(name: bytes, shape: tuple[int, int], zeros: int) -> bytes:
    """A compressed variable that says `shape` of float32 and holds that many zeros."""
    body = struct.pack("<IIII", 6, 8, 7, 0) + struct.pack("<IIii", 5, 8, *shape)
    body += struct.pack("<II", 1, len(name)) + name + b"\x00" * (-len(name) % 8)
    pack = zlib.compressobj()
    head = struct.pack("<II", 14, min(len(body) + 8 + zeros, 2**32 - 1)) + body
    parts = [pack.compress(head + struct.pack("<II", 7, min(zeros, 2**32 - 1)))]
    parts += [pack.compress(bytes(1 << 20)) for _ in range(zeros >> 20)]
    data = b"".join([*parts, pack.flush()])
    return struct.pack("<II", 15, len(data)) + data


@pytest.mark.parametrize(
    ("name", "shape", "said"),
    [
        (b"shapePC", (160_470, 2**31 - 1), "unpacks to"),  # says terabytes
        (b"shapePC", (126, 3), "shapePC claims shape (126, 3)"),  # holds more than it says
        (b"another", (160_470, 199), None),  # not asked for: never inflated
    ],
)
def test_a_bomb_costs_no_memory(tmp_path, name, shape, said):
    changes: dict[str, Any] = {name.decode(): None}
    path = write_basel(tmp_path / "m.mat", SMALL, **changes)
    path.write_bytes(path.read_bytes() + bomb(name, shape, 200 << 20))
    assert path.stat().st_size < 1 << 20
    tracemalloc.start()
    if said is None:
        assert fio.load_model(path, origin="file").n_modes == 3
    else:
        with pytest.raises(AssetError, match=re.escape(said)):
            fio.load_model(path, origin="file")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 10 << 20  # the bomb holds 200 MB


def test_files_of_other_matlabs_are_named(tmp_path):
    path = tmp_path / "m.mat"
    data = write_basel(path, SMALL).read_bytes()
    path.write_bytes(data[:126] + b"MI" + data[128:])
    with pytest.raises(AssetError, match=r"m\.mat: a MATLAB 5 file of a big-endian machine"):
        fio.load_model(path)
    path.write_bytes(data[:-100])
    with pytest.raises(AssetError, match=r"m\.mat: cut off: the part at byte \d+ claims"):
        fio.load_model(path)
    path.write_bytes(data + data[128:])
    with pytest.raises(AssetError, match=r"m\.mat: shapeMU is there twice"):
        fio.load_model(path)


@pytest.fixture(scope="module", params=[False, True])
def whole(request, tmp_path_factory) -> bytes:
    path = tmp_path_factory.mktemp("basel") / "m.mat"
    return write_basel(path, SMALL, compressed=request.param).read_bytes()


@cases(150)
@given(damage=damages(2_500))
def test_damage_is_an_asset_error_or_another_number(whole, tmp_path_factory, damage):
    read_damaged(tmp_path_factory.getbasetemp() / "damaged.mat", whole, damage)


def test_all_eyes_are_among_the_maps():
    assert set(eyes_of("bfm2009_ibug68")) == set(EYES)
