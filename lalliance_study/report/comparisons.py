"""Two contenders on the same missions of a scenario: who is better, and how sure that is.

A mission that is not finished by its deadline has no makespan. Giving it one would let the deadline, which is ours, decide the
comparison; leaving it out would praise whoever fails at the hard missions. So finishing comes first: who finishes significantly
more missions is better. Where that decides nothing, makespans are compared on the missions that both finish. All others are
counted and shown.
"""

from collections.abc import Iterable, Sequence
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from lalliance_study.report import statistics
from lalliance_study.report.statistics import CONFIDENCE, Floats, LogRatio
from lalliance_study.scenarios import Scenario

#: Ratios nearer to 1 than this count as equal.
MARGIN = 0.01


class Outcome(StrEnum):
    """What a comparison says of the first contender."""

    BETTER = "better"
    WORSE = "worse"
    EQUAL = "equal"
    UNDECIDED = "undecided"


class Comparison(NamedTuple):
    """The first contender against the second, in one scenario."""

    number: int
    draws: int
    """Scenarios of the same draws have the same missions."""
    scenario: Scenario
    both: int
    """Missions that both finished."""
    only_first: int
    only_second: int
    neither: int
    ratio: LogRatio | None
    """Mean makespan of the first over that of the second, where both finished; None if they never did."""

    @property
    def missions(self) -> int:
        """How many missions there were."""
        return self.both + self.only_first + self.only_second + self.neither

    @property
    def timed(self) -> bool:
        """Whether enough missions were finished by both to compare scenarios by time: half of them, and two."""
        return self.ratio is not None and self.both >= max(2, self.missions / 2)

    def not_better(self, confidence: float = CONFIDENCE) -> bool:
        """Whether the first is surely not better than the second by more than the margin."""
        if self.outcome(confidence) is Outcome.WORSE:
            return True
        evenly = statistics.discordance(self.only_first, self.only_second) >= 1 - confidence
        return evenly and self.ratio is not None and self.ratio.ratio(confidence).low > 1 - MARGIN

    def outcome(self, confidence: float = CONFIDENCE) -> Outcome:
        """Who is better: by finishing if that is uneven, else by time, if the interval lies beyond the margin."""
        if statistics.discordance(self.only_first, self.only_second) < 1 - confidence:
            return Outcome.BETTER if self.only_first > self.only_second else Outcome.WORSE
        if self.ratio is None:
            return Outcome.UNDECIDED
        _, low, high = self.ratio.ratio(confidence)
        if high < 1 - MARGIN:
            return Outcome.BETTER
        if low > 1 + MARGIN:
            return Outcome.WORSE
        return Outcome.EQUAL if low > 1 - MARGIN and high < 1 + MARGIN else Outcome.UNDECIDED


def compare(number: int, draws: int, scenario: Scenario, first: Floats, second: Floats) -> Comparison:
    """Compare makespans of common missions, `[missions]` in seconds; not a number where a mission was not finished."""
    done, other = np.isfinite(first), np.isfinite(second)
    both = done & other
    return Comparison(
        number,
        draws,
        scenario,
        both=int(both.sum()),
        only_first=int((done & ~other).sum()),
        only_second=int((~done & other).sum()),
        neither=int((~done & ~other).sum()),
        ratio=statistics.log_ratio(first[both], second[both]) if both.any() else None,
    )


def strict(comparisons: Sequence[Comparison]) -> float:
    """The confidence of each of several comparisons with which all of them hold together (Bonferroni)."""
    return 1 - (1 - CONFIDENCE) / max(1, len(comparisons))


def count(comparisons: Iterable[Comparison], wanted: Outcome, confidence: float = CONFIDENCE) -> int:
    """How many comparisons come out so."""
    return sum(one.outcome(confidence) is wanted for one in comparisons)


def pooled(comparisons: Iterable[Comparison]) -> LogRatio | None:
    """The geometric mean of the ratios of those scenarios that can be compared by time; None if there are none."""
    draws: dict[int, list[LogRatio]] = {}
    for one in comparisons:
        if one.ratio is not None and one.timed:
            draws.setdefault(one.draws, []).append(one.ratio)
    return statistics.pooled(list(draws.values())) if draws else None
