"""One head as a picture, drawn off-screen by pyrender on OSMesa or EGL: the same pixels on both.

Importing this module needs no OpenGL: the first picture does, in the render thread (studio.py).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, IntArray, vertex_normals
from ..scene import Head, View
from .lamps import AMBIENT, LIGHTS, lit_colours, shown_colours, srgb_to_linear
from .mends import node_class
from .studio import NoRendererError, renderer_name, studio

__all__ = [
    "Layer",
    "Mesh",
    "NoRendererError",
    "render_head",
    "render_layer",
    "renderer_name",
    "viewer_rotation",
]

# Metres: the viewer is far away, only the highlights know how far
EYE, NEAR, FAR = 20.0, 18.0, 22.0
LARGEST = 12_000_000  # pixels of one frame buffer; 4 samples each with depth are 32 bytes a pixel

ROUGHNESS = 0.62
INSIDE = 0.42  # sRGB grey of back faces: a cut surface, never a look into the empty head

# A landmark on a head: radius over the picture's height, sRGB
BEAD, BEAD_COLOUR = 0.0055, (0x1B, 0x5F, 0xC1)


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
    colours = lit_colours(head, normals) if head.lit else shown_colours(head, normals)
    mesh = Mesh(points, normals, head.faces, colours, head.lit)
    if marked is not None and len(marked):
        mesh = _with_beads(mesh, points[marked], BEAD * height / pixels_per_metre)
    factor = 2 if 4 * width * height <= LARGEST else 1
    size = (factor * width, factor * height)
    half = (width / (2 * pixels_per_metre), height / (2 * pixels_per_metre))
    large, depth = studio().call(
        lambda pyrender, renderer: _frame(pyrender, renderer, mesh, half, size)
    )
    return Layer(_reduced(large, factor), _front(depth, factor))


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
    Node = node_class(pyrender)
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
