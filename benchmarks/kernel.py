"""How many missions a second the kernel runs, beside the exact simulator and a plain loop over control steps.

Each task can be done by 3 robots; mean task 200 control steps, given knowledge, strategy II, derived ordering. The plain loop
is the simulator made to take every control step of every robot, and every message when it comes, with an event for each; a
leaner loop is that of `peers.py`. All three run the same missions and must find the same makespans. Generation is the time to
draw the missions, as a share of the kernel's. The best of several runs counts, in CPU time where one thread runs, as whatever
else the machine does only slows a run down.

    python benchmarks/kernel.py [--json FILE] [--quick] [--runs N]
"""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from form import options, publish

from lalliance_agents.model.parameters import Parameters
from lalliance_study.kernel import RESULTS, run_in_threads, run_missions
from lalliance_study.kernel_state import rules_of
from lalliance_study.scenarios import Missions, Scenario, draw_missions, mission_of
from lalliance_study.simulator import Simulator

#: robots, tasks, missions a run of the kernel, and how many of them the simulator runs
SHAPES = [(5, 10, 4000, 8), (10, 20, 1500, 4), (20, 40, 500, 2)]
QUICK = [(5, 10, 400, 2), (10, 20, 150, 1), (20, 40, 50, 1)]
#: Missions a second that one thread is to run.
GOALS = {(5, 10): 40_000, (10, 20): 12_000, (20, 40): 3_000}


def best(deed: Callable[[], object], runs: int, clock: Callable[[], float]) -> float:
    """The least time that `deed` takes, in seconds."""
    least = float("inf")
    for _ in range(runs):
        began = clock()
        deed()
        least = min(least, clock() - began)
    return least


def simulate(scenario: Scenario, missions: Missions, count: int, *, every_step: bool) -> list[float]:
    """The makespans that the exact simulator finds for the first of the missions, in seconds."""
    found = []
    for number in range(count):
        mission, circumstances = mission_of(scenario, Parameters(), missions, number)
        found.append(Simulator(mission, circumstances=circumstances, every_step=every_step).run()["makespan"])
    return found


def row(robots: int, tasks: int, count: int, few: int, runs: int) -> dict[str, Any]:
    """The figures of one size."""
    scenario = Scenario(robots=robots, tasks=tasks, coverage=3)
    missions = draw_missions(scenario, count)
    rules = rules_of(mission_of(scenario, Parameters(), missions, 0)[0])
    one = run_missions(rules, missions)
    if (one != run_in_threads(rules, missions, 2)).any():
        raise SystemExit("two threads give other results than one")
    makespans = one[:, RESULTS.index("makespan")]
    for every_step in (False, True):
        if not np.allclose(
            simulate(scenario, missions, few, every_step=every_step), makespans[:few], rtol=0, atol=1e-9
        ):
            raise SystemExit("the simulator gives other results than the kernel")
    alone = best(lambda: run_missions(rules, missions), runs, time.process_time)
    made = best(lambda: draw_missions(scenario, count), runs, time.process_time)
    wall = best(lambda: run_missions(rules, missions), runs, time.perf_counter)
    both = best(lambda: run_in_threads(rules, missions, 2), runs, time.perf_counter)
    exact = best(lambda: simulate(scenario, missions, few, every_step=False), max(runs // 3, 1), time.process_time)
    plain = best(lambda: simulate(scenario, missions, few, every_step=True), max(runs // 3, 1), time.process_time)
    return {
        "robots": robots,
        "tasks": tasks,
        "missions_per_second": count / alone,
        "goal": GOALS[robots, tasks],
        "generation_share": made / alone,
        "two_threads_gain": wall / both,
        "simulator_missions_per_second": few / exact,
        "plain_loop_missions_per_second": few / plain,
        "gain_over_simulator": count / alone * exact / few,
        "gain_over_plain_loop": count / alone * plain / few,
        "decisions_per_mission": float(one[:, RESULTS.index("decisions")].mean()),
        "makespan": float(makespans.mean()),
    }


#: heading -> how a figure is told
COLUMNS: dict[str, Callable[[dict[str, Any]], str]] = {
    "robots": lambda one: f"{one['robots']}",
    "tasks": lambda one: f"{one['tasks']}",
    "kernel/s": lambda one: f"{one['missions_per_second']:,.0f}",
    "goal": lambda one: f"{one['goal']:,}",
    "generation": lambda one: f"+{one['generation_share']:.0%}",
    "two threads": lambda one: f"{one['two_threads_gain']:.2f} x",
    "simulator/s": lambda one: f"{one['simulator_missions_per_second']:.1f}",
    "kernel is": lambda one: f"{one['gain_over_simulator']:,.0f} x",
    "plain loop/s": lambda one: f"{one['plain_loop_missions_per_second']:.1f}",
    "kernel is ": lambda one: f"{one['gain_over_plain_loop']:,.0f} x",
    "decisions": lambda one: f"{one['decisions_per_mission']:.0f}",
    "makespan": lambda one: f"{one['makespan']:.0f} s",
}


def compile_time() -> float:
    """CPU time of a process's first mission, nearly all of which is compiling, in seconds."""
    scenario = Scenario(robots=2, tasks=1, coverage=2)
    missions = draw_missions(scenario, 1)
    rules = rules_of(mission_of(scenario, Parameters(), missions, 0)[0])
    return best(lambda: run_missions(rules, missions), 1, time.process_time)


def main() -> None:
    """Run from the command line."""
    arguments = options(__doc__)
    arguments.add_argument(
        "--runs", type=int, help="runs of each size (default 10; with --quick 2); a third as many of the simulator"
    )
    chosen = arguments.parse_args()
    compiling = compile_time()
    shapes, runs = (QUICK, 2) if chosen.quick else (SHAPES, 10)
    publish(
        "Missions a second, coverage 3",
        COLUMNS,
        [{**row(*shape, chosen.runs or runs), "compile_seconds": compiling} for shape in shapes],
        path=chosen.json,
        notes=[f"Compiling took {compiling:.1f} s."],
        packages=["numba"],
    )


if __name__ == "__main__":
    main()
