"""Flexibility modes: how far the face may bend while its landmarks hardly move (paper, section 4.4; MATH.md 4).

max |Q f|^2 subject to |Pi f|^2 = c gives Q^T Q f = lambda Pi^T Pi f. Pi^T Pi may be singular (2 L < S), G = Q^T Q never
is, so the reversed problem Pi^T Pi f = mu G f is solved: mu ascending is flexibility descending. mu = 0 is invisible;
what is invisible is ordered by a second problem, the most surface change for the least |f| first.

Pi (linear.py) is the Jacobian of the landmarks by alpha. With the pose compensated the camera follows the bend, and
surface change is what rigid alignment leaves, in G as in millimetres.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, get_args

import numpy as np
from scipy.special import gammaln

from .arrays import Array, IntArray, number, one_of, positive, read_only, shown, whole
from .camera import Camera
from .fitting import Fit
from .fitting.checks import check_fit
from .linear import PoseFree, algebraic, linearised, pose_columns, without_pose
from .model import FaceModel
from .rotation import rotation_matrix
from .surface import DIRECTIONS, Bending, bending, evaluation_modes, gram, sign, words

__all__ = [
    "DIRECTIONS", "FlexibilityModes", "KeptModes", "evaluation_modes", "flexibility_modes", "gram", "plausible_limit",
]  # fmt: skip

Linearisation = Literal["reprojection", "algebraic"]
Pose = Literal["fixed", "compensated"]
INVISIBLE = 1e-12  # of the largest mu: below, mu is rounding


@dataclass(frozen=True, slots=True, eq=False)
class KeptModes:
    """The modes that a truncation keeps, and how many of them give plausible faces."""

    surface_mm: float  # k_1, mean surface change that each mode is moved by
    landmark_px: float  # k_2, mean landmark movement that is still allowed
    kept: IntArray  # (M,) numbers of the modes kept, 0-based, ascending
    plausible: int  # |w f| is that of a face: within 3 sd of the mean of chi (the paper's count)
    plausible_upper: int  # |w f| is not above it: an offset may be small
    plausible_faces: int  # |alpha + w f| and |alpha - w f| of the fitted face are not above it

    def __post_init__(self) -> None:
        object.__setattr__(self, "kept", read_only(self.kept))

    def __len__(self) -> int:
        return len(self.kept)


@dataclass(frozen=True, slots=True, eq=False)
class FlexibilityModes:
    """Bending directions of one fit, most flexible first. K modes, S shape coefficients."""

    fit: Fit
    directions: Array  # (K, S) change of alpha per millimetre of mean surface change
    landmark_percent: Array  # (K,) mean landmark movement per millimetre, % of the interocular distance, first order
    words: tuple[str, ...]  # K descriptions of what the positive direction moves
    linearisation: Linearisation = "reprojection"
    pose: Pose = "fixed"
    # (K, 7) how the compensating camera follows, per millimetre: turn (radians), t_xy (metres), log s, kappa.
    # None: it stays
    camera_steps: Array | None = None

    def __post_init__(self) -> None:
        for name in ("directions", "landmark_percent", "camera_steps"):
            array = getattr(self, name)
            if array is not None:
                object.__setattr__(self, name, read_only(array))

    def reach(self, mode: int) -> tuple[float, float]:
        """(lowest, highest) millimetres along mode (0-based) that still give a plausible face: |alpha + w f| <= limit.

        Empty, (0, 0), where the fitted face itself is beyond the limit.
        """
        f, alpha = self.directions[self._number(mode)], self.fit.alpha
        a, b, c = f @ f, alpha @ f, alpha @ alpha - plausible_limit(len(alpha)) ** 2
        if c > 0:
            return 0.0, 0.0
        root = float(np.sqrt(b * b - a * c))
        return float(-b - root) / float(a), float(-b + root) / float(a)

    def camera(self, mode: int, mm: float) -> Camera:
        """The camera that sees the fit bent by `mm` along mode (0-based): the fit's own unless the pose compensates."""
        mode, mm = self._number(mode), number("mm", mm)
        camera = self.fit.camera
        if self.camera_steps is None:
            return camera
        if not np.isfinite(mm):
            raise ValueError(f"mm: {mm} is not a number of millimetres")
        step = mm * self.camera_steps[mode]
        return Camera(
            rotation_matrix(step[:3]) @ camera.R,
            camera.t + step[3:5],
            camera.s * float(np.exp(step[5])),
            max(camera.kappa + float(step[6]), 0.0),
        )

    def truncated(
        self,
        surface_mm: float = 2.0,
        *,
        landmark_px: float | None = None,
        landmark_percent: float | None = None,
    ) -> KeptModes:
        """The modes that change the surface by k_1 = `surface_mm` and the landmarks by less than k_2, means of both.

        Parameters
        ----------
        landmark_px: k_2 in pixels, of this picture: twice the size keeps fewer. None and no percent: 2, the paper's.
        landmark_percent: k_2 in percent of the interocular distance instead.

        Raises
        ------
        ValueError: k_1 or k_2 is not positive, both k_2 are given, or only some of the modes are known.
        """
        fit, S = self.fit, len(self.fit.alpha)
        if len(self.directions) < S:
            raise ValueError(
                f"count: {len(self.directions)} of {S} modes are known, truncation looks at all; "
                "ask flexibility_modes for count=None"
            )
        k_1 = positive("surface_mm", surface_mm)
        if landmark_percent is None:
            k_2 = positive("landmark_px", 2.0 if landmark_px is None else landmark_px)
        elif landmark_px is None:
            k_2 = positive("landmark_percent", landmark_percent) * fit.interocular_px / 100
        else:
            raise ValueError("landmark_percent: given beside landmark_px; give one of them")
        moved_px = k_1 * self.landmark_percent * fit.interocular_px / 100
        kept = np.flatnonzero(moved_px < k_2)
        wf = k_1 * self.directions[kept]
        low, high = plausible_range(S)
        size = np.linalg.norm(wf, axis=1)
        faces = np.maximum(
            np.linalg.norm(fit.alpha + wf, axis=1), np.linalg.norm(fit.alpha - wf, axis=1)
        )
        return KeptModes(
            surface_mm=k_1,
            landmark_px=k_2,
            kept=kept,
            plausible=int(((low <= size) & (size <= high)).sum()),
            plausible_upper=int((size <= high).sum()),
            plausible_faces=int((faces <= high).sum()),
        )

    def _number(self, mode: int) -> int:
        if not 0 <= whole("mode", mode) < len(self.directions):
            raise ValueError(f"mode: {shown(mode)} is not within 0 to {len(self.directions) - 1}")
        return int(mode)


@lru_cache(maxsize=128)
def plausible_range(n_modes: int) -> tuple[float, float]:
    """Least and largest |alpha| of a plausible face: mean -+ 3 sd of chi with S = n_modes (paper, section 6.4)."""
    mean = np.sqrt(2.0) * np.exp(gammaln((n_modes + 1) / 2) - gammaln(n_modes / 2))
    sd = np.sqrt(n_modes - mean**2)
    return float(mean - 3.0 * sd), float(mean + 3.0 * sd)


def plausible_limit(n_modes: int) -> float:
    """Largest |alpha| of a plausible face: mean + 3 sd of chi with S = n_modes (paper, section 6.4)."""
    return plausible_range(n_modes)[1]


def flexibility_modes(
    model: FaceModel,
    fit: Fit,
    count: int | None = 3,
    *,
    linearisation: Linearisation = "reprojection",
    pose: Pose = "fixed",
    free_distance: bool = False,
    previous: FlexibilityModes | None = None,
) -> FlexibilityModes:
    """The `count` most flexible modes at a fit, each scaled to 1 mm of mean surface change (MATH.md 4).

    The surface is the model's evaluation region, the one d_S is measured on. The sign makes the part that moves most
    along z move forward. The problem knows no prior: |alpha| beside a bend says whether it is still a face.

    Parameters
    ----------
    count: modes asked for; None: all S, as a truncation needs. Each costs its millimetres, 0.3 ms for 9,400 vertices.
    linearisation: of the landmarks, see the module; "algebraic" is the paper's, and less exact below 0.6 m.
        `landmark_percent` is of the reprojection either way.
    pose: "fixed"; or "compensated", where the camera turns, shifts and scales with the bend (6 parameters) so that the
        landmarks stay, and surface change is what rigid alignment leaves.
    free_distance: the compensating camera changes its distance too (7 parameters).
    previous: modes of a fit nearby: mode i is then the one that continues its mode i, in its sign, whatever its place
        by flexibility; further ones follow in their own order.

    Raises
    ------
    ValueError: no fit or one that did not converge, a model of another mesh, an argument out of range.
    """
    check_fit(model, fit)
    count = count_of(fit, count)
    one_of("linearisation", linearisation, get_args(Linearisation))
    columns = pose_columns(pose, get_args(Pose), free_distance)
    picture = linearised(model, fit)
    rows = picture if linearisation == "reprojection" else algebraic(model, fit)
    surface = bending(model, fit.alpha, aligned=pose == "compensated")
    F = most_flexible(without_pose(rows, columns).shape, surface.W)
    signs = None
    if previous is not None:
        if not isinstance(previous, FlexibilityModes):
            raise ValueError(f"previous: {shown(previous)} is not a FlexibilityModes")
        order, signs = continued(previous.directions, F, surface.G, count)
        F = F[:, order]
    F = F[:, :count]
    return _scaled(fit, F, signs, surface, without_pose(picture, columns), linearisation, pose)


def _scaled(
    fit: Fit,
    F: Array,
    signs: Array | None,
    surface: Bending,
    picture: PoseFree,
    linearisation: Linearisation,
    pose: Pose,
) -> FlexibilityModes:
    """Directions F (S, K) in millimetres, with sign and words. `signs` (P,) are those of the first P, if known."""
    mean = surface.mean_change(F)
    F = F / (1e3 * mean)
    moves = surface.parts(F)
    turned = np.array([sign(f, 1e-3, moves, k) for k, f in enumerate(F.T)])
    if signs is not None:
        turned[: len(signs)] = signs
    F = F * turned
    movement = (picture.shape @ F).reshape(-1, 2, F.shape[1])
    return FlexibilityModes(
        fit,
        np.ascontiguousarray(F.T),
        100 * np.linalg.norm(movement, axis=1).mean(axis=0) / fit.interocular_px,
        tuple(words(moves, k, s) for k, s in enumerate(turned)),
        linearisation,
        pose,
        None if pose == "fixed" else np.ascontiguousarray((picture.steps @ F).T),
    )


def count_of(fit: Fit, count: int | None) -> int:
    """`count`, or all S modes for None; ValueError out of range."""
    S = len(fit.alpha)
    if count is None:
        return S
    if not 1 <= whole("count", count) <= S:
        raise ValueError(f"count: {shown(count)} is not within 1 to {S}")
    return int(count)


def most_flexible(Pi: Array, W: Array) -> Array:
    """F (S, S), columns with F^T G F = I and the least |Pi f| first; W^T G W = I.

    Columns that Pi (m, S) does not see have the least |f| first.
    """
    A = Pi @ W
    mu, V = np.linalg.eigh(A.T @ A)
    F = W @ V
    unseen = int((mu <= INVISIBLE * mu[-1]).sum())
    if unseen > 1:
        F_0 = F[:, :unseen]
        F[:, :unseen] = F_0 @ np.linalg.eigh(F_0.T @ F_0)[1]
    return F


def continued(previous: Array, F: Array, G: Array, count: int) -> tuple[IntArray, Array]:
    """Order (S,) of the columns of F that continues the directions `previous` (K, S), and the signs of its first P.

    P = min(K, count). The assignment of largest sum |F_old^T G F| (Hungarian method), old directions at unit length.
    """
    from scipy.optimize import linear_sum_assignment  # 0.2 s to import: only where it is needed

    S = len(F)
    if previous.shape[1] != S:
        raise ValueError(f"previous: of {previous.shape[1]} shape modes, the fit has {S}")
    old = previous[:count]
    alike = old @ G @ F  # (P, S)
    alike /= np.sqrt(((old @ G) * old).sum(axis=1))[:, None]
    rows, chosen = linear_sum_assignment(np.abs(alike), maximize=True)
    rest = np.setdiff1d(np.arange(S), chosen)
    signs = np.where(alike[rows, chosen] < 0, -1.0, 1.0)
    return np.concatenate([chosen, rest]), signs
