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
from typing import Literal, NamedTuple, get_args

import numpy as np
from scipy.linalg import eigh, lapack

from .arrays import Array, number, read_only, shown, whole
from .camera import Camera, depths, jacobian, project
from .fitting import Fit
from .fitting.boxqp import solve_box_qp
from .fitting.solve import POSE
from .fitting.task import best_camera, landmark_rows
from .flex import evaluation_modes, gram
from .metrics import HUMAN_TOLERANCE_PERCENT, mean_gap_percent, surface_difference
from .model import FaceModel

Pose = Literal["fixed", "free"]
CLIMB, CLIMBS = 1e-4, 60  # least relative gain of a convex-concave step, and most steps
CORRECTIONS = 4  # derivatives taken anew where the face has moved to
ON_TOLERANCE = 1e-4  # relative: nearer, a face is not corrected any more
ROUNDING = 1e-12
EXACT = 1e-6  # of the squared tolerance: how far below it the multiplier may leave the landmarks
QP_ROUNDS = 60
GROWTH = 8.0  # most a pace grows at once: bounds are followed, not guessed
# Of the mean curvature, step by step: with less, modes that the landmarks hardly see send the first box QP's search of
# active bounds far astray; a step's answer is the next one's guess. The last changes no face by 0.01 mm
RIDGES = (1e-2, 1e-3, 1e-4, 1e-5)
GAP = 1e-4  # relative, of the barrier: how near the bound is to the dual's least value
NEWTON_STEPS = 300


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
    ValueError: the fit did not converge or has no box, is of another model, or is itself beyond the tolerance.

    Notes
    -----
    Change is measured vertex by vertex over the model's evaluation region, without aligning the faces: the search and
    its bound need it so (`d_s_mm` says what is left after alignment, less with a free pose, where size may follow).
    """
    _refuse(model, fit, pose)
    tolerance, starts = number("tolerance_percent", tolerance_percent), whole("starts", starts)
    if not 0 < tolerance < np.inf:
        raise ValueError(f"tolerance_percent: {tolerance:g} is not above 0 and finite")
    if starts < 2:
        raise ValueError(f"starts: {shown(starts)} is not at least 2")
    photo = _photo(model, fit, tolerance, pose == "free")
    reached = photo.rms(fit.alpha, fit.camera)
    if not reached < 1:
        least = math.ceil(1e4 * reached * tolerance) / 1e4
        raise ValueError(
            f"tolerance_percent: {tolerance:g} is not above the {least:g} % rms that the fit itself reaches"
        )
    S = len(fit.alpha)
    assert fit.options.box is not None
    E = len(evaluation_modes(model))
    G = 1e6 / E * gram(model)[:S, :S]  # d^T G d: squared rms surface change, mm^2
    low = np.minimum(-fit.options.box - fit.alpha, 0.0)
    high = np.maximum(fit.options.box - fit.alpha, 0.0)
    marks = photo.linearised(fit.alpha, fit.camera, np.zeros(S))
    first, second = _two(marks, G, low, high, starts, progress)
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
    if not isinstance(model, FaceModel):
        raise ValueError(f"model: {shown(model)} is not a FaceModel; load one with load_model")
    if not isinstance(fit, Fit):
        raise ValueError(f"fit: {shown(fit)} is not a Fit")
    if not isinstance(pose, str) or pose not in get_args(Pose):
        raise ValueError(f"pose: {shown(pose)} is not {' or '.join(get_args(Pose))}")
    S = len(fit.alpha)
    if model.n_vertices != fit.model.n_vertices or model.n_modes < S:
        raise ValueError(
            f"model: {model.n_vertices} vertices, {model.n_modes} modes; "
            f"the fit is of one with {fit.model.n_vertices} and {fit.model.n_modes}"
        )
    if not fit.converged:
        raise ValueError(f"fit: not converged ({fit.status.value}); fit again with more max_steps")
    if fit.options.box is None:
        raise ValueError(
            "fit: made without a box, so nothing ends what the landmarks do not see; fit with box=2"
        )


class Marks(NamedTuple):
    """The landmarks as linear functions of the change d of alpha: |r + Pi d|^2 is their mean square, 1 tolerated."""

    r: Array  # (n,), n up to S + 1
    Pi: Array  # (n, S)
    H: Array  # (S, S) Pi^T Pi
    pull: Array  # (S,) Pi^T r

    def excess(self, d: Array) -> float:
        gap = self.r + self.Pi @ d
        return float(gap @ gap)


@dataclass(frozen=True, slots=True, eq=False)
class _Photo:
    """The visible landmarks of a photograph, in units of the tolerance."""

    points: Array  # (L, 2) pixels from the principal point
    mean: Array  # (L, 3)
    modes: Array  # (L, 3, S)
    unit: float  # pixels: sqrt(L) tau
    free: bool  # the pose follows the face

    def landmarks(self, alpha: Array) -> Array:
        return self.mean + self.modes @ alpha

    def camera(self, alpha: Array, camera: Camera) -> Camera:
        """The camera that sees a face best, from `camera` on."""
        if not self.free:
            return camera
        return best_camera(self.points, self.landmarks(alpha), camera)

    def rms(self, alpha: Array, camera: Camera) -> float:
        """Rms distance of the projected landmarks, 1 is the tolerance; inf with one behind the camera."""
        v = self.landmarks(alpha)
        if depths(camera, v).min() <= 0:
            return float("inf")
        return float(np.linalg.norm(project(camera, v) - self.points)) / self.unit

    def linearised(self, alpha: Array, camera: Camera, d: Array) -> Marks:
        """At a face that differs from the fit by d; what a free pose takes up is taken out."""
        S, v = len(alpha), self.landmarks(alpha)
        J = jacobian(camera, v, self.modes).reshape(-1, S + POSE + 1) / self.unit
        r = (project(camera, v) - self.points).ravel() / self.unit
        Pi = J[:, :S]
        if self.free:
            span = np.linalg.qr(J[:, S : S + POSE])[0]
            Pi, r = Pi - span @ (span.T @ Pi), r - span @ (span.T @ r)
        # Its triangle has the same squares in at most S + 1 rows, however many the landmarks are
        R = np.linalg.qr(np.column_stack([Pi, r - Pi @ d])).R
        Pi, r = R[:, :S], R[:, S]
        H = Pi.T @ Pi
        return Marks(r, Pi, H, Pi.T @ r)


def _photo(model: FaceModel, fit: Fit, tolerance: float, free: bool) -> _Photo:
    observation = fit.observation
    visible = observation.visible
    vertices = tuple(observation.vertices(model)[visible].tolist())
    mean, _, modes = landmark_rows(model, vertices, len(fit.alpha))
    unit = float(np.sqrt(len(mean))) * tolerance / 100 * fit.interocular_px
    return _Photo(observation.points[visible] - observation.centre, mean, modes, unit, free)


def _farthest(
    marks: Marks, H: Array, c: Array, low: Array, high: Array, pace: float, active: np.ndarray
) -> tuple[Array, float, np.ndarray]:
    """d of the largest c . d within the box and the tolerance; and its pace and active bounds, for a neighbouring c.

    With p, the pace, 1 / the multiplier of the landmarks, d(p) is the box QP's answer to H, p c - Pi^T r. As long as no
    bound changes it is linear in p, so the landmarks' square is a parabola, and it only grows. The parabola's root is
    the next p, kept within a bracket.
    """
    c = c / np.linalg.norm(c)
    d = np.where(c > 0, high, low)
    if marks.excess(d) <= 1:  # the landmarks hold nothing back
        return d, pace, np.sign(c).astype(np.int8)
    lowest, highest, best = 0.0, np.inf, np.zeros(len(c))
    for _ in range(60):
        d, bounds, solved, *_ = solve_box_qp(H, pace * c - marks.pull, low, high, active, QP_ROUNDS)
        gap = marks.r + marks.Pi @ d
        square = float(gap @ gap)
        if not solved:  # says nothing about larger paces: come nearer to where the bounds are known
            pace = 0.5 * (lowest + pace)
            continue
        active = bounds
        if square <= 1:
            lowest, best = pace, d
            if square >= 1 - EXACT:
                break
        else:
            highest = pace
        if highest - lowest < 1e-13 * highest:
            break
        pace = _next_pace(marks, H, c, active == 0, gap, pace, lowest, highest)
    return best, lowest or pace, active


def _next_pace(
    marks: Marks,
    H: Array,
    c: Array,
    free: np.ndarray,
    gap: Array,
    pace: float,
    lowest: float,
    highest: float,
) -> float:
    chosen = free.nonzero()[0]
    new = np.nan
    if len(chosen):
        *_, way, info = lapack.dposv(H[np.ix_(chosen, chosen)], c[chosen], lower=1)
        if info == 0:
            along = marks.Pi[:, chosen] @ way
            a, b = float(along @ along), float(gap @ along)
            rest = float(gap @ gap) - (1 - 0.5 * EXACT)
            root = b * b - a * rest
            if root >= 0 and a > 0:
                new = pace + (-b + np.sqrt(root)) / a
    if highest < np.inf:
        return new if lowest < new < highest else 0.5 * (lowest + highest)
    return float(min(new, GROWTH * pace)) if new > pace else GROWTH * pace


def _climb(marks: Marks, G: Array, low: Array, high: Array, c: Array) -> Array:
    """A local maximum of d^T G d by convex-concave steps: the first of them along c, the others along G d."""
    d, value = np.zeros(len(c)), 0.0
    if not c.any():
        return d
    unit = c / np.linalg.norm(c)
    ridges = np.array(RIDGES)[:, None, None] * (np.trace(marks.H) / len(c) * np.eye(len(c)))
    # without a box and r
    pace = 1 / float(np.sqrt(unit @ np.linalg.solve(marks.H + ridges[0], unit)))
    active = (high <= 0).astype(np.int8) - (low >= 0)
    for step in range(CLIMBS):
        H = marks.H + ridges[min(step, len(ridges) - 1)]
        new, pace, active = _farthest(marks, H, c, low, high, pace, active)
        reached = float(new @ G @ new)
        if reached > value:
            d = new
        if not d.any() or (reached <= value * (1 + CLIMB) and step >= len(RIDGES) - 1):
            break
        value, c = max(value, reached), G @ d
    return d


def _two(
    marks: Marks,
    G: Array,
    low: Array,
    high: Array,
    starts: int,
    progress: Callable[[int], object] | None = None,
) -> tuple[Array, Array]:
    """The largest change found, and the largest of those that point away from it."""
    S = len(G)
    # Towards what moves the surface most for what it moves of the landmarks and takes of the box
    room = np.diag((2 / (high - low)) ** 2) / S
    _, F = eigh(G, marks.H + room)  # room > 0, so never singular
    found = []
    for f in F.T[::-1][: -(-starts // 2)]:
        found += [_climb(marks, G, low, high, sign * (G @ f)) for sign in (1.0, -1.0)]
        if progress is not None:
            progress(2)
    first = max(found, key=lambda d: float(d @ G @ d))
    found.append(_climb(marks, G, low, high, -(G @ first)))
    away = [d for d in found if d @ G @ first < 0]
    return first, max(away, key=lambda d: float(d @ G @ d), default=np.zeros(S))


def _true(
    photo: _Photo, fit: Fit, G: Array, low: Array, high: Array, d: Array, other: Array
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
        d = _climb(marks, G, low, high, G @ d)
    return best, seen


def _within(photo: _Photo, fit: Fit, d: Array, camera: Camera) -> tuple[float, Camera]:
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
    model: FaceModel, fit: Fit, photo: _Photo, G: Array, d: Array, camera: Camera
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


def upper_bound(marks: Marks, G: Array, alpha: Array, box: float) -> float:
    """The least value of the Lagrange dual that Newton's method with a logarithmic barrier finds."""
    S = len(alpha)
    P, square = marks.Pi.T @ marks.Pi, float(marks.r @ marks.r)
    diag = np.diag_indices(S)
    room = box**2 - alpha**2

    def at(x: Array) -> tuple[float, float, Array, Array] | None:
        """Dual value, log det M, M^-1, u = M^-1 b; None where M is not positive definite."""
        nu, l = x[0], x[1:]
        M = nu * P - G
        M[diag] += l
        factor, info = lapack.dpotrf(M, lower=1)
        if info:
            return None
        inverse, info = lapack.dpotri(factor, lower=1)
        if info:
            return None
        inverse = np.tril(inverse) + np.tril(inverse, -1).T
        b = -(nu * marks.pull + l * alpha)
        u = inverse @ b
        value = float(b @ u) + nu * (1 - square) + float(l @ room)
        return value, 2 * float(np.log(np.diag(factor)).sum()), inverse, u

    top = float(np.linalg.eigvalsh(G)[-1])
    x = np.full(S + 1, 1.1 * top)
    now = at(x)
    assert now is not None
    least, t = now[0], 1.0 / now[0]
    n_barrier = 2 * S + 1
    for _ in range(NEWTON_STEPS):
        value, logdet, inverse, u = now
        w, p = alpha + u, marks.pull + P @ u
        gap = marks.r + marks.Pi @ u
        A = np.column_stack([p, np.diag(w)])
        IP = inverse @ P
        slope = np.concatenate([[1 - gap @ gap], box**2 - w**2])
        slope_log = np.concatenate([[np.trace(IP)], np.diag(inverse)])
        H = 2 * A.T @ inverse @ A
        curve = np.empty_like(H)
        curve[0, 0] = (IP * IP.T).sum()
        curve[0, 1:] = curve[1:, 0] = (IP * inverse).sum(axis=1)
        curve[1:, 1:] = inverse**2
        g = t * slope - slope_log - 1 / x
        H = t * H + curve
        H[np.diag_indices(S + 1)] += 1 / x**2
        *_, step, info = lapack.dposv(H, -g, lower=1)
        if info:
            break
        decrement = float(-g @ step)
        merit = t * value - logdet - float(np.log(x).sum())
        shrinking = step < 0
        length = min(1.0, 0.99 * float((-x[shrinking] / step[shrinking]).min(initial=np.inf)))
        new = None
        for _ in range(40):
            y = x + length * step
            new = at(y)
            if new is not None:
                changed = t * new[0] - new[1] - float(np.log(y).sum())
                if changed <= merit - 0.1 * length * decrement + 1e-9 * abs(merit):
                    break
            new, length = None, 0.5 * length
        if new is None:
            break
        x, now = x + length * step, new
        least = min(least, now[0])
        if decrement < 0.5:
            if n_barrier / t < GAP * least:
                break
            t *= 10
    return least
