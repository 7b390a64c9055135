"""fit() on real heads: the optimum against SciPy's TRF, and the published table of distances."""

from __future__ import annotations

import numpy as np
import pytest

import faceambig as fa
from faceambig.fitting.result import FitOptions
from faceambig.fitting.solve import Solution, kkt_error, solve
from faceambig.fitting.start import start_pose
from faceambig.fitting.task import prepare
from faceambig.metrics import surface_difference
from reference import trf
from strategies import face_of

CASES = 100


def random_case(model: fa.FaceModel, seed: int) -> tuple[fa.Observation, float, float]:
    """Observation, fitting distance and lambda: 0.3 to 2.4 m, yaw within 40 degrees, 0 to 2 px of 100, two priors."""
    rng = np.random.default_rng(seed)
    face = face_of(model, rng.standard_normal(model.n_modes))
    actual, fitted = np.exp(rng.uniform(np.log(0.3), np.log(2.4), 2))
    yaw, pitch, roll = rng.uniform((-40, -20, -20), (40, 20, 20))
    noise = float(rng.choice([0.0, 0.5, 1.0, 2.0]))
    observation = fa.observe(
        face,
        distance=float(actual),
        yaw_deg=yaw,
        pitch_deg=pitch,
        roll_deg=roll,
        noise_percent=noise,  # eye centres are 100 px apart: percent are pixels
        seed=seed,
    )
    return observation, float(fitted), (1.0, 0.01)[seed % 2]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ict", "embedded"])
def test_the_cost_is_that_of_trf_at_tight_tolerances(name, request):
    model = request.getfixturevalue(name)
    worst = 0.0
    for seed in range(CASES if name == "ict" else 20):
        observation, distance, lam = random_case(model, seed)
        task = prepare(model, observation, FitOptions(prior_weight=lam))
        start = start_pose(task.problem, 1 / distance)
        found = solve(task.problem, start, np.zeros(70))
        assert found.status == "converged", seed
        assert kkt_error(task.problem, found) < 1e-3, (
            seed
        )  # its square times E bounds the cost above the optimum
        reference = trf(task.problem, Solution(found.alpha, found.camera, 0.0, 0, found.status))
        from_start = trf(task.problem, Solution(np.zeros(70), start, 0.0, 0, found.status), 1e-12)
        worst = max(worst, found.cost / min(reference, from_start) - 1)
    assert worst < 1e-6  # measured 8e-9


# Means over ten subjects (PEERS.md 1 of the design): rows actual, columns fitted 0.3, 0.6, 1.2, 2.4 m and orthographic
DISTANCES = (0.3, 0.6, 1.2, 2.4, None)
D_L = (
    (0.1790, 0.2665, 0.4241, 0.5543, 0.7277),
    (0.2343, 0.1764, 0.1999, 0.2290, 0.2741),
    (0.3260, 0.1872, 0.1756, 0.1823, 0.2011),
    (0.3939, 0.2085, 0.1773, 0.1754, 0.1823),
    (0.4880, 0.2439, 0.1874, 0.1770, 0.1752),
)
D_S = (
    (1.6550, 4.1578, 5.8074, 6.5693, 7.4250),
    (4.8249, 1.6341, 2.7027, 3.6716, 4.5810),
    (6.6950, 2.7667, 1.6269, 1.9714, 2.8193),
    (7.2425, 3.7141, 1.9851, 1.6276, 1.9831),
    (7.7080, 4.6134, 2.6986, 1.9806, 1.6332),
)


@pytest.mark.slow
def test_every_cell_of_the_table_of_distances_is_reproduced(ict):
    shapes = np.random.default_rng(2019).standard_normal((10, 100))
    subjects = [face_of(ict, alpha) for alpha in shapes]
    for i, actual in enumerate(DISTANCES):
        observations = [fa.observe(subject, distance=actual) for subject in subjects]
        for j, fitted in enumerate(DISTANCES):
            camera = "orthographic" if fitted is None else "perspective"
            fits = [
                fa.fit(ict, observation, camera=camera, distance=fitted, prior_weight=0.01)
                for observation in observations
            ]
            assert all(fit.converged for fit in fits)
            d_l = np.mean([fit.d_l_percent for fit in fits])
            d_s = np.mean(
                [
                    surface_difference(f.vertices(), s.vertices).mean_mm
                    for f, s in zip(fits, subjects, strict=True)
                ]
            )
            # the table's own reproducibility: a stop at 1e-4 still moves a cell by less than this
            assert d_l == pytest.approx(D_L[i][j], abs=0.001), (actual, fitted)
            assert d_s == pytest.approx(D_S[i][j], abs=0.005), (actual, fitted)


def test_a_free_distance_is_found_near_the_truth_at_selfie_distance(embedded):
    face = embedded.subject(3)
    for actual in (0.3, 0.6):
        fit = fa.fit(embedded, fa.observe(face, distance=actual), noise_percent=0.1)
        assert fit.converged
        # noise-free reprojection estimates err by 7 to 10 % at these distances with shapes outside the model
        assert fit.distance == pytest.approx(actual, rel=0.3)


def test_the_points_of_a_real_photograph_are_fitted(embedded):
    from pathlib import Path

    file = Path(__file__).resolve().parents[2] / "shared" / "data" / "photos" / "image_0010.pts"
    if not file.is_file():
        pytest.skip("no photograph: ../shared/data/photos/image_0010.pts is not there")
    read = fa.load_landmarks(file)
    observation = fa.Observation(read.points, read.scheme, image_size=read.image_size)
    assert observation.centre.tolist() == [640, 512]
    fit = fa.fit(embedded, observation, distance=0.6)
    assert fit.converged
    assert fit.interocular_px == pytest.approx(126.7, abs=0.05)  # measured by hand
    assert (
        3.5 < fit.d_l_percent < 5
    )  # a neutral model cannot make his expression; ICT gives 3.8 to 4.2
