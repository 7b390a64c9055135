"""faceambig landmarks: the points of a face, found by the networks."""

from __future__ import annotations

import argparse
import json
from typing import TYPE_CHECKING, Any

from .shared import GOOD, target, version

if TYPE_CHECKING:
    from faceambig.io.detect import Detection
    from faceambig.io.pictures import Picture


def add(command: argparse.ArgumentParser) -> None:
    """Its flags."""
    command.add_argument("picture", metavar="PHOTO", help="the photograph, with one face or more")
    command.add_argument(
        "--out", metavar="FILE.json", help="where to write the points; fit and sweep read them"
    )
    command.add_argument(
        "--overlay", metavar="FILE.png", help="where to write the photograph with the points on it"
    )
    command.add_argument(
        "--jaw",
        action="store_true",
        help="keep the jaw (points 1 to 17), which is off by a tenth of the eye distance",
    )
    command.add_argument("--json", action="store_true", help="print JSON for programs")


def run(options: argparse.Namespace) -> int:
    """Find the points of the largest face in a photograph; write them, and a picture of them, if asked."""
    from pathlib import Path

    from faceambig.io.detect import detect_landmarks, draw_detection, write_detection
    from faceambig.io.pictures import read_picture

    photograph = Path(options.picture)
    out, overlay = (
        target(name, value, suffix, photograph)
        for name, value, suffix in (
            ("--out", options.out, ".json"),
            ("--overlay", options.overlay, ".png"),
        )
    )
    picture = read_picture(photograph)
    found = detect_landmarks(picture.rgb, jaw=options.jaw, name=picture.name)
    drawn = None if overlay is None else draw_detection(picture.rgb, found)
    write_detection(found, out, drawn, overlay)
    files = [str(path) for path in (out, overlay) if path is not None]
    if options.json:
        print(json.dumps(_record(picture, found, files)))
    else:
        print("\n".join(_lines(picture, found, files, options.jaw)))
    return GOOD


def _record(picture: Picture, found: Detection, files: list[str]) -> dict[str, Any]:
    return {
        "status": "found",
        "picture": picture.name,
        "converted": list(picture.notes),
        "image_size": list(found.image_size),
        "scheme": found.scheme,
        "points": [None if x != x else [x, y] for x, y in found.points.tolist()],
        "box_px": list(found.box),
        "score": found.score,
        "presence_log_odds": found.presence,
        "n_faces": found.n_faces,
        "files": files,
        "version": version(),
    }


def _lines(picture: Picture, found: Detection, files: list[str], jaw: bool) -> list[str]:
    left, top, right, bottom = found.box
    where = f"from ({left:.0f}, {top:.0f}) to ({right:.0f}, {bottom:.0f})"
    lines = [f"{picture.name}: {note}" for note in picture.notes]
    lines.append(f"{picture.name}: a face {where}, score {found.score:.2f}")
    if found.n_faces > 1:
        lines.append(f"{found.n_faces} faces found; these are the points of the largest")
    lines.append(
        "68 points; those of the jaw are off by a tenth of the eye distance"
        if jaw
        else "51 points; the jaw (1 to 17) is left out, --jaw keeps it"
    )
    return [*lines, f"written: {', '.join(files)}"] if files else lines
