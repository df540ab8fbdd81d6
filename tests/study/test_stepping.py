"""A simulated mission moved step by step, with faults that are put in force on the way, and what its followers hear."""

import pytest

from lalliance_agents.errors import UserError
from lalliance_agents.mission_file import parse_mission, read_fault
from lalliance_agents.wire.messages import DecisionMade
from lalliance_study.simulator import Simulator
from world_server.world import Happening

PAIR = """
name: pair
tasks: {a: {}, b: {}}
robots:
  left: {tasks: {a: 5, b: 9}}
  right: {tasks: {a: 9, b: 5}}
knowledge: given
parameters: {min_delay: 0.1, max_delay: 0.4}
"""


def simulator(more: str = "") -> Simulator:
    return Simulator(parse_mission(PAIR + more, "pair.yaml"))


def step_until(running: Simulator, instant: float) -> None:
    while running.now < instant:
        running.step()


def test_a_mission_moved_step_by_step_is_the_one_that_is_run() -> None:
    whole, stepped = simulator(), simulator()
    summary = whole.run()
    while not stepped.world.over:
        stepped.step()
    assert (stepped.log, stepped.summary()) == (whole.log, summary)


def test_an_injected_fault_acts_from_then_on_until_it_is_healed() -> None:
    running = simulator()
    step_until(running, 1.0)
    assert running.inject(read_fault('{"kind": "stuck", "robot": "left"}'), None) == (
        "1-stuck: stuck of left, until it is healed"
    )
    step_until(running, 3.0)
    assert running.heal("1-stuck") == "healed 1-stuck"
    summary = running.run()
    [fault] = summary["faults"]
    assert (fault["fired"], fault["state"]) == (True, "over")
    held_up = fault["until"] - fault["at"]
    assert held_up == pytest.approx(2.0, abs=0.1)
    [attempt] = summary["tasks"]["a"]["attempts"]
    assert summary["tasks"]["a"]["completed_at"] - attempt["at"] == pytest.approx(5.0 + held_up, abs=1e-6)


def test_an_injected_crash_is_carried_out_and_its_healing_starts_the_robot_again() -> None:
    running = simulator()
    step_until(running, 1.0)
    running.inject(read_fault('{"kind": "crash", "robot": "left"}'), 2.0)
    summary = running.run()
    told = [
        str(line).partition(" ")[2] for line in running.log if line.who == "left" and line.what in {"gone", "present"}
    ]
    assert told == ["left present: left is there", "left gone: left is gone", "left present: left is there"]
    assert [(one["robot"], one["ended"]) for one in summary["tasks"]["a"]["attempts"]] == [
        ("left", "lost"),
        ("left", "complete"),
    ]


def test_a_link_rule_touches_nothing_on_the_way_to_a_robot_that_is_not_there() -> None:
    """Rules act where messages arrive; what is sent to a robot that was killed arrives nowhere."""
    faults = "faults: [{at: 1, robot: left, kind: crash}, {at: 2, link: {from: right, to: left}, cut: true}]"
    crash, cut = simulator(faults).run()["faults"]
    assert (crash["fired"], cut["fired"], cut["count"]) == (True, False, 0)


def test_a_fault_is_refused_once_the_mission_is_over() -> None:
    running = simulator()
    running.run()
    with pytest.raises(UserError, match="faults belong to the live trial of a running mission; this one is complete"):
        running.inject(read_fault('{"kind": "stuck", "robot": "left"}'), None)


def test_a_follower_hears_what_an_operator_would() -> None:
    running = simulator("faults: [{at: 2, robot: left, kind: crash}]")
    heard: list[str] = []

    def take(told: Happening | DecisionMade) -> None:
        if isinstance(told, DecisionMade):
            heard.append(f"{told.sender} {told.verb} {told.task}: {told.cause} {told.other}")
        else:
            heard.append(f"{told.kind} {told.robot} {told.task} {dict(told.details)}")

    running.follow(take)
    running.run()
    assert heard == [
        "present left None {}",
        "present right None {}",
        "trial None None {'begins': True}",
        "left activate a: free None",
        "right activate b: free None",
        "fault left None {'name': '1-crash', 'begins': True}",
        "gone left None {}",
        "complete right b {}",
        "right complete b: sensed None",
        "right activate a: silence left",
        "takeover right a {'from': 'left', 'cause': 'silence'}",
        "complete right a {}",
        "complete None None {}",
    ]
