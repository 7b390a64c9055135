"""What docs/ambiguity.md shows, computed on the embedded head: each function once a process, seconds all together."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

import faceambig as fa
from faceambig import compose
from faceambig.arrays import Array
from faceambig.flex import plausible_limit
from faceambig.metrics import HUMAN_TOLERANCE_PERCENT, mean_gap_percent, surface_difference

ACTUAL = (0.3, 0.6, 1.2, 2.4)  # metres, the photographs of the curves
FITTED = np.array([0.2, *(0.3 * 2.0 ** (np.arange(-2, 14) / 4))])  # metres; ACTUAL are among them
TABLE = (0.3, 0.6, 1.2, 2.4, None)  # metres, of the table; None: orthographic
ROW = (0.2, *TABLE)  # metres, the faces of the row
LOW = 0.01  # px^2: the paper's low weight of the prior; the library's own is 1, for noise of 1 %
SUBJECT = 3  # of all pictures of one face
PHOTOGRAPHS = (0.3, 1.0, 3.0)  # metres, those whose distance is guessed
NOISE = 1.0  # of their points, % of the eye distance per coordinate
CLICKED = HUMAN_TOLERANCE_PERCENT / 1.2533  # of two people's: a mean distance as sd per coordinate
SEED = 1
EXTREME = 0.6  # metres
BENT_MM = 10.0  # the paper's weight of flexibility modes


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """Fits of every subject, photographed at one distance. D distances and, last, the orthographic camera."""

    actual: float  # metres
    d_l_percent: Array  # (10, D + 1)
    d_s_mm: Array  # (10, D + 1)

    def at(self, distance: float | None) -> int:
        """The column of a distance of FITTED, metres; None: orthographic."""
        return -1 if distance is None else int(np.argmin(np.abs(FITTED - distance)))


@dataclass(frozen=True, slots=True, eq=False)
class Bent:
    """A fit moved along its first flexibility mode."""

    mm: float
    face: compose.Face
    size: float  # |alpha|
    landmark_percent: float  # its points from those of the fit, mean, % of the eye distance
    d_s_mm: float  # from the fit


@dataclass(frozen=True, slots=True, eq=False)
class Modes:
    """The first flexibility mode under one camera."""

    distance: float | None  # metres; None: orthographic
    words: str
    limit: float  # largest |alpha| of a plausible face
    # -10 mm, the lower end of the plausible range, the fit, the upper end, +10 mm
    faces: tuple[Bent, ...]


@cache
def model() -> fa.FaceModel:
    return fa.load_model("embedded")


@cache
def paths(prior_weight: float | None = None) -> tuple[Path, ...]:
    """The curves: ten subjects, four photographs each, without noise; px^2, None: the library's own."""
    answer = []
    for actual in ACTUAL:
        lines = []
        for number in range(1, len(model().subjects) + 1):
            face = model().subject(number)
            seen = fa.observe(face, distance=actual)
            sweep = fa.sweep_distance(model(), seen, FITTED, prior_weight=prior_weight)
            curve = compose.curves(face, sweep, actual)
            lines.append(
                (
                    np.append(curve.d_l_percent, curve.orthographic[0]),
                    np.append(curve.d_s_mm, curve.orthographic[1]),
                )
            )
        d_l, d_s = (np.array(values) for values in zip(*lines, strict=True))
        answer.append(Path(actual, d_l, d_s))
    return tuple(answer)


@cache
def row() -> tuple[compose.Face, ...]:
    """One subject photographed from 30 cm, fitted at the distances of ROW."""
    face = model().subject(SUBJECT)
    seen = fa.observe(face, distance=ACTUAL[0])
    fits = [
        fa.fit(model(), seen, camera="orthographic")
        if distance is None
        else fa.fit(model(), seen, distance=distance)
        for distance in ROW
    ]
    return tuple(compose.measure(face, fit) for fit in fits)


@cache
def modes(distance: float | None) -> Modes:
    """The first flexibility mode of a fit at the true distance, metres; None: orthographic."""
    face = model().subject(SUBJECT)
    seen = fa.observe(face, distance=distance)
    if distance is None:
        fit = fa.fit(model(), seen, camera="orthographic")
    else:
        fit = fa.fit(model(), seen, distance=distance)
    found = fa.flexibility_modes(model(), fit, 1)
    limit = plausible_limit(len(fit.alpha))
    still = compose.measure(face, fit)
    low, high = found.reach(0)
    faces = []
    for mm in (-BENT_MM, low, 0.0, high, BENT_MM):
        # one rounding inside the limit: reach ends on it
        bend = mm * found.directions[0] * (1.0 - 1e-9)
        bent = compose.measure(face, fit, bend, limit=limit)
        apart = surface_difference(bent.own_vertices, still.own_vertices, model().evaluation)
        moved = mean_gap_percent(bent.projected - still.projected, fit.interocular_px)
        size = float(np.linalg.norm(fit.alpha + bend))
        faces.append(Bent(mm, bent, size, moved, apart.mean_mm))
    return Modes(distance, found.words[0], limit, tuple(faces))


@cache
def posterior(actual: float, *, noise: float = NOISE, exact: bool = False) -> fa.Posterior:
    """What a photograph of one subject from `actual` metres leaves open; sigma is `noise` % also for exact points."""
    drawn = 0.0 if exact else noise
    seen = fa.observe(model().subject(SUBJECT), distance=actual, noise_percent=drawn, seed=SEED)
    return fa.posterior(model(), seen, noise_percent=noise)


@cache
def spread(actual: float) -> tuple[Array, fa.SurfaceSpread]:
    """Posterior sd (E,) mm of the measured vertices, and what shape, pose and distance contribute at the true one."""
    found = posterior(actual)
    seen = found.sweep.orthographic.observation
    fit = fa.fit(model(), seen, distance=actual, modes=model().n_modes, box=None)
    return found.vertex_sd_mm[model().evaluation], fa.surface_spread(model(), fit)


@cache
def extremes(pose: str) -> fa.ExtremeFaces:
    """The two extreme faces of one photograph at 3 %."""
    seen = fa.observe(model().subject(SUBJECT), distance=EXTREME)
    return fa.extreme_faces(model(), fa.fit(model(), seen, distance=EXTREME), pose=pose)


def said(distance: float | None) -> str:
    """Centimetres below a metre, metres above, of two digits."""
    if distance is None:
        return "far away"
    return f"{100 * distance:.0f} cm" if distance < 0.995 else f"{distance:.2g} m"


def between(interval: fa.DistanceInterval) -> str:
    """The ends of an interval, one of them may be open."""
    if interval.high is None:
        return f"from {said(interval.low)}, no end"
    return f"{said(interval.low)} to {said(interval.high)}"
