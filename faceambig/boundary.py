"""The occluding boundary: where a surface turns away from the camera (paper, section 5; MATH.md 5).

Its edges lie between a triangle that shows its outer and one that shows its inner side: the outline of the head and,
inside it, of the nose or an ear before the cheek.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .arrays import Array, IntArray, checked, read_only
from .camera import Camera, project, see
from .model import FaceModel
from .visibility import visible_in


@dataclass(frozen=True, slots=True, eq=False)
class Boundary:
    """Occluding boundary of a surface, as one camera sees it. Edges at the border of the mesh are none of it."""

    edges: IntArray  # (K, 2) vertex numbers
    vertices: IntArray  # (C,) of the edges, ascending
    visible: NDArray[np.bool_]  # (C,) no part of the surface lies in front

    def __post_init__(self) -> None:
        for name in ("edges", "vertices", "visible"):
            object.__setattr__(self, name, read_only(getattr(self, name)))


def occluding_boundary(model: FaceModel, vertices: ArrayLike, camera: Camera) -> Boundary:
    """The occluding boundary of a surface `vertices` (N, 3), metres, of the model, under either camera.

    Outer and inner parts alike. An edge belongs to it if its two triangles look opposite ways along the ray from the
    camera: their areas in the picture differ in sign. Edges of one triangle, the border of the mesh, do not, nor does
    an edge that touches them: a picture of a whole head shows nothing there.
    """
    points = checked("vertices", vertices, (model.n_vertices, 3))
    seen = see(camera.view, points)
    corners = np.ascontiguousarray(seen.xy.T)[:, model.faces]  # (2, F, 3)
    one, two = (corners[..., k] - corners[..., 0] for k in (1, 2))
    outside = one[0] * two[1] - one[1] * two[0] < 0  # y counts down, triangles are wound outward
    edges, triangles = inner_edges(model)
    on = outside[triangles]
    edges = edges[on[:, 0] != on[:, 1]]
    flags = np.zeros(model.n_vertices, dtype=bool)
    flags[edges] = True
    found = flags.nonzero()[0]
    return Boundary(edges, found, visible_in(seen, camera, model.faces, found))


def contour_points(model: FaceModel, vertices: ArrayLike, camera: Camera) -> Array:
    """Points (n, 2) along the visible occluding boundary, a quarter of a pixel apart; pixels from the principal point.

    What a perfect edge detector sees of a surface `vertices` (N, 3): for pictures, and to test with.
    """
    boundary = occluding_boundary(model, vertices, camera)
    seen = np.zeros(model.n_vertices, dtype=bool)
    seen[boundary.vertices[boundary.visible]] = True
    ends = boundary.edges[seen[boundary.edges].all(axis=1)]
    xy = project(camera, np.asarray(vertices, dtype=np.float64))
    start, way = xy[ends[:, 0]], xy[ends[:, 1]] - xy[ends[:, 0]]
    number = 1 + np.ceil(4 * np.linalg.norm(way, axis=1)).astype(np.intp)
    row = np.repeat(np.arange(len(number)), number)
    place = np.arange(len(row)) - (np.cumsum(number) - number)[row]
    return start[row] + (place / (number - 1).clip(1)[row])[:, None] * way[row]


@lru_cache(maxsize=8)
def inner_edges(model: FaceModel) -> tuple[IntArray, IntArray]:
    """Edges (E, 2) away from the border of the mesh, and the two triangles (E, 2) of each."""
    faces = model.faces.astype(np.intp)
    ends = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    name = ends[:, 0] * model.n_vertices + ends[:, 1]
    order = np.argsort(name, kind="stable")
    _, first, count = np.unique(name[order], return_index=True, return_counts=True)
    border = np.zeros(model.n_vertices, dtype=bool)
    border[ends[order[first[count != 2]]]] = True
    first = first[count == 2]
    edges = ends[order[first]]
    triangles = np.stack([order[first], order[first + 1]], axis=1) % len(faces)
    inner = ~border[edges].any(axis=1)
    return read_only(edges[inner]), read_only(triangles[inner])
