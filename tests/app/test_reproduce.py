"""faceambig reproduce: what it runs, writes and says; the report holds everything and asks nobody."""

from __future__ import annotations

import base64
import csv
import hashlib
import json
import re

import cv2
import numpy as np
import pytest

from commands import printed, refused
from faceambig import experiments
from faceambig.experiments import fig1
from faceambig.experiments.protocol import Claim, Experiment, Outcome, Step, Table
from faceambig_app.commands import reproduce
from faceambig_app.reports import report

QUICK = ("reproduce", "fig4a", "fig1", "--quick")


@pytest.fixture(scope="module")
def written(tmp_path_factory, embedded):
    """The folder of a quick run of two experiments, named in the other order, and what was printed for programs."""
    folder = tmp_path_factory.mktemp("reproduce") / "made" / "here"
    with pytest.MonkeyPatch.context() as patch:
        said: list[str] = []
        patch.setattr("builtins.print", lambda text="", **_: said.append(text))
        from faceambig_app.cli import main

        assert main([*QUICK, "--json", "--out", str(folder)]) == 0
    return folder, json.loads(said[0])


def test_each_experiment_is_written_as_tables_numbers_and_pictures(written):
    folder, record = written
    names = {path.name for path in folder.iterdir()}
    assert names == {
        "fig1.json", "fig1_table1.csv", "fig1_image1.png",
        "fig4a.json", "fig4a_table1.csv", "fig4a_chart1.png", "report.html",
    }  # fmt: skip
    assert [each["name"] for each in record["experiments"]] == ["fig1", "fig4a"]
    assert {path.rpartition("/")[2] for path in record["files"]} == names
    stored = json.loads((folder / "fig4a.json").read_text(encoding="utf-8"))
    assert stored == record["experiments"][1]
    with (folder / "fig4a_table1.csv").open(encoding="utf-8", newline="") as file:
        header, first, *_ = csv.reader(file)
    assert header == list(stored["tables"][0]["columns"])
    assert float(first[1]) == stored["tables"][0]["rows"][0][1]  # all digits
    picture = cv2.imread(str(folder / "fig4a_chart1.png"))
    assert picture is not None
    assert picture.shape == (520, 900, 3)


def test_the_report_holds_every_claim_and_picture_and_asks_nobody(written):
    folder, record = written
    page = (folder / "report.html").read_text(encoding="utf-8")
    for each in record["experiments"]:
        for claim in each["claims"]:
            assert page.count(claim["ours"]) == 2  # in the summary and in its place
    assert page.index('id="fig1"') < page.index('id="fig4a"')
    sources = re.findall(r'src="([^"]+)"', page)
    assert len(sources) == 2
    png = base64.b64decode(sources[1].removeprefix("data:image/png;base64,"))
    assert png == (folder / "fig4a_chart1.png").read_bytes()
    assert "://" not in page
    assert "<script" not in page
    (style,) = re.findall(r"<style>(.*?)</style>", page, re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(style.encode()).digest()).decode()
    assert f"default-src 'none'; img-src data:; style-src 'sha256-{digest}'" in page


def test_the_same_run_writes_the_same_bytes(written, tmp_path, capsys):
    folder, _ = written
    status, out, _ = printed(capsys, *QUICK, "--out", tmp_path, "--jobs", "1")
    assert status == 0
    assert "holds: it falls below 1 % at about 2.5 m" in out
    for path in folder.iterdir():
        assert (tmp_path / path.name).read_bytes() == path.read_bytes(), path.name


def test_a_run_that_is_interrupted_is_taken_up_again(tmp_path, capsys, monkeypatch):
    asked = ("reproduce", "fig1", "--subjects", "3", "--jobs", "1", "--out", tmp_path)
    seen: list[Step] = []

    def stop(self: object, step: Step) -> None:
        seen.append(step)
        if step.done == 2 and step.resumed == 0:
            raise KeyboardInterrupt

    monkeypatch.setattr(reproduce.TimeLeft, "__call__", stop)
    assert printed(capsys, *asked)[0] == 130
    assert len(list((tmp_path / "unfinished").iterdir())) == 2
    assert printed(capsys, *asked)[0] == 0
    assert seen[-1][1:4] == (3, 3, 2)
    assert not (tmp_path / "unfinished").exists()


def test_what_there_is_is_listed(capsys, monkeypatch):
    monkeypatch.setattr(experiments, "NAMES", ("fig1", "table3"))
    status, out, _ = printed(capsys, "reproduce", "--list")
    assert status == 0
    assert out.splitlines()[0].startswith("fig1       Fig. 1  ")
    _, out, _ = printed(capsys, "reproduce", "--list", "--json")
    assert [each["name"] for each in json.loads(out)["experiments"]] == ["fig1", "table3"]


def test_one_that_cannot_be_run_stops_none_of_the_others(capsys, monkeypatch, tmp_path):
    def refuse(settings, progress):
        raise ValueError("model: it has no ears\nat all")

    broken = Experiment("table3", "A title", "Table 3", refuse)
    monkeypatch.setattr(
        experiments, "experiment", lambda name: broken if name == "table3" else fig1.EXPERIMENT
    )
    names = ("reproduce", "fig1", "table3", "--subjects", "2", "--jobs", "1", "--out", tmp_path)
    status, out, _ = printed(capsys, *names)
    assert status == 1
    assert "not run: model: it has no ears at all" in out
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "This could not be run: model: it has no ears at all" in page
    alone = refused(capsys, "reproduce", "table3", "--jobs", "1", "--out", tmp_path)
    assert "it has no ears at all" in alone


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        ((), "NAME: none given; say all, or some of fig1, "),
        (("table9",), "NAME: 'table9' is not all or one of fig1, "),
        (("fig1", "--subjects", "1"), "--subjects: 1 is not at least 2"),
        (("fig1", "--seed", "-1"), "--seed: -1 is negative"),
        (("fig1", "--jobs", "0"), "n_jobs: 0 is no number of processes"),
        (("fig1", "--scheduler", "tcp://x:1"), "--scheduler: loky has none"),
        (("fig1", "--model", "nothing.npz"), "nothing.npz"),
    ],
)
def test_wrong_flags_are_one_line(capsys, tmp_path, flags, said):
    assert said in refused(capsys, "reproduce", *flags, "--out", tmp_path / "out")


def test_a_file_where_the_folder_should_be_is_refused(capsys, tmp_path):
    taken = tmp_path / "taken"
    taken.write_text("mine", encoding="utf-8")
    assert "is a file, not a folder" in refused(capsys, "reproduce", "fig1", "--out", taken)
    assert taken.read_text(encoding="utf-8") == "mine"


def test_progress_tells_the_time_left():
    assert reproduce.told(Step("heads", 3, 13, 1, 120_000_000), 4.0) == (
        "heads 3 of 13, 1 from before, 20 s left, 120 MB a process"
    )
    assert reproduce.told(Step("heads", 0, 13), 0.0) == "heads 0 of 13"
    assert reproduce.told(Step("heads", 1, 100), 10.0) == "heads 1 of 100, 16 min left"


def test_what_is_no_number_is_null_for_programs_and_a_dash_for_people():
    table = Table("T", ("a", "b"), ((float("nan"), float("inf")), (np.float64(1.5), None)))  # type: ignore[arg-type]
    claim = Claim("<b>bold</b>", "1", "2", None, "since 1 < 2")
    outcome = Outcome("x", "X", (table,), claims=(claim,), settings={"n": 3})
    rows = report.record_of(outcome)["tables"][0]["rows"]
    assert rows == [[None, None], [1.5, None]]
    json.dumps(rows, allow_nan=False)
    assert [report.shown(v) for v in (float("nan"), None, -1.25, 3, "a")] == [
        "–", "–", "\u22121.25", "3", "a",
    ]  # fmt: skip
    done = report.Done(Experiment("x", "X", "Fig. X", lambda s, p: outcome), outcome)
    page = report.html([done], {}, {"model": "<none>"})
    assert "&lt;b&gt;bold" in page
    assert "<b>" not in page
    assert "since 1 &lt; 2" in page
    assert '<td class="open">undecided</td>' in page
