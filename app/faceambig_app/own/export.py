"""A person's own photograph as a file: picture, mesh and numbers of the frame that is shown of it. Nothing is kept.

There is no true face: what stands in for it, the fit at 60 cm, is called so in every file. The photograph itself is in
a picture only where that is asked for.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from faceambig.scene import Scene

from .. import export
from ..export import MESHES, SCALES, Progress
from ..state import ViewState, changed
from ..text import say
from .fit import REFERENCE, own_face, own_sweep, problem, reference
from .frame import own_frame
from .photo import OwnPhoto

HEADS = {
    "fit": ("fit", "fit"),
    "true": ("true", "reference"),
}  # of the scene, and in the file's name


def files(
    own: OwnPhoto | None,
    state: ViewState,
    kind: str,
    *,
    progress: Progress | None = None,
    **options: Any,
) -> tuple[str, bytes]:
    """(name, contents) of an own photograph's state as a file, as `export.files` makes those of synthetic people.

    Raises
    ------
    ValueError: in the page's words, if there is no photograph, no face fits its points, or the kind has no frame of
        one's own. Otherwise as `export.files`.
    """
    if kind == "state":
        return export.state_file(state, **options)
    if own is None or problem(own, state):
        raise ValueError(problem(own, state))
    if kind == "png":
        return _picture(own, state, progress=progress, **options)
    if kind in MESHES:
        return _mesh(own, state, kind, **options)
    if kind in ("csv", "json"):
        return export.numbers_of(_measured(own, state, **options), state, kind)
    raise ValueError(say("own.no_moving"))


def _picture(
    own: OwnPhoto,
    state: ViewState,
    *,
    scale: int = 1,
    transparent: bool = False,
    overlays: bool = True,
    own_photo: bool = False,
    progress: Progress | None = None,
) -> tuple[str, bytes]:
    if scale not in SCALES:
        raise ValueError(f"scale: {scale!r} is not one of {', '.join(map(str, SCALES))}")
    scene = own_frame(own, state, draft=False).scene
    if own_photo:
        scene = replace(scene, photo=replace(scene.photo, pixels=own.taken.rgb))
    return export.picture_of(scene, state, scale, transparent, overlays, progress)


def _mesh(own: OwnPhoto, state: ViewState, kind: str, *, face: str = "fit") -> tuple[str, bytes]:
    if face not in HEADS:
        raise ValueError(f"face: {face!r} is not one of {', '.join(HEADS)}")
    if face == "true" and "truth" in state.hide:
        raise ValueError("face: 'true' is hidden in this state")
    name, words = HEADS[face]
    scene: Scene = own_frame(own, changed(state, show="both"), draft=False).scene
    head = next(head for head in scene.heads if head.name == name)
    return export.mesh_of(head, state, kind, words)


def _measured(own: OwnPhoto, state: ViewState) -> dict[str, Any]:
    """The numbers of `export.measured`; d_S, to a true face, is the difference to the fit at 60 cm instead."""
    state = changed(state, show="both")
    face = own_face(own, state, state.fitting, reference(own, state, draft=False))
    along = export.along_distance(*own_sweep(own, state))
    along["curves"]["difference_mm"] = along["curves"].pop("d_s_mm")
    return {
        **export.source_of(state),
        "subject": "photo",
        "points_placed": own.placed,
        **export.numbers_of_face(face),
        "plausible": face.plausible,
        "d_l_percent": face.d_l_percent,
        "reference_distance_m": REFERENCE,
        "difference_mm": face.d_s_mm,
        "alpha": face.alpha.tolist(),
        **along,
    }
