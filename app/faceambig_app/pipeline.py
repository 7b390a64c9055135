"""ViewState -> Frame: observation, fit, bend and Scene, each a pure function of the part of the state it needs.

Each step is memoised and bounded, shared by every browser: thirty pupils in one lesson cost one fit, and moving the
view never refits. Every fit starts from the closed-form pose of its own points, never from the last frame, so a face
does not depend on the way the slider took.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

import faceambig as fa
from faceambig.camera import Camera
from faceambig.compose import Face, compose, compose_row, curves, measure, photo
from faceambig.flex import FlexibilityModes, plausible_limit
from faceambig.io.files import replacing
from faceambig.model import FaceModel, Subject
from faceambig.observation import portrait_camera
from faceambig.scene import Curves, Photo, Scene

from .origin import origin
from .state import DEFAULT, Bend, Fitting, Look, Target, ViewState
from .text import centimetres, distance_text, percent_number, say

ROW_DISTANCES = (0.3, 0.6, 1.2, 2.4)  # metres, of the strip of faces
# What is composed today of what a state can ask for
SHOWS = ("both", "row")
SURFACES = ("skin", "difference")
VIEWS = ("front", "three_quarter", "side", "top", "camera")
PHOTO_FULL, PHOTO_DRAFT = 560, 200  # pixels wide, of the page's photograph


@dataclass(frozen=True, slots=True, eq=False)
class Photograph:
    """A synthetic photograph: who, with which camera, and the points it gave."""

    subject: Subject
    observation: fa.Observation
    camera: Camera


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """What one browser shows now."""

    state: ViewState
    scene: Scene
    flex_words: str  # what mode A moves; empty in a draft
    flex_reach: tuple[float, float]  # mm along mode A that give plausible faces


@lru_cache(maxsize=4)
def model(name: str) -> FaceModel:
    """The model of a name or path, loaded once."""
    return fa.load_model(name)


@lru_cache(maxsize=256)
def photograph(target: Target) -> Photograph:
    """The synthetic photograph of a target."""
    if isinstance(target.subject, str):
        raise ValueError("subject: photo: there is no photograph here, only the synthetic people")
    if target.data != "points":
        raise ValueError(f"data: {target.data} is not fitted here, only points")
    subject = model(target.model).subject(target.subject)
    pose = {
        "scheme": target.scheme,
        "yaw_deg": target.yaw,
        "pitch_deg": target.pitch,
        "roll_deg": target.roll,
    }
    observation = fa.observe(
        subject, distance=target.actual, noise_percent=target.noise, seed=target.seed, **pose
    )
    return Photograph(
        subject, observation, portrait_camera(subject, distance=target.actual, **pose)
    )


@lru_cache(maxsize=2048)
def fitted(target: Target, fitting: Fitting) -> fa.Fit:
    """The fit of a target's points."""
    taken = photograph(target)
    return fa.fit(
        taken.subject.model,
        taken.observation,
        camera="perspective" if fitting.distance is not None else "orthographic",
        distance=fitting.distance,
        modes=_modes(fitting),
        box=fitting.box,
        noise_percent=fitting.prior,
    )


def _modes(fitting: Fitting) -> int | None:
    """The modes a fit is asked for: a setting left alone is the library's default, which suits smaller models too."""
    return None if fitting.modes == DEFAULT.modes else fitting.modes


@lru_cache(maxsize=256)
def bending(target: Target, fitting: Fitting, flex_at: str, count: int) -> FlexibilityModes:
    """The `count` most flexible modes of a fit."""
    fit = fitted(target, fitting)
    # The fast solver's landmarks are those of the picture; the paper's, of the algebraic DLT
    linearisation = "algebraic" if flex_at == "dlt" else "reprojection"
    return fa.flexibility_modes(fit.model, fit, count=count, linearisation=linearisation)


@lru_cache(maxsize=256)
def face(target: Target, fitting: Fitting, bend: Bend) -> Face:
    """The fitted face, bent, measured against the true one; its words are of the mode bent most."""
    if bend.draw is not None:
        raise ValueError(f"draw: {bend.draw}: faces drawn from the posterior are not drawn here")
    fit = fitted(target, fitting)
    subject = photograph(target).subject
    if not bend.flex:
        return measure(subject, fit)
    last = max(mode for mode, _ in bend.flex)
    if last > len(fit.alpha):
        raise ValueError(f"flex: mode {last} of a fit with {len(fit.alpha)} modes")
    modes = bending(target, fitting, bend.flex_at, last)
    most, most_mm = max(bend.flex, key=lambda pair: abs(pair[1]))
    return measure(
        subject,
        fit,
        np.sum([mm * modes.directions[mode - 1] for mode, mm in bend.flex], axis=0),
        # A fit that is beyond the limit by itself is not blamed on the bend that leads back
        limit=max(plausible_limit(len(fit.alpha)), float(np.linalg.norm(fit.alpha))),
        flex_words=modes.words[most - 1],
        flex_mm=most_mm,
    )


@lru_cache(maxsize=64)
def curve(target: Target, fitting: Fitting) -> Curves:
    """d_L and d_S of a target over all distances; the fitting's own distance plays no part."""
    taken = photograph(target)
    sweep = fa.sweep_distance(
        taken.subject.model,
        taken.observation,
        modes=_modes(fitting),
        box=fitting.box,
        noise_percent=fitting.prior,
        tolerance=1e-6,  # d_L to 3e-6 points, d_S to 3e-4 mm: far below a pixel of the plot
    )
    return curves(taken.subject, sweep, target.actual)


def frame(state: ViewState, *, with_curves: bool = True) -> Frame:
    """Everything a browser shows of a state. with_curves=False leaves the plots out: they cost a sweep a target."""
    _drawn(state.look)
    if state.show == "row":
        return Frame(state, row(state), "", (0.0, 0.0))
    target, fitting = state.target, state.fitting
    taken = photograph(target)
    shown = face(target, fitting, state.bend)
    scene = _scene(
        target, shown, state.look, curve_of(state) if with_curves else None, _note(taken, target)
    )
    if not with_curves:
        return Frame(state, scene, "", (0.0, 0.0))
    modes = bending(target, fitting, state.flex_at, 1)
    return Frame(state, scene, modes.words[0], modes.reach(0))


def _drawn(look: Look) -> None:
    """ValueError for a look that no scene is composed of."""
    for name, ours in (("show", SHOWS), ("surface", SURFACES), ("view", VIEWS)):
        if (value := getattr(look, name)) not in ours:
            raise ValueError(f"{name}: {value} is not drawn here, only {', '.join(ours)}")


def curve_key(state: ViewState) -> tuple[Target, Fitting]:
    """What a state's curves depend on: not its assumed distance."""
    return state.target, state.fitting._replace(distance=None)


def curve_of(state: ViewState) -> Curves:
    """The curves of a state's target."""
    return curve(*curve_key(state))


@lru_cache(maxsize=64)
def photo_jpeg(target: Target, draft: bool) -> bytes:
    """The photograph as a JPEG for the page; a draft is small and coarse, for while a hand turns the head."""
    import cv2  # 75 ms to import: only where a picture is made

    from faceambig.render.painter import paint_photo

    taken, width = picture(target), PHOTO_FULL
    coarse = photograph(target).subject.model.coarse_faces
    if draft and coarse is not None:
        taken, width = replace(taken, faces=coarse), PHOTO_DRAFT
    rgb = paint_photo(taken, width)
    return cv2.imencode(".jpg", rgb[:, :, ::-1], (cv2.IMWRITE_JPEG_QUALITY, 88))[1].tobytes()


def row(state: ViewState) -> Scene:
    """The strip: the true head and the fits at ROW_DISTANCES, coloured by their difference."""
    target = state.target
    taken = photograph(target)
    faces = [face(target, state.fitting._replace(distance=d), state.bend) for d in ROW_DISTANCES]
    titles = [
        say("head.true"),
        *(say("head.assumed", distance=centimetres(d)) for d in ROW_DISTANCES),
    ]
    captions = [((_taken(target), "dim"),)]
    captions += [
        (
            (f"{say('number.d_l').lower()} {percent_number(f.d_l_percent)}\u202f%", "d_l"),
            (f"{say('number.d_s').lower()} {f.d_s_mm:.1f}\u202fmm", "d_s"),
        )
        for f in faces
    ]
    return compose_row(
        taken.subject,
        faces,
        picture(target),
        titles=titles,
        captions=captions,
        legend_words=(say("legend.difference"), say("legend.unmeasured")),
        note=_note(taken, target),
    )


def snapshot(
    state: ViewState,
    path: str | Path | None = None,
    *,
    width: int | None = None,
    height: int | None = None,
) -> np.ndarray:
    """The page's picture of a state, drawn off-screen: (H, W, 4) uint8 RGBA, and a PNG file if `path` is given."""
    from faceambig.render.overlay import (
        draw,
        encode_png,
    )  # pyrender and OpenCV only when a picture is asked for

    picture = draw(frame(state).scene, width, height)
    if path is not None:
        write(Path(path), encode_png(picture, origin(state, model(state.model))))
    return picture


def writable(path: Path) -> None:
    """ValueError if a file cannot be put at `path`: no such folder, or a folder itself."""
    if not path.parent.is_dir():
        raise ValueError(f"out: there is no folder {str(path.parent)!r}")
    if path.is_dir():
        raise ValueError(f"out: {str(path)!r} is a folder, not a file")


def write(path: Path, data: bytes) -> None:
    """The whole file or nothing: beside it first, then in its place. ValueError says why not."""
    writable(path)
    write_all({path: data})


def write_all(files: Mapping[Path, bytes]) -> None:
    """All files or none: each beside its place first, and only when all of them are there, in their places.

    ValueError says why not; of a full disk nothing is left.
    """
    write_pairs(files.items())


def write_pairs(files: Iterable[tuple[Path, bytes]]) -> None:
    """As `write_all`; the files are taken one after the other, so that they need not be in memory together."""
    path = None
    try:
        with ExitStack() as stack:
            for path, data in files:
                stack.enter_context(replacing(path)).write_bytes(data)
    except OSError as error:
        raise ValueError(f"out: cannot write {str(path)!r}: {error.strerror}") from error


def _scene(target: Target, shown: Face, look: Look, plot: Curves | None, note: str) -> Scene:
    taken = photograph(target)
    return compose(
        taken.subject,
        shown,
        picture(target),
        titles=(say("head.true"), say("head.fit")),
        view=look.view,
        surface=look.surface,
        curve=plot,
        legend_words=(say("legend.difference"), say("legend.unmeasured")),
        note=note,
    )


@lru_cache(maxsize=64)
def picture(target: Target) -> Photo:
    """The photograph of a target, without a fit's points."""
    taken = photograph(target)
    caption = say("app.taken", distance=distance_text(target.actual))
    return photo(taken.subject, taken.observation, taken.camera, caption=caption)


def _taken(target: Target) -> str:
    return say("head.taken", distance=centimetres(target.actual))


def _note(taken: Photograph, target: Target) -> str:
    noise = (
        say("note.noise", percent=f"{target.noise:g}") if target.noise else say("note.noise_free")
    )
    return say(
        "note.snapshot",
        points=len(taken.observation.points),
        model=taken.subject.model.name,
        subject=taken.subject.name,
        noise=noise,
    )
