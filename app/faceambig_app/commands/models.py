"""faceambig models: what a model holds; a model of another format as our own file; the free models fetched."""

from __future__ import annotations

import argparse
import json
import sys
from typing import TYPE_CHECKING, Any

from .shared import GOOD

if TYPE_CHECKING:
    import faceambig as fa

USAGE = """faceambig models [info] [MODEL] [--scheme NAME] [--part PART] [--json]
       faceambig models convert MODEL FILE.npz [--part PART] [--json]
       faceambig models install ict|gnm [--from ADDRESS] [--json]"""
ACTIONS = {
    "info": (0, 1),
    "convert": (2, 2),
    "install": (1, 1),
}  # words that follow, least and most


def add(command: argparse.ArgumentParser) -> None:
    """Its flags."""
    command.usage = USAGE
    command.add_argument(
        "words",
        nargs="*",
        default=[],
        metavar="WORD",
        help="info MODEL: what it holds (default embedded; info may be left out); convert MODEL FILE.npz: as a file "
        "of faceambig; install ict or gnm: fetch it. MODEL is embedded, ict, gnm or a path",
    )
    command.add_argument(
        "--scheme", metavar="NAME", help="list the points of this scheme: name, side, vertex"
    )
    command.add_argument(
        "--part", default="face", help="face, or head where the file has both (default face)"
    )
    command.add_argument(
        "--from", dest="address", metavar="ADDRESS", help="install: another place of the files"
    )
    command.add_argument("--json", action="store_true", help="print JSON for programs")


def run(options: argparse.Namespace) -> int:
    """Do what the first word says; without one, say what the model holds."""
    action, words = "info", list(options.words)
    if words and words[0] in ACTIONS:
        action = words.pop(0)
    least, most = ACTIONS[action]
    if not least <= len(words) <= most:
        needs = {
            "info": "at most one MODEL",
            "convert": "MODEL and FILE.npz",
            "install": "ict or gnm",
        }
        raise ValueError(f"{action}: {needs[action]} expected, {len(words)} words given")
    if options.scheme is not None and action != "info":
        raise ValueError(f"--scheme: goes with info, not with {action}")
    if options.address is not None and action != "install":
        raise ValueError(f"--from: goes with install, not with {action}")
    return {"info": _info, "convert": _convert, "install": _install}[action](words, options)


def _info(words: list[str], options: argparse.Namespace) -> int:
    import faceambig as fa

    # At the file's own origin: so that a model without eyes can be looked at too
    model = fa.load_model(words[0] if words else "embedded", part=options.part, origin="file")
    chosen = [model.scheme(options.scheme)] if options.scheme else list(model.schemes.values())
    if options.json:
        print(json.dumps(_record(model, chosen)))
    elif options.scheme:
        for name, side, vertex in chosen[0].rows():
            print(f"{name:>6} {side:>6} {vertex:6}")
    else:
        print("\n".join(_lines(model, chosen)))
    return GOOD


def _record(model: fa.FaceModel, schemes: list[fa.Scheme]) -> dict[str, Any]:
    from faceambig.io import eye_distances

    keys = ("name", "side", "vertex")
    return {
        "name": model.name,
        "source": model.source,
        "licence": model.licence,
        "unit_of_file": model.unit,
        "vertices": model.n_vertices,
        "modes": model.n_modes,
        "triangles": len(model.faces),
        "subjects": len(model.subjects),
        "colours": model.colours is not None,
        "eye_distances_mm": {what: mm for what, mm, _, _ in eye_distances(model)},
        "eye_distances_expected_mm": {what: [a, b] for what, _, a, b in eye_distances(model)},
        "schemes": {
            scheme.name: [dict(zip(keys, row, strict=True)) for row in scheme.rows()]
            for scheme in schemes
        },
    }


def _lines(model: fa.FaceModel, schemes: list[fa.Scheme]) -> list[str]:
    from faceambig.io import eye_distances

    lines = [
        f"{model.name}: {model.source}; {model.licence or 'licence not known'}",
        f"{model.n_vertices} vertices, {model.n_modes} modes, {len(model.subjects)} subjects",
        f"unit in the file: {model.unit or 'metre'}",
    ]
    for what, mm, low, high in eye_distances(model):
        lines.append(f"{what} of the mean: {mm:.1f} mm (an adult's {low:g} to {high:g})")
    if not model.schemes:
        lines.append(
            "no landmarks: the size of the face cannot be checked, and origin='file' is needed"
        )
    return lines + [f"scheme {s.name}: {len(s)} points; eyes: {s.eyes_meaning}" for s in schemes]


def _convert(words: list[str], options: argparse.Namespace) -> int:
    from pathlib import Path

    import faceambig as fa
    from faceambig.io import save_model

    source, target = words[0], Path(words[1])
    if target.suffix.lower() != ".npz":
        raise ValueError(f"convert: {words[1]!r} does not end in .npz")
    if not target.parent.is_dir():
        raise ValueError(f"convert: there is no folder {str(target.parent)!r}")
    if target.is_dir() or (target.exists() and Path(source).exists() and target.samefile(source)):
        raise ValueError(
            f"convert: {words[1]!r} is {'a folder' if target.is_dir() else 'the model itself'}"
        )
    model = fa.load_model(source, part=options.part, origin="file")
    save_model(model, target)
    if options.json:
        print(json.dumps({"file": str(target), "name": model.name, "licence": model.licence}))
    else:
        print(
            f"written: {target} ({target.stat().st_size >> 20} MB); {model.licence or 'licence not known'}"
        )
    return GOOD


def _install(words: list[str], options: argparse.Namespace) -> int:
    from faceambig.io.install import install

    def progress(done: int, total: int) -> None:
        if sys.stderr.isatty():
            print(f"\r{words[0]}: file {done + 1} of {total}", end="", file=sys.stderr, flush=True)

    try:
        folder = install(words[0], address=options.address, progress=progress)
    finally:
        if sys.stderr.isatty():
            print(file=sys.stderr)
    if options.json:
        print(json.dumps({"name": words[0], "folder": str(folder)}))
    else:
        print(f"{words[0]}: installed in {folder}; use it as --model {words[0]}")
    return GOOD
