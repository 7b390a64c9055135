"""faceambig fit: one face, and its files."""

from __future__ import annotations

import argparse

from .inputs import add_camera, add_fitting, add_input, fitting, start_of
from .shared import GOOD, NOT_CONVERGED, fit_line, fit_record, note_lines, say_or_print


def add(command: argparse.ArgumentParser) -> None:
    """Its flags."""
    add_input(command)
    add_fitting(command)
    add_camera(command)
    command.add_argument("--json", action="store_true", help="print JSON for programs")
    command.add_argument(
        "--contours", action="store_true", help="fit the photograph's edges too, as contours"
    )
    command.add_argument(
        "--out",
        metavar="FOLDER",
        help="write there: overlay.png, face.obj, .ply and .glb (metres, coloured), and fit.json, from which sweep, "
        "modes and posterior go on",
    )


def run(options: argparse.Namespace) -> int:
    """Fit a face to a photograph, or to the points of one; write picture, meshes and numbers if asked."""
    from ..reports import photo

    out = None if options.out is None else photo.folder(options.out)  # before the work, not after
    start = start_of(options, pixels=options.contours or out is not None)
    picture, notes = start.picture, start.notes
    if out is not None and picture is None:
        raise ValueError("--out: the photograph is needed to lay the face over it; give it again")
    given = photo.Given(start.observation, notes["image_size_from"], notes["landmarks"], picture)
    outcome = photo.fitted(
        start.model, given, contours=options.contours, camera=options.camera or "perspective",
        distance=options.distance, **fitting(options, start),
    )  # fmt: skip
    fit = outcome.fit
    lines = [fit_line(fit), *note_lines(fit, notes)]
    record = fit_record(fit) | notes
    said: list[str] = []
    if outcome.contours is not None:
        record["contours"] = outcome.contours
        lines.append(photo.contour_words(outcome.contours))
    if picture is not None:
        record["picture"] = {"name": picture.name, "converted": list(picture.notes)}
        said += [f"{picture.name}: {note}" for note in picture.notes]
        if hint := photo.exif_hint(picture, fit):
            record["exif"] = hint
            said.append(photo.hint_words(hint))
    if out is not None and picture is not None:
        files = photo.contents(picture, fit, record, lines)
        photo.write_folder(out, files.items())
        record["files"] = [str(out / name) for name in files]
        said.append(photo.written_words(out, files))
    say_or_print(options, record, lines + said)
    return GOOD if outcome.converged else NOT_CONVERGED
