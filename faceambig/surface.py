"""How directions of alpha move the measured surface: Gram matrix, millimetres, and words for what moves.

The measured surface is the model's evaluation region, the one d_S is taken on. Rigidly aligned means that the motion
tau + omega x v that lays each direction best on the unmoved face is taken out: d_S to first order (MATH.md 6).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import solve_triangular

from .arrays import Array, read_only
from .model import FaceModel

# Of the mean movement of a part: away from the middle on both sides, up, forward, towards the subject's left
DIRECTIONS = (("wider", "narrower"), ("up", "down"), ("forward", "back"), ("left", "right"))
DEPTH = 2
NOTHING = 1e-6  # of the mean surface movement: parts that move less in depth do not give a direction its sign
# Of a direction's own variance: what is left of it beside the others, below which it is one of them
DEPENDENT = 1e-12
# Rows of the scheme ibug68, for models that name no region of their own
LANDMARK_GROUPS = {
    "jaw": range(17), "brows": range(17, 27), "nose": range(27, 36), "eyes": range(36, 48), "mouth": range(48, 68),
}  # fmt: skip


@lru_cache(maxsize=4)  # 22 MB each
def _rows(model: FaceModel) -> Array:
    """Modes (S, 3, E) of the evaluation region: in this order a few directions move it in 0.6 of the time."""
    return read_only(np.ascontiguousarray(model.rows(_measured(model))[1].transpose(2, 1, 0)))


def evaluation_modes(model: FaceModel) -> Array:
    """Modes (E, 3, S) of the evaluation region, metres per standard deviation; a view of (S, 3, E)."""
    return _rows(model).transpose(2, 1, 0)


@lru_cache(maxsize=8)
def gram(model: FaceModel) -> Array:
    """G = Q^T Q (S, S) over the evaluation region, m^2."""
    Q = _rows(model).reshape(model.n_modes, -1)
    return read_only(Q @ Q.T)


@lru_cache(maxsize=16)
def _whitening(model: FaceModel, S: int) -> Array:
    return whitening(gram(model)[:S, :S])


def whitening(G: Array) -> Array:
    """W (S, S) upper triangular with W^T G W = I; ValueError if a mode moves the surface no way of its own."""
    try:
        C = np.linalg.cholesky(G)
    except np.linalg.LinAlgError:
        C = np.zeros_like(G)
    if (np.diag(C) ** 2 <= DEPENDENT * np.diag(G)).any():
        raise ValueError(
            f"model: its {len(G)} modes move the measured surface in fewer ways than that; "
            "truncate it or enlarge its evaluation region"
        )
    return read_only(solve_triangular(C, np.eye(len(G)), lower=True, check_finite=False).T)


@dataclass(frozen=True, slots=True, eq=False)
class Bending:
    """How alpha moves the measured surface of one face. S coefficients."""

    model: FaceModel
    G: Array  # (S, S) m^2: f^T G f is the sum of squared movements
    W: Array  # (S, S), W^T G W = I
    face: Array | None  # (N, 3) metres, the face whose rigid motion is taken out; None: none is
    centre: Array  # (3,) metres
    motion: Array  # (6, S) the rigid motion in each coefficient: tau (3,), omega (3,)

    def moved(self, F: Array) -> Array:
        """(K, 3, E) metres: movement of the measured surface along the columns of F (S, K)."""
        S, K = F.shape
        moved = F.T @ _rows(self.model)[:S].reshape(S, -1)
        if self.face is not None:
            field = rigid_field(self.face[_measured(self.model)] - self.centre)
            moved -= (self.motion @ F).T @ field.reshape(6, -1)
        return moved.reshape(K, 3, -1)

    def mean_change(self, F: Array) -> Array:
        """(K,) metres: mean movement of the measured surface along each column of F (S, K)."""
        moved = self.moved(F)
        np.multiply(moved, moved, out=moved)
        squares = moved[:, 0]
        squares += moved[:, 1]
        squares += moved[:, 2]
        return np.sqrt(squares, out=squares).mean(axis=1)

    def parts(self, F: Array) -> dict[str, Array]:
        """Mean movement (4, K) of each named part, in the order of DIRECTIONS, metres."""
        moves = {}
        for name, vertices, outward, rows in _parts(self.model):
            change = rows[:, : len(F)] @ F
            if self.face is not None:
                field = rigid_field(self.face[vertices] - self.centre)
                change -= _means(outward, field) @ (self.motion @ F)
            moves[name] = change
        return moves


def bending(model: FaceModel, alpha: Array, *, aligned: bool) -> Bending:
    """How alpha (S,) moves the measured surface, rigid motion included or, `aligned`, taken out."""
    S = len(alpha)
    G = gram(model)[:S, :S]
    if not aligned:
        return Bending(model, G, _whitening(model, S), None, np.zeros(3), np.zeros((6, S)))
    face = model.vertices(alpha)
    measured = face[_measured(model)]
    centre = measured.mean(axis=0)
    field = rigid_field(measured - centre).reshape(6, -1)
    pull = _rows(model)[:S].reshape(S, -1) @ field.T
    motion = np.asarray(np.linalg.solve(field @ field.T, pull.T), dtype=np.float64)
    G = G - pull @ motion
    return Bending(model, G, whitening(G), face, centre, motion)


def rigid_field(v: Array) -> Array:
    """(6, 3, n) movement of points v (n, 3) by each of tau (3,) and omega (3,): tau + omega x v."""
    x, y, z = v.T
    field = np.zeros((6, 3, len(v)))
    field[[0, 1, 2], [0, 1, 2]] = 1.0
    field[3, 1], field[3, 2] = -z, y
    field[4, 0], field[4, 2] = z, -x
    field[5, 0], field[5, 1] = -y, x
    return field


def _measured(model: FaceModel) -> np.ndarray:
    return np.arange(model.n_vertices) if model.evaluation is None else model.evaluation


@lru_cache(maxsize=8)
def _parts(model: FaceModel) -> tuple[tuple[str, np.ndarray, Array, Array], ...]:
    """(name, vertices (n,), side of each (n,), mean movement (4, S) by each mode) of the parts that words may name.

    The regions that d_S measures and the ears: the back of the head is free to follow and would always be the loudest.
    A model without regions has the groups of its landmarks, and without those one part, "face".
    """
    every = _measured(model)
    parts = {
        name: vertices
        for name, vertices in model.regions.items()
        if name == "ears" or np.isin(vertices, every).mean() > 0.5
    }
    if not parts and "ibug68" in model.schemes:
        vertices = model.schemes["ibug68"].vertices
        parts = {name: vertices[list(rows)] for name, rows in LANDMARK_GROUPS.items()}
    answer = []
    for name, vertices in (parts or {"face": every}).items():
        mean, modes = model.rows(vertices)
        outward = np.sign(mean[:, 0])  # +1 left, -1 right
        answer.append(
            (name, vertices, outward, read_only(_means(outward, modes.transpose(2, 1, 0))))
        )
    return tuple(answer)


def _means(outward: Array, movements: Array) -> Array:
    """(4, k) means of movements (k, 3, n) in the order of DIRECTIONS."""
    x, y, z = movements.mean(axis=2).T
    return np.stack([movements[:, 0] @ outward / len(outward), y, z, x])


def sign(f: Array, mean_change: float, moves: dict[str, Array], k: int) -> float:
    """+1 or -1: turns direction f (S,), column k of `moves`, so that the part that moves most in depth comes forward.

    Where no part moves in depth, as when left and right change against each other, the largest coefficient is positive.
    """
    depth = max((change[DEPTH, k] for change in moves.values()), key=abs)
    if abs(depth) > NOTHING * mean_change:
        return float(np.sign(depth))
    return float(np.sign(f[np.argmax(np.abs(f))]))


def words(moves: dict[str, Array], k: int, sign: float) -> str:
    """Such as "nose forward, ears back": the two largest movements along column k, of two parts in two ways."""
    ordered = sorted(
        (
            (abs(change[axis, k]), name, axis, sign * change[axis, k] > 0)
            for name, change in moves.items()
            for axis in range(len(DIRECTIONS))
        ),
        reverse=True,
    )
    first = ordered[0]
    second = next((m for m in ordered[1:] if m[1] != first[1] and m[2:] != first[2:]), None)
    said = [m for m in (first, second) if m is not None and m[0] > 0.3 * first[0]]
    return ", ".join(
        f"{name} {DIRECTIONS[axis][0 if positive else 1]}" for _, name, axis, positive in said
    )
