"""The public names: sorted, importable, spelled as users know them; the command line's start loads little."""

from __future__ import annotations

import inspect
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import pytest

import faceambig as fa

ROOT = Path(__file__).parent.parent
# Names users have written into their programs: more may come, none of these may go or change
KEPT = {
    "AssetError", "ContourFit", "ContourStatus", "DistanceDensity", "DistanceInterval", "FaceModel", "FaceSamples",
    "Fit", "FitOptions", "FlexibilityModes", "Interval", "Observation", "Posterior", "Scheme", "Status", "Subject",
    "Sweep", "condition", "contour_fit", "fit", "flexibility_modes", "load_fit", "load_landmarks", "load_model",
    "observe", "posterior", "save_fit", "sweep_distance",
}  # fmt: skip
MEMBERS = {
    fa.FaceModel: {"faces", "mean", "n_modes", "n_vertices", "scheme", "subject", "truncate", "vertices"},
    fa.ContourFit: {"fit", "iterations", "movement_mm", "pairs", "status"},
    fa.DistanceDensity: {"beyond", "cumulative", "density", "distances", "masses", "quantiles"},
    fa.DistanceInterval: {"high", "level", "low"},
    fa.FaceSamples: {"alpha", "distances", "vertices"},
    fa.Fit: {
        "alpha", "converged", "cost", "d_l_percent", "distance", "focal", "projected", "rotation", "scale", "status",
        "translation", "vertices",
    },
    fa.FlexibilityModes: {"camera", "directions", "landmark_percent", "reach", "truncated", "words"},
    fa.KeptModes: {"kept", "plausible", "plausible_faces", "plausible_upper"},
    fa.PosteriorModes: {"amplitude_mm", "directions", "landmark_percent", "total_mm", "words"},
    fa.SurfaceSpread: {"distance_mm", "pose_mm", "prior_mm", "shape_mm", "total_mm"},
    fa.Interval: {"best_d_l_percent", "empty", "high", "low", "pieces", "tolerance_percent"},
    fa.Posterior: {"distance_density", "interval", "sample", "shape_moments", "sigma_px", "sweep", "vertex_sd_mm"},
    fa.Scheme: {"eyes_meaning", "name", "points", "vertices"},
    fa.Sweep: {
        "d_l_percent", "disagreed", "distances", "fits", "interval", "nearest", "orthographic", "speed_mm_per_octave",
    },
}  # fmt: skip
OPTIONS = {"modes": None, "box": 2.0, "noise_percent": 1.0, "prior_weight": None}
SIGNATURES = {
    fa.load_model: (["path"], {"part": "face", "origin": "eyes"}),
    fa.observe: (["face"], {"yaw_deg": 0.0, "noise_percent": 0.0, "seed": 0, "scheme": "ibug68"}),
    fa.fit: (["model", "observation"], {"camera": "perspective", "distance": None, **OPTIONS}),
    fa.contour_fit: (
        ["model", "observation", "edges"],
        {
            "camera": "perspective",
            "distance": None,
            "max_distance_px": None,
            "pair_weight": 1.0,
            **OPTIONS,
        },
    ),
    fa.sweep_distance: (["model", "observation", "distances"], OPTIONS),
    fa.flexibility_modes: (
        ["model", "fit", "count"],
        {
            "linearisation": "reprojection",
            "pose": "fixed",
            "free_distance": False,
            "previous": None,
        },
    ),
    fa.posterior_modes: (
        ["model", "fit", "count"],
        {"noise_px": None, "pose": "free", "free_distance": False, "previous": None},
    ),
    fa.surface_spread: (["model", "fit"], {"noise_px": None}),
    fa.posterior: (
        ["model", "observation", "distances"],
        {
            "prior": None,
            "beyond": 0.05,
            "modes": None,
            "missing_modes": True,
            "box": None,
            "noise_percent": 1.0,
        },
    ),
    fa.condition: (["model", "fit"], {}),
}


def test_all_is_sorted_and_importable_and_holds_what_users_know():
    assert sorted(fa.__all__) == fa.__all__
    assert all(hasattr(fa, name) for name in fa.__all__)
    assert set(fa.__all__) >= KEPT


def test_nothing_else_of_the_package_looks_public():
    loose = {
        name
        for name, value in vars(fa).items()
        if not name.startswith("_") and not inspect.ismodule(value) and name != "annotations"
    }
    assert loose == set(fa.__all__)


def test_every_public_name_says_what_it_is():
    for name in fa.__all__:
        assert (inspect.getdoc(getattr(fa, name)) or "").strip(), name


@pytest.mark.parametrize("kind", MEMBERS, ids=lambda kind: kind.__name__)
def test_results_keep_their_names(kind):
    assert MEMBERS[kind] <= {field.name for field in fields(kind)} | set(vars(kind))


@pytest.mark.parametrize("function", SIGNATURES, ids=lambda function: function.__name__)
def test_arguments_keep_names_order_and_defaults(function):
    places, options = SIGNATURES[function]
    parameters = inspect.signature(function).parameters
    assert list(parameters)[: len(places)] == places
    for name, default in options.items():
        assert parameters[name].default == default
        assert parameters[name].kind is inspect.Parameter.KEYWORD_ONLY


def test_options_of_fit_and_sweep_are_those_of_fit_options():
    for function in (fa.fit, fa.sweep_distance):
        parameters = inspect.signature(function).parameters
        for field in fields(fa.FitOptions):
            assert parameters[field.name].default == field.default


def test_the_first_lines_of_a_users_program_run():
    model = fa.load_model("embedded")
    obs = fa.observe(model.subject(3), distance=0.3)
    given = fa.Observation(obs.points, "ibug68", image_size=(500, 500))
    fit = fa.fit(model, given, distance=1.2)
    assert fit.status == "converged"
    assert fit.vertices().shape == model.mean.shape
    assert fit.projected().shape == obs.points.shape
    assert fit.d_l_percent < 1.5
    assert (fit.focal is None, fit.scale is None) == (False, True)
    orthographic = fa.fit(model, obs, camera="orthographic")
    assert (orthographic.focal is None, orthographic.scale is None) == (True, False)
    assert fa.fit(model, obs).distance is not None  # free
    assert fa.sweep_distance(model, obs, [0.3, 0.6]).interval(tolerance_percent=3.0).empty is False
    assert fa.flexibility_modes(model, fit).directions.shape == (3, 70)


def test_page_and_snapshot_are_importable_by_their_names():
    import faceambig_app

    assert sorted(faceambig_app.__all__) == faceambig_app.__all__
    assert {"ViewState", "snapshot"} <= set(faceambig_app.__all__)
    from faceambig_app import ViewState, snapshot
    from faceambig_app.export import snapshot as same

    assert snapshot is same
    assert ViewState(subject=3, actual=0.3, distance=1.2).subject == 3
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = faceambig_app.nothing


@pytest.mark.parametrize(
    "arguments",
    [[], ["snapshot"], ["fit"], ["sweep"], ["modes"], ["posterior"], ["models"], ["serve"]],
)
def test_help_is_printed_without_loading_anything_heavy(arguments):
    # 17 ms instead of a second: numpy, viser, cv2 and pyrender come only with the work
    code = (
        "import atexit, sys; from faceambig_app.cli import main; "
        "atexit.register(lambda: print(*sys.modules, file=sys.stderr)); "
        f"main({[*arguments, '--help']})"
    )
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert run.returncode == 0
    assert run.stdout.startswith("usage: faceambig")
    heavy = {"cv2", "faceambig", "numpy", "pyrender", "scipy", "trimesh", "viser"}
    assert not {name.split(".")[0] for name in run.stderr.split()} & heavy
