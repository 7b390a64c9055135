"""The sixteen craniofacial measures, and how a population is held against the survey."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from head_people import read_table

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Survey:
    """M measures: names, end points, figures in millimetres."""

    names: tuple[str, ...]
    ends: tuple[tuple[str, str], ...]
    mean: Array  # (M,) men and women in equal numbers
    sd: Array  # (M,)
    by_sex: Array  # (M, 2) means of women and men; NaN where unknown
    sd_within: Array  # (M,) within one sex where known, else the pooled sd


def read_survey() -> Survey:
    """The survey of head_data/survey.csv."""
    rows = read_table("survey.csv")

    def column(key: str) -> Array:
        return np.array([float(r[key] or "nan") for r in rows])

    pooled = column("pooled_sd_mm")
    within = np.sqrt(0.5 * (column("male_sd_mm") ** 2 + column("female_sd_mm") ** 2))
    return Survey(
        names=tuple(r["measure"] for r in rows),
        ends=tuple((r["from_landmark"], r["to_landmark"]) for r in rows),
        mean=column("pooled_mean_mm"),
        sd=pooled,
        by_sex=np.stack([column("female_mean_mm"), column("male_mean_mm")], axis=1),
        sd_within=np.where(np.isnan(within), pooled, within),
    )


def end_vertices(survey: Survey, points: dict[tuple[str, str], int]) -> NDArray[np.int64]:
    """(M, 2) vertices; `points` maps (name, side) to a vertex, side is left, right or mid.

    One name twice means right to left; ear measures are taken on the right ear.
    """
    pairs = []
    for first, second in survey.ends:
        sides = ("right", "left") if first == second else ("right", "right")
        pairs.append(
            [
                points[name, side] if (name, side) in points else points[name, "mid"]
                for name, side in zip((first, second), sides, strict=True)
            ]
        )
    return np.array(pairs)


def measure(ends: Array, names: tuple[str, ...]) -> Array:
    """(n, M) millimetres from end points (n, M, 2, 3) in metres."""
    apart = ends[:, :, 1] - ends[:, :, 0]
    length = 1000.0 * np.linalg.norm(apart, axis=2)
    vertical = names.index("tragion_vertex")
    length[:, vertical] = 1000.0 * np.abs(apart[:, vertical, 1])
    return length


def holds(mean: Array, sd: Array, survey: Survey) -> NDArray[np.bool_]:
    """(M,) whether the mean lies within one sd of the survey's and the sd within a factor 1.5."""
    near = np.abs(mean - survey.mean) <= survey.sd
    ratio = sd / survey.sd
    return near & (ratio >= 1 / 1.5) & (ratio <= 1.5)


def report(values: Array, survey: Survey) -> str:
    """Table of the measures (n, M) in millimetres against the survey."""
    mean, sd = values.mean(axis=0), values.std(axis=0, ddof=1)
    good = holds(mean, sd, survey)
    lines = [f"{'measure (mm)':22}{'survey mean, sd':>18}{'heads mean, sd':>18}"]
    lines += [
        f"{name:22}{m0:11.1f}{s0:7.1f}{m:11.1f}{s:7.1f}  {'ok' if ok else 'OUT'}"
        for name, m0, s0, m, s, ok in zip(
            survey.names, survey.mean, survey.sd, mean, sd, good, strict=True
        )
    ]
    return "\n".join([*lines, f"{good.sum()} of {len(good)} within one sd and a factor 1.5"])
