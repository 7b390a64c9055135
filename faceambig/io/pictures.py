"""The picture beside a landmark file: which one, and how large. Read from its header, without decoding pixels."""

from __future__ import annotations

from pathlib import Path

from ..errors import AssetError

EXTENSIONS = (".jpg", ".jpeg", ".png", ".webp", ".bmp", ".tif", ".tiff")
HEADER_BYTES = 1 << 20  # JPEG: EXIF, thumbnails and colour profiles stand before the size
MAX_SIDE = 65_535  # of a JPEG; larger sizes in other formats are damage or an attack


def picture_beside(path: Path) -> Path | None:
    """The picture of the same name in the folder of `path`, upper or lower case; None if there is none."""
    for extension in EXTENSIONS:
        for candidate in (path.with_suffix(extension), path.with_suffix(extension.upper())):
            if candidate.is_file():
                return candidate
    return None


def picture_size(path: Path) -> tuple[int, int]:
    """Width and height in pixels as stored (EXIF rotation is not applied); AssetError if the header does not say."""
    try:
        with path.open("rb") as stream:
            head = stream.read(HEADER_BYTES)
    except OSError as error:
        raise AssetError(f"{path}: cannot be read ({error.strerror or error})") from error
    size = _png(head) or _jpeg(head) or _webp(head) or _by_pillow(path)
    if size is None or not all(1 <= side <= MAX_SIDE for side in size):
        raise AssetError(f"{path.name}: not a picture whose size can be read")
    return size


def _png(head: bytes) -> tuple[int, int] | None:
    if not head.startswith(b"\x89PNG\r\n\x1a\n") or head[12:16] != b"IHDR" or len(head) < 24:
        return None
    return int.from_bytes(head[16:20], "big"), int.from_bytes(head[20:24], "big")


def _jpeg(head: bytes) -> tuple[int, int] | None:
    """From the frame header (SOF0 to SOF15 but DHT, JPG, DAC), found by walking the segments."""
    if not head.startswith(b"\xff\xd8"):
        return None
    at = 2
    while at + 9 <= len(head) and head[at] == 0xFF:
        marker = head[at + 1]
        if marker == 0xFF:  # fill byte
            at += 1
        elif 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            return int.from_bytes(head[at + 7 : at + 9], "big"), int.from_bytes(
                head[at + 5 : at + 7], "big"
            )
        elif marker == 0xDA:  # pixels begin, and no frame header came
            return None
        else:
            at += 2 + int.from_bytes(head[at + 2 : at + 4], "big")
    return None


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


def _by_pillow(path: Path) -> tuple[int, int] | None:
    """Size of any other picture, if Pillow is installed; it reads headers only."""
    try:
        from PIL import Image
    except ImportError:
        return None
    try:
        with Image.open(path) as picture:
            return picture.size
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):
        return None
