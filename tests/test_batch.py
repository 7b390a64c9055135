"""fit_batch(): the fits of fit(), one by one; a face that cannot be fitted marks its row; processes and a cluster."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import dask.distributed
import joblib
import numpy as np
import pytest
from tqdm import tqdm

import faceambig as fa
from faceambig.fitting import batch
from strategies import face_of, tiny_model

MODEL = tiny_model(n_vertices=24, n_modes=6, seed=4)


def photographs(number: int, model: fa.FaceModel = MODEL, scheme: str = "all") -> list[Any]:
    rng = np.random.default_rng(number)
    return [
        fa.observe(
            face_of(model, rng.standard_normal(model.n_modes)), distance=float(rng.uniform(0.3, 2.4)),
            scheme=scheme, yaw_deg=float(rng.uniform(-40, 40)), pitch_deg=float(rng.uniform(-20, 20)),
            noise_percent=float(rng.choice([0.0, 1.0, 2.0])), seed=row,
        )
        for row in range(number)
    ]  # fmt: skip


def assert_same(rows: tuple[fa.Fit | fa.Failure, ...], fits: list[fa.Fit]) -> None:
    assert len(rows) == len(fits)
    for row, fit in zip(rows, fits, strict=True):
        assert isinstance(row, fa.Fit)
        assert row.status is fit.status
        assert row.steps == fit.steps
        assert row.cost == pytest.approx(fit.cost, rel=1e-8, abs=1e-12)
        # the same steps with sums in another order: rounding times the condition, 1e5 at most here
        assert np.abs(row.alpha - fit.alpha).max() < 1e-8
        assert np.abs(row.camera.R - fit.camera.R).max() < 1e-8
        assert row.observation is fit.observation


OPTIONS: list[dict[str, Any]] = [
    {"distance": 0.6},
    {"distance": None},
    {"camera": "orthographic"},
    {"distance": 1.0, "box": 0.5, "prior_weight": 0.01},
    {"distance": 0.6, "box": None, "noise_percent": 3.0},
    {"distance": 0.6, "method": "snls"},
    {"camera": "orthographic", "method": "als", "als_rounds": 3},
    {"weighting": "algebraic", "distance": 0.8},
]


@pytest.mark.parametrize("options", OPTIONS, ids=str)
def test_a_batch_gives_the_fits_one_by_one(options):
    # more faces than one chunk; missing points and weights make groups of their own
    observations = photographs(batch.CHUNK + 6)
    missing = observations[3].points.copy()
    missing[[7, 9]] = np.nan
    observations[3] = replace(observations[3], points=missing)
    observations[5] = replace(observations[5], weights=np.linspace(0.2, 2, 24))
    rows = fa.fit_batch(MODEL, observations, **options)
    assert_same(rows, [fa.fit(MODEL, each, **options) for each in observations])


def test_a_batch_on_a_head_gives_the_fits_one_by_one(embedded):
    observations = photographs(40, embedded, "ibug68")
    distances = [0.3 + 0.05 * row for row in range(40)]
    for lam in (0.01, 1.0):
        rows = fa.fit_batch(embedded, observations, distance=distances, prior_weight=lam)
        fits = [
            fa.fit(embedded, each, distance=distance, prior_weight=lam)
            for each, distance in zip(observations, distances, strict=True)
        ]
        for row, fit in zip(rows, fits, strict=True):
            assert isinstance(row, fa.Fit)
            assert row.cost == pytest.approx(fit.cost, rel=1e-8)
            assert np.abs(row.alpha - fit.alpha).max() < 1e-6  # lambda 0.01: a flat valley


def test_a_bad_face_marks_its_own_row_and_stops_nothing():
    observations = photographs(5)
    good = [fa.fit(MODEL, each, distance=0.6) for each in observations]
    observations[1] = fa.Observation(observations[1].points, "farkas")
    mirrored = observations[3].points * [-1.0, 1.0] + [observations[3].image_size[0], 0.0]
    observations[3] = replace(observations[3], points=mirrored)
    rows = fa.fit_batch(MODEL, observations, distance=0.6)
    assert [row.converged for row in rows] == [True, False, True, False, True]
    assert isinstance(rows[1], fa.Failure)
    assert isinstance(rows[3], fa.Failure)
    assert "unknown scheme 'farkas'" in rows[1].message
    assert "left and right seem exchanged" in rows[3].message
    assert rows[3].observation is observations[3]
    for row in (0, 2, 4):
        assert rows[row].cost == pytest.approx(good[row].cost, rel=1e-8)  # type: ignore[union-attr]


def test_what_goes_wrong_in_the_solver_stays_in_its_row():
    # a start behind the camera is noticed by the descent, not before
    tasks = [batch.Start(*start) for start in starts_of(photographs(3))]
    tasks[1] = tasks[1]._replace(camera=replace(tasks[1].camera, kappa=100.0))
    rows = batch.solve_batch(tasks, fa.FitOptions(), n_jobs=1, progress=None)
    assert isinstance(rows[1], ValueError)
    assert "behind the camera" in str(rows[1])
    assert not isinstance(rows[0], ValueError)
    assert not isinstance(rows[2], ValueError)


def starts_of(observations: list[Any]) -> Iterator[tuple[Any, Any, Any]]:
    from faceambig.fitting.task import prepare, start_of

    for observation in observations:
        task = prepare(MODEL, observation, fa.FitOptions())
        yield task.problem, *start_of(task, 1.0)


def test_progress_is_told_in_faces_and_fits_a_bar():
    observations = photographs(batch.CHUNK + 3)
    said: list[int] = []
    fa.fit_batch(MODEL, observations, distance=0.6, progress=said.append)
    assert sum(said) == len(observations)
    assert len(said) == 2
    with tqdm(total=len(observations), disable=None) as bar:
        fa.fit_batch(MODEL, observations, distance=0.6, progress=bar.update)
    assert bar.disable or bar.n == len(observations)


def test_two_processes_give_the_same_fits():
    observations = photographs(batch.CHUNK + 6)
    rows = fa.fit_batch(MODEL, observations, distance=0.6, n_jobs=2)
    assert_same(rows, [fa.fit(MODEL, each, distance=0.6) for each in observations])


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_a_dask_cluster_gives_the_same_fits():
    observations = photographs(batch.CHUNK + 6)
    cluster = dask.distributed.LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        host="127.0.0.1",
        dashboard_address="127.0.0.1:0",  # any free port: another cluster may run beside it
    )
    with (
        cluster,
        dask.distributed.Client(cluster),
        joblib.parallel_config(backend="dask"),
    ):
        rows = fa.fit_batch(MODEL, observations, distance=0.6, n_jobs=-1)
    assert_same(rows, [fa.fit(MODEL, each, distance=0.6) for each in observations])


def test_nothing_to_fit_gives_nothing():
    assert fa.fit_batch(MODEL, [], distance=0.6) == ()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"n_jobs": 0}, "n_jobs: 0 is no number of processes"),
        ({"n_jobs": 1.5}, "n_jobs: 1.5"),
        ({"distance": [0.6]}, "distance: 1 for 2 observations"),
        ({"distance": [0.6, 0.1]}, "distance: 0.1 m is not within 0.2"),
        ({"distance": "near"}, "distance: 'near'"),
        ({"modes": 200}, "modes: 200 of a model with 6"),
        ({"box": -1.0}, "box: -1"),
    ],
)
def test_wrong_options_are_refused_at_once(change, words):
    with pytest.raises(ValueError, match=words):
        fa.fit_batch(MODEL, photographs(2), **{"distance": 0.6} | change)


def test_without_joblib_more_processes_are_refused_in_words(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "joblib", None)
    with pytest.raises(ValueError, match=r"n_jobs: 2 processes need joblib; pip install"):
        fa.fit_batch(MODEL, photographs(2), distance=0.6, n_jobs=2)
