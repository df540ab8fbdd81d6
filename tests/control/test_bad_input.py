"""Bad input gets one sentence, exit status 2, and nothing is started."""

import json
import os
import socket
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.processes import Processes

GOOD = """\
name: good
tasks: {a: {}, b: {after: [a]}}
robots:
  one: {tasks: {a: 5, b: 5}}
  two: {tasks: {a: 6}}
parameters: {min_delay: 0.05, max_delay: 0.2}
deadline: 60
"""


@pytest.fixture
def processes(tmp_path: Path) -> Iterator[Processes]:
    with Processes(tmp_path) as tree:
        yield tree


def changed(old: str, new: str) -> str:
    assert old in GOOD
    return GOOD.replace(old, new)


FILES = {
    "broken YAML": ("name: [good\ntasks: {", "m.yaml:2:6: not readable as YAML: "),
    "unknown field": (changed("deadline", "dedline"), "m.yaml:7: dedline: unknown field; did you mean 'deadline'?"),
    "unknown parameter": (
        changed("min_delay", "mindelay"),
        "m.yaml:6: parameters.mindelay: unknown field; did you mean 'min_delay'?",
    ),
    "a task nobody can do": (
        changed("b: {after: [a]}", "b: {after: [a]}, c: {}"),
        "m.yaml:2: tasks.c: no robot can do this task; expected at least one robot that lists it",
    ),
    "a circle of prerequisites": (
        changed("a: {}", "a: {after: [b]}"),
        "m.yaml:2: tasks.a.after: the prerequisites form a circle: a after b after a",
    ),
    "silence timeout too short": (
        changed("max_delay: 0.2", "max_delay: 0.2, silence_timeout: 0.4"),
        "m.yaml:6: parameters: silence_timeout 0.4 s must be longer than two broadcast periods, 2/broadcast_rate = 0.4 s",
    ),
    "boredom too early": (
        changed("max_delay: 0.2", "max_delay: 0.2, boredom_rate: 5"),
        "m.yaml:6: parameters: boredom reaches its threshold after 0.2 s, which must be longer than max_delay 0.2 s",
    ),
    "a name with a slash": (
        changed("  two:", "  two/three:"),
        "m.yaml:5: robots: 'two/three' is not a name; expected 1 to 64 of A-Z a-z 0-9 _ -",
    ),
    "a negative time": (
        changed("two: {tasks: {a: 6}}", "two: {tasks: {a: -6}}"),
        "m.yaml:5: robots.two.tasks.a: -6 is not allowed; expected a number greater than 0",
    ),
    "an unknown environment": (
        changed("deadline", "environment: {kind: task_poll}\ndeadline"),
        "m.yaml:7: environment.kind: 'task_poll' is not a known environment; did you mean 'task_pool'?",
    ),
    "an unknown option of the environment": (
        changed("deadline", "environment: {kind: task_pool, handover: restart}\ndeadline"),
        "m.yaml:7: environment.handover: unknown field; did you mean 'hand_over'?",
    ),
    "behaviour sets that are not there": (
        changed("two: {", "two: {behaviors: 'no_such_module:make', "),
        "m.yaml:5: robots.two.behaviors: behaviors 'no_such_module:make' cannot be loaded: ModuleNotFoundError",
    ),
    "a fault of an unknown robot": (
        changed("deadline", "faults: [{at: 1, robot: tow, kind: crash}]\ndeadline"),
        "m.yaml:7: faults.0.robot: 'tow' is not a robot of this mission; did you mean 'two'?",
    ),
}


@pytest.mark.parametrize("case", FILES)
def test_a_bad_mission_is_refused_with_its_place_and_what_was_expected(processes: Processes, case: str) -> None:
    text, sentence = FILES[case]
    (processes.folder / "m.yaml").write_text(text)
    done = processes.run("run", "m.yaml", "--json")
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.startswith(f"lalliance: {sentence}")
    assert done.stderr.count("\n") == 1


COMMANDS = {
    "missing file": (["check", "no.yaml"], "no.yaml: no such file; expected a mission file"),
    "a directory": (["run", "."], ".: a directory; expected a mission file"),
    "an unknown robot": (
        ["robot", "good.yaml", "--name", "three"],
        "good.yaml: no robot 'three' in this mission; expected one of one, two",
    ),
    "behaviours that are not there": (
        ["robot", "good.yaml", "--name", "one", "--behaviors", "no_such_module:make"],
        "behaviors 'no_such_module:make' cannot be loaded: ModuleNotFoundError",
    ),
    "a glob that names no robot": (
        ["robot", "good.yaml", "--name", "one", "--name", "th*"],
        "good.yaml: no robot 'th*' in this mission; expected one of one, two",
    ),
    "several robots with the keys of one": (
        ["robot", "good.yaml", "--name", "*", "--keys", "keys"],
        "--keys keys: robots one, two would share one connection, and a certificate speaks for one robot alone; expected ",
    ),
    "robots with keys that share a process": (
        ["run", "good.yaml", "--processes", "1", "--keys", "keys"],
        "--keys keys: robots one, two would share one connection, and a certificate speaks for one robot alone; expected ",
    ),
    "learned times where there is no folder": (
        ["run", "good.yaml", "--learned", "good.yaml"],
        "good.yaml: learned times cannot be stored here (File exists); expected a folder that can be written to",
    ),
    "an empty endpoint": (["run", "good.yaml", "--connect", ""], "'' is not an endpoint"),
    "a crash of a process that others share": (
        ["run", "crash.yaml", "--processes", "1"],
        "crash.yaml: faults.0: crash of one would strike all robots of a process that several share; expected no crash ",
    ),
    "an endpoint that is none": (["router", "--listen", "nonsense"], "'nonsense' is not an endpoint"),
    "a router to use and one to start": (
        ["run", "good.yaml", "--connect", "tcp/127.0.0.1:1", "--listen", "tcp/127.0.0.1:2"],
        "--connect uses a router that runs already, --listen starts one; expected one of the two",
    ),
}


@pytest.mark.parametrize("case", COMMANDS)
def test_a_bad_command_is_refused(processes: Processes, case: str) -> None:
    arguments, sentence = COMMANDS[case]
    (processes.folder / "good.yaml").write_text(GOOD)
    (processes.folder / "crash.yaml").write_text(GOOD + "faults: [{at: 3, robot: one, kind: crash}]\n")
    done = processes.run(*arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.startswith(f"lalliance: {sentence}")
    assert done.stderr.count("\n") == 1


def test_a_module_that_ends_the_process_is_no_behaviour(processes: Processes) -> None:
    (processes.folder / "leaver.py").write_text("import sys\nsys.exit(0)\n")
    (processes.folder / "m.yaml").write_text(changed("two: {", "two: {behaviors: 'leaver:make', "))
    done = processes.run("check", "m.yaml")
    assert done.returncode == 2
    assert "behaviors 'leaver:make' cannot be loaded: SystemExit: 0" in done.stderr


def test_what_a_module_prints_is_no_part_of_the_document(processes: Processes) -> None:
    (processes.folder / "talker.py").write_text("print('hello')\ndef make():\n    print('made')\n    return []\n")
    (processes.folder / "m.yaml").write_text(changed("two: {", "two: {behaviors: 'talker:make', "))
    assert processes.run_json("run", "m.yaml", "--speed", "4")["complete"]


def test_a_pipe_is_no_mission(processes: Processes) -> None:
    os.mkfifo(processes.folder / "pipe")
    done = processes.run("check", "pipe")
    assert done.returncode == 2
    assert done.stderr == "lalliance: pipe: not a regular file; expected a mission file\n"


@pytest.mark.parametrize("arguments", [["router", "--listen"], ["run", "good.yaml", "--listen"]])
def test_a_port_in_use_is_refused(processes: Processes, arguments: list[str]) -> None:
    (processes.folder / "good.yaml").write_text(GOOD)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        endpoint = f"tcp/127.0.0.1:{taken.getsockname()[1]}"
        done = processes.run(*arguments, endpoint)
    assert done.returncode == 2
    assert done.stderr.startswith(f"lalliance: The router cannot listen on {endpoint}: the port is in use")
    assert processes.alive() == []


@pytest.mark.parametrize(
    "arguments", [["run", "good.yaml"], ["world", "good.yaml"], ["robot", "good.yaml", "--name", "one"]]
)
def test_a_router_that_cannot_be_reached_is_reported_within_ten_seconds(
    processes: Processes, arguments: list[str]
) -> None:
    (processes.folder / "good.yaml").write_text(GOOD)
    with socket.create_server(("127.0.0.1", 0)) as closed:
        endpoint = f"tcp/127.0.0.1:{closed.getsockname()[1]}"
    began = time.monotonic()
    done = processes.run(*arguments, "--connect", endpoint)
    assert time.monotonic() - began < 10
    assert done.returncode == 2
    assert done.stderr.startswith(f"lalliance: No router could be reached at {endpoint}")
    assert done.stderr.count("\n") == 1
    assert processes.alive() == []


def test_what_is_good_is_called_good(processes: Processes) -> None:
    (processes.folder / "good.yaml").write_text(GOOD)
    done = processes.run("check", "good.yaml")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == "good.yaml is a good mission: good, with 2 robots, 2 tasks, 1 trial, 0 faults\n"


def test_what_a_terminal_has_no_letters_for_is_left_open(processes: Processes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONIOENCODING", "latin-1")
    (processes.folder / "g\N{GREEK SMALL LETTER TAU}d.yaml").write_text(GOOD)
    done = processes.run("check", "g\N{GREEK SMALL LETTER TAU}d.yaml")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("g?d.yaml is a good mission: good")


def test_the_schema_is_json_and_knows_the_options_of_environments(processes: Processes) -> None:
    schema = json.loads(processes.run("schema").stdout)
    assert schema["properties"].keys() >= {"name", "tasks", "robots", "parameters", "phases", "faults"}
    assert schema["$defs"]["Parameters"]["properties"]["strategy"]["default"] == "II"
    assert schema["$defs"]["Parameters"]["properties"]["ordering"]["default"] == "derived"
    assert schema["properties"]["tasks"]["additionalProperties"] is False
    kinds = [one["if"]["properties"]["kind"]["const"] for one in schema["$defs"]["EnvironmentChoice"]["allOf"]]
    assert kinds == ["task_pool", "box_pushing"]


def test_a_robot_that_cannot_use_its_behaviour_sets_ends_the_run(processes: Processes) -> None:
    (processes.folder / "bots.py").write_text(
        "from lalliance_agents import BehaviorSet\n\ndef make():\n    return [BehaviorSet('aa')]\n"
    )
    (processes.folder / "m.yaml").write_text(changed("two: {", "two: {behaviors: 'bots:make', "))
    done = processes.run("run", "m.yaml", "--json")
    assert (done.returncode, done.stdout) == (2, "")
    assert "lalliance: robot two: <BehaviorSet for aa> is for task 'aa', which robot two does not have" in done.stderr
    assert processes.alive() == []


def test_a_seed_that_no_mission_may_have_is_refused(processes: Processes) -> None:
    for command in ("run", "simulate", "world"):
        done = processes.run(command, "good.yaml", "--seed", str(2**63))
        assert (done.returncode, done.stdout) == (2, "")
        assert "--seed" in done.stderr
        assert "Traceback" not in done.stderr
