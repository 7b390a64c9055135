"""The event by which viser's buffer wakes its connection: any thread may set it, the loop alone wakes who waits."""

from __future__ import annotations

import asyncio

from faceambig_app import server
from faceambig_app.guard.hooks import NewsEvent


def test_a_thread_marks_it_and_the_loop_wakes_who_waits():
    async def visit() -> None:
        event = NewsEvent()
        waiting = asyncio.create_task(event.wait())
        await asyncio.sleep(0)
        (future,) = event._waiters  # pyright: ignore[reportAttributeAccessIssue]
        await asyncio.to_thread(event.set)
        assert event.is_set()
        assert not future.done()  # a future is the loop's: no other thread may touch it
        event.set()
        assert await asyncio.wait_for(waiting, 5.0)

    asyncio.run(visit())


def test_the_pages_buffers_have_it():
    page = server.Page("127.0.0.1", 0)
    try:
        assert isinstance(page._server._websock_server._broadcast_buffer.message_event, NewsEvent)
    finally:
        page.close()
