"""Random missions of the study, each run by the exact simulator and by the kernel, and where the two differ first."""

import math
import random
from collections.abc import Sequence
from typing import Any, NamedTuple

from lalliance_agents.model.parameters import Erratum, Parameters
from lalliance_study.kernel import run_logged
from lalliance_study.kernel_state import CAUSES, rules_of
from lalliance_study.scenarios import Missions, Scenario, draw_missions, mission_of
from lalliance_study.simulator import Simulator

#: Two instants that differ by less than this are the same, in seconds.
SAME = 1e-9

#: Missions that do not complete are given up after this many seconds, as the simulator needs time for them.
LONGEST = 600.0

LITERAL = sorted(set(Erratum) - {Erratum.STRATEGY_ONE, Erratum.SECOND_PATIENCE})


class Event(NamedTuple):
    """One decision of a robot, or the completion of a task."""

    at: float
    who: str
    what: str
    task: str
    why: str


def draw_point(seed: int, **fixed: Any) -> tuple[Scenario, Parameters]:
    """A scenario and parameters; `fixed` are fields of either that are not drawn."""
    chance = random.Random(seed)
    robots = chance.randint(2, 8)
    scenario: dict[str, Any] = {
        "robots": robots,
        "tasks": chance.randint(1, 14),
        "coverage": chance.randint(1, min(4, robots)),
        "heterogeneity": chance.choice([0.0, 100.0, 400.0, 3200.0]),
        "spread": chance.choice(["unrelated", "related", "log_uniform"]),
        "hand_over": chance.choice(["shared_max", "shared_add", "restart"]),
        "failures": chance.choice([0, 0, 0.3, 0.8]),
        "traps": chance.choice([0, 0, 0.2, 0.6]),
        "noise": chance.choice([0, 0.1, 0.3]),
        "samples": chance.choice([10, 10, 3, 0]),
        "training": chance.choice([0, 0, 0, 1, 3]),
    }
    readings = dict.fromkeys(chance.sample(LITERAL, chance.choice([0, 0, 0, 1, 2])), "literal")
    if chance.random() < 0.2:
        readings[Erratum.SECOND_PATIENCE] = "mended"
    parameters: dict[str, Any] = {
        "strategy": chance.choice(["I", "II", "III"]),
        "ordering": chance.choice(["derived", "modified_shortest_first", "modified_random", "longest_first"]),
        "architecture": chance.choice([*["l-alliance"] * 4, "alliance"]),
        "trials": chance.choice([10, 10, 3]),
        "broadcast_rate": chance.choice([5.0, 5.0, 3.0, 10.0]),
        "readings": readings,
    }
    for field, value in fixed.items():
        (scenario if field in Scenario.model_fields else parameters)[field] = value
    made = Scenario.model_validate(scenario)
    cap = made.cap * min(1.0, LONGEST / made.deadline)
    return made.model_copy(update={"cap": cap}), Parameters.model_validate(parameters)


def simulated(scenario: Scenario, parameters: Parameters, missions: Missions, number: int) -> list[Event]:
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
    return _with_ends(events, ends, summary["makespan"])


def compiled(scenario: Scenario, parameters: Parameters, missions: Missions, number: int) -> list[Event]:
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
    return _with_ends(events, completed, None if math.isnan(result[0]) else float(result[0]))


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
        found = first_difference(
            simulated(scenario, parameters, drawn, number), compiled(scenario, parameters, drawn, number)
        )
        if found is not None:
            return f"seed {seed}, mission {number}, {scenario!r}, {parameters.model_dump(exclude_unset=True)}: {found}"
    return None
