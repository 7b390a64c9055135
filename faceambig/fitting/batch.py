"""Many faces at once: descents of the same landmarks side by side, chunks of them in several processes.

Each face runs its own `descent` of solve.py, so a batch gives the fits that `solve` gives one by one. What the descents
ask for is computed together: there the calls of NumPy, not the arithmetic, are half the time of a single fit.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import repeat
from typing import Any, NamedTuple

import numpy as np

from ..arrays import Array, whole
from ..camera import Camera, Seen, View
from ..rotation import rotation_matrix
from .boxqp import Pass, passes
from .problem import POSE, Point, Problem, gradient, normal_equations, residuals
from .result import FitOptions
from .solve import First, Gradient, Linearised, Solution, Trial, descent
from .task import solve_by

CHUNK = 32  # faces side by side: their J fill 3 MB; fewer cost more calls, more leave the cache

ORDER = (First, Pass, Trial, Gradient, Linearised)


class Start(NamedTuple):
    """One face to fit."""

    problem: Problem
    camera: Camera
    alpha: Array  # (S,)


Answer = Solution | ValueError  # the error of a face that cannot be fitted stands in its row


def solve_batch(
    starts: Sequence[Start],
    options: FitOptions,
    *,
    n_jobs: int,
    progress: Callable[[int], object] | None,
) -> list[Answer]:
    """As `solve_by` for every start, in order. `progress` hears how many faces are done since it last heard."""
    if whole("n_jobs", n_jobs) == 0:
        raise ValueError("n_jobs: 0 is no number of processes; give 1 or more, or -1 for all cores")
    alike: dict[tuple[int, float, bool], list[int]] = defaultdict(list)
    for row, (problem, _, _) in enumerate(starts):
        alike[id(problem.modes), problem.box, problem.free_distance].append(row)
    chunks = [
        rows[first : first + CHUNK]
        for rows in alike.values()
        for first in range(0, len(rows), CHUNK)
    ]
    answers: list[Answer] = [ValueError("not solved")] * len(starts)
    jobs = ([starts[row] for row in rows] for rows in chunks)
    for rows, solved in zip(chunks, _run(jobs, options, n_jobs), strict=True):
        for row, answer in zip(rows, solved, strict=True):
            answers[row] = answer
        if progress is not None:
            progress(len(rows))
    return answers


def _run(jobs: Iterable[list[Start]], options: FitOptions, n_jobs: int) -> Iterator[list[Answer]]:
    if n_jobs == 1:
        return (_solve_chunk(job, options) for job in jobs)
    try:
        from joblib import Parallel, delayed
    except ImportError as error:
        raise ValueError(
            f"n_jobs: {n_jobs} processes need joblib; pip install 'faceambig[batch]'"
        ) from error
    work = delayed(_solve_chunk)
    parallel: Any = Parallel(n_jobs=n_jobs, return_as="generator")
    return iter(parallel(work(job, options) for job in jobs))


def _solve_chunk(starts: Sequence[Start], options: FitOptions) -> list[Answer]:
    if options.method == "joint" and options.weighting == "reprojection":
        return solve_together(starts, options.tolerance, options.max_steps)
    answers: list[Answer] = []
    for start in starts:
        try:
            answers.append(solve_by(*start, options))
        except ValueError as error:
            answers.append(error)
    return answers


def solve_together(starts: Sequence[Start], tolerance: float, max_steps: int) -> list[Answer]:
    """As `solve` for faces of the same landmarks, modes and box, a row each."""
    many = _together([start.problem for start in starts])
    works = [descent(*start, tolerance, max_steps) for start in starts]
    answers: list[Answer] = [ValueError("not solved")] * len(works)
    asked: dict[type, dict[int, Any]] = {kind: {} for kind in ORDER}

    def go_on(row: int, said: Any) -> None:
        try:
            request = works[row].send(said)
            asked[type(request)][row] = request
        except StopIteration as end:
            answers[row] = end.value
        except ValueError as error:
            answers[row] = error

    for row in range(len(works)):
        go_on(row, None)
    # The small questions first, until all faces are at the large ones: those are answered for all together
    while kind := next((kind for kind in ORDER if asked[kind]), None):
        requests, asked[kind] = dict(sorted(asked[kind].items())), {}
        for row, said in zip(requests, _say(many, kind, requests), strict=True):
            go_on(row, said)
    return answers


def _say(many: Problem, kind: type, requests: dict[int, Any]) -> list[Any]:
    """What each row asked for, all of one kind, in one computation."""
    if kind is Pass:
        return passes(list(requests.values()))
    part = many if len(requests) == len(many.points) else _rows(many, list(requests))
    if kind is First:
        alpha, views = zip(*requests.values(), strict=True)
        return _points(part, np.stack(alpha), _stacked(views))
    points = [request.point for request in requests.values()]
    alpha = np.stack([point.alpha for point in points])
    view = _stacked([point.view for point in points])
    if kind is Trial:
        step = np.stack([length * delta for _, delta, length in requests.values()])
        return _points(part, *_moved(alpha, view, step))
    q, z, xy, _ = zip(*(point.seen for point in points), strict=True)
    seen = Seen(np.stack(q), np.stack(z), np.stack(xy), None)
    e = np.stack([point.e for point in points])
    if kind is Gradient:
        return list(gradient(part, alpha, view, seen, e))
    return list(zip(*normal_equations(part, alpha, view, seen, e), strict=True))


def _moved(alpha: Array, view: View, step: Array) -> tuple[Array, View]:
    """Faces and cameras after steps (F, n): moved_view for many."""
    S = alpha.shape[1]
    pose = step[:, S:]
    R, t, s, kappa = view
    if pose.shape[1] > POSE:
        kappa = np.maximum(0.0, kappa + pose[:, POSE:])
    R = np.stack([rotation_matrix(d) for d in pose[:, :3]]) @ R
    return alpha + step[:, :S], View(R, t + pose[:, None, 3:5], s * np.exp(pose[:, 5:6]), kappa)


def _points(part: Problem, alpha: Array, view: View) -> list[Point]:
    seen, e, E = residuals(part, alpha, view)
    R, t, s, kappa = view
    views = map(View, R, t[:, 0], np.ravel(s).tolist(), np.ravel(kappa).tolist())
    each = map(Seen, seen.q, seen.z, seen.xy, repeat(None))  # the cost says who is behind
    return list(map(Point, alpha, views, each, e, E.tolist()))


def _together(problems: Sequence[Problem]) -> Problem:
    return replace(
        problems[0],
        points=np.stack([problem.points for problem in problems]),
        weights=np.stack([problem.weights for problem in problems]),
        prior_weight=np.array([[problem.prior_weight] for problem in problems]),
    )


def _rows(many: Problem, rows: list[int]) -> Problem:
    return replace(
        many,
        points=many.points[rows],
        weights=many.weights[rows],
        prior_weight=np.asarray(many.prior_weight)[rows],
    )


def _stacked(views: Sequence[View]) -> View:
    R, t, s, kappa = zip(*views, strict=True)
    return View(np.stack(R), np.stack(t)[:, None], np.array(s)[:, None], np.array(kappa)[:, None])
