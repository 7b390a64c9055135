"""What was found in a link or in a file of a state, in words."""

from __future__ import annotations

from collections.abc import Collection

from .state import DEFAULT, ViewState, changed, link
from .state.fields import FIELDS
from .state.forms import LONGEST, from_json
from .state.link import Finding
from .text import say

NAMED = 5  # names of settings in one notice
LONGEST_CAUSE = 200  # characters of an error in one notice


def from_query(
    text: str, models: Collection[str] = (DEFAULT.model,)
) -> tuple[ViewState, tuple[str, ...]]:
    """The state of a link's query, and a sentence for each thing that its reader should know; never an exception.

    models: those that a link may name.
    """
    state, findings = link.read(text, models)
    return state, tuple(words(finding) for finding in findings)


def from_file(
    data: bytes, models: Collection[str] = (DEFAULT.model,)
) -> tuple[ViewState, tuple[str, ...]]:
    """The state of a JSON file, and a sentence for each thing that its reader should know; ValueError if it is none.

    models: those that a file may name; of its own a stranger's file must not make this machine open a path.
    """
    state, found = from_json(data), []
    if state.model not in models:
        found.append(words(Finding("model", ("model",), link.shown(state.model))))
        state = changed(state, model=DEFAULT.model)
    if state.subject == "photo":
        found.append(say("export.needs_photo"))
    return state, tuple(found)


def words(finding: Finding) -> str:
    """A finding as a sentence."""
    names, value = _names(finding.names), finding.value
    match finding.kind:
        case "long":
            return say("link.long", limit=LONGEST)
        case "newer":
            return say("link.newer_left_out", names=names) if names else say("link.newer")
        case "unknown":
            return say("link.unknown", names=names)
        case "twice":
            return say("link.twice", names=names)
        case "range":
            field = FIELDS[finding.names[0]]
            low, high, near = (f"{x:g}" for x in (field.low, field.high, finding.near))
            unit = f" {field.unit}" if field.unit else ""
            return say(
                "link.range", name=names, value=value, low=low, high=high, near=near, unit=unit
            )
        case "malformed":
            return say("link.malformed", name=names, value=value)
        case "orbit":
            return say("link.orbit")
        case "model":
            return say("link.model", value=value, used=DEFAULT.model)
        case "photo":
            return say("link.photo")


def cause(error: BaseException) -> str:
    """Why something failed, as a short sentence of one line: an error's own words, or what it is called."""
    # Of a file the cause, not where on this machine it lies
    told = getattr(error, "strerror", None) or str(error)
    line = " ".join("".join(c if c.isprintable() else " " for c in str(told)).split())[
        :LONGEST_CAUSE
    ]
    if (
        not isinstance(error, ValueError | RuntimeError | OSError) or not line
    ):  # "'a'" alone says nothing
        line = f"{type(error).__name__}: {line}" if line else type(error).__name__
    return line if line.endswith((".", "!", "?")) else f"{line}."


def _names(names: tuple[str, ...]) -> str:
    listed = ", ".join(names[:NAMED])
    more = len(names) - NAMED
    return say("link.more", names=listed, count=more) if more > 0 else listed
