"""Our script in one browser: what it is told and what it reports. assets/page/channel.js has the whole protocol."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable, Sequence
from typing import Annotated, Literal

import msgspec
import viser
from msgspec import UNSET, Meta, Struct, UnsetType

from .guard import add_reports, data_html, log_line
from .state.forms import one_line

Theme = Literal["auto", "light", "dark"]
_Pixel = Annotated[float, Meta(ge=0, le=65_536)]
_Index = Annotated[int, Meta(ge=0, le=9_999)]
LONGEST = 7_000  # characters of a query: five pins with long names; a request of more than 8 kB is refused
_QUERY = re.compile(r"[A-Za-z0-9._,:;=&~*+%-]*")  # what no browser writes otherwise


class Hello(Struct, frozen=True):
    """The first report of every connection: the address holds the state after a reconnection or a restart."""

    # Of the address, without "?", as it stands there
    query: Annotated[str, Meta(max_length=LONGEST)]
    reduced_motion: bool
    touch: bool
    dark: bool  # the system's preference
    theme: Theme | None  # kept in this browser; None: never chosen
    text: Annotated[float, Meta(ge=1, le=2)] | None  # size of text, likewise
    # of the browser, dearest first
    languages: Annotated[tuple[Annotated[str, Meta(max_length=40)], ...], Meta(max_length=8)] = ()


class Point(Struct, frozen=True):
    """A point of the photograph is moved to x, y, in pixels from the upper left corner."""

    index: _Index
    x: _Pixel
    y: _Pixel
    done: bool  # let go


class Click(Struct, frozen=True):
    """A place on a photograph with data-fa-place, pixels."""

    x: _Pixel
    y: _Pixel


class Gone(Struct, frozen=True):
    """Delete on a point."""

    index: _Index


class Key(Struct, frozen=True):
    name: Literal["Escape"]


class Hand(Struct, frozen=True):
    """A hand is turning the viewer: what the camera tells now is a person's will."""

    on: bool


class Dark(Struct, frozen=True):
    """The system has become dark, or light."""

    on: bool


class Copied(Struct, frozen=True):
    """Whether text number n (0: one that the page offers itself) is on the clipboard."""

    n: Annotated[int, Meta(ge=0)]
    ok: bool


class Probe(Struct, frozen=True):
    """The pointer is over a vertex of a head. n counts the questions; the answer is `Script.probed`."""

    n: Annotated[int, Meta(ge=1)]
    head: Annotated[str, Meta(max_length=64)]
    vertex: Annotated[int, Meta(ge=0, le=9_999_999)]


Report = Hello | Point | Click | Gone | Key | Hand | Dark | Copied | Probe


class _Envelope(Struct, frozen=True, forbid_unknown_fields=True):
    """One of these."""

    hello: Hello | UnsetType = UNSET
    point: Point | UnsetType = UNSET
    click: Click | UnsetType = UNSET
    gone: _Index | UnsetType = UNSET
    key: Literal["Escape"] | UnsetType = UNSET
    hand: bool | UnsetType = UNSET
    dark: bool | UnsetType = UNSET
    copied: Copied | UnsetType = UNSET
    probe: Probe | UnsetType = UNSET


_decoder = msgspec.json.Decoder(_Envelope)


def read_report(text: str) -> Report:
    """A report from its JSON; ValueError in one line if it is none."""
    try:
        envelope = _decoder.decode(text)
    except (msgspec.MsgspecError, UnicodeError, RecursionError) as error:
        raise ValueError(f"report: {one_line(str(error))}") from None
    given = [
        (name, value)
        for name in envelope.__struct_fields__
        if (value := getattr(envelope, name)) is not UNSET
    ]
    if len(given) != 1:
        raise ValueError(f"report: {len(given)} kinds instead of one")
    name, value = given[0]
    wrap = {"gone": Gone, "key": Key, "hand": Hand, "dark": Dark}.get(name)
    return value if wrap is None else wrap(value)


class Script:
    """Our script in one browser. Made while the browser enters; its methods may be called from any thread.

    `heard` gets every report on the event loop, in order, and must not wait. Texts that are no reports are dropped;
    the first is logged. `Hello` comes soon after this object is made, at every connection.
    """

    def __init__(self, gui: viser.GuiApi, heard: Callable[[Report], None]) -> None:
        self._heard = heard
        self._warned = False
        self._lock = threading.Lock()
        self._copies = 0
        self._data: dict[str, object] = {}
        self._control = add_reports(gui, self._take)
        self._html = gui.add_html("")
        self._send("report", {"uuid": self._control._impl.uuid})

    def address(self, query: str) -> None:
        """What the address bar shows after "/?"; viser's own harmless keys stay. No new entry of the history."""
        if not _QUERY.fullmatch(query) or len(query) > LONGEST:
            raise ValueError(
                f"query {query[:40]!r}: at most {LONGEST} letters, digits and ._,:;=&~*+%-, the rest escaped"
            )
        self._send("address", {"query": query})

    def copy(self, text: str) -> int:
        """Put a text on the clipboard; the number that `Copied` will name."""
        return self._copy(text, link=False)

    def copy_link(self, query: str) -> int:
        """Put a link to this page on the clipboard; the browser knows its own address, a server may not."""
        return self._copy(query, link=True)

    def _copy(self, text: str, link: bool) -> int:
        with self._lock:
            self._copies += 1
            n = self._copies
        self._send("copy", {"text": text, "n": n, "link": link})
        return n

    def blink(self, nodes: Sequence[str], seconds: float = 0.5) -> None:
        """Draw one of these scene nodes at a time, `seconds` each (at least 0.4); none ends it, and so does Escape.

        Their own visibility rules again afterwards. With reduced motion the first one stays.
        """
        if not 0.4 <= seconds <= 60:
            raise ValueError(f"seconds {seconds}: from 0.4 to 60, or it flashes")
        self._send("blink", {"nodes": list(nodes), "seconds": seconds})

    def theme(self, theme: Theme, text: float = 1.0) -> None:
        """The chosen theme and size of text (1 to 2), kept in the browser.

        The page itself gets dark by `gui.configure_theme(dark_mode=is_dark(theme, hello.dark))`.
        """
        if theme not in ("auto", "light", "dark"):
            raise ValueError(f"theme {theme!r}: auto, light or dark")
        if not 1 <= text <= 2:
            raise ValueError(f"text {text}: from 1 to 2")
        self._send("theme", {"theme": theme, "text": text})

    def keys(self, on: bool) -> None:
        """Whether single keys are shortcuts; those with Ctrl, Alt or Meta always are."""
        self._send("keys", {"on": on})

    def probe(self, on: bool) -> None:
        """Whether the colours of a head are numbers: only then the page asks what is under the pointer."""
        self._send("probe", {"on": on})

    def probed(self, n: int, text: str) -> None:
        """The answer to question n of `Probe`, shown where it was asked; "": what is shown holds no more."""
        self._send("probed", {"n": n, "text": text})

    def words(self, words: dict[str, str]) -> None:
        """Section "page" of another language."""
        self._send("words", words)

    def language(self, language: str, icons: dict[str, str]) -> None:
        """The language of the page, for screen readers and spelling; names of the buttons with viser's icons."""
        self._send("lang", language)
        self._send("icons", icons)

    @property
    def elements(self) -> tuple[str, ...]:
        """Identifiers of its own elements, which stay when a panel is made anew."""
        return self._control._impl.uuid, self._html._impl.uuid

    def _send(self, kind: str, value: object) -> None:
        # All in one element: what is sent within one frame is merged, and nothing must be lost
        with self._lock:
            self._data[kind] = value
            self._html.content = "".join(data_html(*item) for item in self._data.items())

    def _take(self, text: str) -> None:
        try:
            report = read_report(text)
        except ValueError as error:
            if not self._warned:
                log_line(str(error))
            self._warned = True
            return
        # The page has ended it, else the next data would begin it again; never begun here, it may be another's
        if isinstance(report, Key) and "blink" in self._data:
            self.blink(())
        self._heard(report)


def is_dark(theme: Theme, system: bool) -> bool:
    """Whether the page is dark; `system`: whether the browser's system is (`Hello.dark`, `Dark.on`)."""
    return system if theme == "auto" else theme == "dark"
