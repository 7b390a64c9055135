"""A person's own photograph: the picture, its points, and what they become. In memory alone, never written anywhere.

There is no true face: the fit at 60 cm stands in for it, and everything that is measured is measured to that. What is
computed of a photograph is remembered in its own `memo` and goes with it; no cache of the page holds any of it.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

import faceambig as fa
from faceambig.arrays import Array, read_only
from faceambig.compose import (
    CLAY,
    Face,
    bent,
    compose,
    compose_row,
    curves,
    head,
    measure,
    named_view,
    photo_of_fit,
    pivot,
    shown_surface,
    stand_in,
)
from faceambig.flex import FlexibilityModes, plausible_limit
from faceambig.io.landmarks import parse_landmarks
from faceambig.io.pictures import WEB_FORMATS, decode_picture
from faceambig.model import FaceModel, Subject
from faceambig.observation import FLATTEST, MIN_POINTS
from faceambig.scene import Curves, Numbers, Photo, Scene

from .actions import ROW_DISTANCES
from .fields import FIELDS, MODES
from .fits import model
from .state import DEFAULT, Fitting, ViewState
from .text import centimetres, movement, numeral, percent_number, say
from .told import LETTERS

REFERENCE = 0.6  # metres: of the fit that stands in for the true face
LARGEST = 1600  # pixels of the longer side that are kept: 7.7 MB; a face is found and coloured in them as well
MAX_PIXELS = 40_000_000
QUALITY = 85  # of the JPEG on the page
# Points of Farkas that are asked for, by the name of their words: twelve, and what may follow
TWELVE = (
    "ex_r", "en_r", "en_l", "ex_l", "prn", "al_r", "al_l", "ch_r", "ch_l", "gn", "t_r", "t_l",
)  # fmt: skip
MORE = ("p_r", "p_l", "se", "sn", "ls", "li", "sba_r", "sba_l")
NAMED = (*TWELVE, *MORE)
ROOM = 0.45  # of the extent of the points, left on each side of the face in its part of the photo

_T = TypeVar("_T")
_decoding = threading.Lock()  # 40 megapixels take up to 0.5 GB on the way: one at a time


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class Taken:
    """A picture as it is kept: upright, at most LARGEST pixels long."""

    rgb: NDArray[np.uint8]  # (H, W, 3) sRGB
    jpeg: bytes  # the same, for the page
    name: str
    scale: float  # pixels here for one of the file
    file_size: tuple[int, int]  # width, height of the file, upright
    focal_px: float | None  # pixels here, as EXIF has it; None: not told

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, pixels."""
        return self.rgb.shape[1], self.rgb.shape[0]


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class OwnPhoto:
    """A photograph and its points. L landmarks. Another point is another OwnPhoto of the same picture."""

    taken: Taken
    scheme: str
    names: tuple[str, ...]  # L names of the points in the scheme
    points: Array  # (L, 2) pixels of the kept picture; NaN: not placed, or not visible
    asked: tuple[str, ...] = ()  # names of points that are still to be placed, the next one first
    part: tuple[float, float, float, float] | None = None  # x, y, width, height shown; None: all
    words: str = ""  # where the points are from
    memo: dict[Any, Any] = field(init=False, repr=False, default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", read_only(self.points))

    @property
    def placed(self) -> int:
        """How many points there are."""
        return int(np.isfinite(self.points).all(axis=1).sum())


def read_photo(name: str, data: bytes) -> OwnPhoto:
    """The photograph of a file, no point on it yet; ValueError in the page's words if it is none that is read."""
    import cv2  # 75 ms to import: only where a picture is read

    try:
        with _decoding:
            picture = decode_picture(data, name=name, formats=WEB_FORMATS, max_pixels=MAX_PIXELS)
            width, height = picture.size
            scale = min(1.0, LARGEST / max(width, height))
            rgb = picture.rgb
            if scale < 1:
                small = max(1, round(scale * width)), max(1, round(scale * height))
                rgb = np.asarray(cv2.resize(rgb, small, interpolation=cv2.INTER_AREA))
    except ValueError as error:
        raise ValueError(say("own.unreadable")) from error
    jpeg = cv2.imencode(".jpg", rgb[:, :, ::-1], (cv2.IMWRITE_JPEG_QUALITY, QUALITY))[1].tobytes()
    focal = None if picture.focal_px is None else scale * picture.focal_px
    taken = Taken(read_only(rgb.astype(np.uint8)), jpeg, name, scale, (width, height), focal)
    return OwnPhoto(taken, "", (), np.zeros((0, 2)))


def on_scheme(
    own: OwnPhoto, faces: FaceModel, scheme: str, points: Array | None = None, **changes: Any
) -> OwnPhoto:
    """The photograph with the points of a scheme; None: none of them placed yet."""
    names = faces.scheme(scheme).points
    xy = np.full((len(names), 2), np.nan) if points is None else points
    return with_points(own, xy, scheme=scheme, names=names, **changes)


def with_points(own: OwnPhoto, points: Array, **changes: Any) -> OwnPhoto:
    """The photograph with other points. Nothing computed of the old ones is kept but the colours, as a first draft."""
    moved = replace(own, points=points, **changes)
    if "skin" in own.memo:
        moved.memo["skin"] = own.memo["skin"]
    return moved


def found(own: OwnPhoto, faces: FaceModel) -> OwnPhoto:
    """The photograph with the points that the networks find; ValueError in words if they see no face."""
    from faceambig.io.detect import detect_landmarks

    try:
        seen = detect_landmarks(own.taken.rgb, name=own.taken.name)
    except ValueError as error:
        raise ValueError(say("own.no_face")) from error
    words = say("own.found", points=int(np.isfinite(seen.points[:, 0]).sum()))
    if seen.n_faces > 1:
        words = f"{words} {say('own.faces', count=seen.n_faces)}"
    return closer(on_scheme(own, faces, seen.scheme, seen.points, asked=(), words=words))


def from_file(own: OwnPhoto, faces: FaceModel, name: str, data: bytes) -> OwnPhoto:
    """The photograph with the points of a landmark file, whose pixels are those of the picture's file."""
    read = parse_landmarks(data, name=name, image_size=own.taken.file_size, model=faces)
    words = say("own.from_file", words=read.words)
    return closer(
        on_scheme(own, faces, read.scheme, own.taken.scale * read.points, asked=(), words=words)
    )


def moved(own: OwnPhoto, index: int, x: float, y: float) -> OwnPhoto:
    """The photograph with one point elsewhere, NaN: nowhere; unchanged if there is no such point."""
    if not 0 <= index < len(own.points):
        return own
    points = own.points.copy()
    width, height = own.taken.size
    points[index] = np.clip(x, 0, width), np.clip(y, 0, height)  # NaN stays NaN
    return with_points(own, points)


def closer(own: OwnPhoto) -> OwnPhoto:
    """The photograph cut to the face, as far as the points tell where it is."""
    points = own.points[np.isfinite(own.points).all(axis=1)]
    if len(points) < 2:
        return replace_part(own, None)
    size = np.array(own.taken.size, dtype=np.float64)
    low, high = points.min(axis=0), points.max(axis=0)
    side = max(*(high - low), 0.1 * size.min()) * (1 + 2 * ROOM)
    extent = np.minimum(side, size)
    corner = np.clip(0.5 * (low + high) - 0.5 * extent, 0, size - extent)
    x, y, width, height = np.round([*corner, *extent]).tolist()
    return replace_part(own, (x, y, width, height))


def replace_part(own: OwnPhoto, part: tuple[float, float, float, float] | None) -> OwnPhoto:
    """The photograph with another part of it shown."""
    other = replace(own, part=part)
    other.memo.update(own.memo)
    return other


# ---------------------------------------------------------------- from points to a frame


def problem(own: OwnPhoto | None, state: ViewState | None = None) -> str:
    """Why no face can be fitted, in words; "" if one can. Without a state only the points are looked at."""
    if own is None:
        return say("own.none")
    points = own.points[np.isfinite(own.points).all(axis=1)]
    places = np.unique(points, axis=0)
    if len(places) < MIN_POINTS:
        return say("own.few", points=len(places), needed=MIN_POINTS)
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if spread[1] <= FLATTEST * spread[0]:
        return say("own.line")
    return (
        ""
        if state is None
        else _once(own, ("failed", state.model, state.fitting), lambda: _failed(own, state))
    )


def _failed(own: OwnPhoto, state: ViewState) -> str:
    """Why the solver refuses these points, such as those of a face from behind; "" if it does not."""
    try:
        for fitting in (state.fitting, state.fitting._replace(distance=REFERENCE)):
            _fit(own, state, fitting)
    except ValueError as error:
        return say("own.no_fit", cause=str(error).removeprefix("points: "))
    return ""


@dataclass(frozen=True, slots=True, eq=False)
class OwnFrame:
    """What one browser shows of its own photograph."""

    scene: Scene
    sliders: tuple[
        tuple[str, tuple[tuple[float, str], ...]], ...
    ] = ()  # label, marks: of the modes


def own_frame(own: OwnPhoto | None, state: ViewState, draft: bool) -> OwnFrame:
    """What a browser shows of its own photograph; the average face as long as none can be fitted.

    A draft has neither curves nor new colours.
    """
    if state.data != "points":
        raise ValueError(say("own.only_points"))
    if own is None or problem(own, state):
        return OwnFrame(_average(own, state))
    fitting = state.fitting
    subject = reference(own, state, draft)
    if state.show == "row":
        return OwnFrame(_row(own, state, subject))
    face = own_face(own, state, fitting, subject)
    scene = _scene(own, state, subject, face, None if draft else own_curves(own, state))
    if draft:
        return OwnFrame(scene)
    return OwnFrame(
        scene, _sliders(_modes(own, state, fitting, state.flex_from + MODES - 1), state.flex_from)
    )


def _sliders(
    modes: FlexibilityModes, first: int
) -> tuple[tuple[str, tuple[tuple[float, str], ...]], ...]:
    """What the sliders of the modes from `first` on say; where plausible faces end."""
    sliders = []
    for letter, k in zip(LETTERS, range(first - 1, len(modes.words)), strict=False):
        low, high = FIELDS["flex"].low, FIELDS["flex"].high
        ends = tuple((round(mm, 2), "") for mm in modes.reach(k) if low <= mm <= high)
        sliders.append((say("flex.slider", letter=letter, words=movement(modes.words[k])), ends))
    return tuple(sliders)


def reference(own: OwnPhoto, state: ViewState, draft: bool) -> Subject:
    """The fit at 60 cm, which stands in for the true face, in the colours of the photograph."""
    from faceambig.texture import sample_texture

    fit = _fit(own, state, state.fitting._replace(distance=REFERENCE))
    if not draft:
        key = ("skin", state.model, fit.options)
        colours = _once(own, key, lambda: sample_texture(fit, own.taken.rgb).colours)
        own.memo["skin"] = colours
    colours = own.memo.get("skin")
    if colours is not None and len(colours) != fit.model.n_vertices:
        colours = None  # of another model's mesh
    return stand_in(fit, say("own.reference"), colours)


def own_curves(own: OwnPhoto, state: ViewState) -> Curves:
    """d_L, and the difference to the fit at 60 cm, over all distances."""
    return own_sweep(own, state)[1]


def own_sweep(own: OwnPhoto, state: ViewState) -> tuple[fa.Sweep, Curves]:
    """The sweep behind the curves, and the curves."""
    fitting = state.fitting._replace(distance=None)

    def computed() -> tuple[fa.Sweep, Curves]:
        sweep = fa.sweep_distance(
            model(state.model), _observation(own), modes=_count(fitting), box=fitting.box,
            noise_percent=fitting.prior, tolerance=1e-6,
        )  # fmt: skip
        return sweep, curves(reference(own, state, draft=True), sweep, None)

    return _once(own, ("curves", state.model, fitting), computed)


def told_distance(own: OwnPhoto | None, state: ViewState) -> float | None:
    """Metres from the camera that the focal length in the file means, with the fitted scale; None where it tells none.

    f = s t_z: a lens of f pixels that shows the face with s pixels a metre stands t_z away (MATH.md 1). None too where
    that is no distance that can be assumed: the picture is then cropped or zoomed.
    """
    if own is None or own.taken.focal_px is None or problem(own, state):
        return None
    metres = own.taken.focal_px / _fit(own, state, state.fitting).camera.s
    return metres if FIELDS["distance"].low <= metres <= FIELDS["distance"].high else None


def _once(own: OwnPhoto, key: Any, make: Callable[[], _T]) -> _T:
    """What `make` gives, remembered as long as these points."""
    if key not in own.memo:
        own.memo[key] = make()
    return own.memo[key]


def _observation(own: OwnPhoto) -> fa.Observation:
    return fa.Observation(own.points, own.scheme, image_size=own.taken.size)


def _count(fitting: Fitting) -> int | None:
    """A setting left alone is the library's default, which suits smaller models too."""
    return None if fitting.modes == DEFAULT.modes else fitting.modes


def _fit(own: OwnPhoto, state: ViewState, fitting: Fitting) -> fa.Fit:
    def computed() -> fa.Fit:
        return fa.fit(
            model(state.model), _observation(own),
            camera="orthographic" if fitting.distance is None else "perspective",
            distance=fitting.distance, modes=_count(fitting), box=fitting.box,
            noise_percent=fitting.prior,
        )  # fmt: skip

    return _once(own, ("fit", state.model, fitting), computed)


def _modes(own: OwnPhoto, state: ViewState, fitting: Fitting, count: int) -> FlexibilityModes:
    how = "algebraic" if state.flex_at == "dlt" else "reprojection"

    def computed() -> FlexibilityModes:
        fit = _fit(own, state, fitting)
        return fa.flexibility_modes(fit.model, fit, count=count, linearisation=how)

    return _once(own, ("modes", state.model, fitting, how, count), computed)


def own_face(own: OwnPhoto, state: ViewState, fitting: Fitting, subject: Subject) -> Face:
    """The fitted face, bent as the state says, measured against the reference."""
    if state.draw is not None or state.extreme is not None:
        raise ValueError(say("own.no_draw"))
    fit = _fit(own, state, fitting)
    if not state.flex:
        return measure(subject, fit)
    last = max(mode for mode, _ in state.flex)
    modes = _bending(own, state, fitting, len(fit.alpha))
    by_mode = dict(state.flex)
    amounts = [by_mode.get(mode, 0.0) for mode in range(1, last + 1)]
    return measure(
        subject, fit, bent(modes, amounts),
        limit=max(plausible_limit(len(fit.alpha)), float(np.linalg.norm(fit.alpha))),
        flex=[(modes.words[mode - 1], mm) for mode, mm in state.flex],
    )  # fmt: skip


def _bending(own: OwnPhoto, state: ViewState, fitting: Fitting, count: int) -> FlexibilityModes:
    """The modes up to the last that is bent, of a fit with `count` coefficients."""
    last = max(mode for mode, _ in state.flex)
    if last > count:
        raise ValueError(f"flex: mode {last} of a fit with {count} modes")
    return _modes(own, state, fitting, last)


def own_alpha(own: OwnPhoto, state: ViewState, fit: fa.Fit) -> Array:
    """(S,) coefficients of the face shown, its bend included."""
    if not state.flex:
        return fit.alpha
    modes = _bending(own, state, state.fitting, len(fit.alpha))
    return fit.alpha + sum(mm * modes.directions[mode - 1] for mode, mm in state.flex)


def _scene(
    own: OwnPhoto, state: ViewState, subject: Subject, face: Face, plot: Curves | None
) -> Scene:
    hide = [name for name in state.hide if name != "actual"]  # nobody knows it
    surface = shown_surface(state.surface, state.show, hide)
    if surface == "spread":
        raise ValueError(say("own.no_spread"))
    fit = _fit(own, state, state.fitting._replace(distance=REFERENCE))
    scene = compose(
        subject,
        face,
        photo_of_fit(face.fit, own.taken.size, caption=say("own.caption")),
        titles=(say("own.head"), say("head.fit")),
        view=state.view,
        orbit=state.orbit or (0.0, 0.0),
        zoom=state.zoom,
        show=state.show,
        fade=state.fade,
        surface=state.surface,
        overlays=[name for name in state.overlays if name != "ghost"],  # of a true face
        error_scale=float(state.error_scale),
        hide=hide,
        true_camera=fit.camera,
        reference=say("own.reference"),
        curve=plot,
        legend_words=(say("own.legend"), say("legend.unmeasured")),
        note=say("own.note"),
    )
    return replace(scene, photo=_told(own, scene.photo))


def _told(own: OwnPhoto, picture: Photo) -> Photo:
    """The photograph with circles only where there are crosses, and its points by the names that were asked for."""
    return replace(
        picture,
        projected=np.where(np.isfinite(own.points), picture.projected, np.nan),
        names=tuple(say(f"point.{name}") if name in NAMED else name for name in own.names),
    )


def _row(own: OwnPhoto, state: ViewState, subject: Subject) -> Scene:
    """The reference and the fits at four distances, coloured by their difference to it."""
    faces = [
        own_face(own, state, state.fitting._replace(distance=d), subject) for d in ROW_DISTANCES
    ]
    titles = [say("head.assumed", distance=centimetres(d)) for d in ROW_DISTANCES]
    captions = [
        (
            (f"{say('number.in_line_d_l')} {percent_number(face.d_l_percent)}\u202f%", "d_l"),
            (f"{say('own.difference')} {numeral(f'{face.d_s_mm:.1f}')}\u202fmm", "d_s"),
        )
        for face in faces
    ]
    scene = compose_row(
        subject, faces, photo_of_fit(faces[-1].fit, own.taken.size, caption=say("own.caption")),
        titles=[say("own.head"), *titles], captions=[(), *captions],
        legend_words=(say("own.legend"), say("legend.unmeasured")), note=say("own.note"),
    )  # fmt: skip
    numbers = replace(scene.numbers, reference=say("own.reference"))
    return replace(scene, numbers=numbers, photo=_told(own, scene.photo))


def _average(own: OwnPhoto | None, state: ViewState) -> Scene:
    """The average face beside the photograph and the points that there are."""
    faces = model(state.model)
    clay = np.tile(np.array(CLAY, dtype=np.uint8), (faces.n_vertices, 1))
    nothing = Numbers(None, np.nan, np.nan, converged=True, plausible=True, eyes_meaning="")
    size, points = (500, 500), np.zeros((0, 2))
    names: tuple[str, ...] = ()
    if own is not None:
        size, points, names = own.taken.size, own.points, own.names
    view = state.view if state.view != "camera" else "front"
    return Scene(
        heads=(head(faces, "fit", say("own.average"), faces.mean, clay, slot=0.0),),
        views=(named_view(view, orbit=state.orbit or (0.0, 0.0), zoom=state.zoom),),
        photo=Photo(
            *size, observed=points, projected=np.full(points.shape, np.nan),
            names=tuple(say(f"point.{name}") if name in NAMED else name for name in names),
            caption="" if own is None else say("own.caption"), vertices=faces.mean, faces=faces.faces, colours=clay,
            occlusion=None, focal=1.0, principal=(0.5 * size[0], 0.5 * size[1]),
        ),
        numbers=nothing,
        pivot=pivot(faces),
    )  # fmt: skip
