"""One head as a picture, drawn off-screen by pyrender on OSMesa or EGL: the same pixels on both.

Everything that has to be mended in pyrender 0.1.45 and in the PyOpenGL it pins is here and nowhere else. One thread
owns the one renderer: an EGL context works only in the thread that made it, and deleting one EGL renderer ends all
others. pyrender is imported by the first picture, in that thread; importing this module needs no OpenGL.
"""

from __future__ import annotations

import atexit
import ctypes
import os
import queue
import sys
import threading
import types
from collections.abc import Callable
from concurrent.futures import Future
from functools import cache
from typing import Any, NamedTuple, TypeVar

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Array, IntArray, vertex_normals
from ..scene import Head, View

T = TypeVar("T")
LIBRARIES = {"osmesa": ("libOSMesa.so.8",), "egl": ("libEGL.so.1", "libGL.so.1")}
INSTALL = "sudo apt-get install libegl1 libgl1 libgl1-mesa-dri libosmesa6"
# Frames of one OSMesa renderer: it loses 2 to 7 MB a frame and gives them back when it is deleted.
FRAMES = 20
EYE, NEAR, FAR = (
    20.0,
    18.0,
    22.0,
)  # metres: the viewer is far away, only the highlights know how far
LARGEST = 12_000_000  # pixels of one frame buffer; 4 samples each with depth are 32 bytes a pixel

# Direction towards the light in viewer axes (x right, y up, z to the viewer), colour, intensity: the key from above
# left is two lamps a little apart, which softens its edge as a wide window does.
LIGHTS = (
    ((-0.66, 0.62, 0.46), (1.00, 0.95, 0.89), 1.95),
    ((-0.12, 0.50, 0.86), (1.00, 0.96, 0.91), 1.75),
    ((0.88, 0.02, 0.50), (0.96, 0.97, 1.00), 1.05),
    ((0.72, 0.38, -0.58), (1.00, 1.00, 1.00), 2.2),
)
AMBIENT = (0.135, 0.125, 0.12)
ROUGHNESS = 0.62
SHEEN, SHEEN_WIDTH = 0.075, 16  # highlight on skin: strength, and the power that narrows it
INSIDE = 0.42  # sRGB grey of back faces: a cut surface, never a look into the empty head

BEAD, BEAD_COLOUR = (
    0.0055,
    (0x1B, 0x5F, 0xC1),
)  # radius over the picture's height, sRGB: a landmark on a head


class NoRendererError(RuntimeError):
    """No software OpenGL on this machine; the message says what to install."""


def renderer_name() -> str:
    """'osmesa' or 'egl': the one FACEAMBIG_RENDERER names, else the first whose libraries load."""
    forced = os.environ.get("FACEAMBIG_RENDERER", "")
    if forced and forced not in LIBRARIES:
        raise NoRendererError(
            f"FACEAMBIG_RENDERER: {forced!r} is not one of {', '.join(LIBRARIES)}"
        )
    for name in [forced] if forced else LIBRARIES:
        if all(map(_loads, LIBRARIES[name])):
            return name
    raise NoRendererError(f"no software renderer: {INSTALL}")


def _loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


def viewer_rotation(view: View) -> Array:
    """(3, 3) from model axes to viewer axes: rows are the viewer's right, up, and the way to the viewer."""
    a, e = np.radians([view.azimuth_deg, view.elevation_deg])
    right = [np.cos(a), 0.0, -np.sin(a)]
    up = [-np.sin(a) * np.sin(e), np.cos(e), -np.cos(a) * np.sin(e)]
    towards = [np.sin(a) * np.cos(e), np.sin(e), np.cos(a) * np.cos(e)]
    return np.array([right, up, towards])


class Layer(NamedTuple):
    """One head as a picture, and how near it is."""

    rgba: NDArray[np.uint8]  # (H, W, 4), alpha not premultiplied
    front: NDArray[np.float32]  # (H, W) metres from the head's origin to the viewer; -inf: nothing


class Mesh(NamedTuple):
    """What the render thread is given. V vertices, F triangles, viewer axes."""

    points: Array  # (V, 3) metres
    normals: Array  # (V, 3)
    faces: NDArray[np.uint32]  # (F, 3)
    colours: Array  # (V, 3) linear light if lit, else sRGB, 0 to 1
    lit: bool


def render_head(
    head: Head,
    view: View,
    width: int,
    height: int,
    pixels_per_metre: float,
    *,
    middle: tuple[float, float] = (0.0, 0.0),
    marked: IntArray | None = None,
) -> NDArray[np.uint8]:
    """(height, width, 4) RGBA picture of one head, alpha not premultiplied, nothing behind it.

    middle: the point of the picture's middle, metres along the viewer's right and up from the head's origin. Parallel
    rays: one scale in the whole picture. marked: vertices that get a bead. NoRendererError where nothing can draw.
    """
    return render_layer(
        head, view, width, height, pixels_per_metre, middle=middle, marked=marked
    ).rgba


def render_layer(
    head: Head,
    view: View,
    width: int,
    height: int,
    pixels_per_metre: float,
    *,
    middle: tuple[float, float] = (0.0, 0.0),
    marked: IntArray | None = None,
) -> Layer:
    """As `render_head`, with the depth of every pixel: for what stands in the same place."""
    R = viewer_rotation(view)
    points = head.vertices @ R.T
    points[:, :2] -= middle
    normals = vertex_normals(head.vertices, head.faces) @ R.T
    colours = _lit_colours(head, normals) if head.lit else _shown_colours(head, normals)
    mesh = Mesh(points, normals, head.faces, colours, head.lit)
    if marked is not None and len(marked):
        mesh = _with_beads(mesh, points[marked], BEAD * height / pixels_per_metre)
    factor = 2 if 4 * width * height <= LARGEST else 1
    size = (factor * width, factor * height)
    half = (width / (2 * pixels_per_metre), height / (2 * pixels_per_metre))
    large, depth = _studio().call(
        lambda pyrender, renderer: _frame(pyrender, renderer, mesh, half, size)
    )
    return Layer(_reduced(large, factor), _front(depth, factor))


def _lit_colours(head: Head, normals: Array) -> Array:
    """(V, 3) linear: what the shader multiplies the lamps' light by. normals (V, 3) in viewer axes."""
    colours = srgb_to_linear(head.colours / 255.0)
    open_ = np.ones(len(colours)) if head.occlusion is None else head.occlusion / 255.0
    # Pupils and brows do not shine as skin does.
    bright = np.clip(colours.mean(axis=1) / 0.06, 0.0, 1.0)
    # Light that reaches a fold has met skin before: it loses blue and green first, so folds are warm and not grey.
    colours *= open_[:, None] ** (0.9, 1.2, 1.25)
    # pyrender tints highlights with the vertex colour; on skin they are white. They are added here, divided by the
    # light that the shader will multiply with.
    light = np.full(colours.shape, AMBIENT)
    sheen = np.zeros(len(colours))
    for direction, colour, intensity in LIGHTS[:3]:
        lamp = np.asarray(direction) / np.linalg.norm(direction)
        facing = np.clip(normals @ lamp, 0.0, None)
        light += (intensity / np.pi) * facing[:, None] * colour
        half = lamp + np.array([0.0, 0.0, 1.0])
        glance = np.clip(normals @ (half / np.linalg.norm(half)), 0.0, None)
        sheen += intensity * np.sqrt(facing) * glance**SHEEN_WIDTH
    return colours + (SHEEN / np.pi * bright * open_**2 * sheen)[:, None] / light


def _shown_colours(head: Head, normals: Array) -> Array:
    """(V, 3) sRGB of a legend: exact where the surface faces the viewer, darker where it turns away."""
    turned = 1.0 - np.clip(normals[:, 2], 0.0, 1.0)
    shade = 1.0 - 0.42 * turned**1.6
    if head.occlusion is not None:
        shade *= 1.0 - 0.35 * np.clip(0.75 - head.occlusion / 255.0, 0.0, 1.0)
    return head.colours / 255.0 * shade[:, None]


def _with_beads(mesh: Mesh, at: Array, radius: float) -> Mesh:
    """The mesh with a ball of `radius` metres at each of `at` (M, 3): hidden where the face hides it."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=1, radius=1.0)
    shape = np.asarray(ball.vertices)
    starts = len(mesh.points) + len(shape) * np.arange(len(at))
    triangles = (starts[:, None, None] + np.asarray(ball.faces)).reshape(-1, 3).astype(np.uint32)
    colour = np.array(BEAD_COLOUR) / 255.0
    shown = srgb_to_linear(colour) if mesh.lit else colour
    return Mesh(
        np.concatenate([mesh.points, (at[:, None] + radius * shape).reshape(-1, 3)]),
        np.concatenate([mesh.normals, np.tile(shape, (len(at), 1))]),
        np.concatenate([mesh.faces, triangles]),
        np.concatenate([mesh.colours, np.tile(shown, (len(at) * len(shape), 1))]),
        mesh.lit,
    )


def srgb_to_linear(colours: ArrayLike) -> Array:
    """Linear light of sRGB 0 to 1 by the power 2.2 that pyrender's shader undoes."""
    return np.asarray(colours, dtype=np.float64) ** 2.2


def _reduced(large: NDArray[np.uint8], factor: int) -> NDArray[np.uint8]:
    """The picture at 1/factor, averaged with premultiplied alpha: no dark seam at the outline."""
    picture = large.astype(np.float32)
    alpha = picture[..., 3:]
    # The frame buffer's own samples were averaged over a black background: colours are premultiplied already.
    if factor > 1:
        size = (large.shape[1] // factor, large.shape[0] // factor)
        picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
        alpha = picture[..., 3:]
    colour = picture[..., :3] * (255.0 / np.maximum(alpha, 1.0))
    return np.concatenate([colour, alpha], axis=2).clip(0, 255).round().astype(np.uint8)


def _front(depth: NDArray[np.float32], factor: int) -> NDArray[np.float32]:
    """(H, W) metres towards the viewer of the nearest sample of each pixel, -inf where there is none."""
    height, width = depth.shape[0] // factor, depth.shape[1] // factor
    samples = depth.reshape(height, factor, width, factor)
    nothing = samples == 0
    # pyrender undoes the depth of a perspective camera; that of parallel rays is linear in the buffer
    buffer = FAR + NEAR - 2 * NEAR * FAR / np.where(nothing, FAR, samples)
    front = EYE - NEAR - 0.5 * (buffer + FAR - NEAR)
    return np.where(nothing, -np.inf, front).max(axis=(1, 3)).astype(np.float32)


def _frame(
    pyrender: Any, renderer: Any, mesh: Mesh, half: tuple[float, float], size: tuple[int, int]
) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """(H, W, 4) RGBA and (H, W) depth of a mesh, straight from the frame buffer. Runs in the render thread."""
    renderer.viewport_width, renderer.viewport_height = size
    flags = pyrender.RenderFlags.RGBA | (0 if mesh.lit else pyrender.RenderFlags.FLAT)
    return renderer.render(_scene(pyrender, mesh, half), flags=flags)


def _scene(pyrender: Any, mesh: Mesh, half: tuple[float, float]) -> Any:
    """pyrender's scene of a mesh, `half` metres shown to each side and up and down."""
    outside = _primitive(pyrender, mesh, metallicFactor=0.0, roughnessFactor=ROUGHNESS)
    # Back faces are the same triangles wound the other way, of one grey: their normals point where no lamp is, the
    # base is black, and the light comes from the material itself.
    points, lit = mesh.points, mesh.lit
    down = np.tile([0.0, -1.0, 0.0], (len(points), 1))
    grey = np.full((len(points), 3), srgb_to_linear(INSIDE) if lit else INSIDE)
    inside = _primitive(
        pyrender,
        Mesh(points, down, mesh.faces[:, ::-1], grey, lit),
        baseColorFactor=[0.0, 0.0, 0.0, 1.0] if lit else [1.0, 1.0, 1.0, 1.0],
        emissiveFactor=[1.0, 1.0, 1.0],
    )
    scene = pyrender.Scene(bg_color=[0.0, 0.0, 0.0, 0.0], ambient_light=AMBIENT)
    Node = _node_class(pyrender)
    scene.add_node(Node(0, mesh=pyrender.Mesh([outside, inside])))
    eye = np.eye(4)
    eye[2, 3] = EYE
    lens = pyrender.OrthographicCamera(half[0], half[1], znear=NEAR, zfar=FAR)
    scene.add_node(Node(1, camera=lens, matrix=eye))
    for number, (direction, colour, intensity) in enumerate(LIGHTS, start=2):
        lamp = pyrender.DirectionalLight(colour, intensity)
        scene.add_node(Node(number, light=lamp, matrix=_facing(direction)))
    return scene


def _primitive(pyrender: Any, mesh: Mesh, **material: Any) -> Any:
    """Triangles for pyrender; material: what differs from a white one."""
    material = {"baseColorFactor": [1.0, 1.0, 1.0, 1.0]} | material
    # Floats: integer colours would be divided by 255.
    rgba = np.column_stack([mesh.colours, np.ones(len(mesh.colours))])
    return pyrender.Primitive(
        positions=mesh.points.astype(np.float32),
        normals=mesh.normals.astype(np.float32),
        indices=np.ascontiguousarray(mesh.faces, dtype=np.uint32),
        color_0=rgba.astype(np.float32),
        mode=4,
        material=pyrender.MetallicRoughnessMaterial(**material),
    )


def _facing(direction: tuple[float, float, float]) -> Array:
    """(4, 4) pose whose +z is `direction`: a light shines along its own -z."""
    z = np.asarray(direction) / np.linalg.norm(direction)
    x = np.array([z[2], 0.0, -z[0]]) / np.hypot(z[0], z[2])
    pose = np.eye(4)
    pose[:3, :3] = np.stack([x, [z[1] * x[2], z[2] * x[0] - z[0] * x[2], -z[1] * x[0]], z], axis=1)
    return pose


# ---- the render thread ----


class Studio:
    """The render thread and its renderer; `call` runs a job there and returns what it returns."""

    def __init__(self, name: str) -> None:
        self.name = name  # "osmesa" or "egl"
        self._jobs: queue.SimpleQueue[tuple[Callable[[Any, Any], Any], Future[Any]] | None] = (
            queue.SimpleQueue()
        )
        # A daemon: a picture that hangs must not keep the program alive. close() lets it end in good order.
        self._thread = threading.Thread(target=self._work, name="faceambig-render", daemon=True)
        self._thread.start()

    def call(self, job: Callable[[Any, Any], T]) -> T:
        """job(pyrender, renderer) run in the render thread; what it raises is raised here."""
        future: Future[T] = Future()
        self._jobs.put((job, future))
        return future.result()

    def close(self) -> None:
        """Free the renderer in its own thread and end that."""
        self._jobs.put(None)
        self._thread.join(timeout=10)

    def _work(self) -> None:
        pyrender = renderer = None
        frames = 0
        while (item := self._jobs.get()) is not None:
            job, future = item
            try:
                pyrender = pyrender or _import_pyrender(self.name)
                if renderer is not None and frames >= FRAMES and self.name == "osmesa":
                    renderer.delete()
                    renderer = None
                if renderer is None:
                    renderer, frames = pyrender.OffscreenRenderer(64, 64), 0
                frames += 1
                future.set_result(job(pyrender, renderer))
            except BaseException as error:  # noqa: BLE001 - raised again in the thread that asked
                future.set_exception(error)
            del item, job, future  # else the last picture is kept until the next
        if renderer is not None:
            renderer.delete()


@cache
def _studio() -> Studio:
    studio = Studio(renderer_name())
    atexit.register(studio.close)
    return studio


# ---- mends of pyrender 0.1.45, PyOpenGL 3.1.0 and 3.1.10 ----


def _import_pyrender(name: str) -> Any:
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
def _node_class(pyrender: Any) -> Any:
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
