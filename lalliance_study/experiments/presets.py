"""The presets: which experiments a study consists of, over which scenarios, as data.

`paper` redoes section 4 and 5 of the paper and what goes beyond it; `mini` is the corners of the same grids with the smallest
teams, so that every experiment is touched in a minute; `full` is `paper` with denser grids and larger teams.

Wherever the paper leaves a choice open, it is a named field of `Scenario` that some experiment varies: `hand_over`, `spread`,
`failures`, `traps`, `noise`, `samples`, `training`.
"""

from dataclasses import dataclass, replace

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


STRATEGIES = Experiment(
    "strategies",
    "Which strategy is best, over tasks per robot, coverage, heterogeneity and PWW (Figure 2)?",
    Grid(_sizes((5, 10), (1.0, 2.0, 4.0), (2, 3, 5, 10)), HETEROGENEITIES, circumstances=(PLAIN, STUCK)),
    _each(Ordering.MODIFIED_SHORTEST_FIRST, Ordering.MODIFIED_RANDOM),
)
ORDERINGS = Experiment(
    "orderings",
    "What do the orderings change (Figure 3), is longest first a disaster, and is the derived one best?",
    Grid(
        ((5, 10, 3), (10, 20, 3), (10, 40, 4)),
        HETEROGENEITIES,
        ("unrelated", "related", "log_uniform"),
        (PLAIN, DYING, STUCK),
    ),
    _each(Ordering.MODIFIED_SHORTEST_FIRST, Ordering.MODIFIED_RANDOM, Ordering.LONGEST_FIRST, Ordering.DERIVED),
)
OPTIMUM = Experiment(
    "optimum",
    "Is it within 20 % of the optimum on problems whose optima are all proven?",
    Grid(_sizes((2, 3, 4, 5, 6), (1.0, 1.5, 2.0, 2.5, 3.0, 4.0), (2, 3, 4, 5)), HETEROGENEITIES),
    (DEFAULT, alliance(Strategy.II, Ordering.MODIFIED_SHORTEST_FIRST), alliance(Strategy.III, Ordering.DERIVED)),
    Yardsticks(work_limit=30.0, shared=True),
)
GROWTH = Experiment(
    "growth",
    "How does the distance to the optimum grow with the size of the problem?",
    Grid(((2, 4, 2), (4, 8, 4), (6, 12, 4), (8, 16, 4), (10, 20, 4), (15, 30, 4), (20, 40, 4)), (100.0, 800.0)),
    (*_each(Ordering.DERIVED), alliance(Strategy.II, Ordering.MODIFIED_SHORTEST_FIRST)),
    Yardsticks(work_limit=2.0, shared=True),
    part=20,
)
RIVALS = Experiment(
    "rivals",
    "How does it compare with what people use instead, with and without failures?",
    Grid(((5, 10, 3), (10, 20, 4)), (0.0, 100.0, 400.0, 1600.0), circumstances=(PLAIN, DYING)),
    (*_each(Ordering.DERIVED), by_hand(), *map(baseline, BASELINES)),
    Yardsticks(work_limit=2.0, shared=True),
    part=20,
)
KNOWLEDGE = Experiment(
    "knowledge",
    "What is it worth to know, exactly or roughly, given or from training?",
    Grid(
        ((5, 10, 3), (10, 20, 3)),
        (100.0, 800.0),
        circumstances=(
            *({"samples": samples, "noise": noise} for samples, noise in ((10, 0.0), (10, 0.1), (10, 0.3), (1, 0.3))),
            *({"samples": 0, "training": trials} for trials in (0, 1, 3, 10)),
        ),
    ),
    (*_each(Ordering.DERIVED), by_hand()),
)
ABLATION = Experiment(
    "ablation",
    "What does each literal reading of the Appendix cost?",
    Grid(
        ((5, 10, 3),),
        (100.0, 800.0),
        circumstances=tuple(
            {**befalls, "cap": 1.0} for befalls in (PLAIN, DYING, STUCK, {"samples": 0}, {"samples": 0, "training": 3})
        ),
    ),
    (DEFAULT, *read_otherwise()),
    share=0.1,
    part=10,
)
SENSITIVITY = Experiment(
    "sensitivity",
    "How much do delays, boredom, tau, rho, lambda and mu matter?",
    Grid(
        ((5, 10, 3), (10, 20, 3)),
        (100.0, 800.0),
        circumstances=(PLAIN, DYING, STUCK, {"noise": 0.25}),
    ),
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
)

_ALL = (STRATEGIES, ORDERINGS, OPTIMUM, GROWTH, RIVALS, KNOWLEDGE, ABLATION, SENSITIVITY)


def _mini() -> tuple[Experiment, ...]:
    return tuple(replace(one, grid=one.grid.corners(2), share=1.0) for one in _ALL)


PRESETS = {
    one.name: one
    for one in (
        Preset("mini", "a few small missions of every experiment, in under a minute", 4, _mini()),
        Preset("paper", "the whole report, in under an hour on two cores", 200, _ALL),
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
