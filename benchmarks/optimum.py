"""How large a mission can be for its optimum to be proven, and how long that takes, on one core with one solver thread.

Each row is one size with several random missions after the study's rules: times of 100 to 300, unrelated, the slowest of the
robots able to do a task (1 + heterogeneity) times as slow as the fastest. Seconds are of CPU time, as other processes may run
beside; the limit is of the solver's work, in its own seconds, so that what is proven does not depend on the machine. `bounds`
are those proven without any search; a gap is how far the makespan found is above the proven lower bound.

    python benchmarks/optimum.py [--quick] [--json FILE] [--missions N] [--limit WORK] [--tolerance SHARE]
"""

import statistics
import time
from itertools import product
from typing import Any

import numpy as np
from form import Columns, options, publish

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


COLUMNS: Columns = {
    "robots": lambda one: f"{one['robots']}",
    "tasks": lambda one: f"{one['tasks']}",
    "able": lambda one: f"{one['coverage']}",
    "spread": lambda one: f"{one['heterogeneity']:.0%}",
    "bounds": lambda one: f"{one['bounds']}/{one['missions']}",
    "proven": lambda one: f"{one['proven']}/{one['missions']}",
    "median": lambda one: f"{one['median_seconds']:.3f} s",
    "longest": lambda one: f"{one['longest_seconds']:.3f} s",
    "gap": lambda one: f"{one['largest_gap']:.1%}",
    "shared": lambda one: f"{one['shared_median_seconds'] * 1000:.0f} ms",
}


def main() -> None:
    """Run from the command line."""
    arguments = options(__doc__)
    arguments.add_argument("--missions", type=int, default=10, help="missions of each size")
    arguments.add_argument(
        "--limit", type=float, default=30.0, help="work for one optimum, in the solver's own seconds"
    )
    arguments.add_argument("--tolerance", type=float, default=TOLERANCE, help="share that counts as nothing")
    chosen = arguments.parse_args()
    optimum(draw(0, 8, 16, 4, 1), time_limit=1.0)  # what is imported on first use is no part of the measure
    given = {"missions": chosen.missions, "limit": chosen.limit, "tolerance": chosen.tolerance}
    sizes = SIZES
    if chosen.quick:
        given, sizes = {**given, "missions": 2, "limit": 0.1}, SIZES[:2]
    cases = [(*size, coverage, spread) for size, coverage, spread in product(sizes, COVERAGES, HETEROGENEITIES)]
    rows = [row(*case, **given) for case in cases if case[2] <= case[0] or case[2] == COVERAGES[0]]
    work = f"work for one optimum: at most {given['limit']:g} s of the solver's own"
    publish(
        "Proven optima, one core",
        COLUMNS,
        rows,
        path=chosen.json,
        notes=[f"Missions of each size: {given['missions']}; {work}."],
        packages=["ortools"],
    )


if __name__ == "__main__":
    main()
