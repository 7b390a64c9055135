"""MATLAB 5 `.mat` files: the numeric arrays asked for, and nothing of the others.

A file of 234 kB can hold 240 MB, and SciPy's reader inflates even what it skips. Here of each element only the first
bytes are inflated, for its name and shape; then those asked for, up to the size that the shape says.

    128 bytes of header (text, version, "IM" for little endian), then elements: uint32 type, uint32 bytes, data
    type 15: a zlib stream of one element;  type 14: a matrix, itself of elements: flags, dimensions, name, numbers
    an element of at most 4 bytes: uint16 type, uint16 bytes, 4 bytes
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import AssetError
from .files import MAX_BYTES
from .zipped import count

MATRIX, COMPRESSED = 14, 15
START = 256  # bytes that hold flags, dimensions and a name
MAX_ELEMENTS = 1000
# Types of stored numbers, and the classes of arrays that are numeric
TYPES = {
    1: "i1",
    2: "u1",
    3: "<i2",
    4: "<u2",
    5: "<i4",
    6: "<u4",
    7: "<f4",
    9: "<f8",
    12: "<i8",
    13: "<u8",
}
CLASSES = {6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8"}  # fmt: skip
COMPLEX, INT32 = 0x800, 5  # a flag; the type of dimensions


@dataclass(frozen=True, slots=True)
class Variable:
    """A variable before it is read."""

    name: str
    shape: tuple[int, ...]
    kind: int  # class of the array
    is_complex: bool
    offset: int  # of its data in the file
    size: int  # bytes there
    compressed: bool


def is_matlab(path: Path) -> bool:
    """Whether `path` begins like a MATLAB 5 file."""
    with path.open("rb") as stream:
        return stream.read(10) == b"MATLAB 5.0"


def variables(stream: BinaryIO, size: int) -> dict[str, Variable]:
    """The variables of a file of `size` bytes, by name."""
    start = stream.read(128)
    if start[126:128] != b"IM":
        raise AssetError("a MATLAB 5 file of a big-endian machine; save it again")
    found: dict[str, Variable] = {}
    for offset, kind, length in _elements(stream, size):
        stream.seek(offset)
        head = stream.read(min(length, 4 * START if kind == COMPRESSED else START))
        if kind == COMPRESSED:
            head = zlib.decompressobj().decompress(head, START)
            if len(head) < 8 or struct.unpack_from("<I", head)[0] != MATRIX:
                continue
            head = head[8:]
        elif kind != MATRIX:
            continue
        variable = _variable(head, offset, length, kind == COMPRESSED)
        if variable.name in found:
            raise AssetError(f"{variable.name:.30} is there twice")
        found[variable.name] = variable
    return found


def numbers(stream: BinaryIO, variable: Variable) -> NDArray[Any]:
    """The real numeric array of `variable`, column by column as it is stored."""
    name, shape = variable.name, variable.shape
    if variable.kind not in CLASSES or variable.is_complex:
        raise AssetError(f"{name:.30} is not an array of real numbers")
    n = count(shape)
    if 8 * n > MAX_BYTES:
        raise AssetError(f"{name:.30} takes {8 * n >> 20} MB; {MAX_BYTES >> 20} MB are accepted")
    stream.seek(variable.offset)
    data = stream.read(variable.size)
    if variable.compressed:
        # no number takes more than 8 bytes; the rest is for what stands before them
        data = zlib.decompressobj().decompress(data, 8 * n + 2 * START)[8:]
    at = 0
    for _ in range(3):  # flags, dimensions, name
        at = _part(data, at).next
    part = _part(data, at)
    if part.kind not in TYPES:
        raise AssetError(f"{name:.30} holds numbers of type {part.kind}")
    dtype = np.dtype(TYPES[part.kind])
    held = min(part.end, len(data)) - part.start
    if held != n * dtype.itemsize:
        raise AssetError(f"{name:.30} claims shape {shape}, the file holds {held} bytes of it")
    values = np.frombuffer(data, dtype, n, part.start).reshape(shape, order="F")
    wanted = np.dtype(CLASSES[variable.kind])  # doubles that are whole are stored as integers
    return values if values.dtype == wanted else values.astype(wanted)


def read_matlab(path: Path, names: Collection[str]) -> dict[str, NDArray[Any]]:
    """Those of the arrays `names` that the file holds."""
    with path.open("rb") as stream:
        found = variables(stream, path.stat().st_size)
        wanted = {name: found[name] for name in names if name in found}
        total = sum(8 * count(variable.shape) for variable in wanted.values())
        if total > MAX_BYTES:
            raise AssetError(f"unpacks to {total >> 20} MB; {MAX_BYTES >> 20} MB are accepted")
        return {name: numbers(stream, variable) for name, variable in wanted.items()}


def _elements(stream: BinaryIO, size: int) -> Iterator[tuple[int, int, int]]:
    """Offset of the data, type and bytes of each element of the file."""
    at = 128
    for _ in range(MAX_ELEMENTS):
        if at >= size:
            return
        stream.seek(at)
        tag = stream.read(8)
        if len(tag) < 8:
            raise AssetError(f"cut off: ends within the tag at byte {at}")
        kind, length = struct.unpack("<II", tag)
        if at + 8 + length > size:
            raise AssetError(
                f"cut off: the part at byte {at} claims {length} bytes, {size - at - 8} are left"
            )
        yield at + 8, kind, length
        at += 8 + length
    raise AssetError(f"more than {MAX_ELEMENTS} variables")


class _Part(NamedTuple):
    """An element of a matrix."""

    kind: int
    start: int  # of its data
    end: int
    next: int  # start of the next, on 8 bytes


def _part(data: bytes, at: int) -> _Part:
    if at + 8 > len(data):
        raise AssetError("a variable is cut off")
    kind, length = struct.unpack_from("<II", data, at)
    if kind >> 16:  # small: type and length in the first four bytes, data in the others
        return _Part(kind & 0xFFFF, at + 4, at + 4 + min(kind >> 16, 4), at + 8)
    return _Part(kind, at + 8, at + 8 + length, at + 8 + length + -length % 8)


def _variable(head: bytes, offset: int, size: int, compressed: bool) -> Variable:
    flags = _part(head, 0)
    sizes = _part(head, flags.next)
    name = _part(head, sizes.next)
    length = sizes.end - sizes.start
    if sizes.kind != INT32 or length % 4 or not 8 <= length <= 32 or name.end > len(head):
        raise AssetError(f"the variable at byte {offset} has no dimensions and name")
    shape = struct.unpack_from(f"<{length // 4}i", head, sizes.start)
    if min(shape) < 0:
        raise AssetError(f"the variable at byte {offset} has dimensions {shape}")
    word = int.from_bytes(head[flags.start : flags.start + 4], "little")
    return Variable(
        name=head[name.start : name.end].decode("latin-1"),
        shape=shape,
        kind=word & 0xFF,
        is_complex=bool(word & COMPLEX),
        offset=offset,
        size=size,
        compressed=compressed,
    )
