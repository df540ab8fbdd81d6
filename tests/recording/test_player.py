"""A replay on a bus in memory: what is shown, when, and to whom; and what it refuses."""

import asyncio
from collections.abc import Iterable
from pathlib import Path

import pytest
from recording.made_up import KEYS, activity, event, mixture, seen, write

from lalliance_agents.bus.base import Sample
from lalliance_agents.bus.memory import MemoryBus, MemoryHub
from lalliance_agents.clock import MissionClock
from lalliance_agents.errors import UserError
from lalliance_agents.wire.keys import Kind
from lalliance_agents.wire.messages import MAX_PAYLOAD
from mission_control.recording.pace import Pace
from mission_control.recording.player import WINDOW, Played, Player, check_quiet
from mission_control.recording.reader import Recording
from mission_control.watch.onlooker import Onlooker
from mission_control.watch.sighting import Sighting

pytestmark = pytest.mark.virtual_time

ALIVE = KEYS.build(Kind.ALIVE, robot="lifter")
HELLO = KEYS.build(Kind.HELLO, robot="lifter")
TASK = KEYS.build(Kind.SENSE_TASK, task="crate")
EVENT = KEYS.build(Kind.EVENT)
ACTIVITY = KEYS.build(Kind.ACTIVITY, robot="lifter", task="crate")


def shown() -> list[Sighting]:
    """What a replay shows of the mixture: nobody speaks on the key of a presence."""
    return [one for one in mixture() if one.key != ALIVE or not one.payload]


class Stage:
    """A recording, a player of it, and somebody who looks on."""

    def __init__(self, path: Path, what: Iterable[Sighting], *, rate: float = 1.0, start: float = 0.0) -> None:
        self.hub = MemoryHub()
        self.pace = Pace(rate)
        self.seen: list[tuple[float, str, bytes, bool]] = []
        self._recording = Recording(write(path / "a.mcap", what))
        self._start = start

    async def play(self) -> Played:
        clock = MissionClock()
        async with MemoryBus(self.hub) as bus, MemoryBus(self.hub) as witness, MemoryBus(self.hub) as other:
            async with Onlooker(other, "depot", clock, motivations=True) as onlooker:
                player = Player(self._recording, bus, witness, self.pace, start=self._start)
                played = await player.play()
            async for one in onlooker:
                self.seen.append((round(one.now, 3), one.key, one.payload, one.gone))
        return played


async def test_all_is_shown_in_order_and_at_its_time(tmp_path: Path) -> None:
    stage = Stage(tmp_path, mixture(), rate=2.0)
    played = await stage.play()
    assert played == Played(published=8, presences=3, refused=1, arrived=8)
    assert stage.seen == [(round(one.now / 2, 3), one.key, one.payload, one.gone) for one in shown()]


async def test_a_replay_can_be_stopped_for_a_while(tmp_path: Path) -> None:
    stage = Stage(tmp_path, mixture())
    loop = asyncio.get_running_loop()
    loop.call_later(1.0, stage.pace.toggle)
    loop.call_later(101.0, stage.pace.toggle)
    await stage.play()
    expected = [round(one.now + (100.0 if one.now > 1.0 else 0.0), 3) for one in shown()]
    assert [at for at, *_ in stage.seen] == expected


async def test_who_comes_late_is_answered_as_the_owners_answered(tmp_path: Path) -> None:
    happened = [event(number, f"event {number}") for number in range(3)]
    what = [
        seen(0.0, ALIVE),
        seen(0.0, HELLO, b"first"),
        seen(1.0, HELLO, b"second"),
        seen(1.0, TASK, b"open"),
        *(seen(1.0 + number, EVENT, one) for number, one in enumerate(happened)),
        seen(5.0, TASK, b"done"),
        seen(6.0, ALIVE, gone=True),
        seen(9.0, ACTIVITY, activity(1)),
    ]
    stage = Stage(tmp_path, what)
    playing = asyncio.create_task(stage.play())
    async with MemoryBus(stage.hub) as late:

        async def asked(pattern: str) -> list[bytes]:
            return [sample.payload for sample in await late.query(pattern, timeout=1.0)]

        await asyncio.sleep(2.5)
        assert await asked(KEYS.build(Kind.HELLO)) == [b"second"]
        assert await asked(TASK) == [b"open"]
        assert await asked(EVENT) == happened[:2]
        await asyncio.sleep(5.0)
        # The robot is not there any more to answer.
        assert await asked(KEYS.build(Kind.HELLO)) == []
        assert await asked(KEYS.build(Kind.SENSE_TASK)) == [b"done"]
    await playing


async def test_one_that_begins_later_knows_what_was_before(tmp_path: Path) -> None:
    what = [
        seen(0.0, ALIVE),
        seen(0.0, KEYS.build(Kind.LAUNCHER)),
        seen(0.5, TASK, b"open"),
        seen(1.0, KEYS.build(Kind.LAUNCHER), gone=True),
        seen(4.0, ACTIVITY, activity(1)),
        seen(9.0, ACTIVITY, activity(2)),
    ]
    stage = Stage(tmp_path, what, start=3.0)
    playing = asyncio.create_task(stage.play())
    async with MemoryBus(stage.hub) as late:
        await asyncio.sleep(2.0)
        assert await late.query(TASK, timeout=1.0) == [Sample(TASK, b"open")]
    assert await playing == Played(before=4, published=2, arrived=2)
    assert stage.seen[:3] == [
        (0.0, ALIVE, b"", False),
        (1.0, ACTIVITY, activity(1), False),
        (6.0, ACTIVITY, activity(2), False),
    ]


async def test_a_flood_loses_nothing(tmp_path: Path) -> None:
    flood = [seen(0.0, ACTIVITY, b"%d" % number) for number in range(20 * WINDOW)]
    stage = Stage(tmp_path, flood)
    assert await stage.play() == Played(published=20 * WINDOW, arrived=20 * WINDOW)
    assert [payload for _, _, payload, _ in stage.seen] == [one.payload for one in flood]


async def test_what_does_not_arrive_is_counted(tmp_path: Path) -> None:
    class Lossy(MemoryBus):
        def put(self, key, payload, delivery):
            if payload != b"3":
                super().put(key, payload, delivery)

    hub = MemoryHub()
    recording = Recording(write(tmp_path / "a.mcap", [seen(0.0, ACTIVITY, b"%d" % number) for number in range(5)]))
    async with Lossy(hub) as bus, MemoryBus(hub) as witness:
        played = await Player(recording, bus, witness, Pace(1.0)).play()
    assert played == Played(published=5, arrived=4, lost=1)


async def test_what_no_bus_takes_is_counted_and_not_published(tmp_path: Path) -> None:
    what = [
        seen(0.0, f"{KEYS.prefix}{'x' * 600}", b"a key too long"),
        seen(0.0, "lalliance/elsewhere/world/event", b"of another mission"),
        seen(0.0, ACTIVITY, b"x" * (MAX_PAYLOAD + 1)),
        seen(0.0, ACTIVITY, b"good"),
    ]
    stage = Stage(tmp_path, what)
    assert await stage.play() == Played(published=1, refused=3, arrived=1)
    assert [payload for _, _, payload, _ in stage.seen] == [b"good"]


@pytest.mark.parametrize("sign", ["presence", "answer", "message"])
async def test_it_is_refused_where_the_mission_is_live(sign: str) -> None:
    hub = MemoryHub()
    async with MemoryBus(hub) as robot, MemoryBus(hub) as bus:
        await check_quiet(bus, "depot", "tcp/here:1")
        if sign == "presence":
            await robot.announce_presence(ALIVE)
        elif sign == "answer":
            await robot.answer(KEYS.build(Kind.SENSE_TASK), lambda _: [Sample(TASK, b"open")])
        else:
            loop = asyncio.get_running_loop()
            loop.call_later(0.5, robot.put, KEYS.build(Kind.STATUS), b"going on", "telemetry")
        with pytest.raises(UserError, match="mission depot is live on the bus at tcp/here:1"):
            await check_quiet(bus, "depot", "tcp/here:1")
        await check_quiet(bus, "another", "tcp/here:1")
