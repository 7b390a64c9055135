"""Export: what is shown as a file, and a state from one. What is pressed is ordered; it is no change of the state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from html import escape
from typing import Any, NamedTuple, Protocol

import viser
from viser._gui_handles import GuiProgressBarHandle

from ..guard import add_upload
from ..text import say
from .explore import folder
from .flex import LETTERS
from .widgets import Listener, Widgets

STATES = ".json"  # what the browser offers to open
SCALES = (1, 2, 4)
MESHES = ("ply", "obj", "glb")


class Does(Protocol):
    """What the tab's buttons do."""

    def save(self, kind: str, **options: Any) -> None:
        """Order a file, as `export.files` takes it."""

    def stop(self) -> None:
        """Take the order back."""

    def open(self, name: str, data: bytes) -> None:
        """Go to the state of a file."""


class Shown(NamedTuple):
    """How far the file is."""

    words: str = ""
    done: float = 0.0  # 0 to 1
    busy: bool = False  # whether there is something to stop


@dataclass(frozen=True, slots=True)
class Export:
    """The widgets that tell how far the file is."""

    words: viser.GuiHtmlHandle
    bar: GuiProgressBarHandle
    stop: viser.GuiButtonHandle

    def show(self, shown: Shown) -> None:
        """Write what is; on the event loop only."""
        words = escape(shown.words).replace("_", "_<wbr>")  # names of files are long
        words = f'<div class="fa"><p role="status">{words}</p></div>'
        self.words.content = words if shown.words else ""
        self.bar.value = 100.0 * shown.done
        self.bar.visible = self.stop.visible = shown.busy


def build(w: Widgets, does: Does) -> Export:
    """The tab."""
    own = w.gui.add_checkbox(say("export.own"), False, visible=False, hint=say("export.own_hint"))
    w.watch(lambda state: state.subject == "photo", lambda own_photo: _offer(own, own_photo))

    def with_own() -> dict[str, bool]:
        return {"own_photo": True} if own.visible and own.value else {}

    _build_picture(w, does, with_own)
    _build_mesh(w, does)
    _build_numbers(w, does)
    _build_moving(w, does, with_own)
    w.actions("copy", ("copy_link", "copy_command"))
    words = w.gui.add_html("")
    bar = w.gui.add_progress_bar(0.0, visible=False, color="blue")
    stop = w.gui.add_button(say("export.stop"), visible=False, hint=say("export.stop_hint"))
    stop.on_click(_pressed(lambda _: does.stop()))
    return Export(words, bar, stop)


def _offer(own: viser.GuiCheckboxHandle, own_photo: bool) -> None:
    own.visible = own_photo


def _build_picture(w: Widgets, does: Does, with_own: Callable[[], dict[str, bool]]) -> None:
    scales = {say("export.scale", scale=scale): scale for scale in SCALES}
    with w.gui.add_folder(say("export.picture")):
        size = w.gui.add_dropdown(
            say("export.size"), tuple(scales), initial_value=next(iter(scales)), hint=say("export.size_hint")
        )  # fmt: skip
        words = w.gui.add_checkbox(say("export.overlays"), True, hint=say("export.overlays_hint"))
        clear = w.gui.add_checkbox(
            say("export.transparent"), False, hint=say("export.transparent_hint")
        )
        save = w.gui.add_button(say("export.save_picture"), hint=say("export.save_picture_hint"))

    def order(_: object) -> None:
        does.save(
            "png", scale=scales[size.value], transparent=clear.value, overlays=words.value, **with_own()
        )  # fmt: skip

    save.on_click(_pressed(order))


def _build_mesh(w: Widgets, does: Does) -> None:
    faces = {say("head.fit"): "fit", say("head.true"): "true"}
    kinds = {kind.upper(): kind for kind in MESHES}
    with folder(w, "mesh"):
        face = w.gui.add_dropdown(say("export.face"), tuple(faces), initial_value=next(iter(faces)))
        save = w.gui.add_button_group(
            say("export.save_mesh"), tuple(kinds), hint=say("export.save_mesh_hint")
        )
    save.on_click(_pressed(lambda kind: does.save(kinds[kind], face=faces[face.value])))


def _build_numbers(w: Widgets, does: Does) -> None:
    kinds = {"CSV": "csv", "JSON": "json"}
    with folder(w, "numbers"):
        numbers = w.gui.add_button_group(
            say("export.save_numbers"), tuple(kinds), hint=say("export.save_numbers_hint")
        )
        state = w.gui.add_button(say("export.save_state"), hint=say("export.save_state_hint"))
        add_upload(
            w.gui, say("export.open_state"), STATES, does.open, hint=say("export.open_state_hint")
        )
    numbers.on_click(_pressed(lambda kind: does.save(kinds[kind])))
    state.on_click(_pressed(lambda _: does.save("state")))


def _build_moving(w: Widgets, does: Does, with_own: Callable[[], dict[str, bool]]) -> None:
    """The way of the distance or of a mode: a page has all modes, a picture one."""
    modes = {
        say("player.mode", letter=letter): mode for mode, letter in enumerate(LETTERS, start=1)
    }
    whats = {say("field.distance"): 0, **modes}
    kinds = {say("export.page"): "html", "WebP": "webp", "GIF": "gif"}
    with folder(w, "moving"):
        what = w.gui.add_dropdown(
            say("export.what"), tuple(whats), initial_value=next(iter(whats)), hint=say("export.what_hint")
        )  # fmt: skip
        save = w.gui.add_button_group(
            say("export.save_moving"), tuple(kinds), hint=say("export.save_moving_hint")
        )

    def order(option: str) -> None:
        kind, mode = kinds[option], whats[what.value]
        moves = "mode" if mode else "distance"
        if kind == "html":
            does.save(kind, whats=(moves,), **with_own())
        elif mode:
            does.save(kind, what=moves, mode=mode, **with_own())
        else:
            does.save(kind, what=moves, **with_own())

    save.on_click(_pressed(order))


def _pressed(do: Callable[[Any], None]) -> Listener:
    async def listener(event: viser.GuiEvent[Any]) -> None:  # async: on the loop
        if event.client_id is not None:
            do(event.target.value)

    return listener
