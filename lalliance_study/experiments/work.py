"""Carries out one part of a study: missions, their optima, and every contender, as rows.

The same part gives the same rows on any machine, however busy it is.
"""

import math
from typing import Any

import numpy as np
import polars as pl

from lalliance_study.assignments import Floats
from lalliance_study.experiments.contenders import Contender
from lalliance_study.experiments.engines import Account, Planners, of_minds
from lalliance_study.experiments.plan import Numbered, Part
from lalliance_study.experiments.rows import ORDER, SCHEMA
from lalliance_study.experiments.yardsticks import Optima, shared_makespans, times_of
from lalliance_study.scenarios import Missions, draw_missions


def carry_out(part: Part) -> pl.DataFrame:
    """The rows of a part."""
    work = _Work(part)
    found = [work.rows(one, contender) for one in part.scenarios for contender in part.experiment.contenders]
    return pl.concat(found).sort(ORDER)


class _Work:
    """What the contenders of a part have in common.

    Args:
        part: the part.
    """

    def __init__(self, part: Part) -> None:
        self._part = part
        self._missions = {one.number: self._draw(one) for one in part.scenarios}
        first = part.scenarios[0]
        times = times_of(self._missions[first.number], first.scenario.robots)
        wanted = part.experiment.yardsticks
        optima = Optima(math.inf if wanted is None else wanted.work_limit)
        self._planners = Planners(times, optima)
        found = [] if wanted is None else [optima(one) for one in times]
        self._optimum = _column([one.makespan for one in found], len(times))
        self._bound = _column([one.lower for one in found], len(times))
        self._proven: list[bool] | None = [one.proven for one in found] or None
        hand_overs = sorted({one.scenario.hand_over for one in part.scenarios}) if wanted and wanted.shared else []
        self._shared = {rule: shared_makespans(times, rule) for rule in hand_overs}

    def _draw(self, one: Numbered) -> Missions:
        drawn = draw_missions(one.scenario, self._part.last, seed=self._part.seed, number=one.draws)
        return Missions._make(np.ascontiguousarray(field[self._part.first :]) for field in drawn)

    def _account(self, one: Numbered, contender: Contender) -> Account:
        missions = self._missions[one.number]
        if contender.parameters is None:
            return self._planners.account(contender.name, one.scenario, missions)
        return of_minds(one.scenario, contender.parameters, missions)

    def rows(self, one: Numbered, contender: Contender) -> pl.DataFrame:
        """Those of a contender in a scenario."""
        account, count = self._account(one, contender), len(self._optimum)
        columns: dict[str, Any] = {
            "experiment": one.experiment,
            "scenario": one.number,
            "mission": np.arange(self._part.first, self._part.last),
            "seed": self._part.seed,
            "contender": contender.name,
            "kind": contender.kind,
            "strategy": contender.strategy,
            "ordering": contender.ordering,
            "variant": contender.variant,
            "makespan": account.makespan,
            "optimum": self._optimum,
            "bound": self._bound,
            "proven": self._proven,
            "shared_optimum": self._shared.get(one.scenario.hand_over, _column([], count)),
            "ratio": account.makespan / self._optimum,
            "reallocations": account.reallocations,
            "activations": account.activations,
            "messages": account.messages,
            "unfinished": np.isnan(account.makespan),
        }
        series = [
            _series(name, kind, value if isinstance(value, np.ndarray | list) else [value] * count)
            for (name, kind), value in zip(SCHEMA.items(), columns.values(), strict=True)
        ]
        return pl.DataFrame(series)


def _column(found: list[float], count: int) -> Floats:
    return np.array(found, dtype=np.float64) if found else np.full(count, np.nan)


def _series(name: str, kind: pl.DataType, values: Any) -> pl.Series:
    """A column; what is not a number is null."""
    series = pl.Series(name, values, dtype=None if isinstance(values, np.ndarray) else kind)
    return (series.fill_nan(None) if series.dtype.is_float() else series).cast(kind)
