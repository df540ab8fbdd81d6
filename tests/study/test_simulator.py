"""The exact simulator: a literal log, the same run for the same seed, and every kind of fault where it belongs."""

import os
import random
import subprocess
import sys

import pytest
from support.processes import MISSIONS

from lalliance_agents.mission_file import load_mission, parse_mission
from lalliance_study.logbook import Timing
from lalliance_study.simulator import Simulator
from world_server.environments import check_options

PAIR = """
name: pair
tasks: {a: {}, b: {}}
robots:
  left: {tasks: {a: 6, b: 12}}
  right: {tasks: {a: 12, b: 6}}
knowledge: given
parameters: {min_delay: 0.1, max_delay: 0.4}
deadline: 60
"""


def run(text: str, *, timing: Timing | None = None, every_step: bool = False) -> Simulator:
    mission = parse_mission(text, "x.yaml")
    check_options(mission)
    simulator = Simulator(mission, timing=timing, every_step=every_step)
    simulator.run()
    return simulator


def told(simulator: Simulator) -> list[str]:
    """The log as lines rounded to hundredths, once the team is there."""
    kept = [line for line in simulator.log if line.at > 0.1]
    return [f"{line.at:.2f} {line.who} {line.what} {line.task}: {line.why}" for line in kept]


def test_a_robot_dies_and_its_teammate_takes_the_task_over() -> None:
    simulator = run(PAIR + "faults: [{at: 3, robot: left, kind: crash}]\n")
    assert told(simulator) == [
        "0.53 left activate a: free",
        "0.62 right activate b: free",
        "3.05 world fault None: fault: crash of left",
        "3.05 left process None: killed",
        "3.05 left gone None: left is gone",
        "6.65 right complete b: b completed by right",
        "6.72 right complete b: sensed",
        "6.82 right activate a: silence",
        "6.82 right takeover a: right takes a from left (silence)",
        "13.80 right complete a: a completed by right",
        "13.80 world complete None: complete after 13.7 s",
    ]
    [takeover] = simulator.world.summary()["takeovers"]
    assert takeover["failed_at"] == pytest.approx(3.0, abs=0.01)
    assert takeover["detected_at"] - takeover["failed_at"] == pytest.approx(0.9, abs=0.2)  # tau is 1 s


@pytest.mark.parametrize("mission", sorted(path.name for path in MISSIONS.glob("*.yaml")))
def test_a_mission_file_runs_as_it_does_with_every_step_made(mission: str) -> None:
    simulators = [Simulator(load_mission(MISSIONS / mission), every_step=every) for every in (False, True)]
    quick, plain = (simulator.run() for simulator in simulators)
    assert simulators[0].log == simulators[1].log
    assert quick["complete"]
    assert all(fault["fired"] for fault in quick["faults"])
    for part in ("tasks", "takeovers", "faults", "trials"):
        assert quick[part] == plain[part]
    steps = [sum(member.steps for member in one.members.values()) for one in simulators]
    assert steps[0] < steps[1] / 3


def events(seed: int, hash_seed: str) -> bytes:
    """The event log of a mission as the command prints it, from a process with hashes of its own."""
    words = ["simulate", str(MISSIONS / "material_handling.yaml"), "--seed", str(seed), "--events"]
    done = subprocess.run(
        [sys.executable, "-m", "mission_control", *words],
        capture_output=True,
        check=True,
        env={**os.environ, "PYTHONHASHSEED": hash_seed},
    )
    return done.stdout


def test_the_same_seed_gives_the_same_log_to_the_byte_and_another_one_does_not() -> None:
    first = events(7, "1")
    assert first == events(7, "2")
    assert first != events(8, "1")
    assert first.count(b"\n") > 30


FAULTS = {
    "hang": "{at: 2, until: 8, robot: left, kind: hang}",
    "stuck": "{at: 2, until: 5, robot: left, kind: stuck}",
    "slow": "{at: 2, until: 5, robot: left, kind: slow, factor: 3}",
    "mute": "{at: 0, robot: left, kind: mute}",
    "deaf": "{at: 0, robot: left, kind: deaf}",
    "blind": "{at: 2, until: 9, robot: left, kind: blind}",
    "blind and late": "{at: 2, robot: left, kind: blind, delay: 1.5}",
    "loss": "{at: 0, link: {}, loss: 0.5}",
    "bursts": "{at: 0, link: {}, loss: {enter: 0.2, leave: 0.2}}",
    "delay": "{at: 0, link: {}, delay: {lognormal: {median: 0.2, sigma: 0.5}}}",
    "duplicates": "{at: 0, link: {}, duplicate: 0.5}",
    "reordering": "{at: 0, link: {}, reorder: 0.5}",
    "one way": "{at: 0, link: {from: left, to: right}, cut: true}",
    "partition": "{at: 0, until: 4, partition: [left, right]}",
    "restart": "{at: 2, until: 4, robot: left, kind: crash, restart: true}",
}


@pytest.mark.parametrize("kind", FAULTS)
def test_each_fault_fires_and_the_mission_completes(kind: str) -> None:
    text = PAIR + f"faults: [{FAULTS[kind]}]\n"
    simulator = run(text)
    summary = simulator.world.summary()
    assert summary["complete"], told(simulator)
    [report] = summary["faults"]
    assert report["fired"]
    assert report["count"] > 0
    assert simulator.log == run(text, every_step=True).log


def test_work_stands_still_while_a_body_is_stuck_and_is_slower_while_it_is_slow() -> None:
    makespans = {
        kind: run(PAIR + f"faults: [{FAULTS[kind]}]\n" if kind else PAIR).world.makespan
        for kind in ("", "stuck", "slow")
    }
    assert makespans == pytest.approx({"": 6.5, "stuck": 9.5, "slow": 8.5}, abs=0.1)


def test_the_ghost_of_a_hung_robot_yields_to_whoever_took_its_task() -> None:
    simulator = run(PAIR + "faults: [{at: 2, until: 11, robot: left, kind: hang}]\n")
    assert told(simulator)[8:] == [
        "6.82 right takeover a: right takes a from left (silence)",
        "11.05 world fault None: fault is over: hang of left",
        "11.05 left process None: continued",
        "11.05 left present None: left is there",
        "11.23 left yield a: contender",
        # What it was told while it hung is lost, and it is told again within a second.
        "11.93 left activate b: released",
        "11.93 left takeover b: left takes b from right (released)",
        "12.03 left complete b: sensed",
        "15.80 right complete a: a completed by right",
        "15.80 world complete None: complete after 15.7 s",
    ]


def test_delays_are_explicit() -> None:
    slow_bus = run(PAIR, timing=Timing(message_delay=0.3))
    assert told(slow_bus)[0] != told(run(PAIR))[0]
    assert slow_bus.world.summary()["complete"]


def test_whoever_waits_for_what_is_said_next_changes_nothing() -> None:
    mission, slow_bus = load_mission(MISSIONS / "janitorial.yaml"), Timing(message_delay=0.04)
    plain = Simulator(mission, timing=slow_bus, every_step=True)
    summary = plain.run()
    disturbed = Simulator(mission, timing=slow_bus)
    chance = random.Random(1)
    while not disturbed.world.over:
        disturbed.step()
        for member in disturbed.members.values():
            if member.runs and chance.random() < 0.3:
                member.voice.unsettle(disturbed.now)
    assert (disturbed.summary(), disturbed.log) == (summary, plain.log)


def test_a_mission_that_cannot_complete_ends_at_its_deadline() -> None:
    simulator = run(PAIR + "faults: [{at: 1, robot: left, kind: crash}, {at: 1, robot: right, kind: crash}]\n")
    summary = simulator.world.summary()
    assert (summary["complete"], summary["makespan"]) == (False, None)
    assert simulator.now == pytest.approx(60.05, abs=0.05)
