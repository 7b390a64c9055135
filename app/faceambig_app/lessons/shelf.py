"""The lessons of a folder, by number. A file that is wrong is named with its line, and the others work."""

from __future__ import annotations

import json
import logging
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from faceambig.errors import AssetError
from faceambig.io import asset_path

from ..state import ViewState
from ..text import speaking
from .lesson import Lesson, Step
from .reading import read_lesson

log = logging.getLogger("faceambig")

FILE = re.compile(r"(\d\d)-[a-z0-9-]+\.md")
NUMBERS = "numbers.json"  # what tools/lessons.py has computed


@dataclass(frozen=True, slots=True)
class Lessons:
    """All that could be read, by number; and a line for each file that could not."""

    by_number: Mapping[int, Lesson]
    problems: tuple[str, ...] = ()

    def step(self, state: ViewState) -> Step | None:
        """The step that a state is in; a number beyond the last is the last."""
        lesson = self.by_number.get(state.lesson or 0)
        return None if lesson is None else lesson.steps[min(state.step, len(lesson.steps)) - 1]


@lru_cache(maxsize=4)
def lessons(language: str = "en") -> Lessons:
    """The lessons of a language, with the numbers that tools/lessons.py has computed; problems are logged."""
    folder = asset_path(f"lessons/{language}")
    with speaking(language):  # the numbers in them
        found = read_lessons(folder, stored(folder.parent / NUMBERS))
    for problem in found.problems:
        log.warning("a lesson is left out: %s", problem)
    return found


def stored(path: Path) -> dict[str, float]:
    """Numbers computed before, by expression; none where there is no such file."""
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}


def read_lessons(folder: Path, numbers: Mapping[str, float]) -> Lessons:
    """The lessons of a folder. A number that is not in `numbers` is computed, which takes up to some seconds."""
    found: dict[int, Lesson] = {}
    problems: list[str] = []
    for path in sorted(folder.glob("*.md")):
        named = FILE.fullmatch(path.name)
        if named is None:
            if path.name != "README.md":
                problems.append(f"{path.name}: is not named like 06-my-lesson.md")
            continue
        try:
            lesson = read_lesson(path, numbers)
            if lesson.number in found:
                raise ValueError(
                    f"{path.name}: lesson {lesson.number} is {found[lesson.number].name}.md already"
                )
            found[lesson.number] = lesson
        except (ValueError, AssetError) as error:
            problems.append(str(error))
    return Lessons(found, tuple(problems))
