"""Pickles read as data: a stack machine that knows how to store things and cannot call anything.

Python's own reader calls what the file names. Here an object stays what it was written as: the name of its class, its
arguments and its state (`Thing`), and only the names of ALLOWED may occur at all: NumPy arrays and their types,
SciPy's compressed columns, chumpy's arrays, plain containers. No class of these is looked up, no package imported.

What a file may cost is bounded by its own size and MAX_STEPS: each step takes or makes one thing, lengths are compared
with what is left, the memo is a dictionary (a list would be grown to any number that the file names), and keys are
texts or whole numbers (nested tuples would be hashed for ever).
"""

from __future__ import annotations

import codecs
import re
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import AssetError
from .zipped import count

MAX_STEPS = 1_000_000  # a FLAME file takes some thousands
MAX_PICKLE = 1 << 28  # bytes; FLAME's have 50 to 100 MB, and a text may take four times its bytes

ARRAY, DTYPE, MAKE_ARRAY, ENCODE, MAKE_OBJECT, OBJECT, SET, CHUMPY, COLUMNS = (
    "array", "dtype", "make array", "encode", "make object", "object", "set", "chumpy", "columns",
)  # fmt: skip
ALLOWED = {
    ("numpy", "ndarray"): ARRAY,
    ("numpy", "dtype"): DTYPE,
    ("numpy.core.multiarray", "_reconstruct"): MAKE_ARRAY,
    ("numpy._core.multiarray", "_reconstruct"): MAKE_ARRAY,
    ("_codecs", "encode"): ENCODE,
    ("copy_reg", "_reconstructor"): MAKE_OBJECT,
    ("copyreg", "_reconstructor"): MAKE_OBJECT,
    ("__builtin__", "object"): OBJECT,
    ("builtins", "object"): OBJECT,
    ("__builtin__", "set"): SET,
    ("builtins", "set"): SET,
    ("chumpy.ch", "Ch"): CHUMPY,
    ("scipy.sparse.csc", "csc_matrix"): COLUMNS,
    ("scipy.sparse._csc", "csc_matrix"): COLUMNS,
}
DTYPE_CODE = re.compile(r"[iuf][1248]|b1")


class Name(str):
    """A name of ALLOWED that the file mentions: what it stands for."""

    __slots__ = ()


@dataclass(slots=True, eq=False)
class Thing:
    """An object of the file, not made: what it is, its arguments, its state."""

    kind: str
    arguments: tuple[Any, ...] = ()
    state: Any = None


def is_pickle(path: Path) -> bool:
    """Whether `path` begins like a pickle, or is called one."""
    with path.open("rb") as stream:
        start = stream.read(3)
    binary = start[:1] == b"\x80" and start[1:2] in (b"\x02", b"\x03", b"\x04", b"\x05")
    return binary or start in (b"(dp", b"(dq") or path.suffix.lower() == ".pkl"


def read_pickle(path: Path) -> Any:
    """The data of the pickle at `path`: containers, texts, numbers, and `Thing`s; AssetError for anything else."""
    size = path.stat().st_size
    if size > MAX_PICKLE:
        raise AssetError(f"{size >> 20} MB; {MAX_PICKLE >> 20} MB are accepted")
    return _Machine(path.read_bytes()).run()


def array_of(name: str, value: Any) -> NDArray[Any]:
    """The array of a NumPy or chumpy `Thing`."""
    if isinstance(value, Thing) and value.kind == CHUMPY:
        value = value.state.get("x") if isinstance(value.state, dict) else None
    if not isinstance(value, Thing) or value.kind != ARRAY or not isinstance(value.state, tuple):
        raise AssetError(f"{name} is not an array")
    if len(value.state) != 5:
        raise AssetError(f"{name} is an array with a state of {len(value.state)} parts, not 5")
    _, shape, kind, fortran, raw = value.state
    dtype = _dtype(name, kind)
    if isinstance(raw, str):  # Python 2's bytes
        raw = raw.encode("latin-1")
    if not isinstance(shape, tuple) or not all(type(n) is int and n >= 0 for n in shape):
        raise AssetError(f"{name} has no shape")
    if not isinstance(raw, bytes) or count(shape) * dtype.itemsize != len(raw):
        held = len(raw) if isinstance(raw, bytes) else 0
        raise AssetError(f"{name} claims shape {shape!r:.60}, the file holds {held} bytes of it")
    return np.frombuffer(raw, dtype).reshape(shape, order="F" if fortran else "C")


def _dtype(name: str, kind: Any) -> np.dtype[Any]:
    code = _text(kind.arguments[0]) if isinstance(kind, Thing) and kind.arguments else ""
    if not isinstance(kind, Thing) or kind.kind != DTYPE or not DTYPE_CODE.fullmatch(code):
        raise AssetError(f"{name} holds {code or 'unknown'!s:.20} values, not numbers")
    order = _text(kind.state[1]) if isinstance(kind.state, tuple) and len(kind.state) > 1 else "|"
    return np.dtype((order if order in ("<", ">") else "<") + code)


def _text(value: Any) -> str:
    if isinstance(value, bytes):
        return value.decode("latin-1")
    return value if isinstance(value, str) else ""


_MARK = object()


class _Machine:
    """Runs a pickle: the stack, the memo, the place in the file."""

    def __init__(self, data: bytes) -> None:
        self.data, self.at = data, 0
        self.stack: list[Any] = []
        self.memo: dict[int, Any] = {}
        self.made = 0  # bytes made of texts

    def run(self) -> Any:
        for _ in range(MAX_STEPS):
            code = self.take(1)
            if code == b".":
                return self.pop()
            step = STEPS.get(code)
            if step is None:
                raise AssetError(f"pickle step {code!r} at byte {self.at - 1} is not allowed")
            step(self)
        raise AssetError(f"more than {MAX_STEPS} steps")

    def take(self, n: int) -> bytes:
        if n < 0 or n > len(self.data) - self.at:
            raise AssetError(f"cut off: {n} bytes wanted at byte {self.at} of {len(self.data)}")
        self.at += n
        return self.data[self.at - n : self.at]

    def number(self, kind: str) -> Any:
        return struct.unpack(kind, self.take(struct.calcsize(kind)))[0]

    def line(self) -> str:
        end = self.data.find(b"\n", self.at)
        if end < 0:
            raise AssetError(f"cut off: no end of the line at byte {self.at}")
        return self.take(end + 1 - self.at)[:-1].decode("latin-1")

    def encoded(self, text: str) -> bytes:
        """The bytes that Python 3 wrote as a text; one made into bytes again and again would fill the memory."""
        self.made += len(text)
        if self.made > len(self.data):
            raise AssetError("makes more bytes than it holds")
        return text.encode("latin-1")

    def push(self, value: Any) -> None:
        self.stack.append(value)

    def pop(self) -> Any:
        if not self.stack or self.stack[-1] is _MARK:
            raise AssetError(f"damaged pickle: nothing to take at byte {self.at - 1}")
        return self.stack.pop()

    def top(self, kind: type) -> Any:
        if not self.stack or not isinstance(self.stack[-1], kind):
            raise AssetError(f"damaged pickle: no {kind.__name__} at byte {self.at - 1}")
        return self.stack[-1]

    def since_mark(self) -> list[Any]:
        k = len(self.stack) - 1
        while k >= 0 and self.stack[k] is not _MARK:
            k -= 1
        if k < 0:
            raise AssetError(f"damaged pickle: no mark before byte {self.at}")
        items = self.stack[k + 1 :]
        del self.stack[k:]
        return items


def _last(machine: _Machine, n: int) -> tuple[Any, ...]:
    return tuple(reversed([machine.pop() for _ in range(n)]))


def _named(machine: _Machine, module: Any, name: Any) -> None:
    if not isinstance(module, str) or not isinstance(name, str):
        raise AssetError(f"damaged pickle: a name that is no text before byte {machine.at}")
    kind = ALLOWED.get((module, name))
    if kind is None:
        full = " ".join(f"{module:.40}.{name:.40}".split())
        raise AssetError(f"names {full}, which is not allowed: nothing was run")
    machine.push(Name(kind))


def _remember(machine: _Machine, number: int) -> None:
    if not machine.stack or machine.stack[-1] is _MARK:
        raise AssetError(f"damaged pickle: nothing to remember at byte {machine.at - 1}")
    machine.memo[number] = machine.stack[-1]


def _recall(machine: _Machine, number: int) -> None:
    if number not in machine.memo:
        raise AssetError(f"damaged pickle: {number} is not remembered")
    machine.push(machine.memo[number])


def _reduce(machine: _Machine) -> None:
    """A call as it is written: the few that are known become what they would store."""
    arguments, name = machine.pop(), machine.pop()
    if not isinstance(name, Name) or not isinstance(arguments, tuple):
        raise AssetError(f"damaged pickle: a call without a name before byte {machine.at}")
    kind, first = str(name), arguments[0] if arguments else None
    if kind == ENCODE and isinstance(first, str) and arguments[1:] == ("latin1",):
        machine.push(machine.encoded(first))
    elif kind == MAKE_ARRAY and isinstance(first, Name) and first == ARRAY:
        machine.push(Thing(ARRAY))
    elif kind == MAKE_OBJECT and len(arguments) == 3 and first in (CHUMPY, COLUMNS):
        machine.push(Thing(str(first)))
    elif kind in (DTYPE, SET):
        machine.push(Thing(kind, arguments))
    else:
        raise AssetError(f"calls {kind} in a way that is not allowed: nothing was run")


def _new(machine: _Machine) -> None:
    arguments, name = machine.pop(), machine.pop()
    if not isinstance(name, Name) or name not in (CHUMPY, COLUMNS) or arguments != ():
        what = name if isinstance(name, str) else type(name).__name__
        raise AssetError(f"makes {what:.40}, which is not allowed: nothing was run")
    machine.push(Thing(str(name)))


def _build(machine: _Machine) -> None:
    state = machine.pop()
    machine.top(Thing).state = state


def _set_items(machine: _Machine, items: list[Any]) -> None:
    target = machine.top(dict)
    if len(items) % 2:
        raise AssetError(f"damaged pickle: a key without a value before byte {machine.at}")
    for key, value in zip(items[::2], items[1::2], strict=True):
        if isinstance(key, bytes):
            key = key.decode("latin-1")
        if type(key) not in (str, int):
            raise AssetError(f"a key of type {type(key).__name__} is not allowed")
        target[key] = value


def _make_dict(machine: _Machine) -> None:
    items = machine.since_mark()
    machine.push({})
    _set_items(machine, items)


def _quoted(machine: _Machine) -> bytes:
    """A text of protocol 0, in quotes, with escapes."""
    text = machine.line()
    if len(text) < 2 or text[0] != text[-1] or text[0] not in "'\"":
        raise AssetError(f"damaged pickle: no quotes before byte {machine.at}")
    return codecs.escape_decode(text[1:-1].encode("latin-1"))[0]  # pyright: ignore[reportAttributeAccessIssue]


def _whole(machine: _Machine) -> int | bool:
    text = machine.line()
    return text == "01" if text in ("00", "01") else int(text.removesuffix("L"))


def _do(make: Any) -> Any:
    """A step that pushes what `make` returns."""
    return lambda machine: machine.push(make(machine))


def _decoded(raw: bytes) -> str:
    return raw.decode("utf-8", "surrogatepass")


STEPS: dict[bytes, Any] = {
    b"\x80": lambda m: m.take(1),  # protocol
    b"\x95": lambda m: m.take(8),  # length of a frame: what it holds says its own
    b"(": lambda m: m.push(_MARK),
    b"0": lambda m: m.pop(),
    b"1": lambda m: m.since_mark(),
    b"2": lambda m: m.push(m.top(object)),
    b"N": _do(lambda _: None),
    b"\x88": _do(lambda _: True),
    b"\x89": _do(lambda _: False),
    b"I": _do(_whole),
    b"L": _do(_whole),
    b"J": _do(lambda m: m.number("<i")),
    b"K": _do(lambda m: m.number("<B")),
    b"M": _do(lambda m: m.number("<H")),
    b"\x8a": _do(lambda m: int.from_bytes(m.take(m.number("<B")), "little", signed=True)),
    b"F": _do(lambda m: float(m.line())),
    b"G": _do(lambda m: m.number(">d")),
    b"S": _do(_quoted),
    b"T": _do(lambda m: m.take(m.number("<i"))),
    b"U": _do(lambda m: m.take(m.number("<B"))),
    b"V": _do(lambda m: m.line().encode("latin-1").decode("raw-unicode-escape")),
    b"X": _do(lambda m: _decoded(m.take(m.number("<I")))),
    b"\x8c": _do(lambda m: _decoded(m.take(m.number("<B")))),
    b"\x8d": _do(lambda m: _decoded(m.take(m.number("<Q")))),
    b"B": _do(lambda m: m.take(m.number("<I"))),
    b"C": _do(lambda m: m.take(m.number("<B"))),
    b"\x8e": _do(lambda m: m.take(m.number("<Q"))),
    b")": _do(lambda _: ()),
    b"t": _do(lambda m: tuple(m.since_mark())),
    b"\x85": _do(lambda m: _last(m, 1)),
    b"\x86": _do(lambda m: _last(m, 2)),
    b"\x87": _do(lambda m: _last(m, 3)),
    b"]": _do(lambda _: []),
    b"l": _do(lambda m: m.since_mark()),
    b"}": _do(lambda _: {}),
    b"d": _make_dict,
    b"a": lambda m: _append(m, [m.pop()]),
    b"e": lambda m: _append(m, m.since_mark()),
    b"s": lambda m: _set_items(m, list(_last(m, 2))),
    b"u": lambda m: _set_items(m, m.since_mark()),
    b"\x8f": _do(lambda _: Thing(SET)),
    b"\x90": lambda m: (m.since_mark(), m.top(Thing)),  # members of a set: none is needed
    b"g": lambda m: _recall(m, int(m.line())),
    b"h": lambda m: _recall(m, m.number("<B")),
    b"j": lambda m: _recall(m, m.number("<I")),
    b"p": lambda m: _remember(m, int(m.line())),
    b"q": lambda m: _remember(m, m.number("<B")),
    b"r": lambda m: _remember(m, m.number("<I")),
    b"\x94": lambda m: _remember(m, len(m.memo)),
    b"c": lambda m: _named(m, m.line(), m.line()),
    b"\x93": lambda m: _named(m, *_last(m, 2)),
    b"R": _reduce,
    b"\x81": _new,
    b"b": _build,
}


def _append(machine: _Machine, items: list[Any]) -> None:
    machine.top(list).extend(items)
