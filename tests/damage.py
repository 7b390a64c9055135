"""Damage, for the property tests of readers: bytes of a file changed, or a place of its JSON."""

from __future__ import annotations

import json
import tracemalloc
from collections.abc import Callable
from typing import Any

from hypothesis import settings
from hypothesis import strategies as st

# What readers stumble over: ends of ranges, other kinds, brackets without end, signs of other formats
TOKENS = (
    b"", b"0", b"-1", b"1e999", b"-1e-999", b"NaN", b"Infinity", b"null", b"true", b"9" * 20, b"9" * 5000, b"1" * 310,
    b"[", b"]", b"{", b"}", b'"', b"[" * 2000, b'{"a":' * 2000, b",", b":", b"\n", b"\r", b"\x00", b"\xff\xfe",
    b"\xef\xbb\xbf", b"\xed\xa0\x80", b"\\u0000", b"\\ud800", b"&", b"=", b"%", b"%ff",
    b"..", b"none", b"\xe2\x80\xae", b"\x1b[2J",
)  # fmt: skip

Change = tuple[int, int, bytes]  # where, how many bytes are taken out, what comes instead
PLAIN = (
    st.none()
    | st.booleans()
    | st.integers(-(10**30), 10**30)
    | st.floats()
    | st.text(max_size=6)
    | st.sampled_from([1e300, -1e300, 1e-300, 10**400, "nan", "\0", "\ud800", "x" * 3000, [], {}])
)
VALUES = st.recursive(
    PLAIN,
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=3)
    ),
    max_leaves=8,
)


def cases(number: int) -> settings:
    """So many examples of a test in the usual profile; in another one as many times more as that one has."""
    return settings(max_examples=max(1, number * settings().max_examples // 100))


def changes(size: int) -> st.SearchStrategy[list[Change]]:
    """A few places of a file of `size` bytes that become something else."""
    token = st.sampled_from(TOKENS) | st.binary(max_size=4)
    removed = st.sampled_from([0, 1, 1, 2, 4, 16, size])
    return st.lists(st.tuples(st.integers(0, size), removed, token), min_size=1, max_size=4)


def damaged(data: bytes, how: list[Change]) -> bytes:
    """The file with those places changed."""
    for at, removed, token in how:
        at = min(at, len(data))
        data = data[:at] + token + data[at + removed :]
    return data


@st.composite
def other_json(draw: st.DrawFn, whole: Any) -> str:
    """The JSON of a value in which one or two places hold something else, or nothing."""
    tree = json.loads(json.dumps(whole))
    for _ in range(draw(st.integers(1, 2))):
        place = tree
        while True:
            keys = list(place) if isinstance(place, dict) else range(len(place))
            if not keys:
                break
            key = draw(st.sampled_from(keys))
            if isinstance(place[key], list | dict) and draw(st.integers(0, 4)):
                place = place[key]
                continue
            if draw(st.booleans()):
                place[key] = draw(VALUES)
            else:
                del place[key]
            break
    return json.dumps(tree)


def peak_of(call: Callable[[], Any]) -> int:
    """Bytes that Python and NumPy hold at the most while `call` runs, beyond what they held before."""
    running = tracemalloc.is_tracing()
    if not running:
        tracemalloc.start()
    try:
        tracemalloc.reset_peak()
        before = tracemalloc.get_traced_memory()[0]
        call()
        return tracemalloc.get_traced_memory()[1] - before
    finally:
        if not running:
            tracemalloc.stop()
