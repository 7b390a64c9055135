"""Panels: taking away what a browser's panels hold, to make it anew in other words."""

from __future__ import annotations

from collections.abc import Collection

import viser


def clear(gui: viser.GuiApi, keep: Collection[str] = ()) -> None:
    """Remove a browser's panels, elements and commands, but the elements with the identifiers `keep`.

    viser's own `reset` would take those too, and with them the control through which the page's script reports.
    """
    root = gui._container_handle_from_uuid["root"]
    for uuid, element in list(root._children.items()):
        if uuid not in keep:
            element.remove()
    for panel in list(gui._panel_handle_from_uuid.values()):
        panel.remove()
    for entry in list(gui._command_handle_from_uuid.values()):
        entry.remove()
