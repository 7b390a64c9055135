"""A ViewState as the query of an address: subject=3&distance=0.6&view=side. Defaults are left out, numbers have three
significant digits, and a link that is wrong in part is right in the rest: reading it never fails, it finds things.

What was found is told in words by notices.py.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from typing import Any, Literal
from urllib.parse import quote, unquote_plus

from .fields import FIELDS, Field, canonical
from .forms import LONGEST, rounded, set_fields, text_of, value_of
from .viewstate import DEFAULT, VERSION, ViewState, changed

LONGEST_VALUE = 4000  # characters: five pins of all their fields have half of it
SHOWN = 24  # characters of what a link says that are repeated

OF_THE_PAGE = ("darkMode", "fixedDpr")  # what viser's page itself reads from its address

# A server that lets no unknown name into its page's address leaves word of them: ignored=spin,lens
IGNORED = "ignored"
MOST_IGNORED = 8  # names
_IGNORED = re.compile(
    rf"[\w.-]{{1,{SHOWN}}}(,[\w.-]{{1,{SHOWN}}}){{0,{MOST_IGNORED - 1}}}", re.ASCII
)

Kind = Literal["long", "newer", "unknown", "twice", "range", "malformed", "orbit", "model", "photo"]


@dataclass(frozen=True, slots=True)
class Finding:
    """Something about a link that its reader should know."""

    kind: Kind
    names: tuple[str, ...] = ()  # settings it is about
    value: str = ""  # what the link says, cut short; nothing in it but what can be printed
    near: float = math.nan  # of "range": what was taken instead


def query(state: ViewState) -> str:
    """The query of a state's link, "" of the default; equal states give the same text."""
    values = set_fields(to_digits(state))
    texts = {name: text_of(FIELDS[name], value) for name, value in values.items()}
    return "&".join(f"{name}={quote(text, safe=',:')}" for name, text in texts.items())


def to_digits(state: ViewState) -> ViewState:
    """The state with the three significant digits that its link has: a distance to 0.5 % or better."""
    values = {
        name: _to_digits(field, getattr(state, name))
        for name, field in FIELDS.items()
        if field.kind in ("number", "modes", "orbit", "pins")
    }
    return changed(state, **values)


def _to_digits(field: Field, value: Any) -> Any:
    match field.kind:
        case "number":
            return rounded(value)
        case "modes":
            return tuple((mode, rounded(mm)) for mode, mm in value)
        case "orbit":
            return None if value is None else tuple(map(rounded, value))
        case _:
            return tuple(map(to_digits, value))


def read(
    text: str, models: Collection[str] = (DEFAULT.model,)
) -> tuple[ViewState, tuple[Finding, ...]]:
    """The state of a query, with or without its question mark, and what was found on the way; never an exception.

    models: those that a link may name. Of its own a stranger's link must not make this machine open a path.
    """
    if len(text) > LONGEST:
        return DEFAULT, (Finding("long"),)
    given, twice = _pairs(text.removeprefix("?"))
    findings: list[Finding] = []
    ours = (*FIELDS, "v", IGNORED, *OF_THE_PAGE)
    unknown = tuple(shown(name) or "?" for name in given if name not in ours)
    unknown += told_ignored(given.get(IGNORED, ""))
    if _newer(given.get("v"), findings):
        findings.append(Finding("newer", unknown))
    elif unknown:
        findings.append(Finding("unknown", unknown))
    if twice:
        findings.append(Finding("twice", tuple(map(shown, twice))))
    values: dict[str, Any] = {}
    for name, field in FIELDS.items():
        if name in given:
            values |= _value(field, given[name], models, findings)
    if values.get("view") == "free" and values.get("orbit") is None:
        del values["view"]
        findings.append(Finding("orbit", ("view",)))
    return ViewState(**values), tuple(findings)


def ignored(names: Iterable[str]) -> str:
    """The value of IGNORED that tells of names as an address has them: few, short, of letters and digits alone."""
    plain = (re.sub(r"[^\w.-]", "_", unquote_plus(name), flags=re.ASCII)[:SHOWN] for name in names)
    return ",".join(list(dict.fromkeys(name or "_" for name in plain))[:MOST_IGNORED])


def told_ignored(value: str) -> tuple[str, ...]:
    """The names in a value of IGNORED; none if it is not what `ignored` writes."""
    return tuple(value.split(",")) if _IGNORED.fullmatch(value) else ()


def _pairs(text: str) -> tuple[dict[str, str], tuple[str, ...]]:
    """The last value of each name; and the names that stood there more than once."""
    given: dict[str, str] = {}
    twice: dict[str, None] = {}
    for item in text.split("&"):
        name, _, value = item.partition("=")
        name, value = unquote_plus(name), unquote_plus(value)
        if name in given:
            twice[name] = None
        if item:
            given[name] = value
    return given, tuple(twice)


def _newer(version: str | None, findings: list[Finding]) -> bool:
    if version is None or version == str(VERSION):
        return False
    # Not int(): a version is a few digits, and nothing else is one
    if version.isascii() and version.isdecimal() and len(version) < 10 and int(version) > VERSION:
        return True
    findings.append(Finding("malformed", ("v",), shown(version)))
    return False


def _value(
    field: Field, text: str, models: Collection[str], findings: list[Finding]
) -> dict[str, Any]:
    """The value of a field by its name, clamped into its range; nothing if the text is none."""
    outside: list[Finding] = []

    def into_range(number: float) -> float:
        if field.low <= number <= field.high or number != number:
            return number  # NaN too: it is nowhere
        near = field.low if number < field.low else field.high
        outside.append(Finding("range", (field.name,), _number(number), near))
        return type(number)(near)

    try:
        if len(text) > LONGEST_VALUE:
            raise ValueError(f"{field.name}: longer than {LONGEST_VALUE} characters")
        value = canonical(field, _clamped(field, value_of(field, text), into_range))
    except ValueError:
        findings.append(Finding("malformed", (field.name,), shown(text)))
        return {}
    if field.kind == "name" and value not in models:
        findings.append(Finding("model", (field.name,), shown(value)))
        return {}
    if value == "photo":
        outside.append(Finding("photo", (field.name,)))
    findings += outside
    return {field.name: value}


def _clamped(field: Field, value: Any, into_range: Callable[[float], float]) -> Any:
    match field.kind:
        case "number" | "whole":
            return into_range(value)
        case "subject" | "index":
            return into_range(value) if isinstance(value, int) else value
        case "modes":
            return tuple((mode, into_range(mm)) for mode, mm in value)
        case "orbit":
            return None if value is None else (value[0], into_range(value[1]))
        case _:
            return value


def _number(value: float) -> str:
    try:
        return f"{value:g}"
    except OverflowError:  # a whole number beyond every float
        return "inf" if value > 0 else "-inf"


def shown(text: str) -> str:
    """What a stranger wrote, as it may be repeated."""
    plain = "".join(c if c.isprintable() else "?" for c in text[: SHOWN + 1])
    return plain if len(plain) <= SHOWN else f"{plain[:SHOWN]}..."
