"""Child processes that never outlive their parent.

Each child is a `lalliance` command of its own in a session of its own, so that Ctrl-C reaches only the parent, which then
ends its children in order. A child is told its parent's process id and has the kernel kill it when that process is gone,
whatever the parent died of.
"""

import asyncio
import contextlib
import itertools
import os
import signal
import sys
from collections.abc import Callable, Sequence

#: How long a child may take to end by itself when asked to, in seconds.
GRACE = 1.0

#: Longest line read from a child, in bytes.
LONGEST_LINE = 2**22

#: Lines read from a child in one turn of the event loop: a chatty child must not starve the rest.
LINES_PER_TURN = 20

OnLine = Callable[[str, str], None]


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


class Child:
    """One running child process.

    Args:
        name: what it is called in messages.
        process: the process.
        on_line: called with the name and each line that the child writes.
        keeps_output: whether its standard output is for `read_line` and `read_all` instead.
    """

    def __init__(self, name: str, process: asyncio.subprocess.Process, on_line: OnLine, *, keeps_output: bool) -> None:
        self.name = name
        self._process = process
        self._on_line = on_line
        streams = [process.stderr] if keeps_output else [process.stderr, process.stdout]
        self._readers = [asyncio.create_task(self._read(stream)) for stream in streams if stream is not None]
        self.last_line = ""
        #: Whether it was stopped by `stop` and not continued since.
        self.stopped = False

    @classmethod
    async def start(
        cls, name: str, arguments: Sequence[str], on_line: OnLine, *, keeps_output: bool = False
    ) -> "Child":
        """Start `lalliance` with `arguments`; the parent's id is handed down."""
        process = await asyncio.create_subprocess_exec(
            sys.executable,
            "-m",
            "mission_control",
            *arguments,
            "--parent",
            str(os.getpid()),
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
            start_new_session=True,
            limit=LONGEST_LINE,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
        )
        return cls(name, process, on_line, keeps_output=keeps_output)

    def __repr__(self) -> str:
        return f"<Child {self.name}: process {self._process.pid}, {self.status}>"

    @property
    def pid(self) -> int:
        """The process's id."""
        return self._process.pid

    @property
    def status(self) -> str:
        """Whether it runs, or how it ended."""
        code = self._process.returncode
        if code is None:
            return "stopped" if self.stopped else "running"
        return f"killed by {_signal_name(-code)}" if code < 0 else f"exit status {code}"

    @property
    def running(self) -> bool:
        """Whether it has not ended yet."""
        return self._process.returncode is None

    @property
    def exit_code(self) -> int | None:
        """Its exit status; negative: the signal that killed it; None while it runs."""
        return self._process.returncode

    async def read_line(self) -> str:
        """The next line of its standard output; empty when that has ended."""
        stream = self._process.stdout
        return "" if stream is None else (await stream.readline()).decode(errors="replace").rstrip()

    async def read_all(self) -> str:
        """All that it still writes to its standard output."""
        stream = self._process.stdout
        return "" if stream is None else (await stream.read()).decode(errors="replace")

    async def wait(self) -> int:
        """Wait for its end; its exit status."""
        code = await self._process.wait()
        self._end_group()
        await asyncio.wait(self._readers)
        return code

    def send_signal(self, number: signal.Signals) -> None:
        """Send a signal, unless it has ended."""
        if self.running:
            # Not by the process's own `send_signal`, which would take the news of its end from asyncio if it has just ended.
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, number)

    def stop(self) -> None:
        """Have it make no further step until it is continued."""
        self.send_signal(signal.SIGSTOP)
        self.stopped = self.running

    def resume(self) -> None:
        """Let it go on where it was stopped."""
        self.send_signal(signal.SIGCONT)
        self.stopped = False

    async def end(self, *, grace: float = GRACE) -> None:
        """Ask it to end, and kill it if it does not within the grace; what it has started itself ends with it."""
        # Who is stopped hears no request; whom somebody else has stopped hears it on being continued.
        self.send_signal(signal.SIGKILL if self.stopped else signal.SIGTERM)
        self.send_signal(signal.SIGCONT)
        try:
            async with asyncio.timeout(grace):
                await self._process.wait()
        except TimeoutError:
            self.send_signal(signal.SIGKILL)
            await self._process.wait()
        self._end_group()
        await asyncio.wait(self._readers, timeout=grace)

    def _end_group(self) -> None:
        """Kill what the child, which has ended, has left in its session."""
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self.pid, signal.SIGKILL)

    async def _read(self, stream: asyncio.StreamReader) -> None:
        for count in itertools.count(1):
            if count % LINES_PER_TURN == 0:
                await asyncio.sleep(0)
            try:
                line = await stream.readline()
            except ValueError:  # longer than the limit; what is left of it is read next
                continue
            if not line:
                return
            self.last_line = line.decode(errors="replace").rstrip()
            self._on_line(self.name, self.last_line)
