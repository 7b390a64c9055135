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


def bumpy_model(rings: int = 24, around: int = 36, n_modes: int = 8) -> FaceModel:
    """An egg of head size with a nose, brows and ears, open at the back; smooth modes, 20 landmarks "egg" in front."""
    polar = np.linspace(0.0, 2.4, rings + 1)[1:]  # from the front; 2.4 rad: the back is open
    turn = np.linspace(0.0, 2 * np.pi, around, endpoint=False)
    grid = np.stack(np.meshgrid(polar, turn, indexing="ij"), axis=-1).reshape(-1, 2)
    polar, turn = np.concatenate([[[0.0, 0.0]], grid]).T
    ball = np.stack(
        [np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)], axis=1
    )
    bumps = ((0.0, -0.1, 1.0, 0.35), (0.35, 0.3, 0.85, 0.15), (-0.35, 0.3, 0.85, 0.15),
             (1.0, 0.0, 0.0, 0.3), (-1.0, 0.0, 0.0, 0.3))  # fmt: skip
    swell = np.ones(len(ball))
    for *at, height in bumps:
        swell += height * np.exp(-30.0 * ((ball - np.array(at)) ** 2).sum(axis=1))
    mean = ball * swell[:, None] * (0.075, 0.105, 0.085) - (0.0, 0.0, 0.085)
    rng = np.random.default_rng(3)
    modes = np.zeros((len(mean), 3, n_modes))
    for j in range(n_modes):  # waves along the sphere, half as strong each third one
        wave = np.cos(3.0 * ball @ rng.normal(size=3) + rng.uniform(0, 6))
        modes[:, :, j] = 0.004 * 0.5 ** (j / 3) * wave[:, None] * rng.normal(size=3)
    i, k = np.meshgrid(np.arange(rings - 1), np.arange(around), indexing="ij")
    here, beside = 1 + i * around + k, 1 + i * around + (k + 1) % around
    tip = np.arange(around)
    faces = np.concatenate([
        np.stack([np.zeros_like(tip), 1 + tip, 1 + (tip + 1) % around], axis=1),
        np.stack([here, here + around, beside], axis=-1).reshape(-1, 3),
        np.stack([beside, here + around, beside + around], axis=-1).reshape(-1, 3),
    ]).astype(np.uint32)  # fmt: skip
    front = np.flatnonzero(polar < 0.9)
    four = [int(np.argmin(np.linalg.norm(ball - np.array([x, 0.3, 0.9]), axis=1)))
            for x in (-0.45, -0.2, 0.2, 0.45)]  # fmt: skip
    rest = [v for v in rng.choice(front, 30, replace=False).tolist() if v not in four][:16]
    vertices = np.array(four + rest)
    scheme = Scheme(
        "egg",
        tuple(str(v) for v in vertices),
        vertices,
        ("mid",) * 20,
        ((0, 1), (2, 3)),
        "two each",
    )
    return FaceModel("egg", mean, modes, faces, {"egg": scheme})


def poses(number: int) -> list[tuple[float, float, float]]:
    """Yaw, pitch, roll in degrees: the whole circle of yaw, pitch within 50, any roll."""
    rng = np.random.default_rng(17)
    return [tuple(rng.uniform((-180, -50, -180), (180, 50, 180)).tolist()) for _ in range(number)]
