"""Whole teams in one process and in virtual time: what robots and world do together, without a network."""

import asyncio
from pathlib import Path

import pytest
from support.team import Team

from lalliance_agents import BehaviorSet
from lalliance_agents.wire.keys import Kind
from lalliance_agents.wire.messages import DecisionMade, Event

pytestmark = pytest.mark.virtual_time

TWO = """
name: two
tasks: {a: {}, b: {}}
robots:
  left: {tasks: {a: 5, b: 20}}
  right: {tasks: {a: 20, b: 5}}
knowledge: given
parameters: {min_delay: 0.1, max_delay: 0.5}
"""

TAKEOVER = """
name: takeover
tasks: {a: {}, b: {}}
robots:
  worker: {tasks: {a: 30}}
  reserve: {tasks: {a: 40, b: 1}}
knowledge: given
parameters: {min_delay: 0.1, max_delay: 0.5}
faults: [{at: %g, robot: worker, kind: crash}]
"""


async def test_each_robot_does_what_it_does_best() -> None:
    async with Team(TWO) as team:
        summary = await team.run()
    assert summary["complete"]
    assert {task: facts["by"] for task, facts in summary["tasks"].items()} == {"a": ["left"], "b": ["right"]}
    assert summary["makespan"] == pytest.approx(5.7, abs=0.4)
    assert summary["takeovers"] == []
    assert team.ended == {"left": "complete", "right": "complete"}
    assert summary["control"]["missed"] == 0


@pytest.mark.parametrize("at", [4.0, 4.03, 4.06, 4.09, 4.12, 4.15, 4.18])
async def test_a_killed_robots_task_is_taken_within_tau_and_delay_and_one_control_period(at: float) -> None:
    async with Team(TAKEOVER % at) as team:
        summary = await team.run()
    assert summary["faults"][0]["fired"]
    [takeover] = summary["takeovers"]
    assert (takeover["from"], takeover["to"], takeover["cause"]) == ("worker", "reserve", "silence")
    tau, period = team.mission.parameters.silence_timeout, team.mission.control_period
    assert takeover["after_failure"] <= tau + takeover["delay"] + period + 1e-6
    assert takeover["detected_at"] - takeover["failed_at"] <= tau + period + 1e-6
    assert summary["complete"]


async def test_a_behaviour_set_of_ones_own_joins_a_running_team() -> None:
    performed: list[str] = []

    class Push(BehaviorSet):
        task = "a"

        async def perform(self) -> None:
            performed.append("began")
            try:
                await asyncio.Event().wait()
            finally:
                performed.append("ended")

    mission = TAKEOVER.replace("reserve: {", "reserve: {joins: 2, ") % 10
    async with Team(mission) as team:
        team.factories["reserve"] = lambda: [Push()]
        summary = await team.run()
    assert summary["complete"]
    assert summary["tasks"]["a"]["by"] == ["reserve"]
    assert performed == ["began", "ended"]


async def test_a_failing_behaviour_set_harms_only_its_own_attempt(caplog: pytest.LogCaptureFixture) -> None:
    class Broken(BehaviorSet):
        task = "a"

        async def perform(self) -> None:
            raise RuntimeError("gripper jammed")

    async with Team(TWO) as team:
        team.factories["left"] = lambda: [Broken()]
        summary = await team.run()
    drops = [m for _, m in team.messages if isinstance(m, DecisionMade) and m.cause == "body_failed"]
    assert drops
    assert all(drop.sender == "left" for drop in drops)
    assert summary["complete"]
    assert summary["tasks"]["a"]["by"] != []
    assert "gripper jammed" in caplog.text


async def test_a_behaviour_set_whose_sensing_fails_is_not_applicable(caplog: pytest.LogCaptureFixture) -> None:
    class Blind(BehaviorSet):
        task = "a"

        def applicable(self) -> bool:
            raise OSError("no camera")

    async with Team(TWO) as team:
        team.factories["left"] = lambda: [Blind()]
        summary = await team.run()
    assert summary["complete"]
    assert all(attempt["robot"] == "right" for attempt in summary["tasks"]["a"]["attempts"])
    assert [record.message for record in caplog.records] == ["sensing of <Blind for a> failed; taken as not applicable"]


async def test_training_fills_every_monitor_and_the_live_mission_is_faster() -> None:
    untrained = """
name: janitors
tasks: {waste-1: {}, waste-2: {}, floor-1: {}, floor-2: {}, dust-1: {}}
robots:
  arm: {tasks: {waste-1: 4, waste-2: 4, floor-1: 24, floor-2: 24, dust-1: 12}}
  sweeper: {tasks: {waste-1: 16, waste-2: 16, floor-1: 5, floor-2: 5}}
  duster: {tasks: {dust-1: 4, waste-1: 12, floor-2: 20}}
parameters: {trials: 3, min_delay: 0.1, max_delay: 0.5}
"""
    training = "phases: [{learning: active, trials: 200, until: full}, {learning: adaptive}]\n"
    cold = trained = 0.0
    for seed in range(3):
        async with Team(f"seed: {seed}\n{untrained}") as team:
            cold += (await team.run())["makespan"]
        async with Team(f"seed: {seed}\n{untrained}{training}") as team:
            summary = await team.run()
            counts = {
                (me, k, task): team.robots[me].mind.knowledge.monitors[task].count(k)
                for me, spec in team.mission.robots.items()
                for task in spec.tasks
                for k in team.mission.able(task)
            }
        assert set(counts.values()) == {3}
        assert 3 < len(summary["trials"]) < 200
        trained += summary["makespan"]
    assert trained < 0.9 * cold


async def test_a_restarted_robot_is_a_new_incarnation_and_keeps_what_it_learned(tmp_path: Path) -> None:
    mission = """
name: again
tasks: {a: {}, b: {after: [a]}, c: {after: [b]}}
robots: {solo: {tasks: {a: 4, b: 6, c: 5}}}
parameters: {min_delay: 0.1, max_delay: 0.2}
faults: [{at: 8, robot: solo, kind: crash, restart: true, until: 12}]
"""
    async with Team(mission) as team:
        team.learned = tmp_path
        summary = await team.run()
        learned = team.robots["solo"].mind.knowledge.time_of("solo", "a")
    assert summary["complete"]
    assert summary["faults"][0]["fired"]
    assert [attempt["robot"] for attempt in summary["tasks"]["b"]["attempts"]] == ["solo", "solo"]
    assert learned == pytest.approx(4.0, abs=0.2)
    lives = {m.incarnation for key, m in team.messages if key.kind is Kind.HEARTBEAT}
    assert lives == {1, 2}


async def test_what_a_robot_learned_is_there_in_the_next_mission(tmp_path: Path) -> None:
    for _ in range(2):
        async with Team(TWO.replace("knowledge: given\n", "")) as team:
            team.learned = tmp_path
            started = {name: team.start(name) for name in team.mission.robots}
            known = {name: robot.mind.knowledge.time_of(name, "a") for name, robot in started.items()}
            await team.run()
    assert any(time is not None for time in known.values())


async def test_a_robot_that_freezes_does_no_more_work() -> None:
    """The dead-man switch: an action that is not refreshed ends, although the process is there."""
    async with Team(TAKEOVER.replace("faults: [{at: %g, robot: worker, kind: crash}]", "")) as team:
        world = asyncio.create_task(team.serve())
        team.start_all()
        await team.wait_for(lambda _, m: isinstance(m, DecisionMade) and m.verb == "activate" and m.sender == "worker")
        frozen = team.robots["worker"]
        frozen._tick = lambda now: None  # type: ignore[method-assign] # a robot whose control loop does nothing
        summary = await world
    [takeover] = summary["takeovers"]
    assert takeover["cause"] == "silence"
    assert summary["tasks"]["a"]["by"] == ["reserve"]
    assert summary["makespan"] > 38


async def test_hostile_messages_disturb_nobody(caplog: pytest.LogCaptureFixture) -> None:
    async with Team(TWO) as team:
        team.start_all()
        world = asyncio.create_task(team.serve())
        await team.wait_for(lambda _, m: isinstance(m, Event) and m.kind == "trial")
        bus = team._bus
        for key in (
            team.keys.build(Kind.ACTIVITY, task="a", robot="right"),
            team.keys.build(Kind.HEARTBEAT, robot="left"),
            team.keys.build(Kind.SENSE_TASK, task="a"),
            team.keys.build(Kind.SENSE_ROBOT, robot="left"),
            team.keys.build(Kind.ACTION, robot="left"),
            team.keys.build(Kind.HELLO, robot="x"),
        ):
            for payload in (b"", b"\xc1", b"\x80", b"\x81\xa1v\x01", b"x" * 100_000, b"\xdf\xff\xff\xff\xff"):
                bus.put(key, payload, "state")  # type: ignore[arg-type]
        summary = await world
    assert summary["complete"]
    assert summary["messages"]["dropped"].keys() >= {"msgpack", "content"}


async def test_a_world_without_its_whole_team_begins_after_its_patience() -> None:
    async with Team(TWO) as team:
        team.start("left")
        summary = await team.serve(patience=3.0)
    assert summary["complete"]
    assert any(isinstance(m, Event) and m.kind == "warning" and "right" in m.text for _, m in team.messages)


async def test_a_mission_that_misses_its_deadline_has_failed() -> None:
    async with Team(TWO.replace("name: two", "name: two\ndeadline: 3")) as team:
        summary = await team.run()
    assert not summary["complete"]
    assert summary["makespan"] is None
    assert set(team.ended.values()) == {"failed"}
