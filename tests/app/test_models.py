"""faceambig models: what a file holds, our own file of it, and models that are fetched."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

import faceambig as fa
import faceambig.io as fio
from commands import printed, refused
from faceambig.io import install as installing
from model_files import (
    EYES,
    Drawn,
    drawn,
    eyes_of,
    gnm_head,
    gnm_rows,
    write_basel,
    write_eos,
    write_flame,
    write_gnm,
)

SMALL = drawn(42, 3, {point: k for k, point in enumerate(EYES)})


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> dict[str, Path]:
    """A file of each format, h5 apart."""
    folder = tmp_path_factory.mktemp("files")
    named = {point: k for k, point in enumerate(EYES)}
    return {
        "eos": write_eos(folder / "eos.bin", SMALL, 3, colours=True, landmarks=named),
        "sfm": write_eos(folder / "sfm.bin", drawn(3448, 2, eyes_of("sfm_ibug68"))),
        "basel": write_basel(folder / "basel.mat", SMALL),
        "flame": write_flame(folder / "flame.pkl", SMALL),
        "gnm": write_gnm(folder / "gnm_head.npz", gnm_head(), gnm_rows()),
    }


def test_info_says_units_and_eyes_against_what_an_adult_has(capsys, files):
    status, out, err = printed(capsys, "models", "info", files["eos"])
    assert (status, err) == (0, "")
    assert "42 vertices, 3 modes, 0 subjects" in out
    assert "unit in the file: mm, found by its size: outer eye corners 90.0 mm" in out
    assert "outer eye corners of the mean: 90.0 mm (an adult's 80 to 100)" in out
    assert "eye centres of the mean: 63.0 mm (an adult's 56 to 72)" in out
    assert "scheme ibug68: 12 points" in out
    assert printed(capsys, "models", files["eos"])[1] == out
    _, out, _ = printed(capsys, "models", "info", files["sfm"])
    assert "sfm: Surrey Face Model, eos file of version 1; free for non-commercial use only" in out
    assert "scheme ibug68: 50 points" in out


def test_info_for_programs(capsys, files):
    _, out, _ = printed(capsys, "models", "info", files["gnm"], "--json")
    record = json.loads(out)
    assert (record["name"], record["vertices"], record["modes"]) == ("gnm", 120, 3)
    assert record["unit_of_file"] == "m"
    assert record["licence"] == "Apache-2.0, Google"
    assert record["eye_distances_mm"]["inner eye corners"] == pytest.approx(36, abs=1e-3)
    assert record["eye_distances_expected_mm"]["inner eye corners"] == [28, 44]
    assert len(record["schemes"]["ibug68"]) == 68


def test_a_model_without_landmarks_is_looked_at_all_the_same(capsys, files):
    _, out, _ = printed(capsys, "models", "info", files["basel"])
    assert "unit in the file: micrometre" in out
    assert (
        "no landmarks: the size of the face cannot be checked, and origin='file' is needed" in out
    )
    with pytest.raises(fa.AssetError, match="names no eyes to put the origin between"):
        fa.load_model(files["basel"])


@pytest.mark.parametrize("name", ["eos", "sfm", "basel", "flame", "gnm"])
def test_what_is_converted_is_equal(capsys, files, tmp_path, name):
    target = tmp_path / f"{name}.npz"
    status, out, err = printed(capsys, "models", "convert", files[name], target)
    assert (status, err) == (0, "")
    before, after = (fio.load_model(path, origin="file") for path in (files[name], target))
    assert str(target) in out
    assert before.licence in out
    for part in ("mean", "control_mean", "control_modes", "faces", "file_origin"):
        assert np.array_equal(getattr(before, part), getattr(after, part)), part
    for part in ("colours", "evaluation", "coarse_faces"):
        one, other = getattr(before, part), getattr(after, part)
        assert (one is None) == (other is None), part
        assert one is None or np.array_equal(one, other), part
    assert (before.name, before.unit, before.licence) == (after.name, after.unit, after.licence)
    assert {k: s.rows() for k, s in before.schemes.items()} == {
        k: s.rows() for k, s in after.schemes.items()
    }
    if before.schemes:
        assert np.array_equal(fio.load_model(files[name]).mean, fio.load_model(target).mean)


def test_the_embedded_head_is_converted_too(capsys, tmp_path, embedded):
    printed(capsys, "models", "convert", "embedded", tmp_path / "head.npz")
    again = fio.load_model(tmp_path / "head.npz")
    assert np.array_equal(again.control_modes, embedded.control_modes)
    assert len(again.subjects) == len(embedded.subjects)


def test_install_fetches_and_load_model_finds_it(capsys, files, tmp_path, monkeypatch):
    monkeypatch.setenv("FACEAMBIG_MODELS", str(tmp_path / "models"))
    lines = ["https://example.invalid/"]
    lines += [
        f"{hashlib.sha256(file.read_bytes()).hexdigest()} 0 {file.name} {file.name}"
        for file in (files["gnm"], files["gnm"].parent / "head_sparse_68.txt")
    ]
    (tmp_path / "gnm.txt").write_text("\n".join(lines))
    monkeypatch.setattr(installing, "asset_path", lambda name: tmp_path / Path(name).name)
    address = files["gnm"].parent.as_uri()
    status, out, err = printed(capsys, "models", "install", "gnm", "--from", address)
    assert (status, err) == (0, "")
    assert out == f"gnm: installed in {tmp_path / 'models' / 'gnm'}; use it as --model gnm\n"
    _, out, _ = printed(capsys, "models", "info", "gnm", "--json")
    assert json.loads(out)["vertices"] == 120


def wrong_size() -> Drawn:
    model = gnm_head()
    model.mean[:] *= 100
    return model


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["convert", "embedded"], "convert: MODEL and FILE.npz expected, 1 words given"),
        (["convert", "embedded", "a.mat"], "convert: 'a.mat' does not end in .npz"),
        (["convert", "embedded", "/none/a.npz"], "convert: there is no folder '/none'"),
        (["convert", "{tmp}/gnm_head.npz", "{tmp}/gnm_head.npz"], "is the model itself"),
        (["convert", "none", "{tmp}/a.npz"], "none: no such file or folder"),
        (["info", "a", "b"], "info: at most one MODEL expected, 2 words given"),
        (["a", "b"], "info: at most one MODEL expected, 2 words given"),
        (["install"], "install: ict or gnm expected, 0 words given"),
        (["install", "bfm"], "model: 'bfm' cannot be installed; ict or gnm can"),
        (["install", "gnm", "--from", "ftp://x"], "address: 'ftp://x' does not begin with"),
        (["install", "gnm", "--scheme", "x"], "--scheme: goes with info, not with install"),
        (["info", "embedded", "--from", "x"], "--from: goes with install, not with info"),
        (["info", "{tmp}/gnm_head.npz"], "are 9000 mm apart, an adult's 80 to 100; times 0.01 it would fit"),
        (["info", "embedded", "--part", "ear"], "part: 'ear' is not face or head"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line(capsys, tmp_path, monkeypatch, words, said):
    monkeypatch.setenv("FACEAMBIG_MODELS", str(tmp_path / "models"))
    write_gnm(tmp_path / "gnm_head.npz", wrong_size(), gnm_rows())
    assert said in refused(capsys, "models", *(word.format(tmp=tmp_path) for word in words))
