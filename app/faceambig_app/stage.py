"""Stage: draws a Scene as viser nodes and panel figures of one browser. It computes nothing of the face.

Two heads stand at +-slot along the viewer's right, so they turn in place and never hide each other while orbiting. Each
has a board, a frame that always faces the viewer, which carries its title and the 50 mm bar. The viewer looks through a
long lens: 20 m away, zoomed by the angle, so perspective is the subject's camera's alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import viser
from numpy.typing import NDArray

from faceambig.scene import Head, Photo, Scene, View

from .guard import add_colours

LENS = 20.0  # metres to the viewer: a head 0.2 m deep is true to 0.5 %
NEAR, FAR = 0.5, 60.0  # with 18 and 22 the canvas stayed blank behind a background picture
HALF_WIDTH = 0.255  # metres: both heads and a little air
TITLE_AT, BAR_AT = 0.155, -0.165  # metres above and below the pivot
NARROW = 1100  # pixels: two panels of 372 leave too little for two heads
PHONE = 577  # pixels: at most 576 wide, viser shows its panel as a sheet over the lower part
PHONE_HEADS_AT = 0.19  # share of the height, from the top, where the heads stand above the sheet
FIRST_POSITION, FIRST_FOV = (
    (0.0, 0.0, LENS),
    0.0257,
)  # of a browser that has heard nothing yet; no view uses this angle
TO_WORLD = np.array(
    [1.0, -1.0, -1.0]
)  # camera axes (y down, z forward) to the page's (y up, z to the viewer)
OCCLUSION_POWER = 1.3  # without it nostrils and ears glow (no shadows)
BACKGROUND = {False: (243, 246, 249), True: (24, 28, 33)}  # light, dark
LIGHTS = (  # direction towards the light in viewer axes (right, up, back), colour, intensity: key from above left
    ("key", (-0.5, 0.7, 1.2), (255, 244, 232), 2.8),
    ("fill", (0.9, 0.1, 0.8), (235, 242, 255), 0.7),
    ("rim", (0.0, 0.6, -1.0), (255, 250, 245), 0.9),
)


class Stage:
    """The 3D nodes of one browser."""

    def __init__(self, client: viser.ClientHandle) -> None:
        self._client, self._scene = client, client.scene
        # Of the window, so asked before a panel is docked and takes its share of the canvas
        self.phone = (
            0 < client.camera.image_width < PHONE
        )  # viser's panel is a sheet over the scene
        self.narrow = 0 < client.camera.image_width < NARROW  # no room for a second panel
        self._heads: dict[str, HeadNodes] = {}
        self._view: View | Lens | None = None
        self._board = np.eye(3)
        self._aim = (np.array(FIRST_POSITION), FIRST_FOV)  # where the last look put the viewer
        self._size = (0, 0)  # pixels of the canvas the zoom was made for
        self._light_room()
        client.camera.on_update(self._turned)

    def show(self, scene: Scene, draft: bool) -> None:
        """Draw the heads; a draft has the coarse mesh. Call inside client.atomic()."""
        through = _lens(scene.photo) if scene.through_camera else None
        for head in scene.heads:
            if head.name not in self._heads:
                self._heads[head.name] = HeadNodes(self._client, head)
            nodes = self._heads[head.name]
            if through is None:
                nodes.show(head.vertices - scene.pivot, head, draft)
            elif head.name == "fit" and scene.photo.fit_vertices is not None:
                nodes.show(scene.photo.fit_vertices * TO_WORLD, head, draft)
            nodes.stand(self._board, through is not None, head.name == "fit")
        view = scene.views[0] if through is None else through
        if view != self._view:
            self._view = view
            self.look(view)

    def look(self, view: View | Lens) -> None:
        """Put the viewer where a view says, or the subject's camera stands."""
        camera = self._client.camera
        if isinstance(view, Lens):
            self._look_through(view)
            return
        self._size = (camera.image_width, camera.image_height)
        half = max(view.half_height, HALF_WIDTH * camera.image_height / max(1, camera.image_width))
        azimuth, elevation = np.radians((view.azimuth_deg, view.elevation_deg))
        back = np.array(
            [
                np.sin(azimuth) * np.cos(elevation),
                np.sin(elevation),
                np.cos(azimuth) * np.cos(elevation),
            ]
        )
        right = np.array([np.cos(azimuth), 0.0, -np.sin(azimuth)])
        up = np.cross(back, right)
        centre = -(1 - 2 * PHONE_HEADS_AT) * half * up if self.phone else np.zeros(3)
        with self._client.atomic():
            # Place before limits: the other way round viser glides there
            camera.up_direction = (0.0, 1.0, 0.0)
            camera.position = centre + LENS * back
            camera.look_at = centre
            camera.fov = 2 * float(np.arctan(half / LENS))
            self._aim = (centre + LENS * back, camera.fov)
            camera.near, camera.far = NEAR, FAR
            camera.min_orbit_distance = LENS  # no dolly: the wheel must not change perspective
            camera.max_orbit_distance = LENS
        self._place(np.column_stack([right, up, back]))

    def _aimed(self, camera: viser.CameraHandle) -> bool:
        position, fov = self._aim
        return (
            bool(np.allclose(camera.position, position, atol=1e-3))
            and abs(camera.fov / fov - 1) < 1e-3
        )

    def _look_through(self, lens: Lens) -> None:
        camera = self._client.camera
        self._size = (camera.image_width, camera.image_height)
        height, width = camera.image_height, max(1, camera.image_width)
        tall = lens.half * max(1.0, height / width)  # the whole photograph is seen
        up = (1 - 2 * PHONE_HEADS_AT) * tall if self.phone else 0.0
        with self._client.atomic():
            camera.min_orbit_distance, camera.max_orbit_distance = 0.05, 2 * LENS
            camera.near, camera.far = 0.05, FAR
            camera.up_direction = (0.0, 1.0, 0.0)
            camera.position = (0.0, 0.0, 0.0)
            # Shifting the axis instead of the picture: on a phone the face stands in the upper part
            camera.look_at = (0.0, -up * lens.distance, -lens.distance)
            camera.fov = 2 * float(np.arctan(tall))
            self._aim = (np.zeros(3), camera.fov)
            self._lights.wxyz = (1.0, 0.0, 0.0, 0.0)

    async def _turned(self, camera: viser.CameraHandle) -> None:  # async: on the loop, cheap
        if self._view is not None and _at_first(camera) and not self._aimed(camera):
            # The browser went to its first camera after ours: when it connects, in no order, or by "Reset View"
            self.look(self._view)
            return
        if isinstance(self._view, Lens):
            if (camera.image_width, camera.image_height) != self._size:
                self.look(self._view)
            return
        if self._view is not None and (camera.image_width, camera.image_height) != self._size:
            self.look(self._view)  # a panel was docked or the window resized: both heads stay whole
            return
        w, x, y, z = camera.wxyz
        R = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        self._place(R * (1.0, -1.0, -1.0))  # viser's camera looks along +z with y down

    def _place(self, board: NDArray[np.float64]) -> None:
        """Stand the heads along the viewer's right; `board` (3, 3) has the viewer's right, up and back as columns."""
        self._board = board
        wxyz = quaternion(board)
        with self._client.atomic():
            for nodes in self._heads.values():
                nodes.place(board, wxyz)
            self._lights.wxyz = wxyz

    def _light_room(self) -> None:
        scene = self._scene
        scene.configure_default_lights(enabled=False)
        scene.configure_environment_map(None)
        scene.add_light_ambient("/ambient", intensity=0.75)
        self._lights = scene.add_frame("/light", show_axes=False)
        for name, towards, colour, intensity in LIGHTS:
            scene.add_light_directional(
                f"/light/{name}", color=colour, intensity=intensity, position=towards
            )


@dataclass(frozen=True, slots=True)
class Lens:
    """The subject's camera: where the photograph was assumed to be taken from."""

    distance: float  # metres
    half: float  # tangent of half the photograph's angle


def _lens(photo: Photo) -> Lens:
    focal = photo.focal if photo.fit_focal is None else photo.fit_focal
    points = photo.vertices if photo.fit_vertices is None else photo.fit_vertices
    return Lens(float(points[:, 2].mean()), 0.5 * photo.height / focal)


def _at_first(camera: viser.CameraHandle) -> bool:
    """Whether a browser stands where every browser starts; "Reset View" leaves its angle as it is."""
    return bool(
        np.allclose(camera.position, FIRST_POSITION, atol=1e-3)
        and np.allclose(camera.look_at, 0.0, atol=1e-3)
    )


class HeadNodes:
    """The nodes of one head: two meshes (coarse while a hand moves), title, bar."""

    def __init__(self, client: viser.ClientHandle, head: Head) -> None:
        scene, root = client.scene, f"/{head.name}"
        self._slot = head.slot
        self._root = scene.add_frame(root, show_axes=False)
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
        self._title = scene.add_label(
            f"{root}/board/title", head.title, position=(0.0, TITLE_AT, 0.0), anchor="bottom-center"
        )
        bar = np.array(
            [
                [[-0.025, 0, 0], [0.025, 0, 0]],
                [[-0.025, -0.003, 0], [-0.025, 0.003, 0]],
                [[0.025, -0.003, 0], [0.025, 0.003, 0]],
            ]
        )
        scene.add_line_segments(
            f"{root}/board/bar", bar.astype(np.float32), (120, 134, 148), thickness=2.0, thickness_units="screen",
            position=(0.0, BAR_AT, 0.0),
        )  # fmt: skip
        scene.add_label(
            f"{root}/board/mm", "50 mm", position=(0.0, BAR_AT - 0.006, 0.0), anchor="top-center"
        )
        # Directly below the root, where both meshes stand: the first of the fine vertices are the coarse ones
        self._colours = add_colours(scene, root, shaded(head))
        self._painted: object = head.colours

    def show(self, points: NDArray[np.float64], head: Head, draft: bool) -> None:
        """Send what changed of the head at `points` (V, 3), metres; equal arrays send nothing."""
        draft = draft and self._coarse is not None
        vertices = points.astype(np.float32)
        if not draft:
            self._full.vertices = vertices
        if self._coarse is not None:  # at rest too: an invisible mesh must not keep an older face
            self._coarse.vertices = vertices[: self._n_coarse]
            self._coarse.visible = draft
        self._full.visible = not draft
        if head.colours is not self._painted:
            self._painted = head.colours
            self._colours.colors = shaded(head)

    def stand(self, board: NDArray[np.float64], through_camera: bool, kept: bool) -> None:
        """In the row; or, seen through the subject's camera, where its vertices say, alone (`kept`)."""
        self._root.visible = kept or not through_camera
        self._board.visible = not through_camera
        self._root.position = np.zeros(3) if through_camera else self._slot * board[:, 0]

    def place(self, board: NDArray[np.float64], wxyz: NDArray[np.float64]) -> None:
        """Stand along the viewer's right; the board faces the viewer."""
        self._root.position = self._slot * board[:, 0]
        self._board.wxyz = wxyz


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


def quaternion(R: NDArray[np.float64]) -> NDArray[np.float64]:
    """(w, x, y, z) of a rotation matrix, by the largest of its four components."""
    K = np.array(
        [
            [R[0, 0] + R[1, 1] + R[2, 2], R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]],
            [0.0, R[0, 0] - R[1, 1] - R[2, 2], R[1, 0] + R[0, 1], R[0, 2] + R[2, 0]],
            [0.0, 0.0, R[1, 1] - R[0, 0] - R[2, 2], R[2, 1] + R[1, 2]],
            [0.0, 0.0, 0.0, R[2, 2] - R[0, 0] - R[1, 1]],
        ]
    )
    return np.linalg.eigh(K + np.triu(K, 1).T)[1][
        :, -1
    ]  # eigenvector of the largest eigenvalue (Bar-Itzhack)
