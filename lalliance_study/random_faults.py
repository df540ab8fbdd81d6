"""Random faults for the campaign: every kind of failure of robots and every rule of links.

Faults are drawn one after the other; one that does not fit the team or contradicts an earlier one (`fault_checks`) is dropped.
Most missions are merciful: each task keeps a robot that no fault strikes for good, so that the mission still has to complete.
"""

import random
from collections.abc import Callable
from typing import Any

from pydantic import TypeAdapter

from lalliance_agents.fault_checks import contradiction, misfit
from lalliance_agents.faults import AnyFault, Fault, robot_of

Document = dict[str, Any]

_FAULT: TypeAdapter[Fault] = TypeAdapter(AnyFault)

#: How often missions have how many faults.
_COUNTS = (0,) * 5 + (1,) * 6 + (2,) * 4 + (3,) * 3 + (4, 6)


def draw_faults(chance: random.Random, robots: Document, horizon: float) -> list[Document]:
    """Faults of one mission.

    Args:
        chance: where they come from.
        robots: the robots of the mission's document.
        horizon: about how long the mission will take, in seconds.
    """
    merciful = chance.random() < 0.85
    spared = _spared(chance, robots) if merciful else {}
    documents: list[Document] = []
    faults: list[Fault] = []
    for _ in range(chance.choice(_COUNTS)):
        document = _draw(chance, robots, horizon, spared)
        fault = _FAULT.validate_python(document)
        if _fits(fault, faults, robots):
            documents.append(document)
            faults.append(fault)
    return documents


def draw_stuck(chance: random.Random, robots: Document, horizon: float) -> list[Document]:
    """Robots that are stuck for good at tasks which another one can do; they may be the only ones for other tasks."""
    spared = _spared(chance, robots)
    pairs = [(name, task) for name, spec in robots.items() for task in spec["tasks"] if spared[task] != name]
    return [
        {"at": round(chance.uniform(0.0, horizon), 3), "kind": "stuck", "robot": name, "task": task}
        for name, task in chance.sample(pairs, min(len(pairs), chance.randint(1, 4)))
    ]


def _spared(chance: random.Random, robots: Document) -> dict[str, str]:
    """For each task the robot that will not be struck for good."""
    able: dict[str, list[str]] = {}
    for name, spec in robots.items():
        for task in spec["tasks"]:
            able.setdefault(task, []).append(name)
    # Few robots for all tasks, so that most of the team may be struck.
    order = list(robots)
    chance.shuffle(order)
    return {task: min(names, key=order.index) for task, names in able.items()}


def _fits(fault: Fault, earlier: list[Fault], robots: Document) -> bool:
    robot = robot_of(fault)
    if misfit(fault, robots, lambda name: robots[name]["tasks"]) is not None:
        return False
    if robot is not None and fault.at < robots[robot].get("joins", 0.0):
        return False
    return all(contradiction(fault, one, robots) is None for one in earlier)


def _draw(chance: random.Random, robots: Document, horizon: float, spared: dict[str, str]) -> Document:
    make = chance.choice(_KINDS)
    robot = chance.choice(list(robots))
    at = round(chance.uniform(robots[robot].get("joins", 0.0), horizon), 3)
    found: Document = {"at": at, **make(chance, robots, robot)}
    if _ends(chance, found, robots, spared):
        found["until"] = round(at + chance.uniform(0.1, 0.5 * horizon + 2.0), 3)
        if found.get("kind") == "crash":
            found["restart"] = True
    return found


def _ends(chance: random.Random, found: Document, robots: Document, spared: dict[str, str]) -> bool:
    """Whether the fault is to end: by chance, and if it would strike for good a robot that is to be spared."""
    if chance.random() < 0.5:
        return True
    robot = found.get("robot")
    if robot is None or found["kind"] in {"slow", "mute", "deaf"} or "delay" in found:
        return False
    if "task" in found:
        return bool(spared.get(found["task"]) == robot)
    return any(spared.get(task) == robot for task in robots[robot]["tasks"])


Make = Callable[[random.Random, Document, str], Document]


def _of_robot(kind: str) -> Make:
    return lambda _, __, robot: {"kind": kind, "robot": robot}


def _stuck_at(chance: random.Random, robots: Document, robot: str) -> Document:
    return {"kind": "stuck", "robot": robot, "task": chance.choice(list(robots[robot]["tasks"]))}


def _slow(chance: random.Random, _: Document, robot: str) -> Document:
    return {"kind": "slow", "robot": robot, "factor": round(chance.uniform(1.1, 6.0), 3)}


def _late_senses(chance: random.Random, _: Document, robot: str) -> Document:
    return {"kind": "blind", "robot": robot, "delay": round(chance.uniform(0.05, 2.0), 3)}


def _globs(chance: random.Random, robots: Document) -> str | list[str]:
    names = list(robots)
    kind = chance.random()
    if kind < 0.4:
        return "*"
    if kind < 0.6:
        return f"{chance.choice(names)[0]}*"
    if kind < 0.7:
        return f"?{chance.choice(names)[1:]}"
    if kind < 0.85:
        return chance.choice(names)
    return chance.sample(names, chance.randint(1, min(3, len(names))))


def _link(chance: random.Random, robots: Document) -> Document:
    link: Document = {"from": _globs(chance, robots), "to": _globs(chance, robots)}
    if chance.random() < 0.3:
        link["both"] = True
    return link


def _loss(chance: random.Random) -> float | Document:
    if chance.random() < 0.6:
        return round(chance.choice((chance.uniform(0.05, 0.5), chance.uniform(0.5, 0.95), 1.0)), 3)
    bursts: Document = {"enter": round(chance.uniform(0.02, 0.9), 3), "leave": round(chance.uniform(0.05, 0.9), 3)}
    if chance.random() < 0.3:
        bursts |= {"good": round(chance.uniform(0.0, 0.2), 3), "bad": round(chance.uniform(0.5, 1.0), 3)}
    return bursts


def _delay(chance: random.Random) -> float | Document:
    kind = chance.random()
    if kind < 0.33:
        return _some(chance.uniform(0.0, 1.5))
    if kind < 0.66:
        low = round(chance.uniform(0.0, 0.5), 3)
        return {"uniform": [low, _some(low + chance.uniform(0.0, 1.5))]}
    return {"lognormal": {"median": round(chance.uniform(0.02, 0.5), 3), "sigma": round(chance.uniform(0.1, 1.5), 3)}}


def _some(delay: float) -> float:
    """A delay in whole milliseconds, at least one: a rule that delays by nothing can never fire."""
    return max(round(delay, 3), 0.001)


def _rule(chance: random.Random, robots: Document, _: str) -> Document:
    """One or more aspects on some links."""
    found: Document = {"link": _link(chance, robots)}
    while len(found) == 1:
        if chance.random() < 0.4:
            found["loss"] = _loss(chance)
        if chance.random() < 0.4:
            found["delay"] = _delay(chance)
        if chance.random() < 0.2:
            found["duplicate"] = round(chance.uniform(0.05, 1.0), 3)
        if chance.random() < 0.2:
            found |= {"reorder": round(chance.uniform(0.05, 1.0), 3), "held": round(chance.uniform(0.05, 1.5), 3)}
    return found


def _cut(chance: random.Random, robots: Document, _: str) -> Document:
    return {"link": _link(chance, robots), "cut": True}


def _partition(chance: random.Random, robots: Document, _: str) -> Document:
    letters = sorted({name[0] for name in robots})
    if len(letters) > 1 and chance.random() < 0.6:
        return {"partition": [f"{letter}*" for letter in letters]}
    names = list(robots)
    chance.shuffle(names)
    cut = chance.randint(1, len(names) - 1)
    return {"partition": [names[:cut], names[cut:]]}


_KINDS: tuple[Make, ...] = (
    *(_of_robot(kind) for kind in ("crash", "crash", "hang", "hang", "stuck", "mute", "deaf", "blind")),
    *(_stuck_at, _slow, _late_senses, _rule, _rule, _rule, _rule, _cut, _cut, _partition),
)
