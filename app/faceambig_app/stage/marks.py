"""Points and lines on heads: red crosses and blue discs, told apart by shape, and thin straight lines.

Points lie on the surface and would sink into it, so they are lifted towards the viewer, which moves nothing on the
screen through the long lens. Their sizes are of the screen: they never hide the face.
"""

from __future__ import annotations

import numpy as np
import viser
from numpy.typing import NDArray

from faceambig.scene import Lines, Marks

from .viewer import Sight

TONES = {"seen": (200, 16, 46), "d_l": (27, 95, 193), "dim": (120, 134, 148)}
CROSS, DISC = 4.5, 8.0  # pixels: half a cross, a whole disc
LARGEST = {"seen": 0.0034, "d_l": 0.006}  # metres: on a phone, where heads are small, marks are too
LIFT = {"d_l": 0.002, "seen": 0.003}  # metres towards the viewer: crosses over discs
BESIDE = 6.0  # pixels from a point to its name
NAME_LIFT = 0.015  # metres more: a name is wide, and the cheek beside it may be nearer
NAME_SCALE = 0.8  # of viser's 12 pixels


class PointNodes:
    """The marks of one tone on one head."""

    def __init__(self, scene: viser.SceneApi, marks: Marks, bold: float = 1.0) -> None:
        self._scene, self._root = scene, f"/{marks.head}/{marks.tone}"
        self._frame = scene.add_frame(self._root, show_axes=False)
        self._tone, self._bold = marks.tone, bold
        self._crosses: viser.LineSegmentsHandle | None = None
        self._discs: viser.PointCloudHandle | None = None
        self._words: list[viser.LabelHandle] = []
        self._points = np.zeros((0, 3))
        self._sight: Sight | None = None
        self._named, self._named_in = self._points, self._sight  # what the names stand for
        self._names: tuple[str, ...] = ()

    def show(
        self, marks: Marks, pivot: NDArray[np.float64], sight: Sight, draft: bool, visible: bool
    ) -> None:
        """Send what changed; names move at rest only, as there is a node for each."""
        self._frame.visible = visible and len(marks.points) > 0
        self._points = np.asarray(marks.points, dtype=np.float64) - pivot
        if not self._frame.visible:
            return
        self.turn(sight)
        if draft and len(marks.names) == len(self._words):
            return
        same = sight is self._named_in and np.array_equal(self._points, self._named)
        if not same or marks.names != self._names:
            self._named, self._named_in, self._names = self._points, sight, marks.names
            self._name(marks.names, sight)

    def turn(self, sight: Sight) -> None:
        """Face the viewer, at the size of the screen."""
        if sight is not self._sight:
            self._sight = sight
            self._frame.position = LIFT.get(self._tone, LIFT["seen"]) * sight.board[:, 2]
        if len(self._points) == 0:
            return
        if self._tone == "seen":
            self._draw_crosses(sight)
        else:
            self._draw_discs(sight)

    def _draw_crosses(self, sight: Sight) -> None:
        right, up = min(self._bold * CROSS * sight.pixel, LARGEST["seen"]) * sight.board[:, :2].T
        arms = np.array([[-right - up, right + up], [-right + up, right - up]])
        segments = (self._points[:, None, None, :] + arms).reshape(-1, 2, 3).astype(np.float32)
        if self._crosses is None:
            self._crosses = self._scene.add_line_segments(
                f"{self._root}/crosses", segments, TONES[self._tone],
                thickness=2.0 * self._bold, thickness_units="screen",
            )  # fmt: skip
        else:
            self._crosses.points = segments

    def _draw_discs(self, sight: Sight) -> None:
        points = self._points.astype(np.float32)
        if self._discs is None:
            self._discs = self._scene.add_point_cloud(
                f"{self._root}/discs", points, TONES[self._tone], point_shape="circle",
                point_shading="flat", precision="float32",  # half floats have steps of 0.1 mm here
            )  # fmt: skip
        self._discs.points = points
        # Half: viser draws points twice as wide
        self._discs.point_size = 0.5 * min(self._bold * DISC * sight.pixel, LARGEST["d_l"])

    def _name(self, names: tuple[str, ...], sight: Sight) -> None:
        while len(self._words) > len(names):
            self._words.pop().remove()
        beside = (
            self._bold * BESIDE * sight.pixel * sight.board[:, 0] + NAME_LIFT * sight.board[:, 2]
        )
        for index, name in enumerate(names):
            at = self._points[index] + beside
            if index == len(self._words):
                self._words.append(
                    self._scene.add_label(
                        f"{self._root}/name{index}", name, position=at, anchor="center-left",
                        font_screen_scale=NAME_SCALE * self._bold, depth_test=True,
                    )
                )  # fmt: skip
            self._words[index].text, self._words[index].position = name, at

    def remove(self) -> None:
        """Take the marks out of the scene."""
        self._frame.remove()


class LineNodes:
    """The straight lines of one name in the room of one head."""

    def __init__(self, scene: viser.SceneApi, lines: Lines, bold: float = 1.0) -> None:
        self._handle = scene.add_line_segments(
            f"/{lines.head}/{lines.name}", np.zeros((1, 2, 3), dtype=np.float32),
            TONES.get(lines.tone, TONES["dim"]), thickness=1.4 * bold, thickness_units="screen",
        )  # fmt: skip

    def show(self, lines: Lines, pivot: NDArray[np.float64], visible: bool) -> None:
        """Send what changed."""
        self._handle.visible = visible and len(lines.segments) > 0
        if self._handle.visible:
            self._handle.points = (lines.segments - pivot).astype(np.float32)

    def remove(self) -> None:
        """Take the lines out of the scene."""
        self._handle.remove()
