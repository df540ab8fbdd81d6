"""Claims on the orderings: longest first is a disaster, and the derived ordering is the best of all."""

from collections.abc import Sequence

from lalliance_study.report.claims import Answer, Claim, Finding, anything, judge, ratio_of, said, unfinished
from lalliance_study.report.comparisons import Comparison, strict
from lalliance_study.report.results import Measured
from lalliance_study.report.strategies import MILD, answers_of
from lalliance_study.scenarios import Scenario

#: How many times as long a mission must take to be a disaster.
DISASTER = 1.5
STRATEGIES = ("I", "II", "III")


def disaster(found: Sequence[Measured]) -> Finding:
    """Longest first is a disaster under each strategy."""
    pairs = [(f"{strategy}/longest_first", f"{strategy}/shortest_first") for strategy in STRATEGIES]
    compared = {pair: [one.compare(*pair) for one in found] for pair in pairs}
    every = [one for own in compared.values() for one in own]
    answers = [_disastrous(one, strict(every)) for one in every]
    told = [said(*pair, ratio_of(own)) for pair, own in compared.items()]
    told += [
        f"Of {spread.replace('_', '-')} times: {ratio.value:.2f} ({ratio.low:.2f} to {ratio.high:.2f})."
        for spread in dict.fromkeys(one.scenario.spread for one in every)
        if (ratio := ratio_of([one for one in every if one.scenario.spread == spread])) is not None
    ]
    told.append(unfinished(every, "longest first", "shortest first"))
    return judge(answers, ratio_of(every), " ".join(filter(None, told)))


def _disastrous(one: Comparison, confidence: float) -> Answer:
    if one.ratio is None:
        return Answer(one.scenario, None)
    _, low, high = one.ratio.ratio(confidence)
    return Answer(one.scenario, True if low > DISASTER else False if high < DISASTER else None)


def derived(found: Sequence[Measured]) -> Finding:
    """The derived ordering is the best for strategy II."""
    ours, rivals = "II/derived", [f"II/{ordering}" for ordering in ("shortest_first", "random", "longest_first")]
    compared = {rival: [one.compare(ours, rival) for one in found] for rival in rivals}
    told = [said(ours, rival, ratio_of(own)) for rival, own in compared.items()]
    told += dict.fromkeys(unfinished(own, ours, rival) for rival, own in compared.items())
    told_all = " ".join(filter(None, told))
    return judge(answers_of(found, ours, rivals), ratio_of(compared[rivals[0]]), told_all)


def derived_instead(found: Sequence[Measured]) -> Finding:
    """The derived ordering beats shortest first."""
    ours, rival = "II/derived", "II/shortest_first"
    compared = [one.compare(ours, rival) for one in found]
    ratio = ratio_of(compared)
    told = " ".join(
        filter(None, [said(ours, rival, ratio), *_by_coverage(compared), unfinished(compared, ours, rival)])
    )
    return judge(answers_of(found, ours, [rival]), ratio, told)


def _by_coverage(compared: Sequence[Comparison]) -> list[str]:
    """The ratio where every robot can do every task, and where not."""
    told = []
    for everybody, where in ((True, "every robot can do every task"), (False, "some tasks are not for all robots")):
        own = [one for one in compared if (one.scenario.coverage >= one.scenario.robots) == everybody]
        if (ratio := ratio_of(own)) is not None:
            told.append(f"Where {where}: {ratio.value:.3f} ({ratio.low:.3f} to {ratio.high:.3f}).")
    return told


def _dying(scenario: Scenario) -> bool:
    return scenario.failures > 0 and scenario.heterogeneity >= MILD


ORDERINGS = (
    Claim(
        key="longest-first",
        title="Longest first is a disaster",
        where="section 4, last paragraph but one",
        says="Longest task first is disastrous for heterogeneous teams in which robots may fail: in general each task is tried "
        "by the robot that is worst at it.",
        rule=f"Teams at least mildly heterogeneous ({MILD:g} %) in which robots die, each strategy. Yes: it takes more than "
        f"{DISASTER:g} times as long as shortest first. No: less.",
        effect="longest first / shortest first",
        experiment="orderings",
        wanted=_dying,
        test=disaster,
    ),
    Claim(
        key="derived",
        title="The derived ordering is best",
        where="section 5, paragraphs 3 and 4; Appendix",
        says="What a robot is best at longest first, and the rest shortest first, avoids the trouble of longest first and "
        "gains more than random selection does.",
        rule="Strategy II. Yes: derived beats shortest first, random or longest first and none beats it. No: one beats it.",
        effect="II: derived / shortest first",
        experiment="orderings",
        wanted=anything,
        test=derived,
    ),
)
SMALL_TEAMS = (
    Claim(
        key="derived-in-small-teams",
        title="The derived ordering is better than shortest first, small teams",
        where="section 5, paragraphs 3 to 5",
        says="As above; the comparison with the optimum is made with the derived ordering.",
        rule="Strategy II, teams of up to six. Yes: derived beats shortest first. No: the reverse.",
        effect="II: derived / shortest first",
        experiment="optimum",
        wanted=anything,
        test=derived_instead,
    ),
)
