"""Each equation of the Appendix against values worked out by hand; the arithmetic stands beside the value."""

import math

import pytest

from lalliance_agents.model import equations as eq
from lalliance_agents.model.events import OCCASIONS, REASONS_TO_STOP, Cause
from lalliance_agents.model.parameters import SLACK, Ordering, Strategy

HALF = SLACK / 2
TWICE = SLACK * 2


@pytest.mark.parametrize(
    ("value", "exceeds", "reached"),
    [
        (4.9, False, False),
        (5.0 - TWICE, False, False),
        (5.0 - HALF, False, True),
        (5.0, False, True),
        (5.0 + HALF, False, True),
        (5.0 + TWICE, True, True),
        (0.1 * 3 - 0.3 + 5.0, False, True),
    ],
)
def test_a_limit_is_reached_within_slack_and_exceeded_beyond_it(value: float, exceeds: bool, reached: bool) -> None:
    assert (eq.more_than(value, 5.0), eq.reaches(value, 5.0)) == (exceeds, reached)


@pytest.mark.parametrize(
    ("instant", "closed", "open_"),
    [
        (1.0, False, False),  # the earlier end belongs to the window before
        (1.0 + HALF, False, True),
        (1.0 + TWICE, True, True),
        (1.5, True, True),
        (2.0, True, False),  # the later end belongs to this window
        (2.0 + HALF, True, False),
        (2.0 + TWICE, False, False),
        (-math.inf, False, False),
    ],
)
def test_a_window_is_open_at_its_earlier_and_closed_at_its_later_end(instant: float, closed: bool, open_: bool) -> None:
    assert eq.in_window(instant, 1.0, 2.0) is closed
    assert eq.in_window(instant, 1.0, 2.0, closed=False) is open_


def test_a_window_since_ever_takes_all_that_is_not_later() -> None:
    assert eq.in_window(-5.0, -math.inf, 2.0)
    assert not eq.in_window(2.1, -math.inf, 2.0)


@pytest.mark.parametrize(
    ("samples", "floor", "expected"),
    [
        ([7.0], 0.0, 7.0),  # one sample has deviation 0
        ([4.0, 4.0, 4.0], 0.0, 4.0),
        ([2.0, 4.0], 0.0, 3.0 + 1.0),  # deviations -1 and 1: sqrt(2 / 2)
        ([2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0], 0.0, 5.0 + 2.0),  # sqrt((9 + 1 + 1 + 1 + 0 + 0 + 4 + 16) / 8) = 2
        ([1.0, 2.0, 3.0], 0.0, 2.0 + math.sqrt(2 / 3)),
        ([2.0, 4.0], 3.9, 4.0),
        ([2.0, 4.0], 4.1, 4.1),
    ],
)
def test_task_time_is_mean_plus_population_deviation_and_at_least_the_floor(
    samples: list[float], floor: float, expected: float
) -> None:
    assert eq.task_time(samples, floor) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(
    ("own", "best", "anybody", "knows", "ordering", "category"),
    [
        (5.0, 5.0, False, True, Ordering.DERIVED, 1),
        (5.0 + HALF, 5.0, False, True, Ordering.DERIVED, 1),
        (5.0 + TWICE, 5.0, False, True, Ordering.DERIVED, 2),
        (5.0, 4.0, False, True, Ordering.DERIVED, 2),
        (5.0, 5.0, True, True, Ordering.DERIVED, 2),  # somebody is on it
        (5.0, 5.0, False, False, Ordering.DERIVED, 2),  # no knowledge of any teammate: all tasks are of category 2
        (5.0, math.inf, False, True, Ordering.DERIVED, 2),  # literal erratum 3: nobody is present
        (math.nan, math.nan, False, True, Ordering.DERIVED, 2),  # literal erratum 10
        (5.0, 5.0, False, True, Ordering.MODIFIED_SHORTEST_FIRST, 1),
        (5.0, 5.0, False, True, Ordering.MODIFIED_RANDOM, 1),
        (9.0, 4.0, False, False, Ordering.LONGEST_FIRST, 1),  # no best-robot category
        (9.0, 4.0, True, False, Ordering.LONGEST_FIRST, 2),
    ],
)
def test_category_1_is_what_this_robot_does_best_and_nobody_is_on(
    own: float, best: float, anybody: bool, knows: bool, ordering: Ordering, category: int
) -> None:
    assert eq.task_category(own, best, anybody, knows, ordering) == category


def test_boredom_is_its_rate_times_the_idle_time() -> None:
    assert eq.boredom(0.8, 0.0) == 0.0
    assert eq.boredom(0.8, 1.5) == pytest.approx(1.2)  # 0.8 * 1.5


@pytest.mark.parametrize(
    ("bored", "category", "influence"),
    [(0.0, 1, 1), (0.0, 2, 0), (1.0 - TWICE, 2, 0), (1.0 - HALF, 2, 1), (1.0, 2, 1), (3.0, 2, 1)],
)
def test_a_task_is_left_to_better_teammates_until_boredom_reaches_its_threshold(
    bored: float, category: int, influence: int
) -> None:
    assert eq.learned_robot_influence(bored, 1.0, category) == influence


def test_learning_impatience_is_0_while_anybody_is_on_the_task() -> None:
    assert (eq.learning_impatience(anybody_on_task=True), eq.learning_impatience(anybody_on_task=False)) == (0, 1)


def test_only_strategy_iii_grants_a_teammate_its_own_time() -> None:
    assert [eq.patience(strategy, 8.0, 20.0) for strategy in Strategy] == [8.0, 8.0, 20.0]


def test_only_strategy_ii_holds_itself_to_the_best_of_the_team() -> None:
    assert [eq.yield_time(strategy, 8.0, 5.0) for strategy in Strategy] == [8.0, 5.0, 8.0]


def test_the_slow_rate_reaches_the_threshold_as_patience_ends() -> None:
    assert eq.slow_rate(1.0, 8.0) == 0.125  # 1 / 8
    assert eq.slow_rate(3.0, 8.0) * 8.0 == 3.0


@pytest.mark.parametrize(
    ("low", "high", "scale"),
    [
        (5.0, 25.0, 0.04),  # (1.0 - 0.2) / (25 - 5)
        (5.0, 5.0, 0.0),
        (5.0, 5.0 + HALF, 0.0),  # the same but for rounding
        (math.nan, math.nan, 0.0),
    ],
)
def test_scale_spreads_the_delays_over_the_known_times(low: float, high: float, scale: float) -> None:
    assert eq.scale_factor(0.2, 1.0, low, high) == pytest.approx(scale)


def test_scale_is_0_where_both_delays_are_the_same() -> None:
    assert eq.scale_factor(0.5, 0.5, 5.0, 25.0) == 0.0


@pytest.mark.parametrize(
    ("ordering", "category", "own", "expected"),
    [
        (Ordering.DERIVED, 1, 5.0, 1.0),  # longest first: 1.0 - (5 - 5) * 0.04
        (Ordering.DERIVED, 1, 15.0, 0.6),  # 1.0 - (15 - 5) * 0.04
        (Ordering.DERIVED, 1, 25.0, 0.2),  # 1.0 - (25 - 5) * 0.04
        (Ordering.DERIVED, 2, 5.0, 0.2),  # shortest first: 0.2 + (5 - 5) * 0.04
        (Ordering.DERIVED, 2, 20.0, 0.8),  # 0.2 + (20 - 5) * 0.04
        (Ordering.DERIVED, 2, 25.0, 1.0),  # 0.2 + (25 - 5) * 0.04
        (Ordering.MODIFIED_SHORTEST_FIRST, 1, 20.0, 0.8),
        (Ordering.MODIFIED_SHORTEST_FIRST, 2, 20.0, 0.8),
        (Ordering.LONGEST_FIRST, 1, 20.0, 0.4),  # 1.0 - (20 - 5) * 0.04
        (Ordering.LONGEST_FIRST, 2, 20.0, 0.4),
        (Ordering.MODIFIED_RANDOM, 1, 20.0, 0.4),  # 0.2 + 0.25 * (1.0 - 0.2)
        (Ordering.MODIFIED_RANDOM, 2, 5.0, 0.4),
    ],
)
def test_delay_follows_the_ordering(ordering: Ordering, category: int, own: float, expected: float) -> None:
    delay = eq.delay(ordering, category, own, low=5.0, scale=0.04, min_delay=0.2, max_delay=1.0, draw=0.25)
    assert delay == pytest.approx(expected)


def test_where_all_times_are_the_same_category_1_waits_longest_and_category_2_shortest() -> None:
    """The Appendix gives a delay to each category even where the scale has nothing to spread."""
    delays = [eq.delay(Ordering.DERIVED, category, 5.0, 5.0, 0.0, 0.2, 1.0, 0.0) for category in (1, 2)]
    assert delays == [1.0, 0.2]


def test_the_fast_rate_reaches_the_threshold_after_the_delay() -> None:
    assert eq.fast_rate(1.0, 0.4) == 2.5  # 1 / 0.4


@pytest.mark.parametrize(
    ("now", "before", "holds"), [(True, False, True), (True, True, False), (False, False, False), (False, True, False)]
)
def test_a_teammate_holds_back_while_heard_and_not_for_longer_than_patience(
    now: bool, before: bool, holds: bool
) -> None:
    assert eq.holds_back(now, before) is holds


def test_impatience_is_reset_in_the_step_of_the_first_message() -> None:
    assert (eq.impatience_reset(first_heard_now=True), eq.impatience_reset(first_heard_now=False)) == (0, 1)


def test_lambda_is_a_multiple_of_the_own_time() -> None:
    assert eq.give_up_time(2.0, 7.5) == 15.0


@pytest.mark.parametrize(
    ("active_for", "contender", "acquiescence"),
    [
        (0.0, True, 1),
        (5.0, True, 1),  # "more than" is strict
        (5.0 + HALF, True, 1),
        (5.0 + TWICE, True, 0),
        (9.0, False, 1),  # nobody to yield to
        (10.0 + HALF, False, 1),
        (10.0 + TWICE, False, 0),  # lambda asks for no contender
        (99.0, True, 0),
    ],
)
def test_acquiescence_is_0_after_psi_with_a_contender_and_after_lambda_without(
    active_for: float, contender: bool, acquiescence: int
) -> None:
    assert eq.acquiescence(active_for, 5.0, contender, 10.0) == acquiescence


def test_lambda_below_psi_ends_the_attempt_first() -> None:
    assert eq.acquiescence(4.0, 5.0, contender=True, lambda_=3.0) == 0


def test_unknown_and_infinite_limits_are_never_exceeded() -> None:
    assert eq.acquiescence(1e9, math.nan, contender=True, lambda_=math.inf) == 1


@pytest.mark.parametrize(
    ("own", "theirs", "collides"),
    [
        (3.0, 3.0, True),
        (3.0, 3.4, True),
        (3.4, 3.0, True),
        (3.0, 3.4 + HALF, True),
        (3.0, 3.4 + TWICE, False),
        (3.0, -math.inf, False),
        (3.0, math.nan, False),
    ],
)
def test_starts_within_the_window_collide(own: float, theirs: float, collides: bool) -> None:
    assert eq.collides(own, theirs, 0.4) is collides


def test_motivation_adds_the_increment_and_multiplies_the_factors() -> None:
    assert eq.motivation(0.5, 0.25, 1, 1, 1, 1, 1) == 0.75


@pytest.mark.parametrize("zero", range(5))
def test_each_factor_alone_takes_motivation_to_0(zero: int) -> None:
    factors = [0 if place == zero else 1 for place in range(5)]
    assert eq.motivation(0.5, 0.25, *factors) == 0.0


@pytest.mark.parametrize(
    ("rate", "limit", "at"),
    [(0.5, 1.0, 2.0 + 2.0), (0.5, 0.0, 2.0), (0.0, 1.0, math.inf), (-1.0, 1.0, math.inf)],  # 0 + 0.5 (t - 2) = limit
)
def test_a_ramp_reaches_its_limit_when_it_has_grown_to_it(rate: float, limit: float, at: float) -> None:
    found = eq.ramp_reaches(0.0, 2.0, rate, limit)
    assert found == pytest.approx(at)
    grown = [rate * (instant - 2.0) for instant in (found - TWICE, found + HALF)]
    assert math.isinf(found) or [eq.reaches(value, limit) for value in grown] == [False, True]


@pytest.mark.parametrize(
    ("longest", "floor", "expected"),
    [(0.0, 0.0, 30.0), (12.0, 0.0, 12.0), (12.0, 20.0, 20.0), (0.0, 20.0, 30.0), (0.0, 40.0, 40.0)],
)
def test_an_unknown_time_is_the_longest_known_or_the_initial_one_and_at_least_the_floor(
    longest: float, floor: float, expected: float
) -> None:
    assert eq.presumed_time(longest, 30.0, floor) == expected


def test_a_failed_attempt_raises_the_floor_and_never_lowers_it() -> None:
    assert eq.censored(0.0, 2.0, 7.0) == 14.0  # 2 * 7
    assert eq.censored(20.0, 2.0, 7.0) == 20.0


def test_a_time_is_but_a_bound_while_it_does_not_exceed_the_floor() -> None:
    assert [eq.is_bound(time, floor) for time, floor in ((14.0, 14.0), (15.0, 14.0), (14.0, 0.0))] == [
        True,
        False,
        False,
    ]


def test_an_attempt_that_did_its_task_at_once_still_leaves_a_time() -> None:
    assert (eq.credited(3.0, 8.0), eq.credited(3.0, 3.0)) == (5.0, SLACK)


@pytest.mark.parametrize(
    ("elapsed", "trace", "there", "may"),
    [
        (0.3, False, False, False),
        (0.3, False, True, True),  # still heard on the task: it may have done it, however short
        (0.4, False, False, False),  # the window's end belongs to it
        (0.4 + TWICE, True, False, True),
    ],
)
def test_an_attempt_within_the_collision_window_leaves_no_trace(
    elapsed: float, trace: bool, there: bool, may: bool
) -> None:
    assert eq.leaves_no_trace(elapsed, 0.4) is not trace
    assert eq.may_have_done(elapsed, 0.4, there) is may


@pytest.mark.parametrize(
    ("active_for", "now", "same"),
    [
        (3.2, 5.2, True),  # 0.2 s after it said 3.0
        (3.0, 5.2, True),  # delayed, or its clock stood still
        (2.9, 5.2, False),  # a falling number is a new attempt
        (3.1, 9.2, False),  # begun at 6.1, when it had been silent for more than tau = 1 since 5.0
        (3.3, 9.2, True),  # begun at 5.9
    ],
)
def test_a_message_belongs_to_an_attempt_that_it_can_have_begun_in(active_for: float, now: float, same: bool) -> None:
    assert eq.goes_on(active_for, 3.0, 5.0, now, 1.0) is same


@pytest.mark.parametrize(
    ("own", "theirs", "first", "gives"),
    [(8.0, 5.0, False, True), (5.0, 8.0, True, False), (5.0, 5.0, True, True), (5.0, 5.0, False, False)],
)
def test_the_slower_gives_way_and_between_equals_the_later_name(
    own: float, theirs: float, first: bool, gives: bool
) -> None:
    assert eq.gives_way(own, theirs, first) is gives


def test_an_announcement_is_made_by_the_step_nearest_to_its_instant() -> None:
    steps = [0.0, 0.1, 0.2, 0.3]
    assert [min(step for step in steps if step >= eq.announces_from(due, 0.1)) for due in (0.04, 0.1, 0.16, 0.24)] == [
        0.0, 0.1, 0.2, 0.2
    ]  # fmt: skip


@pytest.mark.parametrize("elsewhere", [True, False])
def test_a_teammate_is_heard_while_idle_and_on_what_is_shared_and_else_as_the_reading_says(elsewhere: bool) -> None:
    assert eq.is_heard(True, False, elsewhere)
    assert eq.is_heard(False, True, elsewhere)
    assert eq.is_heard(False, False, elsewhere) is elsewhere


def test_why_a_task_on_which_somebody_was_heard_can_be_taken() -> None:
    asked = [(False, True), (True, True), (True, False)]
    assert [OCCASIONS[eq.occasion(*one)] for one in asked] == [Cause.IMPATIENCE, Cause.RELEASED, Cause.SILENCE]


def test_of_several_reasons_to_stop_the_first_counts() -> None:
    going_on = [False, 1, False, False, False, 1, 1, 1, 1]
    stopped = [True, 0, True, True, True, 0, 0, 0, 0]
    assert eq.reason_to_stop(*going_on) == -1
    for place in range(len(REASONS_TO_STOP)):
        assert eq.reason_to_stop(*going_on[:place], *stopped[place:]) == place
        assert eq.reason_to_stop(*going_on[:place], stopped[place], *going_on[place + 1 :]) == place
