"""Fits along the camera distance: how d_L hardly changes while the face does (paper, section 6.1).

The grid is uniform in log t_z and ends in the orthographic camera, kappa = 0. Each fit starts from its neighbour's with
only kappa changed: in the unified camera nothing else needs rescaling (MATH.md 6).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Array, checked, read_only
from .camera import depths
from .fitting import FARTHEST, NEAREST, Fit, FitOptions, prepare, solve_from, start_pose
from .fitting.result import Jacobian, Method, Weighting
from .metrics import HUMAN_TOLERANCE_PERCENT
from .model import FaceModel
from .observation import Observation

GRID = (0.2, 3.0, 49)  # metres from, to, steps: the range of the page's slider
END_TOLERANCE = 0.01  # relative, how exactly the ends of an interval are found


@dataclass(frozen=True, slots=True)
class Interval:
    """All distances with d_L below a tolerance, metres."""

    low: float | None  # None: open, the nearest distance of the sweep is inside
    high: float | None  # None: open at infinity
    empty: bool  # no distance reaches the tolerance
    best_d_l_percent: float
    tolerance_percent: float


@dataclass(frozen=True, slots=True, eq=False)
class Sweep:
    """Fits of one observation along the distance. D distances."""

    distances: Array  # (D,) metres, ascending
    fits: tuple[Fit, ...]  # D, perspective
    orthographic: Fit

    def __post_init__(self) -> None:
        object.__setattr__(self, "distances", read_only(self.distances))

    @property
    def d_l_percent(self) -> Array:
        """(D,) landmark error of each fit, percent of the interocular distance."""
        return np.array([fit.d_l_percent for fit in self.fits])

    def nearest(self, distance: float) -> Fit:
        """The fit whose distance is nearest in ratio: a start for a fit at `distance`."""
        return self.fits[int(np.argmin(np.abs(np.log(self.distances / distance))))]

    def interval(self, tolerance_percent: float = HUMAN_TOLERANCE_PERCENT) -> Interval:
        """The distances around the best one that the tolerance cannot tell apart, each end to 1 %."""
        d_l = self.d_l_percent
        best = int(np.argmin(d_l))
        least = min(float(d_l[best]), self.orthographic.d_l_percent)
        if least > tolerance_percent:
            return Interval(None, None, True, least, tolerance_percent)
        if d_l[best] > tolerance_percent:  # only farther cameras than the sweep's reach it
            low = _end_beyond(self.fits[-1], tolerance_percent) or FARTHEST
            return Interval(low, None, False, least, tolerance_percent)
        low = self._end(range(best, -1, -1), tolerance_percent)
        high = self._end(range(best, len(self.fits)), tolerance_percent)
        if high is None and self.orthographic.d_l_percent > tolerance_percent:
            high = _end_beyond(self.fits[-1], tolerance_percent)
        return Interval(low, high, False, least, tolerance_percent)

    def _end(self, order: range, tolerance_percent: float) -> float | None:
        """Where d_L crosses the tolerance going outward in `order`; None if it does not."""
        inside = self.fits[order[0]]
        for index in order:
            fit = self.fits[index]
            if fit.d_l_percent > tolerance_percent:
                return _crossing(inside, fit, tolerance_percent)
            inside = fit
        return None


def sweep_distance(
    model: FaceModel,
    observation: Observation,
    distances: ArrayLike | None = None,
    *,
    modes: int = 70,
    box: float | None = 2.0,
    noise_percent: float = 1.0,
    prior_weight: float | None = None,
    tolerance: float = 1e-8,
    max_steps: int = 100,
    weighting: Weighting = "reprojection",
    method: Method = "joint",
    jacobian: Jacobian = "kaufman",
    als_rounds: int | None = 10,
) -> Sweep:
    """Fits at every distance (D,), metres (default: 49 from 0.2 to 3 m), and orthographic; options as `fit`."""
    options = FitOptions(
        modes, box, noise_percent, prior_weight, tolerance, max_steps,
        weighting, method, jacobian, als_rounds,
    )  # fmt: skip
    grid = (
        np.geomspace(*GRID)
        if distances is None
        else np.unique(checked("distances", distances, (None,)))
    )
    if not len(grid):
        raise ValueError("distances: at least one is needed")
    if grid[0] < NEAREST or grid[-1] > FARTHEST:
        raise ValueError(
            f"distances: {grid[0]:g} to {grid[-1]:g} m is not within {NEAREST:g} to {FARTHEST:g}"
        )
    task = prepare(model, observation, options)
    camera = start_pose(task.problem, 0.0)
    orthographic = solve_from(task, camera, np.zeros(task.problem.modes.shape[2]))
    fits: list[Fit] = []
    last = orthographic
    for t_z in grid[::-1]:  # from far to near: the orthographic fit is the farthest neighbour
        camera = replace(last.camera, kappa=1.0 / float(t_z))
        v = task.problem.mean + task.problem.modes @ last.alpha
        if (depths(camera, v) <= 0).any():  # a wide gap in the grid: start afresh
            camera = start_pose(task.problem, 1.0 / float(t_z))
            last = replace(last, alpha=np.zeros_like(last.alpha))
        last = solve_from(task, camera, last.alpha)
        fits.append(last)
    return Sweep(grid, tuple(fits[::-1]), orthographic)


def _crossing(inside: Fit, outside: Fit, tolerance_percent: float) -> float:
    """Distance between two fits where d_L reaches the tolerance, by bisection in log t_z."""
    task = prepare(inside.model, inside.observation, inside.options)
    near, far = inside, outside
    a, b = (1.0 / fit.camera.kappa for fit in (near, far))
    while abs(np.log(a / b)) > END_TOLERANCE:
        middle = float(np.sqrt(a * b))
        fit = solve_from(task, replace(near.camera, kappa=1.0 / middle), near.alpha)
        if fit.d_l_percent > tolerance_percent:
            b = middle
        else:
            a, near = middle, fit
    return a


def _end_beyond(fit: Fit, tolerance_percent: float) -> float | None:
    """Where d_L crosses the tolerance farther away than `fit`, by doubling the distance; None: nowhere."""
    task = prepare(fit.model, fit.observation, fit.options)
    within = fit.d_l_percent <= tolerance_percent
    while FARTHEST * fit.camera.kappa >= 2.0:
        farther = solve_from(task, replace(fit.camera, kappa=0.5 * fit.camera.kappa), fit.alpha)
        if (farther.d_l_percent <= tolerance_percent) != within:
            inside, outside = (fit, farther) if within else (farther, fit)
            return _crossing(inside, outside, tolerance_percent)
        fit = farther
    return None


__all__: Sequence[str] = ["Interval", "Sweep", "sweep_distance"]
