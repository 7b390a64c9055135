"""What several commands share: statuses, flags of a fit, records for programs, words for people."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import faceambig as fa

GOOD, NOT_CONVERGED, BAD_INPUT = 0, 1, 2


def add_points(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "points",
        metavar="FILE",
        help="landmarks of the photograph: .pts, CSV with x and y, or JSON; 68 or 51 points of iBUG, "
        "468 or 478 of MediaPipe, or points with names",
    )
    add_options(command)


def add_options(command: argparse.ArgumentParser) -> None:
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
