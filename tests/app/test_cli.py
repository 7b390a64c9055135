"""The command line: what it prints, and that every bad input is one line and exit status 2."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import faceambig as fa
from commands import RECORD, printed, refused, write_pts
from faceambig.io.schemes import mesh_of_ibug68
from faceambig_app import cli, export
from faceambig_app.commands import snapshot as snapshot_command
from faceambig_app.commands import sweep as sweep_command
from faceambig_app.state import DEFAULT, FIELDS, ViewState, changed
from faceambig_app.state.forms import command, to_json
from scenes import need_renderer
from states import states

COMMANDS = ("serve", "snapshot", "fit", "sweep", "modes", "posterior", "landmarks", "models")


@pytest.fixture(scope="module")
def observation(embedded: fa.FaceModel) -> fa.Observation:
    return fa.observe(embedded.subject(2), distance=0.4, yaw_deg=10)


@pytest.fixture
def pts(tmp_path: Path, observation: fa.Observation) -> Path:
    """A landmark file as users have it; no picture beside it."""
    return write_pts(tmp_path / "face.pts", observation.points)


def test_fit_prints_the_record_of_a_program_in_metres_pixels_and_radians(
    capsys, pts, embedded, observation
):
    status, out, err = printed(
        capsys, "fit", pts, "--distance", 1.2, "--image-size", "500x500", "--json"
    )
    assert (status, err) == (0, "")
    assert out.count("\n") == 1
    record = json.loads(out)
    assert record.keys() >= RECORD | {"focal_px"}
    assert "scale" not in record
    fit = fa.fit(embedded, observation, distance=1.2)
    # the file has six digits after the point
    assert record["status"] == "converged"
    assert record["camera"] == "perspective"
    assert record["distance_m"] == pytest.approx(1.2, rel=1e-12)
    assert record["focal_px"] == pytest.approx(fit.focal, rel=1e-4)
    assert np.allclose(record["rotation"], fit.rotation, rtol=0, atol=1e-4)
    assert np.allclose(record["translation_m"], fit.translation, rtol=0, atol=1e-5)
    assert record["translation_m"][2] == record["distance_m"]
    assert len(record["alpha"]) == 70
    assert record["cost"] == pytest.approx(fit.cost, rel=1e-5)
    assert record["d_l_percent"] == pytest.approx(fit.d_l_percent, rel=1e-3)
    assert record["d_l_unit"] == fit.interocular_meaning
    assert re.fullmatch(r"\d+\.\d+\.\d+", record["version"])
    assert record["points_used"] == 68
    assert record["principal_point"] == "(250, 250), middle of the picture"
    assert record["image_size_from"] == "given"


def test_an_orthographic_fit_has_a_scale_and_no_distance(capsys, pts, embedded, observation):
    _, out, _ = printed(
        capsys, "fit", pts, "--camera", "orthographic", "--json", "--image-size", "500x500"
    )
    record = json.loads(out)
    fit = fa.fit(embedded, observation, camera="orthographic")
    assert record["camera"] == "orthographic"
    assert record["distance_m"] is None
    assert record["scale"] == pytest.approx(fit.scale, rel=1e-4)  # pixels per metre
    assert "focal_px" not in record
    assert len(record["translation_m"]) == 2


def test_flags_reach_the_fit(capsys, pts, embedded, observation):
    flags = (
        "--modes",
        20,
        "--box",
        3,
        "--prior",
        0.2,
        "--distance",
        0.5,
        "--image-size",
        "500x500",
    )
    _, out, _ = printed(capsys, "fit", pts, "--json", *flags)
    fit = fa.fit(embedded, observation, distance=0.5, modes=20, box=3, noise_percent=0.2)
    record = json.loads(out)
    assert len(record["alpha"]) == 20
    assert record["cost"] == pytest.approx(fit.cost, rel=1e-4)


def test_a_fit_without_a_distance_finds_one(capsys, pts):
    status, out, _ = printed(
        capsys, "fit", pts, "--json", "--image-size", "500x500", "--prior", 0.1
    )
    assert status == 0
    assert json.loads(out)["distance_m"] == pytest.approx(0.4, rel=0.4)  # MATH.md 2.1: errs by 20 %


def test_fit_says_in_words_what_was_assumed(capsys, pts):
    status, out, err = printed(capsys, "fit", pts, "--distance", 1.2)
    assert (status, err) == (0, "")
    assert out.startswith("converged: camera at 120 cm, landmark error d_L ")
    assert "mean of the two corners of each eye" in out
    assert "middle of the points" in out
    assert "no picture beside face.pts" in out
    _, far, _ = printed(capsys, "fit", pts, "--camera", "orthographic")
    assert "far away (orthographic)" in far


def test_missing_points_are_left_out_and_counted(capsys, tmp_path, observation):
    points = observation.points.copy()
    points[:10] = np.nan
    file = write_pts(tmp_path / "part.pts", points)
    _, out, _ = printed(capsys, "fit", file, "--json", "--image-size", "500x500")
    assert json.loads(out)["points_used"] == 58


MESH = np.random.default_rng(4).uniform(0.3, 0.7, (478, 3))


def test_what_became_of_the_points_is_said(capsys, tmp_path, observation):
    points = observation.points.copy()
    points[0] = np.nan
    points[1] = [501.5, 200]
    rows = "\n".join(f"{k},{x},{y}" for k, (x, y) in enumerate(points, start=1))
    file = tmp_path / "face.csv"
    file.write_text(f"name,x,y\n{rows}\n")
    said = "66 of 68 points used; 1 not in the file (1); 1 outside the picture (2); ibug68, pixels"
    asked = ("fit", file, "--distance", 0.4, "--image-size", "500x500")
    _, out, _ = printed(capsys, *asked)
    assert f"landmarks: {said}\n" in out
    _, out, _ = printed(capsys, *asked, "--json")
    assert (json.loads(out)["landmarks"], json.loads(out)["points_used"]) == (said, 66)
    _, out, _ = printed(capsys, "sweep", *asked[1:2], "--steps", 1, "--image-size", "500x500")
    assert f"landmarks: {said}\n" in out


def test_a_face_mesh_is_fitted_by_the_points_it_shares(capsys, tmp_path, observation):
    mesh = np.zeros((468, 3))
    for pair, point in zip(mesh_of_ibug68(), observation.points, strict=True):
        mesh[list(pair), :2] = point / 500
    landmarks = [dict(zip("xyz", point, strict=True)) for point in mesh.tolist()]
    file = tmp_path / "face.json"
    file.write_text(json.dumps({"face_landmarks": [landmarks]}))
    asked = ("fit", file, "--distance", 0.4, "--image-size", "500x500", "--json")
    status, out, _ = printed(capsys, *asked)
    record = json.loads(out)
    assert status == 0
    assert record["points_used"] == 51
    assert record["landmarks"].startswith("51 of 68 points used; 17 of the jaw, where MediaPipe's")
    assert record["landmarks"].endswith("; ibug68, fractions of the picture of 500 x 500 pixels")
    assert record["d_l_percent"] < 1


def test_models_says_what_a_model_holds(capsys, embedded):
    status, out, err = printed(capsys, "models")
    assert (status, err) == (0, "")
    assert "14159 vertices, 100 modes, 10 subjects" in out
    for scheme in embedded.schemes.values():
        assert f"scheme {scheme.name}: {len(scheme)} points; eyes: {scheme.eyes_meaning}" in out
    _, out, _ = printed(capsys, "models", "embedded", "--scheme", "farkas")
    rows = [tuple(line.split()) for line in out.splitlines()]
    assert rows == [(name, side, str(v)) for name, side, v in embedded.scheme("farkas").rows()]
    _, out, _ = printed(capsys, "models", "--json")
    record = json.loads(out)
    assert (record["name"], record["vertices"], record["modes"]) == ("embedded", 14159, 100)
    assert list(record["schemes"]) == ["ibug68", "farkas", "mediapipe"]
    first = {"name": "1", "side": "right", "vertex": int(embedded.scheme("ibug68").vertices[0])}
    assert record["schemes"]["ibug68"][0] == first
    _, out, _ = printed(capsys, "models", "--json", "--scheme", "mediapipe")
    assert list(json.loads(out)["schemes"]) == ["mediapipe"]


def test_sweep_prints_every_fit_and_the_interval(capsys, pts, embedded, observation):
    asked = ("sweep", pts, "--from", 0.3, "--to", 2.4, "--steps", 4, "--image-size", "500x500")
    status, out, err = printed(capsys, *asked, "--json")
    assert (status, err) == (0, "")
    record = json.loads(out)
    distances = [fit["distance_m"] for fit in record["fits"]]
    assert distances[:-1] == pytest.approx([0.3, 0.6, 1.2, 2.4], rel=1e-12)
    assert distances[-1] is None
    assert all(fit.keys() >= RECORD for fit in record["fits"])
    sweep = fa.sweep_distance(embedded, observation, np.geomspace(0.3, 2.4, 4))
    found = [fit["d_l_percent"] for fit in record["fits"][:-1]]
    assert found == pytest.approx(sweep.d_l_percent, rel=1e-3)
    interval = record["interval"]
    assert interval.pop("best_d_l_percent") == pytest.approx(min(found), rel=1e-12)
    assert interval == {
        "low_m": None,
        "high_m": None,
        "empty": False,
        "pieces": 1,
        "tolerance_percent": 3.0,
    }
    speeds = [fit["speed_mm_per_octave"] for fit in record["fits"]]
    assert speeds[:-1] == pytest.approx(sweep.speed_mm_per_octave(), rel=1e-3)
    assert speeds[-1] == 0  # far away the distance changes nothing
    assert record["disagreed_distances_m"] == []
    status, out, err = printed(capsys, *asked)
    assert (status, err) == (0, "")
    rows = out.splitlines()
    assert rows[0] == "distance cm   d_L %   face changes mm per doubling   status"
    table = [row.split() for row in rows[1:6]]
    assert [row[0] for row in table] == ["30", "60", "120", "240", "orthographic"]
    assert [float(row[2]) for row in table] == pytest.approx(speeds, abs=0.0051)
    assert {row[3] for row in table} == {"converged"}
    assert "d_L stays under 3 % from the nearest tried to infinity" in out


@pytest.mark.parametrize(
    ("interval", "words"),
    [
        (
            fa.Interval(None, None, True, 4.25, 3.0),
            "no distance brings d_L under 3 %: the best is 4.25 %",
        ),
        (fa.Interval(0.31, 1.5, False, 0.2, 0.5), "d_L stays under 0.5 % from 31 cm to 150 cm"),
        (fa.Interval(None, 1.5, False, 0.2, 3.0), "from the nearest tried to 150 cm"),
        (fa.Interval(0.31, None, False, 0.2, 3.0), "from 31 cm to infinity: within"),
        (
            fa.Interval(0.31, 0.5, False, 0.2, 3.0, 2),
            "to 50 cm (2 such ranges; this one holds the best): within",
        ),
    ],
)
def test_an_interval_is_a_sentence(interval, words):
    assert words in sweep_command.interval_words(interval)


@pytest.mark.parametrize("command", ["fit", "sweep"])
@pytest.mark.parametrize("flags", [[], ["--json"]])
def test_a_fit_that_does_not_converge_is_exit_status_one(capsys, pts, monkeypatch, command, flags):
    for name in ("fit", "sweep_distance"):
        real = getattr(fa, name)
        monkeypatch.setattr(
            fa, name, lambda *a, real=real, **options: real(*a, **options, max_steps=1)
        )
    status, out, err = printed(capsys, command, pts, "--image-size", "500x500", *flags)
    assert status == 1
    assert err == ""
    assert "step limit reached" in out


def test_a_sweep_says_where_its_two_directions_disagree(capsys, pts, monkeypatch):
    real = fa.sweep_distance
    monkeypatch.setattr(
        fa, "sweep_distance",
        lambda *a, **options: replace(real(*a, **options), disagreed=np.array([0.3, np.inf])),
    )  # fmt: skip
    asked = ("sweep", pts, "--from", 0.3, "--to", 0.6, "--steps", 2, "--image-size", "500x500")
    _, out, _ = printed(capsys, *asked, "--json")
    assert json.loads(out)["disagreed_distances_m"] == [0.3, None]
    _, out, _ = printed(capsys, *asked)
    assert "at 2 distances another fit came from the other side; the lower cost is kept" in out


@pytest.mark.parametrize("command", ["fit", "sweep"])
def test_without_the_flag_the_modes_are_those_the_model_has(
    capsys, pts, monkeypatch, embedded, command
):
    monkeypatch.setattr(fa, "load_model", lambda _: embedded.truncate(12))
    asked = (command, pts, "--json", "--image-size", "500x500")
    status, out, _ = printed(capsys, *asked)
    assert status == 0
    record = json.loads(out)
    fits = record["fits"] if command == "sweep" else [record]
    assert {len(fit["alpha"]) for fit in fits} == {12}
    assert "modes: 13 of a model with 12; give at most 12" in refused(capsys, *asked, "--modes", 13)


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[tuple[ViewState, str, dict[str, Any]]]:
    """What a snapshot would be drawn of, without a renderer."""
    calls: list[tuple[ViewState, str, dict[str, Any]]] = []
    monkeypatch.setattr(
        export, "snapshot", lambda state, path, **size: calls.append((state, path, size))
    )
    return calls


def test_a_snapshot_is_of_the_state_of_its_flags(capsys, tmp_path, drawn):
    out = tmp_path / "a.png"
    flags = [
        "--subject",
        3,
        "--actual",
        0.4,
        "--distance",
        2,
        "--yaw",
        -12.5,
        "--view",
        "side",
        "--seed",
        5,
    ]
    size = ["--width", 640, "--height", 480]
    assert printed(capsys, "snapshot", "--out", out, *flags, *size) == (0, "", "")
    state = changed(DEFAULT, subject=3, actual=0.4, distance=2.0, yaw=-12.5, view="side", seed=5)
    assert drawn == [(state, str(out), {"width": 640, "height": 480})]
    assert printed(capsys, "snapshot", "--out", out)[0] == 0
    assert drawn[1] == (DEFAULT, str(out), {"width": None, "height": None})


# Of each field a value as people write it, and the state it gives
WRITTEN: dict[str, tuple[str, dict[str, Any]]] = {
    "model": ("faces/mine.npz", {"model": "faces/mine.npz"}),
    "subject": ("photo", {"subject": "photo"}),
    "actual": ("0.2", {"actual": 0.2}),
    "distance": ("3", {"distance": 3.0}),
    "camera": ("orthographic", {"camera": "orthographic"}),
    "yaw": ("-60", {"yaw": -60.0}),
    "pitch": ("-1e1", {"pitch": -10.0}),
    "roll": ("45", {"roll": 45.0}),
    "scheme": ("farkas", {"scheme": "farkas"}),
    "data": ("dense", {"data": "dense"}),
    "noise": ("0.5", {"noise": 0.5}),
    "seed": ("9999", {"seed": 9999}),
    "modes": ("10", {"modes": 10}),
    "prior": ("0.01", {"prior": 0.01}),
    "box": ("4", {"box": 4.0}),
    "flex": ("-3.5", {"flex": ((1, -3.5),)}),
    "flex_at": ("dlt", {"flex_at": "dlt"}),
    "draw": ("0", {"draw": 0}),
    "extreme": ("2", {"extreme": 2}),
    "flex_from": ("4", {"flex_from": 4}),
    "show": ("row", {"show": "row"}),
    "surface": ("spread", {"surface": "spread"}),
    "view": ("side", {"view": "side"}),
    "orbit": ("-30,10.5", {"orbit": (-30.0, 10.5)}),
    "zoom": ("0.5", {"zoom": 0.5}),
    "overlays": ("rays,names", {"overlays": ("names", "rays")}),
    "error_scale": ("20", {"error_scale": 20}),
    "fade": ("1", {"fade": 1.0}),
    "hide": ("truth", {"hide": ("truth",)}),
    "pins": (
        "default..distance:0.6,flex:1:3,flex:2:-4",
        {"pins": (DEFAULT, changed(DEFAULT, distance=0.6, flex=[(1, 3.0), (2, -4.0)]))},
    ),
    "lesson": ("2", {"lesson": 2}),
    "step": ("3", {"step": 3}),
    "theme": ("dark", {"theme": "dark"}),
    "lang": ("de", {"lang": "de"}),
    "text": ("1.25", {"text": 1.25}),
}


def test_pins_are_named_by_a_flag(capsys, tmp_path, drawn):
    pins, out = "--pins=default..distance:0.6", ("--out", tmp_path / "a.png")
    assert printed(capsys, "snapshot", *out, pins, "--pin-names", "N\u00e4her, 50%25,Far")[0] == 0
    names = drawn[0][0].pin_names
    assert names == ("N\u00e4her", "50%")  # one more than there are pins means nothing
    status, *_, error = printed(capsys, "snapshot", *out, pins, "--pin-names", "x" * 31)
    assert status == 2
    assert "pin_names: 'xxx" in error


@pytest.mark.parametrize("name", [name for name in FIELDS if name != "pin_names"])
def test_every_field_of_the_state_is_a_flag(capsys, tmp_path, drawn, name):
    field = FIELDS[name]
    text, values = WRITTEN[name]
    status, *_ = printed(capsys, "snapshot", "--out", tmp_path / "a.png", f"{field.flag}={text}")
    assert status == 0
    assert drawn[0][0] == changed(DEFAULT, **values) != DEFAULT


def test_a_saved_state_is_drawn_and_flags_change_it(capsys, tmp_path, drawn):
    state = changed(DEFAULT, subject=3, distance=0.6123456789, flex=[(2, -1.0)])
    (tmp_path / "s.json").write_text(to_json(state))
    asked = ("snapshot", "--out", tmp_path / "a.png", "--state", tmp_path / "s.json")
    assert printed(capsys, *asked)[0] == printed(capsys, *asked, "--flex", "none")[0] == 0
    assert [call[0] for call in drawn] == [state, changed(state, flex=())]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ('{"distance": 9}', "s.json: distance: 9 is not within 0.2 to 3 m"),
        ('{"colour": 1}', "s.json: Object contains unknown field `colour`"),
        ("no", "s.json: state: not JSON (Input data was truncated)"),
        ('{"v": 2, "spin": 1}', "s.json: v: 2 is not the format that this program reads (1)"),
        (" " * 70000, "s.json: state: longer than 65536 characters"),
    ],
)
def test_a_file_that_is_no_state_is_refused_by_name(capsys, tmp_path, content, words):
    (tmp_path / "s.json").write_text(content)
    asked = ("snapshot", "--out", tmp_path / "a.png", "--state", tmp_path / "s.json")
    assert words in refused(capsys, *asked)


@settings(max_examples=50)
@given(states(), st.text(min_size=1, max_size=20).filter(lambda name: "\0" not in name))
def test_the_command_of_a_state_gives_it_back(state, out):
    with pytest.MonkeyPatch.context() as patch:
        calls: list[Any] = []
        patch.setattr(snapshot_command, "run", lambda options: calls.append(options) or 0)
        program, *arguments = shlex.split(command(state, out))
        assert program == "faceambig"
        assert cli.main(arguments) == 0
    assert snapshot_command.state_of(calls[0]) == state
    assert calls[0].out == out


def test_serve_is_given_host_and_port(capsys, monkeypatch):
    import faceambig_app.server

    asked: list[tuple[str, int]] = []
    monkeypatch.setattr(faceambig_app.server, "serve", lambda *place, **_: asked.append(place) or 0)
    monkeypatch.setattr(os, "_exit", sys.exit)  # the end of a whole process, which this one is not
    assert printed(capsys, "serve", "--port", 0)[0] == 0
    assert printed(capsys, "serve", "--host", "::1")[0] == 0
    assert asked == [("127.0.0.1", 0), ("::1", 8080)]


def test_interrupted_is_exit_status_130(capsys, pts, monkeypatch):
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(fa, "fit", interrupt)
    assert printed(capsys, "fit", pts) == (130, "", "")


@pytest.mark.parametrize("command", COMMANDS)
def test_help_mentions_every_flag_with_words(capsys, command):
    status, out, err = printed(capsys, command, "--help")
    assert (status, err) == (0, "")
    flags = cli.parser()._subparsers._group_actions[0].choices[command]._actions  # pyright: ignore
    assert len(flags) > 2
    for action in flags:
        assert action.help
        assert "%(" not in out
        for name in action.option_strings or [action.metavar]:
            assert re.search(rf"(?<![\w-]){re.escape(name)}(?![\w-])", out), name
    assert "%%" not in out


def test_help_lists_every_command(capsys):
    status, out, _ = printed(capsys, "--help")
    assert status == 0
    assert all(re.search(rf"^\s+{command}\s+\w", out, re.MULTILINE) for command in COMMANDS)


# Each: the arguments, and what the line must name. {pts} a good file, {tmp} a folder
BAD: dict[str, tuple[list[str], str]] = {
    "no command": ([], "COMMAND"),
    "unknown command": (["fitt"], "fitt"),
    "unknown flag": (["fit", "{pts}", "--colour", "red"], "--colour"),
    "no file": (["fit"], "FILE"),
    "missing file": (["fit", "{tmp}/none.pts"], "none.pts"),
    "a folder for a file": (["fit", "{tmp}"], "Is a directory"),
    "not a landmark file": (["fit", "{tmp}/words.pts"], "words.pts: not a landmark file"),
    "damaged file": (["fit", "{tmp}/damaged.pts"], "line 6 of damaged.pts: expected two numbers, found '3 x'"),
    "cut file": (["sweep", "{tmp}/cut.pts"], "cut.pts: ends before }"),
    "five points": (["fit", "{tmp}/five.pts"], "points: 5 visible; 6 are needed"),
    "points on a line": (["fit", "{tmp}/line.pts"], "points: they lie on one line"),
    "empty file": (["fit", "{tmp}/empty.json"], "empty.json: empty"),
    "cut JSON": (["fit", "{tmp}/cut.json"], "line 2 of cut.json: not JSON (Expecting value, column 10)"),
    "damaged table": (["sweep", "{tmp}/damaged.csv"], "line 3 of damaged.csv: expected two numbers, found '3 x'"),
    "other counts": (["fit", "{tmp}/seven.json"], "seven.json: 7 points without names; 68 or 51 (iBUG), 468 or 478"),
    "fractions of what": (["fit", "{tmp}/mesh.json"], "give its size (--image-size 640x480)"),
    "a picture too small": (["fit", "{pts}", "--image-size", "90x500"], "the picture has 90 x 500 (given); is it"),
    "a face outside": (["fit", "{tmp}/outside.csv", "--image-size", "500x500"], "68 outside the picture (1 to 68)"),
    "names no model knows": (["fit", "{tmp}/warts.csv"], "8 without a vertex in scheme farkas of embedded (wart0, "),
    "unknown scheme": (["models", "--scheme", "ibug"], "unknown scheme 'ibug': this model has ibug68, farkas or"),
    "models of none": (["models", "none"], "none: no such file or folder"),
    "unknown model": (["fit", "{pts}", "--model", "none"], "none: no such file or folder"),
    "a model that is none": (["fit", "{pts}", "--model", "{pts}"], "face.pts: not a model"),
    "distance near": (["fit", "{pts}", "--distance", "0.1"], "distance: 0.1 m is not within 0.2"),
    "distance negative": (["fit", "{pts}", "--distance", "-1"], "distance: -1 m"),
    "distance NaN": (["fit", "{pts}", "--distance", "nan"], "distance: nan m"),
    "distance abc": (["fit", "{pts}", "--distance", "abc"], "'abc'"),
    "distance far and orthographic": (["fit", "{pts}", "--camera", "orthographic", "--distance", "1"], "distance: "),
    "camera": (["fit", "{pts}", "--camera", "fisheye"], "camera: 'fisheye'"),
    "modes": (["fit", "{pts}", "--modes", "0"], "modes: 0"),
    "modes more": (["fit", "{pts}", "--modes", "200"], "modes: 200 of a model with 100; give at most 100"),
    "modes more, sweep": (["sweep", "{pts}", "--modes", "101"], "modes: 101 of a model with 100"),
    "modes words": (["fit", "{pts}", "--modes", "all"], "'all'"),
    "modes half": (["fit", "{pts}", "--modes", "7.5"], "'7.5'"),
    "modes of 5000 digits": (["fit", "{pts}", "--modes", "9" * 5000], "--modes"),
    "modes of 400 digits": (["fit", "{pts}", "--modes", "9" * 400], "modes: 999"),
    "box zero": (["fit", "{pts}", "--box", "0"], "box: 0 is not within"),
    "box infinity": (["sweep", "{pts}", "--box", "inf"], "box: inf is not within"),
    "box words": (["fit", "{pts}", "--box", "none"], "'none'"),
    "prior NaN": (["fit", "{pts}", "--prior", "nan"], "noise_percent: nan"),
    "prior zero": (["fit", "{pts}", "--prior", "0"], "noise_percent: 0 is not within"),
    "distance infinity": (["fit", "{pts}", "--distance", "inf"], "distance: inf m is not within"),
    "distance zero": (["fit", "{pts}", "--distance", "0"], "distance: 0 m is not within"),
    "distance of 400 digits": (["fit", "{pts}", "--distance", "9" * 400], "distance: inf m"),
    "points at one place": (["fit", "{tmp}/place.pts"], "points: 68 visible, but at only 1 different places"),
    "points at five places": (["sweep", "{tmp}/places.pts"], "points: 68 visible, but at only 5 different"),
    "points at infinity": (["fit", "{tmp}/infinite.pts"], "infinite.pts"),
    "points far out": (["fit", "{tmp}/far.pts"], "points: 1e+200 is not within 1e+09 pixels"),
    "points all missing": (["sweep", "{tmp}/missing.pts"], "points: 0 visible; 6 are needed"),
    "image size huge": (["fit", "{pts}", "--image-size", "9999999999x480"], "image_size: 1e+10 is not within"),
    "box NaN": (["fit", "{pts}", "--box", "nan"], "box: nan"),
    "prior": (["sweep", "{pts}", "--prior", "-1"], "noise_percent: -1"),
    "image size words": (["fit", "{pts}", "--image-size", "big"], "--image-size: 'big' is not like 640x480"),
    "image size half": (["fit", "{pts}", "--image-size", "640x"], "'640x'"),
    "image size zero": (["fit", "{pts}", "--image-size", "0x480"], "'0x480'"),
    "image size negative": (["fit", "{pts}", "--image-size=-640x480"], "'-640x480'"),
    "image size in odd digits": (["fit", "{pts}", "--image-size", "6²x480"], "--image-size: '6²x480' is not like"),
    "sweep backwards": (["sweep", "{pts}", "--from", "2", "--to", "1"], "--from 2 --to 1"),
    "sweep near": (["sweep", "{pts}", "--from", "0.1"], "--from 0.1"),
    "sweep NaN": (["sweep", "{pts}", "--to", "nan"], "--to nan"),
    "sweep infinity": (["sweep", "{pts}", "--to", "inf"], "--to inf"),
    "sweep far": (["sweep", "{pts}", "--to", "1e9"], "1e+09"),
    "no steps": (["sweep", "{pts}", "--steps", "0"], "--steps 0"),
    "too many steps": (["sweep", "{pts}", "--steps", "100000"], "--steps 100000"),
    "half a step": (["sweep", "{pts}", "--steps", "1.5"], "'1.5'"),
    "no out": (["snapshot"], "--out"),
    "unknown subject": (["snapshot", "--out", "{tmp}/a.png", "--subject", "11"], "subject: 11 is not within 1 to 10"),
    "subject nobody": (["snapshot", "--out", "{tmp}/a.png", "--subject", "me"], "subject: 'me' is not a whole number"),
    "subject of 400 digits": (["snapshot", "--out", "{tmp}/a.png", "--subject", "9" * 400], "subject: "),
    "snapshot distance": (["snapshot", "--out", "{tmp}/a.png", "--distance", "9"], "distance: 9 is not within 0.2 to"),
    "snapshot NaN": (["snapshot", "--out", "{tmp}/a.png", "--actual", "nan"], "actual: nan"),
    "snapshot abc": (["snapshot", "--out", "{tmp}/a.png", "--yaw", "abc"], "yaw: 'abc' is not a number"),
    "snapshot view": (["snapshot", "--out", "{tmp}/a.png", "--view", "below"], "view: 'below' is not front or"),
    "snapshot model": (["snapshot", "--out", "{tmp}/a.png", "--model", "none"], "none: no such file"),
    "no folder": (["snapshot", "--out", "{tmp}/none/a.png"], "out: there is no folder"),
    "out is a folder": (["snapshot", "--out", "{tmp}"], "is a folder, not a file"),
    "width": (["snapshot", "--out", "{tmp}/a.png", "--width", "5"], "width, height: 5 is not within"),
    "width words": (["snapshot", "--out", "{tmp}/a.png", "--width", "wide"], "'wide'"),
    "port words": (["serve", "--port", "http"], "'http'"),
    "port": (["serve", "--port", "99999"], "port 99999: must be from 0 to 65535"),
    "host": (["serve", "--host", "192.0.2.1"], "port 8080 at 192.0.2.1: "),
    "host name": (["serve", "--host", "nowhere.example"], "host 'nowhere.example'"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_one_line_and_exit_status_two(capsys, tmp_path, pts, observation, name):
    (tmp_path / "words.pts").write_text("hello\n")
    (tmp_path / "empty.json").write_text("\n")
    (tmp_path / "cut.json").write_text('{"points": [\n[1, 2], [')
    (tmp_path / "damaged.csv").write_text("x,y\n1,2\n3,x\n")
    (tmp_path / "seven.json").write_text(json.dumps([[k, k * k] for k in range(9, 16)]))
    (tmp_path / "mesh.json").write_text(json.dumps(MESH.tolist()))
    outside = "".join(f"{x + 900},{y}\n" for x, y in observation.points)
    (tmp_path / "outside.csv").write_text(f"x,y\n{outside}")
    warts = "".join(f"wart{k},{k},{k * k}\n" for k in range(8))
    (tmp_path / "warts.csv").write_text(f"name,x,y\n{warts}")
    lines = pts.read_text().splitlines()
    (tmp_path / "damaged.pts").write_text("\n".join([*lines[:5], "3 x", *lines[6:]]))
    (tmp_path / "cut.pts").write_text("\n".join(lines[:30]))
    five = np.where(np.arange(68)[:, None] < 5, observation.points, np.nan)
    write_pts(tmp_path / "five.pts", five)
    write_pts(tmp_path / "place.pts", np.full((68, 2), 250.0))
    write_pts(tmp_path / "places.pts", observation.points[np.arange(68) % 5])
    write_pts(tmp_path / "infinite.pts", np.where(np.eye(68, 2) > 0, np.inf, observation.points))
    write_pts(tmp_path / "far.pts", np.where(np.eye(68, 2) > 0, 1e200, observation.points))
    write_pts(tmp_path / "missing.pts", np.full((68, 2), np.nan))
    write_pts(tmp_path / "line.pts", np.outer(np.arange(68.0), [3, 1]) + 100)
    arguments, words = BAD[name]
    filled = [
        argument.replace("{pts}", str(pts)).replace("{tmp}", str(tmp_path))
        for argument in arguments
    ]
    assert words in refused(capsys, *filled)
    assert not (tmp_path / "a.png").exists()


@pytest.mark.gl
def test_a_snapshot_is_a_picture_that_carries_its_state(capsys, tmp_path):
    need_renderer()
    files = [tmp_path / "a.png", tmp_path / "b.png"]
    for file in files:
        asked = ("--out", file, "--subject", 3, "--distance", 0.6, "--width", 480, "--height", 300)
        assert printed(capsys, "snapshot", *asked) == (0, "", "")
    picture = files[0].read_bytes()
    assert picture.startswith(b"\x89PNG")
    assert int.from_bytes(picture[16:20]) == 480
    assert int.from_bytes(picture[20:24]) == 300
    assert b'{"subject":3,"distance":0.6}' in picture
    assert files[1].read_bytes() == picture  # the same state, the same bytes
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.png", "b.png"]


def test_the_installed_command_says_the_same_as_main(pts):
    # through the interpreter: warnings and tracebacks of a real run would show on stderr
    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        code = "import sys; from faceambig_app.cli import main; sys.exit(main())"
        return subprocess.run(
            [sys.executable, "-c", code, *arguments], capture_output=True, text=True
        )

    good = run("fit", str(pts), "--distance", "0.6", "--json")
    assert (good.returncode, good.stderr) == (0, "")
    assert json.loads(good.stdout)["status"] == "converged"
    bad = run("sweep", str(pts), "--to", "inf")
    assert bad.returncode == 2
    assert bad.stderr.count("\n") == 1


def test_errors_are_put_on_one_line():
    one: Callable[[BaseException], str] = cli.one_line
    assert one(ValueError("a\n  b\tc")) == "a b c"
    assert one(OSError(13, "Permission denied", "x.pts")) == "x.pts: Permission denied"
    assert one(RuntimeError()) == "RuntimeError"


def test_a_reader_that_has_enough_is_no_error():
    code = "from faceambig_app.cli import main; import sys; sys.exit(main())"
    pipe, asked = subprocess.PIPE, ("models", "--scheme", "ibug68")
    with subprocess.Popen(
        [sys.executable, "-c", code, *asked], stdout=pipe, stderr=pipe
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 141
