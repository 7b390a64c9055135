"""From a state to what is shown of it: photograph, fit, bend, posterior, scene. Kept; nothing is drawn."""

from .frames import Frame, draft, frame, plots_of

__all__ = ["Frame", "draft", "frame", "plots_of"]
