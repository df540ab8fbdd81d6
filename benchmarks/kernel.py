"""How many missions a second the kernel runs, without and with their generation, on one thread and on two.

Robots that can do 3 of the tasks each, mean task 200 control steps, given knowledge, strategy II, derived ordering. The best
of several runs counts, in CPU time where one thread runs, as whatever else the machine does only slows a run down.

    python benchmarks/kernel.py [--json FILE] [--runs N]
"""

import argparse
import json
import platform
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from lalliance_agents.model.parameters import Parameters
from lalliance_study.kernel import run_in_threads, run_missions
from lalliance_study.kernel_state import rules_of
from lalliance_study.scenarios import Scenario, draw_missions, mission_of

#: robots, tasks, missions a run
SHAPES = [(5, 10, 4000), (10, 20, 1500), (20, 40, 500)]


def best(deed: Callable[[], object], runs: int, clock: Callable[[], float]) -> float:
    """The least time that `deed` takes, in seconds."""
    least = float("inf")
    for _ in range(runs):
        began = clock()
        deed()
        least = min(least, clock() - began)
    return least


def row(robots: int, tasks: int, count: int, runs: int) -> dict[str, Any]:
    """The figures of one size."""
    scenario = Scenario(robots=robots, tasks=tasks, coverage=3)
    missions = draw_missions(scenario, count)
    rules = rules_of(mission_of(scenario, Parameters(), missions, 0)[0])
    one = run_missions(rules, missions)
    two = run_in_threads(rules, missions, 2)
    if (one != two).any():
        raise SystemExit("two threads give other results than one")
    alone = best(lambda: run_missions(rules, missions), runs, time.process_time)
    made = best(lambda: draw_missions(scenario, count), runs, time.process_time)
    wall = best(lambda: run_missions(rules, missions), runs, time.perf_counter)
    both = best(lambda: run_in_threads(rules, missions, 2), runs, time.perf_counter)
    return {
        "robots": robots,
        "tasks": tasks,
        "missions_per_second": count / alone,
        "generation_share": made / alone,
        "two_threads_gain": wall / both,
        "decisions_per_mission": float(one[:, 4].mean()),
        "makespan": float(one[:, 0].mean()),
    }


def main() -> None:
    """Print a table and write a JSON file if one is named."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--json", type=Path, help="where to write the figures")
    arguments.add_argument("--runs", type=int, default=10, help="runs of each size")
    chosen = arguments.parse_args()
    rows = [row(*shape, chosen.runs) for shape in SHAPES]
    table = Table(title="Kernel, coverage 3", title_justify="left", box=None, pad_edge=False)
    for column in ("robots", "tasks", "missions/s", "generation", "two threads", "decisions", "makespan"):
        table.add_column(column, justify="right")
    for one in rows:
        table.add_row(
            str(one["robots"]),
            str(one["tasks"]),
            f"{one['missions_per_second']:,.0f}",
            f"+{one['generation_share']:.0%}",
            f"{one['two_threads_gain']:.2f}x",
            f"{one['decisions_per_mission']:.0f}",
            f"{one['makespan']:.0f} s",
        )
    Console().print(table)
    if chosen.json is not None:
        machine = {"python": platform.python_version(), "machine": platform.machine(), "numba": version("numba")}
        chosen.json.write_text(json.dumps({"machine": machine, "kernel": rows}, indent=2) + "\n")


if __name__ == "__main__":
    main()
