"""Display: what one browser shows of a state. A worker computes it and sends it; nothing here hears a person.

Scenes become nodes (stage), words and plots the contents of the panel's elements.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from typing import NamedTuple

import viser

from faceambig.scene import Numbers, Scene

from .drawn import Drawn, drawn
from .markup import figures, photograph
from .markup.style import text_size
from .own import OwnFrame, OwnPhoto, own_frame, told_distance
from .own import page as own_page
from .panel import Panel
from .pipeline.faces import curve_key
from .pipeline.scenes import photo_jpeg, whole
from .pipeline.told import Slider
from .stage import Stage
from .state import ViewState

Contents = list[tuple[viser.GuiHtmlHandle, str]]


class Rest(NamedTuple):
    """What the widgets are told of a state at rest."""

    sliders: Sequence[Slider]  # of the flexibility modes
    hint: float | None  # metres: of the camera, as the own photograph's file tells it
    numbers: Numbers


class Sent(NamedTuple):
    """Of what the elements are that seldom change; noted once they are sent, for a frame may fail before."""

    curves: object = None  # target and fitting of the plots
    crosses: object = None  # (target, whether they are shown); None: none of a target's
    picture: object = None  # what the photograph shows: (target, draft), or a person's own


class Display:
    """The elements and nodes of one browser. `gone` says whether the browser has left meanwhile, or has another panel.

    one: held while something is written, and by who takes the panel away: an element that is removed at that moment
    would be written into all the same, in a browser that has it no more.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        stage: Stage,
        panel: Panel,
        *,
        gone: Callable[[], bool],
        one: threading.Lock,
    ) -> None:
        self._client, self._stage, self._panel, self._gone = client, stage, panel, gone
        self._one = one
        self._rested: ViewState | None = None  # the state drawn in full last
        self._sent = Sent()

    def draw(self, state: ViewState, draft: bool, own: OwnPhoto | None) -> Rest | None:
        """Compute a state and send it; a draft is for while a hand moves, and says nothing.

        Computing is done before the lock of atomic(), never inside.
        """
        if state.subject == "photo":
            return self._draw_own(own, state, draft)
        shown = drawn(state, draft, self._rested)
        html, sent = self._contents(state, shown, draft)
        self._send(html, shown.scene, draft)
        self._sent = sent
        if draft:
            return None
        self._rested = state
        # Heads first: a new target's curves cost a sweep and a posterior
        self._send([(self._panel.places.plots, shown.curves), *self._others(shown)])
        self._sent = sent._replace(curves=curve_key(state.target, state.fitting))
        return Rest(shown.sliders, None, shown.scene.numbers)

    def _draw_own(self, own: OwnPhoto | None, state: ViewState, draft: bool) -> Rest | None:
        shown = own_frame(own, state, draft)
        html, sent = self._own_contents(own, state, shown, draft)
        self._send(html, whole(shown.scene), draft)
        self._sent = sent
        if draft:
            return None
        return Rest(shown.sliders, told_distance(own, state), shown.scene.numbers)

    def _heading(self, state: ViewState, points: int) -> str:
        if state.lesson is not None:  # whose text stands there
            return ""
        actual = None if "actual" in state.hide else state.actual
        return figures.heading(state.fitting.distance, actual, points)

    def _others(self, shown: Drawn) -> Contents:
        """Other faces behind the same points, and those that were kept."""
        at = self._panel.places
        return [(at.flex, shown.flex), (at.spectrum, shown.spectrum), (at.pins, shown.pins)]

    def _send(self, html: Contents, scene: Scene | None = None, draft: bool = False) -> None:
        with self._one, self._client.atomic():
            if self._gone():  # while this was computed
                return
            if scene is not None:
                self._stage.show(scene, draft)
            for handle, content in html:
                handle.content = content
        self._client.flush()

    def _contents(self, state: ViewState, shown: Drawn, draft: bool) -> tuple[Contents, Sent]:
        """What the elements of the panel show of a frame."""
        at, sent = self._panel.places, self._sent
        html: Contents = []
        crosses = (state.target, shown.scene.photo.points_shown)
        if crosses != sent.crosses:  # 0.3 ms that a hand on the distance does not need
            html.append((at.crosses, shown.crosses))
            sent = sent._replace(crosses=crosses)
        if self._stage.narrow:
            html.append((at.marks, shown.side_by_side))
        else:
            html += [(at.cards, shown.cards), (at.marks, shown.marks)]
        if (
            curve_key(state.target, state.fitting) == sent.curves
        ):  # else at rest, when all else is shown
            html.append((at.plots, shown.curves))
        picture = (state.target, draft)
        if sent.picture not in (picture, (state.target, False)):
            html.append((at.picture, photograph.photo_picture(photo_jpeg(*picture))))
            sent = sent._replace(picture=picture)
        if not draft:
            html += self._at_rest(state, shown)
        return html, sent

    def _own_contents(
        self, own: OwnPhoto | None, state: ViewState, shown: OwnFrame, draft: bool
    ) -> tuple[Contents, Sent]:
        """As `_contents`, of a person's own photograph."""
        at, scene, sent = self._panel.places, shown.scene, self._sent
        cards, marks = own_page.cards(own, state, scene), own_page.marks(own, scene)
        html: Contents = [(at.crosses, "")]
        if self._stage.narrow:  # one below the other: a finger needs a large photograph
            html.append((at.marks, marks + cards))
        else:
            html += [(at.cards, cards), (at.marks, marks)]
        taken = None if own is None else own.taken
        if sent.picture is not taken or taken is None:
            picture = "" if taken is None else photograph.photo_picture(taken.jpeg)
            html.append((at.picture, picture))
        if not draft:
            sent = sent._replace(curves=None)
            words = own_page.spoken(own, state, scene) + figures.heads_words(scene)
            html += [
                (at.plots, own_page.curves(own, state, scene)),
                (at.legend, "" if scene.legend is None else figures.legend(scene.legend)),
                (at.spoken, words),
                (at.data, self._panel.spoken(state) + text_size(state.text)),
                *((place, "") for place in (at.flex, at.spectrum, at.pins)),
                (at.heading, own_page.heading(own, state)),
            ]
        return html, sent._replace(crosses=None, picture=taken)

    def _at_rest(self, state: ViewState, shown: Drawn) -> Contents:
        at = self._panel.places
        return [
            (at.legend, shown.legend),
            (at.spoken, shown.spoken),
            (at.data, self._panel.spoken(state) + text_size(state.text)),
            (at.heading, self._heading(state, shown.frame.points)),
        ]
