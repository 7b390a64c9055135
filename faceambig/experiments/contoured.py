"""Figures 6 and 7: one picture explained at a wrong distance by landmarks, by contours too, and by all vertices.

`run_pairs` is both figures; they differ in distances and in the subjects that are shown. Contours are those of the true
face, as a perfect edge detector would see them; dense is every vertex that the camera sees, its correspondence given.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np

from ..arrays import Array
from ..boundary import contour_points
from ..camera import project
from ..contours import ContourFit, contour_fit
from ..fitting import Fit, fit
from ..metrics import mean_gap_percent, surface_difference
from ..model import FaceModel, Subject
from ..observation import Observation, observe, portrait_camera
from .drawings import blended, labelled, portrait, with_pairs
from .heads import person, usual_scheme, who
from .parallel import Numbers, over_subjects
from .protocol import Cell, Claim, Image, Outcome, Progress, Settings, Table

METHODS = ("landmarks", "landmarks and contours", "all visible vertices")
YAW = 30.0  # degrees, of the rotated pose
DENSE_BOX = 3.0  # standard deviations, with all modes; the others: 70 modes and 2
AT_WRONG = (
    "The paper shows one face. At a wrong distance a wrong shape meets the contour as well as the landmarks: what is "
    "gained is far from what the right distance gives."
)
COLUMNS = tuple(f"{method}, {what}" for method in METHODS for what in ("d_S mm", "d_L %"))
# Landmark noise that the prior assumes, percent: the paper's light weight, and the library's own
PRIORS = (("light prior", 0.1), ("default prior", 1.0))
SUBJECTS, QUICK_SUBJECTS = 10, 1


@dataclass(frozen=True, slots=True)
class Pair:
    """What a figure shows."""

    name: str
    title: str
    paper: str
    actual: float  # metres, of the picture
    fitted: float  # metres, of the fits
    frontal: int  # subject shown, from 1
    rotated: int
    contours: str  # what the paper's rotated face gains from contours
    published: tuple[str, ...]  # frontal, then rotated: d_S mm / d_L % of the three methods

    @property
    def shown(self) -> tuple[tuple[int, float], ...]:
        """Subject and yaw of each picture."""
        return ((self.frontal, 0.0), (self.rotated, YAW))


class View(NamedTuple):
    """One photograph of one subject."""

    face: Subject
    seen: Observation
    edges: Array  # (E, 2) pixels
    yaw: float


def photograph(model: FaceModel, number: int, seed: int, actual: float, yaw: float) -> View:
    """Subject `number` from `actual` metres, turned by `yaw` degrees, with landmarks and visible contour."""
    face, scheme = person(model, number, seed), usual_scheme(model)
    seen = observe(face, distance=actual, scheme=scheme, yaw_deg=yaw)
    camera = portrait_camera(face, distance=actual, scheme=scheme, yaw_deg=yaw)
    return View(face, seen, contour_points(model, face.vertices, camera) + seen.centre, yaw)


def by_points(
    model: FaceModel, view: View, distance: float, noise_percent: float
) -> tuple[Fit, ContourFit]:
    """The fits to landmarks, and to landmarks and contours."""
    landmarks = fit(model, view.seen, distance=distance, noise_percent=noise_percent)
    contours = contour_fit(
        model, view.seen, view.edges, distance=distance, noise_percent=noise_percent
    )
    return landmarks, contours


def by_all(
    model: FaceModel, view: View, distance: float, noise_percent: float, actual: float
) -> Fit:
    """The fit to every vertex that the camera sees."""
    every = observe(view.face, distance=actual, scheme="visible", yaw_deg=view.yaw)
    return fit(
        model, every, distance=distance, noise_percent=noise_percent,
        modes=model.n_modes, box=DENSE_BOX,
    )  # fmt: skip


Item = tuple[int, float, float, float, bool]  # number, yaw, distance, noise; whether dense too
Found = dict[tuple[int, float, float, float], Numbers]  # by the first four


@lru_cache(maxsize=4)
def fits_of(
    model: FaceModel, item: Item, actual: float, seed: int
) -> tuple[View, Fit, ContourFit, Fit | None]:
    """The photograph of one subject and yaw, and its fits at one distance and prior."""
    number, yaw, distance, noise, dense = item
    view = photograph(model, number, seed, actual, yaw)
    landmarks, contours = by_points(model, view, distance, noise)
    every = by_all(model, view, distance, noise, actual) if dense else None
    return view, landmarks, contours, every


def one_subject(model: FaceModel, item: Item, *, actual: float, seed: int) -> Numbers:
    """d_S (2,) or (3,) mm and d_L percent of the fits of one item."""
    view, landmarks, contours, every = fits_of(model, item, actual, seed)
    fits = [landmarks, contours.fit, *([] if every is None else [every])]
    return {
        "d_s": np.array([d_s_mm(one, view.face) for one in fits]),
        "d_l": np.array([d_l_percent(one, view.seen, landmarks.interocular_px) for one in fits]),
    }


def d_s_mm(found: Fit, face: Subject) -> float:
    """Rigid surface difference, mm, over the region that the model measures on."""
    return surface_difference(found.vertices(), face.vertices, face.model.evaluation).mean_mm


def d_l_percent(found: Fit, seen: Observation, interocular_px: float) -> float:
    """Error of the landmarks of `seen`, whatever points were fitted."""
    points = found.vertices()[seen.vertices(found.model)]
    gaps = seen.points - project(found.camera, points) - found.observation.centre
    return mean_gap_percent(gaps[seen.visible], interocular_px)


def run_pairs(pair: Pair, settings: Settings, progress: Progress) -> Outcome:
    """Tables, pictures and claims of one of the figures."""
    model, seed = settings.model, settings.seed
    n = settings.subjects(SUBJECTS, QUICK_SUBJECTS)
    found = _found(pair, settings, n, progress)
    among = f"the first {n} and those shown, of {who(settings, max(n, pair.frontal, pair.rotated))}"
    return Outcome(
        pair.name,
        pair.title,
        _tables(pair, found, among),
        (),
        tuple(picture(model, pair, number, yaw, seed) for number, yaw in pair.shown),
        claims(pair, found),
        {
            "photograph": f"from {100 * pair.actual:.0f} cm, frontal or turned by {YAW:g} degrees, no noise",
            "fit": f"at {100 * pair.fitted:.0f} cm; 70 modes, box 2 sd; of all vertices {model.n_modes} modes, box "
            f"{DENSE_BOX:g} sd",
            "contours": "of the true face, as a perfect edge detector sees them",
            "seed": seed,
        },
    )


def _found(pair: Pair, settings: Settings, n: int, progress: Progress) -> Found:
    """The first n subjects and those shown at both distances, light prior; and those shown with the other priors."""
    numbers = {yaw: sorted({*range(1, n + 1), number}) for number, yaw in pair.shown}
    items = [
        (number, yaw, distance, PRIORS[0][1], distance == pair.fitted)
        for yaw in numbers
        for distance in (pair.fitted, pair.actual)
        for number in numbers[yaw]
    ]
    # Those of the pictures last: they are still at hand when they are drawn
    items += [(*one, pair.fitted, noise, True) for one in pair.shown for _, noise in PRIORS[1:]]
    work = partial(one_subject, actual=pair.actual, seed=settings.seed)
    answers = over_subjects(work, items, settings, progress, what="fits")
    return {item[:4]: one for item, one in zip(items, answers, strict=True)}


def _tables(pair: Pair, found: Found, among: str) -> tuple[Table, Table]:
    """The faces shown, with every prior; and the means over all subjects."""
    shown = tuple(
        (number, _pose(yaw), prior, *_cells(found[number, yaw, pair.fitted, noise]))
        for number, yaw in pair.shown
        for prior, noise in PRIORS
    )
    means = tuple(
        mean_row(found, yaw, distance)
        for yaw in (0.0, YAW)
        for distance in (pair.fitted, pair.actual)
    )
    wrong = f"picture from {100 * pair.actual:.0f} cm, fitted at {100 * pair.fitted:.0f} cm"
    return (
        Table(f"The faces shown: {wrong}", ("face", "pose", "prior", *COLUMNS), shown, among),
        Table(
            "Means over the subjects with the light prior, at the wrong and at the right distance",
            ("fitted at", "pose", "subjects", *COLUMNS, "contours better for"),
            means, among,
        ),
    )  # fmt: skip


def _cells(one: Numbers) -> tuple[float | None, ...]:
    """d_S and d_L of each method; None for one that was not run."""
    cells: list[float | None] = np.stack([one["d_s"], one["d_l"]], axis=1).ravel().tolist()
    return (*cells, *[None] * (2 * len(METHODS) - len(cells)))


def _some(found: Found, yaw: float, distance: float) -> Numbers:
    """All subjects of one pose and distance, light prior."""
    some = [one for key, one in found.items() if key[1:] == (yaw, distance, PRIORS[0][1])]
    return {name: np.array([one[name] for one in some]) for name in ("d_s", "d_l")}


def mean_row(found: Found, yaw: float, distance: float) -> tuple[Cell, ...]:
    """Means over all subjects of one pose and distance."""
    some = _some(found, yaw, distance)
    d_s = some["d_s"]
    better = f"{int((d_s[:, 1] < d_s[:, 0]).sum())} of {len(d_s)}"
    means = {name: values.mean(axis=0) for name, values in some.items()}
    return (f"{100 * distance:.0f} cm", _pose(yaw), len(d_s), *_cells(means), better)


def _pose(yaw: float) -> str:
    return "frontal" if yaw == 0 else f"turned by {yaw:g} degrees"


def picture(model: FaceModel, pair: Pair, number: int, yaw: float, seed: int) -> Image:
    """The target and its contour pairs; then for each method the fitted face in the photograph, and both blended."""
    item = (number, yaw, pair.fitted, PRIORS[1][1], True)
    view, landmarks, contours, every = fits_of(model, item, pair.actual, seed)
    assert every is not None  # asked for
    size = view.seen.image_size
    assert size is not None  # observe tells it
    camera = portrait_camera(
        view.face, distance=pair.actual, scheme=usual_scheme(model), yaw_deg=yaw
    )
    target = portrait(view.face, view.seen, camera)
    matched = contours.fit.vertices()[contours.pairs.vertices]
    at = project(contours.fit.camera, matched) + view.seen.centre
    pairs = with_pairs(target, target.shape[1] / size[0], view.edges, at, contours.pairs.points)
    fits = (landmarks, contours.fit, every)
    heads = [_face(view.face, one) for one in fits]
    fitted = [portrait(one, view.seen, by.camera) for one, by in zip(heads, fits, strict=True)]
    names = [
        f"{way}: {d_s_mm(one, view.face):.1f} mm" for way, one in zip(METHODS, fits, strict=True)
    ]
    far = portrait_camera(view.face, distance=None, scheme=usual_scheme(model), yaw_deg=yaw)
    last = [("orthographic", portrait(one, view.seen, far)) for one in (view.face, *heads)]
    upper = [("the target", target), *zip(names, fitted, strict=True)]
    lower = [("contours and their pairs", pairs)]
    lower += [("blended with the target", blended(target, one)) for one in fitted]
    words = (
        f"Face {number}, {_pose(yaw)}: target from {100 * pair.actual:.0f} cm; fits at {100 * pair.fitted:.0f} cm to "
        f"{', '.join(METHODS)}, with their d_S, default prior. Below: contour pairs, and target and fit "
        "blended. Last: the same heads by one orthographic camera, which shows how they differ"
    )
    return Image(words, labelled([upper, lower, last]))


def _face(face: Subject, found: Fit) -> Subject:
    """The fitted surface in the colours of the true face: what is at the same vertex has the same colour."""
    return Subject(face.name, face.about, found.vertices(), face.colours, face.model)


def claims(pair: Pair, found: Found) -> tuple[Claim, ...]:
    """The figure's numbers, face by face, and what contours do in the mean."""
    answer = []
    for k, (number, yaw) in enumerate(pair.shown):
        one = found[number, yaw, pair.fitted, PRIORS[0][1]]
        ours = ", ".join(f"{s:.2f}/{l:.2f}" for s, l in zip(one["d_s"], one["d_l"], strict=True))
        answer.append(
            Claim(
                f"{_pose(yaw)}: d_S mm / d_L % of {', '.join(METHODS)}; every d_L is below 1 %",
                pair.published[k],
                ours,
                bool((one["d_l"] < 1).all()),
                "Other people and another model: the paper's ten are scans, ours are more like their model.",
            )
        )
    wrong = "Turned, contours bring the face at the wrong distance nearer to the truth"
    answer.append(_gain(wrong, pair.contours, _some(found, YAW, pair.fitted)["d_s"], AT_WRONG))
    right = "Turned, contours help at the right distance"
    answer.append(_gain(right, "not in the figure", _some(found, YAW, pair.actual)["d_s"]))
    return tuple(answer)


def _gain(words: str, paper: str, d_s: Array, why: str = "") -> Claim:
    """What contours do in the mean to d_s (n, methods): undecided within two standard errors."""
    mean, gain = d_s.mean(axis=0), d_s[:, 0] - d_s[:, 1]
    error = float(gain.std(ddof=1) / np.sqrt(len(gain))) if len(gain) > 1 else np.inf
    told = abs(float(gain.mean())) > 2 * error
    few = (
        f"{gain.mean():.2f} mm nearer with a standard error of {error:.2f}: too few faces to tell."
    )
    return Claim(
        words,
        paper,
        f"{mean[0]:.2f} to {mean[1]:.2f} mm, mean of {len(d_s)}; better for {int((gain > 0).sum())}",
        bool(gain.mean() > 0) if told else None,
        " ".join(part for part in ("" if told or len(gain) == 1 else few, why) if part),
    )
