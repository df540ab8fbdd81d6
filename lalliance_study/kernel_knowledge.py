"""What a kernel robot makes of what it knows and has heard: task times, who is present, who is on a task.

These are `Knowledge` and the questions of `Hearing` in the model. A place `at` is a robot and a task it can do, a pair a place
and a teammate able to do the same task (`kernel_state`).
"""

import math

from lalliance_agents.model import equations
from lalliance_agents.model.parameters import SLACK
from lalliance_study.compiled import Memory, compiled, inlined
from lalliance_study.kernel_state import INFINITY, ROBOTS, TASKS, Rules

in_window = equations.in_window
is_bound = equations.is_bound
patience = equations.patience
presumed_time = equations.presumed_time
scale_factor = equations.scale_factor


@inlined
def own_time(w: Memory, rules: Rules, robot: int, at: int) -> float:
    """Knowledge.own_time, of the robot at the place `at`."""
    pair = at * w.width + w.p_mine[at]
    known: float = w.q_time[pair]
    if math.isnan(known) and rules.replaces_unknown:
        return presumed_time(w.r_longest[robot], rules.initial_task_time, w.q_floor[pair])
    return known


@inlined
def expects_best(w: Memory, robot: int, at: int, own: float) -> bool:
    """Whether a robot may expect to be best at all: it knows its teammates, and its own time is no mere bound."""
    return w.r_knows[robot] == 1 and not is_bound(own, w.q_floor[at * w.width + w.p_mine[at]])


@compiled
def read(w: Memory, rules: Rules, robot: int) -> None:
    """Knowledge._read: what all monitors say together."""
    if w.r_stale[robot] == 0:
        return
    w.r_stale[robot] = 0
    longest, low, high, knows, unknown = 0.0, INFINITY, -INFINITY, False, False
    for index in range(w.r_sets[robot]):
        task = w.set_task[robot * TASKS + index]
        at = task * w.width + w.place[robot * TASKS + task]
        if w.p_stale[at]:
            _extent(w, at)
        low, high = min(low, w.p_low[at]), max(high, w.p_high[at])
        longest = max(longest, w.p_longest[at])
        knows = knows or w.p_of_mates[at] == 1
        unknown = unknown or math.isnan(w.q_time[at * w.width + w.p_mine[at]])
    w.r_longest[robot] = longest
    if unknown and rules.replaces_unknown:
        for index in range(w.r_sets[robot]):
            task = w.set_task[robot * TASKS + index]
            own = own_time(w, rules, robot, task * w.width + w.place[robot * TASKS + task])
            low, high = min(low, own), max(high, own)
    w.r_low[robot], w.r_high[robot] = low, high
    w.r_scale[robot] = scale_factor(rules.min_delay, rules.max_delay, low, high)
    w.r_knows[robot] = knows or not rules.replaces_unknown


@compiled
def _extent(w: Memory, at: int) -> None:
    """Monitor.extent: the range of the times known of one task."""
    longest, low, high, of_mates = 0.0, INFINITY, -INFINITY, False
    for place in range(w.t_able_count[w.p_task[at]]):
        time = w.q_time[at * w.width + place]
        if not math.isnan(time):
            low, high = min(low, time), max(high, time)
            longest = max(longest, w.q_measured[at * w.width + place])
            of_mates = of_mates or place != w.p_mine[at]
    w.p_stale[at] = 0
    w.p_low[at], w.p_high[at], w.p_longest[at], w.p_of_mates[at] = low, high, longest, of_mates


@compiled
def who_is_present(w: Memory, rules: Rules, robot: int, now: float) -> float:
    """Hearing.robots_present, into `present`; when the next of those that are not live will be absent."""
    lapse = INFINITY
    for index in range(w.r_mates[robot]):
        mate = w.mate[robot * ROBOTS + index]
        couple = robot * ROBOTS + mate
        w.present[mate] = 1
        if w.k_live[couple] == 0:
            if in_window(w.k_last[couple], now - rules.tau, INFINITY, rules.closed):
                lapse = min(lapse, w.k_last[couple] + rules.tau)
            else:
                w.present[mate] = 0
    return lapse - SLACK


@inlined
def best_time(w: Memory, rules: Rules, at: int, own: float) -> float:
    """Knowledge.best_time, with those who are `present`."""
    best = own if rules.self_counts else INFINITY
    task = w.p_task[at]
    for place in range(w.t_able_count[task]):
        time = w.q_time[at * w.width + place]
        if place != w.p_mine[at] and w.present[w.p_able[task * w.width + place]] and time < best:
            best = time
    return best


@inlined
def phi_of(w: Memory, rules: Rules, pair: int, own: float) -> float:
    """Appraisal._patience: phi with the speaker of `pair`, in seconds."""
    if not rules.learns:
        return rules.hand_patience
    theirs = w.q_time[pair]
    return patience(rules.strategy, own, own if math.isnan(theirs) else theirs)


@inlined
def is_on(w: Memory, rules: Rules, pair: int, now: float) -> bool:
    """Hearing.is_on: whether the speaker of `pair` was heard on the task within tau."""
    if w.q_met_on[pair] == 0:
        return False
    return is_live(w, pair) or in_window(w.q_c_last[pair], now - rules.tau, INFINITY, rules.closed)


@inlined
def beginning(w: Memory, rules: Rules, pair: int) -> float:
    """Hearing.beginning: the instant with which windows begin that look back to the first message."""
    first: float = w.q_c_since[pair] if rules.per_attempt else w.q_c_first[pair]
    return first


@inlined
def is_live(w: Memory, pair: int) -> bool:
    """Whether the speaker of `pair` goes on to say that it is on the task."""
    at = w.q_at[pair]
    task = w.p_task[at]
    on: bool = w.r_heard[w.q_speaker[pair]] == task
    return on
