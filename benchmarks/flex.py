"""What the modes of a fit cost: `python benchmarks/flex.py [--json] [--check]`.

Milliseconds of CPU of one thread, medians over random photographs with every mode of the model; the Gram matrix is at
hand, as after the first fit. ICT-FaceKit if FACEAMBIG_ICT names its folder, else the embedded head. --check fails
when a figure is a quarter above what is promised.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from functools import partial

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from problems import drawn, model_of_the_benchmarks
from timing import about, compare

import faceambig as fa
from faceambig.flex import most_flexible
from faceambig.linear import linearised
from faceambig.surface import bending

PHOTOGRAPHS = 8
ROUNDS = 10
EIGENPROBLEM, TEN = "eigenproblem", "first 10 modes in mm"
PROMISED = {EIGENPROBLEM: 1.5, TEN: 6.0}  # ms, for 100 modes and 68 landmarks
SLACK = 1.25


def main() -> int:
    """Print the lines."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--json", action="store_true")
    arguments.add_argument("--check", action="store_true")
    options = arguments.parse_args()
    model = model_of_the_benchmarks()
    fits = [
        fa.fit(model, case.observation, distance=case.distance, modes=model.n_modes)
        for case in drawn(model, PHOTOGRAPHS)
    ]
    fits = [fit for fit in fits if fit.converged]
    rows = [milliseconds(model, fit) for fit in fits]
    medians = {name: float(np.median([row[name] for row in rows])) for name in rows[0]}
    if options.json:
        print(json.dumps(about() | {"model": model.name, "ms": medians}))
    else:
        print(f"{model.n_modes} modes, {len(fits)} photographs of 68 landmarks, ms:")
        for name, took in medians.items():
            wanted = f" (wanted {PROMISED[name]:g})" if name in PROMISED else ""
            print(f"  {name:<34}{took:7.2f}{wanted}")
    missed = any(medians[name] > SLACK * most for name, most in PROMISED.items())
    return int(options.check and missed)


def milliseconds(model: fa.FaceModel, fit: fa.Fit) -> dict[str, float]:
    """Of one fit, by what is asked."""
    modes = partial(fa.flexibility_modes, model, fit)
    before = modes(10)
    surface, Pi = bending(model, fit.alpha, aligned=False), linearised(model, fit).shape
    return compare(
        {
            EIGENPROBLEM: lambda: most_flexible(Pi, surface.W),
            TEN: lambda: modes(10),
            "... continued": lambda: modes(10, previous=before),
            "... the pose compensated": lambda: modes(10, pose="compensated"),
            "all modes in mm": lambda: modes(None),
            "first 10 posterior modes in mm": lambda: fa.posterior_modes(model, fit, 10),
            "spread by shape, pose, distance": lambda: fa.surface_spread(model, fit),
        },
        ROUNDS,
    )


if __name__ == "__main__":
    sys.exit(main())
