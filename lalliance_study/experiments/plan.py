"""What is to be done: experiments, their scenarios, and the parts into which they are cut.

Scenarios that differ only in what befalls or rules a team, not in the team and its tasks, see the same missions: the spawn key
of a scenario's draws is made from the team alone. So the optimum of a mission is computed once for all of them, and they can be
compared mission by mission, in all experiments and presets.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from hashlib import blake2b
from itertools import product
from typing import Any, NamedTuple

from lalliance_agents.model.parameters import Record
from lalliance_study.experiments.contenders import Contender
from lalliance_study.scenarios import Scenario
from world_server.environments.task_pool import HAND_OVERS


class Team(NamedTuple):
    """What decides the missions of a scenario, but for what befalls the team."""

    robots: int
    tasks: int
    coverage: int
    heterogeneity: float
    spread: str

    @classmethod
    def of(cls, scenario: Scenario) -> "Team":
        """The team of a scenario."""
        return cls(
            scenario.robots, scenario.tasks, scenario.coverage, float(scenario.heterogeneity), str(scenario.spread)
        )

    @property
    def draws(self) -> int:
        """The spawn key of its missions."""
        return int.from_bytes(blake2b(repr(tuple(self)).encode(), digest_size=4).digest(), "little")


@dataclass(frozen=True, slots=True)
class Grid:
    """Scenarios that are all combinations of some values."""

    sizes: tuple[tuple[int, int, int], ...]
    """Robots, tasks, coverage."""
    heterogeneities: tuple[float, ...]
    spreads: tuple[str, ...] = ("unrelated",)
    circumstances: tuple[dict[str, Any], ...] = ({},)
    """Other fields of `Scenario`."""
    hand_overs: tuple[str, ...] = HAND_OVERS

    def scenarios(self) -> Iterator[Scenario]:
        """All of them; those of one team follow one another."""
        for size, heterogeneity, spread in product(self.sizes, self.heterogeneities, self.spreads):
            for befalls, hand_over in product(self.circumstances, self.hand_overs):
                yield Scenario.model_validate(
                    {
                        **dict(zip(("robots", "tasks", "coverage"), size, strict=True)),
                        "heterogeneity": heterogeneity,
                        "spread": spread,
                        "hand_over": hand_over,
                        **befalls,
                    }
                )

    def corners(self, most: int) -> "Grid":
        """The first and the last value of each dimension, and `most` of the smallest sizes."""
        sizes = sorted(self.sizes, key=lambda size: (size[0] * size[1], size[2]))[:most]
        return Grid(
            tuple(sizes),
            _ends(self.heterogeneities),
            _ends(self.spreads),
            self.circumstances if len(self.circumstances) > 3 else _ends(self.circumstances),
            self.hand_overs,
        )


def _ends(values: tuple[Any, ...]) -> tuple[Any, ...]:
    return (values[0], values[-1]) if len(values) > 1 else values


@dataclass(frozen=True, slots=True)
class Yardsticks:
    """Which optima an experiment wants of each mission."""

    work_limit: float
    """For one HRASP optimum, in CP-SAT's deterministic seconds."""
    shared: bool = False
    """Whether also those where robots share the work of a task."""


@dataclass(frozen=True, slots=True)
class Experiment:
    """Some contenders on the same missions of some scenarios."""

    name: str
    asks: str
    """The question, as a sentence."""
    grids: tuple[Grid, ...]
    contenders: tuple[Contender, ...]
    yardsticks: Yardsticks | None = None
    share: float = 1.0
    """Of the missions of each scenario that a study wants, those that this experiment has."""
    part: int = 200
    """Missions that are done at once: few where they are dear, as what is interrupted is lost."""

    def scenarios(self) -> Iterator[Scenario]:
        """All of its scenarios; those of one team follow one another."""
        for grid in self.grids:
            yield from grid.scenarios()

    def missions(self, wanted: int) -> int:
        """How many missions each scenario has."""
        return max(1, round(self.share * wanted))


class Numbered(Record):
    """A scenario of a study."""

    number: int
    """Its place in the study."""
    experiment: str
    draws: int
    """The spawn key of its missions; scenarios with the same one have the same missions."""
    scenario: Scenario


@dataclass(frozen=True, slots=True)
class Part:
    """Some missions of all scenarios of one team in one experiment: what is done at once, and kept in one file."""

    experiment: Experiment
    scenarios: tuple[Numbered, ...]
    first: int
    last: int
    """The missions: from `first` to before `last`."""
    seed: int

    @property
    def name(self) -> str:
        """The name of its file, without folder and ending."""
        return f"{self.experiment.name}-{self.scenarios[0].number:05}-{self.first:05}"

    @property
    def runs(self) -> int:
        """Its rows."""
        return (self.last - self.first) * len(self.scenarios) * len(self.experiment.contenders)


def numbered(experiments: Sequence[Experiment]) -> list[Numbered]:
    """All scenarios, in order."""
    planned = [(one.name, scenario) for one in experiments for scenario in one.scenarios()]
    return [
        Numbered(number=number, experiment=name, draws=Team.of(scenario).draws, scenario=scenario)
        for number, (name, scenario) in enumerate(planned)
    ]


def parts(experiments: Sequence[Experiment], wanted: int, seed: int) -> Iterator[Part]:
    """All parts of a study with `wanted` missions a scenario, in order."""
    teams: dict[tuple[str, int], list[Numbered]] = {}
    for one in numbered(experiments):
        teams.setdefault((one.experiment, one.draws), []).append(one)
    by_name = {one.name: one for one in experiments}
    for (name, _), scenarios in teams.items():
        experiment = by_name[name]
        missions = experiment.missions(wanted)
        for first in range(0, missions, experiment.part):
            last = min(first + experiment.part, missions)
            yield Part(experiment, tuple(scenarios), first, last, seed)
