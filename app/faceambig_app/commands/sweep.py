"""faceambig sweep: fits at many distances, and the distances the points cannot tell apart."""

from __future__ import annotations

import argparse
import json
from typing import TYPE_CHECKING

from .shared import GOOD, NOT_CONVERGED, add_points, fit_record, observation_of

if TYPE_CHECKING:
    import faceambig as fa


def add(command: argparse.ArgumentParser) -> None:
    """Its flags."""
    add_points(command)
    command.add_argument(
        "--from",
        dest="low",
        type=float,
        default=0.2,
        metavar="M",
        help="nearest distance (default 0.2)",
    )
    command.add_argument(
        "--to",
        dest="high",
        type=float,
        default=3.0,
        metavar="M",
        help="farthest distance (default 3)",
    )
    command.add_argument(
        "--steps", type=int, default=13, help="distances, evenly in ratio (default 13)"
    )


def run(options: argparse.Namespace) -> int:
    """Fit at many distances and with the far-away camera."""
    import numpy as np

    import faceambig as fa

    if not 0.2 <= options.low <= options.high < float("inf") or not 1 <= options.steps <= 1000:
        raise ValueError(
            f"--from {options.low:g} --to {options.high:g} --steps {options.steps}: "
            "from at least 0.2 m up to `to`, 1 to 1000 steps"
        )
    model = fa.load_model(options.model)
    observation, notes = observation_of(options, model)
    sweep = fa.sweep_distance(
        model, observation, np.geomspace(options.low, options.high, options.steps),
        modes=options.modes, box=options.box, noise_percent=options.prior,
    )  # fmt: skip
    interval = sweep.interval()
    fits = (*sweep.fits, sweep.orthographic)
    speeds = [*sweep.speed_mm_per_octave().tolist(), 0.0]  # at infinity no doubling changes a thing
    if options.json:
        span = {
            "low_m": interval.low,
            "high_m": interval.high,
            "empty": interval.empty,
            "pieces": interval.pieces,
            "best_d_l_percent": interval.best_d_l_percent,
            "tolerance_percent": interval.tolerance_percent,
        }
        records = [
            fit_record(fit) | {"speed_mm_per_octave": speed}
            for fit, speed in zip(fits, speeds, strict=True)
        ]
        # JSON knows no infinity: null is the orthographic camera, as in distance_m
        disagreed = [None if np.isinf(d) else d for d in sweep.disagreed.tolist()]
        print(
            json.dumps(
                {"fits": records, "interval": span, "disagreed_distances_m": disagreed} | notes
            )
        )
    else:
        print("distance cm   d_L %   face changes mm per doubling   status")
        for fit, speed in zip(fits, speeds, strict=True):
            name = "orthographic" if fit.distance is None else f"{100 * fit.distance:.4g}"
            print(f"{name:>12} {fit.d_l_percent:7.3f} {speed:30.2f}   {fit.status}")
        if len(sweep.disagreed):
            print(
                f"at {len(sweep.disagreed)} distances another fit came from the other side; the lower cost is kept"
            )
        print(interval_words(interval))
        print(
            f"interocular distance: {fits[0].interocular_px:.1f} px, {fits[0].interocular_meaning}"
        )
        print(
            f"principal point: {notes['principal_point']}; picture size: {notes['image_size_from']}"
        )
        print(f"landmarks: {notes['landmarks']}")
    return GOOD if all(fit.converged for fit in fits) else NOT_CONVERGED


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
