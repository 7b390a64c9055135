"""The page in a process of its own, for `page.py` and `churn.py`: they see it from outside and ask it for its figures.

`running(stages=...)` starts it. It prints its address; each line on its input is answered by one line of JSON, and it
ends with its input. "stages": what each stage took since the last such line. "state": what is held, after a collection.
"""

from __future__ import annotations

import asyncio
import contextlib
import ctypes
import functools
import gc
import importlib
import inspect
import json
import os
import subprocess
import sys
import threading
import time
import types
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

APP = "faceambig_app"
# Stage -> functions that do it; "*" for all of a module. What one calls of another stage is the other's.
STAGES = {
    "hear": ("guard.messages._checked", "browser.Browser.change"),
    "fit": ("pipeline.fits._fit", "pipeline.fits._of_outline", "pipeline.fits.photograph"),
    "compose": ("pipeline.scenes.scene_of",),
    "sweep, posterior": (
        "pipeline.faces._curve",
        "pipeline.likely.posterior",
        "pipeline.likely.bending",
    ),
    "figures": (
        "markup.figures.*",
        "markup.photograph.*",
        "markup.plots.*",
        "pipeline.told.*",
        "pipeline.scenes.photo_jpeg",
    ),
    "stage": ("stage.Stage.show",),
}


class Stages:
    """Time in each stage, by a stack a thread: what is inside another stage counts once."""

    def __init__(self) -> None:
        self._lock, self._here = threading.Lock(), threading.local()
        self._taken: dict[str, list[float]] = {}
        self._since = time.process_time()

    def timed(self, stage: str, run: Callable[..., Any]) -> Callable[..., Any]:
        """`run`, counted as part of a stage."""

        @functools.wraps(run)
        def wrapped(*arguments: Any, **options: Any) -> Any:
            stack = self._here.__dict__.setdefault("stack", [])
            first = not any(name == stage for name, _ in stack)
            cpu, wall = time.thread_time(), time.perf_counter()
            inner = [0.0, 0.0]
            stack.append((stage, inner))
            try:
                return run(*arguments, **options)
            finally:
                cpu, wall = time.thread_time() - cpu, time.perf_counter() - wall
                stack.pop()
                if stack:
                    stack[-1][1][0] += cpu
                    stack[-1][1][1] += wall
                with self._lock:
                    taken = self._taken.setdefault(stage, [0.0, 0.0, 0])
                    taken[0] += cpu - inner[0]
                    taken[1] += wall - inner[1]
                    taken[2] += first

        return wrapped

    def told(self) -> dict[str, Any]:
        """Stage -> [CPU seconds, wall seconds, calls] since the last time, and all CPU seconds of the process."""
        with self._lock:
            taken, self._taken = self._taken, {}
        since, self._since = self._since, time.process_time()
        return {"stages": taken, "cpu": self._since - since}

    def install(self) -> None:
        """Put the timers into the page, and into viser where it packs and sends."""
        for stage, places in STAGES.items():
            for place in places:
                for owner, name in _functions(place):
                    _replace(owner, name, self.timed(stage, getattr(owner, name)))
        from asyncio import selector_events

        import msgspec
        import zstandard
        from viser.infra import _infra, _messages

        message = _messages.Message
        message.as_serializable_dict = self.timed("pack", message.as_serializable_dict)
        encode = self.timed("pack", msgspec.msgpack.encode)

        def compressor(level: int) -> Any:  # the real one is of C and takes no other method
            return types.SimpleNamespace(
                compress=self.timed("pack", zstandard.ZstdCompressor(level).compress)
            )

        hooked: Any = _infra
        hooked.msgspec = types.SimpleNamespace(msgpack=types.SimpleNamespace(encode=encode))
        hooked.zstandard = types.SimpleNamespace(ZstdCompressor=compressor)
        transport: Any = selector_events._SelectorSocketTransport  # pyright: ignore[reportAttributeAccessIssue]
        transport.write = self.timed("send", transport.write)


def _functions(place: str) -> Iterator[tuple[Any, str]]:
    """(owner, name) of what a place of STAGES names."""
    module, *path, last = place.split(".")
    owner: Any = importlib.import_module(f"{APP}.{module}")
    for name in path:
        owner = getattr(owner, name)
    if last != "*":
        yield owner, last
        return
    for name, value in list(vars(owner).items()):
        if inspect.isfunction(value) and value.__module__ == owner.__name__:
            yield owner, name


def _replace(owner: Any, name: str, by: Any) -> None:
    """Set it there, and in all modules of the page that have imported it."""
    before = getattr(owner, name)
    setattr(owner, name, by)
    for module in [m for n, m in sys.modules.items() if n.startswith(APP)]:
        for alias in [a for a, value in vars(module).items() if value is before]:
            setattr(module, alias, by)


def held(page: Any) -> dict[str, int]:
    """What the process holds, memory in bytes; garbage and freed pages are given back first."""
    gc.collect()
    with contextlib.suppress(OSError, AttributeError):  # other C libraries keep what is freed
        ctypes.CDLL("libc.so.6").malloc_trim(0)
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return {
        "resident": pages * os.sysconf("SC_PAGE_SIZE"),
        "descriptors": len(os.listdir("/proc/self/fd")),  # noqa: PTH208 - numbers, not paths
        "threads": threading.active_count(),
        "tasks": len(asyncio.all_tasks(page._server.get_event_loop())),
        "browsers": len(page._browsers),
        "objects": len(gc.get_objects()),
    }


def main() -> None:
    """Serve until the input ends."""
    from faceambig_app import guard, server

    stages = Stages()
    if "--stages" in sys.argv[1:]:
        stages.install()
    present = "--present" in sys.argv[1:]
    page = server.Page("127.0.0.1", 0, lead=guard.make_token() if present else None)
    print(page.address, page.leader_link or "", flush=True)
    for line in sys.stdin:
        told = stages.told() if line.strip() == "stages" else held(page)
        print(json.dumps(told), flush=True)
    page.close()


class Server:
    """The other process, seen from here."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process
        self.address, _, leader = self._line().strip().partition(" ")
        self.leader = leader or None  # link of who leads

    def ask(self, what: str) -> dict[str, Any]:
        """Its answer to "stages" or "state"."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{what}\n")
        self._process.stdin.flush()
        return json.loads(self._line())

    def cpu_seconds(self) -> float:
        """CPU time of the process until now."""
        stat = Path(f"/proc/{self._process.pid}/stat").read_text(encoding="ascii")
        user, system = stat.rpartition(")")[2].split()[11:13]
        return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")

    def _line(self) -> str:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError("the page has ended: its errors are above")
        return line


@contextlib.contextmanager
def running(*, stages: bool = False, present: bool = False) -> Iterator[Server]:
    """The page on a free port, ended afterwards; `present`: of a class.

    The timers of `stages` cost some microseconds a call.
    """
    flags = ["--stages"] * stages + ["--present"] * present
    command = [sys.executable, __file__, *flags]
    with subprocess.Popen(  # noqa: S603 - this file
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            yield Server(process)
        finally:
            assert process.stdin is not None
            process.stdin.close()
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()


if __name__ == "__main__":
    main()
