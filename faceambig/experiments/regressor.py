"""A learned regressor as a plug-in: a picture of a face in, a vector of its shape out, an ONNX file run by OpenCV.

The network's one input is (1, 3, H, W), H = W, red green blue 0 to 1, of a square three eye distances wide with the
eyes' middle at 0.42 of its height; its output is any vector that is compared by its angle. The side is read in the
file's own description of its input (onnx.proto: model 7 graph, graph 11 input and 5 initialiser).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array
from ..errors import AssetError
from ..io.nets import opencv
from ..model import Subject
from ..observation import observe, portrait_camera
from .drawings import portrait

ACROSS = 3.0  # eye distances that the square is wide
EYES_AT = 0.42  # of its height, from above
SIDES = (16, 1024)
MAX_BYTES = 1 << 29
WHOLE = 5.0  # eye distances of a synthetic photograph


@dataclass(frozen=True, slots=True, eq=False)
class Regressor:
    """A network ready to be asked."""

    name: str  # of its file
    side: int  # pixels
    net: Any


def load_regressor(path: str | Path) -> Regressor:
    """The regressor of an ONNX file; AssetError, one line, if it is none or takes no such input."""
    file = Path(path)
    try:
        if file.stat().st_size > MAX_BYTES:
            raise AssetError(f"{file.name}: larger than {MAX_BYTES >> 20} MB")
        data = file.read_bytes()
    except OSError as error:
        raise AssetError(f"{file}: cannot be read ({error.strerror or error})") from error
    shape = input_shape(data, file.name)
    if (
        len(shape) != 4
        or shape[1] != 3
        or shape[2] != shape[3]
        or not SIDES[0] <= shape[2] <= SIDES[1]
    ):
        raise AssetError(
            f"{file.name}: input of shape {shape}; expected (1, 3, n, n), n from {SIDES[0]} to {SIDES[1]}"
        )
    cv2 = opencv()
    try:
        net = cv2.dnn.readNetFromONNX(np.frombuffer(data, dtype=np.uint8))
    except cv2.error as error:
        raise AssetError(
            f"{file.name}: OpenCV cannot read this network ({_first(error)})"
        ) from error
    return Regressor(file.name, shape[2], net)


def asked(regressor: Regressor, picture: NDArray[np.uint8]) -> Array:
    """(D,) the network's vector of a square picture (side, side, 3)."""
    values = picture.astype(np.float32).transpose(2, 0, 1)[None] / np.float32(255.0)
    try:
        regressor.net.setInput(np.ascontiguousarray(values))
        vector = np.asarray(regressor.net.forward(), dtype=np.float64).ravel()
    except opencv().error as error:
        raise AssetError(
            f"{regressor.name}: OpenCV cannot run this network ({_first(error)})"
        ) from error
    if len(vector) < 2 or not np.isfinite(vector).all() or not np.linalg.norm(vector) > 0:
        raise AssetError(f"{regressor.name}: its output is no vector of finite numbers")
    return vector


def square(face: Subject, distance: float, scheme: str, side: int) -> NDArray[np.uint8]:
    """(side, side, 3) the part of a frontal photograph of a face from `distance` metres that a network sees."""
    whole = round(side * WHOLE / ACROSS)
    seen = observe(face, distance=distance, scheme=scheme)
    camera = portrait_camera(face, distance=distance, scheme=scheme)
    picture = portrait(face, seen, camera, width=whole)
    # The synthetic camera looks at the middle between the eyes of the mean face
    left, top = (whole - side) // 2, round(0.5 * whole - EYES_AT * side)
    return picture[top : top + side, left : left + side]


def input_shape(data: bytes, name: str) -> tuple[int, ...]:
    """The dimensions of the network's one input; 0 stands for a dimension without a number."""
    try:
        graph = next(value for field, value in _fields(data) if field == 7)
        held = {_text(value, 8) for field, value in _fields(graph) if field == 5}
        inputs = [value for field, value in _fields(graph) if field == 11]
        free = [one for one in inputs if _text(one, 1) not in held]
        if len(free) != 1:
            raise AssetError(f"{name}: {len(free)} inputs; a regressor has one")
        tensor = _child(_child(free[0], 2), 1)
        dims = [value for field, value in _fields(_child(tensor, 2)) if field == 1]
        return tuple(_number(one, 1) for one in dims)
    except (StopIteration, IndexError, UnicodeDecodeError) as error:
        raise AssetError(f"{name}: not an ONNX network") from error


def _fields(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Field numbers and contents of a message of protocol buffers; numbers as their own bytes."""
    at = 0
    while at < len(data):
        key, at = _varint(data, at)
        kind = key & 7
        if kind == 0:
            start = at
            _, at = _varint(data, at)
            yield key >> 3, data[start:at]
            continue
        if kind == 2:
            length, at = _varint(data, at)
        elif kind in (1, 5):
            length = 8 if kind == 1 else 4
        else:
            raise IndexError
        if at + length > len(data):
            raise IndexError
        yield key >> 3, data[at : at + length]
        at += length


def _varint(data: bytes, at: int) -> tuple[int, int]:
    """A number and where it ends; IndexError if it does not."""
    value = 0
    for shift in range(0, 70, 7):
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
    raise IndexError


def _child(data: bytes, field: int) -> bytes:
    return next(value for number, value in _fields(data) if number == field)


def _text(data: bytes, field: int) -> str:
    return next((value for number, value in _fields(data) if number == field), b"").decode()


def _number(data: bytes, field: int) -> int:
    value = next((value for number, value in _fields(data) if number == field), b"\0")
    return _varint(value, 0)[0]


def _first(error: Exception) -> str:
    return f"{' '.join(str(error).split()):.100}"
