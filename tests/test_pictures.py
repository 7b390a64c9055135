"""Photographs: formats, orientation, depths and damage, each against Pillow or by what was written into the file."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image, ImageOps

from damage import cases
from faceambig import AssetError
from faceambig.io import pictures
from faceambig.io.pictures import Picture, is_picture, picture_size, read_picture

PIXELS = np.random.default_rng(3).integers(0, 256, (21, 34, 3)).astype(np.uint8)
# Smooth, so that JPEG keeps it: a ramp along each axis
RAMPS = np.stack(
    np.broadcast_arrays(
        np.linspace(20, 230, 64)[None], np.linspace(230, 20, 48)[:, None], np.full((48, 64), 90.0)
    ),
    axis=-1,
).astype(np.uint8)


def saved(path: Path, picture: Image.Image, kind: str, **options) -> Path:
    picture.save(path, kind, **options)
    return path


def exif(turn: int = 1, focal: object = None) -> Image.Exif:
    tags = Image.Exif()
    tags[0x0112] = turn
    if focal is not None:
        tags.get_ifd(0x8769)[0xA405] = focal
    return tags


@pytest.mark.parametrize(
    ("kind", "options"), [("PNG", {}), ("BMP", {}), ("WEBP", {"lossless": True})]
)
def test_lossless_formats_give_the_pixels_back(tmp_path, kind, options):
    path = saved(tmp_path / "a.bin", Image.fromarray(PIXELS), kind, **options)
    picture = read_picture(path)
    assert is_picture(path)
    assert np.array_equal(picture.rgb, PIXELS)
    assert picture.size == picture_size(path) == (34, 21)
    assert (picture.name, picture.notes, picture.focal_px) == ("a.bin", (), None)
    with pytest.raises(ValueError, match="read-only"):
        picture.rgb[0] = 0


def test_a_jpeg_is_read(tmp_path):
    picture = read_picture(saved(tmp_path / "a.jpg", Image.fromarray(RAMPS), "JPEG", quality=95))
    # JPEG's own loss: chroma at half size
    assert np.abs(picture.rgb.astype(int) - RAMPS).max() <= 12


@pytest.mark.parametrize("kind", ["JPEG", "PNG", "WEBP"])
@pytest.mark.parametrize("turn", range(1, 9))
def test_a_picture_is_turned_as_its_camera_says(tmp_path, kind, turn):
    path = saved(tmp_path / "a.bin", Image.fromarray(RAMPS), kind, exif=exif(turn))
    with Image.open(path) as stored:
        upright = np.asarray(ImageOps.exif_transpose(stored).convert("RGB"))
    picture = read_picture(path)
    assert np.array_equal(picture.rgb, upright)
    assert picture.size == picture_size(path) == ((48, 64) if turn >= 5 else (64, 48))
    assert picture.notes == (() if turn == 1 else (f"turned upright (EXIF orientation {turn})",))


@pytest.mark.parametrize("order", ["II", "MM"])
def test_the_size_of_a_turned_jpeg_is_known_in_either_byte_order(tmp_path, order):
    path = saved(tmp_path / "a.jpg", Image.fromarray(RAMPS), "JPEG")
    mark = "<" if order == "II" else ">"
    tiff = order.encode() + struct.pack(mark + "HIHHHIHH", 42, 8, 1, 0x0112, 3, 1, 6, 0) + bytes(4)
    data = b"Exif\x00\x00" + tiff
    jpeg = path.read_bytes()
    path.write_bytes(jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(data) + 2) + data + jpeg[2:])
    assert picture_size(path) == read_picture(path).size == (48, 64)


@pytest.mark.parametrize("turn", [0, 9, 65535])
def test_a_senseless_orientation_is_none(tmp_path, turn):
    path = saved(tmp_path / "a.jpg", Image.fromarray(RAMPS), "JPEG", exif=exif(turn))
    assert read_picture(path).size == picture_size(path) == (64, 48)


def test_a_focal_length_compares_diagonals(tmp_path):
    path = saved(tmp_path / "a.jpg", Image.fromarray(RAMPS), "JPEG", exif=exif(6, 43))
    picture = read_picture(path)
    assert picture.focal_35mm == 43
    # 80 pixels of diagonal; film of 36 x 24 mm has 43.27 mm of it
    assert picture.focal_px == pytest.approx(43 * 80 / np.hypot(36, 24), rel=1e-12)
    half = Picture("b", RAMPS[::2, ::2], 43.0)
    assert half.focal_px == pytest.approx(43 * 40 / np.hypot(36, 24), rel=1e-12)


@pytest.mark.parametrize("focal", [0, 1, 60000, "26"])
def test_a_senseless_focal_length_is_none(tmp_path, focal):
    path = saved(tmp_path / "a.jpg", Image.fromarray(RAMPS), "JPEG", exif=exif(1, focal))
    assert read_picture(path).focal_px is None


def test_sixteen_bits_of_grey_become_eight_not_white(tmp_path):
    grey = np.linspace(0, 65535, 600).reshape(20, 30).astype(np.uint16)
    path = tmp_path / "a.png"
    path.write_bytes(cv2.imencode(".png", grey)[1].tobytes())
    picture = read_picture(path)
    assert np.array_equal(picture.rgb, np.repeat((grey >> 8).astype(np.uint8)[..., None], 3, 2))
    assert picture.notes == ("16 bits reduced to 8",)


def test_sixteen_bits_of_colour_become_eight(tmp_path):
    deep = (PIXELS.astype(np.uint16) << 8) + 7
    path = tmp_path / "a.png"
    path.write_bytes(cv2.imencode(".png", deep[..., ::-1])[1].tobytes())
    assert np.array_equal(read_picture(path).rgb, PIXELS)


def test_cmyk_is_converted(tmp_path):
    path = saved(tmp_path / "a.jpg", Image.fromarray(RAMPS).convert("CMYK"), "JPEG", quality=98)
    picture = read_picture(path)
    assert np.abs(picture.rgb.astype(int) - RAMPS).max() <= 8  # loss of JPEG
    assert picture.notes == ("CMYK converted to RGB",)


def test_what_is_transparent_lies_on_white(tmp_path):
    alpha = np.zeros((*PIXELS.shape[:2], 4), dtype=np.uint8)
    alpha[..., :3], alpha[:10, :, 3], alpha[10:15, :, 3] = PIXELS, 255, 128
    picture = read_picture(saved(tmp_path / "a.png", Image.fromarray(alpha), "PNG"))
    assert np.array_equal(picture.rgb[:10], PIXELS[:10])
    assert (picture.rgb[15:] == 255).all()
    half = PIXELS[10:15] * (128 / 255) + 255 * (127 / 255)
    assert np.abs(picture.rgb[10:15] - half).max() <= 1  # rounded once more by Pillow
    assert picture.notes == ("transparency laid on white",)


def test_a_palette_with_a_transparent_colour_lies_on_white(tmp_path):
    picture = Image.fromarray((np.arange(12).reshape(3, 4) % 3).astype(np.uint8), "L").convert("P")
    picture.putpalette([255, 0, 0, 0, 255, 0, 0, 0, 255])
    read = read_picture(saved(tmp_path / "a.png", picture, "PNG", transparency=1))
    assert read.rgb[0, :3].tolist() == [[255, 0, 0], [255, 255, 255], [0, 0, 255]]


@pytest.mark.parametrize("mode", ["1", "L", "P", "LA"])
def test_grey_and_painted_pictures_are_read(tmp_path, mode):
    made = Image.fromarray(PIXELS).convert(mode)
    read = read_picture(saved(tmp_path / "a.png", made, "PNG"))
    assert np.array_equal(read.rgb, np.asarray(made.convert("RGB")))


def test_one_pixel_is_a_picture(tmp_path):
    path = saved(tmp_path / "a.png", Image.new("RGB", (1, 1), (9, 8, 7)), "PNG")
    assert read_picture(path).rgb.tolist() == [[[9, 8, 7]]]


def header(kind: str, width: int, height: int) -> bytes:
    """The beginning of a picture that claims a size; no pixel follows."""
    if kind == "png":
        data = b"IHDR" + struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
        return b"\x89PNG\r\n\x1a\n\x00\x00\x00\r" + data + struct.pack(">I", zlib.crc32(data))
    if kind == "jpg":
        return b"\xff\xd8\xff\xc0\x00\x11\x08" + struct.pack(">HH", height, width) + bytes(12)
    if kind == "bmp":
        return b"BM" + struct.pack("<IIIIiiHHIIiiII", 54, 0, 54, 40, width, height, 1, 24, *[0] * 6)
    extended = (width - 1).to_bytes(3, "little") + (height - 1).to_bytes(3, "little")
    return b"RIFF\x00\x00\x00\x00WEBPVP8X\x0a\x00\x00\x00\x00\x00\x00\x00" + extended


@pytest.mark.parametrize("kind", ["png", "jpg", "bmp", "webp"])
def test_a_picture_of_400_million_pixels_is_refused_by_its_header(tmp_path, kind, monkeypatch):
    def decode(*_: object) -> None:
        raise AssertionError("decoded")

    monkeypatch.setattr(pictures, "_rgb", decode)
    path = tmp_path / f"a.{kind}"
    path.write_bytes(header(kind, 20_000, 20_000))
    said = f"a.{kind}: 20000 x 20000 is 400 million pixels, 52 are accepted; make it smaller"
    with pytest.raises(AssetError) as error:
        read_picture(path)
    assert str(error.value) == said


def encoded(kind: str) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(PIXELS).save(stream, kind)
    return stream.getvalue()


WHOLE = {kind: encoded(kind) for kind in ("JPEG", "PNG", "WEBP", "BMP")}


@pytest.mark.parametrize("kind", WHOLE)
@pytest.mark.parametrize("share", [0.05, 0.3, 0.6, 0.9])
def test_a_truncated_picture_is_named(tmp_path, kind, share):
    path = tmp_path / "cut.jpg"
    path.write_bytes(WHOLE[kind][: int(share * len(WHOLE[kind]))])
    with pytest.raises(AssetError, match=r"cut\.jpg: ") as error:
        read_picture(path)
    assert "\n" not in str(error.value)
    assert str(tmp_path) not in str(error.value)


@cases(150)
@given(
    kind=st.sampled_from(sorted(WHOLE)),
    changes=st.lists(st.tuples(st.integers(0, 1500), st.integers(0, 255)), max_size=6),
    length=st.integers(0, 4000),
)
def test_damage_gives_a_picture_or_one_line(tmp_path_factory, kind, changes, length):
    data = bytearray(WHOLE[kind][:length])
    for at, value in changes:
        if at < len(data):
            data[at] = value
    path = tmp_path_factory.getbasetemp() / "a.jpg"
    path.write_bytes(data)
    said = ""
    try:
        assert read_picture(path).rgb.ndim == 3
    except AssetError as error:
        said = str(error)
    assert "\n" not in said
    assert len(said) < 250


@pytest.mark.parametrize(
    ("data", "pictured"),
    [
        (b"", False),
        (b"version: 1\n", False),
        (b"\x00\x00\x00\x18ftypheic" + bytes(40), True),
        (b"GIF89a" + bytes(40), True),
    ],
)
def test_other_files_are_refused_with_what_is_accepted(tmp_path, data, pictured):
    path = tmp_path / "a.heic"
    path.write_bytes(data)
    assert is_picture(path) == pictured
    with pytest.raises(AssetError, match=r"a\.heic: not a picture.*JPEG, PNG, WebP and BMP"):
        read_picture(path)


def test_a_tiff_tells_its_size_and_is_not_decoded(tmp_path):
    path = saved(tmp_path / "a.tif", Image.fromarray(PIXELS), "TIFF")
    assert picture_size(path) == (34, 21)
    assert is_picture(path)
    with pytest.raises(AssetError, match=r"a\.tif: .*JPEG, PNG, WebP and BMP are accepted"):
        read_picture(path)


def test_missing_files_and_folders_are_named(tmp_path):
    for path in (tmp_path / "none.jpg", tmp_path):
        assert not is_picture(path)
        with pytest.raises(AssetError, match="cannot be read"):
            read_picture(path)
