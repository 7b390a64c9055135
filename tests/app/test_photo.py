"""From a photograph to files by one command: what is written, what is said, and that bad input writes nothing."""

from __future__ import annotations

import json
import struct
import types
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import trimesh
from PIL import Image

import faceambig as fa
from commands import RECORD, printed, refused, write_pts
from faceambig import compose
from faceambig.io.pictures import Picture, read_picture
from faceambig.observation import portrait_camera
from faceambig.render import fitted, painter
from faceambig_app import files as out_files
from faceambig_app.reports import photo
from faceambig_app.reports.photo import NAMES

PHOTOS = Path(__file__).resolve().parents[3] / "shared" / "data" / "photos"
VIEW: dict[str, Any] = {"distance": 0.5, "yaw_deg": 15.0}


@pytest.fixture(scope="module")
def portrait(embedded, tmp_path_factory) -> Path:
    """A folder with a synthetic photograph, its points beside it, and the same points elsewhere."""
    folder = tmp_path_factory.mktemp("portrait")
    subject = embedded.subject(2)
    observation = fa.observe(subject, **VIEW)
    taken = compose.photo(subject, observation, portrait_camera(subject, **VIEW), caption="")
    tags = Image.Exif()
    tags.get_ifd(0x8769)[0xA405] = 50
    painted = Image.fromarray(painter.paint_photo(taken, 500))
    painted.save(folder / "face.jpg", quality=95, exif=tags)
    write_pts(folder / "face.pts", observation.points)
    (folder / "apart").mkdir()
    write_pts(folder / "apart" / "points.pts", observation.points)
    return folder


@pytest.fixture
def asked(portrait, tmp_path) -> list[object]:
    """The usual command, writing to a folder that is not there yet."""
    points = portrait / "apart" / "points.pts"
    command = ["fit", portrait / "face.jpg", "--landmarks", points]
    return [*command, "--distance", 0.5, "--out", tmp_path / "out"]


def test_one_command_writes_picture_meshes_and_numbers(capsys, asked, tmp_path, embedded):
    status, out, err = printed(capsys, *asked)
    assert (status, err) == (0, "")
    folder = tmp_path / "out"
    assert sorted(path.name for path in folder.iterdir()) == sorted(NAMES)
    record = json.loads((folder / "fit.json").read_text())
    assert record.keys() >= RECORD | {"focal_px", "points_used", "files", "colours"}
    vertices = embedded.vertices(record["alpha"])
    for kind in ("obj", "ply", "glb"):
        mesh: Any = trimesh.load_mesh(folder / f"face.{kind}", process=False, maintain_order=True)
        assert np.abs(mesh.vertices - vertices).max() < 1e-7  # metres, as OBJ has them
        assert np.array_equal(mesh.faces, embedded.faces)
    ply: Any = trimesh.load_mesh(folder / "face.ply", process=False)
    # skin as it was painted: brown, not grey and not the ground of the picture
    tip = ply.visual.vertex_colors[embedded.scheme("ibug68").vertices[30], :3].astype(int)
    assert tip[0] > tip[1] > tip[2]
    head = (folder / "face.obj").read_text()[:2000]
    assert record["colours"] in head
    assert "camera at 50 cm" in head
    overlay = read_picture(folder / "overlay.png")
    assert min(overlay.size) > 500
    assert b"face fitted by faceambig to face.jpg" in (folder / "overlay.png").read_bytes()
    assert f"written to {folder}: overlay.png, face.obj, face.ply, face.glb, fit.json" in out
    assert "size of face.jpg" in out


def test_json_is_that_of_the_points_alone_and_the_files(capsys, asked, portrait, tmp_path):
    _, out, _ = printed(capsys, *asked, "--json")
    record = json.loads(out)
    size = ("--image-size", "500x500")
    alone = ("fit", portrait / "apart" / "points.pts", "--distance", 0.5, *size, "--json")
    _, out, _ = printed(capsys, *alone)
    same = json.loads(out)
    assert record.pop("files") == [str(tmp_path / "out" / name) for name in NAMES]
    assert record.pop("picture") == {"name": "face.jpg", "converted": []}
    assert record.pop("exif").keys() == {"focal_35mm", "focal_px", "distance_hint_m"}
    assert record.pop("image_size_from") == "size of face.jpg"
    assert same.pop("image_size_from") == "given"
    assert record == same


def test_without_out_nothing_is_written(capsys, asked, tmp_path):
    status, out, _ = printed(capsys, *asked[:-2])
    assert status == 0
    assert "written" not in out
    assert not list(tmp_path.iterdir())


def test_points_alone_take_the_picture_beside_them(capsys, portrait, tmp_path):
    status, _, err = printed(
        capsys, "fit", portrait / "face.pts", "--distance", 0.5, "--out", tmp_path / "out"
    )
    assert (status, err) == (0, "")
    assert "face.jpg" in (tmp_path / "out" / "face.obj").read_text()[:300]


def test_an_existing_folder_is_kept_and_its_old_results_replaced(capsys, asked, tmp_path):
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "mine.txt").write_text("kept")
    (folder / "fit.json").write_text("old")
    assert printed(capsys, *asked)[0] == 0
    assert sorted(path.name for path in folder.iterdir()) == sorted([*NAMES, "mine.txt"])
    assert json.loads((folder / "fit.json").read_text())["status"] == "converged"


def test_the_focal_length_of_exif_is_a_hint_and_never_used(capsys, asked):
    _, out, _ = printed(capsys, *asked[:-2], "--json")
    record = json.loads(out)
    assert record["distance_m"] == pytest.approx(0.5, rel=1e-12)
    scale = record["focal_px"] / record["distance_m"]
    focal = 50 * np.hypot(500, 500) / np.hypot(36, 24)
    assert record["exif"]["focal_px"] == pytest.approx(focal, rel=1e-12)
    assert record["exif"]["distance_hint_m"] == pytest.approx(focal / scale, rel=1e-9)
    _, out, _ = printed(capsys, *asked[:-2])
    (line,) = [line for line in out.splitlines() if line.startswith("EXIF")]
    hinted = record["exif"]["distance_hint_m"]
    assert "a lens of 50 mm (35 mm equivalent)" in line
    assert f"Not used; to assume it: --distance {hinted:.2f}" in line
    # and what it leads to: a fit there has nearly that focal length
    _, out, _ = printed(capsys, *asked[:4], "--distance", round(hinted, 2), "--json")
    assert json.loads(out)["focal_px"] == pytest.approx(focal, rel=0.05)


def test_no_hint_without_exif_or_far_off():
    fit: Any = types.SimpleNamespace(camera=types.SimpleNamespace(s=1000.0))
    picture = Picture("a.jpg", np.zeros((30, 40, 3), np.uint8))
    assert photo.exif_hint(picture, fit) is None
    hint = photo.exif_hint(replace(picture, focal_35mm=35.0), fit)
    assert hint is not None
    assert "so no hint" in photo.hint_words(hint)
    assert "--distance" not in photo.hint_words(hint)


@pytest.mark.parametrize("turn", [3, 6])
def test_a_turned_photograph_is_fitted_upright(capsys, portrait, tmp_path, turn):
    tags = Image.Exif()
    tags[0x0112] = turn
    method = {3: Image.Transpose.ROTATE_180, 6: Image.Transpose.ROTATE_90}[turn]
    with Image.open(portrait / "face.jpg") as upright:
        upright.crop((0, 0, 500, 480)).transpose(method).save(tmp_path / "a.jpg", exif=tags)
    points = portrait / "apart" / "points.pts"
    _, out, _ = printed(
        capsys, "fit", tmp_path / "a.jpg", "--landmarks", points, "--distance", 0.5, "--json"
    )
    record = json.loads(out)
    assert record["principal_point"] == "(250, 240), middle of the picture"
    assert record["picture"]["converted"] == [f"turned upright (EXIF orientation {turn})"]


@pytest.mark.parametrize("kind", ["grey16", "cmyk", "alpha"])
def test_odd_pictures_are_converted_and_it_is_said(capsys, portrait, tmp_path, kind):
    with Image.open(portrait / "face.jpg") as picture:
        rgb = np.asarray(picture.convert("RGB"))
    path = tmp_path / ("a.jpg" if kind == "cmyk" else "a.png")
    if kind == "cmyk":
        Image.fromarray(rgb).convert("CMYK").save(path)
    elif kind == "alpha":
        Image.fromarray(rgb).convert("RGBA").save(path)
    else:
        cv2.imwrite(str(path), rgb[..., 1].astype(np.uint16) * 257)
    said = {
        "grey16": "a.png: 16 bits reduced to 8",
        "cmyk": "a.jpg: CMYK converted to RGB",
        "alpha": "a.png: transparency laid on white",
    }
    status, out, err = printed(
        capsys, "fit", path, "--landmarks", portrait / "apart" / "points.pts", "--distance", 0.5
    )  # fmt: skip
    assert (status, err) == (0, "")
    assert said[kind] in out


def bomb(path: Path) -> Path:
    """A PNG that claims 20,000 x 20,000."""
    data = b"IHDR" + struct.pack(">IIBBBBB", 20_000, 20_000, 8, 2, 0, 0, 0)
    crc = struct.pack(">I", zlib.crc32(data))
    path.write_bytes(b"\x89PNG\r\n\x1a\n\x00\x00\x00\r" + data + crc)
    return path


# Each: the arguments after `fit`, and what the line must name
BAD: dict[str, tuple[list[str], str]] = {
    "no points": (["{photo}"], "face.jpg: a picture; its points are read with --landmarks FILE or found with --auto"),
    "both": (["{photo}", "--landmarks", "{pts}", "--auto"], "--landmarks and --auto: give one of them"),
    "points for a picture": (["{pts}", "--landmarks", "{pts}"], "points.pts: not a picture"),
    "no picture": (["{tmp}/none.jpg", "--landmarks", "{pts}"], "none.jpg: cannot be read"),
    "no landmarks": (["{photo}", "--landmarks", "{tmp}/none.pts"], "none.pts: cannot be read"),
    "picture for points": (["{photo}", "--landmarks", "{photo}"], "face.jpg: not a"),
    "truncated": (["{tmp}/cut.jpg", "--landmarks", "{pts}"], "cut.jpg: damaged or cut off"),
    "not a picture": (["{tmp}/words.jpg", "--landmarks", "{pts}"], "words.jpg: not a picture"),
    "400 million pixels": (["{tmp}/bomb.png", "--landmarks", "{pts}"], "bomb.png: 20000 x 20000 is 400 million"),
    "one pixel": (["{tmp}/one.png", "--landmarks", "{pts}"], "pixels, the picture has 1 x 1"),
    "smaller than the points": (["{tmp}/small.png", "--landmarks", "{pts}"], "pixels, the picture has 220 x 220"),
    "size given twice": (["{photo}", "--landmarks", "{pts}", "--image-size", "9x9"], "--image-size: face.jpg is given"),
    "another size": (["{tmp}/face.pts", "--image-size", "600x600"], "--image-size: the picture beside face.pts is 500"),
    "nothing beside": (["{pts}"], "points.pts: no picture of the same name beside it"),
    "face outside": (["{tmp}/large.png", "--landmarks", "{tmp}/far.pts"], "far.pts: 0 of 68 points used; 68"),
    "out is a file": (["{photo}", "--landmarks", "{pts}", "--out", "{pts}"], "is a file, not a folder"),
    "no folder for out": (["{photo}", "--landmarks", "{pts}", "--out", "{tmp}/a/b"], "out: there is no folder"),
    "a folder in the way": (["{photo}", "--landmarks", "{pts}", "--out", "{tmp}/way"], "face.glb' is a folder"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_one_line_and_writes_nothing(capsys, portrait, tmp_path, name, embedded):
    jpeg = (portrait / "face.jpg").read_bytes()
    (tmp_path / "cut.jpg").write_bytes(jpeg[: len(jpeg) // 2])
    (tmp_path / "words.jpg").write_text("hello\n")
    bomb(tmp_path / "bomb.png")
    Image.new("RGB", (1, 1)).save(tmp_path / "one.png")
    Image.new("RGB", (220, 220)).save(tmp_path / "small.png")
    Image.new("RGB", (400, 400)).save(tmp_path / "large.png")
    write_pts(tmp_path / "far.pts", fa.observe(embedded.subject(2), **VIEW).points + 5000)
    for file in ("face.jpg", "face.pts"):
        (tmp_path / file).write_bytes((portrait / file).read_bytes())
    (tmp_path / "way" / "face.glb").mkdir(parents=True)
    before = sorted(tmp_path.rglob("*"))
    places = {"{photo}": portrait / "face.jpg", "{tmp}": tmp_path}
    places["{pts}"] = portrait / "apart" / "points.pts"
    arguments, words = BAD[name]
    for place, path in places.items():
        arguments = [argument.replace(place, str(path)) for argument in arguments]
    if "--out" not in arguments:
        arguments += ["--out", str(tmp_path / "out")]
    said = refused(capsys, "fit", *arguments, "--distance", 0.5)
    assert words in said
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("failing", range(len(NAMES)))
def test_a_full_disk_leaves_nothing_half_written(capsys, asked, tmp_path, monkeypatch, failing):
    write, count = Path.write_bytes, iter(range(99))

    def full(path: Path, data: bytes) -> int:
        if next(count) == failing:
            write(path, data[:7])
            raise OSError(28, "No space left on device", str(path))
        return write(path, data)

    monkeypatch.setattr(photo, "contents", lambda *_: dict.fromkeys(NAMES, b"new data"))
    monkeypatch.setattr(Path, "write_bytes", full)
    said = refused(capsys, *asked)
    assert "out: cannot write" in said
    assert NAMES[failing] in said
    assert "No space left on device" in said
    assert not list(tmp_path.iterdir())  # the folder made for it is gone too
    folder = tmp_path / "out"
    folder.mkdir()
    for name in NAMES:
        (folder / name).write_text("old")
    count = iter(range(99))
    refused(capsys, *asked)
    assert {path.name: path.read_text() for path in folder.iterdir()} == dict.fromkeys(NAMES, "old")


def test_a_folder_without_permission_is_refused_before_the_work(
    capsys, asked, tmp_path, monkeypatch
):
    # root may write everywhere, so the answer of the system is played
    monkeypatch.setattr(photo.os, "access", lambda *_: False)
    monkeypatch.setattr(fa, "load_model", lambda *_: pytest.fail("worked before looking"))
    assert "no permission to write there" in refused(capsys, *asked)


def test_files_are_written_together_or_not_at_all(tmp_path):
    files = {tmp_path / "a": b"1", tmp_path / "none" / "b": b"2"}
    with pytest.raises(ValueError, match=r"out: cannot write .*none"):
        out_files.write_all(files)
    assert not list(tmp_path.iterdir())


def test_contours_of_the_photograph_are_fitted_and_reported(capsys, asked, tmp_path):
    status, out, err = printed(capsys, *asked, "--contours", "--json")
    assert (status, err) == (0, "")
    record = json.loads(out)
    assert record["contours"]["pairs"] > 50
    assert record["contours"]["status"] in ("settled", "cycle")
    alone = json.loads(printed(capsys, *asked[:-2], "--json")[1])
    assert record["alpha"] != alone["alpha"]
    assert f"{record['contours']['pairs']} pairs" in (tmp_path / "out" / "face.obj").read_text()


def test_a_picture_without_edges_falls_back_to_the_landmarks_and_says_so(
    capsys, portrait, tmp_path
):
    Image.new("RGB", (500, 500), (120, 110, 100)).save(tmp_path / "plain.png")
    points = portrait / "apart" / "points.pts"
    asked = ("fit", tmp_path / "plain.png", "--landmarks", points, "--distance", 0.5)
    status, out, err = printed(capsys, *asked, "--contours")
    assert (status, err) == (0, "")
    assert "contours: no contour found; the fit is that of the landmarks alone" in out
    with_contours = json.loads(printed(capsys, *asked, "--contours", "--json")[1])
    alone = json.loads(printed(capsys, *asked, "--json")[1])
    assert with_contours.pop("contours")["pairs"] == 0
    assert with_contours["alpha"] == pytest.approx(alone["alpha"], abs=1e-9)


def test_contours_that_do_not_settle_are_exit_status_one(capsys, asked, monkeypatch):
    real = fa.contour_fit
    monkeypatch.setattr(fa, "contour_fit", lambda *a, **o: real(*a, **o, max_iterations=1))
    status, out, _ = printed(capsys, *asked[:-2], "--contours")
    assert status == 1
    assert "contours: iteration limit reached after 1 iterations" in out


def test_auto_finds_the_points(capsys, portrait, tmp_path):
    asked = ("fit", portrait / "face.jpg", "--distance", 0.5, "--json")
    status, out, err = printed(capsys, *asked, "--auto", "--out", tmp_path / "out")
    assert (status, err) == (0, "")
    record = json.loads(out)
    assert record["points_used"] == 51
    assert record["landmarks"] == "found by the networks, without the jaw"
    assert {path.name for path in (tmp_path / "out").iterdir()} == set(NAMES)
    points = portrait / "apart" / "points.pts"
    given = json.loads(printed(capsys, *asked, "--landmarks", points)[1])
    # both faces lie over the same one: the origins within 3 mm of each other
    gap = np.subtract(record["translation_m"], given["translation_m"])[:2]
    assert np.linalg.norm(gap) < 0.003


def test_auto_without_a_face_is_one_line(capsys, tmp_path):
    Image.new("RGB", (300, 200), (120, 110, 100)).save(tmp_path / "plain.png")
    asked = ("fit", tmp_path / "plain.png", "--auto", "--out", tmp_path / "out")
    assert "plain.png: no face found" in refused(capsys, *asked)
    assert not (tmp_path / "out").exists()


def test_the_overlay_shows_points_outline_and_face(embedded):
    observation = fa.observe(embedded.subject(2), **VIEW)
    fit = fa.fit(embedded, observation, distance=0.5)
    rgb = np.full((500, 500, 3), 90, np.uint8)
    drawn = fitted.draw_fitted(rgb, compose.photo_of_fit(fit, (500, 500)), ["a line", "another"])
    assert drawn.shape[2] == 4
    assert (drawn[..., 3] == 255).all()
    ground = (np.abs(drawn[..., :3].astype(int) - 90).max(axis=2) <= 2).mean()
    assert 0.3 < ground < 0.85  # the photograph shows around the face and behind the marks
    left, right = np.array_split(drawn[:, :, :3].astype(int), 2, axis=1)
    blue = (np.abs(left - fitted.PROJECTED).max(axis=2) < 40).sum()
    red = (np.abs(left - fitted.OBSERVED).max(axis=2) < 40).sum()
    assert blue > 2000
    assert red > 300
    assert (np.abs(right - fitted.PROJECTED).max(axis=2) < 40).sum() < 100
    clay = (right[..., 0] - right[..., 2] > 15).mean()
    assert clay > 0.1
    with pytest.raises(ValueError, match="rgb: expected"):
        fitted.draw_fitted(rgb[:100], compose.photo_of_fit(fit, (500, 500)))


# Rows: lambda; columns: 0.3, 0.5, 0.6, 1, 2 m and orthographic; each k = 2 and k = 3
DISTANCES = (0.3, 0.5, 0.6, 1.0, 2.0, None)
MEASURED = {
    9: ((4.34, 4.07), (4.14, 4.04), (4.14, 4.05), (4.18, 4.09), (4.26, 4.14), (4.38, 4.23)),
    1: ((4.05, 3.45), (3.81, 3.37), (3.80, 3.37), (3.85, 3.43), (3.95, 3.50), (4.10, 3.60)),
}
needs_photo = pytest.mark.skipif(not PHOTOS.is_dir(), reason="no photo in ../shared/data/photos")


@needs_photo
@pytest.mark.parametrize("weight", MEASURED)
@pytest.mark.parametrize("column", range(6))
def test_a_real_photograph_is_fitted_as_measured_before(ict, weight, column):
    """d_L in % of the eye centres, 126.7 px; an independent implementation, two digits."""
    read = fa.load_landmarks(PHOTOS / "image_0010.pts")
    observation = fa.Observation(read.points, "ibug68", image_size=(1280, 1024))
    assert observation.centre.tolist() == [640, 512]
    distance = DISTANCES[column]
    camera = "orthographic" if distance is None else "perspective"
    for box, wanted in zip((2.0, 3.0), MEASURED[weight][column], strict=True):
        fit = fa.fit(
            ict, observation, camera=camera, distance=distance, prior_weight=weight, box=box
        )
        assert fit.converged
        assert fit.interocular_px == pytest.approx(126.7, abs=0.05)
        assert fit.d_l_percent == pytest.approx(wanted, abs=0.02)


@needs_photo
def test_a_real_photograph_becomes_files(capsys, tmp_path, ict_path, ict):
    prior = 100 * 3 / 126.7  # 3 px: lambda 9
    status, out, err = printed(
        capsys, "fit", PHOTOS / "image_0010.jpg", "--landmarks", PHOTOS / "image_0010.pts", "--model", ict_path,
        "--distance", 0.6, "--prior", prior, "--out", tmp_path / "out", "--json",
    )  # fmt: skip
    assert (status, err) == (0, "")
    record = json.loads(out)
    assert record["d_l_percent"] == pytest.approx(4.14, abs=0.02)
    assert record["principal_point"] == "(640, 512), middle of the picture"
    mesh: Any = trimesh.load_mesh(tmp_path / "out" / "face.ply", process=False)
    assert len(mesh.vertices) == ict.n_vertices
