"""What a kind of modes has to say of a fit: modes by probability, and the two extremes. By flexibility: flexible.py."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from .progress import Progress

if TYPE_CHECKING:
    import faceambig as fa
    from faceambig.arrays import Array

    from ..reports.sheets import Bent

BENT_SD = 2.0  # of drawn posterior modes
DRAWN = 3  # modes in the picture
STARTS = 24  # of the search for extreme faces, the library's default


class Result:
    """What one of the three kinds has to say. Filled in by it, written and printed by `run`."""

    def __init__(self) -> None:
        self.record: dict[str, Any] = {}
        self.lines: list[str] = []
        self.header: tuple[str, ...] = ()
        self.rows: list[tuple[Any, ...]] = []
        self.drawn: list[Bent] = []
        self.faces: list[tuple[str, Array, str]] = []  # name of the file, alpha, words


# ---- posterior ----


def posterior(options: argparse.Namespace, fit: fa.Fit) -> Result:
    import faceambig as fa

    modes = fa.posterior_modes(
        fit.model, fit, 3 if options.count is None else options.count, pose=options.pose or "free",
        free_distance=options.free_distance,
    )  # fmt: skip
    spread = fa.surface_spread(fit.model, fit)
    result = Result()
    result.header = ("mode", "sd_mm", "landmark_percent", "words")
    rows = zip(
        modes.amplitude_mm.tolist(), modes.landmark_percent.tolist(), modes.words, strict=True
    )
    result.rows = [(k, *row) for k, row in enumerate(rows, start=1)]
    result.record = _posterior_record(result.rows, modes, spread)
    result.lines = _posterior_lines(result.rows, modes, spread, options.free_distance)
    for k, sd in _signs(len(modes.words), BENT_SD):
        _add_deviation(result, modes, k, sd)
    return result


def _posterior_record(
    rows: list[tuple[Any, ...]], modes: fa.PosteriorModes, spread: fa.SurfaceSpread
) -> dict[str, Any]:
    return {
        "modes": [
            {"number": k, "words": words, "sd_mm": sd, "landmark_percent": moved, "direction": f}
            for (k, sd, moved, words), f in zip(rows, modes.directions.tolist(), strict=True)
        ],
        "total_mm": modes.total_mm,
        "pose": modes.pose,
        "noise_px": modes.noise_px,
        "spread": {
            "prior_mm": spread.prior_mm,
            "shape_mm": spread.shape_mm,
            "pose_mm": spread.pose_mm,
            "distance_mm": spread.distance_mm,
            "total_mm": spread.total_mm,
        },
    }


def _posterior_lines(
    rows: list[tuple[Any, ...]],
    modes: fa.PosteriorModes,
    spread: fa.SurfaceSpread,
    free_distance: bool,
) -> list[str]:
    return [
        (
            f"posterior modes, pose {modes.pose}{', distance free' if free_distance else ''}, landmark noise "
            f"{modes.noise_px:.2f} px"
        ),
        "mode   1 sd mm   landmarks %   moves",
        *(f"{k:4} {sd:9.2f} {moved:13.2f}   {words}" for k, sd, moved, words in rows),
        f"all modes together: {modes.total_mm:.2f} mm, rms over the measured surface, 1 sd",
        (
            f"of it by shape {spread.shape_mm:.2f} mm, added by pose {spread.pose_mm:.2f} mm, added by distance "
            f"{spread.distance_mm:.2f} mm; with all open {spread.total_mm:.2f} mm, before any picture "
            f"{spread.prior_mm:.2f} mm"
        ),
    ]


def _add_deviation(result: Result, modes: fa.PosteriorModes, k: int, sd: float) -> None:
    """The fit `sd` standard deviations along mode k: its file and, of the first modes, its picture."""
    alpha = modes.fit.alpha + sd * modes.directions[k]
    words = f"posterior mode {k + 1}, {sd:+g} sd: {modes.words[k]}"
    result.faces.append((name_of("posterior", k, sd), alpha, words))
    if k < DRAWN:
        from ..reports.sheets import deviation_face

        moved = abs(sd) * float(modes.landmark_percent[k])
        result.drawn.append(deviation_face(k + 1, sd, alpha, moved))


# ---- extremes ----


def extremes(options: argparse.Namespace, fit: fa.Fit) -> Result:
    import faceambig as fa

    from ..reports.sheets import extreme_face

    tolerance = 3.0 if options.tolerance is None else options.tolerance
    with Progress("starts", STARTS) as progress:
        found = fa.extreme_faces(
            fit.model,
            fit,
            tolerance,
            pose=options.pose or "fixed",
            starts=STARTS,
            progress=progress,
        )
    result = Result()
    result.header = ("face", "rms_mm", "mean_mm", "d_s_mm", "landmark_rms_percent", "d_l_percent")
    result.rows = [
        (k, face.rms_mm, face.mean_mm, face.d_s_mm, face.landmark_rms_percent, face.d_l_percent)
        for k, face in enumerate(found.faces, start=1)
    ]
    result.record = _extremes_record(result, found)
    result.lines = _extremes_lines(result.rows, found)
    for k, face in enumerate(found.faces, start=1):
        words = f"extreme face {k}, {face.rms_mm:.2f} mm rms from the fit"
        result.faces.append((f"extreme_{k}", face.alpha, words))
        result.drawn.append(extreme_face(k, face))
    return result


def _extremes_record(result: Result, found: fa.ExtremeFaces) -> dict[str, Any]:
    return {
        "faces": [
            dict(zip(result.header, row, strict=True)) | {"alpha": face.alpha.tolist()}
            for row, face in zip(result.rows, found.faces, strict=True)
        ],
        "tolerance_percent": found.tolerance_percent,
        "pose": found.pose,
        "reached_mm": found.faces[0].rms_mm,
        "bound_mm": found.bound_mm,
        "ratio": found.ratio,
    }


def _extremes_lines(rows: list[tuple[Any, ...]], found: fa.ExtremeFaces) -> list[str]:
    return [
        (
            f"extreme faces, landmarks within {found.tolerance_percent:g} % rms of the eye distance, pose {found.pose}"
        ),
        "face   rms mm   mean mm   d_S mm   landmarks rms %   d_L %",
        *(
            f"{k:4} {rms:8.2f} {mean:9.2f} {d_s:8.2f} {marks:17.2f} {d_l:7.2f}"
            for k, rms, mean, d_s, marks, d_l in rows
        ),
        (
            f"reached {found.faces[0].rms_mm:.2f} mm rms; no face passes {found.bound_mm:.2f} mm while landmarks are "
            f"linear in the shape, and {100 * found.ratio:.0f} % of that was found there"
        ),
    ]


# ---- shared ----


def _signs(count: int, size: float) -> Iterator[tuple[int, float]]:
    for k in range(count):
        yield k, -size
        yield k, size


def name_of(kind: str, k: int, amount: float) -> str:
    return f"{kind}_{k + 1}_{'plus' if amount > 0 else 'minus'}"
