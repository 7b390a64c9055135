"""Drawn: what every browser shows of one state, computed when the first one asks.

Thirty followers of a class are at one state: heads, words and plots are made once, and only sent thirty times. The last
few states are kept; a second worker that asks for what the first is computing waits for it.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Sequence
from typing import Any, Generic, TypeVar

from . import pipeline
from .markup import figures, photograph, plots, plottable
from .pipeline import Frame, frame, plots_of
from .pipeline.scenes import whole
from .pipeline.told import Slider, flex_lines, pins_of, sliders_of, spectrum_of, told
from .state import DEFAULT, ViewState, for_eyes_of
from .text import language

KEPT = 48  # states, each with its heads of about a megabyte: more than one slider passes at a time

_T = TypeVar("_T")


class _once(Generic[_T]):
    """A property that is made once. functools' own holds, until Python 3.12, one lock for all instances: a sweep of
    seconds for one browser would keep every other from its plots.
    """

    def __init__(self, make: Callable[[Any], _T]) -> None:
        self._make, self._name, self.__doc__ = make, make.__name__, make.__doc__

    def __get__(self, drawn: Drawn, _owner: type | None = None) -> _T:
        made = vars(drawn)  # where it is found from then on, before this
        with drawn.lock:
            if self._name not in made:
                made[self._name] = self._make(drawn)
            return made[self._name]


class Drawn:
    """One state, at rest or as a draft: its frame, and its words and plots as HTML."""

    def __init__(self, state: ViewState, shown: Frame, draft: bool) -> None:
        self.state, self.frame, self.scene = state, shown, whole(shown.scene)
        self.lock = threading.RLock()  # who makes one of its properties
        self._draft = draft

    @_once
    def cards(self) -> str:
        """The two numbers."""
        return figures.cards(self.scene.numbers, hide=self.state.hide)

    @_once
    def marks(self) -> str:
        """The circles on the photograph."""
        return photograph.photo_marks(self.scene.photo, crosses=False, hover=not self._draft)

    @_once
    def crosses(self) -> str:
        """Its points."""
        return photograph.photo_crosses(self.scene.photo)

    @_once
    def side_by_side(self) -> str:
        """Circles and numbers, where there is no second panel."""
        return figures.side_by_side(self.marks, self.cards)

    @_once
    def curves(self) -> str:
        """The plots; of a new target a sweep and a posterior."""
        shown = plots_of(self.state)
        drawn = plots.plots(shown, self.scene.numbers, hide=self.state.hide, brief=self._draft)
        return drawn if shown.density is not None else drawn + plottable.nothing_likely()

    @_once
    def legend(self) -> str:
        """Which face stands for the fitted one, and the scale of colours."""
        legend = "" if self.scene.legend is None else figures.legend(self.scene.legend)
        return figures.told(told(self.state)) + legend

    @_once
    def spoken(self) -> str:
        """In words, for screen readers."""
        words = figures.spoken(self.scene.numbers, hide=self.state.hide)
        return words + figures.heads_words(self.scene)

    @_once
    def flex(self) -> str:
        """What the flexibility modes move."""
        return figures.flex_words(flex_lines(self.state))

    @_once
    def spectrum(self) -> str:
        """How far each of them may."""
        return figures.spectrum(*spectrum_of(self.state))

    @_once
    def pins(self) -> str:
        """The faces kept."""
        pins = pins_of(self.state)
        return figures.pins(pins.names, pins.words, pins.d_s_mm)

    @_once
    def sliders(self) -> Sequence[Slider]:
        """What the sliders of flexibility modes are told."""
        return sliders_of(self.state)


class Kept:
    """Values by key, the last `most`; each is made once, by the worker that asks first."""

    def __init__(self, most: int = KEPT) -> None:
        self._most = most
        self._values: OrderedDict[object, tuple[threading.Lock, list[object]]] = OrderedDict()
        self._lock = threading.Lock()

    def get(self, key: object, make: Callable[[], _T]) -> _T:
        """The value at `key`; if `make` fails nothing is kept, and the next who asks tries again."""
        with self._lock:
            one, made = self._values.setdefault(key, (threading.Lock(), []))
            self._values.move_to_end(key)
            while len(self._values) > self._most:
                self._values.popitem(last=False)
        with one:
            if not made:
                made.append(make())
            return made[0]  # pyright: ignore[reportReturnType] - what `make` of this key made


_KEPT = Kept()


def drawn(state: ViewState, draft: bool, rested: ViewState | None) -> Drawn:
    """A state as all browsers show it; `rested`: what this one showed in full last, which a draft may need."""
    # No picture depends on whose eyes they are, words on the language that is spoken
    state = for_eyes_of(state, DEFAULT)
    if not draft:
        return _KEPT.get(
            (state, language(), None), lambda: Drawn(state, frame(state, with_curves=False), False)
        )
    before = None if rested is None or not _asks(state) else for_eyes_of(rested, DEFAULT)
    return _KEPT.get(
        (state, language(), before, "draft"),
        lambda: Drawn(state, pipeline.draft(state, before), True),
    )


def _asks(state: ViewState) -> bool:
    """Whether a draft of a state depends on what was shown before."""
    return state.draw is not None or state.extreme is not None or state.surface == "spread"
