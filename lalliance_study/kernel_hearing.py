"""What kernel robots say and hear: announcements in closed form, contacts, presences and the attempts that are watched.

A robot announces what it does at rate rho. Of a row of announcements that say the same only the first is an event; when the
last one came is worked out when it is needed. While a row goes on, whoever hears it is `live` to the hearer: it is never
silent for tau, since tau exceeds two periods of any teammate.

See `hearing`, `listening` and `monitor` in the model for what is kept and why.
"""

import math

from lalliance_agents.model import equations
from lalliance_agents.model.parameters import SLACK
from lalliance_study.compiled import Memory, compiled, inlined
from lalliance_study.kernel_state import HEAR, IDLE, INFINITY, NEVER, NOTHING, ROBOTS, SAMPLES, TASKS, Rules
from lalliance_study.kernel_world import soon

announces_from = equations.announces_from
censored = equations.censored
credited = equations.credited
goes_on = equations.goes_on
is_heard = equations.is_heard
leaves_no_trace = equations.leaves_no_trace
may_have_done = equations.may_have_done
more_than = equations.more_than
task_time = equations.task_time


@inlined
def instant(w: Memory, rules: Rules, robot: int, step: int) -> float:
    """When a robot makes a control step."""
    at: float = w.r_first[robot] + step * rules.step
    return at


@inlined
def before(w: Memory, rules: Rules, robot: int, step: int) -> float:
    """When it made the step before; its life begins at 0."""
    return instant(w, rules, robot, step - 1) if step > 0 else 0.0


@inlined
def step_from(w: Memory, rules: Rules, robot: int, at: float) -> int:
    """The first step of a robot that is not before `at`."""
    if at == INFINITY:
        return NEVER
    step: int = max(math.ceil((at - w.r_first[robot]) * rules.steps_per_second - SLACK), 0)
    while instant(w, rules, robot, step) < at:
        step += 1
    return step


@inlined
def wake_by(w: Memory, rules: Rules, robot: int, at: float) -> None:
    """Have a robot think at its first step that is neither before `at` nor past."""
    at = max(at, w.now)
    if w.r_wake[robot] == NEVER or instant(w, rules, robot, w.r_wake[robot]) > at:
        w.r_wake[robot] = min(w.r_wake[robot], step_from(w, rules, robot, at))


@compiled
def next_beat(w: Memory, rules: Rules, robot: int) -> int:
    """The step of the next announcement: the first nearest to the instant at which it is due."""
    earliest = announces_from(w.r_due[robot], rules.step)
    step: int = max(step_from(w, rules, robot, earliest), w.r_beat[robot] + 1)
    return step


@compiled
def beat_until(w: Memory, rules: Rules, robot: int, until: float) -> None:
    """Let a robot make all announcements up to and including the instant `until`."""
    counts = 0 if w.r_quiet[robot] else 1
    many = math.floor((until - w.r_due[robot]) * rules.rate) - 1.0
    if many > 0.0:
        w.r_due[robot] += many * rules.period
        w.sent += int(many) * counts
    step = next_beat(w, rules, robot)
    while instant(w, rules, robot, step) <= until:
        w.r_beat[robot] = step
        w.r_due[robot] += rules.period
        w.sent += counts
        step = next_beat(w, rules, robot)


@inlined
def last_beat(w: Memory, rules: Rules, robot: int) -> float:
    """When the latest announcement was made."""
    return instant(w, rules, robot, w.r_beat[robot])


@compiled
def last_heard(w: Memory, rules: Rules, speaker: int) -> float:
    """When the latest message of what is heard of a robot until now arrived."""
    if w.r_flying[speaker]:
        last: float = w.r_old_last[speaker]
        return last
    beat_until(w, rules, speaker, w.now - rules.delay)
    return last_beat(w, rules, speaker) + rules.delay


@compiled
def say(w: Memory, rules: Rules, robot: int, what: int, step: int) -> None:
    """A robot begins to say something else, at its present step; its announcements before that are made."""
    w.r_old_last[robot] = last_beat(w, rules, robot) + rules.delay
    w.r_old_length[robot] = last_beat(w, rules, robot) - w.r_said_since[robot]
    w.r_saying[robot] = what
    w.r_quiet[robot] = 0
    w.r_flying[robot] = 1
    w.r_said_since[robot] = w.now
    w.r_beat[robot] = step
    w.sent += 1
    soon(w, w.now + rules.delay, HEAR, robot)


@compiled
def falls_silent(w: Memory, speaker: int) -> None:
    """What `speaker` said until now is over: its hearers keep when they last heard it."""
    task, last = w.r_heard[speaker], w.r_old_last[speaker]
    for index in range(w.r_mates[speaker]):
        couple = w.mate[speaker * ROBOTS + index] * ROBOTS + speaker
        if w.k_live[couple]:
            w.k_live[couple] = 0
            w.k_last[couple] = last
    if task >= 0:
        mine = w.place[speaker * TASKS + task]
        for place in range(w.t_able_count[task]):
            pair = (task * w.width + place) * w.width + mine
            if place != mine:
                w.q_c_last[pair] = last
                if w.q_trying[pair] and w.q_a_left[pair] == INFINITY:
                    w.q_a_last[pair] = last
                    w.q_a_length[pair] = w.r_old_length[speaker]
    w.r_heard[speaker] = NOTHING


# --- the monitors


@compiled
def refresh(w: Memory, hearer: int, pair: int) -> None:
    """_Performance.refresh: compute a task time anew."""
    count = w.q_count[pair]
    if count > 0:
        samples = w.samples[pair * SAMPLES : pair * SAMPLES + count]
        w.q_time[pair] = task_time(samples, w.q_floor[pair])
        w.q_measured[pair] = task_time(samples, 0.0) if w.q_floor[pair] > 0.0 else w.q_time[pair]
    w.p_stale[w.q_at[pair]] = 1
    w.r_stale[hearer] = 1


@compiled
def fail(w: Memory, rules: Rules, hearer: int, pair: int, failed: bool, short: bool) -> None:
    """Monitor._fail: an attempt ends without completion."""
    w.q_trying[pair] = 0
    if w.q_a_left[pair] < INFINITY:
        w.p_leavers[w.q_at[pair]] -= 1
    elapsed = w.q_a_last[pair] - w.q_a_started[pair]
    if short and leaves_no_trace(elapsed, rules.collision_window):
        return
    w.p_earlier[w.q_at[pair]] += 1
    if failed and rules.remembers_failures:
        w.q_floor[pair] = censored(w.q_floor[pair], rules.failure_factor, elapsed)
        w.q_floor_left[pair] = rules.trials
        refresh(w, hearer, pair)


@compiled
def _sample(w: Memory, rules: Rules, hearer: int, pair: int, duration: float) -> None:
    """Monitor._sample."""
    first = pair * SAMPLES
    if w.q_count[pair] == rules.trials:
        for index in range(first, first + rules.trials - 1):
            w.samples[index] = w.samples[index + 1]
        w.q_count[pair] -= 1
    w.samples[first + w.q_count[pair]] = duration
    w.q_count[pair] += 1
    w.q_floor_left[pair] = max(w.q_floor_left[pair] - 1, 0)
    if w.q_floor_left[pair] == 0:
        w.q_floor[pair] = 0.0
    refresh(w, hearer, pair)


@compiled
def settle(w: Memory, rules: Rules, hearer: int, at: int, now: float) -> None:
    """Monitor.settle, of the place `at`, as it has been done by the hearer's step at `now`."""
    if w.p_leavers[at] == 0:
        return
    for pair in range(at * w.width, (at + 1) * w.width):
        if w.q_trying[pair] and w.q_a_left[pair] < INFINITY and more_than(now - w.q_a_left[pair], rules.tau):
            fail(w, rules, hearer, pair, True, True)


@inlined
def last_step(w: Memory, rules: Rules, robot: int, now: float) -> float:
    """When a robot made its latest step before the event at `now`; minus infinity if it has made none."""
    step = step_from(w, rules, robot, now)
    return instant(w, rules, robot, step - 1) if step > 0 else -INFINITY


@compiled
def completed(w: Memory, rules: Rules, hearer: int, task: int, now: float) -> None:
    """Monitor.completed: credit who did the task."""
    mine = w.place[hearer * TASKS + task]
    at = task * w.width + mine
    if w.p_leavers[at] > 0:
        settle(w, rules, hearer, at, last_step(w, rules, hearer, now))
    lasting, any_attempt, one, one_of_any = 0, 0, -1, -1
    for place in range(w.t_able_count[task]):
        pair = at * w.width + place
        if not w.q_trying[pair]:
            continue
        speaker = w.p_able[task * w.width + place]
        left = w.q_a_left[pair]
        if place == mine:
            w.q_a_last[pair] = now
        elif left == INFINITY and w.r_heard[speaker] == task:
            w.q_a_last[pair] = last_heard(w, rules, speaker)
        silent = more_than(now - w.q_a_last[pair], rules.tau)
        any_attempt += 1
        one_of_any = pair
        elapsed = w.q_a_last[pair] - w.q_a_started[pair]
        if may_have_done(elapsed, rules.collision_window, left == INFINITY and not silent):
            lasting += 1
            one = pair
    if lasting == 0:
        lasting, one = any_attempt, one_of_any
    if lasting != 1 or w.p_earlier[at] != 0:
        one = -1
    for pair in range(at * w.width, at * w.width + w.t_able_count[task]):
        if not w.q_trying[pair]:
            continue
        silent = more_than(now - w.q_a_last[pair], rules.tau)
        if pair == one or (rules.credits_all and not silent):
            ended = now if w.q_a_left[pair] == INFINITY else w.q_a_left[pair]
            _sample(w, rules, hearer, pair, credited(w.q_a_started[pair], ended))
        elif silent:
            fail(w, rules, hearer, pair, True, True)
        w.q_trying[pair] = 0
    w.p_leavers[at] = 0


# --- messages


@compiled
def _elsewhere(w: Memory, rules: Rules, hearer: int, speaker: int, task: int, now: float) -> None:
    """Monitor.elsewhere: the speaker has left what it was last heard on."""
    couple = hearer * ROBOTS + speaker
    left = w.k_attempt[couple]
    if left < 0 or left == task:
        return
    w.k_attempt[couple] = -1
    at = left * w.width + w.place[hearer * TASKS + left]
    pair = at * w.width + w.place[speaker * TASKS + left]
    if w.q_trying[pair] and w.q_a_left[pair] == INFINITY:
        w.q_a_left[pair] = now
        w.p_leavers[at] += 1
        w.r_settle_at[hearer] = min(w.r_settle_at[hearer], now + rules.tau)


@compiled
def _observe(w: Memory, rules: Rules, hearer: int, pair: int, now: float, length: float) -> bool:
    """Monitor.observe: the speaker is on the task since `length` seconds; whether this is a new attempt of it."""
    if w.p_leavers[w.q_at[pair]] > 0:
        settle(w, rules, hearer, w.q_at[pair], last_step(w, rules, hearer, now))
    if w.q_trying[pair]:
        if goes_on(length, w.q_a_length[pair], w.q_a_last[pair], now, rules.tau):
            if w.q_a_left[pair] < INFINITY:
                w.p_leavers[w.q_at[pair]] -= 1
            w.q_a_last[pair] = now
            w.q_a_length[pair] = length
            w.q_a_left[pair] = INFINITY
            return False
        fail(w, rules, hearer, pair, True, True)
    w.q_trying[pair] = 1
    w.q_a_started[pair] = now - length
    w.q_a_last[pair] = now
    w.q_a_length[pair] = length
    w.q_a_left[pair] = INFINITY
    return True


@compiled
def _hear_on(w: Memory, rules: Rules, hearer: int, speaker: int, task: int, now: float) -> None:
    """Listener._take_in, of the first message of an attempt, which says that it has just begun."""
    at = task * w.width + w.place[hearer * TASKS + task]
    pair = at * w.width + w.place[speaker * TASKS + task]
    length = 0.0
    fresh = False
    if w.p_complete[at] == 0:
        fresh = _observe(w, rules, hearer, pair, now, length)
        w.k_attempt[hearer * ROBOTS + speaker] = task
    if w.q_met_on[pair] == 0:
        w.q_met_on[pair] = 1
        w.q_c_first[pair] = now
        w.q_c_since[pair] = now
        w.q_c_started[pair] = now - length
    elif fresh:
        w.q_c_since[pair] = now
        w.q_c_started[pair] = now - length
    w.q_c_last[pair] = now
    w.q_c_expected[pair] = w.r_expected[speaker]


@compiled
def arrive(w: Memory, rules: Rules, speaker: int) -> None:
    """What a robot newly says reaches its teammates."""
    now, task = w.now, w.r_saying[speaker]
    old_task, old_last = w.r_heard[speaker], w.r_old_last[speaker]
    falls_silent(w, speaker)
    w.r_flying[speaker] = 0
    w.r_heard[speaker] = task
    for index in range(w.r_mates[speaker]):
        hearer = w.mate[speaker * ROBOTS + index]
        couple = hearer * ROBOTS + speaker
        if w.r_dead[hearer]:
            continue
        news = False
        shared = task >= 0 and w.place[hearer * TASKS + task] >= 0
        hears = task != NOTHING and is_heard(task == IDLE, shared, rules.elsewhere)
        if hears:
            news = w.k_met[couple] == 0 or now - w.k_last[couple] > rules.tau - rules.step
            if w.k_met[couple] == 0:
                w.k_met[couple] = 1
                w.r_met[hearer] += 1
            w.k_live[couple] = 1
            _elsewhere(w, rules, hearer, speaker, task, now)
            if shared:
                _hear_on(w, rules, hearer, speaker, task, now)
                news = True
        _tell(w, rules, hearer, task if hears else NOTHING, news, old_task, old_last)
    if w.r_dead[speaker]:
        w.r_old_last[speaker] = now
        w.r_old_length[speaker] = 0.0
        hush(w, rules, speaker)


@compiled
def hush(w: Memory, rules: Rules, speaker: int) -> None:
    """A robot says nothing any more; `old_last` tells when it was last heard."""
    task, last = w.r_heard[speaker], w.r_old_last[speaker]
    falls_silent(w, speaker)
    for index in range(w.r_mates[speaker]):
        _tell(w, rules, w.mate[speaker * ROBOTS + index], NOTHING, False, task, last)


@compiled
def _tell(w: Memory, rules: Rules, hearer: int, task: int, news: bool, old_task: int, old_last: float) -> None:
    """Have a hearer think as soon as what it heard, or will not hear any more, can matter to it."""
    w.r_stirred[hearer] = 1
    if w.r_dead[hearer] or (w.r_open[hearer] == 0 and w.r_active[hearer] < 0):
        return
    if w.r_waiting[hearer]:
        if w.r_met[hearer] == w.r_mates[hearer]:
            wake_by(w, rules, hearer, w.now)
        return
    busy = w.r_active[hearer] >= 0
    if busy and not w.r_contended[hearer] and w.r_active[hearer] != task and not rules.influence_on_active:
        return
    if news or busy:
        wake_by(w, rules, hearer, w.now)
    lapses = old_last > -INFINITY and (
        (task == NOTHING) or (old_task >= 0 and old_task != task and w.place[hearer * TASKS + old_task] >= 0)
    )
    if lapses:
        wake_by(w, rules, hearer, old_last + rules.tau - SLACK)
    if w.r_settle_at[hearer] < INFINITY:
        wake_by(w, rules, hearer, w.r_settle_at[hearer])
