"""faceambig modes: how the face may bend behind its points, by flexibility, by probability, or to its extremes."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from . import flexible, kinds
from .inputs import add_camera, add_fitting, add_input, fit_of, start_of
from .progress import Progress
from .shared import (
    GOOD,
    add_outputs,
    fit_line,
    fit_record,
    note_lines,
    outputs_of,
    say_or_print,
    table_csv,
    written,
    written_lines,
)

if TYPE_CHECKING:
    from pathlib import Path

    import faceambig as fa
    from faceambig.arrays import Array


KINDS = ("obj", "ply", "glb")


def add(command: argparse.ArgumentParser) -> None:
    """Its flags."""
    add_input(command)
    add_fitting(command)
    add_camera(command)
    _add_kind(command)
    _add_kept(command)
    command.add_argument(
        "--out", metavar="FOLDER",
        help="write there, each as .obj, .ply and .glb: the fitted face, and the listed modes to both sides or the "
        "extreme faces",
    )  # fmt: skip
    add_outputs(command, "the modes", "the first of these faces beside the fit")


def _add_kind(command: argparse.ArgumentParser) -> None:
    """Which modes, and what the camera does meanwhile."""
    kind = command.add_mutually_exclusive_group()
    kind.add_argument(
        "--posterior", action="store_true",
        help="modes of what is uncertain, one standard deviation long, and what pose, distance and shape contribute",
    )  # fmt: skip
    kind.add_argument(
        "--extremes",
        action="store_true",
        help="the two faces farthest from the fit that the points allow",
    )
    command.add_argument("--count", type=int, help="modes listed (default 3)")
    command.add_argument(
        "--at",
        choices=tuple(flexible.AT),
        help="where the landmarks' change is taken (default reprojection)",
    )
    command.add_argument(
        "--pose",
        help="flexibility: fixed or compensated, the camera follows the bend (default fixed); --posterior: fixed or "
        "free (default free); --extremes: fixed or free (default fixed)",
    )
    command.add_argument(
        "--free-distance",
        action="store_true",
        help="a compensated or free pose has a free distance, too",
    )


def _add_kept(command: argparse.ArgumentParser) -> None:
    """Which of them are kept, and how far faces are bent."""
    command.add_argument(
        "--k1",
        type=float,
        metavar="MM",
        help="a mode is kept that changes the surface by this (default 2 mm)",
    )
    command.add_argument(
        "--k2",
        metavar="PX",
        help="and the landmarks by less: pixels, or as 1%% of the eye distance (default 2)",
    )
    command.add_argument(
        "--mm", type=float,
        help="how far --plot and --out bend the face to each side (default: as far as it is plausible, 10 at most)",
    )  # fmt: skip
    command.add_argument(
        "--tolerance", type=float, metavar="PERCENT",
        help="of --extremes: rms landmark distance allowed, %% of the eye distance (default 3)",
    )  # fmt: skip


def run(options: argparse.Namespace) -> int:
    """List modes or extreme faces of a fit; write table, picture and meshes if asked."""
    csv, plot = outputs_of(options)
    out = _folder(options)
    _refuse_unused(options)
    start = start_of(options)
    fit = fit_of(options, start)
    if options.extremes:
        result = kinds.extremes(options, fit)
    elif options.posterior:
        result = kinds.posterior(options, fit)
    else:
        result = flexible.flexible(options, fit)
    note = f"{fit.model.name} model; {start.notes['landmarks']}"
    files: dict[Path, bytes] = {}
    if csv is not None:
        files[csv] = table_csv(result.header, result.rows)
    if plot is not None:
        from faceambig.render.overlay import encode_png

        from ..reports.sheets import faces_sheet

        drawn = faces_sheet(fit, result.drawn, note)
        files[plot] = encode_png(drawn, {"Software": "faceambig", "Description": note})
    done = written(files, out, _meshes(fit, result.faces, note))
    record = {"fit": fit_record(fit)} | result.record | start.notes | {"files": done}
    lines = [fit_line(fit), *result.lines, *note_lines(fit, start.notes), *written_lines(done)]
    say_or_print(options, record, lines)
    return GOOD


def _folder(options: argparse.Namespace) -> Path | None:
    if options.out is None:
        return None
    from ..reports.photo import folder

    return folder(options.out, ())


def _refuse_unused(options: argparse.Namespace) -> None:
    """ValueError for a flag that the kind of modes asked for has no use for."""
    unused = {
        "extremes": ("count", "at", "k1", "k2", "mm", "free_distance"),
        "posterior": ("at", "k1", "k2", "mm", "tolerance"),
        "": ("tolerance",),
    }
    kind = "extremes" if options.extremes else "posterior" if options.posterior else ""
    for name in unused[kind]:
        if getattr(options, name) not in (None, False):
            flag = f"--{name.replace('_', '-')}"
            raise ValueError(
                f"{flag}: only without --{kind}" if kind else f"{flag}: only with --extremes"
            )


def _meshes(
    fit: fa.Fit, faces: Iterable[tuple[str, Array, str]], note: str
) -> Iterator[tuple[str, bytes]]:
    """Files of the faces, the fitted one first, in every format."""
    from ..reports.photo import face_meshes

    faces = [("fit", fit.alpha, "the fitted face"), *faces]
    with Progress("faces", len(faces)) as progress:
        for name, alpha, words in progress.over(faces):
            yield from face_meshes(fit.model, name, alpha, (words, fit_line(fit), note), KINDS)
