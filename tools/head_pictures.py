"""Pictures of heads, drawn off screen by pyrender: for the eye, never for the numbers."""

from __future__ import annotations

import os
import sys
import types
from pathlib import Path

os.environ.setdefault("PYOPENGL_PLATFORM", "osmesa")
# pyrender's viewer wants a window system that a build machine may lack; it is never used here.
sys.modules.setdefault("pyrender.viewer", types.SimpleNamespace(Viewer=None))  # type: ignore[arg-type]

import cv2
import numpy as np
import pyrender
import trimesh
from numpy.typing import NDArray
from pyrender.platforms import osmesa

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]

osmesa.OSMesaPlatform.supports_framebuffers = lambda self: True  # else no antialiasing

# Direction towards the light (camera axes), colour, intensity.
LIGHTS = (
    ((-0.60, 0.62, 0.52), (1.00, 0.95, 0.88), 3.6),
    ((0.88, 0.02, 0.50), (0.80, 0.89, 1.00), 0.9),
    ((0.00, 0.10, 1.00), (1.00, 1.00, 1.00), 0.7),
    ((0.72, 0.38, -0.58), (1.00, 1.00, 1.00), 2.2),
)
DISTANCE = 3.0  # metres: a long lens, so that a montage compares like with like


class Node(pyrender.Node):
    """A node whose hash is a running number: lights are summed in the same order each time."""

    _count = 0

    def __init__(self, **options: object) -> None:
        super().__init__(**options)
        Node._count += 1
        self._number = Node._count

    def __hash__(self) -> int:
        return self._number

    def __eq__(self, other: object) -> bool:
        return self is other


def turn(yaw_deg: float, pitch_deg: float) -> Array:
    """Rotation (3, 3) of the head: positive yaw shows its right side, positive pitch its top."""
    y, p = np.radians([yaw_deg, pitch_deg])
    about_y = np.array([[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]])
    about_x = np.array([[1, 0, 0], [0, np.cos(p), -np.sin(p)], [0, np.sin(p), np.cos(p)]])
    return about_x @ about_y


def draw(
    vertices: Array,
    faces: NDArray[np.integer],
    colours: NDArray[np.uint8],
    occlusion: NDArray[np.uint8],
    *,
    yaw: float = 0.0,
    pitch: float = 0.0,
    size: int = 360,
    half_height: float = 0.16,
    centre: tuple[float, float, float] = (0.0, -0.005, -0.05),
) -> tuple[Picture, Array]:
    """Picture (size, size, 3) RGB and the pixel positions (N, 2) of the vertices.

    Vertices in metres, colours sRGB, angles in degrees; half_height and centre in metres.
    """
    turned = (vertices - centre) @ turn(yaw, pitch).T
    mesh = trimesh.Trimesh(turned, faces, process=False)
    linear = (colours / 255.0) ** 2.2 * (occlusion[:, None] / 255.0) ** 1.2
    primitive = pyrender.Primitive(
        positions=turned.astype(np.float32),
        normals=mesh.vertex_normals.astype(np.float32),
        indices=np.asarray(faces, np.uint32),
        color_0=np.column_stack([linear, np.ones(len(linear))]).astype(np.float32),
        mode=4,
        material=pyrender.MetallicRoughnessMaterial(
            baseColorFactor=[1.0, 1.0, 1.0, 1.0], metallicFactor=0.0, roughnessFactor=0.6,
            doubleSided=True,
        ),
    )  # fmt: skip
    scene = pyrender.Scene(bg_color=[1.0, 1.0, 1.0, 1.0], ambient_light=[0.14, 0.14, 0.14])
    scene.add_node(Node(mesh=pyrender.Mesh([primitive])))
    double = 2 * size
    focal = 0.5 * double * DISTANCE / half_height
    pose = np.eye(4)
    pose[2, 3] = DISTANCE
    camera = pyrender.IntrinsicsCamera(focal, focal, size, size, znear=0.5, zfar=10.0)
    scene.add_node(Node(camera=camera, matrix=pose))
    for direction, colour, intensity in LIGHTS:
        z = np.array(direction) / np.linalg.norm(direction)
        x = np.cross([0.0, 1.0, 0.0], z)
        x /= np.linalg.norm(x)
        light = np.eye(4)
        light[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
        scene.add_node(Node(light=pyrender.DirectionalLight(colour, intensity), matrix=light))
    renderer = pyrender.OffscreenRenderer(double, double)  # a fresh one: OSMesa leaks per frame
    try:
        picture = renderer.render(scene)[0]
    finally:
        renderer.delete()
    small = cv2.resize(picture[..., :3], (size, size), interpolation=cv2.INTER_AREA)
    scale = 0.5 * focal / (DISTANCE - turned[:, 2])
    pixels = 0.5 * size + np.stack([turned[:, 0] * scale, -turned[:, 1] * scale], axis=1)
    return small, pixels


def montage(pictures: list[list[Picture]]) -> Picture:
    """Rows of equally high pictures as one picture."""
    return np.vstack([np.hstack(row) for row in pictures])


def save(path: Path, picture: Picture) -> None:
    """Write a picture (RGB)."""
    options = [cv2.IMWRITE_PNG_COMPRESSION, 9]
    if not cv2.imwrite(str(path), picture[..., ::-1], options):
        raise OSError(f"cannot write {path}")
