"""Viewer: where one browser looks from. A long lens far away, or the subject's own camera.

The viewer stands 20 m away and zooms by the angle, so that perspective is the subject's camera's alone and the wheel
changes none. Where a hand has turned the viewer to is told when it rests; nothing is drawn from it.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import viser
from numpy.typing import NDArray

from faceambig.scene import Photo, View

Place = tuple[float, float, float]  # azimuth and elevation in degrees, zoom
Orbited = Callable[[float, float, float], None]  # takes a Place

LENS = 20.0  # metres to the viewer: a head 0.2 m deep is true to 0.5 %
NEAR, FAR = 0.5, 60.0  # with 18 and 22 the canvas stayed blank behind a background picture
ZOOM_1 = 0.165  # metres above and below the centre at zoom 1
BESIDE = 0.12  # metres: half a head and a little air, beyond the outermost slots
HAND_COUNTS = 10.0  # seconds: a hand's last move may be told so much later on a slow machine
STEEPEST = 89.0  # degrees: straight from above "up" has no direction
NARROW = 1100  # pixels: two panels of 372 leave too little for two heads
WIDE = 1800  # pixels: of a projector; panels of 558 leave 700 for two heads
PHONE = 577  # pixels: at most 576 wide, viser shows its panel as a sheet over the lower part
PHONE_HEADS_AT = 0.19  # share of the height, from the top, where the heads stand above the sheet
# Of a browser that has heard nothing yet; no view uses this angle
FIRST_POSITION, FIRST_FOV = (
    (0.0, 0.0, LENS),
    0.0257,
)
ARRIVAL = 5.0  # seconds a browser may take to go where it is put; a busy one took more than 1 when it connected
ORBIT_REST = 0.25  # seconds without a turn before the place is told
SAME_TURN, SAME_ZOOM = 0.6, 0.01  # degrees and share that a rounded place may be off


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """What the viewer sees: which way things face, and how large a pixel is."""

    board: NDArray[np.float64]  # (3, 3) the viewer's right, up and back as columns
    pixel: float  # metres a pixel, of what stands at the heads
    above: float  # metres seen above the heads' middle
    below: float  # metres seen below it; on a phone the sheet covers the lower ones


@dataclass(frozen=True, slots=True)
class Lens:
    """The subject's camera: where the photograph was assumed to be taken from."""

    distance: float  # metres
    half: float  # tangent of half the photograph's angle


class Viewer:
    """The camera of one browser. `moved` is called with what is seen whenever that changes."""

    def __init__(
        self,
        client: viser.ClientHandle,
        moved: Callable[[Sight], None],
        orbited: Orbited | None = None,
    ) -> None:
        self._client, self._moved, self._orbited = client, moved, orbited
        # Of the window, so asked before a panel is docked and takes its share of the canvas
        # viser's panel is a sheet over the scene
        self.phone = 0 < client.camera.image_width < PHONE
        self.narrow = 0 < client.camera.image_width < NARROW  # no room for a second panel
        self.wide = client.camera.image_width >= WIDE  # room for panels half as wide again
        self.sight = Sight(np.eye(3), 2 * ZOOM_1 / 800, ZOOM_1, ZOOM_1)
        self._view: View | Lens | None = None
        self._half_width = 0.0  # metres beside the centre that must be seen
        self._half = ZOOM_1  # metres seen above and below the middle of the canvas
        self._rise = 0.0  # metres: how far above that middle the heads stand
        self._told: list[Place] = []  # places told that have not come back as a view
        self._timer: asyncio.TimerHandle | None = None
        self._aim = (np.array(FIRST_POSITION), FIRST_FOV)  # where the last look put the viewer
        self._size = (0, 0)  # pixels of the canvas the zoom was made for
        self._hand_at = -np.inf  # monotonic seconds: when a hand last moved the viewer
        self._looked_at = -np.inf  # monotonic seconds: for a while the browser reports older places
        client.camera.on_update(self._turned)

    def show(self, view: View | Lens, half_width: float) -> None:
        """Stand where a view says, so that `half_width` metres are seen to both sides at zoom 1."""
        if view == self._view and half_width == self._half_width:
            return
        told = [
            n for n, place in enumerate(self._told) if isinstance(view, View) and _same(view, place)
        ]
        stays = bool(told) and half_width == self._half_width
        self._view, self._half_width = view, half_width
        # Those after it are on their way
        self._told = self._told[told[-1] + 1 :] if stays else []
        if not stays:  # else a hand has brought the viewer there, and may be moving on
            self.look(view)

    def by_hand(self) -> None:
        """A hand is turning the viewer: only then is another place news. viser moves it by itself, too."""
        self._hand_at = time.monotonic()

    def look(self, view: View | Lens) -> None:
        """Put the viewer where a view says, or where the subject's camera stands."""
        camera = self._client.camera
        self._size = (camera.image_width, camera.image_height)
        self._looked_at = time.monotonic()
        self._keep_quiet()
        if isinstance(view, Lens):
            self._look_through(view)
            return
        azimuth = np.radians(view.azimuth_deg)
        elevation = np.radians(np.clip(view.elevation_deg, -STEEPEST, STEEPEST))
        back = np.array(
            [
                np.sin(azimuth) * np.cos(elevation),
                np.sin(elevation),
                np.cos(azimuth) * np.cos(elevation),
            ]
        )
        right = np.array([np.cos(azimuth), 0.0, -np.sin(azimuth)])
        up = np.cross(back, right)
        half = self._half = view.half_height * self._wider()
        self._rise = view.rise + ((1 - 2 * PHONE_HEADS_AT) * half if self.phone else 0.0)
        centre = -self._rise * up
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
            self._see(np.column_stack([right, up, back]))

    def _look_through(self, lens: Lens) -> None:
        camera = self._client.camera
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
            self._half, self._rise = tall * lens.distance, up * lens.distance
            self._see(np.eye(3))

    def _wider(self) -> float:
        """How many times more must be seen on this canvas for the outermost heads to be whole at zoom 1."""
        camera = self._client.camera
        high = 0.5 / PHONE_HEADS_AT if self.phone else 1.0  # the sheet leaves the upper part
        return max(
            high, self._half_width / ZOOM_1 * camera.image_height / max(1, camera.image_width)
        )

    def _see(self, board: NDArray[np.float64]) -> None:
        pixel = 2 * self._half / max(1, self._size[1])
        above, below = self._half - self._rise, self._half + self._rise
        self.sight = Sight(board, pixel, above, min(above, below) if self.phone else below)
        self._moved(self.sight)

    async def _turned(self, camera: viser.CameraHandle) -> None:  # async: on the loop, cheap
        view = self._view
        if view is None:
            return
        if _at_first(camera) and not self._aimed(camera):
            # The browser went to its first camera after ours: when it connects, in no order, or by "Reset View"
            self.look(view)
            return
        if (camera.image_width, camera.image_height) != self._size:
            self.look(view)  # a panel was docked or the window resized: all heads stay whole
            return
        if isinstance(view, Lens):
            return
        with self._client.atomic():
            self._see(_board(camera.wxyz))
        if self._aimed(camera):
            self._looked_at = -np.inf
            self._keep_quiet()
        else:  # a hand; or on its way, and then it arrives before that is told
            self._tell_after(max(ORBIT_REST, self._looked_at + ARRIVAL - time.monotonic()))

    def _aimed(self, camera: viser.CameraHandle) -> bool:
        position, fov = self._aim
        return (
            bool(np.allclose(camera.position, position, atol=1e-3))
            and abs(camera.fov / fov - 1) < 1e-3
        )

    def _tell_after(self, seconds: float) -> None:
        self._keep_quiet()
        if self._orbited is not None:
            self._timer = asyncio.get_running_loop().call_later(seconds, self._tell)

    def _keep_quiet(self) -> None:
        if self._timer is not None:
            self._timer.cancel()

    def _tell(self) -> None:
        """Say where a hand has turned the viewer to; the place of the view itself is no news."""
        if self._orbited is None or not isinstance(self._view, View):
            return
        if time.monotonic() - self._hand_at > HAND_COUNTS:
            return
        back = self.sight.board[:, 2]
        half = LENS * np.tan(0.5 * self._client.camera.fov)
        place = (
            round(float(np.degrees(np.arctan2(back[0], back[2]))), 1) + 0.0,  # no minus zero
            round(float(np.degrees(np.arcsin(np.clip(back[1], -1, 1)))), 1) + 0.0,
            round(float(ZOOM_1 * self._wider() / half), 2),
        )
        if not _same(self._view, place) and place not in self._told[-1:]:
            self._told = [*self._told[-3:], place]
            self._orbited(*place)


def lens(photo: Photo, *, by_eyes: bool = False) -> Lens:
    """The camera that a photograph's fit assumed; the true one's where there is no fit.

    by_eyes: zoomed so that the fitted face's eyes are as far apart as the photograph's. At a wrong distance they are
    up to 2.2 % off, a part of the landmark error, and a face that should keep its size would grow while it glides.
    """
    focal = photo.focal if photo.fit_focal is None else photo.fit_focal
    points = photo.vertices if photo.fit_vertices is None else photo.fit_vertices
    share = photo.fit_eyes if by_eyes else 1.0
    return Lens(float(points[:, 2].mean()), 0.5 * share * photo.height / focal)


def _same(view: View, place: Place) -> bool:
    """Whether a view is a place that was told, however its numbers were rounded on the way."""
    azimuth, elevation, zoom = place
    turn = (view.azimuth_deg - azimuth + 180.0) % 360.0 - 180.0
    return (
        abs(turn) < SAME_TURN
        and abs(view.elevation_deg - elevation) < SAME_TURN
        and abs(view.half_height * zoom / ZOOM_1 - 1) < SAME_ZOOM
    )


def _at_first(camera: viser.CameraHandle) -> bool:
    """Whether a browser stands where every browser starts; "Reset View" leaves its angle as it is."""
    return bool(
        np.allclose(camera.position, FIRST_POSITION, atol=1e-3)
        and np.allclose(camera.look_at, 0.0, atol=1e-3)
    )


def _board(wxyz: NDArray[np.float64]) -> NDArray[np.float64]:
    """The viewer's right, up and back as columns, of viser's camera, which looks along +z with y down."""
    w, x, y, z = wxyz
    R = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    return R * (1.0, -1.0, -1.0)


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
    # Eigenvector of the largest eigenvalue (Bar-Itzhack)
    return np.linalg.eigh(K + np.triu(K, 1).T)[1][:, -1]
