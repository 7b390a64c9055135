"""What a photograph leaves open, on the command line: inputs, modes, posterior, tables, pictures, interruptions."""

from __future__ import annotations

import csv
import json
import math
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import faceambig as fa
from commands import RECORD, printed, refused, write_pts
from faceambig.io.fits import encode_fit
from faceambig.metrics import surface_difference
from faceambig_app.commands import progress
from faceambig_app.files import write_pairs
from faceambig_app.reports import photo, sheets
from scenes import need_renderer

VIEW = ("--subject", 2, "--actual", 0.4, "--yaw", 10)
COMMANDS = ("sweep", "modes", "posterior")


@pytest.fixture(scope="module")
def observation(embedded: fa.FaceModel) -> fa.Observation:
    return fa.observe(embedded.subject(2), distance=0.4, yaw_deg=10)


@pytest.fixture(scope="module")
def fit(embedded: fa.FaceModel, observation: fa.Observation) -> fa.Fit:
    return fa.fit(embedded, observation, distance=0.6)


@pytest.fixture(autouse=True)
def loaded_once(embedded: fa.FaceModel, monkeypatch: pytest.MonkeyPatch) -> None:
    """The embedded model without reading it at each command; subjects come from the same one."""
    load = fa.load_model
    monkeypatch.setattr(
        fa, "load_model", lambda name: embedded if name == "embedded" else load(name)
    )
    monkeypatch.setattr("faceambig.io.load_model", fa.load_model)


@pytest.fixture
def saved(tmp_path: Path, fit: fa.Fit) -> Path:
    fa.save_fit(fit, tmp_path / "fit.json")
    return tmp_path / "fit.json"


def record_of(capsys: Any, *arguments: object) -> dict[str, Any]:
    status, out, err = printed(capsys, *arguments, "--json")
    assert (status, err) == (0, ""), err
    assert out.count("\n") == 1
    return json.loads(out)


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


# ---- inputs ----


def test_a_subject_is_photographed_as_the_library_does(capsys, embedded):
    asked = (
        "--subject",
        3,
        "--actual",
        0.5,
        "--pitch",
        -7.5,
        "--scheme",
        "farkas",
        "--noise",
        1,
        "--seed",
        4,
    )
    record = record_of(capsys, "fit", *asked, "--distance", 0.8, "--modes", 30, "--prior", 2)
    seen = fa.observe(
        embedded.subject(3), distance=0.5, pitch_deg=-7.5, scheme="farkas", noise_percent=1, seed=4
    )
    fit = fa.fit(embedded, seen, distance=0.8, modes=30, noise_percent=2)
    assert record["alpha"] == fit.alpha.tolist()
    assert record["cost"] == fit.cost
    assert record["landmarks"] == (
        f"{len(seen.points)} points of synthetic {embedded.subject(3).name}, taken from 50 cm; farkas, "
        "noise of 1 %, seed 4"
    )


def test_a_photograph_of_a_subject_is_painted_and_its_fit_gone_on_from(
    capsys, tmp_path, embedded, observation
):
    folder = tmp_path / "out"
    first = record_of(capsys, "fit", *VIEW, "--distance", 0.6, "--out", folder)
    assert sorted(path.name for path in folder.iterdir()) == sorted(photo.NAMES)
    painted = cv2.imread(str(folder / "overlay.png"))
    assert painted is not None
    assert painted.std() > 20
    fit = fa.load_fit(folder / "fit.json", embedded)
    assert fit.alpha.tolist() == first["alpha"]
    assert json.loads((folder / "fit.json").read_text())["d_l_percent"] == fit.d_l_percent
    again = record_of(capsys, "modes", folder / "fit.json", "--count", 1)
    assert again["fit"]["alpha"] == first["alpha"]
    assert again["fit"]["d_l_percent"] == first["d_l_percent"]
    assert again["landmarks"] == "68 of 68 points, saved with the fit; ibug68, pixels"


@pytest.mark.parametrize("command", COMMANDS)
def test_points_a_photograph_and_a_saved_fit_say_the_same(
    capsys, tmp_path, observation, command, fit
):
    """Of the same points: to the six digits that the file of points has."""
    small = {
        "sweep": ("--steps", 2),
        "modes": ("--distance", 0.6, "--count", 1),
        "posterior": ("--steps", 6),
    }
    cv2.imwrite(str(tmp_path / "face.png"), np.full((500, 500, 3), 90, np.uint8))
    (tmp_path / "apart").mkdir()
    points = write_pts(tmp_path / "apart" / "points.pts", observation.points)
    fa.save_fit(fit, tmp_path / "fit.json")
    said = [
        record_of(capsys, command, points, "--image-size", "500x500", *small[command]),
        record_of(capsys, command, tmp_path / "face.png", "--landmarks", points, *small[command]),
        record_of(capsys, command, tmp_path / "fit.json", *(small[command][-2:])),
        record_of(capsys, command, *VIEW, *small[command]),
    ]
    for record in said:
        match command:
            case "sweep":
                numbers = [each["d_l_percent"] for each in record["fits"]]
                expected = [each["d_l_percent"] for each in said[-1]["fits"]]
            case "modes":
                numbers, expected = record["modes"][0]["reach_mm"], said[-1]["modes"][0]["reach_mm"]
            case _:
                numbers, expected = record["most_probable_m"], said[-1]["most_probable_m"]
        assert numbers == pytest.approx(expected, rel=1e-3)
        assert record["points_used"] == 68


def test_a_saved_fit_keeps_its_assumptions_unless_a_flag_says_otherwise(
    capsys, tmp_path, embedded, observation
):
    made = fa.fit(embedded, observation, distance=0.6, modes=20, box=3.0, noise_percent=0.5)
    fa.save_fit(made, tmp_path / "fit.json")
    asked = ("sweep", tmp_path / "fit.json", "--from", 0.6, "--to", 0.6, "--steps", 1)
    record = record_of(capsys, *asked)
    assert record["fits"][0]["cost"] == pytest.approx(
        made.cost, rel=1e-7
    )  # tolerance of a fit: 1e-8
    other = fa.fit(embedded, observation, distance=0.6, modes=20, box=3.0, noise_percent=2.0)
    record = record_of(capsys, *asked, "--prior", 2)
    assert record["fits"][0]["cost"] == pytest.approx(other.cost, rel=1e-7)
    record = record_of(capsys, "fit", tmp_path / "fit.json", "--distance", 1.2)
    assert record["cost"] == pytest.approx(
        fa.fit(embedded, observation, distance=1.2, modes=20, box=3.0, noise_percent=0.5).cost,
        rel=1e-7,
    )


# ---- sweep ----


@pytest.fixture
def sketched(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, ...]]:
    """What a picture would be drawn of, without a renderer."""
    calls: list[tuple[Any, ...]] = []
    for name in ("faces_sheet", "posterior_sheet"):
        monkeypatch.setattr(
            sheets, name, lambda *a: calls.append(a) or np.full((4, 5, 4), 255, np.uint8)
        )
    return calls


def test_a_sweep_is_a_table_and_a_picture(capsys, tmp_path, embedded, observation):
    table, picture = tmp_path / "a.csv", tmp_path / "a.png"
    asked = ("--from", 0.3, "--to", 1.2, "--steps", 3, "--csv", table, "--plot", picture)
    record = record_of(capsys, "sweep", *VIEW, *asked)
    sweep = fa.sweep_distance(embedded, observation, [0.3, 0.6, 1.2])
    rows = rows_of(table)
    assert [float(row["distance_m"]) for row in rows] == [*sweep.distances.tolist(), math.inf]
    truth = embedded.subject(2).vertices
    for row, said, fit in zip(rows, record["fits"], (*sweep.fits, sweep.orthographic), strict=True):
        assert float(row["d_l_percent"]) == fit.d_l_percent == said["d_l_percent"]
        d_s = surface_difference(fit.vertices(), truth, embedded.evaluation).mean_mm
        assert float(row["d_s_mm"]) == d_s == said["d_s_mm"]
        assert row["status"] == "converged"
    assert record["d_s_reference"] == "the true face"
    assert record["files"] == [str(table), str(picture)]
    drawn = cv2.imread(str(picture))
    assert drawn is not None
    assert drawn.shape == (720, 960, 3)


def test_without_a_true_face_the_surface_is_compared_with_the_best_or_the_saved_one(
    capsys, tmp_path, saved, observation, fit
):
    points = write_pts(tmp_path / "points.pts", observation.points)
    asked = ("--image-size", "500x500", "--from", 0.6, "--to", 1.2, "--steps", 2)
    record = record_of(capsys, "sweep", points, *asked)
    errors = [each["d_l_percent"] for each in record["fits"]]
    gaps = [each["d_s_mm"] for each in record["fits"]]
    assert gaps[int(np.argmin(errors))] == pytest.approx(0, abs=1e-9)  # rounding of the alignment
    assert record["d_s_reference"] == "the face of least landmark error"
    record = record_of(capsys, "sweep", saved, *asked[2:])
    assert record["d_s_reference"] == "the saved fit"
    assert record["fits"][0]["d_s_mm"] < 0.01  # its own distance: the fit's tolerance
    assert record["fits"][1]["d_s_mm"] > 0.5


# ---- modes ----


def test_flexibility_modes_are_those_of_the_library(
    capsys, saved, tmp_path, embedded, fit, sketched
):
    table, picture = tmp_path / "a.csv", tmp_path / "a.png"
    record = record_of(
        capsys, "modes", saved, "--count", 4, "--k1", 1, "--k2", "1.5%", "--csv", table, "--plot", picture
    )  # fmt: skip
    modes = fa.flexibility_modes(embedded, fit, None)
    kept = modes.truncated(1.0, landmark_percent=1.5)
    assert record["fit"].keys() >= RECORD
    assert record["truncation"]["kept"] == (kept.kept + 1).tolist()
    assert record["truncation"]["plausible_faces"] == kept.plausible_faces
    seen = fit.observation
    assert len(record["modes"]) == 4
    for k, (row, line) in enumerate(zip(record["modes"], rows_of(table), strict=True)):
        f = modes.directions[k]
        assert row["direction"] == f.tolist()
        assert row["words"] == line["words"] == modes.words[k]
        assert row["reach_mm"] == list(modes.reach(k))
        assert row["landmark_percent_per_mm"] == modes.landmark_percent[k]
        assert row["kept"] == (k in kept.kept) == bool(int(line["kept"]))
        for mm, size in zip((-10.0, 10.0), row["alpha_size_at_10_mm"], strict=True):
            assert size == np.linalg.norm(fit.alpha + mm * f)
        # the landmarks of the bent surface itself, projected by hand
        bent = embedded.vertices(fit.alpha + 10 * f)[seen.vertices(embedded)]
        q = bent @ fit.camera.R.T
        xy = (
            fit.camera.s * (q[:, :2] + fit.camera.t) / (1 + fit.camera.kappa * q[:, 2:])
            + seen.centre
        )
        moved = 100 * np.linalg.norm(xy - fit.projected(), axis=1).mean() / fit.interocular_px
        assert row["landmark_percent_at_10_mm"][1] == pytest.approx(moved, rel=1e-9)
    (used, faces, _), limit = sketched[0], record["alpha_size_limit"]
    assert used.alpha.tolist() == fit.alpha.tolist()
    assert len(faces) == 6  # three modes, both ways
    for face in faces:  # as far as they are plausible
        assert face.plausible
        assert np.linalg.norm(face.alpha) == pytest.approx(limit, rel=1e-9)


def test_the_table_of_modes_says_what_is_kept_and_plausible(capsys, saved, embedded, fit):
    status, out, err = printed(capsys, "modes", saved, "--k1", 0.2)
    assert (status, err) == (0, "")
    lines = out.splitlines()
    assert lines[0].startswith("converged: camera at 60 cm")
    modes = fa.flexibility_modes(embedded, fit, None)
    low, high = modes.reach(0)
    numbers = lines[3].split()
    assert [float(x) for x in numbers[2:4]] == pytest.approx([low, high], abs=0.051)
    assert "kept, plausible" in lines[3]  # 0.2 mm are within its reach
    assert lines[3].endswith(modes.words[0])
    assert f"{len(modes.truncated(0.2))} of 70 modes are kept" in out


@pytest.mark.parametrize(
    ("flags", "options"),
    [
        (("--at", "dlt"), {"linearisation": "algebraic"}),
        (("--pose", "compensated"), {"pose": "compensated"}),
        (
            ("--pose", "compensated", "--free-distance"),
            {"pose": "compensated", "free_distance": True},
        ),
    ],
)
def test_flags_of_modes_reach_the_library(capsys, saved, embedded, fit, flags, options):
    record = record_of(capsys, "modes", saved, "--count", 1, *flags)
    modes = fa.flexibility_modes(embedded, fit, None, **options)
    assert record["modes"][0]["direction"] == modes.directions[0].tolist()


def test_posterior_modes_and_their_parts_are_those_of_the_library(
    capsys, saved, tmp_path, embedded, fit, sketched
):
    table = tmp_path / "a.csv"
    asked = ("modes", saved, "--posterior", "--csv", table)
    record = record_of(capsys, *asked, "--plot", tmp_path / "a.png")
    modes, spread = fa.posterior_modes(embedded, fit), fa.surface_spread(embedded, fit)
    assert [row["sd_mm"] for row in record["modes"]] == modes.amplitude_mm.tolist()
    assert [float(row["sd_mm"]) for row in rows_of(table)] == modes.amplitude_mm.tolist()
    assert record["total_mm"] == modes.total_mm
    for name in ("prior_mm", "shape_mm", "pose_mm", "distance_mm", "total_mm"):
        assert record["spread"][name] == getattr(spread, name)
    assert np.array_equal(sketched[0][1][1].alpha, fit.alpha + 2 * modes.directions[0])
    _, out, _ = printed(capsys, *asked)
    assert f"by shape {spread.shape_mm:.2f} mm, added by pose {spread.pose_mm:.2f} mm" in out
    record = record_of(capsys, "modes", saved, "--posterior", "--pose", "fixed", "--count", 1)
    assert record["total_mm"] == fa.posterior_modes(embedded, fit, 1, pose="fixed").total_mm


def test_extreme_faces_are_those_of_the_library_and_written_as_meshes(
    capsys, saved, tmp_path, embedded, fit
):
    out = tmp_path / "out"
    asked = ("modes", saved, "--extremes", "--tolerance", 2)
    record = record_of(capsys, *asked, "--out", out, "--csv", tmp_path / "a.csv")
    found = fa.extreme_faces(embedded, fit, 2.0)
    assert [each["alpha"] for each in record["faces"]] == [
        each.alpha.tolist() for each in found.faces
    ]
    assert (record["bound_mm"], record["ratio"]) == (found.bound_mm, found.ratio)
    assert [float(row["d_s_mm"]) for row in rows_of(tmp_path / "a.csv")] == [
        each.d_s_mm for each in found.faces
    ]
    names = [
        f"{name}.{kind}"
        for name in ("fit", "extreme_1", "extreme_2")
        for kind in ("obj", "ply", "glb")
    ]
    assert sorted(path.name for path in out.iterdir()) == sorted(names)
    assert record["files"][1:] == [str(out / name) for name in names]
    vertices = [
        line.split()[1:4]
        for line in (out / "extreme_1.obj").read_text().splitlines()
        if line[:2] == "v "
    ]
    # the file has seven digits after the point, metres
    assert np.allclose(np.array(vertices, float), found.faces[0].vertices, rtol=0, atol=5.1e-8)
    _, text, _ = printed(capsys, *asked)
    assert (
        f"reached {found.faces[0].rms_mm:.2f} mm rms; no face passes {found.bound_mm:.2f} mm"
        in text
    )


# ---- posterior ----


def test_a_posterior_is_that_of_the_library(capsys, tmp_path, embedded, observation, sketched):
    table, out = tmp_path / "a.csv", tmp_path / "out"
    record = record_of(
        capsys, "posterior", *VIEW, "--csv", table, "--plot", tmp_path / "a.png",
        "--draws", 2, "--seed", 5, "--out", out,
    )  # fmt: skip
    found = fa.posterior(embedded, observation)
    density = found.distance_density
    for each, level in zip(record["intervals"], (0.5, 0.95), strict=True):
        real = found.interval(level)
        assert (each["level"], each["low_m"], each["high_m"]) == (level, real.low, real.high)
    assert record["beyond"] == density.beyond
    assert record["sigma_px"] == found.sigma_px
    sd = found.vertex_sd_mm
    assert record["vertex_sd"]["mean_mm"] == sd[embedded.evaluation].mean()
    assert record["vertex_sd"]["max_mm"] == sd[embedded.evaluation].max()
    assert record["vertex_sd"]["regions_mm"]["nose"] == sd[embedded.regions["nose"]].mean()
    assert [
        float(row["density_per_log_distance"]) for row in rows_of(table)
    ] == density.density.tolist()
    drawn = found.sample(2, 5)
    rows = rows_of(out / "draws.csv")
    assert [float(row["distance_m"]) for row in rows] == drawn.distances.tolist()
    assert [float(rows[1][f"alpha_{j}"]) for j in range(1, 101)] == drawn.alpha[1].tolist()
    assert sorted(path.name for path in out.iterdir()) == ["draw_1.ply", "draw_2.ply", "draws.csv"]
    head, _, body = (out / "draw_2.ply").read_bytes().partition(b"end_header\n")
    assert b"draw 2 of 2, seed 5" in head
    kind = np.dtype([("xyz", "<f4", 3), ("rgb", "u1", 3)])
    written = np.frombuffer(body, kind, embedded.n_vertices)["xyz"]
    assert np.allclose(written, drawn.vertices(1), rtol=0, atol=1e-7)  # single precision of a metre
    assert np.array_equal(sketched[0][1], sd)
    assert sketched[0][2] == 0.4  # the true distance, of a subject


def test_a_posterior_states_its_prior_and_what_lies_beyond(capsys):
    asked = ("posterior", *VIEW, "--steps", 8, "--to", 4)
    _, out, _ = printed(capsys, *asked)
    assert "prior: uniform in log distance from 20 to 400 cm, 5 % beyond 400 cm" in out
    assert "beyond 400 cm: practically ruled out by the points" in out
    _, out, _ = printed(capsys, *asked, "--between", 0.5, 2, "--json")
    record = json.loads(out)
    assert record["prior"] == {"words": "uniform in log distance from 50 to 200 cm", "beyond": 0.0}
    assert 0.5 <= record["intervals"][1]["low_m"] < record["intervals"][1]["high_m"] <= 2
    _, out, _ = printed(capsys, *asked, "--beyond", 0)
    assert "beyond 400 cm: ruled out by the prior" in out
    # from far away and with much noise, infinity stays open
    far = ("posterior", "--subject", 2, "--actual", 5, "--noise", 2, "--prior", 2, "--steps", 8)
    _, out, _ = printed(capsys, *far)
    assert "to infinity, it has no end" in out
    assert "so far that the camera is taken for infinitely far away" in out


def test_of_a_saved_fit_the_noise_counts_not_its_box(capsys, tmp_path, embedded, observation):
    made = fa.fit(embedded, observation, distance=0.6, modes=20, box=3.0, noise_percent=0.5)
    fa.save_fit(made, tmp_path / "fit.json")
    record = record_of(capsys, "posterior", tmp_path / "fit.json", "--steps", 8)
    found = fa.posterior(embedded, observation, np.geomspace(0.2, 10, 8), noise_percent=0.5)
    assert record["sigma_px"] == found.sigma_px
    assert (
        record["most_probable_m"]
        == found.distance_density.distances[found.distance_density.density.argmax()]
    )


# ---- pictures ----


@pytest.mark.gl
@pytest.mark.parametrize(
    ("command", "size"),
    [(("modes", "--extremes"), (760, 1600)), (("posterior", "--steps", "12"), (760, 1580))],
)
def test_pictures_of_faces_are_drawn(capsys, saved, tmp_path, command, size):
    need_renderer()
    picture = tmp_path / "a.png"
    status, _, err = printed(capsys, command[0], saved, *command[1:], "--plot", picture)
    assert (status, err) == (0, "")
    drawn = cv2.imread(str(picture))
    assert drawn is not None
    assert drawn.shape == (*size, 3)
    # heads: neither ground nor grey, on a part of the picture that words alone would not fill
    coloured = np.ptp(drawn.astype(int), axis=2) > 60
    assert 0.03 < coloured.mean() < 0.5


# ---- bad input ----

# Each: the arguments, and what the line must name
BAD: dict[str, tuple[list[str], str]] = {
    "nothing": (["modes"], "FILE, --subject N: one of them is needed"),
    "both": (["sweep", "{fit}", "--subject", "2"], "FILE, --subject N: one of them is needed, and one only"),
    "no fit": (["modes", "{tmp}/none.json"], "none.json"),
    "no such subject": (["posterior", "--subject", "11"], "subject: 11 is not within 1 to 10"),
    "subject of words": (["sweep", "--subject", "me"], "subject: 'me' is not a whole number"),
    "yaw without": (["modes", "{fit}", "--yaw", "5"], "--yaw: only with --subject"),
    "landmarks with": (["modes", "--subject", "2", "--auto"], "--auto: for a file, not for --subject"),
    "size of a fit": (["sweep", "{fit}", "--image-size", "9x9"], "--image-size: fit.json has its points already"),
    "picture without points": (["posterior", "{tmp}/face.png"], "face.png: a picture; its points are read with"),
    "unconverged": (["modes", "{tmp}/stopped.json"], "fit: it did not converge (step limit reached)"),
    "unconverged, extremes": (["modes", "{tmp}/stopped.json", "--extremes"], "not converged (step limit reached)"),
    "unconverged, posterior modes": (["modes", "{tmp}/stopped.json", "--posterior"], "it did not converge"),
    "cut": (["sweep", "{tmp}/cut.json"], "cut.json: a damaged file, no JSON"),
    "NaN": (["posterior", "{tmp}/nan.json"], "nan.json: a damaged file, no JSON: NaN is not a number"),
    "shapes": (["modes", "{tmp}/short.json"], "short.json: alpha: expected shape (70), found (3,)"),
    "other model": (["modes", "{tmp}/other.json"], "other.json: made with model 'mine'; give that model"),
    "newer": (["modes", "{tmp}/newer.json"], "newer.json: a saved fit of format 9, this program reads 1"),
    "no picture for out": (["fit", "{fit}", "--out", "{tmp}/o"], "--out: the photograph is needed"),
    "no picture for contours": (["fit", "{fit}", "--contours"], "contours: the photograph is needed"),
    "fitted already": (["modes", "{fit}", "--distance", "1"], "--distance: the saved fit has it already"),
    "modes of it": (["modes", "{fit}", "--modes", "9"], "--modes: the saved fit has it already"),
    "k1 zero": (["modes", "{fit}", "--k1", "0"], "--k1: 0 mm is not above 0"),
    "k1 NaN": (["modes", "{fit}", "--k1", "nan"], "--k1: nan mm is not above 0"),
    "k2 negative": (["modes", "{fit}", "--k2=-1"], "--k2: '-1' is not above 0"),
    "k2 percent": (["modes", "{fit}", "--k2", "0%"], "--k2: '0%' is not above 0"),
    "k2 words": (["modes", "{fit}", "--k2", "few"], "--k2: 'few' is not a number of pixels"),
    "mm": (["modes", "{fit}", "--mm", "-3"], "--mm: -3 is not above 0"),
    "count": (["modes", "{fit}", "--count", "71"], "count: 71 is not within 1 to 70"),
    "at": (["modes", "{fit}", "--at", "points"], "--at: invalid choice: 'points'"),
    "pose": (["modes", "{fit}", "--pose", "free"], "pose: 'free' is not fixed or compensated"),
    "free distance": (["modes", "{fit}", "--free-distance"], "free_distance: a fixed pose has a fixed distance"),
    "two kinds": (["modes", "{fit}", "--posterior", "--extremes"], "--extremes: not allowed with argument --posterior"),
    "k1 of extremes": (["modes", "{fit}", "--extremes", "--k1", "2"], "--k1: only without --extremes"),
    "tolerance alone": (["modes", "{fit}", "--tolerance", "2"], "--tolerance: only with --extremes"),
    "tolerance zero": (["modes", "{fit}", "--extremes", "--tolerance", "0"], "tolerance_percent: 0 is not above 0"),
    "one distance": (["posterior", "{fit}", "--steps", "1"], "--steps 1: from at least 0.2 m up to `to`, 2 to 1000"),
    "one place": (["posterior", "{fit}", "--from", "1", "--to", "1"], "distances: 1 of them; a density needs"),
    "no distance": (["posterior", "{fit}", "--between", "20", "30"], "prior: it excludes every distance from 0.2 to"),
    "between backwards": (["posterior", "{fit}", "--between", "3", "1"], "--between 3 1: two distances"),
    "beyond": (["posterior", "{fit}", "--beyond", "1"], "beyond: 1 is not a probability"),
    "draws alone": (["posterior", "{fit}", "--draws", "3"], "--draws N and --out FOLDER: one needs the other"),
    "no draws": (["posterior", "{fit}", "--draws", "0", "--out", "{tmp}/o"], "--draws: 0 is not within 1 to"),
    "seed of words": (["posterior", "{fit}", "--seed", "x"], "seed: 'x' is not a whole number"),
    "csv": (["sweep", "{fit}", "--csv", "{tmp}/a.txt"], "a.txt' does not end in .csv"),
    "plot": (["modes", "{fit}", "--plot", "{tmp}/none/a.png"], "--plot: there is no folder"),
    "out": (["modes", "{fit}", "--out", "{fit}"], "is a file, not a folder"),
    "over the input": (["sweep", "{tmp}/points.csv", "--csv", "{tmp}/points.csv"], "points.csv' is the input itself"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_one_line_and_writes_nothing(
    capsys, tmp_path, saved, observation, fit, embedded, name
):
    cv2.imwrite(str(tmp_path / "face.png"), np.full((500, 500, 3), 90, np.uint8))
    rows = "".join(f"{x},{y}\n" for x, y in observation.points)
    (tmp_path / "points.csv").write_text(f"x,y\n{rows}")
    whole = encode_fit(fit)
    (tmp_path / "cut.json").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "nan.json").write_bytes(whole.replace(b'"cost": ', b'"cost": NaN, "was": '))
    record = json.loads(whole)
    for file, change in (
        ("short", {"alpha": [0, 0, 0]}),
        ("other", {"model": {**record["saved"]["model"], "name": "mine"}}),
    ):
        (tmp_path / f"{file}.json").write_text(
            json.dumps(record | {"saved": record["saved"] | change})
        )
    (tmp_path / "newer.json").write_text(json.dumps(record | {"format_version": 9}))
    if "stopped" in str(BAD[name]):
        fa.save_fit(
            fa.fit(embedded, observation, distance=0.6, max_steps=1), tmp_path / "stopped.json"
        )
    before = sorted(tmp_path.rglob("*"))
    arguments, words = BAD[name]
    places = {"{fit}": str(saved), "{tmp}": str(tmp_path)}
    for place, path in places.items():
        arguments = [argument.replace(place, path) for argument in arguments]
    assert words in refused(capsys, *arguments)
    assert sorted(tmp_path.rglob("*")) == before


def test_a_tolerance_that_the_fit_itself_passes_is_told_what_it_reaches(capsys, saved, fit):
    gaps = np.linalg.norm(fit.residual, axis=1)
    reached = 100 * np.sqrt((gaps**2).mean()) / fit.interocular_px
    line = refused(capsys, "modes", saved, "--extremes", "--tolerance", 0.1)
    assert "tolerance_percent: 0.1 is not above the " in line
    said = float(line.split("above the ")[1].split(" %")[0])
    assert said == pytest.approx(reached, abs=1e-4)  # rounded up to the fourth digit
    assert printed(capsys, "modes", saved, "--extremes", "--tolerance", said + 0.01)[0] == 0


# ---- progress and interruption ----


class Terminal:
    """stderr as a terminal would be."""

    def __init__(self) -> None:
        self.text = ""

    def write(self, text: str) -> None:
        self.text += text

    def flush(self) -> None:
        pass

    def isatty(self) -> bool:
        return True


def test_progress_is_seen_on_a_terminal_and_wiped_away(capsys, monkeypatch):
    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    monkeypatch.setattr(progress, "EVERY", 0.0)
    terminal = Terminal()
    with monkeypatch.context() as patch:
        patch.setattr(sys, "stderr", terminal)
        status, out, _ = printed(capsys, "sweep", *VIEW, "--steps", 40, "--json")
    assert status == 0
    assert len(json.loads(out)["fits"]) == 41
    for words in ("\rfits: 40 of 40", "\rspeeds: 40 of 40", "\rsurfaces: 41 of 41"):
        assert words in terminal.text
    last = terminal.text.split("\r")[-2:]
    assert last[1] == ""
    assert last[0].strip() == ""
    assert printed(capsys, "sweep", *VIEW, "--steps", 40, "--json")[2] == ""  # no terminal


def test_short_work_says_nothing_on_a_terminal(monkeypatch):
    monkeypatch.setattr(progress, "PATIENCE", 1e9)
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with progress.Progress("fits", 3) as line:
        assert list(line.over("abc")) == ["a", "b", "c"]
    assert terminal.text == ""


@pytest.mark.parametrize("there", [True, False])
def test_an_interruption_leaves_nothing_half_written(capsys, saved, tmp_path, monkeypatch, there):
    real, count = photo.face_meshes, iter(range(99))

    def interrupted(*arguments: Any) -> Any:
        if next(count) == 2:
            raise KeyboardInterrupt
        return real(*arguments)

    monkeypatch.setattr(photo, "face_meshes", interrupted)
    out = tmp_path / "out"
    if there:
        out.mkdir()
        (out / "fit.ply").write_text("old")
    asked = ("modes", saved, "--out", out, "--csv", tmp_path / "a.csv")
    assert printed(capsys, *asked) == (130, "", "")
    assert not (tmp_path / "a.csv").exists()
    assert [(path.name, path.read_text()) for path in tmp_path.rglob("*.ply")] == [
        ("fit.ply", "old")
    ] * there
    assert out.exists() == there


def test_ctrl_c_ends_a_running_command(tmp_path):
    out = tmp_path / "out"
    # a shell in the background hands down an ignored SIGINT; a person at a terminal has the usual one
    code = (
        "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); "
        "from faceambig_app.cli import main; sys.exit(main())"
    )
    arguments = [
        "posterior",
        "--subject",
        "2",
        "--steps",
        "8",
        "--draws",
        "5000",
        "--out",
        str(out),
    ]
    with subprocess.Popen(
        [sys.executable, "-c", code, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as run:
        while run.poll() is None and not any(path.is_file() for path in tmp_path.rglob("*")):
            time.sleep(0.02)  # until it writes, beside the folder that it fills at the end
        run.send_signal(signal.SIGINT)
        said = run.communicate()
    assert run.returncode == 130
    assert said == (b"", b"")
    assert not out.exists()


def test_files_taken_one_after_the_other_are_written_together_or_not_at_all(tmp_path):
    def files() -> Any:
        yield tmp_path / "a", b"1"
        assert not (tmp_path / "a").exists()  # not before all are there
        yield tmp_path / "b", b"2"

    write_pairs(files())
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"a": b"1", "b": b"2"}
