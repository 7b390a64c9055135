"""The class: what a browser is in it, how to go alone and come back; for who leads the link to give away, the answers
and a note to all.
"""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any, Protocol

import viser

from ..state.fields import tidy
from ..text import say
from .widgets import Widgets

NOTE_LENGTH = 160  # characters: two lines of large letters across a projector


@dataclass(frozen=True, slots=True)
class Shown:
    """What is shown of the class in one browser."""

    html: str = ""
    alone: bool = False  # it explores on its own, and may follow again
    hidden: bool = False  # it leads, and something is hidden that it may reveal
    may_take: bool = False  # it came by the leader's link, and another browser leads
    leads: bool = False
    note: str = ""  # of who leads
    strip: str = ""  # HTML: the note as all see it


class Does(Protocol):
    """What a seat does."""

    @property
    def may_lead(self) -> bool:
        """Whether this browser came by the leader's link."""
        ...

    def explore(self, alone: bool) -> None:
        """Go on alone, or be with the class again."""
        ...

    def note(self, words: str) -> None:
        """A note for the class."""
        ...

    def take(self) -> None:
        """Lead from here."""
        ...


class Classroom:
    """The widgets of the class."""

    def __init__(self, w: Widgets, does: Does, invitation: str) -> None:
        if does.may_lead:  # in an element of its own: what is open in it stays open
            w.gui.add_html(invitation)
        self._html, self._strip = w.gui.add_html(""), w.gui.add_html("")
        self._on: dict[str, bool] = {}
        self._alone = w.gui.add_checkbox(
            say("class.explore"), False, visible=False, hint=say("class.explore_hint")
        )
        self._alone.on_update(_heard(lambda: does.explore(self._alone.value)))
        self._again = _button(w.gui, say("class.again"), lambda: does.explore(False))
        self._note = w.gui.add_text(
            say("class.note"), "", visible=False, hint=say("class.note_hint", most=NOTE_LENGTH)
        )
        self._note.on_update(_heard(lambda: does.note(self._note.value)))
        self._take = _button(w.gui, say("class.take"), does.take)
        self._reveal = w.actions("class", ("reveal",), visible=False)

    def show(self, shown: Shown) -> None:
        """Write what is shown; on the event loop only."""
        if self._html.content != shown.html:
            self._html.content = shown.html
        if self._strip.content != shown.strip:
            self._strip.content = shown.strip
        if self._alone.value != shown.alone:
            self._alone.value = shown.alone
        # A space just typed is left for the next word
        if tidy(self._note.value, NOTE_LENGTH) != shown.note:
            self._note.value = shown.note
        self._see("alone", (self._alone,), not shown.leads)
        self._see("again", (self._again,), shown.alone)
        self._see("note", (self._note,), shown.leads)
        self._see("take", (self._take,), shown.may_take)
        self._see("reveal", (self._reveal,), shown.hidden)

    def _see(self, name: str, handles: Sequence[Any], on: bool) -> None:
        if self._on.get(name, False) != on:
            self._on[name] = on
            for handle in handles:
                handle.visible = on


def invitation(link: str, picture: str) -> str:
    """The link to give to a class, and its code (an <svg> element): small, and on a press over the whole page."""
    shown = escape(link)
    return (
        f'<div class="fa fa-room"><details open><summary>{escape(say("class.room"))}</summary>'
        f'<button type="button" popovertarget="fa-room" aria-label="{escape(say("class.larger"))}">{picture}</button>'
        f'<p class="fa-small">{shown}</p></details>'
        f'<div popover id="fa-room">{picture}<p>{shown}</p></div></div>'
    )


def _button(gui: viser.GuiApi, label: str, do: Callable[[], None]) -> viser.GuiButtonHandle:
    button = gui.add_button(label, visible=False)
    button.on_click(_heard(do))
    return button


def _heard(do: Callable[[], None]) -> Callable[[viser.GuiEvent[Any]], Coroutine[Any, Any, None]]:
    async def listener(event: viser.GuiEvent[Any]) -> None:  # on the loop, in message order
        if event.client_id is not None:
            do()

    return listener
