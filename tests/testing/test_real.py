"""The plugin with real processes: whatever becomes of a test, its processes end; and robots run the code of its author."""

import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.processes import Processes, read_until, until

pytestmark = pytest.mark.alone

MISSION = """
name: pair
tasks: {a: {}, b: {}}
robots:
  left: {tasks: {a: 50, b: 90}}
  right: {tasks: {a: 90, b: 50}}
knowledge: given
parameters: {min_delay: 0.1, max_delay: 0.4}
"""
TEST = """
import time

def test_it(lalliance_mission):
    mission = lalliance_mission("pair.yaml", speed=2)
    mission.wait_for("activate", robot="left", task="a")
    mission.inject(kind="hang", robot="right")
    while not mission.faults()["1-hang"]["fired"]:
        pass
    print("running", flush=True)
    END
"""


#: Options that spare the inner pytest what it does not need.
QUICK = ("-p", "no:cacheprovider", "-p", "no:hypothesispytest")


@pytest.fixture
def processes(tmp_path: Path) -> Iterator[Processes]:
    (tmp_path / "pair.yaml").write_text(MISSION)
    with Processes(tmp_path) as tree:
        yield tree


def start(processes: Processes, end: str, *options: str) -> "subprocess.Popen[str]":
    """Run pytest to the point where the mission of its test runs, with a robot stopped."""
    (processes.folder / "test_pair.py").write_text(TEST.replace("END", end))
    running = processes.start_module("pytest", "-s", *QUICK, *options)
    read_until(running, "running")
    return running


@pytest.mark.parametrize("end", ["assert mission is None", "raise SystemExit"])
def test_no_process_survives_a_test_that_fails_and_the_report_tells_its_story(processes: Processes, end: str) -> None:
    out, _ = start(processes, end).communicate(timeout=30)
    assert processes.alive() == []
    assert "left starts a: nobody is on it" in out
    assert "--lalliance-seed 0 --lalliance-speed 2" in out


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_no_process_survives_whatever_ends_pytest(processes: Processes, number: signal.Signals) -> None:
    running = start(processes, "mission.wait_for('end')")
    assert len(processes.alive("robot")) == 2
    running.send_signal(number)
    running.communicate(timeout=5)
    until(lambda: processes.alive() == [], seconds=5.0)


def test_no_process_survives_a_time_limit_that_ends_pytest_at_once(processes: Processes) -> None:
    running = start(processes, "mission.wait_for('end')", "--timeout=10", "--timeout-method=thread")
    running.communicate(timeout=30)
    until(lambda: processes.alive() == [], seconds=5.0)


CODE = """
from lalliance_agents import BehaviorSet

class Talk(BehaviorSet):
    task = "b"

    async def perform(self):
        print("at work")
        await super().perform()

def behaviors():
    return [Talk()]
"""
OWN_TEST = """
def test_it(lalliance_mission):
    mission = lalliance_mission("../pair.yaml", speed=20)
    mission.wait_for("remark", text="[right] at work", anywhere=True)
    assert mission.finish()["complete"]
"""


def test_robots_find_the_code_beside_their_test(processes: Processes) -> None:
    folder = processes.folder / "tests"
    folder.mkdir()
    (folder / "own_robot.py").write_text(CODE)
    (folder / "test_own.py").write_text(OWN_TEST)
    (processes.folder / "pair.yaml").write_text(
        MISSION.replace("right: {", "right: {behaviors: 'own_robot:behaviors', ")
    )
    out, _ = processes.start_module("pytest", *QUICK).communicate(timeout=60)
    assert "1 passed" in out, out
