"""Fits along the camera distance: how d_L hardly changes while the face does (paper, section 6.1).

The grid is uniform in log t_z and ends in the orthographic camera, kappa = 0. The path (path.py) is followed from there
to the nearest distance.

Both ends are checked by fits that know nothing of the path: it begins at one, and where it arrives another is made
from the closed-form pose. If their costs agree the path is taken for the only one; if not, it is followed back from
there as well, the lower of each two fits is kept, and the sweep says where they differed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Array, checked, number, read_only
from .fitting import Fit, FitOptions
from .fitting.result import Jacobian, Method, Weighting
from .fitting.task import FARTHEST, NEAREST, Task, prepare
from .metrics import HUMAN_TOLERANCE_PERCENT
from .model import FaceModel
from .observation import Observation
from .path import at, cold, follow, path_speeds

GRID = (0.2, 3.0, 49)  # metres from, to, steps: the range of the page's slider
END_TOLERANCE = 0.01  # relative, how exactly the ends of an interval are found
STRAIGHT = 20.0  # metres; farther, d_L goes to its limit like 1 / t_z and does not turn (MATH.md 6)
SPEEDS_AT_ONCE = 32  # fits whose surfaces are in memory together
GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
# Two fits at one distance differ if their costs do, relatively by more than the solver's leftover, and by more than
# points a millionth of a pixel off would cause: of a cost of rounding alone no digit agrees
SAME_COST, SAME_PX = 1e-6, 1e-6


@dataclass(frozen=True, slots=True)
class Interval:
    """The distances with d_L below a tolerance, in one piece around the best, metres."""

    low: float | None  # None: open, the nearest distance of the sweep is inside
    high: float | None  # None: open at infinity
    empty: bool  # no distance reaches the tolerance
    best_d_l_percent: float  # least d_L found; if empty the least there is
    tolerance_percent: float
    pieces: int = 1  # of all such distances; only the one that holds the best is told


@dataclass(frozen=True, slots=True, eq=False)
class Sweep:
    """Fits of one observation along the distance. D distances."""

    distances: Array  # (D,) metres, ascending
    fits: tuple[Fit, ...]  # D, perspective
    orthographic: Fit
    # (K,) metres, inf for the orthographic camera: where the two directions ended at different costs, usually nowhere.
    # The lower is kept
    disagreed: Array = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        for name in ("distances", "disagreed"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def d_l_percent(self) -> Array:
        """(D,) landmark error of each fit, percent of the interocular distance."""
        return np.array([fit.d_l_percent for fit in self.fits])

    def nearest(self, distance: float) -> Fit:
        """The fit whose distance is nearest in ratio: a start for a fit at `distance`, metres."""
        distance = number("distance", distance)
        if not 0 < distance < np.inf:
            raise ValueError(f"distance: {distance:g} m is not above 0 and finite")
        return self.fits[int(np.argmin(np.abs(np.log(self.distances / distance))))]

    def speed_mm_per_octave(self, *, progress: Callable[[int], object] | None = None) -> Array:
        """(D,) how fast the face changes at each distance: mm of mean surface movement per doubling of the distance.

        The derivative of d_S: mean over the model's evaluation region of the vertices' velocity along the path, its
        rigid motion taken out, times log 2. From the tangent of each fit, not from differences of the grid: it does
        not depend on the grid. Computed when asked for, 2 to 3 ms a distance; `progress` as in `sweep_distance`.

        Raises
        ------
        ValueError: the fits are no optimum of E (weighting="algebraic", method="als"), so they have no tangent.
        """
        options = self.orthographic.options
        if not options.least_squares:
            raise ValueError(
                f"method: {options.method!r}, weighting {options.weighting!r}: no optimum of E, its path has no "
                "speed; sweep with method='joint'"
            )
        speeds = []
        for k in range(0, len(self.fits), SPEEDS_AT_ONCE):
            fits = self.fits[k : k + SPEEDS_AT_ONCE]
            speeds.append(path_speeds(fits))
            if progress is not None:
                progress(len(fits))
        return np.concatenate(speeds)

    def interval(self, tolerance_percent: float = HUMAN_TOLERANCE_PERCENT) -> Interval:
        """The distances around the best one that the tolerance cannot tell apart, each end to 1 %.

        All distances from the sweep's nearest to infinity count, those beyond its farthest and between its own too:
        a turn of d_L between two distances is looked for where it decides. Ends lie on the inner side. d_L is taken to
        turn once at most between neighbours of the sweep; pieces narrower than 1 % may be missed.
        """
        tolerance = number("tolerance_percent", tolerance_percent)
        if not 0 < tolerance < np.inf:
            raise ValueError(f"tolerance_percent: {tolerance:g} is not above 0 and finite")
        nodes = _with_turns(_to_infinity(self), tolerance)
        d_l = np.array([fit.d_l_percent for fit in nodes])
        inside, best = d_l <= tolerance, int(np.argmin(d_l))
        if not inside[best]:
            return Interval(None, None, True, float(d_l[best]), tolerance, 0)
        first = best
        while first > 0 and inside[first - 1]:
            first -= 1
        last = best
        while last < len(nodes) - 1 and inside[last + 1]:
            last += 1
        low = high = None
        if first > 0:
            low = _crossing(nodes[first], nodes[first - 1], tolerance) or FARTHEST
        if last < len(nodes) - 1:
            high = _crossing(nodes[last], nodes[last + 1], tolerance)
        pieces = int(inside[0]) + int(np.count_nonzero(~inside[:-1] & inside[1:]))
        return Interval(low, high, False, float(d_l[best]), tolerance, pieces)


def sweep_distance(
    model: FaceModel,
    observation: Observation,
    distances: ArrayLike | None = None,
    *,
    modes: int | None = None,
    box: float | None = 2.0,
    noise_percent: float = 1.0,
    prior_weight: float | None = None,
    tolerance: float = 1e-8,
    max_steps: int = 100,
    weighting: Weighting = "reprojection",
    method: Method = "joint",
    jacobian: Jacobian = "kaufman",
    als_rounds: int | None = 10,
    progress: Callable[[int], object] | None = None,
) -> Sweep:
    """Fits at every distance, and orthographic.

    Parameters
    ----------
    distances: (n,) metres in any order, each kept once; None: 49 from 0.2 to 3 m, evenly in ratio. Two neighbours
        may be far apart: the path between them need not be followed closely, only less steps are saved.
    modes, box, noise_percent, prior_weight, tolerance, max_steps, weighting, method, jacobian, als_rounds: as `fit`.
        Answers that are no optimum of E (weighting="algebraic", method="als") cannot be compared by their cost: no
        second direction is tried with them.
    progress: called with the number of distances done since it was last called, such as the `update` of a tqdm bar.

    Raises
    ------
    ValueError: an argument out of range, or points that do not belong to the model.
    """
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
    return sweep_from(task, cold(task, 0.0), grid, progress)


def sweep_from(
    task: Task, first: Fit, grid: Array, progress: Callable[[int], object] | None = None
) -> Sweep:
    """The sweep of a task along distances (D,), ascending, metres, from its orthographic fit."""
    kappas = [0.0, *(1.0 / grid[::-1]).tolist()]
    path = follow(task, kappas, first, progress)
    disagreed: list[float] = []
    if task.options.least_squares and _differ(task, path[-1], arrival := cold(task, kappas[-1])):
        back = follow(task, kappas[::-1], arrival)[::-1]
        pairs = list(zip(path, back, strict=True))
        disagreed = [a.distance or np.inf for a, b in pairs if _differ(task, a, b)]
        path = [b if b.cost < a.cost and _differ(task, a, b) else a for a, b in pairs]
    return Sweep(grid, tuple(path[:0:-1]), path[0], np.array(disagreed[::-1]))


def _differ(task: Task, a: Fit, b: Fit) -> bool:
    slack = SAME_COST * min(a.cost, b.cost) + float(task.problem.weights.sum()) * SAME_PX**2
    return abs(a.cost - b.cost) > max(1.0, task.options.tolerance / 1e-8) * slack


def _to_infinity(sweep: Sweep) -> list[Fit]:
    """The fits from the nearest to the orthographic one; beyond the sweep's farthest, one each doubling."""
    nodes = list(sweep.fits)
    while STRAIGHT * nodes[-1].camera.kappa > 1.0:
        nodes.append(at(nodes[-1], 0.5 * nodes[-1].camera.kappa))
    return [*nodes, sweep.orthographic]


def _with_turns(nodes: list[Fit], tolerance: float) -> list[Fit]:
    """`nodes` and, between them, the turns of d_L that may cross the tolerance where no node does.

    A node on the wrong side of the tolerance that is nearest to it of its neighbours: the turn is beside it.
    """
    d_l = [fit.d_l_percent for fit in nodes]
    found = list(nodes)
    for i in range(len(nodes) - 1):  # the last is infinity, where nothing turns
        beside = [d_l[j] for j in (i - 1, i + 1) if j >= 0]
        dips = d_l[i] > tolerance and d_l[i] <= min(beside)
        rises = i > 0 and d_l[i] <= tolerance and d_l[i] >= max(beside)
        if dips or rises:
            found.append(_turn(nodes[max(i - 1, 0)], nodes[i + 1], 1.0 if dips else -1.0))
    return sorted(found, key=lambda fit: -fit.camera.kappa)


def _turn(near: Fit, far: Fit, sign: float) -> Fit:
    """The fit between two where sign * d_L is least, by golden section in kappa to 1 %."""
    a, b = far.camera.kappa, near.camera.kappa
    x, y = b - GOLDEN * (b - a), a + GOLDEN * (b - a)
    at_x, at_y = at(near, x), at(near, y)
    while b - a > END_TOLERANCE * b:
        if sign * at_x.d_l_percent < sign * at_y.d_l_percent:
            b, y, at_y = y, x, at_x
            x = b - GOLDEN * (b - a)
            at_x = at(at_y, x)
        else:
            a, x, at_x = x, y, at_y
            y = a + GOLDEN * (b - a)
            at_y = at(at_x, y)
    return min(at_x, at_y, key=lambda fit: sign * fit.d_l_percent)


def _crossing(inside: Fit, outside: Fit, tolerance: float) -> float | None:
    """Distance where d_L reaches the tolerance between a fit inside and one outside it; None: beyond FARTHEST.

    By bisection in log t_z; before, if one of the two is orthographic, by doubling the other's distance.
    """
    while True:
        a, b = inside.camera.kappa, outside.camera.kappa
        if min(a, b) > 0 and abs(np.log(a / b)) <= END_TOLERANCE:
            return 1.0 / a
        kappa = float(np.sqrt(a * b)) if min(a, b) > 0 else 0.5 * max(a, b)
        if kappa * FARTHEST < 1.0:
            return None
        fit = at(outside if a == 0 else inside, kappa)
        if fit.d_l_percent <= tolerance:
            inside = fit
        else:
            outside = fit


__all__: Sequence[str] = ["Interval", "Sweep", "sweep_distance"]
