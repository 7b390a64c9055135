"""What is painted on the mean head: colours, occlusion, regions, the evaluation region."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy import sparse

from head_mesh import BaseMesh
from head_source import Source

Array = NDArray[np.float64]
Points = dict[tuple[str, str], int]

REGIONS = (
    "skull", "forehead", "brows", "eyes", "nose", "mouth", "chin", "cheeks", "jaw", "ears", "neck",
)  # fmt: skip
IRIS_MM, PUPIL_MM = 5.75, 2.05  # between the rings of head_mesh.RINGS_MM
N_RAYS = 192  # per vertex; the noise of the mean of 192 is 3 of 255 before smoothing
RAY_START = 2e-4  # metres off the surface, so that a ray does not meet its own triangle
RAY_LENGTH = 0.12  # metres: what lies further away darkens nothing


@dataclass(frozen=True, slots=True)
class Tone:
    """sRGB colours of one person; `blood` scales the redness of cheeks, nose, ears."""

    skin: tuple[int, int, int]
    lips: tuple[int, int, int]
    brows: tuple[int, int, int]
    iris: tuple[int, int, int]
    blood: float = 1.0
    brow_width: float = 1.0


def smooth_step(x: Array, low: float, high: float) -> Array:
    """0 below low, 1 above high, with zero slope at both."""
    t = np.clip((x - low) / (high - low), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def blob(vertices: Array, centre: Array, radius: float) -> Array:
    """Gaussian weight (N,) around a point."""
    return np.exp(-0.5 * (np.linalg.norm(vertices - centre, axis=1) / radius) ** 2)


def along(curve: Array, points: Array) -> tuple[Array, Array]:
    """Distance (N,) to a polyline (K, 2) and the place (N,) on it, 0 to 1, of points (N, 2)."""
    start, step = curve[:-1], np.diff(curve, axis=0)
    length = np.linalg.norm(step, axis=1)
    offset = points[:, None] - start  # (N, K-1, 2)
    t = np.clip((offset * step).sum(axis=2) / length**2, 0.0, 1.0)
    distance = np.linalg.norm(offset - t[..., None] * step, axis=2)
    nearest = distance.argmin(axis=1)
    rows = np.arange(len(points))
    before = np.concatenate([[0.0], np.cumsum(length)])
    place = (before[nearest] + t[rows, nearest] * length[nearest]) / before[-1]
    return distance[rows, nearest], place


class Painter:
    """Weights of the painted parts on the mean head; N fine vertices, metres, eye origin."""

    def __init__(
        self, base: BaseMesh, operator: sparse.csr_array, source: Source, mean: Array,
        points: Points, ibug: NDArray[np.int64],
    ) -> None:  # fmt: skip
        self.mean, self.points = mean, points
        n_head = len(base.kept)

        def spread(name: str) -> Array:
            on_base = np.zeros(base.n_vertices)
            on_base[:n_head] = source.mask(name)[base.kept]
            if name == "lips":  # the strip between the lips too: else a pale line shows there
                on_base[base.mouth_loop] = 1.0
            return np.clip(operator @ on_base, 0.0, 1.0)

        self.lips, self.ears, self.lids = spread("lips"), spread("ears"), spread("eyelids")
        slit = np.zeros(base.n_vertices)
        slit[base.mouth_loop] = 1.0
        self.slit = np.clip(operator @ slit, 0.0, 1.0)
        patch = np.zeros(base.n_vertices)
        patch[n_head:] = 1.0
        self.ball = np.asarray(operator @ patch)  # 1 well inside an eye patch
        margin = np.zeros(base.n_vertices)
        margin[base.eye_loops.ravel()] = 1.0
        self.margin = np.clip(operator @ margin, 0.0, 1.0)
        self.from_pupil = np.full(len(mean), np.inf)  # metres, on eye patches only
        for pupil in base.pupils:
            away = np.linalg.norm((mean - mean[pupil])[:, :2], axis=1)
            near = (self.ball > 0.3) & (away < 0.02)
            self.from_pupil[near] = away[near]
        self.upper = np.zeros(len(mean))  # 1 on upper lids
        for pupil in base.pupils:
            side = np.sign(mean[:, 0]) == np.sign(mean[pupil, 0])
            self.upper[side] = smooth_step(mean[side, 1] - mean[pupil, 1], 0.0, 0.003)
        # Right brow reversed, so that both run from the head to the tail. A parabola through the
        # five landmarks: straight pieces between them would draw an angry, angular brow.
        self.brow_curves = []
        for numbers in (ibug[17:22][::-1], ibug[22:27]):
            x, y = mean[numbers, :2].T
            x_fine = np.linspace(x[0], x[-1], 24)
            arch = np.polynomial.Polynomial.fit(x, y, 2)(x_fine)
            self.brow_curves.append(np.stack([x_fine, arch], axis=1))

    def brows(self, width: float) -> Array:
        """Weight (N,) of the brows, thickest at one third, thin at the tail."""
        weight = np.zeros(len(self.mean))
        for curve in self.brow_curves:
            distance, place = along(curve, self.mean[:, :2])
            half = 1e-3 * width * np.interp(place, [0, 0.3, 0.65, 1.0], [2.7, 3.1, 2.6, 1.9])
            edge = 1.0 - smooth_step(distance / half, 0.35, 1.65)
            front = self.mean[:, 2] > -0.05
            weight = np.maximum(
                weight, edge * front * np.interp(place, [0, 0.15, 0.6, 1], [0.6, 1, 1, 0.5])
            )
        return weight

    def colours(self, tone: Tone) -> NDArray[np.uint8]:
        """sRGB albedo (N, 3)."""
        skin = np.array(tone.skin, dtype=float)
        colour = np.tile(skin, (len(self.mean), 1))

        def mix(weight: Array, target: Array | tuple[float, ...]) -> None:
            colour[:] += weight[:, None] * (np.asarray(target, dtype=float) - colour)

        flush = skin * [1.0, 0.82, 0.80]
        at = {k: self.mean[v] for k, v in self.points.items()}
        for side in ("left", "right"):
            # The landmark lies on the cheek bone; the blush sits nearer to the nose.
            cheek = 0.6 * at["cheek", side] + 0.4 * at["ac", side]
            mix(tone.blood * 0.36 * blob(self.mean, cheek, 0.015), flush)
            mix(tone.blood * 0.30 * blob(self.mean, at["al", side], 0.008), flush)
        mix(tone.blood * 0.4 * blob(self.mean, at["prn", "mid"], 0.011), flush)
        mix(tone.blood * 0.25 * blob(self.mean, at["pg", "mid"], 0.014), flush)
        mix(0.42 * self.ears * tone.blood, skin * [0.99, 0.76, 0.73])
        mix(0.30 * self.lids, skin * [0.86, 0.78, 0.78])
        mix(0.8 * smooth_step(self.lips, 0.1, 0.85), tone.lips)
        mix(0.85 * smooth_step(self.slit, 0.3, 0.85), np.array(tone.lips) * [0.50, 0.40, 0.40])
        for side in ("left", "right"):  # else a pale speck catches the light beside the mouth
            mix(0.45 * blob(self.mean, at["ch", side], 0.0022), np.array(tone.lips) * 0.75)
        mix(0.78 * self.brows(tone.brow_width), tone.brows)

        eye = smooth_step(self.ball, 0.35, 0.75)
        mix(eye, (232.0, 226.0, 220.0))
        for side in ("left", "right"):  # the inner corner is pink
            mix(eye * 0.6 * blob(self.mean, at["en", side], 0.006), (214.0, 150.0, 140.0))
        mm = 1000.0 * self.from_pupil
        iris = 1.0 - smooth_step(mm, IRIS_MM - 0.25, IRIS_MM + 0.25)
        rim = np.array(tone.iris) * 0.45
        inner = np.array(tone.iris)
        depth = smooth_step(np.where(np.isfinite(mm), mm, 9.0), 3.6, 5.6)[:, None]
        mix(iris * eye, inner * (1 - depth) + rim * depth)
        mix((1.0 - smooth_step(mm, PUPIL_MM - 0.3, PUPIL_MM + 0.3)) * eye, (14.0, 11.0, 10.0))
        lash = smooth_step(self.margin, 0.3, 0.9) * (0.22 + 0.6 * self.upper)
        mix(lash, 0.35 * np.array(tone.brows) + 0.1 * skin)
        return np.clip(np.rint(colour), 0, 255).astype(np.uint8)


def occlusion(vertices: Array, faces: NDArray[np.int64], mirror: NDArray[np.int64]) -> Array:
    """Share (N,) of the sky each vertex sees, cosine weighted, by rays; mirror symmetric."""
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    normals = np.asarray(mesh.vertex_normals)
    k = np.arange(N_RAYS) + 0.5
    z = 1.0 - 2.0 * k / N_RAYS  # Fibonacci sphere: no random numbers
    turn = np.pi * (1.0 + 5.0**0.5) * k
    ball = np.stack([np.cos(turn), np.sin(turn), np.zeros(N_RAYS)], axis=1)
    ball *= np.sqrt(1.0 - z**2)[:, None]
    ball[:, 2] = z
    # A point of the sphere of radius 1 around the tip of the normal is a cosine-weighted direction.
    seen = np.zeros(len(vertices))
    caster = trimesh.ray.ray_pyembree.RayMeshIntersector(mesh, scale_to_box=False)
    start = vertices + RAY_START * normals
    for offset in ball:
        direction = normals + 0.999 * offset
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        place, ray, _ = caster.intersects_location(start, direction, multiple_hits=False)
        far = np.full(len(vertices), np.inf)
        far[ray] = np.linalg.norm(place - start[ray], axis=1)
        seen += np.minimum(far / RAY_LENGTH, 1.0) ** 0.5  # near things darken most
    seen = 0.5 * (seen + seen[mirror]) / N_RAYS
    edges = mesh.edges_unique
    near = sparse.csr_array(
        (np.ones(2 * len(edges)), (edges.ravel(), edges[:, ::-1].ravel())),
        shape=(len(vertices), len(vertices)),
    )
    average = sparse.diags_array(1.0 / np.asarray(near.sum(axis=1)).ravel()) @ near
    return 0.5 * seen + 0.5 * (average @ seen)


def regions(painter: Painter) -> NDArray[np.uint8]:
    """Number (N,) into REGIONS of the part of the head each vertex lies in; the last one wins."""
    v = painter.mean
    at = {k: v[n] for k, n in painter.points.items()}
    x, y, z = np.abs(v[:, 0]), v[:, 1], v[:, 2]
    ear_z = at["t", "left"][2]
    chin_y, mouth_y, nose_y = at["sl", "mid"][1], at["ls", "mid"][1], at["sn", "mid"][1]
    brow_y, hair_y = at["sci", "left"][1], at["tr", "mid"][1]
    # The forehead comes down to the root of the nose between the brows.
    brow_y = np.interp(
        x, [0.006, at["sci", "left"][0]], [0.5 * (at["g", "mid"] + at["n", "mid"])[1], brow_y]
    )
    jaw_y, lowest = at["go", "left"][1], at["me", "mid"][1]
    number = np.full(len(v), REGIONS.index("skull"))
    front = z > ear_z

    def set_region(name: str, where: NDArray[np.bool_]) -> None:
        number[where] = REGIONS.index(name)

    set_region("forehead", front & (y > brow_y) & (y < hair_y) & (z > at["ft", "left"][2] - 0.03))
    set_region("cheeks", front & (y <= brow_y) & (y > mouth_y - 0.02))
    # The jaw is the band from the ear lobe to the chin; below and behind it is the neck.
    floor = np.interp(z, [ear_z, at["pg", "mid"][2]], [jaw_y - 0.012, lowest - 0.004])
    lobe_y = at["obi", "left"][1]
    top = np.interp(z, [ear_z, at["ch", "left"][2]], [lobe_y, at["ch", "left"][1] - 0.012])
    set_region("jaw", front & (y < top) & (y >= floor))
    set_region(
        "neck", ((y < floor) & (z <= at["pg", "mid"][2] + 0.01)) | (~front & (y < lobe_y - 0.02))
    )
    set_region("chin", front & (y <= chin_y) & (y >= floor) & (x < at["ch", "left"][0]))
    ch = at["ch", "left"]
    set_region(
        "mouth", (z > ch[2] - 0.02) & (y < nose_y - 0.002) & (y > chin_y) & (x < ch[0] + 0.004)
    )
    set_region("mouth", painter.lips > 0.3)
    half = np.interp(
        y, [nose_y, at["al", "left"][1], at["se", "mid"][1]],
        [at["al", "left"][0] + 0.001, at["al", "left"][0] + 0.002, at["mf", "left"][0]],
    )  # fmt: skip
    set_region(
        "nose",
        (y >= nose_y - 0.002) & (y < at["n", "mid"][1] + 0.004) & (x <= half)
        & (z > at["ac", "left"][2] - 0.012),
    )  # fmt: skip
    for side in ("left", "right"):
        middle = 0.5 * (at["en", side] + at["ex", side])
        reach = (v - middle) / [0.021, 0.0135, 0.03]
        set_region("eyes", (reach**2).sum(axis=1) < 1.0)
    set_region("brows", painter.brows(1.6) > 0.3)
    set_region("eyes", painter.ball > 0.3)
    set_region("ears", painter.ears > 0.35)
    return number.astype(np.uint8)


def front_region(painter: Painter, region: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """(N,) the face before the tragion, from the chin to the hairline, without ears and neck."""
    v, at = painter.mean, painter.points
    keep = (v[:, 2] > v[at["t", "left"], 2]) & (v[:, 1] < v[at["tr", "mid"], 1])
    return keep & ~np.isin(region, [REGIONS.index("neck"), REGIONS.index("ears")])
