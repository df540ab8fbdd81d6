"""What a mission costs when messages are lost: its makespan, takeovers that were not needed, work that was done twice.

The missions are random and the same for every setting, so that settings are compared pair by pair.
"""

import math
import random
from collections.abc import Iterable
from typing import Any

from lalliance_agents.config import Mission
from lalliance_study.detection.probe import RATE
from lalliance_study.detection.rows import Cost
from lalliance_study.logbook import Line
from lalliance_study.simulator import Simulator

ROBOTS, TASKS, COVERAGE = 6, 18, 3
#: Range of own times, and of the instant at which a robot crashes, in seconds.
OWN_TIMES = 10.0, 30.0
CRASH_TIMES = 10.0, 40.0
DEADLINE = 2000.0


def standard(seed: int, loss: float, tau_rho: float, *, crash: bool) -> Mission:
    """A random mission for a team of different robots.

    Args:
        seed: everything that is drawn comes from it, and does not depend on the rest.
        loss: share of the messages lost on every link, independently.
        tau_rho: tau in periods of the announcements.
        crash: whether one robot crashes.
    """
    chance = random.Random(seed)
    able: dict[str, dict[str, float]] = {f"robot-{number}": {} for number in range(ROBOTS)}
    for number in range(TASKS):
        # Who can do least so far is among the able, so that nobody is left without a task.
        fewest = min(sorted(able), key=lambda robot: len(able[robot]))
        others = chance.sample([robot for robot in sorted(able) if robot != fewest], COVERAGE - 1)
        for robot in [fewest, *others]:
            able[robot][f"task-{number}"] = round(chance.uniform(*OWN_TIMES), 2)
    victim, dies = chance.choice(sorted(able)), round(chance.uniform(*CRASH_TIMES), 3)
    faults: list[dict[str, Any]] = [{"at": dies, "robot": victim, "kind": "crash"}] if crash else []
    if loss:
        faults.append({"at": 0.0, "link": {}, "loss": loss})
    return Mission.model_validate(
        {
            "name": "standard",
            "tasks": {f"task-{number}": {} for number in range(TASKS)},
            "robots": {robot: {"tasks": times} for robot, times in able.items()},
            "knowledge": "given",
            "parameters": {
                "min_delay": 0.1,
                "max_delay": 0.5,
                "broadcast_rate": RATE,
                "silence_timeout": round(tau_rho / RATE, 9),
            },
            "faults": faults,
            "deadline": DEADLINE,
            "seed": seed,
        }
    )


def cost(seed: int, loss: float, tau_rho: float, *, crash: bool) -> Cost:
    """What one such mission came to."""
    simulator = Simulator(standard(seed, loss, tau_rho, crash=crash))
    summary = simulator.run()
    silences = [one for one in summary["takeovers"] if one["cause"] == "silence"]
    needed = sum("failed_at" in one for one in silences)
    return Cost(
        seed=seed,
        crash=int(crash),
        loss=loss,
        tau_rho=tau_rho,
        makespan=math.nan if summary["makespan"] is None else summary["makespan"],
        needless=len(silences) - needed,
        needed=needed,
        doubled=abs(round(doubled(simulator.log, simulator.now), 4)),
    )


def doubled(log: Iterable[Line], end: float) -> float:
    """The share of the robots' working time in which another robot was on the same task already.

    Args:
        log: a mission's event log, of one trial.
        end: when it ended, in seconds.
    """
    began: dict[tuple[str, str], float] = {}
    spans: list[tuple[str, float, float]] = []

    def close(at: float, who: str | None, task: str | None) -> None:
        for robot, where in list(began):
            if who in {None, robot} and task in {None, where}:
                spans.append((where, began.pop((robot, where)), at))

    for line in log:
        if line.what == "activate" and line.task is not None:
            began[line.who, line.task] = line.at
        elif line.what == "complete" and line.why.startswith(f"{line.task} completed by"):
            close(line.at, None, line.task)
        elif line.what == "gone" or line.what in {"yield", "give_up", "drop", "complete"}:
            close(line.at, line.who, line.task)
    close(end, None, None)
    worked = sum(until - since for _, since, until in spans)
    return (worked - _covered(spans)) / worked if worked else 0.0


def _covered(spans: Iterable[tuple[str, float, float]]) -> float:
    """The time during which somebody was on a task, summed over tasks, in seconds."""
    covered, reached = 0.0, dict[str, float]()
    for task, since, until in sorted(spans):
        covered += max(until - max(since, reached.get(task, -math.inf)), 0.0)
        reached[task] = max(until, reached.get(task, -math.inf))
    return covered
