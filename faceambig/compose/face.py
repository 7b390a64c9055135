"""A fitted face measured against the true one, and what a picture says of it: its numbers, and the curves.

The fitted head is laid on the true one rigidly (rotation and translation over the evaluation region, never scaled:
size is information), so what differs between the two heads is what d_S measures. Of a photograph whose face is not
known a fit stands in for the true one, and the numbers say so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Array, checked
from ..camera import Camera, project
from ..density import DistanceDensity
from ..fitting import Fit
from ..flex import FlexibilityModes
from ..metrics import HUMAN_TOLERANCE_PERCENT, mean_gap_percent, surface_difference
from ..model import FaceModel, Subject
from ..observation import Observation
from ..scene import Curves, Numbers
from ..sweep import Sweep

LEVELS = (0.5, 0.95)  # of the intervals beside a density


@dataclass(frozen=True, slots=True, eq=False)
class Face:
    """A fitted face, bent or not, measured against the true one. N vertices, L landmarks."""

    fit: Fit
    # The points that pictures show: those fitted, or others of the same photograph
    observation: Observation
    alpha: Array  # (k,) coefficients of this face: the fit's and its bend, or another's
    camera: Camera  # that sees the face so: the fit's own, or a draw's
    vertices: Array  # (N, 3) metres, laid rigidly on the true face
    projected: Array  # (L, 2) pixels
    d_l_percent: float
    d_s_mm: float
    gaps_mm: Array  # (E,) distance to the true face on the evaluation region
    own_vertices: Array  # (N, 3) metres, in the fit's own model frame
    rotation: Array  # (3, 3) vertices = own_vertices rotation^T + translation
    translation: Array  # (3,) metres
    plausible: bool
    flex_words: str = ""
    flex_mm: float = 0.0
    flex: tuple[tuple[str, float], ...] = ()  # of several modes: words and mm of each


def measure(
    subject: Subject,
    fit: Fit,
    bend: Array | None = None,
    *,
    alpha: ArrayLike | None = None,
    camera: Camera | None = None,
    limit: float = np.inf,
    flex_words: str = "",
    flex_mm: float = 0.0,
    flex: Sequence[tuple[str, float]] = (),
    shown: Observation | None = None,
) -> Face:
    """The face of a fit, its coefficients changed by `bend` (S,), against the true face.

    Parameters
    ----------
    alpha: (k,) of another face behind the same points, a posterior draw or an extreme face; None: the fit's.
    camera: that sees it so; None: the fit's.
    limit: the largest |alpha| of a face that still counts as plausible.
    flex_words, flex_mm: what bends it. flex: the same of several modes, (words, mm) each; `bent` gives their sum.
    shown: the points that pictures show, where thousands were fitted; None: all. d_L is of those fitted.
    """
    model, observation = fit.model, fit.observation
    own_alpha = fit.alpha if alpha is None else checked("alpha", alpha, (None,))
    if bend is not None:
        own_alpha = own_alpha + bend
    seen_by = fit.camera if camera is None else camera
    own = model.vertices(own_alpha)
    surface = surface_difference(own, subject.vertices, model.evaluation)
    projected = _projected(seen_by, own, fit.model, observation)
    gaps = (observation.points - projected)[observation.visible]
    if shown is not None:
        observation, projected = shown, _projected(seen_by, own, fit.model, shown)
    moved = tuple((words, float(mm)) for words, mm in flex if mm != 0)
    if moved and not flex_words:
        flex_words, flex_mm = moved[0]
    return Face(
        fit=fit,
        observation=observation,
        alpha=own_alpha,
        camera=seen_by,
        own_vertices=own,
        vertices=own @ surface.rotation.T + surface.translation,
        rotation=surface.rotation,
        translation=surface.translation,
        projected=projected,
        d_l_percent=mean_gap_percent(gaps, fit.interocular_px),
        d_s_mm=surface.mean_mm,
        gaps_mm=1e3 * surface.distances,
        plausible=bool(np.linalg.norm(own_alpha) <= limit),
        flex_words=flex_words,
        flex_mm=flex_mm,
        flex=moved,
    )


def _projected(
    camera: Camera, vertices: Array, model: FaceModel, observation: Observation
) -> Array:
    """(L, 2) pixels: an observation's points of a surface."""
    return project(camera, vertices[observation.vertices(model)]) + observation.centre


def bent(modes: FlexibilityModes, mm: Sequence[float]) -> Array:
    """(S,) change of alpha by `mm` of each of the first modes together, for `measure`."""
    amounts = checked("mm", mm, (None,))
    if len(amounts) > len(modes.directions):
        raise ValueError(f"mm: {len(amounts)} values for {len(modes.directions)} modes")
    return amounts @ modes.directions[: len(amounts)]


def stand_in(fit: Fit, name: str, colours: NDArray[np.uint8] | None = None) -> Subject:
    """A fit in place of the true face, for a photograph whose face is not known; differences are then to it.

    name: of what it is, "the 60 cm fit". colours: (N, 3) sRGB sampled from the photograph; None: the model's.
    """
    return Subject(name, "", fit.vertices(), colours, fit.model)


def depth_change_mm(subject: Subject, face: Face, camera: Camera) -> Array:
    """(E,) mm by which the fitted surface lies nearer (> 0) to the camera of the true face, along its viewing rays.

    Over the evaluation region, after the rigid alignment: what of the difference no picture from there can show.
    """
    region = slice(None) if subject.model.evaluation is None else subject.model.evaluation
    true, fitted = subject.vertices[region], face.vertices[region]
    if camera.kappa > 0:
        rays = true - centre_of(camera)
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    else:
        rays = camera.R[2]
    return -1e3 * ((fitted - true) * rays).sum(axis=1)


def centre_of(camera: Camera) -> Array:
    """(3,) metres, model axes: where a perspective camera stands."""
    return -camera.R.T @ np.array([*camera.t, 1.0 / camera.kappa])


def curves(subject: Subject, sweep: Sweep, true_distance: float | None) -> Curves:
    """d_L and d_S of every fit of a sweep against the true face. true_distance: metres; None: not known."""
    faces = [measure(subject, fit) for fit in (*sweep.fits, sweep.orthographic)]
    return Curves(
        distances=sweep.distances,
        d_l_percent=np.array([face.d_l_percent for face in faces[:-1]]),
        d_s_mm=np.array([face.d_s_mm for face in faces[:-1]]),
        orthographic=(faces[-1].d_l_percent, faces[-1].d_s_mm),
        true_distance=np.nan if true_distance is None else true_distance,
        tolerance_percent=HUMAN_TOLERANCE_PERCENT,
    )


def with_density(plot: Curves, density: DistanceDensity) -> Curves:
    """The curves with how likely each distance is: the posterior at their distances, its 50 and 95 % intervals."""
    at = np.interp(
        np.log(plot.distances), np.log(density.distances), density.density, left=0.0, right=0.0
    )
    highest = float(at.max())
    ends = density.quantiles([0.5 + sign * 0.5 * level for level in LEVELS for sign in (-1, 1)])
    low, high = ends[::2].clip(max=density.distances[-1]).tolist(), ends[1::2].tolist()
    return replace(
        plot,
        density=at / highest if highest > 0 else at,
        intervals=tuple(zip(low, high, strict=True)),
        beyond=density.beyond,
    )


def numbers(face: Face, *, reference: str = "") -> Numbers:
    """The numbers beside the heads. reference: what d_S is measured to, if not the true face."""
    fit = face.fit
    return Numbers(
        distance=face.camera.distance,
        d_l_percent=face.d_l_percent,
        d_s_mm=face.d_s_mm,
        converged=fit.converged,
        plausible=face.plausible,
        eyes_meaning=fit.interocular_meaning,
        flex_words=face.flex_words,
        flex_mm=face.flex_mm,
        flex=face.flex,
        reference=reference,
    )
