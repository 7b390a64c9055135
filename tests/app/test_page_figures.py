"""Figures: what is hidden stays hidden, points that can be moved, intervals, likelihood, legend, tables, words."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from faceambig.scene import Curves, Legend, Numbers, Photo, View
from faceambig_app.markup import figures, photograph, plots, plottable, style
from faceambig_app.text import say
from scenes import legend as a_legend
from scenes import photo as egg
from scenes import scene

HOSTILE = "<b onclick='x'> & \"q\" </svg>"
NUMBERS = Numbers(1.2, 0.25, 5.3, True, True, "mean of two corners")
GRID = np.geomspace(0.2, 3.0, 49)


def parsed(html: str) -> ET.Element:
    return ET.fromstring(f"<page>{html}</page>")


def text_of(html: str) -> str:
    return "".join(parsed(html).itertext())


def v_curves(low: float, high: float) -> Curves:
    """d_L straight over the logarithm, 3 % at both `low` and `high`, 0 between them."""
    x = np.log(GRID)
    middle, half = np.log(low * high) / 2, np.log(high / low) / 2
    d_l = 3.0 * np.abs(x - middle) / half
    return Curves(GRID, d_l, 2 * d_l, (9.0, 9.0), 0.5, 3.0)


def likely(curves: Curves, high: float = np.inf, beyond: float = 0.12) -> Curves:
    density = np.exp(-0.5 * (np.log2(GRID / 0.6) / 0.5) ** 2)
    density /= density.max()
    return replace(curves, density=density, intervals=((0.4, 0.9), (0.25, high)), beyond=beyond)


def test_the_range_that_cannot_be_told_apart_is_where_d_l_is_within_the_tolerance():
    found = plottable.told_apart(v_curves(0.3, 0.75))
    # The middle lies between two distances of the grid, so the kink is cut: a step is 5.8 %
    assert found == pytest.approx((0.3, 0.75), rel=0.005)
    words = plottable.interval_words(v_curves(0.3, 0.75))
    assert words.startswith("30 to 75\u202fcm cannot be told apart")
    whole = plottable.told_apart(v_curves(0.01, 60.0))
    assert whole == pytest.approx((0.2, 3.0))
    assert plottable.told_apart(replace(v_curves(0.3, 0.75), tolerance_percent=-1.0)) is None
    assert "No distance" in plottable.interval_words(
        replace(v_curves(0.3, 0.75), tolerance_percent=-1.0)
    )


@given(st.floats(0.22, 0.6), st.floats(1.3, 4.0))
def test_the_range_follows_the_crossings(low, ratio):
    high = min(low * ratio, 2.9)
    found = plottable.told_apart(v_curves(low, high))
    assert found is not None
    assert found == pytest.approx((low, high), rel=0.02)


def test_a_second_valley_is_not_joined_to_the_best_one():
    d_l = np.where((GRID < 0.3) | ((GRID > 1) & (GRID < 2)), 1.0, 5.0)
    d_l[0] = 0.5
    found = plottable.told_apart(replace(v_curves(0.3, 0.75), d_l_percent=d_l))
    assert found is not None
    assert found[0] == 0.2
    assert 0.28 < found[1] < 0.32


def x_of(cm: float) -> float:
    share = np.log(cm / 20) / np.log(15)
    return plots.LEFT + share * (plots.RIGHT - plots.LEFT)


def test_the_likely_plot_has_its_area_intervals_and_what_lies_beyond():
    curves = likely(v_curves(0.3, 0.75))
    tree = parsed(plots.plots(curves, NUMBERS))
    (area,) = [p for p in tree.iter("path") if p.get("stroke-width") == "1.4"]
    at = np.array(re.findall(r"([\d.]+),([\d.]+)", area.attrib["d"]), dtype=float)
    assert np.abs(at[:, 0] - [x_of(100 * d) for d in GRID]).max() < 0.06
    assert curves.density is not None
    wanted = plots.LIKELY_BOTTOM - (plots.LIKELY_BOTTOM - plots.LIKELY_TOP) * curves.density
    assert np.abs(at[:, 1] - wanted).max() < 0.06
    bars = {
        p.attrib["stroke-width"]: [float(x) for x in re.findall(r"[MH]([\d.]+)", p.attrib["d"])]
        for p in tree.iter("path")
        if p.get("stroke-width") in ("6", "3")
    }
    assert bars["6"] == pytest.approx([x_of(40), x_of(90)], abs=0.06)
    assert bars["3"] == pytest.approx([x_of(25), x_of(300)], abs=0.06)  # it has no end
    assert len([p for p in tree.iter("path") if "l7 5l-7 5z" in p.attrib["d"]]) == 1
    text = text_of(plots.plots(curves, NUMBERS))
    assert "40\u202fcm to 90\u202fcm with a chance of 50\u202f%" in text
    assert "25\u202fcm or more with a chance of 95\u202f%" in text
    assert "12\u202f% of the chance lies beyond 300\u202fcm" in text
    closed = plots.plots(likely(v_curves(0.3, 0.75), 2.0, 0.0), NUMBERS)
    assert "l7 5l-7 5z" not in closed
    assert "beyond" not in text_of(closed)
    assert say("plot.likely") not in text_of(plots.plots(v_curves(0.3, 0.75), NUMBERS))


@pytest.mark.parametrize("cm", [20, 30, 120, 300])
def test_upright_lines_leave_room_for_the_titles(cm):
    tree = parsed(plots.plots(likely(v_curves(0.3, 0.75)), replace(NUMBERS, distance=cm / 100)))
    (cursor,) = [p for p in tree.iter("path") if p.get("stroke") == "var(--fa-ink)" and "H" not in p.attrib["d"]
                 and p.get("stroke-width") == "1.6"]  # fmt: skip
    spans = [(float(a), float(b)) for a, b in re.findall(r" (\d+)V(\d+)", cursor.attrib["d"])]
    assert len(spans) == 3
    titles = [t for t in tree.iter("text") if t.get("class") == "t"]
    assert len(titles) == 3
    for title in titles:
        y = float(title.attrib["y"])
        assert all(bottom <= y - 10 or top >= y + 3 for top, bottom in spans)


def test_the_table_holds_the_curves_and_is_closed():
    curves = likely(v_curves(0.3, 0.75))
    tree = parsed(plots.plots(curves, NUMBERS))
    (details,) = tree.iter("details")
    assert "open" not in details.attrib
    rows = [[cell.text for cell in row] for row in tree.iter("tr")][1:]
    assert len(rows) == plottable.MOST_ROWS + 1
    assert rows[0] == ["20", f"{curves.d_l_percent[0]:.1f}", f"{curves.d_s_mm[0]:.1f}", "1"]
    assert rows[-2][0] == "300"
    assert rows[-1] == [say("plot.far"), "9.0", "9.0", None]
    assert all(cell.get("scope") for cell in tree.iter("th"))


def said(html: str) -> str:
    """What is written and what is told to a screen reader or under the pointer."""
    tree = parsed(html)
    told = [
        e.attrib[name] for e in tree.iter() for name in ("aria-label", "title") if name in e.attrib
    ]
    return " ".join([*tree.itertext(), *told])


def test_what_is_hidden_cannot_be_read_anywhere():
    curves = replace(likely(v_curves(0.3, 0.75)), true_distance=0.77)
    everything = {
        hide: figures.cards(NUMBERS, hide=hide) + plots.plots(curves, NUMBERS, hide=hide)
        + figures.spoken(NUMBERS, hide=hide)
        for hide in (frozenset(), frozenset({"numbers"}), frozenset({"truth"}), frozenset({"actual"}))
    }  # fmt: skip
    plain, numbers, truth, actual = map(said, everything.values())
    marked = everything[frozenset({"numbers"})]
    assert "5.3" in plain
    assert "0.25" in plain
    assert "5.3" not in numbers
    assert "0.25" not in numbers
    assert "<table" not in marked
    assert "<polyline" not in marked  # a curve tells as much as its numbers
    assert "<circle" not in marked
    assert numbers.count("?") == 2
    assert "5.3" not in truth
    assert "0.25" in truth
    assert truth.count("?") == 1
    assert len(list(parsed(everything[frozenset({"truth"})]).iter("polyline"))) == 1
    assert "true: 77" in plain
    assert "true: 77" not in actual
    unknown = replace(curves, true_distance=float("nan"))
    assert "true:" not in plots.plots(unknown, NUMBERS)
    assert "nan" not in plots.plots(unknown, NUMBERS)


def test_a_difference_to_another_fit_is_called_that():
    numbers = replace(NUMBERS, reference="the 60 cm fit")
    assert "Difference to the 60 cm fit" in figures.cards(numbers)
    assert "true face" not in figures.cards(numbers).replace(say("number.d_s_to_note"), "")
    assert "Difference to the 60 cm fit" in plots.plots(v_curves(0.3, 0.75), numbers)


def own(**fields: object) -> Photo:
    return replace(egg(), caption="", width=800, height=600, **fields)  # pyright: ignore[reportArgumentType]


def test_points_that_can_be_moved_are_buttons_with_names_and_places():
    shown = own()
    html = photograph.photo_marks(shown, draggable=True)
    tree = parsed(html)
    (box,) = [e for e in tree.iter() if "data-fa-photo" in e.attrib]
    assert box.attrib["data-fa-photo"] == "800x600"
    assert "aspect-ratio:800/600" in box.attrib["style"]
    groups = [g for g in tree.iter("g") if "data-fa-point" in g.attrib]
    seen = np.flatnonzero(np.isfinite(shown.observed).all(axis=1))
    assert [int(g.attrib["data-fa-point"]) for g in groups] == seen.tolist()
    for group, index in zip(groups, seen, strict=True):
        assert group.attrib["tabindex"] == "0"
        assert group.attrib["role"] == "button"
        x, y = shown.observed[index]
        assert group.attrib["aria-label"] == f"{shown.names[index]}, {x:.0f}, {y:.0f}"
        paths = [path.attrib["d"] for path in group.iter("path")]
        assert len(paths) == 3  # what is hit, halo, cross
        start = [float(word) for word in re.findall(r"[\d.]+", paths[0])[:2]]
        assert start == pytest.approx((x, y), abs=0.06)
    assert next(tree.iter("svg")).attrib["role"] == "group"  # an image would hide its buttons
    assert "#fx" not in html  # each cross is in its group, so that it moves with it
    assert "stroke-width:24px" in style.STYLE
    assert "data-fa-photo" not in photograph.photo_marks(shown)


def test_crosses_in_an_element_of_their_own_are_the_same_crosses():
    shown = egg()
    whole = parsed(photograph.photo_marks(shown))
    apart = parsed(photograph.photo_crosses(shown))
    marks = photograph.photo_marks(shown, crosses=False, hover=False)
    paths = [{p.get("id"): p.attrib["d"] for p in tree.iter("path")} for tree in (whole, apart)]
    assert paths[0]["fx"] == paths[1]["fx"]
    assert 'id="fx"' not in marks
    assert marks.count('href="#fx"') == 2  # halo and stroke
    assert len(marks) < 0.5 * len(photograph.photo_marks(shown))
    hidden = replace(shown, points_shown=False)
    assert "fx" not in photograph.photo_crosses(hidden)
    assert "href" not in photograph.photo_marks(hidden)


def test_the_pointer_reads_a_points_name_and_its_gap_at_the_face():
    shown = replace(egg(), fit_vertices=None, fit_focal=None)
    at = np.flatnonzero(shown.vertices[:, 2] < 0.32)[::24][: len(shown.observed)]
    assert len(at) == len(shown.observed)
    gaps = photograph.gaps_mm(shown, at)
    # 2 pixels wide (tests/scenes.py), focal 450: 2 * depth / 450
    known = np.isfinite(shown.observed[:, 0])
    assert gaps[known] == pytest.approx(2e3 * shown.vertices[at, 2][known] / shown.focal)
    assert np.isnan(gaps[~known]).all()
    titles = [t.text for t in parsed(photograph.photo_marks(shown, landmarks=at)).iter("title")]
    assert len(titles) == known.sum()
    first = np.flatnonzero(known)[0]
    assert titles[0] == f"{shown.names[first]}: {gaps[first]:.1f}\u202fmm at the face"


def test_error_lines_are_as_long_as_asked():
    shown = replace(egg(), error_scale=10.0)
    tree = parsed(photograph.photo_marks(shown))
    (lines,) = [p for p in tree.iter("path") if p.get("id") == "fe"]
    ends = np.array(re.findall(r"M(\S+) (\S+?)L(\S+) ([\d.]+)", lines.attrib["d"]), dtype=float)
    known = np.isfinite(shown.observed[:, 0])
    assert len(ends) == known.sum()
    assert np.abs(ends[:, :2] - shown.observed[known]).max() < 0.06
    assert np.abs(ends[:, 2:] - ends[:, :2] - (20.0, 0.0)).max() < 0.11
    assert 'id="fe"' not in photograph.photo_marks(egg())


def test_an_outline_is_drawn_in_its_pieces():
    nothing = [np.nan, np.nan]
    outline = np.array([[1.0, 2.0], [3.0, 4.0], nothing, nothing, [5.0, 6.0], [7.0, 8.0]])
    tree = parsed(photograph.photo_marks(replace(egg(), outline=outline)))
    (path,) = [p for p in tree.iter("path") if p.get("id") == "fl"]
    assert path.attrib["d"] == "M1.0 2.0L3.0 4.0M5.0 6.0L7.0 8.0"


def test_names_stand_beside_their_points():
    shown = replace(egg(), names_shown=True, names=tuple(f"p{i}" for i in range(len(egg().names))))
    words = {t.text for t in parsed(photograph.photo_marks(shown)).iter("text")}
    known = np.flatnonzero(np.isfinite(shown.observed[:, 0]))
    assert words == {f"p{i}" for i in known}


def test_the_photograph_is_told_in_words():
    label = next(parsed(photograph.photo_marks(egg())).iter("svg")).attrib["aria-label"]
    assert "taken from 30 cm" in label
    assert f"{int(np.isfinite(egg().observed[:, 0]).sum())} points" in label
    assert "mm" in label


def test_the_legend_has_the_very_colours_and_says_what_lies_beyond():
    scale = a_legend()
    html = figures.legend(replace(scale, open_high=True))
    stops = re.search(r"linear-gradient\(90deg,([^)]*)\)", html)
    assert stops is not None
    colours = [[int(c[i : i + 2], 16) for i in (1, 3, 5)] for c in stops[1].split(",")]
    assert np.array_equal(colours, scale.colours)
    ticks = re.findall(r'left:([\d.]+)%">([^<]*)', html)
    assert [word for _, word in ticks] == ["0", "5", "10", "15"]
    assert [float(at) for at, _ in ticks] == pytest.approx([0, 100 / 3, 200 / 3, 100], abs=0.01)
    assert "> 15" in text_of(html)
    assert "> 15" not in text_of(figures.legend(scale))
    assert scale.note in text_of(html)
    signed = Legend("depth", scale.colours, -15, 15, (-15, 0, 15), "", True, True)
    assert "< \u221215" in text_of(figures.legend(signed))
    assert next(iter(parsed(html))).attrib["role"] == "img"


def test_the_spectrum_has_a_bar_a_mode_in_proportion():
    html = figures.spectrum(np.array([8.0, 2.0, 0.0]), ("nose", HOSTILE, "lips"))
    widths = [float(w) for w in re.findall(r"width:([\d.]+)%", html)]
    assert widths == [100.0, 25.0, 0.0]
    assert HOSTILE in text_of(html)
    assert "8.0\u202fmm" in text_of(html)
    assert "nan" not in figures.spectrum(np.zeros(2), ("a", "b"))
    with pytest.raises(ValueError, match="zip"):
        figures.spectrum(np.zeros(2), ("a",))


def test_the_matrix_of_pins_is_a_table_with_heads_on_both_sides():
    d_s = np.array([[0.0, 2.1], [2.1, 0.0]])
    tree = parsed(figures.pin_matrix(("30 cm", HOSTILE), d_s))
    rows = [["".join(cell.itertext()) for cell in row] for row in tree.iter("tr")]
    assert rows == [["", "30 cm", HOSTILE], ["30 cm", "", "2.1"], [HOSTILE, "2.1", ""]]
    assert [th.attrib["scope"] for th in tree.iter("th")] == ["col", "col", "row", "row"]


def test_the_view_of_the_heads_is_told_in_words():
    def told(**fields: object) -> str:
        html = figures.heads_words(scene(**fields))  # pyright: ignore[reportArgumentType]
        return next(iter(parsed(html))).attrib["aria-label"]

    assert "True face and Face that fits" in told()
    assert "32\u00b0 to the person's right and 6\u00b0 above" in told()
    assert "the front" in told(view=View("front", 0.0, 0.0, 0.165))
    assert "12\u00b0 to the person's left and 5\u00b0 below" in told(
        view=View("free", 12.0, -5.0, 0.165)
    )
    assert "the camera" in told(through_camera=True)


@pytest.mark.parametrize(("asked", "put"), [(0.2, "1"), (1.5, "1.5"), (9, "2")])
def test_the_size_of_text_is_kept_in_its_range(asked, put):
    assert f"--fa-scale:{put}}}" in style.text_size(asked)
    assert "var(--fa-scale,1)" in style.STYLE


def contrast(a: str, b: str) -> float:
    """WCAG 2: (L1 + 0.05) / (L2 + 0.05)."""

    def light(hexed: str) -> float:
        c = np.array([int(hexed[i : i + 2], 16) for i in (1, 3, 5)]) / 255
        linear = np.where(c <= 0.03928, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
        return float(linear @ (0.2126, 0.7152, 0.0722))

    x, y = sorted((light(a), light(b)))
    return (y + 0.05) / (x + 0.05)


@pytest.mark.parametrize(("theme", "panel"), [(0, "#FFFFFF"), (1, "#1A1B1E")])
def test_text_is_readable_in_both_themes(theme, panel):
    tokens = [
        dict(re.findall(r"--fa-(\w+):(#\w{6})", part)) for part in style.STYLE.split("color-scheme=dark]", 1)
    ][theme]  # fmt: skip
    for ground in (panel, tokens["card"]):
        for name in ("ink", "dim", "dl", "ds", "seen"):
            assert contrast(tokens[name], ground) >= 4.5, (name, ground)
