"""fit() and fit_batch(): the face and camera that explain the points of a photograph best."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Literal, cast

import numpy as np

from ..model import FaceModel
from ..observation import Observation
from .batch import Answer, Start, solve_batch
from .result import Failure, Fit, FitOptions, Jacobian, Method, Status, Weighting
from .task import Task, answer, kappa_of, prepare, solve_from, start_of

__all__ = ["Failure", "Fit", "FitOptions", "Status", "fit", "fit_batch"]


def fit(
    model: FaceModel,
    observation: Observation,
    *,
    camera: Literal["perspective", "orthographic"] = "perspective",
    distance: float | None = None,
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
) -> Fit:
    """The face and camera of least cost E (MATH.md 3) for one observation.

    Parameters
    ----------
    camera: "perspective", or "orthographic" for a far-away camera (scaled orthographic projection, paper section 4.1).
    distance: t_z, metres from the camera to the model's origin, held fixed; None lets the fit choose it (perspective).
    modes: shape modes used, the strongest first; None for the strongest 70, or all of a model with fewer.
    box: largest |alpha_j| in standard deviations; None for none.
    noise_percent: landmark noise the prior assumes, sd per coordinate in percent of the interocular distance; it sets
        lambda = sigma^2 in px^2.
    prior_weight: lambda in px^2 itself, instead of noise_percent.
    tolerance: relative cost above the optimum that still counts as converged.
    weighting: "reprojection", pixels in the picture; or "algebraic", the paper's DLT residual, Z_i (x_i - xhat_i) over
        the held t_z (over 1 m if free), always solved by SNLS, whose own value `status` is then about. *Biased*: it
        rewards moving the face nearer. A free distance, held to 0.1 to 100 m, comes out at about 0.75 of the truth from
        30 cm, 0.2 from 2.4 m, less with noise, and at 0.1 m with neither box nor prior (MATH.md 2.1). At a given
        distance E is mostly within 0.2 % of its least value. Under an orthographic camera the two weightings are one.
    method: "joint"; "snls", the paper's separable least squares, under perspective on the DLT and from there on E, with
        the same optimum; or "als", the paper's baseline, pose and shape in turn, which stops short of it.
    jacobian: of SNLS, Kaufman's or in full (Golub and Pereyra), with the same optimum.
    als_rounds: rounds of "als"; None for rounds until one gains less than `tolerance`, at most max_steps.

    Raises
    ------
    ValueError: an argument out of range, points that do not belong to the model, or that show the face from behind, as
        with left and right exchanged, in a mirrored picture or with y counted upward.

    Notes
    -----
    Joint Gauss-Newton on shape and camera with a box QP a step (fitting/solve.py), from a closed-form pose; the paper's
    own solvers are in fitting/separable.py and fitting/als.py. `cost` is E for all of them, so they can be compared.
    """
    options = FitOptions(
        modes, box, noise_percent, prior_weight, tolerance, max_steps,
        weighting, method, jacobian, als_rounds,
    )  # fmt: skip
    kappa = kappa_of(camera, distance)
    task = prepare(model, observation, options)
    free = camera == "perspective" and distance is None
    return solve_from(task, *start_of(task, kappa), free)


def fit_batch(
    model: FaceModel,
    observations: Iterable[Observation],
    *,
    camera: Literal["perspective", "orthographic"] = "perspective",
    distance: float | Sequence[float] | None = None,
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
    n_jobs: int = 1,
    progress: Callable[[int], object] | None = None,
) -> tuple[Fit | Failure, ...]:
    """The fits of many observations, in order: those of `fit`, one by one, in half the time.

    A face that cannot be fitted, points from behind or a scheme that the model lacks, has a `Failure` in its row and
    stops nothing; wrong options are a ValueError, as in `fit`.

    Parameters
    ----------
    distance: one for all, or one for each observation.
    n_jobs: processes; -1 for all cores. More than one need joblib (`pip install "faceambig[batch]"`), whose backends
        serve: `with joblib.parallel_config(backend="dask"): ...` sends the work to a cluster.
    progress: called with the number of faces done since it was last called, such as the `update` of a tqdm bar.
    camera, modes, ...: as `fit`.
    """
    options = FitOptions(
        modes, box, noise_percent, prior_weight, tolerance, max_steps,
        weighting, method, jacobian, als_rounds,
    )  # fmt: skip
    options.modes_of(model)  # wrong for one, wrong for all
    observations = list(observations)
    if distance is None or isinstance(distance, str) or np.ndim(distance) == 0:
        kappas = [kappa_of(camera, cast("float | None", distance))] * len(observations)
    else:
        kappas = [kappa_of(camera, each) for each in cast("Sequence[float]", distance)]
    if len(kappas) != len(observations):
        raise ValueError(f"distance: {len(kappas)} for {len(observations)} observations")
    free = camera == "perspective" and distance is None
    rows: list[Task | Failure] = []
    starts: list[Start] = []
    for observation, kappa in zip(observations, kappas, strict=True):
        try:
            task = prepare(model, observation, options)
        except ValueError as error:
            rows.append(Failure(observation, str(error)))
        else:
            rows.append(task)
            problem = replace(task.problem, free_distance=True) if free else task.problem
            starts.append(Start(problem, *start_of(task, kappa)))
    solved = iter(solve_batch(starts, options, n_jobs=n_jobs, progress=progress))
    return tuple(row if isinstance(row, Failure) else _row(row, next(solved)) for row in rows)


def _row(task: Task, solved: Answer) -> Fit | Failure:
    if isinstance(solved, ValueError):
        return Failure(task.observation, str(solved))
    return answer(task, solved)
