"""Lessons: files that a teacher can write, what is asked and ticked in them, and the numbers that they may say."""

from .lesson import Ask, Lesson, Number, Step
from .reading import expressions, read_lesson
from .shelf import NUMBERS, Lessons, lessons, read_lessons

__all__ = [
    "NUMBERS", "Ask", "Lesson", "Lessons", "Number", "Step", "expressions", "lessons", "read_lesson", "read_lessons",
]  # fmt: skip
