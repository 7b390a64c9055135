"""Lessons: their files, their numbers, their conditions, and a learner without a browser."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from faceambig.errors import AssetError
from faceambig.observation import eye_distance
from faceambig_app.lessons import (
    NUMBERS,
    Lessons,
    expressions,
    lessons,
    measures,
    read_lesson,
    read_lessons,
)
from faceambig_app.lessons.conditions import condition
from faceambig_app.lessons.crowd import moved_percent
from faceambig_app.lessons.page import html_of, step_html, teacher_page
from faceambig_app.lessons.room import LessonRoom
from faceambig_app.panel.lessons import Shown
from faceambig_app.pipeline import frame
from faceambig_app.pipeline.faces import curve, face
from faceambig_app.pipeline.fits import model
from faceambig_app.state import DEFAULT, ViewState, changed, link
from faceambig_app.state.fields import LANGUAGES
from faceambig_app.text import speaking

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "assets" / "lessons" / "en"
FILES = sorted(FOLDER.glob("*.md"))
ALL = lessons()
OTHERS = LANGUAGES[1:]
WRITTEN = [path for each in LANGUAGES for path in sorted((FOLDER.parent / each).glob("*.md"))]
STEPS = [(lesson, step) for lesson in ALL.by_number.values() for step in lesson.steps]
IDS = [f"{lesson.number}.{step.state.step}" for lesson, step in STEPS]
STORED = json.loads((FOLDER.parent / NUMBERS).read_text(encoding="utf-8"))
ASKED = sorted({one for path in FILES for one in expressions(path)})

GOOD = """+++
title = "A"
goal = "B"
minutes = 5

[[steps]]
title = "One"
link = "subject=3&hide=numbers"
ask = "How far?"
choices = ["near", "far"]
answer = "far"
do = [{ words = "Go far.", when = "distance > 2" }]

[[steps]]
title = "Two"
link = "subject=3"
+++

## One

Before.

---

After the answer: {{ person_tolerance }}.

---

After the deed.

## Two

The end.

# For the teacher

Notes.
"""


def written(tmp_path: Path, text: str, name: str = "06-mine.md") -> Path:
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def test_five_lessons_are_there_and_nothing_is_wrong_with_them():
    assert sorted(ALL.by_number) == [1, 2, 3, 4, 5]
    assert ALL.problems == ()
    for lesson in ALL.by_number.values():
        assert 5 <= lesson.minutes <= 15
        assert any(step.ask for step in lesson.steps)
        # two questions to discuss, one task to hand out
        discuss = lesson.teacher.partition("**Discuss**")[2]
        assert len(re.findall(r"^\d\. ", discuss, re.MULTILINE)) == 2
        assert lesson.teacher.count("**To hand out.**") == 1
        assert lesson.teacher.count("**Misconception.**") == 1


@pytest.mark.parametrize("language", OTHERS)
def test_a_language_has_the_same_lessons(language):
    # words differ; what is seen, asked, done and told with which numbers does not
    other = lessons(language)
    assert other.problems == ()
    assert list(other.by_number) == list(ALL.by_number)
    for number, lesson in ALL.by_number.items():
        twin = other.by_number[number]
        assert (twin.name, twin.minutes, len(twin.steps)) == (
            lesson.name,
            lesson.minutes,
            len(lesson.steps),
        )
        assert twin.title != lesson.title
        for mine, theirs in zip(lesson.steps, twin.steps, strict=True):
            assert (theirs.state, theirs.tools) == (mine.state, mine.tools)
            assert [task.when for task in theirs.tasks] == [task.when for task in mine.tasks]
            assert [bool(t) for t in (theirs.answered, theirs.done, theirs.ask)] == [
                bool(t) for t in (mine.answered, mine.done, mine.ask)
            ]
            if mine.ask is not None and theirs.ask is not None:
                assert len(theirs.ask.choices) == len(mine.ask.choices)
                assert theirs.ask.number == mine.ask.number
        files = [FOLDER.parent / each / f"{lesson.name}.md" for each in ("en", language)]
        assert sorted(expressions(files[0])) == sorted(expressions(files[1]))


def test_every_number_of_the_lessons_is_what_the_head_gives():
    assert sorted(STORED) == ASKED
    assert len(ASKED) > 40
    for one in ASKED:
        # four digits are stored; another machine's arithmetic moves the fifth
        assert measures.value(one) == pytest.approx(STORED[one], rel=2e-3), one


# Per cent and millimetres that are no results: the paper's and the press's, of chances, of tasks
TYPED = {"3.11 %", "2.83 %", "2.48 %", "30 %", "95 %", "3 %", "10 mm", "1.5 mm"}


@pytest.mark.parametrize("path", WRITTEN, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_no_result_is_typed_by_hand(path):
    text = path.read_text(encoding="utf-8").partition("\n+++\n")[2]
    text = re.sub(r"(?<=\d),(?=\d)", ".", text)
    assert set(re.findall(r"[0-9.]+ (?:%|mm)", re.sub(r"\{\{.*?\}\}", "", text))) <= TYPED


def test_nowhere_do_the_circles_leave_the_crosses_more_than_lesson_1_tells():
    state = ViewState()
    curves = curve(state.target, state.fitting)
    assert curves.d_l_percent.max() <= STORED["d_l distance=3"] * 1.002
    assert curves.d_l_percent.max() < 3.0  # what a person cannot tell


def test_the_lessons_claims_hold():
    s = STORED
    # 1: the points stay, the face does not
    assert s["d_l"] < 1.0 < 3.0 * s["d_s distance=0.3"] < s["d_s"]
    # 2: the reference decides the number
    assert 15 < s["nose_by_face subject=4&distance=1.5"] < 25
    assert (
        s["nose_by_eyes subject=4&distance=1.5"] < 0.25 * s["nose_by_face subject=4&distance=1.5"]
    )
    # 3: the points let the mode go much farther than the model
    assert abs(s["d_l distance=0.3&flex=10"] - s["d_l distance=0.3"]) < 0.01
    assert not face(*_key("distance=0.3&flex=10")).plausible
    assert face(*_key("distance=0.3&flex=1.5")).plausible
    # 4: more data: better at the right distance, worse at the wrong one, for this person and on average
    for who in ("d_s subject=5", "d_s.mean"):
        where, rest = (f"{who}&", f"{who}&") if " " in who else (f"{who} ", f"{who} ")
        assert s[f"{where}distance=0.3&data=dense"] < s[f"{where}distance=0.3"]
        assert s[f"{rest}data=dense"] > s[who]
    # not for everybody
    assert s["d_s distance=0.3&data=dense"] > s["d_s distance=0.3"]
    # 5: two people agree better than one person with himself
    pair = "pair_points subject=3&actual=0.61&pins=subject:{},actual:4.88"
    assert s[pair.format(5)] < s[pair.format(3)]
    assert s["crowd_pair"] < s["crowd_other"] < s["crowd_same"]
    assert s["likely_to subject=3&actual=0.61"] < s["likely_from subject=5&actual=4.88"]


def _key(query: str) -> Any:
    state = link.read(query)[0]
    return state.target, state.fitting, state.bend


def test_moved_points_are_measured_after_a_similarity():
    of = model("embedded")
    points = of.subjects[0].vertices[of.scheme("ibug68").vertices][:, :2]
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    assert moved_percent(3.0 * points @ turn.T + [5.0, -2.0], points, of) < 1e-10
    # against lstsq over scale, angle and place, of one shifted point
    other = points.copy()
    other[0] += [0.01, 0.0]
    (x, y), one, none = other.T, np.ones(len(other)), np.zeros(len(other))
    design = np.block([[np.stack([x, -y, one, none], 1)], [np.stack([y, x, none, one], 1)]])
    wanted = points.T.ravel()
    gaps = (design @ np.linalg.lstsq(design, wanted, rcond=None)[0] - wanted).reshape(2, -1)
    expected = 100 * np.hypot(*gaps).mean() / eye_distance(points, of.scheme("ibug68"))
    assert moved_percent(other, points, of) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(("lesson", "step"), STEPS, ids=IDS)
def test_every_step_is_a_link(lesson, step):
    state, findings = link.read(link.query(step.state))
    assert findings == ()
    assert state == step.state
    assert (state.lesson, ALL.step(state)) == (lesson.number, step)
    asking = next(other for other in lesson.steps if other.ask)
    assert "numbers" in asking.state.hide


@pytest.mark.parametrize("path", WRITTEN, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_teachers_sheets_are_of_these_lessons(path):
    language = path.parent.name
    lesson = lessons(language).by_number[int(path.stem[:2])]
    folder = ROOT / "docs" / "lessons" / ("" if language == "en" else language)
    sheet = (folder / path.name).read_text(encoding="utf-8")
    with speaking(language):
        assert sheet == teacher_page(lesson)
    assert sheet.count(f"lang={language}") == (0 if language == "en" else len(lesson.steps))
    assert sheet.count("http://127.0.0.1:8080/?") == len(lesson.steps)
    assert "{{" not in sheet


def test_a_lesson_is_read(tmp_path):
    lesson = read_lesson(written(tmp_path, GOOD), {})
    assert (lesson.number, lesson.title, lesson.minutes, lesson.teacher) == (6, "A", 5, "Notes.")
    one, two = lesson.steps
    assert (one.text, one.done) == ("Before.", "After the deed.")
    assert one.answered == "After the answer: 3\u202f%."
    assert (two.text, two.answered, two.done) == ("The end.", "", "")
    assert (one.state.subject, one.state.lesson, one.state.step) == (3, 6, 1)
    assert two.state == changed(DEFAULT, subject=3, lesson=6, step=2)


WRONG = [  # what is replaced, by what, line, words
    ("+++\ntitle", "title", 1, "does not begin with"),
    ("minutes = 5", "minutes = 5 6", 4, "Expected newline"),
    ("minutes = 5", 'minutes = "5"', 4, "minutes: expected a whole number"),
    ("minutes = 5\n", "minuets = 5\n", 4, "minuets: not one of"),
    ("minutes = 5\n", "", 1, "minutes is missing"),
    ("subject=3&hide", "subjct=3&hide", 8, "link: subjct"),
    ('link = "subject=3"', 'link = "subject=300"', 16, "link: subject"),
    ('link = "subject=3"', 'link = "lesson=3"', 16, "lesson and step are added"),
    ('choices = ["near", "far"]\n', "", 9, "either choices or a number"),
    ('["near", "far"]', '["near", "near"]', 10, "2 to 5 different"),
    ('ask = "How far?"\n', "", 9, "choices: there is no ask"),
    ("distance > 2", "distance > far", 12, "'far' is not a number"),
    ("distance > 2", "distanz > 2", 12, "'distanz' is no setting"),
    ("distance > 2", "distance is 2", 12, "write < <= > >="),
    ("distance > 2", "distance < 2", 12, "holds before the learner"),
    ("## Two", "## Too", 31, '"## Too" stands where "## Two" should'),
    ("## Two\n\nThe end.\n\n", "", 14, 'no "## Two"'),
    ("The end.", "The end.\n\n---\n\nMore.", 35, "nothing to wait for"),
    ("{{ person_tolerance }}", "{{ nobody }}", 25, "'nobody' is no measure"),
    ("{{ person_tolerance }}", "{{ d_s distnce=1 }}", 25, "distnce"),
    ("{{ person_tolerance }}", "{{ d_s.most }}", 25, "is not .mean, .max or .min"),
    ("{{ person_tolerance }}", "{{ pair_face }}", 25, "other photograph is missing"),
    ("# For the teacher\n", "", 36, 'no part "# For the teacher"'),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "line", "words"), WRONG, ids=[w[3] for w in WRONG])
def test_a_broken_file_is_named_with_its_line_and_the_others_work(tmp_path, old, new, line, words):
    assert GOOD.count(old) >= 1
    written(tmp_path, GOOD.replace(old, new, 1))
    written(tmp_path, GOOD, "07-other.md")
    found = read_lessons(tmp_path, {})
    assert list(found.by_number) == [7]
    (problem,) = found.problems
    assert problem.startswith(f"06-mine.md, line {line}: ")
    assert words in problem
    assert "\n" not in problem


def test_files_that_are_no_lessons_are_named(tmp_path):
    written(tmp_path, GOOD, "lesson.md")
    written(tmp_path, GOOD, "06-a.md")
    written(tmp_path, GOOD, "06-b.md")
    (tmp_path / "08-c.md").write_bytes(b"\xff\xfe+++")
    found = read_lessons(tmp_path, {})
    assert [found.by_number[6].name] == ["06-a"]
    assert [problem.partition(":")[0] for problem in found.problems] == [
        "06-b.md",
        "08-c.md",
        "lesson.md",
    ]


def test_a_lesson_brings_no_markup_of_its_own():
    hostile = (
        "<script>alert(1)</script> ![x](http://a/b.png) [y](javascript:alert(1)) <b onclick=x>"
    )
    html = html_of(hostile)
    assert "<script" not in html
    assert "<img" not in html
    assert "<b " not in html
    assert 'href="javascript' not in html
    lesson = read_lesson_with(hostile)
    step = step_html(lesson, 1, said="<i>me</i>", ticked={0})
    assert "<i>me" not in step
    assert "<script" not in step


def read_lesson_with(words: str):
    lesson = ALL.by_number[1]
    steps = tuple(replace(step, text=words, title=words) for step in lesson.steps)
    return replace(lesson, steps=steps, title=words)


@pytest.mark.parametrize(
    ("text", "state", "holds"),
    [
        ("distance < 0.25", {"distance": 0.24}, True),
        ("distance < 0.25", {"distance": 0.25}, False),
        ("distance <= 0.25", {"distance": 0.25}, True),
        ("view is side", {"view": "side"}, True),
        ("view is side", {}, False),
        ("overlays has rays and view is top", {"overlays": ("rays",), "view": "top"}, True),
        ("overlays has rays and view is top", {"overlays": ("rays",)}, False),
        ("flex2 <= -3", {"flex": ((2, -3.5),)}, True),
        ("flex2 <= -3", {"flex": ((1, -3.5),)}, False),
        ("draw >= 9", {"draw": 9}, True),
        ("draw >= 0", {}, False),  # no draw is none
        ("subject is 4", {"subject": 4}, True),
    ],
)  # fmt: skip
def test_conditions_of_settings(text, state, holds):
    assert condition(text).holds(ViewState(**state), None) is holds


def test_conditions_of_results_wait_for_rest():
    numbers = frame(DEFAULT, with_curves=False).scene.numbers
    assert condition("d_s > 3 and d_l < 1 and plausible is yes").holds(DEFAULT, numbers)
    assert not condition("d_s > 5").holds(DEFAULT, numbers)
    assert not condition("d_s > 3").holds(DEFAULT, None)


@pytest.mark.parametrize(
    "text", ["", "distance", "distance == 1", "view is sideways", "view has side", "flex > 1", "flex0 > 1",
             "distance2 > 1", "overlays is rays", "d_l is 3", "plausible is 1", 3, "distance < nowhere"],
)  # fmt: skip
def test_what_is_no_condition_is_refused(text):
    with pytest.raises(ValueError, match=r"\S"):
        condition(text)


class Learner:
    """A browser's side of a LessonRoom."""

    def __init__(self, found: Lessons = ALL) -> None:
        self.state, self.shown, self.remarks = DEFAULT, Shown(), []
        self.room = LessonRoom(found, lambda: self.state, self.tell, self.remarks.append, self.see)

    def tell(self, change: Any) -> None:
        self.state = change(self.state)
        self.room.watch(self.state)

    def see(self, shown: Shown) -> None:
        self.shown = shown

    def set(self, **values: Any) -> None:
        self.tell(lambda state: changed(state, **values))


def test_a_question_comes_first_and_a_wrong_guess_is_repeated_back():
    me = Learner()
    me.tell(me.room.chosen(1))
    assert (me.state.lesson, me.state.step, me.shown.choices) == (1, 1, ())
    me.tell(me.room.onward)
    assert me.state.step == 2
    assert "numbers" in me.state.hide
    assert me.shown.choices == ("None", "Nearly the same face", "A clearly different face")
    assert "next step shows" not in me.shown.html
    me.tell(me.room.onward)
    assert me.state.step == 2
    assert len(me.remarks) == 1
    me.room.predict("None")
    assert "numbers" not in me.state.hide
    assert "You said: None" in me.shown.html
    assert "next step shows" in me.shown.html
    assert "fa-warn" not in me.shown.html
    assert me.shown.choices == ()
    me.tell(me.room.onward)
    me.tell(me.room.back)
    assert (me.state.step, me.state.hide) == (2, ())  # what was answered hides nothing again


def test_what_is_done_is_ticked_by_itself_and_stays():
    me = Learner()
    me.tell(lambda _: ALL.by_number[1].steps[3].state)
    assert me.shown.html.count("fa-done") == 0
    me.set(distance=0.22)
    me.set(distance=0.6)
    assert me.shown.html.count("fa-done") == 1
    assert "There is none" not in me.shown.html
    me.set(distance=2.2)
    assert me.shown.html.count("fa-done") == 2
    assert "There is none" in me.shown.html


def test_nothing_is_ticked_before_the_answer():
    me = Learner()
    me.tell(lambda _: ALL.by_number[2].steps[3].state)
    me.set(view="top")
    assert me.shown.tools == ()
    me.room.predict("The lens")
    assert "rays" in me.shown.tools
    assert me.shown.html.count("fa-done") == 1  # the view is from the top


def test_a_lesson_is_left_and_its_links_work():
    me = Learner()
    me.tell(me.room.chosen(5))
    me.tell(me.room.leave)
    assert (me.state.lesson, me.state.step, me.state.hide) == (None, 1, ())
    assert me.shown == Shown()
    assert me.room.arrived(ViewState(lesson=2, step=3)) == ALL.by_number[2].steps[2].state
    own = ViewState(lesson=2, step=3, actual=1.0)
    assert me.room.arrived(own) == own
    assert me.room.arrived(ViewState(lesson=77)) == DEFAULT
    assert me.remarks == ["There is no lesson 77 here."]
    big = ViewState(lesson=1, step=20, text=1.5)
    assert me.room.arrived(big) == changed(ALL.by_number[1].steps[-1].state, text=1.5)


def test_after_the_last_step_comes_the_next_lesson_and_then_none():
    me = Learner()
    me.tell(lambda _: ALL.by_number[1].steps[-1].state)
    me.tell(me.room.onward)
    assert (me.state.lesson, me.state.step) == (2, 1)
    me.tell(lambda _: ALL.by_number[5].steps[-1].state)
    me.tell(me.room.onward)
    assert me.state.lesson is None


def test_a_broken_file_is_told_on_the_page():
    me = Learner(replace(ALL, problems=("06-mine.md, line 3: <b>",)))
    me.room.watch(DEFAULT)
    assert "06-mine.md, line 3: &lt;b&gt;" in me.shown.problems


def test_a_missing_folder_has_no_lessons(tmp_path):
    assert read_lessons(tmp_path / "none", {}).by_number == {}
    with pytest.raises((ValueError, AssetError)):
        read_lesson(tmp_path / "06-x.md", {})
