"""States as files: what is read back is what is shown, and every file says where it comes from."""

from __future__ import annotations

import base64
import csv
import io
import json
import re
import zlib
from dataclasses import replace
from functools import partial
from hashlib import sha256

import numpy as np
import pytest

from faceambig.arrays import vertex_normals
from faceambig.compose import skin
from faceambig.io.meshes import linear
from faceambig_app import export, pipeline
from faceambig_app.export import player, standalone, tracks
from faceambig_app.export.packing import (
    TOLERANCE_MM,
    directions,
    packed,
    restored,
    rounded,
    step_of,
)
from faceambig_app.pipeline import faces, fits
from faceambig_app.pipeline import told as told_of
from faceambig_app.stage import heads
from faceambig_app.stage import stage as nodes
from faceambig_app.state import DEFAULT, ViewState, changed
from faceambig_app.state.forms import from_json, to_json
from faceambig_app.text import speaking
from scenes import need_renderer

STATE = ViewState(subject=3, distance=0.6, flex=((1, 1.5), (2, -0.5)), surface="difference")
KINDS = {"u1": "u1", "u2": "<u2", "u4": "<u4", "i2": "<i2", "i4": "<i4"}


def read_glb(data: bytes) -> tuple[dict, dict[str, np.ndarray]]:
    """The JSON and the four arrays of a GLB file of one mesh."""
    length = int.from_bytes(data[12:16], "little")
    tree = json.loads(data[20 : 20 + length])
    binary, names = data[28 + length :], tree["meshes"][0]["primitives"][0]
    found = {}
    for name, number in {**names["attributes"], "indices": names["indices"]}.items():
        view = tree["bufferViews"][number]
        part = binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
        kind = "<u4" if name == "indices" else "<f4"
        found[name] = np.frombuffer(part, kind).reshape(-1, 3)
    return tree, found


def read_ply(data: bytes) -> tuple[str, np.ndarray, np.ndarray, np.ndarray]:
    """Header, vertices, colours, faces."""
    header, _, body = data.partition(b"end_header\n")
    n, f = (int(k) for k in re.findall(rb"element \w+ (\d+)", header))
    vertices = np.frombuffer(body, [("xyz", "<f4", 3), ("rgb", "u1", 3)], count=n)
    faces = np.frombuffer(body[vertices.nbytes :], [("n", "u1"), ("corners", "<i4", 3)], count=f)
    return header.decode(), vertices["xyz"], vertices["rgb"], faces["corners"]


@pytest.mark.parametrize("face", ["fit", "true"])
def test_meshes_come_back_in_metres_and_in_the_colours_shown(face):
    (head,) = (h for h in pipeline.frame(STATE, with_curves=False).scene.heads if h.name == face)
    name, data = export.files(STATE, "ply", face=face)
    assert name == f"faceambig_subject3_30cm_as_60cm_{face}.ply"
    _, vertices, colours, faces = read_ply(data)
    np.testing.assert_allclose(vertices, head.vertices, atol=1e-6)
    np.testing.assert_array_equal(colours, head.colours)
    np.testing.assert_array_equal(faces, head.faces)

    rows = [line.split() for line in export.files(STATE, "obj", face=face)[1].decode().splitlines()]
    points = np.array([row[1:] for row in rows if row[0] == "v"], dtype=float)
    np.testing.assert_allclose(points[:, :3], head.vertices, atol=1e-6)
    np.testing.assert_array_equal(np.round(255 * points[:, 3:]), head.colours)

    _, parts = read_glb(export.files(STATE, "glb", face=face)[1])
    np.testing.assert_allclose(parts["POSITION"], head.vertices, atol=1e-6)
    np.testing.assert_allclose(parts["COLOR_0"], linear(head.colours), atol=1e-6)
    np.testing.assert_array_equal(parts["indices"], head.faces)


def test_fit_and_true_face_are_two_faces_and_the_difference_is_a_colour():
    own, truth = (read_ply(export.files(STATE, "ply", face=face)[1]) for face in ("fit", "true"))
    gaps = 1e3 * np.linalg.norm(own[1] - truth[1], axis=1)
    evaluation = fits.model("embedded").evaluation
    shown = faces.face(STATE.target, STATE.fitting, STATE.bend)
    assert gaps[evaluation].mean() == pytest.approx(shown.d_s_mm, abs=1e-3)  # aligned, so d_S
    plain = read_ply(export.files(changed(STATE, surface="skin", flex=()), "ply")[1])[2]
    subject = fits.photograph(STATE.target).subject
    np.testing.assert_array_equal(plain, skin(subject))
    assert (own[2] != plain).any()


def test_every_text_format_says_where_it_comes_from():
    wanted = (to_json(STATE), "CC0 1.0", "faceambig 0.1.0", "Model: embedded")
    for kind in ("ply", "obj", "csv"):
        head = export.files(STATE, kind)[1].decode("latin-1")[:3000]
        assert all(words in head for words in wanted), kind
    tree, _ = read_glb(export.files(STATE, "glb")[1])
    extras = "\n".join(tree["asset"]["extras"]["notes"])
    assert all(words in extras for words in wanted)
    record = json.loads(export.files(STATE, "json")[1])
    assert from_json(json.dumps(record["state"])) == STATE
    assert record["software"] == "faceambig 0.1.0"
    assert record["licence"].startswith("CC0")
    assert record["model"].startswith("embedded")


def test_pins_are_in_the_numbers_with_their_names_and_their_distances():
    pins = [changed(DEFAULT, distance=0.6), changed(DEFAULT, subject=3)]
    state = changed(DEFAULT, pins=pins, pin_names=["=1+1, \u05e9 \U0001f600"])
    one, two = json.loads(export.files(state, "json")[1])["pins"]
    kept = told_of.pins_of(state)
    assert (one["name"], two["name"]) == ("=1+1, \u05e9 \U0001f600", "Pin 2")
    assert [one["between_mm"], two["between_mm"]] == kept.d_s_mm.tolist()
    assert f"{two['d_s_mm']:.1f}\u202fmm" in kept.words[1]
    table = export.files(state, "csv")[1].decode()
    lines = [line for line in table.splitlines() if not line.startswith("#")]
    assert f"pin_between_mm,1-2,{one['between_mm'][1]},mm" in lines
    assert f"pin_d_l_percent,2,{two['d_l_percent']},%" in lines
    assert not any("1+1" in line for line in lines)  # a table's program would compute it
    assert "pins" not in json.loads(export.files(DEFAULT, "json")[1])
    for kind in ("csv", "json", "state", "ply", "obj", "glb"):  # all of them carry the state
        assert export.files(state, kind)[1].count(b"pin_names"), kind


def test_the_state_comes_back():
    name, data = export.files(STATE, "state")
    assert name == "faceambig_subject3_30cm_as_60cm_state.json"
    assert from_json(data) == STATE


def test_numbers_are_those_of_the_pipeline():
    record = json.loads(export.files(STATE, "json")[1])
    face = faces.face(STATE.target, STATE.fitting, STATE.bend)
    fit = face.fit
    assert record["d_l_percent"] == face.d_l_percent
    assert record["d_s_mm"] == face.d_s_mm
    assert record["distance_m"] == fit.distance == 0.6
    assert record["focal_px"] == fit.focal
    np.testing.assert_allclose(  # the bend is in it
        fit.model.vertices(record["alpha"]), face.own_vertices, atol=1e-12
    )
    curve = pipeline.plots_of(STATE)
    curves = record["curves"]
    np.testing.assert_array_equal(curves["distance_m"][:-1], curve.distances)
    assert curves["distance_m"][-1] is None
    np.testing.assert_array_equal(curves["d_l_percent"][:-1], curve.d_l_percent)
    np.testing.assert_array_equal(curves["d_s_mm"], [*curve.d_s_mm, curve.orthographic[1]])
    assert record["interval"]["tolerance_percent"] == curve.tolerance_percent
    assert min(curves["d_l_percent"]) >= record["interval"]["best_d_l_percent"] - 1e-9


@pytest.mark.parametrize(
    "changes",
    [
        {"camera": "orthographic"},
        {"data": "outline"},
        {"flex": ((1, 2.0),)},
        {"draw": 3, "flex": ((90, 2.0),)},  # a draw is not bent as well
        {"extreme": 1, "flex": ((1, 2.0),)},
    ],
)
def test_the_numbers_are_of_the_face_that_is_shown_and_the_table_has_a_line_for_each(changes):
    state = changed(ViewState(subject=3, distance=0.4), **changes)
    face = faces.face(state.target, state.fitting, state.bend)
    record = json.loads(export.files(state, "json")[1])
    np.testing.assert_allclose(
        face.fit.model.vertices(record["alpha"]), face.own_vertices, atol=1e-12
    )
    assert record["distance_m"] == face.camera.distance
    assert record["translation_m"][:2] == face.camera.t.tolist()
    lines = export.files(state, "csv")[1].decode().splitlines()
    rows = list(csv.reader(line for line in lines if not line.startswith("#")))
    for name in ("translation_m", "rotation", "alpha"):
        assert [float(row[2]) for row in rows if row[0] == name] == record[name]


def test_the_equivalent_lens_sees_the_same_diagonal():
    record = json.loads(export.files(STATE, "json")[1])
    size = fits.photograph(STATE.target).observation.image_size
    assert size is not None
    width, height = size
    film = 2 * np.arctan(np.hypot(36, 24) / 2 / record["focal_35mm"])
    assert film == pytest.approx(2 * np.arctan(np.hypot(width, height) / 2 / record["focal_px"]))
    far = json.loads(export.files(changed(STATE, camera="orthographic"), "json")[1])
    assert far["distance_m"] is far["focal_px"] is far["focal_35mm"] is None
    assert far["scale"] > 0


def test_the_table_holds_the_same_numbers_as_the_json():
    record = json.loads(export.files(STATE, "json")[1])
    name, data = export.files(STATE, "csv")
    assert name == "faceambig_subject3_30cm_as_60cm_numbers.csv"
    text = "".join(line for line in data.decode().splitlines(True) if not line.startswith("#"))
    rows = list(csv.DictReader(io.StringIO(text)))
    told = {(row["quantity"], row["at"]): (row["value"], row["unit"]) for row in rows}
    assert len(told) == len(rows)
    assert told["d_s_mm", ""] == (str(record["d_s_mm"]), "mm")
    assert told["interval_high_m", ""] == ("", "m")  # open at infinity
    assert told["translation_m", "z"] == ("0.6", "m")
    alpha = [float(told["alpha", str(i + 1)][0]) for i in range(len(record["alpha"]))]
    assert alpha == record["alpha"]
    curves = record["curves"]
    for at, d_l in zip(curves["distance_m"], curves["d_l_percent"], strict=True):
        key = ("curve_d_l_percent", "inf" if at is None else str(at))
        assert told[key] == (str(d_l), "%")


@pytest.mark.gl
def test_a_picture_is_the_snapshot_with_its_origin_in_it(monkeypatch):
    need_renderer()
    from PIL.PngImagePlugin import PngImageFile

    from faceambig.render import overlay

    small = partial(overlay.draw, width=480, height=300)
    monkeypatch.setattr(overlay, "draw", lambda scene, *_, **options: small(scene, **options))
    state = ViewState(subject=4, distance=0.6)
    name, data = export.files(state, "png")
    assert name == "faceambig_subject4_30cm_as_60cm.png"
    with PngImageFile(io.BytesIO(data)) as picture:
        assert picture.text["ViewState"] == to_json(state)
        assert picture.text["Software"] == "faceambig 0.1.0"
        assert picture.text["Licence"].startswith("CC0")
        pixels = np.asarray(picture)
    np.testing.assert_array_equal(pixels, export.snapshot(state)[..., :3])


def test_size_ground_and_own_photo_reach_the_renderer(monkeypatch):
    asked = []

    def drawn(scene, **options):
        asked.append((scene.photo.pixels is not None, options))
        return np.zeros((8, 8, 4), np.uint8)

    monkeypatch.setattr("faceambig.render.overlay.draw", drawn)
    with_own_photo(monkeypatch)
    export.files(STATE, "png")
    with speaking("de"):
        export.files(STATE, "png", scale=4, transparent=True, overlays=False, own_photo=True)
    said = [options.pop("words")["d_l"] for _, options in asked]
    assert said == ["Landmark error", "Landmarken-Fehler"]
    assert asked == [
        (False, {"scale": 1, "transparent": False, "overlays": True, "step": None}),
        (True, {"scale": 4, "transparent": True, "overlays": False, "step": None}),
    ]


LOUD = (10, 250, 30)  # no head and no background is of this green


def with_own_photo(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every scene has a photograph of one's own: all of one green."""
    frame = pipeline.frame

    def framed(state, **options):
        made = frame(state, **options)
        photo = made.scene.photo
        pixels = np.tile(np.array(LOUD, np.uint8), (photo.height, photo.width, 1))
        return replace(made, scene=replace(made.scene, photo=replace(photo, pixels=pixels)))

    monkeypatch.setattr(pipeline, "frame", framed)


def photo_of(html: str) -> np.ndarray:
    """(H, W, 3) sRGB of the photograph in a page."""
    import cv2

    data = re.search(r'src="data:image/jpeg;base64,([^"]+)"', html)
    assert data is not None
    raw = np.frombuffer(base64.b64decode(data[1]), np.uint8)
    picture = cv2.imdecode(raw, cv2.IMREAD_COLOR)
    assert picture is not None
    return picture[..., ::-1]


def test_the_page_leaves_an_own_photo_out_unless_asked(monkeypatch):
    monkeypatch.setattr(player, "STOPS", 3)
    with_own_photo(monkeypatch)
    for asked in (False, True):
        html = export.files(STATE, "html", own_photo=asked)[1].decode()
        green = np.abs(photo_of(html).astype(int) - LOUD).max(axis=2) < 30
        assert green.mean() == (1.0 if asked else 0.0)
        assert ("photograph is left out" in html) is not asked


@pytest.fixture(scope="module")
def html() -> str:
    name, data = export.files(ViewState(subject=3), "html")
    assert name == "faceambig_subject3_30cm_distance.html"
    assert len(data) < 1_500_000
    return data.decode()


def block(html: str, element: str) -> str:
    found = re.search(rf"<{element}>(.*?)</{element.split()[0]}>", html, re.DOTALL)
    assert found is not None
    return found[1]


def test_the_policy_allows_this_script_and_this_style_only(html):
    policy = re.search(r'Content-Security-Policy" content="([^"]+)"', html)
    assert policy is not None
    for element in ("script", "style"):
        digest = base64.b64encode(sha256(block(html, element).encode()).digest()).decode()
        assert f"{element}-src 'sha256-{digest}';" in policy[1]
    assert "default-src 'none'" in policy[1]
    assert "unsafe" not in policy[1]
    markup = html.replace(block(html, "script"), "").replace(block(html, "style"), "")
    assert not re.search(
        r"https?:|<link (?!rel=\"icon\" href=\"data:,\")|\son\w+=|\sstyle=", markup
    )
    assert not re.search(
        r"\beval\b|Function\(|fetch\(|XMLHttp|innerHTML|https?:", block(html, "script")
    )


def test_the_page_says_where_it_comes_from(html):
    state = to_json(ViewState(subject=3)).replace('"', "&quot;")
    assert f'<meta name="faceambig:viewstate" content="{state}">' in html
    assert "{{" not in html
    footer = html[html.index("<footer>") :]
    for words in ("faceambig 0.1.0", "CC0 1.0", state):
        assert words in footer


def unpacked(about: list[dict], text: str) -> dict[str, np.ndarray]:
    data, found, at = zlib.decompress(base64.b64decode(text)), {}, 0
    for part in about:
        kind = np.dtype(KINDS[part["kind"]])
        count = part["rows"] * part["columns"]
        rows = np.frombuffer(data, kind, count, at).reshape(part["rows"], part["columns"])
        found[part["name"]] = np.cumsum(rows, axis=1, dtype=kind)
        at += rows.nbytes
    assert at == len(data)
    return found


def test_arrays_come_back_from_the_text():
    rng = np.random.default_rng(1)
    arrays = {
        "a": rng.integers(-32768, 32768, (3, 50)).astype(np.int16),
        "b": rng.integers(0, 256, (2, 7)).astype(np.uint8),
        "c": rng.integers(0, 2**32, (1, 5)).astype(np.uint32),
    }
    found = unpacked(*packed(arrays))
    for name, array in arrays.items():
        np.testing.assert_array_equal(found[name], array)


def test_faces_of_the_page_are_those_of_the_pipeline(html):
    data = json.loads(block(html, 'script type="application/json" id="data"'))
    arrays = unpacked(data["arrays"], block(html, 'script type="text/plain" id="geometry"'))
    (track,) = data["tracks"]
    state, (way,) = ViewState(subject=3), player.tracks_of(ViewState(subject=3), ("distance",))
    weights, parts = np.array(track["weights"]), arrays["distance_parts"].astype(float)
    flat = weights @ parts.reshape(weights.shape[1], -1)
    shown = data["step"] * (flat.reshape(len(flat), 3, -1) + arrays["base"])
    truth = fits.photograph(state.target).subject.vertices
    assert {0.2, 0.3, 0.6, 1.2, 2.4, 3.0} <= set(way.places.tolist())
    for stop, face in enumerate(way.faces):
        assert (
            faces.face(state.target, state.fitting._replace(distance=way.places[stop]), state.bend)
            is face
        )
        gap = 1e3 * np.linalg.norm(shown[stop].T - face.vertices, axis=1)
        assert gap.max() < TOLERANCE_MM
        points = data["pixels"] * arrays["distance_points"][stop].reshape(-1, 2)
        assert np.abs(points - face.projected).max() < 0.02  # pixels of 500
    gap = 1e3 * np.linalg.norm(data["step"] * arrays["truth"].T - truth, axis=1)
    assert gap.max() < TOLERANCE_MM
    np.testing.assert_array_equal(arrays["faces"].T, fits.model("embedded").faces)


def test_directions_keep_to_the_tolerance_on_wild_ways_and_large_heads():
    rng = np.random.default_rng(2)
    base = rng.normal(0, 0.1, (400, 3))
    base[0] = 0.4  # metres: more than 16 bits of the usual step
    way = base + np.cumsum(rng.normal(0, 3e-3, (9, 400, 3)), axis=0)  # of full rank
    step = step_of(base, way)
    first = rounded(way[0], step)
    gap = 1e3 * np.linalg.norm(restored(directions(way, first, step), first, step) - way, axis=2)
    assert gap.max() < TOLERANCE_MM
    still = directions(np.stack([way[0]] * 3), first, step)
    assert restored(still, first, step) == pytest.approx(np.stack([way[0]] * 3), abs=2e-5)


def test_a_swing_bends_as_the_page_does():
    state = ViewState(subject=3, flex=((2, 1.0),))
    track = tracks.mode_track(state, 1, np.array([-2.0, 0.0, 2.0]))
    for mm, flex in ((0, ((1, -2.0), (2, 1.0))), (1, ((2, 1.0),)), (2, ((1, 2.0), (2, 1.0)))):
        one = changed(state, flex=flex)
        assert track.faces[mm] is faces.face(one.target, one.fitting, one.bend)
    scene = tracks.scene_of(state, track, 0)
    assert scene.note.startswith(f"Mode A: {track.words}: −2\u202fmm; ")


def test_light_of_the_page_and_of_the_file_are_one():
    assert tuple(light[1:] for light in nodes.LIGHTS) == player.LIGHTS
    assert player.OCCLUSION_POWER == heads.OCCLUSION_POWER


def test_distances_hold_what_was_asked_for_and_no_step_of_nothing():
    metres = tracks.distances(0.2, 3.0, 49, (0.3, 0.301, 1.2, 5.0))
    assert {0.2, 0.3, 0.301, 1.2, 3.0} <= set(metres.tolist())
    assert 5.0 not in metres
    steps = np.diff(np.log2(metres))
    assert (steps > 0).all()
    assert steps.max() < 2 * np.log2(15) / 48


def test_names_of_files():
    named = {
        "faceambig_subject2_45.5cm_as_far.png": ViewState(actual=0.455, camera="orthographic"),
        "faceambig_subject2_30cm_row.png": ViewState(show="row"),
        "faceambig_photo_as_120cm.png": ViewState(subject="photo"),
    }
    for name, state in named.items():
        assert export.file_name(export.shown(state), "png") == name


@pytest.mark.parametrize(
    ("kind", "options", "words"),
    [
        ("pdf", {}, "kind: 'pdf' is not one of png"),
        ("png", {"scale": 3}, "scale: 3 is not one of 1, 2, 4"),
        ("obj", {"face": "ghost"}, "face: 'ghost' is not one of fit, true"),
        ("html", {"whats": ("time",)}, "whats: 'time' is not one"),
        ("html", {"whats": ()}, "whats: '' is not one"),
        ("gif", {"what": "time"}, "what: 'time' is not distance or mode"),
    ],
)
def test_what_cannot_be_exported_is_said(kind, options, words):
    with pytest.raises(ValueError, match=re.escape(words)):
        export.files(STATE, kind, **options)


def test_a_hidden_face_is_not_given_away():
    with pytest.raises(ValueError, match="'true' is hidden"):
        export.files(changed(STATE, hide=("truth",)), "obj", face="true")


def test_normals_of_a_mesh_are_those_of_its_surface():
    _, parts = read_glb(export.files(STATE, "glb")[1])
    normals = vertex_normals(parts["POSITION"].astype(float), parts["indices"])
    assert (normals * parts["NORMAL"]).sum(axis=1).min() > 0.999


def test_the_legend_of_the_page_is_the_scale():
    from faceambig.compose import difference_legend

    fills = re.findall(r'fill="#(\w{6})"', standalone.legend_html())
    colours = [tuple(bytes.fromhex(fill)) for fill in fills]
    assert colours == [tuple(c) for c in difference_legend("", "").colours.tolist()]
