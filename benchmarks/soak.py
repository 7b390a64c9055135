"""A long class: browsers that do this and that for an hour, and what of the server grows: `python benchmarks/soak.py`.

The server runs in a process of its own. Each browser is a websocket that moves sliders, presses buttons, changes the
person and the look, saves numbers, says nonsense, leaves, vanishes and comes back. Every few seconds memory,
descriptors, threads, asyncio tasks, rooms and blocks of Python's memory are counted in the server; meanwhile one more
browser moves its distance and waits for the heads. Memory alone is noise: what counts are slopes, each by least squares
over the time after the first fifth, with the slope's own error.

    --clients 20 --minutes 60 --pause 4 (mean seconds between two things that one browser does) --seed 1 --json FILE
"""

from __future__ import annotations

import argparse
import asyncio
import gc
import json
import os
import platform
import random
import subprocess
import sys
import threading
import time
import tomllib
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from websockets.exceptions import InvalidStatus
from wire import GONE, Wire

EVERY = 5.0  # seconds between two samples
SETTLED = 0.2  # of the time: until then caches fill
PATIENCE = 60.0  # seconds until an answer counts as none
COUNTED = ("rss_mb", "descriptors", "threads", "tasks", "rooms", "blocks", "answer_ms")
# Of each language: some people choose another
TEXTS = [
    tomllib.loads(path.read_text(encoding="utf-8"))
    for path in sorted((Path(__file__).resolve().parents[1] / "assets" / "text").glob("*.toml"))
]
# Label and button by which everything is as it was
RESETS = {text["field"]["history"]: text["action"]["reset"] for text in TEXTS}
# Left alone: hidden from view, made of a person's own photograph, or a minute's work of one line for all
LEFT_OUT = tuple(
    text[section][name]
    for text in TEXTS
    for section, name in (
        ("own", "find"), ("export", "save_picture"), ("export", "what"), ("export", "save_moving"),
    )
)  # fmt: skip


# ---------------------------------------------------------------- the server's process


def serve() -> None:
    """Serve the page; for each line that is read, write one with what is there."""
    from faceambig_app.server import Page

    page = Page("127.0.0.1", 0)
    print(json.dumps({"address": page.address}), flush=True)
    for _ in sys.stdin:
        print(json.dumps(counted(page)), flush=True)
    page.close()


def counted(page: Any) -> dict[str, float]:
    """What the server holds."""
    gc.collect()
    status = Path("/proc/self/status").read_text().split("VmRSS:")[1]
    loop = page._server.get_event_loop()
    return {
        "rss_mb": int(status.split()[0]) / 1024,
        "descriptors": len(os.listdir("/proc/self/fd")),  # noqa: PTH208 - names alone
        "threads": threading.active_count(),
        "tasks": len(asyncio.all_tasks(loop)),
        "rooms": len(page._browsers),
        "blocks": sys.getallocatedblocks(),
    }


# ---------------------------------------------------------------- browsers


class Person(threading.Thread):
    """One browser that does things until it is told to stop; when it has left or was cut off, it comes back."""

    def __init__(self, port: int, seed: int, pause: float, stopped: threading.Event) -> None:
        super().__init__(daemon=True)
        self.did: Counter[str] = Counter()
        self.errors: list[str] = []
        self._port, self._pause, self._stopped = port, pause, stopped
        self._rng = random.Random(seed)  # noqa: S311 - which button is pressed is no secret
        self._query = ""

    def run(self) -> None:
        """Come, do things, leave, come again."""
        while not self._stopped.is_set():
            try:
                wire = Wire(self._port, self._query)
            except (*GONE, InvalidStatus) as error:
                self.errors.append(f"not let in: {type(error).__name__}: {error}")
                self._wait(1.0)
                continue
            try:
                self.did["came"] += 1
                if wire.rests(PATIENCE):
                    self._visit(wire)
                else:
                    self.errors.append("no first frame")
            except GONE as error:
                self.did["was cut off"] += 1
                if not self._stopped.is_set() and "nonsense" not in self.did:
                    self.errors.append(f"{type(error).__name__}: {error}")
            except LookupError as error:
                self.errors.append(f"{type(error).__name__}: {error}")
            finally:
                with suppress(*GONE):
                    wire.close()
            self._wait(1.0)

    def _visit(self, wire: Wire) -> None:
        while not self._stopped.is_set():
            does, chance = self._rng.choice(ACTIONS), self._rng.random()
            if chance < 0.02:
                self.did["vanished"] += 1
                wire.vanish()
                return
            if chance < 0.04:
                self.did["left"] += 1
                return
            self.did[does.__name__] += 1
            does(self, wire, self._rng)
            self._query = wire.query or ""
            self._read_for(wire, self._rng.expovariate(1 / self._pause))

    def _read_for(self, wire: Wire, seconds: float) -> None:
        wire.wait(self._stopped.is_set, min(seconds, 60.0))

    def _wait(self, seconds: float) -> None:
        self._stopped.wait(seconds)

    def pick(self, wire: Wire, *kinds: str) -> tuple[str, dict[str, Any]] | None:
        """A control of one of the kinds that can be used; None if there is none."""
        found = [
            (uuid, made["props"])
            for uuid, made in wire.controls.items()
            if made["type"] in {f"Gui{kind}Message" for kind in kinds}
            and made["props"]["visible"]
            and not made["props"].get("disabled")
            and not made["props"]["label"].startswith(LEFT_OUT)
        ]
        return self._rng.choice(found) if found else None


def drag(person: Person, wire: Wire, rng: random.Random) -> None:
    """A slider to and fro for a second, as a hand does."""
    picked = person.pick(wire, "Slider")
    if picked is None:
        return
    uuid, props = picked
    low, high, step = props["min"], props["max"], props["step"]
    at = rng.uniform(low, high)
    for _ in range(30):
        at = min(high, max(low, at + rng.gauss(0, 0.05) * (high - low)))
        value = low + round((at - low) / step) * step
        wire.set(uuid, round(value) if isinstance(low, int) else min(high, value))
        wire.read(0.03)


def choose(person: Person, wire: Wire, rng: random.Random) -> None:
    """A button of a group, an item of a list, a box."""
    picked = person.pick(wire, "ButtonGroup", "Dropdown", "Checkbox", "Button")
    if picked is None:
        return
    uuid, props = picked
    options = [option for option in props.get("options") or () if option != "My photo"]
    if options:
        wire.set(uuid, rng.choice(options))
    else:
        wire.set(uuid, rng.random() < 0.5 if isinstance(wire.values.get(uuid), bool) else True)


def command(_person: Person, wire: Wire, rng: random.Random) -> None:
    """A command of the palette."""
    wire.trigger(rng.choice(wire.commands))


def reset(_person: Person, wire: Wire, _rng: random.Random) -> None:
    """Back to the first state, so that no browser stays where all is slow."""
    group, button = next(
        (found, button)
        for label, button in RESETS.items()
        if (found := wire.find("ButtonGroup", label)) is not None
    )
    wire.set(group, button)


def turn(_person: Person, wire: Wire, rng: random.Random) -> None:
    """The viewer, by hand."""
    from wire import CAMERA

    wire.report(hand=True)
    for _ in range(20):
        wire.send(CAMERA | {"position": (rng.gauss(0, 1), rng.gauss(0, 0.3), 3.0)})
        wire.read(0.02)


def nonsense(_person: Person, wire: Wire, rng: random.Random) -> None:
    """What no browser says."""
    wire.send(rng.randbytes(rng.randint(1, 2000)))
    wire.set(rng.choice(list(wire.controls)), float("nan"))
    wire.report(point={"index": 3, "x": 1.0, "y": 2.0, "done": True})


ACTIONS: list[Callable[[Person, Wire, random.Random], None]] = [
    *[drag] * 8, *[choose] * 6, *[command] * 2, *[turn] * 2, reset, nonsense,
]  # fmt: skip


# ---------------------------------------------------------------- measuring


class Watcher:
    """One more browser, whose answers are timed."""

    def __init__(self, port: int) -> None:
        self._wire = Wire(port)
        self._wire.rests(PATIENCE)
        self._slider = self._wire.control("Slider", "Assumed distance")
        self._value = 10

    def answer_ms(self) -> float:
        """From a slider's message to the heads it asks for; NaN if none came."""
        wire, self._value = self._wire, 60 - self._value
        wire.read(0.01)
        before, start = wire.meshes, time.monotonic()
        wire.set(self._slider, self._value)
        came = wire.wait(lambda: wire.meshes > before, PATIENCE)
        return 1000 * (time.monotonic() - start) if came else float("nan")

    def close(self) -> None:
        """Leave."""
        self._wire.close()


def slope(seconds: np.ndarray, values: np.ndarray) -> tuple[float, float]:
    """Growth per hour by least squares after the first fifth, and its standard error."""
    known = (seconds >= SETTLED * seconds[-1]) & np.isfinite(values)
    x, y = seconds[known] / 3600, values[known]
    if len(x) < 3:
        return float("nan"), float("nan")
    x = x - x.mean()
    rate = float(x @ y / (x @ x))
    rest = y - y.mean() - rate * x
    return rate, float(np.sqrt(rest @ rest / (len(x) - 2) / (x @ x)))


def table(samples: list[dict[str, float]]) -> list[str]:
    """A line for each thing counted: at a fifth, at the end, slope an hour with its error."""
    seconds = np.array([sample["seconds"] for sample in samples])
    lines = [f"{'':<14}{'at a fifth':>11}{'at the end':>12}{'slope an hour':>16}{'+-':>9}"]
    late = seconds >= SETTLED * seconds[-1]
    for name in COUNTED:
        values = np.array([sample[name] for sample in samples])
        tenth = max(1, int(late.sum()) // 10)
        known = values[late & np.isfinite(values)]  # an answer that never came is told below
        first, last = (float(np.median(part)) for part in (known[:tenth], known[-tenth:]))
        rate, error = slope(seconds, values)
        lines.append(f"{name:<14}{first:>11.1f}{last:>12.1f}{rate:>+16.1f}{error:>9.1f}")
    waits = np.array([sample["answer_ms"] for sample in samples])
    at = np.nanpercentile(waits, [50, 95, 100])
    lost = int(np.isnan(waits).sum())
    lines.append(
        f"answers: median {at[0]:.0f} ms, 95 % {at[1]:.0f} ms, longest {at[2]:.0f} ms; {lost} of {len(waits)} lost"
    )
    return lines


def main() -> int:
    """Run it; 1 if an answer was lost, the server ended or said something of its own."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--clients", type=int, default=20)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--pause", type=float, default=4.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.serve:
        serve()
        return 0
    with subprocess.Popen(  # noqa: S603 - this very file
        [sys.executable, __file__, "--serve"],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as server:  # fmt: skip
        try:
            return soak(options, server)
        finally:
            server.kill()


def soak(options: argparse.Namespace, server: subprocess.Popen[str]) -> int:
    """The whole of it, at a server that is there."""
    assert server.stdin is not None
    assert server.stdout is not None
    assert server.stderr is not None
    said: list[str] = []
    stderr = server.stderr
    threading.Thread(target=lambda: said.extend(stderr), daemon=True).start()
    address = json.loads(server.stdout.readline())["address"]
    port = int(address.rsplit(":", 1)[1].strip("/"))
    stopped = threading.Event()
    people = [
        Person(port, 1000 * options.seed + k, options.pause, stopped)
        for k in range(options.clients)
    ]
    for person in people:
        person.start()
    watcher, samples = Watcher(port), []
    start = time.monotonic()
    while (seconds := time.monotonic() - start) < 60 * options.minutes:
        waited = watcher.answer_ms()
        server.stdin.write("\n")
        server.stdin.flush()
        samples.append(
            json.loads(server.stdout.readline()) | {"seconds": seconds, "answer_ms": waited}
        )
        time.sleep(max(0.0, EVERY - (time.monotonic() - start - seconds)))
    stopped.set()
    for person in people:
        person.join(timeout=10)
    with suppress(*GONE):
        watcher.close()
    time.sleep(5)
    server.stdin.write("\n")
    server.stdin.flush()
    empty = json.loads(server.stdout.readline())
    did = sum((person.did for person in people), Counter())
    errors = [error for person in people for error in person.errors]
    print(f"{options.clients} browsers, {options.minutes:g} minutes, {os.cpu_count()} processors, Python "
          f"{platform.python_version()}")  # fmt: skip
    print("\n".join(table(samples)))
    print("they did:", ", ".join(f"{name} {count}" for name, count in did.most_common()))
    print("when all have left:", ", ".join(f"{k} {v:.0f}" for k, v in empty.items()))
    print(f"errors of browsers: {len(errors)}", *Counter(errors).most_common(5), sep="\n  ")
    traces = sum("Traceback" in line for line in said)
    print(f"the server's log: {len(said)} lines, {traces} tracebacks", *said[:5], sep="\n  ")
    if options.json:
        record = {"samples": samples, "did": did, "errors": errors, "log": said, "empty": empty}
        options.json.write_text(json.dumps(record, indent=1), encoding="utf-8")
    lost = any(np.isnan(sample["answer_ms"]) for sample in samples)
    return int(lost or traces > 0 or bool(errors))


if __name__ == "__main__":
    sys.exit(main())
