"""A ViewState as text: each value by itself, the JSON of a state, the flags of the command line.

Values are written with the signs A-Z a-z 0-9 . _ , : - only (names of models and pins may have others), so that a link
needs no escapes. Numbers are written in full: what is read is what was written, to the last bit.
"""

from __future__ import annotations

import json
import math
import shlex
from typing import Any
from urllib.parse import unquote

import msgspec

from .fields import FIELDS, PINS, Field, short_repr
from .viewstate import DEFAULT, VERSION, ViewState

NONE = "none"  # no names, no modes, no orbit, no draw, no pins
PIN_END, PLAIN_PIN = "..", "default"  # between pins; a pin of nothing but defaults
LONGEST = 65536  # characters of a link or a file that are read at all


def text_of(field: Field, value: Any) -> str:
    """A value of a field as an address or a command line has it."""
    match field.kind:
        case "number":
            return _digits(value)
        case "names":
            return ",".join(value) or NONE
        case "modes":
            alone = len(value) == 1 and value[0][0] == 1
            pairs = (_digits(mm) if alone else f"{mode}:{_digits(mm)}" for mode, mm in value)
            return ",".join(pairs) or NONE
        case "orbit":
            return NONE if value is None else ",".join(map(_digits, value))
        case "index":
            return NONE if value is None else str(value)
        case "pins":
            return PIN_END.join(map(_pin_text, value)) or NONE
        case "words":
            return _words_text(value)
        case _:
            return str(value)


def value_of(field: Field, text: str) -> Any:
    """The value written as `text`; ValueError if it is none. Whether it is within the range, a ViewState checks."""
    match field.kind:
        case "number":
            return _number(field, text)
        case "whole":
            return _whole(field, text)
        case "subject":
            return text if text == "photo" else _whole(field, text)
        case "choice":
            word = text.replace("-", "_")  # three-quarter, as people write it
            return next((choice for choice in field.choices if str(choice) == word), word)
        case "name":
            return text
        case _ if text == NONE:
            return None if field.kind in ("index", "orbit") else ()
        case "names":
            return tuple(text.split(","))
        case "modes":
            return _modes(field, text)
        case "orbit":
            azimuth, comma, elevation = text.partition(",")
            if not comma:
                raise ValueError(f"{field.name}: {text!r:.60} is not like 30,-10")
            return _number(field, azimuth), _number(field, elevation)
        case "index":
            return _whole(field, text)
        case "pins":
            pins = text.split(PIN_END)
            if len(pins) > PINS:
                raise ValueError(f"pins: {len(pins)} of them; give at most {PINS}")
            return tuple(_pin(pin) for pin in pins)
        case "words":
            return tuple(map(unquote, text.split(",")))


def set_fields(state: ViewState) -> dict[str, Any]:
    """The values that are not the default, in the order of the table."""
    values = {name: getattr(state, name) for name in FIELDS}
    return {name: value for name, value in values.items() if value != getattr(DEFAULT, name)}


def to_json(state: ViewState) -> str:
    """The state as JSON, defaults left out; equal states give the same text, and from_json() the same state."""
    return json.dumps(_plain(state), ensure_ascii=False, separators=(",", ":"))


def from_json(text: str | bytes) -> ViewState:
    """The state of a JSON text; ValueError, of one line, if it is none."""
    if len(text) > LONGEST:
        raise ValueError(f"state: longer than {LONGEST} characters")
    try:
        values = msgspec.json.decode(text)
        if isinstance(values, dict) and "v" in values and values["v"] != VERSION:  # pyright: ignore[reportUnknownArgumentType]
            # Before a setting that only the newer version knows is taken for a mistake
            version = short_repr(values["v"])  # pyright: ignore[reportUnknownArgumentType]
            raise ValueError(f"v: {version} is not the format that this program reads ({VERSION})")
        return msgspec.convert(values, ViewState)
    except RecursionError:
        raise ValueError("state: nested too deeply") from None
    except msgspec.ValidationError as error:
        raise ValueError(one_line(str(error))) from error
    except (msgspec.DecodeError, UnicodeError) as error:
        raise ValueError(f"state: not JSON ({one_line(str(error))})") from error


def flags(state: ViewState) -> list[str]:
    """The arguments of `faceambig snapshot` that give this state."""
    words: list[str] = []
    for name, value in set_fields(state).items():
        field, text = FIELDS[name], text_of(FIELDS[name], value)
        # What begins with a minus would be taken for a flag
        words += [f"{field.flag}={text}"] if text.startswith("-") else [field.flag, text]
    return words


def command(state: ViewState, out: str = "face.png") -> str:
    """The line, for a shell, that draws this state into the file `out`."""
    target = [f"--out={out}"] if out.startswith("-") else ["--out", out]
    return shlex.join(["faceambig", "snapshot", *flags(state), *target])


def _plain(state: ViewState) -> dict[str, Any]:
    values = set_fields(state)
    if state.pins:
        # A pin is of the model of its state
        pins = [_plain(pin) for pin in state.pins]
        values["pins"] = [{k: v for k, v in pin.items() if k != "model"} for pin in pins]
    return values


def _pin_text(pin: ViewState) -> str:
    """field:value,field:value; of the modes each by itself: flex:1:3.5,flex:2:-4."""
    values = {name: value for name, value in set_fields(pin).items() if name != "model"}
    items = (
        f"{name}:{item}"
        for name, value in values.items()
        for item in text_of(FIELDS[name], value).split(",")
    )
    return ",".join(items) or PLAIN_PIN


def _pin(text: str) -> ViewState:
    """The face of a pin's text; ValueError if it is none."""
    given: dict[str, list[str]] = {}
    for item in text.split(",") if text != PLAIN_PIN else ():
        name, _, value = item.partition(":")
        field = FIELDS.get(name)
        if field is None or name == "model" or field.part in ("look", "page"):
            raise ValueError(f"pins: {item!r:.60} is not a setting of a face and its value")
        # Only modes are several: "1,2", of a name that stands there twice, is no value of another field
        given.setdefault(name, []).append(value)
    values = {name: value_of(FIELDS[name], ",".join(items)) for name, items in given.items()}
    return ViewState(**values)


def _modes(field: Field, text: str) -> tuple[tuple[int, float], ...]:
    pairs: list[tuple[int, float]] = []
    for item in text.split(","):
        mode, colon, mm = item.rpartition(":")
        pairs.append((_whole(field, mode) if colon else 1, _number(field, mm)))
    return tuple(pairs)


def _words_text(words: tuple[str, ...]) -> str:
    """Texts with commas between them; within one, a comma and the sign that escapes it are escaped."""
    text = ",".join(word.replace("%", "%25").replace(",", "%2C") for word in words)
    return text.replace("n", "%6E", 1) if text == NONE else text or NONE


def _number(field: Field, text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise ValueError(f"{field.name}: {text!r:.60} is not a number") from error


def _whole(field: Field, text: str) -> int:
    try:
        return int(text)
    except ValueError as error:
        raise ValueError(f"{field.name}: {text!r:.60} is not a whole number") from error


def _digits(value: float) -> str:
    """The shortest text that reads as this number."""
    return repr(value).removesuffix(".0")


def rounded(value: float) -> float:
    """To three significant digits."""
    return float(f"{value:.3g}") if math.isfinite(value) else value


def one_line(words: str) -> str:
    """Words of anybody on one line of at most 200 characters that can be shown."""
    line = " ".join("".join(c if c.isprintable() else " " for c in words).split())
    return line if len(line) <= 200 else f"{line[:197]}..."
