"""Data: a person's own photograph and its points. What is pressed goes to the photograph's room, not to the state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from html import escape
from typing import NamedTuple, Protocol

import viser

from ..guard import add_upload
from ..text import centimetres, say
from .widgets import Widgets

PICTURES = ",".join(f"image/{kind}" for kind in ("png", "jpeg", "webp"))
Button = viser.GuiButtonHandle | viser.GuiButtonGroupHandle

POINTS = ",".join((".pts", ".csv", ".txt", ".json"))
HERE = "\0"  # where an element stands in words


class Does(Protocol):
    """What the tab's buttons do."""

    def take(self, name: str, data: bytes) -> None: ...
    def read_points(self, name: str, data: bytes) -> None: ...
    def find(self) -> None: ...
    def begin(self) -> None: ...
    def more(self) -> None: ...
    def skip(self) -> None: ...
    def undo(self) -> None: ...
    def closer(self, on: bool) -> None: ...
    def remove(self) -> None: ...


class Shown(NamedTuple):
    """What the tab shows."""

    photo: bool  # whether there is one
    asked: bool = False  # whether a point is to be placed
    status: str = ""  # in words: what was done, what is missing
    more: bool = False  # whether further points could be placed
    undo: bool = False  # whether there is a step to take back
    hint: float | None = None  # metres: of the camera as the file tells it


@dataclass(frozen=True, slots=True)
class Data:
    """The widgets of the tab."""

    status: viser.GuiHtmlHandle
    hint: viser.GuiButtonHandle
    of_photo: tuple[Button, ...]  # seen while there is a photograph
    of_asked: tuple[Button, ...]  # while a point is asked for
    more: viser.GuiButtonHandle
    undo: viser.GuiButtonHandle
    points: viser.GuiUploadButtonHandle  # seen while there is a photograph
    # A style that hides it: viser draws a button of uploads even if it is not visible
    without: viser.GuiHtmlHandle

    def show(self, shown: Shown) -> None:
        """Write what is; on the event loop only."""
        lines = shown.status or ("" if shown.photo else say("own.none"))
        self.status.content = f'<div class="fa"><p>{escape(lines)}</p></div>' if lines else ""
        for handle in self.of_photo:
            handle.visible = shown.photo
        for handle in self.of_asked:
            handle.visible = shown.asked
        # Asked by the guard, which takes no file for what is not visible
        self.points.visible = shown.photo
        self.without.content = "" if shown.photo else _hidden(self.points)
        self.more.visible, self.undo.visible = shown.more, shown.undo
        self.hint.visible = shown.hint is not None
        if shown.hint is not None:
            self.hint.label = say("own.hint", distance=centimetres(shown.hint))


def build(w: Widgets, does: Does, use_hint: Callable[[], None]) -> Data:
    """The tab. The words on what becomes of a photograph stand before the button that sends it."""
    host = f"<span data-fa-host>{escape(say('own.host'))}</span>"
    privacy = escape(say("own.privacy", host=HERE)).replace(HERE, host)
    w.gui.add_html(f'<div class="fa"><p>{privacy}</p></div>')
    add_upload(w.gui, say("own.photo"), PICTURES, does.take, hint=say("own.photo_hint"))
    status = w.gui.add_html("")
    skip = _button(w, "skip", does.skip)
    find, begin = _button(w, "find", does.find), _button(w, "begin", does.begin)
    more = _button(w, "more", does.more)
    points = add_upload(
        w.gui, say("own.points"), POINTS, does.read_points, hint=say("own.points_hint")
    )
    without = w.gui.add_html("")
    undo = _button(w, "undo", does.undo)
    face = say("own.face")
    part = w.gui.add_button_group(say("own.part"), (face, say("own.whole")))

    async def cut(event: viser.GuiEvent) -> None:
        if event.client_id is not None:
            does.closer(event.target.value == face)

    part.on_click(cut)
    hint = _button(w, "hint", use_hint)
    remove = _button(w, "remove", does.remove)
    data = Data(status, hint, (find, begin, part, remove), (skip,), more, undo, points, without)
    data.show(Shown(photo=False))
    return data


def _hidden(button: viser.GuiUploadButtonHandle) -> str:
    """A style: the button's box and what it holds are not there."""
    return f'<style>div:has(>[id="{button._impl.uuid}"]){{display:none}}</style>'


def _button(w: Widgets, name: str, do: Callable[[], None]) -> viser.GuiButtonHandle:
    handle = w.gui.add_button(say(f"own.{name}"), hint=say(f"own.{name}_hint"))

    async def pressed(event: viser.GuiEvent) -> None:  # async: on the loop, in message order
        if event.client_id is not None:
            do()

    handle.on_click(pressed)
    return handle
