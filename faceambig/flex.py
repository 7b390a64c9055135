"""Flexibility modes: how far the face may bend while its landmarks hardly move (paper, section 4.4; MATH.md 4).

max |Q f|^2 subject to |Pi f|^2 = c gives Q^T Q f = lambda Pi^T Pi f. Pi^T Pi may be singular (2 L < S), G = Q^T Q never
is, so the reversed problem Pi^T Pi f = mu G f is solved: mu ascending is flexibility descending, mu = 0 is invisible.
Pi is the Jacobian of the reprojection by alpha at the fit, pose fixed: at any distance, in pixels.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import eigh
from scipy.special import gammaln

from .arrays import Array, read_only, shown, whole
from .camera import jacobian
from .fitting import Fit
from .fitting.task import landmark_rows
from .model import FaceModel

DIRECTIONS = (("wider", "narrower"), ("up", "down"), ("forward", "back"))


@dataclass(frozen=True, slots=True, eq=False)
class FlexibilityModes:
    """Bending directions of one fit, most flexible first. K modes, S shape coefficients."""

    fit: Fit
    directions: Array  # (K, S) change of alpha per millimetre of mean surface change
    landmark_percent: Array  # (K,) mean landmark movement per millimetre, % of the interocular distance, first order
    words: tuple[str, ...]  # K descriptions of what the positive direction moves

    def __post_init__(self) -> None:
        object.__setattr__(self, "directions", read_only(self.directions))
        object.__setattr__(self, "landmark_percent", read_only(self.landmark_percent))

    def reach(self, mode: int) -> tuple[float, float]:
        """(lowest, highest) millimetres along mode (0-based) that still give a plausible face: |alpha + w f| <= limit.

        Empty, (0, 0), where the fitted face itself is beyond the limit.
        """
        if not 0 <= whole("mode", mode) < len(self.directions):
            raise ValueError(f"mode: {shown(mode)} is not within 0 to {len(self.directions) - 1}")
        f, alpha = self.directions[mode], self.fit.alpha
        a, b, c = f @ f, alpha @ f, alpha @ alpha - plausible_limit(len(alpha)) ** 2
        if c > 0:
            return 0.0, 0.0
        root = float(np.sqrt(b * b - a * c))
        return float(-b - root) / float(a), float(-b + root) / float(a)


def plausible_limit(n_modes: int) -> float:
    """Largest |alpha| of a plausible face: mean + 3 sd of chi with S = n_modes (paper, section 6.4)."""
    mean = np.sqrt(2.0) * np.exp(gammaln((n_modes + 1) / 2) - gammaln(n_modes / 2))
    return float(mean + 3.0 * np.sqrt(n_modes - mean**2))


def flexibility_modes(model: FaceModel, fit: Fit, count: int = 3) -> FlexibilityModes:
    """The `count` most flexible modes at a fit, each scaled to 1 mm of mean surface change.

    The surface is the model's evaluation region, the one d_S is measured on. The sign makes the part that moves most
    along z move forward.
    """
    if not isinstance(model, FaceModel):
        raise ValueError(f"model: {shown(model)} is not a FaceModel; load one with load_model")
    if not isinstance(fit, Fit):
        raise ValueError(f"fit: {shown(fit)} is not a Fit")
    S = len(fit.alpha)
    if model.n_vertices != fit.model.n_vertices or model.n_modes < S:
        raise ValueError(
            f"model: {model.n_vertices} vertices, {model.n_modes} modes; "
            f"the fit is of one with {fit.model.n_vertices} and {fit.model.n_modes}"
        )
    if not 1 <= whole("count", count) <= S:
        raise ValueError(f"count: {shown(count)} is not within 1 to {S}")
    visible = fit.observation.visible
    vertices = fit.observation.vertices(model)[visible]
    mean, _, modes = landmark_rows(model, tuple(vertices.tolist()), model.n_modes)
    modes = np.ascontiguousarray(modes[:, :, :S])
    Pi = jacobian(fit.camera, mean + modes @ fit.alpha, modes)[:, :, :S]
    flat = Pi.reshape(-1, S)
    G = gram(model)[:S, :S]
    _, F = eigh(flat.T @ flat, G, subset_by_index=[0, count - 1])
    directions, words = [], []
    for f in F.T:
        moved = evaluation_modes(model)[:, :, :S] @ f  # (E, 3) metres
        f_mm = f / (1e3 * np.linalg.norm(moved, axis=1).mean())
        changes = _region_changes(model, S, f_mm)
        if changes[_loudest(changes)][2] < 0:
            f_mm = -f_mm
            changes = {name: -change for name, change in changes.items()}
        directions.append(f_mm)
        words.append(_words(changes))
    per_mm = np.array([np.linalg.norm(Pi @ f, axis=1).mean() for f in directions])
    return FlexibilityModes(
        fit, np.array(directions), 100 * per_mm / fit.interocular_px, tuple(words)
    )


@lru_cache(maxsize=8)
def evaluation_modes(model: FaceModel) -> Array:
    """Modes (E, 3, S) of the evaluation region, metres per standard deviation."""
    every = np.arange(model.n_vertices) if model.evaluation is None else model.evaluation
    return read_only(np.ascontiguousarray(model.rows(every)[1]))


@lru_cache(maxsize=8)
def gram(model: FaceModel) -> Array:
    """G = Q^T Q (S, S) over the evaluation region, m^2."""
    Q = evaluation_modes(model).reshape(-1, model.n_modes)
    return read_only(Q.T @ Q)


def _region_changes(model: FaceModel, S: int, f: Array) -> dict[str, Array]:
    """Mean movement (3,) of each named region along f: x outward on both sides, y up, z forward; metres."""
    return {name: modes[:, :S] @ f for name, modes in _regions(model)}


@lru_cache(maxsize=8)
def _regions(model: FaceModel) -> tuple[tuple[str, Array], ...]:
    """(name, mean movement (3, S) by each mode) of the regions that d_S measures and of the ears.

    The back of the head is free to follow and would always be the loudest. A model that names no part is one "face".
    """
    every = np.arange(model.n_vertices) if model.evaluation is None else model.evaluation
    parts = {
        name: vertices
        for name, vertices in model.regions.items()
        if name == "ears" or np.isin(vertices, every).mean() > 0.5
    }
    rows = []
    for name, vertices in (parts or {"face": every}).items():
        mean, modes = model.rows(vertices)
        outward = np.sign(mean[:, 0])  # +1 left, -1 right
        x = outward @ modes[:, 0] / len(vertices)
        rows.append((name, read_only(np.stack([x, *modes[:, 1:].mean(axis=0)]))))
    return tuple(rows)


def _loudest(changes: dict[str, Array]) -> str:
    return max(changes, key=lambda name: abs(changes[name][2]))


def _words(changes: dict[str, Array]) -> str:
    """Such as "nose forward, ears back": the two largest movements, of two regions in two ways."""
    moves = sorted(
        (
            (abs(change[axis]), name, axis, change[axis] > 0)
            for name, change in changes.items()
            for axis in range(3)
        ),
        reverse=True,
    )
    first = moves[0]
    second = next((m for m in moves[1:] if m[1] != first[1] and m[2:] != first[2:]), None)
    said = [m for m in (first, second) if m is not None and m[0] > 0.3 * first[0]]
    return ", ".join(
        f"{name} {DIRECTIONS[axis][0 if positive else 1]}" for _, name, axis, positive in said
    )
