"""Processes that die, at any time, and what is left: the mission goes on, and no process stays behind."""

import contextlib
import os
import signal
from pathlib import Path

import pytest
from support.processes import MISSIONS, Processes, read_until, until

from lalliance_agents.bus.router import free_endpoint
from mission_control.keeper import RESTARTS

SMALL = """
name: small
tasks: {a: {}, b: {}, c: {}}
robots:
  left: {tasks: {a: 6, b: 9, c: 7}}
  right: {tasks: {a: 9, b: 6, c: 9}}
knowledge: given
parameters: {min_delay: 0.1, max_delay: 0.4}
"""


@pytest.fixture
def small(tmp_path: Path) -> Path:
    path = tmp_path / "small.yaml"
    path.write_text(SMALL)
    return path


def test_a_robot_that_dies_for_good_leaves_the_mission_running(processes: Processes, small: Path) -> None:
    run = processes.start("run", small, "--speed", "2", "--plain")
    read_until(run, "left starts")
    os.kill(processes.robot("left"), signal.SIGKILL)
    out, err = run.communicate(timeout=100)
    assert run.returncode == 0, err
    assert "left is gone" in out
    assert all(f"{task} completed by right" in out for task in "abc")
    assert processes.alive() == []


def test_a_killed_router_is_started_again_and_everybody_comes_back(processes: Processes, small: Path) -> None:
    run = processes.start("run", small, "--speed", "2", "--plain", "--json")
    until(lambda: len(processes.alive("robot")) == 2)
    assert run.stderr is not None
    while "right starts" not in (line := run.stderr.readline()):
        assert line
    [router] = processes.alive("router")
    os.kill(router, signal.SIGKILL)
    out, err = run.communicate(timeout=100)
    assert run.returncode == 0, err
    assert "the router ended (killed by SIGKILL); starting it again" in err
    assert '"complete": true' in out
    assert processes.alive() == []


def test_robots_of_a_router_elsewhere_come_back_when_it_does(processes: Processes, small: Path) -> None:
    """Nobody but the router is restarted: robots and world reconnect by themselves."""
    endpoint = free_endpoint()
    first = processes.start("router", "--listen", endpoint)
    read_until(first, "listens")
    run = processes.start("run", small, "--speed", "2", "--plain", "--connect", endpoint)
    read_until(run, "right starts")
    first.kill()
    first.wait()
    second = processes.start("router", "--listen", endpoint)
    read_until(second, "listens")
    out, err = run.communicate(timeout=100)
    assert run.returncode == 0, err
    assert "complete after" in out
    assert second.poll() is None


@pytest.mark.alone
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
@pytest.mark.parametrize("grown", [1, 2, 3, 4, 5])
def test_wherever_the_launcher_is_stopped_no_process_stays(
    processes: Processes, small: Path, number: signal.Signals, grown: int
) -> None:
    run = processes.start("run", small, "--speed", "2", "--plain")
    until(lambda: len(processes.alive()) >= grown)
    run.send_signal(number)
    run.communicate(timeout=4.0)
    until(lambda: processes.alive() == [], seconds=2.0)


@pytest.mark.alone
def test_a_running_mission_ends_within_two_seconds_of_ctrl_c(processes: Processes) -> None:
    run = processes.start("run", MISSIONS / "material_handling.yaml", "--plain")
    read_until(run, "pusher starts")
    run.send_signal(signal.SIGINT)
    run.communicate(timeout=2.0)
    assert run.returncode == 130
    assert processes.alive() == []


def test_a_run_that_nobody_reads_any_more_ends_without_a_word(processes: Processes, small: Path) -> None:
    run = processes.start("run", small, "--speed", "2", "--plain")
    read_until(run, "left is there")
    assert run.stdout is not None
    assert run.stderr is not None
    run.stdout.close()
    assert run.wait(timeout=100) == 128 + signal.SIGTERM
    told = run.stderr.readlines()
    assert [line for line in told if not line.startswith("lalliance: warning: ")] == []
    until(lambda: processes.alive() == [])


def test_a_mission_without_robots_left_ends_before_its_deadline(processes: Processes, small: Path) -> None:
    run = processes.start("run", small, "--speed", "2", "--plain")
    read_until(run, "right starts")
    for name in ("left", "right"):
        os.kill(processes.robot(name), signal.SIGKILL)
    _, err = run.communicate(timeout=30)
    assert run.returncode == 1
    assert "no robot is left to complete the mission (left: killed by SIGKILL, right: killed by SIGKILL)" in err
    assert processes.alive() == []


CHATTY = """
import subprocess
from lalliance_agents import BehaviorSet

class Chatty(BehaviorSet):
    task = "a"

    async def perform(self):
        subprocess.Popen(["sleep", "1000"])
        print("working\\n" * 300_000)
        await super().perform()

def make():
    return [Chatty()]
"""


@pytest.mark.alone
def test_a_robots_own_code_can_neither_hold_the_launcher_nor_leave_a_process(processes: Processes, small: Path) -> None:
    (processes.folder / "chatty.py").write_text(CHATTY)
    small.write_text(SMALL.replace("left: {", "left: {behaviors: 'chatty:make', "))
    run = processes.start("run", small, "--plain")
    read_until(run, "[left] working")
    run.send_signal(signal.SIGINT)
    run.communicate(timeout=4.0)
    assert run.returncode == 130
    assert processes.alive() == []


def test_a_death_by_a_signal_without_a_name_is_told_too(processes: Processes, small: Path) -> None:
    run = processes.start("run", small, "--speed", "2", "--plain")
    read_until(run, "right starts")
    os.kill(processes.alive("world")[0], signal.SIGRTMIN + 1)
    read_until(run, "the world server ended (killed by signal 35); starting it again")
    out, err = run.communicate(timeout=60)
    assert run.returncode == 0, err
    assert "Mission small complete" in out


def test_a_world_server_that_dies_again_and_again_ends_the_run_with_a_sentence(
    processes: Processes, small: Path
) -> None:
    run = processes.start("run", small, "--speed", "2", "--plain")
    read_until(run, "right starts")
    deaths = 0
    while run.poll() is None:
        for world in processes.alive("world"):
            with contextlib.suppress(ProcessLookupError):
                os.kill(world, signal.SIGKILL)
                deaths += 1
    _, err = run.communicate(timeout=20)
    assert run.returncode == 1
    assert deaths >= RESTARTS + 1
    assert f"the world server ended {RESTARTS + 1} times without a summary (at last killed by SIGKILL)" in err
    assert processes.alive() == []


def test_a_world_server_that_ends_by_itself_is_not_started_again(processes: Processes, small: Path) -> None:
    endpoint = free_endpoint()
    router = processes.start("router", "--listen", endpoint)
    read_until(router, "listens")
    first = processes.start("run", small, "--plain", "--connect", endpoint)
    read_until(first, "right starts")
    second = processes.run("run", small, "--plain", "--connect", endpoint)
    assert second.returncode == 2
    assert "another world server serves mission small on this bus already" in second.stderr
    assert first.poll() is None
