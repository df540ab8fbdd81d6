"""`why`, `echo`, `hz` and `top` beside a mission of real processes, as the documents show them."""

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from support.documents import carried_out_by
from support.processes import Processes, read_until, until

#: With the names of the documents; it lasts for as long as it is looked at.
MISSION = """
name: material_handling
tasks: {crate-2: {}, barrel-1: {}}
robots:
  lifter: {tasks: {crate-2: 8}}
  carrier: {tasks: {crate-2: 12}}
  pusher: {tasks: {barrel-1: 3000}}
knowledge: given
parameters: {min_delay: 0.1, max_delay: 0.5}
faults: [{at: 2, robot: lifter, kind: crash}]
deadline: 9000
"""

#: A terminal shows its cursor again, and what was there before the screen was filled.
SCREEN_LEFT = "\x1b[?25h\x1b[?1049l"


SHOWN = carried_out_by("system/test_watching.py::test_every_command_that_is_shown_works_beside_a_mission")
COMMANDS = {" ".join(command): command for block in SHOWN for command in block.commands}


@pytest.fixture
def mission(tmp_path: Path) -> Path:
    path = tmp_path / "mission.yaml"
    path.write_text(MISSION)
    return path


def decisions(said: str) -> list[dict[str, Any]]:
    return [one for one in json.loads(said)["happened"] if "verb" in one]


def at_once(processes: Processes, commands: dict[str, list[str]]) -> dict[str, str]:
    """What commands print that run beside one another and must all succeed."""
    started = {name: processes.start(*command) for name, command in commands.items()}
    told = {name: process.communicate(timeout=100) for name, process in started.items()}
    assert {name: told[name][1] for name, process in started.items() if process.returncode} == {}
    return {name: out for name, (out, _) in told.items()}


def nothing_is_missing_afterwards(processes: Processes) -> "subprocess.Popen[str]":
    """Kill the router: the world tells who is gone, which nobody hears; it is asked for when the router is back.

    Returns:
        An `echo` that has seen it.
    """
    follow, echo = processes.start("why", "--follow"), processes.start("echo", "heartbeat/carrier")
    read_until(follow, "carrier finished crate-2")
    read_until(echo, "sender: carrier")
    [router] = processes.alive("router")
    os.kill(router, signal.SIGKILL)
    told = read_until(follow, "pusher is there")
    assert sum("carrier is gone" in line for line in told) == 1
    read_until(echo, "sender: carrier")

    def said(*more: str) -> list[str]:
        return sorted(map(json.dumps, json.loads(processes.run("why", "--json", *more).stdout)["happened"]))

    until(lambda: said() == said("--bag", "mission.mcap"))
    follow.send_signal(signal.SIGINT)
    assert follow.wait(timeout=30) == 130
    return echo


def test_every_command_that_is_shown_works_beside_a_mission(processes: Processes, mission: Path) -> None:
    run = processes.start("run", mission, "--plain", "--speed", "2", "--record", "mission.mcap")
    read_until(run, "carrier starts crate-2: lifter is not heard any more")
    commands = dict(COMMANDS)
    follow = processes.start(*commands.pop("why carrier --follow"))
    taken = read_until(follow, "carrier took crate-2 at ")[-1]
    assert "lifter silent for " in taken
    assert "carrier's own time 12.0 s was the best of those present; motivation reached the threshold after" in taken
    told = at_once(processes, commands)
    read_until(follow, "carrier finished crate-2 at ")
    follow.send_signal(signal.SIGINT)
    assert follow.wait(timeout=30) == 130

    assert taken in told["why"]
    assert taken in told["why carrier crate-2"]
    assert re.search(r"^at 2\.\d s: lifter is gone$", told["why"], flags=re.MULTILINE)
    assert told["echo heartbeat/* --once"].startswith("heartbeat/carrier\nv: 1\nsender: carrier\n")
    sensed = json.loads(told["echo sense/task/crate-2 --once --json"])
    assert (sensed["key"], sensed["message"]["sender"]) == ("sense/task/crate-2", "@world")
    rate = re.search(r"^activity/barrel-1/pusher +rate +([\d.]+) Hz", told["hz activity/** --for 2"], re.MULTILINE)
    assert rate is not None
    assert 2 < float(rate[1]) < 20  # five in a second of the mission
    assert json.loads(told["hz world/status --window 20 --for 2 --json"])["world/status"]["window"] <= 20
    table = {line.split()[0]: line.split()[1:3] for line in told["top --once"].splitlines()[3:]}
    assert (table["lifter"], table["pusher"][0]) == (["not", "there"], "barrel-1")
    robots = {row["robot"]: row for row in json.loads(told["top --json"])["robots"]}
    assert robots["pusher"]["motivation"] == 1.0

    # On a terminal `top` goes on until its viewer has seen enough.
    viewed = processes.start("top", within=[sys.executable, "-m", "support.terminal", "by name", "q"])
    screen, err = viewed.communicate(timeout=100)
    assert viewed.returncode == 0, err
    assert "material_handling: running" in screen
    assert screen.rstrip().endswith(SCREEN_LEFT)

    # What was said live is said again from the recording, and by a world that was killed and came back.
    asked = ("why", "carrier", "crate-2", "--json")
    live = decisions(processes.run(*asked).stdout)
    assert [one["kind"] for one in live] == ["activate", "sense_complete"]
    assert decisions(processes.run(*asked, "--bag", "mission.mcap").stdout) == live
    [world] = processes.alive("world")
    os.kill(world, signal.SIGKILL)
    until(lambda: processes.alive("world") not in ([], [world]))

    def remembered() -> bool:
        done = processes.run(*asked)
        return done.returncode == 0 and decisions(done.stdout) == live

    until(remembered)
    echo = nothing_is_missing_afterwards(processes)

    refused = {
        ("why", "carier"): "mission material_handling has no robot 'carier'; did you mean 'carrier'?",
        ("why", "carrier", "crate-3"): "mission material_handling has no task 'crate-3'; did you mean 'crate-2'?",
        ("echo", "hartbeat/*"): "'hartbeat/*' matches no key of mission material_handling; did you mean 'heartbeat/*'?",
        ("top", "--mission", "material-handling"): "expected a mission started by `lalliance run`, or --connect",
    }
    asking = {words: processes.start(*words) for words in refused}
    answers = {words: (*one.communicate(timeout=100), one.returncode) for words, one in asking.items()}
    assert all((out, code) == ("", 2) and refused[words] in err for words, (out, err, code) in answers.items()), answers
    run.send_signal(signal.SIGINT)
    assert run.wait(timeout=30) == 130
    [gap] = json.loads(processes.run("bag", "info", "mission.mcap", "--json").stdout)["gaps"]
    assert (gap["why"], gap["answered"], gap["recovered"] > 1) == ("the bus was not reached", True, True)
    assert echo.stderr is not None
    assert "the bus has not been reached for 2 s at tcp/127.0.0.1:" in echo.stderr.readline()
    echo.send_signal(signal.SIGINT)
    assert echo.wait(timeout=30) == 130
    left = processes.run("why")
    assert (left.returncode, left.stdout) == (2, "")
    assert "no mission is known to run on this machine, and no router answers at" in left.stderr
