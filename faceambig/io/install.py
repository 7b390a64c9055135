"""Models that may be had freely, fetched: ICT-FaceKit and GNM, each file at a fixed revision and with a checksum.

`assets/models/<name>.txt` lists them. They go to FACEAMBIG_MODELS, else to the user's data folder, and appear there in
one step: a model is there whole or not at all.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import platformdirs

from ..errors import AssetError, listed
from .files import MAX_BYTES, asset_path, text_of

# What `load_model` is given of an installed model
ENTRIES = {"ict": ".", "gnm": "gnm_head.npz"}
TIMEOUT_S = 60.0
PIECE = 1 << 20  # bytes


@dataclass(frozen=True, slots=True)
class Wanted:
    """A file of a model."""

    sha256: str
    size: int  # bytes; 0: not known
    place: str  # below the address of the model
    name: str  # below its folder


def models_folder() -> Path:
    """FACEAMBIG_MODELS, else `models` in the user's data folder for faceambig."""
    named = os.environ.get("FACEAMBIG_MODELS")
    return Path(named) if named else platformdirs.user_data_path("faceambig") / "models"


def installed(name: str) -> Path | None:
    """What `load_model` reads of the installed model `name`; None if it is not installed."""
    entry = models_folder() / name / ENTRIES[name]
    return entry if entry.exists() else None


def install(
    name: str,
    *,
    address: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """The folder of model `name`, fetched unless it is there already, every file checked.

    Parameters
    ----------
    name: "ict" or "gnm".
    address: where the files are, https:// or file://; default the place of their authors.
    progress: called before each file with those done and all.

    Raises
    ------
    ValueError: another name; an address of another kind.
    AssetError: a file cannot be fetched, or is not the one that was checked. Nothing is left behind.
    """
    if name not in ENTRIES:
        raise ValueError(f"model: {name!r:.60} cannot be installed; {listed(ENTRIES)} can")
    origin, wanted = _listed(name)
    base = address or origin
    if urllib.parse.urlsplit(base).scheme not in ("https", "http", "file"):
        raise ValueError(f"address: {base!r:.60} does not begin with https:// or file://")
    folder = models_folder() / name
    if folder.is_dir():
        return folder
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=".faceambig-") as beside:
        whole = Path(beside) / name
        for done, file in enumerate(wanted):
            if progress is not None:
                progress(done, len(wanted))
            target = whole / file.name
            target.parent.mkdir(parents=True, exist_ok=True)
            _fetch(base.rstrip("/") + "/" + urllib.parse.quote(file.place), file, target)
        try:
            whole.rename(folder)
        except OSError:
            if not folder.is_dir():  # else another process was first, with the same files
                raise
    return folder


def _listed(name: str) -> tuple[str, list[Wanted]]:
    """The address of a model and its files."""
    lines = text_of(asset_path(f"models/{name}.txt")).splitlines()
    origin, *rows = (line for line in lines if line and not line.startswith("#"))
    wanted = []
    for row in rows:
        sha256, size, place, file = row.split()
        if PurePosixPath(file).is_absolute() or ".." in PurePosixPath(file).parts:
            raise AssetError(f"{name}.txt: {file!r:.60} leads out of the folder")
        wanted.append(Wanted(sha256, int(size), place, file))
    return origin, wanted


def _fetch(address: str, file: Wanted, target: Path) -> None:
    most = file.size or MAX_BYTES
    digest, size = hashlib.sha256(), 0
    try:
        with (
            urllib.request.urlopen(address, timeout=TIMEOUT_S) as answer,  # noqa: S310 - kind checked above
            target.open("wb") as stream,
        ):
            while piece := answer.read(PIECE):
                size += len(piece)
                if size > most:
                    raise AssetError(f"{address}: more than {most} bytes")
                digest.update(piece)
                stream.write(piece)
    except urllib.error.HTTPError as error:
        raise AssetError(f"{address}: the server answers {error.code} {error.reason}") from error
    except urllib.error.URLError as error:
        raise AssetError(f"{address}: cannot be fetched ({error.reason})") from error
    except (OSError, ValueError) as error:
        if isinstance(error, AssetError):
            raise
        raise AssetError(f"{address}: cannot be fetched ({error})") from error
    if digest.hexdigest() != file.sha256:
        raise AssetError(
            f"{address}: not the file that was checked (sha256 {digest.hexdigest()[:12]}..., "
            f"{file.sha256[:12]}... is wanted); nothing was installed"
        )
