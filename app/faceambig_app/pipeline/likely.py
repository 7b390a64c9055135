"""What the points of a target leave open: bends, extreme faces, the posterior, its spread and faces drawn from it.

Each step is memoised and bounded. All but the bends take longer than a hand waits: they are computed at rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

import faceambig as fa
from faceambig.arrays import Array, read_only
from faceambig.camera import Camera
from faceambig.extremes import ExtremeFaces
from faceambig.fitting.start import at_distance
from faceambig.fitting.task import best_camera
from faceambig.flex import FlexibilityModes, plausible_limit
from faceambig.metrics import HUMAN_TOLERANCE_PERCENT
from faceambig.posterior import Posterior

from ..state import Fitting, Target
from .fits import dense, explained, photograph

# Metres from, to, fits of a posterior of thousands of points; more where it is narrow
DENSE_GRID = (
    0.2,
    10.0,
    12,
)


class Source(NamedTuple):
    """What a posterior depends on."""

    target: Target
    prior: float  # % of the eye distance, the noise assumed


class Drawn(NamedTuple):
    """A face that explains the points, and the camera that sees it so."""

    alpha: Array  # (S,)
    camera: Camera


@dataclass(frozen=True, slots=True)
class FlexMode:
    """One flexibility mode, in words and millimetres of mean surface change."""

    number: int  # from 1
    words: str
    low: float  # mm: the ends of plausible faces
    high: float
    tolerance_mm: float  # moves the landmarks as much as a person does not see


@lru_cache(maxsize=64)
def bending(target: Target, fitting: Fitting, flex_at: str, count: int) -> FlexibilityModes:
    """The `count` most flexible modes of a fit, all of them where it has less."""
    fit = explained(target, fitting)
    # The fast solver's landmarks are those of the picture; the paper's, of the algebraic DLT
    linearisation = "algebraic" if flex_at == "dlt" else "reprojection"
    count = min(count, len(fit.alpha))
    return fa.flexibility_modes(fit.model, fit, count=count, linearisation=linearisation)


@lru_cache(maxsize=512)
def flex_modes(target: Target, fitting: Fitting, flex_at: str, count: int) -> tuple[FlexMode, ...]:
    """The first `count` modes of a fit in words."""
    modes = bending(target, fitting, flex_at, count)
    return tuple(
        FlexMode(k + 1, words, *modes.reach(k), HUMAN_TOLERANCE_PERCENT / percent)
        for k, (words, percent) in enumerate(
            zip(modes.words, modes.landmark_percent.tolist(), strict=True)
        )
    )


def limit(fit: fa.Fit) -> float:
    """The largest |alpha| of a plausible face; a fit beyond it by itself is not blamed on what leads back."""
    return max(plausible_limit(len(fit.alpha)), float(np.linalg.norm(fit.alpha)))


@lru_cache(maxsize=64)
def extremes(target: Target, fitting: Fitting) -> ExtremeFaces:
    """The two faces farthest apart behind the same points, at what a person cannot tell."""
    fit = explained(target, fitting)
    return fa.extreme_faces(fit.model, fit, HUMAN_TOLERANCE_PERCENT)


def source(target: Target, fitting: Fitting) -> Source:
    """What the posterior of a state depends on: not its assumed distance.

    Of an outline the landmarks alone: which contour points are pairs is only known at an assumed distance.
    """
    if target.data == "outline":
        target = target._replace(data="points")
    return Source(target, fitting.prior)


@lru_cache(maxsize=8)  # up to 8 MB each
def posterior(of: Source) -> Posterior:
    """Faces and distances that a target's points leave open: all modes, no box, as the library advises."""
    taken = photograph(of.target)
    everything = of.target.data == "dense"
    return fa.posterior(
        taken.subject.model,
        dense(of.target) if everything else taken.observation,
        np.geomspace(*DENSE_GRID) if everything else None,
        noise_percent=of.prior,
    )


@lru_cache(maxsize=64)
def spread(of: Source) -> Array:
    """(N,) mm: posterior sd of every vertex."""
    return read_only(posterior(of).vertex_sd_mm)


@lru_cache(maxsize=256)
def drawn(of: Source, draw: int) -> Drawn:
    """The draw of a number: a whole face at a distance of its own, and the camera there that sees its points best."""
    found = posterior(of)
    sample = found.sample(1, seed=draw)
    alpha, kappa = sample.alpha[0], 1.0 / float(sample.distances[0])  # 0: beyond the last distance
    observation = found.sweep.orthographic.observation
    seen = observation.visible
    landmarks = sample.vertices(0)[observation.vertices(found.model)[seen]]
    fits = (found.sweep.orthographic, *found.sweep.fits)
    near = min(fits, key=lambda fit: abs(fit.camera.kappa - kappa)).camera
    start = at_distance(
        Camera(near.R, near.t, near.s / at_one(near, landmarks), 0.0), landmarks, kappa
    )
    return Drawn(
        alpha, best_camera(observation.points[seen] - observation.centre, landmarks, start)
    )


def at_one(camera: Camera, landmarks: Array) -> float:
    """How much larger than s per metre the landmarks (L, 3) are seen, on average."""
    return 1.0 + camera.kappa * float(camera.R[2] @ landmarks.mean(axis=0))
