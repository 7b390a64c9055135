"""The paper's tables and figures, one module each: `experiment(name).run(settings, progress)`.

A module is imported when its experiment is asked for.
"""

from __future__ import annotations

from importlib import import_module

from .protocol import Experiment

# In the order of the report. A name is that of its module.
NAMES: tuple[str, ...] = (
    "fig1",
    "fig3a",
    "fig3b",
    "table2",
    "fig4a",
    "fig4b",
    "table3",
    "fig6",
    "fig7",
    "fig8",
    "fig9",
    "counts",
    "fig12",
    "fig13",
    "people",
    "forensic",
)


def experiment(name: str) -> Experiment:
    """The experiment of that name; ValueError lists those there are."""
    if name not in NAMES:
        raise ValueError(f"unknown experiment {name!r}: there are {', '.join(NAMES)}")
    return import_module(f".{name}", __package__).EXPERIMENT
