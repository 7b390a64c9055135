"""The path of the fits of one observation along the camera distance, and how fast the face changes on it.

Each fit starts from its neighbours: only kappa changes, in the unified camera nothing else needs rescaling (MATH.md 6),
and the way of the last three fits is carried on, which saves a third of the steps.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from .arrays import Array
from .camera import Camera
from .fitting import Fit
from .fitting.problem import cost
from .fitting.tangent import tangent
from .fitting.task import Task, prepare, solve_from, start_of
from .rotation import rotation_matrix

WIDEST = 1.5  # of the last step: a next one wider than that is not extrapolated to


def follow(
    task: Task,
    kappas: Sequence[float],
    first: Fit,
    progress: Callable[[int], object] | None = None,
) -> list[Fit]:
    """Fits at `kappas`, per metre, each from those before it; `first` is the one at kappas[0]."""
    path = [first]
    for kappa in kappas[1:]:
        path.append(_next(task, path[-3:], kappa))
        if progress is not None:
            progress(1)
    return path


def _next(task: Task, last: Sequence[Fit], kappa: float) -> Fit:
    """The fit at kappa after `last`; where it does not converge, the best of other starts that does.

    Where the shape is hardly held, a path ends at a fold, and what lies beyond is far away.
    """
    fit = solve_from(task, *_start(task, last, kappa))
    if fit.converged or not task.options.least_squares:
        return fit
    starts = (replace(last[-1].camera, kappa=kappa), last[-1].alpha), start_of(task, kappa)
    others = [solve_from(task, *start) for start in starts if cost(task.problem, *start) < np.inf]
    return min(
        (other for other in others if other.converged), key=lambda other: other.cost, default=fit
    )


def cold(task: Task, kappa: float) -> Fit:
    """The fit at kappa, per metre, from the closed-form pose, which knows no other."""
    return solve_from(task, *start_of(task, kappa))


def _start(task: Task, last: Sequence[Fit], kappa: float) -> tuple[Camera, Array]:
    """Where a fit at kappa starts: the polynomial through the last fits, one to three, or the last one, or afresh.

    A polynomial carried far beyond its points ends anywhere: a step much wider than the last starts from its neighbour.
    Nor one through fits between which the path has leapt: then the neighbour itself costs less. The tangent of the
    path would save no more steps, and costs two.
    """
    still = last[-1]
    step, gap = kappa - still.camera.kappa, still.camera.kappa - last[-2:][0].camera.kappa
    starts = [(replace(still.camera, kappa=kappa), still.alpha)]
    if gap and 0 < step / gap <= WIDEST:
        starts.insert(0, _carried_on(last, kappa))
    costs = [cost(task.problem, *start) for start in starts]
    if min(costs) == np.inf:  # behind the camera
        return start_of(task, kappa)
    return starts[int(np.argmin(costs))]


def _carried_on(last: Sequence[Fit], kappa: float) -> tuple[Camera, Array]:
    """Camera and shape at kappa of the polynomial in kappa through the last fits, two or three, oldest first."""
    *before, still = last
    camera, at = still.camera, [fit.camera.kappa for fit in last]
    # Added to the last fit: what does not change between fits, coefficients on the box, stays to the last digit
    alpha, t, log_s, turn = still.alpha.copy(), camera.t.copy(), 0.0, np.zeros((3, 3))
    for a, fit in zip(at, before, strict=False):
        weight = math.prod((kappa - b) / (a - b) for b in at if b != a)  # Lagrange's
        alpha += weight * (fit.alpha - still.alpha)
        t += weight * (fit.camera.t - camera.t)
        log_s += weight * math.log(fit.camera.s / camera.s)
        turn += weight * fit.camera.R
    turn = turn @ camera.R.T  # of small angles: its antisymmetric part is the rotation
    d = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    box = still.options.box
    if box is not None:
        alpha = alpha.clip(-box, box)
    return Camera(rotation_matrix(d) @ camera.R, t, camera.s * math.exp(log_s), kappa), alpha


def at(fit: Fit, kappa: float) -> Fit:
    """The fit at kappa on the path through `fit`."""
    task = prepare(fit.model, fit.observation, fit.options)
    return solve_from(task, *_start(task, [fit], kappa))


def path_speeds(fits: Sequence[Fit]) -> Array:
    """Speed (D,) of the face along the path through each of `fits`, of one task: `Sweep.speed_mm_per_octave`."""
    task, model = prepare(fits[0].model, fits[0].observation, fits[0].options), fits[0].model
    # (S, D, 2) shape and velocity of all at once: the modes are read from memory once, not once a fit
    changes = np.zeros((model.n_modes, len(fits), 2))
    for k, fit in enumerate(fits):
        S = len(fit.alpha)
        changes[:S, k, 0] = fit.alpha
        changes[:S, k, 1] = tangent(task.problem, fit.camera, fit.alpha)[:S]
    flat = model.control_modes.reshape(-1, model.n_modes) @ changes.reshape(model.n_modes, -1)
    surface = model.refine(flat.reshape(len(model.control_mean), -1)).reshape(-1, 3, len(fits), 2)
    mean = model.mean
    if model.evaluation is not None:
        surface, mean = surface[model.evaluation], mean[model.evaluation]
    unrigid = [_unrigid(mean + surface[:, :, k, 0], surface[:, :, k, 1]) for k in range(len(fits))]
    return 1e3 * np.log(2.0) * np.array([np.linalg.norm(gap, axis=1).mean() for gap in unrigid])


def _unrigid(shape: Array, velocity: Array) -> Array:
    """`velocity` (E, 3) of the points `shape` (E, 3) without the rigid one a + w x shape nearest to it.

    Procrustes to first order.
    """
    centred, velocity = shape - shape.mean(axis=0), velocity - velocity.mean(axis=0)
    spread = centred.T @ centred
    inertia = np.trace(spread) * np.eye(3) - spread
    twist = centred.T @ velocity
    x, y, z = np.linalg.solve(
        inertia, [twist[1, 2] - twist[2, 1], twist[2, 0] - twist[0, 2], twist[0, 1] - twist[1, 0]]
    )
    return velocity - centred @ np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
