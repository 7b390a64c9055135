"""What is laid over heads: their landmarks, the rays of the camera that saw them, and that camera itself.

All in the axes of the head they belong to. The camera of the fitted face moves with it when it is laid on the true one.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, IntArray, vertex_normals
from ..camera import Camera
from ..model import FaceModel, Subject
from ..scene import Lines, Marks, Photo
from .face import Face, centre_of

OVERLAYS = ("points", "names", "errors", "rays", "pyramid", "ghost", "scale", "outline")
LIFT = 1.5e-3  # metres above the surface: else a mark's own triangle hides half of it
FARTHEST = 0.6  # metres from the head: a camera beyond is drawn here, with a break mark
PYRAMID = 0.08  # metres from the camera to the photograph in front of it
BREAK = 0.45  # metres from the head where the line to a camera beyond FARTHEST is broken
GAP, TOOTH = 0.012, 0.02  # metres: half the break, and half the length of its two strokes


class Station(NamedTuple):
    """A camera in the axes of the head it looks at."""

    R: Array  # (3, 3) rows: its right, down and forward in those axes
    centre: Array  # (3,) metres; of an orthographic camera a point as far away as is drawn
    focal: float | None  # pixels; None: orthographic
    s: float  # pixels per metre at the head
    far: bool  # beyond FARTHEST


def station(
    camera: Camera, rotation: Array | None = None, translation: Array | None = None
) -> Station:
    """Where a camera stands, for a head laid elsewhere by v -> rotation v + translation."""
    turn = np.eye(3) if rotation is None else rotation
    shift = np.zeros(3) if translation is None else translation
    if camera.kappa > 0:
        centre, focal = centre_of(camera), camera.focal
    else:  # its axis passes where t_xy is the middle of the picture
        centre = camera.R.T @ np.array([-camera.t[0], -camera.t[1], -2 * FARTHEST])
        focal = None
    far = camera.kappa * FARTHEST < 1 - 1e-9
    return Station(camera.R @ turn.T, turn @ centre + shift, focal, camera.s, far)


def marks(subject: Subject, face: Face, *, names: bool) -> tuple[Marks, Marks]:
    """The landmarks given in the photograph, on the true head and on the fitted one, a little above the surface."""
    model, observation = subject.model, face.observation
    seen = np.isfinite(observation.points.sum(axis=1))
    at = observation.vertices(model)[seen]
    words: tuple[str, ...] = ()
    if names and isinstance(observation.scheme, str):
        points = model.scheme(observation.scheme).points
        words = tuple(name for name, given in zip(points, seen.tolist(), strict=True) if given)
    elif names:
        words = tuple(str(vertex) for vertex in at)
    return (
        Marks("true", lifted(model, subject.vertices, at), "seen", words),
        Marks("fit", lifted(model, face.vertices, at), "d_l", words),
    )


def lifted(model: FaceModel, vertices: Array, at: IntArray) -> Array:
    """(L, 3) metres: vertices `at` (L,), LIFT along their normals."""
    used, faces, rows = _around(model, at.tobytes())
    return vertices[at] + LIFT * vertex_normals(vertices[used], faces)[rows]


@lru_cache(maxsize=8)
def _around(model: FaceModel, numbers: bytes) -> tuple[IntArray, NDArray[np.intp], IntArray]:
    """Vertices (n,) of the triangles that touch the numbered ones, those triangles, and the places of the numbered."""
    at = np.frombuffer(numbers, dtype=np.intp)
    wanted = np.zeros(model.n_vertices, dtype=bool)
    wanted[at] = True
    faces = model.faces[wanted[model.faces].any(axis=1)].astype(np.intp)
    used = np.union1d(faces.ravel(), at)
    return used, np.searchsorted(used, faces), np.searchsorted(used, at)


def rays(
    head: str,
    place: Station,
    photo: Photo,
    on_face: Array,
    tone: str,
    *,
    within: tuple[Array, float] | None,
) -> Lines:
    """From the camera through every cross of the photograph to the depth of its landmark `on_face` (L, 3) metres.

    within: (middle (3,), radius) metres of the ball they are cut off at; None: they begin at the camera.
    """
    seen = np.isfinite(photo.observed).all(axis=1)
    pixels, ends = photo.observed[seen] - photo.principal, on_face[seen]
    if place.focal is None:
        starts = place.centre + pixels / place.s @ place.R[:2]
        ways = np.tile(place.R[2], (len(ends), 1))
    else:
        starts = np.tile(place.centre, (len(ends), 1))
        ways = np.column_stack([pixels / place.focal, np.ones(len(ends))]) @ place.R
    depth = (ends - place.centre) @ place.R[2]
    ends = starts + depth[:, None] * ways
    if within is not None:
        starts = _entered(starts, ends, *within)
    return Lines("rays", head, np.stack([starts, ends], axis=1), tone)


def _entered(starts: Array, ends: Array, middle: Array, radius: float) -> Array:
    """(n, 3) where each way from a start to an end comes into the ball: the start itself if it is inside."""
    way, out = ends - starts, starts - middle
    a, b = (way * way).sum(axis=1), (way * out).sum(axis=1)
    root = np.sqrt(np.maximum(b * b - a * ((out * out).sum(axis=1) - radius**2), 0.0))
    share = np.clip((-b - root) / np.maximum(a, 1e-300), 0.0, 1.0)
    return starts + share[:, None] * way


def apex(place: Station) -> Array:
    """(3,) metres where a camera is drawn: its own place, or nearer on the line to the head if it is far away."""
    if not place.far:
        return place.centre
    return FARTHEST * place.centre / np.linalg.norm(place.centre)


def pyramid(head: str, place: Station, photo: Photo) -> Lines:
    """The camera's pyramid with the photograph as its base; the line to it is broken where it stands farther away."""
    tip = apex(place)
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * (photo.width, photo.height)
    offset = corners - photo.principal
    if place.focal is None:
        base = tip + PYRAMID * place.R[2] + offset / place.s @ place.R[:2]
        backs = base - PYRAMID * place.R[2]  # parallel rays: a box instead of a pyramid
    else:
        base = tip + PYRAMID * np.column_stack([offset / place.focal, np.ones(4)]) @ place.R
        backs = np.tile(tip, (4, 1))
    segments = [
        np.stack([backs, base], axis=1),
        np.stack([base, np.roll(base, -1, axis=0)], axis=1),
    ]
    if place.far:
        segments.append(_broken(place, tip))
    return Lines("pyramid", head, np.concatenate(segments), "dim")


def _broken(place: Station, tip: Array) -> Array:
    """(4, 2, 3) the line from the camera's picture to the head, interrupted by two slanted strokes."""
    towards = -tip / np.linalg.norm(tip)
    middle = -BREAK * towards
    near, far = middle + GAP * towards, middle - GAP * towards
    slant = TOOTH * (place.R[0] + 0.5 * place.R[2])
    return np.array(
        [
            [tip + PYRAMID * towards, far],
            [near, middle + 2 * TOOTH * towards],
            [far - slant, far + slant],
            [near - slant, near + slant],
        ]
    )
