"""Colours of a fitted face from its photograph: seen where the camera saw the skin, else mirrored, else filled.

A photograph shows one side of a head. A vertex that faces the camera and is not hidden takes the colour of its pixel.
Of the others, one whose mirror image was seen takes that colour: heads are nearly symmetric in colour. Light is not, so
along the seam the mirrored side is brought to the light of the seen one, and keeps its own farther away. What neither
side shows is filled from the nearest vertices that have a colour. `Texture.source` says which is which, and every file
written from it says so in words.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu
from scipy.spatial import KDTree

from .arrays import Array, IntArray, read_only, vertex_normals
from .camera import Camera, project
from .fitting import Fit
from .model import FaceModel
from .visibility import visible_vertices

FACING = 0.5  # cosine to the ray: turned away by more than 60 degrees, a pixel is soon the ground's
PAIRED = 0.004  # metres between a vertex and the mirror image of its partner, at most
SEAM = 0.03  # metres over which the light of a seam fades out
FINEST = 0.003  # metres over which it is averaged
SKIN = 64.0  # brightness from which on a colour takes all of that light: black hair stays black
NEIGHBOURS = 8  # vertices whose colours a filled one blends


class Source(IntEnum):
    """Where a vertex has its colour from."""

    FILLED = 0
    MIRRORED = 1
    SEEN = 2


@dataclass(frozen=True, slots=True, eq=False)
class Texture:
    """Colours of the vertices of one fitted face. N vertices."""

    colours: NDArray[np.uint8]  # (N, 3) sRGB
    source: NDArray[np.uint8]  # (N,) of Source

    def __post_init__(self) -> None:
        object.__setattr__(self, "colours", read_only(self.colours))
        object.__setattr__(self, "source", read_only(self.source))

    def count(self, source: Source) -> int:
        """How many vertices have their colour from `source`."""
        return int((self.source == source).sum())

    @property
    def words(self) -> str:
        """The origin of the colours in one sentence."""
        seen, mirrored, filled = (
            self.count(s) for s in (Source.SEEN, Source.MIRRORED, Source.FILLED)
        )
        return (
            f"colours (sRGB, with the photograph's light): {seen} of {len(self.source)} vertices sampled from the "
            f"photograph, {mirrored} mirrored from the other side (light matched at the seam), "
            f"{filled} filled from their neighbours"
        )


def sample_texture(fit: Fit, rgb: NDArray[np.uint8]) -> Texture:
    """The colours of `fit`'s face in the photograph `rgb` (H, W, 3), whose pixels its points count.

    ValueError if the picture is no such array or shows nothing of the face.
    """
    if rgb.ndim != 3 or rgb.shape[2] != 3 or rgb.dtype != np.uint8:
        raise ValueError(f"rgb: expected (H, W, 3) of 8 bits, found {rgb.shape} of {rgb.dtype}")
    vertices = fit.vertices()
    at = project(fit.camera, vertices) + fit.observation.centre
    inside = ((at >= 0) & (at <= (rgb.shape[1], rgb.shape[0]))).all(axis=1)
    seen = inside & facing(fit.camera, vertices, fit.model.faces)
    seen &= visible_vertices(fit.model.faces, vertices, fit.camera)
    if not seen.any():
        raise ValueError(
            "rgb: the fitted face lies outside the picture; are the points of this picture?"
        )
    colours = np.zeros((len(vertices), 3))
    colours[seen] = bilinear(rgb, at[seen])
    source = np.where(seen, Source.SEEN, Source.FILLED).astype(np.uint8)
    partner = mirrored_vertices(fit.model.mean)
    taken = ~seen & (partner >= 0) & seen[partner]
    both = seen & (partner >= 0) & seen[partner]
    # Differences, not ratios: skin in shadow is also redder, and multiplied it would glow
    gap = np.where(both[:, None], colours - colours[partner], 0.0)
    colours[taken] = colours[partner[taken]]
    source[taken] = Source.MIRRORED
    light = _spread(gap, both, taken, fit.model)
    light *= taken[:, None] * np.clip(colours.mean(axis=1, keepdims=True) / SKIN, 0.0, 1.0)
    colours = np.clip(colours + light, 0.0, 255.0)
    _fill(colours, source, fit.model)
    return Texture(colours.round().astype(np.uint8), source)


def _spread(
    value: Array, known: NDArray[np.bool_], taken: NDArray[np.bool_], model: FaceModel
) -> Array:
    """(N, 3) `value` (N, 3) of the vertices `known`, smoothed and carried to those `taken`; 0 elsewhere.

    Like heat that leaks away: (L + (h / SEAM)^2 + (h / FINEST)^2 K) d = (h / FINEST)^2 K value, with L the graph
    Laplacian over both kinds of vertices, K 1 at the known ones, h the mean edge.
    """
    d = np.zeros(value.shape)
    rows = np.flatnonzero(known | taken)
    edges = np.concatenate([model.faces[:, pair] for pair in ([0, 1], [1, 2], [2, 0])])
    edges = edges[(known | taken)[edges].all(axis=1)].astype(np.intp)
    if not len(edges) or not known.any():
        return d
    h = float(np.linalg.norm(model.mean[edges[:, 0]] - model.mean[edges[:, 1]], axis=1).mean())
    one = sparse.csr_array((np.ones(len(edges)), edges.T), shape=(len(d), len(d)))
    near = ((one + one.T) > 0).astype(np.float64)[rows][:, rows]
    held = (h / FINEST) ** 2 * known[rows]
    A = sparse.diags_array(near.sum(axis=1) + (h / SEAM) ** 2 + held) - near
    d[rows] = splu(sparse.csc_array(A)).solve(held[:, None] * value[rows])
    return d


def _fill(colours: Array, source: NDArray[np.uint8], model: FaceModel) -> None:
    """Give every FILLED row of `colours` (N, 3) the mean of its nearest coloured ones on the mean face, in place."""
    filled = source == Source.FILLED
    known = np.flatnonzero(~filled)
    near = min(NEIGHBOURS, len(known))
    gap, row = KDTree(model.mean[known]).query(model.mean[filled], k=[*range(1, near + 1)])
    weight = 1.0 / np.maximum(gap, 1e-9)
    weight /= weight.sum(axis=1, keepdims=True)
    colours[filled] = np.einsum("nk,nkc->nc", weight, colours[known[row]])


def bilinear(rgb: NDArray[np.uint8], at: Array) -> Array:
    """(K, 3) colours 0 to 255 of `rgb` (H, W, 3) at `at` (K, 2): x, y from the corner, pixel i spans i to i + 1."""
    height, width = rgb.shape[:2]
    x, y = np.clip(at - 0.5, 0, (width - 1, height - 1)).T
    left, top = (np.floor(v).astype(np.intp) for v in (x, y))
    right, below = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
    across, down = (x - left)[:, None], (y - top)[:, None]
    upper = (1 - across) * rgb[top, left] + across * rgb[top, right]
    lower = (1 - across) * rgb[below, left] + across * rgb[below, right]
    return (1 - down) * upper + down * lower


def mirrored_vertices(mean: Array) -> IntArray:
    """(N,) for each vertex of a mean face (N, 3) the one nearest to its mirror image; -1 if none is near.

    The plane of symmetry is upright from front to back; where it stands is found from the vertices themselves.
    """
    tree = KDTree(mean)
    middle = 0.5 * (mean[:, 0].min() + mean[:, 0].max())
    for _ in range(2):  # ears end a little differently; the median of all pairs does not mind
        _, partner = tree.query(mean * (-1, 1, 1) + (2 * middle, 0, 0))
        middle = float(np.median(0.5 * (mean[:, 0] + mean[partner, 0])))
    gap, partner = tree.query(mean * (-1, 1, 1) + (2 * middle, 0, 0))
    return np.where(gap <= PAIRED, partner, -1)


def facing(camera: Camera, vertices: Array, faces: NDArray[np.integer]) -> NDArray[np.bool_]:
    """(N,) whether the surface (N, 3) is turned towards the camera by at least FACING."""
    q = vertices @ camera.R.T
    # The ray to the point; at kappa = 0 the view direction itself (MATH.md 5)
    ray = np.column_stack([camera.kappa * (q[:, :2] + camera.t), 1 + camera.kappa * q[:, 2]])
    normals = vertex_normals(vertices, faces) @ camera.R.T
    return -np.einsum("nk,nk->n", normals, ray) >= FACING * np.linalg.norm(ray, axis=1)
