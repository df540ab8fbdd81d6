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
    best_time,
    is_live,
    is_on,
    own_time,
    phi_of,
    read,
    who_is_present,
)
from lalliance_study.kernel_state import (
    COLLISION,
    CONTENDER,
    FREE,
    IMPATIENCE,
    INFINITY,
    NEVER,
    NO_SUCCESS,
    NOT_BEST,
    RELEASED,
    RESET,
    SENSED,
    SILENCE,
    TASKS,
    Rules,
)
from lalliance_study.kernel_world import act_soon

acquiescence = equations.acquiescence
boredom = equations.boredom
collides = equations.collides
delay_of = equations.delay
fast_rate = equations.fast_rate
give_up_time = equations.give_up_time
holds_back = equations.holds_back
impatience_reset = equations.impatience_reset
in_window = equations.in_window
influence = equations.learned_robot_influence
motivation = equations.motivation
ramp_reaches = equations.ramp_reaches
reaches = equations.reaches
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
        beginning = w.q_c_since[pair] if rules.per_attempt else w.q_c_first[pair]
        news = news or last < beginning <= now
        if is_on(w, rules, pair, now):
            contended = True
            if not is_live(w, pair):
                lapse = min(lapse, w.q_c_last[pair] + rules.tau - SLACK)
    return contended, news, lapse


@compiled
def grow(w: Memory, rules: Rules, robot: int, at: int, now: float, last: float, bored: float) -> float:
    """Mind._grow with Appraisal.adaptive, of a set that is not active; when it changes by itself, in seconds."""
    contended, news, lapse = contention(w, rules, at, now, last)
    own, floor = own_time(w, robot, at), w.q_floor[at * w.width + w.p_mine[at]]
    expects = w.r_knows[robot] and not (floor > 0.0 and own <= floor)
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
    return min(lapse, ends, _ramp(w, rules, at, now, last, rate, reset, gate))


@compiled
def held(w: Memory, rules: Rules, at: int, own: float, now: float) -> tuple[float, float]:
    """The least delta_slow of those who hold a robot back, -1 if nobody does; and when the first patience ends."""
    slow, slowest, holding, ends = INFINITY, INFINITY, False, INFINITY
    for place in range(w.t_able_count[w.p_task[at]]):
        pair = at * w.width + place
        if place == w.p_mine[at] or w.q_met_on[pair] == 0:
            continue
        phi = phi_of(w, rules, pair, own)
        rate = slow_rate(rules.threshold, phi) if rules.learns else rules.hand_slow_rate
        slowest = min(slowest, rate)
        beginning = w.q_c_since[pair] if rules.per_attempt else w.q_c_first[pair]
        if not holds_back(is_on(w, rules, pair, now), in_window(beginning, -math.inf, now - phi, True)):
            continue
        holding = True
        slow = min(slow, rate)
        ends = min(ends, beginning + phi - SLACK)
    if not holding:
        return -1.0, ends
    return (slowest if rules.slowest_of_all else slow), ends


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
        return now
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
def think_idle(w: Memory, rules: Rules, robot: int, step: int) -> int:
    """The control step of an idle robot; the place of the task that it takes up, or -1."""
    now, last = instant(w, rules, robot, step), before(w, rules, robot, step)
    begin(w, rules, robot, now, last)
    if w.r_waiting[robot]:
        # All motivations wait at 0.
        w.r_wake[robot] = max(step_from(w, rules, robot, w.born + rules.tau - EARLY), step + 1)
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
def occasion(w: Memory, rules: Rules, at: int, now: float) -> int:
    """Mind._occasion: why a task can be taken."""
    latest, cause, task = -INFINITY, FREE, w.p_task[at]
    for place in range(w.t_able_count[task]):
        pair = at * w.width + place
        if place == w.p_mine[at] or w.q_met_on[pair] == 0:
            continue
        if is_on(w, rules, pair, now):
            return IMPATIENCE
        if w.q_c_last[pair] > latest:
            latest = w.q_c_last[pair]
            cause = RELEASED if w.present[w.p_able[task * w.width + place]] else SILENCE
    return cause


@compiled
def take_up(w: Memory, rules: Rules, robot: int, at: int, step: int) -> int:
    """Mind._start: begin to work on a task, and say so; the cause."""
    now, task = w.now, w.p_task[at]
    cause = occasion(w, rules, at, now)
    pair = at * w.width + w.p_mine[at]
    w.r_active[robot] = task
    w.r_active_since[robot] = now
    w.r_expected[robot] = own_time(w, robot, at) if rules.learns else rules.hand_yield_time
    w.q_trying[pair] = 1
    w.q_a_started[pair] = now
    w.q_a_last[pair] = now
    w.q_a_left[pair] = INFINITY
    w.r_wake[robot] = step + 1
    w.r_idle_step[robot] = NEVER
    if w.training == 0:
        w.r_dies[robot] = now + w.r_life[robot]
    beat_until(w, rules, robot, before(w, rules, robot, step))
    say(w, rules, robot, task, step)
    w.r_due[robot] = now + rules.period
    w.activations += 1
    if cause != FREE:
        w.takeovers += 1
    act_soon(w, rules, robot, task)
    return cause


@compiled
def rival(w: Memory, rules: Rules, robot: int, at: int, now: float) -> bool:
    """Appraisal.rival: whether a teammate that started at the same time expects to be faster (erratum 15)."""
    task, mine = w.p_task[at], w.p_mine[at]
    for place in range(w.t_able_count[task]):
        pair = at * w.width + place
        if place == mine or not is_on(w, rules, pair, now):
            continue
        if collides(w.r_active_since[robot], w.q_c_started[pair], rules.collision_window) and (
            w.q_c_expected[pair] < w.r_expected[robot] or (w.q_c_expected[pair] == w.r_expected[robot] and place < mine)
        ):
            return True
    return False


@compiled
def not_best(w: Memory, rules: Rules, robot: int, at: int, best: float, contended: bool) -> bool:
    """Whether the learned influence strikes the active set (erratum 1, literal); boredom is 0 while it is active."""
    own, floor = own_time(w, robot, at), w.q_floor[at * w.width + w.p_mine[at]]
    expects = w.r_knows[robot] and not (floor > 0.0 and own <= floor)
    category = task_category(own, best, contended, expects, rules.ordering)
    return influence(0.0, rules.boredom_threshold, category) == 0


@compiled
def think_active(w: Memory, rules: Rules, robot: int, step: int) -> int:  # noqa: PLR0911 - the causes, one after the other
    """The control step of a robot that works; why it stops, or -1."""
    now, last, task = instant(w, rules, robot, step), before(w, rules, robot, step), w.r_active[robot]
    at = task * w.width + w.place[robot * TASKS + task]
    if w.p_complete[at]:
        return SENSED
    begin(w, rules, robot, now, last)
    read(w, rules, robot)
    absence = who_is_present(w, rules, robot, now)
    contended, news, lapse = contention(w, rules, at, now, last)
    own = own_time(w, robot, at)
    best = best_time(w, rules, at, own)
    psi, lambda_ = rules.hand_yield_time, rules.hand_give_up_time
    if rules.learns:
        psi = yield_time(rules.strategy, own, best)
        lambda_ = give_up_time(rules.give_up_factor, own) if rules.gives_up else INFINITY
    active_for = now - w.r_active_since[robot]
    if rules.collisions and contended and rival(w, rules, robot, at, now):
        return COLLISION
    if w.exploring:
        w.r_contended[robot] = contended
        w.r_wake[robot] = NEVER
        return -1
    if acquiescence(active_for, psi, contended, math.inf) == 0:
        return CONTENDER
    if acquiescence(active_for, psi, contended, lambda_) == 0:
        return NO_SUCCESS
    if rules.reset_on_active and impatience_reset(news) == 0:
        return RESET
    if rules.influence_on_active and rules.learns and not_best(w, rules, robot, at, best, contended):
        return NOT_BEST
    w.r_contended[robot] = contended
    ends = w.r_active_since[robot] + lambda_
    if contended:
        ends = min(ends, w.r_active_since[robot] + psi, w.r_settle_at[robot])
    if contended or rules.influence_on_active:
        ends = min(ends, absence, lapse)
    w.r_wake[robot] = max(step_from(w, rules, robot, ends - SLACK - EARLY), step + 1)
    return -1


@compiled
def lay_down(w: Memory, rules: Rules, robot: int, cause: int, step: int) -> None:
    """Mind._stop: cease to work on the active task, and want all tasks anew."""
    now, task = w.now, w.r_active[robot]
    at = task * w.width + w.place[robot * TASKS + task]
    pair = at * w.width + w.p_mine[at]
    if cause != SENSED and w.q_trying[pair]:
        w.q_a_last[pair] = now
        blameless = cause in (COLLISION, NOT_BEST)
        fail(w, rules, robot, pair, not blameless, blameless)
    if w.training == 0:
        w.r_life[robot] = w.r_dies[robot] - now
    w.r_dies[robot] = INFINITY
    w.r_active[robot] = -1
    w.r_contended[robot] = 0
    w.r_idle_since[robot] = now
    for index in range(w.r_sets[robot]):
        other = w.set_task[robot * TASKS + index]
        place = other * w.width + w.place[robot * TASKS + other]
        w.p_base[place] = 0.0
        w.p_since[place] = now
        w.p_growth[place] = 0.0
    w.r_wake[robot] = step + 1 if w.r_open[robot] > 0 else NEVER
    beat_until(w, rules, robot, before(w, rules, robot, step))
    if rules.beats:
        w.r_idle_step[robot] = next_beat(w, rules, robot)
    else:
        w.r_old_last[robot] = last_beat(w, rules, robot) + rules.delay
        w.r_old_length[robot] = last_beat(w, rules, robot) - w.r_said_since[robot]
        hush(w, rules, robot)
    act_soon(w, rules, robot, -1)
