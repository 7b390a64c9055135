"""The objective of eos, minimised by eos and by us: `python benchmarks/against_eos.py`.

eos (https://github.com/patrikhuber/eos, pip eos-py) fits shape and an affine camera in turn to SSE / 3 + 30 |alpha|^2,
which is a third of our E with lambda = 90 px^2, no box and an orthographic camera. FACEAMBIG_SFM holds its Surrey Face
Model, sfm_shape_3448.bin, and ibug_to_sfm.txt; FACEAMBIG_PTS is a file of 68 points. CPU time of one thread, in turn.
Not named eos.py: it would be imported in place of eos.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from timing import about, compare

import faceambig as fa
from faceambig.arrays import Array
from faceambig.fitting.problem import Problem
from faceambig.fitting.solve import solve
from faceambig.fitting.start import centred_pinv, start_pose
from faceambig.model import Scheme

PRIOR_WEIGHT, ROUNDS = 90.0, 50
SIZE = (1280, 1024)  # pixels; eos turns its y axis by them, the result does not depend on them
EYES = (("37", "40"), ("43", "46"))  # corners of the right and the left eye, counted from 1


def main() -> int:
    """Print the table, or on one line what is missing."""
    try:
        import eos  # pyright: ignore[reportMissingImports]
    except ImportError:
        print("eos: not measured, `import eos` fails; pip install eos-py")
        return 0
    named = [os.environ.get(name) for name in ("FACEAMBIG_SFM", "FACEAMBIG_PTS")]
    if not all(named):
        print("eos: not measured, FACEAMBIG_SFM and FACEAMBIG_PTS name no model and no points")
        return 0
    folder, file = (Path(str(name)) for name in named)
    points = fa.load_landmarks(file, image_size=SIZE).points
    shape, run_eos, ids = their_side(eos, folder, points)
    rows = np.array([int(name) - 1 for name in ids])
    vertices = np.array(list(ids.values()))
    mean = 1e-3 * shape.get_mean().reshape(-1, 3).astype(float)[vertices]
    basis = shape.get_rescaled_pca_basis().astype(float)
    modes = 1e-3 * basis.reshape(-1, 3, basis.shape[1])[vertices]
    seen = points[rows]
    pinv = centred_pinv(mean)
    problem = Problem(seen, np.ones(len(seen)), mean, pinv, modes, PRIOR_WEIGHT, np.inf)
    zero = np.zeros(modes.shape[2])
    model = landmarks_as_model(mean, modes, tuple(ids))
    observation = fa.Observation(seen, "ibug", image_size=SIZE)

    def public(tolerance: float) -> fa.Fit:
        return fa.fit(
            model, observation, camera="orthographic", modes=model.n_modes, box=None,
            prior_weight=PRIOR_WEIGHT, tolerance=tolerance,
        )  # fmt: skip

    runs: dict[str, Callable[[], Any]] = {
        "ours, solver, 1e-8": lambda: solve(problem, start_pose(problem, 0.0), zero),
        "ours, solver, 1e-6": lambda: solve(
            problem, start_pose(problem, 0.0), zero, tolerance=1e-6
        ),
        "ours, fit(), 1e-8": lambda: public(1e-8),
        "eos, 5 iterations (default)": lambda: run_eos(5),
        "eos, 50 iterations": lambda: run_eos(50),
    }
    costs = {name: run() for name, run in runs.items()}
    reached = {
        name: their_cost(answer, seen, vertices) if name.startswith("eos") else answer.cost
        for name, answer in costs.items()
    }
    best = solve(problem, start_pose(problem, 0.0), zero, tolerance=1e-13).cost
    spent = compare(runs, ROUNDS)
    print("; ".join(f"{name} {value}" for name, value in about().items()))
    print(
        f"{len(ids)} of {len(points)} points, {modes.shape[2]} modes, E = SSE + 90 |alpha|^2, least {best:.2f}"
    )
    print(f"{'':<30}{'CPU ms':>8}{'E':>10}{'above the least':>18}")
    for name in runs:
        print(
            f"{name:<30}{spent[name]:>8.2f}{reached[name]:>10.2f}{100 * (reached[name] / best - 1):>17.3f}%"
        )
    return 0


def their_side(
    eos: Any, folder: Path, points: Array
) -> tuple[Any, Callable[[int], Any], dict[str, int]]:
    """The shape model, eos's fit by its number of iterations, and the vertex of each point it maps."""
    loaded = eos.morphablemodel.load_model(str(folder / "sfm_shape_3448.bin"))
    shape = loaded.get_shape_model()
    # Without expressions eos ends in "bad optional access": one that does nothing
    still = eos.morphablemodel.Blendshape(
        "none", np.zeros(shape.get_data_dimension(), dtype=np.float32)
    )
    model = eos.morphablemodel.MorphableModel(shape, [still], loaded.get_color_model())
    mapper = eos.core.LandmarkMapper(str(folder / "ibug_to_sfm.txt"))
    names = [str(number) for number in range(1, len(points) + 1)]
    landmarks = [
        eos.core.Landmark(name, point) for name, point in zip(names, points.tolist(), strict=True)
    ]
    ids = {name: int(vertex) for name in names if (vertex := mapper.convert(name)) is not None}

    def run(iterations: int) -> Any:
        return eos.fitting.fit_shape_and_pose(
            model, landmarks, mapper, *SIZE, num_iterations=iterations
        )

    return shape, run, ids


def their_cost(answer: Any, seen: Array, vertices: np.ndarray) -> float:
    """E of what eos returns: its mesh through its matrices into the picture."""
    mesh, camera, alpha, _ = answer
    corners = np.array(mesh.vertices, dtype=float)[vertices]
    homogeneous = np.column_stack([corners[:, :3], np.ones(len(corners))])
    matrix = camera.get_projection().astype(float) @ camera.get_modelview().astype(float)
    clip = homogeneous @ matrix.T
    width, height = SIZE
    x = 0.5 * (clip[:, 0] / clip[:, 3] + 1) * width
    y = height - 0.5 * (clip[:, 1] / clip[:, 3] + 1) * height
    e = seen - np.column_stack([x, y])
    return float((e**2).sum() + PRIOR_WEIGHT * np.square(alpha).sum())


def landmarks_as_model(mean: Array, modes: Array, names: tuple[str, ...]) -> fa.FaceModel:
    """The mapped points as a model of their own, for the public fit()."""
    eyes = tuple(tuple(names.index(name) for name in corners) for corners in EYES)
    scheme = Scheme(
        "ibug", names, np.arange(len(names)), ("mid",) * len(names), (eyes[0], eyes[1]),
        "eye centres by their corners",
    )  # fmt: skip
    return fa.FaceModel("landmarks", mean, modes, np.empty((0, 3), np.uint32), {"ibug": scheme})


if __name__ == "__main__":
    sys.exit(main())
