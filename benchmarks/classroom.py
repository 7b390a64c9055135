"""A class of 30: how long a step of who leads takes until the last follower has it, and what it costs.

Each step is a value of the distance slider that nobody has shown before, from rest; a follower has it when the fitted
head has come, as a draft or in full. Then a drag at 20 values a second: how long its last value takes. A computation
is a fit's scene put together (`scenes.scene_of`): of one step a draft and the full one, whoever many are shown it.

python benchmarks/classroom.py [--followers 30] [--steps 25]
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import time
import urllib.error
import urllib.request
from collections.abc import Sequence

import numpy as np
from page_load import HEAD, PATIENCE, QUIET, SLIDER
from page_server import Server, running
from page_tab import Tab, opened

PROMISED = 0.3  # seconds, p95
DRAG_VALUES, HERTZ = 40, 20.0


class _Stay(urllib.request.HTTPRedirectHandler):
    def redirect_request(self, *_args: object) -> None:
        return None


def cookie_of(link: str) -> str:
    """What a browser gets from the leader's link."""
    try:
        urllib.request.build_opener(_Stay).open(link)
    except urllib.error.HTTPError as answer:
        cookies = answer.headers.get_all("Set-Cookie") or []
        return "; ".join(cookie.partition(";")[0] for cookie in cookies)
    raise RuntimeError(f"{link} leads nowhere")


async def step(leader: Tab, followers: Sequence[Tab], value: int) -> np.ndarray:
    """(F,) seconds until each follower has the head of a value; afterwards all rest."""
    for tab in (leader, *followers):
        tab.meshes.clear()
    at = await leader.set(SLIDER, value)
    for tab in followers:
        if not await tab.until(lambda t=tab: first(t) is not None, PATIENCE):
            raise TimeoutError(
                f"{SLIDER} at {value}: a follower has no mesh in {PATIENCE:g} s {tab.lost}"
            )
    arrived = np.array([first(tab) or np.nan for tab in followers]) - at
    await rest((leader, *followers))
    return arrived


def first(tab: Tab) -> float | None:
    """When the fitted head came first, seconds."""
    return next((mesh.at for mesh in tab.meshes if mesh.node.startswith(HEAD)), None)


async def rest(tabs: Sequence[Tab]) -> None:
    """Until all have the same full heads and nothing comes any more."""
    end = time.perf_counter() + PATIENCE
    while time.perf_counter() < end:
        await asyncio.gather(*(tab.quiet(QUIET, PATIENCE) for tab in tabs))
        heads = [tab.geometry[f"{HEAD}head"] for tab in tabs]
        if all(np.array_equal(head, heads[0]) for head in heads):
            return
    raise TimeoutError(f"the followers do not have the leader's head in {PATIENCE:g} s")


async def drag(leader: Tab, followers: Sequence[Tab], values: Sequence[int]) -> float:
    """Seconds from the last value of a drag until the last follower has it in full."""
    at = start = time.perf_counter()
    for n, value in enumerate(values):
        await asyncio.sleep(max(0.0, start + n / HERTZ - time.perf_counter()))
        at = await leader.set(SLIDER, value)
    await rest((leader, *followers))
    full = f"{HEAD}head"
    return max(max(m.at for m in tab.meshes if m.node == full) for tab in followers) - at


async def run(server: Server, link: str, count: int, steps: int) -> None:
    """All of it."""
    async with contextlib.AsyncExitStack() as stack:
        leader = await stack.enter_async_context(opened(server.address, cookie=cookie_of(link)))
        followers: list[Tab] = []
        for _ in range(0, count, 10):
            entering = (opened(server.address) for _ in range(min(10, count - len(followers))))
            followers += await asyncio.gather(*map(stack.enter_async_context, entering))
        await rest((leader, *followers))
        props = leader.controls[SLIDER].props
        values = np.linspace(props["min"] + 1, props["max"] - 1, steps + DRAG_VALUES)
        order = np.random.default_rng(0).permutation(np.unique(values.round().astype(int)))
        server.ask("stages")
        cpu, own = server.cpu_seconds(), time.process_time()
        took = np.array([await step(leader, followers, int(value)) for value in order[:steps]])
        cpu, own = server.cpu_seconds() - cpu, time.process_time() - own
        told = server.ask("stages")["stages"]
        last = took.max(axis=1)
        p50, p95 = 1e3 * np.percentile(last, [50, 95])
        print(
            f"{count} followers, {len(last)} steps from rest, on {len(followers) + 1} connections"
        )
        print(
            f"to the last follower: median {p50:.0f} ms, p95 {p95:.0f} ms (promised: {1e3 * PROMISED:.0f} ms)"
        )
        print(f"to the first follower: median {1e3 * np.median(took.min(axis=1)):.0f} ms")
        composed = told.get("compose", (0, 0, 0))[2] / len(last)
        print(f"computations: {composed:.2f} a step (2: a draft, and the full one at rest)")
        print(
            f"CPU a step: server {1e3 * cpu / len(last):.0f} ms, this load {1e3 * own / len(last):.0f} ms"
        )
        ends = await drag(leader, followers, [int(v) for v in np.sort(order[steps:])])
        print(
            f"a drag at {HERTZ:g} values a second: the last follower rests {1e3 * ends:.0f} ms after its last value"
        )


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--followers", type=int, default=30)
    parser.add_argument("--steps", type=int, default=25)
    options = parser.parse_args()
    with running(stages=True, present=True) as server:
        assert server.leader is not None
        asyncio.run(run(server, server.leader, options.followers, options.steps))


if __name__ == "__main__":
    main()
