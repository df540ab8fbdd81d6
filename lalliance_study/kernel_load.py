"""How the kernel's memory is filled: a mission, and the beginning of each of its trials.

A mission is loaded as it stands when the world has told all robots, at once, that its first trial begins. They have made a
few steps before that, in which they only announced that they are there.
"""

import math

from lalliance_study.compiled import Memory, compiled, inlined
from lalliance_study.kernel_explore import draw
from lalliance_study.kernel_hearing import beat_until, next_beat, refresh, wake_by
from lalliance_study.kernel_state import INFINITY, NEVER, NOTHING, ROBOTS, SAMPLES, TASKS, Rules
from lalliance_study.kernel_world import look_at, plan
from lalliance_study.scenarios import Missions


@compiled
def _load_robots(w: Memory, rules: Rules, missions: Missions, number: int) -> None:
    for robot in range(w.n):
        w.r_first[robot] = missions.phase[number, robot] * rules.step
        w.r_life[robot] = missions.life[number, robot]
        w.r_chance[robot] = missions.chance[number, robot]
        w.r_drawn[robot] = 0
        w.r_mates[robot] = 0
        w.r_sets[robot] = 0
        w.r_stale[robot] = 1
        w.r_longest[robot] = 0.0
        w.r_dies[robot] = INFINITY
        for other in range(w.n):
            w.k_met[robot * ROBOTS + other] = 0
        for task in range(w.m):
            w.place[robot * TASKS + task] = -1
        # Its first step of all announces, and then it does so every period.
        w.r_beat[robot] = -1
        w.r_due[robot] = 0.0
        if w.r_first[robot] <= w.born:
            w.r_beat[robot] = 0
            w.r_due[robot] = rules.period


@compiled
def _load_tasks(w: Memory, missions: Missions, number: int) -> None:
    for task in range(w.m):
        count = 0
        for place in range(w.width):
            robot = missions.able[number, task, place]
            if robot < 0:
                break
            count += 1
            at = task * w.width + place
            w.p_able[at] = robot
            w.p_stale[at] = 1
            w.p_task[at] = task
            w.p_mine[at] = place
            w.p_own[at] = missions.own[number, task, place]
            w.p_draw[at] = missions.draw[number, task, place]
            w.p_trap_at[at] = missions.trap_at[number, task, place]
            w.p_trap_lasts[at] = missions.trap_lasts[number, task, place]
            w.place[robot * TASKS + task] = place
            w.set_task[robot * TASKS + w.r_sets[robot]] = task
            w.r_sets[robot] += 1
        w.t_able_count[task] = count


@inlined
def _alike(w: Memory, one: int, other: int, samples: int) -> bool:
    same = True
    for index in range(samples):
        same = same and w.samples[one * SAMPLES + index] == w.samples[other * SAMPLES + index]
    return same


@compiled
def _load_knowledge(w: Memory, rules: Rules, missions: Missions, number: int) -> None:
    """Samples of the width x width pairs of a task: the last mu."""
    for task in range(w.m):
        samples = min(missions.known.shape[4], rules.trials)
        first = missions.known.shape[4] - samples
        count = w.t_able_count[task]
        for place in range(count):
            like = -1  # who was given the same samples
            for mine in range(count):
                hearer = w.p_able[task * w.width + mine]
                pair = (task * w.width + mine) * w.width + place
                w.q_at[pair] = task * w.width + mine
                w.q_speaker[pair] = w.p_able[task * w.width + place]
                w.q_time[pair] = math.nan
                w.q_measured[pair] = 0.0
                w.q_floor[pair] = 0.0
                w.q_floor_left[pair] = 0
                for index in range(samples):
                    w.samples[pair * SAMPLES + index] = missions.known[number, task, mine, place, first + index]
                w.q_count[pair] = samples
                if like >= 0 and _alike(w, like, pair, samples):
                    w.q_time[pair], w.q_measured[pair] = w.q_time[like], w.q_measured[like]
                else:
                    like = pair
                    refresh(w, hearer, pair)


@compiled
def _find_mates(w: Memory) -> None:
    """Who shares a task with whom, in ascending order."""
    for task in range(w.m):
        for mine in range(w.t_able_count[task]):
            for place in range(w.t_able_count[task]):
                if mine != place:
                    robot, mate = w.p_able[task * w.width + mine], w.p_able[task * w.width + place]
                    w.k_met[robot * ROBOTS + mate] = 1
    for robot in range(w.n):
        for mate in range(w.n):
            if w.k_met[robot * ROBOTS + mate]:
                w.k_met[robot * ROBOTS + mate] = 0
                w.mate[robot * ROBOTS + w.r_mates[robot]] = mate
                w.r_mates[robot] += 1


@compiled
def _begin_robot(w: Memory, rules: Rules, robot: int) -> None:
    """Mind._begin_trial, and a body at rest."""
    w.r_active[robot] = -1
    w.r_crowd[robot] = 0
    w.r_idle_since[robot] = w.born
    w.r_contended[robot] = 0
    w.r_stirred[robot] = 1
    w.r_waiting[robot] = rules.beats
    w.r_dead[robot] = w.r_sets[robot] == 0
    w.r_met[robot] = 0
    w.r_open[robot] = w.r_sets[robot]
    w.r_settle_at[robot] = INFINITY
    w.r_saying[robot] = NOTHING
    w.r_quiet[robot] = 1
    w.r_heard[robot] = NOTHING
    w.r_flying[robot] = 0
    w.r_said_since[robot] = 0.0
    w.r_body[robot] = -1
    w.r_stuck[robot] = 0
    w.r_turn[robot] = INFINITY
    w.r_done[robot] = 0.0
    w.r_wake[robot] = NEVER
    w.r_idle_step[robot] = NEVER
    for index in range(w.r_mates[robot]):
        couple = robot * ROBOTS + w.mate[robot * ROBOTS + index]
        w.k_live[couple] = 0
        w.k_met[couple] = 0
        w.k_last[couple] = -INFINITY
        w.k_attempt[couple] = -1
    if w.r_dead[robot]:
        return
    if w.r_beat[robot] >= 0:
        beat_until(w, rules, robot, w.born)
    if rules.beats:
        w.r_idle_step[robot] = next_beat(w, rules, robot) if w.r_beat[robot] >= 0 else 0
    wake_by(w, rules, robot, w.born)


@compiled
def _begin_task(w: Memory, task: int) -> None:
    w.t_share[task] = 0.0
    w.t_rate[task] = 0.0
    w.t_share_at[task] = w.began
    w.t_ends[task] = INFINITY
    w.t_closed[task] = 0
    w.t_published[task] = 0
    for at in range(task * w.width, task * w.width + w.t_able_count[task]):
        w.p_base[at] = 0.0
        w.p_since[at] = w.born
        w.p_growth[at] = 0.0
        w.p_complete[at] = 0
        w.p_active[at] = 0
        w.p_earlier[at] = 0
        w.p_leavers[at] = 0
        for pair in range(at * w.width, (at + 1) * w.width):
            w.q_met_on[pair] = 0
            w.q_trying[pair] = 0
            w.q_a_left[pair] = INFINITY


@compiled
def begin_trial(w: Memory, rules: Rules) -> None:
    """All robots are told, now, that a trial has begun."""
    w.born = w.now
    w.left = w.m
    w.exploring = w.training > 0 and rules.learns
    w.trial_at = INFINITY
    w.gives_up_at = look_at(rules, w.began + rules.deadline)
    if w.gives_up_at < w.began + rules.deadline:
        w.gives_up_at += rules.world_step
    for task in range(w.m):
        _begin_task(w, task)
    for robot in range(w.n):
        _begin_robot(w, rules, robot)
    plan(w, rules)


@compiled
def next_trial(w: Memory, rules: Rules) -> None:
    """The trial after the first, or one after it; what is counted is counted anew."""
    w.training -= 1
    w.sent = w.activations = w.takeovers = 0
    for robot in range(w.n):
        for index in range(w.r_sets[robot]):
            task = w.set_task[robot * TASKS + index]
            w.p_draw[task * w.width + w.place[robot * TASKS + task]] = draw(w, robot)
    begin_trial(w, rules)


@compiled
def load(w: Memory, rules: Rules, missions: Missions, number: int) -> None:
    """Prepare a mission as it stands when its first trial begins."""
    w.n, w.m, w.width = missions.phase.shape[1], missions.able.shape[1], missions.able.shape[2]
    w.began = look_at(rules, rules.delay)
    w.born = w.began + rules.delay
    w.now = w.born
    w.training = rules.training
    w.over = 0
    w.last_end = 0.0
    w.soon_head = w.soon_tail = w.acts_head = w.acts_tail = 0
    w.sent = w.activations = w.takeovers = w.lines = 0
    # Each array of `missions` is counted whenever it is handed on, by all threads: that is done once for each part.
    _load_robots(w, rules, missions, number)
    _load_tasks(w, missions, number)
    _load_knowledge(w, rules, missions, number)
    _find_mates(w)
    begin_trial(w, rules)
