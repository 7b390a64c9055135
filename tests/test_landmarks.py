"""Landmark files: what their points are taken for, which are used, and the picture they belong to."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import faceambig as fa
import faceambig.io as fio
from faceambig.errors import AssetError
from faceambig.io.pictures import picture_beside, picture_size
from faceambig.io.schemes import ibug68_of_mesh

POINTS = np.round(np.random.default_rng(2).uniform(1, 640, (68, 2)), 6)
ROWS = [f"{x:.6f} {y:.6f}" for x, y in POINTS]
PHOTO = Path(__file__).resolve().parents[2] / "shared" / "data" / "photos"


def pts(
    rows: list[str] = ROWS, head: str = "version: 1\nn_points:  68\n{\n", tail: str = "\n}\n"
) -> str:
    return head + "\n".join(rows) + tail


@pytest.fixture
def path(tmp_path) -> Path:
    file = tmp_path / "faces.pts"
    file.write_text(pts())
    return file


# .pts


@pytest.mark.parametrize(
    "text",
    [
        pts(),
        pts(tail="\n}"),
        pts().replace("\n", "\r\n"),
        pts().replace(" ", "\t"),
        pts(head="n_points: 68\n{\n"),
        pts(head="version: 1.0\n\nn_points : 68 \n {\n\n"),
        "\ufeff" + pts(),
    ],
    ids=["plain", "no newline", "windows", "tabs", "no version", "spaces", "byte order mark"],
)
def test_the_numbers_of_the_file_are_kept(path, text):
    path.write_bytes(text.encode())
    file = fio.load_landmarks(path)
    assert np.array_equal(file.points, POINTS)  # 300-W counts from 1, and so does the answer
    assert file.scheme == "ibug68"


def test_two_nan_are_a_missing_point(path):
    path.write_text(pts(["NaN nan", *ROWS[1:]]))
    points = fio.load_landmarks(path).points
    assert np.isnan(points[0]).all()
    assert np.array_equal(points[1:], POINTS[1:])


def rows_with(number: int, line: str) -> list[str]:
    """The rows with the one in line `number` of the file replaced."""
    return [*ROWS[: number - 4], line, *ROWS[number - 3 :]]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (pts(rows_with(14, "NaN")), "line 14 of faces.pts: expected two numbers, found 'NaN'"),
        (pts(rows_with(14, "NaN 3")), "line 14 of faces.pts: expected two numbers, found 'NaN 3'"),
        (pts(rows_with(4, "1 2 3")), "line 4 of faces.pts: expected two numbers, found '1 2 3'"),
        (pts(rows_with(71, "1,5 2")), "line 71 of faces.pts: expected two numbers, found '1,5 2'"),
        (pts(rows_with(5, "1 inf")), "line 5 of faces.pts: expected two numbers, found '1 inf'"),
        (
            pts(rows_with(5, "1 1e999")),
            "line 5 of faces.pts: expected two numbers, found '1 1e999'",
        ),
        (
            pts(rows_with(5, "x" * 500 + " 1")),
            "line 5 of faces.pts: expected two numbers, found 'xxx",
        ),
        (pts(tail=""), "faces.pts: ends before }, after 68 points"),
        (pts(ROWS[:40], tail=""), "faces.pts: ends before }, after 40 points"),
        (pts(ROWS[:67]), "faces.pts: n_points says 68, there are 67"),
        (
            pts(ROWS[:5], head="version: 1\n{\n"),
            "faces.pts: 5 points without names; 68 or 51 (iBUG), 468 or 478 (MediaPipe) are accepted",
        ),
        (pts([], head="version: 1\n{\n"), "faces.pts: 0 points without names; 68 or 51 (iBUG)"),
        (pts(tail="\n}\n}\n"), "line 73 of faces.pts: nothing may follow }, found '}'"),
        (
            pts(head="version: 1\nhello\n{\n"),
            "line 2 of faces.pts: expected 'n_points: 68' or {, found 'hello'",
        ),
        (pts(head="version: 1\n"), "line 2 of faces.pts: expected 'n_points: 68' or {"),
        ("", "faces.pts: empty"),
        (" \n\t\n", "faces.pts: empty"),
        ("hello\n", "faces.pts: not a landmark file; .pts (300-W), CSV with a header (x,y or"),
        ("version: 1\n{\n" + "1 1\n" * 20_000 + "}\n", "faces.pts: more than 10000 points"),
        (
            "version: 1\n" + " " * (1 << 20),
            "faces.pts: 1048587 bytes, a landmark file has at most 1048576",
        ),
    ],
)
def test_damage_is_named_with_its_line(path, text, said):
    path.write_text(text)
    with pytest.raises(AssetError, match=re.escape(said)) as caught:
        fio.load_landmarks(path)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 120


def test_other_files_are_refused(path, tmp_path):
    path.write_bytes(b"version: 1\n{\n\xff\xfe\x00")
    with pytest.raises(AssetError, match=r"faces\.pts: not a text file"):
        fio.load_landmarks(path)
    with pytest.raises(AssetError, match=r"nowhere\.pts: cannot be read \(No such file"):
        fio.load_landmarks(tmp_path / "nowhere.pts")
    with pytest.raises(AssetError, match="cannot be read"):
        fio.load_landmarks(tmp_path)


@given(data=st.data())
def test_any_changed_characters_are_one_line_or_68_points(tmp_path_factory, data):
    text = list(pts())
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(text) - 1))
        text[at] = data.draw(st.sampled_from(list("0 1.-e}{\n:nav\x00\u00e9")))
    file = tmp_path_factory.getbasetemp() / "changed.pts"
    file.write_text("".join(text), encoding="utf-8")
    said, points = "", np.zeros((68, 2))
    try:
        points = fio.load_landmarks(file).points
    except AssetError as error:
        said = str(error)
    assert "\n" not in said
    assert points.shape == (68, 2)
    assert not np.isinf(points).any()


# The picture beside it


def picture(file: Path, width: int = 40, height: int = 30) -> Path:
    """A noisy picture in the format of the extension."""
    pixels = np.random.default_rng(0).integers(0, 256, (height, width, 3)).astype(np.uint8)
    done, data = cv2.imencode(file.suffix.lower(), pixels)
    assert done
    file.write_bytes(data.tobytes())
    return file


@pytest.mark.parametrize(
    "extension", [".jpg", ".jpeg", ".png", ".webp", ".bmp", ".tiff", ".JPG", ".PNG"]
)
def test_the_size_is_that_of_the_picture_of_the_same_name(path, extension):
    path.write_text(pts([f"{x:.6f} {y:.6f}" for x, y in POINTS / 32]))
    picture(path.with_suffix(extension))
    picture(path.with_name(f"other{extension}"), 7, 7)
    file = fio.load_landmarks(path)
    assert file.image_size == (40, 30)
    assert file.image_size_from == f"size of faces{extension}"


@pytest.mark.parametrize("beside", [False, True])
def test_a_size_that_is_given_counts(path, beside):
    if beside:  # as for a picture that its EXIF turns, or that has another name
        picture(path.with_suffix(".png"))
    file = fio.load_landmarks(path, image_size=(640, 650))
    assert (file.image_size, file.image_size_from) == ((640, 650), "given")


def test_without_any_size_the_middle_of_the_points_is_announced(path):
    file = fio.load_landmarks(path)
    assert file.image_size is None
    assert file.image_size_from == (
        "no picture beside faces.pts: the middle of the points stands for the middle of the picture"
    )


@pytest.mark.parametrize("size", [(0, 480), (640, -1), (640,), (1, 2, 3)])
def test_an_impossible_size_is_refused(path, size):
    with pytest.raises(ValueError, match=r"image_size: .* is not a width and a height in pixels"):
        fio.load_landmarks(path, image_size=size)


@pytest.mark.parametrize(("extension", "options"), [
    (".webp", [cv2.IMWRITE_WEBP_QUALITY, 101]),  # lossless
    (".webp", [cv2.IMWRITE_WEBP_QUALITY, 50]),
    (".jpg", [cv2.IMWRITE_JPEG_PROGRESSIVE, 1]),
])  # fmt: skip
def test_every_flavour_tells_its_size(path, extension, options):
    pixels = np.random.default_rng(0).integers(0, 256, (301, 257, 3)).astype(np.uint8)
    data = cv2.imencode(extension, pixels, options)[1].tobytes()
    assert picture_size(written(path.with_suffix(extension), data)) == (257, 301)


def written(file: Path, data: bytes) -> Path:
    file.write_bytes(data)
    return file


def test_the_size_stands_behind_long_remarks(path):
    jpeg = picture(path.with_suffix(".jpg")).read_bytes()
    # a segment as EXIF writes it, with a thumbnail whose size is not that of the picture
    thumbnail = picture(path.with_name("thumbnail.jpg"), 7, 7).read_bytes()
    remark = b"\xff\xe1\xff\xff" + thumbnail.ljust(0xFFFF - 2, b"\x00")
    long = jpeg[:2] + 5 * remark + b"\xff" + jpeg[2:]
    assert picture_size(written(path.with_suffix(".jpg"), long)) == (40, 30)


def test_a_table_before_the_size_is_not_the_size(path):
    jpeg = picture(path.with_suffix(".jpg")).read_bytes()
    tables = b"\xff\xc4\x00\x0b" + bytes(9) + b"\xff\xcc\x00\x04\x00\x00"  # Huffman, arithmetic
    assert picture_size(written(path.with_suffix(".jpg"), jpeg[:2] + tables + jpeg[2:])) == (40, 30)


def test_an_extended_webp_tells_its_canvas(path):
    data = (
        b"RIFF\x00\x00\x00\x00WEBPVP8X\x0a\x00\x00\x00\x00\x00\x00\x00"
        + (256).to_bytes(3, "little")
        + (300).to_bytes(3, "little")
    )
    assert picture_size(written(path.with_suffix(".webp"), data)) == (257, 301)


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"not a picture",
        b"\x89PNG\r\n\x1a\n",
        b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR" + bytes(8),  # 0 x 0
        b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR" + b"\xff" * 8,  # 4 billion squared
        b"\xff\xd8\xff\xe0\x00\x00" * 3,
        b"\xff\xd8\xff\xda" + bytes(100),
        b"\xff\xd8\xff\xda\x00\x02\xff\xc0\x00\x0b\x08\x00\x05\x00\x05\x01\x01\x11\x00",  # after the pixels
        b"RIFF\x00\x00\x00\x00WEBPVP8?" + bytes(30),
    ],
)
def test_a_picture_that_tells_no_size_is_named(path, data):
    written(path.with_suffix(".png"), data)
    with pytest.raises(AssetError, match=r"faces\.png: not a picture whose size can be read"):
        fio.load_landmarks(path)


def test_a_folder_is_no_picture(path):
    path.with_suffix(".jpg").mkdir()
    assert picture_beside(path) is None
    with pytest.raises(AssetError, match="cannot be read"):
        picture_size(path.with_suffix(".jpg"))


@pytest.mark.skipif(not PHOTO.is_dir(), reason="no photo in ../shared/data/photos")
def test_a_real_photograph_is_read():
    file = fio.load_landmarks(PHOTO / "image_0010.pts")
    assert file.image_size == (1280, 1024)
    assert file.image_size_from == "size of image_0010.jpg"
    assert np.array_equal(file.points[0], [611.284152, 272.773913])
    # its own README: outer eye corners 182.0 px apart
    assert np.linalg.norm(file.points[45] - file.points[36]) == pytest.approx(182.0, abs=0.05)
    assert fa.Observation(file.points, file.scheme, image_size=file.image_size).visible.all()


# Which points they are


def json_file(folder: Path, value: object) -> Path:
    return written(folder / "face.json", json.dumps(value).encode())


MESH = np.random.default_rng(4).uniform(0.2, 0.8, (478, 2))
JAW = tuple(str(k) for k in range(1, 18))


def test_51_points_are_the_last_of_68(path):
    path.write_text(pts(ROWS[17:], head="version: 1\n{\n"))
    file = fio.load_landmarks(path)
    assert file.points.shape == (68, 2)
    assert np.array_equal(file.points[17:], POINTS[17:])
    assert np.isnan(file.points[:17]).all()
    assert file.words == "51 of 68 points used; 17 not in the file (1 to 17)"


@pytest.mark.parametrize("count", [468, 478])
def test_a_face_mesh_becomes_the_points_of_ibug_without_the_jaw(tmp_path, count):
    file = fio.load_landmarks(json_file(tmp_path, MESH[:count].tolist()), image_size=(1000, 500))
    assert file.scheme == "ibug68"
    assert file.names == tuple(str(k) for k in range(1, 69))
    xy = MESH * [1000, 500]
    # eye corners, nose tip, mouth corners: 36, 45, 30, 48, 54 from 0
    assert np.array_equal(file.points[[36, 45, 30, 48, 54]], xy[[33, 263, 4, 61, 291]])
    assert file.points[27] == pytest.approx((xy[168] + xy[6]) / 2, rel=1e-15)
    assert np.array_equal(file.points[[31, 35]], xy[[98, 327]])  # the better rows
    assert file.left_out == {"of the jaw, where MediaPipe's outline runs nearer the ear": JAW}
    assert file.words.startswith("51 of 68 points used; 17 of the jaw, where MediaPipe's outline")
    assert file.unit == "fractions of the picture of 1000 x 500 pixels"


@pytest.mark.parametrize(
    ("first", "names"),
    [(1, None), (1, range(1, 69)), (0, range(68)), (1, [f"{k:02d}" for k in range(1, 69)])],
)
def test_numbers_are_those_of_ibug_from_one_or_all_from_zero(tmp_path, first, names):
    rows = [{"x": x, "y": y} for x, y in POINTS.tolist()]
    if names is not None:
        rows = [{"name": name, **row} for name, row in zip(names, rows, strict=True)][::-1]
    file = fio.load_landmarks(json_file(tmp_path, rows))
    assert np.array_equal(file.points, POINTS)


def test_some_numbered_points_are_laid_out_and_the_others_missing(tmp_path):
    some = {str(k): POINTS[k - 1].tolist() for k in (46, 9, 31, 37, 40, 43, 49, 55)}
    file = fio.load_landmarks(json_file(tmp_path, {"points": some | {"1": None}}))
    assert np.array_equal(
        np.flatnonzero(~np.isnan(file.points[:, 0])) + 1, sorted(map(int, set(some)))
    )
    assert file.words.startswith(
        "8 of 68 points used; 60 not in the file (1, 2, 3, 4, 5, 6, 7, 8 and 52 more)"
    )


def test_named_points_of_a_mesh_are_taken_from_it(tmp_path):
    some = {str(k): MESH[k].tolist() for k in range(478) if k not in (4, 33)}
    file = fio.load_landmarks(json_file(tmp_path, {"points": some}), image_size=(100, 100))
    assert file.left_out["not in the file"] == ("31", "37")
    assert file.used == 49


def test_farkas_points_are_matched_by_name(tmp_path, embedded):
    scheme = embedded.scheme("farkas")
    view = fa.observe(embedded.subject(1), distance=0.6, scheme="farkas")
    some = [k for k, name in enumerate(scheme.points) if name[0] in "nespc"][::-1]
    text = "name,x,y\n" + "\n".join(
        f"{scheme.points[k]},{view.points[k, 0]:.9f},{view.points[k, 1]:.9f}" for k in some
    )
    path = written(tmp_path / "face.csv", f"{text}\nwart,1,2\n".encode())
    alone = fio.load_landmarks(path)
    assert alone.names == (*(scheme.points[k] for k in some), "wart")
    file = fio.load_landmarks(path, model=embedded)
    assert (file.scheme, file.names) == ("farkas", scheme.points)
    assert np.abs(file.points[some] - view.points[some]).max() < 1e-9
    assert file.words == (
        f"{len(some)} of {len(some) + 1} points used; 1 without a vertex in scheme farkas of embedded (wart)"
    )
    fit = fa.fit(embedded, fa.Observation(file.points, file.scheme, view.image_size), distance=0.6)
    assert fit.converged
    assert fit.d_l_percent < 1


def test_a_model_with_some_of_the_points_gets_those(path, embedded):
    whole = embedded.scheme("ibug68")
    keep = [8, 27, 30, 33, 36, 39, 42, 45, 48, 54]
    part = fa.Scheme(
        "ibug68", tuple(whole.points[k] for k in keep), whole.vertices[keep],
        tuple(whole.sides[k] for k in keep), ((4, 5), (6, 7)), whole.eyes_meaning,
    )  # fmt: skip
    model = replace(embedded, name="part", schemes={"ibug68": part})
    file = fio.load_landmarks(path, model=model)
    assert np.array_equal(file.points, POINTS[keep])
    assert file.words.startswith(
        "10 of 68 points used; 58 without a vertex in scheme ibug68 of part (1, 2,"
    )
    assert (
        fa.Observation(file.points, file.scheme).vertices(model).tolist() == part.vertices.tolist()
    )


def test_points_no_model_knows_are_refused(tmp_path, embedded):
    names = {f"wart{k}": [k, k * k] for k in range(9)}
    path = json_file(tmp_path, {"points": names})
    with pytest.raises(
        AssetError, match=r"face\.json: 0 of 9 points used; 9 without a vertex in scheme farkas of"
    ):
        fio.load_landmarks(path, model=embedded)
    path = json_file(tmp_path, {"scheme": "warts", "points": names})
    assert fio.load_landmarks(path).scheme == "warts"
    with pytest.raises(
        ValueError, match="unknown scheme 'warts': this model has ibug68, farkas or mediapipe"
    ):
        fio.load_landmarks(path, model=embedded)


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (POINTS[:67].tolist(), "67 points without names; 68 or 51 (iBUG), 468 or 478 (MediaPipe)"),
        (MESH[:470].tolist(), "470 points without names"),
        ({"scheme": "farkas", "points": POINTS.tolist()}, "68 points of scheme 'farkas' without names"),
        ({"scheme": "ibug68", "points": MESH.tolist()}, "478 points of scheme 'ibug68' without names"),
        ({"points": {"1": [3, 4], "69": [1, 2]}}, "point 69 is not within 1 to 68"),
        ({"points": {"0": [3, 4], "9": [1, 2]}}, "point 0 is not within 1 to 68"),
        ({"points": {"1": [3, 4], "01": [1, 2]}}, "a point is named twice"),
        ({"points": {str(k): [k, k] for k in range(420, 500)}}, "point 478 is not within 0 to 477"),
        ({"scheme": "jawline", "points": {"ex_r": [3, 4]}}, "point 'ex_r' is not a number, those of jawline"),
        ({"scheme": "ibug68", "image_size": [640, 0], "points": []}, "image_size [640, 0] is not [width, height]"),
        ({"scheme": "ibug68", "image_size": [640, True], "points": []}, "image_size [640, True] is not"),
        ({"scheme": "ibug68", "image_size": "640x480", "points": []}, "image_size '640x480' is not"),
        ({"scheme": 68, "points": POINTS.tolist()}, "scheme 68 is not a name"),
        ({"points": {}}, "face.json: no points"),
    ],
)  # fmt: skip
def test_other_points_are_refused_with_what_is_accepted(tmp_path, value, said):
    with pytest.raises(AssetError, match=re.escape(said)) as caught:
        fio.load_landmarks(json_file(tmp_path, value))
    assert str(caught.value).startswith("face.json: ")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 150


# Pixels, fractions, and the edge of the picture


def test_fractions_are_multiplied_by_the_size_of_the_picture(tmp_path, path):
    picture(tmp_path / "face.png", 40, 30)
    file = fio.load_landmarks(json_file(tmp_path, (POINTS / 640).tolist()))
    assert np.abs(file.points - POINTS / 640 * [40, 30]).max() < 1e-13
    assert file.unit == "fractions of the picture of 40 x 30 pixels"
    assert file.image_size_from == "size of face.png"
    assert fio.load_landmarks(path).unit == "pixels"


def test_fractions_of_an_unknown_picture_are_refused_with_the_way(tmp_path):
    path = json_file(tmp_path, MESH.tolist())
    with pytest.raises(
        AssetError, match=r"^face\.json: coordinates from 0\.2\d* to 0\.\d+ are fractions of the"
    ) as caught:
        fio.load_landmarks(path)
    assert "give its size (--image-size 640x480), or put it beside the file" in str(caught.value)


@pytest.mark.parametrize("shift", [-0.4, 0.4])
def test_a_mesh_that_leaves_the_picture_is_still_of_fractions(tmp_path, shift):
    path = json_file(tmp_path, (MESH + np.array([shift, 0])).tolist())
    file = fio.load_landmarks(path, image_size=(1000, 1000))
    (gone,) = (names for reason, names in file.left_out.items() if reason == "outside the picture")
    rows = [int(name) - 1 for name in gone]
    inner = ibug68_of_mesh(MESH)[17:, 0] + shift
    assert sorted(rows) == (np.flatnonzero((inner < -0.001) | (inner > 1.001)) + 17).tolist()
    assert np.isnan(file.points[rows]).all()
    assert f"; {len(gone)} outside the picture (" in file.words


@pytest.mark.parametrize("points", [2 * MESH - 1, MESH - 0.6])  # of -1 to 1, or about the middle
def test_coordinates_that_are_neither_are_refused(tmp_path, points):
    path = json_file(tmp_path, points.tolist())
    with pytest.raises(
        AssetError, match=r"face\.json: coordinates from -0\.\d+ to 0\.\d+ are neither pixels nor"
    ):
        fio.load_landmarks(path, image_size=(1000, 1000))


def test_points_outside_the_picture_are_said_and_left_out(path):
    moved = POINTS.copy()
    moved[2] = [-20, 10]
    moved[3] = [10, 650.9]
    moved[4] = [640.9, 650.9]  # counted from 1, the last pixel's far edge is at 650.5
    path.write_text(pts([f"{x:.6f} {y:.6f}" for x, y in moved]))
    file = fio.load_landmarks(path, image_size=(661, 650))
    assert file.left_out == {"outside the picture": ("3",)}
    assert file.words == "67 of 68 points used; 1 outside the picture (3)"
    assert np.isnan(file.points[2]).all()
    assert np.array_equal(file.points[3:], moved[3:])


def test_a_picture_smaller_than_the_face_is_refused(path):
    box = np.ptp(POINTS, axis=0)
    for size in ((600, 700), (700, 600)):
        with pytest.raises(
            AssetError,
            match=r"^faces\.pts: the points span [\d.]+ x [\d.]+ pixels, the picture has",
        ) as caught:
            fio.load_landmarks(path, image_size=size)
        assert f"{size[0]} x {size[1]} (given); is it the picture of these points?" in str(
            caught.value
        )
    assert fio.load_landmarks(path, image_size=tuple(np.ceil(box).astype(int).tolist())).used > 60
    picture(path.with_suffix(".png"))
    with pytest.raises(AssetError, match=r"has 40 x 30 \(size of faces\.png\); is it"):
        fio.load_landmarks(path)


def test_a_face_outside_the_picture_is_refused_with_the_count(path):
    path.write_text(pts([f"{x + 5000:.6f} {y:.6f}" for x, y in POINTS]))
    with pytest.raises(
        AssetError, match=r"0 of 68 points used; 68 outside the picture \(1 to 68\); 6 are needed"
    ):
        fio.load_landmarks(path, image_size=(800, 800))


# Our own file


def test_what_is_saved_is_read_again(tmp_path, path):
    points = POINTS.copy()
    points[5] = np.nan
    first = fio.LandmarkFile(points, "ibug68", (640, 660))
    fio.save_landmarks(first, tmp_path / "face.json")
    again = fio.load_landmarks(tmp_path / "face.json")
    assert np.array_equal(again.points, points, equal_nan=True)  # bit by bit
    assert (again.scheme, again.names, again.image_size) == ("ibug68", first.names, (640, 660))
    assert again.image_size_from == "said by face.json"
    assert again.words == "67 of 68 points used; 1 not in the file (6)"
    value = json.loads((tmp_path / "face.json").read_text())
    assert (value["format"], value["version"]) == ("faceambig-landmarks", 1)
    assert value["points"]["6"] is None
    assert [file.name for file in tmp_path.iterdir() if file.name.startswith(".")] == []
    farkas = fio.LandmarkFile(POINTS[:4], "farkas", names=("n", "ex_r", "ex_l", "sn"))
    fio.save_landmarks(farkas, tmp_path / "face.json")
    again = fio.load_landmarks(tmp_path / "face.json")
    assert (again.scheme, again.names, again.image_size) == ("farkas", farkas.names, None)
    assert np.array_equal(again.points, farkas.points)


def test_points_of_another_picture_are_refused(tmp_path):
    fio.save_landmarks(fio.LandmarkFile(POINTS, "ibug68", (640, 660)), tmp_path / "face.json")
    assert fio.load_landmarks(tmp_path / "face.json", image_size=(640, 660)).used == 68
    said = r"face\.json: made for a picture of 640 x 660 pixels, this one has 1280 x 1320 \(given\)"
    with pytest.raises(AssetError, match=said):
        fio.load_landmarks(tmp_path / "face.json", image_size=(1280, 1320))
    picture(tmp_path / "face.png")
    with pytest.raises(AssetError, match=r"this one has 40 x 30 \(size of face\.png\)"):
        fio.load_landmarks(tmp_path / "face.json")


def test_a_later_version_of_our_file_is_refused(tmp_path):
    path = json_file(tmp_path, {"format": "faceambig-landmarks", "version": 2, "points": []})
    with pytest.raises(
        AssetError, match=r"face\.json: version 2 of faceambig-landmarks; 1 is read"
    ):
        fio.load_landmarks(path)
