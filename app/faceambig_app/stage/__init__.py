"""A Scene as nodes of viser in one browser, and where that browser looks from. Nothing is computed here."""

from .stage import Stage
from .viewer import FAR, FIRST_FOV, FIRST_POSITION, NEAR

__all__ = ["FAR", "FIRST_FOV", "FIRST_POSITION", "NEAR", "Stage"]
