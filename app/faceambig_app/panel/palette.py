"""The palette: every action of the table as a command of viser's, with its words and its key."""

from __future__ import annotations

from collections.abc import Callable, Collection, Coroutine
from typing import Any

import viser

from ..state.actions import ACTIONS
from ..text import say


def register(gui: viser.GuiApi, act: Callable[[str], None], without: Collection[str] = ()) -> None:
    """Offer the actions in one browser, but those `without`; `act` does one by its name."""
    for action in ACTIONS.values():
        if action.name in without:
            continue
        entry = gui.add_command(
            say(f"action.{action.name}"),
            description=say(f"action.{action.name}_hint"),
            hotkey=action.key,
            modifier=action.modifier,
        )
        entry.on_trigger(_triggered(act, action.name))


def _triggered(act: Callable[[str], None], name: str) -> Callable[[Any], Coroutine[Any, Any, None]]:
    async def triggered(_event: Any) -> None:  # on the loop, in message order
        act(name)

    return triggered
