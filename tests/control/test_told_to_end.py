"""Ctrl-C and SIGTERM, whenever they come: a sentence or silence, the exit status that shells know, and nothing left."""

import fcntl
import signal
import subprocess
import sys
import termios
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


TALKING = """
import asyncio, sys
from mission_control.shell import ToldToEnd, run_until_told

async def talk():
    while True:
        print("x" * 1000)
        await asyncio.sleep(0)

try:
    run_until_told(talk())
except ToldToEnd as told:
    sys.exit(128 + told.number)
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_command_ends_that_waits_for_somebody_to_read_what_it_prints(number: signal.Signals) -> None:
    talking = subprocess.Popen([sys.executable, "-c", TALKING], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    with talking:
        assert talking.stdout is not None
        descriptor = talking.stdout.fileno()
        room = fcntl.fcntl(descriptor, fcntl.F_GETPIPE_SZ)
        until(lambda: int.from_bytes(fcntl.ioctl(descriptor, termios.FIONREAD, bytes(4)), sys.byteorder) > room - 4096)
        talking.send_signal(number)
        assert talking.wait(20) == 128 + number
        assert talking.stderr is not None
        assert talking.stderr.read() == b""


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
