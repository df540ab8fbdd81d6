"""Claims and how they are judged. Rules are fixed here, before any row is looked at, and the page prints them.

A claim is put to every scenario that it speaks of. Each answers with *yes*, *no*, or nothing: intervals are widened
(Bonferroni) until all answers of a claim hold together with 95 %. All verdicts follow from these answers by one rule, `judge`.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from math import log
from typing import NamedTuple

from lalliance_study.report.comparisons import Comparison, pooled
from lalliance_study.report.results import FEWEST, Measured
from lalliance_study.report.statistics import Estimate
from lalliance_study.scenarios import Scenario

#: Of the scenarios that answer, the share that must say no for a claim to count as not reproduced.
REFUTED = 0.9
#: The share of scenarios that makes a part of them a region.
SOMEWHERE = 0.05


class Verdict(StrEnum):
    """What became of a claim."""

    REPRODUCED = "reproduced"
    NOT_REPRODUCED = "not reproduced"
    DEPENDS = "depends on"
    ANSWERED = "answered"
    TOO_FEW = "too little data"
    NOT_RUN = "not in these results"


class Finding(NamedTuple):
    """What became of a claim for one way of handing work over."""

    verdict: Verdict
    on: str = ""
    """What it depends on."""
    effect: Estimate | None = None
    """Its size, as the claim's `effect` names it."""
    detail: str = ""
    """Numbers behind it, in sentences."""

    @property
    def word(self) -> str:
        """The verdict in words."""
        return f"{self.verdict} {self.on}".strip()


@dataclass(frozen=True, slots=True)
class Claim:
    """Something that the paper says, or asks."""

    key: str
    title: str
    where: str
    """In the paper."""
    says: str
    """What, in our words."""
    rule: str
    """How it is tested, and when a scenario says yes or no."""
    effect: str
    """What the effect is."""
    experiment: str
    wanted: Callable[[Scenario], bool]
    """The scenarios that it speaks of."""
    test: Callable[[Sequence[Measured]], Finding]

    def judged(self, found: Sequence[Measured]) -> Finding:
        """The finding, unless there is too little to say one."""
        if not found:
            return Finding(Verdict.NOT_RUN)
        if (fewest := min(one.missions for one in found)) < FEWEST:
            return Finding(Verdict.TOO_FEW, detail=f"{fewest} missions a scenario; a verdict needs {FEWEST}.")
        return self.test(found)


class Answer(NamedTuple):
    """What one scenario says to a claim; None: it is not sure."""

    scenario: Scenario
    yes: bool | None


def anything(_: Scenario) -> bool:
    """All scenarios."""
    return True


def judge(answers: Sequence[Answer], effect: Estimate | None, detail: str = "") -> Finding:
    """The verdict on a claim that speaks of every scenario.

    *Reproduced*: some say yes, none no. *Not reproduced*: nobody says yes, or at least nine tenths of those that answer say no.
    *Depends on* something in all other cases: on that property of the scenarios which tells most about their answers.
    """
    yes = sum(one.yes is True for one in answers)
    no = sum(one.yes is False for one in answers)
    told = f"{_counted(answers)} {detail}".strip()
    if yes and not no:
        return Finding(Verdict.REPRODUCED, effect=effect, detail=told)
    if not yes or no >= REFUTED * (yes + no):
        return Finding(Verdict.NOT_REPRODUCED, effect=effect, detail=told)
    told = f"{_counted(answers)} No say, by {_listed(answers, counted=False)}. {detail}".strip()
    return Finding(Verdict.DEPENDS, most_telling(answers)[0], effect, told)


def judge_somewhere(answers: Sequence[Answer], effect: Estimate | None, detail: str = "") -> Finding:
    """The verdict on a claim of some region: *reproduced* if at least a twentieth of the scenarios say yes."""
    yes = sum(one.yes is True for one in answers)
    verdict = Verdict.REPRODUCED if yes >= SOMEWHERE * len(answers) else Verdict.NOT_REPRODUCED
    told = _counted(answers)
    if 0 < yes < len(answers):
        told += f" Yes say, by {_listed(answers, counted=True)}."
    return Finding(verdict, effect=effect, detail=f"{told} {detail}".strip())


def _counted(answers: Sequence[Answer]) -> str:
    said = Counter(one.yes for one in answers)
    return f"Of {len(answers)} scenarios {said[True]} say yes, {said[False]} no, {said[None]} are not sure."


def said(first: str, second: str, ratio: Estimate | None) -> str:
    """A ratio of times as a sentence."""
    if ratio is None:
        return f"{first} and {second} cannot be compared by time: too few missions were finished by both."
    return f"{first} takes {ratio.value:.3f} ({ratio.low:.3f} to {ratio.high:.3f}) times as long as {second}."


def circumstances(scenario: Scenario) -> str:
    """What befalls a team, or what it knows, in words."""
    if scenario.failures:
        return "robots die"
    if scenario.traps:
        return "robots get stuck"
    if scenario.training:
        return f"trained in {scenario.training} trial{'s' if scenario.training > 1 else ''}"
    if not scenario.samples:
        return "knows nothing"
    if scenario.noise:
        return f"knows {scenario.samples} sample{'s' if scenario.samples > 1 else ''} ± {scenario.noise:.0%}"
    return "nothing befalls"


#: What scenarios may differ in, and how a level of it is spelled.
PROPERTIES: Mapping[str, Callable[[Scenario], tuple[float, str]]] = {
    "heterogeneity": lambda one: (one.heterogeneity, f"{one.heterogeneity:g} %"),
    "whether every robot can do every task": lambda one: (
        0,
        "they can" if one.coverage >= one.robots else "they cannot",
    ),
    "coverage": lambda one: (one.coverage, f"{one.coverage}"),
    "tasks per robot": lambda one: (one.tasks / one.robots, f"{one.tasks / one.robots:.2g}"),
    "team size": lambda one: (one.robots, f"{one.robots} robots"),
    "how times are spread": lambda one: (0, one.spread.replace("_", "-")),
    "what befalls the team": lambda one: (0, circumstances(one)),
}


def most_telling(answers: Sequence[Answer]) -> list[str]:
    """The properties of scenarios that tell something about their answers, beginning with the one that tells most.

    Most is the information that a level gives about an answer, less what as many levels would seem to give by chance alone
    (Miller's and Madow's correction).
    """

    def gain(name: str) -> float:
        levels = Counter(PROPERTIES[name](one.scenario) for one in answers)
        pairs = Counter((PROPERTIES[name](one.scenario), one.yes) for one in answers)
        said = Counter(one.yes for one in answers)
        total = len(answers)
        known = sum(
            count / total * log(count * total / (levels[level] * said[yes])) for (level, yes), count in pairs.items()
        )
        return known - (len(levels) - 1) * (len(said) - 1) / (2 * total)

    first, *others = sorted(PROPERTIES, key=gain, reverse=True)
    return [first, *(name for name in others if gain(name) > 0)]


def _listed(answers: Sequence[Answer], *, counted: bool) -> str:
    """How many scenarios give an answer at each level of the two most telling properties."""
    told = []
    for name in most_telling(answers)[:2]:
        groups: dict[tuple[float, str], list[bool]] = {}
        for one in answers:
            groups.setdefault(PROPERTIES[name](one.scenario), []).append(one.yes is counted)
        levels = [f"{level[1]} ({sum(own)} of {len(own)})" for level, own in sorted(groups.items())]
        told.append(f"{name}: {', '.join(levels)}")
    return "; by ".join(told)


def ratio_of(comparisons: Sequence[Comparison]) -> Estimate | None:
    """The pooled ratio of comparisons, with its interval of 95 %."""
    found = pooled(comparisons)
    return None if found is None else found.ratio()


def unfinished(comparisons: Sequence[Comparison], first: str, second: str) -> str:
    """A sentence on the missions that were not finished; empty if all were."""
    total = sum(one.missions for one in comparisons)
    counts = {
        f"by {first} alone": sum(one.only_second for one in comparisons),
        f"by {second} alone": sum(one.only_first for one in comparisons),
        "by neither": sum(one.neither for one in comparisons),
    }
    listed = [f"{count:,} {whom}" for whom, count in counts.items() if count]
    return f"Of {total:,} missions not finished: {', '.join(listed)}." if listed else ""
