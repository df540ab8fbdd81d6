"""A study whose missions were never run, with makespans that a test makes up."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import polars as pl

from lalliance_study.experiments import rows
from lalliance_study.experiments.contenders import SHORT
from lalliance_study.experiments.manifest import Manifest
from lalliance_study.experiments.plan import Part, parts
from lalliance_study.experiments.presets import preset
from lalliance_study.report.results import Measured
from lalliance_study.report.statistics import Floats
from lalliance_study.scenarios import Scenario

#: What a makespan is made of: a contender's factor in a scenario; not a number where it finishes nothing.
Factor = Callable[[Scenario, str], float]


#: Who takes part where no study says so.
CONTENDERS = tuple(f"{strategy}/{ordering}" for strategy in ("I", "II", "III") for ordering in SHORT.values())


def measured(
    scenarios: Sequence[Scenario], factor: Factor, *, missions: int = 24, proven: bool = True
) -> list[Measured]:
    """What was measured in some scenarios, each with missions of its own; the rest is as in `make_up`."""
    found = []
    for number, scenario in enumerate(scenarios):
        chance = np.random.default_rng(number)
        optimum = chance.uniform(80, 120, missions)
        times = {name: _makespans(chance, factor(scenario, name), optimum) for name in CONTENDERS}
        bound = optimum if proven else 0.9 * optimum
        found.append(
            Measured(number, number, scenario, times, optimum, bound, np.full(missions, proven), 0.9 * optimum)
        )
    return found


def _makespans(chance: np.random.Generator, factor: float, optimum: Floats) -> Floats:
    return factor * optimum * chance.lognormal(0, 0.005, len(optimum))


def make_up(
    out: Path,
    factor: Factor,
    *,
    missions: int = 24,
    only: tuple[str, ...] = (),
    name: str = "mini",
    proven: bool = True,
) -> Path:
    """Write a study into a folder.

    Args:
        out: the folder.
        factor: makespans are this many times a mission's own 100 s or so.
        missions: of each scenario.
        only: experiments that have rows; none: all.
        name: of the preset.
        proven: whether its optima are.
    """
    planned = preset(name)
    (out / rows.FOLDER).mkdir(parents=True)
    Manifest.of(planned, missions, 0).write(out)
    for part in parts(planned.experiments, missions, 0):
        if not only or part.experiment.name in only:
            rows.write(out, part.name, _rows(part, factor, proven=proven))
    return out


def _rows(part: Part, factor: Factor, *, proven: bool) -> pl.DataFrame:
    first = part.scenarios[0]
    chance = np.random.default_rng([part.seed, first.draws, part.first])
    count = part.last - part.first
    optimum = chance.uniform(80, 120, count)
    found = []
    for one in part.scenarios:
        for contender in part.experiment.contenders:
            makespan = _makespans(chance, factor(one.scenario, contender.name), optimum)
            found.append(
                pl.DataFrame(
                    {
                        "experiment": one.experiment,
                        "scenario": one.number,
                        "mission": np.arange(part.first, part.last),
                        "seed": part.seed,
                        "contender": contender.name,
                        "kind": contender.kind,
                        "strategy": contender.strategy,
                        "ordering": contender.ordering,
                        "variant": contender.variant,
                        "makespan": pl.Series(makespan).fill_nan(None),
                        "optimum": optimum,
                        "bound": optimum if proven else 0.9 * optimum,
                        "proven": proven,
                        "shared_optimum": 0.9 * optimum if one.scenario.hand_over != "restart" else None,
                        "ratio": pl.Series(makespan / optimum).fill_nan(None),
                        "reallocations": 0,
                        "activations": 1,
                        "messages": 1,
                        "unfinished": np.isnan(makespan),
                    }
                ).cast(dict(rows.SCHEMA))
            )
    return pl.concat(found)
