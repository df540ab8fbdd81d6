"""The kernel's minds: the control step of an idle robot, and what all steps have in common.

These are `Mind.tick`, `Appraisal` and `Outlook` of the model, with the same formulas in the same order. A step also finds out
when the next one is needed, as `Mind.wake` and `Mind.next_lapse` do. A motivation is looked at anew only if something was heard
or sensed since, somebody has fallen silent, or it was foreseen to change; else it is but its ramp.
"""

import math

from lalliance_agents.model import equations
from lalliance_agents.model.parameters import EARLY, SLACK
from lalliance_study.compiled import Memory, compiled, inlined
from lalliance_study.kernel_hearing import before, instant, settle, step_from
from lalliance_study.kernel_knowledge import (
    beginning,
    best_time,
    expects_best,
    is_live,
    is_on,
    own_time,
    phi_of,
    read,
    who_is_present,
)
from lalliance_study.kernel_state import INFINITY, NEVER, TASKS, Rules

boredom = equations.boredom
delay_of = equations.delay
fast_rate = equations.fast_rate
holds_back = equations.holds_back
impatience_reset = equations.impatience_reset
in_window = equations.in_window
influence = equations.learned_robot_influence
motivation = equations.motivation
ramp_reaches = equations.ramp_reaches
reaches = equations.reaches
slow_rate = equations.slow_rate
task_category = equations.task_category


@compiled
def begin(w: Memory, rules: Rules, robot: int, now: float, last: float) -> None:
    """What all sets of a robot share at a step: monitors, the roster, the beginning of boredom."""
    if now >= w.r_settle_at[robot] - EARLY:
        soonest = INFINITY
        for index in range(w.r_sets[robot]):
            task = w.set_task[robot * TASKS + index]
            at = task * w.width + w.place[robot * TASKS + task]
            settle(w, rules, robot, at, now)
            if w.p_leavers[at] > 0:
                for pair in range(at * w.width, (at + 1) * w.width):
                    if w.q_trying[pair] and w.q_a_left[pair] < INFINITY:
                        soonest = min(soonest, w.q_a_left[pair] + rules.tau)
        w.r_settle_at[robot] = soonest
    if w.r_waiting[robot] and (w.r_met[robot] == w.r_mates[robot] or reaches(now - w.born, rules.tau)):
        w.r_waiting[robot] = 0
        w.r_idle_since[robot] = last


@inlined
def fast_of(w: Memory, rules: Rules, robot: int, at: int, category: int, own: float) -> float:
    """Appraisal._fast_rate."""
    if not rules.learns:
        return rules.hand_fast_rate
    wait = delay_of(
        rules.ordering,
        category,
        own,
        w.r_low[robot],
        w.r_scale[robot],
        rules.min_delay,
        rules.max_delay,
        w.p_draw[at],
    )
    return fast_rate(rules.threshold, wait)


@inlined
def contention(w: Memory, rules: Rules, at: int, now: float, last: float) -> tuple[bool, bool, float]:
    """Whether a teammate is on the task of a place, whether one is news, and when the next one lapses."""
    contended, news, lapse = False, False, INFINITY
    for place in range(w.t_able_count[w.p_task[at]]):
        pair = at * w.width + place
        if place == w.p_mine[at] or w.q_met_on[pair] == 0:
            continue
        first = beginning(w, rules, pair)
        news = news or (last < first <= now if rules.closed else in_window(first, last, now, False))
        if is_on(w, rules, pair, now):
            contended = True
            if not is_live(w, pair):
                lapse = min(lapse, w.q_c_last[pair] + rules.tau - SLACK)
    return contended, news, lapse


@compiled
def grow(w: Memory, rules: Rules, robot: int, at: int, now: float, last: float, bored: float) -> float:
    """Mind._grow with Appraisal.adaptive, of a set that is not active; when it changes by itself, in seconds."""
    contended, news, lapse = contention(w, rules, at, now, last)
    own = own_time(w, rules, robot, at)
    expects = expects_best(w, robot, at, own)
    best = INFINITY if contended else best_time(w, rules, at, own)  # it does not matter then
    category = task_category(own, best, contended, expects, rules.ordering)
    gate = influence(bored, rules.boredom_threshold, category) if rules.learns else 1
    reset = impatience_reset(news)
    if gate == 0 or reset == 0:
        # Whatever the rate, the product is 0.
        _ramp(w, rules, at, now, last, 0.0, reset, gate)
        if reset == 0:
            return now
        return min(lapse, ramp_reaches(0.0, w.r_idle_since[robot], rules.boredom_rate, rules.boredom_threshold))
    rate, ends = -1.0, INFINITY
    if contended:
        rate, ends = held(w, rules, at, own, now)
    if rate < 0.0:
        rate = fast_of(w, rules, robot, at, category, own)
    if math.isnan(rate):
        rate = 0.0  # erratum 10, literal
    return min(lapse, ends, _ramp(w, rules, at, now, last, rate, reset, gate))


@inlined
def sooner(one: float, other: float) -> float:
    """The lesser of two numbers; the first if the other is none (erratum 10, literal)."""
    return other if other < one else one


@compiled
def held(w: Memory, rules: Rules, at: int, own: float, now: float) -> tuple[float, float]:
    """The least delta_slow of those who hold a robot back, -1 if nobody does; and when the first patience ends.

    Erratum 10, literal: a rate may be no number, and so is the least of all if it is that of whom was heard first.
    """
    slow, first, undefined, holding, ends = INFINITY, INFINITY, False, False, INFINITY
    for place in range(w.t_able_count[w.p_task[at]]):
        pair = at * w.width + place
        if place == w.p_mine[at] or w.q_met_on[pair] == 0:
            continue
        phi = phi_of(w, rules, pair, own)
        rate = slow_rate(rules.threshold, phi) if rules.learns else rules.hand_slow_rate
        begins = beginning(w, rules, pair)
        holds = holds_back(is_on(w, rules, pair, now), in_window(begins, -math.inf, now - phi, rules.closed))
        if holds:
            holding = True
            ends = sooner(ends, begins + phi - SLACK)
        if holds or rules.slowest_of_all:
            slow = sooner(slow, rate)
            if w.q_c_first[pair] < first:
                first, undefined = w.q_c_first[pair], math.isnan(rate)
    if not holding:
        return -1.0, ends
    return (math.nan if undefined else slow), ends


@inlined
def _ramp(w: Memory, rules: Rules, at: int, now: float, last: float, rate: float, reset: int, gate: int) -> float:
    """Let a motivation grow or fall; when it reaches the threshold, in seconds; now if it is still 0."""
    if rate != w.p_growth[at]:
        w.p_base[at] = w.p_base[at] + w.p_growth[at] * (last - w.p_since[at])
        w.p_since[at] = last
        w.p_growth[at] = rate
    value = motivation(w.p_base[at], rate * (now - w.p_since[at]), 1, 1, reset, 1, gate)
    w.p_value[at] = value
    if value <= 0.0:
        w.p_base[at] = 0.0
        w.p_since[at] = now
        w.p_growth[at] = 0.0
        return now if rate > 0.0 else INFINITY
    ready: float = ramp_reaches(w.p_base[at], w.p_since[at], rate, rules.threshold)
    return ready


@inlined
def first_of(w: Memory, robot: int, highest: float) -> int:
    """The first of a robot's sets, in the order that breaks ties, whose motivation is the highest."""
    for index in range(w.r_sets[robot]):
        task = w.set_task[robot * TASKS + index]
        at = int(task * w.width + w.place[robot * TASKS + task])
        if w.p_complete[at] == 0 and w.p_value[at] >= highest - SLACK:
            return at
    return -1


@compiled
def waits(w: Memory, rules: Rules, robot: int, step: int, now: float, last: float) -> bool:
    """Whether an idle robot still waits for its roster: all motivations wait at 0."""
    begin(w, rules, robot, now, last)
    if w.r_waiting[robot]:
        w.r_wake[robot] = max(step_from(w, rules, robot, w.born + rules.tau - EARLY), step + 1)
        return True
    return False


@compiled
def think_idle(w: Memory, rules: Rules, robot: int, step: int) -> int:
    """The control step of an idle robot; the place of the task that it takes up, or -1."""
    now, last = instant(w, rules, robot, step), before(w, rules, robot, step)
    if waits(w, rules, robot, step, now, last):
        return -1
    anew = w.r_stirred[robot] or w.r_stale[robot] or now >= w.r_steady[robot] - EARLY
    w.r_stirred[robot] = 0
    read(w, rules, robot)
    changes = w.r_steady[robot] = min(who_is_present(w, rules, robot, now), w.r_settle_at[robot])
    bored = boredom(rules.boredom_rate, now - w.r_idle_since[robot])
    highest = -INFINITY
    for index in range(w.r_sets[robot]):
        task = w.set_task[robot * TASKS + index]
        at = task * w.width + w.place[robot * TASKS + task]
        if w.p_complete[at]:
            continue
        if anew or now >= w.p_changes[at] - EARLY:
            w.p_changes[at] = grow(w, rules, robot, at, now, last, bored)
        else:
            w.p_value[at] = w.p_base[at] + w.p_growth[at] * (now - w.p_since[at])
        changes = min(changes, w.p_changes[at])
        if reaches(w.p_value[at], rules.threshold):
            highest = max(highest, w.p_value[at])
    if highest > -INFINITY:
        return first_of(w, robot, highest)
    w.r_wake[robot] = NEVER if w.r_open[robot] == 0 else max(step_from(w, rules, robot, changes - EARLY), step + 1)
    return -1
