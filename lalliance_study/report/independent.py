"""What an independent run of the same study had found, beside what these rows say of it."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from lalliance_study.report import statistics
from lalliance_study.report.claims import ratio_of
from lalliance_study.report.optima import DERIVED
from lalliance_study.report.results import Measured, Results
from lalliance_study.report.statistics import Estimate
from lalliance_study.scenarios import Scenario

#: Numbers agree if they differ by less than this share of theirs.
ALIKE = 0.10


class Known(NamedTuple):
    """A number of the independent run and ours."""

    what: str
    theirs: float
    ours: Estimate | None
    """None: not in these results."""

    @property
    def agrees(self) -> bool | None:
        """Whether the two are alike; None: nobody can say."""
        if self.ours is None:
            return None
        return abs(self.ours.value - self.theirs) <= ALIKE * self.theirs


def known(results: Results) -> list[Known]:
    """All of them that are numbers."""
    return [
        *_strategies(results),
        *_orderings(results),
        *_optima(results),
        *_growth(results),
    ]


def _ratio(found: Sequence[Measured], first: str, second: str) -> Estimate | None:
    return ratio_of([one.compare(first, second) for one in found])


def _strategies(results: Results) -> list[Known]:
    def at(heterogeneity: float) -> Callable[[Scenario], bool]:
        return lambda one: (one.hand_over, one.traps, one.heterogeneity) == ("shared_max", 0, heterogeneity)

    return [
        Known(
            f"III / II at {heterogeneity:g} %, shared_max, shortest first, PWW true",
            theirs,
            _ratio(results.of("strategies", at(heterogeneity)), "III/shortest_first", "II/shortest_first"),
        )
        for heterogeneity, theirs in ((100, 1.15), (800, 2.5), (3200, 7.0))
    ]


def _orderings(results: Results) -> list[Known]:
    def at(spread: str) -> Callable[[Scenario], bool]:
        return lambda one: one.spread == spread and one.heterogeneity == 800 and one.failures > 0

    found = [
        Known(
            f"longest / shortest first at 800 %, {spread} times, robots die, strategy II",
            theirs,
            _ratio(results.of("orderings", at(spread)), "II/longest_first", "II/shortest_first"),
        )
        for spread, theirs in (("unrelated", 4.0), ("related", 1.0))
    ]
    plain = results.of("orderings", lambda one: one.spread == "unrelated" and not one.failures and not one.traps)
    gain = _ratio(plain, "II/derived", "II/shortest_first")
    return [*found, Known("derived / shortest first, strategy II, unrelated times, nothing befalls", 0.95, gain)]


def _optima(results: Results) -> list[Known]:
    found = []
    for rule, mean, most in (("shared_max", 1.053, 1.28), ("restart", 1.108, 1.61)):
        own = [one for one in results.of("optimum") if one.scenario.hand_over == rule]
        all_alike = [one for one in own if one.scenario.coverage >= one.scenario.robots]
        for told, some in ((rule, own), (f"{rule}, where every robot can do every task", all_alike)):
            samples = _samples(some)
            farthest = Estimate(float(np.concatenate(samples).max()), np.nan, np.nan) if samples else None
            found.append(Known(f"mean ratio to the optimum, {told}", mean, _mean(samples)))
            found.append(Known(f"largest ratio to the optimum, {told}", most, farthest))
    return found


def _growth(results: Results) -> list[Known]:
    found = []
    for rule, theirs in (("shared_max", 1.31), ("restart", 1.72)):
        samples = _samples([one for one in results.of("growth", _largest) if one.scenario.hand_over == rule])
        found.append(Known(f"mean ratio to the optimum at (20, 40, 4), 100 %, {rule}", theirs, _mean(samples)))
    return found


def _largest(one: Scenario) -> bool:
    return (one.robots, one.tasks, one.coverage, one.heterogeneity) == (20, 40, 4, 100)


def _mean(samples: Sequence[statistics.Floats]) -> Estimate | None:
    return statistics.pooled_mean(samples) if samples else None


def _samples(found: Sequence[Measured]) -> list[statistics.Floats]:
    return [ratios for one in found if len(ratios := one.ratios(DERIVED))]
