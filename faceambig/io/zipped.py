"""Plain arrays in a zip (.npz): their sizes are known, and agreed with the zip directory, before one is inflated.

195 kB of zip can hold 200 MB, and a header of 100 bytes can claim terabytes. Objects, which NumPy would unpickle, are
not plain arrays and are refused.
"""

from __future__ import annotations

import re
import zipfile
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import AssetError
from .files import MAX_BYTES, damage_named

# What numpy.save writes for a plain array, and nothing else: no pickle, no records, no literal_eval.
HEADER = re.compile(
    rb"\{'descr': '([<>|](?:i[1248]|u[1248]|f[248]|b1|U\d{1,7}))', "
    rb"'fortran_order': (True|False), 'shape': \(([\d, ]*)\), \}\s*"
)


@dataclass(frozen=True, slots=True)
class Member:
    """An array in the zip before it is read."""

    name: str
    dtype: np.dtype[Any]
    shape: tuple[int, ...]
    fortran: bool
    offset: int  # bytes of its header


def names_in(path: Path) -> set[str]:
    """The names of the arrays in the zip at `path`; none if it is no zip."""
    try:
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
    except (OSError, zipfile.BadZipFile, ValueError, NotImplementedError):
        return set()
    return {name.removesuffix(".npy") for name in names if name.endswith(".npy")}


def headers(
    archive: zipfile.ZipFile, known: Collection[str], required: Iterable[str]
) -> dict[str, Member]:
    """The headers of the `known` arrays, each agreeing with the zip directory about its size."""
    members: dict[str, Member] = {}
    for info in archive.infolist():
        name = info.filename.removesuffix(".npy")
        if name == info.filename or name not in known:
            continue
        if name in members:
            raise AssetError(f"{name} is there twice")
        with archive.open(info) as stream:
            start = stream.read(10)
            length = int.from_bytes(start[8:10], "little")
            match = HEADER.fullmatch(stream.read(length))
        if start[:8] != b"\x93NUMPY\x01\x00" or match is None:
            raise AssetError(f"{name} is not a plain array")
        shape = tuple(int(n) for n in match[3].replace(b",", b" ").split())
        member = Member(name, np.dtype(match[1].decode()), shape, match[2] == b"True", 10 + length)
        if member.offset + count(shape) * member.dtype.itemsize != info.file_size:
            raise AssetError(
                f"{name} claims shape {shape}, the file holds {info.file_size} bytes of it"
            )
        members[name] = member
    missing = [name for name in required if name not in members]
    if missing:
        raise AssetError(f"{missing[0]} is missing")
    total = sum(count(m.shape) * max(8, m.dtype.itemsize) for m in members.values())
    if total > MAX_BYTES:
        raise AssetError(f"unpacks to {total >> 20} MB; {MAX_BYTES >> 20} MB are accepted")
    return members


def count(shape: Iterable[int]) -> int:
    """How many numbers an array of `shape` has."""
    product = 1
    for n in shape:  # Python integers: cannot overflow
        product *= n
    return product


def array(archive: zipfile.ZipFile, member: Member) -> NDArray[Any]:
    """The array of a header."""
    data = archive.read(f"{member.name}.npy")
    flat = np.frombuffer(data, member.dtype, offset=member.offset)
    return flat.reshape(member.shape, order="F" if member.fortran else "C")


def plain_arrays(
    path: Path, known: Collection[str], required: Iterable[str]
) -> Mapping[str, NDArray[Any]]:
    """The `known` arrays of the zip at `path`; AssetError, one line, for a damaged file or one of another kind."""
    with damage_named(path), zipfile.ZipFile(path) as archive:
        return {k: array(archive, m) for k, m in headers(archive, known, required).items()}
