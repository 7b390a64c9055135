"""faceambig posterior: how probable each distance is, how open the face is, and faces drawn from what is left."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from ..state import DEFAULT, FIELDS, changed
from ..state.forms import value_of
from .inputs import Start, add_fitting, add_input, fitting, start_of
from .progress import Progress
from .shared import (
    GOOD,
    add_outputs,
    note_lines,
    outputs_of,
    say_or_print,
    table_csv,
    version,
    written,
    written_lines,
)
from .sweep import add_distances, distances_of

if TYPE_CHECKING:
    from pathlib import Path

    import faceambig as fa
    from faceambig.arrays import Array

LEVELS = (0.5, 0.95)
MOST_DRAWS = 10_000


def add(command: argparse.ArgumentParser) -> None:
    """Its flags."""
    add_input(command, shared=("seed",))
    add_fitting(command, "all of the model", "none")
    add_distances(command, 0.2, 10.0, 48)
    command.add_argument(
        "--beyond", type=float, metavar="SHARE",
        help="probability before the picture of all distances beyond the last (default 0.05, with --between 0)",
    )  # fmt: skip
    command.add_argument(
        "--between", type=float, nargs=2, metavar=("M", "M"),
        help="the camera stood between these distances, metres; evenly probable in log distance",
    )  # fmt: skip
    command.add_argument(
        "--draws", type=int, metavar="N", help="write N faces drawn from the posterior to --out"
    )
    command.add_argument(
        "--out",
        metavar="FOLDER",
        help="where the faces go: a .ply each, and draws.csv with distances and coefficients",
    )
    add_outputs(command, "the density of the distance", "that density, and where the face is open")


def run(options: argparse.Namespace) -> int:
    """Say which distances and faces the points leave open; write table, picture and drawn faces if asked."""
    import faceambig as fa

    csv, plot = outputs_of(options)
    out, _ = _folder(options), _seed(options)
    distances = distances_of(options, least=2)
    start = start_of(options)
    between = options.between
    beyond = options.beyond
    if beyond is None:
        beyond = 0.05 if between is None else 0.0
    with Progress("fits", len(distances)) as progress:
        found = fa.posterior(
            start.model, start.observation, distances, prior=None if between is None else _within(*between),
            beyond=beyond, **_assumed(options, start), progress=progress,
        )  # fmt: skip
    sd = found.vertex_sd_mm
    spread = _spread(found.model, sd)
    prior = _prior_words(options, beyond)
    note = f"{start.model.name} model; {start.notes['landmarks']}"
    files: dict[Path, bytes] = {}
    if csv is not None:
        density = found.distance_density
        rows = zip(
            density.distances.tolist(),
            density.density.tolist(),
            density.cumulative.tolist(),
            strict=True,
        )
        files[csv] = table_csv(
            ("distance_m", "density_per_log_distance", "probability_nearer"), rows
        )
    if plot is not None:
        from faceambig.render.overlay import encode_png

        from ..reports.sheets import posterior_sheet

        drawn = posterior_sheet(found, sd, start.true_distance, prior, note)
        files[plot] = encode_png(drawn, {"Software": "faceambig", "Description": note})
    done = written(files, out, () if out is None else _draws(options, found, note))
    record = _record(found, spread, prior, beyond) | start.notes | {"files": done}
    fit = found.sweep.orthographic
    lines = [*_lines(found, spread, prior), *note_lines(fit, start.notes), *written_lines(done)]
    say_or_print(options, record, lines)
    return GOOD


def _folder(options: argparse.Namespace) -> Path | None:
    """Where drawn faces go; ValueError unless number and folder come together."""
    if (options.draws is None) != (options.out is None):
        raise ValueError("--draws N and --out FOLDER: one needs the other")
    if options.out is None:
        return None
    if not 1 <= options.draws <= MOST_DRAWS:
        raise ValueError(f"--draws: {options.draws} is not within 1 to {MOST_DRAWS}")
    from ..reports.photo import folder

    return folder(options.out, ())


def _seed(options: argparse.Namespace) -> int:
    """Of the draws, and of the noise of a subject."""
    if options.seed is None:
        return DEFAULT.seed
    return changed(DEFAULT, seed=value_of(FIELDS["seed"], options.seed)).seed


def _assumed(options: argparse.Namespace, start: Start) -> dict[str, Any]:
    """Keywords of `posterior`: of a saved fit its noise only, for its box and few modes make faces too sure."""
    asked = fitting(options, start)
    if start.fit is None:
        return asked
    weight = asked.pop("prior_weight")
    for name in ("modes", "box"):
        if getattr(options, name) is None:
            del asked[name]
    return asked if weight is None else asked | {"noise_px": weight**0.5}


def _within(low: float, high: float) -> Any:
    """Evenly probable in log distance from low to high, metres, and nowhere else."""
    if not 0 < low < high < float("inf"):
        raise ValueError(
            f"--between {low:g} {high:g}: two distances in metres are needed, the nearer first"
        )
    return lambda distances: ((distances >= low) & (distances <= high)).astype(float)


def _prior_words(options: argparse.Namespace, beyond: float) -> str:
    low, high = (options.low, options.high) if options.between is None else options.between
    words = f"uniform in log distance from {100 * low:.4g} to {100 * high:.4g} cm"
    if beyond:
        words += f", {100 * beyond:.3g} % beyond {100 * options.high:.4g} cm, where the camera is taken for far away"
    return words


def _spread(model: fa.FaceModel, sd: Array) -> dict[str, Any]:
    """Mean and largest sd of a vertex over the measured surface, and where."""
    import numpy as np

    measured = np.arange(len(sd)) if model.evaluation is None else model.evaluation
    worst = int(measured[np.argmax(sd[measured])])
    homes = [name for name, vertices in model.regions.items() if worst in vertices]
    parts = {name: float(sd[vertices].mean()) for name, vertices in model.regions.items()}
    return {
        "mean_mm": float(sd[measured].mean()),
        "max_mm": float(sd[worst]),
        "max_vertex": worst,
        "max_region": homes[0] if homes else None,
        "regions_mm": parts,
    }


def _record(
    found: fa.Posterior, spread: Mapping[str, Any], prior: str, beyond: float
) -> dict[str, Any]:
    intervals = [found.interval(level) for level in LEVELS]
    density = found.distance_density
    return {
        "most_probable_m": _most_probable(density),
        "intervals": [
            {"level": each.level, "low_m": each.low, "high_m": each.high} for each in intervals
        ],
        "beyond": density.beyond,
        "last_m": float(density.distances[-1]),
        "prior": {"words": prior, "beyond": beyond},
        "sigma_px": found.sigma_px,
        "vertex_sd": dict(spread),
        "version": version(),
    }


def _most_probable(density: fa.DistanceDensity) -> float:
    return float(density.distances[density.density.argmax()])


def _lines(found: fa.Posterior, spread: Mapping[str, Any], prior: str) -> Iterator[str]:
    density = found.distance_density
    yield f"most probable distance: {_cm(_most_probable(density))}"
    for level in LEVELS:
        each = found.interval(level)
        high = "infinity, it has no end" if each.high is None else _cm(each.high)
        yield f"{100 * level:g} % of the probability: from {_cm(each.low)} to {high}"
    yield _beyond_words(density)
    yield f"prior: {prior}"
    options = found.sweep.orthographic.options
    box = "no box" if options.box is None else f"box {options.box:g} sd"
    yield (
        f"landmark noise: {found.sigma_px:.2f} px per coordinate, with what modes left out would cause; "
        f"{options.modes} modes, {box}"
    )
    where = "" if spread["max_region"] is None else f", at the {spread['max_region']}"
    yield (
        f"face: a vertex has an sd of {spread['mean_mm']:.2f} mm in the mean over the measured surface, at most "
        f"{spread['max_mm']:.2f} mm (vertex {spread['max_vertex']}{where})"
    )
    if spread["regions_mm"]:
        ordered = sorted(spread["regions_mm"].items(), key=lambda part: -part[1])
        yield f"by part: {', '.join(f'{name} {mm:.1f}' for name, mm in ordered)} mm"


def _beyond_words(density: fa.DistanceDensity) -> str:
    """What is left for the distances beyond the last, in words."""
    last, share = _cm(float(density.distances[-1])), density.beyond
    if share == 0:
        return f"beyond {last}: ruled out by the prior"
    if share < 1e-4:
        return f"beyond {last}: practically ruled out by the points (probability {share:.1g})"
    return f"beyond {last}: probability {100 * share:.2g} %, so far that the camera is taken for infinitely far away"


def _cm(metres: float) -> str:
    return f"{100 * metres:.3g} cm" if metres < 10 else f"{metres:.3g} m"


def _draws(
    options: argparse.Namespace, found: fa.Posterior, note: str
) -> Iterator[tuple[str, bytes]]:
    """A mesh a draw, and a table of all."""
    import numpy as np

    from ..reports.photo import face_meshes

    seed = _seed(options)
    drawn = found.sample(options.draws, seed)
    digits = len(str(len(drawn)))
    names = [f"draw_{k:0{digits}}" for k in range(1, len(drawn) + 1)]
    header = ("draw", "distance_m", *(f"alpha_{j}" for j in range(1, drawn.alpha.shape[1] + 1)))
    rows = (
        (k, distance, *alpha)
        for k, (distance, alpha) in enumerate(
            zip(drawn.distances.tolist(), drawn.alpha.tolist(), strict=True), start=1
        )
    )
    yield "draws.csv", table_csv(header, rows)
    with Progress("faces", len(drawn)) as progress:
        for k, name in progress.over(enumerate(names)):
            distance = drawn.distances[k]
            place = "far away" if np.isinf(distance) else f"at {_cm(float(distance))}"
            words = f"draw {k + 1} of {len(drawn)}, seed {seed}, camera {place}"
            yield from face_meshes(drawn.model, name, drawn.alpha[k], (words, note), ("ply",))
