"""Claims on the strategies: Figures 2 and 3 of the paper, and what section 5 concludes from them.

The boundaries of Figure 2's regions 1 to 4 stand in its drawing and not in the text. So what the text says of a region is
put to the whole grid of tasks per robot and coverage, and where it holds is for the map to show.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np

from lalliance_study.report.claims import (
    Answer,
    Claim,
    Finding,
    anything,
    judge,
    judge_somewhere,
    ratio_of,
    said,
    unfinished,
)
from lalliance_study.report.comparisons import Comparison, Outcome, pooled, strict
from lalliance_study.report.results import Measured
from lalliance_study.report.statistics import trend
from lalliance_study.scenarios import Scenario

#: From which heterogeneity on the paper calls a team heterogeneous, at least mildly, in percent.
MILD = 300.0


def answers_of(found: Sequence[Measured], ours: str, rivals: Sequence[str]) -> list[Answer]:
    """Whether one contender is best: yes if it beats one of its rivals and none beats it, no if one does."""
    compared = [[one.compare(ours, rival) for rival in rivals] for one in found]
    sure = strict([one for row in compared for one in row])
    answers = []
    for row in compared:
        outcomes = {one.outcome(sure) for one in row}
        yes = Outcome.BETTER in outcomes or None
        answers.append(Answer(row[0].scenario, False if Outcome.WORSE in outcomes else yes))
    return answers


def _ratios(found: Sequence[Measured], pairs: Sequence[tuple[str, str]]) -> tuple[list[list[Comparison]], str]:
    """Comparisons of pairs of contenders, and what to say of them."""
    compared = [[one.compare(*pair) for one in found] for pair in pairs]
    told = [said(*pair, ratio_of(own)) for pair, own in zip(pairs, compared, strict=True)]
    open_ends = [unfinished(own, *pair) for pair, own in zip(pairs, compared, strict=True)]
    return compared, " ".join(filter(None, [*told, *dict.fromkeys(open_ends)]))


def best(ordering: str, found: Sequence[Measured]) -> Finding:
    """II is best."""
    one, two, three = (f"{strategy}/{ordering}" for strategy in ("I", "II", "III"))
    compared, told = _ratios(found, [(three, two), (one, two)])
    return judge(answers_of(found, two, [one, three]), ratio_of(compared[0]), told)


def preferred(ours: str, rival: str, found: Sequence[Measured]) -> Finding:
    """In some region one strategy is preferred to another."""
    compared, told = _ratios(found, [("III/shortest_first", "II/shortest_first")])
    return judge_somewhere(answers_of(found, ours, [rival]), ratio_of(compared[0]), told)


def never(found: Sequence[Measured]) -> Finding:
    """I is nowhere better than both of the others."""
    one, two, three = (f"{strategy}/shortest_first" for strategy in ("I", "II", "III"))
    compared, told = _ratios(found, [(one, two), (one, three)])
    sure = strict([each for row in compared for each in row])
    answers = []
    for against_two, against_three in zip(*compared, strict=True):
        superior = against_two.outcome(sure) is against_three.outcome(sure) is Outcome.BETTER
        equalled = against_two.not_better(sure) or against_three.not_better(sure)
        answers.append(Answer(against_two.scenario, False if superior else equalled or None))
    return judge(answers, ratio_of(compared[0]), told)


def changed(strategy: str, better: bool, found: Sequence[Measured]) -> Finding:
    """The random ordering in the place of shortest first makes a strategy better, or else worse."""
    random, shortest = f"{strategy}/random", f"{strategy}/shortest_first"
    ours, rival = (random, shortest) if better else (shortest, random)
    compared, told = _ratios(found, [(random, shortest)])
    return judge(answers_of(found, ours, [rival]), ratio_of(compared[0]), f"{told} {growth(compared[0])}".strip())


def growth(comparisons: Sequence[Comparison]) -> str:
    """By how much a ratio changes with heterogeneity, as a sentence; empty if too little is known."""
    levels = sorted({one.scenario.heterogeneity for one in comparisons})
    ratios = [pooled([one for one in comparisons if one.scenario.heterogeneity == level]) for level in levels]
    known = [(level, ratio) for level, ratio in zip(levels, ratios, strict=True) if ratio is not None]
    if len(known) < 2:
        return ""
    slope = trend(np.log2([1 + level / 100 for level, _ in known]), [ratio for _, ratio in known])
    change, low, high = np.expm1(slope)
    return f"Each doubling of the slowest robot's time changes this by {change:+.1%} ({low:+.1%} to {high:+.1%})."


def _pww(scenario: Scenario) -> bool:
    return scenario.traps == 0


def _stuck(scenario: Scenario) -> bool:
    return scenario.traps > 0


def _mild(scenario: Scenario) -> bool:
    return scenario.heterogeneity >= MILD


_SHORTEST = "Modified shortest first."
FIGURE_2 = (
    Claim(
        key="II-with-PWW",
        title="II is best where work progresses",
        where="Figure 2; section 5, paragraph 2",
        says="With PWW true, II is the strategy to choose in all four regions.",
        rule=f"{_SHORTEST} Yes: II beats I or III and neither beats it. No: one of them beats it.",
        effect="III / II",
        experiment="strategies",
        wanted=_pww,
        test=partial(best, "shortest_first"),
    ),
    Claim(
        key="III-without-PWW",
        title="III is preferred somewhere where robots get stuck",
        where="Figure 2; section 5, paragraph 2",
        says="With PWW false, III is preferred to II in region 3, and in region 2 for mildly heterogeneous teams "
        "(300 to 600 %).",
        rule=f"{_SHORTEST} Yes: III beats II. No: II beats III. It need not be so everywhere.",
        effect="III / II",
        experiment="strategies",
        wanted=_stuck,
        test=partial(preferred, "III/shortest_first", "II/shortest_first"),
    ),
    Claim(
        key="II-without-PWW",
        title="II is preferred elsewhere where robots get stuck",
        where="Figure 2; section 5, paragraph 2",
        says="With PWW false, II is preferred to III in regions 1 and 4, and in region 2 for highly heterogeneous teams.",
        rule=f"{_SHORTEST} Yes: II beats III. No: III beats II. It need not be so everywhere.",
        effect="III / II",
        experiment="strategies",
        wanted=_stuck,
        test=partial(preferred, "II/shortest_first", "III/shortest_first"),
    ),
    Claim(
        key="I-never",
        title="I is never superior",
        where="Figure 2; section 5, paragraph 2",
        says="Strategy I is nowhere superior to both of the others.",
        rule=f"{_SHORTEST} Yes: I is not better than II, or not better than III. No: I beats both.",
        effect="I / II",
        experiment="strategies",
        wanted=anything,
        test=never,
    ),
    Claim(
        key="II-at-random",
        title="II is best under random selection",
        where="section 5, paragraph 2",
        says="With modified random selection II is the strategy to choose everywhere, whether PWW is true or false.",
        rule="Modified random. Yes: II beats I or III and neither beats it. No: one of them beats it.",
        effect="III / II",
        experiment="strategies",
        wanted=anything,
        test=partial(best, "random"),
    ),
)
FIGURE_3 = tuple(
    Claim(
        key=f"random-{strategy}",
        title=f"Random selection {'helps' if better else 'harms'} {strategy}",
        where="Figure 3; section 4, last paragraph",
        says=f"Modified random selection in the place of modified shortest first {effect}, whatever the region.",
        rule=f"Teams at least mildly heterogeneous ({MILD:g} %). Yes: {strategy} is {way} with random selection. "
        "No: the reverse.",
        effect=f"{strategy}: random / shortest first",
        experiment="strategies",
        wanted=_mild,
        test=partial(changed, strategy, better),
    )
    for strategy, better, effect, way in (
        ("I", False, "makes teams under strategy I slower as heterogeneity grows", "slower"),
        ("III", False, "makes teams under strategy III slower as heterogeneity grows", "slower"),
        ("II", True, "makes teams under strategy II quicker", "quicker"),
    )
)
