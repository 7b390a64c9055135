"""The conclusions on forensics: distances between landmarks of two different faces agree, those of one face do not.

Anthropometric distances are measured in the picture and divided by the distance of the eyes, as in comparing two
photographs of unknown distance. First between people: the two of a crowd who agree best across distances, and each
person against themselves. Then of one picture: the true face, and the face fitted to it at a wrong distance.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from ..arrays import Array
from ..fitting import fit
from ..metrics import HUMAN_TOLERANCE_PERCENT, surface_difference
from ..model import FaceModel
from ..observation import eye_distance, observe
from .crowd import (
    FAR,
    NEAR,
    Complex,
    Points,
    eye_unit,
    pictured,
    random_people,
    surface_points,
)
from .heads import person, usual_scheme, who
from .parallel import Numbers, over_subjects
from .protocol import Cell, Chart, Claim, Experiment, Line, Outcome, Progress, Settings, Table

PEOPLE, QUICK_PEOPLE = 1000, 300
FACES, QUICK_FACES = 10, 3
ACTUAL, FITTED = 0.3, 1.2  # metres, of the fitted part
# Of the 68 points of iBUG, from 1: what Farkas measures between the nearest of his points
MEASURES = (
    ("face width (jaw, at the ears)", 1, 17),
    ("width at the mouth", 4, 14),
    ("gonial width", 5, 13),
    ("chin width", 7, 11),
    ("face height (nasion to chin)", 28, 9),
    ("lower face (subnasale to chin)", 34, 9),
    ("nose length", 28, 34),
    ("nose bridge", 28, 31),
    ("nose width", 32, 36),
    ("upper lip (subnasale to lip)", 34, 52),
    ("lips' height", 52, 58),
    ("mouth width", 49, 55),
    ("chin height (lip to chin)", 58, 9),
    ("outer eye corners", 37, 46),
    ("inner eye corners", 40, 43),
    ("brows, outer ends", 18, 27),
    ("right eye to mouth corner", 37, 49),
    ("left eye to mouth corner", 46, 55),
)


class Pair(NamedTuple):
    """Two people and how their measures agree."""

    i: int
    j: int
    mean: float  # percent of the eyes' distance


def run(settings: Settings, progress: Progress) -> Outcome:
    """Both parts, each with its table."""
    model, seed = settings.model, settings.seed
    if usual_scheme(model) != "ibug68":
        raise ValueError(f"model: {model.name} has no scheme ibug68, whose points are measured")
    n = max(2, settings.subjects(PEOPLE, QUICK_PEOPLE))
    scheme = model.scheme("ibug68")
    points = Points("68 points", np.arange(len(scheme)), scheme.eyes)
    at = surface_points(model, scheme, random_people(model, n, seed))
    near, far = (in_picture(pictured(at, distance), points) for distance in (NEAR, FAR))
    pair = most_alike(near, far)
    own = 100 * np.abs(near - far)
    faces = settings.subjects(FACES, QUICK_FACES)
    found = over_subjects(partial(fitted, seed=seed), range(1, faces + 1), settings, progress)
    return Outcome(
        "forensic",
        EXPERIMENT.title,
        (people_table(near, far, own, pair), fitted_table(found, who(settings, faces))),
        (chart(near, far, own, pair),),
        (),
        claims(own, 100 * np.abs(near[pair.i] - far[pair.j]), found),
        {
            "people": f"{n}, drawn from all modes, seed {seed}; from {100 * NEAR:.0f} and {100 * FAR:.0f} cm",
            "faces": who(settings, faces),
            "fit": f"of pictures from {100 * ACTUAL:.0f} cm at {100 * FITTED:.0f} cm; 70 modes, box 2 sd",
        },
    )


def in_picture(z: Complex, points: Points) -> Array:
    """(n, M) measures of pictures z (n, L) over the distance of the eyes."""
    a, b = np.array([ends for _, *ends in MEASURES]).T - 1
    return np.abs(z[:, a] - z[:, b]) / eye_unit(z, points)[:, None]


def on_face(points: Array) -> Array:
    """(M,) measures of a face's points (68, 3), metres."""
    a, b = np.array([ends for _, *ends in MEASURES]).T - 1
    return np.linalg.norm(points[a] - points[b], axis=1)


def most_alike(near: Array, far: Array) -> Pair:
    """The two different people whose measures (n, M), one from near and one from far, are closest in the mean."""
    mean = np.stack([np.abs(one - far).mean(axis=1) for one in near])
    np.fill_diagonal(mean, np.inf)
    i, j = divmod(int(mean.argmin()), len(mean))
    return Pair(i, j, 100 * float(mean[i, j]))


def fitted(model: FaceModel, number: int, *, seed: int) -> Numbers:
    """One picture's face and the face fitted to it at another distance: measures in the picture and on the face."""
    face = person(model, number, seed)
    seen = observe(face, distance=ACTUAL)
    found = fit(model, seen, distance=FITTED)
    scheme = model.scheme("ibug68")
    rows = scheme.vertices
    points = Points("", np.arange(len(rows)), scheme.eyes)
    xy = np.stack([seen.points, found.projected()])
    z = xy[..., 0] + 1j * xy[..., 1]
    true, other = in_picture(z, points)
    surface = found.vertices()
    return {
        "picture": 100 * (other - true),
        "true_mm": 1e3 * on_face(face.vertices[rows]),
        "fitted_mm": 1e3 * on_face(surface[rows]),
        "eyes_mm": 1e3
        * np.array([eye_distance(x[rows], scheme) for x in (face.vertices, surface)]),
        "d_l": np.array(found.d_l_percent),
        "d_s": np.array(surface_difference(surface, face.vertices, model.evaluation).mean_mm),
    }


def people_table(near: Array, far: Array, own: Array, pair: Pair) -> Table:
    """Each measure of the two most alike, and of a person and themselves."""
    i, j, _ = pair
    rows: list[tuple[Cell, ...]] = [
        (
            f"{m + 1} {name}", 100 * float(near[i, m]), 100 * float(far[j, m]), 100 * float(far[j, m] - near[i, m]),
            100 * float(far[i, m] - near[i, m]), float(own[:, m].mean()),
        )
        for m, (name, _, _) in enumerate(MEASURES)
    ]  # fmt: skip
    rows.append(
        ("mean of the differences", None, None, pair.mean, float(own[i].mean()), float(own.mean()))
    )
    a, b = f"{100 * NEAR:.0f} cm", f"{100 * FAR:.0f} cm"
    return Table(
        "Distances in the picture, percent of the distance of the eyes",
        (
            "measure", f"person {i + 1} from {a}", f"person {j + 1} from {b}", "difference",
            f"person {i + 1} from {b}, difference to themselves from {a}",
            "everybody to themselves, mean absolute difference",
        ),
        tuple(rows),
        "random people of the model; differences of the last row are absolute",
    )  # fmt: skip


def fitted_table(found: list[Numbers], people: str) -> Table:
    """Each measure of one picture's two faces, means over the subjects."""
    picture = np.abs([one["picture"] for one in found]).mean(axis=0)
    true, other = (np.array([one[name] for one in found]) for name in ("true_mm", "fitted_mm"))
    body, change = true.mean(axis=0), np.abs(other - true).mean(axis=0)
    eyes = np.array([one["eyes_mm"] for one in found])
    ratio = 100 * np.abs(other / eyes[:, 1:] - true / eyes[:, :1]).mean(axis=0)
    rows: list[tuple[Cell, ...]] = [
        (f"{m + 1} {name}", float(picture[m]), float(body[m]), float(change[m]), float(ratio[m]))
        for m, (name, _, _) in enumerate(MEASURES)
    ]
    rows.append(("mean", float(picture.mean()), None, float(change.mean()), float(ratio.mean())))
    d_l, d_s = (float(np.mean([one[name] for one in found])) for name in ("d_l", "d_s"))
    return Table(
        f"One picture from {100 * ACTUAL:.0f} cm: the true face and the face fitted at {100 * FITTED:.0f} cm",
        (
            "measure", "difference in the picture, % of the eyes' distance", "on the true face, mm",
            "difference of the faces, mm", "difference of the faces, % of their eyes' distance",
        ),
        tuple(rows),
        f"means of absolute differences over {people}; d_L {d_l:.2f} %, d_S {d_s:.1f} mm",
    )  # fmt: skip


def chart(near: Array, far: Array, own: Array, pair: Pair) -> Chart:
    """The differences of the pair and of everybody to themselves, measure by measure."""
    x = tuple(float(k) for k in range(len(MEASURES)))
    apart = 100 * np.abs(near[pair.i] - far[pair.j])
    return Chart(
        "Differences of distances in two pictures",
        "measure, by its number in the table",
        "% of the distance of the eyes",
        (
            Line("two different people", x, tuple(apart.tolist())),
            Line("the same person, mean of all", x, tuple(own.mean(axis=0).tolist())),
        ),
        bars=True,
        ticks=tuple(str(m + 1) for m in range(len(MEASURES))),
    )


def claims(own: Array, pair: Array, found: list[Numbers]) -> tuple[Claim, ...]:
    """The paper's conclusion, in its three parts; pair (M,): differences of the most alike, percent."""
    agree = int((pair < HUMAN_TOLERANCE_PERCENT).sum())
    picture = np.abs([one["picture"] for one in found]).mean(axis=0)
    worst_one = int(picture.argmax())
    worst = max(float(np.abs(one["picture"]).mean()) for one in found)
    change = float(np.mean([np.abs(one["fitted_mm"] - one["true_mm"]) for one in found]))
    d_s = float(np.mean([one["d_s"] for one in found]))
    return (
        Claim(
            "Distances of two different faces, normalised by the eyes, may agree",
            "in words",
            f"mean difference {pair.mean():.2f} %, largest {pair.max():.2f} %",
            float(pair.mean()) < HUMAN_TOLERANCE_PERCENT,
            f"In the mean: between two annotators {HUMAN_TOLERANCE_PERCENT:g} % are usual. The best pair of {len(own)} "
            f"people; {agree} of their {len(MEASURES)} measures agree so.",
        ),
        Claim(
            "and the same person's differ by more between two distances",
            "in words",
            f"mean over everybody {own.mean():.2f} %, largest of a measure {own.mean(axis=0).max():.2f} %",
            float(own.mean()) > float(pair.mean()),
            "Widths at the ears and the jaw change most, measures between inner points hardly.",
        ),
        Claim(
            "One picture leaves open faces with the same normalised distances and another shape",
            "in words",
            f"mean of the measures in the picture at most {worst:.2f} % of any subject, on the face {change:.1f} mm, "
            f"d_S {d_s:.1f} mm",
            worst < HUMAN_TOLERANCE_PERCENT and d_s > 1.0,
            f"In the mean over the measures, again: of the {MEASURES[worst_one][0]} it is {picture[worst_one]:.1f} %.",
        ),
    )


EXPERIMENT = Experiment("forensic", "Distances between landmarks as evidence", "section 7", run)
