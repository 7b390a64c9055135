"""Statismo and Scalismo: the layouts of all versions, landmarks in the file, and HDF5 that leads elsewhere or lies."""

from __future__ import annotations

import re
import sys

import numpy as np
import pytest
from hypothesis import given

import faceambig.io as fio
from damage import cases
from faceambig.errors import AssetError
from model_files import EYES, HEAD_AT, damages, drawn, eyes_of, read_damaged, write_statismo

h5py = pytest.importorskip("h5py", reason="no h5py: .h5 is not read")

SMALL = drawn(42, 3, {point: k for k, point in enumerate(EYES)})
ROUNDING = 2e-8  # metres: float32 of 200 mm
NAMES = {
    "37": "right.eye.corner_outer", "40": "right.eye.corner_inner", "43": "left.eye.corner_inner",
    "46": "left.eye.corner_outer",
}  # fmt: skip
OFF = np.array([0.3, 0.2, 0.1])  # mm that a landmark lies beside its vertex


def landmarks(model=SMALL) -> dict[str, np.ndarray]:
    """The corners of the eyes by Basel's names, the tip of the nose, a point that iBUG does not have."""
    named = {NAMES[p]: model.mean[k] + OFF for k, p in enumerate(EYES) if p in NAMES}
    return {**named, "center.nose.tip": model.mean[20], "left.ear.lobule.tip": model.mean[21]}


@pytest.fixture
def path(tmp_path):
    return tmp_path / "m.h5"


def test_a_mode_is_the_basis_times_the_root_of_the_variance(path):
    model = fio.load_model(write_statismo(path, SMALL), origin="file")
    assert np.abs(model.mean - 1e-3 * SMALL.mean).max() < ROUNDING
    assert np.abs(model.control_modes - 1e-3 * SMALL.modes).max() < ROUNDING
    assert np.array_equal(model.faces, SMALL.faces)


@pytest.mark.parametrize("root", ["", "shape"])
def test_a_plain_model_lies_at_the_root(path, root):
    model = fio.load_model(
        write_statismo(path, SMALL, root=root, colours=bool(root)), origin="file"
    )
    assert np.abs(model.control_modes - 1e-3 * SMALL.modes).max() < ROUNDING


@pytest.mark.parametrize(
    ("version", "representer"),
    [((0, 8), "any"), (None, "itkMeshRepresenter"), (None, "vtkPolyDataRepresenter")],
)
def test_the_basis_of_old_files_holds_the_root_already(path, version, representer):
    write_statismo(path, SMALL, version=version, representer=representer, legacy=True)
    model = fio.load_model(path, origin="file")
    assert np.abs(model.control_modes - 1e-3 * SMALL.modes).max() < ROUNDING
    assert np.array_equal(model.faces, SMALL.faces)


def test_columns_of_newer_files_need_not_be_unit_vectors(path):
    write_statismo(path, SMALL, version=(1, 0), legacy=True)
    model = fio.load_model(path, origin="file")
    assert np.abs(model.control_modes - 1e-3 * SMALL.modes * SMALL.sds).max() < 50 * ROUNDING


def test_the_neutral_face_has_the_mean_of_the_expressions(path):
    neutral = np.full((42, 3), 1.5)
    model = fio.load_model(write_statismo(path, SMALL, expression=neutral), origin="file")
    assert np.abs(model.mean - 1e-3 * (SMALL.mean + neutral)).max() < ROUNDING


def test_colours_are_bytes(path):
    colours = fio.load_model(write_statismo(path, SMALL), origin="file").colours
    assert colours is not None
    assert np.abs(colours - 255 * SMALL.colours).max() <= 0.5 + 1e-4


def test_landmarks_of_the_file_are_the_nearest_vertices(path):
    model = fio.load_model(write_statismo(path, SMALL, landmarks=landmarks()))
    assert list(model.schemes)[:2] == ["ibug68", "basel"]
    rows = {name: v for name, _, v in model.scheme("ibug68").rows()}
    assert rows == {"37": 0, "40": 3, "43": 6, "46": 9, "31": 20}
    basel = model.scheme("basel")
    assert (
        dict(zip(basel.points, basel.vertices.tolist(), strict=True))["left.ear.lobule.tip"] == 21
    )
    assert basel.sides == ("right", "right", "left", "left", "mid", "left")
    assert basel.eyes == ((0, 1), (2, 3))
    assert np.abs(model.file_origin + 1e-3 * HEAD_AT).max() < ROUNDING
    assert [what for what, *_ in fio.eye_distances(model)] == [
        "outer eye corners",
        "inner eye corners",
    ]


@pytest.mark.parametrize(("factor", "unit"), [(1e-3, "m"), (0.1, "cm"), (1.0, "mm")])
def test_the_unit_is_found_by_the_eyes(path, factor, unit):
    model = fio.load_model(write_statismo(path, SMALL, landmarks=landmarks(), factor=factor))
    assert model.unit.startswith(f"{unit}, found by its size: outer eye corners 90.0 mm")
    assert np.abs(model.control_modes - 1e-3 * SMALL.modes).max() < ROUNDING


def test_the_size_of_basel_2017_has_its_points(path):
    full = drawn(53_149, 2, eyes_of("bfm2017_ibug68"))
    model = fio.load_model(write_statismo(path, full))
    assert (model.name, len(model.scheme("ibug68"))) == ("bfm2017", 26)
    assert "no redistribution" in model.licence


# What is refused


def moved(name: str, link: object):
    """A change: the data of `name` moved away, a link in its place."""

    def change(file) -> None:
        file["elsewhere"] = file[name]
        del file[name]
        file[name] = link

    return change


def stored_outside(file) -> None:
    shape = file["shape/model/mean"].shape
    del file["shape/model/mean"]
    file["shape/model"].create_dataset("mean", shape, "f4", external=[("/etc/passwd", 0, 504)])


def virtual(file) -> None:
    layout = h5py.VirtualLayout((126,), "f4")
    layout[:] = h5py.VirtualSource("other.h5", "data", (126,))
    del file["shape/model/mean"]
    file["shape/model"].create_virtual_dataset("mean", layout)


def replaced(name: str, value=None, **options):
    """A change: another dataset in the place of `name`."""

    def change(file) -> None:
        del file[name]
        if value is not None:
            file[name] = value
        elif options:
            file.create_dataset(name, **options)

    return change


MEAN, BASIS, CELLS = "shape/model/mean", "shape/model/pcaBasis", "shape/representer/cells"


CHANGES = [
    (moved(MEAN, h5py.SoftLink("/elsewhere")), "model/mean is a link to elsewhere"),
    (moved(MEAN, h5py.ExternalLink("/etc/passwd", "/x")), "model/mean is a link to elsewhere"),
    (moved("shape", h5py.SoftLink("/elsewhere")), "shape is a link to elsewhere"),
    (moved("color", h5py.ExternalLink("other.h5", "/")), "color is a link to elsewhere"),
    (stored_outside, "model/mean has its numbers in another file"),
    (virtual, "model/mean has its numbers in another file"),
    (replaced(BASIS, shape=(10**7, 10**4), dtype="f4", chunks=(10**4, 10)), "takes 762939 MB; 512 MB are accepted"),
    (replaced(BASIS, shape=(126, 3), dtype="f4"), "holds no data"),
    (replaced(MEAN, shape=(126,), dtype="f4", maxshape=(None,), chunks=(1 << 28,)), "take"),
    (replaced(MEAN), "model/mean is missing"),
    (replaced(MEAN, np.ones((126, 2))), "model/mean has shape (126, 2), expected 1 dimensions"),
    (replaced(MEAN, np.ones(125)), "model/mean has shape (125,), expected x y z"),
    (replaced(MEAN, np.full(126, np.nan)), "mean holds a value that is not finite"),
    (replaced(MEAN, b"words"), "model/mean holds"),
    (replaced(MEAN, np.zeros(126, [("a", "f4")])), "model/mean holds"),
    (replaced(BASIS, np.ones((123, 3))), "modes have shape (41, 3, 3), expected (42, 3, S)"),
    (replaced(BASIS, np.full((126, 3), np.inf)), "modes holds a value that is not finite"),
    (replaced("shape/model/pcaVariance", -np.ones(3)), "variances: -1 is not positive"),
    (replaced("shape/model/pcaVariance", np.arange(1.0, 4)), "mode 2 is stronger than mode 1"),
    (replaced("shape/model/pcaVariance", np.ones(2)), "2 standard deviations for 3 modes"),
    (replaced("shape/version/majorVersion", b"1"), "version/majorVersion is not a number"),
    (replaced(CELLS), "representer/cells is missing"),
    (replaced(CELLS, np.full((3, 4), 42)), "triangles: vertex 42 is not within 0 to 41"),
    (replaced(CELLS, np.full((3, 4), -1)), "triangles: vertex -1 is not within 0 to 41"),
    (replaced(CELLS, np.ones((3, 4))), "triangles hold float64 numbers, not vertex numbers"),
    (replaced(CELLS, np.ones((4, 4), int)), "triangles have shape (4, 4), expected (F, 3)"),
    (replaced("color/model/mean", np.ones(123)), "colours have shape (41, 3), expected (42, 3)"),
    (replaced("metadata/landmarks/json", b"{}"), "landmarks"),
    (replaced("metadata/landmarks/json", b"[" * 100_000), "is not a list of landmarks"),
    (replaced("metadata/landmarks/json", b'[{"id": "a", "coordinates": [1, 2]}]'), "three coordinates"),
    (replaced("metadata/landmarks/json", np.ones(4)), "landmarks"),
    (replaced("metadata/landmarks/json", shape=(1 << 21,), dtype="i1"), "takes more than 1 MB"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "said"), CHANGES, ids=map(str, range(len(CHANGES))))
def test_what_does_not_fit_or_leads_elsewhere_is_named(path, change, said):
    write_statismo(path, SMALL, landmarks=landmarks(), change=change)
    with pytest.raises(AssetError, match=rf"m\.h5: .*{re.escape(said)}") as caught:
        fio.load_model(path, origin="file")
    assert "\n" not in str(caught.value)


def test_landmarks_of_another_mesh_are_refused(path):
    far = landmarks() | {"center.nose.tip": np.array([0.0, 0.0, 900.0])}
    with pytest.raises(
        AssetError, match=r"landmark center\.nose\.tip is \d+ from the nearest vertex"
    ):
        fio.load_model(write_statismo(path, SMALL, landmarks=far))


def test_other_hdf5_is_named(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["x"] = 1
    with pytest.raises(AssetError, match=r"a\.h5: no group model or shape/model"):
        fio.load_model(tmp_path / "a.h5")
    with h5py.File(tmp_path / "b.mat", "w", userblock_size=512) as file:
        file["shapeMU"] = np.ones(3)
    with (tmp_path / "b.mat").open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file")
    with pytest.raises(
        AssetError, match=r"b\.mat: MATLAB 7\.3 is not read; save the arrays with -v7"
    ):
        fio.load_model(tmp_path / "b.mat")
    (tmp_path / "c.h5.json").write_text("{}")
    with pytest.raises(AssetError, match=r"c\.h5\.json: Scalismo's JSON is not read"):
        fio.load_model(tmp_path / "c.h5.json")


def test_without_h5py_the_way_to_get_it_is_said(path, monkeypatch):
    write_statismo(path, SMALL)
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(
        RuntimeError, match=r"m\.h5: \.h5 is read by h5py: pip install 'faceambig\[models\]'"
    ):
        fio.load_model(path)


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> bytes:
    path = tmp_path_factory.mktemp("statismo") / "m.h5"
    return write_statismo(
        path, SMALL, landmarks=landmarks(), expression=np.zeros((42, 3))
    ).read_bytes()


@cases(200)
@given(damage=damages(20_000))
def test_damage_is_an_asset_error_or_another_number(whole, tmp_path_factory, damage):
    read_damaged(tmp_path_factory.getbasetemp() / "damaged.h5", whole, damage)
