"""The sections of the page: which claims, figures and tables belong to which question. The prose stands in `page.md`."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from lalliance_study.report import optima, orderings, strategies, tables
from lalliance_study.report.claims import Claim
from lalliance_study.report.figures import beyond as beyond_figures
from lalliance_study.report.figures import optima as optimum_figures
from lalliance_study.report.figures import orderings as ordering_figures
from lalliance_study.report.figures import strategies as strategy_figures
from lalliance_study.report.results import Measured

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True)
class Drawing:
    """A figure."""

    name: str
    """Of its files."""
    caption: str
    draw: Callable[[Sequence[Measured]], "Figure"]


@dataclass(frozen=True, slots=True)
class Section:
    """What was measured of one question."""

    name: str
    """Its place in `page.md`."""
    experiment: str
    drawings: tuple[Drawing, ...] = ()
    claims: tuple[Claim, ...] = ()
    table: Callable[[Sequence[Measured]], str] | None = None


SECTIONS = (
    Section(
        "strategies",
        "strategies",
        drawings=(
            Drawing(
                "strategy-map",
                "Who is best under modified shortest first, and by how much the next one is slower. Each cell is a scenario; a "
                "colour means that nobody is better, with 95 % confidence and a margin of 1 %.",
                strategy_figures.strategy_map,
            ),
            Drawing(
                "strategy-ratios",
                "Time of strategies I and III relative to II, over all sizes; bands are intervals of 95 %.",
                strategy_figures.strategy_ratios,
            ),
        ),
        claims=strategies.FIGURE_2,
    ),
    Section(
        "random",
        "strategies",
        drawings=(
            Drawing(
                "random-selection",
                "Time with modified random selection relative to modified shortest first; bands are intervals of 95 %.",
                strategy_figures.random_instead,
            ),
        ),
        claims=strategies.FIGURE_3,
    ),
    Section(
        "orderings",
        "orderings",
        drawings=(
            Drawing(
                "longest-first",
                "Time with longest first relative to shortest first, over three sizes; bands are intervals of 95 %.",
                ordering_figures.longest_first,
            ),
            Drawing(
                "orderings",
                "Time of strategy II with each ordering relative to shortest first, unrelated times; bands are intervals of "
                "95 %.",
                ordering_figures.orderings,
            ),
        ),
        claims=orderings.ORDERINGS,
    ),
    Section(
        "optimum",
        "optimum",
        drawings=(
            Drawing(
                "optimum-distribution",
                "Share of single missions within each multiple of the optimum, strategy II. Left every robot can do every "
                "task.",
                optimum_figures.distribution,
            ),
            Drawing(
                "optimum-by-region",
                "Mean of makespan / optimum by region, II with the derived ordering.",
                optimum_figures.by_region,
            ),
        ),
        claims=(*optima.NEAR_THE_OPTIMUM, *orderings.SMALL_TEAMS),
        table=tables.distances,
    ),
    Section(
        "growth",
        "growth",
        drawings=(
            Drawing(
                "growth",
                "Mean of makespan / optimum against size. Pale bands are intervals of 95 %, dark ones reach up to the ratio to "
                "the proven bound. Dotted: 20 %.",
                optimum_figures.growth,
            ),
        ),
        claims=optima.GROWTH,
        table=tables.growth,
    ),
    Section("beyond", "beyond", table=tables.growth),
    Section(
        "rivals",
        "rivals",
        drawings=(
            Drawing(
                "rivals",
                "Time relative to II with the derived ordering, on the same missions, with intervals of 95 %.",
                beyond_figures.rivals,
            ),
        ),
        table=tables.rivals,
    ),
    Section(
        "knowledge",
        "knowledge",
        drawings=(
            Drawing(
                "knowledge",
                "Time relative to exact knowledge, with intervals of 95 %.",
                beyond_figures.knowledge,
            ),
        ),
        table=tables.knowledge,
    ),
    Section(
        "ablation",
        "ablation",
        drawings=(
            Drawing(
                "ablation",
                "Time relative to the default readings, II with the derived ordering, with intervals of 95 %.",
                beyond_figures.ablation,
            ),
        ),
        table=tables.ablation,
    ),
    Section(
        "sensitivity",
        "sensitivity",
        drawings=(
            Drawing(
                "sensitivity",
                "Time relative to the default value; bands are intervals of 95 %.",
                beyond_figures.sensitivity,
            ),
        ),
        table=tables.sensitivity,
    ),
)
CLAIMS = tuple(claim for section in SECTIONS for claim in section.claims)
