"""What docs/ambiguity.md says of all points instead of 68, computed again for the photographs from 30 cm."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from faceambig_app.pipeline.faces import face
from faceambig_app.state import DEFAULT, changed

DOC = (Path(__file__).parents[2] / "docs" / "ambiguity.md").read_text(encoding="utf-8")


def fitted(subject: int, data: str, **values: Any):
    state = changed(DEFAULT, subject=subject, actual=0.3, data=data, **{"distance": 0.3} | values)
    return face(state.target, state.fitting, state.bend)


@pytest.mark.parametrize(("distance", "words"), [(0.3, "30 cm"), (1.2, "1.2 m")])
def test_the_table_is_what_is_computed(distance, words):
    d_s = np.array(
        [
            [fitted(n, data, distance=distance).d_s_mm for data in ("points", "dense")]
            for n in range(1, 11)
        ]
    )
    few, all_of_them = d_s.mean(axis=0)
    nearer = int((d_s[:, 1] < d_s[:, 0]).sum())
    assert f"| 30 cm | {words} | {few:.2f} | {all_of_them:.2f} | {nearer} of 10 |" in DOC


def test_two_persons_come_out_worse_as_the_space_of_faces_ends():
    for number, limits, wider in ((2, (2, 13), {"box": 4.0}), (6, (1, 10), {"modes": 100})):
        points, dense = fitted(number, "points"), fitted(number, "dense")
        assert dense.d_s_mm > points.d_s_mm
        assert dense.d_l_percent < points.d_l_percent
        at_limit = tuple(int((np.abs(f.fit.alpha) > 1.999).sum()) for f in (points, dense))
        assert at_limit == limits
        better = fitted(number, "dense", **wider)
        assert better.d_s_mm < dense.d_s_mm
        for value in (points.d_s_mm, dense.d_s_mm, better.d_s_mm):
            assert f"{value:.2f}" in DOC.split("## All points")[1].split("\n## ")[0]
