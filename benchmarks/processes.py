"""Real processes under measurement: started one by one, their processor time and memory read from the system, and ended.

Needs Linux: all that is measured stands in `/proc`.
"""

import asyncio
import contextlib
import json
import os
import signal
import sys
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import yaml

from lalliance_agents.bus.router import free_endpoint
from lalliance_agents.config import Mission

#: How long processes may take to start, in seconds.
START = 180.0
#: The id of this process, with which all that it starts ends.
PARENT = str(os.getpid())


def busy(pids: Iterable[int]) -> float:
    """Processor time that processes have used so far, in seconds."""
    total = 0
    for pid in pids:
        for thread in Path(f"/proc/{pid}/task").iterdir():
            with contextlib.suppress(OSError):  # one that has just ended
                total += int((thread / "schedstat").read_text().split()[0])
    return total / 1e9


def memory(pid: int) -> dict[str, float]:
    """Memory of a process in megabytes: `shared` pages counted by halves, thirds, … (PSS), and its `own` alone (USS)."""
    sizes: dict[str, int] = {}
    for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()[1:]:
        name, kilobytes, _ = line.split()
        sizes[name.rstrip(":")] = int(kilobytes)
    return {"pss": sizes["Pss"] / 1e3, "uss": (sizes["Private_Clean"] + sizes["Private_Dirty"]) / 1e3}


class Processes:
    """Child processes of one measurement, in a folder that goes with them; none is left behind."""

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="lalliance-benchmark-")
        self.folder = Path(self._folder.name)
        self._started: list[asyncio.subprocess.Process] = []

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await asyncio.gather(*map(kill, self._started))
        self._folder.cleanup()

    async def start(self, *arguments: str | Path, told: bool = False) -> asyncio.subprocess.Process:
        """Start Python with `arguments`; what it prints is thrown away unless it is to be `told`.

        It has to end with this process, whose id is `PARENT`.
        """
        silent = asyncio.subprocess.DEVNULL
        process = await asyncio.create_subprocess_exec(
            sys.executable, *map(str, arguments),
            stdin=silent, stdout=asyncio.subprocess.PIPE if told else silent, stderr=silent,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
        )  # fmt: skip
        self._started.append(process)
        return process

    async def command(self, *words: object, told: bool = False) -> asyncio.subprocess.Process:
        """Start a command of lalliance."""
        return await self.start("-m", "mission_control", *map(str, words), "--parent", PARENT, told=told)


class Team:
    """A mission in single processes of its own: a router, a world server, and robots.

    Attributes:
        endpoint: the router's.
        router, world: the processes' ids.
        running: the latest process of each robot.
    """

    def __init__(self, mission: Mission, processes: Processes, shares: Sequence[Sequence[str]]) -> None:
        self.mission = mission
        self.endpoint = free_endpoint()
        self.router = self.world = 0
        self.running: dict[str, asyncio.subprocess.Process] = {}
        self._shares = shares
        self._processes = processes
        self._path = processes.folder / "mission.yaml"
        self._summary = processes.folder / "summary.json"
        self._served: asyncio.subprocess.Process | None = None

    async def start(self) -> float:
        """Start all of it; returns when the mission begins: how long that took, in seconds."""
        document = self.mission.model_dump(mode="json", exclude_unset=True, by_alias=True)
        self._path.write_text(yaml.dump(document, Dumper=getattr(yaml, "CSafeDumper", yaml.SafeDumper)))
        began = asyncio.get_running_loop().time()
        router = await self._processes.command("router", "--listen", self.endpoint, told=True)
        await read_until(router, "listens")
        bus = "--connect", self.endpoint
        told = "--wait", START, "--summary", self._summary
        world = self._served = await self._processes.command("world", self._path, *bus, *told, told=True)
        for share in self._shares:
            await self.start_robots(share)
        self.router, self.world = router.pid, world.pid
        await read_until(world, "trial 1 begins")
        return asyncio.get_running_loop().time() - began

    async def start_robots(self, names: Sequence[str]) -> None:
        """Start robots, or start them again, in a process that is theirs."""
        words = [word for name in names for word in ("--name", name)]
        process = await self._processes.command("robot", self._path, "--connect", self.endpoint, *words)
        self.running.update(dict.fromkeys(names, process))

    @property
    def robots(self) -> list[int]:
        """The ids of the robots' processes."""
        return sorted({process.pid for process in self.running.values()})

    async def finish(self) -> dict[str, Any]:
        """Wait for the end of the world server; the mission's summary. Robots may still be there."""
        assert self._served is not None  # noqa: S101 - the team was started
        await read_until(self._served, "")
        summary: dict[str, Any] = json.loads(self._summary.read_text())
        return summary


async def read_until(process: asyncio.subprocess.Process, text: str) -> None:
    """Read what a process prints up to a line that holds `text`; if that is empty, up to its end.

    Raises:
        TimeoutError: it does not print that in time.
        RuntimeError: it ends before.
    """
    assert process.stdout is not None  # noqa: S101 - it was started to be told
    async with asyncio.timeout(START):
        while line := (await process.stdout.readline()).decode():
            if text and text in line:
                return
    if text:
        raise RuntimeError(f"a process ended before it printed {text!r}")


async def kill(process: asyncio.subprocess.Process) -> None:
    """Kill a process, unless it has ended, and wait for its end."""
    if process.returncode is None:
        # Not by its own `kill`, which would take the news of its end from asyncio if it has ended just now.
        with contextlib.suppress(ProcessLookupError):
            os.kill(process.pid, signal.SIGKILL)
    if process.stdout is not None:
        await process.stdout.read()
    await process.wait()
