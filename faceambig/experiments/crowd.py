"""Many people of a model, their points in pictures, and how far two pictures' points are apart (paper, section 6.2).

People are random faces of all the model's modes, alpha ~ N(0, I), unclipped. A picture's points are complex numbers
x + i y: the similarity that lays one picture on another (turn, size and place, never a mirror image) is then one
complex factor, so that thousands of pairs are compared in a few products of matrices.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, IntArray
from ..camera import View, see
from ..model import FaceModel, Scheme
from ..rotation import R0
from .heads import drawn

Complex = NDArray[np.complex128]

DISTANCES = (0.61, 0.91, 1.22, 1.83, 2.44, 3.66, 4.88)  # metres of CMDP: 2, 3, 4, 6, 8, 12, 16 feet
NEAR, FAR = DISTANCES[0], DISTANCES[-1]
INNER = 17  # of the 68 points of iBUG and Multi-PIE, the first that is not on the contour
CHUNK = 256  # pictures compared with all others at a time: 10,000 others take 40 MB


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Which points of a picture are compared, and whose distance is the unit."""

    name: str  # as a table says it
    rows: IntArray  # (L,) of the picture's points
    eyes: tuple[tuple[int, ...], tuple[int, ...]]  # rows of the picture whose means are the eyes


def point_sets(model: FaceModel) -> tuple[tuple[Scheme, Points], ...]:
    """The landmarks a model has, those with a contour first: (scheme, points)."""
    found: list[tuple[Scheme, Points]] = []
    words = {
        "ibug68": "68 points",
        "jawline": "68 points, jaw on the outline",
        "farkas": "points of Farkas, with ears",
    }
    for name, said in words.items():
        scheme = model.schemes.get(name)
        if scheme is not None:
            found.append((scheme, Points(said, np.arange(len(scheme)), scheme.eyes)))
    scheme = model.schemes.get("ibug68")
    if scheme is not None:
        rows = np.arange(INNER, len(scheme))
        found.append((scheme, Points("points 18 to 68, no contour", rows, scheme.eyes)))
    if not found:
        scheme = next(iter(model.schemes.values()))
        found.append((scheme, Points(scheme.name, np.arange(len(scheme)), scheme.eyes)))
    return tuple(found)


def random_people(model: FaceModel, n: int, seed: int) -> Array:
    """(n, S) shape coefficients of n people: the heads that `heads.drawn` draws, none of the model's own."""
    return np.stack([drawn(model.n_modes, k + 1, seed) for k in range(n)])


def surface_points(model: FaceModel, scheme: Scheme, alpha: Array) -> Array:
    """(n, L, 3) metres: the scheme's points of people alpha (n, S)."""
    mean, modes = model.rows(scheme.vertices)
    moved = alpha @ modes.reshape(-1, modes.shape[2]).T
    return mean + moved.reshape(len(alpha), *mean.shape)


def pictured(points: Array, distance: float | None) -> Complex:
    """(n, L) points x + i y of frontal portraits of people (n, L, 3) from `distance` metres; None is far away.

    Of one size: at the depth of the eyes of the mean face a metre is a unit. y counts down, as in a picture.
    """
    kappa = 0.0 if distance is None else 1.0 / distance
    xy = see(View(R0, np.zeros(2), 1.0, kappa), points).xy
    return xy[..., 0] + 1j * xy[..., 1]


def eye_unit(z: Complex, points: Points) -> Array:
    """(n,) distance of the eye centres of pictures z (n, all points), in their unit."""
    right, left = (z[:, list(rows)].mean(axis=1) for rows in points.eyes)
    return np.abs(left - right)


def noisy(z: Complex, points: Points, percent: float, rng: np.random.Generator) -> Complex:
    """z (n, all points) with Gaussian noise of `percent` of the eyes' distance as sd of each coordinate."""
    sd = percent / 100 * eye_unit(z, points)[:, None]
    return z + sd * (rng.standard_normal(z.shape) + 1j * rng.standard_normal(z.shape))


@dataclass(frozen=True, slots=True, eq=False)
class Crowd:
    """Pictures of n people, ready to be compared."""

    z: Complex  # (n, L) about their own centre
    eyes: Array  # (n,) the eyes' distance

    def of(self, rows: IntArray | slice) -> Crowd:
        """Some of the pictures."""
        return replace(self, z=self.z[rows], eyes=self.eyes[rows])

    def __len__(self) -> int:
        return len(self.z)


def crowd(z: Complex, points: Points) -> Crowd:
    """The pictures z (n, all points), their points `points.rows`."""
    chosen = z[:, points.rows]
    return Crowd(chosen - chosen.mean(axis=1, keepdims=True), eye_unit(z, points))


def apart_percent(a: Crowd, b: Crowd) -> Array:
    """(n,) mean distance of the points of each picture of `a`, laid on that of `b`, percent of b's eye distance."""
    factor = (a.z.conj() * b.z).sum(axis=1) / (np.abs(a.z) ** 2).sum(axis=1)
    return 100 * np.abs(b.z - factor[:, None] * a.z).mean(axis=1) / b.eyes


def all_apart_percent(a: Crowd, b: Crowd) -> Array:
    """(n, m) as `apart_percent`, of every picture of `a` to every one of `b`."""
    factor = (a.z.conj() @ b.z.T) / (np.abs(a.z) ** 2).sum(axis=1)[:, None]
    rows = [
        np.abs(b.z - f[:, None] * z).mean(axis=1) / b.eyes for f, z in zip(factor, a.z, strict=True)
    ]
    return 100 * np.stack(rows)


def rms_apart(a: Crowd, b: Crowd) -> Array:
    """(n, m) root of the summed squared distances over the eyes' distance of `b`: nearly that order, in one product."""
    size_a, size_b = (np.abs(c.z) ** 2 @ np.ones(c.z.shape[1]) for c in (a, b))
    along = np.abs(a.z.conj() @ b.z.T) ** 2 / size_a[:, None]
    return np.sqrt(np.maximum(size_b - along, 0.0)) / b.eyes
