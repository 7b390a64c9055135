"""Fig. 4a: how far the landmarks seen from a distance are from those of an orthographic camera."""

from __future__ import annotations

from functools import partial

import numpy as np

from ..arrays import Array, IntArray
from ..camera import Camera, project
from ..model import FaceModel, Scheme
from ..observation import eye_distance
from ..rotation import rotation_from_angles
from .heads import person, usual_scheme, who
from .parallel import over_subjects
from .protocol import Chart, Claim, Experiment, Line, Outcome, Progress, Settings, Table

DISTANCES = np.geomspace(0.3, 5.0, 25)  # metres
TOLD = (0.3, 0.6, 1.2, 2.5, 5.0)  # metres, of the table
FAR = 1.0  # metres: from here on the error goes like 1 / t_z
PAPER = 2.5  # metres, where the paper's curve falls below 1 %
INNER = "ibug68 without the jaw"
JAW = 17  # points


def run(settings: Settings, progress: Progress) -> Outcome:
    """The mean over the subjects, for each scheme of the model and for points without the contour."""
    n = settings.subjects(usual=10, quick=5)
    model = settings.model
    names = (*model.schemes, *((INNER,) if "ibug68" in model.schemes else ()))
    work = partial(differences, seed=settings.seed)
    found = over_subjects(work, range(1, n + 1), settings, progress)
    curves = {name: np.stack([one[name] for one in found]) for name in names}
    lines = tuple(
        Line(name, tuple((100 * DISTANCES).tolist()), tuple(each.mean(axis=0).tolist()))
        for name, each in curves.items()
    )
    chart = Chart(
        "Landmarks against those of an orthographic camera",
        "camera distance (cm)", "mean difference (% of the eye distance)", lines, log_x=True, log_y=True,
    )  # fmt: skip
    columns = ("points", *(f"{100 * at:g} cm" for at in TOLD), "below 1 % from (cm)")
    rows = [
        (name, *_at(each.mean(axis=0), TOLD), 100 * _crossing(each.mean(axis=0)))
        for name, each in curves.items()
    ]
    note = "after the best scale and shift; mean over the subjects"
    return Outcome(
        "fig4a",
        EXPERIMENT.title,
        (Table("Difference (% of the eye distance)", columns, tuple(rows), note),),
        (chart,),
        claims=_claims({name: each.mean(axis=0) for name, each in curves.items()}, model),
        settings={"subjects": who(settings, n), "view": "frontal, no noise"},
    )


def differences(model: FaceModel, number: int, *, seed: int) -> dict[str, Array]:
    """(D,) mean distance of the landmarks, percent of the eye distance, of one head, by scheme."""
    face = person(model, number, seed)
    found = {
        name: _difference(face.vertices[scheme.vertices], scheme, np.arange(len(scheme)))
        for name, scheme in model.schemes.items()
    }
    if "ibug68" in model.schemes:
        scheme = model.schemes["ibug68"]
        inner = np.arange(JAW, len(scheme))
        found[INNER] = _difference(face.vertices[scheme.vertices], scheme, inner)
    return found


def _difference(points: Array, scheme: Scheme, rows: IntArray) -> Array:
    """(D,) of landmarks `rows` of points (L, 3)."""
    R = rotation_from_angles(0, 0, 0)

    def seen(kappa: float) -> Array:
        return project(Camera(R, np.zeros(2), 1.0, kappa), points)

    far = seen(0.0)
    unit = eye_distance(far, scheme)
    target = far[rows] - far[rows].mean(axis=0)
    gaps = []
    for distance in DISTANCES:
        near = seen(1 / distance)[rows]
        near = near - near.mean(axis=0)
        near *= np.vdot(near, target) / np.vdot(near, near)  # the best scale; the shift is the mean
        gaps.append(np.linalg.norm(near - target, axis=1).mean())
    return 100 * np.array(gaps) / unit


def _at(curve: Array, distances: tuple[float, ...]) -> list[float]:
    return np.exp(np.interp(np.log(distances), np.log(DISTANCES), np.log(curve))).tolist()


def _crossing(curve: Array, percent: float = 1.0) -> float:
    """Metres from which the curve stays below; NaN if it does not get there."""
    above = np.flatnonzero(curve > percent)
    if not len(above):
        return float(DISTANCES[0])
    k = int(above[-1])
    if k == len(curve) - 1:
        return float("nan")
    share = np.log(curve[k] / percent) / np.log(curve[k] / curve[k + 1])
    return float(DISTANCES[k] * (DISTANCES[k + 1] / DISTANCES[k]) ** share)


def _claims(curves: dict[str, Array], model: FaceModel) -> tuple[Claim, ...]:
    far = DISTANCES >= FAR
    slopes = {
        name: float(np.polyfit(np.log(DISTANCES[far]), np.log(curve[far]), 1)[0])
        for name, curve in curves.items()
    }
    where = {name: 100 * _crossing(curve) for name, curve in curves.items()}
    usual = usual_scheme(model)
    falls = all(bool((np.diff(curve) < 0).all()) for curve in curves.values())
    return (
        Claim(
            "the difference falls with the distance, in the end like one over it",
            "a falling curve",
            "slope of the logarithms beyond 1 m: "
            + ", ".join(f"{slope:.2f} ({name})" for name, slope in slopes.items()),
            falls and all(abs(slope + 1) < 0.1 for slope in slopes.values()),
        ),
        Claim(
            "it falls below 1 % at about 2.5 m",
            f"about {100 * PAPER:g} cm",
            ", ".join(f"{at:.0f} cm ({name})" for name, at in where.items()),
            bool(0.5 * PAPER < where[usual] / 100 < 2 * PAPER),
            "The level belongs to the points: those of the jaw and the ears lie farther back than the eyes, and "
            f"inner points alone all have nearly one depth. The claim is taken by {usual}, within a factor of 2.",
        ),
    )


EXPERIMENT = Experiment(
    "fig4a", "Landmarks from near against an orthographic camera", "Fig. 4a", run
)
