"""Landmark schemes of models: their files, those of ICT-FaceKit, and MediaPipe's mesh on every model."""

from __future__ import annotations

import csv
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import faceambig as fa
import faceambig.io as fio
from faceambig.errors import AssetError
from faceambig.io.between import points_between
from faceambig.io.schemes import (
    check_scheme,
    ibug68_sides,
    load_scheme,
    mediapipe_scheme,
    mesh_of_ibug68,
    schemes_in,
)

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data" / "landmark-maps"


def written(file: Path, data: bytes) -> Path:
    file.write_bytes(data)
    return file


SCHEME = """# a remark, with, commas
name,side,vertex,definition,confidence
n,mid,3,"root, of the nose",high

ex,right,0,corner,low
ex,left,1,corner,low
en,right,2,corner,low
en,left,4,corner,low
"""


@pytest.fixture
def table(tmp_path) -> Path:
    return written(tmp_path / "small_farkas.csv", SCHEME.encode())


def test_a_point_of_both_sides_is_named_by_its_side(table):
    scheme = load_scheme(table, "farkas")
    assert scheme.name == "farkas"
    assert scheme.points == ("n", "ex_r", "ex_l", "en_r", "en_l")
    assert scheme.vertices.tolist() == [3, 0, 1, 2, 4]
    assert scheme.sides == ("mid", "right", "left", "right", "left")
    assert scheme.eyes == ((1, 3), (4, 2))
    assert scheme.eyes_meaning == "mean of the outer and inner corner of each eye (ex, en)"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "name,side",
            "name;side",
            "small_farkas.csv: expected the columns name, side, vertex, found name;side,vertex",
        ),
        (SCHEME, "", "small_farkas.csv: expected the columns name, side, vertex, found "),
        (
            "ex,right,0",
            "ex,west,0",
            "line 5 of small_farkas.csv: expected a side (right, left, mid) and a vertex number",
        ),
        (
            "ex,right,0",
            "ex,right,-1",
            "line 5 of small_farkas.csv: expected a side (right, left, mid) and a vertex",
        ),
        ("ex,right,0", "ex,right,1.5", "found 'right', '1.5'"),
        ("ex,right,0", "ex,right", "line 5 of small_farkas.csv: 4 cells, the header has 5"),
        ("ex,right,0", "x" * 200_000, "line 5 of small_farkas.csv: 0 cells, the header has 5"),
        ("ex,left", "ex,right", "small_farkas.csv: point 'ex_r' is named twice"),
        ("en,", "em,", "small_farkas.csv: no eye corners among the points"),
    ],
)
def test_a_damaged_scheme_is_named_with_its_line(table, old, new, said):
    table.write_text(SCHEME.replace(old, new))
    with pytest.raises(AssetError, match=re.escape(said)):
        load_scheme(table, "farkas")


def test_a_vertex_that_the_model_lacks_is_refused(table):
    scheme = load_scheme(table, "farkas")
    assert check_scheme(scheme, 5, table.name) is scheme
    with pytest.raises(AssetError, match=r"small_farkas\.csv: vertex 4 is not within 0 to 3"):
        check_scheme(scheme, 4, table.name)


def test_a_folder_holds_the_schemes_of_a_model(table):
    folder = table.parent
    written(folder / "small_ibug68.csv", table.read_bytes())
    written(folder / "smaller_a.csv", b"another model's")
    found = schemes_in(folder, "small", 5)
    assert [(name, scheme.name) for name, scheme in found.items()] == [
        ("ibug68",) * 2,
        ("farkas",) * 2,
    ]
    with pytest.raises(AssetError, match=r"small_ibug68\.csv: vertex 4 is not within 0 to 3"):
        schemes_in(folder, "small", 4)


# The schemes of ICT-FaceKit; without its files their numbers, with them their places


def ict_schemes() -> dict[str, fa.Scheme]:
    return schemes_in(fio.asset_path("schemes"), "ict", 9_409)


def test_ict_has_three_schemes_of_the_face_part():
    schemes = ict_schemes()
    assert {name: len(scheme) for name, scheme in schemes.items()} == {
        "ibug68": 68,
        "farkas": 33,
        "jawline": 68,
    }
    ibug, jawline, farkas = schemes["ibug68"], schemes["jawline"], schemes["farkas"]
    assert (jawline.points, jawline.sides, jawline.eyes) == (ibug.points, ibug.sides, ibug.eyes)
    other = np.flatnonzero(ibug.vertices != jawline.vertices)
    assert set(other) <= {*range(8), *range(9, 17)}  # the chin and the face within stay
    same = {
        "n": 28, "prn": 31, "sn": 34, "ls": 52, "li": 58, "ex_r": 37, "en_r": 40, "en_l": 43, "ex_l": 46,
        "cph_r": 51, "cph_l": 53, "ch_r": 49, "ch_l": 55,
    }  # fmt: skip
    for name, number in same.items():
        assert farkas.vertices[farkas.points.index(name)] == ibug.vertices[number - 1], name


@pytest.mark.skipif(not SHARED.is_dir(), reason="no tables in ../shared/data/landmark-maps")
def test_the_numbers_are_those_of_the_tables():
    schemes = ict_schemes()
    table = rows_of(SHARED / "ict_farkas_part.csv")
    assert {name: vertex for name, _, vertex in schemes["farkas"].rows()} == {
        row["point"]: int(row["vertex"]) for row in table
    }
    table = rows_of(SHARED / "ict_ibug68.csv")
    for name, variants in (("ibug68", ("default",)), ("jawline", ("default", "jawline"))):
        wanted = {
            row["point"]: int(row["vertex"])
            for v in variants
            for row in table
            if row["variant"] == v
        }
        assert {point: vertex for point, _, vertex in schemes[name].rows()} == wanted
    mesh = {}
    for variant in ("published", "better"):
        for row in rows_of(SHARED / "mediapipe478_ibug68.csv"):
            if row["variant"] == variant:
                mesh[row["point"]] = tuple(
                    int(row[k]) for k in ("landmark_a", "landmark_b") if row[k]
                )
    assert mesh_of_ibug68() == tuple(mesh[str(k)] for k in range(1, 69))


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def test_the_schemes_of_ict_lie_where_they_say(ict):
    assert list(ict.schemes) == ["ibug68", "farkas", "jawline", "mediapipe"]
    for scheme in ict.schemes.values():
        place = dict(zip(scheme.points, 1000 * ict.mean[scheme.vertices], strict=True))
        x = np.array([p[0] for p in place.values()])
        side = np.array(scheme.sides)
        assert (x[side == "right"] < 0).all()
        assert (x[side == "left"] > 0).all()
        assert np.abs(x[side == "mid"]).max() < 0.1  # the mesh is symmetric to 0.006 mm
        right, left = (
            np.mean([place[scheme.points[k]] for k in eye], axis=0) for eye in scheme.eyes
        )
        assert np.abs(right * [-1, 1, 1] - left).max() < 0.01
    farkas = ict.scheme("farkas")
    place = dict(zip(farkas.points, 1000 * ict.mean[farkas.vertices], strict=True))
    for name in (name for name in place if name.endswith("_r")):
        assert np.abs(place[name] * [-1, 1, 1] - place[f"{name[:-1]}l"]).max() < 0.01, name
    top = min(place["sa_r"][1], place["obs_r"][1])  # within half a millimetre of one height
    assert top > place["t_r"][1] > place["obi_r"][1] > place["sba_r"][1]
    assert place["g"][1] > place["n"][1] > place["prn"][1] > place["sn"][1] > place["ls"][1]
    assert place["li"][1] > place["sl"][1] > place["pg"][1] > place["gn"][1]
    jaw, behind = (ict.mean[ict.scheme(name).vertices[:8]] for name in ("ibug68", "jawline"))
    assert (behind[:6, 2] < jaw[:6, 2]).all()  # 7 and 8 are shared with ibug68


# MediaPipe's mesh


def test_the_mesh_is_mirrored_as_ibug_is():
    # left and right of the mesh by number: no rule, so the pairs of its corners and wings are named
    rows = dict(zip(range(1, 69), mesh_of_ibug68(), strict=True))
    assert (rows[37], rows[46]) == ((33,), (263,))
    assert (rows[32], rows[36]) == ((98,), (327,))
    assert (rows[4], rows[14]) == ((132, 58), (361, 288))
    numbers = [k for row in rows.values() for k in row]
    assert 0 <= min(numbers) <= max(numbers) < 468  # in the mesh without irises too
    assert len(set(rows.values())) == 68


@pytest.mark.parametrize("name", ["embedded", "ict"])
def test_every_model_has_the_mesh_by_its_numbers(name, request):
    model = request.getfixturevalue(name)
    scheme, ibug = model.scheme("mediapipe"), model.scheme("ibug68")
    assert (scheme.name, len(scheme)) == ("mediapipe", 50)
    place = dict(zip(scheme.points, scheme.vertices.tolist(), strict=True))
    assert place["4"] == ibug.vertices[30]
    assert place["263"] == ibug.vertices[45]
    assert "168" not in place  # half of point 28
    assert "152" not in place  # the chin is on the outline
    sides = dict(zip(scheme.points, scheme.sides, strict=True))
    assert (sides["33"], sides["263"], sides["4"]) == ("right", "left", "mid")
    assert [scheme.points[k] for eye in scheme.eyes for k in eye] == ["33", "133", "362", "263"]


def test_a_raw_mesh_can_be_fitted_by_its_numbers(embedded):
    face, scheme = embedded.subject(2), embedded.scheme("mediapipe")
    view = fa.observe(face, distance=0.5, scheme="mediapipe")
    mesh = np.zeros((478, 2))
    mesh[[int(name) for name in scheme.points]] = view.points
    rows = [int(name) for name in scheme.points]
    fit = fa.fit(embedded, fa.Observation(mesh[rows], "mediapipe", view.image_size), distance=0.5)
    assert fit.converged
    assert fit.d_l_percent < 1
    assert "MediaPipe's 33+133" in fit.interocular_meaning


def test_a_model_without_eye_corners_gets_no_mesh(embedded):
    whole = embedded.scheme("ibug68")
    blind = replace(whole, points=tuple("?" if point == "37" else point for point in whole.points))
    assert mediapipe_scheme(blind) is None


@pytest.mark.parametrize("name", ["embedded", "ict"])
def test_schemes_survive_a_file(tmp_path, name, request):
    model = request.getfixturevalue(name)
    small = replace(model.truncate(2), subjects=())  # schemes are the matter, not megabytes
    fio.save_model(small, tmp_path / "again.npz")
    again = fio.load_model(tmp_path / "again.npz")
    assert list(again.schemes) == list(model.schemes)
    for before, after in zip(model.schemes.values(), again.schemes.values(), strict=True):
        assert after.rows() == before.rows()
        assert (after.name, after.eyes, after.eyes_meaning) == (
            before.name,
            before.eyes,
            before.eyes_meaning,
        )


def test_a_files_own_mediapipe_stays(tmp_path, embedded):
    own = replace(embedded.scheme("mediapipe"), vertices=np.arange(50))
    schemes = {"ibug68": embedded.scheme("ibug68"), "mediapipe": own}
    fio.save_model(replace(embedded.truncate(2), subjects=(), schemes=schemes), tmp_path / "a.npz")
    assert fio.load_model(tmp_path / "a.npz").scheme("mediapipe").rows() == own.rows()


def test_the_documents_counts_and_lines_are_so(embedded, ict):
    text = (Path(__file__).resolve().parents[1] / "docs" / "landmarks.md").read_text("utf-8")
    rows = re.findall(r"^\| `(\w+)` \| *(\d*) *\| *(\d*) *\|", text, re.MULTILINE)
    for column, model in ((1, embedded), (2, ict)):
        said = {row[0]: int(row[column]) for row in rows if row[column]}
        assert said == {name: len(scheme) for name, scheme in model.schemes.items()}
    (code,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    names = {"fa": fa, "model": embedded, "mesh": np.random.default_rng(1).uniform(1, 99, (478, 2))}
    found: dict[str, Any] = names | {"width": 100, "height": 100}
    exec(code, found)
    assert (
        found["obs"].vertices(embedded).tolist() == embedded.scheme("mediapipe").vertices.tolist()
    )


@pytest.mark.skipif(not SHARED.is_dir(), reason="no tables in ../shared/data/landmark-maps")
def test_the_numbers_on_other_models_are_those_of_the_tables():
    folder = fio.asset_path("schemes")
    for model, scheme, table, variant, count in (
        ("sfm", "ibug68", "sfm_ibug", "default", 50),
        ("bfm2009", "ibug68", "bfm2009_ibug", "anilbas", 68),
        ("bfm2009", "eos", "bfm2009_ibug", "eos", 18),
        ("bfm2017", "ibug68", "bfm2017_ibug", "model2017-1_bfm_nomouth", 26),
    ):
        wanted = {
            row["point"]: int(row["vertex"])
            for row in rows_of(SHARED / f"{table}.csv")
            if (row["scheme"], row["variant"]) == ("ibug68", variant)
        }
        found = load_scheme(folder / f"{model}_{scheme}.csv", scheme)
        assert {point: vertex for point, _, vertex in found.rows()} == wanted
        assert len(wanted) == count
    table = rows_of(SHARED / "flame_ibug68.csv")
    points = points_between(folder / "flame_ibug68.csv")
    assert points.points == tuple(row["point"] for row in table)
    assert points.corners.tolist() == [[int(row[f"v{k}"]) for k in range(3)] for row in table]
    assert points.weights.tolist() == [[float(row[f"b{k}"]) for k in range(3)] for row in table]


def test_both_sides_of_the_maps_of_other_models_mirror_each_other():
    sides = ibug68_sides()
    assert [point for point, side in sides.items() if side == "mid"] == [
        "9", "28", "29", "30", "31", "34", "52", "58", "63", "67",
    ]  # fmt: skip
    for file in ("sfm_ibug68", "bfm2009_ibug68", "bfm2009_eos", "bfm2017_ibug68", "flame_ibug68"):
        scheme = load_scheme(fio.asset_path(f"schemes/{file}.csv"), "ibug68")
        assert all(sides[point] == side for point, side, _ in scheme.rows()), file
        assert len(set(scheme.vertices.tolist())) == len(scheme), file
