"""How soon a robot that fails is noticed, and its task taken over: real processes, killed (SIGKILL) and stopped (SIGSTOP).

Pairs of robots share one task each: one works, the other waits. The one that works fails, the other takes the task; then the
failed one is started anew, and waits. The world's part in that is none: what counts is what robots hear of one another. A
watcher on the bus times the decisions, and in the same run what Zenoh itself notices: that the robot's session is gone, and
those of bare processes, with Zenoh's default lease and with a short one.

    python benchmarks/failover.py [--quick] [--json FILE]
"""

import argparse
import asyncio
import random
import signal
from collections import defaultdict
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from form import options, publish
from processes import PARENT, Processes, Team, kill

from lalliance_agents.agent.catalog import fresh_incarnation
from lalliance_agents.bus.base import LEASE, Bus
from lalliance_agents.bus.messenger import Messenger
from lalliance_agents.bus.zenoh_bus import open_bus
from lalliance_agents.config import Mission
from lalliance_agents.wire.keys import OPERATOR, Key, Keys, Kind
from lalliance_agents.wire.messages import DecisionMade, Message

TAU, CONTROL = 1.0, 0.1
#: Zenoh's own lease, and one that is as short as a busy machine allows; in seconds.
DEFAULT_LEASE, SHORT_LEASE = 10.0, 0.5
HOLDER = Path(__file__).with_name("holder.py")
#: Faults of one round come within this, at random; in seconds.
SPREAD = 1.0
#: How long to wait for what should come of a fault, beyond the lease; in seconds.
PATIENCE = 6.0
FAULTS = (signal.SIGKILL, signal.SIGSTOP)


def pairs_mission(pairs: int) -> Mission:
    """A mission of pairs of robots with one task for each pair, which never ends."""
    return Mission.model_validate(
        {
            "name": "failover",
            "tasks": {f"task-{number}": {} for number in range(pairs)},
            "robots": {
                f"{side}-{number}": {"tasks": {f"task-{number}": 1e6}}
                for number in range(pairs)
                for side in ("left", "right")
            },
            "knowledge": "given",
            "parameters": {"min_delay": 0.1, "max_delay": 0.5, "broadcast_rate": 5.0, "silence_timeout": TAU},
            "control_period": CONTROL,
        }
    )


class Watcher:
    """What is seen on the bus, with the instants of its arrival."""

    def __init__(self) -> None:
        self._now = asyncio.get_running_loop().time
        #: Task -> who works on it, by what robots decide.
        self.on: dict[str, str] = {}
        #: Task -> activations on it, each with its instant.
        self.taken: dict[str, list[tuple[float, DecisionMade]]] = defaultdict(list)
        #: Presence -> when it went last.
        self.gone: dict[str, float] = {}
        self.present: set[str] = set()
        self._changed = asyncio.Event()

    async def watch(self, bus: Bus, mission: Mission) -> None:
        """Begin to watch."""
        keys = Keys(mission.name)
        ear = Messenger(bus, keys, OPERATOR, fresh_incarnation(), self._now)
        await ear.listen(keys.build(Kind.DECISION), self._decided)
        await ear.ask(keys.build(Kind.DECISION), self._decided, timeout=1.0)  # those made before
        for pattern in (keys.build(Kind.ALIVE), "hold/*/*"):
            await bus.watch_presence(pattern, self._seen)

    def _decided(self, _: Key, made: Message) -> None:
        if isinstance(made, DecisionMade):
            if made.verb == "activate":
                self.on[made.task] = made.sender
                self.taken[made.task].append((self._now(), made))
            elif self.on.get(made.task) == made.sender:
                del self.on[made.task]
            self._changed.set()

    def _seen(self, key: str, present: bool) -> None:
        name = key.rpartition("/alive/")[2]
        if present:
            self.present.add(name)
        else:
            self.present.discard(name)
            self.gone[name] = self._now()
        self._changed.set()

    async def until(self, condition: Any, patience: float) -> bool:
        """Wait until a condition holds; whether it did in time."""
        until = self._now() + patience
        while not condition():
            self._changed.clear()
            try:
                async with asyncio.timeout_at(until):
                    await self._changed.wait()
            except TimeoutError:
                return False
        return True


class Trial:
    """Faults in rounds, at a team and at bare processes beside it; what was seen of each.

    Args:
        team: a running team of pairs.
        place: where further processes are started.
        watcher: who sees it all.
        leases: those of the bare processes, one for each task, in seconds.
        settle: how long nothing fails after all are there (again), in seconds.
    """

    def __init__(self, team: Team, place: Processes, watcher: Watcher, leases: Sequence[float], settle: float) -> None:
        self._team = team
        self._place = place
        self._watcher = watcher
        self._settle = settle
        self._now = asyncio.get_running_loop().time
        self._chance = random.Random(1)
        self._holders: dict[str, asyncio.subprocess.Process | None] = {
            f"hold/{lease:g}/{number}": None for lease in leases for number in range(len(team.mission.tasks))
        }
        #: (how it was noticed, fault) -> one sample of each fault.
        self.samples: dict[tuple[str, str], list[dict[str, float]]] = defaultdict(list)
        self.missing = 0

    async def begin(self) -> None:
        """Have everybody there and every task worked on."""
        await asyncio.gather(*map(self._hold, self._holders))
        tasks = self._team.mission.tasks
        if not await self._watcher.until(lambda: len(self._watcher.on) == len(tasks), PATIENCE):
            raise RuntimeError(f"of {len(tasks)} tasks only {len(self._watcher.on)} were begun in time")
        await asyncio.sleep(self._settle)

    async def round(self, fault: signal.Signals) -> None:
        """Have one robot of each pair and every bare process fail once, and return."""
        await asyncio.gather(
            *(self._fail_robot(task, fault) for task in self._team.mission.tasks),
            *(self._fail_holder(key, fault) for key in self._holders),
        )
        await asyncio.sleep(self._settle)

    async def _hold(self, key: str) -> None:
        lease = key.split("/")[1]
        self._holders[key] = await self._place.start(HOLDER, self._team.endpoint, PARENT, lease, key)
        await self._watcher.until(lambda: key in self._watcher.present, PATIENCE)

    async def _strike(self, process: asyncio.subprocess.Process, fault: signal.Signals) -> float:
        """Make a fault at a random instant; that instant."""
        await asyncio.sleep(self._chance.random() * SPREAD)
        at = self._now()
        process.send_signal(fault)
        return at

    async def _fail_robot(self, task: str, fault: signal.Signals) -> None:
        watcher, taken = self._watcher, self._watcher.taken[task]
        victim = watcher.on[task]
        process = self._team.running[victim]
        seen = len(taken)
        at = await self._strike(process, fault)
        await watcher.until(lambda: any(made.sender != victim for _, made in taken[seen:]), PATIENCE)
        await self._note_gone(victim, LEASE, at, fault)
        came = next(((when, made) for when, made in taken[seen:] if when > at and made.sender != victim), None)
        if came is None:
            self.missing += 1
        else:
            self.samples["silence", fault.name].append(_takeover(victim, at, *came))
        await kill(process)
        watcher.on[task] = watcher.on.get(task, victim) if came is None else came[1].sender
        await self._team.start_robots([victim])
        await watcher.until(lambda: victim in watcher.present, PATIENCE)

    async def _fail_holder(self, key: str, fault: signal.Signals) -> None:
        process = self._holders[key]
        assert process is not None  # noqa: S101 - it was started in `begin`
        at = await self._strike(process, fault)
        await self._note_gone(key, float(key.split("/")[1]), at, fault)
        await kill(process)
        await self._hold(key)

    async def _note_gone(self, name: str, lease: float, at: float, fault: signal.Signals) -> None:
        """Wait until Zenoh takes a presence to be gone, and note when it did."""
        gone = self._watcher.gone
        if await self._watcher.until(lambda: gone.get(name, 0.0) >= at, lease + PATIENCE):
            self.samples[_by_lease(lease), fault.name].append({"noticed": gone[name] - at})
        else:
            self.missing += 1


def _by_lease(lease: float) -> str:
    whose = {DEFAULT_LEASE: ", its default", LEASE: ", as here"}.get(lease, "")
    return f"Zenoh, lease {lease:g} s{whose}"


def _takeover(victim: str, at: float, came: float, made: DecisionMade) -> dict[str, float]:
    """What a takeover tells: when the failure was noticed, and the task taken, in seconds since the fault."""
    lapsed = [mate["lapsed_at"] for mate in made.teammates if mate["robot"] == victim]
    noticed = [came - at - (made.at - when) for when in lapsed if isinstance(when, int | float)]
    delay = made.factors["delay"]
    found = {"taken": came - at, "beyond": came - at - (TAU + float(delay or 0.0) + CONTROL)}
    return found | ({"noticed": noticed[0]} if noticed else {})


async def measure(pairs: int, rounds: int, leases: Sequence[float], settle: float) -> Trial:
    """Run a team through rounds of each fault."""
    mission = pairs_mission(pairs)
    async with Processes() as place:
        team = Team(mission, place, [[name] for name in mission.robots])
        await team.start()
        watcher = Watcher()
        async with await open_bus(team.endpoint) as bus:
            await watcher.watch(bus, mission)
            trial = Trial(team, place, watcher, leases, settle)
            await trial.begin()
            for fault in FAULTS:
                for _ in range(rounds):
                    await trial.round(fault)
    return trial


def row(method: str, fault: str, samples: Sequence[dict[str, float]]) -> dict[str, Any]:
    """The quantiles of one way of noticing one fault, in seconds."""
    figures: dict[str, Any] = {"method": method, "fault": fault, "faults": len(samples)}
    for what in ("noticed", "taken", "beyond"):
        values = [sample[what] for sample in samples if what in sample]
        for share in (50, 99):
            figures[f"{what}_p{share}"] = float(np.quantile(values, share / 100)) if values else None
    return figures


def notes(rows: Sequence[dict[str, Any]], missing: int) -> Iterable[str]:
    """Sentences that hold the figures against what is wanted of them."""
    yield f"{missing} times nothing was noticed in time; the 99th percentile of a row of n is nearly its largest of n."
    for each in rows:
        if each["beyond_p99"] is not None:
            reached = "reached" if each["beyond_p99"] <= 0 else "not reached"
            yield (
                f"Goal after {each['fault']}, the task taken within tau ({TAU:g} s), the model's own delay and one control "
                f"period ({CONTROL:g} s): {each['beyond_p99']:+.3f} s against that at the 99th percentile, {reached}."
            )


async def run(arguments: argparse.Namespace) -> None:
    """Measure and tell."""
    leases = [SHORT_LEASE] if arguments.quick else [DEFAULT_LEASE, SHORT_LEASE]
    trial = await (measure(2, 1, leases, 1.0) if arguments.quick else measure(10, 5, leases, 2.0))
    order = ["silence", *(_by_lease(lease) for lease in (SHORT_LEASE, LEASE, DEFAULT_LEASE))]
    rows = [
        row(method, fault.name, trial.samples[method, fault.name])
        for method in order
        for fault in FAULTS
        if trial.samples[method, fault.name]
    ]

    def seconds(what: str) -> Any:
        return lambda each: "-" if each[what] is None else f"{each[what]:.3f} s"

    publish(
        f"From a robot's failure to what follows; robots notice a silence of tau = {TAU:g} s",
        {
            "noticed by": lambda each: each["method"],
            "fault": lambda each: each["fault"],
            "times": lambda each: str(each["faults"]),
            "noticed p50": seconds("noticed_p50"),
            "p99": seconds("noticed_p99"),
            "taken over p50": seconds("taken_p50"),
            "p99 ": seconds("taken_p99"),
            "beyond p50": seconds("beyond_p50"),
            "p99  ": seconds("beyond_p99"),
        },
        rows,
        path=arguments.json,
        notes=list(notes(rows, trial.missing)),
        packages=["eclipse-zenoh"],
    )


if __name__ == "__main__":
    asyncio.run(run(options(__doc__).parse_args()))
