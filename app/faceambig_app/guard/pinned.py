"""The one viser that the hooks fit: its version, and by name every private part that they take hold of.

Imported before the parts themselves: another viser is refused in words, not by the first name that it lacks.
"""

from __future__ import annotations

import importlib
from functools import reduce

import viser

VISER = "1.1.1"

_HANDLES = (
    "ButtonGroup", "Button", "Checkbox", "Dropdown", "MultiSlider", "Number", "Rgb", "Rgba", "Slider", "Text",
    "UploadButton",
)  # fmt: skip
PARTS = (
    "infra._infra:websockets.asyncio.server.serve", "infra._infra:_message_consumer",
    "infra._infra:_message_producer", "infra._infra:WebsockMessageHandler._handle_incoming_message",
    "infra._async_message_buffer:AsyncMessageBuffer", "_client_autobuild:ensure_client_is_built",
    "_assignable_props_api:AssignablePropsBase._cast_value_recursive",
    "_assignable_props_api:AssignablePropsBase._prop_hints",
    "_gui_api:GuiApi._handle_gui_updates", "_gui_api:GuiApi._handle_file_transfer_start",
    "_gui_api:GuiApi._handle_file_transfer_part", "_gui_api:GuiApi._resolve_client",
    "_gui_api:print_threadpool_errors", "_gui_handles:UploadedFile",
    "_messages:FileTransferPart", "_messages:FileTransferPartAck", "_messages:FileTransferStartDownload",
    "_messages:GuiUpdateMessage", "_messages:Message.deserialize", "_scene_api:print_threadpool_errors",
    "_viser:ViserTunnel", "_viser:print_threadpool_errors",
    *(f"_gui_handles:Gui{kind}Handle" for kind in _HANDLES),
)  # fmt: skip


class ServeError(RuntimeError):
    """The page cannot be served: one line, what is wrong and what helps."""


def check_viser() -> None:
    """Refuse another viser, and one in which a part is not where it was."""
    if viser.__version__ != VISER:
        raise ServeError(
            f"viser {viser.__version__}: the page needs {VISER}: pip install viser=={VISER}"
        )
    for part in PARTS:
        module, _, name = part.partition(":")
        try:
            reduce(getattr, name.split("."), importlib.import_module(f"viser.{module}"))
        except (ImportError, AttributeError):
            raise ServeError(
                f"viser {VISER}: {name} is not where it was: pip install --force-reinstall viser=={VISER}"
            ) from None


check_viser()
