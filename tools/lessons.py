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
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

from faceambig_app import measures
from faceambig_app.lesson_page import teacher_page
from faceambig_app.lessons import NUMBERS, expressions, read_lessons

ROOT = Path(__file__).resolve().parent.parent
ASSETS, DOCS = ROOT / "assets" / "lessons", ROOT / "docs" / "lessons"


def numbers(folder: Path) -> dict[str, float]:
    """Every number that the lessons of a folder ask for, four significant digits."""
    asked = sorted({one for path in folder.glob("[0-9]*.md") for one in expressions(path)})
    return {one: float(f"{measures.value(one):.4g}") for one in asked}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="write nothing")
    check = parser.parse_args().check
    computed = numbers(ASSETS / "en")
    found = read_lessons(ASSETS / "en", computed)
    files = {ASSETS / NUMBERS: json.dumps(computed, indent=1, sort_keys=True) + "\n"}
    for lesson in found.by_number.values():
        files[DOCS / f"{lesson.name}.md"] = teacher_page(lesson)
    old = [p for p, text in files.items() if not p.is_file() or p.read_text("utf-8") != text]
    for path in old:
        print(f"{path.relative_to(ROOT)}: {'is old' if check else 'written'}")
        if not check:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(files[path], "utf-8")
    for problem in found.problems:
        print(problem, file=sys.stderr)
    return int(bool(found.problems or (check and old)))


if __name__ == "__main__":
    sys.exit(main())
