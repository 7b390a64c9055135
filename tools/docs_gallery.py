"""Write docs/gallery.md and docs/gallery/ from a report of `faceambig reproduce`.

    faceambig reproduce all --out report
    python tools/docs_gallery.py report

Charts are copied byte by byte; pictures of heads become WebP, a tenth of the size and not to be told apart.
"""

from __future__ import annotations

import argparse
import json
import shutil
from pathlib import Path
from typing import Any

import cv2

from faceambig.experiments import NAMES, experiment
from faceambig_app.reports.report import VERDICTS
from faceambig_app.text import say

DOCS = Path(__file__).resolve().parents[1] / "docs"
QUALITY = 90
HEAD = """# Gallery

Each table and figure of the paper on the embedded head: the pictures that `faceambig reproduce all` writes, with
each claim of the paper, its number, ours, and whether it holds. That one does not hold here is a result:
[how to read them, and what stands in for what](experiments.md). Larger pictures of the ambiguity itself are in
[what a photograph leaves open](ambiguity.md). Written by `python tools/docs_gallery.py` from a report.
"""


def main() -> None:
    """Copy the pictures, write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("report", type=Path, help="the folder that reproduce wrote")
    report = parser.parse_args().report
    folder = DOCS / "gallery"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    sections = []
    for name in NAMES:
        path = report / f"{name}.json"
        if path.is_file():
            record = json.loads(path.read_text(encoding="utf-8"))
            sections.append(section(record, pictures(record, report, folder)))
    (DOCS / "gallery.md").write_text("\n".join([HEAD, *sections]), encoding="utf-8")


def pictures(record: dict[str, Any], report: Path, folder: Path) -> list[tuple[str, str]]:
    """(file below docs, words) of each picture of one experiment, put into the gallery's folder."""
    done = []
    for number, chart in enumerate(record["charts"], 1):
        file = f"{record['name']}_chart{number}.png"
        shutil.copyfile(report / file, folder / file)
        done.append((f"gallery/{file}", chart["title"]))
    for image in record["images"]:
        pixels = cv2.imread(str(report / image["file"]))
        file = Path(image["file"]).with_suffix(".webp").name
        cv2.imwrite(str(folder / file), pixels, (cv2.IMWRITE_WEBP_QUALITY, QUALITY))
        done.append((f"gallery/{file}", image["title"]))
    return done


def section(record: dict[str, Any], shown: list[tuple[str, str]]) -> str:
    """One experiment: title, claims, pictures."""
    asked = experiment(record["name"])
    lines = [f"## {asked.paper}: {asked.title}", ""]
    lines += [f"`faceambig reproduce {record['name']}`", ""]
    lines += ["| the paper says | its number | ours | |", "|---|---|---|---|"]
    lines += [claim_row(claim) for claim in record["claims"]]
    lines += [""]
    for file, words in shown:
        lines += [f"![{words}]({file})", ""]
    return "\n".join(lines)


def claim_row(claim: dict[str, Any]) -> str:
    """A claim of the paper beside what was found."""
    verdict = say(f"report.{VERDICTS[claim['holds']]}")
    cells = (claim["words"], claim["paper"], claim["ours"], verdict)
    return "| " + " | ".join(" ".join(cell.split()).replace("|", r"\|") for cell in cells) + " |"


if __name__ == "__main__":
    main()
