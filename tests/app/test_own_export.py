"""Files made while an own photograph is shown: they are of its own frame, or refused in words."""

from __future__ import annotations

import csv
import gc
import io
import json
import weakref
from typing import Any

import cv2
import numpy as np
import pytest

import faceambig as fa
from faceambig import compose
from faceambig.metrics import surface_difference
from faceambig.observation import portrait_camera
from faceambig.render import overlay, painter
from faceambig_app import export, own
from faceambig_app.own import export as own_export
from faceambig_app.saving import Saving
from faceambig_app.state import ViewState, changed
from faceambig_app.state.forms import from_json

VIEW: dict[str, Any] = {"distance": 0.5, "yaw_deg": 10.0}
STATE = ViewState(subject="photo", distance=1.5)


@pytest.fixture(scope="module")
def photo(embedded) -> own.OwnPhoto:
    """A synthetic person's photograph, taken for a stranger's."""
    subject = embedded.subject(4)
    observation = fa.observe(subject, **VIEW)
    camera = portrait_camera(subject, **VIEW)
    rgb = painter.paint_photo(compose.photo(subject, observation, camera, caption=""), 500)
    taken = own.read_photo("me.png", cv2.imencode(".png", rgb[:, :, ::-1])[1].tobytes())
    return own.on_scheme(taken, embedded, "ibug68", observation.points)


def test_the_numbers_are_of_the_own_points_and_name_the_fit_they_are_compared_to(photo, embedded):
    name, data = own_export.files(photo, STATE, "json")
    record = json.loads(data)
    observation = fa.Observation(photo.points, "ibug68", image_size=(500, 500))
    wanted, at_60 = (fa.fit(embedded, observation, distance=metres) for metres in (1.5, 0.6))
    assert name == "faceambig_photo_as_150cm_numbers.json"
    assert record["d_l_percent"] == pytest.approx(wanted.d_l_percent, rel=1e-6)
    assert record["alpha"] == pytest.approx(wanted.alpha.tolist(), abs=1e-6)
    gap = surface_difference(at_60.vertices(), wanted.vertices(), embedded.evaluation)
    assert record["difference_mm"] == pytest.approx(gap.mean_mm, rel=1e-6)
    assert record["reference_distance_m"] == 0.6
    assert record["subject"] == "photo"
    assert not {"d_s_mm", "actual_m"} & record.keys()  # no true face, no true distance
    curve = record["curves"]
    assert "d_s_mm" not in curve
    near = int(np.argmin(np.abs(np.array(curve["distance_m"][:-1]) - 0.6)))
    assert curve["difference_mm"][near] < 0.3 < max(curve["difference_mm"])
    rows = list(csv.reader(io.StringIO(own_export.files(photo, STATE, "csv")[1].decode())))
    assert ["difference_mm", "", str(record["difference_mm"]), "mm"] in rows
    bent = json.loads(own_export.files(photo, changed(STATE, flex=[(2, 3.0)]), "json")[1])
    assert np.abs(np.subtract(bent["alpha"], record["alpha"])).max() > 0.1


def test_a_mesh_is_the_own_face_and_the_other_one_is_no_true_face(photo):
    scene = own.own_frame(photo, STATE, draft=False).scene
    for face, words, head in (
        ("fit", "fit", scene.heads[1]),
        ("true", "reference", scene.heads[0]),
    ):
        name, data = own_export.files(photo, changed(STATE, show="row"), "obj", face=face)
        assert name == f"faceambig_photo_row_{words}.obj"
        lines = [line.split() for line in data.decode().splitlines()]
        points = np.array([line[1:4] for line in lines if line[:1] == ["v"]], dtype=float)
        assert np.abs(points - head.vertices).max() < 1e-6
        assert head.title.replace("\u202f", " ") in data.decode()
    with pytest.raises(ValueError, match="hidden"):
        own_export.files(photo, changed(STATE, hide=["truth"]), "ply", face="true")
    with pytest.raises(ValueError, match="face: 'nose'"):
        own_export.files(photo, STATE, "ply", face="nose")


def test_a_picture_is_of_the_own_frame_and_has_the_photograph_only_when_asked(photo, monkeypatch):
    drawn = []

    def draw(scene: Any, **options: Any) -> np.ndarray:
        drawn.append((scene, options))
        return np.zeros((2, 2, 4), np.uint8)

    monkeypatch.setattr(overlay, "draw", draw)
    name, data = own_export.files(photo, STATE, "png", scale=2, transparent=True)
    own_export.files(photo, STATE, "png", own_photo=True)
    assert name == "faceambig_photo_as_150cm.png"
    assert b"own photograph" not in data  # only what is drawn says so
    (plain, options), (whole, _) = drawn
    assert (options["scale"], options["transparent"]) == (2, True)
    assert plain.photo.pixels is None
    assert np.array_equal(whole.photo.pixels, photo.taken.rgb)
    assert plain.note == "own photograph; the fit at 60 cm stands in for the true face"
    assert np.array_equal(plain.photo.observed, photo.points)
    with pytest.raises(ValueError, match="scale: 3"):
        own_export.files(photo, STATE, "png", scale=3)


def test_what_has_no_own_frame_is_refused_in_words(photo):
    for kind in ("html", "webp", "gif"):
        with pytest.raises(ValueError, match="made of the synthetic people, not of your own photo"):
            own_export.files(photo, STATE, kind)
    with pytest.raises(ValueError, match="No photo yet"):
        own_export.files(None, STATE, "png")
    few = own.with_points(photo, np.where(np.arange(68)[:, None] < 4, photo.points, np.nan))
    with pytest.raises(ValueError, match=r"4 points placed\. 6 are needed"):
        own_export.files(few, STATE, "csv")
    for off in ({"draw": 1}, {"data": "outline"}, {"surface": "spread"}):
        with pytest.raises(ValueError, match=r"own photo|Of your own"):
            own_export.files(photo, changed(STATE, **off), "ply")
    name, data = own_export.files(None, STATE, "state")
    assert (name, from_json(data)) == ("faceambig_photo_as_150cm_state.json", STATE)


class Line:
    """Keeps the work it is given."""

    def take(self, _customer: Any, work: Any) -> bool:
        self.work = work
        return True


def test_an_order_that_waits_keeps_no_photograph(photo):
    held = [own.with_points(photo, photo.points)]
    line = Line()
    parts: Any = {"go": None, "show": None, "notice": None}
    stand_ins: Any = (None, None, line)
    saving = Saving(*stand_ins, now=lambda: STATE, own=lambda: held[-1], **parts)
    saving.save("csv")
    assert line.work(lambda *_: None) == own_export.files(photo, STATE, "csv")
    here = weakref.ref(held.pop())
    gc.collect()
    assert here() is None
    with pytest.raises(ValueError, match="changed before the file was made"):
        line.work(lambda *_: None)


def test_of_a_synthetic_person_files_are_as_before(photo):
    line, state = Line(), ViewState()
    parts: Any = {"go": None, "show": None, "notice": None}
    stand_ins: Any = (None, None, line)
    saving = Saving(*stand_ins, now=lambda: state, own=lambda: photo, **parts)
    saving.save("csv")
    assert line.work(lambda *_: None) == export.files(state, "csv")
