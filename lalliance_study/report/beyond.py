"""Beyond the paper: who is compared with whom, and how that is called. The numbers are those of `comparisons`."""

from collections.abc import Iterator, Sequence

from lalliance_agents.model.parameters import Erratum, Parameters
from lalliance_study.report.claims import circumstances
from lalliance_study.report.comparisons import Comparison, compare
from lalliance_study.report.optima import DERIVED
from lalliance_study.report.results import Measured

#: Who is compared with the default, and how they are called; the last six are planners, with perfect times and instant repair.
RIVALS = {
    "II/shortest_first": "II, shortest first",
    "I/derived": "strategy I",
    "III/derived": "strategy III",
    "alliance": "ALLIANCE, set by hand",
    "random": "random",
    "greedy": "greedy",
    "auction": "auction",
    "cbba": "CBBA",
    "lpt": "LPT list",
    "optimum": "optimum, repaired",
}
#: Who learns, and is looked at when it knows less.
LEARNERS = {"I/derived": "I", "II/derived": "II", "III/derived": "III", "alliance": "ALLIANCE"}
#: What all others are compared with where knowledge is given.
EXACT = "nothing befalls"

_DEFAULT = Parameters()
#: Parameters by their symbol in contenders' names, with their default, and what they are.
PARAMETERS = {
    "max_delay": (_DEFAULT.max_delay, "longest delay, in s\n(shortest: a fifth)"),
    "boredom": (1.2, "bored after this many\nlongest delays"),
    "tau": (_DEFAULT.silence_timeout, "silence timeout τ, in s"),
    "rho": (_DEFAULT.broadcast_rate, "messages a second, ρ"),
    "lambda": (_DEFAULT.give_up_factor, "give up after this many\nown times, λ"),
    "failure_factor": (_DEFAULT.failure_factor, "what a failed attempt counts,\nin times spent"),
    "mu": (float(_DEFAULT.trials), "attempts kept, μ"),
}


def against_default(found: Sequence[Measured], contender: str) -> list[Comparison]:
    """A contender against the default, in each scenario."""
    return [one.compare(contender, DERIVED) for one in found]


def against_exact(found: Sequence[Measured], contender: str) -> Iterator[Comparison]:
    """A contender against itself with exact knowledge, on the same missions, in each scenario in which it knows less."""
    exact = {
        (one.draws, one.scenario.hand_over): one.times[contender]
        for one in found
        if circumstances(one.scenario) == EXACT
    }
    for one in found:
        theirs = exact.get((one.draws, one.scenario.hand_over))
        if theirs is not None and circumstances(one.scenario) != EXACT and len(theirs) == one.missions:
            yield compare(one.number, one.draws, one.scenario, one.times[contender], theirs)


def more_unfinished(comparisons: Sequence[Comparison]) -> float:
    """The share of missions that the first leaves unfinished, less that of the second."""
    missions = sum(one.missions for one in comparisons)
    return sum(one.only_second - one.only_first for one in comparisons) / missions if missions else 0.0


def by_circumstances(comparisons: Sequence[Comparison]) -> dict[str, list[Comparison]]:
    """Comparisons in groups, by what befalls the team or what it knows."""
    groups: dict[str, list[Comparison]] = {}
    for one in comparisons:
        groups.setdefault(circumstances(one.scenario), []).append(one)
    return groups


def readings(contenders: Sequence[str]) -> dict[str, str]:
    """Contenders that read an erratum otherwise, and how they are called; in the order of the errata."""
    found = {}
    for number, erratum in enumerate(Erratum, 1):
        for reading, told in (("literal", ""), ("mended", " mended")):
            name = f"{DERIVED}/{reading}-{number}"
            if name in contenders:
                found[name] = f"{number} {erratum.replace('_', ' ')}{told}"
    return found


def values_of(contenders: Sequence[str], symbol: str) -> dict[float, str]:
    """Contenders with another value of a parameter, by that value."""
    spelled = {name: name.rpartition("/")[2].partition("=") for name in contenders}
    return {float(value): name for name, (found, _, value) in spelled.items() if found == symbol}
