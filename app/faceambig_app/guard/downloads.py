"""Downloads: a file to one browser, a part at a time as fast as it is taken.

viser would put all parts into its buffer at once: other messages would wait behind them, and of a browser that does not
read, the whole file would stay in memory.
"""

from __future__ import annotations

import itertools
import mimetypes
import time
import uuid
from collections.abc import Callable

import viser
from viser._messages import FileTransferPart, FileTransferStartDownload, Message
from viser.infra._async_message_buffer import AsyncMessageBuffer

PART = 1024 * 1024  # bytes
AHEAD = 2  # parts that may wait in the buffer
PAUSE = 0.02  # seconds


def send_file(client: viser.ClientHandle, name: str, data: bytes, left: Callable[[], bool]) -> bool:
    """Let a browser save a file at once. Waits until it is on its way; False if the browser left before that.

    Not on the event loop.
    """
    buffer = client._websock_connection.get_message_buffer()
    transfer = uuid.uuid4().hex
    mime = mimetypes.guess_type(name, strict=False)[0] or "application/octet-stream"
    parts = range(0, len(data), PART)
    begin = FileTransferStartDownload(True, transfer, name, mime, len(parts), len(data))
    pieces = (
        FileTransferPart(None, transfer, index, data[at : at + PART])
        for index, at in enumerate(parts)
    )
    for message in itertools.chain[Message]((begin,), pieces):
        while _waiting(buffer, transfer) >= AHEAD:
            if left() or buffer.done:
                return False
            time.sleep(PAUSE)
        with buffer.sanctioned_dead_writes():  # it may leave at any moment
            client._websock_connection.queue_message(message)
        client.flush()
    return not left()


def _waiting(buffer: AsyncMessageBuffer, transfer: str) -> int:
    """Parts of a transfer that the connection has not taken yet."""
    with buffer.buffer_lock:
        return sum(
            isinstance(message, FileTransferPart) and message.transfer_uuid == transfer
            for message in buffer.message_from_id.values()
        )
