"""Figure 13: a face behind a photograph's landmarks and edges, bent both ways, perspective."""

from __future__ import annotations

from .bent import ACTUAL, Figure, run_bent
from .protocol import Experiment, Outcome, Progress, Settings

FIGURE = Figure(
    "fig13", "One photograph, three faces (perspective)", "Fig. 13", distance=ACTUAL, published=1.79
)


def run(settings: Settings, progress: Progress) -> Outcome:
    """As `bent.run_bent`."""
    return run_bent(FIGURE, settings, progress)


EXPERIMENT = Experiment(FIGURE.name, FIGURE.title, FIGURE.paper, run)
