"""Panel: the widgets of one browser, in tabs. They say what a person changed; show() writes what is.

They know no scene and no fit: what is computed comes in as HTML, into the elements that stand between the widgets.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import viser

from ..guard import data_html
from ..state import ViewState
from ..text import distance_text, say
from . import classroom, compare, data, explore, export, flex, lessons, view
from .widgets import Change as Change
from .widgets import Tell, Widgets

Photograph = tuple[
    viser.GuiHtmlHandle, viser.GuiHtmlHandle, viser.GuiHtmlHandle, viser.GuiHtmlHandle
]

SIDE_WIDTH = 372  # pixels of each docked panel, where letters are of the usual size


@dataclass(frozen=True, slots=True)
class Places:
    """Where what is computed is shown: elements of the panel."""

    style: viser.GuiHtmlHandle
    heading: viser.GuiHtmlHandle
    picture: viser.GuiHtmlHandle  # the photograph
    crosses: viser.GuiHtmlHandle  # its points, that seldom change
    marks: viser.GuiHtmlHandle  # the points on it; on narrow windows the numbers stand beside
    cards: viser.GuiHtmlHandle
    plots: viser.GuiHtmlHandle
    legend: viser.GuiHtmlHandle
    flex: viser.GuiHtmlHandle  # what the flexibility modes move
    spectrum: viser.GuiHtmlHandle  # and how far
    pins: viser.GuiHtmlHandle  # the faces kept, and their distances
    spoken: viser.GuiHtmlHandle
    data: viser.GuiHtmlHandle  # of the page's script


class Panel:
    """The widgets of one browser."""

    def __init__(
        self,
        gui: viser.GuiApi,
        people: Mapping[Any, str],
        tell: Tell,
        act: Callable[[str], None],
        *,
        narrow: bool,
        own: data.Does,
        use_hint: Callable[[], None],
        saving: export.Does,
        lessons_do: lessons.Does,
        class_do: classroom.Does | None = None,
        invitation: str = "",
        width: int = SIDE_WIDTH,
    ) -> None:
        """width: pixels of each docked panel."""
        self.widgets = w = Widgets(gui, tell, act)
        gui.set_panel_label(say("app.title"))
        style = gui.add_html("")

        def build_class() -> classroom.Classroom | None:
            return None if class_do is None else classroom.Classroom(w, class_do, invitation)

        if narrow:  # one panel: the photograph comes first, beside the numbers
            self.classroom = build_class()
            # and the slider, before anything is scrolled
            photo = self._photo(w, lessons_do, narrow)
        else:
            side = gui.add_panel()
            with side.add_tab(say("panel.photo")):
                self.classroom = build_class()
                photo = self._photo(w, lessons_do, narrow)
                self.lesson.build_list()
            side.dock_left()
            side.set_width(width)
        tabs = gui.add_tab_group()
        with tabs.add_tab(say("panel.explore")):
            explore.build_first(w)
            cards, legend, plots = gui.add_html(""), gui.add_html(""), gui.add_html("")
            if narrow:
                self.lesson.build_list()
            explore.build_photo(w, people)
            self.flex = flex.Flex(w, self.lesson.flex)
            explore.build_data(w)
            explore.build_history(w)
        with tabs.add_tab(say("panel.view")):
            view.build(w)
        with tabs.add_tab(say("panel.compare")):
            pins = compare.build(w)
        with tabs.add_tab(say("panel.data")):
            self.own = data.build(w, own, use_hint)
        with tabs.add_tab(say("panel.export")):
            self.export = export.build(w, saving)
        spoken, told = gui.add_html(""), gui.add_html("")
        gui.main_panel.dock_right()
        gui.main_panel.set_width(width)
        folded = self.flex.words, self.flex.spectrum
        self.places = Places(style, *photo, cards, plots, legend, *folded, pins, spoken, told)

    def _photo(self, w: Widgets, lessons_do: lessons.Does, narrow: bool) -> Photograph:
        """The places of the heading, the photograph, its crosses and its circles; the lesson between them."""
        heading = w.gui.add_html("")
        self.lesson = lessons.Lessons(w, lessons_do, narrow=narrow)
        return heading, w.gui.add_html(""), w.gui.add_html(""), w.gui.add_html("")

    def show(self, state: ViewState) -> None:
        """Write a state into the widgets; on the event loop only, so an older value never overwrites a newer one."""
        self.widgets.show(state)

    def spoken(self, state: ViewState) -> str:
        """Data for the page's script: buttons that are on, and what a screen reader says for a distance slider."""
        texts = {
            say(f"field.{name}"): distance_text(getattr(state, name))
            for name in ("distance", "actual")
        }
        return data_html("pressed", self.widgets.pressed(state)) + data_html("valuetext", texts)
