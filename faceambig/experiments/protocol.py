"""What every experiment takes and gives: settings in, tables, charts, pictures and claims out. Values only.

An experiment is a module of this package that ends with `EXPERIMENT = Experiment(name, title, paper, run)`; the table
of them is in `__init__`. Its work on each subject goes through `parallel.over_subjects`. What it gives is an
`Outcome`; nothing here knows how one is written down.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..chart import Chart, Line
from ..model import FaceModel

__all__ = [
    "Backend",
    "Cell",
    "Chart",
    "Claim",
    "Experiment",
    "Image",
    "Line",
    "Outcome",
    "Progress",
    "Settings",
    "Step",
    "Table",
    "silent",
]

Backend = Literal["loky", "dask", "ray"]
Cell = str | float | int | None


@dataclass(frozen=True, slots=True, eq=False)
class Settings:
    """What `faceambig reproduce` was asked for."""

    model: FaceModel
    model_name: str  # as it was asked for: "embedded", "ict" or a path
    n_subjects: int | None = None  # None: the experiment's own number
    seed: int = 0  # of everything drawn
    quick: bool = False  # fewer subjects and coarser grids: the trends, not the numbers
    backend: Backend = "loky"
    n_jobs: int = 1  # processes; -1 for all cores
    scheduler: str | None = None  # address of a Dask scheduler or a Ray head; None: this machine
    folder: Path | None = None  # where finished items are kept, for a run that is taken up again
    extra: Mapping[str, str] = field(default_factory=dict)  # for one experiment: regressor, archive

    def subjects(self, usual: int, quick: int) -> int:
        """How many subjects: as asked for, else the paper's `usual` number or the `quick` one."""
        if self.n_subjects is not None:
            return self.n_subjects
        return quick if self.quick else usual


class Step(NamedTuple):
    """How far a run is."""

    what: str  # "subjects"
    done: int
    total: int
    resumed: int = 0  # of those done, how many an earlier run had finished
    # Most memory that one process has taken so far; 0 where that is not known
    worker_bytes: int = 0


Progress = Callable[[Step], object]


def silent(step: Step) -> None:
    """Progress that nobody sees."""


@dataclass(frozen=True, slots=True)
class Table:
    """Named columns of numbers and words. Numbers with all their digits: rounded only where people read them."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""
    decimals: int = 2  # of numbers where they are shown to people

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise ValueError(
                    f"rows: {len(row)} cells in {self.title!r}, of {len(self.columns)} columns"
                )


@dataclass(frozen=True, slots=True, eq=False)
class Image:
    """A picture, with words for those who do not see it."""

    title: str
    pixels: NDArray[np.uint8]  # (h, w, 3)


@dataclass(frozen=True, slots=True)
class Claim:
    """One thing the paper says, and what was found here."""

    words: str  # what the paper says
    paper: str  # its number
    ours: str  # the number found
    holds: bool | None  # None: cannot be compared, or too close to be told
    why: str = ""  # a sentence on what differs and why


@dataclass(frozen=True, slots=True)
class Outcome:
    """What an experiment found."""

    name: str
    title: str
    tables: tuple[Table, ...]
    charts: tuple[Chart, ...] = ()
    images: tuple[Image, ...] = ()
    claims: tuple[Claim, ...] = ()
    settings: Mapping[str, Cell] = field(default_factory=dict)  # what decides the numbers


@dataclass(frozen=True, slots=True)
class Experiment:
    """A figure or table of the paper, by one call."""

    name: str
    title: str
    paper: str  # "Table 3", "section 6.4"
    run: Callable[[Settings, Progress], Outcome]
