"""Our own format: the embedded head, saving and loading, and files that were made to hurt."""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import faceambig.io as fio
from faceambig.errors import AssetError
from faceambig.io.files import MAX_BYTES
from faceambig.metrics import surface_difference
from faceambig.model import FaceModel
from strategies import tiny_model

B, N, S = 70, 90, 4


def arrays() -> dict[str, Any]:
    """A small model in the integers of the embedded head: 70 control vertices, 20 midpoints, a scheme of its own."""
    rng = np.random.default_rng(8)
    mean = rng.normal(size=(B, 3)) * (50_000, 60_000, 30_000)
    # points 37 to 48 of ibug68 at vertices 36 to 47: the eyes of an adult
    x = np.array([-45, -37, -26, -18, -26, -37, 18, 26, 37, 45, 37, 26]) * 1000
    mean[36:48] = np.column_stack([x, np.full(12, 5_000), np.full(12, 12_000)])
    operator = np.vstack([np.eye(B), 0.5 * (np.eye(20, B) + np.eye(20, B, 1))])
    data = operator[operator != 0]
    return {
        "format": "faceambig-model",
        "version": 1,
        "name": "small",
        "licence": "CC0",
        "source": "drawn",
        "mean": mean.astype(np.int32),
        "modes": rng.integers(-9000, 9000, (S, B, 3)).astype(np.int16),
        "mode_step": np.array([4e-7, 3e-7, 2e-7, 1e-7]),
        "subdivision_indptr": np.concatenate([[0], np.cumsum((operator != 0).sum(1))]).astype(
            np.int32
        ),
        "subdivision_indices": np.nonzero(operator)[1].astype(np.uint16),
        "subdivision_data": data,
        "faces": rng.integers(0, N, (50, 3)).astype(np.uint16),
        "coarse_faces": rng.integers(0, B, (20, 3)).astype(np.uint16),
        "colours": rng.integers(0, 256, (B, 3)).astype(np.uint8),
        "occlusion": rng.integers(0, 256, N).astype(np.uint8),
        "evaluation": (np.arange(N) % 2).astype(np.uint8),
        "regions": np.where(np.arange(N) < 80, np.arange(N) % 2, 255).astype(np.uint8),
        "region_names": ["even", "odd"],
        "subjects": rng.integers(-300, 300, (2, B, 3)).astype(np.int16),
        "subject_step": 1e-5,
        "subject_names": ["Ada", "Bo"],
        "subject_notes": ["woman", "man"],
        "subject_colours": rng.integers(0, 256, (2, N, 3)).astype(np.uint8),
        "scheme0_name": "ibug68",
        "scheme0_points": [str(k) for k in range(1, 69)],
        "scheme0_sides": ["mid"] * 68,
        "scheme0_vertices": np.arange(68),
        "scheme0_right_eye": [36, 39],
        "scheme0_left_eye": [42, 45],
        "scheme0_eyes_meaning": "mean of the two corners",
    }


def write(path: Path, changes: dict[str, Any] | None = None) -> Path:
    """The small model, some arrays changed (None: left out), as a file."""
    content = arrays() | (changes or {})
    stored: dict[str, Any] = {k: np.asarray(v) for k, v in content.items() if v is not None}
    np.savez_compressed(path, **stored)
    return path


@pytest.fixture
def path(tmp_path) -> Path:
    return tmp_path / "small.npz"


def same(a: FaceModel, b: FaceModel) -> bool:
    """Everything the format holds, bit by bit; subjects to the rounding of mean + displacement."""
    exact = all(
        np.array_equal(getattr(a, name), getattr(b, name))
        for name in ("mean", "control_mean", "control_modes", "faces", "coarse_faces", "colours", "occlusion",
                     "evaluation", "file_origin")
    )  # fmt: skip
    words = all(getattr(a, name) == getattr(b, name) for name in ("name", "licence", "source"))
    return (
        exact
        and words
        and list(a.regions) == list(b.regions)
        and all(np.array_equal(a.regions[k], b.regions[k]) for k in a.regions)
        and [(s.name, s.about) for s in a.subjects] == [(s.name, s.about) for s in b.subjects]
        and all(
            np.abs(s.vertices - t.vertices).max() < 1e-16
            and np.array_equal(np.asarray(s.colours), np.asarray(t.colours))
            for s, t in zip(a.subjects, b.subjects, strict=True)
        )
        and list(a.schemes) == list(b.schemes)
        and all(
            (s.name, s.points, s.sides, s.eyes, s.eyes_meaning, s.vertices.tolist())
            == (t.name, t.points, t.sides, t.eyes, t.eyes_meaning, t.vertices.tolist())
            for s, t in zip(a.schemes.values(), b.schemes.values(), strict=True)
        )
    )


# What is read


def test_integers_become_metres(path):
    stored = arrays()
    model = fio.load_model(write(path), origin="file")
    assert np.abs(model.control_mean - 1e-6 * stored["mean"]).max() < 1e-16
    for j in range(S):
        mode = model.vertices(np.eye(S)[j]) - model.mean
        assert np.abs(mode[:B] - stored["mode_step"][j] * stored["modes"][j]).max() < 1e-16
        # a vertex of the subdivision is the middle of two
        assert np.abs(mode[B] - (mode[0] + mode[1]) / 2).max() < 1e-16
    assert model.n_vertices == N
    ada = model.subject(1)
    assert (ada.name, ada.about) == ("Ada", "woman")
    assert (
        np.abs(ada.vertices[:B] - 1e-6 * stored["mean"] - 1e-5 * stored["subjects"][0]).max()
        < 1e-16
    )
    assert ada.model is model
    assert model.evaluation is not None
    assert model.evaluation.tolist() == list(range(1, N, 2))
    assert model.regions["odd"].tolist() == list(range(1, 80, 2))


def test_arrays_stored_column_by_column_are_the_same(path, tmp_path):
    turned = {
        name: np.asfortranarray(arrays()[name]) for name in ("mean", "modes", "faces", "colours")
    }
    assert same(fio.load_model(write(path)), fio.load_model(write(tmp_path / "turned.npz", turned)))


def test_colours_of_control_vertices_are_blended_over_the_surface(path):
    stored = arrays()["colours"].astype(float)
    colours = fio.load_model(write(path)).colours
    assert colours is not None
    assert np.array_equal(colours[:B], stored)
    assert np.array_equal(colours[B], np.rint((stored[0] + stored[1]) / 2))


def test_the_origin_moves_between_the_eyes_and_back(path):
    eyes, own = fio.load_model(write(path)), fio.load_model(path, origin="file")
    corners = eyes.mean[[36, 39, 42, 45]]
    assert np.abs(corners.mean(axis=0)).max() < 1e-16
    # from the file: x -45, -18, 18, 45; y 5; z 12 mm
    assert np.abs(eyes.file_origin - [0, -0.005, -0.012]).max() < 1e-16
    assert np.abs(own.mean - (eyes.mean - eyes.file_origin)).max() < 1e-16
    assert (
        np.abs(own.subject(2).vertices - (eyes.subject(2).vertices - eyes.file_origin)).max()
        < 1e-16
    )
    assert np.array_equal(own.control_modes, eyes.control_modes)


def test_a_moved_model_that_was_saved_still_knows_its_files_origin(path, tmp_path):
    eyes, own = fio.load_model(write(path)), fio.load_model(path, origin="file")
    fio.save_model(eyes, tmp_path / "moved.npz")
    again, back = (
        fio.load_model(tmp_path / "moved.npz"),
        fio.load_model(tmp_path / "moved.npz", origin="file"),
    )
    assert np.abs(again.file_origin - eyes.file_origin).max() < 1e-16
    assert np.abs(back.mean - own.mean).max() < 1e-16


def test_saving_keeps_everything(path, tmp_path):
    model = fio.load_model(write(path), origin="file")
    fio.save_model(model, tmp_path / "again.npz")
    assert same(model, fio.load_model(tmp_path / "again.npz", origin="file"))
    fio.save_model(model.truncate(2), tmp_path / "again.npz")
    assert fio.load_model(tmp_path / "again.npz").n_modes == 2
    assert list(tmp_path.glob(".*")) == []  # no half-written file is left


def test_a_plain_model_is_saved_without_what_it_lacks(tmp_path):
    model = tiny_model()
    fio.save_model(model, tmp_path / "tiny.npz")
    again = fio.load_model(tmp_path / "tiny.npz", origin="file")
    assert same(model, again)
    assert again.subdivision is None
    assert again.evaluation is None


def test_regions_that_overlap_are_not_saved_wrongly(tmp_path):
    model = replace(tiny_model(), regions={"a": np.array([1, 2]), "b": np.array([2, 3])})
    with pytest.raises(ValueError, match="regions: 'b' shares a vertex"):
        fio.save_model(model, tmp_path / "tiny.npz")
    assert list(tmp_path.iterdir()) == []


def test_only_asked_for_names_are_accepted(path):
    write(path)
    with pytest.raises(ValueError, match="part: 'ears' is not face or head"):
        fio.load_model(path, part="ears")  # pyright: ignore[reportArgumentType]
    with pytest.raises(ValueError, match="origin: 'nose' is not eyes or file"):
        fio.load_model(path, origin="nose")  # pyright: ignore[reportArgumentType]


def test_a_model_without_eyes_asks_for_its_own_origin(path):
    write(path, {"scheme0_name": None})
    with pytest.raises(AssetError, match=r"small: names no eyes .* use origin='file'"):
        fio.load_model(path)
    assert fio.load_model(path, origin="file").n_vertices == N


# What is refused

CHANGES: list[tuple[dict[str, Any], str]] = [
    ({"format": "other"}, "format other 1; faceambig-model 1 is read"),
    ({"version": 2}, "format faceambig-model 2"),
    ({"faces": None}, "faces is missing"),
    ({"mode_step": None}, "modes are integers, but mode_step is missing"),
    ({"mode_step": np.ones(3)}, "mode_step has shape (3,), expected (4)"),
    ({"mode_step": np.full(S, np.inf)}, "modes holds a value that is not finite"),
    ({"mode_step": np.full(S, np.nan)}, "modes holds a value that is not finite"),
    (
        {"modes": np.zeros((S, B + 1, 3), np.int16)},
        "modes has shape (4, 71, 3), expected (S, 70, 3)",
    ),
    ({"modes": np.zeros((0, B, 3), np.int16)}, "modes has shape (0, 70, 3)"),
    ({"mean": np.full((B, 3), np.nan)}, "mean holds a value that is not finite"),
    ({"mean": np.zeros((B, 3), complex)}, "mean is not a plain array"),
    ({"mean": np.array(["x"])}, "mean holds <U1 numbers"),
    ({"faces": np.full((5, 3), N)}, "faces: 90 is not within 0 to 89"),
    ({"faces": np.full((5, 3), -1)}, "faces: -1 is not within 0 to 89"),
    ({"faces": np.full((5, 3), 2**64 - 1, np.uint64)}, "faces: 18446744073709551615 is not within"),
    ({"faces": np.zeros((5, 4), int)}, "faces has shape (5, 4), expected (F, 3)"),
    ({"coarse_faces": np.full((5, 3), B)}, "coarse_faces: 70 is not within 0 to 69"),
    ({"subdivision_indices": None}, "subdivision_indptr, _indices and _data belong together"),
    ({"subdivision_indices": np.full(110, B)}, "subdivision_indices: 70 is not within 0 to 69"),
    ({"subdivision_indptr": np.zeros(N + 1, int)}, "subdivision_indptr does not grow"),
    ({"subdivision_indptr": np.arange(N + 1)}, "subdivision_indptr does not grow"),
    (
        {"subdivision_indptr": np.full(N + 1, 2**64 - 1, np.uint64)},
        "subdivision_indptr does not grow",
    ),
    ({"subdivision_data": np.full(110, 0.9)}, "a row of weights sums to 1 only within"),
    (
        {"subdivision_data": np.full(110, np.nan)},
        "subdivision_data holds a value that is not finite",
    ),
    (
        {"colours": np.zeros((B + 1, 3), np.uint8)},
        "colours has shape (71, 3), expected (B or N, 3)",
    ),
    ({"occlusion": np.zeros(B, np.uint8)}, "occlusion has shape (70,), expected (90)"),
    ({"evaluation": np.zeros(N, np.uint8)}, "evaluation: 0 vertices; a surface difference needs 3"),
    ({"regions": np.full(N, 2, np.uint8)}, "regions: 2 is not within 0 to 1"),
    ({"subject_step": None}, "subjects are integers, but subject_step is missing"),
    ({"subject_step": np.inf}, "subjects holds a value that is not finite"),
    ({"subject_names": ["Ada"]}, "subject_names has shape (1,), expected (2)"),
    ({"subject_notes": [["a", "b"]]}, "subject_notes has shape (1, 2)"),
    ({"scheme0_vertices": np.full(68, N)}, "scheme0_vertices: 90 is not within 0 to 89"),
    ({"scheme0_vertices": np.arange(67)}, "scheme0_vertices has shape (67,), expected (68)"),
    ({"scheme0_right_eye": [68]}, "scheme0_right_eye: 68 is not within 0 to 67"),
    ({"scheme0_points": ["?"] * 68}, "small: scheme ibug68 has no point 46"),
    ({"scheme0_sides": None}, "scheme0_sides is missing"),
    ({"name": np.array([1])}, "name holds int64 numbers"),
    (
        {"mean": arrays()["mean"] * 10},
        "outer eye corners of the mean are 900 mm apart, an adult's 80 to 100",
    ),
    ({"mean": arrays()["mean"] // 2}, "outer eye corners of the mean are 45 mm apart"),
]


@pytest.mark.parametrize(("changes", "said"), CHANGES)
def test_what_does_not_fit_is_named_with_its_array(path, changes, said):
    with pytest.raises(AssetError, match=re.escape(said)) as caught:
        fio.load_model(write(path, changes))
    assert "\n" not in str(caught.value)


def test_objects_are_never_unpickled(path):
    class Trap:
        def __reduce__(self):
            return (pytest.fail, ("the file ran code",))

    stored: dict[str, Any] = {k: np.asarray(v) for k, v in (arrays() | {"name": Trap()}).items()}
    np.savez(path, **stored)
    with pytest.raises(AssetError, match="name is not a plain array"):
        fio.load_model(path)


def replace_member(path: Path, name: str, content: Callable[[bytes], bytes]) -> Path:
    """The small model with the bytes of one array replaced, compressed."""
    write(path)
    with zipfile.ZipFile(path) as archive:
        members = {info.filename: archive.read(info) for info in archive.infolist()}
    members[name] = content(members[name])
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for filename, data in members.items():
            archive.writestr(filename, data)
    return path


def header(shape: str, descr: str = "'<f8'") -> bytes:
    words = (
        f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}".encode().ljust(117)
        + b"\n"
    )
    return b"\x93NUMPY\x01\x00" + len(words).to_bytes(2, "little") + words


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (
            header("(1000000000000, 3)"),
            "mean claims shape (1000000000000, 3), the file holds 128 bytes",
        ),
        (header("(70, 3)"), "mean claims shape (70, 3)"),
        (header("(-1, 3)"), "mean is not a plain array"),
        (header("(70, 3)", "'|O'"), "mean is not a plain array"),
        (header("(70, 3)", "[('a', '<f8')]"), "mean is not a plain array"),
        (header("(" * 90), "mean is not a plain array"),
        (header("(0, 3)"), "mean has shape (0, 3)"),
        (header("(0, " + "9" * 50 + ")"), "mean has shape (0, 999"),
        (b"\x93NUMPY\x02\x00" + bytes(100), "mean is not a plain array"),
        (b"", "mean is not a plain array"),
        (b"\x93NUMPY\x01\x00\xff\xff", "mean is not a plain array"),
    ],
)
def test_a_header_that_lies_is_refused_before_anything_is_allocated(path, content, said):
    replace_member(path, "mean.npy", lambda _: content)
    with pytest.raises(AssetError, match=re.escape(said)):
        fio.load_model(path)


def test_a_bomb_is_refused_by_the_zip_directory(path):
    # 600 MB of zeros in 600 kB; written in pieces, so that the test itself stays small
    n = MAX_BYTES // 8 + 1
    write(path, {"modes": None})
    with (
        zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive,
        archive.open("modes.npy", "w") as member,
    ):
        member.write(header(f"(1, {n}, 3)", "'|i1'"))
        for _ in range(3):
            member.write(bytes(n))
    assert path.stat().st_size < 1 << 20
    with pytest.raises(AssetError, match=r"small\.npz: unpacks to 15\d\d MB; 512 MB are accepted"):
        fio.load_model(path)


def test_a_thousand_subjects_of_a_large_surface_are_refused(path):
    # 8 bytes a subject in the file would become 24 bytes a vertex each
    n, people = 60_000, 1_000
    one = np.zeros((1, 3), np.int16)
    changes = {
        "mean": one, "modes": one[None], "mode_step": [1.0], "coarse_faces": None, "colours": None, "occlusion": None,
        "evaluation": None, "regions": None, "subject_colours": None, "subject_names": None, "subject_notes": None,
        "subdivision_indptr": np.arange(n + 1), "subdivision_indices": np.zeros(n, int), "subdivision_data": np.ones(n),
        "subjects": np.zeros((people, 1, 3), np.int16),
    }  # fmt: skip
    with pytest.raises(AssetError, match=r"surfaces of 60000 vertices take 13.. MB"):
        fio.load_model(write(path, changes))


def test_a_name_cannot_lead_out_of_the_folder(tmp_path):
    (tmp_path / "inside" / "schemes").mkdir(parents=True)
    (tmp_path / "outside_ibug68.csv").write_text("not a scheme")
    path = write(tmp_path / "inside" / "a.npz", {"name": "../../outside"})
    assert list(fio.load_model(path).schemes) == ["ibug68", "mediapipe"]


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> tuple[Path, bytes, FaceModel]:
    path = write(tmp_path_factory.mktemp("damage") / "small.npz")
    return path, path.read_bytes(), fio.load_model(path, origin="file")


@given(data=st.data())
def test_any_damage_is_one_line_or_does_no_harm(whole, data):
    path, content, model = whole
    damaged = bytearray(content)
    if data.draw(st.booleans(), label="cut"):
        damaged = damaged[: data.draw(st.integers(0, len(content) - 1), label="length")]
    for _ in range(data.draw(st.integers(0, 3), label="bytes changed")):
        if damaged:
            damaged[data.draw(st.integers(0, len(damaged) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(damaged)
    said, read = "", None
    try:
        read = fio.load_model(path, origin="file")
    except AssetError as error:
        said = str(error)
    assert "\n" not in said
    # a byte that nobody reads does no harm
    assert read is None or np.array_equal(read.mean, model.mean)


@given(data=st.data())
def test_any_bytes_inside_an_array_are_refused_or_make_a_finite_face(whole, data):
    # the zip is sound, so that the checks behind its checksums are met
    path, content, _ = whole
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = {info.filename: bytearray(archive.read(info)) for info in archive.infolist()}
    for _ in range(data.draw(st.integers(1, 4))):
        member = members[data.draw(st.sampled_from(sorted(members)))]
        member[data.draw(st.integers(0, len(member) - 1))] = data.draw(st.integers(0, 255))
    with zipfile.ZipFile(path, "w") as archive:
        for filename, changed in members.items():
            archive.writestr(filename, bytes(changed))
    said, read = "", None
    try:
        read = fio.load_model(path)
    except AssetError as error:
        said = str(error)
    assert "\n" not in said
    assert read is None or np.isfinite(read.vertices(np.ones(S))).all()


@pytest.mark.parametrize("content", [b"", b"PK\x05\x06" + bytes(18), b"GIF89a", b"v 0 0 0\n"])
def test_other_files_are_not_models(path, content):
    path.write_bytes(content)
    with pytest.raises(
        AssetError,
        match=r"not a model; an ICT-FaceKit folder .* or a file of faceambig, Basel, .* is accepted",
    ):
        fio.load_model(path)


def test_a_missing_path_is_named(tmp_path):
    with pytest.raises(AssetError, match=r"nowhere\.npz: no such file or folder"):
        fio.load_model(tmp_path / "nowhere.npz")
    with pytest.raises(AssetError, match="not a model"):
        fio.load_model(tmp_path)


def test_another_npz_is_not_a_model(path):
    np.savez(path, x=np.zeros(3))
    with pytest.raises(AssetError, match="not a model"):
        fio.load_model(path)
    buffer = io.BytesIO()
    np.save(buffer, np.zeros(3))
    path.write_bytes(buffer.getvalue())
    with pytest.raises(AssetError, match="not a model"):
        fio.load_model(path)


# The embedded head


def test_the_embedded_head_is_complete(embedded):
    assert embedded.name == "embedded"
    assert embedded.n_modes == 100
    assert len(embedded.subjects) == 10
    assert list(embedded.schemes) == ["ibug68", "farkas", "mediapipe"]
    assert "CC0" in embedded.licence
    assert embedded.evaluation is not None
    assert len(embedded.evaluation) > 9_000  # the front of the head (HEAD.md 7)
    assert embedded.control_modes.flags.c_contiguous
    assert embedded.coarse_faces is not None
    assert embedded.coarse_faces.max() < len(embedded.control_mean)
    assert {"nose", "mouth", "ears"} <= set(embedded.regions)
    assert sum(len(vertices) for vertices in embedded.regions.values()) == embedded.n_vertices


def test_the_embedded_heads_control_vertices_are_its_first_surface_vertices(embedded):
    # what coarse_faces and a landmark on either mesh rely on: same vertex, smoothed by the subdivision
    moved = np.linalg.norm(
        embedded.mean[: len(embedded.control_mean)] - embedded.control_mean, axis=1
    )
    assert np.median(moved) < 1e-3


def test_the_origin_of_the_embedded_head_is_between_its_eyes(embedded):
    corners = embedded.mean[embedded.scheme("ibug68").vertices[[36, 39, 42, 45]]]
    assert np.abs(corners.mean(axis=0)).max() < 1e-16
    assert np.abs(embedded.file_origin).max() < 1e-5  # it is stored so, to rounding


@pytest.mark.parametrize("name", ["ibug68", "farkas"])
def test_right_is_the_subjects_right(embedded, name):
    scheme = embedded.scheme(name)
    x = embedded.mean[scheme.vertices, 0]
    side = np.array(scheme.sides)
    assert (x[side == "right"] < 0).all()
    assert (x[side == "left"] > 0).all()
    assert np.abs(x[side == "mid"]).max() < 1e-4
    right, left = scheme.eyes
    assert set(side[list(right)]) == {"right"}
    assert set(side[list(left)]) == {"left"}


def test_the_eyes_of_both_schemes_are_the_same_vertices(embedded):
    ibug, farkas = (embedded.scheme(name) for name in ("ibug68", "farkas"))
    for of_ibug, of_farkas in zip(ibug.eyes, farkas.eyes, strict=True):
        assert set(ibug.vertices[list(of_ibug)]) == set(farkas.vertices[list(of_farkas)])
    assert ibug.eyes == ((36, 39), (42, 45))
    assert ibug.eyes_meaning == "mean of the two corners of each eye (37+40, 43+46)"


def test_the_subjects_are_faces_of_the_mean(embedded):
    # out-of-sample people: millimetres to a centimetre and a half from the mean, never the mean itself
    for subject in embedded.subjects:
        difference = surface_difference(subject.vertices, embedded.mean, embedded.evaluation)
        assert 1e-3 < difference.mean < 15e-3
        assert subject.colours is not None
        assert subject.colours.shape == (embedded.n_vertices, 3)


def test_the_embedded_head_survives_saving(embedded, tmp_path):
    fio.save_model(embedded, tmp_path / "head.npz")
    again = fio.load_model(tmp_path / "head.npz")
    # moved by the rounding of its own eye centre once more
    assert np.abs(again.mean - embedded.mean).max() < 1e-15
    assert np.array_equal(again.control_modes, embedded.control_modes)
    assert list(again.schemes) == list(embedded.schemes)
