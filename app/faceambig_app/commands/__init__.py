"""The commands of faceambig, one module each: `add` gives a command its flags, `run` does it and returns the status.

Everything heavy is imported inside `run`: --help and a mistyped flag do not wait for NumPy.
"""

from __future__ import annotations

from types import ModuleType

from . import (
    animate,
    fit,
    landmarks,
    models,
    modes,
    posterior,
    reproduce,
    serve,
    snapshot,
    sweep,
)

# The order of the help
COMMANDS: tuple[tuple[str, ModuleType, str], ...] = (
    ("serve", serve, "open the page on this machine"),
    ("snapshot", snapshot, "draw the page's picture of a state, without a browser"),
    ("animate", animate, "draw a sweep of distances or a swing of a mode, or a page that plays it"),
    ("fit", fit, "fit a face to the points of a photograph"),
    ("sweep", sweep, "fit at many distances"),
    ("modes", modes, "other faces behind the same points: flexibility, posterior modes, extremes"),
    ("posterior", posterior, "how probable each distance is, and how open the face"),
    ("landmarks", landmarks, "find the points of a face in a photograph"),
    ("reproduce", reproduce, "the paper's tables and figures, and which of its claims hold"),
    ("models", models, "what a model holds; convert one, install a free one"),
)
