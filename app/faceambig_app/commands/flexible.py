"""Flexibility modes: what they have to say of a fit."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from .kinds import DRAWN, Result, name_of

if TYPE_CHECKING:
    import faceambig as fa
    from faceambig.arrays import Array
    from faceambig.flex import Linearisation

BENT_MM = 10.0  # of the table; no face is drawn farther unless asked for
# Names of the command line and of the library
AT: dict[str, Linearisation] = {"reprojection": "reprojection", "dlt": "algebraic"}


def flexible(options: argparse.Namespace, fit: fa.Fit) -> Result:
    import faceambig as fa
    from faceambig.flex import count_of, plausible_limit

    k1, k2 = _k1(options.k1), _k2(options.k2)  # before the work
    count = count_of(fit, 3 if options.count is None else options.count)
    modes = fa.flexibility_modes(
        fit.model, fit, None, linearisation=AT[options.at or "reprojection"], pose=options.pose or "fixed",
        free_distance=options.free_distance,
    )  # fmt: skip
    kept = modes.truncated(k1, **k2)
    limit = plausible_limit(len(fit.alpha))
    result = Result()
    result.header = (
        "mode", "landmark_percent_at_10_mm", "reach_low_mm", "reach_high_mm", "alpha_at_minus_10_mm", "alpha_at_10_mm",
        "kept", "kept_plausible", "words",
    )  # fmt: skip
    records: list[dict[str, Any]] = []
    for k in range(count):
        row = _mode_record(modes, kept, limit, k)
        records.append(row)
        result.rows.append(
            (k + 1, max(row["landmark_percent_at_10_mm"]), *row["reach_mm"], *row["alpha_size_at_10_mm"],
             int(row["kept"]), int(row["kept_plausible"]), row["words"])
        )  # fmt: skip
    result.record = {"modes": records, "alpha_size_limit": limit, "truncation": _truncation(kept)}
    result.lines = [*_flexible_lines(records, modes), *_kept_lines(kept, limit, len(fit.alpha))]
    for k, mm in _reached(modes, count, options.mm):
        _add_face(result, modes, k, mm, limit)
    return result


def _add_face(result: Result, modes: fa.FlexibilityModes, k: int, mm: float, limit: float) -> None:
    """The fit bent by `mm` along mode k: its file and, of the first modes, its picture."""
    import numpy as np

    fit = modes.fit
    alpha = fit.alpha + mm * modes.directions[k]
    words = f"flexibility mode {k + 1}, {mm:+.3g} mm: {modes.words[k]}"
    result.faces.append((name_of("mode", k, mm), alpha, words))
    if k < DRAWN:
        from ..reports.sheets import mode_face

        d_l = _landmark_error(fit, alpha, modes.camera(k, mm))
        # at the end of the reach itself, too
        plausible = float(np.linalg.norm(alpha)) <= limit * (1 + 1e-9)
        result.drawn.append(mode_face(k + 1, mm, alpha, d_l, plausible))


def _reached(
    modes: fa.FlexibilityModes, count: int, mm: float | None
) -> Iterator[tuple[int, float]]:
    """(mode, millimetres) to both sides: as asked, or as far as the face is plausible, 10 mm at most."""
    if mm is not None and not 0 < mm < float("inf"):
        raise ValueError(f"--mm: {mm:g} is not above 0")
    for k in range(count):
        low, high = (-BENT_MM, BENT_MM) if mm is None else (-mm, mm)
        if mm is None and modes.reach(k) != (0.0, 0.0):
            low, high = max(low, modes.reach(k)[0]), min(high, modes.reach(k)[1])
        yield k, low
        yield k, high


def _k1(mm: float | None) -> float:
    """Millimetres of the truncation; ValueError unless positive."""
    if mm is not None and not 0 < mm < float("inf"):
        raise ValueError(f"--k1: {mm:g} mm is not above 0 and finite")
    return 2.0 if mm is None else mm


def _k2(text: str | None) -> dict[str, float]:
    """Keyword of `truncated`: pixels, or percent of the interocular distance where the text ends so."""
    if text is None:
        return {}
    name = "landmark_percent" if text.endswith("%") else "landmark_px"
    try:
        value = float(text.removesuffix("%"))
    except ValueError as error:
        raise ValueError(
            f"--k2: {text!r:.40} is not a number of pixels, or of percent as in 1%"
        ) from error
    if not 0 < value < float("inf"):
        raise ValueError(f"--k2: {text!r:.40} is not above 0 and finite")
    return {name: value}


def _mode_record(
    modes: fa.FlexibilityModes, kept: fa.KeptModes, limit: float, k: int
) -> dict[str, Any]:
    import numpy as np

    fit, f = modes.fit, modes.directions[k]
    ends = (-BENT_MM, BENT_MM)
    sizes = [float(np.linalg.norm(fit.alpha + mm * f)) for mm in ends]
    at_k1 = [float(np.linalg.norm(fit.alpha + sign * kept.surface_mm * f)) for sign in (-1, 1)]
    is_kept = k in kept.kept
    return {
        "number": k + 1,
        "words": modes.words[k],
        "landmark_percent_per_mm": float(modes.landmark_percent[k]),  # first order
        "landmark_percent_at_10_mm": [_moved(modes, k, mm) for mm in ends],
        "reach_mm": list(modes.reach(k)),
        "alpha_size_at_10_mm": sizes,
        "kept": bool(is_kept),
        "kept_plausible": bool(is_kept and max(at_k1) <= limit),
        "direction": f.tolist(),
    }


def _moved(modes: fa.FlexibilityModes, k: int, mm: float) -> float:
    """Mean landmark movement in the picture by `mm` along a mode, projected, not linearised; % of the eye distance."""
    import numpy as np

    fit = modes.fit
    seen = fit.observation.visible
    bent = _projected(fit, fit.alpha + mm * modes.directions[k], modes.camera(k, mm))[seen]
    way = np.linalg.norm(bent - fit.projected()[seen], axis=1).mean()
    return 100 * float(way) / fit.interocular_px


def _landmark_error(fit: fa.Fit, alpha: Array, camera: Any) -> float:
    """d_L of a face in the fit's photograph."""
    from faceambig.metrics import mean_gap_percent

    seen = fit.observation.visible
    gaps = (fit.observation.points - _projected(fit, alpha, camera))[seen]
    return mean_gap_percent(gaps, fit.interocular_px)


def _projected(fit: fa.Fit, alpha: Array, camera: Any) -> Array:
    """(L, 2) pixels: the landmarks of a face, seen by a camera."""
    from dataclasses import replace

    return replace(fit, alpha=alpha, camera=camera).projected()


def _truncation(kept: fa.KeptModes) -> dict[str, Any]:
    return {
        "k1_mm": kept.surface_mm,
        "k2_px": kept.landmark_px,
        "kept": [int(k) + 1 for k in kept.kept],
        "plausible": kept.plausible,
        "plausible_upper": kept.plausible_upper,
        "plausible_faces": kept.plausible_faces,
    }


def _flexible_lines(records: Sequence[dict[str, Any]], modes: fa.FlexibilityModes) -> Iterator[str]:
    yield f"flexibility modes, landmarks by {modes.linearisation}, pose {modes.pose}"
    yield "mode   landmarks % at 10 mm   plausible from to mm   |alpha| at -10 +10 mm   kept            moves"
    for row in records:
        landmarks = max(row["landmark_percent_at_10_mm"])
        low, high = row["reach_mm"]
        minus, plus = row["alpha_size_at_10_mm"]
        kept = "kept, plausible" if row["kept_plausible"] else "kept" if row["kept"] else "-"
        yield (
            f"{row['number']:4} {landmarks:22.2f} {low:12.1f} {high:9.1f} {minus:14.1f} {plus:8.1f}   "
            f"{kept:<15} {row['words']}"
        )


def _kept_lines(kept: fa.KeptModes, limit: float, S: int) -> list[str]:
    return [
        f"a face is plausible up to |alpha| {limit:.1f}, 3 sd above the mean of {S} coefficients",
        (
            f"{len(kept)} of {S} modes are kept: {kept.surface_mm:g} mm of the surface move the landmarks by less than "
            f"{kept.landmark_px:.3g} px; {kept.plausible_faces} of them give plausible faces both ways"
        ),
    ]
