"""faceambig models: what a model holds."""

from __future__ import annotations

import argparse
import json

from .shared import GOOD


def add(command: argparse.ArgumentParser) -> None:
    """Its flags."""
    command.add_argument(
        "model",
        nargs="?",
        default="embedded",
        metavar="MODEL",
        help="model name or path (default embedded)",
    )
    command.add_argument(
        "--scheme", metavar="NAME", help="list the points of this scheme: name, side, vertex"
    )
    command.add_argument("--json", action="store_true", help="print JSON for programs")


def run(options: argparse.Namespace) -> int:
    """Say what a model holds, or list one of its schemes."""
    import faceambig as fa

    model = fa.load_model(options.model)
    chosen = [model.scheme(options.scheme)] if options.scheme else list(model.schemes.values())
    if options.json:
        keys = ("name", "side", "vertex")
        schemes = {
            scheme.name: [dict(zip(keys, row, strict=True)) for row in scheme.rows()]
            for scheme in chosen
        }
        about = {"name": model.name, "source": model.source, "licence": model.licence}
        sizes = {
            "vertices": model.n_vertices,
            "modes": model.n_modes,
            "subjects": len(model.subjects),
        }
        print(json.dumps(about | sizes | {"schemes": schemes}))
    elif options.scheme:
        for name, side, vertex in chosen[0].rows():
            print(f"{name:>6} {side:>6} {vertex:6}")
    else:
        print(f"{model.name}: {model.source}; {model.licence}")
        print(f"{model.n_vertices} vertices, {model.n_modes} modes, {len(model.subjects)} subjects")
        for scheme in chosen:
            print(f"scheme {scheme.name}: {len(scheme)} points; eyes: {scheme.eyes_meaning}")
    return GOOD
