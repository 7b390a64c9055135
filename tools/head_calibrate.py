"""Fit the means, sex differences and sds of the calibrated axes to the survey.

`python tools/head_calibrate.py [--wheel PATH]` rewrites the columns mean, male and sd of the rows
with fit = 1 in head_data/axes.csv. All else (which axes, looks) is set by hand there. Least squares
over the survey's means by sex and its sds, on the same drawn people in every step, with a ridge
that keeps each axis near its neutral value: many axes move one measure, and large opposite shifts
would fit as well and look wrong.
"""

from __future__ import annotations

import os

os.environ["OPENBLAS_NUM_THREADS"] = "1"

import argparse
import csv
import dataclasses
import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from build_head import DECIMETRE, make_head
from head_measures import end_vertices, measure, read_survey, report
from head_mesh import add_eyes
from head_people import (
    DATA,
    Axes,
    People,
    axis_weights,
    draw_people,
    macro_weights,
    make_generator,
    read_axes,
)
from head_source import Source, find_wheel

Array = NDArray[np.float64]

N_PEOPLE, SEED = 400, 77  # not the model's people
TYPICAL_MM = 2.2  # a neutral sd moves the most mobile vertex by 0.8 of this
# Tolerances: of a mean and a sex difference in survey sds, of a log sd.
MEAN_TOL, MALE_TOL, SD_TOL = 0.08, 0.12, 0.10
# Ridge: how far, in millimetres of its most mobile vertex, an axis may stray for one unit.
MEAN_MM, MALE_MM, LOG_SD = 4.0, 1.2, 0.6


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--wheel", type=Path)
    source = Source(find_wheel(parser.parse_args().wheel))
    topology = json.loads((DATA / "topology.json").read_text(encoding="utf-8"))
    head, axes, survey = make_head(source, topology), read_axes(), read_survey()
    generator = make_generator(source, head.base, topology, axes)
    people = draw_people(N_PEOPLE, axes, SEED)
    men = people.sex > 0.5

    fitted = np.flatnonzero(axes.fitted)
    place = {name: k for k, name in enumerate(generator.names)}
    reach = np.array(
        [  # millimetres of the largest shift at amplitude 1
            100.0 * np.linalg.norm(generator.shifts[place[axes.plus[k]]], axis=1).max()
            for k in fitted
        ]
    )
    neutral_sd = 0.8 * np.minimum(0.40, TYPICAL_MM / reach)

    moving = [n for n, _ in axis_weights(subset(axes, fitted), people_subset(people, fitted))]
    weights = dict([*macro_weights(people), *axis_weights(axes, people)])
    table = np.stack([weights[n] * (n not in moving) for n in generator.names], axis=1)
    size = generator.neutral.size
    still = generator.neutral.ravel() + table @ generator.shifts.reshape(-1, size)
    shifts = generator.shifts[[place[n] for n in moving]].reshape(-1, size)
    ends = end_vertices(survey, head.farkas)
    rows = head.operator[ends.ravel()]
    n_head = len(head.base.kept)

    def values(trial: Axes) -> Array:
        part = people_subset(people, fitted)
        now = np.stack([w for _, w in axis_weights(subset(trial, fitted), part)], axis=1)
        points = (still + now @ shifts).reshape(N_PEOPLE, -1, 3)
        balls = points[:, n_head:].reshape(N_PEOPLE, 2, -1, 3)
        shapes = DECIMETRE * add_eyes(head.base, points[:, :n_head], balls)
        flat = rows @ shapes.transpose(1, 0, 2).reshape(shapes.shape[1], -1)
        return measure(flat.reshape(*ends.shape, N_PEOPLE, 3).transpose(2, 0, 1, 3), survey.names)

    def apply(x: Array) -> Axes:
        mean, male, log_sd = x.reshape(3, -1)
        trial = dataclasses.replace(
            axes, mean=axes.mean.copy(), male=axes.male.copy(), sd=axes.sd.copy()
        )
        trial.mean[fitted] = mean / reach
        trial.male[fitted] = male / reach
        trial.sd[fitted] = neutral_sd * np.exp(log_sd)
        return trial

    wanted = survey.by_sex[:, 1] - survey.by_sex[:, 0]
    # The intercanthal distance has no figures by sex: the same share of its sd as the pupils'.
    pupils = survey.names.index("interpupillary")
    share = wanted[pupils] / survey.sd[pupils]
    wanted = np.where(np.isnan(wanted), share * survey.sd, wanted)

    def residuals(x: Array) -> Array:
        v = values(apply(x))
        apart = v[men].mean(axis=0) - v[~men].mean(axis=0)
        mean, male, log_sd = x.reshape(3, -1)
        return np.concatenate(
            [
                (v.mean(axis=0) - survey.mean) / survey.sd / MEAN_TOL,
                (apart - wanted) / survey.sd / MALE_TOL,
                np.log(v.std(axis=0) / survey.sd) / SD_TOL,
                mean / MEAN_MM,
                male / MALE_MM,
                log_sd / LOG_SD,
            ]
        )

    start = np.stack(
        [
            axes.mean[fitted] * reach,
            axes.male[fitted] * reach,
            np.log(axes.sd[fitted] / neutral_sd),
        ]
    ).ravel()
    step = np.repeat([0.3, 0.3, 0.1], len(fitted))
    # Millimetres, millimetres, log: bounds against the absurd; the ridge is what holds.
    low = np.repeat([-12.0, -4.0, -1.6], len(fitted))
    high = np.repeat([12.0, 4.0, 1.1], len(fitted))
    found = least_squares(
        residuals,
        np.clip(start, low + 1e-3, high - 1e-3),  # files are rounded: a bound may be just missed
        x_scale=step,
        diff_step=1e-3,
        max_nfev=12,
        bounds=(low, high),
    )
    best = apply(found.x)
    v = values(best)
    print(report(v, survey))
    for name, want, got in zip(
        survey.names,
        wanted,
        v[men].mean(axis=0) - v[~men].mean(axis=0),
        strict=True,
    ):
        print(f"men minus women, {name:22}{want:7.1f}{got:7.1f}")
    write_axes(best, fitted)


def subset(axes: Axes, keep: NDArray[np.int64]) -> Axes:
    """Only the kept axes."""
    return Axes(
        **{
            f.name: (
                tuple(getattr(axes, f.name)[k] for k in keep)
                if isinstance(getattr(axes, f.name), tuple)
                else getattr(axes, f.name)[keep]
            )
            for f in dataclasses.fields(axes)
        }
    )


def people_subset(people: People, keep: NDArray[np.int64]) -> People:
    """The same people with the draws of the kept axes only."""
    return dataclasses.replace(people, z=people.z[:, keep], side=people.side[:, keep])


def write_axes(axes: Axes, fitted: NDArray[np.int64]) -> None:
    """Rewrite mean, male and sd of the fitted rows; comments and other rows stay."""
    path = DATA / "axes.csv"
    lines = path.read_text(encoding="utf-8").splitlines()
    top = [line for line in lines if line.startswith("#")]
    rows = list(csv.reader(line for line in lines if not line.startswith("#")))
    column = {name: k for k, name in enumerate(rows[0])}
    for k in fitted:
        for name in ("mean", "male", "sd"):
            rows[k + 1][column[name]] = f"{getattr(axes, name)[k]:.4f}"
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write("\n".join(top) + "\n")
        csv.writer(file, lineterminator="\n").writerows(rows)


if __name__ == "__main__":
    main()
