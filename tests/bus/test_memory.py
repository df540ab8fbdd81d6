"""The in-memory bus goes down and comes back as the real one does with its router."""

import asyncio

import pytest

from lalliance_agents.bus.base import Delivery, Sample
from lalliance_agents.bus.memory import MemoryBus, MemoryHub

pytestmark = pytest.mark.virtual_time


async def test_while_the_hub_is_down_nobody_hears_anybody_and_then_all_holds_again() -> None:
    hub = MemoryHub()
    heard: list[bytes] = []
    news: list[tuple[str, bool]] = []
    reached: list[bool] = []
    async with MemoryBus(hub) as left, MemoryBus(hub) as right:
        await right.subscribe("m/k", lambda sample: heard.append(sample.payload))
        await right.answer("m/q", lambda _: [Sample("m/q", b"yes")])
        await right.watch_presence("m/alive/*", lambda *change: news.append(change))
        await right.watch_connection(reached.append)
        first = await left.announce_presence("m/alive/r1")
        publication = await left.publication("m/k", Delivery.STATE)
        hub.go_down()
        hub.go_down()
        publication.put(b"lost")
        assert not publication.has_listeners
        assert await left.query("m/q", timeout=3600.0) == []
        await left.announce_presence("m/alive/r2")
        await first.close()
        late: list[tuple[str, bool]] = []
        await right.watch_presence("m/alive/*", lambda *change: late.append(change))
        await asyncio.sleep(1)
        assert (news, late) == ([("m/alive/r1", True), ("m/alive/r1", False)], [])
        hub.come_back()
        hub.come_back()
        publication.put(b"again")
        assert await left.query("m/q", timeout=3600.0) == [Sample("m/q", b"yes")]
        await asyncio.sleep(1)
    assert news[2:] == late == [("m/alive/r2", True)]
    assert heard == [b"again"]
    assert reached == [True, False, True]
