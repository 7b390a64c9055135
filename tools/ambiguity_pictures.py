"""The pictures of docs/ambiguity.md: plots on a canvas, heads through the same scenes as a snapshot's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import ambiguity_numbers as numbers
import ambiguity_plots as plots
import faceambig as fa
from ambiguity_plots import DASH, Plot
from faceambig import compose
from faceambig.arrays import Array
from faceambig.metrics import HUMAN_TOLERANCE_PERCENT, surface_difference
from faceambig.observation import portrait_camera
from faceambig.posterior import BEYOND
from faceambig.render.canvas import THIN, Canvas, Picture
from faceambig.render.overlay import draw, percent
from faceambig.render.plots import D_L, D_S, DIM, INK
from faceambig.scene import Head, Legend, Photo, Scene

TICKS, WIDE_TICKS = (20, 30, 60, 120, 240), (20, 30, 60, 120, 240, 480, 960)  # cm
UNIT, PAPER = 1.25, (255, 255, 255)
HEADS = 0.75  # scale of the strips of heads: 1200 pixels wide
ROOMY = 0.185  # metres above and below the middle of the largest heads
SPREAD_MM = 5.0
AXIS, UNKNOWN = "assumed camera distance in cm", "camera distance in cm"
CANNOT_TELL = f"under {HUMAN_TOLERANCE_PERCENT:g}{THIN}%: a person cannot tell"
DENSITY = "Probability per doubling"
# One colour a photograph, from 30 cm to far: of d_L, of d_S, and of both in the plot of densities
BLUES = ((0x08, 0x1E, 0x45), D_L, (0x45, 0x88, 0xDD), (0x7E, 0xAE, 0xE8))
BROWNS = ((0x4A, 0x20, 0x00), D_S, (0xD6, 0x76, 0x22), (0xE6, 0xA1, 0x63))
INKS = (INK, D_L, D_S)


def curves() -> Picture:
    """d_L and d_S over the assumed distance for four photographs, means of the subjects; three densities."""
    canvas = Canvas((1560, 470), UNIT, PAPER)
    paths = numbers.paths()
    left = Plot(46, 50, 240, 260, (19, 300), 3.0)
    middle = Plot(450, 50, 240, 260, (19, 300), 8.0)
    right = Plot(858, 50, 360, 260, (19, 1000), 3.5)
    plots.band(canvas, left, HUMAN_TOLERANCE_PERCENT, CANNOT_TELL)
    plots.frame(canvas, left, "Landmark error in %", D_L, (0, 1, 2, 3), TICKS, AXIS)
    plots.frame(canvas, middle, "Surface difference in mm", D_S, (0, 2, 4, 6, 8), TICKS, AXIS)
    for plot, colours, square in ((left, BLUES, False), (middle, BROWNS, True)):
        labels = []
        for path, colour in zip(paths, colours, strict=True):
            value = (path.d_s_mm if square else path.d_l_percent).mean(axis=0)
            dash = None if square else DASH
            plots.line(
                canvas, plot, numbers.FITTED, value, colour,
                dash=dash, at=(path.actual,), square=square,
            )  # fmt: skip
            labels.append((float(plot.y(value[-1])), f"from {cm(path.actual)}", colour))
        plots.names(canvas, plot.far + 22, labels, square=square)
    plots.frame(
        canvas, right, DENSITY, INK, (0, 1, 2, 3), WIDE_TICKS, UNKNOWN, far=False
    )  # fmt: skip
    for actual, colour in zip(numbers.PHOTOGRAPHS, INKS, strict=True):
        metres, value = per_doubling(numbers.posterior(actual, exact=True))
        canvas.curve(right.x(metres), right.y(value), colour, 2.2)
        x = float(right.x(actual))
        canvas.line((x, right.bottom), (x, right.top), colour, 1.2, dash=plots.DOTS)
        canvas.text(x + 5, right.top + 10, f"from {cm(actual)}", 12.5, colour, 600)
    return canvas.pixels


def errors() -> Picture:
    """The paper's error plot: d_L and d_S over the assumed distance, mean of the subjects and each of them."""
    canvas = Canvas((910, 725), UNIT, PAPER)
    path = numbers.paths()[0]
    upper = Plot(46, 46, 560, 190, (19, 300), 3.0)
    lower = Plot(46, 290, 560, 230, (19, 300), 8.0)
    plots.band(canvas, upper, HUMAN_TOLERANCE_PERCENT, CANNOT_TELL)
    plots.frame(canvas, upper, "Landmark error in %", D_L, (0, 1, 2, 3), TICKS, "")
    plots.frame(canvas, lower, "Surface difference in mm", D_S, (0, 2, 4, 6, 8), TICKS, AXIS)
    for plot, every, colour, square in (
        (upper, path.d_l_percent, D_L, False),
        (lower, path.d_s_mm, D_S, True),
    ):
        for one in every:
            plots.line(canvas, plot, numbers.FITTED, one, plots.pale(colour), width=0.9)
        plots.truth(canvas, plot, path.actual, f"true: {100 * path.actual:.0f}")
        plots.line(
            canvas, plot, numbers.FITTED, every.mean(axis=0), colour,
            dash=None if square else DASH, at=numbers.ROW, square=square,
        )  # fmt: skip
        middle = float(plot.y(every.mean(axis=0)[-1]))
        canvas.text(plot.far + 14, middle + 4.5, "mean of 10", 12.5, colour, 600)
    return canvas.pixels


def distances() -> Picture:
    """Posterior of the distance of one face photographed from three distances."""
    canvas = Canvas((1130, 845), UNIT, PAPER)
    for index, actual in enumerate(numbers.PHOTOGRAPHS):
        found = numbers.posterior(actual)
        plot = Plot(46, 48 + 208 * index, 620, 150, (19, 1000), 4.0)
        last = index == len(numbers.PHOTOGRAPHS) - 1
        metres, value = per_doubling(found)
        for level, white in ((0.95, 0.82), (0.5, 0.55)):
            interval = found.interval(level)
            high = metres[-1] if interval.high is None else interval.high
            inside = np.unique(
                np.concatenate([metres, [interval.low, high]]).clip(interval.low, high)
            )
            plots.area(
                canvas, plot, inside, np.interp(inside, metres, value), plots.pale(D_L, white)
            )
        title = f"{DENSITY}, photograph from {cm(actual)}"
        axis = UNKNOWN if last else ""
        plots.frame(canvas, plot, title, INK, (0, 1, 2, 3, 4), WIDE_TICKS, axis, far=False)
        before = np.full(2, np.log(2.0) * (1.0 - BEYOND) / np.log(metres[-1] / metres[0]))
        canvas.curve(plot.x(metres[[0, -1]]), plot.y(before), DIM, 1.2, dash=DASH)
        canvas.curve(plot.x(metres), plot.y(value), D_L, 2.2)
        plots.truth(canvas, plot, actual, f"true: {100 * actual:.0f}")
        x, y = plot.left + plot.width + 16, plot.top + 22
        for words, colour in (
            (f"50{THIN}%: {said(found.interval(0.5))}", INK),
            (f"95{THIN}%: {said(found.interval(0.95))}", INK),
            (f"beyond 10{THIN}m: {mass(found.distance_density.beyond)}", DIM),
        ):
            canvas.text(x, y, words, 13.5, colour, 600 if colour == INK else 400)
            y += 24
        canvas.line((x, y + 19), (x + 24, y + 19), DIM, 1.2, dash=DASH)
        canvas.text(x + 32, y + 24, "before the picture", 13.5, DIM)
    return canvas.pixels


def faces() -> Picture:
    """The paper's row of faces: one photograph, fitted at several distances."""
    face = numbers.model().subject(numbers.SUBJECT)
    fits = numbers.row()
    titles = ["True face", *(f"fitted at {cm(d)}" if d else "fitted far away" for d in numbers.ROW)]
    captions = [((f"photo taken from {cm(numbers.ACTUAL[0])}", "dim"),)]
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
    camera = "orthographic" if distance is None else f"perspective, {cm(distance)}"
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
                model, f"fit{index}", f"photo taken from {cm(actual)}", middle_face(actual),
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
    note = f"photo from {cm(numbers.EXTREME)}, subject {numbers.SUBJECT}"
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


def per_doubling(found: fa.Posterior) -> tuple[Array, Array]:
    """Distances (K,) metres and the density (K,) per doubling of the distance."""
    density = found.distance_density
    return density.distances, np.log(2.0) * density.density


def cm(metres: float) -> str:
    """Centimetres below a metre, metres above."""
    if metres < 0.995:
        return f"{100 * metres:.0f}{THIN}cm"
    return f"{metres:.2g}{THIN}m" if metres < 9.95 else f"{metres:.0f}{THIN}m"


def said(interval: fa.DistanceInterval) -> str:
    end = "no end" if interval.high is None else f"to {cm(interval.high)}"
    return f"{cm(interval.low)} {end}" if interval.high else f"from {cm(interval.low)}, {end}"


def mass(share: float) -> str:
    """Percent of one decimal."""
    return f"under 0.1{THIN}%" if share < 0.001 else f"{100 * share:.1f}{THIN}%"


PICTURES = {
    "curves": curves,
    "faces": faces,
    "errors": errors,
    "mode_orthographic": lambda: bent(None),
    "mode_perspective": lambda: bent(numbers.ACTUAL[0]),
    "distance": distances,
    "spread": spread,
    "extremes": extremes,
}
