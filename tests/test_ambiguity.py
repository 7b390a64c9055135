"""docs/ambiguity.md says what is computed, and its pictures are those that its script draws."""

from __future__ import annotations

import importlib
import re
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

import scenes

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "ambiguity.md").read_text(encoding="utf-8")
NUMBER = re.compile(r"\d+(?:\.\d+)?")


@pytest.fixture(scope="module")
def tools():
    """Imports a script of tools/, as they find each other: their folder on the path."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "tools"))
        before = set(sys.modules)
        yield importlib.import_module
        for name in set(sys.modules) - before:
            if Path(getattr(sys.modules[name], "__file__", None) or "").parent == ROOT / "tools":
                del sys.modules[name]


def blocks(page: str) -> dict[str, str]:
    return dict(re.findall(r"<!-- figures: (\w+) -->\n(.*?)<!-- end -->", page, re.DOTALL))


@pytest.mark.slow
def test_its_figures_are_those_computed(tools):
    new = tools("ambiguity_page").rewritten(PAGE)
    assert NUMBER.sub("#", new) == NUMBER.sub("#", PAGE)
    for name, block in blocks(PAGE).items():
        computed = NUMBER.findall(blocks(new)[name])
        for said, found in zip(NUMBER.findall(block), computed, strict=True):
            # One step of the last digit: another processor's rounding may turn it over
            step = 10.0 ** -len(said.partition(".")[2])
            assert abs(float(said) - float(found)) < 1.01 * step, f"{name}: {said}, now {found}"


@pytest.mark.slow
def test_what_the_text_says_around_its_figures(tools):
    numbers, page = tools("ambiguity_numbers"), tools("ambiguity_page")
    holds = {claim: verdict for claim, verdict, _ in page.verdicts()}
    assert holds["any wrong distance explains the points within what a person can click, 3 %"]
    low = [verdict for _, verdict, _ in page.verdicts(numbers.LOW)]
    assert low == list(holds.values())  # "with that, too, each verdict is as above"
    near = numbers.paths()[0].d_s_mm.mean(axis=0)
    least = numbers.FITTED[near[:-1].argmin()]
    assert 0.3 < least < 0.4  # "a little farther" than 30 cm
    better, worse = numbers.paths(numbers.LOW), numbers.paths()
    for low, own in zip(better, worse, strict=True):  # "met better and the surface worse"
        at = own.at(own.actual)
        assert low.d_l_percent[:, at].mean() < own.d_l_percent[:, at].mean()
        assert low.d_s_mm[:, at].mean() > own.d_s_mm[:, at].mean()
    for distance in (None, 0.3):
        found = numbers.modes(distance)
        verdicts = [bent.face.plausible for bent in found.faces]
        assert verdicts == [False, True, True, True, False]
        assert found.faces[0].size > 3 * found.limit  # "several times"
        # At the end of the range, not somewhere inside it
        np.testing.assert_allclose([found.faces[k].size for k in (1, 3)], found.limit, rtol=1e-6)
    for actual in numbers.PHOTOGRAPHS:
        parts = numbers.spread(actual)[1]
        assert parts.distance_mm < min(parts.shape_mm, parts.pose_mm)  # "matters least"
    interval = numbers.posterior(0.3).interval(0.95)
    assert interval.high - interval.low < 0.15  # "to a few centimetres"


@pytest.mark.parametrize("name", ["distance"])
def test_its_script_draws_one_picture(tools, monkeypatch, capsys, tmp_path, name):
    monkeypatch.setattr(sys, "argv", ["ambiguity.py", "--only", name, "--out", str(tmp_path)])
    tools("ambiguity").main()
    (file,) = tmp_path.iterdir()
    assert str(file) in capsys.readouterr().out
    picture = cv2.imread(str(file))
    assert picture is not None
    like_docs(file.name, picture[..., ::-1])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["curves", "errors"])
def test_its_plots_are_those_drawn(tools, name):
    like_docs(f"ambiguity_{name}.png", tools("ambiguity").PICTURES[name]())


@pytest.mark.slow
@pytest.mark.gl
def test_its_heads_are_those_drawn(tools):
    scenes.need_renderer()
    like_docs("ambiguity_spread.png", tools("ambiguity").PICTURES["spread"]())


def test_it_shows_every_picture_of_the_script(tools):
    drawn = {f"ambiguity_{name}.png" for name in tools("ambiguity").PICTURES}
    assert drawn == set(re.findall(r"\]\((ambiguity_\w+\.png)\)", PAGE))
    assert drawn == {path.name for path in (ROOT / "docs").glob("ambiguity_*.png")}


def test_a_block_that_nobody_writes_is_refused(tools):
    page = PAGE.replace("<!-- figures: modes -->", "<!-- figures: moods -->")
    with pytest.raises(ValueError, match="moods"):
        tools("ambiguity_page").rewritten(page)


def like_docs(name: str, picture: np.ndarray) -> None:
    scenes.like_file(ROOT / "docs" / name, picture)
