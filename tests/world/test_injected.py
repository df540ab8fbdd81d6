"""Faults that an operator puts in force in a running mission, and ends."""

import pytest

from lalliance_agents.errors import UserError
from lalliance_agents.mission_file import parse_mission, read_fault
from world_server.world import World

PAIR = """
name: pair
tasks: {a: {}}
robots:
  left: {tasks: {a: 100}}
  right: {tasks: {a: 100}}
"""


def begun(text: str = PAIR, *, launcher: bool = True) -> World:
    """A world with its team at 10 s."""
    world = World(parse_mission(text, "test.yaml"), 0.0, lambda _: None)
    world.launcher(launcher, 0.0)
    for robot in ("left", "right"):
        world.presence(robot, True, 0.0)
    world.begin(0.0)
    world.advance(10.0)
    return world


def orders(world: World) -> list[str]:
    return [f"{order.deed} {order.robot}" for order in world.orders()]


CRASH = read_fault('{"kind": "crash", "robot": "left"}')


def test_a_crash_that_is_healed_while_the_robot_is_being_killed_is_over_once_it_is_dead() -> None:
    world = begun()
    assert world.inject(CRASH, None, 10.0) == "1-crash: crash of left, until it is healed"
    assert orders(world) == ["kill left"]
    assert world.heal("1-crash", 10.1) == "healed 1-crash"
    assert orders(world) == ["kill left"]
    world.presence("left", False, 10.2)
    assert orders(world) == ["start left"]
    world.presence("left", True, 11.0)
    assert orders(world) == []
    [fault] = world.failures.report()
    assert (fault["fired_at"], fault["state"], fault["until"]) == (pytest.approx(10.2), "over", pytest.approx(10.1))


def test_a_crash_that_nobody_can_carry_out_is_healed_at_once() -> None:
    world = begun(PAIR + "faults: [{at: 5, robot: left, kind: crash}]", launcher=False)
    assert orders(world) == ["kill left"]
    assert world.heal("", 10.0) == "healed 1-crash"
    assert orders(world) == []
    assert [(fault["state"], fault["fired"]) for fault in world.failures.report()] == [("over", False)]


def test_a_crash_that_is_said_to_last_leaves_room_for_what_the_mission_plans_later() -> None:
    world = begun(PAIR + "faults: [{at: 50, until: 60, robot: left, kind: hang}]")
    with pytest.raises(UserError, match="at 50 s robot left is down from an earlier crash; expected no further fault"):
        world.inject(CRASH, None, 10.0)
    assert world.inject(CRASH, 5.0, 10.0) == "2-crash: crash of left, until 15.0 s"
    world.presence("left", False, 10.1)
    world.advance(15.0)
    assert orders(world) == ["start left"]


def test_a_process_that_is_not_there_can_be_neither_killed_nor_stopped() -> None:
    world = begun()
    world.presence("left", False, 10.0)
    with pytest.raises(UserError, match="crash of left: left is not there; expected a robot whose process runs"):
        world.inject(CRASH, None, 10.0)
    with pytest.raises(UserError, match="robot: 'lefty' is not a robot of this mission; did you mean 'left'"):
        world.inject(read_fault('{"kind": "hang", "robot": "lefty"}'), None, 10.0)
    assert world.failures.report() == []
