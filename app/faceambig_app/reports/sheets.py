"""Pictures of results: faces bent behind one photograph, curves of a sweep, what a posterior leaves open."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

import faceambig as fa
from faceambig.arrays import Array
from faceambig.compose import CLAY, UNMEASURED, head, named_view, photo_of_fit, pivot, scale_colours
from faceambig.model import FaceModel
from faceambig.render import charts, gl
from faceambig.render.canvas import Canvas
from faceambig.render.overlay import GROUND, draw
from faceambig.render.plots import DIM, INK
from faceambig.scene import Curves, Head, Legend, Numbers, Photo, Scene

from ..text import centimetres, drawn_words, percent_number, say

Pixels = NDArray[np.uint8]
Reference = Literal["true", "best", "saved"]  # the face that those of a sweep are compared with
SWEEP, POSTERIOR = (960, 720), (1580, 760)  # pixels
HEADS = 620  # pixels, of the posterior's: the heat map
CELL = 250  # pixels, of a face in a row
MARGIN = 28
ACROSS = 0.29  # metres: a head from the side


class Bent(NamedTuple):
    """A face beside the fitted one."""

    title: str
    alpha: Array  # (S,)
    landmarks: str  # what became of its landmarks
    plausible: bool = True


def faces_sheet(fit: fa.Fit, faces: Sequence[Bent], note: str) -> Pixels:
    """(H, W, 4): the fitted face and others beside it, front and side, coloured by their distance from it."""
    model = fit.model
    own = fit.vertices()
    shapes = [model.vertices(face.alpha) for face in faces]
    gaps = [1e3 * np.linalg.norm(shape - own, axis=1) for shape in shapes]
    most = _scale_end(max(float(gap[_measured(model)].max()) for gap in gaps))
    plain = (
        np.tile(np.array(CLAY, dtype=np.uint8), (model.n_vertices, 1))
        if model.colours is None
        else model.colours
    )
    slots = 0.26 * (np.arange(len(faces) + 1) - len(faces) / 2)
    first = ((_error(fit.d_l_percent), "d_l"),)
    heads = [head(model, "fit", say("sheet.fit"), own, plain, slot=slots[0], caption=first)]
    for k, (face, shape, gap) in enumerate(zip(faces, shapes, gaps, strict=True), start=1):
        mean = float(gap[_measured(model)].mean())
        caption = [
            (face.landmarks, "d_l"),
            (say("sheet.changed", mm=f"{mean:.1f}"), "d_s"),
        ]
        if not face.plausible:
            caption.append((say("sheet.implausible"), "dim"))
        colours = _heat(model, gap, most)
        heads.append(
            head(
                model, f"fit{k}", face.title, shape, colours,
                slot=slots[k], caption=tuple(caption), lit=False,
            )
        )  # fmt: skip
    scene = _scene(fit, heads, _legend(say("sheet.legend"), most, model.evaluation is None), note)
    return draw(scene, max(1600, CELL * len(heads) + 200), 760, words=drawn_words())


def mode_face(number: int, mm: float, alpha: Array, d_l_percent: float, plausible: bool) -> Bent:
    """A face bent by `mm` along a flexibility mode."""
    return Bent(
        say("sheet.mode", number=number, mm=_signed(mm)), alpha, _error(d_l_percent), plausible
    )


def deviation_face(number: int, sd: float, alpha: Array, landmark_percent: float) -> Bent:
    """A face `sd` standard deviations along a posterior mode; its landmarks move, the pose following."""
    moved = say("sheet.moved", percent=percent_number(landmark_percent))
    return Bent(say("sheet.deviations", number=number, sd=_signed(sd)), alpha, moved)


def extreme_face(number: int, face: fa.ExtremeFace) -> Bent:
    """One of the two extreme faces."""
    return Bent(say("sheet.extreme", number=number), face.alpha, _error(face.d_l_percent))


def sweep_sheet(curves: Curves, reference: Reference, note: str) -> Pixels:
    """(H, W, 4): landmark error and surface difference against the distance. reference: what the face differs from."""
    canvas = Canvas(SWEEP, 1.0, GROUND)
    differs = {
        "true": say("sheet.d_s_true"),
        "best": say("sheet.d_s_best"),
        "saved": say("sheet.d_s_saved"),
    }
    words = {
        "d_l": say("sheet.d_l"),
        "d_s": differs[reference],
        "axis": say("sheet.axis"),
        "far": say("sheet.far"),
        "band": say("sheet.band", tolerance=f"{curves.tolerance_percent:g}"),
        "true": _true(curves.true_distance),
    }
    width, height = SWEEP
    charts.two_curves(canvas, curves, words, MARGIN, MARGIN, width - 2 * MARGIN, height - 74)
    canvas.text(MARGIN, height - 18, note, 12.5, DIM, most=width - 2 * MARGIN)
    return _opaque(canvas)


def posterior_sheet(
    found: fa.Posterior, sd_mm: Array, true_distance: float | None, prior: str, note: str
) -> Pixels:
    """(H, W, 4): the density of the distance with its intervals, and the spread sd_mm (N,) on the face."""
    canvas = Canvas(POSTERIOR, 1.0, GROUND)
    width, height = POSTERIOR
    density = found.distance_density
    intervals = [found.interval(level) for level in (0.95, 0.5)]
    ends = [(each.low, np.inf if each.high is None else each.high) for each in intervals]
    truth = np.nan if true_distance is None else true_distance
    words = {
        "density": say("sheet.density"),
        "axis": say("sheet.axis"),
        "far": say("sheet.beyond"),
        "true": _true(truth),
    }
    room = width - HEADS - 3 * MARGIN
    canvas.text(MARGIN, MARGIN + 12, say("sheet.posterior"), 19, INK, 650)
    line = MARGIN + 42
    for each, colour in zip(intervals, charts.WITHIN, strict=True):
        canvas.text(MARGIN + 24, line, _interval(each), 15, INK)
        canvas.fill(MARGIN, line - 12, 15, 15, colour)
        line += 25
    charts.density(
        canvas, density.distances, np.log(2.0) * density.density, ends, density.beyond, words,
        MARGIN, line + 10, room, height - line - 82, true_distance=truth,
    )  # fmt: skip
    canvas.text(MARGIN, height - 42, say("sheet.prior", words=prior), 13, DIM, most=room)
    canvas.text(MARGIN, height - 20, note, 12.5, DIM, most=room)
    _spread(canvas, found, sd_mm, width - HEADS - MARGIN)
    return _opaque(canvas)


def _spread(canvas: Canvas, found: fa.Posterior, sd_mm: Array, x: float) -> None:
    """The most probable face from the front and from the side, coloured by the spread of each vertex."""
    density = found.distance_density
    fit = found.sweep.nearest(float(density.distances[density.density.argmax()]))
    model, measured = fit.model, sd_mm[_measured(fit.model)]
    most = _scale_end(float(measured.max()))
    face = head(model, "fit", "", fit.vertices(), _heat(model, sd_mm, most), slot=0.0, lit=False)
    canvas.text(x, MARGIN + 12, say("sheet.spread"), 19, INK, 650)
    said = say("sheet.spread_front", mean=f"{measured.mean():.1f}", largest=f"{measured.max():.1f}")
    canvas.text(x, MARGIN + 42, said, 15, INK)
    size, top = (HEADS // 2, 470), MARGIN + 70
    ppm = size[0] / ACROSS
    for k, name in enumerate(("front", "side")):
        view = named_view(name)
        middle = gl.viewer_rotation(view) @ pivot(model)
        drawn = gl.render_head(face, view, *size, ppm, middle=(middle[0], middle[1]))
        canvas.paste(x + k * size[0], top, drawn)
    legend, y = _legend(say("sheet.legend_sd"), most, model.evaluation is None), top + size[1] + 42
    canvas.text(x, y - 14, legend.title, 13, DIM)
    canvas.ramp(x, y - 5, 300, 14, legend.colours, upright=False)
    for tick in legend.ticks:
        at = x + 300 * tick / most
        canvas.line((at, y + 9), (at, y + 13), INK)
        canvas.text(at, y + 27, f"{tick:g}", 13, INK, anchor="middle")
    canvas.text(x, y + 50, legend.note, 12.5, DIM)


def _scene(fit: fa.Fit, heads: Sequence[Head], legend: Legend, note: str) -> Scene:
    """A strip: every head from the front and from the side."""
    return Scene(
        heads=tuple(heads),
        views=(named_view("front"), named_view("side")),
        photo=_photo(fit),
        numbers=Numbers(
            fit.distance, fit.d_l_percent, 0.0, fit.converged, True, fit.interocular_meaning
        ),
        legend=legend,
        pivot=pivot(fit.model),
        note=note,
    )


def _photo(fit: fa.Fit) -> Photo:
    size = fit.observation.image_size
    if size is None:  # a strip shows no photograph
        width, height = np.nanmax(fit.observation.points, axis=0).clip(1)
        size = (int(width), int(height))
    return photo_of_fit(fit, size)


def _measured(model: FaceModel) -> NDArray[np.intp] | slice:
    return slice(None) if model.evaluation is None else model.evaluation


def _heat(model: FaceModel, mm: Array, most: float) -> Pixels:
    """(N, 3) sRGB of millimetres (N,) on the measured surface, grey elsewhere."""
    colours = np.empty((model.n_vertices, 3), dtype=np.uint8)
    colours[:] = UNMEASURED
    where = _measured(model)
    colours[where] = scale_colours(mm[where] / most)
    return colours


def _scale_end(mm: float) -> float:
    """A round number of millimetres that holds `mm`."""
    power = 10.0 ** np.floor(np.log10(max(mm, 1e-3)))
    return float(power * next(step for step in (1, 1.5, 2, 3, 4, 6, 8, 10) if step * power >= mm))


def _legend(title: str, most: float, everywhere: bool) -> Legend:
    return Legend(
        title=title,
        colours=scale_colours(np.linspace(0.0, 1.0, 64)),
        low=0.0,
        high=most,
        ticks=tuple(round(share * most, 6) for share in (0.0, 0.5, 1.0)),
        note="" if everywhere else say("legend.unmeasured"),
    )


def _interval(each: fa.DistanceInterval) -> str:
    level, low = f"{100 * each.level:g}", centimetres(each.low)
    if each.high is None:
        return say("sheet.open", level=level, low=low)
    return say("sheet.interval", level=level, low=low, high=centimetres(each.high))


def _error(d_l_percent: float) -> str:
    return say("sheet.landmarks", percent=percent_number(d_l_percent))


def _true(metres: float) -> str:
    return "" if np.isnan(metres) else say("sheet.true", cm=centimetres(metres))


def _signed(value: float) -> str:
    return f"{value:+.2g}".replace("-", "\u2212")


def _opaque(canvas: Canvas) -> Pixels:
    alpha = np.full((*canvas.pixels.shape[:2], 1), 255, dtype=np.uint8)
    return np.concatenate([canvas.pixels, alpha], axis=2)
