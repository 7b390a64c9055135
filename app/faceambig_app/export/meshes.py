"""A head of a state as a mesh file, in the colours that it is shown in."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from faceambig.arrays import vertex_normals
from faceambig.io.meshes import Mesh, encode_glb, encode_obj, encode_ply
from faceambig.scene import Head

from .. import pipeline
from ..state import ViewState, changed
from .provenance import file_name, notes, shown

FACES = ("fit", "true")  # of a mesh
MESHES: Mapping[str, Callable[[Mesh], bytes]] = {
    "ply": encode_ply,
    "obj": encode_obj,
    "glb": encode_glb,
}


def mesh(state: ViewState, kind: str, *, face: str = "fit") -> tuple[str, bytes]:
    """The fitted face, laid rigidly on the true one, or the true face: metres, in the colours it is shown in."""
    if face not in FACES:
        raise ValueError(f"face: {face!r} is not one of {', '.join(FACES)}")
    if face == "true" and "truth" in state.hide:
        raise ValueError("face: 'true' is hidden in this state")
    state = changed(state, show="both")
    scene = pipeline.frame(state, with_curves=False).scene
    head = next(head for head in scene.heads if head.name == face)
    return mesh_of(head, state, kind, face)


def mesh_of(head: Head, state: ViewState, kind: str, words: str) -> tuple[str, bytes]:
    """A head as one of MESHES; its file is called by `words`."""
    about = (head.title, *notes(state))
    normals = vertex_normals(head.vertices, head.faces)
    written = Mesh(head.vertices, head.faces, head.colours, normals, about)
    return file_name(shown(state), f"{words}.{kind}"), MESHES[kind](written)
