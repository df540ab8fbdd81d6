"""Which processes a run starts: robots, when its mission may have come some way before; a router again, and not for ever."""

from types import SimpleNamespace

import pytest

from lalliance_agents.mission_file import parse_mission
from lalliance_agents.wire.messages import Action
from mission_control import launch
from mission_control.launch import Beginning
from mission_control.processes import Child
from world_server.world import World

TEAM = """
name: team
tasks: {a: {}}
robots:
  one: {tasks: {a: 20}}
  two: {tasks: {a: 20}}
  three: {tasks: {a: 20}}
  late: {joins: 3, tasks: {a: 20}}
  later: {joins: 9, tasks: {a: 20}}
faults:
  - {at: 1, robot: one, kind: crash}
  - {at: 1, robot: two, kind: crash, restart: true, until: 7}
  - {at: 5, robot: three, kind: crash}
"""


def test_a_mission_that_begins_has_all_but_those_who_join_late() -> None:
    world = World(parse_mission(TEAM, "test.yaml"), 0.0, lambda _: None)
    assert Beginning.of(world) == Beginning(first=("one", "two", "three"))


def test_a_mission_that_goes_on_has_those_who_were_there_and_none_that_a_fault_has_killed() -> None:
    world = World(parse_mission(TEAM, "test.yaml"), 0.0, lambda _: None)
    for robot in ("one", "two", "three"):
        world.presence(robot, True, 0.0)
    world.begin(0.0)
    for robot in ("one", "two"):
        world.presence(robot, False, 1.5)
    world.presence("late", True, 3.5)
    # The crash of three is ordered and was not seen: whoever is asked to kill it needs it.
    world.advance(6.0)
    assert Beginning.of(world) == Beginning(
        first=("three", "late"), lost=frozenset({"one", "two"}), may_return=frozenset({"two"}), goes_on=True
    )
    # Now the world orders to start two; whoever starts it first, it is there.
    world.advance(8.0)
    assert Beginning.of(world).first == ("two", "three", "late")


def test_a_mission_that_is_over_needs_no_robot() -> None:
    world = World(parse_mission(TEAM, "test.yaml"), 0.0, lambda _: None)
    world.presence("late", True, 0.0)
    world.begin(0.0)
    for second in range(21):
        header = {"sender": "late", "incarnation": 1, "seq": second, "at": 0.0}
        world.act(Action(**header, task="a", trial=1, fewest=0), float(second))
    world.advance(21.0)
    assert world.over
    assert Beginning.of(world).first == ()


async def test_a_router_that_dies_too_often_is_told_of(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(launch, "ROUTER_RESTARTS", 0)
    said: list[str] = []
    child = await Child.start("router", ["--help"], lambda *_: None)
    await launch.Launcher._keep_router(SimpleNamespace(_view=SimpleNamespace(say=said.append)), child)
    assert said == ["the router ended (exit status 2), too often to be started again"]
