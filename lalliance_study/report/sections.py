"""The sections of the page: which claims, figures and tables, and what is to be known of how they came about."""

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
    """What the page says of one question."""

    title: str
    experiment: str
    reads: str
    """How to read it, and what was assumed."""
    drawings: tuple[Drawing, ...]
    claims: tuple[Claim, ...] = ()
    table: Callable[[Sequence[Measured]], str] | None = None


def _claims(*keys: str) -> tuple[Claim, ...]:
    every = {one.key: one for one in (*strategies.CLAIMS, *orderings.CLAIMS, *optima.CLAIMS)}
    return tuple(every[key] for key in keys)


SECTIONS = (
    Section(
        title="Which strategy (Figure 2)",
        experiment="strategies",
        reads="The boundaries of the paper's regions 1 to 4 stand in its drawing, of which we have the text alone. So what it says "
        "of a region is put to the whole grid, and where it holds is for the map to show. PWW true: nobody gets stuck. PWW false: "
        "each pair of robot and task is a trap with probability 0.2: an attempt gets stuck after a random part of the work, half of "
        "the traps for ever, while the robot goes on announcing that it is at work.",
        drawings=(
            Drawing(
                "strategy-map",
                "Who is best under modified shortest first, and by how much the next is slower. Each cell is a scenario; a colour means "
                "that nobody is better with 95 % confidence and a margin of 1 %.",
                strategy_figures.strategy_map,
            ),
            Drawing(
                "strategy-ratios",
                "Time of strategies I and III relative to II, over all sizes; bands are intervals of 95 %.",
                strategy_figures.strategy_ratios,
            ),
        ),
        claims=_claims("II-with-PWW", "III-without-PWW", "II-without-PWW", "I-never", "II-at-random"),
    ),
    Section(
        title="Random selection in the place of shortest first (Figure 3)",
        experiment="strategies",
        reads="The paper shows one exemplary scenario, and says that others look alike; here is the mean over all sizes.",
        drawings=(
            Drawing(
                "random-selection",
                "Time with modified random selection relative to modified shortest first; bands are intervals of 95 %.",
                strategy_figures.random_instead,
            ),
        ),
        claims=_claims("random-I", "random-III", "random-II"),
    ),
    Section(
        title="Longest first, and the derived ordering",
        experiment="orderings",
        reads="Robots die with probability 0.3, after a random amount of work, silently; each task keeps one robot that can do it. Times "
        "are unrelated (each robot is good at something else), log-uniform (the same, with more robots near to the fastest), or "
        "related (one speed for each robot).",
        drawings=(
            Drawing(
                "longest-first",
                "Time with longest first relative to shortest first, over three sizes; bands are intervals of 95 %.",
                ordering_figures.longest_first,
            ),
            Drawing(
                "orderings",
                "Time of strategy II with each ordering relative to shortest first, unrelated times; bands are intervals of 95 %.",
                ordering_figures.orderings,
            ),
        ),
        claims=_claims("longest-first", "derived"),
    ),
    Section(
        title="Within 20 % of the optimum",
        experiment="optimum",
        reads="The optimum is HRASP's: each task by one robot. Where work left belongs to the task a team may be quicker than that, so "
        "that ratios below 1 are no mistake. In the left part of the figure every robot can do every task, so that all hear of all "
        "work; in the right one a robot does not hear from teammates at work on what it cannot do.",
        drawings=(
            Drawing(
                "optimum-distribution",
                "Share of single missions within each multiple of the optimum, strategy II.",
                optimum_figures.distribution,
            ),
            Drawing(
                "optimum-by-region",
                "Mean of makespan / optimum by region, II with the derived ordering.",
                optimum_figures.by_region,
            ),
        ),
        claims=_claims("near-the-optimum"),
        table=tables.distances,
    ),
    Section(
        title="How the distance grows with the size of the problem",
        experiment="growth",
        reads="The paper's open question. Two tasks per robot; each task can be done by four robots (by two, where there are but two). An "
        "optimum that is not proven lies between the proven bound and the best schedule known: *at most* is the ratio to that bound.",
        drawings=(
            Drawing(
                "growth",
                "Mean of makespan / optimum against size; narrow bands are intervals of 95 %, darker ones reach up to the ratio to the "
                "proven bound. Dotted: 20 %.",
                optimum_figures.growth,
            ),
        ),
        claims=_claims("growth"),
        table=tables.growth,
    ),
    Section(
        title="Against what people use instead",
        experiment="rivals",
        reads="The same missions, carried out by planners. They are favoured: they know all times exactly, plan in no time, miss no "
        "message, and repair a plan at the instant at which a death is noticed, after the same silence. *Optimum, repaired* plans "
        "HRASP's optimum anew for what is left; it does not foresee deaths.",
        drawings=(
            Drawing("rivals", "Time relative to II with the derived ordering, on the same missions, with intervals of 95 %.", beyond_figures.rivals),
        ),
        table=tables.rivals,
    ),
    Section(
        title="What knowledge is worth",
        experiment="knowledge",
        reads="Robots are given samples of one another's times, exact or noisy, or begin knowing nothing, after none or some trials of "
        "active learning. Compared is each strategy with itself on the same missions, given ten exact samples.",
        drawings=(
            Drawing("knowledge", "Time relative to exact knowledge, with intervals of 95 %.", beyond_figures.knowledge),
        ),
        table=tables.knowledge,
    ),
    Section(
        title="What literal readings cost",
        experiment="ablation",
        reads="The Appendix, taken literally, does not work in some places; each is an erratum with a mended reading, which is the default "
        "(but for 16, where the literal one is). Here one at a time is read the other way. Erratum 12 has no other reading: without it "
        "strategy I has no formula.",
        drawings=(
            Drawing(
                "ablation", "Time relative to the default readings, II with the derived ordering, with intervals of 95 %.", beyond_figures.ablation
            ),
        ),
        table=tables.ablation,
    ),
    Section(
        title="How much parameters matter",
        experiment="sensitivity",
        reads="One parameter at a time; the others have their defaults. Tasks take the fastest robot 10 to 30 s.",
        drawings=(
            Drawing("sensitivity", "Time relative to the default value; bands are intervals of 95 %.", beyond_figures.sensitivity),
        ),
        table=tables.sensitivity,
    ),
)
