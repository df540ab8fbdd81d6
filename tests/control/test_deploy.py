"""What a deployment needs of the commands: the compose file, the look at health, the kept summary."""

import json
import os
import re
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from support.processes import MISSIONS, Processes, is_stopped, read_until, until
from support.secured import new_keys

from lalliance_agents.bus.router import free_endpoint

ROOT = MISSIONS.parent
PAIR = """\
name: pair
tasks: {a: {}, b: {after: [a]}}
robots:
  r1: {tasks: {a: 5, b: 5}}
  r2: {tasks: {a: 6}, joins: 2}
knowledge: given
parameters: {min_delay: 0.05, max_delay: 0.2}
deadline: 60
"""


@pytest.fixture
def processes(tmp_path: Path) -> Iterator[Processes]:
    (tmp_path / "pair.yaml").write_text(PAIR)
    (tmp_path / "missions").symlink_to(MISSIONS)
    with Processes(tmp_path) as tree:
        yield tree


def test_the_compose_file_that_is_shipped_is_the_one_that_is_generated(processes: Processes) -> None:
    shipped = (ROOT / "deploy/compose.yaml").read_text()
    [words] = re.findall(r"^# Made by: lalliance (.*)$", shipped, flags=re.MULTILINE)
    assert processes.run(*words.split()).stdout == shipped


def test_a_mission_with_code_of_its_own_says_that_the_image_has_none(processes: Processes) -> None:
    mission = "name: own\ntasks: {t: }\nrobots: {r: {tasks: {t: 30}, behaviors: 'mine:behaviors'}}\n"
    (processes.folder / "own.yaml").write_text(mission)
    assert processes.run("deploy", "compose", "own.yaml").stderr == (
        "lalliance: warning: own.yaml: the image holds no code of yours; use one of your own, FROM lalliance, with mine\n"
    )


def test_every_robot_has_a_service_with_its_own_keys_alone(processes: Processes) -> None:
    done = processes.run("deploy", "compose", "pair.yaml", "--folder", "elsewhere/deep")
    assert done.returncode == 0
    assert done.stderr == (
        "lalliance: warning: pair.yaml: who joins later is to be started by hand, with docker compose up -d: robot-r2 at 2 s\n"
    )
    services = yaml.safe_load(done.stdout)["services"]
    assert list(services) == ["router", "world", "robot-r1", "robot-r2", "summary", "operator", "dashboard"]
    assert services["robot-r2"]["profiles"] == ["later"]
    bound = {
        name: [volume["source"] for volume in service["volumes"] if volume["type"] == "bind"]
        for name, service in services.items()
    }
    keys, mission = "${LALLIANCE_KEYS:-./keys}", "../../pair.yaml"
    assert bound == {
        "router": [f"{keys}/router"],
        "world": [mission, f"{keys}/world"],
        "robot-r1": [mission, f"{keys}/robots/r1"],
        "robot-r2": [mission, f"{keys}/robots/r2"],
        "summary": [],
        "operator": [mission, f"{keys}/operator"],
        "dashboard": [mission, f"{keys}/operator"],
    }
    assert [name for name, service in services.items() if service["networks"] != ["bus"]] == ["dashboard"]
    assert services["dashboard"]["ports"] == ["127.0.0.1:${LALLIANCE_PAGE:-8080}:8080"]


def test_the_keys_that_are_named_must_be_those_of_the_mission(processes: Processes) -> None:
    new_keys(processes.folder / "keys", "r1")
    done = processes.run("deploy", "compose", "pair.yaml", "--keys", "keys")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        "lalliance: keys: these keys were made for another team, without r2 of pair.yaml; "
        "expected new ones, once these are moved away: lalliance keys init pair.yaml --keys keys\n"
    )
    new_keys(processes.folder / "both", "r1", "r2")
    done = processes.run("deploy", "compose", "pair.yaml", "--folder", "there", "--keys", "both")
    assert "${LALLIANCE_KEYS:-../both}/robots/r1" in done.stdout


def test_a_bad_mission_makes_no_compose_file(processes: Processes) -> None:
    (processes.folder / "bad.yaml").write_text(PAIR.replace("deadline", "dedline"))
    done = processes.run("deploy", "compose", "bad.yaml")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("lalliance: bad.yaml:8: dedline: unknown field")


def test_health_is_asked_of_whoever_it_is_about(processes: Processes) -> None:
    """A robot that hangs does not answer, nor does one that is not there; the world and the router do."""
    keys = new_keys(processes.folder / "keys", "r1", "r2")
    endpoint = free_endpoint("tls")
    told = ["--connect", endpoint, "--keys", keys]
    gone = processes.run("health", *told)
    assert (gone.returncode, gone.stdout) == (1, "")
    assert f"No router could be reached at {endpoint}" in gone.stderr
    running = processes.start("run", "pair.yaml", "--plain", "--keys", keys, "--listen", endpoint, "--speed", "0.2")
    read_until(running, "r1 starts")
    assert processes.run("health", *told).stdout == f"the router at {endpoint} is well\n"
    assert processes.run("health", "pair.yaml", *told).stdout == "the world of mission pair is well\n"
    robot = ["health", "pair.yaml", "--name", "r1", *told]
    assert processes.run(*robot).stdout == "robot r1 of mission pair is well\n"
    pid = processes.robot("r1")
    os.kill(pid, signal.SIGSTOP)
    until(lambda: is_stopped(pid))
    ill = processes.run(*robot)
    assert (ill.returncode, ill.stdout) == (1, "")
    assert ill.stderr == f"lalliance: robot r1 of mission pair does not answer at {endpoint}\n"
    os.kill(pid, signal.SIGCONT)


def test_a_member_waits_for_its_router_as_long_as_it_is_told(processes: Processes) -> None:
    endpoint = free_endpoint()
    robot = ["robot", "pair.yaml", "--name", "r1", "--connect", endpoint, "--connect-timeout"]
    given_up = processes.run(*robot, "0.2")
    assert (given_up.returncode, given_up.stdout) == (2, "")
    assert given_up.stderr.startswith(f"lalliance: No router could be reached at {endpoint} within 0.2 s")
    patient = processes.start(*robot, "100")
    # It is on its way when it holds the library of the bus.
    until(lambda: "zenoh" in Path(f"/proc/{patient.pid}/maps").read_text())
    processes.start("router", "--listen", endpoint)
    read_until(patient, f"robot r1 of mission pair is connected to {endpoint}")


def test_a_summary_is_kept_and_told_with_the_missions_status(processes: Processes) -> None:
    endpoint = free_endpoint()
    read_until(processes.start("router", "--listen", endpoint), "listens")
    waiting = processes.start("summary", "kept.json", "--wait", "--json")
    processes.start("robot", "pair.yaml", "--name", "r1", "--connect", endpoint, "--speed", "4")
    world = ["world", "pair.yaml", "--connect", endpoint, "--speed", "4", "--summary", "kept.json", "--json"]
    summary = processes.run_json(*world[:-1])
    out, _ = waiting.communicate(timeout=30)
    assert waiting.returncode == 0
    assert json.loads(out) == summary
    told = processes.run("summary", "kept.json")
    assert told.returncode == 0
    assert f"Mission pair complete: makespan {summary['makespan']:.1f} s" in told.stdout
    (processes.folder / "failed.json").write_text(json.dumps({**summary, "complete": False}))
    assert processes.run("summary", "failed.json").returncode == 1


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (None, "kept.json: no such file; expected a mission that is over, or --wait"),
        ("{", "kept.json: this is no summary; expected what `lalliance world --summary FILE` has written"),
        ("[]", "kept.json: this is no summary; expected what `lalliance world --summary FILE` has written"),
        (
            '{"complete": true}',
            "kept.json: this is no summary; expected what `lalliance world --summary FILE` has written",
        ),
    ],
)
def test_what_is_no_summary_is_refused(processes: Processes, text: str | None, sentence: str) -> None:
    if text is not None:
        (processes.folder / "kept.json").write_text(text)
    done = processes.run("summary", "kept.json")
    assert (done.returncode, done.stdout, done.stderr) == (2, "", f"lalliance: {sentence}\n")


def test_a_place_where_no_summary_can_be_kept_is_refused_before_the_mission(processes: Processes) -> None:
    done = processes.run("world", "pair.yaml", "--summary", "none/kept.json")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        "lalliance: none/kept.json: a summary cannot be kept there (No such file or directory); "
        "expected a folder that can be written to\n"
    )
