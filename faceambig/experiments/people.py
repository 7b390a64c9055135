"""A prediction of section 6.2: with more people, more of them are nearer to somebody else than to themselves.

The paper expects it of its 53 people; here 10 to 10,000 random people of the model are photographed from near and from
far. A person's own two pictures do not care how many others there are, the nearest other comes ever closer.
"""

from __future__ import annotations

from typing import NamedTuple

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


class Grown(NamedTuple):
    """What holds of the first people of a crowd."""

    same: float  # percent of the eyes' distance: a person from near and from far
    near: float  # the nearest other, both from near
    far: float  # both from far
    nearer: float  # % of people nearer to another than to themselves
    recognised: float  # % whose own picture is the closest


Found = dict[float, dict[int, Grown]]  # by noise, then by the number of people
Row = tuple[str | int | float, ...]


def run(settings: Settings, progress: Progress) -> Outcome:
    """Both pictures of everyone, with and without noise; nearest others among the first n."""
    model, numbers = settings.model, _numbers(settings)
    scheme, points = point_sets(model)[0]
    at = surface_points(model, scheme, random_people(model, numbers[-1], settings.seed))
    found: Found = {}
    for noise in NOISE_PERCENT:
        near, far = _pictures(at, points, noise, settings.seed)
        found[noise] = {n: grown(near, far, n) for n in numbers}
        progress(Step("kinds of pictures", len(found), len(NOISE_PERCENT)))
    rows = [(f"{noise:g} %", n, *one) for noise, by in found.items() for n, one in by.items()]
    return Outcome(
        "people",
        EXPERIMENT.title,
        (table(rows, points),),
        (nearest_chart(found), share_chart(found)),
        (),
        claims(rows, len(numbers)),
        {
            "people": f"{numbers[-1]}, drawn from all modes, seed {settings.seed}; {ASKED} of them are looked for",
            "points": points.name,
            "compared": "after the best shift, turn and scale",
        },
    )


def _numbers(settings: Settings) -> tuple[int, ...]:
    """How many people there are, two numbers at least; the last is as many as were asked for."""
    most = max(4, settings.subjects(NUMBERS[-1], QUICK[-1]))
    fewer = tuple(n for n in (QUICK if settings.quick else NUMBERS) if n < most)
    return (*(fewer or (most // 2,)), most)


def _pictures(at: Array, points: Points, noise: float, seed: int) -> tuple[Crowd, Crowd]:
    """Everybody from near and from far."""
    rng = np.random.default_rng([seed, 62])
    z = [pictured(at, distance) for distance in (NEAR, FAR)]
    if noise > 0:
        z = [noisy(each, points, noise, rng) for each in z]
    near, far = (crowd(each, points) for each in z)
    return near, far


def grown(near: Crowd, far: Crowd, n: int) -> Grown:
    """The numbers of the first n people."""
    asked = min(ASKED, n)
    own = apart_percent(near.of(slice(asked)), far.of(slice(asked)))
    others = [nearest(each.of(slice(asked)), each.of(slice(n))) for each in (near, far)]
    across = nearest(near.of(slice(asked)), far.of(slice(n)))
    return Grown(
        same=float(own.mean()),
        near=float(others[0].mean()),
        far=float(others[1].mean()),
        nearer=100 * float((others[0] < own).mean()),
        recognised=100 * float((own <= across).mean()),
    )


def nearest(asked: Crowd, crowd: Crowd) -> Array:
    """(n,) percent to the nearest of `crowd`, whose row i, the same person, does not count."""
    apart = rms_apart(asked, crowd)
    np.fill_diagonal(apart, np.inf)
    few = min(CANDIDATES, len(crowd) - 1)
    chosen = np.argpartition(apart, few - 1, axis=1)[:, :few]
    exact = [apart_percent(asked, crowd.of(column)) for column in chosen.T]
    return np.min(exact, axis=0)


def table(rows: list[Row], points: Points) -> Table:
    """Every number of people, without and with noise."""
    return Table(
        f"Landmarks in two pictures ({points.name}), mean distance in percent of the distance of the eyes",
        (
            "noise", "people", f"same person, {100 * NEAR:.0f} and {100 * FAR:.0f} cm",
            f"nearest other, both {100 * NEAR:.0f} cm", f"nearest other, both {100 * FAR:.0f} cm",
            "% of people nearer to another than to themselves", "% whose own picture is the closest",
        ),
        tuple(rows),
        f"of the first {ASKED} people at most; the others are those they may be taken for",
    )  # fmt: skip


def nearest_chart(found: Found) -> Chart:
    """The nearest other from near as the people grow in number, a line for each noise."""
    lines = (
        Line(_words(noise), tuple(map(float, by)), tuple(one.near for one in by.values()))
        for noise, by in found.items()
    )
    return Chart(
        f"The nearest other person, both from {100 * NEAR:.0f} cm",
        "people",
        "mean landmark distance in %",
        tuple(lines),
        log_x=True,
    )


def share_chart(found: Found) -> Chart:
    """Who is nearer to another, and who is recognised, two lines for each noise."""
    lines = []
    for noise, by in found.items():
        x, words = tuple(map(float, by)), _words(noise)
        nearer = tuple(one.nearer for one in by.values())
        recognised = tuple(one.recognised for one in by.values())
        lines.append(Line(f"nearer to another, {words}", x, nearer))
        lines.append(Line(f"recognised, {words}", x, recognised))
    return Chart("Share of people", "people", "%", tuple(lines), log_x=True)


def _words(noise: float) -> str:
    return "no noise" if noise == 0 else f"noise {noise:g} %"


def claims(rows: list[Row], numbers: int) -> tuple[Claim, ...]:
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
