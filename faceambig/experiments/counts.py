"""Section 6.4: how many flexibility modes bend a face by 2 mm behind landmarks that move by less than 2 pixels.

Frontal, orthographic, 70 modes of shape. k_2 in pixels needs a scale, which the paper's text leaves out (a line that
was commented out says 100 pixels between the eyes): its double and its half are beside it. Plausible is the paper's
count, |w f| within 3 sd of the mean length of a face's alpha; an offset may well be shorter, so its upper end alone
and the bent face itself are counted too.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from ..fitting import fit
from ..flex import flexibility_modes, plausible_range
from ..model import FaceModel
from ..observation import observe
from .heads import person, usual_scheme, who
from .parallel import Numbers, over_subjects
from .protocol import Chart, Claim, Experiment, Line, Outcome, Progress, Settings, Table

SUBJECTS, QUICK_SUBJECTS = 10, 2
SURFACE_MM, LANDMARK_PX = 2.0, 2.0  # k_1, k_2
MODES = 70
NOISE_PERCENT = 0.1  # the paper's light prior
PAPER_COUNT, PAPER_PLAUSIBLE = 50, 7
FARKAS = "farkas"  # the paper's 70 points are those of Farkas
# Scheme or "" for the usual one, metres or None for far away, pixels between the eyes, pose
Kind = tuple[str, float | None, float, str]
KINDS: tuple[Kind, ...] = (
    ("", None, 100.0, "fixed"),
    ("", None, 50.0, "fixed"),
    ("", None, 200.0, "fixed"),
    ("", None, 100.0, "compensated"),
    (FARKAS, None, 100.0, "fixed"),
    ("", 0.3, 100.0, "fixed"),
    ("", 0.6, 100.0, "fixed"),
    ("", 1.2, 100.0, "fixed"),
)
COUNTED = ("kept", "plausible", "plausible_upper", "plausible_faces")

Row = tuple[str | float, ...]


def run(settings: Settings, progress: Progress) -> Outcome:
    """The counts of every kind of picture, means over the subjects, and the first kind's movements."""
    model = settings.model
    n = settings.subjects(SUBJECTS, QUICK_SUBJECTS)
    found = _found(settings, n, progress)
    rows = [row(model, kind, subjects) for kind, subjects in found.items()]
    first = next(iter(found.values()))
    modes = int(min(MODES, model.n_modes))
    low, high = first[0]["range"].tolist()
    return Outcome(
        "counts",
        EXPERIMENT.title,
        (table(rows, modes, f"means over {who(settings, n)}; 3 sd is {low:.2f} to {high:.2f}"),),
        (movement_chart(first), length_chart(first)),
        (),
        claims(rows, modes),
        {
            "subjects": who(settings, n),
            "view": "frontal, no noise",
            "fit": f"{modes} modes, box 2 sd, prior of {NOISE_PERCENT:g} % noise",
        },
    )


def _found(settings: Settings, n: int, progress: Progress) -> dict[Kind, list[Numbers]]:
    """The counts of n subjects, of every kind of picture whose landmarks the model has."""
    usual = usual_scheme(settings.model)
    kinds = [kind for kind in KINDS if (kind[0] or usual) in settings.model.schemes]
    items = [(number, *kind) for kind in kinds for number in range(1, n + 1)]
    work = partial(counted, seed=settings.seed)
    answers = over_subjects(work, items, settings, progress, what="fits")
    return {kind: answers[k * n : (k + 1) * n] for k, kind in enumerate(kinds)}


def counted(
    model: FaceModel, item: tuple[int, str, float | None, float, str], *, seed: int
) -> Numbers:
    """The counts of one subject and kind of picture, and each mode's movements at k_1."""
    number, scheme, distance, px, pose = item
    name = scheme or usual_scheme(model)
    seen = observe(person(model, number, seed), distance=distance, scheme=name, eyes_px=px)
    given = {"modes": min(MODES, model.n_modes), "noise_percent": NOISE_PERCENT}
    if distance is None:
        found = fit(model, seen, camera="orthographic", **given)
    else:
        found = fit(model, seen, distance=distance, **given)
    modes = flexibility_modes(
        model, found, None, pose="compensated" if pose == "compensated" else "fixed"
    )
    kept = modes.truncated(SURFACE_MM, landmark_px=LANDMARK_PX)
    return {
        "kept": np.array(len(kept)),
        "plausible": np.array(kept.plausible),
        "plausible_upper": np.array(kept.plausible_upper),
        "plausible_faces": np.array(kept.plausible_faces),
        "moved_px": SURFACE_MM * modes.landmark_percent * found.interocular_px / 100,
        "size": SURFACE_MM * np.linalg.norm(modes.directions, axis=1),
        "range": np.array(plausible_range(len(found.alpha))),
    }


def row(model: FaceModel, kind: Kind, subjects: list[Numbers]) -> Row:
    """A kind of picture and its counts, means over the subjects."""
    scheme, distance, px, pose = kind
    name = scheme or usual_scheme(model)
    points = f"{name}, {len(model.schemes[name])} points"
    camera = "orthographic" if distance is None else f"{100 * distance:.0f} cm"
    means = [float(np.mean([one[count] for one in subjects])) for count in COUNTED]
    return (points, camera, px, pose, *means)


def table(rows: list[Row], modes: int, note: str) -> Table:
    """What is kept of `modes` modes, and what of it is plausible by each count."""
    return Table(
        f"Flexibility modes of {modes} that move the surface by {SURFACE_MM:g} mm "
        f"and the landmarks by less than {LANDMARK_PX:g} px",
        (
            "landmarks", "camera", "px between the eyes", "pose", "kept",
            "plausible: |w f| within 3 sd", "|w f| not above", "|alpha +- w f| not above",
        ),
        tuple(rows),
        note,
    )  # fmt: skip


def movement_chart(subjects: list[Numbers]) -> Chart:
    """How far each mode moves the landmarks, beside what is allowed."""
    moved = np.mean([one["moved_px"] for one in subjects], axis=0)
    x = tuple(float(k + 1) for k in range(len(moved)))
    return Chart(
        f"Modes at {SURFACE_MM:g} mm of mean surface change", "mode", "landmarks, px",
        (
            Line("mean movement", x, tuple(moved.tolist())),
            Line("allowed", x, (LANDMARK_PX,) * len(x)),
        ),
    )  # fmt: skip


def length_chart(subjects: list[Numbers]) -> Chart:
    """How long each mode's change is, between the lengths of a face."""
    size = np.mean([one["size"] for one in subjects], axis=0)
    low, high = subjects[0]["range"].tolist()
    x = tuple(float(k + 1) for k in range(len(size)))
    return Chart(
        "Length of the change in standard deviations", "mode", "|w f|",
        (
            Line("|w f|", x, tuple(size.tolist())),
            Line("most of a face", x, (high,) * len(x)),
            Line("least of a face", x, (low,) * len(x)),
        ),
        log_y=True,
    )  # fmt: skip


def claims(rows: list[Row], modes: int) -> tuple[Claim, ...]:
    """The paper's two numbers."""
    kept, plausible, faces = (float(value) for value in (rows[0][4], rows[0][5], rows[0][7]))
    return (
        Claim(
            "Modes that bend the face by 2 mm behind landmarks that move by less than 2 px",
            f"around {PAPER_COUNT}",
            f"{kept:.1f} of {modes}",
            abs(kept - PAPER_COUNT) <= 0.25 * PAPER_COUNT,
            "Within a quarter counts as the same. The scale decides: with half the pixels more modes pass, with twice "
            "as many fewer. A model whose weak modes are weaker needs more standard deviations for 2 mm.",
        ),
        Claim(
            "Few of them give plausible faces",
            f"{PAPER_PLAUSIBLE}",
            f"{plausible:.1f}",
            plausible < 0.5 * kept,
            f"Fewer than half of those kept; {faces:.1f} give a plausible face both ways from the fitted one. Weak "
            "modes need many standard deviations for 2 mm.",
        ),
    )


EXPERIMENT = Experiment(
    "counts", "How many ways a face can bend behind its landmarks", "section 6.4", run
)
