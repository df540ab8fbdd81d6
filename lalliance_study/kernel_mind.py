"""The kernel's minds: one control step of a robot that is idle, and of one that works.

These are `Mind.tick`, `Appraisal` and `Outlook` of the model, with the same formulas in the same order. A step
also finds out when the next one is needed, as `Mind.wake` and `Mind.next_lapse` do. A robot that works alone on its task
needs none before it is told that the task is complete, or gives it up: what it hears meanwhile waits in its memory.
"""

import math

from lalliance_agents.model import equations
from lalliance_agents.model.parameters import EARLY, SLACK
from lalliance_study.compiled import Memory, compiled, inlined
from lalliance_study.kernel_hearing import (
    beat_until,
    before,
    fail,
    hush,
    instant,
    last_beat,
    next_beat,
    say,
    settle,
    step_from,
)
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
from lalliance_study.kernel_state import BLAMELESS, FREE, INFINITY, NEVER, SENSED, TASKS, Rules
from lalliance_study.kernel_world import act_soon

acquiescence = equations.acquiescence
boredom = equations.boredom
collides = equations.collides
delay_of = equations.delay
fast_rate = equations.fast_rate
gives_way = equations.gives_way
give_up_time = equations.give_up_time
holds_back = equations.holds_back
impatience_reset = equations.impatience_reset
in_window = equations.in_window
influence = equations.learned_robot_influence
motivation = equations.motivation
occasion = equations.occasion
ramp_reaches = equations.ramp_reaches
reaches = equations.reaches
reason_to_stop = equations.reason_to_stop
slow_rate = equations.slow_rate
task_category = equations.task_category
yield_time = equations.yield_time


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
    category = task_category(own, best_time(w, rules, at, own), contended, expects, rules.ordering)
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
    read(w, rules, robot)
    changes = min(who_is_present(w, rules, robot, now), w.r_settle_at[robot])
    bored = boredom(rules.boredom_rate, now - w.r_idle_since[robot])
    highest = -INFINITY
    for index in range(w.r_sets[robot]):
        task = w.set_task[robot * TASKS + index]
        at = task * w.width + w.place[robot * TASKS + task]
        if w.p_complete[at]:
            continue
        changes = min(changes, grow(w, rules, robot, at, now, last, bored))
        if reaches(w.p_value[at], rules.threshold):
            highest = max(highest, w.p_value[at])
    if highest > -INFINITY:
        return first_of(w, robot, highest)
    w.r_wake[robot] = NEVER if w.r_open[robot] == 0 else max(step_from(w, rules, robot, changes - EARLY), step + 1)
    return -1


@compiled
def why_free(w: Memory, rules: Rules, at: int, now: float) -> int:
    """Mind._occasion: why a task can be taken."""
    latest, cause, task = -INFINITY, FREE, w.p_task[at]
    for place in range(w.t_able_count[task]):
        pair = at * w.width + place
        if place == w.p_mine[at] or w.q_met_on[pair] == 0:
            continue
        on = is_on(w, rules, pair, now)
        heard = INFINITY if on else w.q_c_last[pair]
        if heard > latest:
            latest = heard
            cause = occasion(not on, w.present[w.p_able[task * w.width + place]] == 1)
    return cause


@compiled
def start(w: Memory, rules: Rules, robot: int, at: int) -> int:
    """Mind._start: begin to work on a task; the cause."""
    now, task = w.now, w.p_task[at]
    cause = why_free(w, rules, at, now)
    pair = at * w.width + w.p_mine[at]
    w.p_expected[at] = expected_time(w, rules, robot, at)
    w.q_trying[pair] = 1
    w.q_a_started[pair] = now
    w.q_a_last[pair] = now
    w.q_a_left[pair] = INFINITY
    w.activations += 1
    if cause != FREE:
        w.takeovers += 1
    act_soon(w, rules, robot, task)
    return cause


@inlined
def expected_time(w: Memory, rules: Rules, robot: int, at: int) -> float:
    """Appraisal.expected_time."""
    if not rules.learns:
        return rules.hand_yield_time
    own = own_time(w, rules, robot, at)
    return rules.initial_task_time if math.isnan(own) else own


@compiled
def take_up(w: Memory, rules: Rules, robot: int, at: int, step: int) -> None:
    """A robot works, and says so: on the task of `at`, which it has started."""
    now, task = w.now, w.p_task[at]
    w.r_active[robot] = task
    w.r_active_since[robot] = now
    w.r_expected[robot] = w.p_expected[at]
    w.r_wake[robot] = step + 1
    w.r_idle_step[robot] = NEVER
    if w.training == 0:
        w.r_dies[robot] = now + w.r_life[robot]
    beat_until(w, rules, robot, before(w, rules, robot, step))
    say(w, rules, robot, task, step)
    w.r_due[robot] = now + rules.period


@compiled
def rival(w: Memory, rules: Rules, robot: int, at: int, now: float) -> bool:
    """Appraisal.rival: whether a teammate that started at the same time expects to be faster (erratum 15)."""
    task, mine = w.p_task[at], w.p_mine[at]
    for place in range(w.t_able_count[task]):
        pair = at * w.width + place
        if (
            place != mine
            and is_on(w, rules, pair, now)
            and collides(w.r_active_since[robot], w.q_c_started[pair], rules.collision_window)
            and gives_way(w.p_expected[at], w.q_c_expected[pair], place < mine)
        ):
            return True
    return False


@compiled
def judge(
    w: Memory, rules: Rules, robot: int, at: int, now: float, last: float, suppressed: bool
) -> tuple[int, bool, float]:
    """Mind._reason_to_stop, of an active set: the cause, or -1; whether it is contended; when that may change."""
    contended, news, lapse = contention(w, rules, at, now, last)
    psi, lambda_, reset, gate = INFINITY, INFINITY, 1, 1
    if not w.exploring:
        psi, lambda_, gate = limits(w, rules, robot, at, contended, now)
        reset = impatience_reset(news) if rules.reset_on_active else 1
    active_for = now - w.r_active_since[robot]
    reason = reason_to_stop(
        w.p_complete[at] == 1,
        1,
        False,
        rules.collisions and contended and rival(w, rules, robot, at, now),
        acquiescence(active_for, psi, contended, INFINITY) == 0,
        acquiescence(active_for, psi, contended, lambda_),
        reset,
        gate,
        0 if suppressed else 1,
    )
    ends = sooner(INFINITY, w.r_active_since[robot] + lambda_)
    if contended:
        ends = min(sooner(ends, w.r_active_since[robot] + psi), w.r_settle_at[robot])
    if contended or rules.influence_on_active:
        ends = min(ends, lapse)
    return (SENSED + reason if reason >= 0 else -1), contended, ends


@compiled
def limits(w: Memory, rules: Rules, robot: int, at: int, contended: bool, now: float) -> tuple[float, float, int]:
    """Psi and lambda of an active set, and its learned influence (erratum 1, literal)."""
    if not rules.learns:
        return rules.hand_yield_time, rules.hand_give_up_time, 1
    read(w, rules, robot)
    own = own_time(w, rules, robot, at)
    best = best_time(w, rules, at, own)
    lambda_ = give_up_time(rules.give_up_factor, own) if rules.gives_up else INFINITY
    gate = 1
    if rules.influence_on_active:
        expects = expects_best(w, robot, at, own)
        bored = boredom(rules.boredom_rate, now - w.r_idle_since[robot]) if bored_at_work(w, rules, robot) else 0.0
        gate = influence(bored, rules.boredom_threshold, task_category(own, best, contended, expects, rules.ordering))
    return yield_time(rules.strategy, own, best), lambda_, gate


@inlined
def bored_at_work(w: Memory, rules: Rules, robot: int) -> bool:
    """Whether boredom goes on at work (erratum 9, literal)."""
    return rules.bored_at_work and w.r_sets[robot] == 1


@compiled
def think_active(w: Memory, rules: Rules, robot: int, step: int) -> int:
    """The control step of a robot that works on one task; why it stops, or -1."""
    now, last, task = instant(w, rules, robot, step), before(w, rules, robot, step), w.r_active[robot]
    at = task * w.width + w.place[robot * TASKS + task]
    if w.p_complete[at]:
        return SENSED
    begin(w, rules, robot, now, last)
    absence = who_is_present(w, rules, robot, now)
    cause, contended, ends = judge(w, rules, robot, at, now, last, False)
    if cause >= 0:
        return cause
    w.r_contended[robot] = contended
    if contended or rules.influence_on_active:
        ends = min(ends, absence)
    w.r_wake[robot] = NEVER if w.exploring else max(step_from(w, rules, robot, ends - SLACK - EARLY), step + 1)
    return -1


@compiled
def cease(w: Memory, rules: Rules, robot: int, at: int, cause: int) -> None:
    """Mind._stop: an attempt of the robot itself ends."""
    pair = at * w.width + w.p_mine[at]
    if cause != SENSED and w.q_trying[pair]:
        w.q_a_last[pair] = w.now
        blameless = BLAMELESS[cause]
        fail(w, rules, robot, pair, not blameless, blameless)


@compiled
def rest(w: Memory, rules: Rules, robot: int, step: int) -> None:
    """A robot is idle, says so, and wants all tasks anew."""
    now = w.now
    if w.training == 0:
        w.r_life[robot] = w.r_dies[robot] - now
    w.r_dies[robot] = INFINITY
    w.r_active[robot] = -1
    w.r_contended[robot] = 0
    if not bored_at_work(w, rules, robot):
        w.r_idle_since[robot] = now
    for index in range(w.r_sets[robot]):
        task = w.set_task[robot * TASKS + index]
        at = task * w.width + w.place[robot * TASKS + task]
        w.p_base[at] = 0.0
        w.p_since[at] = now
        w.p_growth[at] = 0.0
        w.p_active[at] = 0
    w.r_wake[robot] = step + 1 if w.r_open[robot] > 0 else NEVER
    beat_until(w, rules, robot, before(w, rules, robot, step))
    if rules.beats:
        w.r_idle_step[robot] = next_beat(w, rules, robot)
    else:
        w.r_old_last[robot] = last_beat(w, rules, robot) + rules.delay
        w.r_old_length[robot] = last_beat(w, rules, robot) - w.r_said_since[robot]
        hush(w, rules, robot)
    act_soon(w, rules, robot, -1)
