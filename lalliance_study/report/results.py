"""What the study measured, as the report uses it: per scenario the makespans of all contenders on the same missions."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lalliance_agents.errors import UserError
from lalliance_study.experiments.manifest import FILE, Asked, Manifest
from lalliance_study.experiments.plan import parts
from lalliance_study.experiments.presets import preset
from lalliance_study.experiments.rows import kept, read
from lalliance_study.report.comparisons import Comparison, compare
from lalliance_study.report.statistics import Floats
from lalliance_study.scenarios import Scenario

#: With fewer missions a scenario no verdict is given.
FEWEST = 20
#: Columns of times that are read, in seconds.
FLOATS = ("makespan", "optimum", "bound", "shared_optimum")


@dataclass(frozen=True, slots=True)
class Measured:
    """One scenario and what came of it. Arrays are `[missions]`, times in seconds, not a number where there is none."""

    number: int
    draws: int
    """Scenarios of the same draws have the same missions."""
    scenario: Scenario
    times: Mapping[str, Floats]
    """Makespans, by contender; not a number where a mission was not finished."""
    optimum: Floats
    """HRASP's, or the best schedule known."""
    bound: Floats
    """What is proven that no schedule is shorter than."""
    proven: NDArray[np.bool_]
    """Whether these two are the same."""
    shared: Floats
    """The optimum where the work left belongs to the task."""

    @property
    def missions(self) -> int:
        """How many."""
        return len(self.optimum)

    def compare(self, first: str, second: str) -> Comparison:
        """Two contenders on these missions."""
        return compare(self.number, self.draws, self.scenario, self.times[first], self.times[second])

    def ratios(self, contender: str, yardstick: Floats | None = None) -> Floats:
        """A contender's makespans over the optimum, or another yardstick, of those missions that it finished."""
        found = self.times[contender] / (self.optimum if yardstick is None else yardstick)
        return found[np.isfinite(found)]


class Results:
    """The results of a study in a folder, read an experiment at a time.

    Attributes:
        folder: where they are.
        manifest: what the study consists of.
        parts: of how many parts it consists.
        missing: how many of them are not there yet.
    """

    def __init__(self, folder: Path) -> None:
        """Look at what is there.

        Raises:
            UserError: it is no study, or one of another version.
        """
        self.folder = folder
        self.manifest = Manifest.read(folder)
        ours = version("lalliance")
        if self.manifest.lalliance != ours:
            raise UserError(
                f"{folder / FILE}: results of lalliance {self.manifest.lalliance}; expected lalliance {ours}"
            )
        asked = preset(self.manifest.preset)
        same = Manifest.of(asked, self.manifest.missions, self.manifest.seed)
        if (self.manifest.experiments, self.manifest.scenarios) != (same.experiments, same.scenarios):
            raise UserError(
                f"{folder / FILE}: other experiments than preset {asked.name} has in this version; "
                "expected results of this version"
            )
        planned = {part.name for part in parts(asked.experiments, self.manifest.missions, self.manifest.seed)}
        self.parts, self.missing = len(planned), len(planned - kept(folder))
        self._read: dict[str, list[Measured]] = {}

    @cached_property
    def asked(self) -> dict[str, Asked]:
        """The experiments of the study, by name."""
        return {one.name: one for one in self.manifest.experiments}

    def of(self, experiment: str, wanted: Callable[[Scenario], bool] = lambda _: True) -> list[Measured]:
        """What was measured in those scenarios of an experiment that are wanted; none if it is no part of the study.

        Raises:
            UserError: rows that cannot be read.
        """
        if experiment not in self._read:
            self._read[experiment] = list(self._measured(experiment)) if experiment in self.asked else []
        return [one for one in self._read[experiment] if wanted(one.scenario)]

    def _measured(self, experiment: str) -> Iterator[Measured]:
        rows = read(self.folder, [experiment])
        numbers = rows["scenario"].to_numpy()
        columns = {name: rows[name].fill_null(np.nan).to_numpy() for name in FLOATS}
        who, missions = rows["contender"].to_numpy(), rows["mission"].to_numpy()
        proven = rows["proven"].fill_null(value=False).to_numpy().astype(np.bool_)
        names = sorted(one.name for one in self.asked[experiment].contenders)
        planned = {one.number: one for one in self.manifest.scenarios}
        for block in np.split(np.arange(len(numbers)), np.flatnonzero(np.diff(numbers)) + 1):
            if not len(block):
                continue
            one = planned[int(numbers[block[0]])]
            count = len(block) // len(names)
            first = block[:count]
            if len(block) != count * len(names) or not (
                (who[block] == np.repeat(names, count)).all()
                and (missions[block].reshape(len(names), count) == missions[first]).all()
            ):
                raise UserError(
                    f"{self.folder}: scenario {one.number} of {experiment} has not the same missions for all contenders; "
                    "expected what lalliance study run wrote"
                )
            times = columns["makespan"][block].reshape(len(names), count)
            optimum, bound, shared = (columns[name][first] for name in FLOATS[1:])
            yield Measured(
                number=one.number,
                draws=one.draws,
                scenario=one.scenario,
                times=dict(zip(names, times, strict=True)),
                optimum=optimum,
                bound=bound,
                proven=proven[first],
                shared=shared,
            )
