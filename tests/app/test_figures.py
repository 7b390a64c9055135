"""figures: well-formed whatever is put in, and every mark where its number is."""

from __future__ import annotations

import base64
import itertools
import re
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from faceambig.scene import Curves, Numbers, Photo
from faceambig_app.markup import figures, photograph, plots, style
from faceambig_app.text import say

HOSTILE = "<script>alert('x')</script> & \"quoted\" </svg></style>"
NUMBERS = Numbers(1.2, 0.25, 5.3, True, True, "mean of two corners")
GRID = np.geomspace(0.2, 3.0, 49)


def curves(true_distance: float = 0.3, d_s_top: float = 8.0) -> Curves:
    away = np.abs(np.log(GRID / true_distance)) / np.log(15)
    return Curves(GRID, 0.2 + 0.6 * away, d_s_top * away, (0.9, 9.0), true_distance, 3.0)


def photo(caption: str = "taken from 30 cm", size: int = 500) -> Photo:
    observed = np.array([[100.0, 200.0], [np.nan, np.nan], [300.5, 250.25]])
    projected = np.array([[101.0, 201.0], [150.0, 160.0], [300.0, 250.0]])
    nothing = np.zeros((0, 3))
    return Photo(
        size, size, observed, projected, ("1", "2", "3"), caption, nothing,
        nothing.astype(np.uint32), nothing.astype(np.uint8), None, 500.0, (250.0, 250.0),
    )  # fmt: skip


def parsed(html: str) -> ET.Element:
    """The tree of a piece of HTML or SVG, which must be well-formed XML."""
    return ET.fromstring(f"<page>{html}</page>")


def text_of(html: str) -> str:
    return "".join(parsed(html).itertext())


def points(polyline: ET.Element) -> np.ndarray:
    return np.array([pair.split(",") for pair in polyline.attrib["points"].split()], dtype=float)


PIECES = {
    "heading": lambda: figures.heading(1.2, 0.3, 68),
    "far heading": lambda: figures.heading(None, 0.3, 68),
    "cards": lambda: figures.cards(NUMBERS),
    "flex": lambda: figures.flex_words(["nose forward, chin back"]),
    "spoken": lambda: figures.spoken(NUMBERS),
    "marks": lambda: photograph.photo_marks(photo()),
    "picture": lambda: photograph.photo_picture(b"\xff\xd8jpeg"),
    "narrow": lambda: figures.side_by_side(photograph.photo_marks(photo()), figures.cards(NUMBERS)),
    "plots": lambda: plots.plots(curves(), NUMBERS),
    "far plots": lambda: plots.plots(curves(5.0), replace(NUMBERS, distance=None)),
    "boxes": lambda: figures.hidden_boxes(["a-1", "b-2"]),
    "style": lambda: style.STYLE,
}


@pytest.mark.parametrize("name", PIECES)
def test_every_piece_is_well_formed(name):
    assert len(parsed(PIECES[name]())) == 1  # one element, nothing left open
    assert "nan" not in PIECES[name]().lower()


@pytest.mark.parametrize(
    "html",
    [
        lambda: photograph.photo_marks(photo(HOSTILE)),
        lambda: figures.flex_words([HOSTILE]),
        lambda: figures.cards(replace(NUMBERS, eyes_meaning=HOSTILE)),
    ],
    ids=["caption", "words", "meaning"],
)
def test_hostile_names_stay_text(html):
    tree = parsed(html())
    assert not list(tree.iter("script"))
    values = [*tree.itertext(), *(value for e in tree.iter() for value in e.attrib.values())]
    assert any(HOSTILE in value for value in values)


@given(
    st.text(st.characters(blacklist_categories=["Cc", "Cs"], blacklist_characters="\ufffe\uffff"))
)
def test_any_caption_is_shown_as_it_is(caption):
    tree = parsed(photograph.photo_marks(photo(caption)))
    label = next(tree.iter("em"))
    assert (label.text or "") == caption
    assert caption in next(tree.iter("svg")).attrib["aria-label"]


def test_numbers_are_written_as_they_are_said():
    text = text_of(figures.cards(NUMBERS))
    assert "0.25\u202f%" in text
    assert "5.3\u202fmm" in text
    assert "mean of two corners" in figures.cards(NUMBERS)
    spoken = parsed(figures.spoken(NUMBERS))[0]
    assert "data-fa-spoken" in spoken.attrib
    assert "0.25 percent" in (spoken.text or "")
    assert "5.3 millimetres" in (spoken.text or "")
    assert "1.2\u202fm" in (spoken.text or "")


@pytest.mark.parametrize(
    ("converged", "plausible", "key"),
    [
        (True, True, None),
        (False, True, "number.not_converged"),
        (True, False, "number.implausible"),
        (False, False, "number.not_converged"),
    ],
)
def test_a_bad_result_is_warned_of_once(converged, plausible, key):
    html = figures.cards(replace(NUMBERS, converged=converged, plausible=plausible))
    warnings = [e.text for e in parsed(html).iter() if e.get("class") == "fa-warn"]
    assert warnings == ([] if key is None else [say(key)])


def test_crosses_and_circles_stand_on_their_points():
    tree = parsed(photograph.photo_marks(photo()))
    paths = {path.get("id"): path.attrib["d"] for path in tree.iter("path")}
    assert next(tree.iter("svg")).attrib["viewBox"] == "0 0 500 500"
    crosses = [
        (float(x) + photograph.CROSS, float(y) + photograph.CROSS)
        for x, y in re.findall(r"M(\S+) (\S+?)l[^M]*", paths["fx"])
    ]
    circles = [
        (float(x) + photograph.CIRCLE, float(y))
        for x, y in re.findall(r"M(\S+) (\S+?)a", paths["fo"])
    ]
    shown = photo()
    assert len(crosses) == 2  # a missing point has no cross
    assert np.abs(np.array(crosses) - shown.observed[[0, 2]]).max() < 0.06  # written to a tenth
    assert np.abs(np.array(circles) - shown.projected).max() < 0.06
    used = [use.attrib["href"] for use in tree.iter("use")]
    assert used[-2:] == ["#fx", "#fo"]  # circles above crosses, both above their halo


def test_marks_keep_their_size_in_a_larger_picture():
    small, large = (
        float(re.findall(r"M\S+ \S+?l(\S+) ", photograph.photo_marks(photo(size=size)))[0])
        for size in (500, 1000)
    )
    assert large == pytest.approx(2 * small, abs=0.1)


def test_the_photograph_is_carried_in_the_style():
    html = photograph.photo_picture(b"\xff\xd8 a picture")
    data = re.search(r"base64,([^)]*)\)", html)
    assert data is not None
    assert base64.b64decode(data[1]) == b"\xff\xd8 a picture"


def x_of(cm: float) -> float:
    """Where a distance stands: even in ratio from 20 to 300 cm, by hand."""
    share = np.log(cm / 20) / np.log(15)
    return plots.LEFT + share * (plots.RIGHT - plots.LEFT)


@pytest.mark.parametrize("cm", [20, 30, 120, 300])
def test_the_cursor_stands_at_the_distance_and_the_two_numbers(cm):
    numbers = replace(NUMBERS, distance=cm / 100, d_l_percent=1.5, d_s_mm=6.0)
    tree = parsed(plots.plots(curves(), numbers))
    (line,) = [p for p in tree.iter("path") if p.get("stroke") == "var(--fa-ink)"]
    assert float(line.attrib["d"].split()[0].removeprefix("M")) == pytest.approx(x_of(cm), abs=0.06)
    (dot,) = filled(tree, "circle")
    assert float(dot.attrib["cx"]) == pytest.approx(x_of(cm), abs=0.06)
    # 1.5 of 6 % from 94 up to 24; 6 of 12 mm from 222 up to 128
    assert float(dot.attrib["cy"]) == pytest.approx(94 - 70 / 4, abs=0.06)
    (square,) = [r for r in tree.iter("rect") if r.get("fill") == "var(--fa-ds)"]
    middle = [
        float(square.attrib[a]) + float(square.attrib[b]) / 2
        for a, b in ("xw", "yh")
        for a, b in [(a, {"w": "width", "h": "height"}[b])]
    ]
    assert middle == pytest.approx([x_of(cm), 222 - 94 / 2], abs=0.11)


def filled(tree: ET.Element, tag: str) -> list[ET.Element]:
    """The marks of the cursor; those of the far-away camera are open."""
    return [mark for mark in tree.iter(tag) if mark.get("fill") is not None]


def far_marks(tree: ET.Element) -> dict[str, ET.Element]:
    (group,) = [g for g in tree.iter("g") if g.get("class") == "far"]
    return {mark.tag: mark for mark in group}


def test_the_far_away_camera_has_marks_of_its_own_beyond_all_distances():
    shown = replace(curves(), orthographic=(1.5, 6.0))
    tree = parsed(plots.plots(shown, NUMBERS))
    marks = far_marks(tree)
    ring, square = marks["circle"].attrib, marks["rect"].attrib
    assert float(ring["cx"]) == plots.FAR > x_of(300) + 10
    assert float(ring["cy"]) == pytest.approx(94 - 70 / 4, abs=0.06)  # 1.5 of 6 %
    assert float(square["x"]) + float(square["width"]) / 2 == pytest.approx(plots.FAR, abs=0.06)
    assert float(square["y"]) + float(square["height"]) / 2 == pytest.approx(222 - 94 / 2, abs=0.06)
    assert say("plot.far") in [text.text for text in tree.iter("text")]
    rows = [[cell.text for cell in row] for row in tree.iter("tr")]
    assert rows[-1] == [say("plot.far"), "1.5", "6.0"]
    hidden = far_marks(parsed(plots.plots(shown, NUMBERS, hide=("truth",))))
    assert set(hidden) == {"circle"}
    tall = parsed(plots.plots(replace(shown, orthographic=(1.5, 14.0)), NUMBERS))
    assert float(far_marks(tall)["rect"].attrib["y"]) > 128 - 4  # the axis has grown to hold it


def test_of_the_far_away_camera_the_cursor_stands_on_its_marks():
    shown = replace(curves(), orthographic=(1.5, 6.0))
    now = replace(NUMBERS, distance=None, d_l_percent=1.5, d_s_mm=6.0)
    tree = parsed(plots.plots(shown, now))
    (dot,) = filled(tree, "circle")
    ring = far_marks(tree)["circle"]
    assert (dot.attrib["cx"], dot.attrib["cy"]) == (f"{plots.FAR:.1f}", ring.attrib["cy"])


def test_curves_pass_through_their_values():
    shown = curves()
    tree = parsed(plots.plots(shown, NUMBERS))
    d_l, d_s = (points(line) for line in tree.iter("polyline"))
    assert np.abs(d_l[:, 0] - [x_of(100 * d) for d in GRID]).max() < 0.06
    assert np.abs(d_s[:, 0] - d_l[:, 0]).max() == 0
    assert np.abs(d_l[:, 1] - (94 - 70 * shown.d_l_percent / 6)).max() < 0.06
    assert np.abs(d_s[:, 1] - (222 - 94 * shown.d_s_mm / 12)).max() < 0.06


def test_ticks_stand_at_their_distances():
    tree = parsed(plots.plots(curves(), NUMBERS))
    ticks = {
        t.text or "": float(t.attrib["x"])
        for t in tree.iter("text")
        if t.get("text-anchor") == "middle"
    }
    ticks.pop(say("plot.axis"))
    assert list(ticks) == ["20", "30", "60", "120", "240"]
    for cm, x in ticks.items():
        assert x == pytest.approx(x_of(float(cm)), abs=0.06)


def test_the_band_ends_at_the_tolerance():
    tree = parsed(plots.plots(curves(), NUMBERS))
    (band,) = [p for p in tree.iter("path") if p.get("fill") == "var(--fa-band)"]
    low, high = re.findall(r"(?:M\S+ |V)([\d.]+)", band.attrib["d"])
    assert float(low) == pytest.approx(94 - 70 * 3 / 6, abs=0.06)
    assert float(high) == 94


@pytest.mark.parametrize(
    ("largest", "now", "top"), [(3, 1, 12), (12, 1, 12), (12.1, 1, 16), (5, 17, 20)]
)
def test_the_axis_grows_in_steps_of_four(largest, now, top):
    shown = curves(d_s_top=1.0)
    shown = replace(shown, d_s_mm=shown.d_s_mm / shown.d_s_mm.max() * largest)
    assert plots.d_s_axis(shown, replace(NUMBERS, d_s_mm=now)) == top


def test_values_beyond_an_axis_stay_inside_the_plot():
    shown = replace(curves(), d_l_percent=np.full(49, 50.0))
    tree = parsed(plots.plots(shown, replace(NUMBERS, d_l_percent=50.0)))
    assert points(next(tree.iter("polyline")))[:, 1].min() == 24


# Width of a letter in units of the font's size: the widest sans-serif text of these labels measures 0.56
LETTER = 0.62


def label_boxes(tree: ET.Element) -> list[tuple[str, float, float, float, float]]:
    """(text, left, top, right, bottom) of every label, a little too large."""
    boxes = []
    for label in tree.iter("text"):
        size = 12.5 if label.get("class") == "t" else 11.5  # of STYLE
        text, x, y = label.text or "", float(label.attrib["x"]), float(label.attrib["y"])
        width = LETTER * size * len(text)
        left = x - {"end": width, "middle": width / 2}.get(label.get("text-anchor", ""), 0.0)
        boxes.append((text, left, y - 0.8 * size, left + width, y + 0.25 * size))
    return boxes


@pytest.mark.parametrize("cm", [20, 30, 77.5, 120, 240, 300])
def test_no_label_crosses_another_or_leaves_the_plot(cm):
    assert "height:auto;font-size:11.5px}.fa-plot" in style.STYLE
    assert ".fa-plot .t{font-weight:650;font-size:12.5px}" in style.STYLE
    # 20 mm: the largest flex, 10 mm, on a face fitted at the worst distance
    html = plots.plots(curves(cm / 100, 20.0), replace(NUMBERS, distance=cm / 100))
    boxes = label_boxes(parsed(html))
    height = float(next(parsed(html).iter("svg")).attrib["viewBox"].split()[3])
    assert any("true" in text for text, *_ in boxes)
    for text, left, top, right, bottom in boxes:
        assert left >= 0, text
        assert right <= plots.WIDTH, text
        assert top >= 0, text
        assert bottom <= height, text
    for (a, al, at, ar, ab), (b, bl, bt, br, bb) in itertools.combinations(boxes, 2):
        assert ar <= bl or br <= al or ab <= bt or bb <= at, (a, b)


def test_a_photograph_from_beyond_the_slider_has_no_line():
    html = plots.plots(curves(5.0), NUMBERS)
    assert "true:" not in text_of(html)


@pytest.mark.parametrize("cm", [20, 60, 120, 300])
def test_no_upright_line_crosses_letters(cm):
    """Words come after the lines, on a rim of what is behind them; curves and marks after the words."""
    assert ".fa-plot text{fill:var(--fa-dim);\nstroke:var(--mantine-color-body);" in style.STYLE
    assert "paint-order:stroke}\n.fa-plot text.b{stroke:var(--fa-band)}" in style.STYLE
    (svg,) = parsed(plots.plots(curves(), replace(NUMBERS, distance=cm / 100))).iter("svg")
    order = list(svg)
    words = [i for i, part in enumerate(order) if part.tag == "text"]
    upright = [
        i for i, part in enumerate(order) if re.fullmatch(r"(M\S+ \d+V\d+)+", part.get("d", ""))
    ]
    assert len(upright) == 2  # true distance and cursor
    assert max(upright) < min(words)
    curves_at = [i for i, part in enumerate(order) if part.tag in ("polyline", "circle", "rect")]
    assert min(curves_at) > max(words)
    on_band = [order[i].text for i in words if order[i].get("class") == "b"]
    assert on_band == [say("plot.band")]
