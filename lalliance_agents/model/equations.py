"""The Appendix, one formula a function.

Every function here is a pure function of numbers: no records, no names, no clock. The robot, the simulator and the
compiled kernel call these same functions, so nothing in this file may use more than arithmetic, comparisons, loops over a
sequence and the integer enumerations of `parameters`. Times are in seconds, rates per second. Where the literal text does
not work (`Erratum` in `parameters`), the reading is a boolean argument or the caller's choice of inputs.

Symbols: i is the robot itself, k a teammate, j a task; theta the threshold, tau the silence timeout, phi the patience, psi
the time before yielding, lambda the time before giving up, delta_slow and delta_fast the two rates of impatience.
"""

import math
from collections.abc import Sequence

from lalliance_agents.model.parameters import SLACK, Ordering, Strategy


def more_than(value: float, limit: float) -> bool:
    """Whether `value` exceeds `limit` strictly, beyond rounding (erratum 7)."""
    return value > limit + SLACK


def reaches(value: float, limit: float) -> bool:
    """Whether `value` is at least `limit`, but for rounding (erratum 7)."""
    return value >= limit - SLACK


def ramp_reaches(base: float, since: float, rate: float, limit: float) -> float:
    """The instant from which a ramp `reaches` the limit, in seconds; infinity if it never does.

    Args:
        base: its value at `since`.
        since: an instant, in seconds.
        rate: its growth, per second.
        limit: what is to be reached.
    """
    return since + (limit - SLACK - base) / rate if rate > 0.0 else math.inf


def in_window(instant: float, after: float, until: float, closed: bool = True) -> bool:
    """comm_received: whether an instant lies in (after, until], or, if not `closed`, in (after, until) (erratum 7, literal)."""
    if closed:
        return after + SLACK < instant <= until + SLACK
    return after < instant < until


def task_time(samples: Sequence[float], floor: float = 0.0) -> float:
    """task_time_i(k, j, t): mean of the last mu times plus one population standard deviation, in seconds.

    Args:
        samples: the last mu measured times, at least one, in seconds.
        floor: what a failed attempt has taught the time to be at least (erratum 13), in seconds.
    """
    total = 0.0
    for sample in samples:
        total += sample
    mean = total / len(samples)
    squares = 0.0
    for sample in samples:
        squares += (sample - mean) * (sample - mean)
    return max(mean + math.sqrt(squares / len(samples)), floor)


def presumed_time(longest: float, initial: float, floor: float) -> float:
    """The own task time while it is unknown (erratum 10), in seconds.

    Args:
        longest: the largest time measured of anybody for any task, in seconds; 0 if there is none.
        initial: what it is taken to be then, in seconds.
        floor: what a failed attempt has taught it to be at least (erratum 13), in seconds.
    """
    return max(longest if longest > 0.0 else initial, floor)


def is_bound(time: float, floor: float) -> bool:
    """Whether a time is but the lower bound that a failed attempt has left (erratum 13)."""
    return floor > 0.0 and time <= floor


def censored(floor: float, factor: float, elapsed: float) -> float:
    """The lower bound of a time after one more failed attempt of `elapsed` seconds (erratum 13), in seconds."""
    return max(floor, factor * elapsed)


def credited(started: float, ended: float) -> float:
    """The sample that an attempt leaves which has done its task, in seconds: never 0."""
    return max(ended - started, SLACK)


def leaves_no_trace(elapsed: float, window: float) -> bool:
    """Whether an attempt is so short that it may have ended in a collision (erratum 15): it is as if it had never been."""
    return not more_than(elapsed, window)


def may_have_done(elapsed: float, window: float, there: bool) -> bool:
    """Whether an attempt that is known at a task's completion may have done it (erratum 14).

    Args:
        elapsed: its length as far as it was heard, in seconds.
        window: an attempt no longer than this may have ended in a collision, in seconds.
        there: whether its robot is still heard on the task.
    """
    return more_than(elapsed, window) or there


def goes_on(active_for: float, active_for_before: float, last: float, now: float, tau: float) -> bool:
    """Whether a message belongs to an attempt: not to one begun after it, and not to one begun while nothing was heard.

    Args:
        active_for: how long its robot says to have been active, in seconds.
        active_for_before: what it said in the message before, in seconds.
        last: when that came, in seconds.
        now: when this one came, in seconds.
        tau: the silence timeout, in seconds.
    """
    return active_for >= active_for_before - SLACK and not more_than(now - active_for, last + tau)


def task_category(
    own_time: float, best_time: float, anybody_on_task: bool, knows_teammates: bool, ordering: Ordering
) -> int:
    """task_category_ij(t): 1 for tasks this robot expects to do best and nobody is on, else 2.

    Args:
        own_time: task_time_i(i, j, t), in seconds.
        best_time: the minimum of task_time_i(k, j, t) over the robots present, in seconds; infinite if there is none.
        anybody_on_task: whether a teammate was heard on task j within tau.
        knows_teammates: whether any teammate's time for any task is known (erratum 10).
        ordering: `LONGEST_FIRST` has no best-robot category.
    """
    if anybody_on_task:
        return 2
    if ordering == Ordering.LONGEST_FIRST:
        return 1
    return 1 if knows_teammates and abs(own_time - best_time) <= SLACK else 2


def boredom(rate: float, idle_for: float) -> float:
    """boredom_i(t): the boredom rate summed over the steps since a set was last active.

    Args:
        rate: boredom_rate_i, per second.
        idle_for: time since then, in seconds; 0 while a set is active (erratum 9).
    """
    return rate * idle_for


def learned_robot_influence(bored: float, threshold: float, category: int) -> int:
    """learned_robot_influence_ij(t): 0 while a task is left to teammates that are expected to do it better."""
    return 0 if category == 2 and not reaches(bored, threshold) else 1


def learning_impatience(anybody_on_task: bool) -> int:
    """learning_impatience_ij(t): 0 while a teammate is on the task (active learning phase)."""
    return 0 if anybody_on_task else 1


def patience(strategy: Strategy, own_time: float, their_time: float) -> float:
    """phi_ij(k, t): how long the messages of k hold this robot back, in seconds (Table 1).

    Args:
        strategy: I and II go by the own time, III by that of the robot doing it.
        own_time: task_time_i(i, j, t), in seconds.
        their_time: task_time_i(k, j, t), in seconds.
    """
    return their_time if strategy == Strategy.III else own_time


def slow_rate(threshold: float, patience_time: float) -> float:
    """delta_slow_ij(k, t) = theta / phi, in motivation per second."""
    return threshold / patience_time


def scale_factor(min_delay: float, max_delay: float, low: float, high: float) -> float:
    """scale_factor: the share of delay per second of task time; 0 where all times are the same.

    Args:
        min_delay: shortest delay, in seconds.
        max_delay: longest delay, in seconds.
        low: smallest task time known for a task this robot can do, in seconds.
        high: largest one, in seconds.
    """
    return (max_delay - min_delay) / (high - low) if high - low > SLACK else 0.0


def delay(
    ordering: Ordering,
    category: int,
    own_time: float,
    low: float,
    scale: float,
    min_delay: float,
    max_delay: float,
    draw: float,
) -> float:
    """The time after which a free task is taken, in seconds: the denominator of delta_fast.

    Args:
        ordering: which tasks come first; the Appendix has the derived one.
        category: 1 or 2.
        own_time: task_time_i(i, j, t), in seconds.
        low: smallest task time known, in seconds.
        scale: `scale_factor`.
        min_delay: shortest delay, in seconds.
        max_delay: longest delay, in seconds.
        draw: a number in [0, 1), fixed per robot, task and mission; used by `MODIFIED_RANDOM` alone.
    """
    longest_first = max_delay - (own_time - low) * scale
    shortest_first = min_delay + (own_time - low) * scale
    if ordering == Ordering.MODIFIED_RANDOM:
        return min_delay + draw * (max_delay - min_delay)
    if ordering == Ordering.LONGEST_FIRST:
        return longest_first
    if ordering == Ordering.MODIFIED_SHORTEST_FIRST:
        return shortest_first
    return longest_first if category == 1 else shortest_first


def fast_rate(threshold: float, delay_time: float) -> float:
    """delta_fast_ij(t) = theta / delay, in motivation per second."""
    return threshold / delay_time


def holds_back(heard_now: bool, heard_before_patience: bool) -> bool:
    """Whether k's messages slow the impatience: heard within tau, and not since longer than phi ago."""
    return heard_now and not heard_before_patience


def impatience_reset(first_heard_now: bool) -> int:
    """impatience_reset_ij(t): 0 in the one step in which a teammate is first heard on the task."""
    return 0 if first_heard_now else 1


def yield_time(strategy: Strategy, own_time: float, best_time: float) -> float:
    """psi_ij(t): activity after which the task is yielded to a contender, in seconds (Table 1)."""
    return best_time if strategy == Strategy.II else own_time


def give_up_time(factor: float, own_time: float) -> float:
    """lambda_ij(t): activity after which the task is given up in any case, in seconds (erratum 11)."""
    return factor * own_time


def acquiescence(active_for: float, psi: float, contender: bool, lambda_: float) -> int:
    """acquiescence_ij(t): 0 when the task is to be yielded to a contender, or given up.

    Args:
        active_for: time for which the set has been active, in seconds; 0 if it is not.
        psi: `yield_time`, in seconds.
        contender: whether a teammate was heard on the task within tau.
        lambda_: `give_up_time`, in seconds.
    """
    if contender and more_than(active_for, psi):
        return 0
    return 0 if more_than(active_for, lambda_) else 1


def collides(own_start: float, their_start: float, window: float) -> bool:
    """Whether two starts of the same task are so close that neither could know of the other (erratum 15)."""
    return abs(own_start - their_start) <= window + SLACK


def gives_way(expected: float, their_expected: float, they_come_first: bool) -> bool:
    """Whether a robot gives way to one that started the same task with it (erratum 15).

    Args:
        expected: the time it announced to need, in seconds.
        their_expected: the time the other one announced, in seconds.
        they_come_first: whether the other's name comes first, which decides between equals.
    """
    return their_expected < expected or (their_expected == expected and they_come_first)


def announces_from(due: float, step: float) -> float:
    """The instant from which a control step makes the announcement that is due: it is the first nearest to that instant.

    Args:
        due: when it is due, in seconds.
        step: from one control step to the next, in seconds.
    """
    return due - step / 2 - SLACK


def is_heard(idle: bool, shared: bool, elsewhere: bool) -> bool:
    """Whether a robot hears what a teammate that shares a task with it says (erratum 17).

    Args:
        idle: whether the teammate is on no task.
        shared: whether the robot itself can do the task that the teammate is on.
        elsewhere: whether it hears teammates also on tasks that it cannot do.
    """
    return idle or shared or elsewhere


def occasion(lapsed: bool, present: bool) -> int:
    """Why a task on which somebody was heard can be taken: the place of the cause in `OCCASIONS` of `events`.

    Args:
        lapsed: whether the teammate that was heard last on the task is not heard on it any more.
        present: whether it is heard at all.
    """
    if not lapsed:
        return 1
    return 2 if present else 3


def reason_to_stop(
    complete: bool,
    sensory_feedback: int,
    body_failed: bool,
    rival: bool,
    yields: bool,
    acquiescence: int,
    impatience_reset: int,
    learned_robot_influence: int,
    activity_suppression: int,
) -> int:
    """Why an active set stops, of several reasons the first: its place in `REASONS_TO_STOP` of `events`; -1 if it goes on.

    Args:
        complete: whether the task is complete.
        sensory_feedback: a factor.
        body_failed: whether the robot's own code ended with an error.
        rival: whether it gives way to a teammate that started with it (erratum 15).
        yields: whether acquiescence is 0 because of a contender.
        acquiescence: a factor, like all that follow.
        impatience_reset: see there.
        learned_robot_influence: see there.
        activity_suppression: 0 if another set is active too (erratum 5, literal).
    """
    reasons = (
        complete,
        sensory_feedback == 0,
        body_failed,
        rival,
        yields,
        acquiescence == 0,
        impatience_reset == 0,
        learned_robot_influence == 0,
        activity_suppression == 0,
    )
    for place in range(len(reasons)):
        if reasons[place]:
            return place
    return -1


def motivation(
    previous: float,
    increment: float,
    sensory_feedback: int,
    activity_suppression: int,
    impatience_reset: int,
    acquiescence: int,
    learned_robot_influence: int,
) -> float:
    """m_ij(t), adaptive phase: [m_ij(t-1) + impatience] times the five factors.

    The increment is the rate of impatience times the length of the steps since `previous`; the active learning phase is
    the same product with a random increment and `learning_impatience` in the place of `impatience_reset`.
    """
    return (
        (previous + increment)
        * sensory_feedback
        * activity_suppression
        * impatience_reset
        * acquiescence
        * learned_robot_influence
    )
