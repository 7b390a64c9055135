"""From a fit to a Scene: the only place that decides what a picture shows. Page and snapshot draw what comes out.

The fitted head is laid on the true one rigidly (rotation and translation over the evaluation region, never scaled:
size is information), so what differs between the two heads is what d_S measures.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from .arrays import Array
from .camera import Camera, camera_points, project
from .fitting import Fit
from .metrics import HUMAN_TOLERANCE_PERCENT, mean_gap_percent, surface_difference
from .model import FaceModel, Subject
from .observation import Observation
from .scene import Curves, Head, Legend, Numbers, Photo, Scene, View
from .sweep import Sweep

HALF_HEIGHT = 0.165  # metres: a large head with its neck
SPACING = 0.26  # metres between two heads of the row: they never touch while turning
DIFFERENCE_MM = 15.0  # end of the difference scale
UNMEASURED = (176, 178, 184)  # grey of what is not in d_S
CLAY = (205, 172, 150)
# matplotlib's inferno (CC0) at 0, 0.1, ... 1; used reversed from 4 % to 78 %: light is small, dark is large
INFERNO = np.array(
    [
        (0, 0, 4), (22, 11, 57), (66, 10, 104), (106, 23, 110), (147, 38, 103), (188, 55, 84),
        (221, 81, 58), (243, 120, 25), (252, 165, 10), (246, 215, 70), (252, 255, 164),
    ],
    dtype=np.float64,
)  # fmt: skip
VIEWS: Mapping[str, tuple[float, float]] = {  # azimuth, elevation in degrees
    "front": (0.0, 0.0),
    "three_quarter": (-32.0, 6.0),
    "side": (-90.0, 0.0),
    "top": (0.0, 89.0),
}


@dataclass(frozen=True, slots=True, eq=False)
class Face:
    """A fitted face, bent or not, measured against the true one. N vertices, L landmarks."""

    fit: Fit
    vertices: Array  # (N, 3) metres, laid rigidly on the true face
    projected: Array  # (L, 2) pixels
    d_l_percent: float
    d_s_mm: float
    gaps_mm: Array  # (E,) distance to the true face on the evaluation region
    own_vertices: Array  # (N, 3) metres, in the fit's own model frame
    plausible: bool
    flex_words: str = ""
    flex_mm: float = 0.0


def measure(
    subject: Subject,
    fit: Fit,
    bend: Array | None = None,
    *,
    limit: float = np.inf,
    flex_words: str = "",
    flex_mm: float = 0.0,
) -> Face:
    """The face of a fit, its coefficients changed by `bend` (S,), against the true face.

    `limit` is the largest |alpha| of a face that still counts as plausible; flex_words and flex_mm say what bends it.
    """
    model, observation = fit.model, fit.observation
    alpha = fit.alpha if bend is None else fit.alpha + bend
    own = model.vertices(alpha)
    surface = surface_difference(own, subject.vertices, model.evaluation)
    projected = project(fit.camera, own[observation.vertices(model)]) + observation.centre
    gaps = (observation.points - projected)[observation.visible]
    return Face(
        fit=fit,
        own_vertices=own,
        vertices=own @ surface.rotation.T + surface.translation,
        projected=projected,
        d_l_percent=mean_gap_percent(gaps, fit.interocular_px),
        d_s_mm=surface.mean_mm,
        gaps_mm=1e3 * surface.distances,
        plausible=bool(np.linalg.norm(alpha) <= limit),
        flex_words=flex_words,
        flex_mm=flex_mm,
    )


def curves(subject: Subject, sweep: Sweep, true_distance: float) -> Curves:
    """d_L and d_S of every fit of a sweep against the true face."""
    faces = [measure(subject, fit) for fit in (*sweep.fits, sweep.orthographic)]
    return Curves(
        distances=sweep.distances,
        d_l_percent=np.array([face.d_l_percent for face in faces[:-1]]),
        d_s_mm=np.array([face.d_s_mm for face in faces[:-1]]),
        orthographic=(faces[-1].d_l_percent, faces[-1].d_s_mm),
        true_distance=true_distance,
        tolerance_percent=HUMAN_TOLERANCE_PERCENT,
    )


def photo(
    subject: Subject,
    observation: Observation,
    camera: Camera,
    *,
    caption: str,
    draw_from: float = 3.0,
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


def photo_of_fit(fit: Fit, size: tuple[int, int], *, draw_from: float = 3.0) -> Photo:
    """A real photograph of `size` (width, height): its points, and of the face only what was fitted, in clay."""
    model, camera, observation = fit.model, fit.camera, fit.observation
    cx, cy = observation.centre
    return Photo(
        width=size[0],
        height=size[1],
        observed=observation.points,
        projected=fit.projected(),
        names=tuple(str(vertex) for vertex in observation.vertices(model)),
        caption="",
        vertices=camera_points(camera, fit.vertices(), draw_from),
        faces=model.faces,
        colours=np.tile(np.array(CLAY, dtype=np.uint8), (model.n_vertices, 1)),
        occlusion=model.occlusion,
        focal=camera.focal if camera.focal is not None else camera.s * draw_from,
        principal=(float(cx), float(cy)),
    )


def with_fit(picture: Photo, face: Face, *, whole: bool, draw_from: float = 3.0) -> Photo:
    """The photograph with the fitted face's points, and with the fitted face itself if `whole`."""
    if not whole:
        return replace(picture, projected=face.projected)
    camera = face.fit.camera
    return replace(
        picture,
        projected=face.projected,
        fit_vertices=camera_points(camera, face.own_vertices, draw_from),
        fit_focal=camera.focal if camera.focal is not None else camera.s * draw_from,
    )


def numbers(face: Face) -> Numbers:
    """The numbers beside the heads."""
    fit = face.fit
    return Numbers(
        distance=fit.distance,
        d_l_percent=face.d_l_percent,
        d_s_mm=face.d_s_mm,
        converged=fit.converged,
        plausible=face.plausible,
        eyes_meaning=fit.interocular_meaning,
        flex_words=face.flex_words,
        flex_mm=face.flex_mm,
    )


def compose(
    subject: Subject,
    face: Face,
    picture: Photo,
    *,
    titles: tuple[str, str],
    view: str = "three_quarter",
    surface: str = "skin",
    curve: Curves | None = None,
    legend_words: tuple[str, str] = ("", ""),
    note: str = "",
) -> Scene:
    """True head and fitted head side by side, with the photograph, the numbers and the curves.

    view: a key of VIEWS, or "camera": the photograph itself. surface: "skin", or "difference" (d_S per vertex, mm).
    """
    model = subject.model
    difference = surface == "difference"
    true_colours = skin(subject)
    fit_colours = difference_colours(model, face.gaps_mm) if difference else true_colours
    if not face.plausible and not difference:
        fit_colours = greyed(fit_colours)
    heads = (
        head(model, "true", titles[0], subject.vertices, true_colours, slot=-SPACING / 2),
        head(
            model,
            "fit",
            titles[1],
            face.vertices,
            fit_colours,
            slot=SPACING / 2,
            lit=not difference,
        ),
    )
    return Scene(
        heads=heads,
        views=(named_view("front" if view == "camera" else view),),
        photo=with_fit(picture, face, whole=view == "camera"),
        pivot=pivot(model),
        numbers=numbers(face),
        curves=curve,
        legend=difference_legend(*legend_words) if difference else None,
        through_camera=view == "camera",
        note=note,
    )


def compose_row(
    subject: Subject,
    faces: Sequence[Face],
    picture: Photo,
    *,
    titles: Sequence[str],
    captions: Sequence[tuple[tuple[str, str], ...]],
    legend_words: tuple[str, str],
    note: str = "",
) -> Scene:
    """The true head and several fits in a row, coloured by their difference, from the front and from the side.

    titles and captions: one for the true head, then one a face; a caption line is (text, tone of scene.Head).
    """
    model = subject.model
    slots = SPACING * (np.arange(len(faces) + 1) - len(faces) / 2)
    heads = [
        head(
            model,
            "true",
            titles[0],
            subject.vertices,
            skin(subject),
            slot=slots[0],
            caption=captions[0],
        )
    ]
    for index, face in enumerate(faces, start=1):
        colours = difference_colours(model, face.gaps_mm)
        heads.append(
            head(
                model, f"fit{index}", titles[index], face.vertices, colours,
                slot=slots[index], caption=captions[index], lit=False,
            )
        )  # fmt: skip
    return Scene(
        heads=tuple(heads),
        views=(named_view("front"), named_view("side")),
        photo=picture,
        pivot=pivot(model),
        numbers=numbers(faces[-1]),
        legend=difference_legend(*legend_words),
        note=note,
    )


@lru_cache(maxsize=8)
def pivot(model: FaceModel) -> tuple[float, float, float]:
    """The middle of the mean head's height and depth, metres: heads that turn about it stay in their place."""
    low, high = model.mean.min(axis=0), model.mean.max(axis=0)
    return 0.0, float(low[1] + high[1]) / 2, float(low[2] + high[2]) / 2


def head(
    model: FaceModel,
    name: str,
    title: str,
    vertices: Array,
    colours: NDArray[np.uint8],
    *,
    slot: float,
    caption: tuple[tuple[str, str], ...] = (),
    lit: bool = True,
) -> Head:
    """One head of the row, with the model's triangles."""
    return Head(
        name=name,
        title=title,
        vertices=vertices,
        faces=model.faces,
        colours=colours,
        occlusion=model.occlusion,
        lit=lit,
        slot=float(slot),
        caption=caption,
        coarse_faces=model.coarse_faces,
    )


def named_view(name: str) -> View:
    """The viewer's place for a key of VIEWS."""
    if name not in VIEWS:
        raise ValueError(f"view: {name!r} is not one of {', '.join(VIEWS)} or camera")
    azimuth, elevation = VIEWS[name]
    return View(name, azimuth, elevation, HALF_HEIGHT)


def skin(subject: Subject) -> NDArray[np.uint8]:
    """(N, 3) sRGB: the subject's own colours, else the model's, else clay."""
    for colours in (subject.colours, subject.model.colours):
        if colours is not None:
            return colours
    return np.tile(np.array(CLAY, dtype=np.uint8), (subject.model.n_vertices, 1))


def greyed(colours: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The colours without their colour: a face that is no longer plausible."""
    grey = colours @ np.array([0.3, 0.59, 0.11])
    return np.repeat(grey.round().astype(np.uint8)[:, None], 3, axis=1)


def scale_colours(share: Array) -> NDArray[np.uint8]:
    """sRGB (n, 3) of the magnitude scale at share (n,) of its range, 0 to 1."""
    at = 10.0 * (0.96 - np.clip(share, 0.0, 1.0) * (0.96 - 0.22))
    return (
        np.stack([np.interp(at, np.arange(11), INFERNO[:, c]) for c in range(3)], axis=1)
        .round()
        .astype(np.uint8)
    )


def difference_colours(model: FaceModel, gaps_mm: Array) -> NDArray[np.uint8]:
    """(N, 3) sRGB: distance to the true face on the evaluation region (E,), grey elsewhere."""
    colours = np.empty((model.n_vertices, 3), dtype=np.uint8)
    colours[:] = UNMEASURED
    colours[slice(None) if model.evaluation is None else model.evaluation] = scale_colours(
        gaps_mm / DIFFERENCE_MM
    )
    return colours


def difference_legend(title: str, note: str) -> Legend:
    """The scale of difference_colours."""
    return Legend(
        title=title,
        colours=scale_colours(np.linspace(0.0, 1.0, 64)),
        low=0.0,
        high=DIFFERENCE_MM,
        ticks=(0.0, 5.0, 10.0, 15.0),
        note=note,
    )
