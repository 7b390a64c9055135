"""Small files: where ours lie, how a text is read, how one is written without ever being half there."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import AssetError

MAX_TEXT_BYTES = (
    1 << 20
)  # 68 points take 2 kB, a dense scheme 200 kB, a face mesh with all its words 300 kB


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
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A path to write to that becomes `path` at the end: readers see the old file or the new one, never half of one."""
    file = Path(path)
    with tempfile.TemporaryDirectory(dir=file.parent, prefix=".faceambig-") as folder:
        whole = Path(folder) / file.name
        yield whole
        whole.replace(file)
