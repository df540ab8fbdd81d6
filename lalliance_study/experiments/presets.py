"""The presets: which experiments a study consists of, over which scenarios, as data.

`paper` redoes section 4 and 5 of the paper and what goes beyond it; `mini` is the corners of the same grids with the smallest
teams, so that every experiment is touched in a minute; `full` is `paper` with more and larger teams and more missions.

Wherever the paper leaves a choice open, it is a named field of `Scenario` that some experiment varies: `hand_over`, `spread`,
`failures`, `traps`, `noise`, `samples`, `training`.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import get_args

from lalliance_agents.errors import UserError
from lalliance_agents.model.parameters import Ordering, Strategy
from lalliance_study.baselines import BASELINES
from lalliance_study.experiments.contenders import (
    DEFAULT,
    Contender,
    alliance,
    baseline,
    by_hand,
    read_otherwise,
    with_other_boredom,
    with_other_delays,
    with_values,
)
from lalliance_study.experiments.plan import Experiment, Grid, Yardsticks
from lalliance_study.scenarios import Spread

#: The paper's grid, in percent.
HETEROGENEITIES = (0.0, 100.0, 200.0, 400.0, 800.0, 1600.0, 3200.0)
#: Probability that a robot gets stuck at a task it can do, where progress when working (PWW) is false.
TRAPS = 0.2
#: Probability that a robot dies, where robots do.
FAILURES = 0.3
#: What befalls a team: nothing, robots die, robots get stuck.
PLAIN: dict[str, float] = {}
DYING, STUCK = {"failures": FAILURES}, {"traps": TRAPS}

_Sizes = tuple[tuple[int, int, int], ...]


@dataclass(frozen=True, slots=True)
class Preset:
    """A study."""

    name: str
    says: str
    missions: int
    """Of each scenario, where an experiment does not want fewer."""
    experiments: tuple[Experiment, ...]


def _sizes(teams: tuple[int, ...], loads: tuple[float, ...], coverages: tuple[int, ...]) -> _Sizes:
    """Robots, tasks and coverage for all combinations of robots, tasks per robot, and coverage that there can be."""
    return tuple(
        (robots, round(robots * load), coverage)
        for robots in teams
        for load in loads
        for coverage in coverages
        if coverage <= robots and 1 <= robots * load <= 40
    )


def _each(*orderings: Ordering) -> tuple[Contender, ...]:
    return tuple(alliance(strategy, ordering) for ordering in orderings for strategy in Strategy)


def _named(teams: "Teams") -> tuple[Experiment, ...]:
    """All experiments, over the teams of a preset."""
    orderings = (
        Ordering.MODIFIED_SHORTEST_FIRST, Ordering.MODIFIED_RANDOM, Ordering.LONGEST_FIRST, Ordering.DERIVED,
    )  # fmt: skip
    shortest_first = alliance(Strategy.II, Ordering.MODIFIED_SHORTEST_FIRST)
    return (
        Experiment(
            "strategies",
            "Which strategy is best, over tasks per robot, coverage, heterogeneity and PWW (Figure 2)?",
            (Grid(teams.strategies, HETEROGENEITIES, circumstances=(PLAIN, STUCK)),),
            _each(*orderings[:2]),
        ),
        Experiment(
            "orderings",
            "What do the orderings change (Figure 3), is longest first a disaster, and is the derived one best?",
            (Grid(teams.orderings, HETEROGENEITIES, get_args(Spread), (PLAIN, DYING, STUCK)),),
            _each(*orderings),
        ),
        Experiment(
            "optimum",
            "Is it within 20 % of the optimum on problems whose optima are all proven?",
            (
                # Without heterogeneity many robots are alike, and many tasks make the proof too dear.
                Grid(tuple(size for size in teams.optimum if size[1] <= 12), HETEROGENEITIES[:1]),
                Grid(teams.optimum, HETEROGENEITIES[1:]),
            ),
            (DEFAULT, shortest_first, alliance(Strategy.III, Ordering.DERIVED)),
            Yardsticks(work_limit=30.0, shared=True),
        ),
        Experiment(
            "growth",
            "How does the distance to the optimum grow with the size of the problem?",
            (Grid(teams.growth, (100.0, 800.0)),),
            (*_each(Ordering.DERIVED), shortest_first),
            Yardsticks(work_limit=10.0, shared=True),
            part=10,
        ),
        Experiment(
            "beyond",
            "And beyond the paper's largest teams, by fewer missions?",
            (Grid(teams.beyond, (100.0, 800.0), hand_overs=("shared_max", "restart")),),
            (DEFAULT, shortest_first),
            Yardsticks(work_limit=10.0, shared=True),
            share=0.1,
            part=2,
        ),
        Experiment(
            "rivals",
            "How does it compare with what people use instead, with and without failures?",
            (
                Grid(teams.rivals[:2], (0.0, 100.0, 400.0, 1600.0), circumstances=(PLAIN, DYING)),
                Grid(teams.rivals[2:], (100.0, 400.0, 1600.0), circumstances=(PLAIN, DYING)),
            ),
            (*_each(Ordering.DERIVED), shortest_first, by_hand(), *map(baseline, BASELINES)),
            Yardsticks(work_limit=2.0, shared=True),
            part=20,
        ),
        *_of_parameters(teams.parameters),
    )


def _of_parameters(sizes: _Sizes) -> Iterator[Experiment]:
    """What knowledge, readings and parameters do to the default, and to whom they concern."""
    yield Experiment(
        "knowledge",
        "What is it worth to know, exactly or roughly, given or from training?",
        (
            Grid(
                sizes,
                (100.0, 800.0),
                circumstances=(
                    *({"samples": 10, "noise": noise} for noise in (0.0, 0.1, 0.3)),
                    *({"samples": samples, "noise": 0.3} for samples in (1, 3)),
                    *({"samples": 0, "training": trials} for trials in (0, 1, 3, 10)),
                ),
            ),
        ),
        (*_each(Ordering.DERIVED), by_hand()),
        part=50,
    )
    yield Experiment(
        "ablation",
        "What does each literal reading of the Appendix cost?",
        (
            Grid(
                sizes[:1],
                (100.0, 800.0),
                circumstances=tuple(
                    {**befalls, "cap": 1.0}  # some literal teams never end
                    for befalls in (PLAIN, DYING, STUCK, {"samples": 0}, {"samples": 0, "training": 3})
                ),
            ),
        ),
        (DEFAULT, *read_otherwise()),
        part=50,
    )
    yield Experiment(
        "sensitivity",
        "How much do delays, boredom, tau, rho, lambda and mu matter?",
        (Grid(sizes, (100.0, 800.0), circumstances=(PLAIN, DYING, STUCK, {"noise": 0.25})),),
        (
            DEFAULT,
            *with_other_delays((0.1, 0.3, 3.0, 10.0, 30.0)),
            *with_other_boredom((1.05, 2.0, 5.0, 20.0)),
            *with_values("silence_timeout", "tau", (0.5, 2.0, 5.0, 10.0)),
            *with_values("broadcast_rate", "rho", (2.5, 10.0)),
            *with_values("give_up_factor", "lambda", (1.0, 1.5, 3.0, 5.0, 20.0)),
            *with_values("failure_factor", "failure_factor", (1.2, 4.0)),
            *with_values("trials", "mu", (1, 3)),
        ),
        part=50,
    )


@dataclass(frozen=True, slots=True)
class Teams:
    """Sizes of teams, by experiment: robots, tasks, coverage."""

    strategies: _Sizes
    orderings: _Sizes
    optimum: _Sizes
    growth: _Sizes
    beyond: _Sizes
    rivals: _Sizes
    parameters: _Sizes


PAPER = Teams(
    strategies=_sizes((5, 10), (1.0, 2.0, 4.0), (2, 3, 5, 10)),
    orderings=((5, 10, 3), (10, 20, 3), (10, 40, 4)),
    optimum=_sizes((2, 3, 4, 5, 6), (1.0, 1.5, 2.0, 2.5, 3.0, 4.0), (2, 3, 4, 5)),
    growth=((2, 4, 2), (4, 8, 4), (6, 12, 4), (8, 16, 4), (10, 20, 4), (15, 30, 4), (20, 40, 4)),
    beyond=((30, 60, 4),),
    rivals=((5, 10, 3), (10, 20, 3), (20, 40, 3)),
    parameters=((5, 10, 3), (10, 20, 3)),
)
FULL = Teams(
    strategies=_sizes((2, 5, 10, 20), (0.5, 1.0, 2.0, 3.0, 4.0, 8.0), (1, 2, 3, 5, 10)),
    orderings=((5, 5, 3), (5, 10, 3), (5, 20, 3), (10, 20, 3), (10, 40, 4), (20, 40, 4)),
    optimum=_sizes((2, 3, 4, 5, 6, 8), (1.0, 1.5, 2.0, 2.5, 3.0, 4.0), (1, 2, 3, 4, 5, 6)),
    growth=(*PAPER.growth, (5, 20, 4), (10, 40, 4), (20, 20, 4), (20, 40, 3), (20, 40, 6)),
    beyond=((30, 60, 4), (40, 80, 4), (60, 120, 4)),
    rivals=(*PAPER.rivals, (10, 40, 4), (20, 40, 4)),
    parameters=(*PAPER.parameters, (20, 40, 4)),
)


def _corners(experiments: tuple[Experiment, ...]) -> tuple[Experiment, ...]:
    return tuple(replace(one, grids=tuple(grid.corners(2) for grid in one.grids[-1:])) for one in experiments)


PRESETS = {
    one.name: one
    for one in (
        Preset("mini", "a few small missions of every experiment, in under a minute", 4, _corners(_named(PAPER))),
        Preset("paper", "the whole report, in under an hour on two cores", 200, _named(PAPER)),
        Preset("full", "more teams and five times as many missions, in a day or two on two cores", 1000, _named(FULL)),
    )
}


def preset(name: str) -> Preset:
    """The preset of this name.

    Raises:
        UserError: there is none.
    """
    if name not in PRESETS:
        raise UserError(f"no preset {name!r}; expected one of {', '.join(PRESETS)}")
    return PRESETS[name]
