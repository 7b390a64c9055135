"""Pictures of faces for a report: through the camera that explains a photograph, and from the side, in labelled rows.

Painted in software: a report needs no graphics library.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array
from ..camera import Camera, camera_points
from ..compose import pivot, skin
from ..compose.picture import DRAW_FROM
from ..model import Subject
from ..observation import Observation
from ..rotation import rotation_from_angles
from ..scene import Photo

Pixels = NDArray[np.uint8]
CELL = 210  # pixels of a face
LABEL = 30  # pixels of its words
GAP = 10
SIDE_DEG, SIDE_FROM, SIDE_ROOM = 90.0, 5.0, 0.34  # a profile: degrees, metres away, metres across


def seen_through(
    subject: Subject, vertices: Array, camera: Camera, observation: Observation
) -> Photo:
    """A face (N, 3) with a subject's colours, as `camera` sees it in the picture of `observation`."""
    cx, cy = observation.centre
    return _seen(subject, vertices, camera, observation.image_size or (CELL, CELL), (cx, cy))


def side_view(subject: Subject, vertices: Array, yaw_deg: float = SIDE_DEG) -> Photo:
    """A face (N, 3) with a subject's colours, turned by `yaw_deg`, from so far away that its shape is seen."""
    R = rotation_from_angles(yaw_deg, 0, 0)
    middle = R @ np.array(pivot(subject.model))
    camera = Camera(R, -middle[:2], CELL / SIDE_ROOM, 1 / SIDE_FROM)
    return _seen(subject, vertices, camera, (CELL, CELL), (CELL / 2, CELL / 2))


def _seen(
    subject: Subject,
    vertices: Array,
    camera: Camera,
    size: tuple[int, int],
    centre: tuple[float, float],
) -> Photo:
    none = np.zeros((0, 2))
    return Photo(
        width=size[0],
        height=size[1],
        observed=none,
        projected=none,
        names=(),
        caption="",
        vertices=camera_points(camera, vertices, DRAW_FROM),
        faces=subject.model.faces,
        colours=skin(subject),
        occlusion=subject.model.occlusion,
        focal=camera.focal if camera.focal is not None else camera.s * DRAW_FROM,
        principal=(float(centre[0]), float(centre[1])),
    )


def face_rows(rows: Sequence[Sequence[tuple[str, Photo]]], cell: int = CELL) -> Pixels:
    """(H, W, 3): faces in rows, with words above each."""
    from ..render.canvas import Canvas  # with OpenCV: only where something is drawn
    from ..render.painter import paint_photo
    from ..render.plots import INK
    from ..render.sheet import GROUND

    columns = max(len(row) for row in rows)
    size = (columns * (cell + GAP) + GAP, len(rows) * (cell + LABEL + GAP) + GAP)
    canvas = Canvas(size, 1.0, GROUND)
    for i, row in enumerate(rows):
        for j, (words, face) in enumerate(row):
            x, y = GAP + j * (cell + GAP), GAP + i * (cell + LABEL + GAP)
            canvas.text(x + cell / 2, y + 19, words, 14, INK, anchor="middle", most=cell)
            canvas.paste(x, y + LABEL, paint_photo(face, cell), radius=6)
    return canvas.pixels
