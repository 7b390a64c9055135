"""FaceModel: a mean face and its modes of variation, with named landmarks.

A face is v = mean + Q alpha, metres (paper, section 3.1). Q is already multiplied by one standard deviation per mode,
so alpha ~ N(0, I) and |alpha_j| <= k reads "k standard deviations". Axes: +x the subject's left, +y up, +z out of the
face; origin between the eyes of the mean head.

A model may be stored at a coarser *control* resolution (B vertices) with a linear subdivision operator to the N
vertices of the surface: rows of the operator sum to 1, so rigid motions and statistics commute with it. Everything
below is exact for both kinds; without an operator the control vertices are the surface.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from .arrays import Array, IntArray, checked, read_only, shown, whole
from .errors import listed


@dataclass(frozen=True, slots=True, eq=False)
class Scheme:
    """Named landmarks of one model: which vertex each point is."""

    name: str
    points: tuple[str, ...]  # L names, in the order of the picture's points
    vertices: IntArray  # (L,) vertex numbers of the surface
    sides: tuple[str, ...]  # L of "right", "left", "mid": the subject's
    # Rows whose mean is the centre of the right and of the left eye
    eyes: tuple[tuple[int, ...], tuple[int, ...]]
    eyes_meaning: str  # the definition of the interocular distance, printed with every d_L

    def __post_init__(self) -> None:
        vertices = np.asarray(self.vertices, dtype=np.intp)
        object.__setattr__(self, "vertices", read_only(vertices))

    def __len__(self) -> int:
        return len(self.points)

    def rows(self) -> list[tuple[str, str, int]]:
        """Name, side and vertex number of each point."""
        return list(zip(self.points, self.sides, self.vertices.tolist(), strict=True))


@dataclass(frozen=True, slots=True, eq=False)
class Subject:
    """One face of known shape, not made from the model's modes: the truth behind a synthetic photograph."""

    name: str
    about: str  # sex, age, ancestry: facts for the reader
    vertices: Array  # (N, 3) metres
    colours: NDArray[np.uint8] | None  # (N, 3) sRGB
    model: FaceModel

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", read_only(self.vertices))


@dataclass(frozen=True, slots=True, eq=False)
class FaceModel:
    """A statistical face model. S modes, B control vertices, N surface vertices, F triangles."""

    name: str
    control_mean: Array  # (B, 3) metres
    control_modes: Array  # (B, 3, S) metres per standard deviation
    faces: NDArray[np.uint32]  # (F, 3) triangles of the surface, wound outward
    schemes: Mapping[str, Scheme]
    subdivision: sparse.csr_array | None = None  # (N, B); None: control vertices are the surface
    coarse_faces: NDArray[np.uint32] | None = None  # (Fc, 3) over the first B surface vertices
    colours: NDArray[np.uint8] | None = None  # (N, 3) sRGB
    occlusion: NDArray[np.uint8] | None = None  # (N,) ambient occlusion, 255 is fully open
    evaluation: IntArray | None = None  # (E,) vertices that d_S is measured on; None: all
    regions: Mapping[str, IntArray] = field(default_factory=dict)  # parts of the face, by name
    subjects: tuple[Subject, ...] = ()
    licence: str = ""
    source: str = ""
    unit: str = ""  # of the file it was read from, in words; everything here is metres
    # (3,) metres, where the file's own origin lies in these coordinates
    file_origin: Array = field(default_factory=lambda: np.zeros(3))
    mean: Array = field(init=False)  # (N, 3) metres

    def __post_init__(self) -> None:
        for name in ("control_mean", "control_modes", "faces"):
            object.__setattr__(self, name, read_only(getattr(self, name)))
        object.__setattr__(self, "mean", read_only(self.refine(self.control_mean)))
        object.__setattr__(
            self, "subjects", tuple(replace(subject, model=self) for subject in self.subjects)
        )

    @property
    def n_modes(self) -> int:
        """S, the number of modes."""
        return self.control_modes.shape[2]

    @property
    def n_vertices(self) -> int:
        """N, the number of vertices of the surface."""
        return self.mean.shape[0]

    def refine(self, control: Array) -> Array:
        """Surface positions (N, 3) or (N, k) of control positions (B, 3) or (B, k)."""
        return control if self.subdivision is None else self.subdivision @ control

    def vertices(self, alpha: ArrayLike) -> Array:
        """Surface (N, 3), metres, of shape coefficients alpha (k,), k <= S standard deviations."""
        return self.refine(self.control_vertices(alpha))

    def control_vertices(self, alpha: ArrayLike) -> Array:
        """Control positions (B, 3), metres, of shape coefficients alpha (k,), k <= S."""
        a = checked("alpha", alpha, (None,))
        if len(a) > self.n_modes:
            raise ValueError(f"alpha: {len(a)} values for a model of {self.n_modes} modes")
        # One matrix-vector product: six times faster than B of them
        flat = self.control_modes.reshape(-1, self.n_modes)
        return self.control_mean + (flat[:, : len(a)] @ a).reshape(-1, 3)

    def rows(self, vertices: IntArray) -> tuple[Array, Array]:
        """Mean (L, 3) and modes (L, 3, S) of the surface vertices `vertices` (L,), metres."""
        if self.subdivision is None:
            return self.control_mean[vertices], np.ascontiguousarray(self.control_modes[vertices])
        weights = self.subdivision[vertices]
        modes = weights @ self.control_modes.reshape(len(self.control_mean), -1)
        return weights @ self.control_mean, modes.reshape(len(vertices), 3, self.n_modes)

    def scheme(self, name: str) -> Scheme:
        """The named landmark scheme; ValueError lists those the model has."""
        if not isinstance(name, str) or name not in self.schemes:
            known = listed(self.schemes) if self.schemes else "none"
            raise ValueError(f"unknown scheme {shown(name)}: this model has {known}")
        return self.schemes[name]

    def subject(self, number: int) -> Subject:
        """Out-of-sample subject `number`, counted from 1; ValueError if there is none."""
        number = whole("subject", number)
        if not self.subjects:
            raise ValueError(f"model {self.name!r} has no subjects")
        if not 1 <= number <= len(self.subjects):
            raise ValueError(f"unknown subject {shown(number)}: 1 to {len(self.subjects)}")
        return self.subjects[number - 1]

    def truncate(self, n_modes: int) -> FaceModel:
        """The same model with its first `n_modes` modes."""
        if not 1 <= n_modes <= self.n_modes:
            raise ValueError(f"modes: {n_modes} is not within 1 to {self.n_modes}")
        return replace(self, control_modes=self.control_modes[:, :, :n_modes])
