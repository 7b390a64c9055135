"""Does shading tell which face it was? The light that explains a photograph's shading best on another face.

The paper's closing question (section 7): faces fitted at different distances explain the same points; would the light
and shade on them tell them apart? If the light is not known it may be chosen anew for each of them, and hide part of
what the surfaces differ in. How much is a linear least-squares problem in nine numbers.

A matte (Lambertian) surface lit from far away reflects its irradiance, and that varies so slowly with the normal n that
spherical harmonics up to order 2 hold at least 98 % of its energy (Basri & Jacobs, PAMI 2003; Ramamoorthi & Hanrahan,
SIGGRAPH 2001):

    E(n) = sum_lm A_l L_lm Y_lm(n),   A = pi, 2 pi / 3, pi / 4                                            (E)

with the real, orthonormal Y and the light L, nine coefficients. Not in it: cast shadows, light reflected from skin to
skin, gloss, and the colour of the skin, which is taken as known. A light stands with the camera: directions are in
camera axes (x right, y down, z forward), so a fit at another pose sees the same light.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .arrays import Array, checked, number, read_only, shown, vertex_normals
from .camera import Camera, depths, project
from .fitting import Fit
from .visibility import visible_vertices

# A_l of each coefficient: the clamped cosine's share of order l
KERNEL = np.array([math.pi, *[2 * math.pi / 3] * 3, *[math.pi / 4] * 5])
RANK = 1e-10  # of the largest singular value: below it the normals do not tell a coefficient
CONSTANT = 1e-9  # of the mean: shading that varies by less varies by rounding only


@dataclass(frozen=True, slots=True, eq=False)
class Light:
    """Light from far away, by order-2 spherical harmonics; `a + b` shines with both."""

    # (9,) radiance L_lm in the order (0, 0), (1, -1), (1, 0), (1, 1), (2, -2) ... (2, 2), camera axes
    coefficients: Array

    def __post_init__(self) -> None:
        object.__setattr__(
            self, "coefficients", read_only(checked("coefficients", self.coefficients, (9,)))
        )

    @classmethod
    def lamp(cls, direction: ArrayLike, strength: float = 1.0) -> Light:
        """A lamp far away in `direction` (3,), camera axes: (0, 0, -1) is behind the camera, (0, -1, 0) above the face.

        strength: irradiance of a surface that faces it; of (E) such a surface gets 17/16, and one turned away
        -1/25 to 3/32 instead of nothing, for the clamped cosine has orders above 2.
        """
        w = checked("direction", direction, (3,))
        length = float(np.linalg.norm(w))
        if not 0 < length < np.inf:
            raise ValueError(f"direction: {shown(w.tolist())} does not point anywhere")
        return cls(_not_negative("strength", strength) * harmonics(w[None] / length)[0])

    @classmethod
    def sky(cls, radiance: float) -> Light:
        """The same light from everywhere: its irradiance is pi times `radiance`."""
        value = _not_negative("radiance", radiance)
        return cls(np.array([math.sqrt(4 * math.pi) * value, *[0.0] * 8]))

    def __add__(self, other: Light) -> Light:
        return Light(self.coefficients + other.coefficients)

    def irradiance(self, normals: Array) -> Array:
        """(n,) E of unit normals (n, 3), camera axes. Equation E."""
        return _design(normals) @ self.coefficients


def harmonics(directions: Array) -> Array:
    """(n, 9) real orthonormal Y_lm of unit vectors (n, 3), in the order of `Light.coefficients`."""
    x, y, z = directions.T
    first, second = math.sqrt(3 / (4 * math.pi)), math.sqrt(15 / (4 * math.pi))
    return np.stack(
        [
            np.full(len(directions), math.sqrt(1 / (4 * math.pi))),
            first * y,
            first * z,
            first * x,
            second * x * y,
            second * y * z,
            second / math.sqrt(12) * (2 * z * z - x * x - y * y),
            second * x * z,
            0.5 * second * (x * x - y * y),
        ],
        axis=1,
    )


def shade(vertices: ArrayLike, faces: ArrayLike, camera: Camera, light: Light) -> Array:
    """(N,) irradiance of a surface's vertices (N, 3), metres, model axes, under a light that stands with the camera.

    faces: (F, 3) triangles, wound outward; the normal of a vertex is their mean weighted by area, zero if it has none.

    Raises
    ------
    ValueError: wrong shape, not finite, a triangle of vertices that do not exist; no Camera or no Light.
    """
    v = checked("vertices", vertices, (None, 3))
    T = np.asarray(faces)
    if T.ndim != 2 or T.shape[1] != 3 or T.dtype.kind not in "iu":
        raise ValueError(
            f"faces: expected vertex numbers of shape (n, 3), found {T.dtype} {T.shape}"
        )
    if T.size and not 0 <= T.min() <= T.max() < len(v):
        raise ValueError(f"faces: {T.min()} to {T.max()} is not within 0 to {len(v) - 1}")
    _is("camera", camera, Camera)
    _is("light", light, Light)
    return light.irradiance(vertex_normals(v, T) @ camera.R.T)


def best_light(target: Array, normals: Array, weights: Array) -> tuple[Light, int]:
    """The light that minimises sum_i w_i (target_i - E(n_i))^2, and how many of its nine numbers the normals tell.

    target, weights (n,), normals (n, 3) unit, camera axes. Of the lights that do as well, as on a plane where all
    normals agree, it is the one of least norm. Nothing keeps it from being negative somewhere: what it explains is an
    upper bound for real lamps.
    """
    root = np.sqrt(weights)
    found, _, rank, _ = np.linalg.lstsq(root[:, None] * _design(normals), root * target, rcond=RANK)
    return Light(found.astype(np.float64, copy=False)), int(rank)


@dataclass(frozen=True, slots=True, eq=False)
class ExplainedShading:
    """The shading of a photograph on another face. N vertices."""

    target: Array  # (N,) irradiance of the true face under the known light
    explained: Array  # (N,) of the fitted face under `light`
    kept: Array  # (N,) of the fitted face under the known light: nothing chosen anew
    weights: Array  # (N,) px^2 of the photograph that a vertex stands for; 0: not compared
    light: Light  # the best for the fitted face
    rank: int  # how many numbers of `light` the compared normals tell, at most 9

    def __post_init__(self) -> None:
        for name in ("target", "explained", "kept", "weights"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def sd(self) -> float:
        """Standard deviation of the target over the compared part of the photograph."""
        return self._rms(self.target - np.average(self.target, weights=self.weights))

    @property
    def residual(self) -> float:
        """Rms of target - explained, in sd of the target: 0 all explained, 1 nothing."""
        return self._rms(self.target - self.explained) / self.sd

    @property
    def kept_residual(self) -> float:
        """As `residual`, of the known light kept; above 1 it is worse than one even grey."""
        return self._rms(self.target - self.kept) / self.sd

    @property
    def fraction(self) -> float:
        """Share of the target's variance that the best light explains, 0 to 1."""
        return 1.0 - self.residual**2

    @property
    def kept_fraction(self) -> float:
        """As `fraction`, of the known light kept: below 0 where it is worse than the mean."""
        return 1.0 - self.kept_residual**2

    @property
    def residual_percent(self) -> float:
        """Rms of target - explained in percent of the target's mean: the contrast that a picture's noise is held to."""
        mean = float(np.average(self.target, weights=self.weights))
        return 100.0 * self._rms(self.target - self.explained) / mean

    def _rms(self, gap: Array) -> float:
        return math.sqrt(float(np.average(gap * gap, weights=self.weights)))


def explain_shading(fit: Fit, truth: ArrayLike, camera: Camera, light: Light) -> ExplainedShading:
    """The shading of the face `truth` under `light`, explained on the face of `fit` by the light best for it.

    Parameters
    ----------
    fit: a face for the same photograph, at any distance; vertices correspond by their numbers.
    truth: (N, 3) metres, model axes: the face photographed.
    camera: that of the photograph, by which `truth` is seen; for a synthetic one `observation.portrait_camera`.
    light: under which it was taken, camera axes.

    Compared are the vertices of the model's evaluation region that both cameras see, each weighted by the area of the
    photograph that it stands for.

    Raises
    ------
    ValueError: a wrong type or shape, a face behind the camera, nothing seen by both, or shading without variance.
    """
    _is("fit", fit, Fit)
    _is("camera", camera, Camera)
    _is("light", light, Light)
    v, T = checked("truth", truth, (None, 3)), fit.model.faces
    if len(v) != fit.model.n_vertices:
        raise ValueError(
            f"truth: {len(v)} vertices for a fit of {fit.model.n_vertices}; both need the same mesh"
        )
    if (depths(camera, v) <= 0).any():
        raise ValueError(
            "truth: part of the face lies behind the camera; take it from farther away"
        )
    found = fit.vertices()
    compared = visible_vertices(T, v, camera) & visible_vertices(T, found, fit.camera)
    if fit.model.evaluation is not None:
        compared &= np.isin(np.arange(len(v)), fit.model.evaluation)
    weights = np.where(compared, _picture_areas(project(camera, v), T), 0.0)
    used = weights > 0
    if not used.any():
        raise ValueError(
            "truth: no vertex is seen by both cameras; is the fit one of this photograph?"
        )
    target = shade(v, T, camera, light)
    normals = vertex_normals(found, T) @ fit.camera.R.T
    best, rank = best_light(target[used], normals[used], weights[used])
    answer = ExplainedShading(
        target, best.irradiance(normals), light.irradiance(normals), weights, best, rank
    )
    if not answer.sd > CONSTANT * np.abs(target[used]).max():
        raise ValueError(
            "light: the same everywhere on the face; its shading leaves nothing to explain"
        )
    return answer


def _design(normals: Array) -> Array:
    """(n, 9) irradiance of each coefficient's light alone."""
    return KERNEL * harmonics(normals)


def _picture_areas(xy: Array, faces: NDArray[np.integer]) -> Array:
    """(N,) px^2: each vertex has a third of its triangles that face the camera; xy (N, 2) pixels, y down."""
    a, b, c = (xy[corner] for corner in faces.T)
    u, v = b - a, c - a
    area = np.maximum(0.5 * (u[:, 1] * v[:, 0] - u[:, 0] * v[:, 1]), 0.0)
    sums = np.bincount(faces.ravel(), np.repeat(area / 3, 3), len(xy))
    return sums.astype(np.float64, copy=False)


def _not_negative(name: str, value: object) -> float:
    x = number(name, value)
    if not 0 <= x < np.inf:
        raise ValueError(f"{name}: {x:g} is not at least 0 and finite")
    return x


def _is(name: str, value: object, kind: type) -> None:
    if not isinstance(value, kind):
        raise ValueError(f"{name}: {shown(value)} is not a {kind.__name__}")
