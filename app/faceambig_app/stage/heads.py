"""HeadNodes: the nodes of one head of the row: its meshes, colours, title, the scale bar and the lines below.

Title and bar are on a board, a frame that always faces the viewer. Heads that share a slot share the board of the
first of them.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import zip_longest
from typing import Literal

import numpy as np
import viser
from numpy.typing import NDArray

from faceambig.scene import Head

from ..guard import add_colours
from ..text import say
from .viewer import Sight

TITLE_AT, BAR_AT = 0.155, -0.165  # metres above and below the pivot, where that much is seen
# Pixels: to the edge of what is seen, of a line of words, from bar to words
MARGIN, LINE, AIR = (
    14,
    15,
    4,
)
# Pixels: of a letter of usual size, and from the words of one head to those of the next
LETTER, APART = (
    7.0,
    10,
)
LINE_ROOM = 125  # pixels that a line below a head may need
SMALLEST_TITLE, SMALLEST_LINE = 0.7, 0.85  # share of it that letters of a narrow row may have
END = 0.003  # metres: half the height of the bar's ends
GREY = (120, 134, 148)  # of the bar, readable on both grounds
OCCLUSION_POWER = 1.3  # without it nostrils and ears glow (no shadows)


@dataclass(frozen=True, slots=True)
class Board:
    """What stands above and below a head."""

    title: str
    bar: float  # metres; 0: none
    lines: tuple[str, ...]  # below the bar
    room: float = np.inf  # metres to the next head

    def foot(self, room: float) -> tuple[str, ...]:
        """The words below the bar, with `room` pixels to the next head: no lines where they would be too small."""
        length = (say("stage.bar", mm=f"{1e3 * self.bar:g}"),) if self.bar > 0 else ()
        return (*length, *self.lines) if room > LINE_ROOM else length


class Words:
    """Words above or below a head, each line in the middle: viser's labels have theirs to the left."""

    def __init__(
        self,
        scene: viser.SceneApi,
        name: str,
        anchor: Literal["bottom-center", "top-center"],
        bold: float = 1.0,
    ) -> None:
        """bold: times that they are larger."""
        self._scene, self._name, self._bold = scene, name, bold
        self._anchor: Literal["bottom-center", "top-center"] = anchor
        self._labels: list[viser.LabelHandle] = []
        self.lines: list[str] = []

    def write(self, texts: Sequence[str], room: float, smallest: float) -> None:
        """Each in a line, where there is `room` for it (pixels, of letters of usual size): smaller, then in several."""
        self.lines, scale = fitted(texts, room, smallest)
        for _ in range(len(self.lines) - len(self._labels)):
            name = f"{self._name}{len(self._labels)}"
            self._labels.append(self._scene.add_label(name, "", anchor=self._anchor))
        for label, text in zip_longest(self._labels, self.lines):
            label.visible = text is not None
            label.text, label.font_screen_scale = text or "", self._bold * scale

    def place(self, first: float, step: float) -> None:
        """The first line `first` metres above the pivot, each other `step` lower."""
        for k, label in enumerate(self._labels[: len(self.lines)]):
            label.position = (0.0, first - k * step, 0.0)


class HeadNodes:
    """Two meshes (coarse while a hand moves) and a board."""

    def __init__(self, client: viser.ClientHandle, head: Head, bold: float = 1.0) -> None:
        """bold: times that words and lines are larger."""
        scene, root = client.scene, f"/{head.name}"
        self._bold = bold
        self._root = scene.add_frame(root, show_axes=False)
        self._faces, self._coarse_faces = head.faces, head.coarse_faces
        vertices = head.vertices.astype(np.float32)
        self._full = scene.add_mesh_simple(f"{root}/head", vertices, head.faces)
        self._coarse: viser.MeshHandle | None = None
        self._n_coarse = 0
        if head.coarse_faces is not None:
            self._n_coarse = int(head.coarse_faces.max()) + 1
            self._coarse = scene.add_mesh_simple(
                f"{root}/draft", vertices[: self._n_coarse], head.coarse_faces, visible=False
            )
        self._board = scene.add_frame(f"{root}/board", show_axes=False)
        self._title = Words(scene, f"{root}/board/title", "bottom-center", bold)
        self._bar = scene.add_line_segments(
            f"{root}/board/bar", _bar(0.05), GREY, thickness=2.0 * bold, thickness_units="screen",
        )  # fmt: skip
        self._foot = Words(scene, f"{root}/board/foot", "top-center", bold)
        # Directly below the root, where both meshes stand: the first of the fine vertices are the coarse ones
        self._colours = add_colours(scene, root, shaded(head))
        self._painted: object = head.colours
        self._behind = False  # whether the full mesh has an older face than the coarse one
        self._looks: object = None  # of the meshes: (draft, seen, opacity)
        self._values = head.values_mm
        self._offset = 0.0  # metres along the viewer's right
        self._depth = 0.0  # metres, of the words before the viewer who stands at the root
        self._wanted: Board | None = Board(head.title, 0.0, (), 0.0)  # no scene's
        self._said: object = None  # the words there are: (board, pixels of room)
        # What the nodes stand for: viser compares every vector anew, at 50 us each
        self._placed: object = None

    def fits(self, head: Head) -> bool:
        """Whether these meshes have the triangles of `head`; else new ones are needed."""
        return _equal(self._faces, head.faces) and _equal(self._coarse_faces, head.coarse_faces)

    def show(self, points: NDArray[np.float64], head: Head, draft: bool) -> None:
        """Send what changed of the head at `points` (V, 3), metres; equal arrays send nothing."""
        self._values = head.values_mm
        self._move(points, draft)
        self._look(head, draft)

    def keep(self, head: Head, draft: bool) -> bool:
        """As `show` at the points that the meshes have; False if a coarse mesh alone has them and a full one is due."""
        if not draft and self._behind:
            return False
        self._values = head.values_mm
        self._look(head, draft)
        return True

    def _move(self, points: NDArray[np.float64], draft: bool) -> None:
        self._behind = draft and self._coarse is not None
        vertices = points.astype(np.float32)
        if not self._behind:
            self._full.vertices = vertices
        if self._coarse is not None:  # at rest too: an invisible mesh must not keep an older face
            self._coarse.vertices = vertices[: self._n_coarse]

    def _look(self, head: Head, draft: bool) -> None:
        draft = draft and self._coarse is not None
        seen, opacity = head.opacity > 0, head.opacity if head.opacity < 1 else None
        if (draft, seen, opacity) != self._looks:  # asked here: viser takes 10 us to ask
            self._looks = draft, seen, opacity
            if self._coarse is not None:
                self._coarse.visible = draft and seen
                self._coarse.opacity = opacity
            self._full.visible = seen and not draft
            self._full.opacity = opacity  # None: sorted as a solid
        if head.colours is not self._painted:
            self._painted = head.colours
            self._colours.colors = shaded(head)

    def value(self, vertex: int) -> float | None:
        """Millimetres that the colour of a vertex means, NaN where nothing is measured; None where it means none."""
        values = self._values
        return None if values is None or vertex >= len(values) else float(values[vertex])

    def write(self, board: Board | None) -> None:
        """The words above and below; None where another head of the slot, or nothing, has them."""
        if board == self._wanted:
            return
        self._wanted = board
        self._board.visible = board is not None
        if board is None:
            return
        self._bar.visible = board.bar > 0
        if board.bar > 0:
            self._bar.points = _bar(board.bar)

    def _say(self, board: Board, room: float) -> None:
        """The words in a `room` of pixels as `Words.write` has it; panels that come after the heads take of it."""
        if self._said != (board, room):
            self._said = board, room
            self._title.write([board.title], room, SMALLEST_TITLE)
            self._foot.write(board.foot(room), room, SMALLEST_LINE)

    def stand(self, offset: float, visible: bool = True, depth: float = 0.0) -> None:
        """In the row, `offset` metres along the viewer's right, the words `depth` before him; `place` puts it there."""
        self._root.visible = visible
        self._offset, self._depth = offset, depth

    def place(self, sight: Sight, wxyz: NDArray[np.float64]) -> None:
        """Stand along the viewer's right; the board faces the viewer and stays inside what is seen."""
        placed = (sight, self._offset, self._depth, self._wanted)
        if self._placed != placed:
            self._placed = placed
            self._put(sight, wxyz)

    def _put(self, sight: Sight, wxyz: NDArray[np.float64]) -> None:
        self._root.position = self._offset * sight.board[:, 0]
        if self._wanted is None:
            return
        self._say(self._wanted, self._wanted.room / sight.pixel / self._bold)
        self._board.wxyz, self._board.position = wxyz, (0.0, 0.0, -self._depth)
        above, below = len(self._title.lines), len(self._foot.lines)
        line, margin = self._bold * LINE * sight.pixel, MARGIN * sight.pixel
        at = max(BAR_AT, END + margin + line * below - sight.below)
        self._title.place(min(TITLE_AT + (above - 1) * line, sight.above - margin - line), line)
        self._bar.position = (0.0, at, 0.0)
        self._foot.place(at - END - AIR * sight.pixel, line)

    def remove(self) -> None:
        """Take the head and all that stands on it out of the scene."""
        self._root.remove()


def fitted(texts: Sequence[str], room: float, smallest: float) -> tuple[list[str], float]:
    """Lines of the words of `texts` and the share of their size, so that they stay off what is `room` pixels away.

    No word is parted, and no number from its unit, between which is no usual space.
    """
    lines: list[str] = []
    room = max(1.0, room - APART)
    for text in texts:
        if room < smallest * LETTER * len(text):
            letters = max(1, int(room / (smallest * LETTER)))
            lines += textwrap.wrap(text, letters, break_long_words=False)
        elif text:
            lines.append(text)
    longest = max(map(len, lines), default=1)
    return lines, float(np.clip(room / (LETTER * longest), smallest, 1.0))


def _bar(length: float) -> NDArray[np.float32]:
    """(3, 2, 3) a line of `length` metres with two ends."""
    x = length / 2
    return np.array(
        [
            [[-x, 0, 0], [x, 0, 0]],
            [[-x, -END, 0], [-x, END, 0]],
            [[x, -END, 0], [x, END, 0]],
        ],
        dtype=np.float32,
    )


def _equal(a: NDArray[np.uint32] | None, b: NDArray[np.uint32] | None) -> bool:
    return a is b or (a is not None and b is not None and np.array_equal(a, b))


def shaded(head: Head) -> NDArray[np.uint8]:
    """(V, 3) sRGB: the colours darkened by ambient occlusion, in linear light; legend colours stay as they are."""
    if head.occlusion is None or not head.lit:
        return head.colours
    linear = _to_linear()[head.colours] * (head.occlusion[:, None] / 255.0) ** OCCLUSION_POWER
    srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return (255.0 * srgb).round().astype(np.uint8)


@lru_cache(maxsize=1)
def _to_linear() -> NDArray[np.float64]:
    c = np.arange(256) / 255.0
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
