"""The light on a head: four lamps, what skin does with them, and sRGB to linear light."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array
from ..scene import Head

# Direction towards the light in viewer axes (x right, y up, z to the viewer), colour, intensity: the key from above
# left is two lamps a little apart, which softens its edge as a wide window does.
LIGHTS = (
    ((-0.66, 0.62, 0.46), (1.00, 0.95, 0.89), 1.95),
    ((-0.12, 0.50, 0.86), (1.00, 0.96, 0.91), 1.75),
    ((0.88, 0.02, 0.50), (0.96, 0.97, 1.00), 1.05),
    ((0.72, 0.38, -0.58), (1.00, 1.00, 1.00), 2.2),
)
AMBIENT = (0.135, 0.125, 0.12)
SHEEN, SHEEN_WIDTH = 0.075, 16  # highlight on skin: strength, and the power that narrows it


def lit_colours(head: Head, normals: Array) -> Array:
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


def shown_colours(head: Head, normals: Array) -> Array:
    """(V, 3) sRGB of a legend: exact where the surface faces the viewer, darker where it turns away."""
    turned = 1.0 - np.clip(normals[:, 2], 0.0, 1.0)
    shade = 1.0 - 0.42 * turned**1.6
    if head.occlusion is not None:
        shade *= 1.0 - 0.35 * np.clip(0.75 - head.occlusion / 255.0, 0.0, 1.0)
    return head.colours / 255.0 * shade[:, None]


def srgb_to_linear(colours: ArrayLike) -> Array:
    """Linear light of sRGB 0 to 1 by the power 2.2 that pyrender's shader undoes."""
    return np.asarray(colours, dtype=np.float64) ** 2.2
