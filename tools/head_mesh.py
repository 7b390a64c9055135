"""The topology of the head: crop, closed mouth, eye patches, one step of Catmull-Clark.

Vertex order of the base mesh: head vertices in the order of hm08, then the left eye's patch, then
the right eye's, each ring by ring from the lid to the pupil.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial import cKDTree

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# Rings of an eye patch, as distances from the pupil's centre along the ball in millimetres: two
# close to the rim of the iris and two close to the rim of the pupil, so that colours change over
# half a millimetre. `LID` keeps each inside the lid where the lid covers the iris.
RINGS_MM = (6.1, 5.4, 2.4, 1.7)
LID = (0.90, 0.82, 0.55, 0.40)
N_LOOP = 28
N_PATCH = N_LOOP * (1 + len(RINGS_MM)) + 1


@dataclass(frozen=True, slots=True, eq=False)
class BaseMesh:
    """The head before subdivision. H head vertices, B base vertices."""

    kept: Ints  # (H,) their numbers in hm08, ascending
    polygons: tuple[tuple[int, ...], ...]  # quads, and triangles between the lips
    eye_loops: Ints  # (2, 28) socket edge, left eye then right, mirrored in order
    mouth_loop: Ints  # vertices of the closed mouth's edge
    neck_loop: Ints
    mirror: Ints  # (B,) number of the mirror image
    eyes: tuple[range, range]  # numbers of the patch vertices, left and right

    @property
    def n_vertices(self) -> int:
        return len(self.mirror)

    @property
    def pupils(self) -> tuple[int, int]:
        """Centre of the patch, left and right."""
        return self.eyes[0][-1], self.eyes[1][-1]


def nearest_mirror(vertices: Array, tolerance: float) -> Ints:
    """Number of the vertex at (-x, y, z), for each vertex of a symmetric mesh."""
    distance, mirror = cKDTree(vertices).query(vertices * [-1.0, 1.0, 1.0])
    if distance.max() > tolerance or not np.array_equal(mirror[mirror], np.arange(len(mirror))):
        raise ValueError(f"mesh is not mirror symmetric: {distance.max():.2e}")
    return mirror


def flood(quads: Ints, seed: int, loops: list[list[int]]) -> Ints:
    """The quads reached from a vertex without crossing an edge of the loops."""
    closed = {frozenset(e) for loop in loops for e in zip(loop, loop[1:] + loop[:1], strict=True)}
    by_edge: dict[frozenset[int], list[int]] = {}
    for number, quad in enumerate(quads.tolist()):
        for edge in zip(quad, quad[1:] + quad[:1], strict=True):
            by_edge.setdefault(frozenset(edge), []).append(number)
    todo = [int(np.flatnonzero((quads == seed).any(axis=1))[0])]
    seen = set(todo)
    while todo:
        quad = quads[todo.pop()].tolist()
        for edge in zip(quad, quad[1:] + quad[:1], strict=True):
            if frozenset(edge) not in closed:
                fresh = [n for n in by_edge[frozenset(edge)] if n not in seen]
                seen.update(fresh)
                todo.extend(fresh)
    return quads[sorted(seen)]


def lip_strip(upper: list[int], lower: list[int], mirror: Ints) -> list[tuple[int, int, int]]:
    """Triangles that close the mouth: the right half is zipped, the left half mirrored.

    The chains have different lengths; whichever lags in relative position advances.
    """
    top, low = upper[: len(upper) // 2 + 1], lower[: len(lower) // 2 + 1]
    i = j = 1
    half = [(top[0], low[1], top[1])]
    while i < len(top) - 1 or j < len(low) - 1:
        if j == len(low) - 1 or (i < len(top) - 1 and i / (len(top) - 1) <= j / (len(low) - 1)):
            half.append((top[i], low[j], top[i + 1]))
            i += 1
        else:
            half.append((top[i], low[j], low[j + 1]))
            j += 1
    return half + [(int(mirror[a]), int(mirror[c]), int(mirror[b])) for a, b, c in half]


def patch_polygons(loop: list[int], first: int) -> list[tuple[int, ...]]:
    """Polygons of one eye patch whose vertices count from `first`, along the loop's direction."""
    rings = [loop] + [
        list(range(first + k * N_LOOP, first + (k + 1) * N_LOOP)) for k in range(1 + len(RINGS_MM))
    ]
    polygons: list[tuple[int, ...]] = []
    for outer, inner in pairwise(rings):
        for i in range(N_LOOP):
            j = (i + 1) % N_LOOP
            polygons.append((outer[i], outer[j], inner[j], inner[i]))
    pole = first + N_PATCH - 1
    last = rings[-1]
    polygons += [  # quads, two steps of the ring at a time: no fan of slivers at the pupil
        (last[i], last[i + 1], last[(i + 2) % N_LOOP], pole) for i in range(0, N_LOOP, 2)
    ]
    return polygons


def build_base(neutral: Array, quads: Ints, topology: dict) -> BaseMesh:
    """Crop the body (neutral (19158, 3), quads (Q, 4) in hm08 numbers) and close its openings."""
    loops = [topology[k] for k in ("neck_loop", "eye_loop_left", "eye_loop_right")]
    mouth = topology["mouth_upper"] + topology["mouth_lower"][-2:0:-1]
    head = flood(quads, topology["seed_vertex"], [*loops, mouth])
    kept = np.unique(head)
    number = {int(v): n for n, v in enumerate(kept)}
    mirror_head = nearest_mirror(neutral[kept], 1e-9)

    left = [number[v] for v in topology["eye_loop_left"]]
    polygons: list[tuple[int, ...]] = [tuple(number[v] for v in quad) for quad in head.tolist()]
    used = {e for p in polygons for e in zip(p, p[1:] + p[:1], strict=True)}
    if (left[0], left[1]) in used:  # a patch must run against the skin along their common edge
        left.reverse()
    right = [int(mirror_head[v]) for v in left]
    first_left, first_right = len(kept), len(kept) + N_PATCH
    polygons += patch_polygons(left, first_left)
    polygons += [p[::-1] for p in patch_polygons(right, first_right)]
    strip = lip_strip(
        [number[v] for v in topology["mouth_upper"]],
        [number[v] for v in topology["mouth_lower"]],
        mirror_head,
    )
    if any(e in used for t in strip for e in zip(t, t[1:] + t[:1], strict=True)):
        strip = [(a, c, b) for a, b, c in strip]
    polygons += strip

    patch = np.arange(N_PATCH)
    mirror = np.concatenate([mirror_head, first_right + patch, first_left + patch])
    base = BaseMesh(
        kept=kept,
        polygons=tuple(polygons),
        eye_loops=np.array([left, right]),
        mouth_loop=np.array([number[v] for v in mouth]),
        neck_loop=np.array([number[v] for v in topology["neck_loop"]]),
        mirror=mirror,
        eyes=(range(first_left, first_right), range(first_right, first_right + N_PATCH)),
    )
    check_surface(base.polygons, n_border=len(base.neck_loop))
    return base


def check_surface(polygons: tuple[tuple[int, ...], ...], n_border: int) -> None:
    """Raise unless the polygons form an oriented surface with a border of n_border edges."""
    directed = [e for p in polygons for e in zip(p, p[1:] + p[:1], strict=True)]
    if len(set(directed)) != len(directed):
        raise ValueError("an edge is used twice in one direction")
    present = set(directed)
    border = sum((b, a) not in present for a, b in directed)
    if border != n_border:
        raise ValueError(f"border has {border} edges, expected {n_border}")


def add_eyes(base: BaseMesh, head: Array, balls: Array) -> Array:
    """Base vertices (n, B, 3) of n people from head (n, H, 3) and eyeballs (n, 2, 72, 3), in dm.

    Each patch lies on the sphere of its eyeball and starts at the socket's edge, so that the head
    stays one surface. It is not linear in the shape; it comes before the statistics.
    """
    parts = [head]
    for side in range(2):
        centre = balls[:, side].mean(axis=1)[:, None]  # (n, 1, 3)
        radius = np.linalg.norm(balls[:, side] - centre, axis=2).mean(axis=1)[:, None]  # (n, 1)
        away = head[:, base.eye_loops[side]] - centre  # (n, 28, 3)
        away /= np.linalg.norm(away, axis=2, keepdims=True)
        angle = np.arccos(np.clip(away[..., 2], -1.0, 1.0))  # from the front pole, (n, 28)
        sideways = away * [1.0, 1.0, 0.0]
        sideways /= np.linalg.norm(sideways, axis=2, keepdims=True)
        inner = [
            np.minimum(mm / 100.0 / radius, share * angle)
            for mm, share in zip(RINGS_MM, LID, strict=True)
        ]
        for theta in [0.5 * (angle + inner[0]), *inner]:
            direction = np.sin(theta)[..., None] * sideways
            direction[..., 2] = np.cos(theta)
            parts.append(centre + radius[..., None] * direction)
        parts.append(centre + radius[..., None] * np.array([0.0, 0.0, 1.0]))
    return np.concatenate(parts, axis=1)


def catmull_clark(polygons: tuple[tuple[int, ...], ...], n: int) -> tuple[sparse.csr_array, Ints]:
    """One step: operator (N, n) whose rows sum to 1, and the quads (Q, 4) of the fine mesh.

    Fine vertices: the n old ones (same numbers), then one per edge, then one per polygon.
    """
    edges = sorted({(min(e), max(e)) for p in polygons for e in zip(p, p[1:] + p[:1], strict=True)})
    edge_number = {e: k for k, e in enumerate(edges)}
    n_edges, n_faces = len(edges), len(polygons)

    rows = np.repeat(np.arange(n_faces), [len(p) for p in polygons])
    columns = np.concatenate(polygons)
    share = np.concatenate([np.full(len(p), 1.0 / len(p)) for p in polygons])
    face_points = sparse.csr_array((share, (rows, columns)), shape=(n_faces, n))

    touching = np.array(
        [  # (edge, face) incidences
            (edge_number[min(e), max(e)], k)
            for k, p in enumerate(polygons)
            for e in zip(p, p[1:] + p[:1], strict=True)
        ]
    )
    ends = np.array(edges)
    middle = sparse.csr_array(
        (np.full(2 * n_edges, 0.5), (np.repeat(np.arange(n_edges), 2), ends.ravel())),
        shape=(n_edges, n),
    )
    n_touching = np.bincount(touching[:, 0], minlength=n_edges)
    inside = n_touching == 2
    edge_face = sparse.csr_array(
        (0.5 * inside[touching[:, 0]], (touching[:, 0], touching[:, 1])), shape=(n_edges, n_faces)
    )
    weight = sparse.diags_array(np.where(inside, 0.5, 1.0))
    edge_points = weight @ middle + 0.5 * (edge_face @ face_points)

    on_border = np.zeros(n, dtype=bool)
    on_border[ends[~inside].ravel()] = True
    valence = np.bincount(ends.ravel(), minlength=n).astype(float)
    around_faces = (face_points.astype(bool).astype(float)).T  # (n, F)
    n_around = np.asarray(around_faces.sum(axis=1)).ravel()
    around_edges = sparse.csr_array(
        (np.ones(2 * n_edges), (ends.ravel(), np.repeat(np.arange(n_edges), 2))),
        shape=(n, n_edges),
    )
    smooth = (
        sparse.diags_array(np.where(on_border, 0.0, 1.0 / (valence * n_around)))
        @ (around_faces @ face_points)
        + sparse.diags_array(np.where(on_border, 0.0, 2.0 / valence**2)) @ (around_edges @ middle)
        + sparse.diags_array(np.where(on_border, 0.0, (valence - 3.0) / valence))
    )
    border_ends = ends[~inside]
    crease = sparse.csr_array(
        (
            np.full(2 * len(border_ends), 0.125),
            (border_ends.ravel(), border_ends[:, ::-1].ravel()),
        ),
        shape=(n, n),
    ) + sparse.diags_array(np.where(on_border, 0.75, 0.0))
    operator = sparse.csr_array(sparse.vstack([smooth + crease, edge_points, face_points]))
    operator.eliminate_zeros()
    operator.sort_indices()

    quads = []
    for k, p in enumerate(polygons):
        for before, here, after in zip(p[-1:] + p[:-1], p, p[1:] + p[:1], strict=True):
            quads.append(
                (
                    here,
                    n + edge_number[min(here, after), max(here, after)],
                    n + n_edges + k,
                    n + edge_number[min(before, here), max(before, here)],
                )
            )
    return operator, np.array(quads)


def split_quads(polygons: Ints | tuple[tuple[int, ...], ...], vertices: Array) -> Ints:
    """Triangles (F, 3): each quad is cut along its shorter diagonal on `vertices` (n, 3).

    Lengths are compared in whole micrometres, so mirrored quads are cut alike.
    """
    triangles = []
    for polygon in polygons:
        if len(polygon) == 3:
            triangles.append(tuple(polygon))
            continue
        a, b, c, d = (int(v) for v in polygon)
        first, second = (
            round(1e6 * float(np.linalg.norm(vertices[p] - vertices[q])))
            for p, q in ((a, c), (b, d))
        )
        if first <= second:
            triangles += [(a, b, c), (a, c, d)]
        else:
            triangles += [(a, b, d), (b, c, d)]
    return np.array(triangles)
