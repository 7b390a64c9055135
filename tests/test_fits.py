"""Saved fits: read as they were, without fitting again; damaged ones and those of another model are refused."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import faceambig as fa
from faceambig.fitting import task
from faceambig.io.fits import encode_fit, is_fit


@pytest.fixture(scope="module")
def observation(embedded: fa.FaceModel) -> fa.Observation:
    seen = fa.observe(embedded.subject(2), distance=0.4, yaw_deg=10, noise_percent=1, seed=3)
    points = seen.points.copy()
    points[3] = np.nan
    weights = np.linspace(0.5, 2.0, len(points))
    return fa.Observation(points, "ibug68", (500, 480), (251.25, 239.0), weights)


@pytest.fixture(scope="module")
def fit(embedded: fa.FaceModel, observation: fa.Observation) -> fa.Fit:
    return fa.fit(embedded, observation, modes=40, box=1.5, noise_percent=0.7)


def same(read: fa.Fit, fit: fa.Fit) -> None:
    """To the last bit: JSON writes all digits, and what is computed is computed from the same numbers."""
    assert np.array_equal(read.vertices(), fit.vertices())
    assert np.array_equal(read.projected(), fit.projected())
    assert np.array_equal(read.residual, fit.residual, equal_nan=True)
    assert np.array_equal(read.observation.points, fit.observation.points, equal_nan=True)
    for name in ("R", "t", "s", "kappa"):
        assert np.array_equal(getattr(read.camera, name), getattr(fit.camera, name))
    for name in ("d_l_percent", "cost", "steps", "status", "options", "prior_weight", "distance",
                 "interocular_px", "interocular_meaning"):  # fmt: skip
        assert getattr(read, name) == getattr(fit, name), name
    for name in ("image_size", "principal_point"):
        assert getattr(read.observation, name) == getattr(fit.observation, name)


def test_a_saved_fit_is_read_as_it_was(embedded, fit, tmp_path, monkeypatch):
    fa.save_fit(fit, tmp_path / "fit.json", {"words": "for people"})
    assert json.loads((tmp_path / "fit.json").read_text())["words"] == "for people"
    assert [path.name for path in tmp_path.iterdir()] == ["fit.json"]
    monkeypatch.setattr(task, "solve_by", lambda *_, **__: pytest.fail("fitted again"))
    read = fa.load_fit(tmp_path / "fit.json", embedded)
    same(read, fit)
    assert read.observation.weights is not None
    assert np.array_equal(read.observation.weights, fit.observation.weights)
    assert encode_fit(read) == encode_fit(fit)


def test_without_a_model_the_one_it_names_is_loaded(fit, tmp_path):
    fa.save_fit(fit, tmp_path / "fit.json")
    same(fa.load_fit(tmp_path / "fit.json"), fit)


@pytest.mark.parametrize(
    "asked", [{"camera": "orthographic"}, {"distance": 0.6, "max_steps": 1}, {"method": "snls"}]
)
def test_any_camera_and_any_end_survive(embedded, observation, tmp_path, asked):
    fit = fa.fit(embedded, observation, **asked)
    fa.save_fit(fit, tmp_path / "fit.json")
    read = fa.load_fit(tmp_path / "fit.json", embedded)
    same(read, fit)
    assert read.converged == ("max_steps" not in asked)


def test_vertex_numbers_instead_of_a_scheme_survive(embedded, tmp_path):
    vertices = embedded.scheme("ibug68").vertices
    points = fa.observe(embedded.subject(3), distance=1.0).points
    fit = fa.fit(embedded, fa.Observation(points, vertices), distance=1.0)
    fa.save_fit(fit, tmp_path / "fit.json")
    same(fa.load_fit(tmp_path / "fit.json", embedded), fit)


def test_another_model_has_another_fit(ict, observation, tmp_path):
    fit = fa.fit(ict, observation, distance=0.5)
    fa.save_fit(fit, tmp_path / "fit.json")
    same(fa.load_fit(tmp_path / "fit.json", ict), fit)


def changed(record: dict[str, Any], where: str, value: Any) -> dict[str, Any]:
    record = json.loads(json.dumps(record))
    *path, last = where.split(".")
    part = record
    for name in path:
        part = part[name]
    if value is None:
        del part[last]
    else:
        part[last] = value
    return record


# Each: where in the file, what is put there (None: left out), and what the line must say
BAD: dict[str, tuple[str, Any, str]] = {
    "other format": ("format", "a letter", "not a saved fit; save one with faceambig fit --out"),
    "newer": ("format_version", 2, "a saved fit of format 2, this program reads 1"),
    "nothing": ("saved", None, "a damaged saved fit: saved: expected model, "),
    "no camera": ("saved.camera", None, "saved: expected model, observation, options, camera"),
    "other model": ("saved.model.name", "basel", "made with model 'basel' of 14159 vertices"),
    "other size": ("saved.model.vertices", 7, "of 7 vertices and 100 modes; this one is 'embedded' of 14159"),
    "short alpha": ("saved.alpha", [0.0] * 39, "alpha: expected shape (40), found (39,)"),
    "alpha of words": ("saved.alpha", ["a"] * 40, "alpha: expected numbers"),
    "alpha beyond": ("saved.alpha", [1.6] * 40, "alpha: 1.6 is outside the box of 1.5"),
    "another face": ("saved.alpha", [0.5] * 40, "cost: "),
    "flat camera": ("saved.camera.t", [0.0], "t: expected shape (2), found (1,)"),
    "mirrored": ("saved.camera.R", [[1, 0, 0], [0, 1, 0], [0, 0, -1]], "R: not a rotation"),
    "no scale": ("saved.camera.s", 0, "s: 0 pixels per metre is not above 0"),
    "behind": ("saved.camera.kappa", -1, "kappa: -1 per metre is not within 0 to 50"),
    "in the face": ("saved.camera.kappa", 49, "camera: a point of the face lies behind it"),
    "points cut": ("saved.observation.points", [[1, 2]] * 67, "weights: expected shape (67), found (68,)"),
    "points in one place": ("saved.observation.points", [[1, 2]] * 68, "visible, but at only 1 different"),
    "points of three": ("saved.observation.points", [[1, 2, 3]] * 68, "points: expected shape (n, 2)"),
    "no points": ("saved.observation.points", "none", "points: 'none' is not a list"),
    "size": ("saved.observation.image_size", [500], "image_size: [500] is not two numbers"),
    "size half": ("saved.observation.image_size", [500.5, 3], "image_size: 500.5 is not a whole number"),
    "scheme": ("saved.observation.scheme", "nose", "unknown scheme 'nose'"),
    "weights": ("saved.observation.weights", [1, 2], "weights: expected shape (68)"),
    "option": ("saved.options.box", -1, "box: -1 is not within 0 to 10"),
    "option of another": ("saved.options.speed", 9, "options: expected modes, box"),
    "status": ("saved.status", "fine", "status: 'fine' is none of a fit"),
    "cost": ("saved.cost", 1.0, "cost: 1 in the file, "),
    "cost of words": ("saved.cost", "low", "cost: 'low' is not a number"),
    "steps": ("saved.steps", -3, "steps: -3 is negative"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_a_damaged_fit_is_refused_in_one_line(embedded, fit, tmp_path, name):
    where, value, words = BAD[name]
    path = tmp_path / "fit.json"
    path.write_text(json.dumps(changed(json.loads(encode_fit(fit)), where, value)))
    with pytest.raises(fa.AssetError, match=re.escape(words)) as refused:
        fa.load_fit(path, embedded)
    assert str(refused.value).startswith("fit.json: ")
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 300


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (b'"cost": ', b'"cost": NaN, "was": ', "NaN is not a number of JSON"),
        (b'"kappa": ', b'"kappa": Infinity, "was": ', "Infinity is not a number of JSON"),
        (b'"alpha"', b'"alpha', "a damaged file, no JSON"),
        (b'"format"', b"\xff\xfe", "not a text file"),
    ],
)
def test_what_is_no_json_is_refused_in_one_line(embedded, fit, tmp_path, old, new, words):
    path = tmp_path / "fit.json"
    path.write_bytes(encode_fit(fit).replace(old, new, 1))
    with pytest.raises(fa.AssetError, match=words):
        fa.load_fit(path, embedded)


def test_a_file_cut_off_is_still_known_for_a_fit(embedded, fit, tmp_path):
    path = tmp_path / "fit.json"
    path.write_bytes(encode_fit(fit)[:2000])
    assert is_fit(path)
    with pytest.raises(fa.AssetError, match="a damaged file, no JSON"):
        fa.load_fit(path, embedded)
    path.write_text(json.dumps({"points": [[1, 2]]}))
    assert not is_fit(path)
    assert not is_fit(tmp_path / "none.json")
    with pytest.raises(fa.AssetError, match="no such file"):
        fa.load_fit(tmp_path / "none.json", embedded)


def test_a_model_that_is_not_found_by_its_name_must_be_given(fit, tmp_path):
    path: Path = tmp_path / "fit.json"
    path.write_text(json.dumps(changed(json.loads(encode_fit(fit)), "saved.model.name", "mine")))
    with pytest.raises(fa.AssetError, match="made with model 'mine'; give that model"):
        fa.load_fit(path)
