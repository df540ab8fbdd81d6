"""Commands of chaos that cannot be carried out: one sentence, exit status 2; and a team without a launcher."""

import json
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.processes import Processes, read_until, until

from lalliance_agents.bus.router import free_endpoint

pytestmark = pytest.mark.alone

PAIR = """
name: pair
tasks: {a: {}}
robots:
  left: {tasks: {a: 60}}
  right: {tasks: {a: 60}}
knowledge: given
"""


@pytest.fixture
def processes(tmp_path: Path) -> Iterator[Processes]:
    (tmp_path / "pair.yaml").write_text(PAIR)
    with Processes(tmp_path) as tree:
        yield tree


HANG = ["inject", "kind=hang", "robot=left"]
BAD = {
    "no mission file": (["no.yaml", "status"], "no.yaml: no such file; expected a mission file"),
    "an unknown kind": (
        ["pair.yaml", "inject", "kind=hnag", "robot=left"],
        "kind: 'hnag' is not allowed; expected one of crash, hang, stuck, slow, mute, deaf, blind; did you mean 'hang'?",
    ),
    "an unknown robot": (
        ["pair.yaml", "inject", "kind=hang", "robot=lfet"],
        "robot: 'lfet' is not a robot of this mission; did you mean 'left'?",
    ),
    "a negative time": (["pair.yaml", *HANG, "for=-3"], "for: -3 is not allowed; expected a number greater than 0"),
    "too much loss": (
        ["pair.yaml", "inject", "to=left", "loss=1.5"],
        "loss: 1.5 is not allowed; expected a number of at most 1",
    ),
    "an endpoint that is none": (
        ["pair.yaml", *HANG, "--connect", "nonsense"],
        "mission pair cannot be reached: 'nonsense' is not an endpoint of the bus; expected <protocol>/<host>:<port>",
    ),
    "nobody at the endpoint": (
        ["pair.yaml", "heal", "--connect", "tcp/127.0.0.1:9"],
        "mission pair cannot be reached: no router could be reached at tcp/127.0.0.1:9 within 3 s",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_command_is_refused_with_a_sentence(processes: Processes, case: str) -> None:
    words, sentence = BAD[case]
    began = time.monotonic()
    done = processes.run("chaos", *words)
    assert time.monotonic() - began < 10
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"lalliance: {sentence}")
    assert done.stderr.count("\n") == 1


def test_where_a_router_but_no_such_mission_runs_nobody_answers(processes: Processes) -> None:
    endpoint = free_endpoint()
    read_until(processes.start("router", "--listen", endpoint), "listens")
    done = processes.run("chaos", "pair.yaml", "status", "--connect", endpoint)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        f"lalliance: no world server of mission pair answers at {endpoint}; "
        "expected the mission to run there just now\n"
    )


def test_without_a_launcher_bodies_can_fail_and_processes_cannot(processes: Processes) -> None:
    endpoint = free_endpoint()
    read_until(processes.start("router", "--listen", endpoint), "listens")
    world = processes.start("world", "pair.yaml", "--connect", endpoint)
    for name in ("left", "right"):
        processes.start("robot", "pair.yaml", "--connect", endpoint, "--name", name)
    read_until(world, "trial 1 begins")
    for kind in ("crash", "hang"):
        done = processes.run("chaos", "pair.yaml", "inject", f"kind={kind}", "robot=left", "--connect", endpoint)
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr == (
            f"lalliance: {kind} of left: nobody here can reach the robots' processes; expected a mission started by "
            "`lalliance run` with one process per robot, or a fault of another kind\n"
        )
    for robot in ("left", "right"):
        said = processes.chaos("pair.yaml", "inject", "kind=stuck", f"robot={robot}", "--connect", endpoint)
        assert f"stuck of {robot}, until it is healed" in said

    def fired() -> list[str]:
        answer = json.loads(processes.chaos("pair.yaml", "status", "--json", "--connect", endpoint))
        return [fault["text"] for fault in answer["faults"] if fault["fired"]]

    until(fired)
    # Whichever robot took the only task is the one that was held up.
    assert len(fired()) == 1
    assert processes.chaos("pair.yaml", "heal", "--connect", endpoint) == "healed 1-stuck, 2-stuck"
