"""The photograph of a Scene: a synthetic portrait or a real one, its points, and the fitted face in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array
from ..boundary import occluding_boundary
from ..camera import Camera, camera_points, project
from ..fitting import Fit
from ..model import Subject
from ..observation import Observation, eye_distance
from ..scene import Photo
from .colours import CLAY, skin
from .face import Face

DRAW_FROM = 3.0  # metres that stand in for the distance of an orthographic camera


def photo(
    subject: Subject,
    observation: Observation,
    camera: Camera,
    *,
    caption: str,
    draw_from: float = DRAW_FROM,
) -> Photo:
    """The photograph with its points, no fit yet. `draw_from`: metres that stand in for an orthographic distance."""
    size = observation.image_size
    if size is None:
        raise ValueError("image_size: the photograph's width and height are needed to draw it")
    cx, cy = observation.centre
    scheme = observation.scheme
    names = (
        subject.model.scheme(scheme).points
        if isinstance(scheme, str)
        else tuple(str(v) for v in scheme)
    )
    return Photo(
        width=size[0],
        height=size[1],
        observed=observation.points,
        projected=observation.points,
        names=names,
        caption=caption,
        vertices=camera_points(camera, subject.vertices, draw_from),
        faces=subject.model.faces,
        colours=skin(subject),
        occlusion=subject.model.occlusion,
        focal=camera.focal if camera.focal is not None else camera.s * draw_from,
        principal=(float(cx), float(cy)),
    )


def photo_of_fit(
    fit: Fit,
    size: tuple[int, int],
    *,
    draw_from: float = DRAW_FROM,
    caption: str = "",
    pixels: NDArray[np.uint8] | None = None,
) -> Photo:
    """A real photograph of `size` (width, height): its points, and of the face only what was fitted, in clay.

    pixels: (height, width, 3) sRGB, drawn as the photograph; ValueError if they are of another size.
    """
    model, camera, observation = fit.model, fit.camera, fit.observation
    cx, cy = observation.centre
    if pixels is not None and pixels.shape != (size[1], size[0], 3):
        raise ValueError(
            f"pixels: expected shape {(size[1], size[0], 3)} of a picture of {size[0]} x {size[1]}, "
            f"found {pixels.shape}"
        )
    scheme = observation.scheme
    return Photo(
        width=size[0],
        height=size[1],
        observed=observation.points,
        projected=fit.projected(),
        names=model.scheme(scheme).points
        if isinstance(scheme, str)
        else tuple(str(vertex) for vertex in scheme),
        caption=caption,
        vertices=camera_points(camera, fit.vertices(), draw_from),
        faces=model.faces,
        colours=np.tile(np.array(CLAY, dtype=np.uint8), (model.n_vertices, 1)),
        occlusion=model.occlusion,
        focal=camera.focal if camera.focal is not None else camera.s * draw_from,
        principal=(float(cx), float(cy)),
        pixels=pixels,
    )


def with_fit(picture: Photo, face: Face, *, whole: bool, draw_from: float = DRAW_FROM) -> Photo:
    """The photograph with the fitted face's points, and with the fitted face itself if `whole`."""
    if not whole:
        return replace(picture, projected=face.projected)
    camera = face.camera
    return replace(
        picture,
        projected=face.projected,
        fit_vertices=camera_points(camera, face.own_vertices, draw_from),
        fit_focal=camera.focal if camera.focal is not None else camera.s * draw_from,
        fit_eyes=_eyes(face),
    )


def _eyes(face: Face) -> float:
    """The eye distance of the projected points for that of the observed ones; 1 where an eye has no point."""
    scheme = face.observation.scheme
    if not isinstance(scheme, str):
        return 1.0
    rows = face.fit.model.scheme(scheme)
    share = eye_distance(face.projected, rows) / eye_distance(face.observation.points, rows)
    return float(share) if np.isfinite(share) and share > 0 else 1.0


def outline(face: Face) -> Array:
    """(n, 2) pixels: the fitted face's visible occluding outline in the photograph; NaN rows part its pieces."""
    model, camera = face.fit.model, face.camera
    boundary = occluding_boundary(model, face.own_vertices, camera)
    seen = np.zeros(model.n_vertices, dtype=bool)
    seen[boundary.vertices[boundary.visible]] = True
    edges = boundary.edges[seen[boundary.edges].all(axis=1)]
    pieces = _chains([(a, b) for a, b in edges.tolist()])
    if not pieces:
        return np.zeros((0, 2))
    order = [vertex for piece in pieces for vertex in (*piece, -1)][:-1]
    numbers = np.array(order)
    xy = project(camera, face.own_vertices[numbers]) + face.fit.observation.centre
    xy[numbers < 0] = np.nan
    return xy


def _chains(edges: list[tuple[int, int]]) -> list[list[int]]:
    """Vertex numbers along each line that the edges make, every edge once; a closed line ends where it began."""
    beside: dict[int, list[int]] = {}
    for a, b in edges:
        beside.setdefault(a, []).append(b)
        beside.setdefault(b, []).append(a)
    lines = []
    # Loose ends and branches first: what is left then are closed lines
    for start in sorted(beside, key=lambda vertex: len(beside[vertex]) % 2 == 0):
        while beside[start]:
            line = [start]
            while beside[line[-1]]:
                following = beside[line[-1]].pop()
                beside[following].remove(line[-1])
                line.append(following)
            lines.append(line)
    return lines
