"""How far from the optimum: the paper's 20 %, and its open question how that grows."""

from collections.abc import Sequence

import numpy as np

from lalliance_study.report import statistics
from lalliance_study.report.claims import Answer, Claim, Finding, Verdict, anything, judge
from lalliance_study.report.results import Measured
from lalliance_study.report.statistics import Estimate, LogRatio
from lalliance_study.scenarios import Scenario

DERIVED = "II/derived"
#: What the paper calls near to the optimum, and for how many scenarios it says so.
NEAR, SCENARIOS = 1.20, 496


def proven(found: Sequence[Measured]) -> list[Measured]:
    """Those scenarios in which every optimum is proven."""
    return [one for one in found if one.proven.all()]


def near(found: Sequence[Measured]) -> Finding:
    """Within 20 % of the optimum, scenario by scenario."""
    sound = proven(found)
    told = f"Every optimum is proven in {len(sound)} of {len(found)} scenarios"
    if len(sound) < SCENARIOS:
        return Finding(Verdict.TOO_FEW, detail=f"{told}; the claim is of {SCENARIOS}.")
    level = 1 - (1 - statistics.CONFIDENCE) / len(sound)
    answers, finished = [], [one for one in sound if len(one.ratios(DERIVED)) > 1]
    for one in finished:
        mean = statistics.mean(one.ratios(DERIVED), level)
        answers.append(Answer(one.scenario, False if mean.low > NEAR else True if mean.high <= NEAR else None))
    every = np.concatenate([one.ratios(DERIVED) for one in finished])
    missions = sum(one.missions for one in sound)
    share = statistics.proportion(int((every <= NEAR).sum()), missions)
    means = [float(one.ratios(DERIVED).mean()) for one in finished]
    detail = (
        f"{told}. The mean ratio of a scenario is {max(means):.3f} at most, and {NEAR:.2f} or less in "
        f"{sum(mean <= NEAR for mean in means)} of them. Of {missions:,} single missions "
        f"{share.value:.1%} ({share.low:.1%} to {share.high:.1%}) are so near; the farthest takes {every.max():.2f} times the "
        "optimum."
    )
    if missions > len(every):
        detail += f" {missions - len(every):,} missions were not finished and count as not near."
    return judge(answers, statistics.pooled_mean([one.ratios(DERIVED) for one in finished]), detail)


def log_mean(ratios: statistics.Floats) -> LogRatio:
    """The logarithm of a mean ratio, with its error."""
    return statistics.log_ratio(ratios, np.ones_like(ratios))


def grows(found: Sequence[Measured]) -> Finding:
    """How the ratio grows with the size of the problem, at each heterogeneity."""
    told, effects = [], []
    for heterogeneity in sorted({one.scenario.heterogeneity for one in found}):
        own = [one for one in found if one.scenario.heterogeneity == heterogeneity and len(one.ratios(DERIVED)) > 1]
        if len(own) < 3:
            continue
        own.sort(key=lambda one: one.scenario.tasks)
        ratios = [log_mean(one.ratios(DERIVED)) for one in own]
        slope = statistics.trend(np.log2([one.scenario.tasks for one in own]), ratios)
        effects.append(ratios[-1].ratio())
        told.append(
            f"At {heterogeneity:g} %: {spelled(ratios[0].ratio())} at {size(own[0].scenario)}, {spelled(effects[-1])} at "
            f"{size(own[-1].scenario)}{_unproven(own[-1])}; each doubling of the number of tasks multiplies it by "
            f"{spelled(Estimate(*map(float, np.exp(slope))))}."
        )
    if not told:
        return Finding(Verdict.TOO_FEW, detail="Growth needs three sizes.")
    return Finding(Verdict.ANSWERED, effect=effects[0], detail=" ".join(told))


def spelled(estimate: Estimate) -> str:
    """A value and its interval."""
    return f"{estimate.value:.3f} ({estimate.low:.3f} to {estimate.high:.3f})"


def size(scenario: Scenario) -> str:
    """Robots, tasks and coverage, as the paper writes them."""
    return f"({scenario.robots}, {scenario.tasks}, {scenario.coverage})"


def _unproven(one: Measured) -> str:
    """What is to be said where optima are not proven."""
    unproven = int((~one.proven).sum())
    if not unproven:
        return ""
    most = one.ratios(DERIVED, one.bound).mean()
    return f" (of {one.missions} optima {unproven} are not proven: the ratio to the optimum is {most:.3f} at most)"


NEAR_THE_OPTIMUM = (
    Claim(
        key="near-the-optimum",
        title="Within 20 % of the optimum",
        where="section 5, last paragraph but two",
        says=f"In {SCENARIOS} scenarios of regions 1 to 3, small enough for the optimum to be computed, the derived strategy "
        "performs within 20 % of it.",
        rule=f"Scenarios in which every optimum is proven, at least {SCENARIOS}. Yes: the mean of makespan / optimum is "
        f"{NEAR:.2f} at most. No: it is more.",
        effect="mean of makespan / optimum",
        experiment="optimum",
        wanted=anything,
        test=near,
    ),
)
GROWTH = (
    Claim(
        key="growth",
        title="How does this grow with the size of the problem?",
        where="section 5, last paragraph but two: a topic of future research",
        says="Not answered: the key issue is how seriously the performance degrades as the problem grows.",
        rule="The mean of makespan / optimum at each size, and a straight line through its logarithm against that of the "
        "number of tasks. Where an optimum is not proven, the best schedule known is in its place.",
        effect="ratio at the largest size",
        experiment="growth",
        wanted=anything,
        test=grows,
    ),
)
