"""Load times of the models, and of d_S: `python benchmarks/load.py`.

Each line is the least of some rounds, wall-clock. "first" parses OBJ files into an empty cache, "later" reads it.
ICT-FaceKit is measured if FACEAMBIG_ICT names its folder.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import perf_counter

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from faceambig.io import load_model, save_model
from faceambig.metrics import surface_difference


def least(work: Callable[[], object], rounds: int) -> float:
    """Milliseconds of the fastest of `rounds` runs."""
    times = []
    for _ in range(rounds):
        start = perf_counter()
        work()
        times.append(perf_counter() - start)
    return 1000 * min(times)


def line(what: str, milliseconds: float, promised: float) -> None:
    print(f"{what:<44}{milliseconds:>10.2f} ms   promised {promised:g} ms")


def main() -> None:
    line("embedded head", least(lambda: load_model("embedded"), 5), 300)
    head = load_model("embedded")
    a, b = head.subject(1).vertices, head.subject(2).vertices
    line(f"d_S, {head.n_vertices} vertices", least(lambda: surface_difference(a, b), 200), 1)
    if head.evaluation is not None:
        chosen = head.evaluation
        work = lambda: surface_difference(a, b, chosen)  # noqa: E731
        line(f"d_S, the {len(chosen)} of the evaluation region", least(work, 200), 1)
    with tempfile.TemporaryDirectory() as folder:
        saved = Path(folder) / "head.npz"
        save_model(head, saved)
        line("embedded head, saved as float64", least(lambda: load_model(saved), 5), 300)
        if not os.environ.get("FACEAMBIG_ICT"):
            print("ICT-FaceKit: not measured, FACEAMBIG_ICT names no folder")
            return
        os.environ["FACEAMBIG_CACHE"] = folder
        line("ICT-FaceKit, first", least(lambda: load_model("ict"), 1), 10_000)
        line("ICT-FaceKit, later", least(lambda: load_model("ict"), 5), 500)


if __name__ == "__main__":
    main()
