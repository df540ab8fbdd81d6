"""Threads that Python did not start, between two of their calls."""

import asyncio
import threading

import zenoh

from lalliance_agents.bus.router import free_endpoint, open_router
from lalliance_agents.bus.session import client_settings, close_session, open_session
from lalliance_agents.bus.threads import stay_known, this_thread


async def test_a_thread_of_zenoh_s_remembers_what_it_did_in_an_earlier_call():
    loop, calls, remembered = asyncio.get_running_loop(), asyncio.Queue(), threading.local()

    def listen(raw):
        before, remembered.payload = getattr(remembered, "payload", None), raw.payload.to_bytes()
        if not this_thread.known:
            stay_known()
        loop.call_soon_threadsafe(calls.put_nowait, (threading.get_native_id(), before, remembered.payload))

    async with await open_router(free_endpoint()) as router:
        speaker, listener = [await open_session(client_settings(router.endpoint, 5.0)) for _ in range(2)]
        listener.declare_subscriber("m/k", zenoh.handlers.Callback(listen, indirect=False))
        last = {}
        async with asyncio.timeout(20):
            for number in range(100):
                while calls.empty():
                    speaker.put("m/k", b"%d" % number)
                    await asyncio.sleep(0)
                thread, before, payload = await calls.get()
                assert before == last.get(thread)
                last[thread] = payload
        await close_session(speaker)
        await close_session(listener)
