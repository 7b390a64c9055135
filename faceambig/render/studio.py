"""The one thread that draws with OpenGL, and the software renderer it finds: OSMesa or EGL.

An EGL context works only in the thread that made it, and deleting one EGL renderer ends all others. pyrender is
imported by the first picture, in that thread.
"""

from __future__ import annotations

import atexit
import ctypes
import os
import queue
import threading
from collections.abc import Callable
from concurrent.futures import Future
from functools import cache
from typing import Any, TypeVar

from .mends import import_pyrender

T = TypeVar("T")
LIBRARIES = {"osmesa": ("libOSMesa.so.8",), "egl": ("libEGL.so.1", "libGL.so.1")}
INSTALL = "sudo apt-get install libegl1 libgl1 libgl1-mesa-dri libosmesa6"
# Frames of one OSMesa renderer: it loses 2 to 7 MB a frame and gives them back when it is deleted.
FRAMES = 20


class NoRendererError(RuntimeError):
    """No software OpenGL on this machine; the message says what to install."""


def renderer_name() -> str:
    """'osmesa' or 'egl': the one FACEAMBIG_RENDERER names, else the first whose libraries load."""
    forced = os.environ.get("FACEAMBIG_RENDERER", "")
    if forced and forced not in LIBRARIES:
        raise NoRendererError(
            f"FACEAMBIG_RENDERER: {forced!r} is not one of {', '.join(LIBRARIES)}"
        )
    for name in [forced] if forced else LIBRARIES:
        if all(map(loads, LIBRARIES[name])):
            return name
    raise NoRendererError(f"no software renderer: {INSTALL}")


def loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


class Studio:
    """The render thread and its renderer; `call` runs a job there and returns what it returns."""

    def __init__(self, name: str) -> None:
        self.name = name  # "osmesa" or "egl"
        self._jobs: queue.SimpleQueue[tuple[Callable[[Any, Any], Any], Future[Any]] | None] = (
            queue.SimpleQueue()
        )
        # A daemon: a picture that hangs must not keep the program alive. close() lets it end in good order.
        self._thread = threading.Thread(target=self._work, name="faceambig-render", daemon=True)
        self._thread.start()

    def call(self, job: Callable[[Any, Any], T]) -> T:
        """job(pyrender, renderer) run in the render thread; what it raises is raised here."""
        future: Future[T] = Future()
        self._jobs.put((job, future))
        return future.result()

    def close(self) -> None:
        """Free the renderer in its own thread and end that."""
        self._jobs.put(None)
        self._thread.join(timeout=10)

    def _work(self) -> None:
        pyrender = renderer = None
        frames = 0
        while (item := self._jobs.get()) is not None:
            job, future = item
            try:
                pyrender = pyrender or import_pyrender(self.name)
                if renderer is not None and frames >= FRAMES and self.name == "osmesa":
                    renderer.delete()
                    renderer = None
                if renderer is None:
                    renderer, frames = pyrender.OffscreenRenderer(64, 64), 0
                frames += 1
                future.set_result(job(pyrender, renderer))
            except BaseException as error:  # noqa: BLE001 - raised again in the thread that asked
                future.set_exception(error)
            del item, job, future  # else the last picture is kept until the next
        if renderer is not None:
            renderer.delete()


@cache
def studio() -> Studio:
    made = Studio(renderer_name())
    atexit.register(made.close)
    return made
