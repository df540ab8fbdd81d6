"""What docs/testing.md and the README show of tests, run as a user would: by pytest, in a folder with nothing else in it."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.processes import MISSIONS, PYTEST_ALONE, Processes

from mission_control.watch.happened import KINDS

DOCUMENT = (MISSIONS.parent / "docs" / "testing.md").read_text()
README = (MISSIONS.parent / "README.md").read_text()


def blocks(text: str) -> list[str]:
    return re.findall(r"^```python\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)


@pytest.fixture
def processes(tmp_path: Path) -> Iterator[Processes]:
    with Processes(tmp_path) as tree:
        yield tree


def run(processes: Processes, test: str, *options: str) -> str:
    (processes.folder / "test_depot.py").write_text(test)
    running = processes.start_module("pytest", *PYTEST_ALONE, *options)
    out, _ = running.communicate(timeout=110)
    assert running.returncode == 0, out
    return out


def test_the_example_runs_in_an_empty_folder(processes: Processes) -> None:
    assert "7 passed" in run(processes, blocks(DOCUMENT)[0])
    assert processes.alive() == []


def test_the_injections_that_are_shown_are_taken(processes: Processes) -> None:
    example, injections = blocks(DOCUMENT)
    start = example.split("@pytest")[0] + "\ndef test_it(lalliance_mission):\n    mission = lalliance_mission(DEPOT)\n"
    lines = ["mission.wait_for('activate', robot='lifter')", *injections.splitlines(), "mission.finish()"]
    run(processes, start + "".join(f"    {line}\n" for line in lines), "--lalliance-engine=simulated")


def test_the_readmes_test_passes(processes: Processes) -> None:
    (processes.folder / "missions").symlink_to(MISSIONS)
    [test] = [block for block in blocks(README) if "lalliance_mission" in block]
    run(processes, test)


def test_every_kind_of_event_is_in_the_document() -> None:
    table = DOCUMENT.partition("| kind |")[2].partition("\n\n")[0]
    told = set(re.findall(r"`(\w+)`", "".join(line.split("|")[1] for line in table.splitlines()[2:])))
    assert told == KINDS.keys()
