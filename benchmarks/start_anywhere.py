"""How often one closed-form start reaches the best optimum of many starts: no pose, no focal length is given.

`python benchmarks/start_anywhere.py [--cases 1000] [--starts 10] [--json] [--check]`: ICT-FaceKit if FACEAMBIG_ICT
names its folder, else the embedded head; ten minutes. A case counts as found if its cost is at most 1e-6 (relative)
above the best of all starts: the closed form, the truth's pose with the mean face, the pose mirrored in depth, and
turned by 30 to 60 degrees with random shape, scale and (free) distance. Misses are printed with seed and pose.

Cases: yaw within 75, pitch 40, roll 60 degrees, 0.25 to 5 m, off the middle by up to one eye distance, noise 0 to 2 px
at 100 px between the eyes; the fitting distance within a factor e of the truth, at least 0.2 m; shapes of all modes.
The last table counts how often points are refused as those of a face from behind: rightly, with left and right
exchanged, the picture mirrored or y upward, and wrongly, as drawn or upside down.

--check fails below 99.8 % in any row of the first table, and if one of its cases is refused wrongly or not refused.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

import faceambig as fa
from faceambig.camera import Camera, depths, project
from faceambig.fitting.problem import Problem
from faceambig.fitting.solve import Solution, solve
from faceambig.fitting.start import start_pose
from faceambig.fitting.task import FIRST_KAPPA, prepare
from faceambig.observation import portrait_camera
from faceambig.rotation import rotation_from_angles, rotation_matrix

CASES, STARTS = 1000, 10
EXCESS = 1e-6  # relative cost above the best start that still counts as the same optimum
PROMISED = 0.998
LAMBDAS = (1.0, 0.01)  # px^2
KINDS = ("fixed", "free", "orthographic")
FEW, FEW_CASES = (6, 8, 12), 200
ODD_CASES = 200
RIGHT = ("as drawn", "picture upside down")  # the rest of `damaged` is wrong
SIDE = 500  # pixels of the picture's side, 5 eye distances


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """One synthetic photograph and what nobody tells the fit."""

    seed: int
    observation: fa.Observation
    camera: Camera  # the truth
    fitted: float  # metres, the distance of a fixed fit
    about: str


def draw(
    model: fa.FaceModel,
    seed: int,
    *,
    points: int | None = None,
    yaw: tuple[float, float] = (0.0, 75.0),
    roll: tuple[float, float] = (0.0, 60.0),
) -> Case:
    """Case `seed`: |yaw| and |roll| within the ranges, in degrees; `points` of the 68 visible, None: all."""
    rng = np.random.default_rng(seed)
    face = fa.Subject("drawn", "", model.vertices(rng.standard_normal(model.n_modes)), None, model)
    actual = float(np.exp(rng.uniform(np.log(0.25), np.log(5.0))))
    fitted = max(0.2, actual * float(np.exp(rng.uniform(-1, 1))))
    signs = rng.choice([-1.0, 1.0], 2)
    angles = (signs[0] * rng.uniform(*yaw), rng.uniform(-40, 40), signs[1] * rng.uniform(*roll))
    noise = rng.uniform(0, 2)
    frontal = portrait_camera(face, distance=actual)
    shift = rng.uniform(-1, 1, 2) * 100 / frontal.s
    camera = replace(frontal, R=rotation_from_angles(*angles), t=shift)
    vertices = model.scheme("ibug68").vertices
    x = project(camera, face.vertices[vertices]) + 0.5 * SIDE
    x += rng.normal(scale=noise, size=x.shape)
    if points is not None:
        x[rng.permutation(len(x))[points:]] = np.nan
    about = (
        f"yaw {angles[0]:.0f} pitch {angles[1]:.0f} roll {angles[2]:.0f} deg, {actual:.2f} m, "
        f"fitted at {fitted:.2f} m, noise {noise:.1f} px"
    )
    return Case(seed, fa.Observation(x, "ibug68", (SIDE, SIDE)), camera, fitted, about)


def other_starts(
    case: Case, problem: Problem, start: Camera, count: int, rng: np.random.Generator
) -> Iterator[tuple[Camera, np.ndarray]]:
    """`count` cameras in front of the face, and shapes inside the box."""
    S = problem.modes.shape[2]
    kappa = case.camera.kappa if problem.free_distance else start.kappa
    given = [replace(case.camera, kappa=kappa), mirrored_in_depth(start)]
    for camera in given[:count]:
        yield (camera if in_front(problem, camera, np.zeros(S)) else start), np.zeros(S)
    made = len(given)
    while made < count:
        axis = rng.standard_normal(3)
        turn = rotation_matrix(np.radians(rng.uniform(30, 60)) * axis / np.linalg.norm(axis))
        kappa = 1 / float(np.exp(rng.uniform(np.log(0.2), np.log(5.0))))
        camera = Camera(
            turn @ start.R,
            start.t,
            start.s * float(np.exp(rng.uniform(-0.5, 0.5))),
            kappa if problem.free_distance else start.kappa,
        )
        alpha = rng.uniform(-1, 1, S) * problem.box
        if in_front(problem, camera, alpha):
            made += 1
            yield camera, alpha


def mirrored_in_depth(camera: Camera) -> Camera:
    """The second pose of a flat face: its plane tilted the other way, nearly the same picture from far away."""
    x, y = camera.R[:2, 2]  # the nose's direction in the picture; its depth changes sign
    tilt = float(np.arctan2(np.hypot(x, y), -camera.R[2, 2]))
    if tilt == 0:
        return camera
    axis = np.array([y, -x, 0.0]) / np.hypot(x, y)
    candidates = [rotation_matrix(sign * 2 * tilt * axis) @ camera.R for sign in (1, -1)]
    return replace(camera, R=min(candidates, key=lambda R: R[:2, 2] @ camera.R[:2, 2]))


def in_front(problem: Problem, camera: Camera, alpha: np.ndarray) -> bool:
    return bool(depths(camera, problem.mean + problem.modes @ alpha).min() > 0)


def compare(case: Case, problem: Problem, kind: str, count: int) -> tuple[Solution, np.ndarray]:
    """The fit from the closed form, and the costs reached from `count` other starts."""
    problem = replace(problem, free_distance=kind == "free")
    kappa = {"fixed": 1 / case.fitted, "free": FIRST_KAPPA, "orthographic": 0.0}[kind]
    start = start_pose(problem, kappa)
    ours = solve(problem, start, np.zeros(problem.modes.shape[2]))
    rng = np.random.default_rng([case.seed, KINDS.index(kind)])
    others = other_starts(case, problem, start, count, rng)
    return ours, np.array([solve(problem, camera, alpha).cost for camera, alpha in others])


@dataclass(slots=True)
class Tally:
    """One line of a table."""

    cases: int = 0
    found: int = 0
    converged: int = 0
    steps: int = 0
    reached: int = 0  # other starts that came to the best cost too
    others: int = 0
    worst: float = 0.0  # largest excess


def measure(
    model: fa.FaceModel,
    cases: Iterator[Case],
    starts: int,
    lambdas: tuple[float, ...] = LAMBDAS,
) -> tuple[dict[tuple[str, float], Tally], list[str]]:
    """Tallies by kind of fit and lambda, and every miss in words."""
    tallies = {(kind, lam): Tally() for kind in KINDS for lam in lambdas}
    misses: list[str] = []
    for case in cases:
        for (kind, lam), tally in tallies.items():
            try:
                problem = prepare(model, case.observation, fa.FitOptions(prior_weight=lam)).problem
            except ValueError as error:
                tally.cases += 1
                misses.append(f"seed {case.seed}: {error}; {case.about}")
                continue
            ours, costs = compare(case, problem, kind, starts)
            best = min(ours.cost, costs.min())
            excess = ours.cost / best - 1
            tally.cases += 1
            tally.found += excess <= EXCESS
            tally.converged += ours.status == "converged"
            tally.steps += ours.steps
            tally.others += len(costs)
            tally.reached += int(np.count_nonzero(costs <= best * (1 + EXCESS)))
            tally.worst = max(tally.worst, excess)
            if excess > EXCESS or ours.status != "converged":
                misses.append(
                    f"seed {case.seed} {kind} lambda {lam:g}: E {ours.cost:.6g}, {excess:.1e} above "
                    f"the best, {ours.status} after {ours.steps} steps; {case.about}"
                )
    return tallies, misses


def damaged(model: fa.FaceModel, x: np.ndarray) -> dict[str, np.ndarray]:
    """The points (68, 2) as drawn, turned by half, and three ways to get them wrong."""
    mean = model.mean[model.scheme("ibug68").vertices]
    partner = np.linalg.norm(mean[:, None] - mean * [-1, 1, 1], axis=2).argmin(axis=0)
    return {
        "as drawn": x,
        "left and right exchanged": x[partner],
        "picture mirrored": x * [-1, 1] + [SIDE, 0],
        "y upward": x * [1, -1] + [0, SIDE],
        "picture upside down": SIDE - x,
    }


def refusals(model: fa.FaceModel, cases: Iterator[Case]) -> dict[str, list[int]]:
    """[refused, all] by what was done to the points."""
    counts: dict[str, list[int]] = {}
    for case in cases:
        for name, x in damaged(model, case.observation.points).items():
            count = counts.setdefault(name, [0, 0])
            count[1] += 1
            try:
                prepare(model, fa.Observation(x, "ibug68", (SIDE, SIDE)), fa.FitOptions())
            except ValueError:
                count[0] += 1
    return counts


def main() -> int:
    """Print the tables."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--cases", type=int, default=CASES)
    arguments.add_argument("--starts", type=int, default=STARTS)
    arguments.add_argument("--json", action="store_true")
    arguments.add_argument("--check", action="store_true")
    options = arguments.parse_args()
    model = fa.load_model("ict" if os.environ.get("FACEAMBIG_ICT") else "embedded")
    n = options.cases

    def some(count: int, first: int, **ranges: object) -> Callable[[], Iterator[Case]]:
        count = min(count, n)
        return lambda: (draw(model, first + seed, **ranges) for seed in range(count))  # type: ignore[arg-type]

    tables = {
        "all points": some(n, 0),
        **{f"{few} points": some(FEW_CASES, 10_000 * few, points=few) for few in FEW},
        "profile, yaw 75 to 90": some(ODD_CASES, 200_000, yaw=(75.0, 90.0)),
        "upside down, roll 150 to 180": some(ODD_CASES, 300_000, roll=(150.0, 180.0)),
    }
    result: dict[str, object] = {"model": model.name, "starts": 1 + options.starts}
    share = 1.0
    for title, cases in tables.items():
        tallies, misses = measure(model, cases(), options.starts)
        if title == "all points":
            share = min(t.found / t.cases for t in tallies.values())
        result[title] = {
            "rows": [
                {"kind": kind, "lambda": lam, "cases": t.cases, "found": t.found}
                for (kind, lam), t in tallies.items()
            ],
            "misses": misses,
        }
        if not options.json:
            print_table(f"{model.name}, {title}", tallies, misses)
    wanted = {
        "all points": some(n, 0),
        **{f"{few} points": some(n, 10_000 * few, points=few) for few in FEW},
        "profile, yaw 75 to 90": some(n, 200_000, yaw=(75.0, 90.0)),
    }
    refused = {title: refusals(model, cases()) for title, cases in wanted.items()}
    result["refused"] = refused
    if options.json:
        print(json.dumps(result))
    else:
        print(f"\n{model.name}, refused as seen from behind")
        for title, counts in refused.items():
            print(f"{title:<30}", ", ".join(f"{k} {a} of {b}" for k, (a, b) in counts.items()))
    wrong = any(
        count != (0 if name in RIGHT else cases)
        for name, (count, cases) in refused["all points"].items()
    )
    return int(options.check and (share < PROMISED or wrong))


def print_table(title: str, tallies: dict[tuple[str, float], Tally], misses: list[str]) -> None:
    print(f"\n{title}")
    print(
        "fit           lambda  found         share %  converged  steps  largest excess  other starts %"
    )
    for (kind, lam), t in tallies.items():
        print(
            f"{kind:<13} {lam:>6g}  {t.found:>5} of {t.cases:<5} {100 * t.found / t.cases:7.2f}"
            f"  {t.converged:>9}  {t.steps / t.cases:5.1f}  {t.worst:14.1e}  {100 * t.reached / t.others:14.1f}",
            flush=True,
        )
    for miss in misses:
        print("  ", miss)


if __name__ == "__main__":
    sys.exit(main())
