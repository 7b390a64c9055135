"""Figure 7: pictures from 200 cm explained at 60 cm."""

from __future__ import annotations

from .contoured import Pair, run_pairs
from .protocol import Experiment, Outcome, Progress, Settings

PAIR = Pair(
    "fig7",
    "A picture from 200 cm explained at 60 cm",
    "Fig. 7",
    actual=2.0,
    fitted=0.6,
    frontal=5,
    rotated=10,
    contours="7.15 to 4.70 mm",
    published=("5.13/0.39, 5.66/0.38, 2.44/0.36", "7.15/0.51, 4.70/0.52, 3.63/0.49"),
)


def run(settings: Settings, progress: Progress) -> Outcome:
    """As `contoured.run_pairs`."""
    return run_pairs(PAIR, settings, progress)


EXPERIMENT = Experiment(PAIR.name, PAIR.title, PAIR.paper, run)
