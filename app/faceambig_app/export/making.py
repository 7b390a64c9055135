"""A state as a file: picture, mesh, numbers, the state itself, an animation, the standalone page. Nothing is written.

Every file says where it comes from: state, model, licence, version. A photograph of one's own is left out unless it is
asked for; then the face that was fitted stands in its place.
"""

from __future__ import annotations

from typing import Any

from ..state import ViewState
from ..state.forms import to_json
from .meshes import MESHES, mesh
from .numbers import numbers
from .pictures import Progress, picture
from .provenance import file_name, shown

KINDS = ("png", *MESHES, "csv", "json", "state", "html", "webp", "gif")
LONG = ("png", "html", "webp", "gif")  # what takes seconds or more


def files(
    state: ViewState, kind: str, *, progress: Progress | None = None, **options: Any
) -> tuple[str, bytes]:
    """(name, contents) of a state as a file of one of KINDS.

    Parameters
    ----------
    options: of "png": scale (1, 2 or 4), transparent, overlays, own_photo; see `picture`. Of "ply", "obj", "glb":
        face ("fit" or "true"). Of "html": whats, own_photo; see `player.page`. Of "webp", "gif": those of
        `animate.animation`. "csv" and "json" are the numbers, "state" the JSON that `ViewState` reads; they have none.
    progress: called with what is done, of how much, while one of LONG is made; what it raises ends the work.

    Raises
    ------
    ValueError: no such kind, or an option's value. TypeError: an option the kind does not have.
    NoRendererError: a picture or an animation where there is no OpenGL.
    """
    if kind in LONG:
        options["progress"] = progress
    if kind == "png":
        return picture(state, **options)
    if kind in MESHES:
        return mesh(state, kind, **options)
    if kind in ("csv", "json"):
        return numbers(state, kind, **options)
    if kind == "state":
        return state_file(state, **options)
    if kind == "html":
        from .player import page

        return page(state, **options)
    if kind in ("webp", "gif"):
        from .animate import animation

        return animation(state, kind, **options)
    raise ValueError(f"kind: {kind!r} is not one of {', '.join(KINDS)}")


def state_file(state: ViewState) -> tuple[str, bytes]:
    """The state as JSON, defaults left out: what `forms.from_json` and `--state` read."""
    return file_name(shown(state), "state.json"), (to_json(state) + "\n").encode()
