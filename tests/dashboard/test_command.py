"""`lalliance dashboard` and `run --dashboard`: as the document shows them, and what they say to bad input."""

import re
import signal
import socket
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import pytest
from support.documents import carried_out_by
from support.processes import MISSIONS, Processes, read_until

from lalliance_agents.errors import UserError
from mission_control.dashboard.command import dashboard

MISSION = MISSIONS / "material_handling.yaml"


@pytest.fixture
def processes(tmp_path: Path) -> Iterator[Processes]:
    with Processes(tmp_path) as tree:
        yield tree


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ({}, "no mission is named"),
        ({"path": MISSION, "connect": "tcp/127.0.0.1:1"}, "material_handling cannot be reached"),
        ({"bag": Path("no.mcap")}, "no.mcap"),
        ({"bag": MISSION}, "material_handling.yaml"),
        ({"bag": Path("no.mcap"), "connect": "tcp/127.0.0.1:1"}, "one of the two"),
        ({"path": MISSION, "token_file": MISSION}, "this is no token"),
        ({"path": MISSION, "host": "192.0.2.1"}, "cannot listen on 192.0.2.1"),
    ],
)
def test_bad_input_is_answered_with_a_sentence(words: dict[str, Any], said: str) -> None:
    with pytest.raises(UserError, match=said):
        dashboard(**({"port": 0, "speed": 1.0} | words))


def test_a_mission_does_not_begin_whose_page_has_no_port(processes: Processes) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        done = processes.run("run", MISSION, "--dashboard", "--port", str(taken.getsockname()[1]), "--plain")
    assert done.returncode == 2
    assert "cannot listen on 127.0.0.1" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert "starts" not in done.stdout
    assert processes.alive() == []


def test_the_page_is_shown_as_the_document_says(processes: Processes) -> None:
    """Beside the mission that shows itself, one that runs already is shown, and its recording; each on a free port."""
    (processes.folder / "missions").symlink_to(MISSIONS)
    [block] = carried_out_by("dashboard/test_command.py::test_the_page_is_shown_as_the_document_says")
    run, running, recorded = block.commands
    mission = processes.start(*run, "--port", "0", "--plain", "--record", "demo.mcap")
    own = address(mission)
    read_until(mission, "pusher starts")
    viewers = [processes.start(*command, "--port", "0") for command in (running, recorded)]
    for page in (own, *map(address, viewers)):
        with urlopen(f"{page}/health", timeout=30) as answer:
            assert answer.status == 200
        with urlopen(f"{page}/metrics", timeout=30) as answer:
            assert b"lalliance_mission" in answer.read()
    for one in (*viewers, mission):
        one.send_signal(signal.SIGINT)
        assert one.wait(timeout=30) == 130


def address(process: "subprocess.Popen[str]") -> str:
    """Where a page is, as its process says; without the token."""
    said = read_until(process, "http://")[-1]
    found = re.search(r"http://[\d.]+:\d+", said)
    assert found is not None, said
    return found[0]
