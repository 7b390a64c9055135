"""Compute every number of the lessons from the embedded head, and write the teachers' pages.

    python tools/lessons.py          # assets/lessons/numbers.json and docs/lessons/
    python tools/lessons.py --check  # changes nothing; says what is old or wrong, by file and line

A minute of one processor. A number that is in the file already is computed again.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Collection
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

from faceambig_app.lessons import NUMBERS, expressions, measures, read_lessons
from faceambig_app.lessons.page import teacher_page
from faceambig_app.state.fields import LANGUAGES
from faceambig_app.text import speaking

ROOT = Path(__file__).resolve().parent.parent
ASSETS, DOCS = ROOT / "assets" / "lessons", ROOT / "docs" / "lessons"
FOLDERS = {language: "" if language == LANGUAGES[0] else language for language in LANGUAGES}


def numbers(folder: Path, known: Collection[str]) -> dict[str, float]:
    """Every number that the lessons of a folder ask for and nobody knows yet, four significant digits."""
    asked = sorted(
        {one for path in folder.glob("[0-9]*.md") for one in expressions(path)} - set(known)
    )
    return {one: float(f"{measures.value(one):.4g}") for one in asked}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="write nothing")
    check = parser.parse_args().check
    computed: dict[str, float] = {}
    for language in LANGUAGES:
        computed |= numbers(ASSETS / language, computed)
    files = {ASSETS / NUMBERS: json.dumps(computed, indent=1, sort_keys=True) + "\n"}
    problems: list[str] = []
    for language in LANGUAGES:
        with speaking(language):
            found = read_lessons(ASSETS / language, computed)
            for lesson in found.by_number.values():
                files[DOCS / FOLDERS[language] / f"{lesson.name}.md"] = teacher_page(lesson)
        problems += found.problems
    old = [p for p, text in files.items() if not p.is_file() or p.read_text("utf-8") != text]
    for path in old:
        print(f"{path.relative_to(ROOT)}: {'is old' if check else 'written'}")
        if not check:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(files[path], "utf-8")
    for problem in problems:
        print(problem, file=sys.stderr)
    return int(bool(problems or (check and old)))


if __name__ == "__main__":
    sys.exit(main())
