"""Fig. 1: one person photographed from 60 and from 490 cm, the eyes as far apart in both pictures."""

from __future__ import annotations

from functools import partial

import numpy as np

from ..arrays import Array
from ..metrics import align
from ..model import FaceModel, Scheme
from ..observation import eye_distance, observe, portrait_camera
from .heads import cm, person, usual_scheme, who
from .parallel import over_subjects
from .pictures import face_rows, seen_through
from .protocol import Claim, Experiment, Image, Outcome, Progress, Settings, Table

DISTANCES = (0.6, 4.9)  # metres
SHOWN = (1, 3)  # heads
MEASURES = {  # words: two points of iBUG
    "width of the jaw, points 1 to 17": ("1", "17"),
    "width of the nose, points 32 to 36": ("32", "36"),
    "width of the mouth, points 49 to 55": ("49", "55"),
    "height of the face, points 28 to 9": ("28", "9"),
}


def run(settings: Settings, progress: Progress) -> Outcome:
    """The pictures of two heads, and what the distance changes in those of all."""
    n = settings.subjects(usual=10, quick=4)
    model = settings.model
    found = over_subjects(partial(changes, seed=settings.seed), range(1, n + 1), settings, progress)
    difference = np.array([float(one["difference"]) for one in found])
    measures = np.stack([one["measures"] for one in found])  # (n, measures, distances)
    rows = [
        (
            words,
            *values.mean(axis=0).tolist(),
            100 * float((values[:, 0] / values[:, 1] - 1).mean()),
        )
        for words, values in zip(_measures(model), measures.transpose(1, 0, 2), strict=True)
    ]
    columns = ("in eye distances", *(cm(at) for at in DISTANCES), "change (%)")
    tables = (
        Table("What the distance changes", columns, tuple(rows), "means over the subjects", 3),
    )
    worst = max(rows, key=lambda row: abs(float(row[-1])))
    return Outcome(
        "fig1",
        EXPERIMENT.title,
        tables,
        images=(_image(settings),),
        claims=(
            Claim(
                "the same face looks different from another distance, at the same eye distance",
                "two photographs",
                f"landmarks differ by {difference.mean():.2f} % of the eye distance after the best turn, shift and "
                f"scale; {worst[0]}: {worst[-1]:+.0f} %",
                bool((difference > 1).all()),
                "The head is bald and in one light: its geometry alone changes the picture.",
            ),
        ),
        settings={"subjects": who(settings, n), "view": "frontal, no noise"},
    )  # fmt: skip


def changes(model: FaceModel, number: int, *, seed: int) -> dict[str, Array | float]:
    """Landmark difference, percent, and measures in eye distances (measures, distances), of one head."""
    face, scheme = person(model, number, seed), model.scheme(usual_scheme(model))
    near, far = (observe(face, distance=at, scheme=scheme.name).points for at in DISTANCES)
    flat = [np.column_stack([points, np.zeros(len(points))]) for points in (near, far)]
    R, t, s = align(*flat, scale=True)
    gap = np.linalg.norm(s * flat[0] @ R.T + t - flat[1], axis=1).mean()
    measures = [_measured(points, scheme) for points in (near, far)]
    return {
        "difference": 100 * float(gap) / eye_distance(far, scheme),
        "measures": np.array(measures).T,
    }


def _measures(model: FaceModel) -> tuple[str, ...]:
    known = model.scheme(usual_scheme(model)).points
    return tuple(words for words, ends in MEASURES.items() if set(ends) <= set(known))


def _measured(points: Array, scheme: Scheme) -> list[float]:
    row = {name: k for k, name in enumerate(scheme.points)}
    eyes = eye_distance(points, scheme)
    return [
        float(np.linalg.norm(points[row[a]] - points[row[b]])) / eyes
        for a, b in MEASURES.values()
        if a in row and b in row
    ]


def _image(settings: Settings) -> Image:
    """A row of photographs for each head shown."""
    model, scheme = settings.model, usual_scheme(settings.model)
    rows = []
    for number in SHOWN:
        face = person(model, number, settings.seed)
        row = []
        for distance in DISTANCES:
            photo = observe(face, distance=distance, scheme=scheme)
            camera = portrait_camera(face, distance=distance, scheme=scheme)
            row.append((cm(distance), seen_through(face, face.vertices, camera, photo)))
        rows.append(row)
    title = "Fig. 1: two people, each photographed from 60 and from 490 cm, the eyes as far apart in all pictures"
    return Image(title, face_rows(rows, 300))


EXPERIMENT = Experiment("fig1", "One person from two distances", "Fig. 1", run)
