"""Performance monitors: which attempts become samples, which become floors, and which leave no trace."""

import math

import pytest

from lalliance_agents.model.monitor import Monitor, Record
from lalliance_agents.model.parameters import Erratum, Parameters, Reading

# tau is 1 s, the collision window 0.4 s, mu 10, a failed attempt counts twice.


def monitor(**changes: object) -> Monitor:
    return Monitor("me", Parameters(**changes))  # type: ignore[arg-type]


def watch(one: Monitor, robot: str, since: float, until: float, period: float = 0.5) -> None:
    """Hear `robot` on the task from `since` to `until`."""
    for step in range(round((until - since) / period) + 1):
        one.observe(robot, since + step * period, step * period)


def test_a_teammates_attempt_becomes_a_sample_when_the_task_is_complete() -> None:
    one = monitor()
    watch(one, "a", 2.0, 7.0)
    one.completed(7.25)
    assert one.records() == {"a": Record((5.25,))}  # 7.25 - 2


def test_an_attempt_first_heard_late_counts_from_its_start() -> None:
    one = monitor()
    one.observe("a", 6.0, 4.0)
    one.completed(7.0)
    assert one.records() == {"a": Record((5.0,))}  # 7 - (6 - 4)


def test_a_message_lost_or_a_long_silence_does_not_end_an_attempt() -> None:
    one = monitor()
    assert one.observe("a", 0.0, 0.0)
    assert not one.observe("a", 0.2, 0.2)
    assert not one.observe("a", 9.0, 9.0)
    one.settle(9.0)
    one.completed(9.5)
    assert one.records() == {"a": Record((9.5,))}


def test_a_falling_active_for_begins_a_new_attempt_and_ends_the_old_one() -> None:
    one = monitor()
    watch(one, "a", 0.0, 3.0)
    assert one.observe("a", 4.0, 0.5)
    assert one.records() == {"a": Record((), 6.0, 10)}  # 2 * (3 - 0)
    one.completed(5.0)
    assert one.count("a") == 0, "the work of the first attempt is in it"


def test_an_equal_active_for_is_the_same_attempt() -> None:
    one = monitor()
    one.observe("a", 1.0, 1.0)
    assert not one.observe("a", 1.1, 1.0)


def test_an_attempt_begun_during_a_silence_is_new_though_active_for_has_not_fallen() -> None:
    one = monitor()
    watch(one, "a", 0.0, 3.0)
    assert one.observe("a", 20.0, 8.0), "begun at 12, last heard at 3"
    assert one.records() == {"a": Record((), 6.0, 10)}


def test_a_late_message_does_not_begin_a_new_attempt() -> None:
    one = monitor()
    one.observe("a", 0.0, 0.0)
    assert not one.observe("a", 0.9, 0.1), "0.8 s late, below tau"


def test_left_then_complete_within_tau_is_a_sample_up_to_the_leaving() -> None:
    one = monitor()
    watch(one, "a", 0.0, 4.0)
    one.elsewhere("a", 4.25)
    one.elsewhere("a", 4.75)
    one.settle(5.25)
    one.completed(5.25)
    assert one.records() == {"a": Record((4.25,))}


def test_left_for_more_than_tau_is_a_failure() -> None:
    one = monitor()
    watch(one, "a", 0.0, 4.0)
    one.elsewhere("a", 4.25)
    one.settle(5.25)
    assert one.records() == {}, "at tau exactly a completion may still be on its way"
    one.settle(5.26)
    assert one.records() == {"a": Record((), 8.0, 10)}  # 2 * 4
    one.completed(5.3)
    assert one.count("a") == 0


def test_one_who_comes_back_to_the_same_attempt_has_not_left() -> None:
    one = monitor()
    watch(one, "a", 0.0, 4.0)
    one.elsewhere("a", 4.25)
    one.observe("a", 4.5, 4.5)
    one.settle(9.0)
    one.completed(9.0)
    assert one.records() == {"a": Record((9.0,))}


def test_silent_then_complete_is_a_sample_if_nobody_else_was_on_the_task() -> None:
    one = monitor()
    watch(one, "a", 0.0, 2.0)
    one.settle(8.0)
    one.completed(8.0)
    assert one.records() == {"a": Record((8.0,))}


def test_silent_and_the_task_completed_by_another_is_a_failure_and_no_sample_for_either() -> None:
    one = monitor()
    watch(one, "a", 0.0, 2.0)
    watch(one, "b", 4.0, 8.0)
    one.completed(8.25)
    assert one.records() == {"a": Record((), 4.0, 10)}  # 2 * 2


def test_two_on_the_task_at_its_end_give_no_sample() -> None:
    one = monitor()
    watch(one, "a", 0.0, 5.0)
    watch(one, "b", 3.0, 5.0)
    one.completed(5.0)
    assert one.records() == {}


def test_the_finisher_of_what_another_left_is_not_credited() -> None:
    one = monitor()
    watch(one, "a", 0.0, 3.0)
    one.elsewhere("a", 3.25)
    watch(one, "b", 3.5, 6.0)
    one.settle(5.0)
    one.completed(6.0)
    assert one.records() == {"a": Record((), 6.0, 10)}


@pytest.mark.parametrize("leaves", ["is heard elsewhere", "falls silent"])
def test_a_collision_does_not_spoil_the_sample(leaves: str) -> None:
    one = monitor()
    one.observe("b", 0.2, 0.1)
    if leaves == "is heard elsewhere":
        one.elsewhere("b", 0.4)
    watch(one, "a", 0.0, 5.0)
    one.settle(3.0)
    one.completed(5.0)
    assert one.records() == {"a": Record((5.0,))}


def test_an_own_collision_does_not_spoil_the_sample_of_the_other() -> None:
    one = monitor()
    one.began(1.0)
    one.observe("a", 1.1, 0.1)
    one.ceased(1.2, failed=False)
    one.completed(6.0)
    assert one.records() == {"a": Record((5.0,))}


@pytest.mark.parametrize(("length", "samples"), [(0.4, 1), (0.5, 0)])
def test_an_attempt_as_short_as_the_collision_window_is_as_if_it_had_never_been(length: float, samples: int) -> None:
    one = monitor()
    one.began(0.0)
    one.ceased(length, failed=False)
    one.began(1.0)
    one.completed(6.0)
    assert one.count("me") == samples
    two = monitor()
    two.observe("a", length, length)
    two.elsewhere("a", length)
    two.settle(2.0)
    two.began(2.5)
    two.completed(6.0)
    assert two.count("me") == samples
    assert two.floor("a") == (0.0 if samples else 1.0)


def test_an_own_short_attempt_that_failed_is_remembered() -> None:
    """Or a robot whose psi is below the collision window would yield and come back for ever."""
    one = monitor()
    one.began(0.0)
    one.ceased(0.3, failed=True)
    assert one.records() == {"me": Record((), 0.6, 10)}


def test_the_own_attempt_is_measured_exactly() -> None:
    one = monitor()
    one.began(1.5)
    one.completed(9.75)
    assert one.records() == {"me": Record((8.25,))}


def test_the_own_attempt_on_what_a_teammate_had_begun_is_no_sample() -> None:
    one = monitor()
    watch(one, "a", 0.0, 3.0)
    one.elsewhere("a", 3.0)
    one.began(3.5)
    one.settle(6.0)
    one.completed(8.0)
    assert one.count("me") == 0


def test_an_own_earlier_attempt_prevents_a_sample_too() -> None:
    one = monitor()
    one.began(0.0)
    one.ceased(3.0, failed=True)
    one.began(5.0)
    one.completed(8.0)
    assert one.records() == {"me": Record((), 6.0, 10)}


def test_an_attempt_ended_without_blame_leaves_no_floor() -> None:
    one = monitor()
    one.began(0.0)
    one.ceased(3.0, failed=False)
    assert one.records() == {}


def test_while_the_task_cannot_be_worked_on_attempts_end_without_blame() -> None:
    one = monitor()
    one.began(0.0)
    watch(one, "a", 0.0, 3.0)
    one.interrupted(3.0)
    one.ceased(3.0, failed=True)
    one.settle(9.0)
    assert one.records() == {}


def test_a_trial_forgets_attempts_and_keeps_samples() -> None:
    one = monitor()
    one.began(0.0)
    one.completed(3.0)
    one.began(4.0)
    one.ceased(6.0, failed=False)
    watch(one, "a", 4.0, 6.0)
    one.new_trial()
    one.began(7.0)
    one.completed(12.0)
    assert one.records() == {"me": Record((3.0, 5.0))}


def test_a_completion_that_nobody_was_heard_on_teaches_nothing() -> None:
    one = monitor()
    one.completed(5.0)
    assert one.records() == {}


def test_a_floor_holds_until_mu_samples_push_it_out() -> None:
    one = monitor(trials=3)
    one.began(0.0)
    one.ceased(5.0, failed=True)
    times = []
    for trial in range(4):
        one.new_trial()
        one.began(10.0 * trial)
        one.completed(10.0 * trial + 4.0)
        times.append((one.task_time("me"), one.floor("me")))
    assert times == [(10.0, 10.0), (10.0, 10.0), (4.0, 0.0), (4.0, 0.0)]


def test_a_further_failure_renews_the_floor_and_never_lowers_it() -> None:
    one = monitor(trials=2)
    for began, ceased in ((0.0, 5.0), (6.0, 8.0)):
        one.began(began)
        one.ceased(ceased, failed=True)
    assert one.records() == {"me": Record((), 10.0, 2)}


def test_a_robot_with_a_floor_and_no_sample_has_no_task_time() -> None:
    one = monitor()
    one.began(0.0)
    one.ceased(5.0, failed=True)
    assert (one.task_time("me"), one.floor("me"), one.extent().low) == (None, 10.0, math.inf)


def test_the_last_mu_samples_are_kept() -> None:
    one = monitor(trials=2)
    for trial, took in enumerate((9.0, 2.0, 4.0)):
        one.new_trial()
        one.began(20.0 * trial)
        one.completed(20.0 * trial + took)
    assert one.records() == {"me": Record((2.0, 4.0))}
    assert one.task_time("me") == 4.0  # mean 3, deviation 1
    assert one.count("me") == 2


def test_a_task_complete_at_once_takes_more_than_no_time() -> None:
    one = monitor()
    one.began(3.0)
    one.completed(3.0)
    time = one.task_time("me")
    assert time is not None
    assert time > 0


def test_what_was_stored_is_restored() -> None:
    one, two = monitor(trials=3), monitor(trials=3)
    one.restore({"a": Record((4.0, 6.0)), "me": Record((), 8.0, 2)})
    two.restore(one.records())
    assert two.records() == {"a": Record((4.0, 6.0)), "me": Record((), 8.0, 2)}
    assert (two.task_time("a"), two.floor("me")) == (6.0, 8.0)


def test_what_was_stored_with_a_larger_mu_is_cut_to_this_one() -> None:
    one = monitor(trials=2)
    one.restore({"a": Record((1.0, 4.0, 6.0), 9.0, 10), "b": Record((3.0,), 9.0, 0)})
    assert one.records() == {"a": Record((4.0, 6.0), 9.0, 2), "b": Record((3.0,))}


def test_read_literally_a_failed_attempt_leaves_no_trace() -> None:
    one = monitor(readings={Erratum.FAILED_ATTEMPTS: Reading.LITERAL})
    one.began(0.0)
    one.ceased(5.0, failed=True)
    assert one.records() == {}


def test_read_literally_all_who_are_on_the_task_at_its_end_are_credited() -> None:
    one = monitor(readings={Erratum.CREDIT: Reading.LITERAL})
    watch(one, "silent", 0.0, 1.0)
    watch(one, "a", 0.0, 5.0)
    watch(one, "b", 3.0, 5.0)
    one.completed(5.0)
    assert one.records() == {"silent": Record((), 2.0, 10), "a": Record((5.0,)), "b": Record((2.0,))}
