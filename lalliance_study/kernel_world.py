"""The kernel's world: bodies work, tasks end, and the world server looks at its world on its grid.

A task's work is a line between two changes of its crew, so its end is known as soon as a crew changes. See
`world_server.environments.task_pool` for what a second robot finds, and `mishaps` for bodies that get stuck.
"""

import math

from lalliance_study.compiled import Memory, compiled, inlined
from lalliance_study.kernel_state import GONE, INFINITY, QUEUE, RESTART, SENSE, SHARED_ADD, TASKS, TRIAL, Rules
from world_server.environments.task_pool import ROUNDING
from world_server.world import TRIAL_PAUSE


@inlined
def soon(w: Memory, at: float, kind: int, who: int) -> None:
    """Something will arrive after the delay of messages; all of them are equally long under way."""
    tail = w.soon_tail % QUEUE
    w.soon_at[tail] = at
    w.soon_kind[tail] = kind
    w.soon_who[tail] = who
    w.soon_tail += 1


@compiled
def act_soon(w: Memory, rules: Rules, robot: int, task: int) -> None:
    """A body will be told what to do: by its robot's message, or before by the refresh of each full second."""
    refreshed = math.floor(w.now) + 1.0
    tail = w.acts_tail % QUEUE
    w.acts_at[tail] = min(w.now + rules.delay, refreshed)
    w.acts_who[tail] = robot
    w.acts_task[tail] = task
    w.acts_tail += 1


@inlined
def look_at(rules: Rules, instant: float) -> float:
    """The first look of the world server that finds what happened at `instant`."""
    return math.ceil(instant / rules.world_step - 1e-9) * rules.world_step


@compiled
def plan(w: Memory, rules: Rules) -> None:
    """When the next task will end, and when the world will publish what has ended."""
    soonest = unpublished = INFINITY
    for task in range(w.m):
        end = w.t_ends[task]
        if w.t_published[task] == 0 and end < unpublished:
            unpublished = end
        if w.t_closed[task] == 0 and end < soonest:
            soonest = end
    w.next_end = soonest
    w.look = look_at(rules, unpublished) if unpublished < INFINITY else INFINITY


@inlined
def _rate(w: Memory, task: int, robot: int) -> float:
    own: float = w.p_own[task * w.width + w.place[robot * TASKS + task]]
    return 0.0 if w.r_stuck[robot] else 1.0 / own


@inlined
def _end(share: float, rate: float, now: float) -> float:
    """When a share of work is whole."""
    if 1.0 - share <= ROUNDING and rate > 0.0:
        return now
    return now + (1.0 - share) / rate if rate > 0.0 else INFINITY


@compiled
def settle_crew(w: Memory, rules: Rules, task: int, now: float) -> None:
    """Let the crew of `task`, as it was, work until `now`; to be called before it changes."""
    passed = now - w.t_share_at[task]
    if rules.hand_over == RESTART:
        for place in range(w.t_able_count[task]):
            robot = w.p_able[task * w.width + place]
            if w.r_body[robot] == task:
                w.r_done[robot] += _rate(w, task, robot) * passed
    else:
        w.t_share[task] += w.t_rate[task] * passed
    w.t_share_at[task] = now


@compiled
def renew_crew(w: Memory, rules: Rules, task: int, now: float) -> None:
    """When `task` will end, with the crew that it has from `now` on; to be called after it has changed."""
    rate, end = 0.0, INFINITY
    for place in range(w.t_able_count[task]):
        robot = w.p_able[task * w.width + place]
        if w.r_body[robot] != task:
            continue
        own = _rate(w, task, robot)
        if rules.hand_over == RESTART:
            end = min(end, _end(w.r_done[robot], own, now))
        elif rules.hand_over == SHARED_ADD:
            rate += own
        else:
            rate = max(rate, own)
    w.t_rate[task] = rate
    w.t_ends[task] = end if rules.hand_over == RESTART else _end(w.t_share[task], rate, now)


@compiled
def close(w: Memory, rules: Rules, now: float) -> None:
    """Tasks end that were due until `now`, but for those due after the deadline."""
    now = min(now, w.began + rules.deadline)
    if now >= w.next_end:
        for task in range(w.m):
            if w.t_closed[task] == 0 and w.t_ends[task] <= now:
                w.t_closed[task] = 1
                w.left -= 1
                w.last_end = max(w.last_end, w.t_ends[task])
        plan(w, rules)


@compiled
def touch(w: Memory, rules: Rules, now: float) -> bool:
    """The world lets time pass until `now`; whether the trial is over."""
    close(w, rules, now)
    if w.left == 0 and w.training > 0:
        w.trial_at = look_at(rules, w.last_end + TRIAL_PAUSE)
        w.gives_up_at = INFINITY
    elif w.left == 0 or now >= w.began + rules.deadline:
        w.over = 1
    over: bool = w.over == 1
    return over


@compiled
def act(w: Memory, rules: Rules, robot: int, task: int, now: float) -> None:
    """A body turns to `task`, or to none."""
    if w.r_dead[robot] or touch(w, rules, now):
        return
    _turn_to(w, rules, robot, task, now)
    plan(w, rules)


@compiled
def _turn_to(w: Memory, rules: Rules, robot: int, task: int, now: float) -> None:
    before = w.r_body[robot]
    if before >= 0 and w.t_closed[before] == 0:
        settle_crew(w, rules, before, now)
        w.r_body[robot] = -1
        renew_crew(w, rules, before, now)
    w.r_body[robot] = task
    w.r_stuck[robot] = 0
    w.r_turn[robot] = INFINITY
    w.r_done[robot] = 0.0
    if task < 0 or w.t_closed[task]:
        return
    w.r_body[robot] = -1
    settle_crew(w, rules, task, now)
    w.r_body[robot] = task
    at = task * w.width + w.place[robot * TASKS + task]
    if w.training == 0:
        w.r_turn[robot] = now + w.p_trap_at[at] * w.p_own[at]
    renew_crew(w, rules, task, now)


@compiled
def turn(w: Memory, rules: Rules, robot: int, now: float) -> None:
    """A body gets stuck, which touches the world, or comes free, which does not."""
    task = w.r_body[robot]
    freed = w.r_stuck[robot] == 1
    w.r_turn[robot] = INFINITY
    if freed:
        close(w, rules, now)
    elif touch(w, rules, now):
        return
    if w.t_closed[task]:
        return
    settle_crew(w, rules, task, now)
    w.r_stuck[robot] = not freed
    if not freed:
        w.r_turn[robot] = now + w.p_trap_lasts[task * w.width + w.place[robot * TASKS + task]]
    renew_crew(w, rules, task, now)
    plan(w, rules)


@compiled
def leave(w: Memory, rules: Rules, robot: int, now: float) -> None:
    """The world learns that a robot is gone."""
    if touch(w, rules, now):
        return
    _turn_to(w, rules, robot, -1, now)
    plan(w, rules)


@compiled
def publish(w: Memory, rules: Rules) -> None:
    """One look of the world server."""
    if w.now >= w.trial_at:
        w.began = w.last_end + TRIAL_PAUSE
        w.trial_at = INFINITY
        soon(w, w.now + rules.delay, TRIAL, 0)
        return
    if touch(w, rules, w.now):
        return
    for task in range(w.m):
        if w.t_closed[task] and w.t_published[task] == 0:
            w.t_published[task] = 1
            soon(w, w.now + rules.delay, SENSE, task)
    plan(w, rules)
    if w.look <= w.now:
        w.look = w.now + rules.world_step


@compiled
def die(w: Memory, rules: Rules, robot: int) -> None:
    """A process ends; the world sees it a little later."""
    soon(w, w.now + rules.delay, GONE, robot)
