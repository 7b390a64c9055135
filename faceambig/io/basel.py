"""Basel Face Model 2009: `01_MorphableModel.mat` (MATLAB 5), and the points of Farkas that come with it.

    shapeMU (3N, 1), shapePC (3N, S) unit columns, shapeEV (S, 1) standard deviations despite the name: micrometres
    tl (F, 3) triangles from 1, wound inward;  texMU (3N, 1) colours 0 to 255

x, y and z of a vertex follow each other. `11_feature_points/Farkas_face05.fp` beside it: three lines of header, then
`vertex x y z X Y name`, vertices from 0, micrometres. The model may not be passed on: everyone has their own copy.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from ..arrays import Array
from ..errors import AssetError
from ..model import FaceModel, Scheme
from .build import Parts, build
from .checks import nearest, shaped, whole_numbers
from .files import asset_path, damage_named, text_of
from .matlab import read_matlab
from .schemes import EYES, schemes_in

NAMES = ("shapeMU", "shapePC", "shapeEV", "tl")
N_VERTICES = 53_490
POINTS = "11_feature_points/Farkas_face05.fp"
HEADER_LINES = 3
APART = 1e-3  # metres: farther from the mean the points are those of another model
CORNER = 10e-3  # metres: two authors' corners of an eye; inner and outer are 28 apart
MIDDLE = 2.5e-3  # metres: nearer to the middle plane a point has no side


def read_basel(path: Path) -> FaceModel:
    """The Basel Face Model 2009 at its own origin, metres; AssetError, one line, if the file is damaged."""
    with damage_named(path):
        arrays = read_matlab(path, (*NAMES, "texMU"))
        missing = [name for name in NAMES if name not in arrays]
        if missing:
            raise AssetError(f"{missing[0]} is missing; Basel 2009 has {', '.join(NAMES)}")
        mean, modes = shaped("shapeMU", arrays["shapeMU"].ravel()), arrays["shapePC"]
        known = len(mean) == N_VERTICES
        colours = arrays.get("texMU")
        model = build(
            Parts(
                name="bfm2009" if known else "basel",
                mean=mean,
                modes=shaped("shapePC", modes),
                sds=arrays["shapeEV"].ravel(),
                faces=whole_numbers("tl", arrays["tl"]).astype(np.int64) - 1,
                unit="micrometre",
                schemes=schemes_in(asset_path("schemes"), "bfm2009", N_VERTICES) if known else {},
                colours=None if colours is None else shaped("texMU", colours.ravel()),
                licence="research only, no redistribution (Basel Face Model)",
                source=f"Basel Face Model 2009, {path.name}",
            )
        )
    return _with_farkas(model, path)


def _with_farkas(model: FaceModel, path: Path) -> FaceModel:
    for file in (path.parent / POINTS, path.parent / Path(POINTS).name):
        if file.is_file():
            scheme = farkas(file, model)
            return replace(model, schemes={**model.schemes, scheme.name: scheme})
    return model


def farkas(file: Path, model: FaceModel) -> Scheme:
    """The points of `Farkas_face05.fp` on `model`, at its own origin; their names are the file's."""
    names: list[str] = []
    vertices: list[int] = []
    for number, line in enumerate(text_of(file).splitlines(), start=1):
        if number <= HEADER_LINES or not line.strip():
            continue
        words = line.split()
        where = f"line {number} of {file.name}"
        try:
            vertex, *xyz = (float(word) for word in words[-7:-3])
            if len(xyz) != 3 or not 0 <= vertex < model.n_vertices or vertex != int(vertex):
                raise ValueError
        except ValueError as error:
            raise AssetError(
                f"{where}: expected vertex x y z X Y name, found {' '.join(words)!r:.60}"
            ) from error
        away = float(np.linalg.norm(model.mean[int(vertex)] - 1e-6 * np.array(xyz)))
        if not away <= APART:
            raise AssetError(
                f"{where}: {words[-1]:.30} is {1000 * away:.3g} mm from vertex {int(vertex)}: points of another model"
            )
        names.append(words[-1])
        vertices.append(int(vertex))
    if not vertices:
        raise AssetError(f"{file.name}: no points")
    return _scheme(names, np.array(vertices), model, file.name)


def _scheme(names: list[str], vertices: np.ndarray, model: FaceModel, file: str) -> Scheme:
    x = model.mean[vertices, 0]
    sides = tuple("mid" if abs(v) < MIDDLE else "left" if v > 0 else "right" for v in x)
    full = tuple(
        f"{name}_{side[0]}" if names.count(name) == 2 else name
        for name, side in zip(names, sides, strict=True)
    )
    if len(set(full)) < len(full):
        twice = next(name for name in full if full.count(name) > 1)
        raise AssetError(f"{file}: point {twice!r:.30} is named twice")
    right, left = _eyes(full, model.mean[vertices], model, file)
    meaning = "mean of the outer and inner corner of each eye"
    return Scheme("farkas", full, vertices, sides, (right, left), meaning)


def _eyes(
    names: tuple[str, ...], at: Array, model: FaceModel, file: str
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Rows of the corners of both eyes: by Farkas' letters, else those nearest to iBUG's."""
    for right, left, _ in EYES:
        if {*right, *left} <= set(names):
            return tuple(map(names.index, right)), tuple(map(names.index, left))
    ibug = model.schemes.get("ibug68")
    if ibug is not None:
        corners = model.mean[
            ibug.vertices[[ibug.points.index(p) for p in ("37", "40", "43", "46")]]
        ]
        rows, away = nearest(at, corners)
        if (away <= CORNER).all():
            a, b, c, d = rows.tolist()
            return (a, b), (c, d)
    raise AssetError(f"{file}: no eye corners among the points")
