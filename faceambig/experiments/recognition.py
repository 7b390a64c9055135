"""How well shapes that were estimated from near and from far tell people apart.

By the angle between their coefficients, as a threshold on it falls; and by the distance of their surfaces.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..arrays import Array


class Estimates(NamedTuple):
    """Shapes of n people from both distances, by one method."""

    name: str
    near: Array  # (n, D) vectors of shape
    far: Array  # (n, D)
    faces: Array | None  # (2n, V, 3) metres, near first; None: the method gives no surface


class Recognised(NamedTuple):
    """How well one method's shapes tell n people apart."""

    name: str
    n: int
    false: Array  # of the curve
    true: Array
    distances: Array | None  # (2n, 2n) mm, near first; None: the method gives no surface

    @property
    def area(self) -> float:
        return area(self.false, self.true)


class Nearness(NamedTuple):
    """How near faces are, mm, means over the people."""

    same: float  # one person, from near and from far
    near: float  # the nearest other, both from near
    far: float  # both from far


def recognised(shapes: Estimates) -> Recognised:
    """What a method's shapes give."""
    false, true = roc(cosines(shapes.near, shapes.far))
    distances = None if shapes.faces is None else apart_mm(shapes.faces)
    return Recognised(shapes.name, len(shapes.near), false, true, distances)


def cosines(near: Array, far: Array) -> Array:
    """(n, n) cosine between the vectors of everyone from near and everyone from far."""
    a, b = (x / np.linalg.norm(x, axis=1, keepdims=True) for x in (near, far))
    return a @ b.T


def roc(score: Array) -> tuple[Array, Array]:
    """Shares of false and of true positives (m,) as the threshold on score (n, n) falls; the diagonal is true."""
    true = np.eye(len(score), dtype=bool).ravel()
    values = score.ravel()
    order = np.argsort(-values, kind="stable")
    steps = np.flatnonzero(np.diff(values[order], append=-np.inf))  # ties are passed together
    hit, miss = np.cumsum(true[order])[steps], np.cumsum(~true[order])[steps]
    start = np.zeros(1)
    return np.concatenate([start, miss / (~true).sum()]), np.concatenate([start, hit / true.sum()])


def area(false: Array, true: Array) -> float:
    """Area under the curve: how often one's own picture scores above another's."""
    return float(np.trapezoid(true, false))


def apart_mm(faces: Array) -> Array:
    """(m, m) mean distance, mm, of corresponding vertices of faces (m, V, 3) after the best rigid motion."""
    X = faces - faces.mean(axis=1, keepdims=True)
    apart = np.zeros((len(X), len(X)))
    for i, face in enumerate(X):
        U, _, Vt = np.linalg.svd(np.einsum("vk,nvl->nkl", face, X[i:]))
        U[:, :, 2] *= np.sign(np.linalg.det(U @ Vt))[:, None]
        gap = face @ (U @ Vt) - X[i:]
        apart[i, i:] = apart[i:, i] = 1e3 * np.linalg.norm(gap, axis=2).mean(axis=1)
    return apart


def nearness(apart: Array) -> Nearness:
    """Of the distances (2n, 2n) of everybody's faces, those from near first."""
    n = len(apart) // 2
    others = []
    for part in (apart[:n, :n], apart[n:, n:]):
        masked = np.where(np.eye(n, dtype=bool), np.inf, part)
        others.append(float(masked.min(axis=1).mean()))
    return Nearness(float(np.diag(apart[:n, n:]).mean()), *others)
