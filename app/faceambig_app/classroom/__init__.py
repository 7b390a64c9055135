"""A class: who leads, who follows, and what was predicted."""

from .seats import Classroom, Seat

__all__ = ["Classroom", "Seat"]
