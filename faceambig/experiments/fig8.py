"""Figure 8 and the identity statistics of section 6.2: the same person from near and from far, and other people.

With `archive`, the landmarks of the published Caltech Multi-Distance Portraits; without, random people of the model
photographed from the archive's distances. Two pictures are compared after the similarity that lays one on the other,
in percent of the eyes' distance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull

from ..arrays import Array, IntArray
from ..io.cmdp import MANUAL_EYES, Portraits, read_cmdp
from ..metrics import HUMAN_TOLERANCE_PERCENT
from .crowd import (
    DISTANCES,
    INNER,
    Complex,
    Points,
    all_apart_percent,
    apart_percent,
    crowd,
    noisy,
    pictured,
    point_sets,
    random_people,
    surface_points,
)
from .drawings import two_pictures
from .protocol import (
    Chart,
    Claim,
    Experiment,
    Image,
    Line,
    Outcome,
    Progress,
    Settings,
    Step,
    Table,
)

PEOPLE, QUICK_PEOPLE = 53, 24
NOISE_PERCENT = 1.0  # sd of each coordinate: a careful annotator
PAPER_SAME, PAPER_NEAR, PAPER_FAR, PAPER_PAIR = 3.11, 2.86, 2.83, 2.48
IBUG_EYES = ((36, 39), (42, 45))
# Of the eyes' distance: a point of the mean face nearer to its hull is one of the contour
OUTLINE = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """Pictures of the same people from several distances. n people, D distances."""

    name: str
    points: Points
    distances: Array  # (D,) metres, ascending
    z: tuple[Complex, ...]  # D of (n, all points)
    contour: bool


@dataclass(frozen=True, slots=True, eq=False)
class Statistics:
    """How far pictures are apart, percent of the eyes' distance. n people, D distances."""

    same: Array  # (D, n) a person from nearest and from each distance
    near: Array  # (n,) the nearest other person, both from nearest
    far: Array  # (n,) both from farthest
    # Share of people whose own picture from farthest is the closest to that from nearest
    found: float
    closest: tuple[int, int, float]  # two people, from nearest and from farthest


def run(settings: Settings, progress: Progress) -> Outcome:
    """The statistics of every set of points, without and with noise; the closest two people as a picture."""
    archive = settings.extra.get("archive")
    seen = published(read_cmdp(archive)) if archive else synthetic(settings)
    progress(Step("sets of points", 0, len(seen)))
    found = []
    for one in seen:
        found.append(statistics(one))
        progress(Step("sets of points", len(found), len(seen)))
    n = len(seen[0].z[0])
    if archive:
        people, noise, note = f"{n} of {archive}", "the archive's own", "published archive"
    else:
        people = f"{n}, drawn from all modes, seed {settings.seed}"
        noise = f"none, or {NOISE_PERCENT:g} % per coordinate"
        note = "random people of the model; the archive itself is not redistributed here"
    return Outcome(
        "fig8",
        EXPERIMENT.title,
        (table(seen, found, note),),
        (chart(seen[0], found[0]),),
        (picture(seen[0], found[0]),),
        claims(seen, found, bool(archive)),
        {
            "people": people,
            "noise": noise,
            "compared": "after the best shift, turn and scale; percent of the distance of the eyes",
        },
    )


def synthetic(settings: Settings) -> tuple[Seen, ...]:
    """Random people of the model from the archive's distances, each set of points without and with noise."""
    n = max(2, settings.subjects(PEOPLE, QUICK_PEOPLE))
    model, rng = settings.model, np.random.default_rng([settings.seed, 8])
    alpha = random_people(model, n, settings.seed)
    answer = []
    for scheme, points in point_sets(model):
        at = surface_points(model, scheme, alpha)
        z = tuple(pictured(at, distance) for distance in DISTANCES)
        contour = int(points.rows[0]) != INNER
        answer.append(Seen(points.name, points, np.array(DISTANCES), z, contour))
        drawn = tuple(noisy(each, points, NOISE_PERCENT, rng) for each in z)
        name = f"{points.name}, noise {NOISE_PERCENT:g} %"
        answer.append(Seen(name, points, np.array(DISTANCES), drawn, contour))
    return tuple(answer)


def published(portraits: Portraits) -> tuple[Seen, ...]:
    """The archive's 55 points set by hand and 68 detected ones, all and without the contour."""
    answer = [_of_archive("55 points by hand", portraits, portraits.manual, MANUAL_EYES)]
    inner = inner_rows(answer[0])
    answer.append(
        _of_archive("55 points, those inside", portraits, portraits.manual, MANUAL_EYES, inner)
    )
    if portraits.detected is not None:
        detected = portraits.detected
        answer.append(_of_archive("68 points by a detector", portraits, detected, IBUG_EYES))
        rows = np.arange(INNER, detected.shape[2])
        name = "points 18 to 68, no contour"
        answer.append(_of_archive(name, portraits, detected, IBUG_EYES, rows))
    return tuple(answer)


def _of_archive(
    name: str,
    portraits: Portraits,
    pixels: Array,
    eyes: tuple[tuple[int, ...], tuple[int, ...]],
    rows: IntArray | None = None,
) -> Seen:
    """People all of whose points are there from every distance."""
    whole = pixels[np.isfinite(pixels).all(axis=(1, 2, 3))]
    if len(whole) < 2:
        raise ValueError(f"archive: {len(whole)} people with all of the {name}; two are needed")
    chosen = np.arange(pixels.shape[2]) if rows is None else rows
    z = tuple(whole[:, d, :, 0] + 1j * whole[:, d, :, 1] for d in range(whole.shape[1]))
    return Seen(name, Points(name, chosen, eyes), portraits.distances, z, rows is None)


def inner_rows(seen: Seen) -> IntArray:
    """Points of the mean face away from its convex hull: no words say which of the 55 are on the contour."""
    c = crowd(seen.z[0], seen.points)
    # Every face laid on the first by a similarity, then their mean
    factor = (c.z.conj() @ c.z[0]) / (np.abs(c.z) ** 2).sum(axis=1)
    mean = (factor[:, None] * c.z).mean(axis=0) / c.eyes[0]
    xy = np.stack([mean.real, mean.imag], axis=1)
    equations = ConvexHull(xy).equations
    depth = -(xy @ equations[:, :2].T + equations[:, 2]).max(axis=1)
    return np.flatnonzero(depth > OUTLINE)


def statistics(seen: Seen) -> Statistics:
    """The paper's four numbers of one set of points."""
    pictures = [crowd(z, seen.points) for z in seen.z]
    near, far = pictures[0], pictures[-1]
    same = np.stack([apart_percent(near, each) for each in pictures])
    others = []
    for one in (near, far):
        apart = all_apart_percent(one, one)
        np.fill_diagonal(apart, np.inf)
        others.append(apart.min(axis=1))
    across = all_apart_percent(near, far)
    found = float((across.argmin(axis=1) == np.arange(len(across))).mean())
    np.fill_diagonal(across, np.inf)
    i, j = divmod(int(across.argmin()), len(across))
    return Statistics(same, others[0], others[1], found, (i, j, float(across[i, j])))


def table(seen: tuple[Seen, ...], found: list[Statistics], note: str) -> Table:
    """The paper's numbers, a row for each set of points."""
    n = len(seen[0].z[0])
    rows = tuple(
        (
            one.name, n, float(s.same[-1].mean()), float(s.near.mean()), float(s.far.mean()),
            100 * float((s.near < s.same[-1]).mean()), s.closest[2], 100 * s.found,
        )
        for one, s in zip(seen, found, strict=True)
    )  # fmt: skip
    near, far = (f"{100 * d:.0f} cm" for d in seen[0].distances[[0, -1]])
    return Table(
        "Landmarks of people in two pictures, mean distance in percent of the distance of the eyes",
        (
            "points", "people", f"same person, {near} and {far}", f"nearest other, both {near}",
            f"nearest other, both {far}", "% of people nearer to another than to themselves",
            f"closest two people across {near} and {far}", "% whose own picture is the closest",
        ),
        rows,
        note,
    )  # fmt: skip


def chart(seen: Seen, found: Statistics) -> Chart:
    """A person against themselves as the distance grows, beside the nearest other."""
    x = tuple((100 * seen.distances).tolist())
    flat = tuple(float(found.near.mean()) for _ in x)
    low, high = np.quantile(found.same, (0.1, 0.9), axis=1)
    own = Line(
        "the same person", x, tuple(found.same.mean(axis=1).tolist()), tuple(low.tolist()), tuple(high.tolist())
    )  # fmt: skip
    return Chart(
        f"{seen.name}: a person from {x[0]:.0f} cm and farther away; others from {x[0]:.0f} cm",
        "distance of the second picture in cm",
        "mean landmark distance in %; band: 80 % of the people",
        (own, Line("the nearest other", x, flat)),
    )


def picture(seen: Seen, found: Statistics) -> Image:
    """The landmarks of the two different people that are closest across the distances."""
    i, j, percent = found.closest
    a, b = (
        crowd(seen.z[0], seen.points).of(slice(i, i + 1)),
        crowd(seen.z[-1], seen.points).of(slice(j, j + 1)),
    )
    factor = (a.z.conj() * b.z).sum() / (np.abs(a.z) ** 2).sum()
    words = f"{percent:.2f} % apart: person {i + 1} from {100 * seen.distances[0]:.0f} cm (circles)"
    title = f"{words}, person {j + 1} from {100 * seen.distances[-1]:.0f} cm (crosses)"
    return Image(title, two_pictures(factor * a.z[0] / b.eyes[0], b.z[0] / b.eyes[0]))


def claims(seen: tuple[Seen, ...], found: list[Statistics], archive: bool) -> tuple[Claim, ...]:
    """The paper's sentences, of the first set of points and of the inner ones."""
    s = found[0]
    same, near, far = (float(v.mean()) for v in (s.same[-1], s.near, s.far))
    source = seen[0].name if archive else f"{seen[0].name} of the model's own random people"
    answer = [
        Claim(
            "A person differs more from themselves at another distance than from the most similar other at the same",
            f"{PAPER_SAME} against {PAPER_NEAR} and {PAPER_FAR} %",
            f"{same:.2f} against {near:.2f} and {far:.2f} %",
            same > near and same > far,
            f"{source}; the paper has 55 points on head and hairline contours of 53 people.",
        ),
        Claim(
            "Two different people from different distances are closer than two annotators of one picture",
            f"{PAPER_PAIR} % (below {HUMAN_TOLERANCE_PERCENT:g} %)",
            f"{s.closest[2]:.2f} %",
            s.closest[2] < HUMAN_TOLERANCE_PERCENT,
        ),
    ]  # fmt: skip
    for one, inner in zip(seen, found, strict=True):
        if not one.contour and "noise" not in one.name:
            values = tuple(float(v.mean()) for v in (inner.same[-1], inner.near, inner.far))
            answer.append(
                Claim(
                    f"The same by {one.name}",
                    "not asked",
                    f"{values[0]:.2f} against {values[1]:.2f} and {values[2]:.2f} %",
                    values[0] > values[1] and values[0] > values[2],
                    "Distance moves the contour most: by inner points alone a person stays more like themselves.",
                )
            )
    return tuple(answer)


EXPERIMENT = Experiment(
    "fig8", "The same person and others, from near and from far", "Fig. 8, section 6.2", run
)
