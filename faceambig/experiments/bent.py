"""Figures 12 and 13: a face fitted to a photograph's landmarks and edges, bent by 10 mm both ways behind them.

`run_bent` is both figures; they differ in the camera of the fit. The photograph is a rendering of a true face, its
edges are Canny's. The modes are those of landmarks and contour pairs together. The texture is sampled from the
photograph through each of the three faces: where it stays the same, so does the correspondence.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np

from ..arrays import Array
from ..camera import project
from ..contours import ContourFit, contour_fit
from ..fitting import Fit, fit
from ..flex import FlexibilityModes, flexibility_modes, plausible_limit
from ..io.edges import canny_edges
from ..metrics import HUMAN_TOLERANCE_PERCENT, mean_gap_percent
from ..model import FaceModel, Subject
from ..observation import Observation, observe, portrait_camera
from ..texture import Source, Texture, sample_texture
from .drawings import Pixels, head, labelled, portrait, with_pairs
from .heads import person, usual_scheme, who
from .parallel import Numbers, over_subjects
from .protocol import Claim, Image, Outcome, Progress, Settings, Table

ACTUAL = 0.6  # metres, of the photograph
NOISE_PERCENT = 1.0  # of its landmarks
BEND_MM = 10.0
SUBJECTS, QUICK_SUBJECTS = 5, 1
SHOWN = 3  # subject of the picture
WAYS = (0.0, BEND_MM, -BEND_MM)
NAMES = ("the fit", f"+{BEND_MM:g} mm", f"-{BEND_MM:g} mm")


@dataclass(frozen=True, slots=True)
class Figure:
    """What tells the two figures apart."""

    name: str
    title: str
    paper: str
    distance: float | None  # metres, of the fit; None: orthographic
    published: float  # d_L percent at 10 mm


class Work(NamedTuple):
    """One photograph and the face behind it."""

    face: Subject
    seen: Observation
    photograph: Pixels
    edges: Array  # (E, 2) pixels
    contours: ContourFit
    whole: Fit  # to landmarks and pairs together: the same face
    modes: FlexibilityModes  # the first

    def bent(self, mm: float) -> Fit:
        """The fit bent along the first mode."""
        return replace(self.whole, alpha=self.whole.alpha + mm * self.modes.directions[0])


@lru_cache(maxsize=8)  # the picture's is one of the numbers'
def worked(model: FaceModel, number: int, distance: float | None, seed: int) -> Work:
    """Photograph, fit to landmarks and edges, first mode."""
    face, scheme = person(model, number, seed), usual_scheme(model)
    seen = observe(
        face, distance=ACTUAL, scheme=scheme, noise_percent=NOISE_PERCENT, seed=seed + number
    )
    size = seen.image_size
    assert size is not None  # observe tells it
    camera = portrait_camera(face, distance=ACTUAL, scheme=scheme)
    photograph = portrait(face, seen, camera, width=size[0])
    edges = canny_edges(photograph)
    kind = "orthographic" if distance is None else "perspective"
    contours = contour_fit(model, seen, edges, camera=kind, distance=distance)
    whole = fit(
        model, contours.observation, camera=kind, distance=distance, prior_weight=contours.fit.prior_weight
    )  # fmt: skip
    return Work(face, seen, photograph, edges, contours, whole, flexibility_modes(model, whole, 1))


def one_subject(model: FaceModel, number: int, *, distance: float | None, seed: int) -> Numbers:
    """Landmarks, length and colours of the three faces of one photograph."""
    work = worked(model, number, distance, seed)
    vertices = work.seen.vertices(model)
    at = [project((one := work.bent(mm)).camera, one.vertices()[vertices]) for mm in WAYS]
    unit = work.contours.fit.interocular_px
    colours = [sample_texture(work.bent(mm), work.photograph) for mm in WAYS]
    shifted = replace(
        work.whole,
        camera=replace(
            work.whole.camera,
            t=work.whole.camera.t
            + HUMAN_TOLERANCE_PERCENT / 100 * unit / work.whole.camera.s * np.array([1.0, 0.0]),
        ),
    )
    return {
        "error": np.array(
            [mean_gap_percent(work.seen.points - x - work.seen.centre, unit) for x in at]
        ),
        "moved": np.array([mean_gap_percent(x - at[0], unit) for x in at]),
        "size": np.array([np.linalg.norm(work.bent(mm).alpha) for mm in WAYS]),
        "reach": np.array(work.modes.reach(0)),
        "colour": np.array([colour_change(colours[0], one) for one in colours]),
        "shifted": np.array(colour_change(colours[0], sample_texture(shifted, work.photograph))),
        "pairs": np.array(len(work.contours.pairs)),
    }


def colour_change(one: Texture, other: Texture) -> float:
    """Mean difference of a channel, of 255, over the vertices that both faces show to the photograph."""
    both = (one.source == Source.SEEN) & (other.source == Source.SEEN)
    gap = one.colours[both].astype(np.float64) - other.colours[both]
    return float(np.abs(gap).mean())


def run_bent(figure: Figure, settings: Settings, progress: Progress) -> Outcome:
    """Table, picture and claims of one of the figures."""
    model, seed = settings.model, settings.seed
    n = settings.subjects(SUBJECTS, QUICK_SUBJECTS)
    numbers = sorted({SHOWN, *range(1, n + 1)}) if n > 1 else [SHOWN]
    work = partial(one_subject, distance=figure.distance, seed=seed)
    found = over_subjects(work, numbers, settings, progress)
    means = {name: np.mean([one[name] for one in found], axis=0) for name in found[0]}
    limit = plausible_limit(min(70, model.n_modes))
    people = f"{', '.join(map(str, numbers))} of {who(settings, max(numbers))}"
    camera = "orthographic" if figure.distance is None else f"{100 * figure.distance:.0f} cm"
    return Outcome(
        figure.name,
        figure.title,
        (table(means, limit, camera, people),),
        (),
        (picture(model, figure, seed),),
        claims(figure, means, limit, len(numbers)),
        {
            "photograph": f"from {100 * ACTUAL:.0f} cm, landmarks with noise of {NOISE_PERCENT:g} % per coordinate",
            "fit": f"{camera}; 70 modes, box 2 sd, to landmarks and Canny's edges together",
            "subjects": len(numbers),
            "seed": seed,
        },
    )


def table(means: Numbers, limit: float, camera: str, people: str) -> Table:
    """The three faces; what is plausible and what a shift would do in the note."""
    rows = tuple(
        (
            name, float(means["moved"][k]), float(means["error"][k]), float(means["size"][k]),
            float(means["colour"][k]),
        )
        for k, name in enumerate(NAMES)
    )  # fmt: skip
    low, high = means["reach"].tolist()
    return Table(
        f"The first mode of landmarks and edges, {camera}",
        (
            "face", "landmarks move, %", "d_L to the photograph, %", f"|alpha| (a face: at most {limit:.1f})",
            "sampled colours change, of 255",
        ),
        rows,
        f"photographs of {people}, means; a plausible face lies from {low:.1f} to {high:.1f} mm; "
        f"a shift by {HUMAN_TOLERANCE_PERCENT:g} % changes colours by {means['shifted']:.1f}",
    )  # fmt: skip


def picture(model: FaceModel, figure: Figure, seed: int) -> Image:
    """The photograph and its pairs; then the three faces with the colours sampled through each, from front and side."""
    work = worked(model, SHOWN, figure.distance, seed)
    matched = work.contours.fit.vertices()[work.contours.pairs.vertices]
    at = project(work.contours.fit.camera, matched) + work.seen.centre
    pairs = with_pairs(work.photograph, 1.0, work.edges, at, work.contours.pairs.points)
    side = work.photograph.shape[0]
    rows = [[("the photograph", work.photograph)], [("edges and their pairs", pairs)]]
    for name, mm in zip(NAMES, WAYS, strict=True):
        one = work.bent(mm)
        colours = sample_texture(one, work.photograph).colours
        for row, yaw in zip(rows, (0.0, 55.0), strict=True):
            row.append((name, head(model, one.vertices(), colours, yaw_deg=yaw, width=side)))
    words = (
        f"Face {SHOWN}: the photograph and its contour pairs; {', '.join(NAMES)} of the first mode "
        f"({work.modes.words[0]}), each with the photograph's colours sampled through it, background where it is larger"
    )
    return Image(words, labelled(rows))


def claims(figure: Figure, means: Numbers, limit: float, n: int) -> tuple[Claim, ...]:
    """The figure's number, the correspondence, and what the model thinks of such faces."""
    low, high = means["reach"].tolist()
    beyond = float(means["size"][0]) > limit
    moved, size = float(means["moved"][1:].mean()), float(means["size"][1:].mean())
    colour, shifted = float(means["colour"][1:].mean()), float(means["shifted"])
    return (
        Claim(
            f"The landmarks hardly move when the surface bends by {BEND_MM:g} mm",
            f"d_L {figure.published} %",
            f"{moved:.2f} %",
            moved < HUMAN_TOLERANCE_PERCENT,
            "Of one photograph there; the edges that were matched hold the face as landmarks do.",
        ),
        Claim(
            "The correspondence stays: the texture sampled through each face is the same",
            "by eye",
            f"{colour:.1f} of 255; a shift by {HUMAN_TOLERANCE_PERCENT:g} % changes {shifted:.1f}",
            colour < shifted,
        ),
        Claim(
            f"Whether the faces bent by {BEND_MM:g} mm are plausible",
            "not claimed",
            f"|alpha| {size:.1f}, of a face at most {limit:.1f}",
            None,
            f"The mode shows a direction; the model calls plausible {low:.1f} to {high:.1f} mm of it, mean of {n}."
            + (
                " The fit itself is beyond: at the wrong camera the face is bent already."
                if beyond
                else ""
            ),
        ),
    )
