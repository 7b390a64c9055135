"""How far two faces are apart: d_L in the picture, d_S on the surface (MATH.md 6; paper, sections 5 and 6).

d_L = 100 mean_i |x_i - xhat_i| / interocular, a mean of distances (not rms), percent. The interocular distance is the
distance of the two eye centres of the *observed* points; `Scheme.eyes_meaning` says which points those are and belongs
beside every printed d_L: by the outer eye corners it would be 0.7 of this.

d_S = mean distance of corresponding vertices after Procrustes. Rigid by default: size is information, and a face fitted
at a wrong distance comes out up to 7% too small. `scale=True` removes size as well; its factor is in the answer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Array, checked, read_only
from .model import Scheme
from .observation import eye_distance

# Percent of the interocular distance: landmarks that differ by less cannot be told apart.
# Between two annotators: Burgos-Artizzu, Ronchi, Perona, ECCV 2014, as the paper cites it.
HUMAN_TOLERANCE_PERCENT = 3.0
# The best methods for half of the landmarks: paper, section 6, after Sagonas et al. 2016 (300-W).
AUTOMATIC_TOLERANCE_PERCENT = 5.0
# "for only 50 % of images": paper, section 1, same source. The two sentences do not agree.
AUTOMATIC_HALF_PERCENT = 4.5


def interocular(points: ArrayLike, scheme: Scheme) -> float:
    """Distance of the two eye centres (`scheme.eyes_meaning`), in the unit of `points` (L, k).

    Raises
    ------
    ValueError: an eye point is missing (NaN), or both eyes are at one place. Names the points.
    """
    x = _scheme_points("points", points, scheme)
    rows = [row for eye in scheme.eyes for row in eye]
    missing = [scheme.points[row] for row in rows if np.isnan(x[row]).any()]
    if missing:
        raise ValueError(
            f"points: {', '.join(missing)} missing; the interocular distance is the {scheme.eyes_meaning}"
        )
    distance = eye_distance(x, scheme)
    if not distance > 0:
        raise ValueError("points: both eyes are at one place, there is no interocular distance")
    return distance


def mean_gap_percent(gaps: Array, interocular_px: float) -> float:
    """d_L of the gaps (n, 2) between visible points and their projections, pixels: the one place of its formula."""
    return 100.0 * float(np.linalg.norm(gaps, axis=1).mean()) / interocular_px


def landmark_error_percent(
    observed: ArrayLike,
    projected: ArrayLike,
    scheme: Scheme,
    *,
    interocular_px: float | None = None,
) -> float:
    """d_L: mean distance of the visible points from the projected ones, percent of the interocular distance.

    Parameters
    ----------
    observed: (L, 2) pixels, NaN = not visible; such points do not count.
    projected: (L, 2) pixels, finite where `observed` is.
    interocular_px: the distance to measure by, for pictures that hide an eye corner (`Fit.interocular_px`); None
        measures it on `observed`.

    Raises
    ------
    ValueError: wrong shape, nothing visible, or an eye corner missing while `interocular_px` is not given.
    """
    x = _scheme_points("observed", observed, scheme)
    y = _scheme_points("projected", projected, scheme)
    if y.shape != x.shape:
        raise ValueError(f"projected: expected shape {x.shape} like observed, found {y.shape}")
    visible = np.isfinite(x).all(axis=1)
    if not visible.any():
        raise ValueError("observed: no point is visible")
    unprojected = visible & np.isnan(y).any(axis=1)
    if unprojected.any():
        raise ValueError(
            f"projected: point {scheme.points[int(unprojected.argmax())]} is NaN but visible"
        )
    unit = interocular(x, scheme) if interocular_px is None else interocular_px
    if not unit > 0:
        raise ValueError(f"interocular_px: {unit!r} is not a distance in pixels")
    return mean_gap_percent(x[visible] - y[visible], unit)


def align(
    source: ArrayLike, target: ArrayLike, *, scale: bool = False
) -> tuple[Array, Array, float]:
    """R, t, s of the least-squares motion s R source_i + t = target_i (Procrustes; never a reflection).

    Parameters
    ----------
    source, target: (N, 3) corresponding points, N >= 3, one unit.
    scale: also fit s; else s = 1.

    Returns
    -------
    R (3, 3) a rotation, t (3,) in the points' unit, s the scale.

    Notes
    -----
    Kabsch's solution by the SVD of the 3 x 3 covariance; the sign of its determinant goes to the smallest singular
    value (Umeyama 1991). Points on one line leave R open about the line: any of the best ones is returned.
    """
    a = checked("source", source, (None, 3))
    b = checked("target", target, (None, 3))
    if len(a) != len(b):
        raise ValueError(f"target: {len(b)} points for {len(a)} of source")
    if len(a) < 3:
        raise ValueError(f"source: {len(a)} points; a motion needs 3")
    return _align(a, b, scale)[:3]


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceDifference:
    """d_S and where it comes from. E vertices compared."""

    mean: float  # d_S: metres
    distances: Array  # (E,) metres, vertex by vertex
    rotation: Array  # (3, 3) of the motion s R a + t that lays the first face on the second
    translation: Array  # (3,) metres
    scale: float  # s; 1 if rigid

    def __post_init__(self) -> None:
        for name in ("distances", "rotation", "translation"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def mean_mm(self) -> float:
        """d_S in millimetres."""
        return 1000.0 * self.mean


def surface_difference(
    a: ArrayLike, b: ArrayLike, vertices: ArrayLike | None = None, *, scale: bool = False
) -> SurfaceDifference:
    """d_S of faces `a` and `b` (N, 3), metres: mean vertex distance after laying `a` on `b`.

    Parameters
    ----------
    vertices: (E,) vertex numbers to align and to measure on (`model.evaluation`); None: all.
    scale: let the alignment change size; then d_S depends on which face is first, and is measured at the size of `b`.

    Raises
    ------
    ValueError: shapes differ, a value is not finite, or fewer than 3 vertices.
    """
    x, y = checked("a", a, (None, 3)), checked("b", b, (None, 3))
    if x.shape != y.shape:
        raise ValueError(f"b: {len(y)} vertices for {len(x)} of a")
    if vertices is not None:
        chosen = np.asarray(vertices)
        if chosen.ndim != 1 or chosen.dtype.kind not in "iu":
            raise ValueError(
                f"vertices: expected a list of numbers, found {chosen.dtype} {chosen.shape}"
            )
        if chosen.size and (chosen.min() < 0 or chosen.max() >= len(x)):
            raise ValueError(
                f"vertices: {chosen.min()} to {chosen.max()} is not within 0 to {len(x) - 1}"
            )
        x, y = x.take(chosen, axis=0), y.take(chosen, axis=0)
    if len(x) < 3:
        raise ValueError(f"vertices: {len(x)} to compare; a motion needs 3")
    R, t, s, xc, yc = _align(x, y, scale)
    gap = np.subtract((s * R) @ xc, yc, out=yc)
    gap *= gap
    distances = gap.sum(axis=0)
    np.sqrt(distances, out=distances)
    return SurfaceDifference(float(distances.mean()), distances, R, t, s)


def _align(a: Array, b: Array, scale: bool) -> tuple[Array, Array, float, Array, Array]:
    """R, t, s of `align`, and both point sets about their means, (3, N)."""
    # One row per coordinate: NumPy's loops then run over N, not over 3. In place: at this size an
    # array costs more to allocate than to fill.
    ac, bc = np.array(a.T, order="C"), np.array(b.T, order="C")
    a_mean, b_mean = ac.mean(axis=1), bc.mean(axis=1)
    ac -= a_mean[:, None]  # centred first: far from the origin the product alone loses digits
    bc -= b_mean[:, None]
    U, D, Vt = np.linalg.svd(bc @ ac.T)
    if np.linalg.det(U) * np.linalg.det(Vt) < 0:
        U[:, 2] *= -1
        D[2] *= -1
    R = U @ Vt
    s = 1.0
    if scale:
        size = float(np.vdot(ac, ac))
        if not size > 0:
            raise ValueError("source: all points are at one place, no scale fits")
        s = float(D.sum()) / size
    return R, b_mean - s * (R @ a_mean), s, ac, bc


def _scheme_points(name: str, points: ArrayLike, scheme: Scheme) -> Array:
    x = checked(name, points, (None, None), nan=True)
    if len(x) != len(scheme):
        raise ValueError(
            f"{name}: {len(x)} points for scheme {scheme.name!r}, which has {len(scheme)}"
        )
    return x
