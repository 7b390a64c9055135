"""FaceModel: the same face by every route, and arguments that belong to no face."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import sparse

from faceambig.model import FaceModel
from strategies import face_of, tiny_model

B, N, S = 30, 50, 5
ROUNDING = 1e-15  # metres: a few sums of products of 0.1 m; measured 3e-17


def subdivided() -> FaceModel:
    """The tiny model with 20 more vertices, each a mean of three control vertices."""
    model = tiny_model(B, S)
    middles = np.zeros((N - B, B))
    for k, row in enumerate(middles):
        row[k : k + 3] = (0.5, 0.3, 0.2)
    return replace(model, subdivision=sparse.csr_array(np.vstack([np.eye(B), middles])))


def expanded(model: FaceModel) -> FaceModel:
    """The same model without an operator: mean and modes written out for every surface vertex."""
    dense = np.eye(B) if model.subdivision is None else model.subdivision.toarray()
    modes = np.einsum("nb,bks->nks", dense, model.control_modes)
    return replace(
        model, control_mean=dense @ model.control_mean, control_modes=modes, subdivision=None
    )


MODEL = subdivided()
alphas = st.lists(st.floats(-5, 5), min_size=0, max_size=S).map(np.array)


@given(alphas)
def test_a_subdivided_model_is_the_written_out_one(alpha):
    assert np.abs(MODEL.vertices(alpha) - expanded(MODEL).vertices(alpha)).max() < 10 * ROUNDING


@given(alphas)
def test_a_face_is_the_mean_plus_each_mode_times_its_coefficient(alpha):
    by_hand = MODEL.control_mean.copy()
    for j, a in enumerate(alpha):
        by_hand += a * MODEL.control_modes[:, :, j]
    assert np.abs(MODEL.control_vertices(alpha) - by_hand).max() < 10 * ROUNDING


@given(alphas, st.lists(st.integers(0, N - 1), min_size=1, max_size=9).map(np.array))
def test_rows_are_the_face_at_those_vertices(alpha, vertices):
    for model in (MODEL, expanded(MODEL)):
        mean, modes = model.rows(vertices)
        assert modes.shape == (len(vertices), 3, S)
        rows = mean + modes[:, :, : len(alpha)] @ alpha
        assert np.abs(rows - model.vertices(alpha)[vertices]).max() < 10 * ROUNDING


@given(st.tuples(*[st.floats(-1, 1)] * 3).map(np.array))
def test_moving_the_control_vertices_moves_the_surface(shift):
    moved = replace(MODEL, control_mean=MODEL.control_mean + shift)
    assert np.abs(moved.mean - (MODEL.mean + shift)).max() < 2 * ROUNDING


def test_no_coefficients_are_the_mean():
    assert np.array_equal(MODEL.vertices([]), MODEL.mean)
    assert np.array_equal(MODEL.vertices(np.zeros(S)), MODEL.mean)
    assert (MODEL.n_modes, MODEL.n_vertices) == (S, N)


def test_a_truncated_model_makes_the_same_faces_with_its_modes():
    short = MODEL.truncate(2)
    assert short.n_modes == 2
    assert np.abs(short.vertices([1, -2]) - MODEL.vertices([1, -2, 0, 0, 0])).max() < ROUNDING
    for bad in (0, -1, S + 1):
        with pytest.raises(ValueError, match=f"modes: {bad} is not within 1 to {S}"):
            MODEL.truncate(bad)


def test_a_changed_model_has_its_own_mean_and_its_subjects_know_it():
    with_subject = replace(MODEL, subjects=(face_of(MODEL, np.ones(S)),))
    short = with_subject.truncate(3)
    assert short.subject(1).model is short
    assert with_subject.subject(1).model is with_subject
    assert np.array_equal(short.mean, MODEL.mean)


def test_the_arrays_of_a_model_cannot_be_written():
    own = MODEL.control_mean.copy()
    model = replace(MODEL, control_mean=own, subjects=(face_of(MODEL, np.ones(S)),))
    arrays = (
        model.mean,
        model.control_mean,
        model.control_modes,
        model.faces,
        model.scheme("all").vertices,
        model.subject(1).vertices,
    )
    for array in arrays:
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    own[0] = 0  # the caller's own array stays writable


@pytest.mark.parametrize(
    ("alpha", "said"),
    [
        (np.zeros(S + 1), "alpha: 6 values for a model of 5 modes"),
        (np.zeros((S, 1)), r"alpha: expected shape \(n\), found \(5, 1\)"),
        ([np.nan], "alpha: every value must be finite"),
        ([np.inf], "alpha: every value must be finite"),
        (["a"], "alpha: expected numbers"),
        (0.5, r"alpha: expected shape \(n\), found \(\)"),
    ],
)
def test_coefficients_that_are_none_are_refused(alpha, said):
    with pytest.raises(ValueError, match=said):
        MODEL.vertices(alpha)


def test_unknown_names_list_what_there_is():
    with pytest.raises(ValueError, match="unknown scheme 'ibug': this model has all"):
        MODEL.scheme("ibug")
    with pytest.raises(ValueError, match="unknown scheme 'all': this model has none"):
        replace(MODEL, schemes={}).scheme("all")
    two = {"all": MODEL.scheme("all"), "some": MODEL.scheme("all")}
    with pytest.raises(ValueError, match="this model has all or some"):
        replace(MODEL, schemes=two).scheme("x")


def test_subjects_count_from_one():
    with pytest.raises(ValueError, match="model 'tiny' has no subjects"):
        MODEL.subject(1)
    model = replace(MODEL, subjects=(face_of(MODEL, np.ones(S)), face_of(MODEL, -np.ones(S))))
    assert np.array_equal(model.subject(2).vertices, MODEL.vertices(-np.ones(S)))
    assert model.subject(np.int64(2)) is model.subjects[1]  # pyright: ignore[reportArgumentType]
    for bad in (0, 3, -1):
        with pytest.raises(ValueError, match=f"unknown subject {bad}: 1 to 2"):
            model.subject(bad)
    with pytest.raises(ValueError, match="unknown subject a number of that many digits: 1 to 2"):
        model.subject(10**5000)


@pytest.mark.parametrize("bad", ["a", "1", 1.0, None, True, [1], {}, np.zeros(2)])
def test_what_is_no_number_or_no_name_is_refused_in_one_line(bad: Any):
    model = replace(MODEL, subjects=(face_of(MODEL, np.ones(S)),))
    with pytest.raises(ValueError, match=r"^subject: .* is not a whole number$"):
        model.subject(bad)
    with pytest.raises(ValueError, match=r"^unknown scheme .*: this model has all$"):
        model.scheme(bad)


def test_a_scheme_lists_name_side_and_vertex():
    scheme = MODEL.scheme("all")
    assert len(scheme.rows()) == len(scheme)
    assert scheme.rows()[2] == (scheme.points[2], scheme.sides[2], int(scheme.vertices[2]))


def test_the_embedded_heads_landmarks_come_by_either_route(embedded):
    alpha = np.linspace(-2, 2, embedded.n_modes)
    vertices = embedded.scheme("ibug68").vertices
    mean, modes = embedded.rows(vertices)
    # 100 modes of up to 4 mm at 2 sd
    assert np.abs(mean + modes @ alpha - embedded.vertices(alpha)[vertices]).max() < 10 * ROUNDING
