"""Figure 6: pictures from 30 cm explained at 120 cm."""

from __future__ import annotations

from .contoured import Pair, run_pairs
from .protocol import Experiment, Outcome, Progress, Settings

PAIR = Pair(
    "fig6",
    "A picture from 30 cm explained at 120 cm",
    "Fig. 6",
    actual=0.3,
    fitted=1.2,
    frontal=1,
    rotated=8,
    contours="7.12 to 3.88 mm",
    published=("5.33/0.38, 5.90/0.29, 6.13/0.39", "7.12/0.82, 3.88/0.63, 3.51/0.68"),
)


def run(settings: Settings, progress: Progress) -> Outcome:
    """As `contoured.run_pairs`."""
    return run_pairs(PAIR, settings, progress)


EXPERIMENT = Experiment(PAIR.name, PAIR.title, PAIR.paper, run)
