"""The examples run from the README's install in seconds, and say what they promise."""

from __future__ import annotations

import base64
import importlib.util
import json
import re
import runpy
import sys
from pathlib import Path
from types import ModuleType

import pytest

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
# A line that each prints. Digits that a fit's tolerance of 1e-8 cannot reach
SAID = {
    "01_two_faces": r"the faces differ by 3\.8 mm",
    "02_all_distances": r"within 3\.0 %: from the nearest to infinity",
    "03_bend": r"bent by 2\.5 mm the points move 0\.0\d+ %",
    "04_how_probable": r"95 %: from 0\.81 m to 3\.7\d m",
    "05_farthest_faces": r"bound 7\.\d mm; reached 9\d % of it",
    "06_own_points": r"written: face\.ply, 14159 vertices",
}


def test_all_are_known_and_numbered() -> None:
    names = sorted(path.stem for path in EXAMPLES.glob("*.py"))
    assert names == sorted(SAID)
    assert [name[:2] for name in names] == [f"{n:02}" for n in range(1, len(names) + 1)]


@pytest.mark.parametrize("name", SAID)
def test_example_says_what_it_promises(
    name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    path = EXAMPLES / f"{name}.py"
    monkeypatch.setattr(sys, "argv", [str(path)])
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    runpy.run_path(str(path), run_name="__main__")
    out = capsys.readouterr().out
    assert re.search(rf"(?m)^{SAID[name]}$", out), out


@pytest.mark.parametrize("name", SAID)
def test_example_is_a_screen_of_numbered_steps(name: str) -> None:
    source = (EXAMPLES / f"{name}.py").read_text(encoding="utf-8")
    assert len(source.splitlines()) < 60
    steps = re.findall(r"(?m)^# (\d+)\. ", source)
    assert steps == [str(n) for n in range(1, len(steps) + 1)]
    assert len(steps) > 2
    assert f"python examples/{name}.py" in source


def test_example_writes_what_was_fitted_to_the_points_of_a_file(tmp_path: Path) -> None:
    import faceambig as fa

    points = fa.observe(fa.load_model("embedded").subject(1), distance=0.5).points
    rows = "\n".join(f"{x:.3f} {y:.3f}" for x, y in points)
    given, out = tmp_path / "points.pts", tmp_path / "mine.ply"
    given.write_text(f"version: 1\nn_points: 68\n{{\n{rows}\n}}\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["06_own_points.py", str(given), str(out)])
        runpy.run_path(str(EXAMPLES / "06_own_points.py"))
    assert out.read_bytes().startswith(b"ply\n")


@pytest.fixture(scope="module")
def runner() -> ModuleType:
    path = EXAMPLES.parent / "tools" / "notebook.py"
    spec = importlib.util.spec_from_file_location("notebook", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_notebook_of_ten_cells_runs_and_shows_what_is_stored(runner: ModuleType) -> None:
    notebook = json.loads(runner.NOTEBOOK.read_text(encoding="utf-8"))
    assert len(notebook["cells"]) == 10
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    for cell, found in zip(cells, runner.outputs(notebook), strict=True):
        assert runner.told(found) == runner.told(cell["outputs"]), "python tools/notebook.py"
        stored, now = (
            [base64.b64decode(o["data"]["image/png"]) for o in some if "data" in o]
            for some in (cell["outputs"], found)
        )
        assert len(stored) == len(now)
        for png in (*stored, *now):
            assert png.startswith(b"\x89PNG")
            assert len(png) > 5_000  # not one colour


def test_notebook_is_of_the_form_that_jupyter_reads(runner: ModuleType) -> None:
    notebook = json.loads(runner.NOTEBOOK.read_text(encoding="utf-8"))
    assert (notebook["nbformat"], notebook["nbformat_minor"]) == (4, 5)
    names = [cell["id"] for cell in notebook["cells"]]
    assert len(set(names)) == len(names)
    needs = {
        "code": {"cell_type", "execution_count", "id", "metadata", "outputs", "source"},
        "markdown": {"cell_type", "id", "metadata", "source"},
    }
    for cell in notebook["cells"]:
        assert set(cell) == needs[cell["cell_type"]]
