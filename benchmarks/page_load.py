"""Load: many tabs drag one slider, and every mesh that comes is asked which of their values it shows.

A book of the slider's values is made first by calm tabs, one value at a time from rest: a mesh is known by some of its
vertices. In a drag no value comes twice in seconds, so a mesh answers the last time its value was sent. A mesh of no
value is wrong; one that shows an older value than the one before has gone backward; a message without any later mesh of
its value or a newer one is lost.
"""

from __future__ import annotations

import asyncio
import contextlib
import random
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from page_tab import Mesh, Tab, opened, rows_of

SLIDER, HEAD = "Assumed distance", "/fit/"
VALUES = 31  # of the slider, evenly
DRAG = 2.0  # seconds; then a rest until the page is quiet
QUIET = 0.6  # seconds without a mesh: it rests, and has drawn in full
SAME = 1e-6  # metres: float32 of a head
PATIENCE = 30.0  # seconds for anything


class Sent(NamedTuple):
    """A value on its way."""

    at: float
    value: int  # number in the book


@dataclass
class Book:
    """The meshes of every value."""

    values: list[int]
    known: dict[int, np.ndarray]  # vertices of a mesh -> (K, 192) some of them, metres

    def value(self, mesh: Mesh) -> int | None:
        """Number of the value whose mesh this is."""
        known = self.known.get(mesh.n_vertices)
        if known is None:
            return None
        apart = np.abs(known - mesh.rows).max(axis=1)
        nearest = int(apart.argmin())
        return nearest if apart[nearest] <= SAME else None


@dataclass
class Drag:
    """One hand, from the first value to rest."""

    sent: list[Sent] = field(default_factory=list)
    meshes: list[Mesh] = field(default_factory=list)


@dataclass
class Told:
    """What some drags were like."""

    lags: list[float] = field(default_factory=list)  # seconds, from every message
    ends: list[float] = field(default_factory=list)  # of the last messages alone
    wrong: int = 0
    backward: int = 0
    lost: int = 0

    def add(self, drag: Drag, book: Book) -> None:
        """Take in one drag."""
        shown: list[tuple[float, int]] = []  # when, which message
        for mesh in drag.meshes:
            value = book.value(mesh)
            before = [
                n for n, sent in enumerate(drag.sent) if sent.value == value and sent.at < mesh.at
            ]
            if not before:
                self.wrong += 1
            elif shown and before[-1] < shown[-1][1]:
                self.backward += 1
            else:
                shown.append((mesh.at, before[-1]))
        at = 0
        for number, sent in enumerate(drag.sent):
            while at < len(shown) and shown[at][1] < number:
                at += 1
            if at == len(shown):
                self.lost += 1
                continue
            self.lags.append(shown[at][0] - sent.at)
            if number == len(drag.sent) - 1:
                self.ends.append(self.lags[-1])


@dataclass
class Row:
    """The figures of one row: `clients` tabs at `hertz`."""

    clients: int
    hertz: float
    told: Told
    sent: int
    meshes: int
    slowest: float  # meshes a second of the tab that got least, while dragging
    shared: int  # meshes that reached a tab that changed nothing
    seconds: float  # of dragging, each tab
    sizes: Counter[str]  # bytes by kind of message
    server_cpu: float  # seconds
    own_cpu: float  # of this process

    @property
    def mbit(self) -> float:
        """Megabits a second: all bytes, those at rest too, over the time of dragging."""
        return 8e-6 * sum(self.sizes.values()) / self.seconds


async def learn(address: str) -> Book:
    """The meshes of the slider's values, by four calm tabs."""
    async with contextlib.AsyncExitStack() as stack:
        tabs = [await stack.enter_async_context(opened(address)) for _ in range(4)]
        props = tabs[0].controls[SLIDER].props
        values = sorted({round(x) for x in np.linspace(props["min"], props["max"], VALUES)})
        heads = dict(
            pair
            for found in await asyncio.gather(
                *(_calm(tab, values[n :: len(tabs)]) for n, tab in enumerate(tabs))
            )
            for pair in found
        )
        sizes = {mesh.n_vertices for tab in tabs for mesh in tab.meshes}
    # The coarse mesh of a hand is the first vertices of the fine one
    known = {n: np.stack([rows_of(heads[v][: 3 * n]) for v in values]) for n in sizes}
    return Book(values, known)


async def _calm(tab: Tab, values: Sequence[int]) -> list[tuple[int, np.ndarray]]:
    found = []
    full = max((n for n in tab.geometry if n.startswith(HEAD)), key=lambda n: len(tab.geometry[n]))
    for value in values:
        before = tab.geometry[full]
        await tab.set(SLIDER, value)
        if not await tab.until(lambda b=before: tab.geometry[full] is not b, PATIENCE):
            raise TimeoutError(f"{SLIDER} at {value}: no mesh in {PATIENCE:g} s")
        await tab.quiet(QUIET, PATIENCE)
        found.append((value, tab.geometry[full]))
    return found


async def drag(tab: Tab, book: Book, hertz: float, rng: random.Random) -> Drag:
    """A hand on the slider for DRAG seconds, up through the even values and down through the odd ones; then rest."""
    way = [*range(0, len(book.values), 2), *reversed(range(1, len(book.values), 2))]
    turn = rng.randrange(len(way))
    await asyncio.sleep(rng.random() / hertz)
    taken, before, start = Drag(), len(tab.meshes), time.perf_counter()
    for step in range(round(DRAG * hertz)):
        await asyncio.sleep(max(0.0, start + step / hertz - time.perf_counter()))
        value = way[(turn + step) % len(way)]
        taken.sent.append(Sent(await tab.set(SLIDER, book.values[value]), value))
    last, since = taken.sent[-1], time.perf_counter()

    def answered() -> bool:  # in full: else the mesh of this rest would come into the next drag
        came = (m for m in reversed(tab.meshes[before:]) if m.n_vertices == max(book.known))
        full = next(came, None)
        return full is not None and book.value(full) == last.value

    while await tab.until(answered, PATIENCE - (time.perf_counter() - since)):
        await tab.quiet(QUIET, PATIENCE)
        if answered():
            break
    taken.meshes = [mesh for mesh in tab.meshes[before:] if mesh.node.startswith(HEAD)]
    return taken


async def row(address: str, book: Book, clients: int, hertz: float, drags: int, cpu) -> Row:
    """Load the page; `cpu()` is the CPU time of its process, seconds."""
    async with contextlib.AsyncExitStack() as stack:
        silent = await stack.enter_async_context(opened(address))
        tabs: list[Tab] = []
        for _ in range(0, clients, 10):
            entering = (opened(address) for _ in range(min(10, clients - len(tabs))))
            tabs += await asyncio.gather(*map(stack.enter_async_context, entering))
        await asyncio.gather(*(tab.quiet(QUIET, PATIENCE) for tab in (silent, *tabs)))
        for tab in tabs:
            tab.sizes.clear()
        silent.meshes.clear()
        server_cpu, own_cpu = cpu(), time.process_time()
        hands = await asyncio.gather(
            *(_hand(tab, book, hertz, drags, n) for n, tab in enumerate(tabs))
        )
        server_cpu, own_cpu = cpu() - server_cpu, time.process_time() - own_cpu
        shared, lost = len(silent.meshes), [tab.lost for tab in (silent, *tabs) if tab.lost]
    if lost:
        raise ConnectionError(lost[0])
    told = Told()
    for each in _flat(hands):
        told.add(each, book)
    return Row(
        clients, hertz, told,
        sent=sum(len(each.sent) for each in _flat(hands)),
        meshes=sum(len(each.meshes) for each in _flat(hands)),
        slowest=min(_rate(each) for each in hands),
        shared=shared,
        seconds=sum(each.sent[-1].at - each.sent[0].at for each in _flat(hands)) / clients,
        sizes=sum((tab.sizes for tab in tabs), Counter()),
        server_cpu=server_cpu, own_cpu=own_cpu,
    )  # fmt: skip


async def _hand(tab: Tab, book: Book, hertz: float, drags: int, seed: int) -> list[Drag]:
    rng = random.Random(seed)  # noqa: S311 - a load, not a secret
    return [await drag(tab, book, hertz, rng) for _ in range(drags)]


def _flat(hands: Iterable[list[Drag]]) -> list[Drag]:
    return [each for hand in hands for each in hand]


def _rate(hand: list[Drag]) -> float:
    """Meshes a second while dragging."""
    seconds = sum(each.sent[-1].at - each.sent[0].at for each in hand)
    return sum(mesh.at <= each.sent[-1].at for each in hand for mesh in each.meshes) / seconds
