"""Inputs of the property tests, drawn as numbers so that hypothesis can shrink them."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from faceambig.camera import Camera
from faceambig.model import FaceModel, Scheme, Subject
from faceambig.rotation import rotation_from_angles

# both sides of every switch and of every cancellation in rotation.py: uniform angles would never meet them
CORNER_ANGLES = (
    0.0,
    1e-160,
    1e-15,
    9.9e-16,
    1.1e-15,
    1e-9,
    1e-8,
    1e-4,
    1.0,
    2.69,
    2.70,
    np.pi - 1e-3,
    np.pi - 1e-9,
    np.pi,
)


def directions() -> st.SearchStrategy[np.ndarray]:
    """Unit vectors (3,)."""
    component = st.floats(-1, 1)
    vectors = st.tuples(component, component, component).filter(lambda v: np.linalg.norm(v) > 1e-2)
    return vectors.map(lambda v: np.array(v) / np.linalg.norm(v))


def rotation_vectors() -> st.SearchStrategy[np.ndarray]:
    """Axis-angle vectors (3,): the corner list, and angles log-uniform from 1e-9 to pi."""
    log_uniform = st.floats(np.log(1e-9), np.log(np.pi)).map(np.exp)
    return st.tuples(st.sampled_from(CORNER_ANGLES) | log_uniform, directions()).map(
        lambda p: p[0] * p[1]
    )


def cameras() -> st.SearchStrategy[Camera]:
    """Cameras that see a head: any pose, 0.25 m to orthographic."""
    angle = st.floats(-60, 60)
    kappa = st.just(0.0) | st.floats(np.log(0.25), np.log(5.0)).map(lambda x: float(np.exp(-x)))
    shift = st.floats(-0.05, 0.05)
    parts = st.tuples(angle, angle, angle, shift, shift, st.floats(500, 3000), kappa)
    return parts.map(lambda p: Camera(rotation_from_angles(*p[:3]), np.array(p[3:5]), p[5], p[6]))


def tiny_model(n_vertices: int = 30, n_modes: int = 5, seed: int = 0) -> FaceModel:
    """A random model of head size; every vertex is a landmark of scheme "all"."""
    rng = np.random.default_rng(seed)
    mean = rng.normal(scale=(0.05, 0.06, 0.03), size=(n_vertices, 3))
    modes = rng.normal(scale=0.004, size=(n_vertices, 3, n_modes))
    names = tuple(str(i) for i in range(n_vertices))
    eyes = ((0, 1), (2, 3))
    mean[[0, 1, 2, 3]] = [[-0.045, 0, 0], [-0.02, 0, 0.01], [0.02, 0, 0.01], [0.045, 0, 0]]
    scheme = Scheme(
        "all", names, np.arange(n_vertices), ("mid",) * n_vertices, eyes, "mean of two corners each"
    )
    faces = np.array([[i, i + 1, i + 2] for i in range(n_vertices - 2)], dtype=np.uint32)
    return FaceModel("tiny", mean, modes, faces, {"all": scheme})


def face_of(model: FaceModel, alpha: np.ndarray, name: str = "drawn") -> Subject:
    """A subject made of the model's own modes."""
    return Subject(name, "drawn from the model", model.vertices(alpha), None, model)
