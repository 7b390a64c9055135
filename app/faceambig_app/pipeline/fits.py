"""Target -> photograph, and with a Fitting -> fit. Each step is memoised and bounded, and shared by every browser.

Every fit starts from the closed-form pose of its own points, never from the last frame: a face does not depend on the
way the slider took.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple, TypedDict

import faceambig as fa
from faceambig.arrays import Array
from faceambig.boundary import contour_points
from faceambig.camera import Camera
from faceambig.model import FaceModel, Subject
from faceambig.observation import portrait_camera

from ..state import DEFAULT, Fitting, Target


class Options(TypedDict):
    """Of a fit, as the library calls them."""

    modes: int | None
    box: float
    noise_percent: float


@dataclass(frozen=True, slots=True, eq=False)
class Photograph:
    """A synthetic photograph: who, with which camera, and the landmarks it gave."""

    subject: Subject
    observation: fa.Observation  # the landmarks: what pictures show, whatever is fitted
    camera: Camera


class Fits(NamedTuple):
    """A fit to the outline, twice: as what d_L is told of, and as what it explains."""

    landmarks: fa.Fit
    explained: fa.Fit  # landmarks and pairs of contour points


class Pose(TypedDict):
    """Of a target, as `observe` calls it."""

    distance: float
    yaw_deg: float
    pitch_deg: float
    roll_deg: float


@lru_cache(maxsize=4)
def model(name: str) -> FaceModel:
    """The model of a name or path, loaded once."""
    return fa.load_model(name)


@lru_cache(maxsize=256)
def photograph(target: Target) -> Photograph:
    """The synthetic photograph of a target; what of it is fitted plays no part."""
    if isinstance(target.subject, str):
        raise ValueError("subject: photo: there is no photograph here, only the synthetic people")
    if target.data != "points":
        return photograph(target._replace(data="points"))
    subject = model(target.model).subject(target.subject)
    pose = _pose(target)
    observation = fa.observe(
        subject, scheme=target.scheme, noise_percent=target.noise, seed=target.seed, **pose
    )
    return Photograph(subject, observation, portrait_camera(subject, scheme=target.scheme, **pose))


@lru_cache(maxsize=32)
def dense(target: Target) -> fa.Observation:
    """All vertices of the subject that the camera sees, with the target's noise."""
    subject = photograph(target).subject
    return fa.observe(
        subject, scheme="visible", noise_percent=target.noise, seed=target.seed, **_pose(target)
    )


@lru_cache(maxsize=64)
def edges(target: Target) -> Array:
    """(E, 2) pixels: the outline of the subject in the photograph, as a perfect edge detector sees it."""
    taken = photograph(target)
    found = contour_points(taken.subject.model, taken.subject.vertices, taken.camera)
    return found + taken.observation.centre


def _pose(target: Target) -> Pose:
    return {
        "distance": target.actual,
        "yaw_deg": target.yaw,
        "pitch_deg": target.pitch,
        "roll_deg": target.roll,
    }


def fitted(target: Target, fitting: Fitting) -> fa.Fit:
    """The fit of a target's data. Its d_L is that of the landmarks, or of all points where all are fitted."""
    match target.data:
        case "outline":
            return _of_outline(target, fitting).landmarks
        case "dense":
            return _of_all(target, fitting)
        case _:
            return _of_landmarks(target, fitting)


def explained(target: Target, fitting: Fitting) -> fa.Fit:
    """The same fit with all that it was fitted to as its observation: a bend keeps the outline too."""
    if target.data == "outline":
        return _of_outline(target, fitting).explained
    return fitted(target, fitting)


@lru_cache(maxsize=2048)
def _of_landmarks(target: Target, fitting: Fitting) -> fa.Fit:
    return _fit(target, fitting, photograph(target).observation)


@lru_cache(maxsize=64)
def _of_all(target: Target, fitting: Fitting) -> fa.Fit:
    return _fit(target, fitting, dense(target))


@lru_cache(maxsize=256)
def _of_outline(target: Target, fitting: Fitting) -> Fits:
    taken = photograph(target)
    contour = fa.contour_fit(
        taken.subject.model,
        taken.observation,
        edges(target),
        camera=_camera(fitting),
        distance=fitting.distance,
        **options(fitting),
    )
    if not len(contour.pairs):
        return Fits(contour.fit, contour.fit)
    again = fa.fit(
        taken.subject.model,
        contour.observation,
        camera=_camera(fitting),
        distance=fitting.distance,
        modes=options(fitting)["modes"],
        box=fitting.box,
        prior_weight=contour.fit.prior_weight,
    )
    return Fits(contour.fit, again)


def _fit(target: Target, fitting: Fitting, observation: fa.Observation) -> fa.Fit:
    return fa.fit(
        photograph(target).subject.model,
        observation,
        camera=_camera(fitting),
        distance=fitting.distance,
        **options(fitting),
    )


def options(fitting: Fitting) -> Options:
    """A setting left alone is the library's default, which suits smaller models too."""
    modes = None if fitting.modes == DEFAULT.modes else fitting.modes
    return {"modes": modes, "box": fitting.box, "noise_percent": fitting.prior}


def _camera(fitting: Fitting):
    return "perspective" if fitting.distance is not None else "orthographic"


def n_fitted(target: Target, fitting: Fitting) -> int:
    """How many points a fit rests on; of an outline its landmarks and the pairs that were found."""
    return int(explained(target, fitting).observation.visible.sum())
