"""The figures of docs/ambiguity.md: each block between its two comments is written anew from what is computed."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

import numpy as np

import ambiguity_numbers as numbers
from ambiguity_numbers import between, said
from faceambig.arrays import Array
from faceambig.metrics import HUMAN_TOLERANCE_PERCENT

BLOCK = re.compile(r"(<!-- figures: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


def rewritten(page: str) -> str:
    """The page with its figures computed anew; ValueError for a block that nobody writes, or one that is missing."""
    found = [match[1] for match in BLOCK.findall(page)]
    if sorted(found) != sorted(BLOCKS):
        raise ValueError(f"docs/ambiguity.md: blocks {sorted(found)}, expected {sorted(BLOCKS)}")
    return BLOCK.sub(lambda block: f"{block[1]}\n{BLOCKS[block[2]]()}\n\n{block[3]}", page)


def curves(prior_weight: float | None = None) -> str:
    rows = []
    for path in numbers.paths(prior_weight):
        d_l, d_s = path.d_l_percent.mean(axis=0), path.d_s_mm.mean(axis=0)
        at = [path.at(distance) for distance in numbers.TABLE]
        rows.append([said(path.actual), *(f"{d_l[k]:.2f} / {d_s[k]:.1f}" for k in at)])
    return table(["photo from \\ fitted at", *map(said, numbers.TABLE)], rows)


def errors() -> str:
    path, rows = numbers.paths()[0], []
    for distance, face in zip(numbers.ROW, numbers.row(), strict=True):
        d_l, d_s = path.d_l_percent[:, path.at(distance)], path.d_s_mm[:, path.at(distance)]
        rows.append(
            [
                said(distance),
                f"{d_l.mean():.2f} % ({d_l.min():.2f} to {d_l.max():.2f})",
                f"{d_s.mean():.1f} mm ({d_s.min():.1f} to {d_s.max():.1f})",
                f"{face.d_l_percent:.2f} %, {face.d_s_mm:.1f} mm",
            ]
        )
    return table(["fitted at", "d_L, ten subjects", "d_S", "the one drawn"], rows)


def modes() -> str:
    rows = []
    for distance in (None, numbers.ACTUAL[0]):
        found = numbers.modes(distance)
        camera = "orthographic" if distance is None else f"perspective, {said(distance)}"
        rows += [
            [
                camera if each is found.faces[0] else "",
                f"{each.mm:+.1f} mm" if each.mm else "the fit",
                f"{each.size:.1f}",
                "yes" if each.face.plausible else "no",
                f"{each.landmark_percent:.3f} %" if each.mm else "",
                f"{each.d_s_mm:.1f} mm" if each.mm else "",
            ]
            for each in found.faces
        ]
    titles = ["camera", "mode 1", "\\|alpha\\|", "plausible", "landmarks move", "d_S from the fit"]
    return table(titles, rows)


def distances() -> str:
    rows = []
    for actual in numbers.PHOTOGRAPHS:
        found = numbers.posterior(actual)
        beyond = found.distance_density.beyond
        rows.append(
            [
                said(actual),
                between(found.interval(0.5)),
                between(found.interval(0.95)),
                f"{100 * beyond:.1f} %" if beyond >= 0.001 else "under 0.1 %",
                between(numbers.posterior(actual, noise=numbers.CLICKED).interval(0.95)),
            ]
        )
    return table(
        ["photo from", "50 % inside", "95 % inside", "beyond 10 m", "95 %, noise of clicks"], rows
    )


def spread() -> str:
    rows = []
    for actual in numbers.PHOTOGRAPHS:
        sd, parts = numbers.spread(actual)
        values = (
            parts.prior_mm, parts.shape_mm, parts.pose_mm, parts.distance_mm, parts.total_mm,
        )  # fmt: skip
        words = [said(actual), f"{sd.mean():.1f} mm", f"{sd.max():.1f} mm"]
        rows.append([*words, *(f"{value:.2f} mm" for value in values)])
    titles = ["photo from", "mean sd", "largest", "before (rms)"]
    return table([*titles, "shape", "pose adds", "distance adds", "all (rms)"], rows)


def extremes() -> str:
    rows = []
    for pose in ("fixed", "free"):
        found = numbers.extremes(pose)
        for index, face in enumerate(found.faces):
            rows.append(
                [
                    "" if index else pose,
                    ("farthest", "opposite")[index],
                    f"{face.rms_mm:.1f} mm",
                    "" if index else f"{found.bound_mm:.1f} mm",
                    "" if index else f"{100 * found.ratio:.1f} %",
                    f"{face.d_s_mm:.1f} mm",
                    f"{face.landmark_rms_percent:.2f} %",
                    f"{face.d_l_percent:.2f} %",
                ]
            )
    titles = ["pose", "face", "rms from the fit", "bound", "reached / bound"]
    return table([*titles, "d_S from the fit", "landmarks, rms", "d_L"], rows)


def claims() -> str:
    """What the paper says, whether it holds here, and by which figures: the verdicts are computed."""
    rows = [
        [paper, "holds" if holds else "does not hold", here] for paper, holds, here in verdicts()
    ]
    return table(["the paper", "on this head", "figures"], rows)


def verdicts(prior_weight: float | None = None) -> list[tuple[str, bool, str]]:
    """Claim of the paper, whether it holds, and the figures; px^2, None: the library's own."""
    paths = numbers.paths(prior_weight)
    near, far = paths[0], paths[-1]
    every_l = np.concatenate([path.d_l_percent for path in paths])
    means_l = np.array([at_table(path, path.d_l_percent) for path in paths])
    means_s = np.array([at_table(path, path.d_s_mm) for path in paths])
    right, wrong = means_l[0, 0], means_l[0, -1]
    rest = means_l[1:, 1:].max()
    lowest = [least(path.d_s_mm) for path in paths]
    single = max(float(path.d_s_mm.max()) for path in paths)
    near_far, far_near = means_s[0, 3], means_s[3, 0]
    bent = [face for d in (None, numbers.ACTUAL[0]) for face in numbers.modes(d).faces]
    ten = [face.size for face in bent if abs(face.mm) == numbers.BENT_MM]
    limit = numbers.modes(None).limit
    columns = np.arange(len(paths))
    return [
        (
            "any wrong distance explains the points within what a person can click, 3 %",
            bool(every_l.max() < HUMAN_TOLERANCE_PERCENT),
            f"worst single d_L {every_l.max():.2f} %",
        ),
        (
            "a face from 30 cm is explained almost as well at wrong distances (0.21, then 0.28 %)",
            bool(wrong < 1.5 * right),
            f"{right:.2f} % at 30 cm, {wrong:.2f} % far away; faces from 60 cm on, fitted so: at most {rest:.2f} %",
        ),
        (
            "d_L is least at the true distance",
            bool((means_l.argmin(axis=1) == columns).all()),
            "least of the table, photo " + ", ".join(leasts(means_l)),
        ),
        (
            "d_S is least at the true distance",
            bool((means_s.argmin(axis=1) == columns).all()),
            f"least of the table, photo {', '.join(leasts(means_s))}; of all distances {', '.join(lowest)}",
        ),
        (
            "surfaces at a wrong distance differ by over 1 cm",
            bool(means_s.max() > 10.0),
            f"at most {means_s.max():.1f} mm of these means, {single:.1f} mm of single faces",
        ),
        (
            "a near face fitted far is worse than a far one fitted near (14.5 and 11.0 mm)",
            bool(near_far > far_near),
            f"{said(near.actual)} at {said(far.actual)}: {near_far:.1f} mm; the other way {far_near:.1f} mm",
        ),
        (
            "flexibility mode 1 moved by 10 mm is still a face",
            bool(max(ten) <= limit),
            f"\\|alpha\\| {min(ten):.1f} to {max(ten):.1f}, plausible up to {limit:.1f}",
        ),
    ]


def at_table(path: numbers.Path, values: Array) -> Array:
    """(5,) means of the ten subjects, the columns of the table."""
    return values.mean(axis=0)[[path.at(distance) for distance in numbers.TABLE]]


def least(values: Array) -> str:
    """The distance of the least mean among all fitted."""
    return said([*numbers.FITTED.tolist(), None][int(values.mean(axis=0).argmin())])


def leasts(means: Array) -> list[str]:
    """Where the least mean of each photograph's row of the table is."""
    return [
        f"from {said(actual)}: {said(numbers.TABLE[int(row.argmin())])}"
        for actual, row in zip(numbers.ACTUAL, means, strict=True)
    ]


def table(titles: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [titles, ["---"] * len(titles), *rows]
    return "\n".join(f"| {' | '.join(line)} |".replace("  ", " ") for line in lines)


BLOCKS: dict[str, Callable[[], str]] = {
    "claims": claims,
    "curves": curves,
    "curves_low": lambda: curves(numbers.LOW),
    "errors": errors,
    "modes": modes,
    "distances": distances,
    "spread": spread,
    "extremes": extremes,
}
