"""The two faces of faceambig: the page and the command line, over one ViewState."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .state import ViewState

if TYPE_CHECKING:
    from .export import snapshot

__all__ = ["ViewState", "snapshot"]


def __getattr__(name: str) -> Any:
    # `snapshot` pulls in NumPy, OpenCV and the renderer; a state alone must not
    if name == "snapshot":
        from .export import snapshot

        return snapshot
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
