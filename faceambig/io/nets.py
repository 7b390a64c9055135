"""The two networks of the automatic landmarks, run by OpenCV: faces in a square of a picture, the mesh of one face.

They are MediaPipe's (assets/README.md). OpenCV is imported by the first picture. Pixel coordinates count from the upper
left corner of the picture: the first pixel spans 0 to 1.
"""

from __future__ import annotations

import hashlib
import math
import threading
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array
from ..errors import AssetError
from .files import asset_path

DETECTOR, MESH = "face_detection_short_range.tflite", "face_landmark.tflite"
SHA256 = {
    DETECTOR: "bbff11cebd1eb27a1e004cae0b0e63ec8c551cbf34a4451148b4908b8db3eca8",
    MESH: "1055cb9d4a9ca8b8c688902a3a5194311138ba256bcc94e336d8373a5f30c814",
}
DETECTOR_PX, MESH_PX = 128, 192  # sides of the squares they see
MESH_POINTS = 468
SAME_FACE = 0.3  # boxes that share more of their union than this are one face
CORNERS = 0.5 * np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])  # of a unit square
_BUSY = threading.Lock()  # a network keeps its input until it has run


class Frame(NamedTuple):
    """A square of the picture, turned: what a network sees."""

    centre: Array  # (2,) pixels
    side: float  # pixels
    turn: float  # radians, of its x axis; positive is clockwise as seen, since y is down

    def into(self, size: int) -> Array:
        """(2, 3) from pixels of the picture to those of the square drawn at size x size."""
        c, s = math.cos(self.turn) * size / self.side, math.sin(self.turn) * size / self.side
        R = np.array([[c, s], [-s, c]])
        return np.column_stack([R, 0.5 * size - R @ self.centre])

    def out(self, points: Array, size: int) -> Array:
        """Points (..., 2) of the square drawn at size x size, in the picture."""
        c, s = math.cos(self.turn), math.sin(self.turn)
        return (points / size - 0.5) * self.side @ np.array([[c, s], [-s, c]]) + self.centre


class Candidate(NamedTuple):
    """A face that the detector sees."""

    corners: Array  # (4, 2) of its box, pixels of the picture
    keys: Array  # (6, 2) right eye, left eye, tip of the nose, mouth, right and left tragion
    score: float
    pixel: float  # side of one that the detector saw, in pixels of the picture

    @property
    def box(self) -> Array:
        """(2, 2) middle and size of the upright box around it."""
        low, high = self.corners.min(axis=0), self.corners.max(axis=0)
        return np.array([0.5 * (low + high), high - low])


def candidates(picture: NDArray[np.uint8], frame: Frame, least: float) -> list[Candidate]:
    """Faces of at least the score `least` in one frame, best first; without any, the one that came nearest."""
    values = cut(picture, frame, DETECTOR_PX, edge=False).astype(np.float32) / 127.5 - 1.0
    boxes, logits = _run(DETECTOR, values, ("regressors", "classificators"))
    boxes = boxes.reshape(-1, 8, 2).astype(np.float64)  # middle and size of the box, six key points
    scores = 1.0 / (1.0 + np.exp(-np.clip(logits.ravel().astype(np.float64), -50.0, 50.0)))
    rows = np.argsort(-scores, kind="stable")[: max(1, int((scores >= least).sum()))]
    at = boxes[rows] + _anchors()[rows, None] * (np.arange(8) != 1)[:, None]
    # One face answers in several rows: they are averaged by their scores, which steadies the box
    faces = []
    while len(rows):
        same = shared(at[0, :2], at[:, :2]) > SAME_FACE
        same[0] = True
        mean = np.average(at[same], axis=0, weights=scores[rows[same]])
        corners = mean[0] + CORNERS * mean[1]
        seen = frame.out(np.concatenate([corners, mean[2:]]), DETECTOR_PX)
        faces.append(
            Candidate(seen[:4], seen[4:], float(scores[rows[0]]), frame.side / DETECTOR_PX)
        )
        rows, at = rows[~same], at[~same]
    return faces


@cache
def _anchors() -> Array:
    """(896, 2) where each row of the detector's output counts from, pixels of its square."""
    rows = []
    for cells, each in ((16, 2), (8, 6)):
        at = (np.arange(cells) + 0.5) * DETECTOR_PX / cells
        x, y = np.meshgrid(at, at)
        rows.append(np.repeat(np.stack([x.ravel(), y.ravel()], axis=1), each, axis=0))
    return np.concatenate(rows)


def shared(one: Array, boxes: Array) -> Array:
    """(n,) intersection over union of the box `one` (2, 2) and others (n, 2, 2): rows middle and size."""
    low = np.maximum(one[0] - 0.5 * one[1], boxes[:, 0] - 0.5 * boxes[:, 1])
    high = np.minimum(one[0] + 0.5 * one[1], boxes[:, 0] + 0.5 * boxes[:, 1])
    both = np.maximum(high - low, 0.0).prod(axis=1)
    return both / np.maximum(one[1].prod() + boxes[:, 1].prod(axis=1) - both, 1e-12)


def face_mesh(picture: NDArray[np.uint8], frame: Frame) -> tuple[Array, float]:
    """(468, 2) points in the picture, and the log odds that the frame holds a face."""
    values = cut(picture, frame, MESH_PX, edge=True).astype(np.float32) / 255.0
    mesh, presence = _run(MESH, values, ("conv2d_21", "conv2d_31"))
    points = mesh.reshape(MESH_POINTS, 3)[:, :2].astype(np.float64)  # the third is a depth
    return frame.out(points, MESH_PX), float(presence.ravel()[0])


def cut(picture: NDArray[np.uint8], frame: Frame, size: int, *, edge: bool) -> NDArray[np.uint8]:
    """(size, size, 3) the frame's part of the picture; beyond it its edge goes on, or all is black."""
    cv2 = opencv()
    M = frame.into(size)
    coarse = int(frame.side / size)
    if coarse > 1:  # the warp reads single pixels: what would fall between them is averaged first
        reach = math.sqrt(0.5) * frame.side + 2 * coarse  # of a turned square, and a little room
        shape = picture.shape[1::-1]
        low = np.clip(np.floor(frame.centre - reach), 0, np.array(shape) - 1).astype(int)
        high = np.clip(np.ceil(frame.centre + reach), low + 1, shape).astype(int)
        part = picture[low[1] : high[1], low[0] : high[0]]
        small = np.maximum((high - low) // coarse, 1)
        picture = cv2.resize(part, small.tolist(), interpolation=cv2.INTER_AREA)
        M[:, 2] += M[:, :2] @ low
        M[:, :2] *= (high - low) / small
    M[:, 2] += 0.5 * M[:, :2].sum(axis=1) - 0.5  # OpenCV counts from the middle of the first pixel
    border = cv2.BORDER_REPLICATE if edge else cv2.BORDER_CONSTANT
    return cv2.warpAffine(picture, M, (size, size), flags=cv2.INTER_LINEAR, borderMode=border)


def _run(file: str, values: NDArray[np.float32], outputs: tuple[str, str]) -> list[Any]:
    """Two outputs of the network `file` for an image (n, n, 3)."""
    net = network(file)
    with _BUSY:
        net.setInput(np.ascontiguousarray(values.transpose(2, 0, 1)[None]))
        return net.forward(outputs)


@cache
def network(file: str) -> Any:
    path = asset_path(f"nets/{file}")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise AssetError(
            f"{path}: cannot be read ({error.strerror or error}); install faceambig again"
        ) from error
    if hashlib.sha256(data).hexdigest() != SHA256[file]:
        raise AssetError(
            f"{path}: not the network it should be (sha256 differs); install faceambig again"
        )
    cv2 = opencv()
    # The classic engine: of the newer one only one of two outputs can be fetched. By its path: from bytes OpenCV 5.0
    # makes the newer one whatever it is told.
    return cv2.dnn.readNetFromTFLite(str(path), cv2.dnn.ENGINE_CLASSIC)


def opencv() -> Any:
    """OpenCV, imported by the first picture: it takes 75 ms."""
    try:
        import cv2
    except ImportError as error:
        raise RuntimeError(
            "landmarks are found by OpenCV: pip install 'faceambig[render]'"
        ) from error
    return cv2
