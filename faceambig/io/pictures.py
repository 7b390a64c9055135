"""Photographs: the one beside a landmark file, its size without decoding a pixel, and its pixels, upright.

Pixel coordinates count from the upper left corner of the upright picture: the first pixel spans 0 to 1. Upright is what
every viewer shows: where the camera says in the file that it was held turned (EXIF), the picture is turned back.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import read_only
from ..errors import AssetError

if TYPE_CHECKING:
    from PIL import Image

EXTENSIONS = (".jpg", ".jpeg", ".png", ".webp", ".bmp", ".tif", ".tiff")
HEADER_BYTES = 1 << 20  # JPEG: EXIF, thumbnails and colour profiles stand before the size
MAX_SIDE = 65_535  # of a JPEG; larger sizes in other formats are damage or an attack
# Decoded: the largest telephones have 50; at the worst 1.1 GB while converted
MAX_PIXELS = 52_000_000
# Pixels are decoded of these; of TIFF only the size is read: libtiff reports damage to stderr by itself
FORMATS = ("JPEG", "PNG", "WEBP", "BMP")
WEB_FORMATS = ("JPEG", "PNG", "WEBP")  # of them, what people have on a telephone
NAMED = "JPEG, PNG, WebP and BMP are accepted"
# First bytes of pictures; those that are not accepted are still told apart from landmarks
STARTS = (b"\xff\xd8\xff", b"\x89PNG\r\n\x1a\n", b"BM", b"II*\x00", b"MM\x00*", b"GIF8")

# EXIF (CIPA DC-008): the picture as stored has to be turned like this; then tags of the focal length
ORIENTATION, EXIF_FOLDER, FOCAL_35MM = 0x0112, 0x8769, 0xA405
SIDEWAYS = (5, 6, 7, 8)  # orientations whose width and height change places
FOCAL_RANGE = (5.0, 3000.0)  # mm in 35 mm terms; 0 is EXIF's "unknown"
# Millimetres: equivalent focal lengths compare diagonals (CIPA DCG-001)
DIAGONAL_35MM = math.hypot(36.0, 24.0)
DAMAGED = (
    OSError,
    SyntaxError,
    ValueError,
    TypeError,
    EOFError,
    LookupError,
    ArithmeticError,
    MemoryError,
)


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """A photograph, upright, 8 bits a channel. H rows, W columns."""

    name: str  # of the file, without its folder
    rgb: NDArray[np.uint8]  # (H, W, 3) sRGB
    focal_35mm: float | None = None  # mm in terms of 35 mm film, as EXIF has it
    notes: tuple[str, ...] = ()  # what was done to the pixels, in words

    def __post_init__(self) -> None:
        object.__setattr__(self, "rgb", read_only(self.rgb))

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, pixels."""
        return self.rgb.shape[1], self.rgb.shape[0]

    @property
    def focal_px(self) -> float | None:
        """The focal length EXIF tells, in pixels, if the picture is all that the lens drew; None if it tells none.

        An equivalent focal length compares diagonals, so scaling a picture changes nothing; a cropped or digitally
        zoomed one has a longer focal length than this.
        """
        if self.focal_35mm is None:
            return None
        return self.focal_35mm / DIAGONAL_35MM * math.hypot(*self.size)


def is_picture(path: Path) -> bool:
    """Whether the file begins like a picture, of an accepted format or not; False if it cannot be read."""
    try:
        with path.open("rb") as stream:
            head = stream.read(16)
    except OSError:
        return False
    # the last is HEIF, of telephones
    return head.startswith(STARTS) or head[8:12] == b"WEBP" or head[4:8] == b"ftyp"


def read_picture(path: Path) -> Picture:
    """The picture at `path`, turned upright, as 8-bit RGB.

    16 bits a channel are reduced to 8, CMYK is converted, transparent parts are laid on white, and `notes` says so.
    Colour profiles are not applied. Size and format are checked in the header, before a pixel is decoded.

    Raises
    ------
    AssetError: no picture of an accepted format, damaged or cut off, or of more than MAX_PIXELS.
    RuntimeError: Pillow is not installed.
    """
    return _decoded(path, path.name, picture_size(path), FORMATS, MAX_PIXELS)


def decode_picture(
    data: bytes,
    *,
    name: str = "picture",
    formats: tuple[str, ...] = FORMATS,
    max_pixels: int = MAX_PIXELS,
) -> Picture:
    """As `read_picture`, of the bytes of a file: nothing is written. formats: of FORMATS, those that are accepted."""
    size = _told_size(data[:HEADER_BYTES], name, BytesIO(data))
    return _decoded(BytesIO(data), name, size, formats, max_pixels)


def _decoded(
    source: Path | BytesIO,
    name: str,
    size: tuple[int, int],
    formats: tuple[str, ...],
    max_pixels: int,
) -> Picture:
    """The picture of a file whose header tells `size`."""
    try:
        from PIL import Image, UnidentifiedImageError
    except ImportError as error:
        raise RuntimeError(
            "pictures are read by Pillow: pip install 'faceambig[render]'"
        ) from error
    width, height = size
    if width * height > max_pixels:
        raise AssetError(
            f"{name}: {width} x {height} is {width * height / 1e6:.0f} million pixels, "
            f"{max_pixels / 1e6:.0f} are accepted; make it smaller"
        )
    with warnings.catch_warnings():
        # Pillow's remarks on odd files; what matters comes as an error
        warnings.simplefilter("ignore")
        try:
            with Image.open(source, formats=formats) as picture:
                if picture.width * picture.height > max_pixels:  # a header that contradicts itself
                    raise AssetError(f"{name}: its header tells two sizes")
                turn, focal = _exif(picture)
                rgb, notes = _rgb(picture, name)
        except AssetError:
            raise
        except UnidentifiedImageError as error:
            raise AssetError(f"{name}: damaged, or not a picture; {NAMED}") from error
        except (*DAMAGED, Image.DecompressionBombError) as error:
            words = " ".join(str(error).split()) or type(error).__name__
            raise AssetError(f"{name}: damaged or cut off ({words:.100})") from error
    if turn != 1:
        rgb = _upright(rgb, turn)
        notes = (f"turned upright (EXIF orientation {turn})", *notes)
    return Picture(name, rgb, focal, notes)


def _exif(picture: Image.Image) -> tuple[int, float | None]:
    """Orientation 1 to 8 and the focal length in 35 mm terms; 1 and None where EXIF is absent or nonsense."""
    if picture.format == "PNG" and "exif" not in picture.info:
        return 1, None  # it may stand behind the pixels; they are not decoded to find out
    if picture.format == "TIFF":
        return 1, None  # Pillow has turned it already
    try:
        exif: Any = picture.getexif()
        turn, focal = exif.get(ORIENTATION, 1), exif.get_ifd(EXIF_FOLDER).get(FOCAL_35MM)
    except (*DAMAGED, AttributeError):  # EXIF is written by anyone; the pixels may be good
        return 1, None
    known = isinstance(focal, int | float) and FOCAL_RANGE[0] <= focal <= FOCAL_RANGE[1]
    return turn if turn in range(1, 9) else 1, float(focal) if known else None


def _rgb(picture: Image.Image, name: str) -> tuple[NDArray[np.uint8], tuple[str, ...]]:
    """(H, W, 3) as stored, and what was converted."""
    from PIL import Image

    if picture.mode.startswith("I;16"):  # grey; Pillow would cut 16 bits off at 255
        grey = (np.asarray(picture) >> 8).astype(np.uint8)
        return np.repeat(grey[:, :, None], 3, axis=2), ("16 bits reduced to 8",)
    if picture.mode in ("I", "F"):
        raise AssetError(f"{name}: 32 bits a channel; 8 or 16 are accepted")
    if picture.mode in ("RGBA", "LA", "PA", "RGBa", "La") or "transparency" in picture.info:
        above = picture.convert("RGBA")
        ground = Image.new("RGBA", above.size, "white")
        ground.alpha_composite(above)
        return np.asarray(ground.convert("RGB")), ("transparency laid on white",)
    rgb = np.asarray(picture.convert("RGB"))
    return rgb, (f"{picture.mode} converted to RGB",) if picture.mode in ("CMYK", "LAB") else ()


def _upright(rgb: NDArray[np.uint8], turn: int) -> NDArray[np.uint8]:
    """The picture of EXIF orientation `turn`, 2 to 8, as it is to be seen."""
    if turn in SIDEWAYS:
        rgb = rgb.swapaxes(0, 1)
    if turn in (2, 3, 6, 7):
        rgb = rgb[:, ::-1]
    if turn in (3, 4, 7, 8):
        rgb = rgb[::-1]
    return np.ascontiguousarray(rgb)


def picture_beside(path: Path) -> Path | None:
    """The picture of the same name in the folder of `path`, upper or lower case; None if there is none."""
    for extension in EXTENSIONS:
        for candidate in (path.with_suffix(extension), path.with_suffix(extension.upper())):
            if candidate.is_file():
                return candidate
    return None


def picture_size(path: Path) -> tuple[int, int]:
    """Width and height in pixels, upright (EXIF orientation applied); AssetError if the header does not say."""
    try:
        with path.open("rb") as stream:
            head = stream.read(HEADER_BYTES)
    except OSError as error:
        raise AssetError(f"{path}: cannot be read ({error.strerror or error})") from error
    return _told_size(head, path.name, path)


def _told_size(head: bytes, name: str, source: Path | BytesIO) -> tuple[int, int]:
    """Width and height that the first bytes `head` of a file tell; of some formats Pillow reads it in the file."""
    size = _png(head) or _jpeg(head) or _webp(head) or _bmp(head)
    webp_exif = head[8:16] == b"WEBPVP8X" and len(head) > 20 and head[20] & 0x08
    if size is None or b"eXIf" in head or webp_exif:
        size = _by_pillow(source) or size
    if size is None or not all(1 <= side <= MAX_SIDE for side in size):
        raise AssetError(f"{name}: not a picture whose size can be read; {NAMED}")
    return size


def _png(head: bytes) -> tuple[int, int] | None:
    if not head.startswith(b"\x89PNG\r\n\x1a\n") or head[12:16] != b"IHDR" or len(head) < 24:
        return None
    return int.from_bytes(head[16:20], "big"), int.from_bytes(head[20:24], "big")


def _jpeg(head: bytes) -> tuple[int, int] | None:
    """From the frame header (SOF0 to SOF15 but DHT, JPG, DAC), found by walking the segments; EXIF stands before."""
    if not head.startswith(b"\xff\xd8"):
        return None
    at, sideways = 2, False
    while at + 9 <= len(head) and head[at] == 0xFF:
        marker = head[at + 1]
        if marker == 0xFF:  # fill byte
            at += 1
        elif 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            width = int.from_bytes(head[at + 7 : at + 9], "big")
            height = int.from_bytes(head[at + 5 : at + 7], "big")
            return (height, width) if sideways else (width, height)
        elif marker == 0xDA:  # pixels begin, and no frame header came
            return None
        else:
            length = int.from_bytes(head[at + 2 : at + 4], "big")
            if marker == 0xE1 and head[at + 4 : at + 10] == b"Exif\x00\x00":
                sideways = _orientation(head[at + 10 : at + 2 + length]) in SIDEWAYS
            at += 2 + length
    return None


def _orientation(tiff: bytes) -> int:
    """EXIF orientation in the first folder of a TIFF block; 1 where it is not told."""
    order = {b"II*\x00": "little", b"MM\x00*": "big"}.get(tiff[:4])
    if order != "little" and order != "big":
        return 1
    first = int.from_bytes(tiff[4:8], order)
    count = int.from_bytes(tiff[first : first + 2], order)
    for at in range(first + 2, min(first + 2 + 12 * count, len(tiff) - 11), 12):
        if int.from_bytes(tiff[at : at + 2], order) == ORIENTATION:
            return int.from_bytes(tiff[at + 8 : at + 10], order)
    return 1


def _webp(head: bytes) -> tuple[int, int] | None:
    if head[:4] != b"RIFF" or head[8:12] != b"WEBP" or len(head) < 30:
        return None
    kind = head[12:16]
    if kind == b"VP8X":
        return 1 + int.from_bytes(head[24:27], "little"), 1 + int.from_bytes(head[27:30], "little")
    if kind == b"VP8 ":
        return int.from_bytes(head[26:28], "little") & 0x3FFF, int.from_bytes(
            head[28:30], "little"
        ) & 0x3FFF
    if kind == b"VP8L":
        bits = int.from_bytes(head[21:25], "little")
        return 1 + (bits & 0x3FFF), 1 + (bits >> 14 & 0x3FFF)
    return None


def _bmp(head: bytes) -> tuple[int, int] | None:
    if head[:2] != b"BM" or len(head) < 26 or head[14] < 40:
        return None
    high = int.from_bytes(head[22:26], "little", signed=True)  # negative: rows from the top
    return int.from_bytes(head[18:22], "little", signed=True), abs(high)


def _by_pillow(source: Path | BytesIO) -> tuple[int, int] | None:
    """Size of any other picture, if Pillow is installed; it reads headers only."""
    try:
        from PIL import Image
    except ImportError:
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            with Image.open(source, formats=(*FORMATS, "TIFF")) as picture:
                width, height = picture.size
                return (height, width) if _exif(picture)[0] in SIDEWAYS else (width, height)
        except (*DAMAGED, Image.DecompressionBombError):
            return None
