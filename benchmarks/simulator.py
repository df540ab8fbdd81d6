"""How much faster than real time the exact simulator is, on one core.

Each row is one mission, run several times; the fastest run counts, as whatever else the machine does only slows a run down.
Beside it the same mission with every control step made and every message taken in, which must give the same event log.
The goal is 500 times real time for 20 robots and 40 tasks at 10 control steps a second, with three robots able to do each task.

    python benchmarks/simulator.py [--json FILE] [--quick] [--runs N]
"""

import random
import sys
import time
from collections.abc import Callable
from typing import Any

from form import options, publish

from lalliance_agents.config import Mission
from lalliance_study.simulator import Simulator

#: How many times faster than real time 20 robots with 40 tasks, 3 robots able to do each, are to be.
GOAL = 500
#: robots, tasks, robots able to do each task, shortest and longest own time in seconds
SHAPES = [(5, 10, 3, 10, 30), (10, 20, 3, 10, 30), (20, 40, 3, 10, 30), (20, 40, 3, 50, 150), (20, 40, 20, 10, 30)]


def mission(robots: int, tasks: int, coverage: int, shortest: float, longest: float) -> Mission:
    """A mission without faults at 10 control steps and 5 messages a second."""
    chance = random.Random(1)
    able: dict[str, dict[str, float]] = {f"r{number}": {} for number in range(robots)}
    for number in range(tasks):
        for robot in chance.sample(sorted(able), coverage):
            able[robot][f"t{number}"] = round(chance.uniform(shortest, longest), 2)
    return Mission.model_validate(
        {
            "name": "benchmark",
            "tasks": {f"t{number}": {} for number in range(tasks)},
            "robots": {robot: {"tasks": times} for robot, times in able.items() if times},
            "knowledge": "given",
            "parameters": {"min_delay": 0.1, "max_delay": 0.5},
            "deadline": 100_000.0,
            "seed": 1,
        }
    )


def measure(what: Mission, *, every_step: bool, runs: int) -> tuple[Simulator, float]:
    """A finished simulator, and the least CPU time of `runs` runs in seconds."""
    least = float("inf")
    for _ in range(runs):
        simulator = Simulator(what, every_step=every_step)
        began = time.process_time()
        simulator.run()
        least = min(least, time.process_time() - began)
    return simulator, least


def rows(runs: int) -> list[dict[str, Any]]:
    """One row per shape of mission."""
    found = []
    for shape in SHAPES:
        what = mission(*shape)
        simulator, seconds = measure(what, every_step=False, runs=runs)
        plain, plain_seconds = measure(what, every_step=True, runs=max(runs // 4, 1))
        if simulator.log != plain.log:
            sys.exit(f"the logs of {shape} differ")
        members = simulator.members.values()
        found.append(
            {
                "robots": shape[0],
                "tasks": shape[1],
                "coverage": shape[2],
                "own_times": shape[3:],
                "virtual_seconds": simulator.now,
                "cpu_seconds": seconds,
                "times_real_time": simulator.now / seconds,
                "missions_per_second": 1 / seconds,
                "every_step_cpu_seconds": plain_seconds,
                "ratio": plain_seconds / seconds,
                "steps": sum(member.steps for member in members),
                "steps_of_all": sum(member.steps for member in plain.members.values()),
            }
        )
    return found


def _own_times(one: dict[str, Any]) -> str:
    return "{}-{} s".format(*one["own_times"])


COLUMNS: dict[str, Callable[[dict[str, Any]], str]] = {
    "robots": lambda one: f"{one['robots']}",
    "tasks": lambda one: f"{one['tasks']}",
    "coverage": lambda one: f"{one['coverage']}",
    "own times": _own_times,
    "virtual": lambda one: f"{one['virtual_seconds']:.0f} s",
    "CPU": lambda one: f"{one['cpu_seconds'] * 1000:.0f} ms",
    "x real time": lambda one: f"{one['times_real_time']:.0f}",
    "missions/s": lambda one: f"{one['missions_per_second']:.1f}",
    "steps made": lambda one: f"{one['steps'] / one['steps_of_all']:.1%}",
    "gain": lambda one: f"{one['ratio']:.1f}",
}


def main() -> None:
    """Run from the command line."""
    arguments = options(__doc__)
    arguments.add_argument("--runs", type=int, help="runs of each mission (default 8; with --quick 2)")
    chosen = arguments.parse_args()
    measured = rows(chosen.runs or (2 if chosen.quick else 8))
    notes = [
        f"20 robots, 40 tasks, coverage 3, own times of {_own_times(one)}: "
        f"{one['times_real_time'] / GOAL:.0%} of the goal of {GOAL} x"
        for one in measured
        if (one["robots"], one["tasks"], one["coverage"]) == (20, 40, 3)
    ]
    publish("Exact simulator, one core", COLUMNS, measured, path=chosen.json, notes=notes)


if __name__ == "__main__":
    main()
