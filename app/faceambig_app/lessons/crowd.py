"""Random people of a model, photographed from near and from far: how well their points tell them apart. No fit."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from faceambig.arrays import Array
from faceambig.metrics import surface_difference
from faceambig.model import FaceModel
from faceambig.observation import eye_distance

from ..pipeline.fits import model

SCHEME = "ibug68"
NEAR, FAR = 0.61, 4.88  # metres: of the photographs of the paper's section 7
PEOPLE, SEED = 300, 0
# Points of iBUG, counted from 0, whose distance is a width
PARTS = {"nose": (31, 35), "face": (1, 15)}


@dataclass(frozen=True, slots=True)
class Crowd:
    """What a comparison of points finds among random people."""

    same_percent: float  # mean gap of the points of one person, from NEAR and from FAR
    other_percent: float  # of the nearest other person, both from NEAR
    pair_percent: float  # of the two different people who are nearest, one from NEAR, one from FAR
    pair_mm: float  # d_S between the faces of those two
    found_share: float  # of the people whose own picture from FAR is the nearest to that from NEAR


def points_of(of: FaceModel, vertices: Array, metres: float) -> Array:
    """(68, 2) landmarks of a face (N, 3), seen straight on from `metres`; the scale is arbitrary."""
    return _seen(vertices[of.scheme(SCHEME).vertices], metres)


def _seen(points: Array, metres: float) -> Array:
    """Perspective onto the plane of the eyes: (..., 3) -> (..., 2)."""
    return points[..., :2] / (1.0 - points[..., 2:] / metres)


def spans(points: Array, *parts: str) -> tuple[float, ...]:
    """Widths in landmarks (68, 2): "nose", "face", or "eyes" between the centres of both."""
    wide = {part: PARTS[part] for part in parts if part != "eyes"}
    return tuple(
        float(np.linalg.norm(points[wide[part][1]] - points[wide[part][0]]))
        if part in wide
        else float(np.linalg.norm(points[42:48].mean(axis=0) - points[36:42].mean(axis=0)))
        for part in parts
    )


def moved_percent(a: Array, b: Array, of: FaceModel) -> float:
    """Mean gap of landmarks a laid on b, both (68, 2), by a similarity; percent of the eye distance of b."""
    scheme = of.scheme(SCHEME)
    return (
        float(_gaps(_complex(a)[None], _complex(b)[None])[0, 0]) / eye_distance(b, scheme) * 100.0
    )


def _complex(points: Array) -> np.ndarray:
    """Points (..., L, 2) as complex numbers about their mean: a similarity is then one factor."""
    z = points[..., 0] + 1j * points[..., 1]
    return z - z.mean(axis=-1, keepdims=True)


def _gaps(a: np.ndarray, b: np.ndarray) -> Array:
    """(P, Q) mean distance of the points of each a (P, L), laid on each b (Q, L) by the best similarity."""
    factors = (a.conj() @ b.T) / (np.abs(a) ** 2).sum(axis=1)[:, None]
    return np.stack(
        [np.abs(f[:, None] * one - b).mean(axis=1) for f, one in zip(factors, a, strict=True)]
    )


@lru_cache(maxsize=2)
def crowd(name: str) -> Crowd:
    """PEOPLE random people of a model, compared with each other."""
    of = model(name)
    scheme = of.scheme(SCHEME)
    alphas = np.random.default_rng(SEED).normal(size=(PEOPLE, of.n_modes))
    mean, modes = of.rows(scheme.vertices)
    landmarks = mean + np.einsum("lds,ps->pld", modes, alphas)
    near, far = _seen(landmarks, NEAR), _seen(landmarks, FAR)
    across = _percent(near, far, scheme)
    within = _percent(near, near, scheme)
    others = across + np.diag(np.full(PEOPLE, np.inf))
    i, j = divmod(int(others.argmin()), PEOPLE)
    a, b = (of.vertices(alphas[k]) for k in (i, j))
    return Crowd(
        same_percent=float(np.diag(across).mean()),
        other_percent=float((within + np.diag(np.full(PEOPLE, np.inf))).min(axis=1).mean()),
        pair_percent=float(others.min()),
        pair_mm=surface_difference(a, b, of.evaluation).mean_mm,
        found_share=float((across.argmin(axis=1) == np.arange(PEOPLE)).mean()),
    )


def _percent(a: Array, b: Array, scheme) -> Array:
    """(P, Q) gaps of people a on people b, percent of the eye distance of b."""
    eyes = np.array([eye_distance(points, scheme) for points in b])
    return 100.0 * _gaps(_complex(a), _complex(b)) / eyes
