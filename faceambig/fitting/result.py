"""What a fit is asked (FitOptions) and what it answers (Fit, Status)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Literal, get_args

import numpy as np

from ..arrays import Array, number, read_only, shown, whole
from ..camera import Camera, project
from ..metrics import mean_gap_percent
from ..model import FaceModel
from ..observation import Observation
from ..rotation import R0, axis_angle

DEFAULT_MODES = 70  # shape modes of a fit that names no number
Weighting = Literal["reprojection", "algebraic"]
Method = Literal["joint", "snls", "als"]
Jacobian = Literal["kaufman", "full"]


class Status(StrEnum):
    """How a fit ended; only CONVERGED is a result to rely on."""

    # The projected gradient vanishes: no step inside the box lowers the cost
    CONVERGED = "converged"
    MAX_STEPS = "step limit reached"
    STALLED = "no further decrease"  # the descent came to rest before the gradient vanished
    ROUNDS = "stopped after the given rounds"  # als_rounds of them, short of the optimum


@dataclass(frozen=True, slots=True)
class FitOptions:
    """Options of `fit`, in the units of a user. All have defaults."""

    # S, shape modes used; None: the strongest 70, or all of a model with fewer
    modes: int | None = None
    box: float | None = 2.0  # |alpha_j| <= box standard deviations; None: no box
    # Landmark sd per coordinate the prior assumes, % of the interocular distance
    noise_percent: float = 1.0
    prior_weight: float | None = None  # lambda in px^2 itself, instead of noise_percent
    tolerance: float = 1e-8  # relative cost above the optimum that still counts as converged
    max_steps: int = 100
    weighting: Weighting = "reprojection"  # of a landmark's residual
    method: Method = "joint"  # the solver, see `fit`
    jacobian: Jacobian = "kaufman"  # of the projected residual of SNLS
    als_rounds: int | None = 10  # rounds of method="als"; None: until a round gains nothing

    def __post_init__(self) -> None:
        # Python's own numbers from here on: equal options are equal, whatever type they were given in
        kinds = {"noise_percent": number, "tolerance": number, "max_steps": whole}
        kinds |= {"modes": whole, "box": number, "prior_weight": number, "als_rounds": whole}
        for name, kind in kinds.items():
            value = getattr(self, name)
            if value is not None or name in ("noise_percent", "tolerance", "max_steps"):
                object.__setattr__(self, name, kind(name, value))
        if self.modes is not None and self.modes < 1:
            raise ValueError(f"modes: {shown(self.modes)} is not at least 1")
        if self.box is not None and not 0 < self.box <= 10:
            raise ValueError(f"box: {self.box:g} is not within 0 to 10 standard deviations")
        if not 0.001 <= self.noise_percent <= 20:
            raise ValueError(f"noise_percent: {self.noise_percent:g} is not within 0.001 to 20")
        if self.prior_weight is not None and not 0 <= self.prior_weight < np.inf:
            raise ValueError(f"prior_weight: {self.prior_weight:g} is not a weight in px^2")
        if not 1e-14 <= self.tolerance <= 1e-2:
            raise ValueError(f"tolerance: {self.tolerance:g} is not within 1e-14 to 0.01")
        if self.max_steps < 1:
            raise ValueError(f"max_steps: {shown(self.max_steps)} is not at least 1")
        for name, kind in (("weighting", Weighting), ("method", Method), ("jacobian", Jacobian)):
            value = getattr(self, name)
            if not isinstance(value, str) or value not in get_args(kind):
                raise ValueError(f"{name}: {shown(value)} is not {' or '.join(get_args(kind))}")
        if self.als_rounds is not None and self.als_rounds < 1:
            raise ValueError(f"als_rounds: {shown(self.als_rounds)} is not at least 1")
        if self.weighting == "algebraic" and self.method == "als":
            raise ValueError(
                "method: 'als' has no algebraic weighting; leave method out and SNLS solves it"
            )

    @property
    def least_squares(self) -> bool:
        """Whether the answer is an optimum of E: not that of the algebraic residual, nor of rounds that stop short."""
        return self.weighting == "reprojection" and self.method != "als"

    def modes_of(self, model: FaceModel) -> int:
        """S, how many modes of `model` are used; ValueError if it has fewer than were asked for."""
        if self.modes is None:
            return min(DEFAULT_MODES, model.n_modes)
        if self.modes > model.n_modes:
            raise ValueError(
                f"modes: {shown(self.modes)} of a model with {model.n_modes}; "
                f"give at most {model.n_modes}, or none for its strongest {DEFAULT_MODES}"
            )
        return self.modes


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """Best face and camera for one observation. S modes, L landmarks."""

    model: FaceModel
    observation: Observation
    options: FitOptions
    camera: Camera  # (U); pixels from the principal point
    alpha: Array  # (S,) shape, in standard deviations
    residual: Array  # (L, 2) observed minus projected, pixels; NaN where not visible
    cost: float  # E of MATH.md 3: squared pixels, prior included, no factor 1/2; whatever the method and weighting
    prior_weight: float  # lambda, px^2
    interocular_px: float  # the distance d_L is a percentage of
    interocular_meaning: str
    steps: int  # of the solver; rounds of method="als"
    status: Status  # "converged" only if the projected gradient says so

    def __post_init__(self) -> None:
        for name in ("alpha", "residual"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def converged(self) -> bool:
        """Whether the result can be relied on."""
        return self.status is Status.CONVERGED

    @property
    def rotation(self) -> Array:
        """Axis-angle (3,), radians; 0 is a frontal face (MATH.md 1)."""
        return read_only(axis_angle(self.camera.R @ R0))

    @property
    def translation(self) -> Array:
        """(3,) metres, camera axes; (2,), t_2d, if orthographic."""
        t_z = self.camera.distance
        return self.camera.t if t_z is None else read_only(np.array([*self.camera.t, t_z]))

    @property
    def focal(self) -> float | None:
        """f in pixels, None if orthographic."""
        return self.camera.focal

    @property
    def scale(self) -> float | None:
        """Pixels per metre if orthographic, else None."""
        return self.camera.s if self.camera.kappa == 0 else None

    @property
    def distance(self) -> float | None:
        """t_z in metres, None if orthographic."""
        return self.camera.distance

    @property
    def d_l_percent(self) -> float:
        """d_L: mean landmark distance in percent of the interocular distance, over the visible points."""
        return mean_gap_percent(self.residual[self.observation.visible], self.interocular_px)

    def vertices(self) -> Array:
        """The fitted surface (N, 3), metres, model axes."""
        return self.model.vertices(self.alpha)

    def projected(self) -> Array:
        """(L, 2) pixels: the model's landmarks in the picture, those of missing points too."""
        mean, modes = self.model.rows(self.observation.vertices(self.model))
        points = mean + modes[:, :, : len(self.alpha)] @ self.alpha
        return project(self.camera, points) + self.observation.centre


@dataclass(frozen=True, slots=True, eq=False)
class Failure:
    """The row of a batch whose face could not be fitted."""

    observation: Observation
    message: str  # what `fit` says in its ValueError

    @property
    def converged(self) -> bool:
        """False: filter the rows of a batch by it."""
        return False
