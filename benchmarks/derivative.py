"""What the exact Jacobian saves against finite differences: `python benchmarks/derivative.py`.

The same random photographs at a fixed distance, the same start and the same optimum, CPU time of one thread: SciPy's
TRF, and a plain Gauss-Newton (below) that takes its Jacobian from outside and does nothing else differently.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import partial

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from problems import Stacked, drawn, excess_over_best, model_of_the_benchmarks, scipy_fit
from timing import compare

import faceambig as fa
from faceambig.arrays import Array
from faceambig.fitting.boxqp import solve_box_qp
from faceambig.fitting.solve import solve
from faceambig.fitting.start import start_pose
from faceambig.fitting.task import prepare

CASES, ROUNDS = 50, 1
SAME = 1e-6  # relative cost above the best known that still counts as the optimum
STEP = 1.5e-8  # of a forward difference: the root of the rounding of a double, times the parameter's size


def main() -> None:
    """Print times and ratios."""
    model = model_of_the_benchmarks()
    times: list[dict[str, float]] = []
    worst: dict[str, float] = {}
    for case in drawn(model, CASES):
        options = fa.FitOptions(prior_weight=case.prior_weight)
        problem = prepare(model, case.observation, options).problem
        start, zero = start_pose(problem, 1 / case.distance), np.zeros(problem.modes.shape[2])
        work = Stacked(problem, start, zero)
        e = work.residual(work.start)
        both = {
            "trf": lambda p=problem, s=start, z=zero: scipy_fit(p, s, z).cost,
            "trf, differences": lambda p=problem, s=start, z=zero: (
                scipy_fit(p, s, z, derivative="2-point").cost
            ),
            "gn": lambda w=work: gauss_newton(w, lambda theta, _: w.derivative(theta)),
            "gn, differences": lambda w=work: gauss_newton(w, partial(differences, w)),
        }
        costs = {name: run() for name, run in both.items()}
        ours = solve(problem, start, zero)
        above = excess_over_best(problem, ours.camera, ours.alpha, list(costs.values()))
        for name, value in zip(costs, above, strict=True):
            worst[name] = max(worst.get(name, 0.0), value)
        both["J"] = lambda w=work: w.derivative(w.start)
        both["J, differences"] = lambda w=work, e=e: differences(w, w.start, e)
        times.append(compare(both, ROUNDS))
    if max(worst.values()) > SAME:
        raise SystemExit(f"not the same optimum, relative cost above the best: {worst}")
    print(
        f"model {model.name}, {CASES} cases, worst relative cost above the best {max(worst.values()):.0e}"
    )
    print(f"{'':<26}{'exact, ms':>11}{'differences, ms':>18}{'times faster':>15}")
    for words, name in (
        ("one Jacobian", "J"),
        ("SciPy TRF, a fit", "trf"),
        ("plain Gauss-Newton, a fit", "gn"),
    ):
        exact, other = (np.array([t[key] for t in times]) for key in (name, f"{name}, differences"))
        print(
            f"{words:<26}{np.median(exact):>11.3f}{np.median(other):>18.3f}"
            f"{np.median(other / exact):>15.1f}"
        )


def differences(work: Stacked, theta: Array, e: Array) -> Array:
    """(2 L + S, n) by forward differences; e (2 L + S,) is the residual at theta."""
    J = np.empty((len(theta), len(e)))
    moved = theta.copy()
    for j, value in enumerate(theta):
        moved[j] = value + STEP * max(1.0, abs(value))
        J[j] = (work.residual(moved) - e) / (moved[j] - value)
        moved[j] = value
    return J.T


def gauss_newton(work: Stacked, derivative: Callable[[Array, Array], Array]) -> float:
    """Cost reached: steps of the box QP, shortened until the cost falls; stops at 1e-8 of it."""
    theta = work.start.copy()
    e = work.residual(theta)
    E = float(e @ e)
    active = np.zeros(len(theta), dtype=np.int8)
    for _ in range(200):
        J = derivative(theta, e)
        H, g = J.T @ J, -(J.T @ e)
        delta, active, *_ = solve_box_qp(H, g, work.low - theta, work.high - theta, active, 200)
        slope = 2 * float(g @ delta)
        if slope - float(delta @ H @ delta) <= 1e-9 * E:
            break
        length = 1.0
        while True:
            trial = (theta + length * delta).clip(work.low, work.high)
            e_new = work.residual(trial)
            E_new = float(e_new @ e_new)
            if E - E_new >= 0.25 * slope * length or length < 1e-6:
                break
            least = 0.5 * slope * length / (E_new - E + slope * length)  # of the parabola
            length *= min(0.7, max(0.15, least))
        theta, e, E = trial, e_new, E_new
    return E


if __name__ == "__main__":
    main()
