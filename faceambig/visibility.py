"""Which vertices of a face a camera sees: a ray to each, against the triangles that lie where it passes (MATH.md 5).

A grid over the picture, its cells about as wide as a triangle, says which triangles may cover which points; the few
pairs that remain are tested exactly. A depth buffer of the same mesh takes longer, needs a resolution, and calls what
lies a cell behind an edge visible.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .arrays import Array, IntArray
from .camera import Camera, Seen, see

MARGIN = 2e-3  # metres; what lies less behind a triangle is seen, or the outline's own facets would hide it
# Of the grid: a few vertices beside a camera that is too near spread over any number
MOST_CELLS = 1 << 18


def visible_vertices(
    faces: NDArray[np.uint32], vertices: Array, camera: Camera, asked: IntArray | None = None
) -> NDArray[np.bool_]:
    """(N,) True where no triangle is more than 2 mm in front of a vertex, both sides of a triangle hide.

    Parameters
    ----------
    faces: (F, 3) triangles of `vertices` (N, 3), metres, model axes.
    asked: (n,) vertex numbers to answer for, in this order, instead of all: the answer is (n,), and faster.

    A vertex behind the camera is not visible; a triangle that reaches behind it hides nothing.
    """
    return visible_in(see(camera.view, vertices), camera, faces, asked)


def visible_in(
    seen: Seen, camera: Camera, faces: NDArray[np.uint32], asked: IntArray | None = None
) -> NDArray[np.bool_]:
    """`visible_vertices` of vertices already projected, `see(camera.view, vertices)`."""
    depth = seen.q[:, 2]
    x, y = np.ascontiguousarray(seen.xy.T)
    T = faces.astype(np.intp)
    in_front = np.ones(len(depth), dtype=bool)
    if seen.behind is not None:
        in_front = 1.0 + camera.kappa * depth > 0
        T = T[in_front[T].all(axis=1)]
    rays = np.arange(len(depth)) if asked is None else np.asarray(asked, dtype=np.intp)
    answer = in_front[rays]
    if not len(T) or not len(rays):
        return answer
    ray, triangle = _met(x, y, T, rays)
    a, b, c = T[triangle].T
    p = rays[ray]
    px, py = x[p] - x[a], y[p] - y[a]
    bx, by, cx, cy = x[b] - x[a], y[b] - y[a], x[c] - x[a], y[c] - y[a]
    # Barycentric weights times twice the area. Of a triangle's own corner they are exact: it never hides it
    area = bx * cy - by * cx
    at_b, at_c = px * cy - py * cx, bx * py - by * px
    at_a = area - at_b - at_c
    turned = np.sign(area)
    inside = (turned * at_a >= 0) & (turned * at_b >= 0) & (turned * at_c >= 0) & (turned != 0)
    # Depth taken as linear in the picture: over a triangle as wide as w it is off by w^2 / 4 t_z, microns
    nearer = at_a * depth[a] + at_b * depth[b] + at_c * depth[c] - area * (depth[p] - MARGIN)
    answer[ray[inside & (turned * nearer < 0)]] = False
    return answer


def _met(x: Array, y: Array, T: IntArray, rays: IntArray) -> tuple[IntArray, IntArray]:
    """Pairs (row of `rays`, row of `T`) where the ray passes through the triangle's rectangle in the picture."""
    tx, ty = x[T].T, y[T].T
    west, east = np.minimum(np.minimum(*tx[:2]), tx[2]), np.maximum(np.maximum(*tx[:2]), tx[2])
    north, south = np.minimum(np.minimum(*ty[:2]), ty[2]), np.maximum(np.maximum(*ty[:2]), ty[2])
    left, top, right, bottom = west.min(), north.min(), east.max(), south.max()
    cell = 0.5 * float((east - west).mean() + (south - north).mean())
    cell = max(cell, float(np.sqrt((right - left) * (bottom - top) / MOST_CELLS)), 1e-300)
    wide, tall = int((right - left) / cell) + 1, int((bottom - top) / cell) + 1

    px, py = x[rays], y[rays]
    within = ((px >= left) & (px <= right) & (py >= top) & (py <= bottom)).nonzero()[0]
    at = ((py[within] - top) / cell).astype(np.intp) * wide
    at += ((px[within] - left) / cell).astype(np.intp)
    rows = within[np.argsort(at, kind="stable")]  # by cell
    number = np.bincount(at, minlength=wide * tall)
    first = np.cumsum(number) - number

    x0, x1 = (((side - left) / cell).astype(np.intp) for side in (west, east))
    y0, y1 = (((side - top) / cell).astype(np.intp) for side in (north, south))
    # Points in all cells of each triangle by a table of sums: most triangles have none
    table = np.zeros((tall + 1, wide + 1), dtype=np.intp)
    table[1:, 1:] = number.reshape(tall, wide).cumsum(0).cumsum(1)
    some = table[y1 + 1, x1 + 1] - table[y0, x1 + 1] - table[y1 + 1, x0] + table[y0, x0] > 0
    triangle = some.nonzero()[0]
    across = (x1 - x0 + 1)[triangle]
    which, k = _counted(across * (y1 - y0 + 1)[triangle])
    triangle, across = triangle[which], across[which]
    cells = (y0[triangle] + k // across) * wide + x0[triangle] + k % across
    which, k = _counted(number[cells])
    triangle, ray = triangle[which], rows[first[cells[which]] + k]
    qx, qy = px[ray], py[ray]
    met = (qx >= west[triangle]) & (qx <= east[triangle])
    met &= (qy >= north[triangle]) & (qy <= south[triangle])
    return ray[met], triangle[met]


def _counted(numbers: IntArray) -> tuple[IntArray, IntArray]:
    """Row i of `numbers` as often as it says, and which time it is: [2, 1] gives [0, 0, 1] and [0, 1, 0]."""
    row = np.repeat(np.arange(len(numbers)), numbers)
    return row, np.arange(len(row)) - (np.cumsum(numbers) - numbers)[row]
