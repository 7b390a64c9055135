"""faceambig sweep: fits at many distances, and the distances the points cannot tell apart."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from .inputs import Start, add_fitting, add_input, fitting, start_of
from .progress import Progress
from .shared import (
    GOOD,
    NOT_CONVERGED,
    add_outputs,
    fit_record,
    note_lines,
    outputs_of,
    say_or_print,
    table_csv,
    written,
    written_lines,
)

if TYPE_CHECKING:
    from pathlib import Path

    import faceambig as fa
    from faceambig.arrays import Array

    from ..reports.sheets import Reference

HEADER = (
    "distance_m",
    "d_l_percent",
    "d_s_mm",
    "speed_mm_per_octave",
    "focal_px",
    "scale_px_per_m",
    "status",
)
REFERENCES = {
    "true": "the true face",
    "best": "the face of least landmark error",
    "saved": "the saved fit",
}


def add(command: argparse.ArgumentParser) -> None:
    """Its flags."""
    add_input(command)
    add_fitting(command)
    add_distances(command, 0.2, 3.0, 13)
    add_outputs(command, "the fits", "landmark error and surface difference against the distance")


def add_distances(command: argparse.ArgumentParser, low: float, high: float, steps: int) -> None:
    """Which distances are fitted at."""
    for flag, name, value, words in (
        ("--from", "low", low, "nearest"),
        ("--to", "high", high, "farthest"),
    ):
        command.add_argument(
            flag,
            dest=name,
            type=float,
            default=value,
            metavar="M",
            help=f"{words} distance (default {value:g})",
        )
    command.add_argument(
        "--steps", type=int, default=steps, help=f"distances, evenly in ratio (default {steps})"
    )


def distances_of(options: argparse.Namespace, least: int = 1) -> Array:
    """(steps,) metres; ValueError out of range."""
    import numpy as np

    low, high, steps = options.low, options.high, options.steps
    if not 0.2 <= low <= high < float("inf") or not least <= steps <= 1000:
        raise ValueError(
            f"--from {low:g} --to {high:g} --steps {steps}: from at least 0.2 m up to `to`, {least} to 1000 steps"
        )
    return np.geomspace(low, high, steps)


def run(options: argparse.Namespace) -> int:
    """Fit at many distances and with the far-away camera; write table and picture if asked."""
    import faceambig as fa

    csv, plot = outputs_of(options)
    distances = distances_of(options)
    start = start_of(options)
    with Progress("fits", len(distances)) as progress:
        sweep = fa.sweep_distance(
            start.model, start.observation, distances, **fitting(options, start), progress=progress
        )
    with Progress("speeds", len(distances)) as progress:
        # at infinity no doubling changes a thing
        speeds = [*sweep.speed_mm_per_octave(progress=progress).tolist(), 0.0]
    fits = (*sweep.fits, sweep.orthographic)
    reference, face = _reference(start, sweep)
    gaps = _differences(fits, face) if options.json or csv or plot else []
    files: dict[Path, bytes] = {}
    if csv is not None:
        files[csv] = table_csv(HEADER, _rows(fits, speeds, gaps))
    if plot is not None:
        files[plot] = _picture(sweep, gaps, reference, start)
    done = written(files)
    interval = sweep.interval()
    record = _record(sweep, interval, speeds, gaps) | {"d_s_reference": REFERENCES[reference]}
    lines = [
        *_table(fits, speeds),
        *_interval_lines(sweep, interval),
        *note_lines(fits[0], start.notes),
    ]
    say_or_print(options, record | start.notes | {"files": done}, lines + written_lines(done))
    return GOOD if all(fit.converged for fit in fits) else NOT_CONVERGED


def _reference(start: Start, sweep: fa.Sweep) -> tuple[Reference, Array]:
    """The face that those of the sweep are compared with, (N, 3): the true one where it is known."""
    if start.subject is not None:
        return "true", start.subject.vertices
    if start.fit is not None:
        return "saved", start.fit.vertices()
    return "best", min(
        (*sweep.fits, sweep.orthographic), key=lambda fit: fit.d_l_percent
    ).vertices()


def _differences(fits: Sequence[fa.Fit], face: Array) -> list[float]:
    """d_S of each fit to a face, mm."""
    from faceambig.metrics import surface_difference

    with Progress("surfaces", len(fits)) as progress:
        region = fits[0].model.evaluation
        return [
            surface_difference(fit.vertices(), face, region).mean_mm for fit in progress.over(fits)
        ]


def _rows(
    fits: Sequence[fa.Fit], speeds: Sequence[float], gaps: Sequence[float]
) -> Iterator[tuple[Any, ...]]:
    """Rows of the table; the distance of the orthographic camera is inf."""
    for fit, speed, gap in zip(fits, speeds, gaps, strict=True):
        distance = "inf" if fit.distance is None else fit.distance
        yield distance, fit.d_l_percent, gap, speed, fit.focal, fit.camera.s, str(fit.status)


def _picture(sweep: fa.Sweep, gaps: Sequence[float], reference: Reference, start: Start) -> bytes:
    import numpy as np

    from faceambig.metrics import HUMAN_TOLERANCE_PERCENT
    from faceambig.render.overlay import encode_png
    from faceambig.scene import Curves

    from ..reports.sheets import sweep_sheet

    curves = Curves(
        distances=sweep.distances,
        d_l_percent=sweep.d_l_percent,
        d_s_mm=np.array(gaps[:-1]),
        orthographic=(sweep.orthographic.d_l_percent, gaps[-1]),
        true_distance=np.nan if start.true_distance is None else start.true_distance,
        tolerance_percent=HUMAN_TOLERANCE_PERCENT,
    )
    note = f"{start.model.name} model; {start.notes['landmarks']}"
    return encode_png(
        sweep_sheet(curves, reference, note), {"Software": "faceambig", "Description": note}
    )


def _record(
    sweep: fa.Sweep, interval: fa.Interval, speeds: Sequence[float], gaps: Sequence[float]
) -> dict[str, Any]:
    span = {
        "low_m": interval.low,
        "high_m": interval.high,
        "empty": interval.empty,
        "pieces": interval.pieces,
        "best_d_l_percent": interval.best_d_l_percent,
        "tolerance_percent": interval.tolerance_percent,
    }
    fits = (*sweep.fits, sweep.orthographic)
    records = [
        fit_record(fit) | {"speed_mm_per_octave": speed, "d_s_mm": gap}
        for fit, speed, gap in zip(fits, speeds, gaps, strict=False)
    ]
    # JSON knows no infinity: null is the orthographic camera, as in distance_m
    disagreed = [None if d == float("inf") else d for d in sweep.disagreed.tolist()]
    return {"fits": records, "interval": span, "disagreed_distances_m": disagreed}


def _table(fits: Sequence[fa.Fit], speeds: Sequence[float]) -> Iterator[str]:
    yield "distance cm   d_L %   face changes mm per doubling   status"
    for fit, speed in zip(fits, speeds, strict=True):
        name = "orthographic" if fit.distance is None else f"{100 * fit.distance:.4g}"
        yield f"{name:>12} {fit.d_l_percent:7.3f} {speed:30.2f}   {fit.status}"


def _interval_lines(sweep: fa.Sweep, interval: fa.Interval) -> list[str]:
    lines = [interval_words(interval)]
    if len(sweep.disagreed):
        words = f"at {len(sweep.disagreed)} distances another fit came from the other side; the lower cost is kept"
        lines.insert(0, words)
    return lines


def interval_words(interval: fa.Interval) -> str:
    """The distances a tolerance cannot tell apart, as a sentence."""
    tolerance = f"{interval.tolerance_percent:g} %"
    if interval.empty:
        return f"no distance brings d_L under {tolerance}: the best is {interval.best_d_l_percent:.2f} %"
    low = "the nearest tried" if interval.low is None else f"{100 * interval.low:.3g} cm"
    high = "infinity" if interval.high is None else f"{100 * interval.high:.3g} cm"
    others = (
        "" if interval.pieces == 1 else f" ({interval.pieces} such ranges; this one holds the best)"
    )
    return (
        f"d_L stays under {tolerance} from {low} to {high}{others}: "
        "within it the points do not tell the distance"
    )
