"""The examples, used as docs/your-robot.md tells, in folders of their own."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.documents import ROOT
from support.processes import PYTEST_ALONE, Processes, read_until, until

from lalliance_agents.bus.router import free_endpoint

#: Stands for ROS 2, which is not there.
ROS = Path(__file__).with_name("ros")

#: Stops driving before the goal is accepted.
HASTY = """
import asyncio
import base

async def hurry():
    visit, _ = base.behaviors()
    driving = asyncio.create_task(visit.perform())
    await asyncio.sleep(0)
    driving.cancel()
    await asyncio.wait({driving})
    print("cancelled" if driving.cancelled() else "went on")

asyncio.run(hurry())
"""


@pytest.fixture
def processes(tmp_path: Path) -> Iterator[Processes]:
    with Processes(tmp_path) as tree:
        yield tree


def copied(name: str, folder: Path) -> None:
    shutil.copytree(ROOT / "examples" / name, folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__"))


def test_the_greenhouse_passes_its_own_tests(processes: Processes) -> None:
    copied("greenhouse", processes.folder)
    running = processes.start_module("pytest", *PYTEST_ALONE)
    out, _ = running.communicate(timeout=110)
    assert running.returncode == 0, out
    assert "4 passed" in out
    assert processes.alive() == []


def test_a_watchman_without_a_world_goes_on_where_another_one_died(processes: Processes) -> None:
    copied("patrol", processes.folder)
    stamps, endpoint = processes.folder / "inspected", free_endpoint()
    read_until(processes.start("router", "--listen", endpoint), "listens")
    team = ("patrol.yaml", "--connect", endpoint, "--without-world")
    scout, spare = (processes.start("robot", *team, "--name", name) for name in ("scout", "spare"))
    read_until(scout, "inspecting the gate")
    scout.kill()
    read_until(spare, "inspecting the fence")
    read_until(spare, "inspecting the gate")
    until(lambda: {path.name for path in stamps.iterdir()} == {"gate", "fence"})


def test_bases_under_ros_share_their_rounds_and_stop_when_their_robot_does(
    processes: Processes, monkeypatch: pytest.MonkeyPatch
) -> None:
    copied("rounds", processes.folder)
    monkeypatch.setenv("PYTHONPATH", str(ROS))
    endpoint = free_endpoint()
    read_until(processes.start("router", "--listen", endpoint), "listens")
    team = ("rounds.yaml", "--connect", endpoint, "--without-world")
    red, blue = (processes.start("robot", *team, "--name", name) for name in ("red", "blue"))
    read_until(red, "drives to 4.0 1.5")
    red.terminate()
    read_until(red, "stops on its way to 4.0 1.5")
    for what in ("reaches -2.0 6.0", "drives to 4.0 1.5", "reaches 4.0 1.5"):
        read_until(blue, what)
    until(lambda: {path.name for path in (processes.folder / "visited").iterdir()} == {"gate", "fence"})


def test_a_goal_that_is_accepted_only_after_it_was_given_up_is_cancelled(
    processes: Processes, monkeypatch: pytest.MonkeyPatch
) -> None:
    copied("rounds", processes.folder)
    (processes.folder / "hasty.py").write_text(HASTY)
    monkeypatch.setenv("PYTHONPATH", str(ROS))
    out, err = processes.start_module("hasty").communicate(timeout=60)
    assert out.splitlines() == ["drives to 4.0 1.5", "stops on its way to 4.0 1.5", "cancelled"], err
