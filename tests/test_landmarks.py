"""Landmark files of pictures (.pts), the size of the picture beside them, and the schemes of models."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import faceambig as fa
import faceambig.io as fio
from faceambig.errors import AssetError
from faceambig.io.landmarks import check_scheme, load_scheme
from faceambig.io.pictures import picture_beside, picture_size

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
        (pts(ROWS[:5], head="version: 1\n{\n"), "faces.pts: 5 points; 68 (iBUG) are accepted"),
        (pts([], head="version: 1\n{\n"), "faces.pts: 0 points; 68 (iBUG) are accepted"),
        (pts(tail="\n}\n}\n"), "line 73 of faces.pts: nothing may follow }, found '}'"),
        (
            pts(head="version: 1\nhello\n{\n"),
            "line 2 of faces.pts: expected 'n_points: 68' or {, found 'hello'",
        ),
        (pts(head="version: 1\n"), "line 2 of faces.pts: expected 'n_points: 68' or {"),
        ("", "faces.pts: not a landmark file; .pts (300-W) is accepted"),
        ("x,y\n1,2\n", "faces.pts: not a landmark file"),
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
    picture(path.with_suffix(extension))
    picture(path.with_name(f"other{extension}"), 7, 7)
    file = fio.load_landmarks(path, image_size=(640, 480))
    assert file.image_size == (40, 30)
    assert file.image_size_from == f"size of faces{extension}"


def test_without_a_picture_the_given_size_counts(path):
    file = fio.load_landmarks(path, image_size=(640, 480))
    assert (file.image_size, file.image_size_from) == ((640, 480), "given")


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


# Schemes of models

SCHEME = """# a remark, with, commas
name,side,vertex,definition,confidence
n,mid,3,"root, of the nose",high

ex,right,0,corner,low
ex,left,1,corner,low
en,right,2,corner,low
en,left,4,corner,low
"""


@pytest.fixture
def table(tmp_path) -> Path:
    return written(tmp_path / "small_farkas.csv", SCHEME.encode())


def test_a_point_of_both_sides_is_named_by_its_side(table):
    scheme = load_scheme(table, "farkas")
    assert scheme.name == "farkas"
    assert scheme.points == ("n", "ex_r", "ex_l", "en_r", "en_l")
    assert scheme.vertices.tolist() == [3, 0, 1, 2, 4]
    assert scheme.sides == ("mid", "right", "left", "right", "left")
    assert scheme.eyes == ((1, 3), (4, 2))
    assert scheme.eyes_meaning == "mean of the outer and inner corner of each eye (ex, en)"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "name,side",
            "name;side",
            "small_farkas.csv: expected the columns name, side, vertex, found name;side,vertex",
        ),
        (SCHEME, "", "small_farkas.csv: expected the columns name, side, vertex, found "),
        (
            "ex,right,0",
            "ex,west,0",
            "line 5 of small_farkas.csv: expected a side (right, left, mid) and a vertex number",
        ),
        (
            "ex,right,0",
            "ex,right,-1",
            "line 5 of small_farkas.csv: expected a side (right, left, mid) and a vertex",
        ),
        ("ex,right,0", "ex,right,1.5", "found 'right', '1.5'"),
        ("ex,right,0", "ex,right", "line 5 of small_farkas.csv: 4 cells, the header has 5"),
        ("ex,right,0", "x" * 200_000, "line 5 of small_farkas.csv: 0 cells, the header has 5"),
        ("ex,left", "ex,right", "small_farkas.csv: point 'ex_r' is named twice"),
        ("en,", "em,", "small_farkas.csv: no eye corners among the points"),
    ],
)
def test_a_damaged_scheme_is_named_with_its_line(table, old, new, said):
    table.write_text(SCHEME.replace(old, new))
    with pytest.raises(AssetError, match=re.escape(said)):
        load_scheme(table, "farkas")


def test_a_vertex_that_the_model_lacks_is_refused(table):
    scheme = load_scheme(table, "farkas")
    assert check_scheme(scheme, 5, table.name) is scheme
    with pytest.raises(AssetError, match=r"small_farkas\.csv: vertex 4 is not within 0 to 3"):
        check_scheme(scheme, 4, table.name)
