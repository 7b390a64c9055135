"""From 10 to 10,000 subjects, and what a million would take: `python benchmarks/scale.py`.

A subject is what an experiment does with one: a head drawn from all modes, its photograph from 30 cm, a fit at 120 cm,
d_L and d_S. The work goes through faceambig.experiments.parallel, as every experiment's does, in one process and in one
for each core. Seconds are wall-clock, with the processes started before; beside other programs the CPU time of a
subject is what can be relied on, and what the outlook is made of. --most N stops earlier, --model takes another model.
"""

from __future__ import annotations

import argparse
import os
import sys
import time

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from timing import about

import faceambig as fa
from faceambig.experiments.heads import drawn, usual_scheme
from faceambig.experiments.parallel import over_subjects
from faceambig.experiments.protocol import Settings, Step, silent
from faceambig.metrics import surface_difference

COUNTS = (10, 100, 1000, 10000)
CHUNK = 32
CORES = (1, 8, 32, 128)  # of the outlook
MOST_ALONE = 1000  # subjects for one process: its rate is known by then


def subject(model: fa.FaceModel, number: int) -> dict[str, float]:
    """d_L and d_S of one head, and the CPU time they took."""
    begun = time.thread_time()
    vertices = model.vertices(drawn(model.n_modes, number))
    face = fa.Subject(f"head {number}", "", vertices, None, model)
    photo = fa.observe(face, distance=0.3, scheme=usual_scheme(model))
    fit = fa.fit(model, photo, distance=1.2)
    gap = surface_difference(fit.vertices(), vertices, model.evaluation)
    return {"d_l": fit.d_l_percent, "d_s": gap.mean_mm, "cpu": time.thread_time() - begun}


def main() -> int:
    """Print the table and the outlook."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--model", default="embedded")
    parser.add_argument("--most", type=int, default=COUNTS[-1])
    options = parser.parse_args()
    cores = os.cpu_count() or 1
    model = fa.load_model(options.model)
    counts = [count for count in COUNTS if count <= options.most]
    print("; ".join(f"{name} {value}" for name, value in about().items()))
    print("subjects  processes  seconds  a second  CPU ms each  MB a process  d_S mean")
    cpu = 0.0
    means: dict[int, set[str]] = {count: set() for count in counts}
    for jobs in dict.fromkeys((1, cores)):
        settings = Settings(model, options.model, n_jobs=jobs)
        over_subjects(subject, range(1, jobs * 2 + 1), settings, silent)  # warm
        for count in counts if jobs > 1 else [n for n in counts if n <= MOST_ALONE]:
            steps: list[Step] = []
            begun = time.perf_counter()
            found = over_subjects(subject, range(1, count + 1), settings, steps.append, chunk=CHUNK)
            seconds = time.perf_counter() - begun
            cpu = 1e3 * float(np.mean([one["cpu"] for one in found]))
            mean = f"{np.mean([one['d_s'] for one in found]):.12f}"
            means[count].add(mean)
            memory = steps[-1].worker_bytes / 1e6
            print(
                f"{count:>8}{jobs:>11}{seconds:>9.2f}{count / seconds:>10.0f}{cpu:>13.2f}{memory:>14.0f}  {mean}",
                flush=True,
            )
    assert all(len(each) == 1 for each in means.values()), "processes change the numbers"
    for n in sorted({*CORES, cores}):
        minutes = 1e6 * cpu / 1e3 / n / 60
        print(f"a million on {n} such cores with nothing else to do: {minutes:.3g} minutes")
    return 0


if __name__ == "__main__":
    sys.exit(main())
