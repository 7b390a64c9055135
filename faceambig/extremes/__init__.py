"""The two faces farthest apart that one photograph allows: how much of a face its points leave open (MATH.md 4).

From a fit with residual e and box |alpha_j| <= k, with the landmarks' first derivative Pi by alpha,

    largest d^T G d   with   |e + Pi d|^2 <= L tau^2   and   |alpha_j + d_j| <= k,

tau the tolerated rms distance of the L landmarks. The largest value of a convex function is sought, so there are many
local ones. Convex-concave steps replace the function by its tangent (G d)^T d, whose maximum over the convex set is the
box QP's for one multiplier of the landmarks' ellipsoid; from several starts, each climbs to a local maximum. How
much better a face there might be is bounded by the Lagrange dual (Shor's relaxation):

    d^T G d <= b^T M^-1 b + nu (L tau^2 - |e|^2) + sum_j l_j (k^2 - alpha_j^2),
    M = nu Pi^T Pi + diag(l) - G > 0,   b = -(nu Pi^T e + l alpha),   nu, l_j >= 0,

whatever nu and l are; the least of it is found by Newton's method with a logarithmic barrier.

Both are about the linearised picture. The faces handed back are not: they are corrected with the derivative where they
lie, and at last drawn towards the fit until their landmarks, projected, are within the tolerance.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from ..arrays import Array, one_of, positive, read_only, shown, whole
from ..camera import Camera, project
from ..errors import BeyondTolerance
from ..fitting import Fit
from ..fitting.checks import check_fit_of
from ..flex import evaluation_modes, gram
from ..metrics import HUMAN_TOLERANCE_PERCENT, mean_gap_percent, surface_difference
from ..model import FaceModel
from .dual import upper_bound
from .marks import Photo, photo_of
from .search import climb, two_ways

Pose = Literal["fixed", "free"]
CORRECTIONS = 4  # derivatives taken anew where the face has moved to
ON_TOLERANCE = 1e-4  # relative: nearer, a face is not corrected any more
ROUNDING = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class ExtremeFace:
    """One face at the tolerance. S shape coefficients, N vertices."""

    alpha: Array  # (S,) shape, in standard deviations, within the fit's box
    camera: Camera  # that sees the landmarks so; the fit's own if the pose is fixed
    vertices: Array  # (N, 3) metres, model axes
    rms_mm: float  # surface change from the fitted face over the evaluation region: root of the mean square
    mean_mm: float  # the same, mean distance
    d_s_mm: float  # mean distance after the face is laid on the fitted one, rigidly: d_S
    landmark_rms_percent: float  # distance of the projected landmarks from the observed, % of the interocular distance
    d_l_percent: float  # their mean distance: d_L

    def __post_init__(self) -> None:
        for name in ("alpha", "vertices"):
            object.__setattr__(self, name, read_only(getattr(self, name)))


@dataclass(frozen=True, slots=True, eq=False)
class ExtremeFaces:
    """Two faces far from a fitted one, in opposite ways, that its photograph cannot tell from it."""

    fit: Fit
    tolerance_percent: float  # rms landmark distance allowed, % of the interocular distance
    pose: Pose
    faces: tuple[ExtremeFace, ExtremeFace]  # the larger change first
    # rms mm that no face passes if its landmarks are linear in the shape. They are with an orthographic camera and a
    # fixed pose; else a true face may pass it by a few percent, and stay as much below
    bound_mm: float
    ratio: float  # of the largest change found to bound_mm, both of the linearised problem: 1 is proven best


def extreme_faces(
    model: FaceModel,
    fit: Fit,
    tolerance_percent: float = HUMAN_TOLERANCE_PERCENT,
    *,
    pose: Pose = "fixed",
    starts: int = 24,
    progress: Callable[[int], object] | None = None,
) -> ExtremeFaces:
    """Two faces as far from a fitted one as its box and a tolerance on the landmarks allow, in opposite ways.

    Parameters
    ----------
    fit: converged, in a box; the faces stay inside it. `model` is the model it was made with.
    tolerance_percent: largest rms distance of the visible landmarks from the observed ones, percent of the interocular
        distance. d_L, the mean of the distances, is then below it too.
    pose: "fixed", the fit's camera sees both faces; "free", rotation, shift and scale follow, the distance is kept.
    starts: of the search for the first face, both ways along half as many directions.
    progress: called with the number of starts done since it was last called, such as the `update` of a tqdm bar.

    Raises
    ------
    ValueError: the fit did not converge or has no box, or is of another model.
    BeyondTolerance, a ValueError: the fit itself misses the points by more than the tolerance.

    Notes
    -----
    Change is measured vertex by vertex over the model's evaluation region, without aligning the faces: the search and
    its bound need it so (`d_s_mm` says what is left after alignment, less with a free pose, where size may follow).
    """
    _refuse(model, fit, pose)
    tolerance, starts = positive("tolerance_percent", tolerance_percent), whole("starts", starts)
    if starts < 2:
        raise ValueError(f"starts: {shown(starts)} is not at least 2")
    photo = photo_of(model, fit, tolerance, pose == "free")
    reached = photo.rms(fit.alpha, fit.camera)
    if not reached < 1:
        least = math.ceil(1e4 * reached * tolerance) / 1e4
        raise BeyondTolerance(
            f"tolerance_percent: {tolerance:g} is not above the {least:g} % rms that the fit itself reaches"
        )
    S = len(fit.alpha)
    assert fit.options.box is not None
    E = len(evaluation_modes(model))
    G = 1e6 / E * gram(model)[:S, :S]  # d^T G d: squared rms surface change, mm^2
    low = np.minimum(-fit.options.box - fit.alpha, 0.0)
    high = np.maximum(fit.options.box - fit.alpha, 0.0)
    marks = photo.linearised(fit.alpha, fit.camera, np.zeros(S))
    first, second = two_ways(marks, G, low, high, starts, progress)
    bound = float(np.sqrt(upper_bound(marks, G, fit.alpha, fit.options.box)))
    found = float(np.sqrt(first @ G @ first))
    one, its_camera = _true(photo, fit, G, low, high, first, np.zeros(S))
    two, other_camera = _true(photo, fit, G, low, high, second, one)
    faces = [
        _face(model, fit, photo, G, *each) for each in ((one, its_camera), (two, other_camera))
    ]
    large, small = sorted(faces, key=lambda face: -face.rms_mm)
    return ExtremeFaces(fit, tolerance, pose, (large, small), bound, found / bound)


def _refuse(model: FaceModel, fit: Fit, pose: object) -> None:
    check_fit_of(model, fit)
    one_of("pose", pose, get_args(Pose))
    if not fit.converged:
        raise ValueError(f"fit: not converged ({fit.status.value}); fit again with more max_steps")
    if fit.options.box is None:
        raise ValueError(
            "fit: made without a box, so nothing ends what the landmarks do not see; fit with box=2"
        )


def _true(
    photo: Photo, fit: Fit, G: Array, low: Array, high: Array, d: Array, other: Array
) -> tuple[Array, Camera]:
    """Of a change that is right for linear landmarks one that is so for the true ones, on its side of `other`.

    The derivative is taken anew where the face has come to, until it lands on the tolerance: what still oversteps is
    drawn towards the fit. The largest is kept.
    """
    best, seen = np.zeros(len(d)), fit.camera
    for _ in range(1 + CORRECTIONS):
        if not d.any() or d @ G @ other > 0:
            break
        camera = photo.camera(fit.alpha + d, fit.camera)
        rms = photo.rms(fit.alpha + d, camera)
        share, at = _within(photo, fit, d, camera)
        if share**2 * (d @ G @ d) > best @ G @ best:
            best, seen = share * d, at
        if abs(rms - 1) < ON_TOLERANCE or rms == np.inf:
            break
        marks = photo.linearised(fit.alpha + d, camera, d)
        d = climb(marks, G, low, high, G @ d)
    return best, seen


def _within(photo: Photo, fit: Fit, d: Array, camera: Camera) -> tuple[float, Camera]:
    """How much of d the tolerance allows, 1 is all, and the camera that sees that face."""
    inside, outside, at = 0.0, 1.0, fit.camera
    share = 1.0
    for _ in range(40):
        alpha = fit.alpha + share * d
        seen = photo.camera(alpha, camera if photo.free else fit.camera)
        if photo.rms(alpha, seen) <= 1 - ROUNDING:
            inside, at = share, seen
        else:
            outside = share
        if inside == 1.0 or outside - inside < 1e-6:
            break
        share = 0.5 * (inside + outside)
    return inside, at


def _face(
    model: FaceModel, fit: Fit, photo: Photo, G: Array, d: Array, camera: Camera
) -> ExtremeFace:
    assert fit.options.box is not None
    alpha = np.clip(fit.alpha + d, -fit.options.box, fit.options.box)  # a rounding
    vertices = model.vertices(alpha)
    moved = evaluation_modes(model)[:, :, : len(d)] @ d
    gaps = photo.points - project(camera, photo.landmarks(alpha))
    return ExtremeFace(
        alpha=alpha,
        camera=camera,
        vertices=vertices,
        rms_mm=float(np.sqrt(d @ G @ d)),
        mean_mm=1e3 * float(np.linalg.norm(moved, axis=1).mean()),
        d_s_mm=surface_difference(vertices, fit.vertices(), model.evaluation).mean_mm,
        landmark_rms_percent=100 * _rms(gaps) / fit.interocular_px,
        d_l_percent=mean_gap_percent(gaps, fit.interocular_px),
    )


def _rms(gaps: Array) -> float:
    """Root mean square length of (L, 2)."""
    return float(np.linalg.norm(gaps)) / float(np.sqrt(len(gaps)))
