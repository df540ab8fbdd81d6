"""What the README and short pages show, done as they say."""

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from support.documents import ROOT, Shown, blocks, carried_out_by
from support.processes import MISSIONS, Processes, read_until

from lalliance_agents.bus.router import free_endpoint
from lalliance_agents.faults import LinkFault, kind_of
from lalliance_agents.mission_file import parse_mission

README = "README.md"
EACH = carried_out_by("control/test_readme.py::test_each_block_of_commands_works")


@pytest.fixture
def processes(tmp_path: Path) -> Iterator[Processes]:
    (tmp_path / "missions").symlink_to(MISSIONS)
    [mission] = blocks(README, "yaml")
    for name in ("two-rooms.yaml", "my-mission.yaml"):
        (tmp_path / name).write_text(mission)
    [code] = [block for block in blocks(README, "python") if "def behaviors" in block]
    (tmp_path / "my_robot.py").write_text(code)
    with Processes(tmp_path) as tree:
        yield tree


@pytest.mark.parametrize("block", EACH, ids=lambda block: f"{block.page}: {block.first}".replace("/", "-"))
def test_each_block_of_commands_works(processes: Processes, block: Shown) -> None:
    for command in block.commands:
        done = processes.run(*command)
        assert done.returncode == 0, done.stderr
        assert done.stdout
    assert processes.alive() == []


def test_a_robot_of_ones_own_performs_and_takes_the_task_over(processes: Processes) -> None:
    [block] = carried_out_by("control/test_readme.py::test_a_robot_of_ones_own_performs_and_takes_the_task_over")
    [command] = block.commands
    done = processes.run(*command)
    assert done.returncode == 0, done.stderr
    assert "all-rounder takes sweep from broom (silence)" in done.stdout
    assert "mopping, progress 0.0" in done.stdout
    assert "mop put away" in done.stdout


def test_the_single_processes_make_a_team(processes: Processes) -> None:
    endpoint = free_endpoint()
    [block] = carried_out_by("control/test_readme.py::test_the_single_processes_make_a_team")
    router, world, *robots = [
        [word.replace("tcp/127.0.0.1:7447", endpoint) for word in command] for command in block.commands
    ]
    running = processes.start(*router)
    read_until(running, "listens")
    team = [processes.start(*command) for command in robots]
    done = processes.run(*world)
    assert done.returncode == 0, done.stderr
    assert "Mission two-rooms complete" in done.stdout
    for member in team:
        member.communicate(timeout=10)
        assert member.returncode == 0


def test_faults_are_injected_and_healed_while_a_mission_runs(processes: Processes) -> None:
    running = processes.start("run", MISSIONS / "material_handling.yaml", "--plain")
    read_until(running, "pusher starts")
    [block] = carried_out_by("control/test_readme.py::test_faults_are_injected_and_healed_while_a_mission_runs")
    said = [processes.chaos(*command[1:]) for command in block.commands]
    beginnings = [line.split(":")[0] for line in said]
    assert beginnings[:4] == ["2-hang", "3-link", "4-partition", "Mission material_handling"]
    # On a busy machine those that last a few seconds may be over by now, and the mission's own crash may have come.
    assert re.match(r"healed (1-crash, )?(2-hang, )?3-link(, 4-partition)?$", beginnings[4])
    assert re.search("^2-hang .* fired at", said[3], flags=re.MULTILINE)
    assert "partition lifter carrier" in said[3]


def test_a_mission_runs_with_keys(processes: Processes) -> None:
    [block] = carried_out_by("control/test_readme.py::test_a_mission_runs_with_keys")
    for command in block.commands:
        done = processes.run(*command)
        assert done.returncode == 0, done.stderr
    assert "Mission material_handling complete" in done.stdout


def test_each_example_of_a_fault_is_one_and_every_kind_has_an_example() -> None:
    examples = re.findall(r"^\| \w+ \| `(\{.*?\})` \|", (ROOT / README).read_text(), flags=re.MULTILINE)
    mission = (MISSIONS / "material_handling.yaml").read_text()
    assert {kind_of(parse_mission(planned(mission, one), "m.yaml").faults[0]) for one in examples} == {
        "crash", "hang", "stuck", "slow", "mute", "deaf", "blind", "link", "partition"
    }  # fmt: skip
    written = {field for one in examples for field in yaml.safe_load(one)}
    assert written >= LinkFault.model_fields.keys() - {"held"}


def planned(mission: str, fault: str) -> str:
    return yaml.safe_dump(yaml.safe_load(mission) | {"faults": [yaml.safe_load(fault)]})


def test_every_command_of_the_tool_is_in_the_readme(processes: Processes) -> None:
    listed = re.findall(r"^  (\w+)  ", processes.run("--help").stdout, flags=re.MULTILINE)
    assert len(listed) == 22
    text = (ROOT / README).read_text()
    assert [name for name in listed if f"lalliance {name}" not in text] == []


def test_the_commands_are_there_before_anything_that_takes_long_to_import() -> None:
    heavy = {"pydantic", "numpy", "zenoh", "msgpack", "rich.live", "yaml"}
    code = f"import sys, mission_control.cli; print({heavy!r} & sys.modules.keys())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (0, "set()\n", "")
