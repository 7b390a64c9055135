"""compose: surfaces with their legends, ways to show, views, overlays, and what is hidden."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import faceambig as fa
import scenes
from faceambig import compose as fc
from faceambig.arrays import vertex_normals
from faceambig.boundary import occluding_boundary
from faceambig.camera import Camera, depths, project
from faceambig.compose.face import centre_of
from faceambig.compose.overlays import BREAK, FARTHEST, LIFT, apex, station
from faceambig.density import DistanceDensity
from faceambig.flex import plausible_limit
from faceambig.model import Subject
from faceambig.observation import portrait_camera
from faceambig.render import overlay
from faceambig.scene import Lines, Photo, Scene
from strategies import bumpy_model, face_of

TITLES = ("True", "Fits")
MODEL = bumpy_model()
SUBJECT = face_of(MODEL, np.array([1.0, -0.5, 0.3, 0.8, -1.2, 0.4, 0.9, -0.7]))
POSE = {"scheme": "egg", "yaw_deg": 20, "pitch_deg": 5}
CAMERA = portrait_camera(SUBJECT, distance=0.3, **POSE)
OBSERVATION = fa.observe(SUBJECT, distance=0.3, **POSE)
FIT = fa.fit(MODEL, OBSERVATION, distance=1.2)
FACE = fc.measure(SUBJECT, FIT)
PICTURE = fc.photo(SUBJECT, OBSERVATION, CAMERA, caption="taken from 30 cm")
AT = OBSERVATION.vertices(MODEL)


def composed(face: fc.Face = FACE, picture: Photo = PICTURE, **asked) -> Scene:
    return fc.compose(SUBJECT, face, picture, titles=TITLES, true_camera=CAMERA, **asked)


def moved(camera: Camera, mm: np.ndarray) -> fc.Face:
    """A face whose vertices lie `mm` (N,) nearer to a camera than the true ones, along its viewing rays."""
    rays = SUBJECT.vertices - centre_of(camera)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    return replace(FACE, vertices=SUBJECT.vertices - 1e-3 * mm[:, None] * rays)


# ---- surfaces ----


@pytest.mark.parametrize("surface", ["difference", "depth", "spread"])
def test_a_head_of_values_has_the_colours_of_its_legend(surface):
    legend = fc.LEGENDS[surface]("mm", "grey")
    values = np.resize(np.linspace(legend.low, legend.high, len(legend.colours)), MODEL.n_vertices)
    colour = {
        "difference": fc.difference_colours,
        "depth": fc.depth_colours,
        "spread": fc.spread_colours,
    }[surface]
    assert np.array_equal(colour(MODEL, values), np.resize(legend.colours, (MODEL.n_vertices, 3)))
    beyond = colour(MODEL, np.full(MODEL.n_vertices, 99.0))
    assert (beyond == legend.colours[-1]).all()
    assert legend.open_high
    assert (legend.ticks[0], legend.ticks[-1]) == (legend.low, legend.high)


@pytest.mark.parametrize("surface", fc.SURFACES)
def test_what_is_drawn_is_the_surface_that_was_asked_for(surface):
    sd = np.linspace(0, 12, MODEL.n_vertices)
    scene = composed(surface=surface, spread_mm=sd, legend_words=("mm", "grey"))
    true, fitted = scene.heads
    expected = {
        "clay": np.tile(np.array(fc.CLAY, dtype=np.uint8), (MODEL.n_vertices, 1)),
        "skin": fc.skin(SUBJECT),
        "difference": fc.difference_colours(MODEL, FACE.gaps_mm),
        "depth": fc.depth_colours(MODEL, fc.depth_change_mm(SUBJECT, FACE, CAMERA)),
        "spread": fc.spread_colours(MODEL, sd),
    }[surface]
    assert np.array_equal(fitted.colours, expected)
    assert np.array_equal(true.colours, expected if surface == "clay" else fc.skin(SUBJECT))
    valued = surface in fc.LEGENDS
    assert fitted.lit is not valued
    assert true.lit
    assert (scene.legend is not None) is valued
    if scene.legend is not None:
        assert (scene.legend.title, scene.legend.note) == ("mm", "grey")


def test_depth_counts_towards_the_camera_along_its_rays():
    mm = np.random.default_rng(0).uniform(-12, 12, MODEL.n_vertices)
    face = moved(CAMERA, mm)
    # the displacement itself, and through the textbook's camera the pixels stay: rounding
    assert np.abs(fc.depth_change_mm(SUBJECT, face, CAMERA) - mm).max() < 1e-9
    stay = project(CAMERA, face.vertices) - project(CAMERA, SUBJECT.vertices)
    assert np.abs(stay).max() < 1e-9
    nearer = depths(CAMERA, face.vertices) < depths(CAMERA, SUBJECT.vertices)
    assert np.array_equal(nearer, mm > 0)


def test_nearer_is_warm_farther_is_cool_and_nothing_is_grey():
    signs = np.resize([10.0, -10.0, 0.0], MODEL.n_vertices)
    red, _, blue = composed(moved(CAMERA, signs), surface="depth").heads[1].colours.T.astype(int)
    assert (red[signs > 0] - blue[signs > 0] > 50).all()
    assert (red[signs < 0] - blue[signs < 0] < -50).all()
    assert (np.abs(red - blue)[signs == 0] <= 2).all()  # rounding of the displacement
    # both sides are equally dark at the same distance from 0 (Moreland: to a few of 100 levels of lightness)
    luma = fc.signed_colours(np.array([-1.0, -0.5, 0.0, 0.5, 1.0])) @ np.array([0.3, 0.59, 0.11])
    assert luma.argmax() == 2


def test_depth_of_an_orthographic_camera_is_along_its_axis():
    far = replace(CAMERA, kappa=0.0)
    face = replace(FACE, vertices=SUBJECT.vertices - 0.004 * far.R[2])
    assert np.abs(fc.depth_change_mm(SUBJECT, face, far) - 4.0).max() < 1e-9


def test_outside_the_region_of_d_s_differences_and_depth_are_grey():
    region = np.arange(10, 300)
    model = replace(MODEL, evaluation=region)
    subject = replace(SUBJECT, model=model)
    face = fc.measure(subject, fa.fit(model, OBSERVATION, distance=1.2))
    for surface in ("difference", "depth"):
        scene = fc.compose(
            subject, face, PICTURE, titles=TITLES, surface=surface, true_camera=CAMERA
        )
        grey = (scene.heads[1].colours == fc.UNMEASURED).all(axis=1)
        assert np.array_equal(grey.nonzero()[0], np.delete(np.arange(MODEL.n_vertices), region))


def test_a_spread_of_nothing_is_grey_and_of_another_size_is_refused():
    sd = np.full(MODEL.n_vertices, 3.0)
    sd[5] = np.nan
    colours = fc.spread_colours(MODEL, sd)
    assert (colours[5] == fc.UNMEASURED).all()
    assert (colours[6] == fc.scale_colours(np.array([0.3]))).all()
    with pytest.raises(ValueError, match=r"spread_mm: expected shape \(\d+\), found \(7,\)"):
        composed(surface="spread", spread_mm=np.zeros(7))


# ---- ways to show ----


def test_a_difference_colours_the_fitted_head_by_it_or_by_its_depth():
    for surface, drawn in (("skin", "difference"), ("spread", "difference"), ("depth", "depth")):
        assert fc.shown_surface(surface, "difference") == drawn
        shown, same = composed(show="difference", surface=surface), composed(surface=drawn)
        assert np.array_equal(shown.heads[1].colours, same.heads[1].colours)
        assert [head.slot for head in shown.heads] == [head.slot for head in same.heads]


def test_in_an_overlay_both_faces_are_in_one_place_and_fade_says_how_much_of_which():
    amounts = {}
    for fade in (0.0, 0.3, 0.75, 0.9, 1.0):
        scene = composed(show="overlay", fade=fade)
        assert {head.slot for head in scene.heads} == {0.0}
        amounts[fade] = {head.name: round(head.opacity, 9) for head in scene.heads}
        assert not scene.blink
    assert amounts == {
        0.0: {"fit": 1.0},
        0.3: {"true": 0.4, "fit": 1.0},
        0.75: {"true": 1.0, "fit": 1.0},
        0.9: {"true": 1.0, "fit": 0.4},
        1.0: {"true": 1.0},
    }


def test_at_every_fade_one_face_of_an_overlay_is_solid_and_neither_jumps():
    fades = np.linspace(0, 1, 81)
    opacity = {"true": np.zeros(81), "fit": np.zeros(81)}
    for at, fade in enumerate(fades):
        for head in composed(show="overlay", fade=float(fade)).heads:
            opacity[head.name][at] = head.opacity
    assert (np.maximum(opacity["true"], opacity["fit"]) == 1).all()
    assert (np.diff(opacity["true"]) >= 0).all()
    assert (np.diff(opacity["fit"]) <= 0).all()
    steps = np.abs(np.diff([opacity["true"], opacity["fit"]]))
    assert steps.max() < 0.06  # the steeper ramp: 0 to 1 over a quarter of 80 steps


def test_the_fitted_head_carries_the_millimetres_that_its_colours_mean():
    for surface, colours in (("difference", fc.difference_colours), ("depth", fc.depth_colours)):
        fit = composed(surface=surface).heads[1]
        region = MODEL.evaluation if MODEL.evaluation is not None else np.arange(MODEL.n_vertices)
        assert fit.values_mm is not None
        assert np.isfinite(fit.values_mm[region]).all()
        assert np.isnan(np.delete(fit.values_mm, region)).all()
        assert np.array_equal(colours(MODEL, fit.values_mm[region]), fit.colours)
    assert fit.values_mm is not None
    assert np.nanmin(fit.values_mm) < 0 < np.nanmax(fit.values_mm)  # of depth: both signs
    for head in (*composed(surface="skin").heads, composed(surface="depth").heads[0]):
        assert head.values_mm is None


def test_blinking_heads_are_whole_and_in_one_place():
    scene = composed(show="blink")
    assert scene.blink
    assert [(head.name, head.slot, head.opacity) for head in scene.heads] == [
        ("true", 0.0, 1.0),
        ("fit", 0.0, 1.0),
    ]
    assert not composed(show="blink", hide=("truth",)).blink  # one head has nothing to blink with


def test_the_ghost_is_the_true_face_where_the_fitted_one_stands():
    true, fitted, ghost = composed(overlays=("ghost",)).heads
    assert ghost.slot == fitted.slot != true.slot
    assert np.array_equal(ghost.vertices, SUBJECT.vertices)
    assert 0 < ghost.opacity < 1
    assert fitted.opacity == true.opacity == 1
    # over colours that are values it would change them
    for surface, view, show in (
        ("difference", "side", "both"),
        ("skin", "camera", "both"),
        ("skin", "side", "blink"),
    ):
        scene = composed(overlays=("ghost",), surface=surface, view=view, show=show)
        assert len(scene.heads) == 2


# ---- views ----


def test_zoom_shows_less_and_orbit_is_where_the_viewer_stands():
    for view in ("front", "three_quarter", "side", "top"):
        plain, near = (composed(view=view, zoom=zoom).views[0] for zoom in (1.0, 4.0))
        assert plain.half_height / near.half_height == pytest.approx(4.0)
        assert replace(near, half_height=plain.half_height) == plain
    free = composed(view="free", orbit=(33.0, -20.0), zoom=0.5).views[0]
    assert (free.name, free.azimuth_deg, free.elevation_deg) == ("free", 33.0, -20.0)
    assert free.half_height == pytest.approx(0.33)


def test_from_above_a_drawn_camera_is_in_the_picture():
    for distance in (0.2, 0.5, 2.0, None):
        fit = fa.fit(
            MODEL,
            OBSERVATION,
            camera="orthographic" if distance is None else "perspective",
            distance=distance,
        )
        scene = composed(fc.measure(SUBJECT, fit), view="top", overlays=("pyramid",))
        view = scene.views[0]
        up = -np.concatenate([line.segments.reshape(-1, 3) for line in scene.lines])[:, 2]
        up += scene.pivot[2] + view.rise
        assert np.abs(up).max() < view.half_height


# ---- overlays ----


def lines_of(scene: Scene, name: str) -> dict[str, Lines]:
    return {line.head: line for line in scene.lines if line.name == name}


def test_marks_lie_a_little_above_the_landmarks_of_their_head():
    scene = composed(overlays=("points", "marks", "names"))
    assert [(m.head, m.tone) for m in scene.marks] == [("true", "seen"), ("fit", "d_l")]
    for mark, head in zip(scene.marks, scene.heads, strict=True):
        normals = vertex_normals(head.vertices, head.faces)[AT]
        assert np.abs(mark.points - head.vertices[AT] - LIFT * normals).max() < 1e-12
        assert mark.names == MODEL.scheme("egg").points
    assert scene.photo.points_shown
    assert scene.photo.names_shown
    without = composed(overlays=())
    assert without.marks == ()
    assert not without.photo.points_shown
    assert composed(overlays=("marks",)).marks[0].names == ()


def test_points_that_were_not_given_are_not_marked():
    points = OBSERVATION.points.copy()
    points[[3, 7]] = np.nan
    seen = fa.Observation(points, "egg", (500, 500))
    face = fc.measure(SUBJECT, fa.fit(MODEL, seen, distance=0.6))
    for numbered in (False, True):
        if numbered:
            seen = fa.Observation(points, AT, (500, 500))
            face = fc.measure(SUBJECT, fa.fit(MODEL, seen, distance=0.6))
        scene = composed(
            face, replace(PICTURE, observed=points), overlays=("marks", "names", "rays")
        )
        kept = np.delete(np.array(MODEL.scheme("egg").points), [3, 7])
        assert all(mark.names == tuple(kept) and len(mark.points) == 18 for mark in scene.marks)
        assert all(len(line.segments) == 18 for line in scene.lines)


def test_rays_of_the_true_head_lie_on_the_lines_through_camera_and_vertex():
    ray = lines_of(composed(overlays=("rays",)), "rays")["true"].segments
    centre, vertices = centre_of(CAMERA), SUBJECT.vertices[AT]
    assert np.abs(ray[:, 1] - vertices).max() < 1e-12  # noise-free: the cross is the vertex
    way = (vertices - centre) / np.linalg.norm(vertices - centre, axis=1, keepdims=True)
    aside = np.cross(ray[:, 0] - centre, way)
    assert np.abs(aside).max() < 1e-12
    # cut off where the picture ends, between camera and face
    from_pivot = np.linalg.norm(ray[:, 0] - fc.pivot(MODEL), axis=1)
    assert np.abs(from_pivot - 0.165).max() < 1e-9


@pytest.mark.parametrize("distance", [0.3, 1.2, None])
def test_rays_of_the_fitted_head_go_through_the_crosses_from_the_assumed_camera(distance):
    camera = "orthographic" if distance is None else "perspective"
    fit = fa.fit(MODEL, OBSERVATION, camera=camera, distance=distance)
    face = fc.measure(SUBJECT, fit)
    ray = lines_of(composed(face, overlays=("rays",)), "rays")["fit"].segments
    own = (ray - face.translation) @ face.rotation  # back into the fit's own frame
    for end in (0, 1):
        seen = project(fit.camera, own[:, end]) + OBSERVATION.centre
        assert np.abs(seen - OBSERVATION.points).max() < 1e-8  # pixels
    # as deep as the landmark they explain
    apart = (own[:, 1] - face.own_vertices[AT]) @ fit.camera.R[2]
    assert np.abs(apart).max() < 1e-12


def test_from_above_rays_begin_at_a_drawn_camera_or_at_its_break():
    scene = composed(view="top", overlays=("rays", "pyramid"))
    ray = lines_of(scene, "rays")
    assert np.abs(ray["true"].segments[:, 0] - centre_of(CAMERA)).max() < 1e-12
    assert np.abs(np.linalg.norm(ray["fit"].segments[:, 0], axis=1) - BREAK).max() < 1e-9


def test_a_pyramid_has_the_photographs_corners_and_stands_where_the_camera_does():
    segments = lines_of(composed(overlays=("pyramid",)), "pyramid")
    near = segments["true"].segments
    assert len(near) == 8  # four edges and the photograph
    assert np.abs(near[:4, 0] - centre_of(CAMERA)).max() < 1e-12
    corners = project(CAMERA, near[:4, 1]) + OBSERVATION.centre
    assert np.abs(corners - [[0, 0], [500, 0], [500, 500], [0, 500]]).max() < 1e-8
    far = segments["fit"].segments
    assert len(far) == 12  # and the broken line
    place = station(FACE.camera, FACE.rotation, FACE.translation)
    assert np.linalg.norm(far[0, 0]) == pytest.approx(FARTHEST)
    assert np.abs(np.cross(apex(place), place.centre)).max() < 1e-12  # on the line to the camera
    assert np.linalg.norm(place.centre) > 1.1


def test_the_outline_is_the_visible_boundary_of_the_fitted_face():
    outline = composed(overlays=("outline",)).photo.outline
    assert outline is not None
    boundary = occluding_boundary(MODEL, FACE.own_vertices, FIT.camera)
    seen = set(boundary.vertices[boundary.visible].tolist())
    edges = [e for e in boundary.edges.tolist() if set(e) <= seen]
    xy = project(FIT.camera, FACE.own_vertices) + OBSERVATION.centre
    whole = np.isfinite(outline.sum(axis=1))
    steps = [(a, b) for a, b, i in zip(outline, outline[1:], range(len(whole)), strict=False)
             if whole[i] and whole[i + 1]]  # fmt: skip
    # every edge once, whichever way
    drawn = sorted(tuple(sorted(map(tuple, step))) for step in steps)
    expected = sorted(tuple(sorted((tuple(xy[a]), tuple(xy[b])))) for a, b in edges)
    assert len(edges) > 10
    assert drawn == expected
    assert composed().photo.outline is None


def test_error_lines_and_the_scale_bar_are_drawn_when_asked_for():
    assert composed(overlays=("errors",), error_scale=10).photo.error_scale == 10
    assert composed(overlays=(), error_scale=10).photo.error_scale == 0
    assert composed(overlays=("scale",)).scale_bar == 0.05
    assert composed(overlays=()).scale_bar == 0


# ---- what is hidden ----


def test_a_hidden_truth_shows_in_nothing():
    plot = fa.sweep_distance(MODEL, OBSERVATION, [0.3, 1.2])
    scene = composed(
        hide=("truth", "actual"), show="overlay", surface="difference", overlays=fc.OVERLAYS,
        curve=fc.curves(SUBJECT, plot, 0.3),
    )  # fmt: skip
    assert [head.name for head in scene.heads] == ["fit"]
    assert scene.legend is None
    assert np.array_equal(scene.heads[0].colours, fc.skin(SUBJECT))
    assert {part.head for part in (*scene.marks, *scene.lines)} == {"fit"}
    assert scene.photo.caption == ""
    assert scene.curves is not None
    assert np.isnan(scene.curves.true_distance)
    assert scene.hide == {"truth", "actual"}
    assert composed(hide=("numbers",)).hide == {"numbers"}


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"show": "two"}, "show: 'two' is not one of both, overlay"),
        ({"surface": "gold"}, "surface: 'gold' is not one of clay"),
        ({"overlays": ("grid",)}, "overlays: 'grid' is not one of points"),
        ({"hide": ("all",)}, "hide: 'all' is not one of numbers"),
        ({"fade": 1.5}, "fade: 1.5 is not within 0 to 1"),
        ({"zoom": 9}, "zoom: 9 is not within 0.5 to 4"),
        ({"view": "free", "orbit": (0, 91)}, "orbit: azimuth 0 and elevation 91 are not within"),
        ({"view": "free", "orbit": (np.nan, 0)}, "orbit: azimuth nan"),
        ({"overlays": ("errors",), "error_scale": 2}, "error_scale: 2 is not one of 1, 5, 10, 20"),
        ({"surface": "spread"}, "surface: 'spread' needs the sd"),
    ],
)  # fmt: skip
def test_what_cannot_be_shown_is_refused_by_name(asked, words):
    with pytest.raises(ValueError, match=f"^{words}"):
        composed(**asked)


@pytest.mark.parametrize("asked", [{"surface": "depth"}, {"overlays": ("rays",)}])
def test_what_needs_the_true_camera_says_so(asked):
    with pytest.raises(ValueError, match="needs the camera that took the photograph"):
        fc.compose(SUBJECT, FACE, PICTURE, titles=TITLES, **asked)


# ---- other faces, and photographs without a truth ----


def test_several_modes_bend_a_face_by_their_sum():
    modes = fa.flexibility_modes(MODEL, FIT, count=3)
    change = fc.bent(modes, (2.0, 0.0, -1.5))
    assert np.abs(change - (2.0 * modes.directions[0] - 1.5 * modes.directions[2])).max() < 1e-15
    words = list(zip(modes.words, (2.0, 0.0, -1.5), strict=True))
    limit = plausible_limit(len(FIT.alpha))
    face = fc.measure(SUBJECT, FIT, change, limit=limit, flex=words)
    assert face.flex == ((modes.words[0], 2.0), (modes.words[2], -1.5))
    assert (face.flex_words, face.flex_mm) == face.flex[0]
    assert composed(face).numbers.flex == face.flex
    assert face.plausible is bool(np.linalg.norm(FIT.alpha + change) <= limit)
    far = fc.measure(SUBJECT, FIT, fc.bent(modes, (60.0, 60.0, 60.0)), limit=limit, flex=words)
    assert not far.plausible
    grey = composed(far, surface="clay").heads[1].colours
    assert (grey == grey[:, :1]).all()
    with pytest.raises(ValueError, match="mm: 4 values for 3 modes"):
        fc.bent(modes, (1, 2, 3, 4))


def test_a_drawn_face_is_seen_by_its_own_camera():
    other = fa.fit(MODEL, OBSERVATION, distance=0.5)
    drawn = fc.measure(SUBJECT, FIT, alpha=other.alpha, camera=other.camera)
    assert np.array_equal(drawn.own_vertices, other.vertices())
    assert np.abs(drawn.projected - other.projected()).max() < 1e-9
    scene = composed(drawn, view="camera")
    assert scene.numbers.distance == pytest.approx(0.5)
    assert scene.photo.fit_focal == pytest.approx(other.focal)
    assert drawn.d_l_percent == pytest.approx(other.d_l_percent, rel=1e-10)


def test_of_an_own_photograph_a_fit_stands_in_for_the_true_face():
    reference = fa.fit(MODEL, OBSERVATION, distance=0.6)
    standing = fc.stand_in(reference, "the 60 cm fit")
    pixels = np.zeros((500, 500, 3), dtype=np.uint8)
    picture = fc.photo_of_fit(reference, (500, 500), pixels=pixels)
    face = fc.measure(standing, FIT)
    scene = fc.compose(
        standing, face, picture, titles=TITLES, reference="the 60 cm fit",
        surface="depth", overlays=("rays",), true_camera=reference.camera,
    )  # fmt: skip
    assert scene.photo.pixels is pixels
    assert scene.numbers.reference == "the 60 cm fit"
    assert np.array_equal(scene.heads[0].vertices, reference.vertices())
    assert fc.measure(standing, reference).d_s_mm < 1e-9
    assert np.isnan(
        fc.curves(standing, fa.sweep_distance(MODEL, OBSERVATION, [0.3, 1]), None).true_distance
    )
    with pytest.raises(ValueError, match=r"pixels: expected shape \(400, 500, 3\)"):
        fc.photo_of_fit(reference, (500, 400), pixels=pixels)


def test_a_density_is_told_at_the_distances_of_the_curves():
    plot = fc.curves(SUBJECT, fa.sweep_distance(MODEL, OBSERVATION, [0.2, 0.4, 0.8, 1.6]), 0.3)
    at = np.geomspace(0.1, 3.2, 301)
    shape = np.exp(-0.5 * (np.log(at / 0.8) / 0.5) ** 2)
    whole = np.trapezoid(shape, np.log(at))
    told = fc.with_density(plot, DistanceDensity(at, 0.9 * shape / whole, 0.1))
    assert told.density is not None
    # linear between points 1 % apart
    np.testing.assert_allclose(
        told.density, np.exp(-0.5 * (np.log(plot.distances / 0.8) / 0.5) ** 2), atol=1e-3, rtol=0
    )
    assert told.beyond == 0.1
    (low50, high50), (low95, high95) = told.intervals
    assert low95 < low50 < 0.8 < high50 < 3.2
    assert high95 == np.inf  # 2.5 % are less than lie beyond
    far = fc.with_density(plot, DistanceDensity(at, 0.2 * shape / whole, 0.8))
    assert far.intervals[0] == (pytest.approx(3.2), np.inf)  # even 25 % lie beyond


def test_pinned_faces_stand_on_one_scale_each_against_its_own_truth():
    other = face_of(MODEL, -0.5 * np.ones(8), "another")
    seen = fa.observe(other, distance=0.5, **POSE)
    pins = [(SUBJECT, FACE), (other, fc.measure(other, fa.fit(MODEL, seen, distance=1.0)))]
    lines = (("name", "dim"), ("0.3 %", "d_l"), ("4 mm", "d_s"))
    scene = fc.compose_pins(
        pins, PICTURE, titles=("a", "b"), captions=(lines, lines), legend_words=("mm", "")
    )
    assert [head.name for head in scene.heads] == ["pin1", "pin2"]
    for head, (_, face) in zip(scene.heads, pins, strict=True):
        assert np.array_equal(head.colours, fc.difference_colours(MODEL, face.gaps_mm))
        assert np.array_equal(head.vertices, face.vertices)
        assert head.caption == lines
    assert [view.name for view in scene.views] == ["front", "side"]
    assert scene.legend is not None
    hidden = fc.compose_pins(
        pins, PICTURE, titles=("a", "b"), captions=(lines, lines), legend_words=("mm", ""),
        hide=("numbers", "truth"), scale=False,
    )  # fmt: skip
    assert hidden.heads[0].caption == lines[:1]
    assert hidden.legend is None
    assert hidden.scale_bar == 0
    for count in (0, 6):
        with pytest.raises(ValueError, match=f"pins: {count} faces; 1 to 5 stand in a row"):
            fc.compose_pins(
                [pins[0]] * count, PICTURE, titles="x" * count, captions=[()] * count,
                legend_words=("", ""),
            )  # fmt: skip


def test_pinned_heads_of_another_model_turn_about_the_same_pivot():
    shifted = replace(MODEL, control_mean=MODEL.control_mean + np.array([0.0, 0.05, -0.02]))
    subject = Subject("s", "", shifted.mean, None, shifted)
    face = fc.measure(subject, fa.fit(shifted, OBSERVATION, distance=1.2))
    scene = fc.compose_pins(
        [(SUBJECT, FACE), (subject, face)], PICTURE, titles=("a", "b"), captions=((), ()),
        legend_words=("", ""),
    )  # fmt: skip
    apart = scene.heads[1].vertices - face.vertices
    assert np.abs(apart - [0.0, -0.05, 0.02]).max() < 1e-12


def test_a_row_without_the_truth_is_the_fits_as_they_look():
    scene = fc.compose_row(
        SUBJECT, [FACE, FACE], PICTURE, titles=("t", "a", "b"), captions=[()] * 3,
        legend_words=("", ""), hide=("truth",),
    )  # fmt: skip
    assert [(head.name, head.title) for head in scene.heads] == [("fit1", "a"), ("fit2", "b")]
    assert all(head.lit for head in scene.heads)
    assert abs(sum(head.slot for head in scene.heads)) < 1e-12


# ---- as pictures ----

LOOKS = {
    "from_above": {"view": "top", "overlays": ("rays", "pyramid", "scale")},
    "depth": {"view": "free", "orbit": (40.0, 15.0), "zoom": 1.5, "surface": "depth"},
    "clay": {"view": "side", "surface": "clay", "overlays": ("points", "ghost", "rays", "outline")},
}


@pytest.fixture(scope="module")
def posed(embedded: fa.FaceModel) -> tuple[Subject, fc.Face, Photo, Camera]:
    scenes.need_renderer()
    subject, pose = embedded.subject(2), {"distance": 0.3, "yaw_deg": 15}
    seen, camera = fa.observe(subject, **pose), portrait_camera(subject, **pose)
    face = fc.measure(subject, fa.fit(embedded, seen, distance=1.2))
    return subject, face, fc.photo(subject, seen, camera, caption="taken from 30 cm"), camera


@pytest.mark.gl
@pytest.mark.parametrize("name", LOOKS)
def test_a_look_is_like_the_stored_picture(posed, name):
    subject, face, picture, camera = posed
    scene = fc.compose(
        subject, face, picture, titles=TITLES, true_camera=camera, note="person 2",
        legend_words=("nearer to the camera, mm", "grey: not measured"), **LOOKS[name],
    )  # fmt: skip
    scenes.like_stored(f"look_{name}", overlay.draw(scene, 720, 450))


@pytest.mark.gl
def test_a_row_of_pins_is_like_the_stored_picture(posed):
    subject, face, picture, _ = posed
    other = fc.measure(subject, face.fit, alpha=0.5 * face.fit.alpha)
    lines = tuple(
        (("person 2", "dim"), (f"{f.d_l_percent:.2f} %", "d_l"), (f"{f.d_s_mm:.1f} mm", "d_s"))
        for f in (face, other)
    )
    scene = fc.compose_pins(
        [(subject, face), (subject, other)], picture, titles=("one", "another"), captions=lines,
        legend_words=("distance to true face, mm", "grey: not measured"), note="two pins",
    )  # fmt: skip
    scenes.like_stored("pins", overlay.draw(scene, 640, 304))
