"""Nonsense at every border of a fit: the right answer or one line that names the argument, never anything else."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

import faceambig as fa
from faceambig.arrays import checked, number, shown, whole
from strategies import face_of, tiny_model

MODEL = tiny_model(n_vertices=24, n_modes=6, seed=4)
FACE = face_of(MODEL, np.array([0.5, -1.0, 0.3, 1.2, -0.4, 0.8]))
GOOD = fa.observe(FACE, distance=0.6, scheme="all", yaw_deg=10, noise_percent=1)
FIT = fa.fit(MODEL, GOOD, distance=0.6)
SWEEP = fa.sweep_distance(MODEL, GOOD, [0.4, 0.8])

NONSENSE: dict[str, Any] = {
    "None": None,
    "text": "0.6",
    "no text": "",
    "bytes": b"1",
    "True": True,
    "False": np.False_,
    "NaN": float("nan"),
    "infinity": float("inf"),
    "minus infinity": -np.inf,
    "zero": 0,
    "minus one": -1,
    "half": 0.5,
    "one": 1,
    "two": np.int64(2),
    "a 32-bit float": np.float32(1.5),
    "a fraction": Fraction(3, 4),
    "huge": 1e300,
    "a hundred digits": 10**100,
    "five thousand digits": 10**5000,
    "complex": 1 + 1j,
    "0-d": np.array(1.25),
    "0-d whole": np.array(2),
    "0-d text": np.array("x"),
    "one in a list": [0.6],
    "empty": [],
    "whole numbers": [1, 2, 3],
    "text in a list": ["1", "2"],
    "ragged": [[1.0], [1.0, 2.0]],
    "matrix": np.eye(2),
    "numbers with a hole": [0.5, None],
    "complex numbers": np.array([0.5 + 1j, 1.0]),
    "dates": np.array(["2020-01-01", "2021-01-01"], dtype="M8[D]"),
    "a set": {1, 2},
    "a dictionary": {"a": 1},
    "an object": object(),
    "a class": int,
    "a model": MODEL,
}


def observed(**change: Any) -> fa.Observation:
    asked: dict[str, Any] = {"points": GOOD.points, "scheme": "all"}
    return fa.Observation(**asked | change)


def fitted(**change: Any) -> fa.Fit:
    asked: dict[str, Any] = {"distance": 0.6}
    return fa.fit(MODEL, GOOD, **asked | change)


def swept(**change: Any) -> fa.Sweep:
    asked: dict[str, Any] = {"distances": [0.5]}
    return fa.sweep_distance(MODEL, GOOD, **asked | change)


def photographed(**change: Any) -> fa.Observation:
    asked: dict[str, Any] = {"face": FACE, "distance": 0.6, "scheme": "all"}
    return fa.observe(**asked | change)


OPTIONS = ("modes", "box", "noise_percent", "prior_weight", "tolerance", "max_steps", "als_rounds")
WORDS = ("weighting", "method", "jacobian")
BORDERS: dict[str, tuple[Callable[..., Any], str]] = {
    **{f"fit {name}": (fitted, name) for name in (*OPTIONS, *WORDS, "camera", "distance")},
    **{f"sweep {name}": (swept, name) for name in (*OPTIONS, *WORDS, "distances")},
    **{
        f"Observation {name}": (observed, name)
        for name in ("points", "scheme", "image_size", "principal_point", "weights")
    },
    **{
        f"observe {name}": (photographed, name)
        for name in (
            "face", "distance", "scheme", "yaw_deg", "pitch_deg", "roll_deg", "noise_percent", "seed", "eyes_px",
        )
    },
    "fit's model": (lambda value: fa.fit(value, GOOD), "model"),
    "fit's observation": (lambda value: fa.fit(MODEL, value), "observation"),
    "sweep's model": (lambda value: fa.sweep_distance(value, GOOD), "model"),
    "flexibility_modes count": (lambda value: fa.flexibility_modes(MODEL, FIT, value), "count"),
    "flexibility_modes model": (lambda value: fa.flexibility_modes(value, FIT), "model"),
    "flexibility_modes fit": (lambda value: fa.flexibility_modes(MODEL, value), "fit"),
    **{
        f"flexibility_modes {name}": (lambda value, name=name: fa.flexibility_modes(MODEL, FIT, **{name: value}), name)
        for name in ("linearisation", "pose", "free_distance", "previous")
    },
    "reach": (lambda value: fa.flexibility_modes(MODEL, FIT).reach(value), "mode"),
    "truncated": (lambda value: fa.flexibility_modes(MODEL, FIT, None).truncated(value), "surface_mm"),
    "posterior_modes count": (lambda value: fa.posterior_modes(MODEL, FIT, value), "count"),
    **{
        f"posterior_modes {name}": (lambda value, name=name: fa.posterior_modes(MODEL, FIT, **{name: value}), name)
        for name in ("noise_px", "pose", "free_distance", "previous")
    },
    "surface_spread": (lambda value: fa.surface_spread(MODEL, FIT, noise_px=value), "noise_px"),
    "nearest": (SWEEP.nearest, "distance"),
    "interval": (SWEEP.interval, "tolerance_percent"),
}  # fmt: skip


def outcome(call: Callable[..., Any], name: str, value: object) -> Any:
    """What came back, or the error's line."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # a conversion that loses something only warns
        try:
            return (
                call(value)
                if call.__name__ in ("<lambda>", "nearest", "interval")
                else call(**{name: value})
            )
        except ValueError as error:
            return str(error)


@pytest.mark.parametrize("border", BORDERS)
def test_nonsense_is_refused_in_one_line_that_names_it_or_means_something(border):
    call, name = BORDERS[border]
    for what, value in NONSENSE.items():
        result = outcome(call, name, value)
        if isinstance(result, str):
            assert "\n" not in result, what
            assert len(result) < 250, what
            assert name.removesuffix("_deg") in result, (what, result)
        else:
            assert_sound(result)


def assert_sound(result: Any) -> None:
    """What a nonsense value gave is a result like any other."""
    match result:
        case fa.Fit():
            assert np.isfinite(result.alpha).all()
            assert np.isfinite(result.cost)
            assert np.isfinite(result.projected()).all()
            assert (np.abs(result.alpha) <= (result.options.box or np.inf)).all()
            assert result.converged or result.options.max_steps < 10
            for value in (getattr(result.options, name) for name in OPTIONS):
                assert value is None or type(value) in (int, float)
        case fa.Sweep():
            for fit in (*result.fits, result.orthographic):
                assert_sound(fit)
        case fa.Observation():
            assert np.isfinite(result.points[result.visible]).all()
            assert np.isfinite(result.centre).all()
        case fa.Interval():
            assert 0 < result.tolerance_percent < np.inf
        case fa.FlexibilityModes() | fa.PosteriorModes():
            assert np.isfinite(result.directions).all()
        case fa.KeptModes():
            assert 0 < result.surface_mm < np.inf
        case fa.SurfaceSpread():
            assert 0 < result.noise_px < np.inf
            assert 0 <= result.total_mm <= result.prior_mm * (1 + 1e-9)
        case _:
            assert np.isfinite(result).all()


# What is meant by these is plain, so it is done
@pytest.mark.parametrize(
    ("change", "same"),
    [
        ({"distance": np.array(0.6)}, {}),
        ({"distance": Fraction(3, 5)}, {}),
        ({"modes": np.int8(6)}, {}),
        ({"modes": None}, {"modes": 6}),
        ({"box": 2}, {}),
        ({"box": np.float32(2)}, {}),
        ({"noise_percent": np.array(1)}, {}),
        ({"max_steps": np.uint16(50)}, {"max_steps": 50}),
    ],
)
def test_a_number_of_another_type_is_that_number(change, same):
    a, b = fitted(**change), fitted(**same)
    assert np.array_equal(a.alpha, b.alpha)
    assert a.cost == b.cost
    if "modes" not in change:
        assert a.options == b.options
        assert hash(a.options) == hash(b.options)


@pytest.mark.parametrize("kind", [list, tuple, np.float32, np.float64, np.ma.MaskedArray])
def test_points_of_any_kind_of_array_are_those_points(kind):
    points = np.asarray(GOOD.points, dtype=np.float32).astype(np.float64)
    given = kind(points.tolist()) if kind in (list, tuple) else kind(points)
    assert np.array_equal(observed(points=given).points, points)
    whole_pixels = np.rint(points).astype(np.int64)
    assert np.array_equal(observed(points=whole_pixels).points, whole_pixels)


def test_a_masked_point_and_one_that_is_none_are_missing():
    mask = np.zeros((24, 2), dtype=bool)
    mask[4] = True
    masked = observed(points=np.ma.MaskedArray(GOOD.points, mask)).visible
    holed = observed(points=[(None, None) if i == 4 else xy for i, xy in enumerate(GOOD.points)])
    assert np.flatnonzero(~masked).tolist() == np.flatnonzero(~holed.visible).tolist() == [4]
    with pytest.raises(ValueError, match="distances: every value must be finite"):
        swept(distances=np.ma.MaskedArray([0.5, 1.0], [False, True]))


def test_flags_of_weights_say_which_points_count():
    keep = np.arange(24) % 3 > 0
    assert np.array_equal(observed(weights=keep).visible, keep)


@pytest.mark.parametrize(("modes", "have"), [(7, 6), (200, 6), (10**100, 6)])
def test_more_modes_than_the_model_has_are_refused(modes, have):
    for call in (fitted, swept):
        with pytest.raises(ValueError, match=rf"modes: \d+.* of a model with {have}; give at most"):
            call(modes=modes)
    assert fitted(modes=have).alpha.shape == (have,)


def test_without_a_number_the_strongest_70_modes_are_used(embedded):
    obs = fa.observe(embedded.subject(1), distance=0.6)
    assert embedded.n_modes == 100
    for model, modes in ((embedded, 70), (embedded.truncate(70), 70), (embedded.truncate(40), 40)):
        assert fa.fit(model, obs, distance=0.6).alpha.shape == (modes,)
    with pytest.raises(ValueError, match="modes: 101 of a model with 100; give at most 100"):
        fa.fit(embedded, obs, modes=101)
    assert fa.fit(embedded, obs, distance=0.6, modes=100).alpha.shape == (100,)


# The same vertex at the same pixel again adds weight (test_fit.py); a picture of too few places is none
@pytest.mark.parametrize(
    ("points", "scheme", "words"),
    [
        (np.tile([250.0, 250.0], (24, 1)), "all", "24 visible, but at only 1 different places"),
        (
            np.tile(GOOD.points[:5], (5, 1))[:24],
            "all",
            "24 visible, but at only 5 different places",
        ),
        (GOOD.points, np.arange(24) % 5, "points: on only 5 different vertices of the model; 6"),
        (GOOD.points, np.full(24, 7), "points: on the model they lie on one line"),
        (1e-9 * GOOD.points, "all", "points: they lie within .* pixels; give them in pixels"),
        (1e200 * GOOD.points, "all", "points: .*e.202 is not within 1e.09 pixels"),
        (np.where(np.eye(24, 2) > 0, -np.inf, GOOD.points), "all", "points: every value must be"),
    ],
)
def test_points_that_fix_no_pose_are_refused(points, scheme, words):
    with pytest.raises(ValueError, match=words):
        fa.fit(MODEL, fa.Observation(points, scheme), distance=0.6)


def test_six_points_at_six_places_are_enough():
    few = np.full((24, 2), np.nan)
    few[[0, 3, 5, 9, 14, 20]] = GOOD.points[[0, 3, 5, 9, 14, 20]]
    fit = fa.fit(MODEL, fa.Observation(few, "all", (500, 500)), distance=0.6)
    assert fit.converged
    assert np.isfinite(fit.projected()).all()


@pytest.mark.parametrize(
    ("weights", "words"),
    [
        (np.zeros(24), "weights: only 0 of 24 visible points weigh more than 0; 6 are needed"),
        (np.eye(24)[3], "weights: only 1 of 24"),
        (np.full(24, 1e300), r"weights: 1e\+300 to 1e\+300 is not within 1e-09 to 1e\+09"),
        (np.full(24, 5e-324), "weights: 4.* is not within"),
        (np.full(24, np.inf), "weights: every value must be finite"),
    ],
)
def test_weights_that_leave_nothing_or_overflow_are_refused(weights, words):
    with pytest.raises(ValueError, match=words):
        observed(weights=weights)


@pytest.mark.parametrize("change", [{"image_size": (1e300, 500)}, {"principal_point": (0, -1e300)}])
def test_a_centre_beyond_every_picture_is_refused(change):
    with pytest.raises(
        ValueError, match=rf"{next(iter(change))}: 1e\+300 is not within 1e\+09 pixels"
    ):
        observed(**change)


@pytest.mark.parametrize("factor", [1e-5, 1e-2, 1e3, 1e6])
def test_within_the_bounds_the_unit_of_the_picture_changes_nothing(factor):
    scaled = fa.Observation(
        GOOD.points * factor, "all", principal_point=tuple(GOOD.centre * factor)
    )
    fit = fa.fit(MODEL, scaled, distance=0.6)
    assert fit.converged
    assert np.abs(fit.alpha - FIT.alpha).max() < 1e-6


@pytest.mark.parametrize("weight", [1e-9, 1e9])
def test_the_heaviest_and_the_lightest_weight_still_give_a_fit(weight):
    weights = np.ones(24)
    weights[5] = weight
    fit = fa.fit(MODEL, observed(weights=weights), distance=0.6)
    assert fit.converged
    gap = np.linalg.norm(fit.residual[5])
    assert gap < 1e-3 if weight > 1 else gap > 0.1  # pixels: held fast, or not held at all


def test_a_model_of_another_mesh_is_refused_by_the_modes_of_a_fit():
    for other in (tiny_model(n_vertices=30, n_modes=6), MODEL.truncate(4)):
        with pytest.raises(
            ValueError, match=r"model: \d+ vertices, \d modes; the fit is of one with 24 and 6"
        ):
            fa.flexibility_modes(other, FIT)


def test_numbers_cross_the_border_as_pythons_own():
    assert type(number("x", np.array(3))) is float
    assert type(whole("x", np.uint8(3))) is int
    for value in (True, np.True_, "3", None, 3j, [3], np.array([3])):
        with pytest.raises(ValueError, match=r"x: .* is not a number"):
            number("x", value)
        with pytest.raises(ValueError, match=r"x: .* is not a whole number"):
            whole("x", value)
    with pytest.raises(ValueError, match=r"x: 3\.0 is not a whole number"):
        whole("x", 3.0)
    with pytest.raises(ValueError, match="x: a number of that many digits is too large"):
        number("x", 10**5000)
    assert np.isnan(number("x", np.nan))  # the range is the caller's


def test_what_is_shown_of_a_value_is_short_and_on_one_line():
    assert shown("abc") == "'abc'"
    assert shown(np.eye(30)).count("\n") == 0
    assert len(shown(np.eye(30))) == 60
    with pytest.raises(
        ValueError, match=r"^a: expected numbers, found \[\['x' 'y'\] \['z' 'w'\]\]|array"
    ):
        checked("a", np.array([["x", "y"], ["z", "w"]]), (2, 2))
