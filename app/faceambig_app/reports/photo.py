"""From a photograph to files: its points read or found, a face fitted, and overlay, meshes and numbers in a folder.

Nothing is written before everything is computed, and then all files or none.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

import faceambig as fa
from faceambig.arrays import Array
from faceambig.io import LandmarkFile
from faceambig.io.pictures import Picture, is_picture, picture_beside, read_picture

from ..files import write_pairs

NAMES = ("overlay.png", "face.obj", "face.ply", "face.glb", "fit.json")
HINTED = (0.2, 50.0)  # metres: distances that a hint may name


@dataclass(frozen=True, slots=True, eq=False)
class Given:
    """What a fit starts from."""

    observation: fa.Observation
    image_size_from: str  # in words
    landmarks: str  # what of them is used, in words
    picture: Picture | None  # None: only the points are known, and that suffices


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """A fit, and what to say of how it came about."""

    fit: fa.Fit
    converged: bool
    contours: dict[str, Any] | None  # status, iterations, pairs; None: not asked for


def given(
    file: Path,
    model: fa.FaceModel,
    *,
    landmarks: Path | None = None,
    auto: bool = False,
    image_size: tuple[int, int] | None = None,
    pixels: bool = False,
) -> Given:
    """The points of a photograph, and its pixels where they are needed.

    Parameters
    ----------
    file: a photograph, with `landmarks` or `auto` for its points; or a landmark file.
    pixels: the photograph is needed too; to a landmark file that is the picture of the same name beside it.

    Raises
    ------
    ValueError: files that do not belong together, are damaged (AssetError), or show no face.
    """
    if landmarks is not None and auto:
        raise ValueError("--landmarks and --auto: give one of them")
    if landmarks is None and not auto:
        if is_picture(file):
            raise ValueError(
                f"{file.name}: a picture; its points are read with --landmarks FILE or found with --auto"
            )
        read = fa.load_landmarks(file, image_size=image_size, model=model)
        observation = fa.Observation(read.points, read.scheme, image_size=read.image_size)
        picture = _beside(file) if pixels else None
        if picture is not None and read.image_size != picture.size:
            raise ValueError(
                f"--image-size: the picture beside {file.name} is {picture.size[0]} x {picture.size[1]}; leave it out"
            )
        return Given(observation, read.image_size_from, _words(read), picture)
    picture = read_picture(file)
    if image_size is not None:
        raise ValueError(
            f"--image-size: {picture.name} is given, {picture.size[0]} x {picture.size[1]}; leave it out"
        )
    if landmarks is None:
        scheme, (points, words) = "ibug68", _found(picture)
    else:
        read = fa.load_landmarks(landmarks, image_size=picture.size, model=model)
        points, scheme, words = read.points, read.scheme, _words(read)
    observation = fa.Observation(points, scheme, image_size=picture.size)
    return Given(observation, f"size of {picture.name}", words, picture)


def _words(read: LandmarkFile) -> str:
    return f"{read.words}; {read.scheme}, {read.unit}"


def _beside(file: Path) -> Picture:
    path = picture_beside(file)
    if path is None:
        raise ValueError(
            f"{file.name}: no picture of the same name beside it; give the photograph, and the points by --landmarks"
        )
    return read_picture(path)


def _found(picture: Picture) -> tuple[Array, str]:
    """(68, 2) points of the largest face in a picture, NaN for the jaw, which the networks place badly; and words."""
    from faceambig.io.detect import detect_landmarks

    found = detect_landmarks(picture.rgb, name=picture.name)
    others = "" if found.n_faces == 1 else f"; the largest of {found.n_faces} faces"
    return found.points, f"found by the networks, without the jaw{others}"


def fitted(model: fa.FaceModel, start: Given, *, contours: bool = False, **options: Any) -> Outcome:
    """The face of `start`, with the photograph's edges as contours if asked; `options` are those of `fa.fit`."""
    if not contours:
        fit = fa.fit(model, start.observation, **options)
        return Outcome(fit, fit.converged, None)
    if start.picture is None:
        raise ValueError("contours: the photograph is needed, not only its points")
    from faceambig.io.edges import canny_edges

    edges = canny_edges(start.picture.rgb)
    result = fa.contour_fit(model, start.observation, edges, **options)
    said = {
        "status": str(result.status),
        "iterations": result.iterations,
        "pairs": len(result.pairs),
    }
    ended = result.status.name != "MAX_ITERATIONS"
    return Outcome(result.fit, ended and result.fit.converged, said)


def contour_words(contours: Mapping[str, Any]) -> str:
    """How the contours came out, as a line."""
    if not contours["pairs"]:
        return "contours: no contour found; the fit is that of the landmarks alone"
    return (
        f"contours: {contours['status']} after {contours['iterations']} iterations, "
        f"{contours['pairs']} pairs of a contour vertex and an edge pixel"
    )


def exif_hint(picture: Picture, fit: fa.Fit) -> dict[str, float] | None:
    """The focal length EXIF tells, and the distance that follows with the fitted scale; None if it tells none.

    f = s t_z: a lens of f pixels that shows the face with s pixels a metre stands t_z away (MATH.md 1).
    """
    if picture.focal_35mm is None or picture.focal_px is None:
        return None
    return {
        "focal_35mm": picture.focal_35mm,
        "focal_px": picture.focal_px,
        "distance_hint_m": picture.focal_px / fit.camera.s,
    }


def hint_words(hint: Mapping[str, float]) -> str:
    """The hint as a line that says how to use it, and when not to."""
    metres = hint["distance_hint_m"]
    lens = f"EXIF: a lens of {hint['focal_35mm']:g} mm (35 mm equivalent), {hint['focal_px']:.0f} px here"
    if not HINTED[0] <= metres <= HINTED[1]:
        return f"{lens}; with the fitted scale that would be {metres:.3g} m: cropped or zoomed, so no hint"
    return (
        f"{lens}; with the fitted scale the camera was {100 * metres:.3g} cm away, unless the picture is cropped or "
        f"zoomed. Not used; to assume it: --distance {metres:.2f}"
    )


def folder(out: str, names: Iterable[str] = NAMES) -> Path:
    """The folder to write `names` to; ValueError if it cannot be one. It is made when there is something to write."""
    path = Path(out)
    if path.exists() and not path.is_dir():
        raise ValueError(f"out: {out!r} is a file, not a folder")
    if not path.parent.is_dir():
        raise ValueError(f"out: there is no folder {str(path.parent)!r}")
    if not os.access(path if path.exists() else path.parent, os.W_OK | os.X_OK):
        raise ValueError(f"out: {out!r}: no permission to write there")
    for name in names:
        if (path / name).is_dir():
            raise ValueError(
                f"out: {str(path / name)!r} is a folder, and a file of that name is to be written"
            )
    return path


def contents(
    picture: Picture, fit: fa.Fit, record: Mapping[str, Any], lines: Sequence[str]
) -> dict[str, bytes]:
    """The files of a fit by name: picture, meshes, numbers. `lines` stand under the picture and in the meshes."""
    from faceambig.arrays import vertex_normals
    from faceambig.compose import photo_of_fit
    from faceambig.io.fits import encode_fit
    from faceambig.io.meshes import Mesh, encode_glb, encode_obj, encode_ply
    from faceambig.render.fitted import draw_fitted
    from faceambig.render.overlay import encode_png
    from faceambig.texture import sample_texture

    texture = sample_texture(fit, picture.rgb)
    vertices, faces = fit.vertices(), fit.model.faces
    model = f"model: {fit.model.name}, {fit.model.source} ({fit.model.licence})"
    notes = (f"face fitted by faceambig to {picture.name}", *lines, model, texture.words)
    mesh = Mesh(vertices, faces, texture.colours, vertex_normals(vertices, faces), notes)
    drawn = draw_fitted(picture.rgb, photo_of_fit(fit, picture.size), lines)
    about = {"Software": "faceambig", "Description": "\n".join(notes)}
    whole = dict(record) | {"colours": texture.words, "files": list(NAMES)}
    return dict(
        zip(
            NAMES,
            (
                encode_png(drawn, about),
                encode_obj(mesh),
                encode_ply(mesh),
                encode_glb(mesh),
                encode_fit(fit, whole),
            ),
            strict=True,
        )
    )


def face_meshes(
    model: fa.FaceModel, name: str, alpha: Array, notes: Sequence[str], kinds: Sequence[str]
) -> Iterator[tuple[str, bytes]]:
    """Files of one face in the model's colours, or in clay: name.obj, .ply, .glb, those of `kinds`."""
    from faceambig.arrays import vertex_normals
    from faceambig.compose import CLAY
    from faceambig.io.meshes import Mesh, encode_glb, encode_obj, encode_ply

    encode = {"obj": encode_obj, "ply": encode_ply, "glb": encode_glb}
    vertices, colours = model.vertices(alpha), model.colours
    if colours is None:
        colours = np.tile(np.array(CLAY, dtype=np.uint8), (model.n_vertices, 1))
    about = f"model: {model.name}, {model.source} ({model.licence})"
    mesh = Mesh(
        vertices, model.faces, colours, vertex_normals(vertices, model.faces), (*notes, about)
    )
    for kind in kinds:
        yield f"{name}.{kind}", encode[kind](mesh)


def write_folder(
    path: Path, files: Iterable[tuple[str, bytes]], beside: Mapping[Path, bytes] | None = None
) -> None:
    """All files, by name, into the folder `path`, and those `beside` it; or none and no folder: ValueError says why.

    They are taken one after the other: a thousand meshes need not be in memory together.
    """
    made = not path.exists()
    try:
        path.mkdir(exist_ok=True)
    except OSError as error:
        raise ValueError(f"out: cannot make {str(path)!r}: {error.strerror}") from error
    try:
        write_pairs(chain((beside or {}).items(), ((path / name, data) for name, data in files)))
    except BaseException:  # an interruption too
        if made and not any(path.iterdir()):
            path.rmdir()
        raise


def written_words(path: Path, files: Mapping[str, bytes]) -> str:
    """What was written, as a line."""
    return f"written to {path}: {', '.join(files)}"
