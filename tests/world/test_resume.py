"""A world server that goes on where another was killed, over the memory bus: nothing is forgotten, nothing happens twice."""

import asyncio
import contextlib
import random
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest
from support.team import Team

from lalliance_agents.bus.base import Answer, Delivery, Registration, Sample
from lalliance_agents.bus.memory import MemoryBus, MemoryHub
from lalliance_agents.bus.messenger import Messenger
from lalliance_agents.mission_file import parse_mission
from lalliance_agents.wire.keys import LAUNCHER, Key, Keys, Kind
from lalliance_agents.wire.messages import BODY_OF, ChaosCommand, Event, Message, Status, TaskState, decode, encode
from world_server.history import recall
from world_server.journal import Journal
from world_server.server import RETURN_TIMEOUT, WorldServer

pytestmark = pytest.mark.virtual_time

PAIR = """
name: pair
tasks: {a: {}, b: {after: [a]}, c: {}}
robots:
  left: {tasks: {a: 4, b: 8}}
  right: {tasks: {a: 8, b: 4, c: 6}}
  late: {joins: 3, tasks: {c: 1}}
faults: [{at: 2, robot: left, kind: crash, restart: true, until: 4}]
deadline: 100
"""


class Stage:
    """A mission's bus, with a test that plays the robots and the launcher, and one world server after the other."""

    def __init__(self, folder: Path) -> None:
        self.mission = parse_mission(PAIR, "test.yaml")
        self.path = folder / "journal"
        self.keys = Keys(self.mission.name)
        self.hub = MemoryHub()
        self.bus = MemoryBus(self.hub)
        self.loop = asyncio.get_running_loop()
        self.heard: list[tuple[float, Message]] = []
        self.voices: dict[str, Messenger] = {}
        self.presences: dict[str, Registration] = {}
        self.lives = 0

    def voice(self, name: str) -> Messenger:
        if name not in self.voices:
            self.voices[name] = Messenger(self.bus, self.keys, name, 1, self.loop.time)
        return self.voices[name]

    async def listen(self) -> None:
        for kind in (Kind.SENSE_TASK, Kind.SENSE_ROBOT, Kind.EVENT, Kind.STATUS):
            await self.voice("@ear").listen(
                self.keys.build(kind), lambda _, m: self.heard.append((self.loop.time(), m))
            )

    @contextlib.asynccontextmanager
    async def served(self, seconds: float | None = None, *, speed: float = 1.0) -> AsyncIterator["asyncio.Task[Any]"]:
        """A world server that is killed at the end: what it has not committed is gone, and nobody hears of it any more."""
        self.lives += 1
        bus = MemoryBus(self.hub)
        with Journal(self.path, self.mission) as journal:
            server = WorldServer(self.mission, bus=bus, incarnation=1, speed=speed, journal=journal)
            task = asyncio.create_task(server.run())
            yield task
            if seconds is not None:
                await asyncio.sleep(seconds)
            bus.kill()
            task.cancel()
            await asyncio.wait({task})

    async def appear(self, *robots: str) -> None:
        for robot in robots:
            self.presences[robot] = await self.bus.announce_presence(self.keys.build(Kind.ALIVE, robot=robot))
        await asyncio.sleep(0.1)

    def act(self, robot: str, task: str | None) -> None:
        self.voice(robot).send(Kind.ACTION, task=task, trial=1, fewest=0)

    def events(self) -> list[str]:
        return [m.text for _, m in self.heard if isinstance(m, Event) and m.kind != "order"]

    def orders(self) -> set[tuple[Any, Any, str | None]]:
        events = [m for _, m in self.heard if isinstance(m, Event) and m.kind == "order"]
        return {(m.details["number"], m.details["deed"], m.robot) for m in events}

    def status(self) -> Status:
        return [m for _, m in self.heard if isinstance(m, Status)][-1]


@pytest.fixture
async def stage(tmp_path: Path) -> AsyncIterator[Stage]:
    built = Stage(tmp_path)
    await built.listen()
    yield built
    await built.bus.close()


async def test_mission_time_stands_still_while_no_world_server_runs(stage: Stage) -> None:
    async with stage.served():
        await stage.appear("left", "right")
        stage.act("left", "a")
        await asyncio.sleep(1.0)
    before = stage.status()
    await asyncio.sleep(500.0)
    stage.heard.clear()
    async with stage.served():
        await asyncio.sleep(0.02)
        stage.act("left", "a")
        await asyncio.sleep(0.5)
    assert before.elapsed == pytest.approx(1.0, abs=0.3)
    assert stage.status().elapsed == pytest.approx(before.elapsed + 0.5, abs=0.3)
    assert stage.status().tasks["a"]["progress"] == pytest.approx(stage.status().elapsed / 4, abs=0.1)
    assert {m.incarnation for _, m in stage.heard} == {2}
    assert stage.events() == []


async def test_who_does_not_come_back_is_gone_at_the_instant_at_which_the_mission_goes_on(stage: Stage) -> None:
    async with stage.served():
        await stage.appear("left", "right")
        await asyncio.sleep(1.0)
    elapsed = stage.status().elapsed
    await stage.presences["right"].close()
    stage.heard.clear()
    resumed = stage.loop.time()
    async with stage.served():
        await asyncio.sleep(RETURN_TIMEOUT - 0.1)
        assert not [m for _, m in stage.heard if isinstance(m, Status)]
        await asyncio.sleep(0.2)
    assert stage.events() == ["right is gone"]
    [(at, gone)] = [(at, m) for at, m in stage.heard if isinstance(m, Event)]
    assert (at - resumed, gone.elapsed) == pytest.approx((RETURN_TIMEOUT, elapsed), abs=0.3)


async def test_all_who_were_there_are_awaited_and_nobody_longer_than_that(stage: Stage) -> None:
    async with stage.served():
        await stage.appear("left", "right")
        await asyncio.sleep(0.5)
    stage.heard.clear()
    resumed = stage.loop.time()
    async with stage.served(0.3):
        pass
    assert min(at for at, _ in stage.heard) - resumed < 0.1
    for presence in stage.presences.values():
        await presence.close()
    stage.heard.clear()
    resumed = stage.loop.time()
    async with stage.served():
        await asyncio.sleep(0.5)
        await stage.appear("right")
        await stage.appear("left")
        await asyncio.sleep(0.1)
    assert min(at for at, _ in stage.heard) - resumed == pytest.approx(0.6, abs=0.05)
    assert stage.events() == []


async def test_orders_keep_their_numbers_and_what_was_carried_out_meanwhile_is_seen(stage: Stage) -> None:
    async with stage.served():
        await stage.appear("left", "right")
        await stage.bus.announce_presence(stage.keys.build(Kind.LAUNCHER))
        await asyncio.sleep(2.3)
    assert stage.orders() == {(2, "kill", "left")}
    stage.heard.clear()
    async with stage.served(0.5):
        pass
    assert stage.orders() == {(2, "kill", "left")}
    await stage.presences["left"].close()
    stage.heard.clear()
    async with stage.served(RETURN_TIMEOUT + 2.0):
        pass
    assert stage.events() == ["left is gone", "fault is over: crash of left"]
    assert stage.orders() == {(1, "start", "late"), (3, "start", "left")}
    world = recall(stage.path, stage.mission)
    [crash] = world.summary()["faults"]
    assert (crash["fired"], crash["count"], crash["state"]) == (True, 1, "over")
    assert world.has_launcher


async def test_a_finished_mission_is_told_again_and_the_summary_is_the_same(stage: Stage) -> None:
    report = {"sent": 3, "received": 2, "dropped": {}, "teammates": {}, "ticks": 5, "missed": 0}
    async with stage.served(speed=20.0) as task:
        await stage.appear("left", "right")
        for _ in range(500):
            left = "a" if not stage.status().tasks["a"]["complete"] else "b"
            stage.act("left", left)
            stage.act("right", "c")
            await asyncio.sleep(0.05)
            if stage.status().mission == "complete":
                break
        for robot in ("left", "right"):
            stage.voice(robot).send(Kind.LINK, **report, final=True)
        first = await task
    assert first["complete"]
    stage.heard.clear()
    async with stage.served() as task:
        assert await task == first
        await asyncio.sleep(0.01)
    assert stage.status().mission == "complete"
    assert stage.events() == []


class Watched(MemoryBus):
    """A bus that looks, whenever something leaves it, whether what it says could still be forgotten."""

    def __init__(self, hub: MemoryHub, journal: Journal) -> None:
        super().__init__(hub)
        self._journal = journal
        self.left = 0
        self.told: list[tuple[str, bytes]] = []

    def put(self, key: str, payload: bytes, delivery: Delivery) -> None:
        self._look()
        self.told.append((key, payload))
        super().put(key, payload, delivery)

    async def answer(self, pattern: str, handler: Answer) -> Any:
        def watched(ask: Sample) -> list[Sample]:
            replies = handler(ask)
            self._look()
            return replies

        return await super().answer(pattern, watched)

    def _look(self) -> None:
        assert self._journal.is_committed
        self.left += 1


async def test_nothing_is_told_before_what_it_is_based_on_is_committed(stage: Stage) -> None:
    with Journal(stage.path, stage.mission) as journal:
        bus = Watched(stage.hub, journal)
        task = asyncio.create_task(WorldServer(stage.mission, bus=bus, incarnation=1, journal=journal).run())
        await stage.appear("left", "right")
        await stage.bus.announce_presence(stage.keys.build(Kind.LAUNCHER))
        draw = random.Random(1)
        commands = [("inject", '{"robot": "right", "kind": "mute"}'), ("heal", ""), ("status", ""), ("inject", "{}")]
        for number in range(200):
            await asyncio.sleep(draw.uniform(0.0, 0.1))
            stage.act("left", draw.choice(["a", "b", None]))
            for kind in (Kind.SENSE_TASK, Kind.SENSE_ROBOT, Kind.CHAOS_RULES):
                stage.act("right", draw.choice(["b", "c"]))
                assert await stage.bus.query(stage.keys.build(kind), timeout=1.0)
            verb, fault = commands[number % 4]
            header = {"sender": "@operator", "incarnation": 1, "seq": number, "at": 0.0}
            command = encode(ChaosCommand(**header, verb=verb, fault=fault))  # type: ignore[arg-type]
            stage.act("right", "c")
            assert await stage.bus.query(stage.keys.build(Kind.CHAOS_COMMAND), command, timeout=1.0)
            if number == 100:
                await stage.presences["left"].close()
        assert not task.done()
        assert bus.left > 1000
        task.cancel()
        await asyncio.wait({task})
    world = recall(stage.path, stage.mission)
    complete = {task for task, view in world.tasks().items() if view.complete}
    assert "c" in complete
    assert complete == {m.task for m in told(stage.keys, bus) if isinstance(m, Event) and m.kind == "complete"}


def told(keys: Keys, bus: Watched) -> list[Message]:
    parsed = [(keys.parse(key), payload) for key, payload in bus.told]
    return [decode(BODY_OF[key.kind], payload) for key, payload in parsed]


TEAM = """
name: team
tasks: {a: {}, b: {after: [a]}, c: {}, d: {arrives: 20}, e: {after: [d]}, f: {}}
robots:
  one: {tasks: {a: 20, b: 30, c: 25, d: 10}}
  two: {tasks: {a: 30, b: 20, e: 25, f: 30}}
  three: {tasks: {c: 20, d: 20, e: 20, f: 25}}
  four: {joins: 15, tasks: {b: 15, f: 20}}
knowledge: given
faults:
  - {at: 12, robot: one, kind: crash, restart: true, until: 30}
  - {at: 25, robot: three, kind: crash}
deadline: 500
"""


@pytest.mark.parametrize("seed", range(5))
async def test_a_team_whose_world_is_killed_at_fifty_random_instants_does_what_it_does_without(
    tmp_path: Path, seed: int
) -> None:
    draw = random.Random(seed)
    async with Team(TEAM) as team:
        team.start_all()
        journal = tmp_path / "journal"
        for _ in range(50):
            bus = MemoryBus(team.hub)
            with Journal(journal, team.mission) as kept:
                serving = asyncio.create_task(WorldServer(team.mission, bus=bus, incarnation=1, journal=kept).run())
                await asyncio.sleep(draw.choice([0.0, 0.01, 0.2, 1.0, 2.0]) * draw.random())
                assert not serving.done()
                bus.kill()
                serving.cancel()
                await asyncio.wait({serving})
            await asyncio.sleep(draw.random())
        with Journal(journal, team.mission) as kept:
            async with MemoryBus(team.hub) as bus:
                summary = await WorldServer(team.mission, bus=bus, incarnation=1, journal=kept).run()
        check(team, summary)


def check(team: Team, summary: dict[str, Any]) -> None:
    """Every task complete once, by who worked on it; every fault fired once; what was told as done stayed done."""
    assert summary["complete"]
    assert [task for task, facts in summary["tasks"].items() if facts["completed_at"] is None] == []
    for facts in summary["tasks"].values():
        assert facts["by"]
        assert {attempt["robot"] for attempt in facts["attempts"]} >= set(facts["by"])
        instants = [attempt["at"] for attempt in facts["attempts"]]
        assert instants == sorted(instants)
        assert all(instant <= facts["completed_at"] for instant in instants)
    assert [(fault["fired"], fault["count"]) for fault in summary["faults"]] == [(True, 1)] * 2
    states = [(key, m) for key, m in team.messages if isinstance(m, TaskState)]
    for task in team.mission.tasks:
        complete = [m.complete for key, m in states if key == Key(Kind.SENSE_TASK, task=task)]
        assert complete == sorted(complete)
    completions = [m.task for _, m in team.messages if isinstance(m, Event) and m.kind == "complete" and m.task]
    assert len(set(completions)) == len(completions)
    elapsed = [m.elapsed for _, m in team.messages if isinstance(m, Status)]
    assert elapsed == sorted(elapsed)
    assert len({m.incarnation for _, m in team.messages if m.sender == "@world"}) > 20
    assert LAUNCHER not in {m.sender for _, m in team.messages}
