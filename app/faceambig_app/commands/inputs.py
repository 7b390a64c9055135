"""What a command starts from: points, a photograph, a saved fit or a synthetic subject, and the flags that say so."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any, NamedTuple

from ..state import DEFAULT, FIELDS
from ..state.fields import canonical
from ..state.forms import value_of
from .shared import notes_of
from .snapshot import help_of

if TYPE_CHECKING:
    import faceambig as fa
    from faceambig.io.pictures import Picture

OF_SUBJECT = ("actual", "yaw", "pitch", "roll", "scheme", "noise", "seed")
OF_FIT = {"modes": "modes", "box": "box", "prior": "noise_percent"}  # flag, keyword of the library
OF_PICTURE = ("landmarks", "auto", "image_size")
PAINTED = 500  # pixels of a synthetic photograph: what `observe` counts its points in


class Start(NamedTuple):
    """What a command starts from."""

    model: fa.FaceModel
    observation: fa.Observation
    notes: dict[str, Any]  # what was assumed about the picture
    picture: Picture | None = None  # None: only the points are known
    fit: fa.Fit | None = None  # a saved one
    subject: fa.Subject | None = None  # the true face, where it is known
    true_distance: float | None = None  # metres, of a subject


def add_input(command: argparse.ArgumentParser, *, shared: tuple[str, ...] = ()) -> None:
    """FILE or --subject; `shared` are flags of a subject that the command has a use for without one, too."""
    command.add_argument(
        "file",
        metavar="FILE",
        nargs="?",
        help="landmarks of a photograph (.pts, CSV with x and y, or JSON; 68 or 51 points of iBUG, 468 or 478 of "
        "MediaPipe, or points with names); the photograph itself, with --landmarks or --auto; or the fit.json of a fit",
    )
    command.add_argument("--landmarks", metavar="POINTS", help="landmarks of the photograph")
    command.add_argument("--auto", action="store_true", help="find the landmarks by itself")
    command.add_argument(
        "--image-size",
        metavar="WxH",
        help="size of the picture in pixels (default: of the picture of the same name beside the points)",
    )
    command.add_argument(
        "--model", help="model name or path (default embedded, or that of a fit.json)"
    )
    people = command.add_argument_group("instead of FILE")
    people.add_argument("--subject", metavar="N", help="synthetic person [1 to 10]")
    for name in OF_SUBJECT:
        field = FIELDS[name]
        also = "; and of what is drawn" if name in shared else ""
        people.add_argument(
            field.flag,
            metavar=name.upper(),
            help=help_of(field, also),
        )
    command.set_defaults(shared=shared)


def add_fitting(
    command: argparse.ArgumentParser,
    modes: str = "the strongest 70, or all of a model with fewer",
    box: str = "2",
) -> None:
    """What a fit assumes of faces and points; modes and box say the defaults."""
    command.add_argument("--modes", type=int, help=f"shape modes used (default: {modes})")
    command.add_argument("--box", type=float, help=f"largest shape coefficient, sd (default {box})")
    command.add_argument(
        "--prior", type=float, help="landmark noise assumed, %% of the eye distance (default 1)"
    )


def add_camera(command: argparse.ArgumentParser) -> None:
    """Where a fit puts the camera."""
    command.add_argument(
        "--distance",
        type=float,
        metavar="M",
        help="assumed camera distance, metres; left out: fitted too",
    )
    command.add_argument("--camera", help="perspective or orthographic (default perspective)")


def start_of(options: argparse.Namespace, *, pixels: bool = False) -> Start:
    """What is to be fitted; `pixels` if the photograph itself is needed. ValueError names what does not go together."""
    if (options.file is None) == (options.subject is None):
        raise ValueError("FILE, --subject N: one of them is needed, and one only")
    if options.subject is not None:
        _refuse(options, OF_PICTURE, "for a file, not for --subject")
        return _synthetic(options, pixels)
    _refuse(
        options, [name for name in OF_SUBJECT if name not in options.shared], "only with --subject"
    )
    from pathlib import Path

    from faceambig.io.fits import is_fit

    file = Path(options.file)
    if is_fit(file):
        _refuse(options, OF_PICTURE, f"{file.name} has its points already; leave it out")
        return _saved(options, file)
    import faceambig as fa

    from ..reports import photo

    model = fa.load_model(options.model or DEFAULT.model)
    landmarks = None if options.landmarks is None else Path(options.landmarks)
    size = image_size(options.image_size)
    given = photo.given(
        file, model, landmarks=landmarks, auto=options.auto, image_size=size, pixels=pixels
    )
    notes = notes_of(given.observation, given.image_size_from, given.landmarks)
    return Start(model, given.observation, notes, given.picture)


def fit_of(options: argparse.Namespace, start: Start) -> fa.Fit:
    """The saved fit as it is, or one of the points at the distance asked for."""
    if start.fit is not None:
        names = (*OF_FIT, "distance", "camera")
        _refuse(
            options, names, "the saved fit has it already; leave it out, or give the points again"
        )
        return start.fit
    import faceambig as fa

    camera = options.camera or "perspective"
    return fa.fit(
        start.model,
        start.observation,
        camera=camera,
        distance=options.distance,
        **fitting(options, start),
    )


def fitting(options: argparse.Namespace, start: Start) -> dict[str, Any]:
    """Keywords of `faceambig.fit` and its like: those of a saved fit, with the flags given before them."""
    given = {
        word: getattr(options, flag)
        for flag, word in OF_FIT.items()
        if getattr(options, flag) is not None
    }
    if start.fit is None:
        return given
    saved = {name: getattr(start.fit.options, name) for name in (*OF_FIT.values(), "prior_weight")}
    if "noise_percent" in given:
        saved["prior_weight"] = None  # it would count before the percentage
    return saved | given


def _refuse(options: argparse.Namespace, names: Any, why: str) -> None:
    for name in names:
        if getattr(options, name) not in (None, False):
            raise ValueError(f"--{name.replace('_', '-')}: {why}")


def _synthetic(options: argparse.Namespace, pixels: bool) -> Start:
    """A subject's photograph, as the page takes it."""
    given = {name: getattr(options, name) for name in ("subject", *OF_SUBJECT)}
    values: dict[str, Any] = {
        name: canonical(FIELDS[name], value_of(FIELDS[name], text))
        for name, text in given.items()
        if text is not None
    }
    target = DEFAULT.target._replace(model=options.model or DEFAULT.model, **values)

    from ..pipeline import fits, scenes

    taken = fits.photograph(target)
    picture = None
    if pixels:
        from faceambig.io.pictures import Picture
        from faceambig.render.painter import paint_photo

        painted = paint_photo(scenes.picture(target), PAINTED)
        picture = Picture(f"synthetic {taken.subject.name}", painted)
    noise = (
        "without noise" if not target.noise else f"noise of {target.noise:g} %, seed {target.seed}"
    )
    words = (
        f"{len(taken.observation.points)} points of synthetic {taken.subject.name}, "
        f"taken from {100 * target.actual:.3g} cm; {target.scheme}, {noise}"
    )
    notes = notes_of(taken.observation, "synthetic photograph", words)
    return Start(
        taken.subject.model, taken.observation, notes, picture, None, taken.subject, target.actual
    )


def _saved(options: argparse.Namespace, file: Any) -> Start:
    import faceambig as fa

    fit = fa.load_fit(file, None if options.model is None else fa.load_model(options.model))
    seen = fit.observation
    scheme = seen.scheme if isinstance(seen.scheme, str) else "vertices"
    words = f"{int(seen.visible.sum())} of {len(seen.points)} points, saved with the fit; {scheme}, pixels"
    return Start(fit.model, seen, notes_of(seen, f"said by {file.name}", words), fit=fit)


def image_size(text: str | None) -> tuple[int, int] | None:
    """(width, height) of "640x480"."""
    if text is None:
        return None
    width, cross, height = text.lower().partition("x")
    if not (cross and width.isdecimal() and height.isdecimal() and int(width) and int(height)):
        raise ValueError(f"--image-size: {text!r} is not like 640x480")
    return int(width), int(height)
