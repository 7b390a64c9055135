"""Moving pictures: decoded again, their frames are snapshots; the command leaves a whole file or nothing."""

from __future__ import annotations

import io
import sys

import cv2
import numpy as np
import pytest
from PIL import Image, ImageSequence

from commands import printed, refused
from faceambig_app import export
from faceambig_app.export import animate
from faceambig_app.state import ViewState, changed
from faceambig_app.state.forms import to_json
from scenes import need_renderer

STATE = ViewState(subject=3, camera="orthographic")
SIZE = (320, 200)
SHORT = {"seconds": 1.0, "fps": 4.0, "width": SIZE[0]}  # three stops, four frames
# Share of the pixels of pictures a quarter as large that differ by more than 10 of 255: there the edges of compression
# average out, another face does not. Measured at most 0.013 (WebP) and 0 (GIF), 0.05 between the ends of the sweep,
# 0.027 of the swing.
LOSSY = 0.02


def decoded(data: bytes) -> tuple[list[np.ndarray], Image.Image]:
    picture = Image.open(io.BytesIO(data))
    return [
        np.asarray(f.convert("RGB")).astype(int) for f in ImageSequence.Iterator(picture)
    ], picture


def gap(a: np.ndarray, b: np.ndarray) -> float:
    small = [
        cv2.resize(x.astype(np.float32), None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA)
        for x in (a, b)
    ]
    return float((np.abs(small[0] - small[1]).max(axis=2) > 10).mean())


def snapshot(state: ViewState) -> np.ndarray:
    return export.snapshot(state, width=SIZE[0], height=SIZE[1])[..., :3].astype(int)


@pytest.fixture(scope="module")
def ends() -> list[np.ndarray]:
    """Snapshots of the first and the last stop of a sweep of STATE."""
    need_renderer()
    return [snapshot(changed(STATE, camera="perspective", distance=d)) for d in (0.2, 3.0)]


@pytest.mark.gl
@pytest.mark.parametrize("kind", ["webp", "gif"])
def test_a_sweep_begins_and_turns_at_snapshots(kind, ends):
    drawn = []
    name, data = animate.animation(STATE, kind, progress=lambda *at: drawn.append(at), **SHORT)
    assert name == f"faceambig_subject3_30cm_distance.{kind}"
    assert drawn == [(1, 3), (2, 3), (3, 3)]
    frames, picture = decoded(data)
    assert [frame.shape for frame in frames] == [(200, 320, 3)] * 4
    assert gap(frames[0], ends[0]) < LOSSY
    assert gap(frames[2], ends[1]) < LOSSY
    assert gap(frames[1], frames[3]) < LOSSY  # there and back through the same stop
    assert gap(ends[0], ends[1]) > 2 * LOSSY
    assert picture.info["loop"] == 0  # without end
    picture.seek(1)
    picture.load()
    assert picture.info["duration"] == 250
    told = picture.getexif()[0x010E] if kind == "webp" else picture.info["comment"].decode()
    for words in (to_json(STATE), "faceambig 0.1.0", "CC0 1.0"):
        assert words in told


@pytest.mark.gl
def test_a_swing_goes_from_one_side_to_the_other():
    need_renderer()
    name, data = animate.animation(STATE, "webp", what="mode", mode=2, low=-4, high=4, **SHORT)
    assert name == "faceambig_subject3_30cm_as_far_mode2.webp"
    frames, _ = decoded(data)
    left, right = (snapshot(changed(STATE, flex=((2, mm),))) for mm in (-4.0, 4.0))
    # The note below the heads names the mode, the snapshot's does not: 9 of 200 rows
    assert gap(frames[0][:185], left[:185]) < LOSSY
    assert gap(frames[2][:185], right[:185]) < LOSSY
    assert gap(frames[0], frames[2]) > LOSSY


def test_places_swing_slowly_at_the_ends_and_keep_both_to_the_last_digit():
    metres = animate.places("distance", 0.3, 2.4, 7)
    assert metres[[0, -1]].tolist() == [0.3, 2.4]
    np.testing.assert_allclose(np.diff(np.log2(metres)), 0.5)
    mm = animate.places("mode", -5.0, 3.0, 9)
    assert mm[[0, 4, -1]].tolist() == pytest.approx([-5.0, -1.0, 3.0])
    steps = np.diff(mm)
    assert (steps[:4] > 0).all()
    assert (np.diff(steps[:4]) > 0).all()


@pytest.fixture
def drawing(monkeypatch):
    """Frames without a renderer: a grey that counts up. Returns the list of sizes asked for."""
    sizes = []

    def drawn(scene, *size, words):
        sizes.append(size)
        return np.full((size[1], size[0], 4), 10 * len(sizes), np.uint8)

    monkeypatch.setattr("faceambig.render.overlay.draw", drawn)
    return sizes


START = {"webp": b"RIFF", "gif": b"GIF89a"}
COMMAND = ("animate", "--subject", 3, "--seconds", 1, "--fps", 4, "--width", 320, "--out")


def test_the_command_writes_what_its_ending_says(tmp_path, capsys, drawing):
    for kind in ("webp", "gif"):
        file = tmp_path / f"a.{kind}"
        assert printed(capsys, *COMMAND, file) == (0, "", "")
        assert file.read_bytes().startswith(START[kind])
    assert set(drawing) == {(320, 200)}
    page = tmp_path / "a.html"
    assert printed(capsys, "animate", "--what", "mode", "--out", page) == (0, "", "")
    assert 'data-track-button="mode3"' in page.read_text(encoding="utf-8")
    assert len(list(tmp_path.iterdir())) == 3


def test_progress_is_for_terminals_and_leaves_an_empty_line(tmp_path, capsys, drawing, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    status, out, err = printed(capsys, *COMMAND, tmp_path / "a.gif")
    assert (status, out) == (0, "")
    assert "frame 2 of 3" in err
    assert err.endswith("\r\x1b[K")
    assert "\n" not in err


def test_an_interrupt_leaves_the_old_file_and_nothing_else(tmp_path, capsys, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    file = tmp_path / "a.webp"
    file.write_bytes(b"old")
    monkeypatch.setattr("faceambig.render.overlay.draw", interrupted)
    assert printed(capsys, *COMMAND, file)[0] == 130
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"old"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--out", "a.mp4"), "does not end in .webp, .gif, .html"),
        (("--out", "no/a.gif"), "there is no folder"),
        (("--out", "a.html", "--fps", "3"), "--fps: a page has none"),
        (("--out", "a.html", "--from", "1"), "--from: a page has none"),
        (("--out", "a.gif", "--mode", "2"), "--mode: is of --what mode"),
        (("--out", "a.gif", "--what", "mode", "--mode", "4"), "mode: 4 is not within 1 to 3"),
        (("--out", "a.gif", "--from", "2", "--to", "1"), "from, to: 2 to 1 m"),
        (("--out", "a.gif", "--to", "nan"), "from, to: 0.2 to nan m"),
        (("--out", "a.gif", "--what", "mode", "--to", "11"), "within -10 to 10 mm"),
        (("--out", "a.gif", "--fps", "300"), "fps: 300 is not within 1 to 30"),
        (("--out", "a.gif", "--width", "10"), "width: 10 is not within 320 to 1920"),
        (("--out", "a.gif", "--seconds", "60", "--fps", "30"), "give fewer seconds, fps or width"),
        (("--out", "a.gif", "--distance", "9"), "distance"),
        (("--out", "a.gif", "--what", "time"), "invalid choice"),
    ],
)
def test_what_cannot_be_is_refused_in_a_line(tmp_path, capsys, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    assert words in refused(capsys, "animate", *arguments)
    assert list(tmp_path.iterdir()) == []
