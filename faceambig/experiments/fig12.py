"""Figure 12: a face behind a photograph's landmarks and edges, bent both ways, orthographic."""

from __future__ import annotations

from .bent import Figure, run_bent
from .protocol import Experiment, Outcome, Progress, Settings

FIGURE = Figure(
    "fig12", "One photograph, three faces (orthographic)", "Fig. 12", distance=None, published=1.14
)


def run(settings: Settings, progress: Progress) -> Outcome:
    """As `bent.run_bent`."""
    return run_bent(FIGURE, settings, progress)


EXPERIMENT = Experiment(FIGURE.name, FIGURE.title, FIGURE.paper, run)
