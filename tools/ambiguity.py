"""The pictures and the figures of docs/ambiguity.md, on the embedded head.

python tools/ambiguity.py                          # all, and the figures into the page
python tools/ambiguity.py --only errors --out /tmp # one picture, nothing else
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np

import ambiguity_curves as curves
import ambiguity_heads as heads
import ambiguity_numbers as numbers
from ambiguity_page import rewritten
from faceambig.render.overlay import encode_png

DOCS = Path(__file__).resolve().parent.parent / "docs"
PICTURES = {
    "curves": curves.curves,
    "faces": heads.faces,
    "errors": curves.errors,
    "mode_orthographic": lambda: heads.bent(None),
    "mode_perspective": lambda: heads.bent(numbers.ACTUAL[0]),
    "distance": curves.distances,
    "spread": heads.spread,
    "extremes": heads.extremes,
}


def main() -> None:
    """Draw what is asked for; without --only, write the figures too."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--only", choices=[*PICTURES, "page"], help="one picture, or the figures")
    parser.add_argument("--out", type=Path, default=DOCS, help="folder (default: docs)")
    options = parser.parse_args()
    for name, drawn in PICTURES.items():
        if options.only in (None, name):
            picture = drawn()
            opaque = np.full((*picture.shape[:2], 1), 255, dtype=np.uint8)
            rgba = np.concatenate([picture, opaque], axis=2)
            file = options.out / f"ambiguity_{name}.png"
            file.write_bytes(encode_png(rgba, {"Software": "faceambig"}))
            print(f"{file}: {picture.shape[1]} x {picture.shape[0]}, {file.stat().st_size} bytes")
    if options.only in (None, "page"):
        page = DOCS / "ambiguity.md"
        page.write_text(rewritten(page.read_text(encoding="utf-8")), encoding="utf-8")
        print(page)


if __name__ == "__main__":
    main()
