"""The numbers of a state as a file: JSON, or a table of a line a number."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any

import faceambig as fa
from faceambig.compose import Face, curves
from faceambig.io.pictures import DIAGONAL_35MM
from faceambig.scene import Curves

from ..pipeline import faces, fits, told
from ..pipeline.scenes import pin_face
from ..state import DEFAULT, Fitting, Target, ViewState, changed
from ..state.forms import to_json
from .provenance import file_name, notes, provenance, shown

FORMAT_VERSION = 1  # of the JSON; what is added does not raise it
UNITS = {"_m": "m", "_px": "px", "_percent": "%", "_mm": "mm", "_35mm": "mm"}
AXES = ("x", "y", "z")


def numbers(state: ViewState, kind: str) -> tuple[str, bytes]:
    """The numbers of a state as "json", or as "csv": a line a number, with its place and its unit."""
    return numbers_of(measured(state), state, kind)


def numbers_of(record: Mapping[str, Any], state: ViewState, kind: str) -> tuple[str, bytes]:
    """A record of numbers of a state as "json" or "csv"."""
    name = file_name(shown(state), f"numbers.{kind}")
    if kind == "json":
        return name, (json.dumps(record, indent=1) + "\n").encode()
    text = io.StringIO()
    text.writelines(f"# {note}\n" for note in notes(state))
    table = csv.writer(text, lineterminator="\n")
    table.writerow(("quantity", "at", "value", "unit"))
    table.writerows(_rows(record))
    return name, text.getvalue().encode()


def measured(state: ViewState) -> dict[str, Any]:
    """The numbers of a state by name: metres, pixels, radians, as `faceambig fit --json` has them.

    The curves and the interval are those of the unbent face, as on the page. None: far away, or not applicable.
    """
    state = changed(state, show="both")
    face = faces.face(state.target, state.fitting, state.bend)
    return {
        **source_of(state),
        "subject": fits.photograph(state.target).subject.name,
        "actual_m": state.actual,
        **numbers_of_face(face),
        "plausible": face.plausible,
        "d_l_percent": face.d_l_percent,
        "d_s_mm": face.d_s_mm,
        "alpha": face.alpha.tolist(),
        **_along_distance(state),
        **({"pins": _pins(state)} if state.pins else {}),
    }


def source_of(state: ViewState) -> dict[str, Any]:
    """What a record of numbers begins with: its format, and where it comes from."""
    origin = provenance(state)
    return {
        "format": "faceambig-numbers",
        "version": FORMAT_VERSION,
        "software": origin["Software"],
        "model": origin["Model"],
        "licence": origin["Licence"],
        "state": json.loads(to_json(state)),
    }


def numbers_of_face(face: Face) -> dict[str, Any]:
    """How a face is seen, by the fit's camera or by its own, and how the fit ended that it is a bend or another of."""
    seen = replace(face.fit, camera=face.camera)
    return {
        "camera": "orthographic" if seen.distance is None else "perspective",
        "distance_m": seen.distance,
        "status": str(seen.status),
        "d_l_unit": seen.interocular_meaning,
        "focal_px": seen.focal,
        "focal_35mm": focal_35mm(seen),
        "scale": seen.scale,
        "rotation": seen.rotation.tolist(),
        "translation_m": seen.translation.tolist(),
        "cost": seen.cost,
    }


def _pins(state: ViewState) -> list[dict[str, Any]]:
    """Each face that is kept: what it is called, how far off it is, and d_S to each of them in their order."""
    kept = told.pins_of(changed(state, hide=()))
    shown = [pin_face(pin) for pin in state.pins]
    return [
        {"name": name, "d_l_percent": face.d_l_percent, "d_s_mm": face.d_s_mm, "between_mm": row.tolist()}
        for name, face, row in zip(kept.names, shown, kept.d_s_mm, strict=True)
    ]  # fmt: skip


def focal_35mm(fit: fa.Fit) -> float | None:
    """Millimetres of the lens that frames the picture so on 35 mm film, diagonals compared; None if far away."""
    size = fit.observation.image_size
    if fit.focal is None or size is None:
        return None
    return fit.focal * DIAGONAL_35MM / math.hypot(*size)


def _along_distance(state: ViewState) -> dict[str, Any]:
    """Interval and curves of a target over all distances."""
    return along_distance(*swept(state.target, state.fitting._replace(distance=None)))


def along_distance(sweep: fa.Sweep, curve: Curves) -> dict[str, Any]:
    """Interval and curves of a sweep."""
    interval = sweep.interval()
    fits = (*sweep.fits, sweep.orthographic)
    return {
        "interval": {
            "low_m": interval.low,
            "high_m": interval.high,
            "empty": interval.empty,
            "pieces": interval.pieces,
            "best_d_l_percent": interval.best_d_l_percent,
            "tolerance_percent": interval.tolerance_percent,
        },
        "curves": {
            "distance_m": [*sweep.distances.tolist(), None],
            "d_l_percent": [*curve.d_l_percent.tolist(), curve.orthographic[0]],
            "d_s_mm": [*curve.d_s_mm.tolist(), curve.orthographic[1]],
            "focal_px": [fit.focal for fit in fits],
            "focal_35mm": [focal_35mm(fit) for fit in fits],
            "status": [str(fit.status) for fit in fits],
        },
    }


@lru_cache(maxsize=16)
def swept(target: Target, fitting: Fitting) -> tuple[fa.Sweep, Curves]:
    """The sweep behind a target's curves, and the curves; asked as `pipeline.curve` asks, so the numbers are its."""
    taken = fits.photograph(target)
    sweep = fa.sweep_distance(
        taken.subject.model,
        taken.observation,
        modes=None if fitting.modes == DEFAULT.modes else fitting.modes,
        box=fitting.box,
        noise_percent=fitting.prior,
        tolerance=1e-6,
    )
    return sweep, curves(taken.subject, sweep, target.actual)


def _rows(record: Mapping[str, Any]) -> list[tuple[str, object, object, str]]:
    """(quantity, at, value, unit) of each number: `at` is an axis, a mode from 1, or metres assumed, inf far away."""
    rows: list[tuple[str, object, object, str]] = []
    for name, value in record.items():
        if name in ("format", "version", "software", "model", "licence", "state", "curves", "pins"):
            continue
        if isinstance(value, Mapping):
            rows += [(f"{name}_{part}", "", _cell(v), _unit(part)) for part, v in value.items()]
        elif isinstance(value, list):
            # Of the orthographic camera the translation has no z
            places = range(1, len(value) + 1) if name == "alpha" else AXES[: len(value)]
            unit = {"alpha": "sd", "rotation": "rad"}.get(name) or _unit(name)
            rows += [(name, at, v, unit) for at, v in zip(places, value, strict=True)]
        else:
            rows.append((name, "", _cell(value), _unit(name)))
    # By numbers, as a table's program may take a name for a formula; the names are in the state above
    for number, pin in enumerate(record.get("pins", ()), start=1):
        rows += [
            (f"pin_{name}", number, pin[name], _unit(name)) for name in ("d_l_percent", "d_s_mm")
        ]
        between = enumerate(pin["between_mm"], start=1)
        rows += [("pin_between_mm", f"{number}-{k}", mm, "mm") for k, mm in between if k > number]
    metres = record["curves"]["distance_m"]
    for name, values in record["curves"].items():
        if name != "distance_m":
            rows += [
                (f"curve_{name}", _cell(at, "inf"), _cell(v), _unit(name))
                for at, v in zip(metres, values, strict=True)
            ]
    return rows


def _cell(value: object, nothing: str = "") -> object:
    return nothing if value is None else str(value).lower() if isinstance(value, bool) else value


def _unit(name: str) -> str:
    return next((unit for ending, unit in UNITS.items() if name.endswith(ending)), "")
