"""How many robots two cores carry: processor time, memory, missed control periods and messages delivered, by size of team.

Each robot can do two tasks, each task can be done by three robots, and all of them last longer than the measurement. Every
robot announces itself 5 times a second and makes 10 control steps a second. Teams of one process per robot stand beside teams
that share two processes, and beside bare processes: as much Python, asyncio and Zenoh as it takes to send and receive as many
messages of that size without any robot.

    python benchmarks/team_size.py [--quick] [--json FILE]
"""

import argparse
import asyncio
import os
import random
from collections import defaultdict
from collections.abc import Iterable, Sequence
from pathlib import Path
from statistics import mean
from typing import Any, NamedTuple

from form import options, publish
from processes import PARENT, Processes, Team, busy, memory, read_until

from lalliance_agents.agent.catalog import fresh_incarnation
from lalliance_agents.bus.messenger import Messenger
from lalliance_agents.bus.router import free_endpoint
from lalliance_agents.bus.zenoh_bus import open_bus
from lalliance_agents.config import Mission
from lalliance_agents.wire.keys import OPERATOR, Key, Keys, Kind
from lalliance_agents.wire.messages import LinkReport, Message
from mission_control.hosting import shares

RATE = 5.0
COVERAGE, TASKS_OF_ONE = 3, 2
BARE = Path(__file__).with_name("bare.py")
#: Teams that miss more of their control periods are too large for the machine.
MOST_MISSED = 0.01
#: What the notes hold the figures against.
MOST_CPU, MOST_MEMORY, GOAL_TEAM, GOAL_PROCESSES = 0.01, 60.0, 30, 100


def team_mission(robots: int, lasts: float, seed: int = 1) -> Mission:
    """A mission in which every robot has `TASKS_OF_ONE` tasks, and all are busy or idle to the end."""
    names = [f"robot-{number:04}" for number in range(robots)]
    able = deal(names * TASKS_OF_ONE, random.Random(seed))
    tasks = [f"task-{number:04}" for number in range(len(able))]
    own: dict[str, dict[str, float]] = {name: {} for name in names}
    for task, group in zip(tasks, able, strict=True):
        for name in group:
            own[name][task] = 1e6
    return Mission.model_validate(
        {
            "name": f"team-{robots}",
            "tasks": {task: {} for task in tasks},
            "robots": {name: {"tasks": times} for name, times in own.items()},
            "knowledge": "given",
            "parameters": {"min_delay": 0.1, "max_delay": 0.5, "broadcast_rate": RATE},
            "deadline": lasts,
            "seed": seed,
        }
    )


def deal(places: list[str], chance: random.Random) -> list[list[str]]:
    """Share out places among tasks, `COVERAGE` to each as far as they go, none twice to one task."""
    while True:
        chance.shuffle(places)
        groups = [places[begin : begin + COVERAGE] for begin in range(0, len(places), COVERAGE)]
        if all(len(set(group)) == len(group) for group in groups):
            return groups


async def delivered(team: Team, seconds: float) -> float:
    """The share of the announcements due in some seconds that their hearers received."""
    reports: dict[str, list[LinkReport]] = defaultdict(list)

    def take(_: Key, message: Message) -> None:
        if isinstance(message, LinkReport):
            reports[message.sender].append(message)

    async with await open_bus(team.endpoint) as bus:
        keys = Keys(team.mission.name)
        ear = Messenger(bus, keys, OPERATOR, fresh_incarnation(), asyncio.get_running_loop().time)
        await ear.listen(keys.build(Kind.LINK), take)
        await asyncio.sleep(seconds)
    due = came = 0.0
    for robot, told in reports.items():
        for mate in team.mission.teammates(robot):
            due += (told[-1].at - told[0].at) * RATE
            came += _received(told[-1], mate) - _received(told[0], mate)
    return came / due if due else float("nan")


def _received(report: LinkReport, mate: str) -> int:
    heard = report.teammates.get(mate)
    return 0 if heard is None else heard.received


class Spans(NamedTuple):
    """How long the parts of a measurement take, in seconds."""

    settle: float
    """From the mission's beginning until it is measured."""
    window: float
    """While processor time is counted."""
    reading: float
    """For reading memory."""
    reports: float
    """While reports of what was delivered are heard; each robot sends one a second."""


FULL, QUICK = Spans(4.0, 8.0, 2.0, 4.0), Spans(0.5, 0.5, 0.5, 2.3)


async def measure(robots: int, processes: int | None, spans: Spans) -> dict[str, Any]:
    """Run a team for a while; what it took.

    Args:
        robots: how many.
        processes: how many processes they share; None: each has its own.
        spans: how long.
    """
    mission = team_mission(robots, sum(spans))
    async with Processes() as place:
        team = Team(mission, place, shares(list(mission.robots), processes))
        started = await team.start()
        await asyncio.sleep(spans.settle)
        router, world, agents = await used([team.router], [team.world], team.robots, seconds=spans.window)
        sizes = [memory(pid) for pid in team.robots]
        heard = await delivered(team, spans.reports)
        summary = await team.finish()
    return {
        "kind": "robots", "robots": robots, "processes": len(team.robots), "start": started,
        "cpu": agents / robots, "router": router, "world": world,
        "pss": sum(size["pss"] for size in sizes) / robots, "uss": sum(size["uss"] for size in sizes) / robots,
        **summary["control"], "delivered": heard,
    }  # fmt: skip


async def used(*groups: Sequence[int], seconds: float) -> list[float]:
    """The share of a core that each group of processes uses in some seconds."""
    loop = asyncio.get_running_loop()
    began, before = loop.time(), [busy(group) for group in groups]
    await asyncio.sleep(seconds)
    lasted, after = loop.time() - began, [busy(group) for group in groups]
    return [(late - early) / lasted for early, late in zip(before, after, strict=True)]


async def measure_bare(count: int, spans: Spans, *, idle: bool) -> dict[str, Any]:
    """The same of processes without robots; idle ones neither send nor hear."""
    mission = team_mission(count, 1.0)
    endpoint = free_endpoint()
    async with Processes() as place:
        router = await place.command("router", "--listen", endpoint, told=True)
        await read_until(router, "listens")
        bare = []
        for name in mission.robots:
            mates = [] if idle else [name, *mission.teammates(name)]
            bare.append(await place.start(BARE, endpoint, PARENT, *mates, told=True))
        for process in bare:
            await read_until(process, "ready")
        await asyncio.sleep(spans.settle)
        own, routing = await used([one.pid for one in bare], [router.pid], seconds=spans.window)
        sizes = [memory(one.pid) for one in bare]
    return {
        "kind": "bare, idle" if idle else "bare", "robots": count, "processes": count, "start": None,
        "cpu": own / count, "router": routing, "world": None,
        "pss": mean(size["pss"] for size in sizes), "uss": mean(size["uss"] for size in sizes),
        "periods": None, "missed": None, "delivered": None,
    }  # fmt: skip


def goals(rows: Sequence[dict[str, Any]]) -> Iterable[str]:
    """Sentences that hold the figures against what is wanted of them, and say where they end."""
    own = {row["robots"]: row for row in rows if row["kind"] == "robots" and row["processes"] == row["robots"]}
    shared = [row for row in rows if row["kind"] == "robots" and row["processes"] < row["robots"]]
    if (row := own.get(GOAL_TEAM)) is not None:
        reached = "reached" if row["cpu"] <= MOST_CPU and row["pss"] <= MOST_MEMORY else "not reached"
        yield (
            f"Goal for a process in a team of {GOAL_TEAM}, at most {MOST_CPU:.0%} of a core and {MOST_MEMORY:g} MB: "
            f"{row['cpu']:.2%} and {row['pss']:.0f} MB, {reached}."
        )
        bare = next((one for one in rows if one["kind"] == "bare"), None)
        if bare is not None:
            yield f"That is {row['cpu'] / bare['cpu']:.1f} times the processor time of a bare process, {bare['cpu']:.2%}."
    if (row := own.get(GOAL_PROCESSES)) is not None:
        reached = "reached" if row["missed"] == 0 else "not reached"
        periods = f"{row['missed']:,} of {row['missed'] + row['periods']:,}"
        yield f"Goal for {GOAL_PROCESSES} processes, no control period missed: {periods} missed, {reached}."
    for name, teams in (("processes of their own", list(own.values())), ("shared processes", shared)):
        yield from ends(name, teams)


def ends(name: str, teams: Sequence[dict[str, Any]]) -> Iterable[str]:
    """Where all cores are taken, by the largest team that kept its control periods; and which did not."""
    cores = len(os.sched_getaffinity(0))
    kept = [row for row in teams if row["missed"] <= MOST_MISSED * row["periods"]]
    if kept:
        row = max(kept, key=lambda one: one["robots"])
        rest = row["router"] + row["world"]
        all_of_it = row["cpu"] * row["robots"] + rest
        yield (
            f"{row['robots']} robots in {name} take {all_of_it:.2f} of {cores} cores, {rest / all_of_it:.0%} of it router and "
            f"world; at that rate all cores are taken by {row['robots'] * cores / all_of_it:,.0f} robots."
        )
    if late := [row for row in teams if row not in kept]:
        sizes = ", ".join(
            f"{row['robots']} ({row['missed'] / (row['missed'] + row['periods']):.0%} of their periods)" for row in late
        )
        yield f"In {name} more than {MOST_MISSED:.0%} of the control periods were missed by teams of {sizes}."


async def run(arguments: argparse.Namespace) -> None:
    """Measure all teams and tell."""
    spans = QUICK if arguments.quick else FULL
    alone, hosted, bare = ([3], [6], 3) if arguments.quick else ([10, 30, 100], [100, 300, 1000], 30)
    rows = [await measure_bare(bare, spans, idle=idle) for idle in (True, False)]
    rows += [await measure(robots, None, spans) for robots in alone]
    rows += [await measure(robots, 2, spans) for robots in hosted]

    def share(value: float | None) -> str:
        return "-" if value is None else f"{value:.2%}"

    publish(
        "Robots on one machine; shares are of one core, memory is that of one robot",
        {
            "": lambda row: row["kind"],
            "robots": lambda row: str(row["robots"]),
            "processes": lambda row: str(row["processes"]),
            "start": lambda row: "-" if row["start"] is None else f"{row['start']:.0f} s",
            "CPU a robot": lambda row: share(row["cpu"]),
            "PSS": lambda row: f"{row['pss']:.1f} MB",
            "USS": lambda row: f"{row['uss']:.1f} MB",
            "router": lambda row: share(row["router"]),
            "world": lambda row: share(row["world"]),
            "periods missed": lambda row: (
                "-" if row["periods"] is None else f"{row['missed']:,} of {row['missed'] + row['periods']:,}"
            ),
            "delivered": lambda row: "-" if row["delivered"] is None else f"{row['delivered']:.1%}",
        },
        rows,
        path=arguments.json,
        notes=list(goals(rows)),
        packages=["eclipse-zenoh"],
    )


def main() -> None:
    """Run from the command line."""
    asyncio.run(run(options(__doc__).parse_args()))


if __name__ == "__main__":
    main()
