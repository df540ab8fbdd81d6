"""What comes from a running mission, and whether it still does."""

import asyncio
from collections.abc import Iterator

import pytest

from lalliance_agents.bus.base import Delivery, Sample
from lalliance_agents.bus.memory import MemoryBus, MemoryHub
from lalliance_agents.wire.keys import WORLD, Keys, Kind
from lalliance_agents.wire.messages import Event, Status, encode
from mission_control.dashboard.chronicle import Chronicle
from mission_control.dashboard.feed import LiveFeed, retell
from mission_control.watch.gaps import Gap, Moment
from mission_control.watch.sighting import Sighting
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


async def test_what_happened_while_the_bus_was_down_is_shown_and_that_it_was_down() -> None:
    hub, chronicle = MemoryHub(), Chronicle(Story("m"))
    event, rules = KEYS.build(Kind.EVENT), KEYS.build(Kind.CHAOS_RULES)
    header = {"sender": WORLD, "incarnation": 1, "seq": 2, "at": 1.0, "trial": 1, "elapsed": 2.0}
    gone = encode(Event.model_validate({**header, "kind": "gone", "text": "left is gone", "robot": "left"}))
    async with MemoryBus(hub) as bus, MemoryBus(hub) as world:
        feed = LiveFeed(bus, "m", chronicle, speed=1.0)
        async with feed.followed():
            world.put(KEYS.build(Kind.STATUS), status("running", 1), Delivery.STATE)
            await asyncio.sleep(1)
            hub.go_down()
            await world.answer(event, lambda _: [Sample(event, gone)])
            await world.answer(rules, lambda _: [Sample(rules, b"")])
            await asyncio.sleep(4)
            hub.come_back()
            await asyncio.sleep(1)
        told = sorted((one["kind"], one["text"].partition(" for ")[0]) for one in chronicle.told)
        assert told == [("gap", "the bus was not reached"), ("gone", "left is gone")]
        assert [mark["kind"] for mark in chronicle.marks] == ["gone"]


async def test_the_gaps_of_a_recording_are_told_as_they_are_read() -> None:
    chronicle, gaps = Chronicle(Story("m")), list[Gap]()

    def read() -> Iterator[Sighting]:
        for number in range(2):
            yield Sighting(0, float(number), KEYS.build(Kind.STATUS), status("running", number + 1))
            gaps.append(Gap(Moment(0.0, 0, 0.0), Moment(1.0, 1, 1.0), f"gap {number}"))

    await retell(read(), chronicle, gaps)
    assert [one["text"].partition(" for ")[0] for one in chronicle.told] == ["gap 0", "gap 1"]
