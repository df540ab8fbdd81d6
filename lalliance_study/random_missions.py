"""Random missions for the campaign: teams, tasks, parameters and phases; the faults are drawn in `random_faults`.

Mission `number` of campaign `seed` is a function of these two numbers alone: neither how many missions are drawn nor where
they are run changes it. It is drawn as the plain values of a mission file (`Document`), so that it can be written as YAML and
read by every command. Most missions are small and short, since many missions find more than long ones; large teams occur all
the same, and all that a mission file can say is said by some of them.

A mission lasts at most until its deadline. Where it must complete (`promises`) the deadline is the time by which it must have;
elsewhere it is short, because nothing is learned from waiting for what need not happen.
"""

import math
import random
from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
import yaml

from lalliance_agents.config import Mission
from lalliance_agents.model.parameters import Erratum
from lalliance_study.promises import promise, settled_after
from lalliance_study.random_faults import draw_faults, draw_stuck
from world_server import environments
from world_server.environments.task_pool import HAND_OVERS

Document = dict[str, Any]
"""A mission file as plain values."""

#: Largest team, most tasks, and most robots that can do a task (but that each robot has one).
MOST_ROBOTS = 20
MOST_TASKS = 40
WIDEST = 5
#: Deadline of a mission that need not complete: its work, done by one robot, and this many seconds more.
PATIENCE = 8.0

T = TypeVar("T")


def chance_of(seed: int, number: int) -> random.Random:
    """Where all that is drawn for mission `number` of campaign `seed` comes from."""
    state = np.random.SeedSequence(seed, spawn_key=(number,)).generate_state(4, np.uint32)
    return random.Random(int.from_bytes(state.astype("<u4").tobytes(), "little"))


def draw_mission(seed: int, number: int) -> tuple[Document, Mission]:
    """Mission `number` of campaign `seed`: as a document, and checked."""
    chance = chance_of(seed, number)
    box = chance.random() < 0.05
    document: Document = {"name": f"campaign-{seed}-{number}"}
    document["environment"] = _box(chance) if box else _pool(chance)
    phases = _phases(chance)
    tasks, robots = _team(chance, box=box, small=sum(phase["trials"] for phase in phases) > 1)
    horizon = _horizon(robots, len(tasks))
    if not box:
        _order_tasks(chance, tasks, horizon)
    period = chance.choice((0.05, 0.1, 0.1, 0.2, 0.25))
    document["tasks"], document["robots"] = tasks, robots
    document["parameters"] = _parameters(chance, period, list(tasks))
    document["phases"] = phases
    if chance.random() < 0.06:
        _let_failures_teach(chance, document["parameters"])
        document["faults"] = draw_stuck(chance, robots, horizon)
    else:
        _vary_robots(chance, robots, horizon, document["parameters"])
        document["faults"] = draw_faults(chance, robots, horizon)
    document["knowledge"] = chance.choice(("given", "given", "none"))
    document["control_period"] = period
    document["deadline"] = 1e6
    document["seed"] = chance.getrandbits(31)
    return _with_deadline(document)


def _with_deadline(document: Document) -> tuple[Document, Mission]:
    mission = mission_of(document)
    promised = promise(mission).seconds
    if promised is None:
        work = sum(max(mission.robots[robot].tasks[task] for robot in mission.able(task)) for task in mission.tasks)
        promised = settled_after(mission) + work + PATIENCE
    document["deadline"] = float(math.ceil(promised))
    return document, mission.model_copy(update={"deadline": document["deadline"]})


def mission_of(document: Document) -> Mission:
    """The mission that a document says.

    Raises:
        pydantic.ValidationError: it says none.
        pydantic_core.PydanticCustomError: its environment cannot be made.
    """
    mission = Mission.model_validate(document)
    environments.check_options(mission)
    return mission


def text_of(document: Document) -> str:
    """A document as the text of a mission file."""
    return yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=120)


def between(chance: random.Random, low: float, high: float) -> float:
    """A number from `low` to `high`, uniform, to three digits after the point."""
    return round(chance.uniform(low, high), 3)


def _log_between(chance: random.Random, low: float, high: float) -> float:
    drawn: float = round(math.exp(chance.uniform(math.log(low), math.log(high))), 3)
    return drawn


def _some(chance: random.Random, among: Sequence[T], most: int) -> list[T]:
    """One or more of `among`, in a random order."""
    return chance.sample(list(among), chance.randint(1, max(1, min(most, len(among)))))


def _pool(chance: random.Random) -> Document:
    options: Document = {"kind": "task_pool", "hand_over": chance.choice(HAND_OVERS)}
    if chance.random() < 0.4:
        options["noise"] = between(chance, 0.0, 0.3)
    return options


def _box(chance: random.Random) -> Document:
    return {"kind": "box_pushing", "slack": between(chance, 0.05, 0.6)}


def _phases(chance: random.Random) -> list[Document]:
    kind = chance.random()
    if kind < 0.82:
        return [{"learning": "adaptive", "trials": 1}]
    first: Document = {"learning": "active" if kind < 0.95 else "adaptive", "trials": chance.randint(1, 2)}
    if kind < 0.86:
        return [first]
    if kind < 0.9:
        first |= {"trials": 3, "until": "full"}
    return [first, {"learning": "adaptive", "trials": 1}]


def _size(chance: random.Random, low: int, high: int, *, small: bool) -> int:
    """A size that is small most of the time."""
    share = chance.random() ** (5 if small else 3)
    return min(high, int(low * ((high + 1) / low) ** share))


def _team(chance: random.Random, *, box: bool, small: bool) -> tuple[Document, Document]:
    """Tasks, and robots with what each can do and how long that takes it."""
    count = 2 if box else _size(chance, 1, MOST_TASKS, small=small)
    tasks: Document = {f"t{number}": {} for number in range(count)}
    most = min(MOST_ROBOTS, WIDEST * count)
    groups = ("a", "b") if chance.random() < 0.5 else ("r",)
    names = [f"{groups[n % len(groups)]}{n // len(groups)}" for n in range(_size(chance, 2, most, small=small))]
    robots: Document = {name: {"tasks": {}} for name in names}
    longest = chance.choice((2.0, 4.0, 8.0))
    base = {task: _log_between(chance, 0.4, longest) for task in tasks}
    for task in tasks:
        for name in _some(chance, names, WIDEST):
            robots[name]["tasks"][task] = _own_time(chance, base[task])
    for spec in robots.values():
        if not spec["tasks"]:
            task = chance.choice(list(tasks))
            spec["tasks"][task] = _own_time(chance, base[task])
    return tasks, robots


def _own_time(chance: random.Random, base: float) -> float:
    factor = chance.uniform(0.6, 1.6) if chance.random() < 0.5 else 1.0
    return round(base * factor, 3)


def _horizon(robots: Document, count: int) -> float:
    """About how long the mission will take, in seconds: faults and arrivals are to fall into it."""
    times = [time for spec in robots.values() for time in spec["tasks"].values()]
    mean: float = sum(times) / len(times)
    return round(1.0 + mean * math.ceil(count / len(robots)), 3)


def _order_tasks(chance: random.Random, tasks: Document, horizon: float) -> None:
    """Prerequisites and arrivals, in some missions."""
    names = list(tasks)
    if chance.random() < 0.2:
        for index in range(1, len(names)):
            if chance.random() < 0.3:
                tasks[names[index]]["after"] = _some(chance, names[:index], 2)
    if chance.random() < 0.2:
        for name in names:
            if chance.random() < 0.3:
                tasks[name]["arrives"] = between(chance, 0.0, horizon)


def _parameters(chance: random.Random, period: float, tasks: list[str]) -> Document:
    rate = chance.choice([rate for rate in (2.0, 3.0, 4.0, 5.0, 8.0, 10.0) if rate * period <= 1.0])
    shortest = _log_between(chance, 0.05, 0.4)
    found: Document = {
        "strategy": chance.choice(("I", "II", "III")),
        "broadcast_rate": rate,
        "silence_timeout": between(chance, 2.0 / rate + 0.01, max(2.5 / rate, 2.0)),
        "min_delay": shortest,
        "max_delay": shortest if chance.random() < 0.05 else round(shortest * chance.uniform(1.0, 6.0) + 0.001, 3),
        "initial_task_time": chance.choice((1.0, 3.0, 3.0, 8.0, 30.0)),
        "trials": chance.randint(1, 10),
    }
    if chance.random() < 0.45:
        found["ordering"] = chance.choice(("modified_shortest_first", "modified_random", "longest_first"))
    if chance.random() < 0.3:
        found["boredom_threshold"] = between(chance, 0.5, 3.0)
        slowness = found["max_delay"] * chance.uniform(1.05, 3.0)
        found["boredom_rate"] = found["boredom_threshold"] / slowness
    if chance.random() < 0.6:
        found["collision_window"] = between(chance, 0.0, chance.choice((0.2, 0.2, 1.0)))
    found |= _factors(chance)
    if chance.random() < 0.08:
        found |= _by_hand(chance, tasks)
    found |= _readings(chance)
    return found


def _factors(chance: random.Random) -> Document:
    found: Document = {}
    if chance.random() < 0.3:
        found["threshold"] = chance.choice((0.5, 3.0, 10.0))
    if chance.random() < 0.3:
        found["give_up_factor"] = between(chance, 0.75, 4.0)
    if chance.random() < 0.3:
        found["failure_factor"] = between(chance, 0.8, 4.0)
    return found


def _by_hand(chance: random.Random, tasks: list[str]) -> Document:
    def hand_set() -> Document:
        return {
            "patience": between(chance, 1.0, 12.0),
            "slow_rate": _log_between(chance, 0.05, 1.0),
            "fast_rate": _log_between(chance, 0.5, 10.0),
            "yield_time": between(chance, 1.0, 12.0),
            "give_up_time": between(chance, 2.0, 20.0),
        }

    found: Document = {"architecture": "alliance", "by_hand": hand_set()}
    if chance.random() < 0.5:
        found["by_hand_tasks"] = {task: hand_set() for task in _some(chance, tasks, 3)}
    return found


def _readings(chance: random.Random) -> Document:
    kind = chance.random()
    if kind < 0.08:
        return {"readings": {Erratum.SECOND_PATIENCE.value: "mended"}}
    if kind < 0.11:
        literal = [one for one in Erratum if one is not Erratum.STRATEGY_ONE]
        return {"readings": {one.value: "literal" for one in _some(chance, literal, 2)}}
    return {}


def _let_failures_teach(chance: random.Random, parameters: Document) -> None:
    """Make parameters such that robots which are stuck for good cannot keep a mission from completing (`promises`)."""
    for name in ("architecture", "by_hand", "by_hand_tasks", "readings", "boredom_threshold", "boredom_rate"):
        parameters.pop(name, None)
    parameters["ordering"] = chance.choice(("derived", "modified_shortest_first"))
    parameters["max_delay"] = round(parameters["min_delay"] * chance.uniform(2.1, 6.0) + 0.001, 3)
    parameters["collision_window"] = between(chance, 0.0, 0.1)
    parameters["failure_factor"] = between(chance, 2.0, 4.0)
    parameters["give_up_factor"] = between(chance, 0.8, 3.0)


def _vary_robots(chance: random.Random, robots: Document, horizon: float, parameters: Document) -> None:
    """Robots that join late, and robots with parameters of their own, in some missions."""
    if chance.random() < 0.12:
        for name in _some(chance, list(robots)[1:], 2):
            robots[name]["joins"] = between(chance, 0.1, horizon)
    if chance.random() < 0.2:
        for name in _some(chance, list(robots), 3):
            robots[name]["parameters"] = _own_parameters(chance, parameters)


def _own_parameters(chance: random.Random, parameters: Document) -> Document:
    tau, shortest = parameters["silence_timeout"], parameters["min_delay"]
    choices: Document = {
        "strategy": chance.choice(("I", "II", "III")),
        "ordering": chance.choice(("derived", "modified_shortest_first", "modified_random", "longest_first")),
        "trials": chance.randint(1, 10),
        "initial_task_time": chance.choice((1.0, 3.0, 8.0)),
        "silence_timeout": between(chance, tau, 2 * tau),
        "min_delay": between(chance, 0.02, shortest),
        "give_up_factor": between(chance, 0.75, 4.0),
        "threshold": chance.choice((0.5, 1.0, 3.0)),
    }
    return {name: choices[name] for name in _some(chance, list(choices), 3)}
