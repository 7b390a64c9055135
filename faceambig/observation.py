"""Observation: the points of one photograph, and `observe`, which takes a synthetic one."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .arrays import Array, IntArray, checked, number, read_only, shown, whole
from .camera import Camera, depths, project
from .model import FaceModel, Scheme, Subject
from .rotation import rotation_from_angles
from .visibility import visible_vertices

# Six pose unknowns at a known distance; fewer leave the pose itself open (MATH.md 8.4)
MIN_POINTS = 6
# Smallest ratio of the two singular values of the points before they count as one line
FLATTEST = 1e-3
LARGEST_PX = 1e9  # pixels from 0: far beyond every picture, and squares of it are still exact sums
# Pixels from end to end of the points: coordinates in units of a picture are far above
SMALLEST_PX = 1e-6
HEAVIEST = 1e9  # ratio of the largest weight to 1 and of 1 to the smallest
# Metres, of the camera that took the photograph; nearer, the nose leaves the lens's view
DISTANCES = (
    0.2,
    5.0,
)
LARGEST_EYES_PX = 1e6
DENSE = ("all", "visible")  # `scheme` of observe: vertices of the surface instead of landmarks
# Synthetic photographs: frontal distance of the eye centres in a picture of 500 x 500
EYES_PX = 100.0


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """Points of one photograph. L landmarks."""

    points: Array  # (L, 2) pixels, x right, y down; NaN = not visible
    scheme: str | IntArray  # name of the model's landmark scheme, or (L,) vertex numbers
    image_size: tuple[int, int] | None = None  # width, height, pixels
    principal_point: tuple[float, float] | None = None  # pixels; None: the middle of the picture
    weights: Array | None = None  # (L,) >= 0, a point given twice equals weight 2; None: all 1

    def __post_init__(self) -> None:
        points = checked("points", self.points, (None, 2), nan=True)
        _within("points", points)
        object.__setattr__(self, "points", read_only(points))
        if not isinstance(self.scheme, str):
            try:
                numbers = np.asarray(self.scheme)
            except ValueError:  # lists of unequal length
                numbers = np.empty(0)
            if numbers.dtype.kind not in "iu" or numbers.shape != (len(points),):
                raise ValueError(f"scheme: expected a name or {len(points)} vertex numbers")
            object.__setattr__(self, "scheme", read_only(numbers.astype(np.intp)))
        if self.weights is not None:
            weights = checked("weights", self.weights, (len(points),))
            if (weights < 0).any():
                raise ValueError(f"weights: {weights.min():g} is negative")
            used = weights[weights > 0]
            if len(used) and not 1 / HEAVIEST <= used.min() <= used.max() <= HEAVIEST:
                raise ValueError(
                    f"weights: {used.min():g} to {used.max():g} is not within "
                    f"{1 / HEAVIEST:g} to {HEAVIEST:g} (or 0)"
                )
            object.__setattr__(self, "weights", read_only(weights))
        if self.image_size is not None:
            size = checked("image_size", self.image_size, (2,))
            if size.min() < 1:
                raise ValueError(
                    f"image_size: {shown(self.image_size)} is not a width and a height in pixels"
                )
            _within("image_size", size)
        if self.principal_point is not None:
            _within("principal_point", checked("principal_point", self.principal_point, (2,)))
        self._refuse_unusable()

    def _refuse_unusable(self) -> None:
        visible = self.points[self.visible]
        if len(visible) < MIN_POINTS:
            given = int(np.isfinite(self.points.sum(axis=1)).sum())
            if given >= MIN_POINTS:
                raise ValueError(
                    f"weights: only {len(visible)} of {given} visible points weigh more than 0; "
                    f"{MIN_POINTS} are needed"
                )
            raise ValueError(
                f"points: {len(visible)} visible; {MIN_POINTS} are needed, 12 are better"
            )
        places = len(np.unique(visible, axis=0))
        if places < MIN_POINTS:
            raise ValueError(
                f"points: {len(visible)} visible, but at only {places} different places; "
                f"{MIN_POINTS} are needed"
            )
        length = float(np.ptp(visible, axis=0).max())
        if length < SMALLEST_PX:
            raise ValueError(f"points: they lie within {length:g} pixels; give them in pixels")
        spread = np.linalg.svd(visible - visible.mean(0), compute_uv=False)
        if spread[1] <= FLATTEST * spread[0]:
            raise ValueError(
                "points: they lie on one line, no pose can be found; add a point off the line"
            )

    @property
    def visible(self) -> np.ndarray:
        """(L,) True where the point is given and weighs something."""
        seen = np.isfinite(self.points.sum(axis=1))
        return seen if self.weights is None else seen & (self.weights > 0)

    @property
    def centre(self) -> Array:
        """Principal point (2,), pixels: as given, else the middle of the picture, else of the points."""
        if self.principal_point is not None:
            return np.asarray(self.principal_point, dtype=np.float64)
        if self.image_size is not None:
            return 0.5 * np.asarray(self.image_size, dtype=np.float64)
        return 0.5 * (np.nanmin(self.points, axis=0) + np.nanmax(self.points, axis=0))

    @property
    def centre_meaning(self) -> str:
        """Where `centre` comes from, in words, for the output."""
        if self.principal_point is not None:
            return "given"
        return "middle of the picture" if self.image_size is not None else "middle of the points"

    def vertices(self, model: FaceModel) -> IntArray:
        """(L,) vertex numbers of the points on `model`; ValueError if they do not belong together."""
        if isinstance(self.scheme, str):
            scheme = model.scheme(self.scheme)
            if len(scheme) != len(self.points):
                raise ValueError(
                    f"points: {len(self.points)} for scheme {scheme.name!r}, which has {len(scheme)}"
                )
            return scheme.vertices
        for vertex in (self.scheme.min(), self.scheme.max()):
            if not 0 <= vertex < model.n_vertices:
                raise ValueError(
                    f"scheme: vertex {vertex} is not within 0 to {model.n_vertices - 1}"
                )
        return self.scheme


def _within(name: str, pixels: Array) -> None:
    """ValueError for pixels beyond every picture: their squares would overflow."""
    largest = float(np.nanmax(np.abs(pixels), initial=0.0))
    if largest > LARGEST_PX:
        raise ValueError(f"{name}: {largest:g} is not within {LARGEST_PX:g} pixels")


def eye_distance(points: Array, scheme: Scheme) -> float:
    """Distance of the eye centres of `points` (L, k) in scheme order, in their unit; NaN if one is missing."""
    right, left = (points[list(rows)].sum(axis=0) / len(rows) for rows in scheme.eyes)
    return math.dist(left.tolist(), right.tolist())


def portrait_camera(
    face: Subject,
    *,
    distance: float | None,
    scheme: str = "ibug68",
    yaw_deg: float = 0.0,
    pitch_deg: float = 0.0,
    roll_deg: float = 0.0,
    eyes_px: float = EYES_PX,
) -> Camera:
    """The camera of a synthetic portrait: origin of the model in the middle, zoomed for a constant eye distance.

    The zoom is the one that makes the eye centres of the *frontal* face `eyes_px` apart, so a portrait from far away is
    the same size as one from near, and turning the head does not zoom. distance None is a far-away camera.
    """
    if not isinstance(face, Subject):
        raise ValueError(f"face: {shown(face)} is not a Subject; take one with model.subject(1)")
    if not isinstance(scheme, str):
        raise ValueError(f"scheme: {shown(scheme)} is not the name of a landmark scheme")
    distance = None if distance is None else number("distance", distance)
    if distance is not None and not DISTANCES[0] <= distance <= DISTANCES[1]:
        raise ValueError(
            f"distance: {distance:g} m is not within {DISTANCES[0]:g} to {DISTANCES[1]:g}"
        )
    eyes_px = number("eyes_px", eyes_px)
    if not 1 <= eyes_px <= LARGEST_EYES_PX:
        raise ValueError(f"eyes_px: {eyes_px:g} is not within 1 to {LARGEST_EYES_PX:g} pixels")
    for name, value in (("yaw_deg", yaw_deg), ("pitch_deg", pitch_deg), ("roll_deg", roll_deg)):
        degrees = number(name, value)
        if not abs(degrees) <= 360:  # False for NaN too
            raise ValueError(f"{name}: {degrees:g} is not within -360 to 360 degrees")
    kappa = 0.0 if distance is None else 1.0 / distance
    points = face.vertices[face.model.scheme(scheme).vertices]
    frontal = Camera(rotation_from_angles(0, 0, 0), np.zeros(2), 1.0, kappa)
    s = eyes_px / eye_distance(project(frontal, points), face.model.scheme(scheme))
    camera = Camera(rotation_from_angles(yaw_deg, pitch_deg, roll_deg), np.zeros(2), s, kappa)
    _refuse_behind(camera, points)
    return camera


def observe(
    face: Subject,
    *,
    distance: float | None,
    scheme: str = "ibug68",
    yaw_deg: float = 0.0,
    pitch_deg: float = 0.0,
    roll_deg: float = 0.0,
    noise_percent: float = 0.0,
    seed: int = 0,
    eyes_px: float = EYES_PX,
) -> Observation:
    """A synthetic photograph of `face`: its landmarks in a picture of 5 x 5 eye distances.

    Parameters
    ----------
    distance: metres from the camera to the middle between the eyes of the mean head; None is orthographic.
    scheme: of the landmarks; or "all" for every vertex of the surface, "visible" for those that nothing hides: dense
        correspondence, with vertex numbers as the observation's scheme.
    noise_percent: landmark noise, sd per coordinate in percent of the distance of the eye centres in the picture.
    seed: of the noise.
    eyes_px: pixels between the eye centres of the frontal face.
    """
    eyes_px = number("eyes_px", eyes_px)
    noise_percent = number("noise_percent", noise_percent)
    if not 0 <= noise_percent <= 20:
        raise ValueError(f"noise_percent: {noise_percent:g} is not within 0 to 20")
    seed = whole("seed", seed)
    if seed < 0:
        raise ValueError(f"seed: {shown(seed)} is negative")
    dense = isinstance(face, Subject) and isinstance(scheme, str) and scheme in DENSE
    if dense and scheme not in face.model.schemes:
        # Whose eyes give zoom and noise their unit
        named = next(iter(face.model.schemes), "ibug68")
    else:
        dense, named = False, scheme
    camera = portrait_camera(
        face,
        distance=distance,
        scheme=named,
        yaw_deg=yaw_deg,
        pitch_deg=pitch_deg,
        roll_deg=roll_deg,
        eyes_px=eyes_px,
    )
    landmarks = face.model.scheme(named)
    vertices = landmarks.vertices
    if dense and scheme == "all":
        vertices = np.arange(len(face.vertices))
        _refuse_behind(camera, face.vertices)
    elif dense:
        vertices = visible_vertices(face.model.faces, face.vertices, camera).nonzero()[0]
    side = round(5 * eyes_px)
    points = project(camera, face.vertices[vertices]) + 0.5 * side
    if noise_percent > 0:
        eyes = project(camera, face.vertices[landmarks.vertices])
        sigma = noise_percent / 100 * eye_distance(eyes, landmarks)
        points = points + np.random.default_rng(seed).normal(scale=sigma, size=points.shape)
    return Observation(points, vertices if dense else scheme, image_size=(side, side))


def _refuse_behind(camera: Camera, points: Array) -> None:
    if (depths(camera, points) <= 0).any():
        raise ValueError(
            f"distance: at {camera.distance:g} m a point lies behind the camera; take the photo from farther away"
        )
