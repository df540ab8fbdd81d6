"""Real `lalliance` processes for tests: each tree of them is marked, found again, and ended whatever happens."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
import uuid
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

TESTS = Path(__file__).parents[1]
MISSIONS = TESTS.parent / "missions"
_MARK = "LALLIANCE_TEST"

#: Options of a pytest as a user has it who installed nothing but lalliance and pytest; and no warning is left unseen.
PYTEST_ALONE = ("-W", "error", *("-pno:" + plugin for plugin in ("asyncio", "hypothesispytest", "timeout", "xdist")))


class Processes:
    """Starts commands, knows all processes that descend from them, and leaves none behind."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._mark = uuid.uuid4().hex
        self._temporary = tempfile.TemporaryDirectory(prefix="lalliance-test-", ignore_cleanup_errors=True)
        #: Where the commands have their temporary files: what one that is killed leaves there goes with the test.
        self.temporary = Path(self._temporary.name)
        self._started: list[subprocess.Popen[str]] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for pid in self.alive():
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        for process in self._started:
            process.kill()
            process.communicate()
        self._temporary.cleanup()

    def start(self, *arguments: str | Path, within: Sequence[str] = ()) -> "subprocess.Popen[str]":
        """Start `lalliance` with `arguments`, by the command `within` if there is one; its output is piped."""
        return self.start_module("mission_control", *arguments, within=within)

    def start_module(self, module: str, *arguments: str | Path, within: Sequence[str] = ()) -> "subprocess.Popen[str]":
        """Start a module of Python with `arguments`, by the command `within` if there is one; its output is piped."""
        process = subprocess.Popen(
            [*within, sys.executable, "-m", module, *map(str, arguments)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=self.folder,
            # Missions of other tests, which may have the same name, are not to be found.
            env={
                **os.environ,
                _MARK: self._mark,
                "PYTHONPATH": os.pathsep.join([str(TESTS), os.environ.get("PYTHONPATH", "")]),
                "COLUMNS": "120",
                "XDG_RUNTIME_DIR": str(self.folder),
                "TMPDIR": str(self.temporary),
            },
        )
        self._started.append(process)
        return process

    def run(self, *arguments: str | Path, timeout: float = 100.0) -> "subprocess.CompletedProcess[str]":
        """Run `lalliance` with `arguments` to its end."""
        process = self.start(*arguments)
        out, err = process.communicate(timeout=timeout)
        return subprocess.CompletedProcess(process.args, process.returncode, out, err)

    def run_json(self, *arguments: str | Path, timeout: float = 100.0) -> dict[str, Any]:
        """Run a command with `--json` that must succeed; its document."""
        done = self.run(*arguments, "--json", timeout=timeout)
        assert done.returncode == 0, done.stderr
        document: dict[str, Any] = json.loads(done.stdout)
        return document

    def chaos(self, mission: str | Path, *words: str | Path) -> str:
        """Run a chaos command that must be carried out; what it printed."""
        done = self.run("chaos", mission, *words)
        assert done.returncode == 0, done.stderr
        return done.stdout.rstrip()

    def alive(self, command: str = "") -> list[int]:
        """The living processes of this tree, or those of them that run `command`, such as `router`, `robot` or `world`."""
        mark = f"{_MARK}={self._mark}".encode()
        return [pid for pid, words in _commands(mark) if not command or command in words[:4]]

    def robot(self, name: str) -> int:
        """The process of robot `name`."""
        mark = f"{_MARK}={self._mark}".encode()
        return next(
            pid for pid, words in _commands(mark) if "robot" in words and words[words.index("--name") + 1] == name
        )


def is_stopped(pid: int) -> bool:
    """Whether the process is stopped, as by SIGSTOP."""
    return (Path("/proc") / str(pid) / "stat").read_text().rpartition(")")[2].split()[0] == "T"


def words_of(pid: int) -> list[str]:
    """The command line of a process."""
    return (Path("/proc") / str(pid) / "cmdline").read_text().rstrip("\0").split("\0")


def _commands(mark: bytes) -> Iterator[tuple[int, list[str]]]:
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            with contextlib.suppress(OSError):
                # A zombie has neither, so only what lives is found.
                words = (folder / "cmdline").read_bytes().decode(errors="replace").split("\0")
                if mark in (folder / "environ").read_bytes().split(b"\0"):
                    yield int(folder.name), words


def until(condition: Callable[[], object], *, seconds: float = 30.0) -> None:
    """Look until `condition` holds."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, f"not within {seconds:g} s"
        time.sleep(0.01)


def read_until(process: "subprocess.Popen[str]", text: str) -> list[str]:
    """Read the process's standard output up to the line that holds `text`; the lines read."""
    assert process.stdout is not None
    lines = []
    for line in process.stdout:
        lines.append(line)
        if text in line:
            return lines
    raise AssertionError(f"{text!r} never came in: {''.join(lines)}")
