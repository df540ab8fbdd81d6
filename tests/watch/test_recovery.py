"""What happened while the bus was away is told afterwards: once, in its order, and the same in a recording."""

import asyncio
import contextlib
from collections.abc import AsyncIterator
from typing import Any

import msgpack
import pytest

from lalliance_agents.bus.base import Delivery, Sample
from lalliance_agents.bus.memory import MemoryBus, MemoryHub
from lalliance_agents.clock import MissionClock
from lalliance_agents.wire.keys import WORLD, Keys, Kind
from lalliance_agents.wire.messages import BODY_OF, encode
from mission_control.watch.absence import told_of_absence
from mission_control.watch.gaps import DESERTED, DOWN, Gap
from mission_control.watch.onlooker import AGAIN, HOLD, Onlooker

pytestmark = pytest.mark.virtual_time

KEYS = Keys("m")
ALIVE = KEYS.build(Kind.ALIVE, robot="left")
RULES = KEYS.build(Kind.CHAOS_RULES)
EVENT = KEYS.build(Kind.EVENT)
STATUS = KEYS.build(Kind.STATUS)
TASK = KEYS.build(Kind.SENSE_TASK, task="a")


class World:
    """Remembers what it tells, as a world does."""

    def __init__(self, hub: MemoryHub) -> None:
        self.bus = MemoryBus(hub)
        self.told: list[Sample] = []
        self._seq = 0

    async def answers(self) -> None:
        await self.bus.answer(EVENT, lambda _: list(self.told))
        await self.bus.answer(RULES, lambda _: [Sample(RULES, b"rules")])

    def happens(self, text: str) -> None:
        self._seq += 1
        header = {"sender": WORLD, "incarnation": 1, "seq": self._seq, "at": 0.5}
        fields = {"kind": "present", "elapsed": float(self._seq), "trial": 1, "text": text}
        self.told.append(Sample(EVENT, encode(BODY_OF[Kind.EVENT](**header, **fields))))
        self.bus.put(EVENT, self.told[-1].payload, Delivery.STATE)


class Ears:
    """What an onlooker handed on, in short, and the gaps it noticed."""

    def __init__(self) -> None:
        self.heard: list[str] = []
        self.gaps: list[Gap] = []

    @contextlib.asynccontextmanager
    async def open(self, hub: MemoryHub, **options: Any) -> AsyncIterator[Onlooker]:
        async with (
            MemoryBus(hub) as bus,
            Onlooker(bus, "m", MissionClock(), motivations=False, notice=self.gaps.append, **options) as onlooker,
        ):
            hearing = asyncio.create_task(self._hear(onlooker))
            yield onlooker
        await hearing

    async def _hear(self, onlooker: Onlooker) -> None:
        async for one in onlooker:
            if one.key == EVENT:
                self.heard.append(BODY_OF[Kind.EVENT].model_validate(unpacked(one.payload)).text)  # type: ignore[attr-defined]
            elif one.key == ALIVE:
                self.heard.append("gone" if one.gone else "there")
            elif one.key != RULES:
                self.heard.append(one.payload.decode())

    def since(self) -> list[str]:
        heard, self.heard = self.heard, []
        return heard


def unpacked(payload: bytes) -> Any:
    return msgpack.unpackb(payload)


async def test_what_happened_while_the_bus_was_down_is_told_once_and_before_what_came_then() -> None:
    hub, ears = MemoryHub(), Ears()
    world = World(hub)
    await world.answers()
    world.happens("one")
    async with ears.open(hub) as onlooker:
        await world.bus.announce_presence(ALIVE)
        world.happens("two")
        await asyncio.sleep(1)
        assert ears.since() == ["one", "there", "two"]
        hub.go_down()
        world.happens("three")
        await asyncio.sleep(5)
        assert (ears.since(), onlooker.away_for) == (["gone"], 6.0)
        world.happens("four")
        hub.come_back()
        world.happens("five")
        await asyncio.sleep(1)
        assert ears.since() == ["three", "four", "there", "five"]
        assert onlooker.away_for is None
    [gap] = ears.gaps
    assert (gap.why, gap.lasts, gap.answered, gap.recovered) == (DOWN, pytest.approx(6.0, abs=1.1), True, 2)


async def test_a_world_that_comes_back_later_is_asked_then_and_others_do_not_wait_for_it_for_long() -> None:
    hub, ears = MemoryHub(), Ears()
    world = World(hub)
    await world.answers()
    async with ears.open(hub):
        hub.go_down()
        world.happens("one")
        await world.bus.close()
        other = World(hub)
        other.told, other._seq = world.told, 1
        await asyncio.sleep(5)
        hub.come_back()
        other.bus.put(TASK, b"a robot", Delivery.STATE)
        await asyncio.sleep(HOLD - 0.1)
        assert ears.since() == []
        await asyncio.sleep(AGAIN + 0.1)
        assert ears.since() == ["a robot"]
        assert [(gap.answered, gap.recovered) for gap in ears.gaps] == [(False, 0)]
        await asyncio.sleep(60)
        await other.answers()
        await asyncio.sleep(AGAIN)
        assert ears.since() == ["one"]
    assert len(ears.gaps) == 1


async def test_it_asks_again_when_everybody_was_away_and_when_the_world_was_silent() -> None:
    hub, ears = MemoryHub(), Ears()
    world = World(hub)
    await world.answers()

    def unheard(text: str) -> None:
        world.bus, bus = MemoryBus(MemoryHub()), world.bus
        world.happens(text)
        world.bus = bus

    async with ears.open(hub):
        there = await world.bus.announce_presence(ALIVE)
        world.happens("one")
        await asyncio.sleep(1)
        await there.close()
        unheard("two")
        await asyncio.sleep(10)
        await world.bus.announce_presence(ALIVE)
        await asyncio.sleep(AGAIN)
        assert ears.since() == ["there", "one", "gone", "two", "there"]
        assert [(gap.why, gap.recovered) for gap in ears.gaps] == [(DESERTED, 1)]
        for _ in range(5):
            world.bus.put(STATUS, b"", Delivery.STATE)
            await asyncio.sleep(0.25)
        unheard("three")
        await asyncio.sleep(5)
        assert ears.since() == [""] * 5
        world.bus.put(STATUS, b"", Delivery.STATE)
        await asyncio.sleep(AGAIN)
        assert sorted(ears.since()) == ["", "three"]
    assert len(ears.gaps) == 1


async def test_without_anybody_who_answers_it_asks_twice_and_who_does_not_ask_only_notices() -> None:
    hub = MemoryHub()
    for options in ({"asks": True}, {"asks": False}, {"only": TASK}):
        ears = Ears()
        async with ears.open(hub, **options):
            hub.go_down()
            await asyncio.sleep(3)
            hub.come_back()
            await asyncio.sleep(2 * AGAIN)
            assert [(gap.answered, gap.recovered) for gap in ears.gaps] == [(False, 0)]
            await asyncio.sleep(10)
        assert len(ears.gaps) == 1


async def test_a_gap_that_has_no_end_is_noticed_at_the_end() -> None:
    hub, ears = MemoryHub(), Ears()
    async with ears.open(hub):
        hub.go_down()
        await asyncio.sleep(3)
        assert ears.gaps == []
    assert [(gap.why, gap.answered) for gap in ears.gaps] == [(DOWN, False)]


async def test_last_values_are_told_again_only_if_they_changed() -> None:
    hub, ears = MemoryHub(), Ears()
    values = [b"first"]
    async with MemoryBus(hub) as owner:
        await owner.answer(TASK, lambda _: [Sample(TASK, values[0])])
        async with ears.open(hub, only=TASK):
            for value in (b"first", b"second"):
                hub.go_down()
                values[0] = value
                await asyncio.sleep(1)
                hub.come_back()
                await asyncio.sleep(1)
    assert ears.since() == ["first", "second"]


async def test_that_the_bus_is_away_is_told_now_and_then_and_that_it_is_back(
    capsys: pytest.CaptureFixture[str],
) -> None:
    hub, ears = MemoryHub(), Ears()
    async with ears.open(hub) as onlooker, told_of_absence(onlooker, "tcp/there:1"):
        for lasts in (1.0, 9.0):
            hub.go_down()
            await asyncio.sleep(lasts)
            hub.come_back()
            await asyncio.sleep(1)
    told = [line.removeprefix("lalliance: warning: the bus ") for line in capsys.readouterr().err.splitlines()]
    assert told == [
        "has not been reached for 2 s at tcp/there:1; waiting for it",
        "has not been reached for 8 s at tcp/there:1; waiting for it",
        "at tcp/there:1 is reached again",
    ]
