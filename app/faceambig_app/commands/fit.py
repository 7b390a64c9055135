"""faceambig fit: one face, and its files."""

from __future__ import annotations

import argparse
import json
from typing import TYPE_CHECKING, Any

from .shared import GOOD, NOT_CONVERGED, add_options, fit_record, image_size, notes_of

if TYPE_CHECKING:
    import faceambig as fa


def add(command: argparse.ArgumentParser) -> None:
    """Its flags."""
    command.add_argument(
        "file",
        metavar="FILE",
        help="the photograph, with --landmarks or --auto; or its landmarks alone",
    )
    command.add_argument("--landmarks", metavar="POINTS", help="landmarks of the photograph")
    command.add_argument("--auto", action="store_true", help="find the landmarks by itself")
    add_options(command)
    command.add_argument(
        "--distance",
        type=float,
        metavar="M",
        help="assumed camera distance, metres; left out: fitted too",
    )
    command.add_argument(
        "--camera", default="perspective", help="perspective or orthographic (default perspective)"
    )
    command.add_argument(
        "--contours", action="store_true", help="fit the photograph's edges too, as contours"
    )
    command.add_argument(
        "--out",
        metavar="FOLDER",
        help="write there: overlay.png, face.obj, .ply and .glb (metres, coloured), fit.json",
    )


def run(options: argparse.Namespace) -> int:
    """Fit a face to a photograph, or to the points of one; write picture, meshes and numbers if asked."""
    from pathlib import Path

    import faceambig as fa

    from .. import photo

    out = None if options.out is None else photo.folder(options.out)  # before the work, not after
    model = fa.load_model(options.model)
    start = photo.given(
        Path(options.file), model, landmarks=None if options.landmarks is None else Path(options.landmarks),
        auto=options.auto, image_size=image_size(options.image_size), pixels=options.contours or out is not None,
    )  # fmt: skip
    outcome = photo.fitted(
        model, start, contours=options.contours, camera=options.camera, distance=options.distance,
        modes=options.modes, box=options.box, noise_percent=options.prior,
    )  # fmt: skip
    fit, picture = outcome.fit, start.picture
    notes = notes_of(start.observation, start.image_size_from, start.landmarks)
    lines = fit_lines(fit, notes)
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
        photo.write_folder(out, files)
        record["files"] = [str(out / name) for name in files]
        said.append(photo.written_words(out, files))
    if options.json:
        print(json.dumps(record))
    else:
        print("\n".join(lines + said))
    return GOOD if outcome.converged else NOT_CONVERGED


def fit_lines(fit: fa.Fit, notes: dict[str, Any]) -> list[str]:
    """A fit in words."""
    where = "far away (orthographic)" if fit.distance is None else f"{100 * fit.distance:.3g} cm"
    return [
        f"{fit.status}: camera at {where}, landmark error d_L {fit.d_l_percent:.2f} % of the interocular distance",
        f"interocular distance: {fit.interocular_px:.1f} px, {fit.interocular_meaning}",
        f"principal point: {notes['principal_point']}; picture size: {notes['image_size_from']}",
        f"landmarks: {notes['landmarks']}",
    ]
