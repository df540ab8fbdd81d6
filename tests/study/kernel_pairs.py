"""Random missions of the study, each run by the exact simulator and by the kernel, and where the two differ first.

    PYTHONPATH=tests python -m study.kernel_pairs --missions 5000

runs as many as one likes, over everything that the kernel accepts, and counts what was among them.
"""

import argparse
import math
import random
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from rich.console import Console
from rich.progress import track

from lalliance_agents.model.parameters import Erratum, Parameters
from lalliance_study.kernel import RESULTS, run_logged
from lalliance_study.kernel_state import CAUSES, rules_of
from lalliance_study.scenarios import Missions, Scenario, draw_missions, mission_of
from lalliance_study.simulator import Simulator

#: Two instants that differ by less than this are the same, in seconds.
SAME = 1e-9

#: Missions that do not complete are given up after this many seconds, as the simulator needs time for them.
LONGEST = 150.0

LITERAL = sorted(set(Erratum) - {Erratum.STRATEGY_ONE, Erratum.SECOND_PATIENCE})


class Event(NamedTuple):
    """One decision of a robot, or the completion of a task."""

    at: float
    who: str
    what: str
    task: str
    why: str


class Told(NamedTuple):
    """What one of the two says of a mission."""

    log: list[Event]
    sent: int
    """Announcements; the kernel's end when the world finds the mission over, the simulator's when the robots hear of it."""


def draw_parameters(chance: random.Random) -> dict[str, Any]:
    """Parameters: the numbers are those of the defaults, or others that a study of their effects would try."""
    rate = chance.choice([5.0, 5.0, 2.0, 3.0, 10.0])
    shortest, longest = chance.choice([(0.2, 1.0), (0.2, 1.0), (0.1, 0.5), (1.0, 6.0), (0.7, 0.7)])
    found: dict[str, Any] = {
        "strategy": chance.choice(["I", "II", "III"]),
        "ordering": chance.choice(["derived", "modified_shortest_first", "modified_random", "longest_first"]),
        "architecture": chance.choice([*["l-alliance"] * 5, "alliance"]),
        "trials": chance.choice([10, 10, 3, 1]),
        "broadcast_rate": rate,
        "silence_timeout": chance.choice([tau for tau in (1.0, 1.0, 0.7, 2.5) if tau > 2 / rate] or [1.5]),
        "min_delay": shortest,
        "max_delay": longest,
        "threshold": chance.choice([1.0, 1.0, 0.3, 4.0]),
        "boredom_threshold": chance.choice([1.0, 2.0]),
        "give_up_factor": chance.choice([2.0, 2.0, 0.7, 5.0]),
        "failure_factor": chance.choice([2.0, 2.0, 1.2]),
        "initial_task_time": chance.choice([30.0, 4.0]),
        "readings": draw_readings(chance),
    }
    if chance.random() < 0.2:
        found["boredom_rate"] = found["boredom_threshold"] / chance.uniform(1.05 * longest, 40.0)
    if chance.random() < 0.2:
        found["collision_window"] = chance.choice([0.0, 0.05, 1.5])
    if found["architecture"] == "alliance":
        found["by_hand"] = {
            "patience": chance.uniform(1, 40),
            "slow_rate": chance.uniform(0.01, 0.5),
            "fast_rate": chance.uniform(0.3, 3),
            "yield_time": chance.uniform(1, 40),
            "give_up_time": chance.uniform(5, 80),
        }
    if found["strategy"] != "I" and chance.random() < 0.2:
        found["readings"][Erratum.STRATEGY_ONE] = "literal"
    return found


def draw_readings(chance: random.Random) -> dict[Erratum, str]:
    """Often none; now and then all at once, as the Appendix has it."""
    count = chance.choice([0, 0, 0, 1, 1, 2, 3, len(LITERAL)])
    readings = dict.fromkeys(chance.sample(LITERAL, count), "literal")
    if chance.random() < 0.2:
        readings[Erratum.SECOND_PATIENCE] = "mended"
    return readings


def draw_point(seed: int, **fixed: Any) -> tuple[Scenario, Parameters]:
    """A scenario and parameters; `fixed` are fields of either that are not drawn."""
    chance = random.Random(seed)
    robots = chance.randint(2, 6)
    scenario: dict[str, Any] = {
        "robots": robots,
        "tasks": chance.randint(1, 8),
        "coverage": chance.randint(1, min(4, robots)),
        "heterogeneity": chance.choice([0.0, 100.0, 400.0, 3200.0]),
        "spread": chance.choice(["unrelated", "related", "log_uniform"]),
        "hand_over": chance.choice(["shared_max", "shared_add", "restart"]),
        "failures": chance.choice([0, 0, 0.3, 0.8]),
        "traps": chance.choice([0, 0, 0.2, 0.6]),
        "noise": chance.choice([0, 0.1, 0.3]),
        "samples": chance.choice([10, 10, 10, 3, 0]),
        "training": chance.choice([0, 0, 0, 0, 1, 2]),
    }
    parameters = draw_parameters(chance)
    for field, value in fixed.items():
        (scenario if field in Scenario.model_fields else parameters)[field] = value
    made = Scenario.model_validate(scenario)
    cap = made.cap * min(1.0, LONGEST / made.deadline)
    return made.model_copy(update={"cap": cap}), Parameters.model_validate(parameters)


def simulated(scenario: Scenario, parameters: Parameters, missions: Missions, number: int) -> Told:
    """What the exact simulator makes of a mission, with the makespan at the end."""
    mission, circumstances = mission_of(scenario, parameters, missions, number)
    simulator = Simulator(mission, circumstances=circumstances)
    summary = simulator.run()
    names = mission.robots.keys()
    events = [
        Event(line.at, line.who, line.what, line.task or "", line.why)
        for line in simulator.log
        if line.who in names and line.why in CAUSES
    ]
    ends = {task: one["completed_at"] for task, one in summary["tasks"].items()}
    return Told(_with_ends(events, ends, summary["makespan"]), summary["messages"]["sent"])


def compiled(scenario: Scenario, parameters: Parameters, missions: Missions, number: int) -> Told:
    """The same from the kernel."""
    mission, _ = mission_of(scenario, parameters, missions, number)
    result, log, ends = run_logged(rules_of(mission), missions, number)
    events = [
        Event(
            float(line["at"]),
            f"r{int(line['robot']):02}",
            CAUSES[int(line["cause"])].verb,
            f"t{int(line['task']):02}",
            CAUSES[int(line["cause"])],
        )
        for line in log
    ]
    completed = {f"t{task:02}": None if math.isnan(end) else float(end) for task, end in enumerate(ends)}
    makespan = None if math.isnan(result[0]) else float(result[0])
    return Told(_with_ends(events, completed, makespan), int(result[RESULTS.index("sent")]))


def _with_ends(events: list[Event], ends: dict[str, float | None], makespan: float | None) -> list[Event]:
    completions = [
        Event(math.inf if end is None else end, "world", "ends", task, "") for task, end in sorted(ends.items())
    ]
    return [*events, *completions, Event(math.inf if makespan is None else makespan, "world", "makespan", "", "")]


def first_difference(one: Sequence[Event], other: Sequence[Event]) -> str | None:
    """Where two logs part, in words; None if they are the same."""
    for index in range(max(len(one), len(other))):
        pair = [log[index] if index < len(log) else None for log in (one, other)]
        first, second = pair
        if first is None or second is None or first[1:] != second[1:] or not _same(first.at, second.at):
            return f"event {index}: the simulator says {first}, the kernel {second}"
    return None


def _same(one: float, other: float) -> bool:
    return one == other or abs(one - other) < SAME


def difference(seed: int, *, missions: int = 2, **fixed: Any) -> str | None:
    """The first difference in a few missions of a random scenario; None if there is none."""
    scenario, parameters = draw_point(seed, **fixed)
    drawn = draw_missions(scenario, missions, seed=seed)
    for number in range(missions):
        exact, quick = (way(scenario, parameters, drawn, number) for way in (simulated, compiled))
        found = first_difference(exact.log, quick.log)
        # The kernel counts those of the live trial alone.
        if found is None and not scenario.training and abs(exact.sent - quick.sent) > scenario.robots:
            found = f"the simulator's robots announce {exact.sent} times, the kernel's {quick.sent}"
        if found is not None:
            return f"seed {seed}, mission {number}, {scenario!r}, {parameters.model_dump(exclude_unset=True)}: {found}"
    return None


def groups(scenario: Scenario, parameters: Parameters) -> Iterator[str]:
    """What is tested by a mission."""
    yield f"strategy {parameters.strategy.name}"
    yield f"ordering {parameters.ordering.name.lower()}"
    yield f"architecture {parameters.architecture.value}"
    yield f"hand-over {scenario.hand_over}"
    yield "robots die" if scenario.failures else "no robot dies"
    yield "PWW false" if scenario.traps else "PWW true"
    yield "after active learning" if scenario.training else "live from the start"
    yield "knowledge none" if scenario.samples == 0 else f"knowledge given, noise {scenario.noise:g}"
    literal = [one for one in Erratum if parameters.is_literal(one) and one is not Erratum.SECOND_PATIENCE]
    yield "errata all mended" if not literal else f"errata {len(literal) if len(literal) < 5 else 'all'} literal"
    yield from (f"literal {one.value}" for one in literal)
    if not parameters.is_literal(Erratum.SECOND_PATIENCE):
        yield f"mended {Erratum.SECOND_PATIENCE.value}"


def main() -> int:
    """Compare missions; 1 if any differ."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--missions", type=int, default=5000, help="at least so many, two of each point")
    arguments.add_argument("--seed", type=int, default=0, help="the first of the seeds, one for each point")
    chosen = arguments.parse_args()
    counts: Counter[str] = Counter()
    differences, console = [], Console(highlight=False)
    for seed in track(range(chosen.seed, chosen.seed + (chosen.missions + 1) // 2), "Comparing", console=console):
        counts.update(dict.fromkeys(["missions", *groups(*draw_point(seed))], 2))
        found = difference(seed)
        if found is not None:
            differences.append(found)
            console.print(found, markup=False)
    for group, count in sorted(counts.items()):
        console.print(f"{count:6} {group}")
    console.print(f"{len(differences)} points differ")
    return 1 if differences else 0


if __name__ == "__main__":
    raise SystemExit(main())
