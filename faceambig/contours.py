"""Fits to contours, where the surface turns away from the camera (paper, section 5; MATH.md 5).

What is visible of the occluding boundary (boundary.py) is drawn in a picture as an edge, but which pixel belongs to
which vertex is not known: nearest neighbours are paired, the face is fitted to landmarks and pairs together, and both
are repeated. The pairs hardly ever come to rest, so the surface decides.

Contours help at the right distance, in the mean and as far as the model can make the face; at a wrong distance they
pull it further from the truth (benchmarks/contours.py).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from .arrays import Array, IntArray, checked, number, positive, read_only, whole
from .boundary import occluding_boundary
from .camera import Camera, project
from .fitting import Fit, FitOptions
from .fitting.problem import Problem, cost
from .fitting.solve import Solution
from .fitting.task import Task, answer, kappa_of, prepare, solve_by, start_of
from .model import FaceModel
from .observation import LARGEST_PX, Observation

SETTLED_MM = 0.05  # mean movement of the surface in one iteration that ends them
WORST = 0.05  # share of the pairs that is dropped, those farthest apart
FARTHEST_PERCENT = 15.0  # of the interocular distance, of the points of a pair, if not given


class ContourStatus(StrEnum):
    """How the iterations of a contour fit ended."""

    SETTLED = "settled"  # the surface moved less than 0.05 mm
    CYCLE = "cycle"  # a set of pairs returned; the fit of least cost among those in between is kept
    MAX_ITERATIONS = "iteration limit reached"
    NO_CONTOUR = "no contour found"  # no pair: the fit is that of the landmarks alone


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """Contour vertices and the edge points they were matched with. P pairs."""

    vertices: IntArray  # (P,) vertex numbers of the model
    points: Array  # (P, 2) pixels, as the edges were given

    def __post_init__(self) -> None:
        for name in ("vertices", "points"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    def __len__(self) -> int:
        return len(self.vertices)


@dataclass(frozen=True, slots=True, eq=False)
class ContourFit:
    """A face fitted to landmarks and contours. I iterations, P pairs."""

    fit: Fit  # its observation, residual, d_L and cost are those of the landmarks, its status that of the last refit
    pairs: Pairs  # that the face was fitted to
    pair_weight: float  # of each, beside landmarks of weight 1
    status: ContourStatus
    movement_mm: Array  # (I,) mean movement of the surface's vertices in each iteration
    cost: float  # E of MATH.md 3 over landmarks and pairs, px^2

    def __post_init__(self) -> None:
        object.__setattr__(self, "movement_mm", read_only(self.movement_mm))

    @property
    def iterations(self) -> int:
        """I, how often the face was fitted to pairs."""
        return len(self.movement_mm)

    @property
    def observation(self) -> Observation:
        """Landmarks and pairs by their vertex numbers: with `fit.prior_weight` its fit is this face again."""
        seen = self.fit.observation
        weights = np.ones(len(seen.points)) if seen.weights is None else seen.weights
        return Observation(
            np.concatenate([seen.points, self.pairs.points]),
            np.concatenate([seen.vertices(self.fit.model), self.pairs.vertices]),
            image_size=seen.image_size,
            principal_point=(float(seen.centre[0]), float(seen.centre[1])),
            weights=np.concatenate([weights, np.full(len(self.pairs), self.pair_weight)]),
        )


def contour_fit(
    model: FaceModel,
    observation: Observation,
    edges: ArrayLike,
    *,
    camera: Literal["perspective", "orthographic"] = "perspective",
    distance: float | None = None,
    max_distance_px: float | None = None,
    pair_weight: float = 1.0,
    max_iterations: int = 60,
    modes: int | None = None,
    box: float | None = 2.0,
    noise_percent: float = 1.0,
    prior_weight: float | None = None,
    tolerance: float = 1e-8,
    max_steps: int = 100,
) -> ContourFit:
    """The face and camera that explain landmarks and the edges of a picture (paper, section 5).

    Starts from the fit to the landmarks. An iteration finds the visible occluding boundary of the last face, pairs
    each of its vertices with an edge point if each is the other's nearest and they are near enough, drops the worst
    5 % of the pairs, and fits again; landmarks are always kept. It ends when the surface moves less than 0.05 mm, or a
    set of pairs returns, or at the limit: `status` says which.

    Parameters
    ----------
    edges: (E, 2) pixels, such as `io.edges.canny_edges` finds; in the coordinates of the landmarks.
    max_distance_px: pixels between the points of a pair; None for 15 % of the interocular distance.
    pair_weight: of each pair, beside landmarks of weight 1. Pairs are many, some 400, and known in one direction only.
    max_iterations: 5 to 30 are usual at the right distance; at a wrong one the pairs may never come to rest.
    camera, distance, modes, box, noise_percent, prior_weight, tolerance, max_steps: as `fit`.

    Raises
    ------
    ValueError: an argument out of range, or landmarks that `fit` refuses.
    """
    options = FitOptions(modes, box, noise_percent, prior_weight, tolerance, max_steps)
    pixels = _edges(edges)
    pair_weight = number("pair_weight", pair_weight)
    if not 1e-6 <= pair_weight <= 1e6:
        raise ValueError(f"pair_weight: {pair_weight:g} is not within 1e-06 to 1e+06")
    most = whole("max_iterations", max_iterations)
    if most < 1:
        raise ValueError(f"max_iterations: {most} is not at least 1")
    kappa = kappa_of(camera, distance)
    task = prepare(model, observation, options)
    reach = _reach(max_distance_px, task)
    if camera == "perspective" and distance is None:
        task = replace(task, problem=replace(task.problem, free_distance=True))
    start = solve_by(task.problem, *start_of(task, kappa), options)
    tree = cKDTree(pixels - observation.centre)
    status, rounds, movement = _iterated(task, start, tree, reach, pair_weight, most)
    best, pairs = start, Pairs(np.zeros(0, dtype=np.intp), np.zeros((0, 2)))
    if rounds:
        one = rounds[-1]
        if status is ContourStatus.CYCLE:
            one = min(rounds, key=lambda each: each.solution.cost)
        best, pairs = one.solution, Pairs(one.vertices, pixels[one.rows])
    fit = replace(answer(task, best), cost=cost(task.problem, best.camera, best.alpha))
    return ContourFit(fit, pairs, pair_weight, status, np.array(movement), best.cost)


class _Round(NamedTuple):
    name: bytes  # of its set of pairs
    vertices: IntArray  # (P,)
    rows: IntArray  # (P,) of the edges
    solution: Solution


def _iterated(
    task: Task, start: Solution, tree: cKDTree, reach: float, weight: float, most: int
) -> tuple[ContourStatus, list[_Round], list[float]]:
    """Rounds of pairing and fitting from the fit to the landmarks on, and the surface's movements, mm.

    Of a cycle the rounds that return; none where there is no contour.
    """
    model, best, surface = task.model, start, task.model.vertices(start.alpha)
    rounds: list[_Round] = []
    movement: list[float] = []
    for _ in range(most):
        vertices, rows = match(model, surface, best.camera, tree, reach)
        if not len(vertices):
            return ContourStatus.NO_CONTOUR, [], movement
        name = vertices.tobytes() + rows.tobytes()
        again = next((i for i, each in enumerate(rounds) if each.name == name), None)
        if again is not None:
            rounds = rounds[again:]
            ended = ContourStatus.CYCLE if len(rounds) > 1 else ContourStatus.SETTLED
            return ended, rounds, movement
        problem = _with_pairs(task, model, vertices, tree.data[rows], weight)
        best = solve_by(problem, best.camera, best.alpha, task.options)
        rounds.append(_Round(name, vertices, rows, best))
        before, surface = surface, model.vertices(best.alpha)
        movement.append(1e3 * float(np.linalg.norm(surface - before, axis=1).mean()))
        if movement[-1] < SETTLED_MM:
            return ContourStatus.SETTLED, rounds, movement
    return ContourStatus.MAX_ITERATIONS, rounds, movement


def match(
    model: FaceModel, surface: Array, camera: Camera, tree: cKDTree, reach: float
) -> tuple[IntArray, IntArray]:
    """Pairs (P,) of visible contour vertices of a surface and rows of the tree's points, pixels from the centre."""
    boundary = occluding_boundary(model, surface, camera)
    vertices = boundary.vertices[boundary.visible]
    xy = project(camera, surface[vertices])
    gaps, rows = _nearest(tree, xy, reach)
    near = (gaps < reach).nonzero()[0]
    if not len(near):
        return near, near
    _, back = _nearest(cKDTree(xy), tree.data[rows[near]])
    mutual = near[back == near]
    kept = len(mutual) - int(WORST * len(mutual))
    mutual = np.sort(mutual[np.argsort(gaps[mutual], kind="stable")[:kept]])
    return vertices[mutual], rows[mutual]


def _nearest(tree: cKDTree, points: Array, reach: float = np.inf) -> tuple[Array, IntArray]:
    """Distance (n,) and row (n,) of the nearest point of the tree; beyond `reach` infinity."""
    gaps, rows = tree.query(points, distance_upper_bound=reach)
    return np.asarray(gaps, dtype=np.float64), np.asarray(rows, dtype=np.intp)


def _with_pairs(
    task: Task, model: FaceModel, vertices: IntArray, points: Array, weight: float
) -> Problem:
    """The task's problem with pairs of vertices (P,) and points (P, 2) below its landmarks.

    Not by an Observation: every iteration has pairs of its own, which no cache need remember, and the prior's weight
    and the start stay those of the landmarks.
    """
    problem = task.problem
    mean, modes = model.rows(vertices)
    return replace(
        problem,
        points=np.concatenate([problem.points, points]),
        weights=np.concatenate([problem.weights, np.full(len(points), weight)]),
        mean=np.concatenate([problem.mean, mean]),
        modes=np.concatenate([problem.modes, modes[:, :, : problem.modes.shape[2]]]),
    )


def _edges(edges: ArrayLike) -> Array:
    pixels = checked("edges", edges, (None, 2))
    largest = float(np.abs(pixels).max(initial=0.0))
    if largest > LARGEST_PX:
        raise ValueError(f"edges: {largest:g} is not within {LARGEST_PX:g} pixels")
    return np.unique(pixels, axis=0) if len(pixels) else pixels


def _reach(max_distance_px: float | None, task: Task) -> float:
    if max_distance_px is None:
        return FARTHEST_PERCENT / 100 * task.interocular_px
    return positive("max_distance_px", max_distance_px)
