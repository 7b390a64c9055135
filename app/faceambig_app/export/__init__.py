"""A state as a file: picture, mesh, numbers, the state itself, an animation, or a page to play with."""

from .making import KINDS, files, state_file
from .meshes import MESHES, mesh_of
from .numbers import along_distance, numbers_of, numbers_of_face, source_of
from .pictures import SCALES, Progress, picture_of, snapshot
from .provenance import file_name, shown

__all__ = [
    "KINDS", "MESHES", "SCALES", "Progress", "along_distance", "file_name", "files", "mesh_of", "numbers_of",
    "numbers_of_face", "picture_of", "shown", "snapshot", "source_of", "state_file",
]  # fmt: skip
