"""Who takes part: L-ALLIANCE with one set of parameters, its predecessor, or one of the `baselines`.

A contender's name is that of its strategy and ordering, and what else differs from the default: `II/derived/tau=0.5`.
"""

from typing import Any, Literal

from lalliance_agents.model.parameters import Architecture, Erratum, Ordering, Parameters, Reading, Record, Strategy

#: How names of contenders spell the orderings.
SHORT = {
    Ordering.DERIVED: "derived",
    Ordering.MODIFIED_SHORTEST_FIRST: "shortest_first",
    Ordering.MODIFIED_RANDOM: "random",
    Ordering.LONGEST_FIRST: "longest_first",
}


class Contender(Record):
    """One way of sharing out the tasks."""

    name: str
    """Unique within an experiment."""
    kind: Literal["alliance", "baseline"]
    """A team of minds of their own, or a planner."""
    strategy: str | None = None
    """As missions spell it; of a baseline and of ALLIANCE none, as of the next."""
    ordering: str | None = None
    variant: str | None = None
    """What differs from the default; None: nothing."""
    parameters: Parameters | None = None
    """Of each robot; of a baseline none."""


def alliance(strategy: Strategy, ordering: Ordering, variant: str | None = None, **changed: Any) -> Contender:
    """L-ALLIANCE with some parameters changed, and what that is called."""
    parameters = Parameters.model_validate({"strategy": strategy, "ordering": ordering, **changed})
    spelled = parameters.model_dump(mode="json")
    name = "/".join(filter(None, (strategy.name, SHORT[ordering], variant and variant.replace(" ", "-"))))
    return Contender(
        name=name,
        kind="alliance",
        strategy=spelled["strategy"],
        ordering=spelled["ordering"],
        variant=variant,
        parameters=parameters,
    )


def baseline(name: str) -> Contender:
    """One of the `baselines`."""
    return Contender(name=name, kind="baseline")


def by_hand() -> Contender:
    """ALLIANCE, without the L: all set by hand, the same for every task, and nothing learned."""
    variant = "architecture=alliance"
    parameters = Parameters(architecture=Architecture.ALLIANCE)
    return Contender(name="alliance", kind="alliance", variant=variant, parameters=parameters)


DEFAULT = alliance(Strategy.II, Ordering.DERIVED)


def read_otherwise() -> list[Contender]:
    """The default with one erratum read the other way, for each but strategy I, which would have no formula."""
    found = []
    for number, erratum in enumerate(Erratum, 1):
        if erratum is not Erratum.STRATEGY_ONE:
            other = Reading.LITERAL if erratum.default is Reading.MENDED else Reading.MENDED
            found.append(
                alliance(Strategy.II, Ordering.DERIVED, f"{other} {number}", readings={erratum.value: other.value})
            )
    return found


def with_values(field: str, symbol: str, values: tuple[float, ...]) -> list[Contender]:
    """The default with other values of one parameter."""
    return [alliance(Strategy.II, Ordering.DERIVED, f"{symbol}={value:g}", **{field: value}) for value in values]


def with_other_delays(longest: tuple[float, ...]) -> list[Contender]:
    """The default with other delays before a free task is taken, the shortest a fifth of the longest as by default."""
    return [
        alliance(Strategy.II, Ordering.DERIVED, f"max_delay={delay:g}", min_delay=delay / 5, max_delay=delay)
        for delay in longest
    ]


def with_other_boredom(multiples: tuple[float, ...]) -> list[Contender]:
    """The default with robots that are bored after another multiple of `max_delay`."""
    longest = Parameters().max_delay
    return [
        alliance(Strategy.II, Ordering.DERIVED, f"boredom={multiple:g}", boredom_rate=1 / (multiple * longest))
        for multiple in multiples
    ]
