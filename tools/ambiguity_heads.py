"""The heads of docs/ambiguity.md, through the same scenes as a snapshot's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import ambiguity_numbers as numbers
import faceambig as fa
from ambiguity_plots import thin
from faceambig import compose
from faceambig.arrays import Array
from faceambig.metrics import surface_difference
from faceambig.observation import portrait_camera
from faceambig.render.canvas import THIN, Picture
from faceambig.render.gauges import percent
from faceambig.render.overlay import draw
from faceambig.scene import Head, Legend, Photo, Scene

HEADS = 0.75  # scale of the strips: 1200 pixels wide
ROOMY = 0.185  # metres above and below the middle of the largest heads
SPREAD_MM = 5.0  # end of the scale


def faces() -> Picture:
    """The paper's row of faces: one photograph, fitted at several distances."""
    face = numbers.model().subject(numbers.SUBJECT)
    fits = numbers.row()
    titles = [
        "True face",
        *(f"fitted at {thin(numbers.said(d))}" if d else "fitted far away" for d in numbers.ROW),
    ]
    captions = [((f"photo taken from {thin(numbers.said(numbers.ACTUAL[0]))}", "dim"),)]
    for fit in fits:
        landmarks, surface = percent(fit.d_l_percent), f"{fit.d_s_mm:.1f}"
        captions.append(
            ((f"landmarks {landmarks}{THIN}%", "d_l"), (f"surface {surface}{THIN}mm", "d_s"))
        )
    scene = compose.compose_row(
        face,
        fits,
        photograph(numbers.ACTUAL[0]),
        titles=titles,
        captions=captions,
        legend_words=("distance to true face, mm", "grey: not measured"),
        note=f"embedded head, subject {numbers.SUBJECT}",
    )
    return strip(scene)


def bent(distance: float | None) -> Picture:
    """The first flexibility mode both ways: at the paper's 10 mm and at the end of the plausible range."""
    found = numbers.modes(distance)
    face = numbers.model().subject(numbers.SUBJECT)
    skin = compose.skin(face)
    heads = []
    for index, each in enumerate(found.faces):
        plausible = each.face.plausible
        verdict = "a plausible face" if plausible else "not a plausible face"
        title = f"{each.mm:+.1f}{THIN}mm" if each.mm else "The fit"
        moved = f"landmarks move {each.landmark_percent:.3f}{THIN}%" if each.mm else ""
        heads.append(
            compose.head(
                numbers.model(), f"fit{index}", title.replace("-", "−"), each.face.own_vertices,
                skin if plausible else compose.greyed(skin), slot=compose.SPACING * (index - 2),
                caption=(
                    (f"|α| = {each.size:.1f}, at most {found.limit:.1f}", "dim"),
                    (verdict, "dim" if plausible else "d_s"),
                    (moved, "d_l"),
                ),
            )
        )  # fmt: skip
    camera = "orthographic" if distance is None else f"perspective, {thin(numbers.said(distance))}"
    note = f"{camera}; mode 1: {found.words}; subject {numbers.SUBJECT}"
    return strip(shown(heads, distance, ("three_quarter", "side"), None, note))


def spread() -> Picture:
    """Posterior sd of every measured vertex, for three photographs of one face."""
    model = numbers.model()
    heads = []
    for index, actual in enumerate(numbers.PHOTOGRAPHS):
        sd, _ = numbers.spread(actual)
        heads.append(
            compose.head(
                model, f"fit{index}", f"photo taken from {thin(numbers.said(actual))}", middle_face(actual),
                coloured(sd / SPREAD_MM), slot=compose.SPACING * (index - 1), lit=False,
                caption=((f"mean {sd.mean():.1f}{THIN}mm, largest {sd.max():.1f}{THIN}mm", "dim"),),
            )
        )  # fmt: skip
    scale = Legend(
        title="standard deviation, mm",
        colours=compose.scale_colours(np.linspace(0.0, 1.0, 64)),
        low=0.0,
        high=SPREAD_MM,
        ticks=(0.0, 1.0, 2.0, 3.0, 4.0, 5.0),
        note="grey: not measured",
    )
    note = f"drawn on the mean of the faces left open; subject {numbers.SUBJECT}"
    return strip(shown(heads, numbers.PHOTOGRAPHS[0], ("front", "side"), scale, note))


def extremes() -> Picture:
    """The two extreme faces at 3 %, with the pose fixed and free, beside the fit."""
    model = numbers.model()
    found = {pose: numbers.extremes(pose) for pose in ("fixed", "free")}
    fit = found["fixed"].fit
    still = fit.vertices()
    skin = compose.skin(model.subject(numbers.SUBJECT))
    words = (f"landmarks {percent(fit.d_l_percent)}{THIN}%", "d_l")
    slots = compose.SPACING * (np.arange(5) - 2)
    heads = [
        compose.head(model, "fit0", "The fit", still, skin, slot=slots[0], caption=(words,)),
    ]
    for pose, answer in found.items():
        for one, which in zip(answer.faces, ("farthest", "opposite"), strict=True):
            apart = surface_difference(one.vertices, still, model.evaluation)
            caption = (
                (f"landmarks {percent(one.d_l_percent)}{THIN}%", "d_l"),
                (f"surface {one.d_s_mm:.1f}{THIN}mm", "d_s"),
                (f"rms {one.rms_mm:.1f}{THIN}mm, bound {answer.bound_mm:.1f}{THIN}mm", "dim"),
            )
            heads.append(
                compose.head(
                    model, f"fit{len(heads)}", f"pose {pose}, {which}",
                    one.vertices @ apart.rotation.T + apart.translation,
                    compose.difference_colours(model, 1e3 * apart.distances),
                    slot=slots[len(heads)], caption=caption, lit=False,
                )
            )  # fmt: skip
    legend = compose.difference_legend("distance to the fit, mm", "grey: not measured")
    note = f"photo from {thin(numbers.said(numbers.EXTREME))}, subject {numbers.SUBJECT}"
    scene = shown(heads, numbers.EXTREME, ("front", "side"), legend, note)
    views = tuple(replace(view, half_height=ROOMY) for view in scene.views)
    return strip(replace(scene, views=views))


def strip(scene: Scene) -> Picture:
    """A strip of heads, RGB."""
    return draw(scene, scale=HEADS)[..., :3]


def shown(
    heads: list[Head],
    distance: float | None,
    views: tuple[str, ...],
    legend: Legend | None,
    note: str,
) -> Scene:
    """A scene of heads alone; the photograph and the numbers of a strip are not drawn."""
    model = numbers.model()
    return Scene(
        heads=tuple(heads),
        views=tuple(compose.named_view(name) for name in views),
        photo=photograph(distance),
        numbers=compose.numbers(numbers.row()[0]),
        pivot=compose.pivot(model),
        legend=legend,
        note=note,
    )


def photograph(distance: float | None) -> Photo:
    """The photograph of the subject from `distance` metres; None: far away."""
    face = numbers.model().subject(numbers.SUBJECT)
    seen = fa.observe(face, distance=distance)
    return compose.photo(face, seen, portrait_camera(face, distance=distance), caption="")


def middle_face(actual: float) -> Array:
    """(N, 3) the mean of the faces that a photograph leaves open."""
    mean, _ = numbers.posterior(actual).shape_moments()
    return numbers.model().vertices(mean)


def coloured(share: Array) -> np.ndarray:
    """(N, 3) sRGB of a share of the scale on the measured vertices, grey elsewhere."""
    colours = np.tile(np.array(compose.UNMEASURED, dtype=np.uint8), (numbers.model().n_vertices, 1))
    colours[numbers.model().evaluation] = compose.scale_colours(share)
    return colours
