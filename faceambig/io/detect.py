"""Automatic landmarks: the 68 points of iBUG on the largest face of a picture, by two small networks in `assets/nets`.

1. The detector sees a square of the picture at 128 x 128 and gives boxes of faces, each with six key points.
2. The mesh network sees one face at 192 x 192, its eyes level, and gives 468 points; it runs twice, the second time
   on the square around its own points.
3. Each point of iBUG is one of the 468 or the middle between two (MESH_OF_IBUG).

Accuracy, speed, and what else looks like a face: benchmarks/detect.py.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, read_only, shown
from .files import replacing
from .landmarks import LandmarkFile, save_landmarks
from .nets import DETECTOR_PX, SAME_FACE, Candidate, Frame, candidates, face_mesh, opencv, shared

ROOM = 1.5  # side of the square the mesh network sees over that of the face in it
SMALLEST = 32  # pixels: a smaller picture is refused

# A face has the least score and presence, and both networks agree on it.
LEAST_SCORE = 0.5  # of the detector, 0 to 1
LEAST_PRESENCE = 0.0  # of the mesh network, log odds; clear faces have 15 to 30
# With both of these no other look is taken: a face upside down passes for another one with 0.81 and 4.
SURE_SCORE, SURE_PRESENCE = 0.75, 10.0
MOST_GAP = 0.25  # between both networks' eyes, nose and mouth, in distances of the eyes

JAW = slice(0, 17)
# Mesh points (a, b) of the 68: the middle between the two. iBUG marks the middle line of a brow, the mesh its upper and
# its lower edge, with five points each that are spaced otherwise: pairs chosen on the embedded head, whose brows are
# painted. The jaw of iBUG is a contour that moves with the pose, the mesh's is not: it is off by a tenth of the eyes.
MESH_OF_IBUG = np.array(
    [
        *((i, i) for i in (127, 234, 93, 58, 172, 136, 149, 148, 152, 377, 378, 365, 397, 288, 323, 454, 356)),
        *((70, 46), (63, 53), (105, 65), (105, 55), (107, 55)),
        *((336, 285), (334, 285), (334, 295), (293, 283), (300, 276)),
        *((i, i) for i in (168, 197, 5, 4)),
        *((75, 98), (97, 97), (2, 2), (326, 326), (305, 327)),
        *((i, i) for i in (33, 160, 158, 133, 153, 144, 362, 385, 387, 263, 373, 380)),
        *((i, i) for i in (61, 39, 37, 0, 267, 269, 291, 405, 314, 17, 84, 181)),
        *((i, i) for i in (78, 82, 13, 312, 308, 317, 14, 87)),
    ]
)  # fmt: skip
# The detector's first four key points on the mesh, again as middles: right eye, left eye, tip of the nose, mouth.
MESH_OF_KEYS = np.array([(33, 133), (362, 263), (1, 4), (13, 14)])
OUTER_CORNERS = (33, 263)  # of the eyes, right and left, on the mesh

# Parts of the 68 that are drawn as lines: first, last, closed.
STROKES = (
    (0, 16, False), (17, 21, False), (22, 26, False), (27, 30, False), (31, 35, False),
    (36, 41, True), (42, 47, True), (48, 59, True), (60, 67, True),
)  # fmt: skip
DOTS, RIM, LINES, BOX = (0x1B, 0x5F, 0xC1), (255, 255, 255), (0xE8, 0xF0, 0xFC), (0xF2, 0xA9, 0x3B)


@dataclass(frozen=True, slots=True, eq=False)
class Detection:
    """The largest face of a picture. Pixels, x right, y down, from the upper left corner of the picture."""

    points: Array  # (68, 2) iBUG order; NaN = left out (the jaw)
    mesh: Array  # (468, 2) the network's own points, in the order of MediaPipe's face mesh
    box: tuple[float, float, float, float]  # left, top, right, bottom of the face, pixels
    score: float  # of the detector, 0 to 1
    presence: float  # of the mesh network, log odds that this is a face
    n_faces: int  # seen as clearly; this is the largest
    image_size: tuple[int, int]  # width, height, pixels
    scheme: str = "ibug68"

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", read_only(self.points))
        object.__setattr__(self, "mesh", read_only(self.mesh))


class Found(NamedTuple):
    """A face that both networks see."""

    candidate: Candidate
    mesh: Array  # (468, 2) pixels of the picture
    presence: float

    @property
    def is_sure(self) -> bool:
        """Whether no better look is needed."""
        return self.candidate.score >= SURE_SCORE and self.presence >= SURE_PRESENCE


def detect_landmarks(
    picture: NDArray[np.uint8], *, jaw: bool = False, name: str = "picture"
) -> Detection:
    """The 68 points of iBUG on the largest face of `picture`.

    Where the picture as a whole shows no face it is searched again: turned by quarters, with room around it (a face
    larger than the picture), and in windows of a half and of a quarter of its side (small faces).

    Parameters
    ----------
    picture: (H, W, 3) uint8 RGB, upright.
    jaw: keep points 1 to 17. They are off by a tenth of the eye distance; left out, they are NaN.
    name: how an error calls the picture.

    Raises
    ------
    ValueError: no face found, or no such array.
    AssetError: a network's file is missing or damaged.
    RuntimeError: OpenCV is not installed.
    """
    picture = _checked(picture, name)
    best, found = 0.0, list[Found]()
    for frames in _looks(picture):
        for frame in frames:
            seen = candidates(picture, frame, LEAST_SCORE)
            best = max([best, *(candidate.score for candidate in seen)])
            faces = (_face(picture, candidate) for candidate in seen)
            found += [face for face in faces if face is not None]
        if sure := [face for face in found if face.is_sure]:
            return _largest(picture, _apart(sure), jaw=jaw)
    if not found:
        near = f"best score {best:.2f}, {LEAST_SCORE:g} is needed"
        if best >= LEAST_SCORE:
            near = "what looks like one has no eyes, nose and mouth that can be placed"
        raise ValueError(
            f"{name}: no face found ({near}); cut the picture to the face, or give the points in a file"
        )
    return _largest(picture, [max(found, key=lambda face: face.presence)], jaw=jaw)


def _checked(picture: NDArray[np.uint8], name: str) -> NDArray[np.uint8]:
    if not isinstance(picture, np.ndarray) or picture.ndim != 3 or picture.shape[2] != 3:
        what = f"an array {picture.shape}" if isinstance(picture, np.ndarray) else shown(picture)
        raise ValueError(f"{name}: {what} is not a picture of (H, W, 3) RGB values")
    if picture.dtype != np.uint8:
        raise ValueError(f"{name}: {picture.dtype} values; 8 bits (uint8) are accepted")
    height, width = picture.shape[:2]
    if min(width, height) < SMALLEST:
        raise ValueError(
            f"{name}: {width} x {height} pixels; at least {SMALLEST} x {SMALLEST} show a face"
        )
    return np.ascontiguousarray(picture)


def _looks(picture: NDArray[np.uint8]) -> Iterator[list[Frame]]:
    """Lists of frames to look into, one list after the other until a face is found."""
    height, width = picture.shape[:2]
    centre, side = np.array([0.5 * width, 0.5 * height]), float(max(width, height))
    yield [Frame(centre, side, 0.0)]
    yield [Frame(centre, side, 0.5 * math.pi * quarter) for quarter in (1, 2, 3)]
    yield [Frame(centre, ROOM * side, 0.0), Frame(centre, ROOM * ROOM * side, 0.0)]
    for part in (2, 4):
        window = side / part
        if window >= DETECTOR_PX:  # an enlarged window shows nothing new
            yield [
                Frame(np.array([x, y]), window, 0.0)
                for y in _middles(height, window)
                for x in _middles(width, window)
            ]


def _middles(length: float, window: float) -> Array:
    """Middles of windows that cover 0 to length, half a window apart or less."""
    count = 1 + max(0, math.ceil((length - window) / (0.5 * window)))
    margin = min(0.5 * window, 0.5 * length)
    return np.linspace(margin, length - margin, count)


def _largest(picture: NDArray[np.uint8], found: list[Found], *, jaw: bool) -> Detection:
    face = max(found, key=lambda face: float(face.candidate.box[1].prod()))
    points = face.mesh[MESH_OF_IBUG].mean(axis=1)
    if not jaw:
        points[JAW] = np.nan
    (left, top), (right, bottom) = face.candidate.corners[[0, 2]].tolist()
    return Detection(
        points=points,
        mesh=face.mesh,
        box=(min(left, right), min(top, bottom), max(left, right), max(top, bottom)),
        score=face.candidate.score,
        presence=face.presence,
        n_faces=len(found),
        image_size=(picture.shape[1], picture.shape[0]),
    )


def _apart(found: list[Found]) -> list[Found]:
    """One of each face, the best score first: two looks may see the same."""
    left = sorted(found, key=lambda face: -face.candidate.score)
    kept = []
    while left:
        kept.append(left[0])
        boxes = np.array([face.candidate.box for face in left])
        left = [
            f for f, share in zip(left, shared(boxes[0], boxes), strict=True) if share <= SAME_FACE
        ]
    return kept


def _face(picture: NDArray[np.uint8], candidate: Candidate) -> Found | None:
    """The mesh of a candidate; None if the networks do not agree that it is a face, and where its parts are."""
    if candidate.score < LEAST_SCORE:
        return None
    right, left = candidate.keys[:2]
    side = float(np.abs(candidate.corners[2] - candidate.corners[0]).max())
    eyes = float(np.linalg.norm(left - right))
    if not min(side, eyes) > 1.0:  # pixels: an answer, but no face
        return None
    middle = 0.5 * (candidate.corners[0] + candidate.corners[2])
    mesh, _ = face_mesh(picture, Frame(middle, ROOM * side, _turn(right, left)))
    mesh, presence = face_mesh(picture, _around(mesh))
    gaps = np.linalg.norm(mesh[MESH_OF_KEYS].mean(axis=1) - candidate.keys[:4], axis=1)
    # The detector places its points to a pixel of what it sees
    agree = gaps.mean() <= MOST_GAP * eyes + candidate.pixel
    return Found(candidate, mesh, presence) if presence > LEAST_PRESENCE and agree else None


def _turn(right: Array, left: Array) -> float:
    """Radians that turn the x axis into the line from the right eye to the left."""
    across, down = left - right
    return math.atan2(down, across)


def _around(mesh: Array) -> Frame:
    """The square around a mesh, the outer corners of its eyes level."""
    turn = _turn(*mesh[list(OUTER_CORNERS)])
    R = Frame(np.zeros(2), 1.0, turn).into(1)[:, :2]
    level = mesh @ R.T
    low, high = level.min(axis=0), level.max(axis=0)
    return Frame(0.5 * (low + high) @ R, ROOM * max(1.0, float((high - low).max())), turn)


def draw_detection(picture: NDArray[np.uint8], detection: Detection) -> NDArray[np.uint8]:
    """A copy of `picture` (H, W, 3) with the points, the lines between them and the box of the face."""
    cv2 = opencv()
    drawn = np.ascontiguousarray(picture).copy()
    left, top, right, bottom = detection.box
    unit = max(1.0, (right - left) / 150)  # pixels: the width of a line

    def fixed(points: Array) -> NDArray[np.int32]:
        """What OpenCV wants: 4 bits of fraction, counted from the middle of the first pixel."""
        return np.round(16 * (points - 0.5)).astype(np.int32)

    def line(points: Array, closed: bool, colour: tuple[int, int, int], width: float) -> None:
        cv2.polylines(drawn, [fixed(points)], closed, colour, max(1, round(width)), cv2.LINE_AA, 4)

    line(np.array([(left, top), (right, top), (right, bottom), (left, bottom)]), True, BOX, unit)
    for first, last, closed in STROKES:
        stroke = detection.points[first : last + 1]
        if np.isfinite(stroke).all():
            line(stroke, closed, LINES, 0.6 * unit)
    for x, y in fixed(detection.points[np.isfinite(detection.points).all(axis=1)]).tolist():
        cv2.circle(drawn, (x, y), round(16 * 1.7 * unit), RIM, cv2.FILLED, cv2.LINE_AA, 4)
        cv2.circle(drawn, (x, y), round(16 * 1.2 * unit), DOTS, cv2.FILLED, cv2.LINE_AA, 4)
    return drawn


def write_detection(
    detection: Detection,
    points: str | os.PathLike[str] | None = None,
    drawn: NDArray[np.uint8] | None = None,
    overlay: str | os.PathLike[str] | None = None,
) -> None:
    """Write the file that `load_landmarks` reads to `points`, and the picture `drawn` as PNG to `overlay`.

    Either may be left out. Both are written whole before either appears; ValueError if they cannot be.
    """
    file = LandmarkFile(detection.points, detection.scheme, detection.image_size)
    try:
        with ExitStack() as stack:
            if overlay is not None and drawn is not None:
                packed = opencv().imencode(".png", np.ascontiguousarray(drawn[:, :, ::-1]))[1]
                stack.enter_context(replacing(overlay)).write_bytes(packed.tobytes())
            if points is not None:
                save_landmarks(file, points)
    except OSError as error:
        named = " and ".join(str(path) for path in (points, overlay) if path is not None)
        raise ValueError(f"{named}: cannot be written ({error.strerror or error})") from error
