"""One mission file simulated many times, each time with the next seed, and what the runs have in common."""

from collections import Counter
from collections.abc import Iterable, Sequence
from statistics import fmean, median
from typing import Any, NamedTuple

from lalliance_agents.config import Mission
from lalliance_study.simulator import Simulator


class Run(NamedTuple):
    """What is kept of one run."""

    seed: int
    makespan: float | None
    """In seconds of mission time; None if the mission did not complete."""
    takeovers: tuple[tuple[str, int], ...]
    """By cause, how many."""
    fired: tuple[bool, ...]
    """Of each fault of the mission, whether it did."""
    simulated: float
    """Seconds of mission time."""


def simulate_seeds(mission: Mission, seeds: Iterable[int]) -> list[Run]:
    """Run `mission` once with each of `seeds`."""
    return [_run(mission.model_copy(update={"seed": seed})) for seed in seeds]


def _run(mission: Mission) -> Run:
    simulator = Simulator(mission)
    summary = simulator.run()
    return Run(
        mission.seed,
        summary["makespan"],
        tuple(sorted(Counter(one["cause"] for one in summary["takeovers"]).items())),
        tuple(one["fired"] for one in summary["faults"]),
        simulator.now,
    )


def overview(mission: Mission, runs: Sequence[Run]) -> dict[str, Any]:
    """What several runs of `mission` have in common, as plain data."""
    makespans = sorted(run.makespan for run in runs if run.makespan is not None)
    takeovers: Counter[str] = Counter()
    for run in runs:
        takeovers.update(dict(run.takeovers))
    return {
        "mission": mission.name,
        "seeds": [runs[0].seed, runs[-1].seed],
        "complete": len(makespans) == len(runs),
        "completed": len(makespans),
        "makespan": _spread(makespans) if makespans else None,
        "takeovers": dict(sorted(takeovers.items())),
        "faults": [sum(run.fired[index] for run in runs) for index in range(len(mission.faults))],
        "runs": [run._asdict() | {"takeovers": dict(run.takeovers)} for run in runs],
    }


def _spread(ordered: Sequence[float]) -> dict[str, float]:
    return {"min": ordered[0], "median": median(ordered), "mean": fmean(ordered), "max": ordered[-1]}
