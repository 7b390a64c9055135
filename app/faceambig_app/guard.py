"""Every hook into viser's internals: one page from memory, checked requests and values, errors in words.

viser is pinned: the hooks name private parts, and `start` refuses any other version. They act on servers made by
`start` alone; which server a piece of code serves is found in the context that each connection runs in. In the page
`assets/page.js` stands before viser's script; its data come through hidden elements (`data_html`) and, for colours,
a hidden cloud of points (`add_colours`).
"""

from __future__ import annotations

import asyncio
import base64
import contextlib
import errno
import gzip
import hashlib
import html
import http
import ipaddress
import json
import logging
import math
import re
import socket
import sys
import threading
import types
from collections.abc import Awaitable, Callable, Collection, Iterable, Mapping, Sequence
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import viser
import websockets.asyncio.server
import zstandard
from viser import _client_autobuild, _gui_api, _gui_handles, _messages, _scene_api, _viser
from viser.infra import _infra
from websockets import Headers
from websockets.http11 import Request, Response

from faceambig.io import asset_path

VISER = "1.1.1"
MAX_MESSAGE = 768 * 1024  # bytes; an upload arrives in parts of 512 KiB
MAX_TEXT = 10_000  # characters typed into one field
MAX_BAD = 40  # messages that mean nothing, before the connection is closed
TYPING = 0.8  # seconds: on the way to "120" the field sends 1 and 12, which are not meant
SIDE = 65_536  # pixels of a canvas

_log = logging.getLogger(__name__)
_quiet = logging.getLogger(f"{__name__}.websockets")  # its news is scanners and closed laptops
_quiet.disabled = True


class ServeError(RuntimeError):
    """The page cannot be served: one line, what is wrong and what helps."""


def _no_words(_control: Any, _asked: object, _put: object) -> str:
    return "This value cannot be set."


@dataclass(frozen=True)
class Hooks:
    """What the page is told. A call that raises costs one line in the log."""

    words: Callable[[Any, object, object], str] = _no_words  # (control, asked, put) -> the notice
    on_refused: Callable[[int, str], None] = lambda _client_id, _words: None
    on_error: Callable[[int | None, BaseException], None] = lambda _client_id, _error: None


@dataclass
class _Held:
    """A number out of range that may be half typed."""

    asked: float
    put: float
    timer: asyncio.TimerHandle


@dataclass
class _Door:
    """One server of ours: its socket, its page and the controls that wait for the end of typing."""

    listener: socket.socket
    port: int
    names: frozenset[str]  # values of Host that mean us
    keys: frozenset[str]
    page: _Page
    hooks: Hooks
    held: dict[tuple[int, str], _Held] = field(default_factory=dict)

    def failed(self, client_id: int | None, error: BaseException) -> None:
        _say(f"{type(error).__name__}: {error}")
        _log.debug("where it happened", exc_info=error)
        try:
            self.hooks.on_error(client_id, error)
        except Exception as again:  # noqa: BLE001 - the page's own code; nothing is left to tell it
            _say(f"on_error: {type(again).__name__}: {again}")

    def refuse(self, client_id: int, control: Any, asked: object, put: object) -> None:
        try:
            self.hooks.on_refused(client_id, self.hooks.words(control, asked, put))
        except Exception as error:  # noqa: BLE001 - the page's own code
            self.failed(client_id, error)

    # ------------------------------------------------------------ requests

    def answer(self, _connection: Any, request: Request) -> Response | None:
        """The answer to a request; None lets a websocket through."""
        hosts = [value.lower() for value in request.headers.get_all("Host")]
        if len(hosts) != 1 or hosts[0] not in self.names:  # another name: DNS rebinding
            return _reply(421, "This server does not go by that name.")
        path, _, query = request.path.partition("?")
        if request.headers.get_all("Upgrade"):
            origins = request.headers.get_all("Origin")
            if origins and origins != [f"http://{hosts[0]}"]:  # a page of another site
                return _reply(403, "Another page may not connect.")
            return None if path == "/" else _reply(404, "There is one page, /.")
        if path not in ("/", "/index.html"):
            return _reply(404, "There is one page, /.")
        pieces = query.split("&") if query else []
        # Compared as written: viser also obeys websocket= and playbackPath=, in any spelling.
        kept = [piece for piece in pieces if piece.partition("=")[0] in self.keys]
        if kept != pieces:
            return _reply(303, "", Location="/?" + "&".join(kept) if kept else "/")
        zipped = "gzip" in request.headers.get("Accept-Encoding", "")
        return _reply(
            200,
            self.page.zipped if zipped else self.page.text,
            **{"Content-Type": "text/html; charset=utf-8", "Vary": "Accept-Encoding"},
            **({"Content-Encoding": "gzip"} if zipped else {}),
        )

    def dress(self, _connection: Any, request: Request, response: Response) -> None:
        """Headers on every answer, those of websockets itself included."""
        if response.status_code == 101:
            return
        host = next(iter(request.headers.get_all("Host")), "").lower()
        for name, value in _HEADERS.items():
            response.headers[name] = value
        response.headers["Content-Security-Policy"] = self.page.policy(
            host if host in self.names else f"127.0.0.1:{self.port}"
        )


@dataclass(frozen=True)
class _Page:
    """The page in memory, with what its policy must name."""

    text: bytes
    zipped: bytes
    hashes: tuple[str, ...]  # of our script, viser's loader, viser's bundle

    def policy(self, host: str) -> str:
        scripts = " ".join(f"'sha256-{value}'" for value in self.hashes)
        return (
            f"default-src 'none'; script-src 'wasm-unsafe-eval' {scripts}; worker-src blob: data:; "
            "style-src 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; "
            f"connect-src 'self' ws://{host} data: blob:; "
            "object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
        )


_HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
    "X-Frame-Options": "DENY",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=()",
}


def start(
    host: str = "127.0.0.1",
    port: int = 8080,
    *,
    keys: Collection[str] = (),
    title: str = "faceambig",
    hooks: Hooks | None = None,
    script: str | None = None,
    patches: Sequence[tuple[str, str]] | None = None,
) -> viser.ViserServer:
    """A viser server on an address of this machine; port 0 takes a free one (`get_port`). Prints nothing.

    `keys` are the names that may stand in the page's address beside those of viser that do no harm. `script` and
    `patches` replace our script and our mends of viser's bundle; tests show with them what happens without.
    """
    _install()
    page = _page(
        script if script is not None else asset_path("page.js").read_text(encoding="utf-8"),
        title,
        PATCHES if patches is None else patches,
    )
    listener = _listen(host, port)
    address, port = listener.getsockname()[:2]
    names = {"localhost", f"[{address}]" if ":" in address else address}
    door = _Door(
        listener,
        port,
        frozenset(f"{name}:{port}" for name in names) | (names if port == 80 else frozenset()),
        frozenset(keys) | {"darkMode", "fixedDpr"},
        page,
        hooks or Hooks(),
    )
    global _opening
    with _opening_one:
        _opening = door
        try:
            server = viser.ViserServer(address, port, label=title, verbose=False)
        finally:
            _opening = None
    _name_failures(server, door)
    return server


def data_html(kind: str, value: object) -> str:
    """A hidden element for `gui.add_html` that our script reads.

    "title": text of the browser's tab. "pressed": label of a button group -> the option that is on.
    "valuetext": label of a slider -> what a screen reader says for its number. "icons": icon -> name of its button,
    viser's gear is "adjustments".
    """
    return (
        f'<div hidden data-faceambig="{kind}" data-json="{html.escape(json.dumps(value))}"></div>'
    )


def add_colours(scene: viser.SceneApi, parent: str, colours: np.ndarray) -> viser.PointCloudHandle:
    """Colours (V, 3) uint8 sRGB for the vertices of the meshes that stand directly below `parent`.

    Assign new ones to `.colors`; `.remove()` takes them off. A mesh of fewer vertices takes the first ones. They travel
    as a cloud of points that is never shown: in the same batch as vertices, whether or not a panel is open, which a
    hidden element is not: what is in a folded panel does not reach the page.
    """
    _check(colours)
    return scene.add_point_cloud(
        f"{parent}/colours", np.zeros(colours.shape), colours, point_size=0.001, visible=False
    )


def _check(colours: np.ndarray) -> None:
    if colours.dtype != np.uint8 or colours.ndim != 2 or colours.shape[1] != 3:
        raise ValueError(f"colours must be (V, 3) uint8, not {colours.shape} {colours.dtype}")


# ---------------------------------------------------------------- starting


def _listen(host: str, port: int) -> socket.socket:
    """A listening socket. Bound here: viser takes the next port in silence, or never comes back."""
    name = "127.0.0.1" if host == "localhost" else host.strip("[]")
    try:
        address = ipaddress.ip_address(name)  # no look-up of names, which may take its time
    except ValueError:
        raise ServeError(
            f"host {host!r}: not an address of this machine, 127.0.0.1 or ::1"
        ) from None
    if not address.is_loopback:  # nothing here asks who comes in
        raise ServeError(f"host {host}: the page is served to this machine only, 127.0.0.1 or ::1")
    if not 0 <= port <= 65535:
        raise ServeError(f"port {port}: must be from 0 to 65535")
    listener = socket.socket(socket.AF_INET if address.version == 4 else socket.AF_INET6)
    if (
        sys.platform != "win32"
    ):  # there it would share the port; here it frees it at once after a restart
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((str(address), port))
        listener.listen(128)
    except OSError as error:
        listener.close()
        if error.errno == errno.EADDRINUSE:
            raise ServeError(f"port {port} is taken: choose another one") from None
        raise ServeError(f"port {port} at {host}: {error.strerror or error}") from None
    return listener


# viser sends the changes of a panel's controls through one sender, which every 50 ms keeps the newest message: a value
# set less than 50 ms before another control changes never arrives. Ours keeps the newest of each control, in order,
# and sends what waits when its panel is closed.
_SENDER = (
    "function RL(e,t){let n=!0,r=!1,i=null,a=null;function o(s){let c=e.mutable.current;c.sendMessage!==null&&(i=s,"
    "n?(c.sendMessage(s),r=!1,n=!1,a=setTimeout(()=>{a=null,n=!0,r&&i&&o(i)},t)):r=!0)}function s(){"
    "e.mutable.current.sendMessage!==null&&i!==null&&r&&(e.mutable.current.sendMessage(i),i=null,r=!1)}"
    "function c(){a!==null&&(clearTimeout(a),a=null),n=!0,r=!1,i=null}return{send:o,flush:s,cancel:c}}"
)
_OUR_SENDER = (
    "function RL(e,t){let waiting=new Map,timer=null;"
    "function flush(){let m=e.mutable.current,all=[...waiting.values()];waiting.clear();"
    "if(m.sendMessage!==null)for(let one of all)m.sendMessage(one);return all.length>0}"
    "function pause(){timer=setTimeout(()=>{timer=null;if(flush())pause()},t)}"
    "function send(one){if(e.mutable.current.sendMessage===null)return;let key=one.type+(one.uuid??'');"
    "waiting.delete(key);waiting.set(key,one);if(timer===null){flush();pause()}}"
    "function cancel(){if(timer!==null)clearTimeout(timer);timer=null;flush()}"
    "return{send,flush,cancel}}"
)
# The canvas is told in device pixels, three to a pixel of the page on a phone; the page's own decide the layout.
_CANVAS = "image_height:o.height,image_width:o.width,fov:"
_OUR_CANVAS = "image_height:o.clientHeight,image_width:o.clientWidth,fov:"
PATCHES = ((_SENDER, _OUR_SENDER), (_CANVAS, _OUR_CANVAS))
_PACKED = re.compile(
    r'<script data-p="([^"]*)" data-ss="(\d+)" data-cs="(\d+)">(.*?)</script>', re.DOTALL
)
_UNPACKED = (
    "const code=td.decode(heap.subarray(up+ss,up+sz));"  # in the loader, which unpacks the bundle
)
# viser's packing: zstd in base 88, five characters for four bytes.
_DIGITS = "".join(chr(c) for c in range(0x21, 0x7F) if chr(c) not in "\"&'<>`")


def _page(script: str, title: str, patches: Sequence[tuple[str, str]]) -> _Page:
    """viser's page with our script before its own. The loader mends the bundle, so that it stays packed as it is."""
    if "</script" in script.lower():
        raise ServeError("page.js: must not hold the end of a script element")
    source = Path(viser.__file__).parent / "client" / "build" / "index.html"
    text = source.read_text(encoding="utf-8")
    found = _PACKED.search(text)
    if found is None or found[4].count(_UNPACKED) != 1:
        raise ServeError(f"viser {VISER}: its page is not packed as expected: install it again")
    size = int(found[2]) + int(found[3])
    code = (
        zstandard.ZstdDecompressor()
        .decompress(_from_base88(found[1]), size)[int(found[2]) :]
        .decode()
    )
    mends = ""
    for old, new in patches:
        if code.count(old) != 1:
            raise ServeError(f"viser {VISER}: its script is not as expected: install it again")
        code = code.replace(old, new)
        mends += f".replace({json.dumps(old)},()=>{json.dumps(new)})"
    loader = found[4].replace(_UNPACKED, f"{_UNPACKED[:-1]}{mends};")
    text = (
        text[: found.start()].replace(
            "<title>Viser</title>", f"<title>{html.escape(title)}</title>"
        )
        + f"<script>{script}</script>"
        + text[found.start() : found.start(4)]
        + loader
        + text[found.end(4) :]
    )
    parts = (script, loader, code)
    hashes = (base64.b64encode(hashlib.sha256(part.encode()).digest()).decode() for part in parts)
    return _Page(text.encode(), gzip.compress(text.encode(), 6), tuple(hashes))


def _from_base88(text: str) -> bytes:
    worth = np.zeros(127, np.int64)
    worth[[ord(c) for c in _DIGITS]] = np.arange(88)
    whole = len(text) // 5 * 5
    digits = worth[np.frombuffer(text.encode(), np.uint8)]
    packed = (digits[:whole].reshape(-1, 5) @ 88 ** np.arange(4, -1, -1)).astype(">u4").tobytes()
    rest = 0
    for digit in digits[whole:].tolist():
        rest = rest * 88 + digit
    return (
        packed + rest.to_bytes(4, "big")[5 - (len(text) - whole) :] if whole < len(text) else packed
    )


def _reply(status: int, body: str | bytes, **headers: str) -> Response:
    data = body if isinstance(body, bytes) else body.encode()
    every = {"Content-Type": "text/plain; charset=utf-8", "Connection": "close", **headers}
    return Response(
        status,
        http.HTTPStatus(status).phrase,
        Headers(every | {"Content-Length": str(len(data))}),
        data,
    )


def _say(text: str) -> None:
    """One line of the log, whatever is in the text."""
    _log.warning("page: %s", text[:200].encode("unicode_escape").decode())


# ---------------------------------------------------------------- hooks

_DOOR: ContextVar[_Door | None] = ContextVar("door of the running connection", default=None)
_opening: _Door | None = None
_opening_one = threading.Lock()
_installed = False

_real_serve = websockets.asyncio.server.serve
_real_consumer = _infra._message_consumer
_real_dispatch = _infra.WebsockMessageHandler._handle_incoming_message
_real_update = _gui_api.GuiApi._handle_gui_updates


def _install() -> None:
    """Put the hooks in place, once; refuse another viser."""
    global _installed
    if viser.__version__ != VISER:
        raise ServeError(
            f"viser {viser.__version__}: the page needs {VISER}: pip install viser=={VISER}"
        )
    if _installed:
        return
    doors = types.SimpleNamespace(
        asyncio=types.SimpleNamespace(
            server=types.SimpleNamespace(
                serve=_serve, ServerConnection=websockets.asyncio.server.ServerConnection
            )
        ),
        exceptions=websockets.exceptions,
        datastructures=websockets.datastructures,
    )
    hooks: list[tuple[Any, str, Any]] = [
        (_infra, "websockets", doors),
        (_infra, "_message_consumer", _consume),
        (_infra.WebsockMessageHandler, "_handle_incoming_message", _dispatch),
        (_gui_api.GuiApi, "_handle_gui_updates", _update),
        (_viser, "ViserTunnel", _NoTunnel),
        (_client_autobuild, "ensure_client_is_built", lambda: None),  # it would call npm
    ]
    reports = ("print_threadpool_errors", _future_failed), ("print_task_error", _future_failed)
    reports += (("print_awaited_callback_error", _callback_failed),)
    modules = (_gui_api, _gui_handles, _scene_api, _viser)
    hooks += [(m, name, ours) for m in modules for name, ours in reports if hasattr(m, name)]
    for owner, name, ours in hooks:
        if not hasattr(owner, name):
            raise ServeError(f"viser {VISER}: {name} is not where it was: install it again")
        setattr(owner, name, ours)
    _hush()
    _installed = True


def _hush() -> None:
    """viser prints its banner and farewell through rich.print, even when not verbose."""
    import rich

    loud = rich.print

    def quiet(*objects: Any, **options: Any) -> None:
        if not sys._getframe(1).f_globals.get("__name__", "").startswith("viser"):
            loud(*objects, **options)

    rich.print = quiet


def _serve(handler: Callable[[Any], Awaitable[None]], host: str, port: int, **options: Any) -> Any:
    """websockets' serve, on the socket of the server that is being started."""
    door = _opening
    if door is None:
        return _real_serve(handler, host, port, **options)

    async def ours(connection: Any) -> None:
        _DOOR.set(door)
        try:
            await handler(connection)
        except Exception as error:  # noqa: BLE001 - a session ends, the page goes on
            door.failed(None, error)

    return _real_serve(
        ours,
        sock=door.listener,
        process_request=door.answer,
        process_response=door.dress,
        select_subprotocol=_subprotocol,
        max_size=MAX_MESSAGE,
        max_queue=4,
        write_limit=64 * 1024,
        compression=None,  # slower than what it saves; and no bombs
        open_timeout=5,
        ping_interval=15,
        ping_timeout=15,
        close_timeout=3,
        server_header=None,
        logger=_quiet,
    )


def _subprotocol(_connection: Any, offered: Sequence[Any]) -> Any:
    return next((p for p in offered if re.fullmatch(r"viser-v[0-9a-z.+-]{1,24}", p)), None)


async def _consume(websocket: Any, handle_message: Any, message_class: Any) -> None:
    """viser's reader of one connection; ours lets through what `_FIELDS` knows."""
    if _DOOR.get() is None:
        await _real_consumer(websocket, handle_message, message_class)
        return
    bad = 0
    while True:
        raw = await websocket.recv()
        try:
            message = _checked(raw, message_class)
        except (ValueError, TypeError, RecursionError, msgspec.MsgspecError) as error:
            bad += 1
            if bad == 1:
                _say(f"a message is dropped: {error}")
            if bad >= MAX_BAD:
                await websocket.close(1008, "too many bad messages")
            continue
        handle_message(message)


def _checked(raw: object, message_class: Any) -> Any:
    if not isinstance(raw, bytes):
        raise TypeError("text instead of bytes")
    content = msgspec.msgpack.decode(raw)
    kind = content.get("type") if isinstance(content, dict) else None
    fields = _FIELDS.get(kind) if isinstance(kind, str) else None
    if fields is None:
        raise ValueError("not one that the page sends")
    if content.keys() - {"type"} != fields.keys():
        raise ValueError(f"{kind}: fields missing or unknown")
    for name, holds in fields.items():
        if not holds(content[name]):
            raise ValueError(f"{kind}: {name}")
    message = message_class.deserialize(raw)
    if kind == "ViewerCameraMessage":  # a canvas without height has no aspect
        message.image_height = max(1, message.image_height)
        message.image_width = max(1, message.image_width)
    return message


def _number(value: object, low: float = -1e9, high: float = 1e9) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and low <= value <= high


def _vector(value: object, size: int) -> bool:
    return isinstance(value, list) and len(value) == size and all(map(_number, value))


def _name(value: object) -> bool:
    return isinstance(value, str) and len(value) <= 64


_positive = partial(_number, low=1e-9)
_side = partial(_number, low=0, high=SIDE)
# What a browser may say. Not here, so dropped: the public tunnel, rendered pictures, local storage, uploads.
_FIELDS: Mapping[str, Mapping[str, Callable[[Any], bool]]] = {
    "ViewerCameraMessage": {
        "wxyz": partial(_vector, size=4),
        "position": partial(_vector, size=3),
        "fov": partial(_number, low=1e-9, high=math.pi),
        "near": _positive,
        "far": _positive,
        "image_height": _side,
        "image_width": _side,
        "look_at": partial(_vector, size=3),
        "up_direction": partial(_vector, size=3),
    },
    "GuiUpdateMessage": {"uuid": _name, "updates": lambda value: isinstance(value, dict)},
    "CommandTriggerMessage": {"uuid": _name},
}


async def _dispatch(self: Any, client_id: Any, message: Any) -> None:
    door = _DOOR.get()
    try:
        await _real_dispatch(self, client_id, message)
    except Exception as error:
        if door is None:
            raise
        door.failed(int(client_id), error)


# ---------------------------------------------------------------- values of controls


async def _update(api: Any, client_id: Any, message: Any) -> None:
    """viser sets any attribute to anything; ours sets values that the control may have."""
    door = _DOOR.get()
    if door is None:
        await _real_update(api, client_id, message)
        return
    control = api._gui_input_handle_from_uuid.get(message.uuid)
    if control is None or control._impl.removed:
        return
    before = door.held.pop((client_id, message.uuid), None)
    if before is not None:
        before.timer.cancel()
    if message.updates.keys() != {"value"} or control.disabled or not control.visible:
        _put_back(api, client_id, control)
        return
    asked = message.updates["value"]
    put, why = _nearest(control, asked)
    if why == "":
        message.updates["value"] = put
        await _real_update(api, client_id, message)
        # Leaving the field, the browser puts the nearest value itself; a longer or shorter one is still typing.
        if before is not None and put == before.put and not _typing(before.asked, put):
            door.refuse(client_id, control, before.asked, put)
    elif why == "range":
        settle = partial(_settle, door, api, client_id, control, message)
        timer = api._event_loop.call_later(TYPING, lambda: _task(settle()))
        door.held[client_id, message.uuid] = _Held(asked, put, timer)
    else:
        _put_back(api, client_id, control)
        door.refuse(client_id, control, asked, put)


async def _settle(door: _Door, api: Any, client_id: Any, control: Any, message: Any) -> None:
    """Nobody types any more: the nearest value is set, and said."""
    held = door.held.pop((client_id, message.uuid), None)
    if held is None or control._impl.removed:
        return
    message.updates["value"] = held.put
    try:
        await _real_update(api, client_id, message)
    except Exception as error:  # noqa: BLE001 - the page's handler
        door.failed(client_id, error)
    _put_back(api, client_id, control)
    door.refuse(client_id, control, held.asked, held.put)


_tasks: set[asyncio.Task[None]] = set()  # asyncio forgets tasks that nobody holds


def _task(work: Any) -> None:
    task = asyncio.get_running_loop().create_task(work)
    _tasks.add(task)
    task.add_done_callback(_tasks.discard)


def _put_back(api: Any, client_id: Any, control: Any) -> None:
    """The value that counts, to the browser that has another one."""
    client = api._resolve_client(client_id)
    if client is not None and not control._impl.is_button:
        message = _messages.GuiUpdateMessage(control._impl.uuid, {"value": control.value})
        client._websock_connection.queue_message(message)
        client.flush()


def restate(client: viser.ClientHandle, controls: Iterable[Any]) -> None:
    """Send the values of controls, those that the server has not changed too.

    A value of ours that crosses an older one of the browser's on the way is shown there and is wrong here; saying it
    once more when nobody moves ends the disagreement.
    """
    for control in controls:
        message = _messages.GuiUpdateMessage(control._impl.uuid, {"value": control.value})
        client._websock_connection.queue_message(message)


def _typing(first: object, second: object) -> bool:
    a, b = f"{first:g}", f"{second:g}"
    return a.startswith(b) or b.startswith(a)


def _nearest(control: Any, asked: Any) -> tuple[Any, str]:
    """The value to set instead, and why: "" (asked is right), "range" (a number beyond its bounds) or "kind"."""
    value, props = control.value, control._impl.props
    if isinstance(control, _gui_handles.GuiButtonHandle | _gui_handles.GuiCheckboxHandle):
        return (asked, "") if isinstance(asked, bool) else (value, "kind")
    if isinstance(control, _gui_handles.GuiDropdownHandle | _gui_handles.GuiButtonGroupHandle):
        return (asked, "") if asked in tuple(props.options) else (value, "kind")
    if isinstance(control, _gui_handles.GuiTextHandle):
        return (asked, "") if _readable(asked) else (value, "kind")
    if isinstance(control, _gui_handles.GuiSliderHandle | _gui_handles.GuiNumberHandle):
        if not _number(asked, -math.inf, math.inf) or math.isinf(asked):
            return value, "kind"
        put = _clamped(asked, props.min, props.max, whole=isinstance(value, int))
        # The browser counts steps in doubles: a hair beyond the end is the end
        return put, "" if math.isclose(put, asked, rel_tol=1e-9, abs_tol=1e-9) else "range"
    if isinstance(value, tuple) and not isinstance(control, _gui_handles.GuiUploadButtonHandle):
        return (tuple(asked), "") if _tuple_allowed(control, asked) else (value, "kind")
    return value, "kind"


def _clamped(asked: float, low: float | None, high: float | None, *, whole: bool) -> float:
    put = round(asked) if whole else asked
    if low is not None:
        put = max(put, low)
    return put if high is None else min(put, high)


def _readable(asked: object) -> bool:
    return (
        isinstance(asked, str)
        and len(asked) <= MAX_TEXT
        and not any(ord(c) < 32 and c not in "\n\t" for c in asked)
    )


def _tuple_allowed(control: Any, asked: Any) -> bool:
    """Vectors, colours and several thumbs on a slider: as many numbers as now, each in its bounds."""
    value, props = control.value, control._impl.props
    if not (isinstance(asked, list | tuple) and len(asked) == len(value)):
        return False
    if not all(_number(x) for x in asked):
        return False
    low, high = getattr(props, "min", None), getattr(props, "max", None)
    if isinstance(control, _gui_handles.GuiRgbHandle | _gui_handles.GuiRgbaHandle):
        low, high = 0, 255
    lows, highs = (b if isinstance(b, list | tuple) else [b] * len(value) for b in (low, high))
    if isinstance(control, _gui_handles.GuiMultiSliderHandle) and list(asked) != sorted(asked):
        return False
    return all(
        x == _clamped(x, a, b, whole=isinstance(v, int))
        for x, a, b, v in zip(asked, lows, highs, value, strict=True)
    )


# ---------------------------------------------------------------- errors and the tunnel


class _NoTunnel:
    """viser's public tunnel: any browser could ask for it."""

    def __init__(self, *_args: Any, **_options: Any) -> None:
        raise ServeError("the page is not published: there is no tunnel")


def _callback_failed(error: BaseException) -> None:
    door = _DOOR.get()
    if door is None:
        _say(f"{type(error).__name__}: {error}")
    else:
        door.failed(None, error)


def _future_failed(future: Any) -> None:
    if not future.cancelled() and future.exception() is not None:
        _callback_failed(future.exception())


def _name_failures(server: viser.ViserServer, door: _Door) -> None:
    """In viser's threads no connection is running: the client is found in what a callback is given."""
    submit = server._thread_executor.submit

    def named(call: Callable[..., Any], /, *args: Any, **options: Any) -> Any:
        def run() -> None:
            try:
                call(*args, **options)
            except Exception as error:  # noqa: BLE001 - the page's handler
                client_id = next(
                    (i for a in args if isinstance(i := getattr(a, "client_id", None), int)), None
                )
                door.failed(client_id, error)

        with contextlib.suppress(RuntimeError):  # a browser leaves while the server stops
            return submit(run)
        return _Nothing()

    server._thread_executor.submit = named


class _Nothing:
    """A future that never comes."""

    def add_done_callback(self, _callback: Any) -> None:
        """Nothing happens, so nothing follows."""
