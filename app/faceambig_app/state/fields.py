"""The table of everything a person can set: one row is a key of the address, a key of the JSON, a command line flag, a
keyword of ViewState(...), its range, and the words of its help. Metres and degrees; centimetres only on labels.

`canonical` decides what may stand in a field, and brings values that mean the same into one form.
"""

from __future__ import annotations

import math
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

# number: float; whole: int; choice: one of `choices`; names: a tuple of some of `choices`, in their order; name: a
# model; subject: a whole number or "photo"; index: a whole number or None; modes: (mode, mm) pairs; orbit: (azimuth,
# elevation) or None; pins: short states; words: a tuple of short texts of a person's own, "" where none is given
Kind = Literal[
    "number", "whole", "choice", "names", "name", "subject", "index", "modes", "orbit", "pins", "words"
]  # fmt: skip
# Which cached step of the pipeline a field is a key of; "page": of none, it is the browser's alone
Part = Literal["target", "fitting", "bend", "look", "page"]

LANGUAGES = ("en", "de")  # each a file of words, assets/text/, and a folder of lessons
MODES = 3  # flexibility modes bent at once
LAST_MODE = 100
PINS = 5
LAST_LESSON, LAST_STEP = 99, 20
NAME_LENGTH = 1000  # characters of a model's name or path
PIN_NAME_LENGTH = 30  # characters
# Signs that would break a line, or turn round the words that follow: controls, half characters, marks of direction
_NO_WORDS = ("Cc", "Cs")
_TURNING = ("LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI")


@dataclass(frozen=True, slots=True)
class Field:
    """One setting: where it may lie and what it is called."""

    name: str  # ViewState field, URL and JSON key, Python keyword
    kind: Kind
    part: Part
    help: str  # of the command line
    low: float = -math.inf  # of a number; of modes the millimetres, of an orbit the elevation
    high: float = math.inf
    step: float = 1.0  # of the widget, in the widget's unit
    unit: str = ""  # "m", "deg", "mm", "%"
    choices: tuple[str | int, ...] = ()
    view: bool = False  # moves the viewer, not what is seen: no step of undo

    @property
    def flag(self) -> str:
        """Command line flag."""
        return "--" + self.name.replace("_", "-")


OVERLAYS = ("points", "marks", "names", "errors", "rays", "pyramid", "ghost", "scale", "outline")
VIEWS = ("front", "three_quarter", "side", "top", "camera", "free")

_ROWS = (
    Field("model", "name", "target", "model name or path"),
    Field("subject", "subject", "target", 'synthetic person, or "photo"', 1, 10),
    Field("actual", "number", "target", "where the photo was taken from", 0.2, 5.0, unit="m"),
    Field("distance", "number", "fitting", "distance the fit assumes", 0.2, 3.0, unit="m"),
    Field(
        "camera", "choice", "fitting", "camera of the fit", choices=("perspective", "orthographic")
    ),
    Field("yaw", "number", "target", "turn of the head in the photo", -60, 60, unit="deg"),
    Field("pitch", "number", "target", "nod of the head in the photo", -30, 30, unit="deg"),
    Field("roll", "number", "target", "tilt of the head in the photo", -45, 45, unit="deg"),
    Field("scheme", "choice", "target", "landmarks used", choices=("ibug68", "farkas")),
    Field(
        "data", "choice", "target", "what is fitted: the landmarks, with the outline, all points",
        choices=("points", "outline", "dense"),
    ),
    Field(
        "noise", "number", "target", "noise added to the points, of the eye distance",
        0, 5, step=0.5, unit="%",
    ),
    Field("seed", "whole", "target", "of the noise", 0, 9999),
    Field("modes", "whole", "fitting", "shape modes of the fit", 10, 100),
    Field(
        "prior", "number", "fitting", "landmark noise the fit assumes, of the eye distance",
        0.01, 5, unit="%",
    ),
    Field("box", "number", "fitting", "largest shape coefficient", 1, 4, step=0.5, unit="sd"),
    Field(
        "flex", "modes", "bend",
        f"bend along flexibility modes: 3.5 is the first, 1:3.5,2:-4 up to {MODES} of them",
        -10, 10, step=0.5, unit="mm",
    ),
    Field(
        "flex_at", "choice", "bend", "landmarks that the flexibility modes keep",
        choices=("reprojection", "dlt"),
    ),
    Field("draw", "index", "bend", "which face drawn from the posterior, in place of the fit", 0, 9999),
    Field(
        "extreme", "index", "bend",
        "which of the two faces farthest apart behind the same points, in place of the fit", 1, 2,
    ),
    Field(
        "flex_from", "whole", "page", f"first of the {MODES} flexibility modes that have sliders",
        1, LAST_MODE - MODES + 1, view=True,
    ),
    Field(
        "show", "choice", "look",
        "how true and fitted face are compared; row: fits at 30 60 120 240 cm",
        choices=("both", "overlay", "blink", "difference", "row"),
    ),
    Field(
        "surface", "choice", "look", "colours of the fitted face",
        choices=("clay", "skin", "difference", "depth", "spread"),
    ),
    Field("view", "choice", "look", "where the viewer stands", choices=VIEWS, view=True),
    Field(
        "orbit", "orbit", "look", "the viewer of --view free: azimuth,elevation as in --orbit=-30,10; elevation",
        -90, 90, unit="deg", view=True,
    ),
    Field("zoom", "number", "look", "of the view", 0.5, 4, step=0.1, view=True),
    Field("overlays", "names", "look", "what is drawn besides, none or some of", choices=OVERLAYS),
    Field("error_scale", "choice", "look", "lengthens error lines", choices=(1, 5, 10, 20)),
    Field("fade", "number", "look", "of the true face over the fitted one", 0, 1, step=0.05),
    Field(
        "hide", "names", "look", "what is not told, none or some of",
        choices=("numbers", "truth", "actual"),
    ),
    Field(
        "pins", "pins", "page",
        f"up to {PINS} faces kept to compare, like distance:0.6..distance:2.4,subject:3",
    ),
    Field(
        "pin_names", "words", "page",
        f"names of the kept faces in their order, up to {PIN_NAME_LENGTH} characters each, like Near,,Far",
    ),
    Field("lesson", "index", "page", "number of the lesson", 1, LAST_LESSON),
    Field("step", "whole", "page", "of the lesson", 1, LAST_STEP),
    Field(
        "theme", "choice", "page", "colours of the page",
        choices=("auto", "light", "dark"), view=True,
    ),
    Field("text", "number", "page", "size of letters", 1, 2, step=0.25, view=True),
    Field("lang", "choice", "page", "language of the words", choices=("auto", *LANGUAGES), view=True),
)  # fmt: skip
FIELDS: Mapping[str, Field] = {field.name: field for field in _ROWS}


def canonical(field: Field, value: Any) -> Any:
    """The one form of a value of `field`; ValueError, naming field, value and range, if it may not stand there.

    Numbers become floats without minus zero; names come in the table's order; modes in theirs, without those of 0 mm;
    an azimuth lies in (-180, 180]. Pins are checked by ViewState.
    """
    match field.kind:
        case "number":
            return _number(field, value)
        case "whole":
            return _whole(field, value)
        case "choice":
            return _choice(field, value)
        case "names":
            given = _several(field, value)
            for name in given:
                _choice(field, name)
            return tuple(choice for choice in field.choices if choice in given)
        case "name":
            return _name(field, value)
        case "subject":
            return value if isinstance(value, str) and value == "photo" else _whole(field, value)
        case "index":
            return None if value is None else _whole(field, value)
        case "modes":
            return _modes(field, value)
        case "orbit":
            return None if value is None else _orbit(field, value)
        case "pins":
            return _several(field, value)
        case "words":
            return _words(field, value)


def _number(field: Field, value: Any) -> float:
    if not isinstance(value, float | int) or isinstance(value, bool):
        raise ValueError(f"{field.name}: {short_repr(value)} is not a number")
    _within(field, value)
    return float(value) + 0.0  # -0.0 + 0.0 is 0.0


def _whole(field: Field, value: Any) -> int:
    if not isinstance(value, int) or isinstance(value, bool):
        what = "a whole number" if field.kind != "subject" else 'a whole number or "photo"'
        raise ValueError(f"{field.name}: {short_repr(value)} is not {what}")
    _within(field, value)
    return value


def _within(field: Field, value: float) -> None:
    if not field.low <= value <= field.high:  # False for NaN too
        unit = f" {field.unit}" if field.unit else ""
        try:
            shown = f"{value:g}"
        except OverflowError:  # a whole number beyond every float
            shown = "a number of that many digits"
        raise ValueError(
            f"{field.name}: {shown} is not within {field.low:g} to {field.high:g}{unit}"
        )


def _choice(field: Field, value: Any) -> str | int:
    for choice in field.choices:
        if type(value) is type(choice) and value == choice:  # True is 1 otherwise
            return choice
    known = " or ".join(str(choice) for choice in field.choices)
    raise ValueError(f"{field.name}: {short_repr(value)} is not {known}")


def _several(field: Field, value: Any) -> tuple[Any, ...]:
    if not isinstance(value, tuple | list | set | frozenset):
        raise ValueError(f"{field.name}: {short_repr(value)} is not a tuple, a list or a set")
    return tuple(value)  # pyright: ignore[reportUnknownArgumentType,reportUnknownVariableType]


def _pair(field: Field, value: Any, what: str) -> tuple[Any, Any]:
    if not isinstance(value, tuple | list) or len(value) != 2:  # pyright: ignore[reportUnknownArgumentType]
        raise ValueError(f"{field.name}: {short_repr(value)} is not {what}")  # pyright: ignore[reportUnknownArgumentType]
    return value[0], value[1]  # pyright: ignore[reportUnknownVariableType]


def _name(field: Field, value: Any) -> str:
    if not isinstance(value, str) or not 0 < len(value) <= NAME_LENGTH:
        raise ValueError(f"{field.name}: {short_repr(value)} is not a name or a path")
    # Half a surrogate pair has no UTF-8: it could not be written into a link or a file
    if any(character < " " or "\ud800" <= character <= "\udfff" for character in value):
        raise ValueError(f"{field.name}: {short_repr(value)} has characters no name has")
    return value


def _words(field: Field, value: Any) -> tuple[str, ...]:
    """Short texts, with one space between words; without empty ones at the end."""
    if isinstance(value, set | frozenset):  # their order is what they are for
        raise ValueError(f"{field.name}: {short_repr(value)} is not a tuple or a list")  # pyright: ignore[reportUnknownArgumentType]
    given = list(_several(field, value))
    for at, text in enumerate(given):
        if not isinstance(text, str):
            raise ValueError(f"{field.name}: {short_repr(text)} is not a text")
        given[at] = " ".join(text.split())
        if len(given[at]) > PIN_NAME_LENGTH:
            raise ValueError(
                f"{field.name}: {short_repr(text)} is longer than {PIN_NAME_LENGTH} characters"
            )
        if not all(map(_is_of_words, given[at])):
            raise ValueError(f"{field.name}: {short_repr(text)} has characters no name has")
    while given and not given[-1]:
        given.pop()
    if len(given) > PINS:
        raise ValueError(f"{field.name}: {len(given)} of them; give at most {PINS}")
    return tuple(given)


def _is_of_words(character: str) -> bool:
    return (
        unicodedata.category(character) not in _NO_WORDS
        and unicodedata.bidirectional(character) not in _TURNING
    )


def tidy(text: str, most: int = PIN_NAME_LENGTH) -> str:
    """The nearest text that a pin's name, or another line of `most` characters, may be: cut, never refused."""
    plain = "".join(filter(_is_of_words, " ".join(text.split())))
    return " ".join(plain[:most].split())


def _modes(field: Field, value: Any) -> tuple[tuple[int, float], ...]:
    bent: dict[int, float] = {}
    for pair in _several(field, value):
        mode, mm = _pair(field, pair, "(mode, mm)")
        if not isinstance(mode, int) or isinstance(mode, bool) or not 1 <= mode <= LAST_MODE:
            raise ValueError(
                f"{field.name}: mode {short_repr(mode)} is not a whole number within 1 to {LAST_MODE}"
            )
        if mode in bent:
            raise ValueError(f"{field.name}: mode {mode} stands there twice")
        bent[mode] = _number(field, mm)
    kept = tuple(sorted((mode, mm) for mode, mm in bent.items() if mm))
    if len(kept) > MODES:
        raise ValueError(f"{field.name}: {len(kept)} modes at once; give at most {MODES}")
    return kept


def _orbit(field: Field, value: Any) -> tuple[float, float]:
    azimuth, elevation = _pair(field, value, "(azimuth, elevation)")
    try:
        turned = math.remainder(azimuth, 360.0)
    except (TypeError, ValueError, OverflowError):
        turned = math.nan
    if isinstance(azimuth, bool) or math.isnan(turned):
        raise ValueError(f"{field.name}: azimuth {short_repr(azimuth)} is not an angle in degrees")
    return (180.0 if turned == -180.0 else turned + 0.0), _number(field, elevation)


def short_repr(value: object) -> str:
    """A value as an error names it: never long, never of several lines."""
    try:
        text = repr(value)
    except ValueError:  # whole numbers of more than 4300 digits
        return "a number of that many digits"
    return text if len(text) <= 60 else f"{text[:57]}..."
