"""pyrender 0.1.45 on PyOpenGL 3.1.0 and 3.1.10, mended: all that has to be, and nowhere else."""

from __future__ import annotations

import ctypes
import os
import sys
import types
from functools import cache
from typing import Any

import numpy as np

from ..arrays import Array


def import_pyrender(name: str) -> Any:
    """pyrender on the back end `name`, mended."""
    os.environ["PYOPENGL_PLATFORM"] = name  # read once, when OpenGL is first imported
    # The real viewer loads pyglet, which needs an X library that servers lack.
    sys.modules.setdefault("pyrender.viewer", _empty_viewer())
    _mend_format_handler()
    if name == "osmesa":
        _mend_osmesa()
    import pyrender
    from pyrender.platforms.osmesa import OSMesaPlatform

    mends: tuple[tuple[Any, str, Any], ...] = (
        (OSMesaPlatform, "supports_framebuffers", lambda _: True),  # else no antialiasing, no alpha
        (pyrender.Mesh, "bounds", property(_bounds)),  # NumPy 2 has no np.infty
    )
    for where, attribute, value in mends:
        setattr(where, attribute, value)
    return pyrender


def _empty_viewer() -> types.ModuleType:
    module = types.ModuleType("pyrender.viewer")
    module.Viewer = None  # type: ignore[attr-defined]
    return module


def _mend_format_handler() -> None:
    """PyOpenGL 3.1.0 on Python 3.12 and later refuses ctypes' byref arguments (glGenTextures)."""
    from OpenGL.plugins import FormatHandler

    handler = FormatHandler.by_name("ctypesparameter")
    if handler is not None and "_ctypes.CArgObject" not in handler.check:
        handler.check.append("_ctypes.CArgObject")


def _mend_osmesa() -> None:
    """PyOpenGL 3.1.0 lacks OSMesaCreateContextAttribs, and its contexts cannot be keys of a dictionary."""
    import OpenGL.osmesa as osmesa
    from OpenGL.platform import PLATFORM
    from OpenGL.raw.osmesa._types import OSMesaContext

    if hasattr(osmesa, "OSMesaCreateContextAttribs"):
        return
    OSMesaContext.__hash__ = lambda self: ctypes.cast(self, ctypes.c_void_p).value or 0
    library: Any = PLATFORM  # None until a back end is chosen: it is, by now
    create = library.GL.OSMesaCreateContextAttribs
    create.restype = OSMesaContext
    create.argtypes = [ctypes.POINTER(ctypes.c_int), ctypes.c_void_p]
    osmesa.OSMesaCreateContextAttribs = create
    names = ("DEPTH_BITS", "STENCIL_BITS", "ACCUM_BITS", "PROFILE", "CORE_PROFILE", "COMPAT_PROFILE",
             "CONTEXT_MAJOR_VERSION", "CONTEXT_MINOR_VERSION")  # fmt: skip
    for value, word in enumerate(names, start=0x30):
        setattr(osmesa, f"OSMESA_{word}", value)


def _bounds(mesh: Any) -> Array:
    """(2, 3) corners of the box around all primitives of a mesh."""
    boxes = np.array([primitive.bounds for primitive in mesh.primitives])
    return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])


@cache
def node_class(pyrender: Any) -> Any:
    """pyrender.Node hashed by its number in the scene.

    pyrender keeps lights in a set. Hashed by address they are summed in another order, and rounded differently, from
    process to process; a number that ran on from scene to scene would do so from picture to picture.
    """

    class Node(pyrender.Node):
        def __init__(self, number: int, **options: Any) -> None:
            super().__init__(**options)
            self._number = number

        def __hash__(self) -> int:
            return self._number

        def __eq__(self, other: object) -> bool:
            return self is other

    return Node
