"""Edges of a picture, for fits to the contours of a face."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, number, shown


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
