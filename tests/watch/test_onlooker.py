"""What an onlooker hands on: everything, in order, or a count of what it dropped."""

import asyncio

import pytest

from lalliance_agents.bus.base import Delivery, Sample
from lalliance_agents.bus.memory import MemoryBus, MemoryHub
from lalliance_agents.clock import MissionClock
from lalliance_agents.wire.keys import WORLD, Keys, Kind
from lalliance_agents.wire.messages import DecisionMade, Event, encode
from mission_control.watch.onlooker import Onlooker
from mission_control.watch.sighting import Sighting

pytestmark = pytest.mark.virtual_time

KEYS = Keys("m")
RULES = KEYS.build(Kind.CHAOS_RULES)
DEED = KEYS.build(Kind.CHAOS_DEED)
ALIVE = KEYS.build(Kind.ALIVE, robot="left")
HOLDER = KEYS.build(Kind.LAUNCHER)
DECISION = KEYS.build(Kind.DECISION, robot="left")
EVENT = KEYS.build(Kind.EVENT)
MOTIVATION = KEYS.build(Kind.MOTIVATION, robot="left")
STATUS = KEYS.build(Kind.STATUS)


def short(sighting: Sighting) -> tuple[str, bytes, bool]:
    return sighting.key.removeprefix(KEYS.prefix), sighting.payload, sighting.gone


async def fetch(onlooker: Onlooker, count: int) -> list[tuple[str, bytes, bool]]:
    async with asyncio.timeout(5):
        return [short(await anext(onlooker)) for _ in range(count)]


async def test_all_that_is_said_and_who_comes_and_goes_is_seen_as_it_came_also_on_hidden_keys() -> None:
    hub = MemoryHub()
    async with MemoryBus(hub) as bus, MemoryBus(hub) as robot:
        await robot.announce_presence(ALIVE)
        async with Onlooker(bus, "m", MissionClock(), motivations=False) as onlooker:
            launcher = await robot.announce_presence(HOLDER)
            for key in (RULES, DEED, DECISION, MOTIVATION, "lalliance/other/world/status", STATUS):
                robot.put(key, b"\xff\x00", Delivery.STATE)
            await asyncio.sleep(0)
            await launcher.close()
            assert await fetch(onlooker, 7) == [
                ("alive/left", b"", False),
                ("@chaos/launcher", b"", False),
                ("@chaos/rules", b"\xff\x00", False),
                ("@chaos/deed", b"\xff\x00", False),
                ("mind/left/decision", b"\xff\x00", False),
                ("world/status", b"\xff\x00", False),
                ("@chaos/launcher", b"", True),
            ]
            listening = await onlooker.listen_to_motivations("left")
            robot.put(MOTIVATION, b"m", Delivery.STATE)
            robot.put(KEYS.build(Kind.MOTIVATION, robot="right"), b"m", Delivery.STATE)
            robot.put(STATUS, b"s", Delivery.STATE)
            assert await fetch(onlooker, 2) == [("mind/left/motivation", b"m", False), ("world/status", b"s", False)]
            await listening.close()
            assert onlooker.dropped == 0
        assert [one async for one in onlooker] == []


async def test_what_there_was_before_comes_first_in_the_order_in_which_it_happened_and_once() -> None:
    hub = MemoryHub()
    header = {"incarnation": 1, "at": 0.0, "trial": 1}
    made = {"verb": "activate", "task": "a", "cause": "free", "other": None, "active_for": 0.0, "factors": {}}
    second = encode(DecisionMade(sender="left", seq=7, elapsed=2.0, teammates=[], **header, **made))
    # Made while the world's clock stood still for a while, and so earlier by that clock.
    next_one = encode(DecisionMade(sender="left", seq=8, elapsed=1.5, teammates=[], **header, **made))
    first = encode(Event(sender=WORLD, seq=9, kind="trial", elapsed=0.0, text="trial 1 begins", **header))
    third = encode(Event(sender=WORLD, seq=12, kind="gone", elapsed=3.0, text="left is gone", **header))
    async with MemoryBus(hub) as bus, MemoryBus(hub) as world:
        await world.answer(EVENT, lambda _: [Sample(EVENT, first), Sample(EVENT, third)])
        await world.answer(RULES, lambda _: [Sample(RULES, b"rules")])

        def answer(_: Sample) -> list[Sample]:
            world.put(EVENT, third, Delivery.STATE)  # while the answers are under way, it is told as well
            return [Sample(DECISION, second), Sample(DECISION, next_one)]

        await world.answer(DECISION, answer)
        async with Onlooker(bus, "m", MissionClock(), motivations=False) as onlooker:
            assert [payload for _, payload, _ in await fetch(onlooker, 5)] == [b"rules", first, second, next_one, third]


async def test_what_is_not_fetched_in_time_is_dropped_and_counted_but_for_presences() -> None:
    hub = MemoryHub()
    async with (
        MemoryBus(hub) as bus,
        MemoryBus(hub) as robot,
        Onlooker(bus, "m", MissionClock(), motivations=True, capacity=3) as onlooker,
    ):
        await robot.announce_presence(ALIVE)
        for number in range(6):
            robot.put(STATUS, bytes([number]), Delivery.STATE)
        robot.put(HOLDER, b"", Delivery.STATE)
        robot.put(ALIVE, b"", Delivery.STATE)
        await asyncio.sleep(1)
        assert await fetch(onlooker, 4) == [
            ("alive/left", b"", False),
            ("world/status", b"\x03", False),
            ("world/status", b"\x04", False),
            ("world/status", b"\x05", False),
        ]
        # Nobody can pretend to be there by publishing; a hidden key is not even heard.
        assert (onlooker.overflowed, onlooker.misplaced, onlooker.dropped) == (3, 1, 4)


async def test_others_have_their_turn_however_much_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mission_control.watch.onlooker.TURN", 0.0)
    hub = MemoryHub()
    turns = 0

    async def others() -> None:
        nonlocal turns
        while True:
            turns += 1
            await asyncio.sleep(0)

    async with MemoryBus(hub) as bus, Onlooker(bus, "m", MissionClock(), motivations=False) as onlooker:
        for _ in range(100):
            bus.put(STATUS, b"s", Delivery.STATE)
        await asyncio.sleep(0)
        counting = asyncio.create_task(others())
        await fetch(onlooker, 100)
        counting.cancel()
    assert turns >= 99


async def test_what_waits_is_limited_in_bytes_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mission_control.watch.waiting.HEAVIEST", 1000)
    hub = MemoryHub()
    async with MemoryBus(hub) as bus, MemoryBus(hub) as robot:
        await robot.announce_presence(ALIVE)
        async with Onlooker(bus, "m", MissionClock(), motivations=False) as onlooker:
            for number in range(5):
                robot.put(STATUS, bytes([number]) * 300, Delivery.STATE)
            robot.put(STATUS, bytes([5]), Delivery.STATE)
            await asyncio.sleep(0)
            got = await fetch(onlooker, 5)
            assert [payload[:1] for _, payload, _ in got] == [b"", b"\2", b"\3", b"\4", b"\5"]
            assert onlooker.overflowed == 2
