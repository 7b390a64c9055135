"""Stage: draws a Scene as viser nodes of one browser. It computes nothing of the face.

Heads stand at their slots along the viewer's right, so they turn in place and never hide each other while orbiting.
Heads of one slot are drawn over each other: a ghost, or two faces in turn. On the page a row shows its first view.
"""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from faceambig.scene import Head, Photo, Scene

from ..guard import data_html
from .heads import Board, HeadNodes
from .marks import LineNodes, PointNodes
from .viewer import (
    BESIDE,
    FAR,
    FIRST_FOV,
    FIRST_POSITION,
    NEAR,
    Orbited,
    Sight,
    Viewer,
    lens,
    quaternion,
)

__all__ = ["FAR", "FIRST_FOV", "FIRST_POSITION", "NEAR", "Stage"]

# Camera axes (y down, z forward) to the page's (y up, z to the viewer)
TO_WORLD = np.array([1.0, -1.0, -1.0])
BLINK_SECONDS = 0.5  # each: once round a second
LIGHTS = (  # direction towards the light in viewer axes (right, up, back), colour, intensity: key from above left
    ("key", (-0.5, 0.7, 1.2), (255, 244, 232), 2.8),
    ("fill", (0.9, 0.1, 0.8), (235, 242, 255), 0.7),
    ("rim", (0.0, 0.6, -1.0), (255, 250, 245), 0.9),
)
AMBIENT = 0.75
# Beside a legend: light from everywhere, in which a surface has its own colour (pi is all of it). What the lamps add
# is little: a colour that faces the viewer is read to 0.2 mm of 15, with twice of them to 0.3, and noses are still seen
READ_AMBIENT, READ_SHARE = 2.7, 0.15


class Stage:
    """The 3D nodes of one browser. `orbited` hears where a hand has turned the viewer to: see viewer.Orbited."""

    def __init__(
        self, client: viser.ClientHandle, orbited: Orbited | None = None, *, bold: float = 1.0
    ) -> None:
        """bold: times that lines, marks and words are larger, for eyes at the far end of a room."""
        self._client, self._scene, self._bold = client, client.scene, bold
        self._heads: dict[str, HeadNodes] = {}
        # Of each head's meshes: vertices, as the one array they came in, and pivot
        self._where: dict[str, tuple[NDArray[np.float64], tuple[float, ...]] | None] = {}
        self._points: dict[tuple[str, str], PointNodes] = {}
        self._lines: dict[tuple[str, str], LineNodes] = {}
        self._blink: viser.GuiHtmlHandle | None = None
        # The viewer turns on the loop while a worker draws: one writes nodes, and does the other's work before it ends
        self._writing = threading.Lock()
        self._asked: Sight | None = None  # as the viewer sees now
        self._sight: Sight | None = None  # as all nodes stand
        self._wxyz = np.array([1.0, 0.0, 0.0, 0.0])
        self._lit = True
        self._light_room()
        self._viewer = Viewer(client, self._place, orbited)

    @property
    def phone(self) -> bool:
        """Whether viser's panel is a sheet over the scene."""
        return self._viewer.phone

    @property
    def narrow(self) -> bool:
        """Whether there is no room for a second panel."""
        return self._viewer.narrow

    @property
    def wide(self) -> bool:
        """Whether there is room for wider panels."""
        return self._viewer.wide

    def value(self, head: str, vertex: int) -> float | None:
        """What the colour of a head at a vertex means: see HeadNodes.value. None too if there is no such head."""
        nodes = self._heads.get(head)
        return None if nodes is None else nodes.value(vertex)

    def by_hand(self) -> None:
        """A hand is turning the viewer, as the page's script tells."""
        self._viewer.by_hand()

    @property
    def elements(self) -> tuple[str, ...]:
        """Identifiers of its own elements, which stay when a panel is made anew."""
        return () if self._blink is None else (self._blink._impl.uuid,)

    def show(self, scene: Scene, draft: bool) -> None:
        """Draw the heads; a draft has the coarse mesh. Call inside client.atomic()."""
        with self._writing:
            self._draw(scene, draft)
        self._catch_up()

    def _draw(self, scene: Scene, draft: bool) -> None:
        self._clear(scene)
        through = scene.through_camera
        slots = [head.slot for head in scene.heads]
        middle, depth = (min(slots) + max(slots)) / 2, 0.0
        if through:
            # Two faces in one place are compared as the photograph has them, the true one to the pixel
            alone = not any(_shares(scene, head) for head in scene.heads)
            camera = lens(scene.photo, by_eyes=alone)
            self._viewer.show(camera, 0.0)
            depth = camera.distance
        else:
            self._viewer.show(scene.views[0], max(slots) - middle + BESIDE)
        for head in scene.heads:
            nodes = self._heads.get(head.name)
            if nodes is None:
                nodes = self._heads[head.name] = HeadNodes(self._client, head, self._bold)
            seen = not through or _at_camera(scene, head) is not None
            if seen:
                # A hand on the distance moves the fitted face alone
                where = None if through else (head.vertices, scene.pivot)
                same = where is not None and _is(self._where.get(head.name), where)
                if not (same and nodes.keep(head, draft)):
                    self._where.pop(head.name, None)  # if this fails, they are nowhere known
                    nodes.show(_points(scene, head), head, draft)
                    self._where[head.name] = where
            nodes.write(_board(scene, head))
            nodes.stand(0.0 if through else head.slot - middle, seen, depth)
        sight = self._viewer.sight
        self._mark(scene, draft, sight)
        self._read_colours(all(head.lit for head in scene.heads))
        self._take_turns(scene)
        self._stand(sight)

    def _clear(self, scene: Scene) -> None:
        """Take out what the scene no longer has; what has other triangles is made anew."""
        kept = {head.name: head for head in scene.heads}
        marks = {(mark.head, mark.tone) for mark in scene.marks}
        lines = {(line.head, line.name) for line in scene.lines}
        gone = {
            name
            for name, nodes in self._heads.items()
            if name not in kept or not nodes.fits(kept[name])
        }
        for held, wanted in ((self._points, marks), (self._lines, lines)):
            for key in [key for key in held if key not in wanted or key[0] in gone]:
                held.pop(key).remove()
        for name in gone:
            self._heads.pop(name).remove()
            self._where.pop(name, None)

    def _mark(self, scene: Scene, draft: bool, sight: Sight) -> None:
        """Points and lines; not through the subject's camera, where the photograph has them."""
        pivot, visible = np.asarray(scene.pivot), not scene.through_camera
        for mark in scene.marks:
            key = (mark.head, mark.tone)
            if key not in self._points:
                self._points[key] = PointNodes(self._scene, mark, self._bold)
            self._points[key].show(mark, pivot, sight, draft, visible)
        for line in scene.lines:
            key = (line.head, line.name)
            if key not in self._lines:
                self._lines[key] = LineNodes(self._scene, line, self._bold)
            self._lines[key].show(line, pivot, visible)

    def _take_turns(self, scene: Scene) -> None:
        """Tell the page's script which nodes it shows in turn."""
        nodes = [f"/{head.name}" for head in scene.heads if _shares(scene, head)]
        if not scene.blink:
            nodes = []
        if self._blink is None:
            if not nodes:
                return
            self._blink = self._client.gui.add_html("")
        self._blink.content = data_html("blink", {"nodes": nodes, "seconds": BLINK_SECONDS})

    def _place(self, sight: Sight) -> None:
        """Stand everything as it is now seen; inside client.atomic(). Where a worker draws, he does it."""
        self._asked = sight
        self._catch_up()

    def _catch_up(self) -> None:
        while (sight := self._asked) not in (None, self._sight) and self._writing.acquire(False):
            try:
                self._stand(sight)
                for nodes in self._points.values():
                    nodes.turn(sight)
            finally:
                self._writing.release()

    def _stand(self, sight: Sight) -> None:
        """Stand the heads along the viewer's right, with the lights."""
        if sight is not self._sight:
            self._sight, self._wxyz = sight, quaternion(sight.board)
            self._lights.wxyz = self._wxyz
        for nodes in self._heads.values():
            nodes.place(sight, self._wxyz)

    def _light_room(self) -> None:
        scene = self._scene
        scene.configure_default_lights(enabled=False)
        scene.configure_environment_map(None)
        self._ambient = scene.add_light_ambient("/ambient", intensity=AMBIENT)
        self._lights = scene.add_frame("/light", show_axes=False)
        self._lamps = [
            scene.add_light_directional(
                f"/light/{name}", color=colour, intensity=intensity, position=towards
            )
            for name, towards, colour, intensity in LIGHTS
        ]

    def _read_colours(self, lit: bool) -> None:
        """Studio light; where a head has the colours of a legend, light in which they can be read."""
        if lit == self._lit:
            return
        self._lit = lit
        self._ambient.intensity = AMBIENT if lit else READ_AMBIENT
        for lamp, (_, _, _, intensity) in zip(self._lamps, LIGHTS, strict=True):
            lamp.intensity = intensity if lit else READ_SHARE * intensity


def _points(scene: Scene, head: Head) -> NDArray[np.float64]:
    """(V, 3) metres: about the pivot; through the subject's camera, where the camera sees them."""
    seen = _at_camera(scene, head) if scene.through_camera else None
    return head.vertices - scene.pivot if seen is None else seen * TO_WORLD


def _is(before: tuple[Any, Any] | None, now: tuple[Any, Any]) -> bool:
    return before is not None and before[0] is now[0] and before[1] == now[1]


def _at_camera(scene: Scene, head: Head) -> NDArray[np.float64] | None:
    """(V, 3) the head in the axes of the subject's camera; None if it is not seen through it.

    The fitted face is; the true face where it is laid over it.
    """
    if head.name == "fit":
        return scene.photo.fit_vertices
    if head.name == "true" and _shares(scene, head):
        return _through_other_lens(scene.photo)
    return None


def _through_other_lens(photo: Photo) -> NDArray[np.float64]:
    """(V, 3) the true face where the lens of the fitted one shows it exactly as its own lens did.

    It stands at the fitted face's distance with its own depth; right and down follow from the pixels it had.
    """
    own, shown = photo.vertices, lens(photo)
    focal = photo.focal if photo.fit_focal is None else photo.fit_focal
    depth = own[:, 2] - own[:, 2].mean() + shown.distance
    share = photo.focal / focal * depth / own[:, 2]
    return np.column_stack([own[:, :2] * share[:, None], depth])


def _shares(scene: Scene, head: Head) -> bool:
    return any(other.slot == head.slot for other in scene.heads if other.name != head.name)


def _board(scene: Scene, head: Head) -> Board | None:
    """The words of a slot, with its first head; None for the others."""
    together = [other for other in scene.heads if other.slot == head.slot]
    if together[0].name != head.name:
        return None
    title = " / ".join(other.title for other in together if other.title)
    if scene.through_camera:  # where what is nearer is larger: no bar is true
        return Board(title, 0.0, ())
    lines = tuple(text for other in together for text, _ in other.caption)
    apart = [abs(other.slot - head.slot) for other in scene.heads if other.slot != head.slot]
    return Board(title, scene.scale_bar, lines, min(apart, default=np.inf))
