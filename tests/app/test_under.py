"""Words for what is under the pointer."""

from __future__ import annotations

import math

import pytest

from faceambig_app import under
from faceambig_app.pipeline import frame
from faceambig_app.state import DEFAULT, changed


@pytest.mark.parametrize(
    ("values", "mm", "words"),
    [
        ({"show": "difference"}, 3.14, "3.1\u202fmm to the true face"),
        ({"surface": "difference"}, math.nan, "not measured here"),
        ({"show": "row"}, 0.04, "0.0\u202fmm to the true face"),
        ({"surface": "depth"}, 2.0, "2.0\u202fmm nearer to the camera than the true face"),
        ({"surface": "depth"}, -2.0, "2.0\u202fmm farther from the camera than the true face"),
        ({"surface": "depth"}, -0.04, "0.0\u202fmm: as near to the camera as the true face"),
        ({"surface": "spread"}, 1.26, "1.3\u202fmm: the spread here (standard deviation)"),
        ({"show": "difference", "subject": "photo"}, 3.0, "3.0\u202fmm to the 60\u202fcm fit"),
        ({"show": "difference"}, None, ""),
        ({"surface": "skin"}, 3.0, ""),
        ({"show": "difference", "hide": ["numbers"]}, 3.0, ""),
        ({"show": "difference", "hide": ["truth"]}, 3.0, ""),
    ],
)
def test_the_words_say_what_the_colour_means(values, mm, words):
    assert under.words(changed(DEFAULT, **values), mm) == words


def test_heads_have_values_where_words_are_asked_for():
    for values in ({"show": "difference"}, {"surface": "depth"}, {"show": "row"}, {"surface": "skin"},
                   {"show": "difference", "hide": ["truth"]}, {"show": "row", "hide": ["truth"]}):  # fmt: skip
        state = changed(DEFAULT, **values)
        heads = frame(state, with_curves=False).scene.heads
        valued = [head.name for head in heads if head.values_mm is not None]
        hidden = "truth" in state.hide
        row = [f"fit{k}" for k in range(1, 5)] if state.show == "row" else ["fit"]
        assert valued == (row if under.has_values(state) and not hidden else []), values
