"""How time and memory of fits grow: `python benchmarks/growth.py [--plot docs/growth.png]`.

With the number of points L, of modes S, of faces fitted, and of vertices of the surface that a fit is turned into. CPU
time of one thread, medians over random photographs; memory is the most that is held at once beyond the model. The
slope is that on logarithmic axes, of the lower and of the upper half: 1 is proportional.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from problems import Case, drawn, model_of_the_benchmarks
from timing import compare, peak_megabytes

import faceambig as fa
from faceambig.arrays import Array

MODES, DISTANCE, PRIOR = 70, 0.6, 1.0  # metres, px^2
COLOURS = ((0x1B, 0x5F, 0xC1), (0xA8, 0x4A, 0x00), (0x1E, 0x7A, 0x46), (0x7A, 0x3D, 0x9E))


@dataclass(frozen=True, slots=True, eq=False)
class Growth:
    """One curve. K sizes."""

    words: str
    axis: str
    sizes: Array  # (K,)
    milliseconds: Array  # (K,) medians
    megabytes: Array  # (K,)


def main() -> None:
    """Print the tables, draw the plot if a file is named."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--plot", type=Path)
    options = arguments.parse_args()
    model = model_of_the_benchmarks()
    growths = [over_points(model), over_modes(model), over_faces(model), over_vertices(model)]
    for growth in growths:
        print(growth.words)
        for name, values in (
            (growth.axis, growth.sizes),
            ("CPU ms", growth.milliseconds),
            ("memory MB", growth.megabytes),
        ):
            shown = "".join(
                f"{value:>9.0f}" if value >= 100 else f"{value:>9.3g}" for value in values
            )
            slopes = "   slope {:.2f}, {:.2f}".format(*halves(growth.sizes, values))
            print(f"  {name:<10}{shown}{slopes if values is not growth.sizes else ''}")
    if options.plot:
        draw(growths, options.plot)


def halves(x: Array, y: Array) -> tuple[float, float]:
    """Slopes of y over x on logarithmic axes, of the lower and the upper half; the middle belongs to both."""
    middle = len(x) // 2
    log_x, log_y = np.log(x), np.log(y)
    low, high = (
        float(np.polyfit(log_x[part], log_y[part], 1)[0])
        for part in (slice(0, middle + 1), slice(middle, None))
    )
    return low, high


def measured(
    words: str, axis: str, sizes: Sequence[int], works: Sequence[Sequence[Callable[[], object]]]
) -> Growth:
    """`works` has a list a size: the same kind of work for several photographs."""
    milliseconds, megabytes = [], []
    for same in works:
        megabytes.append(peak_megabytes(same[0]))  # the first call: what is prepared once counts
        milliseconds.append(np.median([compare({"": run}, 3)[""] for run in same]))
    return Growth(words, axis, np.array(sizes, float), np.array(milliseconds), np.array(megabytes))


def fits(model: fa.FaceModel, cases: Sequence[Case], modes: int) -> list[Callable[[], object]]:
    own = model.truncate(model.n_modes)  # its rows are not prepared yet

    def work(case: Case) -> Callable[[], object]:
        return lambda: fa.fit(
            own, case.observation, distance=case.distance, modes=modes, prior_weight=PRIOR
        )

    return [work(case) for case in cases]


def over_points(model: fa.FaceModel) -> Growth:
    rng, N = np.random.default_rng(5), model.n_vertices
    sizes = [*np.unique(np.geomspace(20, N, 8).round().astype(int)).tolist()]
    works = []
    for L in sizes:
        vertices = rng.choice(N, L, replace=False)
        works.append(fits(model, drawn(model, 6, points=vertices.tolist()), MODES))
    return measured(f"points of the picture, {MODES} modes: a fit", "L", sizes, works)


def over_modes(model: fa.FaceModel) -> Growth:
    sizes = [S for S in (1, 3, 10, 20, 40, 70, 100) if model.n_modes > S] + [model.n_modes]
    cases = drawn(model, 12)
    works = [fits(model, cases, S) for S in sizes]
    return measured("modes, 68 points: a fit", "S", sizes, works)


def over_faces(model: fa.FaceModel) -> Growth:
    sizes = [1, 3, 10, 30, 100, 300, 1000]
    photographs = [case.observation for case in drawn(model, sizes[-1])]
    together: Any = getattr(fa, "fit_batch", None)

    def work(number: int) -> Callable[[], object]:
        chosen = photographs[:number]
        if together is None:
            return lambda: [
                fa.fit(model, one, distance=DISTANCE, prior_weight=PRIOR) for one in chosen
            ]
        return lambda: together(model, chosen, distance=DISTANCE, prior_weight=PRIOR, n_jobs=1)

    how = "fit_batch" if together else "fit, one after the other"
    return measured(
        f"faces, 68 points, {MODES} modes: {how}", "faces", sizes, [[work(n)] for n in sizes]
    )


def over_vertices(model: fa.FaceModel) -> Growth:
    sizes = np.unique(np.geomspace(100, model.n_vertices, 7).round().astype(int)).tolist()
    (case,) = drawn(model, 1)
    alpha = fa.fit(model, case.observation, distance=case.distance, prior_weight=PRIOR).alpha

    def work(number: int) -> Callable[[], object]:
        mean, modes = model.rows(np.arange(number))
        part = replace(
            model, control_mean=mean, control_modes=modes, subdivision=None, coarse_faces=None,
            colours=None, occlusion=None, evaluation=None, regions={}, subjects=(), schemes={},
            faces=model.faces[(model.faces < number).all(axis=1)],
        )  # fmt: skip
        return lambda: part.vertices(alpha)

    words = f"vertices of the surface, {len(alpha)} modes: the face of a fit"
    return measured(words, "N", sizes, [[work(n)] for n in sizes])


def draw(growths: Sequence[Growth], file: Path) -> None:
    """Time and memory side by side."""
    import cv2
    from chart import PAPER, Frame, Line, plot

    from faceambig.render.canvas import Canvas

    canvas = Canvas((2440, 960), 2.0, PAPER)
    names = ("points of a picture", "modes", "faces fitted", "vertices of a face")
    time_words = ("10 µs", "100 µs", "1 ms", "10 ms", "100 ms", "1 s", "10 s")
    memory_words = ("1 kB", "10 kB", "100 kB", "1 MB", "10 MB", "100 MB")
    for left, title, words, powers, values in (
        (70.0, "CPU time", time_words, (-2, 4), [one.milliseconds for one in growths]),
        (690.0, "Memory at most", memory_words, (-3, 2), [one.megabytes for one in growths]),
    ):
        frame = Frame(left, 50.0, 320.0, 360.0, (0, 4), powers)
        lines = [
            Line(f"{name}, slope {halves(one.sizes, y)[1]:.1f}", one.sizes, y, colour)
            for name, one, y, colour in zip(names, growths, values, COLOURS, strict=True)
        ]
        plot(canvas, frame, title, "how many (slope: of the upper half)", words, lines)
    cv2.imwrite(str(file), canvas.pixels[..., ::-1])


if __name__ == "__main__":
    main()
