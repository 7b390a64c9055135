"""People: the parameters of a population, and the shapes they give.

The head is base + sum of weight * target. Macro weights are products of piecewise linear hats over
sex, age, muscle, weight, height and ancestry; axis weights come from `head_data/axes.csv`.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from head_mesh import BaseMesh, add_eyes
from head_source import Source, sparse_to_dense

Array = NDArray[np.float64]

DATA = Path(__file__).parent / "head_data"
ANCESTRIES = ("african", "asian", "caucasian")
SEXES, AGES = ("female", "male"), ("young", "old")
MUSCLE = ("minmuscle", "averagemuscle", "maxmuscle")
WEIGHT = ("minweight", "averageweight", "maxweight")
HEIGHT = ("minheight", "maxheight")
YEARS_YOUNG, YEARS_OLD = 25.0, 90.0  # what "young" and "old" of the collection stand for
MEAN_AGE = 0.25  # of the age parameter in `draw_people`: 41 years
CUT = 2.2  # standard normals are cut here: beyond, single axes turn into caricatures
LARGEST = 1.25  # amplitudes are cut here: the collection draws its shapes for 1
SIDE_SD = 0.12  # of a pair's sd: how much left and right differ


def read_table(name: str) -> list[dict[str, str]]:
    """Rows of a commented CSV file of head_data."""
    with (DATA / name).open(encoding="utf-8") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


@dataclass(frozen=True, slots=True, eq=False)
class Axes:
    """The axes of variation, A of them."""

    plus: tuple[str, ...]
    minus: tuple[str, ...]  # empty where there is no opposite
    kind: tuple[str, ...]  # mid, pair or asym
    mean: Array  # (A,)
    male: Array  # (A,)
    old: Array  # (A,)
    sd: Array  # (A,)
    factor: tuple[str, ...]
    loading: Array  # (A,)
    fitted: NDArray[np.bool_]  # (A,) set by head_calibrate.py


def read_axes() -> Axes:
    """The axes of head_data/axes.csv."""
    rows = read_table("axes.csv")

    def column(key: str) -> Array:
        return np.array([float(r[key] or 0.0) for r in rows])

    return Axes(
        plus=tuple(r["plus"] for r in rows),
        minus=tuple(r["minus"] for r in rows),
        kind=tuple(r["kind"] for r in rows),
        mean=column("mean"),
        male=column("male"),
        old=column("old"),
        sd=column("sd"),
        factor=tuple(r["factor"] for r in rows),
        loading=column("loading"),
        fitted=column("fit") > 0,
    )


@dataclass(frozen=True, slots=True, eq=False)
class People:
    """Parameters of n people before any axis is scaled."""

    sex: Array  # (n,) 0 female, 1 male
    age: Array  # (n,) 0 = 25 years, 1 = 90 years
    muscle: Array  # (n,)
    weight: Array  # (n,)
    height: Array  # (n,)
    ancestry: Array  # (n, 3) sums to 1
    z: Array  # (n, A) standard normal, cut
    side: Array  # (n, A) the part of left minus right, standard normal, cut

    @property
    def years(self) -> Array:
        return YEARS_YOUNG + (YEARS_OLD - YEARS_YOUNG) * self.age


def draw_people(n: int, axes: Axes, seed: int) -> People:
    """n people, half of them women, in a fixed order of draws."""
    rng = np.random.default_rng(seed)
    men = np.arange(n) % 2
    sex = np.clip(men + rng.normal(0.0, 0.08, n) + np.where(men, -0.08, 0.08), 0.0, 1.0)
    age = np.minimum(rng.beta(1.1, 3.3, n), 0.8)
    muscle = np.clip(rng.normal(0.5, 0.12, n), 0.2, 0.85)
    weight = np.clip(rng.normal(0.5, 0.15, n), 0.1, 0.95)
    # Height is the one knob for size, and a strong one: it scales the whole head.
    height = 0.5 + rng.normal(0.0, 0.012, n) + np.where(men, -0.006, 0.006)
    ancestry = rng.dirichlet((0.6, 0.6, 0.6), n)
    own = rng.standard_normal((n, len(axes.plus)))
    side = rng.standard_normal((n, len(axes.plus)))
    z = own.copy()
    for name in sorted(set(axes.factor) - {""}):
        shared = rng.standard_normal((n, 1))
        member = np.array([f == name for f in axes.factor])
        part = axes.loading[member]
        z[:, member] = part * shared + np.sqrt(1.0 - part**2) * own[:, member]
    return People(
        sex, age, muscle, weight, height, ancestry,
        np.clip(z, -CUT, CUT), np.clip(side, -CUT, CUT),
    )  # fmt: skip


def hats(x: Array) -> list[Array]:
    """Weights of the anchors 0, 0.5 and 1 at x."""
    return [np.maximum(1 - 2 * x, 0), 1 - np.abs(2 * x - 1), np.maximum(2 * x - 1, 0)]


def macro_weights(people: People) -> Iterator[tuple[str, Array]]:
    """(name, weights (n,)) of each macro target."""
    sex = dict(zip(SEXES, (1.0 - people.sex, people.sex), strict=True))
    age = dict(zip(AGES, (1.0 - people.age, people.age), strict=True))
    muscle = dict(zip(MUSCLE, hats(people.muscle), strict=True))
    weight = dict(zip(WEIGHT, hats(people.weight), strict=True))
    height = dict(zip(HEIGHT, hats(people.height)[::2], strict=True))
    for k, race in enumerate(ANCESTRIES):
        for s, a in product(SEXES, AGES):
            yield f"macrodetails/{race}-{s}-{a}", people.ancestry[:, k] * sex[s] * age[a]
    for s, a, m, w in product(SEXES, AGES, MUSCLE, WEIGHT):
        body = sex[s] * age[a] * muscle[m] * weight[w]
        yield f"macrodetails/universal-{s}-{a}-{m}-{w}", body
        for h in HEIGHT:
            yield f"macrodetails/height/{s}-{a}-{m}-{w}-{h}", body * height[h]


def axis_weights(axes: Axes, people: People) -> Iterator[tuple[str, Array]]:
    """(name, weights (n,)) of each face target."""
    sign = 2.0 * people.sex - 1.0
    for k, (plus, minus, kind) in enumerate(zip(axes.plus, axes.minus, axes.kind, strict=True)):
        middle = axes.mean[k] + axes.male[k] * sign + axes.old[k] * (people.age - MEAN_AGE)
        amplitude = middle + axes.sd[k] * people.z[:, k]
        sides: list[tuple[str, str, Array]] = [(plus, minus, amplitude)]
        if kind == "pair":
            apart = SIDE_SD * axes.sd[k] * people.side[:, k]
            right = [name.replace("/l-", "/r-") for name in (plus, minus)]
            sides = [(plus, minus, amplitude + apart), (right[0], right[1], amplitude - apart)]
        for up, down, value in sides:
            cut = np.clip(value, -LARGEST, LARGEST)
            yield up, np.maximum(cut, 0.0)
            if down:
                yield down, np.maximum(-cut, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Generator:
    """Linear part of the shapes, restricted to head and eyeballs."""

    base: BaseMesh
    names: tuple[str, ...]
    neutral: Array  # (K, 3) dm, head vertices then left and right eyeballs
    shifts: Array  # (T, K, 3) dm

    def shapes(self, axes: Axes, people: People) -> Array:
        """Base vertices (n, B, 3) in decimetres, before any alignment."""
        weights = dict([*macro_weights(people), *axis_weights(axes, people)])
        table = np.stack([weights[name] for name in self.names], axis=1)
        flat = self.neutral.ravel() + table @ self.shifts.reshape(len(self.names), -1)
        points = flat.reshape(len(table), -1, 3)
        n_head = len(self.base.kept)
        balls = points[:, n_head:].reshape(len(table), 2, -1, 3)
        return add_eyes(self.base, points[:, :n_head], balls)


def make_generator(source: Source, base: BaseMesh, topology: dict, axes: Axes) -> Generator:
    """Read every target that can get a weight."""
    balls = [topology[f"eyeball_{side}"] for side in ("left", "right")]
    wanted = np.concatenate([base.kept, *(np.arange(a, b + 1) for a, b in balls)])
    one = draw_people(1, axes, 0)
    names = [name for name, _ in (*macro_weights(one), *axis_weights(axes, one))]
    return Generator(
        base, tuple(names), source.vertices[wanted], sparse_to_dense(source, names, wanted)
    )
