"""Faults put in force in a running mission of real processes: what is done at them, and that the mission goes on."""

import json
import re
import signal
from pathlib import Path

import pytest
from support.processes import Processes, is_stopped, read_until, until, words_of

TEAM = """
name: team
tasks: {a: {}, b: {}}
robots:
  left: {tasks: {a: 12, b: 30}}
  right: {tasks: {a: 30, b: 12}}
knowledge: given
parameters: {min_delay: 0.1, max_delay: 0.4}
"""


@pytest.fixture
def team(tmp_path: Path) -> Path:
    path = tmp_path / "team.yaml"
    path.write_text(TEAM)
    return path


def fired(processes: Processes, team: Path) -> dict[str, bool]:
    answer = json.loads(processes.chaos(team, "status", "--json"))
    return {fault["name"]: fault["fired"] for fault in answer["faults"]}


def test_a_robot_that_hangs_for_a_while_goes_on_and_the_mission_completes(processes: Processes, team: Path) -> None:
    run = processes.start("run", team, "--speed", "2", "--plain")
    read_until(run, "left starts a")
    said = processes.chaos(team, "inject", "kind=hang", "robot=left", "for=3")
    assert re.fullmatch(r"1-hang: hang of left, until [\d.]+ s", said)
    read_until(run, "fault: hang of left")
    read_until(run, "fault is over: hang of left")
    assert fired(processes, team) == {"1-hang": True}
    out, err = run.communicate(timeout=60)
    assert run.returncode == 0, err
    assert "Fault: hang of left: fired at" in out
    assert "robot left ended" not in out
    assert processes.alive() == []


def test_a_robot_that_hangs_longer_than_its_presence_lasts_comes_back_when_it_is_healed(
    processes: Processes, team: Path
) -> None:
    run = processes.start("run", team, "--speed", "2", "--plain")
    read_until(run, "left starts a")
    left = processes.robot("left")
    assert processes.chaos(team, "inject", "kind=hang", "robot=left") == "1-hang: hang of left, until it is healed"
    until(lambda: is_stopped(left))
    read_until(run, "left does not answer")
    assert processes.chaos(team, "heal", "1-hang") == "healed 1-hang"
    read_until(run, "left is there")
    assert processes.robot("left") == left
    assert not is_stopped(left)
    out, err = run.communicate(timeout=60)
    assert run.returncode == 0, err
    assert "Fault: hang of left: fired at" in out


def test_a_robot_whose_crash_is_healed_returns_in_a_new_life(processes: Processes, team: Path) -> None:
    run = processes.start("run", team, "--speed", "2", "--plain")
    read_until(run, "left starts a")
    first = processes.robot("left")
    assert processes.chaos(team, "inject", "kind=crash", "robot=left") == "1-crash: crash of left, until it is healed"
    read_until(run, "left is gone")
    assert fired(processes, team) == {"1-crash": True}
    assert processes.chaos(team, "heal") == "healed 1-crash"
    read_until(run, "left is there")
    second = processes.robot("left")
    assert second != first
    assert words_of(second)[words_of(second).index("--incarnation") + 1] == "2"
    out, err = run.communicate(timeout=60)
    assert run.returncode == 0, err
    assert "Fault: crash of left: fired at" in out


def test_what_contradicts_a_fault_in_force_is_refused(processes: Processes, team: Path) -> None:
    run = processes.start("run", team, "--speed", "2", "--plain")
    read_until(run, "left starts a")
    processes.chaos(team, "inject", "kind=slow", "robot=left", "factor=2")
    done = processes.run("chaos", team, "inject", "kind=slow", "robot=left", "factor=3")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        "lalliance: robot left is slow already at that time; expected one fault of a kind at a time (see fault 1-slow)\n"
    )
    table = processes.chaos(team, "status")
    assert re.search(r"^Mission team: running at [\d.]+ s$", table, flags=re.MULTILINE)
    assert re.search(r"^1-slow +slow of left by 2 .* for good +on +fired at", table, flags=re.MULTILINE)


def test_a_mission_whose_robots_were_all_killed_by_an_operator_lasts_until_its_deadline(
    processes: Processes, team: Path
) -> None:
    """Healing could bring them back at any time, so it is the world that says when it is over."""
    team.write_text(TEAM + "deadline: 30\n")
    run = processes.start("run", team, "--speed", "2", "--plain")
    read_until(run, "left starts a")
    for robot in ("left", "right"):
        processes.chaos(team, "inject", "kind=crash", f"robot={robot}")
    out, err = run.communicate(timeout=60)
    assert run.returncode == 1, err
    assert "30.0 s  not complete by the deadline of 30 s" in out
    for robot in ("left", "right"):
        assert f"Fault: crash of {robot}: fired at" in out
    assert processes.alive() == []


@pytest.mark.alone
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_a_stopped_robot_does_not_stay_whatever_ends_the_run(
    processes: Processes, team: Path, number: signal.Signals
) -> None:
    run = processes.start("run", team, "--speed", "2", "--plain")
    read_until(run, "left starts a")
    processes.chaos(team, "inject", "kind=hang", "robot=left")
    until(lambda: is_stopped(processes.robot("left")))
    assert fired(processes, team) == {"1-hang": True}
    run.send_signal(number)
    run.communicate(timeout=2.0)
    until(lambda: processes.alive() == [], seconds=2.0)


def test_a_mission_ends_without_waiting_for_a_robot_that_is_stopped(processes: Processes, team: Path) -> None:
    run = processes.start("run", team, "--speed", "4", "--plain")
    read_until(run, "left starts a")
    processes.chaos(team, "inject", "kind=hang", "robot=left")
    until(lambda: is_stopped(processes.robot("left")))
    out, err = run.communicate(timeout=60)
    assert run.returncode == 0, err
    assert "right takes a from left (silence)" in out
    assert "Fault: hang of left: fired at" in out
    assert processes.alive() == []
