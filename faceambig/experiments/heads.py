"""The people experiments are about, by number, and what they are made of: the same ones for every experiment and run.

A model's own subjects come first, heads that its modes did not make; further ones, and those of another seed, are
drawn from all modes of the model, unclipped, so that a fit with fewer modes does not hold them either.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ..arrays import Array
from ..model import FaceModel, Subject
from .protocol import Settings

BLOCK = 1000  # heads drawn from one generator
FIRST = 2019  # its seed; with it the ten heads of the measured tables are drawn


def person(model: FaceModel, number: int, seed: int = 0) -> Subject:
    """Head `number`, counted from 1: the model's own subject of that number if it has one and the seed is 0."""
    if number < 1:
        raise ValueError(f"number: {number} is not 1 or more")
    if seed == 0 and number <= len(model.subjects):
        return model.subject(number)
    alpha = drawn(model.n_modes, number, seed)
    about = f"drawn from all {model.n_modes} modes, seed {seed}"
    return Subject(f"head {number}", about, model.vertices(alpha), model.colours, model)


def drawn(n_modes: int, number: int, seed: int = 0) -> Array:
    """Shape (S,) of drawn head `number`, in standard deviations."""
    block, row = divmod(number - 1, BLOCK)
    return _block(n_modes, block, seed)[row]


@lru_cache(maxsize=4)
def _block(n_modes: int, block: int, seed: int) -> Array:
    # Row by row from one generator: how many of a block are used changes none of them
    key = FIRST + seed if block == 0 else [FIRST + seed, block]
    return np.random.default_rng(key).standard_normal((BLOCK, n_modes))


def who(settings: Settings, n: int) -> str:
    """Which people `n` of them are, in words for the report."""
    model = settings.model
    own = min(n, len(model.subjects)) if settings.seed == 0 else 0
    rest = f"drawn from all {model.n_modes} modes of the model, seed {settings.seed}, unclipped"
    if own == n:
        return f"the model's own subjects 1 to {n}, not made from its modes"
    if own == 0:
        return f"{n} heads {rest}"
    return f"the model's own {own} subjects, and {n - own} heads {rest}"


def usual_scheme(model: FaceModel) -> str:
    """The landmarks to fit: the 68 points of iBUG where the model has them, else its first scheme."""
    if "ibug68" in model.schemes:
        return "ibug68"
    if not model.schemes:
        raise ValueError(f"model {model.name!r} names no landmarks: no picture of it can be fitted")
    return next(iter(model.schemes))


def cm(metres: float | None) -> str:
    """A distance as in the paper's tables."""
    return "ortho" if metres is None else f"{100 * metres:g} cm"
