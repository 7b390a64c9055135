"""The picture beside a landmark file: which one, and how large; read from its header without decoding pixels. Edges."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, number, shown
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


def canny_edges(
    pixels: NDArray[np.uint8], *, threshold: float = 0.15, blur_px: float = 1.5
) -> Array:
    """Edge points (E, 2) of a picture, pixels: the middles of the pixels that Canny's detector keeps.

    Parameters
    ----------
    pixels: (height, width) grey or (height, width, 3) RGB.
    threshold: gradient that begins an edge, as a share of the largest in the picture; 0.4 of it carries an edge on.
        0.15 as in the public code of the paper's authors.
    blur_px: sd of the Gaussian before it.

    Raises
    ------
    ValueError: not such a picture, or an argument out of range. Needs OpenCV, of the extra "render".
    """
    if (
        not isinstance(pixels, np.ndarray)
        or pixels.dtype != np.uint8
        or pixels.ndim not in (2, 3)
        or (pixels.ndim == 3 and pixels.shape[2] != 3)
        or not pixels.size
    ):
        raise ValueError(
            f"pixels: expected uint8 of shape (height, width) or (height, width, 3), found {_kind(pixels)}"
        )
    threshold, blur_px = number("threshold", threshold), number("blur_px", blur_px)
    if not 0 < threshold < 1:
        raise ValueError(f"threshold: {threshold:g} is not within 0 to 1")
    if not 0.3 <= blur_px <= 50:
        raise ValueError(f"blur_px: {blur_px:g} is not within 0.3 to 50 pixels")
    try:
        import cv2
    except ImportError as error:
        raise ValueError(
            "edges: finding them needs OpenCV; pip install 'faceambig[render]'"
        ) from error
    grey = pixels if pixels.ndim == 2 else cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY)
    smooth = cv2.GaussianBlur(grey.astype(np.float32), (0, 0), blur_px)
    # As 16 bits, which Canny takes: 0.1 of a grey level, not the whole one that a smoothed uint8 would keep
    slopes = [cv2.Sobel(smooth, cv2.CV_16S, *axis, scale=10.0) for axis in ((1, 0), (0, 1))]
    steepest = float(np.hypot(*(slope.astype(np.float32) for slope in slopes)).max())
    if steepest == 0:
        return np.zeros((0, 2))
    high = threshold * steepest
    found = cv2.Canny(slopes[0], slopes[1], 0.4 * high, high, L2gradient=True)
    rows, columns = found.nonzero()
    return 0.5 + np.stack([columns, rows], axis=1).astype(np.float64)


def _kind(pixels: object) -> str:
    return f"{pixels.dtype} {pixels.shape}" if isinstance(pixels, np.ndarray) else shown(pixels)
