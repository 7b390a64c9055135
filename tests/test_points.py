"""How points are written in files: CSV with a header and JSON of every usual shape; damage is named."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import faceambig.io as fio
from faceambig.errors import AssetError
from faceambig.io.points import parse_points

XY = np.round(np.random.default_rng(3).uniform(50, 600, (68, 2)), 4)
MESH = np.random.default_rng(4).uniform(0.2, 0.8, (478, 3))
PAIRS = XY.tolist()


def table(header: str, rows: list[str]) -> str:
    return "\n".join([header, *rows]) + "\n"


CSV = table("x,y", [f"{x},{y}" for x, y in PAIRS])


@pytest.mark.parametrize(
    "text",
    [
        CSV,
        CSV.replace(",", ";"),
        CSV.replace(",", "\t"),
        CSV.replace("\n", "\r\n"),
        CSV.replace("x,y", " X , Y "),
        CSV.replace(",", " , "),
        "\ufeff# a remark\n\n" + CSV,
        table("y,x", [f"{y},{x}" for x, y in PAIRS]),
        table("x,y,z,visibility", [f"{x},{y},0.1,1" for x, y in PAIRS]),
        table("frame,x,y,text", [f'7,{x},{y},"with, comma"' for x, y in PAIRS]),
        table('"x","y"', [f'"{x}","{y}"' for x, y in PAIRS]),
    ],
    ids=range(11),
)
def test_a_table_with_x_and_y_is_read_by_its_header(text, tmp_path):
    (tmp_path / "a.csv").write_bytes(text.encode())
    found = parse_points(fio.files.text_of(tmp_path / "a.csv"), "a.csv")
    assert np.array_equal(found.xy, XY)
    assert found.names is None


@pytest.mark.parametrize("column", ["name", "Point", "landmark", "id", "INDEX"])
def test_a_column_names_the_points(column):
    names = [f"p{k}" for k in range(68)]
    rows = [f"{x},{name},{y}" for name, (x, y) in zip(names, PAIRS, strict=True)]
    found = parse_points(table(f"x,{column},y", rows), "a.csv")
    assert found.names == tuple(names)
    assert np.array_equal(found.xy, XY)


def test_a_side_is_part_of_the_name_as_in_a_scheme():
    text = "name,side,x,y\nex,right,1,2\nex,left,3,4\nn,mid,5,6\n37,right,7,8\n"
    assert parse_points(text, "a.csv").names == ("ex_r", "ex_l", "n", "37")


@pytest.mark.parametrize("row", ["3,,", "3,nan,NaN", "3, , "])
def test_empty_cells_are_a_missing_point(row):
    found = parse_points(f"name,x,y\n1,1,2\n{row}\n4,5,6\n", "a.csv")
    assert np.array_equal(found.xy, [[1, 2], [np.nan, np.nan], [5, 6]], equal_nan=True)
    assert found.names == ("1", "3", "4")


def openface(rows: int = 1) -> str:
    """Columns as OpenFace names them: pixels in small letters, millimetres in capitals."""
    header = ["frame", " confidence"]
    header += [f" {letter}_{k}" for letter in "xyXYZ" for k in range(68)]
    cells = ["1", "0.98", *map(str, XY.T.ravel().tolist()), *["9.0"] * 204]
    return table(",".join(header), [", ".join(cells)] * rows)


def test_a_row_of_openface_is_a_face():
    found = parse_points(openface(), "a.csv")
    assert np.array_equal(found.xy, XY)
    with pytest.raises(AssetError, match=r"a\.csv: 2 rows of a face each; keep one"):
        parse_points(openface(2), "a.csv")
    with pytest.raises(AssetError, match=r"line 2 of a\.csv: 343 cells, the header has 342"):
        parse_points(openface().rstrip() + ",1\n", "a.csv")
    broken = openface().replace(f" {PAIRS[5][1]},", " x,", 1)
    with pytest.raises(AssetError, match=r"line 2 of a\.csv, point 5: expected two numbers"):
        parse_points(broken, "a.csv")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x,y\n1,2\n3\n", "line 3 of a.csv: 1 cells, the header has 2"),
        ("x,y\n1,2\n3,4,5\n", "line 3 of a.csv: 3 cells, the header has 2"),
        ("# r\nx,y\n\n1,2\n3,four\n", "line 5 of a.csv: expected two numbers, found '3 four'"),
        ("x,y\n1,\n", "line 2 of a.csv: expected two numbers, found '1 '"),
        ("x,y\n1,nan\n", "line 2 of a.csv: expected two numbers, found '1 nan'"),
        ("x,y\ninf,1\n", "line 2 of a.csv: expected two numbers, found 'inf 1'"),
        ("x;y\n1,5;2\n", "line 2 of a.csv: expected two numbers, found '1,5 2'"),
        ("name,x,y\nn,1,2\nn,3,4\n", "line 3 of a.csv: point 'n' is named twice"),
        ("name,side,x,y\nex,left,1,2\nex_l,mid,3,4\n", "line 3 of a.csv: point 'ex_l' is named twice"),
        ("name,x,y\nn,1,2\n,3,4\n", "line 3 of a.csv: the point has no name"),
        ("x,y\n" + "1,2\n" * 10_001, "a.csv: more than 10000 points"),
        ("x,y\n1," + "2" * 200_000, "line 2 of a.csv: 0 cells, the header has 2"),
        ("x,z\n1,2\n", "a.csv: not a landmark file; .pts (300-W), CSV with a header (x,y or"),
        ("1,2\n3,4\n", "a.csv: not a landmark file"),
        ("# only remarks\n", "a.csv: not a landmark file"),
    ],
)  # fmt: skip
def test_damage_in_a_table_is_named_with_its_line(text, said):
    with pytest.raises(AssetError, match=re.escape(said)) as caught:
        parse_points(text, "a.csv")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 120


# JSON


def objects(points: np.ndarray, **more: object) -> list[dict[str, Any]]:
    return [{**dict(zip("xyz", p, strict=False)), **more} for p in points.tolist()]


# Each: what a program writes of 478 points with z
SHAPES: dict[str, Any] = {
    "triples": MESH.tolist(),
    "flat": MESH.ravel().tolist(),
    "objects": objects(MESH),
    "one face in a list": [MESH.tolist()],
    "Face Landmarker, Python": {"face_landmarks": [objects(MESH, visibility=0.0, presence=0.0)]},
    "Face Landmarker, web": {"faceLandmarks": [objects(MESH)], "faceBlendshapes": [], "other": {"x": 1}},
    "Face Mesh, Python": {"multi_face_landmarks": [{"landmark": objects(MESH)}]},
    "Face Mesh, one face": {"landmark": objects(MESH)},
    "Face Mesh, web": {"multiFaceLandmarks": [objects(MESH)], "image": None},
    "tfjs": [{"box": {"xMin": 1, "width": 9}, "keypoints": objects(MESH[:10], name="lips") + objects(MESH[10:])}],
    "tfjs, older": [{"faceInViewConfidence": 1, "scaledMesh": MESH.tolist(), "mesh": MESH.tolist()}],
    "holistic": {"face_landmarks": {"landmark": objects(MESH)}, "pose_landmarks": {"landmark": objects(MESH[:33])}},
    "landmarks": {"landmarks": MESH.tolist(), "width": 640},
}  # fmt: skip


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("indent", [None, 1])
def test_every_usual_shape_of_a_face_mesh_is_read(name, indent):
    found = parse_points(json.dumps(SHAPES[name], indent=indent), "a.json")
    assert np.array_equal(found.xy, MESH[:, :2])
    assert found.names is None


@pytest.mark.parametrize("count", [51, 68])
@pytest.mark.parametrize("shape", ["pairs", "flat pairs", "flat triples", "in a key", "[[face]]"])
def test_plain_lists_of_ibug_points_are_read(count, shape):
    points = np.column_stack([XY, np.zeros(68)])[:count]
    value = {
        "pairs": points[:, :2].tolist(),
        "flat pairs": points[:, :2].ravel().tolist(),
        "flat triples": points.ravel().tolist(),
        "in a key": {"points": points.tolist()},
        "[[face]]": [[points.tolist()]],
    }[shape]
    assert np.array_equal(parse_points(json.dumps(value), "a.json").xy, XY[:count])


def test_missing_points_are_null_or_nan():
    text = '[[1, 2], null, [null, null], [NaN, NaN], {"x": null, "y": null}, {"x": 3, "y": 4}]'
    nan = [np.nan, np.nan]
    wanted = [[1, 2], nan, nan, nan, nan, [3, 4]]
    assert np.array_equal(parse_points(text, "a.json").xy, wanted, equal_nan=True)


@pytest.mark.parametrize("key", ["name", "point", "index"])
def test_names_count_if_every_point_has_one(key):
    named = [{key: f"p{k}", "x": x, "y": y} for k, (x, y) in enumerate(PAIRS)]
    found = parse_points(json.dumps({"scheme": "farkas", "points": named}), "a.json")
    assert (found.names, found.scheme) == (tuple(f"p{k}" for k in range(68)), "farkas")
    del named[3][key]
    assert parse_points(json.dumps(named), "a.json").names is None
    by_name = {f"p{k}": pair for k, pair in enumerate(PAIRS)}
    found = parse_points(json.dumps({"image_size": [640, 480], "points": by_name}), "a.json")
    assert (found.names, found.image_size) == (tuple(by_name), (640, 480))
    assert np.array_equal(found.xy, XY)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[[1, 2],\n [3, 4\n", "line 3 of a.json: not JSON (Expecting ',' delimiter, column 1)"),
        ("[[1, 2],\n [3, 4],\n [x, 1]]", "line 3 of a.json: not JSON (Expecting value, column 3)"),
        ('{"points": [[1, 2]]} tail', "line 1 of a.json: not JSON (Extra data, column 22)"),
        ("[" * 200_000, "a.json: not JSON that can be read (RecursionError)"),
        ("[" + "9" * 5000 + "]", "a.json: not JSON that can be read (ValueError)"),
        ("[[1, 2], [3, " + "9" * 400 + "]]", "point 2 of a.json: expected two numbers, found '3 999"),
        ('[[1, 2], [3, "x"]]', "point 2 of a.json: expected two numbers, found [3, 'x']"),
        ("[[1, 2], [3, null]]", "point 2 of a.json: expected two numbers, found [3, None]"),
        ("[[1, 2], [3, NaN]]", "point 2 of a.json: expected two numbers, found '3 nan'"),
        ("[[1, 2], [Infinity, 3]]", "point 2 of a.json: expected two numbers, found 'inf 3'"),
        ("[[1, 2], [true, 3]]", "point 2 of a.json: expected two numbers, found [True, 3]"),
        ("[[1, 2], [3]]", "point 2 of a.json: expected two numbers, found [3]"),
        ("[[1, 2], 3]", "point 2 of a.json: expected two numbers, found 3"),
        ('[{"x": 1, "y": 2}, {"x": 3}]', "point 2 of a.json: expected two numbers, found {'x': 3}"),
        ('{"points": {"n": [1, 2], "sn": "x"}}', "point 2 of a.json: expected two numbers, found 'x'"),
        ('[{"name": "n", "x": 1, "y": 2}, {"name": "n", "x": 3, "y": 4}]', "point 2 of a.json: 'n' is named twice"),
        ('{"points": {"n": [1, 2], "n": [3, 4]}}', "a.json: 'n' is given twice"),
        ("[[[1, 2], [3, 4]], [[1, 2], [3, 4]]]", "a.json: 2 faces; keep one"),
        ('{"multi_face_landmarks": [{"landmark": []}, {"landmark": []}]}', "a.json: 2 faces; keep one"),
        ('{"faceLandmarks": []}', None),  # no face: 0 points, refused by their number
        ("{}", "a.json: no points; a list of [x, y] below 'points' is accepted"),
        ('{"image_size": [640, 480]}', "a.json: no points"),
        ('{"points": 3}', "a.json: expected a list of points, found 3"),
        ('["a", "b"]', "a.json: expected a list of points, found 'a'"),
        ("[[[[[[[[1, 2]]]]]]]]", "a.json: no points"),
        ("[1, 2, 3]", "a.json: a list of 3 numbers; x, y of 68, 51, 468 or 478 points are accepted"),
        ("[" + "[1,2]," * 10_000 + "[1,2]]", "a.json: more than 10000 points"),
    ],
)  # fmt: skip
def test_damage_in_json_is_named(text, said):
    if said is None:
        assert parse_points(text, "a.json").xy.shape == (0, 2)
        return
    with pytest.raises(AssetError, match=re.escape(said)) as caught:
        parse_points(text, "a.json")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 150


@given(
    value=st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=3),
        lambda inner: (
            st.lists(inner, max_size=4)
            | st.dictionaries(
                st.sampled_from(
                    [
                        "x",
                        "y",
                        "points",
                        "landmark",
                        "faceLandmarks",
                        "name",
                        "scheme",
                        "image_size",
                    ]
                ),
                inner,
                max_size=4,
            )
        ),
        max_leaves=20,
    )
)
def test_any_json_is_points_or_one_line(value):
    said, found = "", None
    try:
        found = parse_points(json.dumps(value), "a.json")
    except AssetError as error:
        said = str(error)
    assert "\n" not in said
    assert len(said) < 200
    if found is not None:
        assert found.xy.ndim == 2
        assert found.xy.shape[1] == 2
        assert found.names is None or len(set(found.names)) == len(found.xy)
        assert not np.isinf(found.xy).any()


@given(data=st.data())
def test_any_changed_characters_of_a_file_are_one_line_or_points(tmp_path_factory, data):
    shape = data.draw(st.sampled_from(["csv", "json", "openface"]))
    text = list(
        {"csv": CSV, "json": json.dumps({"points": PAIRS}, indent=0), "openface": openface()}[shape]
    )
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(text) - 1))
        text[at] = data.draw(st.sampled_from(list('0 1.-e}{[]"\n,:nax\x00\u00e9')))
    file: Path = tmp_path_factory.getbasetemp() / f"changed.{shape}"
    file.write_text("".join(text), encoding="utf-8")
    said = ""
    try:
        read = fio.load_landmarks(file)
    except AssetError as error:
        said = str(error)
    else:
        assert read.points.shape == (68, 2)
        assert not np.isinf(read.points).any()
    assert "\n" not in said
