"""Output files: the whole of them or nothing."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory


def writable(path: Path) -> None:
    """ValueError if a file cannot be put at `path`: no such folder, or a folder itself."""
    if not path.parent.is_dir():
        raise ValueError(f"out: there is no folder {str(path.parent)!r}")
    if path.is_dir():
        raise ValueError(f"out: {str(path)!r} is a folder, not a file")


def write(path: Path, data: bytes) -> None:
    """The whole file or nothing: beside it first, then in its place. ValueError says why not."""
    writable(path)
    write_all({path: data})


def write_all(files: Mapping[Path, bytes]) -> None:
    """All files or none: each beside its place first, and only when all of them are there, in their places.

    ValueError says why not; of a full disk nothing is left.
    """
    write_pairs(files.items())


def write_pairs(files: Iterable[tuple[Path, bytes]]) -> None:
    """As `write_all`; the files are taken one after the other, so that they need not be in memory together."""
    path = None
    try:
        with ExitStack() as stack:
            beside: dict[Path, Path] = {}  # folder of files -> where they wait
            waiting: dict[Path, Path] = {}
            for path, data in files:
                if path.parent not in beside:
                    made = TemporaryDirectory(dir=path.parent, prefix=".faceambig-")
                    beside[path.parent] = Path(stack.enter_context(made))
                waiting[path] = beside[path.parent] / path.name
                _write_through(waiting[path], data)
            for path, whole in waiting.items():
                whole.replace(path)
    except OSError as error:
        raise ValueError(f"out: cannot write {str(path)!r}: {error.strerror}") from error


def _write_through(path: Path, data: bytes) -> None:
    """A new file, on the disk when this returns: some systems tell only then that there is no room for it."""
    path.write_bytes(data)
    with path.open("rb+") as file:
        os.fsync(file.fileno())
