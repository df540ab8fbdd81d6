"""All monitors of a robot read together: what stands for unknown times, who is best, low and high."""

import math

import pytest

from lalliance_agents.model.knowledge import Knowledge
from lalliance_agents.model.monitor import Record
from lalliance_agents.model.parameters import Erratum, Parameters, Reading


def knowledge(known: dict[str, dict[str, Record]] | None = None, **changes: object) -> Knowledge:
    """Knowledge of robot "me", which can do x and y."""
    made = Knowledge("me", ["x", "y"], Parameters(**changes))  # type: ignore[arg-type]
    made.restore(known or {})
    return made


def times(**known: float) -> dict[str, Record]:
    return {robot: Record((time,)) for robot, time in known.items()}


def test_the_own_time_is_the_monitors_where_there_is_one() -> None:
    assert knowledge({"x": times(me=5.0)}).own_time("x") == 5.0


def test_the_own_unknown_time_is_the_largest_known_for_any_robot_and_task() -> None:
    assert knowledge({"x": times(me=5.0, a=7.0)}).own_time("y") == 7.0


def test_a_failure_at_one_task_says_nothing_of_another() -> None:
    made = knowledge({"x": {"me": Record((5.0,), 40.0, 1), "a": Record((7.0,), 80.0, 1)}})
    assert (made.own_time("x"), made.own_time("y")) == (40.0, 7.0)


def test_with_nothing_known_the_own_time_is_the_initial_one() -> None:
    assert knowledge(initial_task_time=42.0).own_time("x") == 42.0


def test_a_failed_attempt_raises_the_own_unknown_time() -> None:
    assert knowledge({"x": {"me": Record((), 50.0, 1)}}).own_time("x") == 50.0
    assert knowledge({"x": {"me": Record((), 50.0, 1)}}).own_time("y") == 30.0


def test_an_own_time_that_is_but_a_lower_bound_is_a_failure() -> None:
    failed = {"x": {"me": Record((5.0,), 8.0, 1)}, "y": {"me": Record((5.0,), 2.0, 1)}}
    assert (knowledge(failed).has_failed("x"), knowledge(failed).has_failed("y")) == (True, False)
    assert not knowledge().has_failed("x")
    assert knowledge({"x": {"me": Record((), 50.0, 1)}}).has_failed("x")


def test_read_literally_an_unknown_time_is_undefined() -> None:
    made = knowledge({"x": times(a=7.0)}, readings={Erratum.UNKNOWN_TIMES: Reading.LITERAL})
    assert math.isnan(made.own_time("x"))


def test_the_best_time_is_the_least_of_those_present_and_the_robot_itself() -> None:
    made = knowledge({"x": times(me=6.0, a=5.0, b=4.0)})
    assert made.best_time("x", []) == 6.0
    assert made.best_time("x", ["a"]) == 5.0
    assert made.best_time("x", ["a", "b"]) == 4.0
    assert made.best_time("x", ["stranger"]) == 6.0


def test_read_literally_the_robot_itself_is_not_in_the_minimum() -> None:
    made = knowledge({"x": times(me=3.0, a=5.0)}, readings={Erratum.SELF_PRESENCE: Reading.LITERAL})
    assert made.best_time("x", ["a"]) == 5.0
    assert made.best_time("x", []) == math.inf


def test_low_and_high_range_over_all_robots_and_tasks_known() -> None:
    made = knowledge({"x": times(me=5.0, a=7.0), "y": times(b=2.0)})
    assert made.span() == (2.0, 7.0)
    assert made.scale(2.0, 7.0) == pytest.approx(0.16)  # (1.0 - 0.2) / (7 - 2)


def test_low_and_high_take_in_an_own_time_that_a_failure_has_raised() -> None:
    """Also where there is no sample: what has failed is to be wanted later than what has not been tried."""
    assert knowledge({"x": times(me=5.0, a=7.0), "y": {"me": Record((), 50.0, 1)}}).span() == (5.0, 50.0)
    assert knowledge({"x": {"me": Record((), 50.0, 1)}}).span() == (30.0, 50.0)


def test_with_nothing_known_low_and_high_are_the_initial_time() -> None:
    assert knowledge().span() == (30.0, 30.0)


def test_read_literally_low_and_high_are_undefined_where_nothing_is_known() -> None:
    literal = {Erratum.UNKNOWN_TIMES: Reading.LITERAL}
    assert all(math.isnan(end) for end in knowledge(readings=literal).span())
    assert knowledge({"x": times(me=5.0, a=7.0)}, readings=literal).span() == (5.0, 7.0)


def test_a_teammate_is_known_by_a_time_and_not_by_a_failure() -> None:
    assert not knowledge({"x": times(me=5.0)}).knows_teammates
    assert not knowledge({"x": {"a": Record((), 9.0, 3)}}).knows_teammates
    assert knowledge({"y": times(a=5.0)}).knows_teammates


def test_what_is_learned_later_is_seen() -> None:
    made = knowledge({"x": times(me=5.0)})
    assert (made.span(), made.knows_teammates) == ((5.0, 5.0), False)
    made.monitors["y"].observe("a", 9.0, 9.0)
    made.monitors["y"].completed(9.0)
    assert (made.span(), made.knows_teammates, made.time_of("a", "y")) == ((5.0, 9.0), True, 9.0)


def test_fewest_counts_each_robot_for_each_task_it_shares() -> None:
    made = knowledge({"x": {"me": Record((1.0, 2.0)), "a": Record((3.0,))}, "y": {"me": Record((1.0, 2.0, 3.0))}})
    assert made.fewest({}) == 2
    assert made.fewest({"a": frozenset({"x", "unshared"})}) == 1
    assert made.fewest({"a": frozenset({"x", "y"})}) == 0
    assert Knowledge("me", [], Parameters()).fewest({}) == 0


def test_what_was_learned_is_restored_for_the_tasks_at_hand() -> None:
    learned = {"x": {"me": Record((5.0, 6.0), 8.0, 2)}, "gone": times(a=1.0)}
    made = knowledge(learned)
    assert made.records() == {"x": {"me": Record((5.0, 6.0), 8.0, 2)}, "y": {}}
    again = knowledge(made.records())
    assert again.records() == made.records()
    assert again.own_time("x") == made.own_time("x") == 8.0
