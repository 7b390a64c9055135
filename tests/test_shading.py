"""Light by order-2 harmonics against its closed forms, and the light that explains another face's shading."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import faceambig as fa
from faceambig.arrays import Array, vertex_normals
from faceambig.camera import Camera
from faceambig.observation import portrait_camera
from faceambig.rotation import rotation_from_angles, rotation_matrix
from faceambig.shading import KERNEL, best_light, harmonics
from faceambig.visibility import visible_vertices
from strategies import bumpy_model, directions, face_of, rotation_vectors

NOTHING: Any = None
WORD: Any = "bright"
FRONT = Camera(rotation_from_angles(0, 0, 0), np.zeros(2), 1500.0, 0.0)
SIDE = fa.Light.lamp((0.9, -0.2, -0.5)) + fa.Light.sky(0.05)
lights = st.lists(st.floats(-2, 2), min_size=9, max_size=9).map(
    lambda values: fa.Light(np.array(values))
)


def globe(rings: int = 40, around: int = 80) -> tuple[Array, np.ndarray]:
    """Unit sphere (N, 3), and triangles wound outward."""
    polar = np.linspace(0, np.pi, rings + 1)[1:-1]
    turn = np.linspace(0, 2 * np.pi, around, endpoint=False)
    p, t = (grid.ravel() for grid in np.meshgrid(polar, turn, indexing="ij"))
    ring = np.stack([np.sin(p) * np.cos(t), np.sin(p) * np.sin(t), np.cos(p)], axis=1)
    points = np.concatenate([ring, [[0, 0, 1], [0, 0, -1]]])
    faces = []
    for k in range(around):
        beside = (k + 1) % around
        faces.append((len(ring), k, beside))
        faces.append((len(ring) + 1, len(ring) - around + beside, len(ring) - around + k))
        for i in range(rings - 2):
            here, next_ = i * around, (i + 1) * around
            faces += [(here + k, next_ + k, here + beside)]
            faces += [(here + beside, next_ + k, next_ + beside)]
    return points, np.array(faces)


def quadrature(degree: int = 12) -> tuple[Array, Array]:
    """Directions (n, 3) and weights (n,) that integrate polynomials up to `degree` over the sphere exactly."""
    z, w = np.polynomial.legendre.leggauss(degree)
    turn = 2 * np.pi * np.arange(2 * degree) / (2 * degree)
    z, t = (grid.ravel() for grid in np.meshgrid(z, turn, indexing="ij"))
    r = np.sqrt(1 - z * z)
    weights = np.repeat(w, 2 * degree) * np.pi / degree
    return np.stack([r * np.cos(t), r * np.sin(t), z], axis=1), weights


@cache
def photographed(yaw: float = 15.0) -> tuple[fa.Fit, fa.Subject, Camera]:
    """A face from 0.35 m, and what fits its landmarks at 1.5 m."""
    model = bumpy_model(rings=28, around=40)
    face = face_of(model, np.random.default_rng(8).standard_normal(model.n_modes))
    at = {"distance": 0.35, "scheme": "egg", "yaw_deg": yaw}
    fit = fa.fit(model, fa.observe(face, **at), distance=1.5, noise_percent=0.1)
    assert fit.converged
    return fit, face, portrait_camera(face, **at)


def test_harmonics_are_orthonormal():
    n, w = quadrature()
    np.testing.assert_allclose(harmonics(n).T @ (w[:, None] * harmonics(n)), np.eye(9), atol=1e-14)


@given(directions(), directions())
def test_lamp_is_the_clamped_cosine_up_to_order_two(lamp, normal):
    # Legendre's series of max(c, 0): 1/4 P0 + 1/2 P1 + 5/16 P2
    c = float(lamp @ normal)
    found = fa.Light.lamp(3.0 * lamp, 2.0).irradiance(normal[None])
    expected = 2.0 * (1 / 4 + c / 2 + 5 / 16 * (3 * c * c - 1) / 2)
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-15)


def test_kernel_is_what_the_clamped_cosine_has_of_each_order():
    # Funk and Hecke: A_l = 2 pi times the integral of c P_l(c) over 0 to 1; exact by Gauss's rule
    c, w = np.polynomial.legendre.leggauss(8)
    c, w = 0.5 * (c + 1), 0.5 * w
    for order, rows in enumerate((slice(0, 1), slice(1, 4), slice(4, 9))):
        legendre = np.polynomial.Legendre.basis(order)(c)
        np.testing.assert_allclose(KERNEL[rows], 2 * np.pi * (w * c * legendre).sum(), rtol=1e-14)


def test_order_two_holds_99_percent_of_a_lamps_energy():
    # Basri and Jacobs give 99.22 % for the clamped cosine; its whole energy is the integral of c^2, 1/3 of a half
    c, w = np.polynomial.legendre.leggauss(12)
    normals = np.stack([np.sqrt(1 - c * c), 0 * c, c], axis=1)
    E = fa.Light.lamp((0, 0, 1)).irradiance(normals)
    assert (w * E * E).sum() / (1 / 3) == pytest.approx(0.9922, abs=5e-5)


def test_sky_gives_pi_times_its_radiance_to_every_normal():
    n, _ = quadrature()
    np.testing.assert_allclose(fa.Light.sky(0.7).irradiance(n), 0.7 * np.pi, rtol=1e-14)


def test_lights_add():
    n, _ = quadrature()
    a, b = fa.Light.lamp((1, 2, 3)), fa.Light.sky(0.4)
    np.testing.assert_allclose((a + b).irradiance(n), a.irradiance(n) + b.irradiance(n), atol=1e-15)


def test_sphere_under_a_lamp_is_shaded_by_the_angle_to_it():
    points, faces = globe()
    lamp = np.array([0.5, -0.4, -0.7]) / np.linalg.norm([0.5, -0.4, -0.7])
    found = fa.shade(points, faces, FRONT, fa.Light.lamp(lamp))
    c = points @ FRONT.R.T @ lamp
    # the derivative in the angle is at most 1/2 + 15/16; normals of the facets are off by 0.8 degrees near the poles
    off = np.linalg.norm(vertex_normals(points, faces) - points, axis=1)
    assert off.max() < 0.014
    gap = np.abs(found - (3 / 32 + c / 2 + 15 / 32 * c * c))
    assert (gap <= 23 / 16 * 1.001 * off + 1e-14).all()


@given(rotation_vectors(), directions())
def test_turning_face_and_lamp_together_changes_nothing(r, lamp):
    model, R = bumpy_model(rings=8, around=12), rotation_matrix(r)
    still = fa.shade(model.mean, model.faces, FRONT, fa.Light.lamp(lamp))
    turned = replace(FRONT, R=R @ FRONT.R)
    moved = fa.shade(model.mean, model.faces, turned, fa.Light.lamp(R @ lamp))
    np.testing.assert_allclose(moved, still, atol=1e-13)


@given(rotation_vectors())
def test_what_a_light_explains_does_not_depend_on_the_axes(r):
    # orders do not mix under rotation: the nine functions span the same shadings in all axes
    model, R = bumpy_model(rings=8, around=12), rotation_matrix(r)
    normals, rng = vertex_normals(model.mean, model.faces), np.random.default_rng(1)
    target, weights = rng.uniform(size=len(normals)), rng.uniform(size=len(normals))
    still, turned = (
        best_light(target, n, weights)[0].irradiance(n) for n in (normals, normals @ R.T)
    )
    np.testing.assert_allclose(turned, still, atol=1e-10)


@given(lights)
@settings(max_examples=20)  # 50 ms each: both cameras' visibility
def test_on_the_same_face_the_known_light_is_found(light):
    fit, _, _ = photographed()
    if np.abs(light.coefficients[1:]).max() < 1e-3:
        light = light + SIDE
    found = fa.explain_shading(fit, fit.vertices(), fit.camera, light)
    assert found.rank == 9
    np.testing.assert_allclose(found.light.coefficients, light.coefficients, atol=1e-10)
    assert found.residual < 1e-10
    assert found.kept_residual < 1e-10
    assert found.fraction == pytest.approx(1.0, abs=1e-15)


def test_explained_is_the_weighted_optimum_and_counts_only_what_both_cameras_see():
    fit, face, camera = photographed()
    found = fa.explain_shading(fit, face.vertices, camera, SIDE)
    T = fit.model.faces
    both = visible_vertices(T, face.vertices, camera) & visible_vertices(
        T, fit.vertices(), fit.camera
    )
    used = found.weights > 0
    assert 0.3 < used.mean() < 0.8
    assert not (used & ~both).any()
    # normal equations, no lstsq
    normals = (vertex_normals(fit.vertices(), T) @ fit.camera.R.T)[used]
    H, w = KERNEL * harmonics(normals), found.weights[used]
    light = np.linalg.solve(H.T @ (w[:, None] * H), H.T @ (w * found.target[used]))
    np.testing.assert_allclose(found.light.coefficients, light, atol=1e-8)
    gap = found.target[used] - H @ light
    mean = (w * found.target[used]).sum() / w.sum()
    variance = (w * (found.target[used] - mean) ** 2).sum()
    assert found.fraction == pytest.approx(1 - (w * gap**2).sum() / variance, abs=1e-12)
    assert found.residual_percent == pytest.approx(
        100 * np.sqrt((w * gap**2).sum() / w.sum()) / mean, rel=1e-10
    )
    kept = found.target[used] - SIDE.irradiance(normals)
    assert found.kept_fraction == pytest.approx(1 - (w * kept**2).sum() / variance, abs=1e-12)


def test_hidden_vertices_do_not_count():
    # whatever the part of the true face that is not compared, the answer is the same
    fit, face, camera = photographed()
    found = fa.explain_shading(fit, face.vertices, camera, SIDE)
    T = fit.model.faces
    hidden = ~visible_vertices(T, face.vertices, camera)
    inner = hidden & ~np.isin(np.arange(len(hidden)), T[~hidden[T].all(axis=1)])
    assert inner.sum() > 100
    # by little, or they would hide others
    moved = face.vertices + 5e-5 * inner[:, None] * np.random.default_rng(0).normal(
        size=face.vertices.shape
    )
    again = fa.explain_shading(fit, moved, camera, SIDE)
    assert again.residual == pytest.approx(found.residual, rel=1e-9)


@given(lights)
@settings(max_examples=20)  # 50 ms each: both cameras' visibility
def test_best_light_is_never_worse_than_the_known_one_or_the_mean(light):
    fit, face, camera = photographed()
    found = fa.explain_shading(fit, face.vertices, camera, light + SIDE)
    assert found.residual <= min(found.kept_residual, 1.0) + 1e-12


def test_evaluation_region_bounds_what_is_compared():
    fit, face, camera = photographed()
    part = np.arange(200)
    bounded = replace(fit, model=replace(fit.model, evaluation=part))
    found = fa.explain_shading(bounded, face.vertices, camera, SIDE)
    assert found.weights[part].any()
    assert not found.weights[200:].any()


def test_weights_are_the_area_in_the_picture():
    # a ball seen from far away: pi r^2 s^2, less the ring of facets at its edge
    points, faces = globe()
    fit, _, _ = photographed()
    model = replace(
        bumpy_model(), control_mean=0.1 * points, control_modes=np.zeros((len(points), 3, 1)),
        faces=faces.astype(np.uint32),
    )  # fmt: skip
    ball = replace(fit, model=model, alpha=np.zeros(1), camera=FRONT)
    found = fa.explain_shading(ball, 0.1 * points, FRONT, SIDE)
    assert found.weights.sum() == pytest.approx(np.pi * 150.0**2, rel=0.02)


def test_plane_tells_one_number_of_the_light():
    normals = np.tile([0.0, 0.0, -1.0], (50, 1))
    light, rank = best_light(np.full(50, 0.6), normals, np.ones(50))
    assert rank == 1
    np.testing.assert_allclose(light.irradiance(normals), 0.6, rtol=1e-14)
    # of all lights that do it the least: along the one direction in coefficients that the plane sees
    seen = (KERNEL * harmonics(normals[:1]))[0]
    np.testing.assert_allclose(light.coefficients, 0.6 * seen / (seen @ seen), atol=1e-14)
    rng = np.random.default_rng(0)
    target = rng.uniform(size=50)
    light, _ = best_light(target, normals, np.ones(50))
    np.testing.assert_allclose(light.irradiance(normals), target.mean(), rtol=1e-14)


def test_cylinder_tells_five():
    # normals on a circle: 1, cos, sin, cos 2, sin 2
    turn = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    normals = np.stack([np.cos(turn), 0 * turn, np.sin(turn)], axis=1)
    light, rank = best_light(SIDE.irradiance(normals), normals, np.ones(60))
    assert rank == 5
    np.testing.assert_allclose(light.irradiance(normals), SIDE.irradiance(normals), atol=1e-13)


def test_embedded_subject_from_30_cm_is_mostly_explained_on_the_face_at_120_cm(embedded):
    # benchmarks/shading.py has the table: 0.92 to 0.99 for the embedded head's subjects
    face = embedded.subject(3)
    fit = fa.fit(embedded, fa.observe(face, distance=0.3), distance=1.2)
    camera = portrait_camera(face, distance=0.3)
    found = fa.explain_shading(fit, face.vertices, camera, SIDE)
    assert 0.85 < found.fraction < 0.999
    assert found.kept_fraction < found.fraction - 0.01


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"fit": None}, "fit: None is not a Fit"),
        ({"camera": 0.3}, "camera: 0.3 is not a Camera"),
        ({"light": [1.0] * 9}, "light: .* is not a Light"),
        ({"truth": np.zeros((5, 3))}, "truth: 5 vertices for a fit of"),
        ({"truth": np.zeros((5, 2))}, r"truth: expected shape \(n, 3\)"),
        ({"light": fa.Light.sky(1.0)}, "light: the same everywhere"),
        ({"light": fa.Light.sky(0.0)}, "light: the same everywhere"),
        ({"camera": replace(FRONT, kappa=100.0)}, "truth: part of the face lies behind"),
    ],
)
def test_bad_questions_are_one_line(change, message):
    fit, face, camera = photographed(0.0)
    asked = {"fit": fit, "truth": face.vertices, "camera": camera, "light": SIDE} | change
    with pytest.raises(ValueError, match=message) as error:
        fa.explain_shading(**asked)
    assert "\n" not in str(error.value)


def test_photograph_from_behind_has_nothing_to_compare():
    fit, face, _ = photographed()
    front = replace(fit, model=replace(fit.model, evaluation=np.arange(20)))
    with pytest.raises(ValueError, match="truth: no vertex is seen by both cameras"):
        fa.explain_shading(front, face.vertices, replace(FRONT, R=np.eye(3)), SIDE)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: fa.Light(np.zeros(4)), r"coefficients: expected shape \(9\), found \(4,\)"),
        (lambda: fa.Light(np.full(9, np.nan)), "coefficients: every value must be finite"),
        (lambda: fa.Light.lamp((0, 0, 0)), "direction: .* does not point anywhere"),
        (lambda: fa.Light.lamp((0, 1)), "direction: expected shape"),
        (lambda: fa.Light.lamp((0, 0, 1), -1), "strength: -1 is not at least 0"),
        (lambda: fa.Light.sky(np.inf), "radiance: inf is not at least 0 and finite"),
        (lambda: fa.Light.sky(WORD), "radiance: 'bright' is not a number"),
        (lambda: fa.shade(np.zeros((3, 3)), [[0, 1, 3]], FRONT, SIDE), "faces: 0 to 3 is not"),
        (lambda: fa.shade(np.zeros((3, 3)), [[0.5, 1, 2]], FRONT, SIDE), "faces: expected vertex"),
        (lambda: fa.shade(np.zeros(3), [[0, 1, 2]], FRONT, SIDE), "vertices: expected shape"),
        (lambda: fa.shade(np.zeros((3, 3)), [[0, 1, 2]], NOTHING, SIDE), "camera: None is not"),
        (lambda: fa.shade(np.zeros((3, 3)), [[0, 1, 2]], FRONT, NOTHING), "light: None is not"),
    ],
)
def test_bad_lights_and_surfaces_are_one_line(make, message):
    with pytest.raises(ValueError, match=message) as error:
        make()
    assert "\n" not in str(error.value)
