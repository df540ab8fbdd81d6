"""How large a mission can be for its optimum to be proven, and how long that takes, on one core with one solver thread.

Each row is one size with several random missions after the study's rules: times of 100 to 300, unrelated, the slowest of the
robots able to do a task (1 + heterogeneity) times as slow as the fastest. Seconds are of CPU time, as other processes may run
beside; the limit is of the solver's work, in its own seconds, so that what is proven does not depend on the machine. `bounds`
are those proven without any search; a gap is how far the makespan found is above the proven lower bound.

    python benchmarks/optimum.py [--json FILE] [--missions N] [--limit WORK] [--tolerance SHARE]
"""

import argparse
import json
import platform
import statistics
import time
from importlib.metadata import version
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from lalliance_study.assignments import Floats
from lalliance_study.optimum import TOLERANCE, optimum, shared_optimum

#: robots and tasks
SIZES = [(2, 4), (4, 8), (5, 10), (8, 16), (10, 20), (15, 30), (20, 40)]
COVERAGES = [3, 4]
HETEROGENEITIES = [0, 1, 8]
#: Seconds of a search that the limit of work ends.
NO_LIMIT = 1e6


def draw(seed: int, robots: int, tasks: int, coverage: int, heterogeneity: float) -> Floats:
    """The times of one mission, `[robots, tasks]`."""
    chance = np.random.default_rng(seed)
    able = min(coverage, robots)
    times = np.full((robots, tasks), np.inf)
    for task in range(tasks):
        others = chance.uniform(1, 1 + heterogeneity, able)
        factors = np.concatenate([[1.0, 1 + heterogeneity], others])[:able]
        times[chance.choice(robots, able, replace=False), task] = chance.uniform(100, 300) * factors
    return times


def row(
    robots: int, tasks: int, coverage: int, heterogeneity: int, *, missions: int, limit: float, tolerance: float
) -> dict[str, Any]:
    """What came of the missions of one size."""
    seconds, gaps, shared, bounds = [], [], [], 0
    for seed in range(missions):
        times = draw(seed, robots, tasks, coverage, heterogeneity)
        bounds += optimum(times, tolerance=tolerance, time_limit=0.0).proven
        began = time.process_time()
        found = optimum(times, tolerance=tolerance, time_limit=NO_LIMIT, work_limit=limit)
        ended = time.process_time()
        shared_optimum(times, "shared_max")
        seconds.append(ended - began)
        shared.append(time.process_time() - ended)
        gaps.append(0.0 if found.proven else found.makespan / found.lower - 1)
    return {
        "robots": robots,
        "tasks": tasks,
        "coverage": min(coverage, robots),
        "heterogeneity": heterogeneity,
        "missions": missions,
        "bounds": bounds,
        "proven": sum(gap == 0.0 for gap in gaps),
        "median_seconds": statistics.median(seconds),
        "longest_seconds": max(seconds),
        "largest_gap": max(gaps),
        "shared_median_seconds": statistics.median(shared),
    }


def show(rows: list[dict[str, Any]]) -> None:
    """Print the rows as a table."""
    table = Table(title="Proven optima, one core", title_justify="left", box=None, pad_edge=False)
    for column in ("robots", "tasks", "able", "spread", "bounds", "proven", "median", "longest", "gap", "shared"):
        table.add_column(column, justify="right")
    for one in rows:
        table.add_row(
            str(one["robots"]),
            str(one["tasks"]),
            str(one["coverage"]),
            f"{one['heterogeneity']:.0%}",
            f"{one['bounds']}/{one['missions']}",
            f"{one['proven']}/{one['missions']}",
            f"{one['median_seconds']:.3f} s",
            f"{one['longest_seconds']:.3f} s",
            f"{one['largest_gap']:.1%}",
            f"{one['shared_median_seconds'] * 1000:.0f} ms",
        )
    Console().print(table)


def main() -> None:
    """Print a table and write a JSON file if one is named."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--json", type=Path, help="where to write the figures")
    arguments.add_argument("--missions", type=int, default=10, help="missions of each size")
    arguments.add_argument(
        "--limit", type=float, default=30.0, help="work for one optimum, in the solver's own seconds"
    )
    arguments.add_argument("--tolerance", type=float, default=TOLERANCE, help="share that counts as nothing")
    chosen = arguments.parse_args()
    optimum(draw(0, 8, 16, 4, 1), time_limit=1.0)  # what is imported on first use is no part of the measure
    given = {"missions": chosen.missions, "limit": chosen.limit, "tolerance": chosen.tolerance}
    cases = [(*size, coverage, spread) for size, coverage, spread in product(SIZES, COVERAGES, HETEROGENEITIES)]
    rows = [row(*case, **given) for case in cases if case[2] <= case[0] or case[2] == COVERAGES[0]]
    show(rows)
    if chosen.json is not None:
        machine = {"python": platform.python_version(), "machine": platform.machine(), "ortools": version("ortools")}
        chosen.json.write_text(json.dumps({"machine": machine, "arguments": given, "optimum": rows}, indent=2) + "\n")


if __name__ == "__main__":
    main()
