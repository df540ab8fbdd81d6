"""The kernel's minds at work: how a robot takes a task up, goes on with it, and stops.

These are `Mind._start`, `Mind._reason_to_stop` and `Mind._stop` of the model. A robot that works alone on its task needs no
step before it is told that the task is complete, or gives it up: what it hears meanwhile waits in its memory.
"""

import math

from lalliance_agents.model import equations
from lalliance_agents.model.parameters import EARLY, SLACK
from lalliance_study.compiled import Memory, compiled, inlined
from lalliance_study.kernel_hearing import beat_until, before, fail, hush, instant, last_beat, next_beat, say, step_from
from lalliance_study.kernel_knowledge import best_time, expects_best, is_on, own_time, read, who_is_present
from lalliance_study.kernel_mind import begin, contention, sooner
from lalliance_study.kernel_state import BLAMELESS, FREE, INFINITY, NEVER, SENSED, TASKS, Rules
from lalliance_study.kernel_world import act_soon

acquiescence = equations.acquiescence
boredom = equations.boredom
collides = equations.collides
gives_way = equations.gives_way
give_up_time = equations.give_up_time
impatience_reset = equations.impatience_reset
influence = equations.learned_robot_influence
occasion = equations.occasion
reason_to_stop = equations.reason_to_stop
task_category = equations.task_category
yield_time = equations.yield_time


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
    w.r_stirred[robot] = 1
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
        w.r_quiet[robot] = 1
        hush(w, rules, robot)
    act_soon(w, rules, robot, -1)
