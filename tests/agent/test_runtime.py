"""The robot at run time, alone with a world that the test plays: joining, leaving, trials, strangers, and no world at all."""

import asyncio
import contextlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest
from support.robot_stage import PAIR, Logged, Stage, mission

from lalliance_agents import BehaviorSet, Robot
from lalliance_agents.agent import runtime
from lalliance_agents.agent.behavior import AutonomousBehaviorSet
from lalliance_agents.agent.catalog import Catalog
from lalliance_agents.bus.base import Sample
from lalliance_agents.bus.memory import MemoryBus, MemoryHub
from lalliance_agents.bus.messenger import Messenger
from lalliance_agents.model.monitor import Record
from lalliance_agents.wire.keys import WORLD, Key, Keys, Kind
from lalliance_agents.wire.messages import Action, Activity, DecisionMade, Hello, Message

pytestmark = pytest.mark.virtual_time


async def leave_nothing(stage: Stage, performed: Logged) -> None:
    """After the robot has ended: no task runs, nothing is declared, its presence is gone."""
    for _ in range(5):
        await asyncio.sleep(0)
    assert asyncio.all_tasks() == {asyncio.current_task()}
    assert performed.log.count("begins") == performed.log.count("ends")
    assert not stage.present or stage.present[-1] == ("left", False)
    patterns = [one.pattern for one in stage.hub._subscriptions if one.owner is stage.bus]
    assert patterns == []


@pytest.mark.parametrize("again", [None, 0, 1, 2])
async def test_a_robot_cancelled_at_any_moment_leaves_nothing_behind(again: int | None) -> None:
    """The moment is a number of turns of the loop, or later a time; `again`: cancelled once more while it leaves."""
    for moment in range(60):
        performed = Logged("a")
        async with Stage(performed) as stage:
            stranger = stage.voice("stranger")
            stage.sense("a")
            stranger.send(Kind.HELLO, tasks=["a"])
            for _ in range(min(moment, 40)):
                await asyncio.sleep(0)
                stage.say("running")
                stranger.send(Kind.HELLO, tasks=["a"])
            if moment > 40:
                await asyncio.sleep((moment - 40) * 0.15)
            stage.task.cancel()
            if again is not None:
                for _ in range(again):
                    await asyncio.sleep(0)
                stage.task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await stage.task
            assert stage.task.cancelled()
            if again is None:
                await leave_nothing(stage, performed)
        await leave_nothing(stage, performed)
    assert performed.log == ["begins", "ends"]


async def test_a_robot_that_ends_reports_its_counters_first_and_cleans_up_after_its_body() -> None:
    class Careful(Logged):
        async def perform(self) -> None:
            try:
                await super().perform()
            finally:
                await asyncio.sleep(1.0)
                self.log.append("is clean")

    careful = Careful("a")
    async with Stage(careful) as stage:
        await stage.begin()
        await asyncio.sleep(3.0)
        stage.say("complete")
        await asyncio.sleep(0.2)
        assert [m.final for m in stage.messages if m.__class__.__name__ == "LinkReport"][-1:] == [True]  # type: ignore[attr-defined]
        assert not stage.task.done()
        assert await stage.task == "complete"
        await leave_nothing(stage, careful)
    assert careful.log == ["begins", "ends", "is clean"]


async def test_nothing_is_begun_before_the_mission_is_not_even_by_a_set_that_senses_for_itself() -> None:
    own = Logged("a")
    async with Stage(own) as stage:
        for _ in range(30):
            stage.sense("a", trial=0, applicable=False)
            stage.sense("b", trial=0, applicable=False)
            stage.say("waiting", trial=0)
            await asyncio.sleep(0.1)
        assert own.log == []
        assert stage.decisions() == []
        stage.say("running")
        await asyncio.sleep(3.0)
        assert stage.decisions()[0] == ("activate", "a", 1)
        assert own.log == ["begins"]


async def test_a_new_trial_stops_the_body_at_once_and_what_it_did_counts_for_the_old_one() -> None:
    own = Logged("a", returns_after=2.0)
    async with Stage(own) as stage:
        await stage.begin()
        await own.began.wait()
        await asyncio.sleep(1.99)
        stage.say("running", trial=2)
        await asyncio.sleep(0.05)
        assert own.log == ["begins", "ends"]
        assert not own.returned
        stage.say("running", trial=1)  # a message that comes late changes nothing
        await asyncio.sleep(6.0)
        assert stage.decisions() == [
            ("activate", "a", 1), ("drop", "a", 2), ("activate", "a", 2), ("complete", "a", 2),
        ]  # fmt: skip
        actions = [(m.task, m.trial) for m in stage.messages if isinstance(m, Action)]
        assert list(dict.fromkeys(actions)) == [(None, 1), ("a", 1), (None, 2), ("a", 2)]
        assert ("a", 1) not in actions[actions.index((None, 2)) :]


async def test_strangers_are_listened_to_once_follow_their_abilities_and_are_not_too_many(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(runtime, "MOST_TEAMMATES", 3)
    async with Stage() as stage:
        await stage.begin()
        await asyncio.sleep(1.5)
        team = stage.robot._team
        stranger = stage.voice("stranger")
        for _ in range(3):
            stranger.send(Kind.HELLO, tasks=["a", "c"])
        stage.voice("useless").send(Kind.HELLO, tasks=["c"])
        stage.voice("left").send(Kind.HELLO, tasks=["a"])
        await asyncio.sleep(0.1)
        assert team.abilities == {"right": {"a", "b"}, "stranger": {"a"}}
        heartbeat = stage.keys.build(Kind.HEARTBEAT, robot="stranger")
        assert [one.pattern for one in stage.hub._subscriptions].count(heartbeat) == 1
        stranger.send(Kind.HEARTBEAT, trial=1)
        await asyncio.sleep(0.05)
        assert stage.robot.mind.hearing.silences(0.0).keys() == {"stranger"}
        stranger.send(Kind.HELLO, tasks=["b"])
        stage.voice("right").send(Kind.HELLO, tasks=["a"])
        for number in range(20):
            stage.voice(f"made-up-{number}").send(Kind.HELLO, tasks=["a"])
        await asyncio.sleep(0.1)
        assert team.abilities == {"right": {"a"}, "stranger": {"b"}, "made-up-0": {"a"}}
        stage.voice("made-up-9").send(Kind.ACTIVITY, key_task="a", task="a", trial=1, active_for=1.0, expected=1.0)
        await asyncio.sleep(0.05)
        assert "made-up-9" not in stage.robot.mind.hearing.silences(0.0)


@pytest.mark.parametrize(("reading", "heard"), [("mended", {"right", "stranger"}), ("literal", {"stranger"})])
async def test_a_teammate_is_heard_on_what_the_robot_cannot_do_unless_the_appendix_is_read_literally(
    reading: str, heard: set[str]
) -> None:
    text = PAIR.replace("}}\nknowledge", ", c: 3}}\nknowledge").replace("b: {}}", "b: {}, c: {}}")
    text = text.replace("max_delay: 0.5", f"max_delay: 0.5, readings: {{heard_elsewhere: {reading}}}")
    async with Stage(mission=mission(text)) as stage:
        await stage.begin()
        stage.voice("stranger").send(Kind.HELLO, tasks=["a", "d"])
        await asyncio.sleep(1.5)
        for name, task in (("right", "c"), ("stranger", "a")):
            stage.voice(name).send(Kind.ACTIVITY, key_task=task, task=task, trial=1, active_for=0.0, expected=1.0)
        await asyncio.sleep(0.05)
        assert stage.robot.mind.hearing.silences(0.0).keys() == heard
        assert stage.robot._messenger.dropped == {}
        assert [contact.robot for contact in stage.robot.mind.hearing.contacts("a")] == ["stranger"]


async def test_robots_of_the_mission_are_known_before_any_made_up_one_can_take_their_place(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(runtime, "MOST_TEAMMATES", 1)
    async with Stage() as stage:
        for number in range(5):
            await asyncio.sleep(0)
            stage.voice(f"made-up-{number}").send(Kind.HELLO, tasks=["a"])
        await asyncio.sleep(0.1)
        assert stage.robot._team.abilities.keys() == {"right"}


async def test_a_teammates_hello_is_answered_and_asked_for() -> None:
    async with Stage() as stage:
        late = stage.voice("late")
        key = stage.keys.build(Kind.HELLO, robot="late")
        await late.offer(key, lambda _: [Sample(key, late.compose(Kind.HELLO, tasks=["b"]))])
        await asyncio.sleep(0.5)
        assert stage.robot._team.abilities["late"] == {"b"}
        heard: list[Message] = []

        def hear(_: Key, message: Message) -> None:
            heard.append(message)

        assert await late.ask(stage.keys.build(Kind.HELLO), hear, timeout=1.0) >= 1
        assert [m.tasks for m in heard if isinstance(m, Hello)] == [["a", "b"]]


async def test_a_set_that_fails_at_all_it_is_asked_does_not_end_the_robot(caplog: pytest.LogCaptureFixture) -> None:
    class Hopeless(BehaviorSet):
        def applicable(self) -> bool:
            raise ValueError("blind")

        def __repr__(self) -> str:
            raise ValueError("nameless")

    async with Stage(Hopeless("a")) as stage:
        await asyncio.sleep(0.001)
        stage.sense("a")
        stage.sense("b")
        await asyncio.sleep(5.0)
        assert stage.decisions() == [("activate", "b", 1)]
        assert not stage.task.done()
    assert [record.message for record in caplog.records] == ["sensing of <Hopeless> failed; taken as not applicable"]


async def test_learned_times_of_other_missions_are_passed_over_and_kept(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = {
        "weld": {"left": Record((3.0,)), "gone": Record((1.0,))},
        "a": {"left": Record((1e12,)), "gone": Record((4.0,))},
    }
    Catalog(tmp_path, "left").save(known)
    catalog = Catalog(tmp_path, "left")
    full = OSError(28, "No space left on device")
    save, tries = catalog.save, []

    def save_later(learned: Any) -> None:
        tries.append(learned)
        if len(tries) < 4:
            raise full
        save(learned)

    monkeypatch.setattr(catalog, "save", save_later)
    async with Stage(Logged("a", returns_after=1.0), catalog=catalog) as stage:
        assert stage.robot.mind.knowledge.time_of("gone", "a") == 4.0
        await stage.begin()
        await asyncio.sleep(60.0)  # a robot that takes itself to be so slow is in no hurry
        assert ("activate", "a", 1) in stage.decisions()
        assert all(m.expected <= 1e12 for m in stage.messages if isinstance(m, Activity))
    learned = Catalog(tmp_path, "left").learned
    assert learned["weld"] == known["weld"]
    assert learned["a"]["gone"] == known["a"]["gone"]
    assert learned["a"]["left"].samples[-1] == pytest.approx(1.0, abs=0.2)
    assert len(tries) == 4
    assert [record.message for record in caplog.records] == [
        "learned times not stored: [Errno 28] No space left on device; will be tried again"
    ]


async def run_without_world(
    behaviors: dict[str, Iterable[BehaviorSet]], until: asyncio.Event
) -> list[tuple[str, str, str]]:
    """Let the robots of `PAIR` work without a world server until `until`; their decisions."""
    hub, team = MemoryHub(), mission()
    decided: list[tuple[str, str, str]] = []
    async with contextlib.AsyncExitStack() as stack:
        buses = {name: await stack.enter_async_context(MemoryBus(hub)) for name in [*team.robots, "@ear"]}
        ear = Messenger(buses["@ear"], Keys("pair"), "@ear", 1, lambda: 0.0)

        def hear(_: Key, message: Message) -> None:
            assert isinstance(message, DecisionMade)
            decided.append((message.sender, message.verb, message.task))

        await ear.listen(ear.keys.build(Kind.DECISION), hear)
        running = [
            asyncio.create_task(Robot(team, name, bus=buses[name], behaviors=sets, incarnation=1, world=False).run())
            for name, sets in behaviors.items()
        ]
        impostor = Messenger(buses["@ear"], ear.keys, WORLD, 1, lambda: 0.0)
        await asyncio.sleep(1.0)
        for name in team.robots:  # there is no world in this team: who says so is not believed
            impostor.send(Kind.SENSE_ROBOT, key_robot=name, mission="failed", trial=1, learning="adaptive")
        async with asyncio.timeout(120):
            await until.wait()
        await asyncio.sleep(2.0)
        assert not any(task.done() for task in running)
        for task in running:
            task.cancel()
        await asyncio.wait(running)
    return decided


async def test_a_team_without_a_world_finishes_tasks_that_each_robot_can_see() -> None:
    """What is done can be seen by both, as real robots would see an empty floor: nothing is done twice."""
    floor: set[str] = set()
    clean = asyncio.Event()

    class Sweep(BehaviorSet):
        def __init__(self, task: str, seconds: float) -> None:
            super().__init__(task)
            self._seconds = seconds

        async def perform(self) -> None:
            await asyncio.sleep(self._seconds)
            floor.add(self.task)
            if floor == {"a", "b"}:
                clean.set()

        def applicable(self) -> bool:
            return self.task not in floor

        def complete(self) -> bool:
            return self.task in floor

    times = {name: spec.tasks for name, spec in mission().robots.items()}
    sets = {name: [Sweep(task, seconds) for task, seconds in tasks.items()] for name, tasks in times.items()}
    decided = await run_without_world(dict(sets), clean)
    assert sorted(decided) == [
        ("left", "activate", "a"), ("left", "complete", "a"), ("right", "activate", "b"), ("right", "complete", "b"),
    ]  # fmt: skip


async def test_a_team_without_a_world_in_which_each_robot_knows_only_of_its_own_work_does_all_of_it() -> None:
    """`AutonomousBehaviorSet` senses for its own robot alone: each does every task once, its better one first."""
    done: list[tuple[str, str]] = []
    over = asyncio.Event()

    class Do(AutonomousBehaviorSet):
        def __init__(self, robot: str, task: str, seconds: float) -> None:
            super().__init__(task)
            self._robot = robot
            self._seconds = seconds

        async def perform(self) -> None:
            await asyncio.sleep(self._seconds)
            done.append((self._robot, self.task))
            if len(done) == 4:
                over.set()

    times = {name: spec.tasks for name, spec in mission().robots.items()}
    sets = {name: [Do(name, task, seconds) for task, seconds in tasks.items()] for name, tasks in times.items()}
    await run_without_world(dict(sets), over)
    assert set(done[:2]) == {("left", "a"), ("right", "b")}
    assert set(done[2:]) == {("left", "b"), ("right", "a")}
