"""The world server over the memory bus: what it answers, refreshes and waits for, and what it does not listen to."""

import asyncio
import math
import re
from itertools import pairwise
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import pytest

from lalliance_agents.bus.base import Delivery
from lalliance_agents.bus.memory import MemoryBus, MemoryHub
from lalliance_agents.bus.messenger import Messenger
from lalliance_agents.errors import UserError
from lalliance_agents.mission_file import parse_mission
from lalliance_agents.wire.keys import OPERATOR, Key, Keys, Kind
from lalliance_agents.wire.messages import (
    Action,
    BodyState,
    ChaosAnswer,
    ChaosCommand,
    DecisionMade,
    Event,
    Message,
    Status,
    TaskState,
    decode,
    encode,
)
from world_server.environments.base import TaskView
from world_server.environments.task_pool import TaskPool
from world_server.journal import Journal
from world_server.server import LINGER, WorldServer

pytestmark = pytest.mark.virtual_time

PAIR = """
name: pair
tasks: {a: {}, b: {}}
robots:
  left: {tasks: {a: 4, b: 8}}
  right: {tasks: {a: 8, b: 4}}
"""


class Served:
    """A world server, and a test that plays the robots and hears all that the world says."""

    def __init__(self, text: str = PAIR, **more: Any) -> None:
        self.mission = parse_mission(text, "test.yaml")
        self.keys = Keys(self.mission.name)
        self.hub = MemoryHub()
        self.bus = MemoryBus(self.hub)
        self.server = WorldServer(self.mission, bus=MemoryBus(self.hub), incarnation=1, **more)
        self.heard: list[tuple[float, Message]] = []
        self.voices: dict[str, Messenger] = {}
        self.loop = asyncio.get_running_loop()
        self.task: asyncio.Task[dict[str, Any]]

    def voice(self, name: str) -> Messenger:
        if name not in self.voices:
            self.voices[name] = Messenger(self.bus, self.keys, name, 1, self.loop.time)
        return self.voices[name]

    def hear(self, _: Key, message: Message) -> None:
        self.heard.append((self.loop.time(), message))

    async def __aenter__(self) -> Self:
        for kind in (Kind.SENSE_TASK, Kind.SENSE_ROBOT, Kind.EVENT, Kind.STATUS):
            await self.voice("@ear").listen(self.keys.build(kind), self.hear)
        self.task = asyncio.create_task(self.server.run())
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.task.cancel()
        await asyncio.wait({self.task})
        await self.bus.close()

    async def appear(self, *robots: str) -> None:
        for robot in robots:
            await self.bus.announce_presence(self.keys.build(Kind.ALIVE, robot=robot))
        await asyncio.sleep(0.1)

    async def work(self, robot: str, task: str, seconds: int) -> None:
        for _ in range(seconds):
            self.voice(robot).send(Kind.ACTION, task=task, trial=1, fewest=0)
            await asyncio.sleep(1.0)

    def events(self) -> list[str]:
        return [message.text for _, message in self.heard if isinstance(message, Event)]

    async def ask(self, kind: Kind, **names: str) -> list[tuple[Key, Message]]:
        answers: list[tuple[Key, Message]] = []
        asker = Messenger(self.bus, self.keys, "late", 1, self.loop.time)
        await asker.ask(
            self.keys.build(kind, **names), lambda key, message: answers.append((key, message)), timeout=1.0
        )
        return answers


async def test_who_comes_late_is_told_by_query_all_of_it_or_what_it_asks_for() -> None:
    async with Served() as served:
        await served.appear("left", "right")
        await served.work("left", "a", 2)
        answers = await served.ask(Kind.SENSE_TASK)
        assert [key.task for key, _ in answers] == ["a", "b"]
        assert [m.progress for _, m in answers if isinstance(m, TaskState)] == pytest.approx([0.5, 0.0], abs=0.02)
        assert [key.task for key, _ in await served.ask(Kind.SENSE_TASK, task="b")] == ["b"]
        assert [key.robot for key, _ in await served.ask(Kind.SENSE_ROBOT, robot="left")] == ["left"]
        assert [key.robot for key, _ in await served.ask(Kind.SENSE_ROBOT)] == ["left", "right"]
        assert await served.ask(Kind.SENSE_ROBOT, robot="stranger") == []


async def test_who_comes_late_is_told_what_happened_before_also_by_a_server_that_goes_on_from_the_journal(
    tmp_path: Path,
) -> None:
    made = {"verb": "activate", "task": "a", "cause": "free", "other": None, "active_for": 0.0, "factors": {}}

    async def past(served: Served) -> tuple[list[str], list[tuple[str, int, str]]]:
        events = [m.text for _, m in await served.ask(Kind.EVENT) if isinstance(m, Event)]
        decisions = [m for _, m in await served.ask(Kind.DECISION) if isinstance(m, DecisionMade)]
        return events, [(m.sender, m.seq, m.task) for m in decisions]

    mission = parse_mission(PAIR, "test.yaml")
    begun = ["left is there", "right is there", "trial 1 begins (adaptive learning)"]
    with Journal(tmp_path / "journal", mission) as journal:
        async with Served(journal=journal) as served:
            await served.appear("left", "right")
            for robot in ("left", "right", "left", "stranger"):
                served.voice(robot).send(Kind.DECISION, trial=1, teammates=[], **made)
            await served.work("left", "a", 2)
            first = await past(served)
    assert first == (begun, [("left", 1, "a"), ("left", 2, "a"), ("right", 1, "a")])
    with Journal(tmp_path / "journal", mission) as journal:
        async with Served(journal=journal, returning=0.1) as served:
            await asyncio.sleep(1)
            events, decisions = await past(served)
    assert (events[:3], decisions) == first


async def test_what_robots_need_is_refreshed_every_second_and_changes_are_told_at_once() -> None:
    async with Served() as served:
        await served.appear("left", "right")
        await served.work("left", "a", 8)
        for kind in (TaskState, BodyState):
            instants = [at for at, m in served.heard if isinstance(m, kind)]
            assert max(later - at for at, later in pairwise(instants)) <= 1.1
        done = next(at for at, m in served.heard if isinstance(m, TaskState) and m.complete)
        told = next(at for at, m in served.heard if isinstance(m, Event) and m.kind == "complete")
        assert done == told
        [elapsed] = [m.elapsed for _, m in served.heard if isinstance(m, Event) and m.kind == "complete"]
        assert told <= elapsed + 0.15
        assert len([m for _, m in served.heard if isinstance(m, Status)]) >= 4 * 7


@pytest.mark.parametrize("final", [True, False])
async def test_the_last_reports_are_waited_for_and_not_for_ever(final: bool) -> None:
    report = {"sent": 3, "received": 2, "dropped": {}, "teammates": {}, "ticks": 5, "missed": 0}
    async with Served() as served:
        await served.appear("left", "right")
        for robot in ("left", "right", "stranger"):
            served.voice(robot).send(Kind.LINK, **report)
        await asyncio.gather(served.work("left", "a", 5), served.work("right", "b", 5))
        ended = served.loop.time()
        assert not served.task.done()
        for robot in ("left", "right") if final else ("left",):
            served.voice(robot).send(Kind.LINK, **report | {"sent": 4}, final=True)
        summary = await served.task
        assert summary["complete"]
        assert summary["messages"]["sent"] == (8 if final else 7)
        assert served.loop.time() - ended == pytest.approx(0.1 if final else LINGER - 1.0, abs=0.2)
        await asyncio.sleep(0.01)
        assert {m.mission for _, m in served.heard[-2:] if isinstance(m, BodyState | Status)} == {"complete"}


async def test_a_world_does_not_begin_before_somebody_is_there_however_patient_it_was() -> None:
    late = PAIR.replace("tasks: {a: 8", "joins: 5, tasks: {a: 8")
    async with Served(late, patience=3.0) as served:
        await asyncio.sleep(10.0)
        assert served.events() == []
        await served.appear("left")
        await asyncio.sleep(0.2)
        assert served.events() == ["left is there", "trial 1 begins (adaptive learning)"]


async def test_strangers_and_hostile_presences_change_nothing(caplog: pytest.LogCaptureFixture) -> None:
    async with Served() as served:
        for name in ("stranger", "le ft", "left\n", "@left", "x" * 100):
            await served.bus.announce_presence(f"lalliance/pair/alive/{name}")
        await served.appear("left", "right")
        stranger = served.voice("stranger")
        stranger.send(Kind.ACTION, task="a", trial=1, fewest=0)
        stranger.send(Kind.ACTION, key_robot="left", task="a", trial=1, fewest=0)
        for name in ("left", "@world"):
            for payload in (b"", b"\xc1", b"x" * 1000):
                served.bus.put(served.keys.build(Kind.ACTION, robot=name), payload, Delivery.STATE)
        await asyncio.sleep(1.0)
        assert served.events() == ["left is there", "right is there", "trial 1 begins (adaptive learning)"]
        [status] = [m for _, m in served.heard if isinstance(m, Status)][-1:]
        assert status.robots == {name: {"present": True, "task": None} for name in ("left", "right")}
        assert served.server._messenger.dropped == {"stranger": 1, "sender": 1, "msgpack": 3, "key": 3}
        assert all(record.message.isprintable() for record in caplog.records if record.levelname == "WARNING")
        await served.work("left", "a", 5)
        assert served.events()[-1] == "a completed by left"


async def test_a_robot_cut_off_by_a_made_up_action_is_told_aloud(caplog: pytest.LogCaptureFixture) -> None:
    """Its action is heard no more, and its body rests; the log, the operator and the summary all say why."""
    async with Served(PAIR + "deadline: 30") as served:
        await served.appear("left", "right")
        action = Action(sender="left", incarnation=2**63 - 1, seq=2**63 - 1, at=0.0, task="b", trial=1, fewest=0)
        served.bus.put(served.keys.build(Kind.ACTION, robot="left"), encode(action), Delivery.STATE)
        await served.work("left", "a", 25)
        command = ChaosCommand(sender=OPERATOR, incarnation=1, seq=1, at=0.0, verb="status")
        [answer] = await served.bus.query(served.keys.build(Kind.CHAOS_COMMAND), encode(command), timeout=1.0)
        assert decode(ChaosAnswer, answer.payload).text.endswith("; cut off: left at @world")
        told = [record.message for record in caplog.records if "cut off" in record.message]
        assert len(told) == 1
        assert re.match(r"left is cut off: for 1\d s nothing on lalliance/pair/body/left/action is newer than", told[0])
        summary = await served.task
    assert not summary["complete"]
    cut_off, stale = summary["messages"]["drops"]
    assert [cut_off, stale] == [
        {"at": "@world", "of": "left", "reason": "cut off", "count": cut_off["count"]},
        {"at": "@world", "of": "left", "reason": "stale", "count": 25 - cut_off["count"]},
    ]
    assert cut_off["count"] in {14, 15}


async def test_a_progress_that_is_no_share_does_not_stop_the_world(monkeypatch: pytest.MonkeyPatch) -> None:
    class Careless(TaskPool):
        def sense(self) -> dict[str, TaskView]:
            odd = {"a": math.nan, "b": 1 + 1e-9}
            return {task: TaskView(view.complete, view.applicable, odd[task]) for task, view in super().sense().items()}

    monkeypatch.setattr("world_server.environments.create", Careless)
    async with Served() as served:
        await served.appear("left", "right")
        await served.work("left", "a", 5)
        assert served.events()[-1] == "a completed by left"
        assert {m.progress for _, m in served.heard if isinstance(m, TaskState)} == {0.0, 1.0}


async def test_two_robots_that_join_late_are_both_ordered() -> None:
    """Orders are carried out once per number: two of them must never have the same."""
    late = PAIR.replace("deadline", "") + "  c: {joins: 2, tasks: {a: 1}}\n  d: {joins: 4, tasks: {b: 1}}\n"
    async with Served(late) as served:
        await served.appear("left", "right")
        carried_out: dict[Any, str] = {}
        for _ in range(80):
            await asyncio.sleep(0.1)
            for _, m in served.heard:
                if isinstance(m, Event) and m.kind == "order" and m.details["number"] not in carried_out:
                    carried_out[m.details["number"]] = f"{m.details['deed']} {m.robot}"
                    assert m.robot is not None
                    await served.appear(m.robot)
        assert sorted(carried_out.values()) == ["start c", "start d"]
        assert {"c is there", "d is there"} <= set(served.events())


async def test_a_second_world_server_of_a_mission_is_refused_and_the_first_goes_on() -> None:
    async with Served() as served:
        await served.appear("left", "right")
        async with MemoryBus(served.hub) as bus:
            with pytest.raises(UserError, match="another world server serves mission pair on this bus already"):
                await WorldServer(served.mission, bus=bus, incarnation=2).run()
        assert not served.task.done()


@pytest.mark.parametrize(("pace", "warned"), [(1.0, False), (1.4, False), (4.0, True), (0.25, True)])
async def test_a_robot_at_another_speed_is_told_of_once(pace: float, warned: bool) -> None:
    async with Served() as served:
        left = served.voices["left"] = Messenger(
            served.bus, served.keys, "left", 1, lambda: 500.0 + pace * served.loop.time()
        )
        await served.appear("left", "right")
        for _ in range(25):
            left.send(Kind.ACTION, task=None, trial=1, fewest=0)
            await asyncio.sleep(1.0)
    told = [text for text in served.events() if "clock" in text]
    sentence = (
        f"the clock of left runs {pace:g} times as fast as the world's; expected all processes to be started with"
    )
    assert told == [f"{sentence} the same --speed, 1"] * warned


async def test_events_say_for_programs_what_their_text_says_for_people() -> None:
    stuck = PAIR + "faults: [{at: 1, until: 2, robot: left, kind: stuck}]\n"
    async with Served(stuck) as served:
        await served.appear("left", "right")
        await served.work("left", "a", 3)
        told = [(m.kind, m.robot, m.details) for _, m in served.heard if isinstance(m, Event) and m.details]
        assert told == [
            ("trial", None, {"begins": True}),
            ("fault", "left", {"name": "1-stuck", "begins": True}),
            ("fault", "left", {"name": "1-stuck", "begins": False}),
        ]
