"""The embedded head as it is stored: assets/head.npz and its two landmark schemes.

Read with plain NumPy, so that a mistake of the package's reader cannot hide one of the asset.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

ROOT = Path(__file__).parent.parent
ASSET = ROOT / "assets" / "head.npz"
N_BASE, N_FINE, N_TRIANGLES, N_MODES, N_SUBJECTS = 3_542, 14_159, 28_232, 100, 10


@pytest.fixture(scope="module")
def asset() -> dict[str, np.ndarray]:
    with np.load(ASSET, allow_pickle=False) as file:
        return dict(file)


@pytest.fixture(scope="module")
def operator(asset) -> sparse.csr_array:
    """(N, B) from base to fine vertices."""
    pointer = asset["subdivision_indptr"]
    return sparse.csr_array(
        (asset["subdivision_data"], asset["subdivision_indices"].astype(np.int32), pointer),
        shape=(len(pointer) - 1, len(asset["mean"])),
    )


@pytest.fixture(scope="module")
def mean(asset) -> np.ndarray:
    """(B, 3) metres."""
    return asset["mean"] * 1e-6


@pytest.fixture(scope="module")
def fine(operator, mean) -> np.ndarray:
    """(N, 3) metres."""
    return operator @ mean


@pytest.fixture(scope="module")
def modes(asset) -> np.ndarray:
    """(S, B, 3) metres for one standard deviation."""
    return asset["modes"] * asset["mode_step"][:, None, None]


def rows_of(path: Path) -> list[dict[str, str]]:
    text = path.read_text(encoding="utf-8").splitlines()
    return list(csv.DictReader(line for line in text if not line.startswith("#")))


@pytest.fixture(scope="module")
def schemes() -> dict[str, list[dict[str, str]]]:
    folder = ROOT / "assets" / "schemes"
    return {name: rows_of(folder / f"embedded_{name}.csv") for name in ("ibug68", "farkas")}


def edges_of(faces: np.ndarray) -> np.ndarray:
    """Directed edges (3F, 2)."""
    faces = faces.astype(np.int64)
    return np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])


# ---------------------------------------------------------------- file


def test_file_is_small_and_says_what_it_is(asset):
    assert ASSET.stat().st_size < 4_000_000  # the promise to those who clone or install
    assert asset["format"] == "faceambig-model"
    assert asset["version"] == 1
    assert asset["name"] == "embedded"
    assert "CC0" in str(asset["licence"])
    assert "\n" not in str(asset["licence"])
    assert "MakeHuman" in str(asset["source"])
    assert asset["population"] >= 2_000


def test_arrays_have_the_promised_shapes_and_types(asset):
    expected = {
        "mean": ((N_BASE, 3), np.int32),
        "modes": ((N_MODES, N_BASE, 3), np.int16),
        "mode_step": ((N_MODES,), np.float64),
        "subdivision_indptr": ((N_FINE + 1,), np.int32),
        "faces": ((N_TRIANGLES, 3), np.uint16),
        "colours": ((N_FINE, 3), np.uint8),
        "occlusion": ((N_FINE,), np.uint8),
        "evaluation": ((N_FINE,), np.uint8),
        "regions": ((N_FINE,), np.uint8),
        "subjects": ((N_SUBJECTS, N_BASE, 3), np.int16),
        "subject_colours": ((N_SUBJECTS, N_FINE, 3), np.uint8),
        "variance_held": ((N_MODES,), np.float64),
    }
    for name, (shape, dtype) in expected.items():
        assert asset[name].shape == shape, name
        assert asset[name].dtype == dtype, name
    assert len(asset["subject_names"]) == len(asset["subject_notes"]) == N_SUBJECTS


def test_no_integer_wrapped_around(asset):
    # A wrapped entry differs from its neighbours on the mesh by most of the range; the real field
    # is smooth. Measured largest difference along an edge: 10,162 units.
    edges = edges_of(asset["coarse_faces"])
    for mode in asset["modes"].astype(np.int64):
        assert np.abs(mode[edges[:, 0]] - mode[edges[:, 1]]).max() < 30_000
    assert np.abs(asset["subjects"].astype(np.int64)).max() < 10_000  # 100 mm; measured 21 mm


# ---------------------------------------------------------------- surface


def test_operator_keeps_points_and_translations(operator):
    assert operator.shape == (N_FINE, N_BASE)
    rows = np.asarray(operator.sum(axis=1)).ravel()
    assert np.abs(rows - 1).max() < 1e-14  # a sum of at most 57 numbers below 1
    # Row b leans most on base vertex b: the first rows are the moved base vertices.
    heaviest = operator[:N_BASE].toarray().argmax(axis=1)
    assert np.array_equal(heaviest, np.arange(N_BASE))


@pytest.mark.parametrize("name", ["faces", "coarse_faces"])
def test_surface_is_one_sheet_with_one_border(asset, name):
    faces = asset[name]
    n = N_FINE if name == "faces" else N_BASE
    assert np.array_equal(np.unique(faces), np.arange(n))  # every vertex is used
    directed = edges_of(faces)
    assert len(np.unique(directed, axis=0)) == len(directed)  # manifold, one orientation
    _, count = np.unique(np.sort(directed, axis=1), axis=0, return_counts=True)
    assert set(count.tolist()) == {1, 2}
    n_border = int((count == 1).sum())
    assert n_border == (84 if name == "faces" else 42)  # the neck

    graph = sparse.coo_array((np.ones(len(directed)), directed.T), shape=(n, n))
    assert connected_components(graph, directed=False)[0] == 1
    code = directed @ [n, 1]
    border = directed[~np.isin(code, directed[:, ::-1] @ [n, 1])]
    assert len(border) == n_border
    step = dict(border.tolist())  # each border vertex has one successor: walk round
    vertex, seen = int(border[0, 0]), 0
    while seen == 0 or vertex != border[0, 0]:
        vertex, seen = step[vertex], seen + 1
    assert seen == n_border
    # Euler characteristic of a disc: no handle, no hidden hole.
    assert n - len(count) + len(faces) == 1


def test_surface_is_wound_outward(asset, fine):
    corner = fine[asset["faces"].astype(np.int64)]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    outward = corner.mean(axis=1) - [0.0, 0.0, -0.09]  # from the middle of the skull
    # Nostrils, ears and the back of the lips face inward; measured share of the area: 0.985.
    area = np.linalg.norm(normal, axis=1)
    assert area[(normal * outward).sum(axis=1) > 0].sum() / area.sum() > 0.96
    assert 0.5e6 * area.min() > 0.001  # mm2; measured 0.004, beside the pupil


def test_mean_is_mirror_symmetric(fine):
    distance, mirror = map(np.asarray, cKDTree(fine).query(fine * [-1.0, 1.0, 1.0]))
    # Each pair was rounded alike, so only the order of the operator's sums differs.
    assert distance.max() < 1e-14
    assert np.array_equal(mirror[mirror], np.arange(N_FINE))


# ---------------------------------------------------------------- units, origin, landmarks


def test_units_and_axes(fine, schemes):
    at = {(r["name"], r["side"]): fine[int(r["vertex"])] for r in schemes["farkas"]}
    # Adults: pupils 52 to 76 mm apart (64 +- 3 sd), nose tip 25 to 55 mm before the eyes.
    assert 0.052 < at["p", "left"][0] - at["p", "right"][0] < 0.076
    assert 0.025 < at["prn", "mid"][2] < 0.055
    assert at["v", "mid"][1] > 0.09 > 0 > at["gn", "mid"][1] > -0.15
    assert at["op", "mid"][2] < -0.14


def test_origin_lies_between_the_eyes(fine, schemes):
    point = {r["name"]: int(r["vertex"]) for r in schemes["ibug68"]}
    corners = fine[[point[name] for name in ("37", "40", "43", "46")]]
    assert np.abs(corners.mean(axis=0)).max() < 1e-5  # stored in steps of 1e-6


def test_schemes_are_complete(schemes):
    ibug, farkas = schemes["ibug68"], schemes["farkas"]
    assert [r["name"] for r in ibug] == [str(k) for k in range(1, 69)]
    assert len(farkas) == 76
    for rows in (ibug, farkas):
        vertices = [int(r["vertex"]) for r in rows]
        assert len(set(vertices)) == len(vertices)
        assert min(vertices) >= 0
        assert max(vertices) < N_FINE
        assert {r["side"] for r in rows} == {"left", "right", "mid"}
        assert {r["confidence"] for r in rows} <= {"high", "medium", "low"}
        assert all(r["definition"] for r in rows)
    names = [r["name"] for r in farkas if r["side"] != "mid"]
    assert all(names.count(name) == 2 for name in names)


@pytest.mark.parametrize("name", ["ibug68", "farkas"])
def test_landmark_pairs_mirror(fine, schemes, name):
    mirror = [*range(17, 0, -1), *range(27, 17, -1), 28, 29, 30, 31, *range(36, 31, -1)]
    mirror += [46, 45, 44, 43, 48, 47, 40, 39, 38, 37, 42, 41]
    mirror += [*range(55, 48, -1), *range(60, 55, -1), *range(65, 60, -1), 68, 67, 66]
    place = {(r["name"], r["side"]): fine[int(r["vertex"])] for r in schemes[name]}
    other = {"left": "right", "right": "left", "mid": "mid"}
    for (point, side), here in place.items():
        image = str(mirror[int(point) - 1]) if name == "ibug68" else point
        # Pairs are exact mirror images: what is left is the order of the operator's sums.
        assert np.abs(place[image, other[side]] * [-1, 1, 1] - here).max() < 1e-14, (point, side)


# ---------------------------------------------------------------- statistics


def test_measures_agree_with_the_survey(operator, mean, modes, schemes):
    survey = rows_of(ROOT / "tools" / "head_data" / "survey.csv")
    vertex = {(r["name"], r["side"]): int(r["vertex"]) for r in schemes["farkas"]}

    def end(name: str, side: str) -> int:
        return vertex[name, side] if (name, side) in vertex else vertex[name, "mid"]

    first, second = [], []
    for row in survey:
        a, b = row["from_landmark"], row["to_landmark"]
        first.append(end(a, "right"))
        second.append(end(b, "left" if a == b else "right"))
    rows = operator[first + second]
    # 2,000 draws: the standard error of a mean is 2% and of a sd 1.6% of the sd.
    alpha = np.random.default_rng(1).standard_normal((2_000, N_MODES))
    basis = np.stack([rows @ mode for mode in modes])
    points = rows @ mean + np.tensordot(alpha, basis, axes=1)
    apart = points[:, len(first) :] - points[:, : len(first)]
    length = 1e3 * np.linalg.norm(apart, axis=2)
    vertical = [row["measure"] for row in survey].index("tragion_vertex")
    length[:, vertical] = 1e3 * np.abs(apart[:, vertical, 1])

    want = np.array([float(row["pooled_mean_mm"]) for row in survey])
    want_sd = np.array([float(row["pooled_sd_mm"]) for row in survey])
    ratio = length.std(axis=0, ddof=1) / want_sd
    # The criterion of the model: mean within one sd of the survey, sd within a factor of 1.5.
    good = (np.abs(length.mean(axis=0) - want) <= want_sd) & (ratio >= 1 / 1.5) & (ratio <= 1.5)
    assert len(survey) == 16
    assert good.sum() >= 14, [r["measure"] for r, ok in zip(survey, good, strict=True) if not ok]


def test_variance_held(asset, operator, modes):
    held = asset["variance_held"]
    assert np.all(np.diff(held) > 0)
    assert held[69] > 0.99  # 70 modes, the default of a fit; measured 0.9963
    assert 0.995 < held[-1] < 1.0
    # The stored modes carry the shares they claim: half a step of rounding is far below 1e-4.
    power = np.array([((operator @ mode) ** 2).sum() for mode in modes])
    assert np.abs(np.cumsum(power) / power.sum() - held / held[-1]).max() < 1e-4
    assert np.all(power[:-1] > power[1:])


def test_modes_are_orthogonal_on_the_surface(operator, modes):
    flat = np.stack([(operator @ mode).ravel() for mode in modes])
    flat /= np.linalg.norm(flat, axis=1)[:, None]
    # Rounding to 0.25 micrometres (0.07 rms) against 37 micrometres rms of the last mode: about
    # 1 / 500 in each entry, averaged over thousands of them. Measured 2e-4.
    assert np.abs(flat @ flat.T - np.eye(N_MODES)).max() < 1e-3


def test_modes_are_symmetric_or_antisymmetric(asset, mean):
    mirror = cKDTree(mean).query(mean * [-1.0, 1.0, 1.0])[1]
    symmetric = 0
    for mode in asset["modes"].astype(np.int64):
        image = mode[mirror] * [-1, 1, 1]
        assert np.array_equal(image, mode) or np.array_equal(image, -mode)  # exact, in integers
        symmetric += np.array_equal(image, mode)
    assert 70 < symmetric < 95  # faces differ by both, mostly by the first; measured 85


# ---------------------------------------------------------------- subjects


def test_subjects_are_outside_the_model_but_near_it(asset, operator, modes):
    flat = np.stack([(operator @ mode).ravel() for mode in modes])
    shift = asset["subjects"] * float(asset["subject_step"])
    for displacement in shift:
        wanted = (operator @ displacement).ravel()
        alpha, *_ = np.linalg.lstsq(flat.T, wanted, rcond=None)
        rest = np.linalg.norm((wanted - alpha @ flat).reshape(-1, 3), axis=1)
        # In millimetres, measured 0.18 to 0.23 mean. Rounding to 10 micrometres alone gives 0.005,
        # so 0.05 says "not made from the modes"; above 0.5 the model would not be theirs.
        assert 5e-5 < rest.mean() < 5e-4
        # Weights of a member of the population: chi with 100 degrees of freedom is below 14.6
        # with probability 1 - 1e-6 (subjects differ from the Gaussian: ages are skewed).
        assert np.linalg.norm(alpha) < 14.6
        assert 1e-3 < np.linalg.norm(wanted.reshape(-1, 3), axis=1).mean() < 2e-2  # a person


def test_subjects_differ_in_sex_age_ancestry_and_tone(asset):
    notes = [str(note) for note in asset["subject_notes"]]
    assert sum(note.startswith("woman") for note in notes) == 5
    years = sorted(int(note.split(",")[1].split()[0]) for note in notes)
    assert years[0] <= 30
    assert years[-1] >= 60
    assert {note.split("ancestry ")[1].split()[1].strip(",") for note in notes} == {
        "african", "asian", "caucasian",
    }  # fmt: skip
    forehead = asset["subject_colours"][:, asset["regions"] == 1].mean(axis=1)  # (10, 3)
    apart = np.linalg.norm(forehead[:, None] - forehead, axis=2)[np.triu_indices(N_SUBJECTS, 1)]
    assert apart.min() > 5  # sRGB units, just visible side by side: no tone is given twice
    assert np.ptp(forehead.mean(axis=1)) > 80  # from dark to light
    assert len(set(asset["subject_names"].tolist())) == N_SUBJECTS


# ---------------------------------------------------------------- paint


def test_mouth_and_skin_are_neither_grey_nor_white(asset, schemes):
    point = {r["name"]: int(r["vertex"]) for r in schemes["ibug68"]}
    lips = [point[str(k)] for k in range(49, 69)]
    for colours in (asset["colours"], *asset["subject_colours"]):
        red, green, blue = colours[lips].astype(float).T
        # Lips and the slit between them are redder than green by a tenth at least, never pale.
        assert np.all(red > 1.1 * green)
        assert np.all(red > 1.1 * blue)
        inner = colours[[point[str(k)] for k in range(61, 69)]].astype(float)
        skin = colours[point["31"]].astype(float)
        assert np.all(inner.mean(axis=1) < skin.mean())


def test_eyes_have_pupil_iris_and_white(asset, fine, schemes):
    at = {(r["name"], r["side"]): int(r["vertex"]) for r in schemes["farkas"]}
    for side in ("left", "right"):
        colours = asset["colours"].astype(float).mean(axis=1)
        away = np.linalg.norm((fine - fine[at["p", side]])[:, :2], axis=1)
        ball = (asset["regions"] == 3) & (np.abs(fine[:, 1] - fine[at["p", side], 1]) < 0.002)
        assert colours[at["p", side]] < 30
        assert 30 < colours[ball & (away > 0.003) & (away < 0.005)].mean() < 140
        assert colours[ball & (away > 0.0065) & (away < 0.008)].mean() > 180


def test_regions_and_evaluation(asset, fine, schemes):
    names = asset["region_names"].tolist()
    assert set(names) == {
        "nose", "mouth", "chin", "cheeks", "eyes", "brows", "forehead", "ears", "skull", "neck",
        "jaw",
    }  # fmt: skip
    farkas = {(r["name"], r["side"]): int(r["vertex"]) for r in schemes["farkas"]}
    expected = {
        ("prn", "mid"): "nose", ("sto", "mid"): "mouth", ("pg", "mid"): "chin",
        ("p", "left"): "eyes", ("tr", "mid"): "skull", ("v", "mid"): "skull",
        ("sa", "right"): "ears", ("sci", "left"): "brows", ("cheek", "right"): "cheeks",
        ("g", "mid"): "forehead", ("go", "left"): "jaw",
    }  # fmt: skip
    for key, name in expected.items():
        assert names[asset["regions"][farkas[key]]] == name, key
    inside = asset["evaluation"].astype(bool)
    assert set(np.unique(asset["evaluation"]).tolist()) == {0, 1}
    assert 0.5 < inside.mean() < 0.85  # the face has the finer mesh; measured 0.66
    behind = fine[:, 2] < fine[farkas["t", "left"], 2]
    assert not np.any(inside & behind)
    for name in ("ears", "neck"):
        assert not np.any(inside & (asset["regions"] == names.index(name)))
    for name in ("nose", "mouth", "eyes"):
        assert np.all(inside[asset["regions"] == names.index(name)])


def test_occlusion_is_dark_where_little_light_comes(asset, schemes):
    ibug = {r["name"]: int(r["vertex"]) for r in schemes["ibug68"]}
    occlusion = asset["occlusion"]
    assert occlusion.max() == 255
    assert occlusion[ibug["31"]] > 230  # nose tip
    # Between the lips at the corner, and in the ear, less than on the tip of the nose.
    assert occlusion[ibug["61"]] < 0.8 * occlusion[ibug["31"]]
