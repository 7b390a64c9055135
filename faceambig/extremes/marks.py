"""The landmarks of a photograph in units of the tolerance, and as linear functions of the face."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..arrays import Array
from ..camera import Camera, depths, jacobian, project
from ..fitting import Fit
from ..fitting.problem import POSE
from ..fitting.task import best_camera, landmark_rows
from ..model import FaceModel


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
class Photo:
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


def photo_of(model: FaceModel, fit: Fit, tolerance: float, free: bool) -> Photo:
    observation = fit.observation
    visible = observation.visible
    vertices = tuple(observation.vertices(model)[visible].tolist())
    mean, _, modes = landmark_rows(model, vertices, len(fit.alpha))
    unit = float(np.sqrt(len(mean))) * tolerance / 100 * fit.interocular_px
    return Photo(observation.points[visible] - observation.centre, mean, modes, unit, free)
