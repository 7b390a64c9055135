"""The hooks: where viser's own parts are replaced by ours, once, for all servers of ours."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import re
import sys
import threading
import types
import warnings
from collections.abc import Awaitable, Callable, Sequence
from functools import lru_cache
from typing import Any, get_type_hints

import viser
import websockets.asyncio.server
from viser import (
    _assignable_props_api,
    _client_autobuild,
    _gui_api,
    _gui_handles,
    _scene_api,
    _viser,
)
from viser.infra import _infra
from viser.infra._async_message_buffer import AsyncMessageBuffer

from .door import DOOR, Door
from .log import log_line
from .messages import MAX_MESSAGE, consume, dispatch
from .pinned import ServeError, check_viser
from .requests import answer, dress, preferred
from .sessions import SESSION, Session, produce
from .uploads import part, start
from .values import update

QUIET = logging.getLogger(f"{__package__}.websockets")  # its news is scanners and closed laptops
QUIET.disabled = True

_opening: Door | None = None
_opening_one = threading.Lock()
_installed = False

_real_cast = _assignable_props_api.AssignablePropsBase._cast_value_recursive
_real_serve = websockets.asyncio.server.serve


def opened(door: Door, address: str, title: str) -> viser.ViserServer:
    """A viser server behind a door of ours: viser calls our `serve`, which finds the door."""
    global _opening
    with _opening_one:
        _opening = door
        try:
            server = viser.ViserServer(address, door.access.port, label=title, verbose=False)
        finally:
            _opening = None
    _name_failures(server, door)
    return server


def install() -> None:
    """Put the hooks in place, once; refuse another viser."""
    global _installed
    check_viser()
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
        (_infra, "_message_consumer", consume),
        (AsyncMessageBuffer, "__init__", _buffer),
        (_infra, "_message_producer", produce),
        (_infra.WebsockMessageHandler, "_handle_incoming_message", dispatch),
        (_gui_api.GuiApi, "_handle_gui_updates", update),
        (_gui_api.GuiApi, "_handle_file_transfer_start", start),
        (_gui_api.GuiApi, "_handle_file_transfer_part", part),
        (_assignable_props_api.AssignablePropsBase, "_cast_value_recursive", _cast),
        (_assignable_props_api.AssignablePropsBase, "_prop_hints", property(_hints)),
        (_viser, "ViserTunnel", _NoTunnel),
        (_client_autobuild, "ensure_client_is_built", lambda: None),  # it would call npm
    ]
    reports = ("print_threadpool_errors", _future_failed), ("print_task_error", _future_failed)
    reports += (("print_awaited_callback_error", _callback_failed),)
    modules = (_gui_api, _gui_handles, _scene_api, _viser)
    hooks += [(m, name, ours) for m in modules for name, ours in reports if hasattr(m, name)]
    for owner, name, ours in hooks:
        setattr(owner, name, ours)
    _hush()
    _installed = True


class NewsEvent(asyncio.Event):
    """Set by any thread: off the loop it is a mark and wakes nobody, for viser sets it once more on the loop.

    A plain one goes through those who wait, while the loop takes them in and out: "deque mutated during iteration", and
    the frame that a worker was sending is lost.
    """

    def set(self) -> None:
        try:
            asyncio.get_running_loop()
        except RuntimeError:
            self._value = True
            return
        self._value = False  # it may be marked, with somebody waiting
        super().set()


_real_buffer = AsyncMessageBuffer.__init__


def _buffer(self: AsyncMessageBuffer, *arguments: Any, **options: Any) -> None:
    _real_buffer(self, *arguments, **options)
    self.message_event = NewsEvent()


def _hush() -> None:
    """viser prints its banner and farewell through rich.print, even when not verbose.

    And it warns when something is sent to a browser that has just gone: a worker may be drawing for it.
    """
    import rich

    warnings.filterwarnings("ignore", "Queued a .* on a closed connection", UserWarning)

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
        cookies = connection.request.headers.get_all("Cookie")
        if door.full(cookies):  # several came in at once
            await connection.close(1013, "too many browsers")
            return
        session = Session(
            door.limits,
            connection,
            leads=door.access.leads(cookies),
            languages=preferred(connection.request.headers.get_all("Accept-Language")),
        )
        DOOR.set(door)
        SESSION.set(session)
        door.sessions.add(session)
        try:
            await handler(connection)
        except Exception as error:  # noqa: BLE001 - a session ends, the page goes on
            door.failed(None, error)
        finally:
            door.sessions.discard(session)
            session.end()

    return _real_serve(
        ours,
        sock=door.listener,
        process_request=lambda at, request: answer(door, _address(at), request),
        process_response=lambda at, request, response: dress(door, _address(at), request, response),
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
        logger=QUIET,
    )


def _address(connection: Any) -> str:
    """The address of this machine at which somebody has come."""
    return connection.local_address[0]


def _subprotocol(_connection: Any, offered: Sequence[Any]) -> Any:
    return next((p for p in offered if re.fullmatch(r"viser-v[0-9a-z.+-]{1,24}", p)), None)


def _cast(self: Any, hint: Any, value: Any, prop_name: str) -> Any:
    """viser's, asked only where it may change something: it makes four types to compare with, at every assignment."""
    if value is None or isinstance(value, str | bool | int | float):
        return value
    return _real_cast(self, hint, value, prop_name)


def _hints(self: Any) -> dict[str, Any]:
    """viser's, which reads the types of a control's properties anew for every control: half the time of a panel."""
    return _hints_of(type(self._impl.props))


_hints_of = lru_cache(maxsize=256)(get_type_hints)


class _NoTunnel:
    """viser's public tunnel: any browser could ask for it."""

    def __init__(self, *_args: Any, **_options: Any) -> None:
        raise ServeError("the page is not published: there is no tunnel")


def _callback_failed(error: BaseException) -> None:
    door = DOOR.get()
    if door is None:
        log_line(f"{type(error).__name__}: {error}")
    else:
        door.failed(None, error)


def _future_failed(future: Any) -> None:
    if not future.cancelled() and future.exception() is not None:
        _callback_failed(future.exception())


def _name_failures(server: viser.ViserServer, door: Door) -> None:
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
