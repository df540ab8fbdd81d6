"""The examples, used as docs/your-robot.md tells, in folders of their own."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.documents import ROOT
from support.processes import PYTEST_ALONE, Processes, read_until, until

from lalliance_agents.bus.router import free_endpoint


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
