"""How long it takes until something happens: commands, imports, a robot's first heartbeat, a mission's first activation.

Each is measured from the start of a process, beside two floors: Python that does nothing, and Python that opens a session at
the same router with Zenoh alone. All take turns, so that whatever else the machine does strikes all alike; medians are over the
turns, and what a figure is above its floor is made within a turn.

A robot is one of a mission that has no world server yet: it is there from its first heartbeat on. A mission is there with the
first activation; before that its robots wait until all of them are, and then at least `min_delay`, a tenth of a second here.

    python benchmarks/start_up.py [--quick] [--json FILE] [--turns N]
"""

import asyncio
import json
import signal
import subprocess
import sys
import tempfile
import time
from asyncio.subprocess import DEVNULL, PIPE
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

import form

from lalliance_agents.bus.router import free_endpoint, open_router
from lalliance_agents.bus.session import client_settings
from lalliance_agents.bus.zenoh_bus import ZenohBus, open_bus
from lalliance_agents.wire.keys import Keys, Kind

LALLIANCE = [sys.executable, "-m", "mission_control"]
MISSION = """
name: start-up
tasks: {sweep: {}, mop: {}, dust: {}, wipe: {}}
robots:
  broom: {tasks: {sweep: 30, mop: 40}}
  bucket: {tasks: {mop: 30, dust: 40}}
  duster: {tasks: {dust: 30, wipe: 40}}
  cloth: {tasks: {wipe: 30, sweep: 40}}
knowledge: given
parameters: {min_delay: 0.1, max_delay: 0.3}
deadline: 120
"""
KEYS, ROBOT = Keys("start-up"), "broom"
#: Seconds that `lalliance --help` may take.
HELP_GOAL = 0.3
#: Seconds after which something has gone wrong.
PATIENCE = 60.0

NOTHING, SESSION = "Python that does nothing", "Python, and a session opened with Zenoh alone"
HELP = "`lalliance --help`"
#: What ends by itself: what it is called -> its arguments after `python`, and the floor beside it
RUNS: dict[str, tuple[list[str], str]] = {
    NOTHING: (["-c", "pass"], NOTHING),
    "`import zenoh`": (["-c", "import zenoh"], NOTHING),
    SESSION: (["-c", "import zenoh; zenoh.open(zenoh.Config.from_json5({settings!r})).close()"], NOTHING),
    "`import lalliance_agents`": (["-c", "import lalliance_agents"], NOTHING),
    "`from lalliance_agents import Robot`": (["-c", "from lalliance_agents import Robot"], NOTHING),
    HELP: (["-m", "mission_control", "--help"], NOTHING),
    "`lalliance check` of a mission": (["-m", "mission_control", "check", "{mission}"], NOTHING),
}
HEARTBEAT = "`lalliance robot` to its first heartbeat"
ACTIVATION = "`lalliance run` of four robots to the first activation"


def timed(command: Sequence[str]) -> float:
    """How long a process takes from start to end, in seconds."""
    began = time.monotonic()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, timeout=PATIENCE)  # noqa: S603 - ours
    return time.monotonic() - began


async def heartbeat(bus: ZenohBus, mission: Path) -> float:
    """How long a robot takes until it is heard, in seconds."""
    heard: asyncio.Future[float] = asyncio.get_running_loop().create_future()

    def hear(_: object) -> None:
        if not heard.done():
            heard.set_result(time.monotonic())

    listening = await bus.subscribe(KEYS.build(Kind.HEARTBEAT, robot=ROBOT), hear)
    command = [*LALLIANCE, "robot", str(mission), "--connect", bus.endpoint, "--name", ROBOT]
    began = time.monotonic()
    process = await asyncio.create_subprocess_exec(*command, stdout=DEVNULL, stderr=DEVNULL)
    try:
        async with asyncio.timeout(PATIENCE):
            return await heard - began
    finally:
        await listening.close()
        process.kill()
        await process.wait()


async def activation(mission: Path) -> float:
    """How long a mission takes until a robot starts a task, as the command tells it, in seconds."""
    began = time.monotonic()
    process = await asyncio.create_subprocess_exec(
        *LALLIANCE, "run", str(mission), "--plain", stdout=PIPE, stderr=DEVNULL
    )
    try:
        async with asyncio.timeout(PATIENCE):
            async for line in process.stdout or asyncio.StreamReader():
                if b" starts " in line:
                    return time.monotonic() - began
        raise SystemExit("the mission ended without an activation")
    finally:
        process.send_signal(signal.SIGINT)
        await process.wait()


async def turn(mission: Path) -> dict[str, float]:
    """Each once, in seconds."""
    endpoint = free_endpoint()
    settings = json.dumps(client_settings(endpoint, 5.0))
    async with await open_router(endpoint), await open_bus(endpoint) as bus:
        found = {}
        for what, (arguments, _) in RUNS.items():
            given = [
                one.replace("{settings!r}", repr(settings)).replace("{mission}", str(mission)) for one in arguments
            ]
            found[what] = await asyncio.to_thread(timed, [sys.executable, *given])
        found[HEARTBEAT] = await heartbeat(bus, mission)
        found[ACTIVATION] = await activation(mission)
    return found


async def turns(count: int) -> list[dict[str, float]]:
    """Several turns; one before them does not count, as it reads files that later ones find in memory."""
    with tempfile.TemporaryDirectory() as folder:
        mission = Path(folder) / "mission.yaml"
        mission.write_text(MISSION)
        if count > 1:
            await turn(mission)
        return [await turn(mission) for _ in range(count)]


def rows(found: Sequence[Mapping[str, float]]) -> Iterator[dict[str, Any]]:
    """A row for each of what was measured."""
    floors = {what: floor for what, (_, floor) in RUNS.items()}
    for what in found[0]:
        floor = floors.get(what, SESSION)
        yield {
            "what": what,
            "seconds": median(one[what] for one in found),
            "least": min(one[what] for one in found),
            "most": max(one[what] for one in found),
            "floor": floor,
            "above": median(one[what] - one[floor] for one in found),
            "ratio": median(one[what] / one[floor] for one in found),
        }


COLUMNS: form.Columns = {
    "from start to end of": lambda one: one["what"],
    "median": lambda one: f"{one['seconds']:.3f} s",
    "least": lambda one: f"{one['least']:.3f} s",
    "most": lambda one: f"{one['most']:.3f} s",
    "above the floor": lambda one: f"{one['above']:+.3f} s",
    "of the floor": lambda one: f"{one['ratio']:.1f} x",
    "floor": lambda one: "the same" if one["floor"] == one["what"] else one["floor"],
}


def main() -> None:
    """Measure everything."""
    arguments = form.options(__doc__)
    arguments.add_argument("--turns", type=int, default=10)
    chosen = arguments.parse_args()
    made = list(rows(asyncio.run(turns(1 if chosen.quick else chosen.turns))))
    seconds = next(one["seconds"] for one in made if one["what"] == HELP)
    verdict = "met" if seconds < HELP_GOAL else "missed"
    note = f"{HELP} takes {seconds:.2f} s; the goal of less than {HELP_GOAL:g} s is {verdict}."
    form.publish(
        "From the start of a process", COLUMNS, made, path=chosen.json, notes=[note], packages=["eclipse-zenoh"]
    )


if __name__ == "__main__":
    main()
