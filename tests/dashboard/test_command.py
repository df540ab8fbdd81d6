"""What `lalliance dashboard` says to bad input, and what becomes of a mission without its page."""

import os
import signal
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
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


def test_a_mission_goes_on_without_its_page_and_says_so(processes: Processes) -> None:
    run = processes.start("run", MISSION, "--dashboard", "--port", "0", "--plain", "--speed", "4")
    read_until(run, "the page of mission material_handling")
    [page] = processes.alive("dashboard")
    os.kill(page, signal.SIGKILL)
    read_until(run, "the page ended (killed by SIGKILL); `lalliance dashboard` shows the mission again")
    out, _ = run.communicate(timeout=60)
    assert run.returncode == 0
    assert "Mission material_handling complete" in out
