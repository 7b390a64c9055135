"""FLAME: pickles of every protocol read as data, landmarks inside triangles, and pickles that would run something."""

from __future__ import annotations

import os
import re
import struct
import subprocess
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given

import faceambig.io as fio
from damage import cases
from faceambig.errors import AssetError
from faceambig.io.between import points_between
from model_files import Drawn, damages, drawn, flame_arrays, pickled, read_damaged, write_flame

SMALL = drawn()
POINTS = points_between(fio.asset_path("schemes/flame_ibug68.csv"))


@pytest.mark.parametrize("name", ["m.pkl", "m.npz"])
@pytest.mark.parametrize("protocol", [0, 1, 2, 3, 4])
def test_every_protocol_is_the_same_model(tmp_path, name, protocol):
    model = fio.load_model(write_flame(tmp_path / name, SMALL, protocol), origin="file")
    assert np.array_equal(model.mean, 1e-3 * SMALL.mean)  # float64 in the file, metres
    assert np.abs(model.control_modes - 1e-3 * SMALL.modes).max() == 0.0  # in sd units already
    assert np.array_equal(model.faces, SMALL.faces)
    assert model.unit == "m"


def test_python_2_writes_bytes_as_text(tmp_path):
    # what Python 2 writes: str for bytes, and the names of its modules
    numbers = np.arange(6.0).reshape(2, 3)
    text = repr(numbers.tobytes())[1:].encode()
    array = (
        b"cnumpy.core.multiarray\n_reconstruct\n(cnumpy\nndarray\n(I0\ntS'b'\ntR"
        b"(I1\n(I2\nI3\ntcnumpy\ndtype\n(S'f8'\nI0\nI1\ntR(I3\nS'<'\nNNNI-1\nI-1\nI0\ntbI00\nS"
    )
    (tmp_path / "m.pkl").write_bytes(
        b"(dS'v_template'\n" + array + text + b"\ntbsS'x'\nI01\nsS'y'\nL5L\ns."
    )
    with pytest.raises(
        AssetError, match=r"m\.pkl: shapedirs is missing; FLAME has v_template, shapedirs, f"
    ):
        fio.load_model(tmp_path / "m.pkl")
    from faceambig.io.pickled import array_of, read_pickle

    found = read_pickle(tmp_path / "m.pkl")
    assert np.array_equal(array_of("v_template", found["v_template"]), numbers)
    assert (found["x"], found["y"]) == (True, 5)


def test_expressions_are_left_out(tmp_path):
    wide = drawn(42, 60)
    model = fio.load_model(write_flame(tmp_path / "m.npz", wide, expressions=0), origin="file")
    assert model.n_modes == 60
    many = drawn(150, 300)
    model = fio.load_model(write_flame(tmp_path / "m.pkl", many, expressions=100), origin="file")
    assert model.n_modes == 300
    assert np.array_equal(model.control_modes, 1e-3 * many.modes)


# Landmarks inside triangles


def full() -> Drawn:
    """FLAME's size: each landmark's triangle a small one around its place, on the drawn head."""
    small = drawn(5_023, 4)
    mean, rng = small.mean.copy(), np.random.default_rng(4)
    eyes = dict(zip(range(36, 48), EYE_PLACES, strict=True))
    triples = {}
    for row, triple in enumerate(POINTS.corners.tolist()):
        triples.setdefault(frozenset(triple), (triple, row))
    for triple, row in triples.values():
        place = eyes.get(row, rng.uniform((-60, -100, -20), (60, -20, 10))) + np.array(
            (3.0, -40.0, -90.0)
        )
        offsets = np.array([(2.0, 0, 0), (-1, 1.8, 0), (-1, -1.8, 0.5)])
        offsets -= POINTS.weights[row] @ offsets
        mean[triple] = place + offsets
    faces = np.concatenate([small.faces, [triple for triple, _ in triples.values()]])
    return Drawn(mean, small.basis, small.sds, faces, small.colours)


EYE_PLACES = [(x, 0.0, 0.0) for x in (-45, -37, -26, -18, -26, -37, 18, 26, 37, 45, 37, 26)]


@pytest.fixture(scope="module")
def flame(tmp_path_factory):
    return fio.load_model(
        write_flame(tmp_path_factory.mktemp("flame") / "m.pkl", full()), origin="file"
    )


def test_the_points_lie_where_their_weights_say(flame):
    scheme = flame.scheme("ibug68")
    model = full()
    for place, moved in (
        (model.mean, flame.mean),
        (model.mean + model.modes[:, :, 1], flame.vertices([0.0, 1.0])),
    ):
        wanted = (place[POINTS.corners] * POINTS.weights[:, :, None]).sum(axis=1)
        # weights have six digits: their sum is 1 to 1e-6, of positions of 0.2 m
        assert np.abs(moved[scheme.vertices] - 1e-3 * wanted).max() < 1e-6
    assert (flame.name, flame.n_vertices) == (
        "flame",
        5_023 + len(set(scheme.vertices) - set(range(5_023))),
    )


def test_the_surface_is_the_same_with_the_points_in_it(flame):
    def area(faces: np.ndarray) -> np.ndarray:
        a, b, c = flame.mean[faces].transpose(1, 0, 2)
        return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)

    assert flame.coarse_faces is not None
    # weights of six digits put a point within a nanometre of its triangle
    assert area(flame.faces).sum() == pytest.approx(area(flame.coarse_faces).sum(), rel=1e-9)
    added = flame.n_vertices - 5_023
    assert added >= 66
    assert set(range(5_023, flame.n_vertices)) <= set(flame.faces.ravel().tolist())
    before = {tuple(face) for face in flame.coarse_faces.tolist()}
    assert len(before - {tuple(face) for face in flame.faces.tolist()}) == 67  # one has two points
    assert flame.evaluation is not None
    assert np.array_equal(flame.evaluation, np.arange(5_023))  # d_S counts the file's own vertices


def test_a_model_with_points_in_triangles_is_fitted_and_saved(flame, tmp_path):
    import faceambig as fa

    model = fio.load_model(write_flame(tmp_path / "m.npz", full()))
    assert [round(mm, 3) for _, mm, _, _ in fio.eye_distances(model)] == pytest.approx(
        [90, 36, 63], abs=0.6
    )
    fio.save_model(flame, tmp_path / "saved.npz")
    again = fio.load_model(tmp_path / "saved.npz")
    assert np.array_equal(again.control_modes, model.control_modes)
    assert np.array_equal(again.mean, model.mean)
    assert np.array_equal(again.faces, model.faces)
    assert again.unit == "m"
    face = fa.Subject("drawn", "", model.vertices([0.5, -0.5, 0.2, 0.1]), None, model)
    fit = fa.fit(model, fa.observe(face, distance=0.6), distance=0.6, noise_percent=0.01)
    assert fit.converged
    assert fit.d_l_percent < 0.05


# Pickles that are not FLAME's


class Runs:
    """Runs a command when Python's own reader unpickles it."""

    def __init__(self, function: Any, *arguments: Any) -> None:
        self.call = (function, arguments)

    def __reduce__(self) -> tuple[Any, Any]:
        return self.call


@pytest.fixture
def trap(tmp_path) -> Path:
    return tmp_path / "ran"


def bombs(trap: Path) -> dict[str, bytes]:
    """Pickles that would make the file `trap`, run a command or fill the memory."""
    touch = Runs(os.system, f"touch {trap}")  # noqa: TID251 - never run: that is the claim
    arrays = flame_arrays(SMALL)
    big = b"\x80\x02X" + struct.pack("<I", 100_000) + b"a" * 100_000 + b"q\x00"
    encode = b"c_codecs\nencode\nq\x01h\x00X\x06\x00\x00\x00latin1\x86R"
    tuples = b"\x80\x02)" + b"".join(b"q\x002\x86" for _ in range(60))
    return {
        "os.system": pickled(touch, 2),
        "as a value": pickled({**arrays, "J": touch}, 2),
        "protocol 0": pickled(touch, 0),
        "protocol 4": pickled({"v_template": [1, (2, {"deep": touch})]}, 4),
        "subprocess": pickled(Runs(subprocess.Popen, ["touch", str(trap)]), 2),
        "eval": pickled(Runs(eval, f"open({str(trap)!r}, 'w')"), 2),
        "getattr": pickled(Runs(getattr, "a", "format"), 2),
        "numpy.load": b"cnumpy\nload\n(S'/etc/passwd'\ntR.",
        "an allowed name with a dot": b"\x80\x04\x8c\x05numpy\x8c\x0bndarray.max\x93.",
        "state of a class": b"\x80\x02cnumpy\nndarray\n}q\x00b.",
        "a dtype of objects": pickled({**arrays, "v_template": np.array([touch], dtype=object)}, 2),
        "INST": b"(S'touch'\nios\nsystem\n.",
        "OBJ": b"(cos\nsystem\nS'touch'\no.",
        "an extension": b"\x80\x02\x82\x01.",
        "a persistent name": b"\x80\x02Pabc\n.",
        "nested pickles": pickled(pickled(touch, 2), 2),
        "an array of terabytes": b"cnumpy.core.multiarray\n_reconstruct\n(cnumpy\nndarray\n(I9999999999999\ntS'b'\ntR.",
        "a place of four billion": b"\x80\x02]r\xff\xff\xff\xff.",
        "a text of four gigabytes": b"\x80\x02X\xff\xff\xff\xff.",
        "a text of exabytes": b"\x80\x04\x8d" + b"\xff" * 8 + b".",
        "a thousand copies": big + encode * 1000 + b".",
        "doubled keys": tuples + b"}N\x87s.",
        "doubled tuples as a key": tuples + b"q\x05}h\x05Ns.",
        "a number of a million digits": b"I" + b"9" * 1_000_000 + b"\n.",
        "no end": b"\x80\x02",
        "nothing": b"",
        "words": b"hello",
    }


@pytest.mark.parametrize("name", list(bombs(Path("x"))))
def test_nothing_of_a_pickle_is_run(tmp_path, trap, name):
    path = tmp_path / "m.pkl"
    path.write_bytes(bombs(trap)[name])
    tracemalloc.start()
    with pytest.raises(AssetError, match=r"m\.pkl: ") as caught:
        fio.load_model(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert "\n" not in str(caught.value)
    assert not trap.exists()
    assert peak < 10 << 20  # the largest file has 1 MB


def test_a_pickle_of_endless_steps_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("faceambig.io.pickled.MAX_STEPS", 1000)  # of a million, which take a second
    (tmp_path / "m.pkl").write_bytes(b"\x80\x02" + b"N" * 1000 + b".")
    with pytest.raises(AssetError, match=r"m\.pkl: more than 1000 steps"):
        fio.load_model(tmp_path / "m.pkl")


def test_what_is_not_allowed_is_named(tmp_path, trap):
    path = tmp_path / "m.pkl"
    path.write_bytes(bombs(trap)["as a value"])
    with pytest.raises(
        AssetError, match=r"m\.pkl: names posix\.system, which is not allowed: nothing was run"
    ):
        fio.load_model(path)
    path.write_bytes(pickled([1, 2], 2))
    with pytest.raises(
        AssetError, match=r"m\.pkl: a pickle of something else; FLAME's is a dictionary"
    ):
        fio.load_model(path)


CHANGES: list[tuple[dict[str, Any], str]] = [
    ({"v_template": np.zeros((42, 2))}, "mean has shape (42, 2), expected (N, 3)"),
    ({"v_template": np.zeros((42, 3), bool)}, "mean holds bool numbers"),
    ({"v_template": np.full((42, 3), np.nan)}, "mean holds a value that is not finite"),
    ({"v_template": [1, 2]}, "v_template is not an array"),
    ({"v_template": np.array(["a"])}, "v_template holds U1 values, not numbers"),
    ({"shapedirs": np.zeros((42, 3))}, "shapedirs has shape (42, 3), expected (N, 3, S)"),
    ({"shapedirs": np.zeros((41, 3, 2))}, "modes have shape (41, 3, 2), expected (42, 3, S)"),
    ({"shapedirs": np.zeros((42, 3, 0))}, "modes have shape (42, 3, 0)"),
    ({"shapedirs": np.full((42, 3, 1), 1e9)}, "modes: a value of 1e+09 m is no face's"),
    ({"f": np.full((5, 3), 42)}, "triangles: vertex 42 is not within 0 to 41"),
    (
        {"f": np.full((5, 3), 2**32 - 1, np.uint32)},
        "triangles: vertex 4294967295 is not within 0 to 41",
    ),
    ({"f": np.full((5, 3), 0.5)}, "f holds numbers that are not whole"),
]


@pytest.mark.parametrize(("changes", "said"), CHANGES, ids=map(str, range(len(CHANGES))))
def test_what_does_not_fit_is_named(tmp_path, changes, said):
    path = tmp_path / "m.pkl"
    path.write_bytes(pickled({**flame_arrays(SMALL), **changes}, 4))
    with pytest.raises(AssetError, match=rf"m\.pkl: .*{re.escape(said)}"):
        fio.load_model(path, origin="file")


def test_an_array_that_lies_about_its_size_is_refused(tmp_path):
    path = tmp_path / "m.pkl"
    good = pickled(flame_arrays(SMALL), 2)
    path.write_bytes(good.replace(b"K*K\x03\x86", b"J\x00\x00\x00\x7fK\x03\x86", 1))
    with pytest.raises(
        AssetError, match=r"v_template claims shape \(2130706432, 3\), the file holds 1008 bytes"
    ):
        fio.load_model(path)


@pytest.fixture(scope="module", params=[0, 2, 4, "npz"])
def whole(request, tmp_path_factory) -> tuple[str, bytes]:
    name = "m.npz" if request.param == "npz" else "m.pkl"
    protocol = 2 if request.param == "npz" else request.param
    return name, write_flame(tmp_path_factory.mktemp("flame") / name, SMALL, protocol).read_bytes()


@cases(60)
@given(damage=damages(5_000))
def test_damage_is_an_asset_error_or_another_number(whole, tmp_path_factory, damage):
    read_damaged(tmp_path_factory.getbasetemp() / f"damaged_{whole[0]}", whole[1], damage)
