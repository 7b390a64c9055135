"""Small files: where ours lie, how a text is read, how one is written without ever being half there."""

from __future__ import annotations

import os
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from ..errors import AssetError

# Of all arrays of a model as float64; the largest public one, 53,490 vertices and 199 modes, needs 255 MB
MAX_BYTES = 1 << 29
# 68 points take 2 kB, a dense scheme 200 kB, a face mesh with all its words 300 kB
MAX_TEXT_BYTES = 1 << 20


def asset_path(name: str) -> Path:
    """A file of ours: beside the installed package, or in the checkout."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "_assets"
    return (installed if installed.is_dir() else package.parent / "assets") / name


def text_of(path: Path, most: int = MAX_TEXT_BYTES, kind: str = "a landmark file") -> str:
    """A text file of at most `most` bytes; AssetError if it is none."""
    try:
        if path.stat().st_size > most:
            raise AssetError(f"{path.name}: {path.stat().st_size} bytes, {kind} has at most {most}")
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise AssetError(f"{path.name}: not a text file") from error
    except OSError as error:
        raise AssetError(f"{path}: cannot be read ({error.strerror or error})") from error


@contextmanager
def damage_named(path: Path) -> Iterator[None]:
    """Whatever reading a model at `path` raises becomes an AssetError of one line that names the file."""
    try:
        with np.errstate(all="ignore"):  # what is not finite is refused by name
            yield
    except AssetError as error:
        message = str(error)
        raise error if path.name in message else AssetError(f"{path.name}: {message}") from error
    except (
        # all that zipfile, zlib, h5py and NumPy raise on bytes that are not what they say
        ValueError, TypeError, KeyError, IndexError, OSError, EOFError, RuntimeError, OverflowError, MemoryError,
        NotImplementedError, zipfile.BadZipFile, zlib.error,
    ) as error:  # fmt: skip
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise AssetError(f"{path.name}: damaged model file ({reason:.100})") from error


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A path to write to that becomes `path` at the end: readers see the old file or the new one, never half of one."""
    file = Path(path)
    with tempfile.TemporaryDirectory(dir=file.parent, prefix=".faceambig-") as folder:
        whole = Path(folder) / file.name
        yield whole
        with whole.open(
            "rb+"
        ) as written:  # some systems tell only here that there is no room for it
            os.fsync(written.fileno())
        whole.replace(file)
