"""Robots that share processes, as real ones over a real router."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from support.processes import Processes, read_until, until, words_of

from lalliance_agents.bus.router import free_endpoint
from lalliance_agents.mission_file import parse_mission
from mission_control.hosting import named, shares

MISSION = """
name: shared
tasks: {a: {}, b: {}, c: {}}
robots:
  left-1: {tasks: {a: 5, b: 9}}
  left-2: {tasks: {a: 9, b: 5}}
  right: {tasks: {b: 9, c: 6}}
  late: {tasks: {c: 9}, joins: 2}
knowledge: given
parameters: {min_delay: 0.1, max_delay: 0.4}
"""


@pytest.fixture
def processes(tmp_path: Path) -> Iterator[Processes]:
    with Processes(tmp_path) as tree:
        (tree.folder / "shared.yaml").write_text(MISSION)
        yield tree


def test_robots_that_share_processes_finish_a_mission_and_one_that_joins_has_its_own(processes: Processes) -> None:
    run = processes.start("run", "shared.yaml", "--speed", "2", "--plain", "--processes", "2")
    read_until(run, "starts")
    done = processes.run("chaos", "shared.yaml", "inject", "kind=hang", "robot=right")
    assert (done.returncode, done.stdout) == (2, "")
    assert (
        "nobody here can reach the robots' processes; expected a mission started by `lalliance run` with one"
        in done.stderr
    )
    until(lambda: len(processes.alive("robot")) == 3)
    names = [
        [words_of(pid)[at + 1] for at, word in enumerate(words_of(pid)) if word == "--name"]
        for pid in processes.alive("robot")
    ]
    assert sorted(names) == [["late"], ["left-1"], ["left-2", "right"]]
    out, err = run.communicate(timeout=60)
    assert run.returncode == 0, err
    assert all(
        f"{task} completed by {robot}" in out for task, robot in {"a": "left-1", "b": "left-2", "c": "right"}.items()
    )
    assert processes.alive() == []


def test_one_process_speaks_for_the_robots_that_a_glob_names(processes: Processes) -> None:
    endpoint = free_endpoint()
    read_until(processes.start("router", "--listen", endpoint), "listens")
    world = processes.start("world", "shared.yaml", "--connect", endpoint, "--speed", "4", "--wait", "0")
    hosted = processes.start(
        "robot", "shared.yaml", "--connect", endpoint, "--speed", "4", "--name", "left-*", "--name", "right"
    )
    out, _ = world.communicate(timeout=60)
    assert world.returncode == 0, out
    assert "Mission shared complete" in out
    said, err = hosted.communicate(timeout=20)
    assert (hosted.returncode, err) == (0, "")
    assert said == f"robots left-1, left-2, right of mission shared are connected to {endpoint}\n"


def test_robots_are_named_in_the_missions_order_and_shared_out_evenly() -> None:
    mission = parse_mission(MISSION, "test.yaml")
    assert named(Path("m.yaml"), mission, ["right", "*-2", "left-*"]) == ["left-1", "left-2", "right"]
    assert shares(list("abcdefg"), 3) == [["a", "b"], ["c", "d"], ["e", "f", "g"]]
    assert shares(list("ab"), 3) == shares(list("ab"), None) == [["a"], ["b"]]
    assert shares([], 3) == shares([], None) == []
