"""Other faces behind the same points: three flexibility modes at a time in millimetres, mixtures, extremes, draws."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import viser
from viser._messages import GuiSliderMark  # a slider's marks have no setter that is public

from ..state import ViewState, changed
from ..state.actions import draw_next, surprise
from ..state.fields import FIELDS, MODES
from ..text import say
from .explore import folder
from .widgets import Change, Widgets

LETTERS = ("A", "B", "C")
STRENGTH = 5.0  # mm of a mixture

Marks = tuple[tuple[float, str], ...]


class Flex:
    """The folder, its sliders, and the elements that say what the modes move."""

    def __init__(self, w: Widgets, elsewhere: Sequence[viser.GuiSliderHandle[float]] = ()) -> None:
        """elsewhere: the same sliders, made by `sliders`, that stand at another place too."""
        with folder(w, "flex"):
            self._sliders = [*sliders(w), *elsewhere]
            w.actions("flex_modes", ("next_modes", "unbend"))
            self._strength = w.gui.add_slider(
                say("field.strength"), 0.0, 10.0, 0.5, STRENGTH, hint=say("field.strength_hint")
            )
            self._others(w)
            self.words = w.gui.add_html("")
            self.spectrum = w.gui.add_html("")
        self._told: list[tuple[str, Marks]] = [("", ())] * len(self._sliders)

    def _others(self, w: Widgets) -> None:
        """Whole faces behind the same points: mixed, farthest apart, drawn."""
        does: dict[str, Callable[[], Change]] = {
            say("action.surprise"): lambda: surprise(float(self._strength.value)),
            say("action.draw"): lambda: draw_next,
        }
        group = w.gui.add_button_group(say("field.flex_faces"), tuple(does))
        group.on_click(w.heard(lambda option: does[option]()))
        w.actions("flex_ends", ("extremes",))

    def tell(self, sliders: Sequence[tuple[str, Marks]]) -> None:
        """Label and marks (mm, words) of each slider, in the order of LETTERS; one that is missing has no mode."""
        for k, handle in enumerate(self._sliders):
            place = k % MODES
            there = place < len(sliders)
            told = sliders[place] if there else (say("field.flex", letter=LETTERS[place]), ())
            if handle.disabled == there:  # asked first: viser looks up types at every assignment
                handle.disabled = not there
            if told != self._told[k]:
                self._told[k] = told
                handle.label = told[0]
                handle._marks = tuple(GuiSliderMark(value=mm, label=words) for mm, words in told[1])


def sliders(w: Widgets, *, visible: bool = True) -> list[viser.GuiSliderHandle[float]]:
    """The sliders of the modes that have some."""
    return [_slider(w, k, letter, visible) for k, letter in enumerate(LETTERS)]


def _slider(w: Widgets, place: int, letter: str, visible: bool) -> viser.GuiSliderHandle[float]:
    field = FIELDS["flex"]
    handle = w.gui.add_slider(
        say("field.flex", letter=letter), field.low, field.high, field.step, 0.0, hint=say("field.flex_hint"),
        visible=visible,
    )  # fmt: skip
    w.bind(handle, _millimetres(place), _bent(place))
    return handle


def _millimetres(place: int) -> Callable[[ViewState], float]:
    return lambda state: dict(state.flex).get(state.flex_from + place, 0.0)


def _bent(place: int) -> Callable[[float], Change]:
    def write(mm: float) -> Change:
        def change(state: ViewState) -> ViewState:
            mode = state.flex_from + place
            others = [pair for pair in state.flex if pair[0] != mode]
            # Modes that have no slider now make room for the one that a hand moves. What is bent is the fit again
            flex = (*others[: MODES - 1], (mode, float(mm)))
            return changed(state, flex=flex, draw=None, extreme=None)

        return change

    return write
