"""What several commands share: statuses, records for programs, words for people, tables, files to write."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path

    import faceambig as fa

GOOD, NOT_CONVERGED, BAD_INPUT, READER_GONE = 0, 1, 2, 141


def add_outputs(command: argparse.ArgumentParser, table: str, picture: str) -> None:
    """--json, and files for a table and a picture; what they hold is said in the help."""
    command.add_argument("--json", action="store_true", help="print JSON for programs")
    command.add_argument("--csv", metavar="FILE.csv", help=f"write {table} as a table there")
    command.add_argument("--plot", metavar="FILE.png", help=f"draw {picture} there")


def outputs_of(options: argparse.Namespace) -> tuple[Path | None, Path | None]:
    """Where table and picture are to be written; ValueError if that cannot be, before any work."""
    from pathlib import Path

    source = None if options.file is None else Path(options.file)
    csv = target("--csv", options.csv, ".csv", source)
    return csv, target("--plot", options.plot, ".png", source)


def target(name: str, value: str | None, suffix: str, source: Path | None) -> Path | None:
    """The path to write to, if one is asked for; ValueError if that cannot be, or if it is `source` itself."""
    from pathlib import Path

    if value is None:
        return None
    path = Path(value)
    if path.suffix.lower() != suffix:
        raise ValueError(f"{name}: {value!r} does not end in {suffix}")
    if not path.parent.is_dir():
        raise ValueError(f"{name}: there is no folder {str(path.parent)!r}")
    if path.is_dir():
        raise ValueError(f"{name}: {value!r} is a folder, not a file")
    if source is not None and path.exists() and source.exists() and path.samefile(source):
        what = "photograph" if suffix in (".json", ".png") else "input"
        raise ValueError(f"{name}: {value!r} is the {what} itself")
    return path


def table_csv(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> bytes:
    """A CSV file: a header, rows of numbers with all their digits."""
    import csv
    import io

    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return text.getvalue().encode()


def written(
    files: Mapping[Path, bytes],
    folder: Path | None = None,
    inside: Iterable[tuple[str, bytes]] = (),
) -> list[str]:
    """Write all files, and those `inside` a folder by name, or none; what was written, in order."""
    from ..files import write_all
    from ..reports.photo import write_folder

    done = [str(path) for path in files]
    if folder is None:
        write_all(files)
        return done

    def named() -> Iterable[tuple[str, bytes]]:
        for name, data in inside:
            done.append(str(folder / name))
            yield name, data

    write_folder(folder, named(), files)
    return done


def written_lines(done: Sequence[str]) -> list[str]:
    """What was written, in words."""
    if not done:
        return []
    if len(done) <= 6:
        return [f"written: {', '.join(done)}"]
    return [f"written: {len(done)} files, {done[0]} to {done[-1]}"]


def say_or_print(
    options: argparse.Namespace, record: Mapping[str, Any], lines: Iterable[str]
) -> None:
    """The record for a program, or the lines for a person."""
    import json

    print(json.dumps(record, allow_nan=False) if options.json else "\n".join(lines))


def notes_of(observation: fa.Observation, image_size_from: str, landmarks: str) -> dict[str, Any]:
    """What was assumed about a picture."""
    cx, cy = observation.centre
    return {
        "points_used": int(observation.visible.sum()),
        "principal_point": f"({cx:g}, {cy:g}), {observation.centre_meaning}",
        "image_size_from": image_size_from,
        "landmarks": landmarks,
    }


def note_lines(fit: fa.Fit, notes: Mapping[str, Any]) -> list[str]:
    """The same in words, with the unit of d_L."""
    return [
        f"interocular distance: {fit.interocular_px:.1f} px, {fit.interocular_meaning}",
        f"principal point: {notes['principal_point']}; picture size: {notes['image_size_from']}",
        f"landmarks: {notes['landmarks']}",
    ]


def fit_line(fit: fa.Fit) -> str:
    """How a fit ended, in one line."""
    return (
        f"{fit.status}: camera at {place(fit.distance)}, landmark error d_L {fit.d_l_percent:.2f} % "
        "of the interocular distance"
    )


def place(metres: float | None) -> str:
    """A distance in words."""
    return "far away (orthographic)" if metres is None else f"{100 * metres:.3g} cm"


def fit_record(fit: fa.Fit) -> dict[str, Any]:
    """A fit as JSON: metres, pixels, radians, names as in Python."""
    camera = {"focal_px": fit.focal} if fit.focal is not None else {"scale": fit.scale}
    return {
        "status": str(fit.status),
        "camera": "orthographic" if fit.distance is None else "perspective",
        "distance_m": fit.distance,
        **camera,
        "rotation": fit.rotation.tolist(),
        "translation_m": fit.translation.tolist(),
        "alpha": fit.alpha.tolist(),
        "cost": fit.cost,
        "d_l_percent": fit.d_l_percent,
        "d_l_unit": fit.interocular_meaning,
        "steps": fit.steps,
        "version": version(),
    }


def version() -> str:
    """The installed version of faceambig."""
    from importlib.metadata import version as installed

    return installed("faceambig")
