"""Every reader of what comes from outside, given damage: a value, or one short line; never anything else, and no flood.

The numbers of cases are those of the usual profile; HYPOTHESIS_PROFILE=long has fifty times as many, others every
time. Files of models are damaged in their own tests: test_npz, test_basel, test_eos, test_flame and others.
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from viser import _messages

import faceambig as fa
import faceambig.io as fio
from damage import VALUES, cases, changes, damaged, other_json, peak_of
from faceambig.errors import AssetError
from faceambig.io.fits import encode_fit
from faceambig.io.ict import ALL, MEAN, read_ict
from faceambig.io.landmarks import parse_landmarks
from faceambig.io.pictures import picture_size
from faceambig.io.schemes import load_scheme
from faceambig_app import own
from faceambig_app.guard.messages import FIELDS, _checked
from faceambig_app.notices import from_file, from_query
from faceambig_app.script import read_report
from faceambig_app.state import DEFAULT, ViewState
from faceambig_app.state.forms import to_json
from faceambig_app.state.link import query
from states import states
from strategies import face_of, tiny_model

LONGEST_LINE = 400  # characters: it stands in a notice, or on one or two lines of a terminal
# Of a text of n bytes: what JSON of brackets or of short numbers becomes in Python, 60 bytes for two of text
TEXT_MEMORY = 4_000_000, 60


def line_or(call: Callable[[], Any], kind: type[ValueError] = ValueError) -> Any:
    """What comes back, or None and the refusal was one line that can be shown."""
    try:
        return call()
    except kind as error:
        said = str(error)
        assert said
        assert len(said) <= LONGEST_LINE, said
        assert len(said.splitlines()) == 1, said
        return None


def modest(call: Callable[[], Any], n_bytes: int) -> None:
    """`call` takes no more memory than a reader of so many bytes of text may."""
    fixed, each = TEXT_MEMORY
    assert peak_of(call) < fixed + each * n_bytes


# ---------------------------------------------------------------- links and states


@cases(60)
@given(state=states(), data=st.data())
def test_a_damaged_link_is_a_state_and_short_lines(state, data):
    whole = query(state).encode()
    text = damaged(whole, data.draw(changes(len(whole)))).decode("utf-8", "surrogateescape")
    found, notices = from_query(text)
    assert isinstance(found, ViewState)
    assert query(found).isascii()
    assert all(len(words) <= LONGEST_LINE and words.isprintable() for words in notices)


@cases(60)
@given(state=states(), data=st.data())
def test_a_damaged_state_is_a_state_or_a_line(state, data):
    text = to_json(state)
    if data.draw(st.booleans()):
        raw = data.draw(other_json(json.loads(text))).encode()
    else:
        raw = damaged(text.encode(), data.draw(changes(len(text))))
    read = line_or(lambda: from_file(raw))
    if read is not None:
        assert from_file(to_json(read[0]).encode())[0] == read[0]


@pytest.mark.parametrize(
    "bomb", [b"[" * 65_000, b"[0," * 21_000, b'{"pins":[' * 7_000, b"9" * 65_000]
)
def test_bombs_of_states_are_lines_in_little_memory(bomb):
    modest(lambda: line_or(lambda: from_file(bomb)), len(bomb))


# ---------------------------------------------------------------- landmark files

PAIRS = np.random.default_rng(2).uniform(20, 480, (68, 2)).round(2)
ROWS = [f"{x} {y}" for x, y in PAIRS]
LANDMARKS = {
    "pts": "\n".join(["version: 1", "n_points: 68", "{", *ROWS, "}", ""]),
    "csv": "\n".join(["name,x,y", *(f"{k},{x},{y}" for k, (x, y) in enumerate(PAIRS, 1))]),
    "openface": "\n".join([
        ",".join([*(f"x_{k}" for k in range(68)), *(f"y_{k}" for k in range(68))]),
        ",".join(map(str, PAIRS.T.ravel())),
    ]),
    "json": json.dumps({
        "format": "faceambig-landmarks", "version": 1, "scheme": "ibug68", "image_size": [500, 500],
        "points": [{"name": str(k), "x": x, "y": y} for k, (x, y) in enumerate(PAIRS.tolist(), 1)],
    }),
    "mesh": json.dumps([{"x": x / 500, "y": y / 500, "z": 0.1} for x, y in np.tile(PAIRS, (7, 1))[:468].tolist()]),
}  # fmt: skip


@pytest.mark.parametrize("kind", LANDMARKS)
@cases(30)
@given(data=st.data())
def test_damaged_landmarks_are_points_or_a_line(kind, data):
    text = LANDMARKS[kind]
    if kind in ("json", "mesh") and data.draw(st.booleans()):
        raw = data.draw(other_json(json.loads(text))).encode()
    else:
        raw = damaged(text.encode(), data.draw(changes(len(text))))
    read = line_or(lambda: parse_landmarks(raw, name="a.txt", image_size=(500, 500)), AssetError)
    if read is not None:
        assert read.points.shape == (len(read.names), 2)
        assert not np.isinf(read.points).any()
        given = read.points[np.isfinite(read.points).all(axis=1)]
        assert ((given >= -1) & (given <= 501)).all()  # a pixel of slack: files count from 0 or 1


@pytest.mark.parametrize(
    "bomb",
    [
        b"[" * (1 << 20),
        b"[0," * (1 << 18),
        b"[[]," * (1 << 18),
        b"x,y\n" + b"1,2\n" * (1 << 17),
        b"x,y\n" + b"," * ((1 << 20) - 4),
        b"version: 1\n{\n" + b"1 2\n" * (1 << 17),
        b"x_0,y_0," + b"x_1," * (1 << 17),
        b"\n" * (1 << 20),
        b'{"points":[' + b"1," * (1 << 18),
        b'{"a":1,' * (1 << 17),
        b"1" * (1 << 20),
    ],
)
def test_bombs_of_landmarks_are_lines_in_little_memory(bomb):
    read = lambda: parse_landmarks(bomb, name="a.txt", image_size=(500, 500))  # noqa: E731
    modest(lambda: line_or(read, AssetError), len(bomb))


@cases(50)
@given(data=st.data())
def test_a_damaged_scheme_is_a_scheme_or_a_line(tmp_path_factory, data):
    whole = fio.asset_path("schemes/embedded_ibug68.csv").read_bytes()
    path = tmp_path_factory.getbasetemp() / "damaged_scheme.csv"
    path.write_bytes(damaged(whole, data.draw(changes(len(whole)))))
    read = line_or(lambda: load_scheme(path, "ibug68"), AssetError)
    if read is not None:
        assert len(read.points) == len(read.vertices) == len(read.sides)
        assert read.vertices.min() >= 0


# ---------------------------------------------------------------- saved fits

TINY = tiny_model(n_vertices=24, n_modes=4, seed=4)


def _tiny_fit() -> fa.Fit:
    face = face_of(TINY, np.array([0.5, -1.0, 0.3, 1.2]))
    return fa.fit(TINY, fa.observe(face, distance=0.6, scheme="all"), distance=0.6)


SAVED = encode_fit(_tiny_fit(), {"words": "for people"})


@cases(80)
@given(data=st.data())
def test_a_damaged_fit_is_a_finite_fit_or_a_line(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "damaged_fit.json"
    if data.draw(st.integers(0, 2)):
        path.write_text(data.draw(other_json(json.loads(SAVED))))
    else:
        path.write_bytes(damaged(SAVED, data.draw(changes(len(SAVED)))))
    read = line_or(lambda: fa.load_fit(path, TINY), AssetError)
    if read is not None:
        assert np.isfinite(read.vertices()).all()
        assert np.isfinite(read.projected()).all()
        assert np.isfinite(read.cost)
        assert read.steps >= 0


# ---------------------------------------------------------------- pictures


def _encoded(kind: str, **options: Any) -> bytes:
    pixels = np.random.default_rng(1).integers(0, 255, (21, 34, 3), dtype=np.uint8)
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, kind, **options)
    return stream.getvalue()


EXIF = Image.Exif()
EXIF[0x0112], EXIF[0x010E] = 6, "turned"
PICTURES = {
    **{kind: _encoded(kind) for kind in ("JPEG", "PNG", "WEBP", "BMP", "TIFF", "GIF")},
    "JPEG turned": _encoded("JPEG", exif=EXIF),
    "PNG turned": _encoded("PNG", exif=EXIF),
    "WEBP turned": _encoded("WEBP", exif=EXIF),
}
SMALL = 4_000_000  # pixels: decoding a size that a header only claims costs its memory, 12 MB here


@pytest.mark.parametrize("kind", PICTURES)
@cases(20)
@given(data=st.data())
def test_a_damaged_upload_is_a_picture_or_a_line(kind, data):
    whole = PICTURES[kind]
    # the first bytes are the header, where most is at stake
    raw = damaged(
        whole, data.draw(changes(min(len(whole), data.draw(st.sampled_from([64, 4000])))))
    )
    own_limit, own.MAX_PIXELS = own.MAX_PIXELS, SMALL
    try:
        read = line_or(lambda: own.read_photo("a.jpg", raw))
    finally:
        own.MAX_PIXELS = own_limit
    if read is not None:
        height, width, channels = read.taken.rgb.shape
        assert channels == 3
        assert 1 <= min(width, height) <= max(width, height) <= own.LARGEST


@pytest.mark.parametrize("kind", PICTURES)
@cases(20)
@given(data=st.data())
def test_the_size_in_a_damaged_header_is_a_size_or_a_line(tmp_path_factory, kind, data):
    whole = PICTURES[kind]
    path = tmp_path_factory.getbasetemp() / "damaged_header.jpg"
    path.write_bytes(damaged(whole, data.draw(changes(min(len(whole), 200)))))
    size = line_or(lambda: picture_size(path), AssetError)
    if size is not None:
        assert 1 <= min(size) <= max(size) <= 65_535


# ---------------------------------------------------------------- models of many files

OBJ_LINES = [
    *(f"v {x:.4f} {y:.4f} {z:.4f}" for x, y, z in np.random.default_rng(3).normal(size=(ALL.vertices, 3))),
    *(f"f {k}/{k} {k + 1}/{k + 1} {k + 2}/{k + 2}" for k in np.arange(ALL.polygons) % 9000 + 1),
]  # fmt: skip
OBJ = ("\n".join(OBJ_LINES) + "\n").encode()


@cases(6)
@given(data=st.data())
def test_damaged_meshes_are_a_finite_model_or_a_line(tmp_path_factory, data):
    folder: Path = tmp_path_factory.getbasetemp() / "damaged_ict"
    folder.mkdir(exist_ok=True)
    hurt = data.draw(st.sampled_from([MEAN, "identity000.obj"]))
    for name in (MEAN, "identity000.obj"):
        how = data.draw(changes(len(OBJ))) if name == hurt else []
        (folder / name).write_bytes(damaged(OBJ, how))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FACEAMBIG_CACHE", str(folder / "cache"))
        patch.setattr(
            "faceambig.io.ict._keep", lambda *_: None
        )  # its key is the time: too coarse here
        read = line_or(lambda: read_ict(folder), AssetError)
    if read is not None:
        assert np.isfinite(read.mean).all()
        assert np.isfinite(read.control_modes).all()


# ---------------------------------------------------------------- what a browser says

GOOD: dict[str, dict[str, Any]] = {
    "ViewerCameraMessage": {
        "wxyz": [1.0, 0.0, 0.0, 0.0], "position": [0.0, 0.0, 3.0], "fov": 1.0, "near": 0.01, "far": 100.0,
        "image_height": 600, "image_width": 800, "look_at": [0.0, 0.0, 0.0], "up_direction": [0.0, 1.0, 0.0],
    },
    "GuiUpdateMessage": {"uuid": "a", "updates": {"value": 1.5}},
    "CommandTriggerMessage": {"uuid": "a"},
    "FileTransferStartUpload": {
        "source_component_uuid": "a", "transfer_uuid": "b", "filename": "c", "mime_type": "d", "part_count": 1,
        "size_bytes": 9,
    },
    "FileTransferPart": {"source_component_uuid": "a", "transfer_uuid": "b", "part_index": 0, "content": b"123"},
}  # fmt: skip


def test_all_messages_that_are_let_through_are_fuzzed():
    assert GOOD.keys() == FIELDS.keys()


@pytest.mark.parametrize("kind", GOOD)
@cases(40)
@given(data=st.data())
def test_a_damaged_message_is_one_of_ours_or_a_line(kind, data):
    content = {"type": kind, **GOOD[kind]}
    if data.draw(st.booleans()):
        key = data.draw(st.sampled_from(sorted(content)) | st.text(max_size=5))
        content[key] = data.draw(VALUES)
    try:
        raw = msgspec.msgpack.encode(content)
    except (OverflowError, UnicodeEncodeError):  # no msgpack has this
        return
    if data.draw(st.booleans()):
        raw = damaged(raw, data.draw(changes(len(raw))))
    try:
        message = _checked(raw, _messages.Message, shown=True)
    # all that the reader of a connection drops with a line of the log
    except (ValueError, TypeError, RecursionError, msgspec.MsgspecError):
        return
    assert type(message).__name__ in FIELDS
    if isinstance(message, _messages.ViewerCameraMessage):
        numbers = [*message.wxyz, *message.position, *message.look_at, *message.up_direction]
        assert np.isfinite([*numbers, message.fov, message.near, message.far]).all()
        assert min(message.image_height, message.image_width) >= 1


@cases(60)
@given(data=st.data())
def test_a_damaged_report_is_a_report_or_a_line(data):
    whole = data.draw(
        st.sampled_from(
            [
                {"hello": {"query": query(DEFAULT), "reduced_motion": False, "touch": False, "dark": True,
                           "theme": None, "text": 1.0}},
                {"point": {"index": 3, "x": 4.5, "y": 6.0, "done": True}},
                {"click": {"x": 1.0, "y": 2.0}}, {"gone": 4}, {"key": "Escape"}, {"hand": True}, {"dark": False},
                {"copied": {"n": 1, "ok": True}},
            ]
        )
    )  # fmt: skip
    text = json.dumps(whole)
    if data.draw(st.booleans()):
        text = data.draw(other_json(whole))
    else:
        raw = damaged(text.encode(), data.draw(changes(len(text))))
        text = raw.decode("utf-8", "surrogateescape")
    report = line_or(lambda: read_report(text))
    if report is not None:
        # strict JSON again: nothing that is not finite came through
        assert json.loads(msgspec.json.encode(report)) is not None
