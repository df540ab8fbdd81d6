"""Verdicts: what is planted in a made-up study is found in it, and nothing else is."""

import math
from collections.abc import Iterable
from itertools import product

import numpy as np
import pytest
from support.made_up_study import Factor, measured

from lalliance_study.report import comparisons, optima, orderings, strategies
from lalliance_study.report.claims import Answer, Claim, Finding, Verdict, judge, judge_somewhere
from lalliance_study.report.comparisons import Outcome, compare
from lalliance_study.report.results import Measured
from lalliance_study.scenarios import Scenario

NAN = math.nan
TEAM = Scenario(robots=5, tasks=10, coverage=3)


def compared(first: list[float], second: list[float]) -> comparisons.Comparison:
    return compare(0, 0, TEAM, np.array(first), np.array(second))


def test_who_is_quicker_by_more_than_the_margin_is_better() -> None:
    quick, slow = [10.0, 11, 12, 13] * 5, [11.0, 12.1, 13.2, 14.3] * 5
    assert compared(quick, slow).outcome() is Outcome.BETTER
    assert compared(slow, quick).outcome() is Outcome.WORSE
    assert compared(quick, quick).outcome() is Outcome.EQUAL


def test_a_difference_within_the_margin_is_none() -> None:
    quick, slow = [10.0, 11, 12, 13] * 5, [10.05, 11.05, 12.06, 13.06] * 5
    assert compared(quick, slow).outcome() is Outcome.EQUAL


def test_few_missions_that_scatter_decide_nothing() -> None:
    found = compared([10.0, 20, 30], [12.0, 19, 33])
    assert found.outcome() is Outcome.UNDECIDED
    assert not found.not_better()


def test_who_finishes_more_is_better_however_slow() -> None:
    found = compared([100.0] * 20, [10.0] * 10 + [NAN] * 10)
    assert found.outcome() is Outcome.BETTER
    assert (found.both, found.only_first, found.only_second, found.neither) == (10, 10, 0, 0)


def test_missions_that_one_did_not_finish_have_no_part_in_the_ratio_and_are_counted() -> None:
    found = compared([10.0, 10, 10, NAN, NAN], [20.0, 20, NAN, 1, NAN])
    assert found.ratio is not None
    assert found.ratio.ratio().value == pytest.approx(0.5)
    assert (found.both, found.only_first, found.only_second, found.neither, found.missions) == (2, 1, 1, 1, 5)


def test_contenders_that_finish_nothing_cannot_be_compared() -> None:
    found = compared([NAN] * 20, [NAN] * 20)
    assert found.ratio is None
    assert found.outcome() is Outcome.UNDECIDED
    assert comparisons.pooled([found]) is None


def test_a_scenario_of_which_few_missions_were_finished_by_both_is_not_pooled() -> None:
    found = compared([10.0] * 20, [10.0] * 9 + [NAN] * 11)
    assert comparisons.pooled([found]) is None


def answers(**yes: tuple[bool | None, ...]) -> list[Answer]:
    """Answers by heterogeneity, as `h400=(True, None)`."""
    scenarios = {name: TEAM.model_copy(update={"heterogeneity": float(name[1:])}) for name in yes}
    return [Answer(scenarios[name], one) for name, own in yes.items() for one in own]


def test_a_claim_that_holds_wherever_it_can_be_told_is_reproduced() -> None:
    assert judge(answers(h100=(True, None), h400=(True,)), None).verdict is Verdict.REPRODUCED


def test_a_claim_that_holds_nowhere_is_not_reproduced() -> None:
    assert judge(answers(h100=(None,), h400=(None,)), None).verdict is Verdict.NOT_REPRODUCED
    assert judge(answers(h100=(True,), h400=(False,) * 9), None).verdict is Verdict.NOT_REPRODUCED


def test_a_claim_depends_on_what_tells_most_about_the_answers() -> None:
    found = judge(answers(h100=(True,) * 8, h400=(False,) * 7 + (True,)), None)
    assert found.word == "depends on heterogeneity"
    assert "heterogeneity: 100 % (0 of 8), 400 % (7 of 8)" in found.detail


def test_a_region_is_a_twentieth_of_the_scenarios() -> None:
    assert judge_somewhere(answers(h100=(True,) + (False,) * 19), None).verdict is Verdict.REPRODUCED
    assert judge_somewhere(answers(h100=(True,) + (False,) * 20), None).verdict is Verdict.NOT_REPRODUCED


HETEROGENEITIES = (0.0, 100.0, 400.0, 800.0)


def scenarios(**fields: Iterable[object]) -> list[Scenario]:
    """Scenarios of all combinations of some fields and heterogeneities."""
    combined = product(HETEROGENEITIES, *fields.values())
    return [
        TEAM.model_copy(update={"heterogeneity": level, **dict(zip(fields, values, strict=True))})
        for level, *values in combined
    ]


def claim_of(key: str) -> Claim:
    every = (*strategies.FIGURE_2, *strategies.FIGURE_3, *orderings.ORDERINGS, *orderings.SMALL_TEAMS)
    return next(one for one in (*every, *optima.NEAR_THE_OPTIMUM, *optima.GROWTH) if one.key == key)


def verdict(key: str, found: Iterable[Measured]) -> Finding:
    claim = claim_of(key)
    return claim.judged([one for one in found if claim.wanted(one.scenario)])


def figure_2(scenario: Scenario, contender: str) -> float:
    """II is best, but III where robots get stuck in a heterogeneous team."""
    strategy = contender.partition("/")[0]
    if scenario.heterogeneity and scenario.traps:
        return {"I": 1.5, "II": 1.3, "III": 1.2}[strategy]
    return {"I": 1.2, "II": 1.1, "III": 1.3}[strategy]


def test_figure_2_is_found_where_it_was_planted() -> None:
    found = measured(scenarios(traps=(0.0, 0.2)), figure_2)
    with_pww = verdict("II-with-PWW", found)
    assert with_pww.verdict is Verdict.REPRODUCED
    assert with_pww.effect == pytest.approx((1.3 / 1.1,) * 3, rel=0.01)
    without = verdict("III-without-PWW", found)
    assert without.verdict is Verdict.REPRODUCED
    assert "Yes say, by heterogeneity: 0 % (0 of 1), 100 % (1 of 1), 400 % (1 of 1), 800 % (1 of 1)" in without.detail
    assert verdict("II-without-PWW", found).verdict is Verdict.REPRODUCED
    assert verdict("I-never", found).verdict is Verdict.REPRODUCED


def test_a_region_that_is_nowhere_is_not_reproduced() -> None:
    found = measured(scenarios(traps=(0.2,)), lambda _, contender: 1.1 if contender.startswith("II/") else 1.3)
    assert verdict("III-without-PWW", found).verdict is Verdict.NOT_REPRODUCED


def test_a_strategy_that_is_superior_somewhere_is_told_where() -> None:
    def superior(scenario: Scenario, contender: str) -> float:
        return 1.0 if contender.startswith("I/") and scenario.heterogeneity < 300 else 1.1

    found = verdict("I-never", measured(scenarios(coverage=(2, 3, 5)), superior))
    assert found.word == "depends on heterogeneity"
    assert "No say, by heterogeneity: 0 % (3 of 3), 100 % (3 of 3), 400 % (0 of 3), 800 % (0 of 3)" in found.detail


def test_a_strategy_that_is_as_good_as_the_best_is_not_superior() -> None:
    found = measured(scenarios(coverage=(2, 3)), lambda _, contender: 1.3 if contender.startswith("III/") else 1.1)
    assert verdict("I-never", found).verdict is Verdict.REPRODUCED


def test_figure_3_is_found_where_it_was_planted() -> None:
    def figure_3(scenario: Scenario, contender: str) -> float:
        if contender.endswith("shortest_first"):
            return 1.0
        return 0.9 if contender.startswith("II/") else 1 + scenario.heterogeneity / 1000

    found = measured(scenarios(coverage=(2, 3)), figure_3)
    for key in ("random-I", "random-II", "random-III"):
        assert verdict(key, found).verdict is Verdict.REPRODUCED, key
    assert verdict("random-II", measured(scenarios(), lambda _, name: 1.2 if "random" in name else 1.0)).verdict is (
        Verdict.NOT_REPRODUCED
    )


def test_a_ratio_that_grows_with_heterogeneity_says_by_how_much() -> None:
    """From 400 to 800 % the slowest robot's time grows from 5 to 9 times the fastest one's, and the ratio from 1.4 to 1.8."""
    found = measured(
        scenarios(), lambda one, name: 1.0 if name.endswith("shortest_first") else 1 + one.heterogeneity / 1000
    )
    assert (1.8 / 1.4) ** (1 / math.log2(9 / 5)) == pytest.approx(1.345, abs=0.001)
    assert "Each doubling of the slowest robot's time changes this by +34." in verdict("random-I", found).detail


def test_a_disaster_for_some_spreads_depends_on_them() -> None:
    def disaster(scenario: Scenario, contender: str) -> float:
        return 3.0 if contender.endswith("longest_first") and scenario.spread != "related" else 1.0

    spreads = ("unrelated", "related", "log_uniform")
    found = verdict("longest-first", measured(scenarios(spread=spreads, failures=(0.3,)), disaster))
    assert found.word == "depends on how times are spread"
    assert "Of unrelated times: 3.0" in found.detail
    assert "Of related times: 1.0" in found.detail


def test_an_ordering_that_nobody_beats_is_best() -> None:
    found = measured(scenarios(coverage=(2, 5)), lambda _, contender: 1.0 if contender.endswith("derived") else 1.2)
    assert verdict("derived", found).verdict is Verdict.REPRODUCED


def test_an_ordering_that_needs_all_to_hear_all_depends_on_that() -> None:
    def heard(scenario: Scenario, contender: str) -> float:
        if not contender.endswith("derived"):
            return 1.2
        return 1.3 if scenario.coverage < scenario.robots else 1.1

    sizes = [one.model_copy(update={"robots": robots}) for one in scenarios(coverage=(2, 3)) for robots in (2, 3, 4)]
    found = verdict("derived-in-small-teams", measured([one for one in sizes if one.coverage <= one.robots], heard))
    assert found.word == "depends on whether every robot can do every task"
    assert "Where every robot can do every task: 0.91" in found.detail
    assert "Where some tasks are not for all robots: 1.083" in found.detail


@pytest.mark.parametrize(
    ("factor", "expected"),
    [
        (lambda *_: 1.1, "reproduced"),
        (lambda *_: 1.3, "not reproduced"),
        (lambda scenario, _: 1.1 if scenario.heterogeneity < 300 else 1.3, "depends on heterogeneity"),
    ],
)
def test_within_20_percent_is_judged_scenario_by_scenario(factor: Factor, expected: str) -> None:
    many = scenarios(coverage=range(1, 5), tasks=range(1, 32))
    assert len(many) == optima.SCENARIOS
    assert verdict("near-the-optimum", measured(many, factor)).word == expected


def test_optima_that_are_not_proven_do_not_count() -> None:
    many = scenarios(coverage=range(1, 5), tasks=range(1, 32))
    found = verdict("near-the-optimum", measured(many, lambda *_: 1.1, proven=False))
    assert found.verdict is Verdict.TOO_FEW
    assert found.detail == "Every optimum is proven in 0 of 496 scenarios; the claim is of 496."


def test_growth_is_told_by_the_doubling_of_the_size() -> None:
    sizes = [Scenario(robots=robots, tasks=2 * robots, coverage=2, heterogeneity=100) for robots in (2, 4, 8, 16)]
    found = verdict("growth", measured(sizes, lambda one, _: 1.1 * 1.05 ** math.log2(one.robots)))
    assert found.verdict is Verdict.ANSWERED
    assert found.effect == pytest.approx((1.1 * 1.05**4,) * 3, rel=0.01)
    assert "each doubling of the number of tasks multiplies it by 1.0" in found.detail


def test_few_missions_are_not_judged() -> None:
    assert verdict("II-with-PWW", measured(scenarios(), figure_2, missions=19)).verdict is Verdict.TOO_FEW


def test_what_was_not_run_is_not_judged() -> None:
    assert verdict("derived", []).verdict is Verdict.NOT_RUN
