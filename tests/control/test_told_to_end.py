"""Ctrl-C and SIGTERM, whenever they come: a sentence or silence, the exit status that shells know, and nothing left."""

import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.processes import MISSIONS, Processes, until

pytestmark = pytest.mark.alone

INTERRUPTING = """
import signal, sys

class Interrupting:
    def find_spec(self, name, path=None, target=None):
        if name == {name!r}:
            signal.raise_signal({number})

sys.meta_path.insert(0, Interrupting())
from mission_control.__main__ import main
sys.argv = ["lalliance", "simulate", {mission!r}]
main()
"""


@pytest.fixture
def processes(tmp_path: Path) -> Iterator[Processes]:
    with Processes(tmp_path) as tree:
        yield tree


@pytest.mark.parametrize("name", ["mission_control.cli", "typer", "rich.console", "numpy", "lalliance_study.simulator"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_a_command_is_being_imported_leaves_no_traceback(name: str, number: signal.Signals) -> None:
    code = INTERRUPTING.format(name=name, number=int(number), mission=str(MISSIONS / "box_pushing.yaml"))
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    said = "lalliance: interrupted\n" if number is signal.SIGINT else ""
    assert (done.stdout, done.stderr) == ("", said)
    # Before there is a handler for it, SIGTERM does what it always does; a shell tells both alike.
    assert done.returncode in {128 + number, -number if number is signal.SIGTERM else 128 + number}


@pytest.mark.parametrize(
    "words", [["campaign", "--missions", "1000000"], ["simulate", MISSIONS / "box_pushing.yaml", "--runs", "100000"]]
)
@pytest.mark.parametrize("grown", [1, 2, 3, 4])
def test_work_on_all_cores_ends_quietly_when_it_is_told_to(
    processes: Processes, words: list[str | Path], grown: int
) -> None:
    """However many of its processes are there: itself, one that watches what they share, and two that work."""
    running = processes.start(*words, "--jobs", "2")
    until(lambda: len(processes.alive()) >= grown)
    running.send_signal(signal.SIGTERM)
    out, err = running.communicate(timeout=20)
    assert (out, err) == ("", "")
    assert running.returncode in {128 + signal.SIGTERM, -signal.SIGTERM}
    until(lambda: not processes.alive())
