"""How long the processes around the robots are missed when they are killed: `lalliance run`, real processes, SIGKILL.

Two robots are at work, and an observer on the bus hears them and the world. Killed are, each time in a mission of its own: the
router (until the observer hears a robot again), the world server (until it hears the world again), all robots (until the run
has ended with its sentence) and the launcher (until none of its processes is left). Times are real seconds.

    python benchmarks/outages.py [--times 20] [--json FILE]
"""

import asyncio
import os
import signal
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Coroutine
from pathlib import Path

import form

from lalliance_agents.agent.catalog import fresh_incarnation
from lalliance_agents.bus.messenger import Messenger
from lalliance_agents.bus.zenoh_bus import open_bus
from lalliance_agents.wire.keys import OPERATOR, Key, Keys, Kind
from lalliance_agents.wire.messages import Message
from mission_control.running import endpoints

MISSION = """
name: outages
tasks: {a: {}, b: {}}
robots:
  left: {tasks: {a: 300, b: 400}}
  right: {tasks: {a: 400, b: 300}}
knowledge: given
parameters: {min_delay: 0.1, max_delay: 0.4}
"""
LIMIT = 30.0
#: What was said before a death has come after so long, in seconds.
UNDER_WAY = 0.05
COLUMNS = {
    "killed": lambda row: row["killed"],
    "times": lambda row: str(len(row["seconds"])),
    "median": lambda row: f"{statistics.median(row['seconds']):.2f}",
    "shortest": lambda row: f"{row['seconds'][0]:.2f}",
    "longest": lambda row: f"{row['seconds'][-1]:.2f}",
}


class Team:
    """One run, and what an observer on its bus hears."""

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        self.process = process
        self.heard: dict[str, float] = {}

    async def watch(self) -> None:
        """Listen until cancelled."""
        await until(lambda: endpoints("outages"))
        async with await open_bus(endpoints("outages")[0]) as bus:
            keys = Keys("outages")
            observer = Messenger(bus, keys, OPERATOR, fresh_incarnation(), time.monotonic)

            def take(key: Key, _: Message) -> None:
                self.heard[key.kind.name] = time.monotonic()

            for kind in (Kind.ACTIVITY, Kind.STATUS):
                await observer.listen(keys.build(kind), take)
            await asyncio.Event().wait()

    def processes(self, command: str = "") -> list[int]:
        """The living processes that the launcher started, or those that run `command`."""
        found = []
        for folder in Path("/proc").iterdir():
            try:
                words = (folder / "cmdline").read_bytes().split(b"\0")
                environment = (folder / "environ").read_bytes()
            except OSError:
                continue
            ours = (
                folder.name != str(self.process.pid)
                and b"XDG_RUNTIME_DIR=" + os.environb[b"XDG_RUNTIME_DIR"] in environment
            )
            if ours and folder.name != str(os.getpid()) and (not command or command.encode() in words[:4]):
                found.append(int(folder.name))
        return found

    def kill(self, command: str) -> float:
        """Kill what runs `command`; when that was."""
        for process in self.processes(command):
            os.kill(process, signal.SIGKILL)
        return time.monotonic()

    async def heard_after(self, kind: Kind, since: float) -> float:
        """How long it takes until something of `kind` is heard again."""
        await until(lambda: self.heard.get(kind.name, 0.0) > since)
        return self.heard[kind.name] - since


async def until(condition: Callable[[], object]) -> None:
    """Wait until `condition` holds."""
    async with asyncio.timeout(LIMIT):
        while not condition():  # noqa: ASYNC110 - files and processes, of which nothing tells
            await asyncio.sleep(0.002)


async def _heard_anew(team: Team, kind: Kind, killed: float) -> float:
    """From the instant of a death until something of `kind` is heard that was not under way then."""
    await asyncio.sleep(UNDER_WAY)
    return await team.heard_after(kind, killed + UNDER_WAY) + UNDER_WAY


async def router(team: Team) -> float:
    """From the router's death until a robot is heard again."""
    killed = team.kill("router")
    return await _heard_anew(team, Kind.ACTIVITY, killed)


async def world(team: Team) -> float:
    """From the world server's death until it is heard again."""
    killed = team.kill("world")
    return await _heard_anew(team, Kind.STATUS, killed)


async def robots(team: Team) -> float:
    """From the death of all robots until the run has ended."""
    killed = team.kill("robot")
    async with asyncio.timeout(LIMIT):
        await team.process.wait()
    return time.monotonic() - killed


async def launcher(team: Team) -> float:
    """From the launcher's death until none of its processes is left."""
    killed = time.monotonic()
    team.process.kill()
    await until(lambda: not team.processes())
    return time.monotonic() - killed


async def measured(measure: Callable[[Team], Coroutine[None, None, float]], path: Path) -> float:
    """One outage, in a mission of its own."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "mission_control", "run", str(path), "--plain", "--json",
        stdout=asyncio.subprocess.DEVNULL, stderr=asyncio.subprocess.DEVNULL,
    )  # fmt: skip
    team = Team(process)
    watching = asyncio.create_task(team.watch())
    try:
        await until(lambda: {"ACTIVITY", "STATUS"} <= team.heard.keys())
        await asyncio.sleep(1.0)  # both are at work, and nothing of the start is under way
        return await measure(team)
    finally:
        watching.cancel()
        await asyncio.wait({watching})
        if process.returncode is None:
            process.terminate()
            await process.wait()


async def measure_all(times: int) -> list[form.Row]:
    """What each outage took, the shortest first."""
    rows: list[form.Row] = []
    with tempfile.TemporaryDirectory() as folder:
        os.environ["XDG_RUNTIME_DIR"] = folder
        path = Path(folder) / "outages.yaml"
        path.write_text(MISSION)
        for measure in (router, world, robots, launcher):
            found = sorted([await measured(measure, path) for _ in range(times)])
            rows.append({"killed": measure.__name__, "seconds": [round(one, 3) for one in found]})
    return rows


def main() -> None:
    """Do what the command line says."""
    arguments = form.options(__doc__)
    arguments.add_argument("--times", type=int, default=20, help="how often each is killed")
    chosen = arguments.parse_args()
    rows = asyncio.run(measure_all(2 if chosen.quick else chosen.times))
    form.publish("Outages after SIGKILL, in real seconds", COLUMNS, rows, path=chosen.json, packages=["eclipse-zenoh"])


if __name__ == "__main__":
    main()
