"""A study whose missions were never run, with makespans that a test makes up."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import polars as pl

from lalliance_study.experiments import rows
from lalliance_study.experiments.contenders import SHORT, Contender
from lalliance_study.experiments.manifest import Manifest
from lalliance_study.experiments.plan import Numbered, Part, parts
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
    optimum = chance.uniform(80, 120, part.last - part.first)
    who = [(one, contender) for one in part.scenarios for contender in part.experiment.contenders]
    makespan = np.concatenate(
        [_makespans(chance, factor(one.scenario, contender.name), optimum) for one, contender in who]
    )
    every = np.tile(optimum, len(who))
    shared = np.repeat([one.scenario.hand_over != "restart" for one, _ in who], len(optimum))

    def each(told: Callable[[Numbered, Contender], object]) -> pl.Series:
        return pl.Series([told(*pair) for pair in who]).repeat_by(len(optimum)).explode()

    return (
        pl.DataFrame(
            {
                "experiment": part.experiment.name,
                "scenario": each(lambda one, _: one.number),
                "mission": np.tile(np.arange(part.first, part.last), len(who)),
                "seed": part.seed,
                "contender": each(lambda _, contender: contender.name),
                "kind": each(lambda _, contender: contender.kind),
                "strategy": each(lambda _, contender: contender.strategy),
                "ordering": each(lambda _, contender: contender.ordering),
                "variant": each(lambda _, contender: contender.variant),
                "makespan": makespan,
                "optimum": every,
                "bound": every if proven else 0.9 * every,
                "proven": proven,
                "shared_optimum": np.where(shared, 0.9 * every, np.nan),
                "ratio": makespan / every,
                "reallocations": 0,
                "activations": 1,
                "messages": 1,
                "unfinished": np.isnan(makespan),
            }
        )
        .cast(dict(rows.SCHEMA))
        .fill_nan(None)
    )
