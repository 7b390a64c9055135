"""A prediction of section 6.2: with more people, more of them are nearer to somebody else than to themselves.

The paper expects it of its 53 people; here 10 to 10,000 random people of the model are photographed from near and from
far. A person's own two pictures do not care how many others there are, the nearest other comes ever closer.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Array
from .crowd import (
    FAR,
    NEAR,
    Crowd,
    Points,
    apart_percent,
    crowd,
    noisy,
    pictured,
    point_sets,
    random_people,
    rms_apart,
    surface_points,
)
from .protocol import Chart, Claim, Experiment, Line, Outcome, Progress, Settings, Step, Table

NUMBERS = (10, 30, 100, 300, 1000, 3000, 10_000)
QUICK = (10, 100, 1000)
ASKED = 300  # people whose nearest other is looked for among all
CANDIDATES = 12  # by the root mean square; of them the nearest by the mean distance
NOISE_PERCENT = (0.0, 1.0)


def run(settings: Settings, progress: Progress) -> Outcome:
    """Both pictures of everyone, with and without noise; nearest others among the first n."""
    model = settings.model
    most = max(4, settings.subjects(NUMBERS[-1], QUICK[-1]))
    numbers = (*(n for n in (QUICK if settings.quick else NUMBERS) if n < most), most)
    if len(numbers) < 2:
        numbers = (most // 2, most)
    scheme, points = point_sets(model)[0]
    at = surface_points(model, scheme, random_people(model, numbers[-1], settings.seed))
    rows, lines = [], []
    for k, noise in enumerate(NOISE_PERCENT):
        near, far = _pictures(at, points, noise, settings.seed)
        found = [grown(near, far, n) for n in numbers]
        rows += [(f"{noise:g} %", n, *one) for n, one in zip(numbers, found, strict=True)]
        words = "no noise" if noise == 0 else f"noise {noise:g} %"
        x = tuple(map(float, numbers))
        lines.append([Line(words, x, tuple(one[column] for one in found)) for column in (1, 3, 4)])
        progress(Step("kinds of pictures", k + 1, len(NOISE_PERCENT)))
    table = Table(
        f"Landmarks in two pictures ({points.name}), mean distance in percent of the distance of the eyes",
        (
            "noise", "people", f"same person, {100 * NEAR:.0f} and {100 * FAR:.0f} cm",
            f"nearest other, both {100 * NEAR:.0f} cm", f"nearest other, both {100 * FAR:.0f} cm",
            "% of people nearer to another than to themselves", "% whose own picture is the closest",
        ),
        tuple(rows),
        f"of the first {ASKED} people at most; the others are those they may be taken for",
    )  # fmt: skip
    return Outcome(
        "people",
        EXPERIMENT.title,
        (table,),
        (
            Chart(
                f"The nearest other person, both from {100 * NEAR:.0f} cm",
                "people",
                "mean landmark distance in %",
                tuple(line[0] for line in lines),
                log_x=True,
            ),
            Chart(
                "Share of people", "people", "%",
                tuple(
                    Line(f"{words}, {each.label}", each.x, each.y)
                    for line in lines
                    for words, each in zip(("nearer to another", "recognised"), line[1:], strict=True)
                ),
                log_x=True,
            ),
        ),
        (),
        claims(rows, len(numbers)),
        {
            "people": f"{numbers[-1]}, drawn from all modes, seed {settings.seed}; {ASKED} of them are looked for",
            "points": points.name,
            "compared": "after the best shift, turn and scale",
        },
    )  # fmt: skip


def _pictures(at: Array, points: Points, noise: float, seed: int) -> tuple[Crowd, Crowd]:
    """Everybody from near and from far."""
    rng = np.random.default_rng([seed, 62])
    z = [pictured(at, distance) for distance in (NEAR, FAR)]
    if noise > 0:
        z = [noisy(each, points, noise, rng) for each in z]
    near, far = (crowd(each, points) for each in z)
    return near, far


def grown(near: Crowd, far: Crowd, n: int) -> tuple[float, float, float, float, float]:
    """Of n people: same person, nearest other near, far, % nearer to another, % whose own picture is the closest."""
    asked = min(ASKED, n)
    own = apart_percent(near.of(slice(asked)), far.of(slice(asked)))
    others = [nearest(each.of(slice(asked)), each.of(slice(n))) for each in (near, far)]
    across = nearest(near.of(slice(asked)), far.of(slice(n)))
    return (
        float(own.mean()),
        float(others[0].mean()),
        float(others[1].mean()),
        100 * float((others[0] < own).mean()),
        100 * float((own <= across).mean()),
    )


def nearest(asked: Crowd, crowd: Crowd) -> Array:
    """(n,) percent to the nearest of `crowd`, whose row i, the same person, does not count."""
    apart = rms_apart(asked, crowd)
    np.fill_diagonal(apart, np.inf)
    few = min(CANDIDATES, len(crowd) - 1)
    chosen = np.argpartition(apart, few - 1, axis=1)[:, :few]
    exact = [apart_percent(asked, crowd.of(column)) for column in chosen.T]
    return np.min(exact, axis=0)


def claims(rows: list[tuple[str | int | float, ...]], numbers: int) -> tuple[Claim, ...]:
    """Growth from the least to the greatest number of people, of each kind of picture."""
    answer = []
    for first in range(0, len(rows), numbers):
        part = np.array([row[1:] for row in rows[first : first + numbers]], dtype=np.float64)
        noise, share = rows[first][0], part[:, 4]
        answer.append(
            Claim(
                f"The more people, the more are nearer to another than to themselves (noise {noise})",
                "expected of more than 53 people",
                f"{share[0]:.0f} % of {part[0, 0]:.0f}, {share[-1]:.0f} % of {part[-1, 0]:.0f}",
                bool(share[-1] > share[0] and (np.diff(part[:, 2]) < 0).all()),
                f"The nearest other at {100 * NEAR:.0f} cm: {part[0, 2]:.2f} to {part[-1, 2]:.2f} %; "
                f"one's own picture is the closest for {part[0, 5]:.0f} to {part[-1, 5]:.0f} %.",
            )
        )
    return tuple(answer)


EXPERIMENT = Experiment(
    "people", "The identity effect and the number of people", "section 6.2", run
)
