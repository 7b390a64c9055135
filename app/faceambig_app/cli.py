"""faceambig on the command line: parse -> state or library call -> print. Text for people, --json for programs.

Exit status 0: good; 1: the fit did not converge; 2: bad input, one line on stderr, never a traceback.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NoReturn

from .forms import LONGEST, from_json, text_of, value_of
from .state import DEFAULT, FIELDS, Field, ViewState, changed

if TYPE_CHECKING:
    from pathlib import Path

    import faceambig as fa

GOOD, NOT_CONVERGED, BAD_INPUT = 0, 1, 2


class Parser(argparse.ArgumentParser):
    """argparse with errors of one line, and flags in full: an abbreviation of today may mean two things tomorrow."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options, allow_abbrev=False)

    def error(self, message: str) -> NoReturn:
        """One line on stderr, exit status 2."""
        short = (
            message if len(message) <= 300 else f"{message[:297]}..."
        )  # argparse repeats all of a value
        self.exit(BAD_INPUT, f"{self.prog}: {short}\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit status."""
    options = parser().parse_args(arguments)
    try:
        return options.run(options)
    except (
        ValueError,
        OSError,
        RuntimeError,
    ) as error:  # AssetError and ServeError are among these
        print(f"faceambig {options.command}: {one_line(error)}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        return 130


def one_line(error: BaseException) -> str:
    """The error's words on one line."""
    if isinstance(error, OSError) and error.strerror and error.filename:
        return f"{error.filename}: {error.strerror}"
    return " ".join(str(error).split()) or type(error).__name__


def parser() -> Parser:
    """All commands and their flags; those of a picture come from the field table."""
    root = Parser(prog="faceambig", description="A photograph of a face does not fix the face.")
    commands = root.add_subparsers(
        dest="command", required=True, parser_class=Parser, metavar="COMMAND"
    )
    _serve(commands.add_parser("serve", help="open the page on this machine"))
    _snapshot(
        commands.add_parser(
            "snapshot", help="draw the page's picture of a state, without a browser"
        )
    )
    _fit(commands.add_parser("fit", help="fit a face to the points of a photograph"))
    _sweep(commands.add_parser("sweep", help="fit at many distances"))
    _landmarks(commands.add_parser("landmarks", help="find the points of a face in a photograph"))
    _models(commands.add_parser("models", help="what a model holds: modes, landmark schemes"))
    return root


def _serve(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--host",
        default="127.0.0.1",
        help="address to listen on; only this machine's own (default 127.0.0.1)",
    )
    command.add_argument("--port", type=int, default=8080, help="port (default 8080)")
    command.set_defaults(run=run_serve)


def _snapshot(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--out", required=True, metavar="FILE.png", help="where to write the picture"
    )
    command.add_argument("--width", type=int, metavar="PX", help="width of the picture")
    command.add_argument("--height", type=int, metavar="PX", help="height of the picture")
    command.add_argument(
        "--state", metavar="FILE.json", help="a state, as saved by the page; flags change it"
    )
    for field in FIELDS.values():
        command.add_argument(
            field.flag, dest=field.name, metavar=field.name.upper(), help=_help(field)
        )
    command.set_defaults(run=run_snapshot)


def _help(field: Field) -> str:
    """What a flag sets, its range or choices, its default."""
    within = f"{field.low:g} to {field.high:g}" if field.high < float("inf") else ""
    told = " ".join(filter(None, (within, field.unit))) or ", ".join(map(str, field.choices))
    default = text_of(field, getattr(DEFAULT, field.name))
    ranged = f" [{told}]" if told else ""
    return f"{field.help}{ranged} (default {default})".replace("%", "%%")  # argparse fills in %


def _points(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "points",
        metavar="FILE",
        help="landmarks of the photograph: .pts, CSV with x and y, or JSON; 68 or 51 points of iBUG, "
        "468 or 478 of MediaPipe, or points with names",
    )
    _options(command)


def _options(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--model", default="embedded", help="model name or path (default embedded)"
    )
    command.add_argument(
        "--image-size",
        metavar="WxH",
        help="size of the picture in pixels (default: of the picture of the same name beside the points)",
    )
    command.add_argument(
        "--modes",
        type=int,
        help="shape modes used (default: the strongest 70, or all of a model with fewer)",
    )
    command.add_argument(
        "--box", type=float, default=2.0, help="largest shape coefficient, sd (default 2)"
    )
    command.add_argument(
        "--prior",
        type=float,
        default=1.0,
        help="landmark noise assumed, %% of the eye distance (default 1)",
    )
    command.add_argument("--json", action="store_true", help="print JSON for programs")


def _fit(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "file",
        metavar="FILE",
        help="the photograph, with --landmarks or --auto; or its landmarks alone",
    )
    command.add_argument("--landmarks", metavar="POINTS", help="landmarks of the photograph")
    command.add_argument("--auto", action="store_true", help="find the landmarks by itself")
    _options(command)
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
    command.set_defaults(run=run_fit)


def _sweep(command: argparse.ArgumentParser) -> None:
    _points(command)
    command.add_argument(
        "--from",
        dest="low",
        type=float,
        default=0.2,
        metavar="M",
        help="nearest distance (default 0.2)",
    )
    command.add_argument(
        "--to",
        dest="high",
        type=float,
        default=3.0,
        metavar="M",
        help="farthest distance (default 3)",
    )
    command.add_argument(
        "--steps", type=int, default=13, help="distances, evenly in ratio (default 13)"
    )
    command.set_defaults(run=run_sweep)


def _landmarks(command: argparse.ArgumentParser) -> None:
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
    command.set_defaults(run=run_landmarks)


def _models(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "model",
        nargs="?",
        default="embedded",
        metavar="MODEL",
        help="model name or path (default embedded)",
    )
    command.add_argument(
        "--scheme", metavar="NAME", help="list the points of this scheme: name, side, vertex"
    )
    command.add_argument("--json", action="store_true", help="print JSON for programs")
    command.set_defaults(run=run_models)


def run_serve(options: argparse.Namespace) -> int:
    """Serve the page until interrupted."""
    from .server import serve

    return serve(options.host, options.port)


def run_snapshot(options: argparse.Namespace) -> int:
    """Draw a state off-screen."""
    state = state_of(options)
    for side in (options.width, options.height):
        if side is not None and not 64 <= side <= 8192:
            raise ValueError(f"width, height: {side} is not within 64 to 8192 pixels")
    from pathlib import Path

    from .pipeline import snapshot, writable

    writable(Path(options.out))  # before the work, not after it
    snapshot(state, options.out, width=options.width, height=options.height)
    return GOOD


def state_of(options: argparse.Namespace) -> ViewState:
    """The state of the file and the flags given; a flag counts before the file."""
    given = {
        name: value_of(field, getattr(options, name))
        for name, field in FIELDS.items()
        if getattr(options, name) is not None
    }
    return changed(DEFAULT if options.state is None else _saved(options.state), **given)


def _saved(name: str) -> ViewState:
    """The state in a file of JSON."""
    from pathlib import Path

    path = Path(name)
    with path.open("rb") as file:
        content = file.read(LONGEST + 1)  # not more than tells that it is too long
    try:
        return from_json(content)
    except ValueError as error:
        raise ValueError(f"{path.name}: {error}") from error


def run_fit(options: argparse.Namespace) -> int:
    """Fit a face to a photograph, or to the points of one; write picture, meshes and numbers if asked."""
    from pathlib import Path

    import faceambig as fa

    from . import photo

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


def run_sweep(options: argparse.Namespace) -> int:
    """Fit at many distances and with the far-away camera."""
    import numpy as np

    import faceambig as fa

    if not 0.2 <= options.low <= options.high < float("inf") or not 1 <= options.steps <= 1000:
        raise ValueError(
            f"--from {options.low:g} --to {options.high:g} --steps {options.steps}: "
            "from at least 0.2 m up to `to`, 1 to 1000 steps"
        )
    model = fa.load_model(options.model)
    observation, notes = observation_of(options, model)
    sweep = fa.sweep_distance(
        model, observation, np.geomspace(options.low, options.high, options.steps),
        modes=options.modes, box=options.box, noise_percent=options.prior,
    )  # fmt: skip
    interval = sweep.interval()
    fits = (*sweep.fits, sweep.orthographic)
    speeds = [*sweep.speed_mm_per_octave().tolist(), 0.0]  # at infinity no doubling changes a thing
    if options.json:
        span = {
            "low_m": interval.low,
            "high_m": interval.high,
            "empty": interval.empty,
            "pieces": interval.pieces,
            "best_d_l_percent": interval.best_d_l_percent,
            "tolerance_percent": interval.tolerance_percent,
        }
        records = [
            fit_record(fit) | {"speed_mm_per_octave": speed}
            for fit, speed in zip(fits, speeds, strict=True)
        ]
        # JSON knows no infinity: null is the orthographic camera, as in distance_m
        disagreed = [None if np.isinf(d) else d for d in sweep.disagreed.tolist()]
        print(
            json.dumps(
                {"fits": records, "interval": span, "disagreed_distances_m": disagreed} | notes
            )
        )
    else:
        print("distance cm   d_L %   face changes mm per doubling   status")
        for fit, speed in zip(fits, speeds, strict=True):
            name = "orthographic" if fit.distance is None else f"{100 * fit.distance:.4g}"
            print(f"{name:>12} {fit.d_l_percent:7.3f} {speed:30.2f}   {fit.status}")
        if len(sweep.disagreed):
            print(
                f"at {len(sweep.disagreed)} distances another fit came from the other side; the lower cost is kept"
            )
        print(interval_words(interval))
        print(
            f"interocular distance: {fits[0].interocular_px:.1f} px, {fits[0].interocular_meaning}"
        )
        print(
            f"principal point: {notes['principal_point']}; picture size: {notes['image_size_from']}"
        )
        print(f"landmarks: {notes['landmarks']}")
    return GOOD if all(fit.converged for fit in fits) else NOT_CONVERGED


def run_landmarks(options: argparse.Namespace) -> int:
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
        record = {
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
        print(json.dumps(record))
        return GOOD
    for note in picture.notes:
        print(f"{picture.name}: {note}")
    left, top, right, bottom = found.box
    print(
        f"{picture.name}: a face from ({left:.0f}, {top:.0f}) to ({right:.0f}, {bottom:.0f}), score {found.score:.2f}"
    )
    if found.n_faces > 1:
        print(f"{found.n_faces} faces found; these are the points of the largest")
    print(
        "68 points; those of the jaw are off by a tenth of the eye distance"
        if options.jaw
        else "51 points; the jaw (1 to 17) is left out, --jaw keeps it"
    )
    if files:
        print(f"written: {', '.join(files)}")
    return GOOD


def target(name: str, value: str | None, suffix: str, photograph: Path) -> Path | None:
    """The path to write to, if one is asked for; ValueError if that cannot be, before any work."""
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
    if path.exists() and photograph.exists() and path.samefile(photograph):
        raise ValueError(f"{name}: {value!r} is the photograph itself")
    return path


def interval_words(interval: fa.Interval) -> str:
    """The distances a tolerance cannot tell apart, as a sentence."""
    tolerance = f"{interval.tolerance_percent:g} %"
    if interval.empty:
        return f"no distance brings d_L under {tolerance}: the best is {interval.best_d_l_percent:.2f} %"
    low = "the nearest tried" if interval.low is None else f"{100 * interval.low:.3g} cm"
    high = "infinity" if interval.high is None else f"{100 * interval.high:.3g} cm"
    others = (
        "" if interval.pieces == 1 else f" ({interval.pieces} such ranges; this one holds the best)"
    )
    return (
        f"d_L stays under {tolerance} from {low} to {high}{others}: "
        "within it the points do not tell the distance"
    )


def run_models(options: argparse.Namespace) -> int:
    """Say what a model holds, or list one of its schemes."""
    import faceambig as fa

    model = fa.load_model(options.model)
    chosen = [model.scheme(options.scheme)] if options.scheme else list(model.schemes.values())
    if options.json:
        keys = ("name", "side", "vertex")
        schemes = {
            scheme.name: [dict(zip(keys, row, strict=True)) for row in scheme.rows()]
            for scheme in chosen
        }
        about = {"name": model.name, "source": model.source, "licence": model.licence}
        sizes = {
            "vertices": model.n_vertices,
            "modes": model.n_modes,
            "subjects": len(model.subjects),
        }
        print(json.dumps(about | sizes | {"schemes": schemes}))
    elif options.scheme:
        for name, side, vertex in chosen[0].rows():
            print(f"{name:>6} {side:>6} {vertex:6}")
    else:
        print(f"{model.name}: {model.source}; {model.licence}")
        print(f"{model.n_vertices} vertices, {model.n_modes} modes, {len(model.subjects)} subjects")
        for scheme in chosen:
            print(f"scheme {scheme.name}: {len(scheme)} points; eyes: {scheme.eyes_meaning}")
    return GOOD


def observation_of(
    options: argparse.Namespace, model: fa.FaceModel
) -> tuple[fa.Observation, dict[str, Any]]:
    """The points of a file, and what was assumed about their picture."""
    import faceambig as fa

    size = image_size(options.image_size)
    read = fa.load_landmarks(options.points, image_size=size, model=model)
    observation = fa.Observation(read.points, read.scheme, image_size=read.image_size)
    words = f"{read.words}; {read.scheme}, {read.unit}"
    return observation, notes_of(observation, read.image_size_from, words)


def notes_of(observation: fa.Observation, image_size_from: str, landmarks: str) -> dict[str, Any]:
    """What was assumed about a picture."""
    cx, cy = observation.centre
    return {
        "points_used": int(observation.visible.sum()),
        "principal_point": f"({cx:g}, {cy:g}), {observation.centre_meaning}",
        "image_size_from": image_size_from,
        "landmarks": landmarks,
    }


def image_size(text: str | None) -> tuple[int, int] | None:
    """(width, height) of "640x480"."""
    if text is None:
        return None
    width, cross, height = text.lower().partition("x")
    if not (cross and width.isdecimal() and height.isdecimal() and int(width) and int(height)):
        raise ValueError(f"--image-size: {text!r} is not like 640x480")
    return int(width), int(height)


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
