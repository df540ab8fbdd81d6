"""A few points of the failure detection figures, measured in real runs: `lalliance run`, processes, Zenoh, SIGKILL.

The mission is the probe of the study. An observer on the bus reads the robots' link reports, which tell how often and since
when a teammate is held to be silent, and the world's event that a robot is gone. Its one clock times both; the way of these
two messages to it is the error, some milliseconds.

    python benchmarks/real_detection.py --out docs/faults/rows [--speed 2]
"""

import argparse
import asyncio
import json
import os
import random
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from lalliance_agents.agent.catalog import fresh_incarnation
from lalliance_agents.bus.messenger import Messenger
from lalliance_agents.bus.zenoh_bus import open_bus
from lalliance_agents.clock import MissionClock
from lalliance_agents.config import Mission
from lalliance_agents.wire.keys import OPERATOR, Key, Keys, Kind
from lalliance_agents.wire.messages import Event, LinkReport, Message, Reception
from lalliance_study.detection.law import Loss
from lalliance_study.detection.probe import SPEAKER, STEADY, hearer, probe, quantiles
from lalliance_study.detection.rows import Detections, Suspicions, save
from mission_control.running import endpoints

#: Two hearers for each tau, in periods of the announcements.
TAU_RHOS = (3.0, 3.0, 5.0, 5.0)
LOSSES = (0.3, 0.6)
#: The first death, between two of them, and how long the speaker stays away; in seconds.
FIRST_DEATH, BETWEEN, AWAY = 14.0, 22.0, 4.0
#: After the death, when the reports are read: every hearer has noticed, and the speaker is not back.
READ = 1.5, 3.9


class Observer:
    """What was heard of one run, with the instants of its arrival in mission seconds."""

    def __init__(self) -> None:
        self.deaths: list[float] = []
        self.reports: dict[str, list[tuple[float, LinkReport]]] = {}
        self.now = 0.0

    async def watch(self, mission: Mission, speed: float) -> None:
        """Connect as soon as the mission's router is there, and listen until cancelled."""
        while not (found := endpoints(mission.name)):  # noqa: ASYNC110 - a file, of which nothing tells
            await asyncio.sleep(0.05)
        clock = MissionClock(speed=speed)

        def take(_: Key, message: Message) -> None:
            if isinstance(message, Event) and (message.kind, message.robot) == ("gone", SPEAKER):
                self.deaths.append(clock.now())
            elif isinstance(message, LinkReport):
                self.reports.setdefault(message.sender, []).append((clock.now(), message))

        async with await open_bus(found[0]) as bus:
            keys = Keys(mission.name)
            messenger = Messenger(bus, keys, OPERATOR, fresh_incarnation(), clock.now)
            await messenger.listen(keys.build(Kind.LINK), take)
            await messenger.listen(keys.build(Kind.EVENT), take)
            await asyncio.Event().wait()

    def of(self, name: str) -> list[tuple[float, LinkReport, Reception]]:
        """The reports of a hearer on the speaker."""
        return [(at, one, one.teammates[SPEAKER]) for at, one in self.reports[name] if SPEAKER in one.teammates]


async def run(mission: Mission, speed: float, folder: Path) -> tuple[Observer, dict[str, Any]]:
    """Run a mission in real processes; what was observed, and its summary."""
    path = folder / f"{mission.name}.yaml"
    path.write_text(yaml.safe_dump(mission.model_dump(mode="json", exclude_unset=True, by_alias=True)))
    observer = Observer()
    watching = asyncio.create_task(observer.watch(mission, speed))
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "mission_control", "run", str(path), "--speed", str(speed), "--json", "--plain",
        stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.DEVNULL,
    )  # fmt: skip
    out, _ = await process.communicate()
    watching.cancel()
    await asyncio.wait({watching})
    return observer, json.loads(out)


def suspicions(observer: Observer, loss: Loss, tau_rho: float, names: Sequence[str]) -> Suspicions:
    """How often the living speaker was taken to be silent by hearers of one tau."""
    seconds, count = 0.0, 0
    for name in names:
        seen = [(one.at, heard.lapses) for _, one, heard in observer.of(name)]
        steady = [each for each in seen if each[0] >= seen[0][0] + STEADY]
        seconds += steady[-1][0] - steady[0][0]
        count += steady[-1][1] - steady[0][1]
    return Suspicions("real", loss.share, 0.0, 0.0, tau_rho, len(names), round(seconds, 3), count)


def detections(observer: Observer, loss: Loss, tau_rho: float, names: Sequence[str]) -> Detections:
    """How soon hearers of one tau noticed each death."""
    times = []
    for death in observer.deaths:
        for name in names:
            told = [
                at - heard.lost_for - death
                for at, _, heard in observer.of(name)
                if death + READ[0] < at < death + READ[1] and heard.lost_for is not None
            ]
            times += told[-1:]
    suspected = sum(time < 0 for time in times)
    return Detections("real", loss.share, 0.0, tau_rho, len(times), suspected, **quantiles(times))


def groups() -> list[tuple[float, list[str]]]:
    """For each tau, the hearers that have it."""
    return [
        (tau_rho, [hearer(number) for number, own in enumerate(TAU_RHOS) if own == tau_rho])
        for tau_rho in sorted(set(TAU_RHOS))
    ]


async def measure(out: Path, speed: float, deaths: int, listening: float) -> None:
    """Make all runs and write their rows."""
    counted, timed, notes = [], [], []
    with tempfile.TemporaryDirectory() as folder:
        os.environ["XDG_RUNTIME_DIR"] = folder
        for number, share in enumerate(LOSSES):
            loss = Loss(share)
            quiet = probe(TAU_RHOS, loss, lasts=STEADY + listening, seed=number + 1)
            chance = random.Random(number + 1)
            instants = [round(FIRST_DEATH + BETWEEN * index + chance.random(), 3) for index in range(deaths)]
            crashes = [
                {"kind": "crash", "robot": SPEAKER, "at": at, "restart": True, "until": at + AWAY} for at in instants
            ]
            deadly = probe(TAU_RHOS, loss, lasts=instants[-1] + 2 * AWAY, seed=number + 1, faults=crashes)
            for mission in (quiet, deadly):
                observer, summary = await run(mission, speed, Path(folder))
                notes.append({"loss": share, "deaths": len(observer.deaths), "speed": speed, **summary["control"]})
                sys.stderr.write(f"{notes[-1]}\n")
                for tau_rho, names in groups():
                    if mission is quiet:
                        counted.append(suspicions(observer, loss, tau_rho, names))
                    else:
                        timed.append(detections(observer, loss, tau_rho, names))
    save(out / "suspicions-real.csv", counted, Suspicions)
    save(out / "detections-real.csv", timed, Detections)
    (out / "real.json").write_text(json.dumps(notes, indent=2) + "\n")


def main() -> None:
    """Do what the command line says."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--out", type=Path, default=Path("docs/faults/rows"), help="folder for the rows")
    arguments.add_argument("--speed", type=float, default=2.0, help="mission seconds in one second")
    arguments.add_argument("--deaths", type=int, default=12, help="deaths for each loss")
    arguments.add_argument("--listening", type=float, default=300.0, help="mission seconds in which nobody dies")
    chosen = arguments.parse_args()
    chosen.out.mkdir(parents=True, exist_ok=True)
    asyncio.run(measure(chosen.out, chosen.speed, chosen.deaths, chosen.listening))


if __name__ == "__main__":
    main()
