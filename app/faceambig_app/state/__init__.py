"""What a person can set, as values: the state, its fields, its texts, its past. Neither viser nor NumPy."""

from .fields import FIELDS, Field
from .viewstate import (
    DEFAULT,
    Bend,
    Fitting,
    Look,
    Target,
    ViewState,
    changed,
    for_eyes_of,
    names_of_pins,
    short,
)

__all__ = [
    "DEFAULT", "FIELDS", "Bend", "Field", "Fitting", "Look", "Target", "ViewState", "changed", "for_eyes_of",
    "names_of_pins", "short",
]  # fmt: skip
