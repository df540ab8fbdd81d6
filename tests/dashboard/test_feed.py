"""What comes from a running mission, and whether it still does."""

import asyncio

import pytest

from lalliance_agents.bus.base import Delivery
from lalliance_agents.bus.memory import MemoryBus, MemoryHub
from lalliance_agents.wire.keys import WORLD, Keys, Kind
from lalliance_agents.wire.messages import Status, encode
from mission_control.dashboard.chronicle import Chronicle
from mission_control.dashboard.feed import LiveFeed
from mission_control.watch.story import Story

pytestmark = pytest.mark.virtual_time

KEYS = Keys("m")


def status(stage: str, seq: int) -> bytes:
    header = {"sender": WORLD, "incarnation": 1, "seq": seq, "at": 1.0}
    fixed = {"trial": 1, "trials": 1, "learning": "adaptive", "elapsed": 1.0, "tasks": {}, "robots": {}}
    return encode(Status.model_validate({**header, **fixed, "mission": stage}))


async def test_a_mission_is_well_while_it_is_heard_and_when_it_is_over() -> None:
    hub = MemoryHub()
    async with MemoryBus(hub) as bus, MemoryBus(hub) as world:
        feed = LiveFeed(bus, "m", Chronicle(Story("m")), speed=4.0)
        async with feed.followed():
            assert feed.trouble() == "nothing has been heard of the mission"
            world.put(KEYS.build(Kind.STATUS), status("running", 1), Delivery.STATE)
            await asyncio.sleep(4)
            assert feed.trouble() == ""
            await asyncio.sleep(3)
            assert feed.trouble() == "nothing has been heard of the mission for 7 s"
            world.put(KEYS.build(Kind.STATUS), status("running", 2), Delivery.STATE)
            await asyncio.sleep(1)
            assert feed.trouble() == ""
            world.put(KEYS.build(Kind.STATUS), status("complete", 3), Delivery.STATE)
            await asyncio.sleep(60)
            assert feed.trouble() == ""
